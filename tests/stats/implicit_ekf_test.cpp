// The implicit extended Kalman filter: against the linear filter, dense against information form, on manifolds.

#include <lie/essential.hpp>
#include <lie/se3.hpp>
#include <stats/auto_diff.hpp>
#include <stats/implicit_ekf.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <support/implicit_ekf_reference.hpp>
#include <support/turned_s2.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using liestat_test::TurnedS2;

template <int N>
using Vec = Eigen::Matrix<double, N, 1>;
template <int R, int C = R>
using Mat = Eigen::Matrix<double, R, C>;

template <int N>
Mat<N> randomCovariance(CounterRng& rng, double sigma) {
  Mat<N> A;
  for (int i = 0; i < N; ++i) A.col(i) = rng.normalVector<N>();
  return sigma * sigma * (A * A.transpose() / N + 0.2 * Mat<N>::Identity());
}

// --- Equations ----------------------------------------------------------------------------------------------------

/// G y - H x = 0, linear.
template <int P, int N, int K>
struct Linear {
  Mat<P, N> H;
  Mat<P, K> G;
  Vec<P> operator()(const Vec<N>& x, const Vec<K>& y) const { return G * y - H * x; }
  EquationDerivatives<P, N, K> linearize(const Vec<N>& x, const Vec<K>& y) const { return {(*this)(x, y), -H, G}; }
};
template <int P, int N>
Linear<P, N, P> observes(const Mat<P, N>& H) {
  return {H, Mat<P>::Identity()};
}

/// b = R a for n pairs (a, b), one after the other.
template <int n>
struct Rotates {
  template <class S>
  Eigen::Matrix<S, 3 * n, 1> operator()(const SO3<S>& R, const Eigen::Matrix<S, 6 * n, 1>& m) const {
    Eigen::Matrix<S, 3 * n, 1> value;
    for (int i = 0; i < n; ++i) {
      const Eigen::Matrix<S, 3, 1> a = m.template segment<3>(6 * i), b = m.template segment<3>(6 * i + 3);
      value.template segment<3>(3 * i) = b - R * a;
    }
    return value;
  }
};

/// x_aᵀ E x_b = 0 of two calibrated image points.
struct Epipolar {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Essential<S>& a_E_b, const Eigen::Matrix<S, 4, 1>& m) const {
    const Eigen::Matrix<S, 3, 1> a(m[0], m[1], S(1)), b(m[2], m[3], S(1));
    return Eigen::Matrix<S, 1, 1>(a_E_b.epipolarResidual(a, b).value);
  }
};
struct EpipolarByHand {
  Vec<1> operator()(const Essentiald& E, const Vec<4>& m) const { return Epipolar{}(E, m); }
  EquationDerivatives<1, 5, 4> linearize(const Essentiald& E, const Vec<4>& m) const {
    const auto r = E.epipolarResidual(Eigen::Vector3d(m[0], m[1], 1), Eigen::Vector3d(m[2], m[3], 1));
    EquationDerivatives<1, 5, 4> J;
    J.value[0] = r.value;
    J.by_parameter = r.by_pose;
    J.by_measurement << r.by_a[0], r.by_a[1], r.by_b[0], r.by_b[1];
    return J;
  }
};

/// A direction that is orthogonal to what is measured, x·y = 0; on any placement of the sphere.
struct Orthogonal {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const S2<S>& x, const Eigen::Matrix<S, 3, 1>& y) const {
    return Eigen::Matrix<S, 1, 1>(x.unit_vector().dot(y));
  }
};
template <class M>
Eigen::Vector3d unitVector(const M& x) {
  if constexpr (requires { x.direction; }) {
    return x.direction.unit_vector();
  } else {
    return x.unit_vector();
  }
}
template <class M>
Mat<3, 2> axes(const M& x) {
  return ManifoldTraits<M>::placement(x).matrix().template leftCols<2>();
}
template <class M>
struct OrthogonalByHand {
  EquationDerivatives<1, 2, 3> linearize(const M& x, const Eigen::Vector3d& y) const {
    const Eigen::Vector3d d = unitVector(x);
    return {Vec<1>(d.dot(y)), y.transpose() * axes(x), d.transpose()};
  }
};

/// The measured direction is the state: three equations x × y = 0, two of them independent.
struct SameDirection {
  static constexpr int rank = 2;
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const S2<S>& x, const S2<S>& y) const {
    const Eigen::Matrix<S, 3, 1> a = x.unit_vector(), b = y.unit_vector();
    return a.cross(b);
  }
};

/// A landmark at p in the world seen at y in the body.
struct SeesLandmark {
  Eigen::Vector3d p;
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const SE3<S>& world_T_body, const Eigen::Matrix<S, 3, 1>& y) const {
    return world_T_body * y - p.cast<S>();
  }
};

/// x² + y² = r².
struct HasRange {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 2, 1>& x, const Eigen::Matrix<S, 1, 1>& r) const {
    return Eigen::Matrix<S, 1, 1>(x.squaredNorm() - r[0] * r[0]);
  }
};

template <int N>
bool positiveDefinite(const Mat<N>& P) {
  return P == P.transpose() && detail::Cholesky<double, N>(P).ok();
}

// --- Against the linear filter ------------------------------------------------------------------------------------

TEST(ImplicitEkf, IsTheKalmanFilterOnVectors) {
  CounterRng rng(1);
  Mat<4> F = Mat<4>::Identity();
  F.topRightCorner<2, 2>() = 0.1 * Mat<2>::Identity();
  const Mat<4> Q = randomCovariance<4>(rng, 0.03);
  const Mat<2> R = randomCovariance<2>(rng, 0.2);
  Gaussian<Vec<4>> start{rng.normalVector<4>(), randomCovariance<4>(rng, 1)};
  ImplicitEkf filter(start);
  Vec<4> x = start.mean;
  Mat<4> P = start.covariance;
  for (int k = 0; k < 100; ++k) {
    Mat<2, 4> H;
    for (int i = 0; i < 4; ++i) H.col(i) = rng.normalVector<2>();
    const Vec<2> y = rng.normalVector<2>();
    ASSERT_EQ(filter.predict(propagate(
                                 filter.state(), [&](const Vec<4>& s) { return Vec<4>(F * s); }, F),
                             Q),
              FilterStatus::ok);
    const auto result = filter.update(y, CovarianceNoise<2>(R), observes<2, 4>(H));

    x = F * x, P = F * P * F.transpose() + Q;
    const Mat<2> S = H * P * H.transpose() + R;
    const Mat<4, 2> K = P * H.transpose() * S.inverse();
    const Vec<2> innovation = y - H * x;
    const double nis = innovation.dot(S.inverse() * innovation);
    x += K * innovation, P = (Mat<4>::Identity() - K * H) * P;

    ASSERT_TRUE(result.ok());
    EXPECT_LE((filter.state().mean - x).norm(), 1e-12 * (1 + x.norm())) << k;
    EXPECT_LE((filter.state().covariance - P).norm(), 1e-12) << k;
    EXPECT_LE((result.innovation - innovation).norm(), 1e-12 * (1 + innovation.norm()));
    EXPECT_LE((result.innovation_covariance - S).norm(), 1e-12 * S.norm());
    EXPECT_NEAR(result.nis, nis, 1e-11 * (1 + nis));
    EXPECT_EQ(result.degrees_of_freedom, 2);
  }
}

TEST(ImplicitEkf, MovesByAModelWithAnUncertainInput) {
  CounterRng rng(4);
  const Gaussian<SE3d> start{sampleInCube<SE3d>(rng, 3), randomCovariance<6>(rng, 0.1)};
  const Gaussian<SE3d> u{SE3d::exp(0.3 * rng.normalVector<6>()), randomCovariance<6>(rng, 0.02)};
  const Mat<6> Q = randomCovariance<6>(rng, 0.01);
  ImplicitEkf by_hand(start), by_jet(start);
  const auto model = [](const auto& x, const auto& motion) { return x * motion; };
  by_hand.predict(propagate(by_hand.state(), u, model, u.mean.inverse().Adj(), Mat<6>(Mat<6>::Identity())), Q);
  by_jet.predict(propagate(by_jet.state(), u, model), Q);
  const Gaussian<SE3d> expected = compose(start, u);
  EXPECT_LE((by_hand.state().covariance - expected.covariance - Q).norm(), 1e-14);
  EXPECT_LE((by_jet.state().covariance - by_hand.state().covariance).norm(), 1e-13);
  EXPECT_LE(log(by_hand.state().mean, expected.mean).norm(), 1e-14);

  Gaussian<SE3d> broken = start;
  broken.covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  const Mat<6> before = by_hand.state().covariance;
  EXPECT_EQ(by_hand.predict(broken, Q), FilterStatus::not_finite);
  EXPECT_EQ(by_hand.state().covariance, before);
}

// --- Sizes at run time against fixed ones -------------------------------------------------------------------------

template <class A, class B>
void expectSame(const A& a, const B& b) {
  ASSERT_EQ(a.status, b.status);
  EXPECT_LE((a.step - b.step).norm(), 1e-12 * (1 + b.step.norm()));
  EXPECT_NEAR(a.nis, b.nis, 1e-12 * (1 + b.nis));
  EXPECT_EQ(a.degrees_of_freedom, b.degrees_of_freedom);
  EXPECT_EQ(a.iterations, b.iterations);
  EXPECT_EQ(a.measurements, b.measurements);
  EXPECT_EQ(a.gated, b.gated);
}

/// Both forms, plain and iterated, with a gate and without: the reference finds the same.
template <class X, class M, class Noise, class EquationOf>
void expectReference(const Gaussian<X>& start, const std::vector<M>& measured, const Noise& noise,
                     const EquationOf& equation_of, double gate) {
  for (const int iterations : {1, 8}) {
    const ImplicitEkfOptions options{.max_iterations = iterations};
    ImplicitEkf<X> filter(start, options);
    liestat_test::ReferenceEkf<X> reference{start, options};
    const auto compare = [&] {
      EXPECT_LE(log(reference.state.mean, filter.state().mean).norm(), 1e-12);
      EXPECT_LE((filter.state().covariance - reference.state.covariance).norm(),
                1e-12 * reference.state.covariance.norm());
      // Each update from the same state, or differences grow.
      reference.state = filter.state();
    };
    if constexpr (!detail::HasFreeDirections<Noise>) {
      for (std::size_t i = 0; i < measured.size(); ++i) {
        const auto a = filter.update(measured[i], noise, equation_of(i), gate);
        const auto b = reference.update(measured[i], noise, equation_of(i), gate);
        expectSame(a, b);
        EXPECT_LE((a.innovation - b.innovation).norm(), 1e-12 * (1 + b.innovation.norm()));
        EXPECT_LE((a.innovation_covariance - b.innovation_covariance).norm(), 1e-12 * b.innovation_covariance.norm());
        compare();
      }
      filter.reset(start), reference.state = start;
    }
    const auto add = [&](auto& sums) {
      for (std::size_t i = 0; i < measured.size(); ++i) sums.add(measured[i], noise, equation_of(i), gate);
    };
    expectSame(filter.updateAll(add), reference.updateAll(measured, noise, equation_of, gate));
    compare();
  }
}

TEST(ImplicitEkf, SizesAtRunTimeGiveWhatFixedSizesGive) {
  CounterRng rng(30);
  const double infinity = std::numeric_limits<double>::infinity();
  const auto with = [](const auto& equation) { return [=](std::size_t) { return equation; }; };
  // Vectors: a larger state than any that the loops know by size; a singular covariance of the noise; redundant equations;
  // a free direction.
  Mat<8> F;
  for (int i = 0; i < 8; ++i) F.col(i) = rng.normalVector<8>();
  const Gaussian<Vec<8>> wide{rng.normalVector<8>(), randomCovariance<8>(rng, 0.5)};
  const Mat<7, 8> H7 = F.topRows<7>();
  expectReference(wide, std::vector<Vec<7>>{rng.normalVector<7>(), rng.normalVector<7>()},
                  CovarianceNoise<7>(randomCovariance<7>(rng, 0.4)), with(observes<7, 8>(H7)), infinity);
  const Mat<2, 8> H2 = F.topRows<2>();
  expectReference(wide, std::vector<Vec<2>>{rng.normalVector<2>()},
                  InformationNoise<2>(Eigen::Vector2d(4, 0).asDiagonal()), with(observes<2, 8>(H2)), infinity);
  Mat<3, 2> twice;
  twice << 1, 0, 0, 1, 1, 1;
  expectReference(wide, std::vector<Vec<2>>{rng.normalVector<2>(), rng.normalVector<2>()}, DiagonalNoise<2>({0.3, 0.5}),
                  with(Linear<3, 8, 2>{twice * H2, twice}), infinity);
  expectReference(Gaussian<Vec<2>>{Vec<2>(1, 0.6), Mat<2>(0.04 * Mat<2>::Identity())},
                  std::vector<Vec<1>>{Vec<1>(1.2), Vec<1>(1.3)}, IsotropicNoise<1>(0.05), with(autoDiff(HasRange{})),
                  infinity);

  // Manifolds: of the state, and of both; a gate that leaves some out.
  const Gaussian<SO3d> turn{SO3d::exp(rng.normalVector<3>()), randomCovariance<3>(rng, 0.1)};
  std::vector<Vec<6>> pairs(8);
  for (Vec<6>& pair : pairs) {
    const Eigen::Vector3d a = rng.unitVector<3>();
    pair << a, turn.mean * a;
    pair += 0.05 * rng.normalVector<6>();
  }
  expectReference(turn, pairs, IsotropicNoise<6>(0.05), with(autoDiff(Rotates<1>{})), 5.);
  const Gaussian<S2d> direction{S2d(rng.unitVector<3>()), randomCovariance<2>(rng, 0.1)};
  std::vector<S2d> seen;
  for (int i = 0; i < 5; ++i) seen.push_back(exp(direction.mean, TangentOf<S2d>(0.1 * rng.normalVector<2>())));
  expectReference(direction, seen, DiagonalNoise<2>({0.05, 0.08}), with(autoDiff(SameDirection{})), infinity);
  const Gaussian<SE3d> pose{sampleInCube<SE3d>(rng, 1), randomCovariance<6>(rng, 0.05)};
  std::vector<Vec<3>> landmarks, in_body;
  for (int i = 0; i < 6; ++i) {
    landmarks.push_back(rng.normalVector<3>());
    in_body.push_back(pose.mean.inverse() * landmarks.back() + 0.05 * rng.normalVector<3>());
  }
  expectReference(
      pose, in_body, CovarianceNoise<3>(randomCovariance<3>(rng, 0.05)),
      [&](std::size_t i) { return autoDiff(SeesLandmark{landmarks[i]}); }, infinity);
}

// --- Two forms ----------------------------------------------------------------------------------------------------

TEST(ImplicitEkf, DenseAndInformationFormAgree) {
  constexpr int n = 2;
  for (int iterations : {1, 20}) {
    for (std::uint64_t trial = 0; trial < 20; ++trial) {
      CounterRng rng(2, trial);
      const Gaussian<SO3d> start{SO3d::exp(rng.normalVector<3>()), randomCovariance<3>(rng, 0.2)};
      const SO3d truth = sample(start, rng);
      Vec<6 * n> all;
      Mat<6 * n> R = Mat<6 * n>::Zero();
      std::vector<Vec<6>> pairs;
      std::vector<CovarianceNoise<6>> noises;
      for (int i = 0; i < n; ++i) {
        const Eigen::Vector3d a = rng.normalVector<3>();
        const Mat<6> V = randomCovariance<6>(rng, 0.05);
        Vec<6> pair;
        pair << a, truth * a;
        pair += V.llt().matrixL() * rng.normalVector<6>();
        pairs.push_back(pair), noises.emplace_back(V);
        all.segment<6>(6 * i) = pair;
        R.block<6, 6>(6 * i, 6 * i) = V;
      }
      const ImplicitEkfOptions options{.max_iterations = iterations, .tolerance = 1e-12};
      ImplicitEkf dense(start, options), information(start, options);
      const auto a = dense.update(all, CovarianceNoise<6 * n>(R), autoDiff(Rotates<n>{}));
      const auto b = information.updateAll([&](auto& sums) {
        for (std::size_t i = 0; i < pairs.size(); ++i) sums.add(pairs[i], noises[i], autoDiff(Rotates<1>{}));
      });
      ASSERT_TRUE(a.ok() && b.ok()) << name(a.status) << " " << name(b.status);
      EXPECT_LE(log(dense.state().mean, information.state().mean).norm(), 1e-10) << iterations << " " << trial;
      EXPECT_LE((dense.state().covariance - information.state().covariance).norm(),
                1e-10 * dense.state().covariance.norm())
          << iterations << " " << trial;
      EXPECT_NEAR(a.nis, b.nis, 1e-10 * (1 + a.nis));
      EXPECT_EQ(a.degrees_of_freedom, 3 * n);
      EXPECT_EQ(b.degrees_of_freedom, 3 * n);
      EXPECT_EQ(b.measurements, static_cast<std::size_t>(n));
    }
  }
}

TEST(ImplicitEkf, DerivativesByHandAndByJetAgree) {
  CounterRng rng(3);
  const Gaussian<Essentiald> start{sampleInCube<Essentiald>(rng), randomCovariance<5>(rng, 0.05)};
  ImplicitEkf by_hand(start), by_jet(start);
  for (int k = 0; k < 30; ++k) {
    const Vec<4> m = rng.normalVector<4>();
    const auto a = by_hand.update(m, IsotropicNoise<4>(0.1), EpipolarByHand{});
    const auto b = by_jet.update(m, IsotropicNoise<4>(0.1), autoDiff(Epipolar{}));
    ASSERT_TRUE(a.ok() && b.ok());
    EXPECT_LE((a.innovation_covariance - b.innovation_covariance).norm(), 1e-12 * a.innovation_covariance.norm());
    EXPECT_LE(log(by_hand.state().mean, by_jet.state().mean).norm(), 1e-12);
    EXPECT_LE((by_hand.state().covariance - by_jet.state().covariance).norm(), 1e-12);
  }
}

TEST(ImplicitEkf, SumsLeaveFreeDirectionsOfAMeasurementOut) {
  CounterRng rng(5);
  const Gaussian<Vec<3>> start{Vec<3>::Zero(), randomCovariance<3>(rng, 1)};
  ImplicitEkf with_free(start), without(start);
  Mat<2, 3> H;
  for (int i = 0; i < 3; ++i) H.col(i) = rng.normalVector<2>();
  const Vec<2> y = rng.normalVector<2>();
  const auto a = with_free.updateAll(
      [&](auto& sums) { sums.add(y, InformationNoise<2>(Eigen::Vector2d(4, 0).asDiagonal()), observes<2, 3>(H)); });
  const auto b = without.update(Vec<1>(y[0]), IsotropicNoise<1>(0.5), observes<1, 3>(H.topRows<1>()));
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a.degrees_of_freedom, 1);
  EXPECT_LE((with_free.state().mean - without.state().mean).norm(), 1e-12);
  EXPECT_LE((with_free.state().covariance - without.state().covariance).norm(), 1e-12);
}

// --- Covariance ---------------------------------------------------------------------------------------------------

TEST(ImplicitEkf, CovarianceStaysPositiveDefinite) {
  // 1e5 updates with a noise of 1e-7 on a prior of 1: a condition of 1e14 after the first, the most that a covariance in
  // double can say.
  const double sigma = 1e-7;
  CounterRng rng(6);
  ImplicitEkf filter(Gaussian<Vec<3>>{Vec<3>::Zero(), Mat<3>::Identity()});
  const Vec<3> truth(0.3, -0.2, 0.5);
  Mat<3> information = Mat<3>::Identity();
  for (int k = 0; k < 100000; ++k) {
    const Mat<1, 3> H = rng.normalVector<3>().transpose();
    const Vec<1> y(H.row(0).dot(truth) + sigma * rng.normal());
    information += H.transpose() * H / (sigma * sigma);
    ASSERT_TRUE(filter.update(y, IsotropicNoise<1>(sigma), observes<1, 3>(H)).ok());
    ASSERT_TRUE(positiveDefinite<3>(filter.state().covariance)) << k << "\n" << filter.state().covariance;
  }
  EXPECT_LE((filter.state().covariance * information - Mat<3>::Identity()).norm(), 1e-6);
  EXPECT_LE(std::sqrt((filter.state().mean - truth).dot(information * (filter.state().mean - truth))), 6);

  // A curved state, whose covariance is carried from frame to frame each time. The start is near enough for the squares of
  // its error to be small against the noise.
  const SO3d attitude = SO3d::exp(Vec<3>(0.4, -1, 0.3));
  ImplicitEkf rotation(Gaussian<SO3d>{exp(attitude, Vec<3>(1e-6, -1e-6, 5e-7)), Mat<3>(1e-12 * Mat<3>::Identity())});
  for (int k = 0; k < 100000; ++k) {
    const Eigen::Vector3d a = rng.unitVector<3>();
    Vec<6> pair;
    pair << a, attitude * a;
    pair += 1e-10 * rng.normalVector<6>();
    ASSERT_TRUE(rotation.update(pair, IsotropicNoise<6>(1e-10), autoDiff(Rotates<1>{})).ok());
    ASSERT_TRUE(positiveDefinite<3>(rotation.state().covariance)) << k;
  }
  // 1e-10 √2 of each pair, two of its three components say something, 1e5 pairs: 6e-13 each coordinate.
  EXPECT_LE(distance(rotation.state().mean, attitude), 6e-12);
}

TEST(ImplicitEkf, CovarianceIsCarriedToTheNewFrame) {
  // Steps of up to two radians: the covariance in the chart at the prior, by the textbook's formula, moved by the
  // derivative of exp, found by central differences.
  CounterRng rng(7);
  double longest = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const Gaussian<S2d> start{S2d(rng.unitVector<3>()), randomCovariance<2>(rng, 1.5)};
    const Eigen::Vector3d y = rng.unitVector<3>();
    ImplicitEkf filter(start);
    const auto result = filter.update(y, IsotropicNoise<3>(0.1), autoDiff(Orthogonal{}));
    ASSERT_TRUE(result.ok());
    longest = std::max(longest, result.step.norm());
    const Mat<1, 2> C = y.transpose() * axes(start.mean);
    const Mat<2, 1> gain = start.covariance * C.transpose() / result.innovation_covariance(0, 0);
    EXPECT_LE((result.step + gain * result.innovation).norm(), 1e-12);
    const Mat<2> in_chart = (Mat<2>::Identity() - gain * C) * start.covariance;
    Mat<2> J;
    for (int k = 0; k < 2; ++k) {
      const TangentOf<S2d> d = 1e-5 * TangentOf<S2d>::Unit(k);
      J.col(k) = (log(filter.state().mean, exp(start.mean, TangentOf<S2d>(result.step + d))) -
                  log(filter.state().mean, exp(start.mean, TangentOf<S2d>(result.step - d)))) /
                 2e-5;
    }
    EXPECT_LE((filter.state().covariance - J * in_chart * J.transpose()).norm(), 1e-8) << trial;
  }
  EXPECT_GT(longest, 1);
}

TEST(ImplicitEkf, DoesNotDependOnThePlacement) {
  // The same measurements on the sphere with the library's placement and with another, turned differently at each
  // point: directions agree, and covariances do as matrices of space.
  CounterRng rng(8);
  using Turned = TurnedS2<double>;
  const S2d start(rng.unitVector<3>());
  const Mat<2> P = randomCovariance<2>(rng, 0.5);
  const Mat<2> turn = axes(Turned{start}).transpose() * axes(start);
  for (int iterations : {1, 5}) {
    const ImplicitEkfOptions options{.max_iterations = iterations};
    ImplicitEkf plain(Gaussian<S2d>{start, P}, options);
    ImplicitEkf turned(Gaussian<Turned>{{start}, turn * P * turn.transpose()}, options);
    for (int k = 0; k < 40; ++k) {
      const Eigen::Vector3d y = rng.unitVector<3>();
      plain.predict(Mat<2>(0.01 * Mat<2>::Identity()));
      turned.predict(Mat<2>(0.01 * Mat<2>::Identity()));
      if (k % 2 == 0) {
        const auto a = plain.update(y, IsotropicNoise<3>(0.3), OrthogonalByHand<S2d>{});
        const auto b = turned.update(y, IsotropicNoise<3>(0.3), OrthogonalByHand<Turned>{});
        ASSERT_EQ(a.status, b.status);
        EXPECT_NEAR(a.nis, b.nis, 1e-10 * (1 + a.nis));
      } else {
        const auto a =
            plain.updateAll([&](auto& sums) { sums.add(y, IsotropicNoise<3>(0.3), OrthogonalByHand<S2d>{}); });
        const auto b =
            turned.updateAll([&](auto& sums) { sums.add(y, IsotropicNoise<3>(0.3), OrthogonalByHand<Turned>{}); });
        ASSERT_EQ(a.status, b.status);
      }
      EXPECT_LE((unitVector(plain.state().mean) - unitVector(turned.state().mean)).norm(), 1e-10) << k;
      const Mat<3> in_space = detail::congruence(axes(plain.state().mean), plain.state().covariance);
      EXPECT_LE((in_space - detail::congruence(axes(turned.state().mean), turned.state().covariance)).norm(), 1e-10);
    }
  }
}

// --- Consistency --------------------------------------------------------------------------------------------------

/// The mean of n values of χ²_k is k within this, but for a probability of 6e-5.
double bound(int k, int n) { return 4 * std::sqrt(2. * k / n); }

TEST(ImplicitEkf, IsConsistentOnRotations) {
  const int trials = 1000;
  double nees = 0, nis = 0;
  int equations = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(20, static_cast<std::uint64_t>(t));
    const Gaussian<SO3d> start{SO3d::exp(rng.normalVector<3>()), randomCovariance<3>(rng, 0.05)};
    const SO3d truth = sample(start, rng);
    ImplicitEkf filter(start);
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d a = rng.unitVector<3>();
      Vec<6> pair;
      pair << a, truth * a;
      pair += 0.02 * rng.normalVector<6>();
      const auto result = filter.update(pair, IsotropicNoise<6>(0.02), autoDiff(Rotates<1>{}));
      ASSERT_TRUE(result.ok());
      nis += result.nis, equations += result.degrees_of_freedom;
    }
    nees += mahalanobisSquared(filter.state(), truth);
  }
  EXPECT_NEAR(nees / trials, 3, bound(3, trials));
  EXPECT_EQ(equations, 15 * trials);
  EXPECT_NEAR(nis / trials, 15, bound(15, trials));
}

TEST(ImplicitEkf, IsConsistentOnDirectionsThatMove) {
  const int trials = 1000;
  double nees = 0, nis = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(21, static_cast<std::uint64_t>(t));
    const Mat<2> Q = 1e-4 * Mat<2>::Identity();
    const Gaussian<S2d> start{S2d(rng.unitVector<3>()), randomCovariance<2>(rng, 0.05)};
    S2d truth = sample(start, rng);
    ImplicitEkf filter(start);
    for (int k = 0; k < 5; ++k) {
      truth = exp(truth, TangentOf<S2d>(0.01 * rng.normalVector<2>()));
      ASSERT_EQ(filter.predict(Q), FilterStatus::ok);
      const S2d y = exp(truth, TangentOf<S2d>(0.03 * rng.normalVector<2>()));
      const auto result = filter.update(y, IsotropicNoise<2>(0.03), autoDiff(SameDirection{}));
      ASSERT_TRUE(result.ok());
      EXPECT_EQ(result.degrees_of_freedom, 2);
      nis += result.nis;
    }
    nees += mahalanobisSquared(filter.state(), truth);
  }
  EXPECT_NEAR(nees / trials, 2, bound(2, trials));
  EXPECT_NEAR(nis / trials, 10, bound(10, trials));
}

TEST(ImplicitEkf, IsConsistentOnPosesThatMove) {
  const int trials = 1000;
  double nees = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(22, static_cast<std::uint64_t>(t));
    const Gaussian<SE3d> start{sampleInCube<SE3d>(rng, 1), randomCovariance<6>(rng, 0.05)};
    SE3d truth = sample(start, rng);
    ImplicitEkf filter(start);
    for (int k = 0; k < 4; ++k) {
      const SE3d u = SE3d::exp(0.2 * rng.normalVector<6>());
      const Mat<6> Q = 1e-4 * Mat<6>::Identity();
      truth = sample(Gaussian<SE3d>{truth * u, Q}, rng);
      filter.predict(compose(filter.state(), u), Q);
      const auto result = filter.updateAll([&](auto& sums) {
        // The same draws in each pass of an update.
        for (std::uint32_t i = 0; i < 3; ++i) {
          CounterRng own(23, static_cast<std::uint64_t>(t), static_cast<std::uint32_t>(10 * k) + i);
          const Eigen::Vector3d p = own.normalVector<3>();
          const Vec<3> y = truth.inverse() * p + 0.02 * own.normalVector<3>();
          sums.add(y, IsotropicNoise<3>(0.02), autoDiff(SeesLandmark{p}));
        }
      });
      ASSERT_TRUE(result.ok());
    }
    nees += mahalanobisSquared(filter.state(), truth);
  }
  EXPECT_NEAR(nees / trials, 6, bound(6, trials));
}

TEST(ImplicitEkf, FindsARelativePoseFromMatches) {
  // 60 epipolar constraints at once. The sums are linearised where the start is, some 0.02 rad off, which is much against
  // their noise: a plain update is far from consistent, the iterated one is.
  const int trials = 300;
  const double sigma = 1. / 2000, start_sigma = 0.02;
  double plain_nees = 0, nees = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(24, static_cast<std::uint64_t>(t));
    const SO3d turn = SO3d::exp(0.1 * rng.normalVector<3>());
    const SE3d a_T_b(turn, rng.unitVector<3>());
    const Essentiald truth(a_T_b);
    const Gaussian<Essentiald> start{exp(truth, TangentOf<Essentiald>(start_sigma * rng.normalVector<5>())),
                                     Mat<5>(start_sigma * start_sigma * Mat<5>::Identity())};
    std::vector<Vec<4>> matches;
    for (int i = 0; i < 60; ++i) {
      Eigen::Vector3d in_b;
      for (int k = 0; k < 3; ++k) in_b[k] = k < 2 ? rng.uniform(-2, 2) : rng.uniform(4, 8);
      const Eigen::Vector3d in_a = a_T_b * in_b;
      Vec<4> m;
      m << in_a.head<2>() / in_a.z(), in_b.head<2>() / in_b.z();
      matches.push_back(m + sigma * rng.normalVector<4>());
    }
    const auto add = [&](auto& sums) {
      for (const Vec<4>& m : matches) sums.add(m, IsotropicNoise<4>(sigma), EpipolarByHand{});
    };
    ImplicitEkf plain(start), iterated(start, {.max_iterations = 20});
    ASSERT_TRUE(plain.updateAll(add).ok());
    const auto result = iterated.updateAll(add);
    ASSERT_TRUE(result.ok()) << t << " " << name(result.status);
    plain_nees += mahalanobisSquared(plain.state(), truth);
    nees += mahalanobisSquared(iterated.state(), truth);
  }
  EXPECT_NEAR(nees / trials, 5, bound(5, trials));
  EXPECT_GT(plain_nees / trials, 20);
}

TEST(ImplicitEkf, IterationFindsTheMostProbableState) {
  // A range of 1 % accuracy and a prior of 20 %, sideways too: the plain update misses the circle, the iterated one is
  // where the posterior is largest.
  double plain_nees = 0, iterated_nees = 0, plain_cost = 0, iterated_cost = 0;
  const int trials = 500;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(25, static_cast<std::uint64_t>(t));
    const Mat<2> P = 0.04 * Mat<2>::Identity();
    const double sigma = 0.01;
    const Gaussian<Vec<2>> start{Vec<2>(1, 0.6), P};
    const Vec<2> truth = sample(start, rng);
    const Vec<1> range(truth.norm() + sigma * rng.normal());
    ImplicitEkf plain(start), iterated(start, {.max_iterations = 100, .tolerance = 1e-10});
    ASSERT_TRUE(plain.update(range, IsotropicNoise<1>(sigma), autoDiff(HasRange{})).ok());
    const auto result = iterated.update(range, IsotropicNoise<1>(sigma), autoDiff(HasRange{}));
    ASSERT_TRUE(result.ok()) << t << " " << result.iterations;
    EXPECT_LE(result.iterations, 60);
    const auto cost = [&](const Vec<2>& x) {
      const double e = (range[0] - x.norm()) / sigma;
      return mahalanobisSquared(start, x) + e * e;
    };
    plain_cost += cost(plain.state().mean), iterated_cost += cost(iterated.state().mean);
    // The gradient of the cost vanishes.
    const Vec<2> x = iterated.state().mean, away = x - start.mean;
    const Vec<2> gradient = P.inverse() * away - (range[0] - x.norm()) / (sigma * sigma) * x / x.norm();
    EXPECT_LE(gradient.norm(), 1e-5) << t;
    plain_nees += mahalanobisSquared(plain.state(), truth);
    iterated_nees += mahalanobisSquared(iterated.state(), truth);
  }
  EXPECT_LT(iterated_cost, 0.8 * plain_cost);
  EXPECT_LT(iterated_nees / trials, 0.7 * plain_nees / trials);
}

// --- Rank, gates, bad input ---------------------------------------------------------------------------------------

TEST(ImplicitEkf, RedundantEquationsChangeNothing) {
  CounterRng rng(9);
  const Gaussian<Vec<3>> start{rng.normalVector<3>(), randomCovariance<3>(rng, 1)};
  // Six equations of rank three, as in P ẋ = 0 with a projector P, and the three of a basis of its range.
  Mat<6, 3> U;
  for (int i = 0; i < 3; ++i) U.col(i) = rng.normalVector<6>();
  U = Eigen::HouseholderQR<Mat<6, 3>>(U).householderQ() * Mat<6, 3>::Identity();
  const Mat<6> projector = U * U.transpose();
  Mat<6, 3> H;
  for (int i = 0; i < 3; ++i) H.col(i) = rng.normalVector<6>();
  const Vec<6> y = rng.normalVector<6>();
  const Mat<6> R = randomCovariance<6>(rng, 0.3);
  ImplicitEkf redundant(start), reduced(start), summed(start);
  const auto a = redundant.update(y, CovarianceNoise<6>(R), Linear<6, 3, 6>{projector * H, projector});
  const auto b = reduced.update(y, CovarianceNoise<6>(R), Linear<3, 3, 6>{U.transpose() * H, U.transpose()});
  const auto c = summed.updateAll([&](auto& sums) {
    sums.add(y, CovarianceNoise<6>(R), Linear<6, 3, 6>{projector * H, projector});
  });
  ASSERT_TRUE(a.ok() && b.ok() && c.ok()) << name(a.status) << name(b.status) << name(c.status);
  EXPECT_EQ(a.degrees_of_freedom, 3);
  EXPECT_EQ(c.degrees_of_freedom, 3);
  EXPECT_NEAR(a.nis, b.nis, 1e-10 * b.nis);
  EXPECT_NEAR(c.nis, b.nis, 1e-10 * b.nis);
  for (const ImplicitEkf<Vec<3>>* filter : {&redundant, &summed}) {
    EXPECT_LE((filter->state().mean - reduced.state().mean).norm(), 1e-10);
    EXPECT_LE((filter->state().covariance - reduced.state().covariance).norm(), 1e-10);
  }
}

TEST(ImplicitEkf, ExactConstraintsNeedTheDenseForm) {
  CounterRng rng(10);
  const Gaussian<Vec<3>> start{rng.normalVector<3>(), randomCovariance<3>(rng, 1)};
  const Mat<1, 3> H = rng.unitVector<3>().transpose();
  ImplicitEkf filter(start);
  const auto exact = filter.update(Vec<1>(2), IsotropicNoise<1>(0), observes<1, 3>(H));
  ASSERT_TRUE(exact.ok());
  EXPECT_NEAR(H.row(0).dot(filter.state().mean), 2, 1e-13);
  EXPECT_NEAR((H * filter.state().covariance * H.transpose())(0, 0), 0, 1e-14);
  // The same again says nothing, another value contradicts it, and neither moves the state.
  const Gaussian<Vec<3>> before = filter.state();
  Mat<2, 3> twice;
  twice << H, H;
  ImplicitEkf contradicted(start);
  const auto contradiction =
      contradicted.update(Vec<2>(2, 2.5), CovarianceNoise<2>(Mat<2>::Zero()), observes<2, 3>(twice));
  EXPECT_EQ(contradiction.status, FilterStatus::ok) << "half a standard deviation";
  ImplicitEkf far(start);
  EXPECT_EQ(far.update(Vec<2>(2, 50), CovarianceNoise<2>(Mat<2>::Zero()), observes<2, 3>(twice)).status,
            FilterStatus::singular);
  EXPECT_EQ(far.state().mean, start.mean);
  EXPECT_EQ(
      filter.update(Vec<1>(1), IsotropicNoise<1>(0), Linear<1, 3, 1>{Mat<1, 3>::Zero(), Mat<1>::Identity()}).status,
      FilterStatus::singular);
  // Sums have no finite information for it, nor for a state that is exact in a direction.
  ImplicitEkf sums_only(start);
  const auto add = [&](double sigma) {
    return [&, sigma](auto& sums) {
      sums.add(Vec<2>(2, 1), DiagonalNoise<2>({sigma, 0.1}), Linear<2, 3, 2>{twice, Mat<2>::Identity()});
    };
  };
  EXPECT_EQ(sums_only.updateAll(add(0)).status, FilterStatus::singular);
  EXPECT_EQ(sums_only
                .updateAll([&](auto& sums) {
                  sums.add(Vec<1>(2), IsotropicNoise<1>(1), Linear<1, 3, 1>{H, Mat<1>::Zero()});
                })
                .status,
            FilterStatus::singular);
  EXPECT_EQ(sums_only.state().covariance, start.covariance);
  ImplicitEkf flat(Gaussian<Vec<3>>{start.mean, Eigen::Vector3d(1, 1, 0).asDiagonal()});
  EXPECT_EQ(flat.updateAll(add(0.1)).status, FilterStatus::singular);
  EXPECT_TRUE(flat.update(Vec<1>(2), IsotropicNoise<1>(0.1), observes<1, 3>(H)).ok());
  EXPECT_EQ(before.mean, filter.state().mean);
}

TEST(ImplicitEkf, GatesLeaveTheStateAsItWas) {
  CounterRng rng(11);
  const Gaussian<SO3d> start{SO3d::exp(rng.normalVector<3>()), 0.01 * Mat<3>::Identity()};
  std::vector<Vec<6>> pairs;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d a = rng.unitVector<3>();
    Vec<6> pair;
    pair << a, start.mean * a;
    pairs.push_back(pair + 0.01 * rng.normalVector<6>());
  }
  std::vector<Vec<6>> mixed = pairs;
  Vec<6> outlier;
  outlier << 1, 0, 0, start.mean * Eigen::Vector3d(-1, 0, 0);
  mixed.insert(mixed.begin() + 4, outlier);

  const double gate = 16.27;  // χ²_3 is beyond it once in a thousand
  for (int iterations : {1, 10}) {
    ImplicitEkf gated(start, {.max_iterations = iterations}), clean(start, {.max_iterations = iterations});
    const auto run = [&](auto& filter, const std::vector<Vec<6>>& list) {
      return filter.updateAll([&](auto& sums) {
        for (const Vec<6>& pair : list) sums.add(pair, IsotropicNoise<6>(0.01), autoDiff(Rotates<1>{}), gate);
      });
    };
    const auto a = run(gated, mixed), b = run(clean, pairs);
    ASSERT_TRUE(a.ok() && b.ok());
    EXPECT_EQ(a.gated, 1u);
    EXPECT_EQ(a.measurements, pairs.size());
    EXPECT_EQ(gated.state().mean.params(), clean.state().mean.params());
    EXPECT_EQ(gated.state().covariance, clean.state().covariance);
    EXPECT_EQ(a.nis, b.nis);
    EXPECT_EQ(run(gated, {outlier}).status, FilterStatus::gated);
    EXPECT_EQ(gated.state().covariance, clean.state().covariance);
  }
  ImplicitEkf dense(start);
  const auto refused = dense.update(outlier, IsotropicNoise<6>(0.01), autoDiff(Rotates<1>{}), gate);
  EXPECT_EQ(refused.status, FilterStatus::gated);
  EXPECT_GT(refused.nis, gate);
  EXPECT_GT(refused.step.norm(), 0);
  EXPECT_EQ(dense.state().covariance, start.covariance);
  EXPECT_EQ(dense.state().mean.params(), start.mean.params());
}

TEST(ImplicitEkf, BadInputIsSaidAndLeavesTheStateAsItWas) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Gaussian<SO3d> start{SO3d::exp(Vec<3>(0.1, 0.2, 0.3)), 0.01 * Mat<3>::Identity()};
  ImplicitEkf filter(start);
  Vec<6> pair;
  pair << 1, 0, 0, nan, 0, 1;
  const auto equation = autoDiff(Rotates<1>{});
  EXPECT_EQ(filter.update(pair, IsotropicNoise<6>(0.01), equation).status, FilterStatus::not_finite);
  EXPECT_EQ(filter.updateAll([&](auto& sums) { sums.add(pair, IsotropicNoise<6>(0.01), equation); }).status,
            FilterStatus::not_finite);
  pair[3] = 0;
  EXPECT_EQ(filter.update(pair, IsotropicNoise<6>(nan), equation).status, FilterStatus::singular);
  EXPECT_EQ(filter.updateAll([&](auto& sums) { sums.add(pair, IsotropicNoise<6>(-0.), equation); }).status,
            FilterStatus::singular);
  EXPECT_EQ(filter.predict(Mat<3>(Mat<3>::Constant(nan))), FilterStatus::not_finite);
  const auto nothing = filter.updateAll([](auto&) {});
  EXPECT_EQ(nothing.status, FilterStatus::ok);
  EXPECT_EQ(nothing.measurements, 0u);
  EXPECT_EQ(filter.state().covariance, start.covariance);
  EXPECT_EQ(filter.state().mean.params(), start.mean.params());
  ImplicitEkf broken(Gaussian<SO3d>{start.mean, Mat<3>::Constant(nan)});
  EXPECT_EQ(broken.update(pair, IsotropicNoise<6>(0.01), equation).status, FilterStatus::not_finite);
  EXPECT_EQ(broken.updateAll([&](auto& sums) { sums.add(pair, IsotropicNoise<6>(0.01), equation); }).status,
            FilterStatus::not_finite);
}

}  // namespace
