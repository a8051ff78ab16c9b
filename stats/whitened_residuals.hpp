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

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/noise_components.hpp>
#include <stats/noise_fit.hpp>
#include <stats/laws.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
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

/// Parameters that all residuals share, such as those of an alignment: with the error δ of the parameters the residuals are
/// e_i = ξ_i - J_i δ, ξ_i independent. Whitened one by one they would be correlated by δ.
struct SharedParameters {
  using Jacobian = Eigen::Matrix<double, 6, 7>;
  using Information = Eigen::Matrix<double, 7, 7>;

  std::vector<Jacobian> jacobians =
      {};  ///< one for each residual, zeros for fixed parameters; empty: nothing is shared
  /// The information of an estimate from data that are not among the residuals. Without it the parameters were estimated from
  /// these residuals, of which they make the sum of squares the smallest.
  std::optional<Information> prior = {};
};

/// The seven tests of one set of residuals.
struct WhitenedResidualTests {
  std::size_t n = 0;
  std::size_t indefinite = 0;       ///< covariances that are not positive definite: any of them leaves all tests NaN
  NoiseComponents components = {};  ///< that were tested
  ResidualTest joint, position, rotation, mean, covariance, tail, lag;
  /// Overconfidence that no dependence of the errors explains: the NEES that a fifth of the residuals exceed. With the k-th
  /// smallest p of n single residuals, k = n/5, the probability of p₍k₎ ≤ α k/n is at most α whatever their dependence
  /// (Rüger, "Das maximale Signifikanzniveau des Tests: Lehne H₀ ab, wenn k unter n gegebenen Tests zur Ablehnung führen",
  /// Metrika 25, 1978). Shared parameters are fitted to the residuals first, which makes NEES smaller only.
  ResidualTest gross;
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
  v("gross", tests.gross, "NEES that a fifth of the poses exceed; p holds whatever the dependence of the errors");
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

/// The lag test of vectors in order, with zeros in components that are not judged: those whitened by their own second
/// moment are compared with their neighbours. `expected`: of the sum of products, for independent errors. NaN for fewer than
/// ten vectors, or where the second moment is singular.
inline ResidualTest lagTest(std::span<const Eigen::Matrix<double, 6, 1>> z, const Eigen::Matrix<double, 6, 6>& moment,
                            int components, double expected) {
  ResidualTest test;
  if (z.size() < 10) return test;
  const Cholesky<double, 6> root(moment);
  double sum = -expected;
  Eigen::Matrix<double, 6, 1> before = root.halfSolve<1>(z[0]);
  for (std::size_t i = 1; i < z.size(); ++i) {
    const Eigen::Matrix<double, 6, 1> y = root.halfSolve<1>(z[i]);
    sum += before.dot(y);
    before = y;
  }
  test.statistic = sum / std::sqrt(components * static_cast<double>(z.size() - 1));
  test.p = chiSquaredSurvival(test.statistic * test.statistic, 1);
  return test;
}

/// The number of residuals from which on Bartlett's factor keeps the level of the likelihood ratio.
inline constexpr std::size_t min_for_covariance_test = 15;

/// The inverse of an information matrix on the directions that it determines, and their number. Parameters whose
/// diagonal is zero are fixed. Directions below `least` of the largest, in units of the diagonal, are not determined.
struct DeterminedInverse {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;

  Matrix7 inverse = Matrix7::Zero();
  double log_determinant = 0;  ///< of the information in these directions
  int rank = 0;

  DeterminedInverse(const Matrix7& information, double least) {
    Eigen::Matrix<double, 7, 1> unit;
    for (int k = 0; k < 7; ++k) {
      unit[k] = information(k, k) > 0 ? 1 / std::sqrt(information(k, k)) : 0;
      if (unit[k] > 0) log_determinant -= 2 * std::log(unit[k]);
    }
    const SymmetricEigen eigen(Matrix7(unit.asDiagonal() * information * unit.asDiagonal()));
    for (int k = 0; k < 7; ++k) {
      if (!(eigen.values[k] > least * eigen.values[6])) continue;
      const Eigen::Matrix<double, 7, 1> v = unit.asDiagonal() * eigen.vectors.col(k);
      inverse += v * v.transpose() / eigen.values[k];
      log_determinant += std::log(eigen.values[k]);
      ++rank;
    }
  }
};

/// Where all six components are judged, the caller has seen that all parameters are determined.
inline double leastDetermined(const NoiseComponents& components) { return components.omits() ? 1e-10 : 1e-13; }

/// A sum of squares of whitened residuals of some components, and what the shared parameters do to it.
struct SharedSquares {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  using Vector7 = Eigen::Matrix<double, 7, 1>;

  double squares = 0;
  Matrix7 information = Matrix7::Zero();
  Vector7 gradient = Vector7::Zero();

  template <int N>
  void add(const Eigen::Matrix<double, N, 1>& z) {
    squares += z.squaredNorm();
  }
  template <int N>
  void add(const Eigen::Matrix<double, N, 1>& z, const Eigen::Matrix<double, N, 7>& columns) {
    add<N>(z);
    for (int j = 0; j < 7; ++j) {
      for (int i = 0; i <= j; ++i) {
        double sum = 0;
        for (int k = 0; k < N; ++k) sum += columns(k, i) * columns(k, j);
        information(i, j) += sum;
        if (i < j) information(j, i) += sum;
      }
      double sum = 0;
      for (int k = 0; k < N; ++k) sum += columns(k, j) * z[k];
      gradient[j] += sum;
    }
  }
  /// Under a prior: Woodbury's identity, exact.
  ResidualTest underPrior(double dof, const Matrix7& prior, double least) const {
    return neesTest(squares - gradient.dot(DeterminedInverse(prior + information, least).inverse * gradient), dof);
  }
  /// Of one part, with parameters of covariance C fitted to all: χ² of the exact mean and variance.
  ResidualTest fitted(double dof, const Matrix7& C) const {
    const Matrix7 taken = C * information;
    const double mean = dof - taken.trace(), half_variance = mean - taken.trace() + (taken * taken).trace();
    if (!(mean > 0) || !(half_variance > 1e-9 * mean)) return {};
    const double unit = half_variance / mean;
    return neesTest(squares / unit, mean / unit);
  }
};

/// (I + V Vᵀ)^-½ = I - V f Vᵀ for the columns V = B C^½ of shared parameters of covariance C: the returned K = C^½ f C^½ᵀ
/// makes I - B K Bᵀ of it. The symmetric root is the whitening that changes the residuals the least.
inline Eigen::Matrix<double, 7, 7> jointWhitening(const Eigen::Matrix<double, 7, 7>& C,
                                                  const Eigen::Matrix<double, 7, 7>& information) {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  const SymmetricEigen of_C(C);
  Matrix7 half = of_C.vectors;
  for (int k = 0; k < 7; ++k) half.col(k) *= std::sqrt(std::max(0., of_C.values[k]));
  const SymmetricEigen seen(Matrix7(half.transpose() * information * half));
  Matrix7 f = Matrix7::Zero();
  for (int k = 0; k < 7; ++k) {
    const double d = std::max(0., seen.values[k]), root = std::sqrt(1 + d);
    f(k, k) = 1 / (root * (1 + root));  // (1 - 1/√(1 + d))/d
  }
  const Matrix7 V = half * seen.vectors;
  return V * f * V.transpose();
}

}  // namespace detail

/// The seven tests of residuals in order of time, of the components that carry noise; O(n). Tests that need more residuals
/// than there are, are NaN: the lag test needs 10, the one of the covariance 15. Under shared parameters with a prior the
/// residuals are whitened jointly, so that all tests are those of independent errors. Parameters that were fitted to the
/// residuals leave each pose the covariance Σ_i - J_i C J_iᵀ, which it is whitened by, and take degrees of freedom; mean
/// and lag test allow for the correlation that remains.
/// Sources: Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", section 5.4 (NEES);
/// Anderson, "An introduction to multivariate statistical analysis", section 10.8 (likelihood ratio, Bartlett's factor).
inline WhitenedResidualTests testWhitenedResiduals(std::span<const PoseResidual> residuals,
                                                   const NoiseComponents& components = {},
                                                   const SharedParameters& shared = {}) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Columns = SharedParameters::Jacobian;
  WhitenedResidualTests tests;
  tests.n = residuals.size(), tests.components = components;
  if (tests.n == 0) return tests;
  const auto n = static_cast<double>(tests.n);
  const double least = detail::leastDetermined(components);
  const bool sharing = !shared.jacobians.empty(), fitted = sharing && !shared.prior;
  const int judged = components.count(), of_position = components.count(0, 3), of_rotation = components.count(3, 3);
  std::vector<Vector6> z(tests.n);
  std::vector<Columns> columns(sharing ? tests.n : 0);
  detail::SharedSquares joint, position, rotation;
  for (std::size_t i = 0; i < tests.n; ++i) {
    PoseResidual r = residuals[i];
    components.reduce(r.error, r.covariance);
    const detail::Cholesky<double, 6> root(r.covariance);
    // The leading block of the factor is that of the position; the rotation's needs a factor of its own.
    const detail::Cholesky<double, 3> rotation_root(Eigen::Matrix3d(r.covariance.bottomRightCorner<3, 3>()));
    if (!root.ok() || !rotation_root.ok()) {
      ++tests.indefinite;
      continue;
    }
    z[i] = root.halfSolve<1>(r.error);
    const Eigen::Vector3d turned = rotation_root.halfSolve<1>(Eigen::Vector3d(r.error.tail<3>()));
    if (!sharing) {
      joint.add<6>(z[i]), position.add<3>(z[i].head<3>()), rotation.add<3>(turned);
      continue;
    }
    Columns J = shared.jacobians[i];
    for (int k = 0; k < 6; ++k) {
      if (!components.keeps(k)) J.row(k).setZero();
    }
    columns[i] = root.halfSolve<7>(J);
    joint.add<6>(z[i], columns[i]), position.add<3>(z[i].head<3>(), columns[i].topRows<3>());
    rotation.add<3>(turned, rotation_root.halfSolve<7>(Eigen::Matrix<double, 3, 7>(J.bottomRows<3>())));
  }
  if (tests.indefinite > 0) return tests;
  const detail::DeterminedInverse own(joint.information, least);
  const double taken = fitted ? own.rank : 0, effective = n - taken / judged;
  if (fitted || !sharing) {
    tests.joint = detail::neesTest(joint.squares, judged * n - taken);
    tests.position = position.fitted(of_position * n, own.inverse);
    tests.rotation = rotation.fitted(of_rotation * n, own.inverse);
  } else {
    tests.joint = joint.underPrior(judged * n, *shared.prior, least);
    tests.position = position.underPrior(of_position * n, *shared.prior, least);
    tests.rotation = rotation.underPrior(of_rotation * n, *shared.prior, least);
  }

  const double gate = chiSquaredThreshold(1e-3, judged);
  const Eigen::Matrix<double, 7, 1> best = own.inverse * joint.gradient;
  Eigen::Matrix<double, 7, 1> step = Eigen::Matrix<double, 7, 1>::Zero();
  if (sharing && !fitted) {
    const detail::DeterminedInverse prior(*shared.prior, least);
    step = detail::jointWhitening(prior.inverse, joint.information) * joint.gradient;
  }
  std::vector<double> single(tests.n);
  Vector6 sum = Vector6::Zero();
  Matrix6 moment = Matrix6::Zero(), law_of_sum = n * Matrix6::Identity();
  Columns left_sum = Columns::Zero(), before = Columns::Zero();
  double expected_lag = 0;
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < tests.n; ++i) {
    if (!sharing) {
      single[i] = z[i].squaredNorm();
    } else if (!fitted) {
      single[i] = (z[i] - columns[i] * best).squaredNorm();
      z[i] -= columns[i] * step;
    } else {
      single[i] = z[i].squaredNorm();
      const Columns taken_off = columns[i] * own.inverse;
      const detail::Cholesky<double, 6> left(
          Matrix6(Matrix6::Identity() - detail::productTransposed(taken_off, columns[i])));
      // A direction of the pose that the parameters explain entirely leaves nothing to whiten; rounding decides near it.
      if (left.ok() && taken_off.cwiseProduct(columns[i]).sum() < judged - 1e-6) {
        z[i] = left.halfSolve<1>(z[i]), columns[i] = left.halfSolve<7>(columns[i]);
      }
      const Columns carried = columns[i] * own.inverse;
      law_of_sum += detail::productTransposed(carried, columns[i]);
      if (i > 0) expected_lag -= carried.cwiseProduct(before).sum();
      left_sum += columns[i];
      before = columns[i];
    }
    beyond += z[i].squaredNorm() > gate;
    sum += z[i];
    for (int k = 0; k < 6; ++k) {
      for (int l = 0; l <= k; ++l) moment(k, l) += z[i][k] * z[i][l];
    }
  }
  for (int k = 0; k < 6; ++k) {
    for (int l = 0; l <= k; ++l) moment(l, k) = moment(k, l) /= effective;
  }
  // Ones for what is not judged: no part of traces and determinants.
  for (int k = 0; k < 6; ++k) {
    if (!components.keeps(k)) moment(k, k) = 1, law_of_sum(k, k) = 0;
  }
  tests.whitened_mean = sum / n;
  tests.whitened_second_moment = moment;
  if (fitted) {
    law_of_sum -= detail::productTransposed(Columns(left_sum * own.inverse), left_sum);
    // Directions in which the parameters absorb the mean are not tested: the errors' second order would decide there.
    constexpr double least_share = 0.1;
    const detail::SymmetricEigen law(law_of_sum);
    double squared = 0, directions = 0;
    for (int k = 0; k < 6; ++k) {
      if (law.values[k] <= least_share * n) continue;
      squared += std::pow(law.vectors.col(k).dot(sum), 2) / law.values[k];
      ++directions;
    }
    tests.mean = {squared, directions, chiSquaredSurvival(squared, directions)};
  } else {
    const double mean = sum.squaredNorm() / n;
    tests.mean = {mean, static_cast<double>(judged), chiSquaredSurvival(mean, judged)};
  }
  if (tests.n >= detail::min_for_covariance_test) {
    const detail::Cholesky<double, 6> root(moment);
    const double p = judged, dof = p * (p + 1) / 2, bartlett = 1 - (2 * p + 1 - 2 / (p + 1)) / (6 * effective);
    const double ratio =
        root.ok() ? effective * (moment.trace() - root.logDeterminant() - 6) * bartlett : detail::infinity;
    tests.covariance = {ratio, dof, ratio == ratio ? chiSquaredSurvival(std::max(0., ratio), dof) : ratio};
  }
  tests.tail = {static_cast<double>(beyond), 1e-3 * n, binomialSurvival(beyond, tests.n, 1e-3)};
  tests.lag = detail::lagTest(z, moment, judged, expected_lag);
  const std::size_t fifth = tests.n / 5;
  if (fifth > 0) {
    std::nth_element(single.begin(), single.begin() + static_cast<std::ptrdiff_t>(fifth - 1), single.end(),
                     std::greater<>());
    const double nees = single[fifth - 1], p = chiSquaredSurvival(nees, judged);
    tests.gross = {nees, static_cast<double>(judged), std::min(1., p * n / static_cast<double>(fifth))};
  }
  return tests;
}

}  // namespace liestat
