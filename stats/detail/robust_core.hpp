// The iterations, covariances and tests of robustMean() (stats/robust_mean.hpp), which see the data as residuals alone:
// compiled once in liestat::means, inline without it.
#pragma once

#include <lie/concepts.hpp>
#include <lie/units.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

namespace liestat {

enum class RobustLoss {
  huber,  ///< quadratic up to RobustOptions::huber scales, then linear
  median  ///< the distance itself
};

/// Options of robustMean().
struct RobustOptions {
  /// The probability that normal noise stays within the quadratic part of Huber's loss: that of 1.345 standard
  /// deviations on a line, which has 95 % of the mean's efficiency there and more in several dimensions.
  double quadratic = 0.8214;
  /// Outliers that lie on one side by chance with a lower probability make the status inconsistent.
  double shift_level = 0.05;
  double outlier_level = 0.05;  ///< family-wise, of the outliers that are named
  int max_iterations = 500;
};

/// A measurement that normal noise of the others' scatter does not explain.
struct RobustOutlier {
  std::size_t index = 0;  ///< among the measurements
  TangentPart part = TangentPart::point;
  double distance = 0;  ///< from the mean, rad or m
  double p = 1;         ///< the probability of such a one among all measurements (Bonferroni)
};

namespace detail {

inline constexpr double infinite_radius = std::numeric_limits<double>::infinity();
/// Fewer measurements cannot tell outliers on one side from noise.
inline constexpr std::size_t least_robust_count = 20;

/// Data about a centre that moves.
struct RobustData {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  std::vector<TangentBlock> parts;  ///< of the metric, three coordinates each at most
  std::size_t n = 0;
  int dimension = 0;
  double precision = 0;  ///< of the coordinates

  virtual ~RobustData() = default;
  /// The same data about exp(centre, v).
  virtual std::unique_ptr<RobustData> at(const Vector& v) const = 0;
  virtual void move(const Vector& v) = 0;
  /// log(centre, the other's centre).
  virtual Vector to(const RobustData& other) const = 0;
  /// In columns the residuals of every stride-th datum about exp(centre, v), in the axes of the centre.
  virtual void residuals(const Vector& v, std::size_t stride, Matrix& z) const = 0;
  virtual double injectivityRadius(TangentPart part) const = 0;
};

/// The result of robustCentre(), which leaves the data at the centre.
struct RobustCentre {
  Status status = Status::not_converged;
  const char* reason = "";
  int iterations = 0;
  double residual = 0, tolerance = 0, cost = 0;
  std::vector<double> scales;
  Eigen::MatrixXd covariance;
  std::vector<RobustOutlier> outliers;
  Eigen::VectorXd shift, rival;
  double shift_p = 1, rival_z = 0;
  const char* proof = "";
};

RobustCentre robustCentre(RobustData& data, RobustLoss loss, const RobustOptions& options);

}  // namespace detail
}  // namespace liestat

#ifndef LIESTAT_COMPILED_MEANS
#include <stats/detail/robust_core_definitions.hpp>
#endif
