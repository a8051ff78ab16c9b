// The dependence of a mean's measurements on time (stats/time_dependence.hpp), and its covariance with it.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/mean_summary.hpp>
#include <stats/time_dependence.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The number of independent errors whose scatter is known as well as that of n errors with the correlation factor F of
/// their mean: 2 n/(F + 1/F), exact where errors fade by the same factor from row to row.
inline double rowsInEffect(double n, double factor) { return 2 * n / (factor + 1 / factor); }

/// Tests rows of k whitened errors, their columns the whitened axes of the tangent space. `inflate`: widens the
/// covariance, with the measurements in effect for its law, and withholds it where they are less than three times the
/// dimensions: the scatter of fewer says nothing of errors that hold on for so long (docs/which_mean.md).
template <int K>
void setDependence(MeanSummary& mean, std::vector<TimedRow<K, K>> rows, bool inflate) {
  using Matrix = Eigen::Matrix<double, K, K>;
  constexpr double min_rows_per_dimension = 3, min_rows = 6;
  Matrix information = Matrix::Zero();
  for (const auto& row : rows) information += row.columns().transpose() * row.columns();
  const Cholesky<double, K> normal(information);
  if (!normal.ok()) return;
  const Matrix plain = normal.template solve<K>(Matrix(Matrix::Identity()));
  const double n = static_cast<double>(rows.size());
  const TimedCovariance<K> timed = timedCovariance<K, K>(std::move(rows), plain, mean.known_noise);
  mean.dependence = timed.dependence;
  mean.inflated = inflate && timed.dependence.tested;
  const double factor = timed.dependence.correlation_factor;
  if (!mean.inflated || !(factor > 1)) return;
  const double in_effect = rowsInEffect(n, factor);
  if (in_effect < std::max(min_rows, min_rows_per_dimension * K)) {
    mean.covariance.resize(0, 0);
    mean.covariance_factor.fill(std::numeric_limits<double>::quiet_NaN());
    mean.status = mean.covariance_status = Status::not_applicable;
    mean.reason = "errors hold on for so long that the rows are worth " + significant(in_effect, 2) +
                  " independent ones: too few for a covariance";
    return;
  }
  // Both covariances are of the same errors to first order: what the one gains the other does, in its own axes.
  const Cholesky<double, K> first(plain), own(Matrix(mean.covariance));
  if (!first.ok() || !own.ok()) return;
  const Matrix left = first.template halfSolve<K>(timed.covariance);
  const Matrix gain = first.template halfSolve<K>(Matrix(left.transpose()));
  const Matrix covariance = congruence(own.lower(), Matrix(0.5 * (gain + gain.transpose())));
  mean.covariance = 0.5 * (covariance + covariance.transpose());
  if (mean.covariance_factor.size() > 0) mean.covariance_factor = Cholesky<double, K>(Matrix(mean.covariance)).lower();
  if (!mean.known_noise) mean.law_n = std::min(mean.law_n, in_effect);
}

}  // namespace liestat::detail
