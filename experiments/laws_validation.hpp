#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/rate.hpp>
#include <stats/directional_laws.hpp>

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::experiments {

inline constexpr std::array all_law_models{LawModel::vmf, LawModel::von_mises, LawModel::bingham,
                                           LawModel::matrix_fisher, LawModel::wrapped_normal};

/// A run of `liestat validate laws`: the product of the lists, of rotations from 18 features on.
struct LawsValidation {
  std::vector<LawModel> laws{all_law_models.begin(), all_law_models.end()};
  std::vector<double> kappas{5, 50};
  std::vector<std::size_t> sizes{20};
  RunSize run{.trials = 40};  ///< trials of a row, of the wrapped normal law a quarter
};

/// Fits of simulated features, all κ equal, where sorting biases them most. Rates: ok fits; of these the true location
/// outside of the region, and the largest and the least κ within 1.96 standard deviations; right laws that the goodness of fit refutes,
/// and the rejections at 5 % of the test of symmetry.
struct LawRow {
  LawModel law = LawModel::vmf;
  double kappa = 0;
  std::size_t n = 0, trials = 0;
  std::vector<Rate> rates = {};

  std::string title() const { return fmt::format("{}, kappa {:g}, n = {}", name(law), kappa, n); }
};
template <class V>
void describe(V& v, const LawRow& row) {
  v("law", name(row.law))("kappa", row.kappa, "all of them")("n", row.n, "features")("trials", row.trials);
  v("rates", row.rates);
}

std::vector<LawRow> validateLaws(const LawsValidation& validation, const RunProgress& progress = {});

}  // namespace liestat::experiments
