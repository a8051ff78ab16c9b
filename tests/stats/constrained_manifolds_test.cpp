// Constrained estimation on manifolds: measurements that are rotations and directions, derivatives by hand, and means
// as a special case.

#include <lie/product.hpp>
#include <lie/s2.hpp>
#include <support/constrained_models.hpp>
#include <support/constrained_reference.hpp>
#include <stats/maha.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

/// The measurement is the parameter: log(q, m) = 0.
struct Same {
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const SO3<S>& q, const SO3<S>& m) const {
    return log(q, m);
  }
};

TEST(ConstrainedManifolds, MeansWithCovariancesAreASpecialCase) {
  CounterRng rng(3);
  std::vector<Gaussian<SO3d>> measured;
  for (int i = 0; i < 12; ++i) {
    Eigen::Matrix3d half;
    for (int k = 0; k < 3; ++k) half.col(k) = 0.15 * rng.normalVector<3>();
    measured.push_back(
        {SO3d::exp(0.3 * rng.normalVector<3>()), half * half.transpose() + 0.003 * Eigen::Matrix3d::Identity()});
  }
  const auto estimate = constrainedEstimate(SO3d(), measurements(measured, autoDiff(Same{})), NoConstraint{},
                                            {.tolerance = 1e-11, .noise = StatedNoise::trusted});
  ASSERT_TRUE(estimate.ok()) << name(estimate.end);
  const auto mean = maha(measured, CovarianceAt::measured, {.refutation_level = 0});
  ASSERT_EQ(mean.status, Status::ok);
  EXPECT_LE(distance(estimate.parameter, mean.mean), 1e-8);
  EXPECT_EQ(estimate.degrees_of_freedom, 3 * 12 - 3);
}

/// A direction before and after a rotation.
using Pair = Product<S2d, S2d>;
/// R a = b: three equations, of which two are independent.
struct Turns {
  static constexpr int rank = 2;
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const SO3<S>& R, const Product<S2<S>, S2<S>>& m) const {
    return R * Eigen::Matrix<S, 3, 1>(m.template get<0>().unit_vector()) - m.template get<1>().unit_vector();
  }
};
/// The same with derivatives by hand.
struct TurnsByHand {
  static constexpr int rank = 2;
  Eigen::Vector3d operator()(const SO3d& R, const Pair& m) const { return Turns{}(R, m); }
  EquationDerivatives<3, 3, 4> linearize(const SO3d& R, const Pair& m) const {
    const auto basis = [](const S2d& x) {
      // Columns: the unit vector's derivatives along the local coordinates.
      const Eigen::Matrix3d placed = ManifoldTraits<S2d>::placement(x).matrix();
      Eigen::Matrix<double, 3, 2> J;
      for (int k = 0; k < 2; ++k) {
        const double h = 1e-6;
        J.col(k) = (exp(x, Eigen::Vector2d(h * Eigen::Vector2d::Unit(k))).unit_vector() -
                    exp(x, Eigen::Vector2d(-h * Eigen::Vector2d::Unit(k))).unit_vector()) /
                   (2 * h);
      }
      EXPECT_LE((placed.transpose() * J).bottomRows<1>().norm(), 1e-9);
      return J;
    };
    const Eigen::Vector3d a = m.get<0>().unit_vector();
    Eigen::Matrix3d cross;
    cross << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
    EquationDerivatives<3, 3, 4> J;
    J.value = (*this)(R, m);
    J.by_parameter = -R.matrix() * cross;
    J.by_measurement << R.matrix() * basis(m.get<0>()), -basis(m.get<1>());
    return J;
  }
};

TEST(ConstrainedManifolds, DirectionsGiveARotationWithItsCovariance) {
  const int trials = 600, n = 8;
  const double sigma = 0.01;
  double chi2 = 0, squares = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(8, static_cast<std::uint64_t>(t));
    const SO3d truth = SO3d::exp(rng.normalVector<3>());
    std::vector<Pair> pairs;
    for (int i = 0; i < n; ++i) {
      const S2d a(rng.normalVector<3>().normalized()), b(truth * a.unit_vector());
      pairs.emplace_back(exp(a, Eigen::Vector2d(sigma * rng.normalVector<2>())),
                         exp(b, Eigen::Vector2d(sigma * rng.normalVector<2>())));
    }
    const SO3d start = exp(truth, Eigen::Vector3d(0.2, -0.1, 0.1));
    const auto r = constrainedEstimate(start, measurements(pairs, IsotropicNoise<4>(sigma), autoDiff(Turns{})),
                                       NoConstraint{}, {.second_order = t < 20, .noise = StatedNoise::trusted});
    ASSERT_TRUE(r.ok()) << t << " " << name(r.end);
    EXPECT_EQ(r.equations, 2 * n);
    EXPECT_EQ(r.dropped_equations, 0);
    EXPECT_EQ(r.degrees_of_freedom, 2 * n - 3);
    if (t < 20) {
      const auto by_hand = constrainedEstimate(start, measurements(pairs, IsotropicNoise<4>(sigma), TurnsByHand{}));
      ASSERT_TRUE(by_hand.ok());
      EXPECT_LE(distance(r.parameter, by_hand.parameter), 1e-7);
      EXPECT_LE((r.covariance - by_hand.covariance).norm(), 1e-6 * r.covariance.norm());
    }
    chi2 += r.chi2;
    squares += mahalanobisSquared(Gaussian<SO3d>{r.parameter, r.covariance}, truth);
  }
  EXPECT_NEAR(chi2 / trials, 13, 4 * std::sqrt(26. / trials));
  EXPECT_NEAR(squares / trials, 3, 4 * std::sqrt(6. / trials));
}

TEST(ConstrainedManifolds, UsesKindsOfMeasurementsTogether) {
  // Rotations measured directly, and directions: the information is the sum.
  CounterRng rng(2);
  const SO3d truth = SO3d::exp(rng.normalVector<3>());
  std::vector<Gaussian<SO3d>> rotations;
  std::vector<Pair> pairs;
  for (int i = 0; i < 5; ++i) {
    rotations.push_back(
        {exp(truth, Eigen::Vector3d(0.02 * rng.normalVector<3>())), 4e-4 * Eigen::Matrix3d::Identity()});
    const S2d a(rng.normalVector<3>().normalized()), b(truth * a.unit_vector());
    pairs.emplace_back(a, exp(b, Eigen::Vector2d(0.01 * rng.normalVector<2>())));
  }
  const auto direct = measurements(rotations, autoDiff(Same{}));
  const auto seen = measurements(pairs, IsotropicNoise<4>(0.01), autoDiff(Turns{}));
  const auto both = constrainedEstimate(truth, std::tuple(direct, seen), NoConstraint{});
  const auto first = constrainedEstimate(truth, direct), second = constrainedEstimate(truth, seen);
  ASSERT_TRUE(both.ok() && first.ok() && second.ok());
  EXPECT_EQ(both.degrees_of_freedom, 15 + 10 - 3);
  EXPECT_LE((both.information - first.information - second.information).norm(), 0.05 * both.information.norm());
  EXPECT_GE(both.chi2, first.chi2 + second.chi2 - 1e-9);
}

// ---------------------------------------------------------------------------------- against blocks of fixed size

/// Everything to 1e-12 of its size; corrections, which iterations of either end at 1e-9 standard deviations, of sigma.
template <class Q, class Channel, class Constraint>
void expectReference(const Q& start, const Channel& channel, const Constraint& constraint, double sigma) {
  ConstrainedEstimator estimator(start, constraint, ConstrainedOptions<Q>{.tolerance = 1e-11}, channel);
  while (estimator.iterate()) {
  }
  const ConstrainedResult<Q>& r = estimator.result();
  ASSERT_TRUE(r.ok()) << name(r.end);
  const ReferenceEstimate<Q, Channel> expected(start, channel, constraint);
  EXPECT_LE(log(expected.parameter, r.parameter).norm(), 1e-12);
  EXPECT_LE((r.information - expected.information).norm(), 1e-12 * expected.information.norm());
  EXPECT_LE((r.covariance - expected.covariance).norm(), 1e-12 * expected.covariance.norm());
  EXPECT_NEAR(r.chi2, expected.chi2, 1e-12 * (1 + expected.chi2));
  for (std::size_t i = 0; i < channel.size(); ++i) {
    EXPECT_LE((estimator.correction(i) - expected.corrections[i]).norm(), 1e-10 * sigma) << i;
  }
}

TEST(ConstrainedReference, SizesAtRunTimeGiveWhatFixedSizesGive) {
  const Ellipse ellipse(30, 0.005, 4);
  const auto on_conic = autoDiff(OnConic{});
  const auto unit = autoDiff(UnitLength{});
  const Eigen::Matrix2d half{{1, 0}, {0.3, 0.7}}, V = 2.5e-5 * half * half.transpose();
  expectReference(ellipse.truth, measurements(ellipse.points, IsotropicNoise<2>(0.005), on_conic), unit, 0.005);
  expectReference(ellipse.truth, measurements(ellipse.points, DiagonalNoise<2>({0.005, 0.008}), on_conic), unit, 0.005);
  expectReference(ellipse.truth, measurements(ellipse.points, CovarianceNoise<2>(V), on_conic), unit, 0.005);
  expectReference(ellipse.truth, measurements(ellipse.points, InformationNoise<2>(V.inverse()), on_conic), unit, 0.005);

  // Six constraints of nine numbers; the same on the manifold; measurements of which one coordinate is free.
  const RotatedPairs data(12, 5);
  Eigen::Matrix<double, 6, 6> free = data.sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  free(4, 4) = 0;
  const auto rotates = autoDiff(Rotates{});
  const auto pairs = measurements(data.pairs, DiagonalNoise<6>(data.sigmas), rotates);
  expectReference(elements(data.truth), pairs, autoDiff(Orthogonal{}), 0.01);
  expectReference(data.truth, pairs, NoConstraint{}, 0.01);
  expectReference(data.truth, measurements(data.pairs, InformationNoise<6>(free), rotates), NoConstraint{}, 0.01);

  // Directions: equations of which two of three are independent, measurements on a manifold.
  CounterRng rng(11);
  std::vector<Pair> directions;
  for (int i = 0; i < 12; ++i) {
    const S2d a(rng.normalVector<3>().normalized()), b(data.truth * a.unit_vector());
    directions.emplace_back(exp(a, Eigen::Vector2d(0.01 * rng.normalVector<2>())),
                            exp(b, Eigen::Vector2d(0.01 * rng.normalVector<2>())));
  }
  expectReference(data.truth, measurements(directions, IsotropicNoise<4>(0.01), autoDiff(Turns{})), NoConstraint{},
                  0.01);
}

}  // namespace
