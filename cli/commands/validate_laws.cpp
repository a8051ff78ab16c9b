#include <cli/commands/validation_command.hpp>
#include <experiments/laws_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <memory>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

template <std::size_t k>
std::string rateOf(const LawRow& row) {
  return row.rates[k].of > 0 ? fmt::format("{:.1f}", row.rates[k].percent()) : "";
}

const Columns<LawRow> columns{{"law", [](const LawRow& row) { return name(row.law); }},
                              {"kappa", &LawRow::kappa},
                              {"n", &LawRow::n},
                              {"trials", &LawRow::trials},
                              {"ok", rateOf<0>},
                              {"outside", rateOf<1>},
                              {"largest", rateOf<2>},
                              {"least", rateOf<3>},
                              {"refuted", rateOf<4>},
                              {"symmetry", rateOf<5>},
                              {"verdict", [](const LawRow& row) { return verdictCell(answerOf(row)); }}};

ValidationView viewOf(const std::vector<LawRow>& rows) {
  return {.title = "Laws: do the regions hold, and do the tests have their level?",
          .introduction =
              "Each trial draws features of a law and fits it. At most 7 % of all may be ok with the location outside "
              "of the region. Where half are ok at most 7 % of these may have the true "
              "location outside of the 95 % region, and 93 % must have the largest kappa, and the least, within "
              "1.96 standard deviations; at most one right law of a thousand may be refuted.",
          .judgement = judgementOfRates(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head =
              "Fits of true laws, per cent: ok; of these the location outside of the region,\n"
              "the largest and the least kappa in their intervals; refuted by the goodness\n"
              "of fit; symmetry rejected at 5 %\n\n",
          .tables = {{.table = tablesOf(columns, rows)}}};
}

}  // namespace

void addValidateLawsCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<LawsValidation>>();
  const Command app = validate.add("laws", "Laws of directions, axes, headings and rotations: do their regions hold?");
  declareNames(app, "--law", options->names, all_law_models,
               "vmf, von-mises, bingham, matrix-fisher, wrapped-normal: a comma list (default: all)");
  app.option("--kappa", options->validation.kappas, "Concentrations, a comma list (default 5,50, with --full 1,2,5,50)")
      .list()
      .range(1e-2, 1e12);
  app.option("--n", options->validation.sizes, "Features, a comma list (default 20, with --full 10,20,50)")
      .list()
      .range(std::size_t{10}, std::size_t{100000});
  app.flag("--full", options->run.full, "400 trials a row, of more concentrations and of 10, 20 and 50 features");
  options->run.declare(app, "40, with --full 400; of wrapped-normal a quarter");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    LawsValidation validation = given.validation;
    validation.laws = chosen(all_law_models, given.names);
    if (given.run.full) {
      if (validation.sizes == LawsValidation{}.sizes) validation.sizes = {10, 20, 50};
      if (validation.kappas == LawsValidation{}.kappas) validation.kappas = {1, 2, 5, 50};
    }
    validation.run = given.run.size(validation.run.trials, 400);
    return validateLaws(validation, progress);
  };
  runValidation(app, options, "validate laws", compute, viewOf);
}

}  // namespace liestat::cli
