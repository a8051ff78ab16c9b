#include <cli/commands/validation_command.hpp>
#include <experiments/groups_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <memory>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

template <std::size_t k>
std::string levelOf(const GroupRow& row) {
  return fmt::format("{:.2f}", row.rates[k].percent());
}

const Columns<GroupRow> columns{{"groups", &GroupRow::groups},
                                {"n", &GroupRow::n},
                                {"trials", &GroupRow::trials},
                                {"means", levelOf<1>},
                                {"if alike", levelOf<2>},
                                {"dispersions", levelOf<3>},
                                {"verdict", [](const GroupRow& row) { return verdictCell(answerOf(row)); }}};

ValidationView viewOf(const std::vector<GroupRow>& rows) {
  return {.title = "Comparisons of groups: do the tests have their level?",
          .introduction =
              "Each trial draws groups of normal features with one mean, the smallest of max(10, 4 d) features. A test "
              "at 5 % rejects equal means in 4 to 6 %; means_if_alike and dispersions are judged where dispersions are "
              "equal, else what they reject is shown. The last row has different means: the powers.",
          .judgement = judgementOfRates(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head = "Rejections at 5 % of groups with one mean, per cent\n\n",
          .tables = {{.table = tablesOf(columns, rows), .width = 110}}};
}

}  // namespace

void addValidateGroupsCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<GroupsValidation>>();
  const Command app = validate.add("groups", "Comparisons of groups: do the tests have their level?");
  app.flag("--full", options->run.full, "10 000 trials a row");
  options->run.declare(app, "1000, with --full 10 000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    return validateGroups({given.run.size(1000, 10000)}, progress);
  };
  runValidation(app, options, "validate groups", compute, viewOf);
}

}  // namespace liestat::cli
