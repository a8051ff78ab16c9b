#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/two_view_validation.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* short_names[] = {"none", "rtrans", "zoom", "rdisp", "rot", "homog", "trans", "ess", "fund"};
static_assert(std::size(short_names) == default_two_view_motions.size());

std::vector<std::string> choiceHeaders() {
  std::vector<std::string> headers{"truth"};
  headers.insert(headers.end(), std::begin(short_names), std::end(short_names));
  return headers;
}
std::string percent(std::size_t count, const TwoViewChoice& choice) {
  return fmt::format("{:.1f}", 100 * static_cast<double>(count) / static_cast<double>(choice.trials));
}
/// Shares of the chosen models in per cent.
std::vector<std::string> choiceCells(const TwoViewChoice& choice) {
  std::vector<std::string> cells{short_names[static_cast<std::size_t>(choice.truth)]};
  for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) cells.push_back(percent(choice.chosen[m], choice));
  return cells;
}
const std::vector<std::string> optional_headers{"truth", "chosen, %", "others, %"};
/// The share of the optional model of a motion, and what was chosen instead of it.
std::vector<std::string> optionalCells(const TwoViewChoice& choice) {
  std::string others;
  for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) {
    if (choice.chosen[m] == 0) continue;
    others += fmt::format("{}{} {}", others.empty() ? "" : ", ", short_names[m], percent(choice.chosen[m], choice));
  }
  return {nameOf(choice.truth), percent(choice.right(), choice), others};
}
const std::vector<std::string> distance_headers{"model", "k", "index", "SE", "95 % covers", "K-S p", "verdict"};
std::vector<std::string> distanceCells(const TwoViewRow& row) {
  const ValidationReport& r = row.report;
  return {name(row.motion),
          fmt::format("{}", r.dof),
          number(r.index),
          number(r.index_se, 2),
          number(100 * r.coverage[2].observed),
          number(r.ks_p_value, 2),
          verdictCell(row.passed)};
}

}  // namespace

ValidationView viewOf(const TwoViewValidationResult& result) {
  const double average = 100 * result.average();
  ValidationTable nine{.title = "Models that were chosen, %",
                       .headers = choiceHeaders(),
                       .below = fmt::format("mean of the diagonal: {:.1f} %\n", average),
                       .page_title = "Models that were chosen",
                       .page_caption = fmt::format("Per cent of the trials; mean of the diagonal {:.1f} %.", average)};
  ValidationTable optional{.title = "Optional models, each beside the default lattice",
                           .headers = optional_headers,
                           .page_title = "",
                           .page_caption = "Optional models, each beside the default lattice."};
  for (const TwoViewChoice& choice : result.choices) {
    if (choice.optional()) {
      optional.rows.push_back(optionalCells(choice));
    } else {
      nine.rows.push_back(choiceCells(choice));
    }
  }
  if (nine.rows.empty()) optional.page_title = nine.page_title;
  ValidationTable distances{.title = "Squared distance of the truth from the true model's estimate; index k expected",
                            .headers = distance_headers,
                            .page_title = "Distances of the truth"};
  Plot histograms{
      .name = "distances", .caption = "Squared distances with the density that they should have.", .columns = 4};
  for (const TwoViewRow& row : result.rows) {
    distances.rows.push_back(distanceCells(row));
    histograms.panels.push_back(histogramPanel(row, name(row.motion)));
  }
  distances.plots = {std::move(histograms)};
  return {.title = "Two-view motion: is the right model chosen, and is its covariance true?",
          .introduction =
              "Each trial moves a camera by one motion, takes matches with noise and outliers, and runs the hierarchy "
              "of models over them. The table has the models that were chosen. For the true model's estimate the "
              "squared Mahalanobis distance of the true parameter follows a chi-square law if the covariance is true; "
              "its mean, the index, is then the number k of free parameters.",
          .judgement = judgementOf(result),
          .fields = [&result](JsonObject& object) { object.fieldsOf(result); },
          .tables = {std::move(nine), std::move(optional), std::move(distances)}};
}

}  // namespace liestat::cli
