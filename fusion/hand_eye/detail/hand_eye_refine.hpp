// Refinement of a hand-eye calibration: Gauss–Newton steps on Σ eᵀ S⁻¹ e along the directions that the motions determine,
// then the projection estimator of stats/constrained.hpp with the other directions held.
#pragma once

#include <fusion/hand_eye/detail/hand_eye_problem.hpp>
#include <fusion/hand_eye/detail/hand_eye_starts.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace liestat::detail {

/// The step of X and Y along the directions v_first … v_5 of an excitation.
inline std::pair<Vector6, Vector6> handEyeStep(const HandEyeSums& sums, const HandEyeExcitation& excitation, int first,
                                               bool world) {
  Matrix6 L = sums.yy;
  Vector6 g = sums.y;
  Matrix6 by_y = Matrix6::Zero();
  Vector6 constant = Vector6::Zero();
  if (world) {
    const Cholesky<double, 6> xx(sums.xx);
    by_y = -xx.solve<6>(sums.xy);
    constant = -xx.solve<1>(sums.x);
    L += product(sums.xy.transpose(), by_y);
    g += product(sums.xy.transpose(), constant);
  }
  Matrix6 reduced = product(excitation.vectors.transpose(), product(L, excitation.vectors));
  Vector6 right = -product(excitation.vectors.transpose(), g);
  for (int k = 0; k < first; ++k) {
    reduced.row(k).setZero(), reduced.col(k).setZero();
    reduced(k, k) = 1, right[k] = 0;
  }
  const Vector6 y = product(excitation.vectors, Cholesky<double, 6>(reduced).solve<1>(right));
  return {world ? Vector6(constant + product(by_y, y)) : y, y};
}

inline HandEyeValue moved(const HandEyeValue& at, const std::pair<Vector6, Vector6>& step, bool world) {
  HandEyeValue there{at.X * SE3d::exp(step.first), at.Y * SE3d::exp(step.second)};
  there.X.normalize(), there.Y.normalize();
  if (!world) there.Y = there.X;
  return there;
}

/// The number of directions below the trusted excitation.
inline int openDirections(const HandEyeExcitation& excitation, double trusted) {
  int open = 0;
  while (open < 6 && !(excitation.values[open] >= trusted)) ++open;
  return open;
}

struct HandEyeFit {
  HandEyeValue value;
  double cost = std::numeric_limits<double>::infinity();
  bool converged = false;
};

/// How a descent went.
struct HandEyeDescent {
  int open = 6;        ///< directions below the trusted excitation where it ended
  bool freed = false;  ///< there were fewer on the way: X moved along one that is open
};

/// Gauss–Newton with halved steps along the directions of at least an excitation. S follows the value, so it ends at a
/// thousandth of a standard deviation, which is far inside of what the strict estimate starts from.
template <class Indices>
HandEyeDescent descendHandEye(HandEyeFit& fit, const std::vector<PosePair>& pairs, const Indices& indices, bool world,
                              double trusted, int iterations) {
  HandEyeDescent descent;
  HandEyeExcitation excitation;
  int fewest = 6;
  for (int k = 0; k < iterations; ++k) {
    const HandEyeSums sums = handEyeSums(fit.value, pairs, indices, world);
    // Where all directions are excited any basis serves.
    if (k < 2 || descent.open > 0) excitation = handEyeExcitation(fit.value, pairs, indices, world);
    fit.cost = sums.cost;
    descent.open = openDirections(excitation, trusted);
    fewest = std::min(fewest, descent.open);
    descent.freed = fewest < descent.open;
    const std::pair<Vector6, Vector6> step = handEyeStep(sums, excitation, descent.open, world);
    const double squared = -sums.y.dot(step.second) - (world ? sums.x.dot(step.first) : 0);
    if (!std::isfinite(squared)) return descent;
    std::pair<Vector6, Vector6> shortened = step;
    bool better = false;
    for (int halving = 0; halving < 8 && !better; ++halving) {
      const HandEyeValue there = moved(fit.value, shortened, world);
      const double cost = handEyeCost(there, pairs, indices);
      better = cost < fit.cost;
      if (better) fit.value = there, fit.cost = cost;
      shortened.first *= 0.5, shortened.second *= 0.5;
    }
    fit.converged = squared < 1e-6 || !better;
    if (fit.converged) break;
  }
  return descent;
}

/// The excitation below which a direction is looked at twice.
inline constexpr double doubtful_excitation = 1000;

/// The minimum of Σ eᵀ S⁻¹ e that a start leads to. Excitations mean something at the minimum alone: far from it, or where
/// X has run metres along a direction that is open, residuals look like motion. So directions of little excitation wait
/// until the others have settled, from translations that are short along them, and are judged there. `factor` is that by
/// which the variances of the poses are larger than given.
template <class Indices>
HandEyeFit refineHandEye(HandEyeFit fit, const std::vector<PosePair>& pairs, const Indices& indices, bool world,
                         double trusted, int iterations = 30, double factor = 1) {
  const double doubtful = factor * std::max(trusted, doubtful_excitation);
  if (descendHandEye(fit, pairs, indices, world, doubtful, iterations).open == 0) return fit;
  const HandEyeMoments moments(pairs, indices, world);
  for (int round = 0; round < 5; ++round) {
    fit.value = withTranslations(fit.value.X.so3(), fit.value.Y.so3(), moments, pairs, indices, world);
    if (!descendHandEye(fit, pairs, indices, world, doubtful, iterations).freed) break;
  }
  descendHandEye(fit, pairs, indices, world, factor * trusted, iterations);
  return fit;
}

/// Directions of Y (of X for AX = XB) that stay where they are: rows·Log(reference⁻¹ Y) = 0. Rows of zeros are none.
template <class Equation>
struct HeldDirections {
  using Parameter = typename Equation::Parameter;
  static constexpr int N = ManifoldTraits<Parameter>::DoF;
  SE3d reference;
  Matrix6 rows = Matrix6::Zero();

  Vector6 operator()(const Parameter& q) const {
    return product(rows, (reference.inverse() * Equation::value(q).Y).log());
  }
  ConstraintDerivatives<6, N> linearize(const Parameter& q) const {
    const Vector6 y = (reference.inverse() * Equation::value(q).Y).log();
    ConstraintDerivatives<6, N> d;
    d.value = product(rows, y);
    d.by_parameter.setZero();
    d.by_parameter.template rightCols<6>() = product(rows, SE3d::rightJacobianInverse(y));
    return d;
  }
};

/// The strict estimate from the pairs of an index list. The first `open` directions of the excitation are held.
template <class Equation, class Indices>
ConstrainedResult<typename Equation::Parameter> strictHandEye(const HandEyeValue& start,
                                                              const std::vector<PosePair>& pairs,
                                                              const Indices& indices,
                                                              const HandEyeExcitation& excitation, int open) {
  MeasurementChannel<typename Equation::Measurement, PosePairNoise, Equation> channel{{}, {}, {Equation{}}};
  channel.measurements.reserve(indices.size()), channel.noises.reserve(indices.size());
  for (const std::size_t i : indices) {
    channel.measurements.emplace_back(pairs[i].a.mean, pairs[i].b.mean);
    channel.noises.emplace_back(pairs[i].a.covariance, pairs[i].b.covariance);
  }
  HeldDirections<Equation> held{start.Y};
  for (int k = 0; k < open; ++k)
    held.rows.row(k) = product(excitation.metric, Vector6(excitation.vectors.col(k))).transpose();
  // It starts within a fraction of a standard deviation of the end.
  ConstrainedOptions<typename Equation::Parameter> options;
  options.max_iterations = 30;
  options.second_order = false;
  options.noise = StatedNoise::trusted;  // the calibration has a verdict of its own
  return constrainedEstimate(Equation::parameter(start), channel, held, options);
}

}  // namespace liestat::detail
