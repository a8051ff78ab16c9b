// Members shared by the models of two-view motion: estimating the parameter under the constraints of each model.
#pragma once

#include <fusion/two_view/detail/two_view_constraints.hpp>
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

/// Matches of which the parameter fits so much by itself (ConstrainedEstimator::leverage) take no part. A wrong match
/// that lies on its epipolar line by chance has often a parallax that no other one has: it agrees with all others, and
/// moves the estimate by many of its standard deviations. Where all matches are few, three times their mean is the
/// bound.
inline constexpr double max_leverage = 0.5;

/// The projection estimate, with its curvature if `is_final`; `finish` takes the parameter that was found into the
/// result.
template <class Q, class Constraint, class Equation, class Finish>
ModelEstimate<TwoViewMotionModel> estimateTwoView(const Q& start, const Constraint& constraint,
                                                  std::span<const Eigen::Vector4d> inliers, const MatchNoise& noise,
                                                  const StopRequest& stop, bool is_final, const Finish& finish) {
  using Noise = DiagonalNoise<4>;
  using Channel = MeasurementChannel<Eigen::Vector4d, Noise, Equation>;
  const Noise sigma(Eigen::Vector4d(noise.first, noise.first, noise.second, noise.second));
  ConstrainedOptions<Q> options;
  options.max_iterations = is_final ? 100 : 20;
  options.tolerance = 1e-4;              // standard deviations
  options.curvature = is_final;          // residuals are small: the search needs none
  options.noise = StatedNoise::trusted;  // models are compared by their χ²
  Channel matches{{inliers.begin(), inliers.end()}, {sigma}, {Equation{}}};
  ConstrainedResult<Q> found;
  bool rests_on_few = false;
  for (int pass = 0; pass < 4; ++pass) {
    ConstrainedEstimator<Q, Constraint, Channel> estimator(start, constraint, options, matches);
    while (estimator.iterate()) {
      if (stop && stop()) estimator.stop();
    }
    const ConstrainedResult<Q>& next = estimator.result();
    const bool ended = next.ok() || next.end == ConstrainedEnd::curved;
    rests_on_few = pass > 0 && !ended;
    if (rests_on_few && !is_final) break;
    found = next;
    if (!ended) break;
    const double mean = static_cast<double>(found.free_parameters) / found.equations;
    Channel vouched_for{{}, {sigma}, {Equation{}}};
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (estimator.leverage(i) > std::max(max_leverage, 3 * mean)) continue;
      vouched_for.measurements.push_back(matches.measurements[i]);
    }
    rests_on_few = vouched_for.size() < matches.size();
    if (!rests_on_few) break;
    matches.measurements = std::move(vouched_for.measurements);
  }
  ModelEstimate<TwoViewMotionModel> result;
  result.status = found.status();
  // A covariance that holds by such matches alone is none.
  if (is_final && rests_on_few) result.status = Status::ill_defined;
  finish(found.parameter, result.parameter);
  result.information = found.information;
  result.covariance = found.covariance;
  result.chi2 = found.chi2;
  result.equation_error = found.equation_error;
  result.degrees_of_freedom = found.degrees_of_freedom;
  result.measurements = found.measurements;
  result.relative_curvature = found.relative_curvature;
  return result;
}

/// J C Jᵀ, by plain loops: Eigen's products of run-time sizes take a compiler seconds.
inline Eigen::MatrixXd covarianceThrough(const Eigen::MatrixXd& J, const Eigen::MatrixXd& C) {
  const Eigen::Index m = J.rows(), n = J.cols();
  Eigen::MatrixXd half(m, n), result(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      half(i, j) = 0;
      for (Eigen::Index k = 0; k < n; ++k) half(i, j) += J(i, k) * C(k, j);
    }
    for (Eigen::Index j = 0; j < m; ++j) {
      result(i, j) = 0;
      for (Eigen::Index k = 0; k < n; ++k) result(i, j) += half(i, k) * J(j, k);
    }
  }
  return result;
}

/// Name, parents and dimensions of a model of the lattice.
struct TwoViewModelCard {
  std::string name;
  std::vector<std::string> parents;
  int free_parameters = 0;
  std::size_t sample_size = 0;
};

/// The parts that all models have in common.
class CardModel : public TwoViewModel {
 public:
  CardModel(TwoViewModelCard card, const TwoViewImages& images) : card_(std::move(card)), images_(images) {}
  std::string name() const override { return card_.name; }
  std::vector<std::string> parents() const override { return card_.parents; }
  int freeParameters() const override { return card_.free_parameters; }
  int measurementDimension() const override { return 4; }
  std::size_t sampleSize() const override { return card_.sample_size; }
  ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                    const StopRequest& stop) const override {
    return fit(start, inliers, stop, false);
  }
  ModelEstimate<Parameter> finalEstimate(const Parameter& start, std::span<const Measurement> inliers,
                                         const StopRequest& stop) const override {
    return fit(start, inliers, stop, true);
  }

 protected:
  /// estimate() or finalEstimate().
  virtual ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers,
                                       const StopRequest& stop, bool is_final) const = 0;

  TwoViewModelCard card_;
  TwoViewImages images_;
};

/// The matrices that a closed-form solver finds, as parameters.
using TwoViewSolver = void (*)(std::span<const Eigen::Vector4d>, std::vector<TwoViewMotionModel>&);
template <auto solver>
void addSolutions(std::span<const Eigen::Vector4d> sample, std::vector<TwoViewMotionModel>& solutions) {
  for (const Eigen::Matrix3d& M : solver(sample)) solutions.emplace_back().matrix = M;
}

}  // namespace liestat::detail
