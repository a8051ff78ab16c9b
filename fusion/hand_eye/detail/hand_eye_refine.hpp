// Refinement of a hand-eye calibration: Gauss–Newton steps on Σ eᵀ S⁻¹ e along the directions that the motions
// determine, then the most likely corrected poses, with the other directions held.
#pragma once

#include <fusion/hand_eye/detail/hand_eye_problem.hpp>
#include <fusion/hand_eye/detail/hand_eye_starts.hpp>

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

/// At most some thousands of a list, evenly: enough for starts to part, and to tell the excitations.
template <class Indices>
std::vector<std::size_t> evenly(const Indices& all) {
  constexpr std::size_t enough = 2000;
  const std::size_t step = all.size() / enough + 1;
  std::vector<std::size_t> some;
  for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

/// Gauss–Newton with halved steps along the directions of at least an excitation. S follows the value, so it ends at a
/// thousandth of a standard deviation, which is far inside of what the strict estimate starts from.
template <class Indices>
HandEyeDescent descendHandEye(HandEyeFit& fit, const PosePairList& pairs, const Indices& indices, bool world,
                              double trusted, int iterations) {
  HandEyeDescent descent;
  HandEyeExcitation excitation;
  const std::vector<std::size_t> some = evenly(indices);
  const bool many = some.size() < indices.size();
  // In squared standard deviations of an estimate from so many pairs.
  const double small = 1e-6 * static_cast<double>(indices.size()) / static_cast<double>(some.size());
  int fewest = 6;
  for (int k = 0; k < iterations; ++k) {
    const HandEyeSums sums = handEyeSums(fit.value, pairs, indices, world);
    // Where all directions are excited any basis serves.
    if (k < 2 || descent.open > 0) excitation = handEyeExcitation(fit.value, pairs, some, world);
    fit.cost = sums.cost;
    descent.open = openDirections(excitation, trusted);
    fewest = std::min(fewest, descent.open);
    descent.freed = fewest < descent.open;
    const std::pair<Vector6, Vector6> step = handEyeStep(sums, excitation, descent.open, world);
    const double squared = -sums.y.dot(step.second) - (world ? sums.x.dot(step.first) : 0);
    if (!std::isfinite(squared)) return descent;
    if (many && squared < small) {
      fit.value = moved(fit.value, step, world);
      fit.converged = true;
      break;
    }
    std::pair<Vector6, Vector6> shortened = step;
    bool better = false;
    // S follows the value; with many pairs it decides within a standard deviation, where no part of the step is better.
    for (int halving = 0; halving < (many && squared < 1 ? 1 : 8) && !better; ++halving) {
      const HandEyeValue there = moved(fit.value, shortened, world);
      const double cost = handEyeCost(there, pairs, indices);
      better = cost < fit.cost;
      if (better) fit.value = there, fit.cost = cost;
      shortened.first *= 0.5, shortened.second *= 0.5;
    }
    fit.converged = squared < small || !better;
    if (fit.converged) break;
  }
  return descent;
}

/// The excitation below which a direction is looked at twice.
inline constexpr double doubtful_excitation = 1000;

/// The minimum of Σ eᵀ S⁻¹ e that a start leads to. Excitations mean something at the minimum alone: far from it, or
/// where X has run metres along a direction that is open, residuals look like motion. So directions of little
/// excitation wait until the others have settled, from translations that are short along them, and are judged there.
/// `factor` is that by which the variances of the poses are larger than given.
template <class Indices>
HandEyeFit refineHandEye(HandEyeFit fit, const PosePairList& pairs, const Indices& indices, bool world, double trusted,
                         int iterations = 30, double factor = 1) {
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

/// The most likely X, Y and corrected poses.
struct StrictHandEye {
  HandEyeValue value;
  /// The errors of X and Y; for AX = XB the block of Y is that of X.
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  double chi2 = 0;  ///< squared distance of the poses from the corrected poses
  bool converged = false;
};

/// The estimate that the projection estimator of stats/constrained.hpp has for these equations, pairs being corrected
/// one by one: errors ε of A and B under c(X, Y, A Exp(ε_a), B Exp(ε_b)) = 0 are ε = -V Dᵀ S⁻¹ (c - D ε), D the
/// derivative at ε itself, S = D V Dᵀ. They are iterated with X and Y, and are all that is kept of a pair from pass to
/// pass. Directions below `open` are held where they are.
template <class Indices>
StrictHandEye strictHandEye(const HandEyeValue& start, const PosePairList& pairs, const Indices& indices, bool world,
                            const HandEyeExcitation& excitation, int open) {
  constexpr int max_iterations = 30, min_iterations = 3, enough_iterations = 8;
  constexpr double small = 1e-20, rounding = 1e-8;  // squared standard deviations
  double before = std::numeric_limits<double>::infinity();
  StrictHandEye result{start};
  std::vector<Eigen::Matrix<double, 12, 1>> errors(indices.size(), Eigen::Matrix<double, 12, 1>::Zero());
  HandEyeSums sums;
  for (int k = 0; k < max_iterations && !result.converged; ++k) {
    sums = {};
    for (std::size_t j = 0; j < indices.size(); ++j) {
      const PosePair pair = pairs[indices[j]];
      const Vector6 a = errors[j].head<6>(), b = errors[j].tail<6>();
      const HandEyeJacobians J(result.value, pair.a.mean * SE3d::exp(a), pair.b.mean * SE3d::exp(b));
      const Matrix6 by_a = product(J.A, SE3d::rightJacobian(a)), by_b = product(J.B, SE3d::rightJacobian(b));
      const Cholesky<double, 6> S = handEyeErrorFactor(by_a, by_b, pair);
      const Vector6 r = J.e - by_a * a - by_b * b;
      sums.add(J, S, r, world);
      const Vector6 multiplier = S.solve<1>(r);
      errors[j].head<6>() = -product(pair.a.covariance, product(by_a.transpose(), multiplier));
      errors[j].tail<6>() = -product(pair.b.covariance, product(by_b.transpose(), multiplier));
    }
    const std::pair<Vector6, Vector6> step = handEyeStep(sums, excitation, open, world);
    const double squared = -sums.y.dot(step.second) - (world ? sums.x.dot(step.first) : 0);
    if (!std::isfinite(squared) || !std::isfinite(sums.cost)) return result;
    result.value = moved(result.value, step, world);
    // Steps shrink by far more than half until rounding makes them.
    const bool rounded = k + 1 >= enough_iterations && squared < rounding && squared > 0.25 * before;
    result.converged = k + 1 >= min_iterations && (squared < small || rounded);
    before = squared;
  }
  result.chi2 = sums.cost;
  // (Zᵀ H Z)⁻¹ of the directions Z that are free, X following Y.
  Matrix6 L = sums.yy, x_by_y = Matrix6::Identity(), own = Matrix6::Zero();
  if (world) {
    const Cholesky<double, 6> xx(sums.xx);
    x_by_y = -xx.solve<6>(sums.xy);
    own = xx.solve<6>(Matrix6(Matrix6::Identity()));
    L += product(sums.xy.transpose(), x_by_y);
  }
  Matrix6 reduced = congruence(excitation.vectors.transpose(), L), axes = excitation.vectors;
  for (int k = 0; k < open; ++k) {
    reduced.row(k).setZero(), reduced.col(k).setZero();
    reduced(k, k) = 1, axes.col(k).setZero();
  }
  const Matrix6 half = Cholesky<double, 6>(reduced).halfSolve<6>(axes.transpose());
  const Matrix6 of_y = product(half.transpose(), half), of_xy = product(x_by_y, of_y);
  const Matrix6 of_x = own + productTransposed(of_xy, x_by_y);
  result.covariance << of_x, of_xy, of_xy.transpose(), of_y;
  result.covariance = (0.5 * (result.covariance + result.covariance.transpose())).eval();
  return result;
}

}  // namespace liestat::detail
