#include <cli/show/diagnosis.hpp>

#include <formats/text.hpp>
#include <report/table.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
namespace {

std::string optionOf(const Convention& c) { return conventionName(c, false); }

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

std::string planInWords(const std::vector<PlanRow>& plan) {
  std::string text = "What this file can decide, from its poses and matrices alone:\n\n";
  Table table({"if the truth is", "nearest other", "nats per pose", "poses needed", "equal to"});
  for (const PlanRow& row : plan) {
    std::vector<std::string> equal;
    for (const Convention& c : row.equal) equal.push_back(optionOf(c));
    table.row({optionOf(row.convention), row.poses > 0 ? optionOf(row.nearest) : "none", number(row.divergence, 3),
               row.poses > 0 ? number(row.poses, 6) : "none", joined(equal, " ")});
  }
  return text + table.str() +
         "\nequal to: conventions that write the same matrices here; no number of poses decides between them\n";
}

}  // namespace

std::string formatDiagnosis(const DiagnosisOutput& output) {
  const CovarianceDiagnosis& r = output.result;
  std::string text = r.mode == DiagnosisMode::plan ? planInWords(r.plan)
                                                   : r.verdict().text + "\n" + acceptedInWords(r.accepted()) + "\n";
  text += fmt::format("{}: {} {}{}\n", joined(output.files, ", "), r.structure.n, r.what,
                      output.reference.empty() ? "" : ", truth " + output.reference);
  for (const std::string& note : r.file_notes) text += note + "\n";
  if (!r.diagnosis) {
    for (const std::string& line : r.structure.words()) text += line + "\n";
    if (r.chain) text += chainInWords(*r.chain);
    return text;
  }
  const ConventionDiagnosis& d = *r.diagnosis;
  if (d.skipped > 0) text += fmt::format("{} {} without a usable matrix\n", d.skipped, r.what);
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

}  // namespace liestat::cli
