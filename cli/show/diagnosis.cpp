#include <cli/show/diagnosis.hpp>

#include <cli/commands/command_line.hpp>
#include <cli/io/text.hpp>
#include <cli/show/table.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
namespace {

std::string optionOf(const Convention& c) { return conventionName(c, false); }

std::vector<std::string> namesOfConventions(const std::vector<Convention>& list) {
  std::vector<std::string> names;
  for (const Convention& c : list) names.push_back(optionOf(c));
  return names;
}

std::string acceptedInWords(const std::vector<Convention>& accepted) {
  constexpr std::size_t most = 12;
  std::string text;
  for (std::size_t k = 0; k < std::min(most, accepted.size()); ++k) {
    text += fmt::format("  --cov-from {}: {}\n", optionOf(accepted[k]), describe(accepted[k]));
  }
  if (accepted.size() > most) text += fmt::format("  and {} more\n", accepted.size() - most);
  return text;
}

std::string testsInWords(const WhitenedResidualTests& tests) {
  Table table({"test", "statistic", "expected", "p", ""});
  const auto all = tests.all();
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto kind = static_cast<ResidualTestKind>(k);
    if (!all[k].applies()) continue;
    const double expected = kind == ResidualTestKind::lag ? 0 : all[k].dof;
    table.row(
        {name(kind), number(all[k].statistic), number(expected), number(all[k].p, 2), all[k].fires() ? "fires" : ""});
  }
  return table.str();
}

std::string chainInWords(const ChainDiagnosis& c) {
  std::string text =
      fmt::format("chain condition, {} steps: share of steps in which the covariance shrinks\n", c.steps);
  for (std::size_t k = 0; k < std::min<std::size_t>(5, c.fits.size()); ++k) {
    text += fmt::format("  {:.3f}  {}\n", c.fits[k].indefinite, optionOf(c.fits[k].convention));
  }
  if (c.increments.applies()) {
    text += fmt::format("  NEES of the increments is {} of its expectation (p {})\n", number(c.increments.ratio(), 3),
                        number(c.increments.p, 2));
  }
  return text;
}

std::string planInWords(const DiagnosisOutput& output) {
  std::string text = "What this file can decide, from its poses and matrices alone:\n\n";
  Table table({"if the truth is", "nearest other", "nats per pose", "poses needed", "equal to"});
  for (const PlanRow& row : output.plan) {
    table.row({optionOf(row.convention), row.poses > 0 ? optionOf(row.nearest) : "none", number(row.divergence, 3),
               row.poses > 0 ? number(row.poses, 6) : "none", joined(namesOfConventions(row.equal), " ")});
  }
  return text + table.str() +
         "\nequal to: conventions that write the same matrices here; no number of poses decides between them\n";
}

}  // namespace

std::string verdictOf(const DiagnosisOutput& output) {
  if (output.diagnosis) {
    const ConventionDiagnosis& d = *output.diagnosis;
    std::string word = name(d.verdict);
    if (d.verdict != DiagnosisVerdict::identified) {
      std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::toupper(c); });
    }
    return fmt::format("{}: {}", word, d.reason);
  }
  if (!output.chain) return {};
  const ChainDiagnosis& c = *output.chain;
  if (!c.is_chain) return fmt::format("UNDECIDABLE: {}", c.reason);
  if (c.accepted.size() == 1) return fmt::format("identified: {}", describe(c.accepted.front()));
  return fmt::format("UNDECIDABLE: {}", c.reason);
}

int exitCodeOf(const DiagnosisOutput& output) {
  if (output.mode == "plan") return exit_fine;
  if (output.diagnosis) {
    switch (output.diagnosis->verdict) {
      case DiagnosisVerdict::identified:
        return exit_fine;
      case DiagnosisVerdict::undecidable:
        return exit_undecidable;
      default:
        return exit_inconsistent;
    }
  }
  return output.chain->is_chain && output.chain->accepted.size() == 1 ? exit_fine : exit_undecidable;
}

std::string formatDiagnosis(const DiagnosisOutput& output) {
  std::string text;
  if (output.mode == "plan") {
    text = planInWords(output);
  } else {
    text = verdictOf(output) + "\n";
    const std::vector<Convention>& accepted = output.diagnosis ? output.diagnosis->accepted : output.chain->accepted;
    text += acceptedInWords(accepted);
    text += "\n";
  }
  text += fmt::format("{}: {} {}{}\n", joined(output.files, ", "), output.structure.n, output.what,
                      output.reference.empty() ? "" : ", truth " + output.reference);
  for (const std::string& note : output.notes) text += note + "\n";
  if (!output.diagnosis) {
    for (const std::string& line : output.structure.words()) text += line + "\n";
    if (output.chain) text += chainInWords(*output.chain);
    return text;
  }
  const ConventionDiagnosis& d = *output.diagnosis;
  if (d.skipped > 0) text += fmt::format("{} {} without a usable matrix\n", d.skipped, output.what);
  for (const std::string& note : d.notes) text += note + "\n";
  if (d.correlated) {
    text +=
        fmt::format("neighbouring errors are correlated (lag test {}): no hypothesis is ranked on absolute errors\n",
                    number(d.tests.lag.statistic, 3));
    if (std::isfinite(d.growth))
      text += fmt::format("NEES of the second half over the first: {}\n", number(d.growth, 3));
  }
  if (!d.fits.empty()) {
    text += fmt::format("\nhypotheses, in nats below the best one (margin {})\n", number(d.margin, 3));
    Table table({"nats", "NEES/dof", "convention", "fault"});
    for (std::size_t k = 0; k < std::min<std::size_t>(6, d.fits.size()); ++k) {
      const HypothesisFit& f = d.fits[k];
      if (std::isinf(f.log_likelihood)) break;
      table.row({number(0 - f.log_likelihood, 4), number(f.nees_ratio, 3), optionOf(f.convention),
                 f.fault == MatrixFault::none ? "" : name(f.fault)});
    }
    text += table.str();
  }
  if (!d.correlated || d.increments_as_absolute) text += "\n" + testsInWords(d.tests);
  if (d.scale) {
    text += "\nscales of the blocks, free: ";
    text += fmt::format("translation {}, rotation {} (variances, +- {:.0f} %)\n", number(d.scale->translation, 3),
                        number(d.scale->rotation, 3), 100 * d.scale->relative_sigma);
  }
  if (d.chain) text += "\n" + chainInWords(*d.chain);
  return text;
}

void setDiagnosis(JsonObject& object, const DiagnosisOutput& output) {
  object.set("mode", output.mode).set("files", output.files);
  object.set("reference", output.reference.empty() ? std::nullopt : std::optional(output.reference));
  object.set("what", output.what).set("n", output.structure.n).set("structure", output.structure.words());
  object.set("indefinite", output.structure.indefinite).set("file_notes", output.notes);
  const auto chainJson = [](const ChainDiagnosis& c) {
    JsonObject o;
    std::vector<JsonObject> fits;
    for (const ChainFit& f : c.fits) {
      JsonObject row;
      fits.push_back(row.set("convention", optionOf(f.convention)).set("indefinite", f.indefinite));
    }
    o.set("steps", c.steps).set("is_chain", c.is_chain).set("accepted", namesOfConventions(c.accepted));
    o.set("reason", c.reason).set("increments_nees", c.increments.ratio()).set("increments_p", c.increments.p);
    return o.set("fits", fits);
  };
  if (output.chain) object.set("chain", chainJson(*output.chain));
  if (output.diagnosis) {
    const ConventionDiagnosis& d = *output.diagnosis;
    object.set("verdict", name(d.verdict)).set("reason", d.reason).set("notes", d.notes);
    object.set("accepted", namesOfConventions(d.accepted)).set("fault", name(d.fault));
    object.set("skipped", d.skipped).set("margin", d.margin).set("correlated", d.correlated);
    object.set("exact_coordinates", d.exact_coordinates).set("increments_as_absolute", d.increments_as_absolute);
    object.set("growth", d.growth);
    JsonObject tests;
    const auto all = d.tests.all();
    for (std::size_t k = 0; k < all.size(); ++k) {
      JsonObject t;
      t.set("statistic", all[k].statistic).set("degrees_of_freedom", all[k].dof).set("p", all[k].p);
      tests.set(name(static_cast<ResidualTestKind>(k)), t);
    }
    object.set("tests", tests);
    if (d.scale) {
      JsonObject s;
      s.set("convention", optionOf(d.scale->convention)).set("translation", d.scale->translation);
      s.set("rotation", d.scale->rotation).set("relative_sigma", d.scale->relative_sigma);
      object.set("scale", s.set("words", d.scale->words()));
    } else {
      object.set("scale", nullptr);
    }
    if (d.chain) object.set("chain", chainJson(*d.chain));
    std::vector<JsonObject> fits;
    for (const HypothesisFit& f : d.fits) {
      JsonObject row;
      row.set("convention", optionOf(f.convention)).set("fault", name(f.fault)).set("log_likelihood", f.log_likelihood);
      fits.push_back(row.set("nees_ratio", f.nees_ratio).set("indefinite", f.indefinite));
    }
    object.set("hypotheses", fits);
  }
  std::vector<JsonObject> plan;
  for (const PlanRow& row : output.plan) {
    JsonObject o;
    o.set("convention", optionOf(row.convention)).set("nearest", optionOf(row.nearest));
    o.set("divergence", row.divergence).set("poses", row.poses);
    plan.push_back(o.set("equal", namesOfConventions(row.equal)));
  }
  if (output.mode == "plan") object.set("plan", plan);
}

}  // namespace liestat::cli
