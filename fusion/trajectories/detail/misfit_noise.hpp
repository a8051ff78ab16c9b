// The rows of a fit of misfit, and the noise that whitens them.
#pragma once

#include <Eigen/Core>
#include <lie/detail/small_products.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// Parameters of a fit, in this order: clock, scale, body (6), world (6).
inline constexpr int misfit_parameters = 14;
using MisfitMask = std::array<bool, misfit_parameters>;
/// A residual Log(M⁻¹ T) behind its derivatives by the parameters.
using MisfitRow = Eigen::Matrix<double, 6, misfit_parameters + 1>;
using MisfitVector6 = Eigen::Matrix<double, 6, 1>;
using MisfitMatrix6 = Eigen::Matrix<double, 6, 6>;

/// The noise of rows: a Gauss–Markov process and white noise, translation and rotation with shares and time constants of
/// their own, whose innovations have one covariance. The errors of dead reckoning are those of its steps: `relative` rows
/// are of these, but for the first, which may be off by as much as all steps together.
struct MisfitNoise {
  std::vector<double> gaps = {};
  double gap = 1;  // the median
  bool relative = false;
  std::array<double, 2> share = {0, 0}, time_constant = {1, 1};
  MisfitMatrix6 half = MisfitMatrix6::Identity();  // whitens innovations
  std::vector<double> weights = {};                // of rows; empty: one

  /// Innovations in place of the rows, in units of the process; log det of their variances per channel of each block.
  double unitOf(std::size_t row) const { return std::sqrt(gaps[row] / gap); }
  template <int N>
  std::array<double, 2> innovate(std::vector<Eigen::Matrix<double, 6, N>>& rows) const {
    Eigen::Matrix<double, 6, N> state = Eigen::Matrix<double, 6, N>::Zero();
    std::array<double, 2> P = share, log_det = {0, 0};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (i > 0) {
        for (int b = 0; b < 2; ++b) {
          const auto k = static_cast<std::size_t>(b);
          const double phi = std::exp(-gaps[i] / time_constant[k]);
          state.template middleRows<3>(3 * b) *= phi;
          P[k] = phi * phi * P[k] + share[k] * (1 - phi * phi);
        }
      }
      for (int b = 0; b < 2; ++b) {
        const auto k = static_cast<std::size_t>(b);
        const double F = P[k] + 1 - share[k];
        const Eigen::Matrix<double, 3, N> innovation =
            rows[i].template middleRows<3>(3 * b) - state.template middleRows<3>(3 * b);
        state.template middleRows<3>(3 * b) += P[k] / F * innovation;
        rows[i].template middleRows<3>(3 * b) = innovation / std::sqrt(F);
        log_det[k] += std::log(F);
        P[k] *= 1 - P[k] / F;
      }
    }
    return log_det;
  }
  void whiten(std::vector<MisfitRow>& rows) const {
    innovate(rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i] = product(half, rows[i]);
      if (!weights.empty()) rows[i] *= weights[i];
    }
  }
};

}  // namespace liestat::detail
