// What the models of two-view motion have in common: nine entries of a matrix as parameter, under the constraints of each
// model, and the estimate of it.
#pragma once

#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/models.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/essential.hpp>
#include <lie/rn.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The entries of a 3×3 matrix, column after column.
using Entries = Eigen::Matrix<double, 9, 1>;

inline Entries entriesFrom(const Eigen::Matrix3d& M) { return Eigen::Map<const Entries>(M.data()); }
inline Eigen::Matrix3d matrixFrom(const Entries& entries) { return Eigen::Map<const Eigen::Matrix3d>(entries.data()); }
/// Where entry (row, column) is.
constexpr int entry(int row, int column) { return 3 * column + row; }

/// Up to P constraints on the entries; rows that are not used stay zero.
template <int P>
using EntryConstraints = ConstraintDerivatives<P, 9>;

/// Constraints that are written one after the other.
template <int P>
class ConstraintRows {
 public:
  explicit ConstraintRows(const Entries& q) : q_(q) { rows_.value.setZero(), rows_.by_parameter.setZero(); }
  /// a·q[i] + b·q[j] = c.
  void linear(int i, double a, int j, double b, double c) {
    rows_.value[next_] = a * q_[i] + b * q_[j] - c;
    rows_.by_parameter(next_, i) += a;
    rows_.by_parameter(next_, j) += b;
    ++next_;
  }
  void fixed(int i, double value) { linear(i, 1, i, 0, value); }
  void equal(int i, int j) { linear(i, 1, j, -1, 0); }
  void opposite(int i, int j) { linear(i, 1, j, 1, 0); }
  /// Any other, with its derivatives.
  void add(double value, const Eigen::Matrix<double, 1, 9>& by_entries) {
    rows_.value[next_] = value;
    rows_.by_parameter.row(next_++) = by_entries;
  }
  void norm(double squared) { add(q_.squaredNorm() - squared, 2 * q_.transpose()); }
  const EntryConstraints<P>& rows() const { return rows_; }

 private:
  Entries q_;
  EntryConstraints<P> rows_;
  int next_ = 0;
};

/// Matches of which the parameter fits so much by itself (ConstrainedEstimator::leverage) take no part. A wrong match that
/// lies on its epipolar line by chance has often a parallax that no other one has: it agrees with all others, and moves
/// the estimate by many of its standard deviations. Where all matches are few, three times their mean is the bound.
inline constexpr double most_leverage = 0.5;

/// The projection estimate; `finish` takes the parameter that was found into the result.
template <class Q, class Constraint, class Equation, class Finish>
ModelEstimate<TwoViewMotionModel> estimateTwoView(const Q& start, const Constraint& constraint,
                                                  std::span<const Eigen::Vector4d> inliers, const MatchNoise& noise,
                                                  const StopRequest& stop, const Finish& finish) {
  using Noise = DiagonalNoise<4>;
  using Channel = MeasurementChannel<Eigen::Vector4d, Noise, Equation>;
  const Noise sigma(Eigen::Vector4d(noise.first, noise.first, noise.second, noise.second));
  ConstrainedOptions<Q> options;
  options.max_iterations = 20;
  options.tolerance = 1e-4;   // standard deviations
  options.curvature = false;  // residuals are small
  Channel matches{{inliers.begin(), inliers.end()}, {sigma}, {Equation{}}};
  ConstrainedResult<Q> found;
  for (int pass = 0; pass < 4; ++pass) {
    ConstrainedEstimator<Q, Constraint, Channel> estimator(start, constraint, options, matches);
    while (estimator.iterate()) {
      if (stop && stop()) estimator.stop();
    }
    const ConstrainedResult<Q>& next = estimator.result();
    if (pass > 0 && !next.ok()) break;
    found = next;
    if (!found.ok()) break;
    const double mean = static_cast<double>(found.free_parameters) / found.equations;
    Channel vouched_for{{}, {sigma}, {Equation{}}};
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (estimator.leverage(i) > std::max(most_leverage, 3 * mean)) continue;
      vouched_for.measurements.push_back(matches.measurements[i]);
    }
    if (vouched_for.size() == matches.size()) break;
    matches.measurements = std::move(vouched_for.measurements);
  }
  ModelEstimate<TwoViewMotionModel> result;
  result.status = found.status();
  finish(found.parameter, result.parameter);
  result.information = found.information;
  result.covariance = found.covariance;
  result.chi2 = found.chi2;
  result.equation_error = found.equation_error;
  result.degrees_of_freedom = found.degrees_of_freedom;
  result.measurements = found.measurements;
  return result;
}

/// What each model of the lattice says of itself.
struct TwoViewModelCard {
  std::string name;
  std::vector<std::string> parents;
  int free_parameters = 0;
  std::size_t sample_size = 0;
};

}  // namespace liestat::detail
