// Statistics ask a type for its traits and for nothing else: types whose members mean other things than the library's,
// and types that say by their traits what the library's say.

#include <lie/lie.hpp>
#include <stats/certified_mean.hpp>
#include <stats/conventions.hpp>
#include <stats/maha.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <type_traits>
#include <vector>

namespace {

using namespace liestat;

/// An attitude whose members are named as those of SO3, S2 and SE2 are and mean something else.
struct Impostor {
  SO3d attitude;
  std::string unit_quaternion() const { return "kept in a drawer"; }
  std::string unit_vector() const { return "metre"; }
  int unit_complex() const { return 2; }
  int params() const { return 7; }
  int num_parameters() const { return 7; }
  void* data() const { return nullptr; }
  void so2() const {}
  void so3() const {}
  void scale() const {}
  void rows() const {}
  void cols() const {}
  void translation() const {}
  void rotationMatrix() const {}
};

/// An attitude of somebody else's, about which the traits say everything; only its address says where its numbers are.
struct Told {
  double x = 0, y = 0, z = 0, w = 1;
};
/// The same in single words: the general formulas, though its compact factor is known.
struct ToldWithoutMemory {
  SO3d attitude;
};

SO3d attitudeOf(const Impostor& x) { return x.attitude; }
SO3d attitudeOf(const ToldWithoutMemory& x) { return x.attitude; }
SO3d attitudeOf(const Told& x) { return SO3d::fromParams({x.x, x.y, x.z, x.w}); }
void setAttitude(Impostor& x, const SO3d& R) { x.attitude = R; }
void setAttitude(ToldWithoutMemory& x, const SO3d& R) { x.attitude = R; }
void setAttitude(Told& x, const SO3d& R) { x = {R.params()[0], R.params()[1], R.params()[2], R.params()[3]}; }

template <class M>
M withAttitude(const SO3d& R) {
  M x;
  setAttitude(x, R);
  return x;
}

/// The least traits that make an attitude Metric.
template <class M>
struct AttitudeManifold : TrivialIsotropy<M, SO3d> {
  using T = ManifoldTraits<SO3d>;
  using typename TrivialIsotropy<M, SO3d>::Tangent, typename TrivialIsotropy<M, SO3d>::Square;
  static constexpr bool covariance_models_coincide = true;
  static M act(const SO3d& f, const M& x) { return withAttitude<M>(f * attitudeOf(x)); }
  static SO3d placement(const M& x) { return attitudeOf(x); }
  static M expOrigin(const Tangent& v) { return withAttitude<M>(SO3d::exp(v)); }
  static Tangent logOrigin(const M& x) { return attitudeOf(x).log(); }
  static Square dexpOrigin(const Tangent& v) { return T::dexpOrigin(v); }
  static Square dlogOrigin(const M& x) { return T::dlogOrigin(attitudeOf(x)); }
  static Square hessianHalfSquaredDistance(const Tangent& z) { return T::hessianHalfSquaredDistance(z); }
  static Tangent metricWeights() { return Tangent::Ones(); }
  static double injectivityRadius() { return T::injectivityRadius(); }
  static double maxSectionalCurvature() { return T::maxSectionalCurvature(); }
};

/// Optional traits for statistics.
template <class M>
struct ToldManifold : AttitudeManifold<M> {
  struct ChordalMoments {
    ManifoldTraits<SO3d>::ChordalMoments sums;
    void add(const M& x, double p) { sums.add(attitudeOf(x), p); }
    M mean() const { return withAttitude<M>(sums.mean()); }
  };
  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 0;
  static Eigen::Vector4d compactCoordinates(const M& x) { return attitudeOf(x).params(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 3}};
};

}  // namespace

template <>
struct liestat::ManifoldTraits<Impostor> : AttitudeManifold<Impostor> {};
template <>
struct liestat::ManifoldTraits<ToldWithoutMemory> : ToldManifold<ToldWithoutMemory> {};
template <>
struct liestat::ManifoldTraits<Told> : ToldManifold<Told> {
  static const double* parameters(const Told& x) { return &x.x; }
};

namespace {

static_assert(Metric<Impostor> && !HasCompactFactor<Impostor> && !HasChordalMoments<Impostor>);
static_assert(!HasTangentParts<Impostor> && !HasRotationParameters<Impostor>);
static_assert(HasCompactFactor<Told> && HasChordalMoments<Told> && HasRotationParameters<Told>);
static_assert(detail::HasRotationSums<Told> && !detail::HasRotationSums<ToldWithoutMemory>);

std::vector<SO3d> rotations(std::size_t n, double spread, std::uint64_t seed) {
  CounterRng rng(seed, 0);
  const SO3d centre = SO3d::sampleUniform(rng);
  std::vector<SO3d> samples;
  for (std::size_t i = 0; i < n; ++i) samples.push_back(centre * SO3d::exp(spread * rng.normalVector<3>()));
  return samples;
}
template <class M>
std::vector<M> as(const std::vector<SO3d>& rotations) {
  std::vector<M> samples;
  for (const SO3d& R : rotations) samples.push_back(withAttitude<M>(R));
  return samples;
}
double gap(const SO3d& a, const SO3d& b) { return (a.inverse() * b).log().norm(); }

template <class M>
class StatisticsOf : public testing::Test {};
using UsersTypes = testing::Types<Impostor, Told, ToldWithoutMemory>;
TYPED_TEST_SUITE(StatisticsOf, UsersTypes);

TYPED_TEST(StatisticsOf, aUsersTypeAreThoseOfTheLibrarys) {
  using M = TypeParam;
  const std::vector<SO3d> theirs = rotations(50, 0.3, 1);
  const std::vector<M> samples = as<M>(theirs);
  const std::vector<double> weights(samples.size(), 2.0);
  // Both iterations end within their tolerance of 1e-12.
  EXPECT_LE(gap(attitudeOf(mean(samples).mean), mean(theirs).mean), 1e-11);
  EXPECT_LE(gap(attitudeOf(mean(samples, weights).mean), mean(theirs).mean), 1e-11);

  const auto expected = certifiedMean(theirs);
  const auto certified = certifiedMean(samples);
  ASSERT_EQ(certified.status, Status::ok) << certified.reason;
  EXPECT_EQ(certified.uniqueness.unique, Uniqueness::unique);
  EXPECT_LE((certified.estimate->covariance - expected.estimate->covariance).norm(),
            1e-10 * expected.estimate->covariance.norm());
  EXPECT_EQ(uniqueness(samples, weights, mean(samples, weights)).unique, Uniqueness::unique);

  std::vector<Gaussian<M>> measured;
  std::vector<Gaussian<SO3d>> measured_rotations;
  for (const SO3d& R : theirs) {
    const Eigen::Matrix3d covariance = Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal();
    measured.push_back({withAttitude<M>(R), covariance});
    measured_rotations.push_back({R, covariance});
  }
  EXPECT_LE(gap(attitudeOf(maha(measured).mean), maha(measured_rotations).mean), 1e-11);

  CounterRng rng(2, 0);
  EXPECT_TRUE(std::isfinite(attitudeOf(sampleInCube<M>(rng)).log().norm()));
}

TEST(StatisticsOfUnknownTypes, certifyWhatDistancesAlone) {
  const auto samples = as<Impostor>(rotations(30, 1.2, 3));
  const auto result = mean(samples);
  ASSERT_EQ(result.status, Status::ok);
  ASSERT_GT(result.largest_distance, 0.5 * EIGEN_PI) << "too near for the test";
  EXPECT_EQ(uniqueness(samples, result).unique, Uniqueness::not_certified);
}

TYPED_TEST(StatisticsOf, typesThatSayTheirTraitsGetTheWholeCertificate) {
  using M = TypeParam;
  if constexpr (HasCompactFactor<M>) {
    const std::vector<SO3d> theirs = rotations(30, 1.2, 3);
    const std::vector<M> samples = as<M>(theirs);
    const auto expected = uniqueness(theirs, mean(theirs));
    const auto result = mean(samples);
    const auto certificate = uniqueness(samples, result);
    EXPECT_EQ(certificate.unique, Uniqueness::unique);
    EXPECT_STREQ(certificate.proof, expected.proof);
    EXPECT_NEAR(certificate.r_star, expected.r_star, 1e-9);
    EXPECT_NEAR(localRadius(samples, certificate.minimiser), certificate.r_star, 1e-9);
    // The same start, hence the same number of steps.
    EXPECT_EQ(result.iterations, mean(theirs).iterations);
    // A tie, and the mass near the cut locus.
    const auto pair = as<M>({SO3d::rotZ(0), SO3d::rotZ(EIGEN_PI)});
    EXPECT_EQ(uniqueness(pair, mean(pair)).unique, Uniqueness::ambiguous);
    const auto wide = rotations(200, 2, 4);
    EXPECT_NEAR(cutLocusMass(as<M>(wide), mean(as<M>(wide)), 0.4).hessian_change,
                cutLocusMass(wide, mean(wide), 0.4).hessian_change, 1e-9);
  }
}

TEST(Conventions, serveAUsersType) {
  const Gaussian<Told> g{withAttitude<Told>(SO3d::rotX(0.3)), Eigen::Vector3d(1, 2, 3).asDiagonal()};
  const Gaussian<SO3d> expected{SO3d::rotX(0.3), g.covariance};
  EXPECT_LE((worldAxesCovariance(g) - worldAxesCovariance(expected)).norm(), 1e-14);
  EXPECT_EQ(covarianceInOrder<Told>(g.covariance, rotation_first), g.covariance);
}

}  // namespace
