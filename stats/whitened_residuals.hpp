// Seven tests of pose errors against their covariances: does each error ξ_i follow N(0, Σ_i), independently of the
// others? (Needs Boost.Math, Debian: libboost-dev.)
//
//   joint, position, rotation   NEES: sums of squared Mahalanobis distances against χ², two-sided; see the scale
//   mean                        n |z̄|² against χ²₆: sees a bias
//   covariance                  likelihood ratio of S = Σ z zᵀ / n against I: sees correlations and shapes that NEES misses
//   tail                        number of errors beyond the 0.999 quantile: sees outliers and heavy tails
//   lag                         correlation of neighbours: sees errors that are not independent
//
// z_i = L_i⁻¹ ξ_i with Σ_i = L_i L_iᵀ. The lag test is valid under wrong covariances as well, because it whitens z by its
// own second moment; where it fires none of the others is a verdict, for they presuppose independent errors. Power and
// false alarms: docs/theory/trajectories.md, section 4.
//
//   std::vector<liestat::PoseResidual> residuals;  // {Log(T_estimated⁻¹ T_true), covariance} in order of time
//   const auto tests = liestat::testWhitenedResiduals(residuals);
//   if (tests.lag.fires()) …                       // correlated errors
//   else if (tests.anyFires()) …                   // tests.joint.p, …
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/noise_fit.hpp>
#include <stats/laws.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// An error of a pose, ξ = Log(T_estimated⁻¹ T_true), and the covariance that it is said to have: translation (m) before
/// rotation (rad), in the body's axes.
struct PoseResidual {
  Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Identity();
};

/// The level below which a test fires by default. Any of the seven fires falsely in less than one case in a hundred.
inline constexpr double residual_test_level = refutation_level;

/// The outcome of one test. NaN where it does not apply (too few residuals, or a covariance that is not positive definite).
struct ResidualTest {
  double statistic = detail::not_a_number;
  double dof = detail::not_a_number;  ///< degrees of freedom of χ²; expected number for the tail, NaN for the lag test
  double p = detail::not_a_number;    ///< probability of a statistic at least as extreme, two-sided for NEES and lag

  bool applies() const { return p == p; }
  bool fires(double level = residual_test_level) const { return p < level; }
  /// NEES over its expectation: 1 where the covariance has the right scale.
  double ratio() const { return statistic / dof; }
};
template <class V>
void describe(V& v, const ResidualTest& t) {
  v("statistic", t.statistic)("degrees_of_freedom", t.dof)("ratio", t.ratio(), "1 is expected");
  v("p", t.p, "probability of a statistic as extreme, if the covariances are right");
}

/// The interval below and above which NEES lies with a probability of `tail` each if the covariances are right.
struct NeesInterval {
  double low = detail::not_a_number, high = low;
};
inline NeesInterval neesInterval(double dof, double tail = 0.025) {
  return {chiSquaredQuantile(tail, dof), chiSquaredThreshold(tail, dof)};
}

/// The names of the tests, in the order of WhitenedResidualTests::all().
enum class ResidualTestKind { joint, position, rotation, mean, covariance, tail, lag };

constexpr auto words(ResidualTestKind) {
  return std::array{"joint_nees", "position_nees", "rotation_nees", "mean", "covariance", "tail", "lag"};
}

/// The likely cause where a test fires, in words. `too_large`: the statistic is above its expectation.
inline const char* cause(ResidualTestKind kind, bool too_large) {
  switch (kind) {
    case ResidualTestKind::joint:
      return too_large ? "errors are larger than the covariances say: overconfident, or another convention"
                       : "errors are smaller than the covariances say: inflated, or another convention";
    case ResidualTestKind::position:
      return too_large ? "position errors are larger than their block says"
                       : "position errors are smaller than their block says";
    case ResidualTestKind::rotation:
      return too_large ? "rotation errors are larger than their block says: half angles, degrees, or overconfident"
                       : "rotation errors are smaller than their block says: double angles, or inflated";
    case ResidualTestKind::mean:
      return "a bias: the mean error is not zero (an extrinsic offset, a lag of the clock, gravity, scale)";
    case ResidualTestKind::covariance:
      return "the shape is wrong: cross terms dropped or swapped, other axes, blocks of the wrong scale";
    case ResidualTestKind::tail:
      return "outliers or heavy tails: wrong loop closures, wrong associations";
    case ResidualTestKind::lag:
      return too_large ? "errors are correlated in time: drift, smoothing, or a filter between fixes"
                       : "neighbouring errors alternate in sign";
  }
  return "";
}

/// Degrees of freedom that parameters fitted to the same residuals have taken, of all six components and of the two parts.
struct FittedDof {
  double joint = 0, position = 0, rotation = 0;
};

/// The seven tests of one set of residuals.
struct WhitenedResidualTests {
  std::size_t n = 0;
  std::size_t indefinite = 0;  ///< covariances that are not positive definite: any of them leaves all tests NaN
  ResidualTest joint, position, rotation, mean, covariance, tail, lag;
  /// Mean and second moment of the whitened residuals; 0 and I are expected.
  Eigen::Matrix<double, 6, 1> whitened_mean = Eigen::Matrix<double, 6, 1>::Constant(detail::not_a_number);
  Eigen::Matrix<double, 6, 6> whitened_second_moment = Eigen::Matrix<double, 6, 6>::Constant(detail::not_a_number);

  std::array<ResidualTest, 7> all() const { return {joint, position, rotation, mean, covariance, tail, lag}; }
  bool anyFires(double level = residual_test_level) const {
    const auto tests = all();
    return std::any_of(tests.begin(), tests.end(), [level](const ResidualTest& t) { return t.fires(level); });
  }
  /// No test fires, and those of NEES apply.
  bool consistent(double level = residual_test_level) const { return joint.applies() && !anyFires(level); }
  /// The tests that fire, each with its likely cause.
  std::vector<std::string> causes() const {
    std::vector<std::string> list;
    for (std::size_t k = 0; k < all().size(); ++k) {
      const ResidualTest test = all()[k];
      if (!test.fires()) continue;
      const auto kind = static_cast<ResidualTestKind>(k);
      const bool large = kind == ResidualTestKind::lag ? test.statistic > 0 : test.ratio() > 1;
      list.push_back(std::string(name(kind)) + ": " + cause(kind, large) + " (p " + significant(test.p, 2) + ")");
    }
    return list;
  }
};
template <class V>
void describe(V& v, const WhitenedResidualTests& tests) {
  for (std::size_t k = 0; k < tests.all().size(); ++k) v(name(static_cast<ResidualTestKind>(k)), tests.all()[k]);
}

namespace detail {

/// The smaller tail of χ², doubled; for a non-integral number of degrees of freedom too.
inline double chiSquaredTwoSided(double statistic, double dof) {
  if (!(dof > 0)) return not_a_number;
  return std::min(1., 2 * std::min(chiSquaredCdf(statistic, dof), chiSquaredSurvival(statistic, dof)));
}
inline ResidualTest neesTest(double statistic, double dof) {
  return {statistic, dof, chiSquaredTwoSided(statistic, dof)};
}

/// The lag test of vectors in order: those whitened by their own second moment are compared with their neighbours. NaN
/// for fewer than ten, or where the second moment is singular.
inline ResidualTest lagTest(std::span<const Eigen::Matrix<double, 6, 1>> z, const Eigen::Matrix<double, 6, 6>& moment) {
  ResidualTest test;
  if (z.size() < 10) return test;
  const Cholesky<double, 6> root(moment);
  double sum = 0;
  Eigen::Matrix<double, 6, 1> before = root.halfSolve<1>(z[0]);
  for (std::size_t i = 1; i < z.size(); ++i) {
    const Eigen::Matrix<double, 6, 1> y = root.halfSolve<1>(z[i]);
    sum += before.dot(y);
    before = y;
  }
  test.statistic = sum / std::sqrt(6. * static_cast<double>(z.size() - 1));
  test.p = chiSquaredSurvival(test.statistic * test.statistic, 1);
  return test;
}

/// The number of residuals from which on Bartlett's factor keeps the level of the likelihood ratio.
inline constexpr std::size_t min_for_covariance_test = 15;

}  // namespace detail

/// The seven tests of residuals in order of time; O(n). Tests that need more residuals than there are, are NaN: the lag
/// test needs 10, the one of the covariance 15. `fitted`: see FittedDof; for mean, covariance and tail an alignment should be
/// taken off the covariances instead (PoseErrorCovariance in fusion/trajectories.hpp).
/// Sources: Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", section 5.4 (NEES);
/// Anderson, "An introduction to multivariate statistical analysis", section 10.8 (likelihood ratio, Bartlett's factor).
inline WhitenedResidualTests testWhitenedResiduals(std::span<const PoseResidual> residuals,
                                                   const FittedDof& fitted = {}) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Matrix3 = Eigen::Matrix3d;
  WhitenedResidualTests tests;
  tests.n = residuals.size();
  if (tests.n == 0) return tests;
  const auto n = static_cast<double>(tests.n);
  const double gate = chiSquaredThreshold(1e-3, 6);
  std::vector<Vector6> z(tests.n);
  Vector6 sum = Vector6::Zero();
  Matrix6 moment = Matrix6::Zero();
  double joint = 0, position = 0, rotation = 0;
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < tests.n; ++i) {
    const PoseResidual& r = residuals[i];
    const detail::Cholesky<double, 6> root(r.covariance);
    // The leading block of the factor is that of the position; the rotation's needs a factor of its own.
    const detail::Cholesky<double, 3> rotation_root(Matrix3(r.covariance.bottomRightCorner<3, 3>()));
    if (!root.ok() || !rotation_root.ok()) {
      ++tests.indefinite;
      continue;
    }
    z[i] = root.halfSolve<1>(r.error);
    const double squared = z[i].squaredNorm();
    joint += squared;
    position += z[i].head<3>().squaredNorm();
    rotation += rotation_root.halfSolve<1>(Eigen::Vector3d(r.error.tail<3>())).squaredNorm();
    beyond += squared > gate;
    sum += z[i];
    for (int k = 0; k < 6; ++k) {
      for (int l = 0; l <= k; ++l) moment(k, l) += z[i][k] * z[i][l];
    }
  }
  if (tests.indefinite > 0) return tests;
  for (int k = 0; k < 6; ++k) {
    for (int l = 0; l <= k; ++l) moment(l, k) = moment(k, l) /= n;
  }
  tests.whitened_mean = sum / n;
  tests.whitened_second_moment = moment;
  tests.joint = detail::neesTest(joint, 6 * n - fitted.joint);
  tests.position = detail::neesTest(position, 3 * n - fitted.position);
  tests.rotation = detail::neesTest(rotation, 3 * n - fitted.rotation);
  const double mean = n * tests.whitened_mean.squaredNorm();
  tests.mean = {mean, 6, chiSquaredSurvival(mean, 6)};
  if (tests.n >= detail::min_for_covariance_test) {
    const detail::Cholesky<double, 6> root(moment);
    const double bartlett = 1 - (13 - 2. / 7) / (6 * n);
    const double ratio = root.ok() ? n * (moment.trace() - root.logDeterminant() - 6) * bartlett : detail::infinity;
    tests.covariance = {ratio, 21, ratio == ratio ? chiSquaredSurvival(std::max(0., ratio), 21) : ratio};
  }
  tests.tail = {static_cast<double>(beyond), 1e-3 * n, binomialSurvival(beyond, tests.n, 1e-3)};
  tests.lag = detail::lagTest(z, moment);
  return tests;
}

}  // namespace liestat
