// Conventions of poses' covariances: Jacobians against differences of the exact coordinates, round trips, what commutes
// with a conversion, and mistakes that must show.

#include <stats/convention_charts.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>
#include <stats/convention_sampling.hpp>
#include <stats/conventions.hpp>
#include <stats/propagation.hpp>
#include <stats/random.hpp>

#include <support/full_pose.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <functional>
#include <limits>
#include <span>
#include <sstream>
#include <string>
#include <vector>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::scaledGap, liestat_test::Matrix6, liestat_test::Vector6;
constexpr double pi = 3.14159265358979323846;
constexpr double eps = std::numeric_limits<double>::epsilon();

/// Each perturbation in each order and unit.
std::vector<Convention> allCoordinates() {
  std::vector<Convention> all;
  for (const Perturbation p : all_perturbations) {
    for (const auto order : {CovarianceOrder::translation_rotation, CovarianceOrder::rotation_translation}) {
      for (const auto unit :
           {RotationUnit::radian, RotationUnit::half_angle, RotationUnit::double_angle, RotationUnit::degree}) {
        all.push_back({order, p, unit});
      }
    }
  }
  return all;
}
std::vector<NamedConvention> allNamed() {
  std::vector<NamedConvention> all(std::begin(convention_presets), std::end(convention_presets));
  all.insert(all.end(), std::begin(convention_aliases), std::end(convention_aliases));
  return all;
}

/// The Jacobian of a function of six numbers at zero, by central differences of sixth order: with h = 2e-3 rounding
/// is some 1e-13, and what the order leaves out h⁶ = 6e-17 of the seventh derivative.
template <class F>
Matrix6 jacobianAtZero(F&& f) {
  constexpr double h = 2e-3;
  Matrix6 J;
  for (int i = 0; i < 6; ++i) {
    const auto odd = [&](int k) -> Vector6 {
      const Vector6 d = k * h * Vector6::Unit(i);
      return f(d) - f(Vector6(-d));
    };
    J.col(i) = (45 * odd(1) - 9 * odd(2) + odd(3)) / (60 * h);
  }
  return J;
}

TEST(PoseConventions, jacobiansAreTheDerivativesOfTheCharts) {
  CounterRng rng(11, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const SE3d T = fullGaussian(rng).mean;
    for (const Convention& c : allCoordinates()) {
      const Matrix6 J = conventionJacobian(c, T);
      const Matrix6 differences =
          jacobianAtZero([&](const Vector6& d) { return conventionLog(c, T, T * SE3d::exp(d)); });
      EXPECT_LE((J - differences).cwiseAbs().maxCoeff(), 1e-9 * std::max(1.0, J.cwiseAbs().maxCoeff()))
          << conventionName(c);
      EXPECT_LE((J * conventionJacobianInverse(c, T) - Matrix6::Identity()).norm(), 1e-12) << conventionName(c);
      EXPECT_NEAR(conventionLogDeterminant(c, T), std::log(std::abs(J.determinant())), 1e-12) << conventionName(c);
    }
  }
}

TEST(PoseConventions, chartsAreBijective) {
  CounterRng rng(12, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean;
    // Large errors: a radian, a metre.
    Vector6 xi = rng.normalVector<6>();
    xi.tail<3>() *= 0.5;
    const SE3d T = T_hat * SE3d::exp(xi);
    for (const Convention& c : allCoordinates()) {
      const SE3d back = conventionExp(c, T_hat, conventionLog(c, T_hat, T));
      EXPECT_LE((back.matrix() - T.matrix()).norm(), 1e-12) << conventionName(c);
      EXPECT_LE(conventionLog(c, T_hat, T_hat).norm(), 1e-14 * unitsPerRadian(RotationUnit::degree))
          << conventionName(c);
    }
  }
}

TEST(PoseConventions, roundTripsOfAllOrderedPairs) {
  CounterRng rng(13, 0);
  for (const double distance : {0.0, 2.0, 100.0, 1e4}) {
    Gaussian<SE3d> g = fullGaussian(rng, 1e-4);
    g.mean = SE3d(g.mean.so3(), distance * Eigen::Vector3d(g.mean.translation()).normalized());
    for (const NamedConvention& from : allNamed()) {
      const Matrix6 C = toConvention(from.convention, g);
      for (const NamedConvention& to : allNamed()) {
        const Gaussian<SE3d> there = fromConvention(from.convention, g.mean, C);
        const Matrix6 D = toConvention(to.convention, there);
        const Gaussian<SE3d> back = fromConvention(to.convention, g.mean, D);
        // An information matrix adds an inversion, whose error grows with the condition, here 18.
        const double bound = conversionLoss(from.convention, to.convention, g).round_trip +
                             conversionLoss({}, from.convention, g).round_trip +
                             conversionLoss({}, to.convention, g).round_trip;
        EXPECT_LE(scaledGap(back.covariance, g.covariance), bound)
            << from.name << " to " << to.name << " at " << distance << " m";
        // Directly, from one to the other: the same, and nothing at all where nothing is to be done.
        const Matrix6 direct = convertConvention(from.convention, to.convention, g.mean, C);
        EXPECT_LE(scaledGap(direct, D), bound) << from.name << " to " << to.name << " at " << distance << " m";
        if (from.convention == to.convention) {
          EXPECT_EQ(direct, C) << from.name;
        }
      }
    }
  }
}

TEST(PoseConventions, textOfConventions) {
  for (const Convention& c : allCoordinates()) {
    for (const auto content :
         {CovarianceContent::covariance, CovarianceContent::information, CovarianceContent::sigmas}) {
      for (const auto layout :
           {CovarianceLayout::full36, CovarianceLayout::upper21, CovarianceLayout::lower21, CovarianceLayout::blocks12,
            CovarianceLayout::diag6, CovarianceLayout::planar6, CovarianceLayout::toro6}) {
        Convention d = c;
        d.content = content;
        d.layout = layout;
        EXPECT_EQ(parseConvention(conventionName(d)), d) << conventionName(d);
      }
    }
  }
  for (const NamedConvention& n : allNamed()) EXPECT_EQ(parseConvention(n.name), n.convention) << n.name;
  EXPECT_EQ(conventionName(*parseConvention("gtsam")), "right,order=rt");
  for (const char* wrong :
       {"", "rigth", "right,", "right,order", "right,order=", "right,order=xy", "right,side=left"}) {
    EXPECT_FALSE(parseConvention(wrong)) << wrong;
  }
}

// --- Golden numbers ---------------------------------------------------------------------------------------------------

/// tests/data/pose_conventions.txt, which an independent program wrote with 60 digits.
struct Golden {
  struct Row {
    std::string name, layout;
    std::vector<double> numbers;
  };
  Gaussian<SE3d> g;
  std::vector<Row> rows;

  Golden() {
    std::ifstream file(LIESTAT_SOURCE_DIR "/tests/data/pose_conventions.txt");
    Eigen::Vector3d phi, p;
    for (std::string line; std::getline(file, line);) {
      if (line.empty() || line[0] == '#') continue;
      std::istringstream words(line);
      Row row;
      words >> row.name;
      if (row.name != "phi" && row.name != "p" && row.name != "sigma") words >> row.layout;
      for (double x = 0; words >> x;) row.numbers.push_back(x);
      if (row.name == "phi") phi = Eigen::Map<Eigen::Vector3d>(row.numbers.data());
      if (row.name == "p") p = Eigen::Map<Eigen::Vector3d>(row.numbers.data());
      if (row.name == "sigma") g.covariance = Eigen::Map<Matrix6>(row.numbers.data());
      if (!row.layout.empty()) rows.push_back(row);
    }
    g.mean = SE3d(SO3d::exp(phi), p);
  }
  /// The matrix of a convention.
  Matrix6 matrix(const std::string& name) const {
    for (const Row& row : rows) {
      if (row.name == name && row.layout == "full36") return Eigen::Map<const Matrix6>(row.numbers.data());
    }
    return Matrix6::Constant(std::numeric_limits<double>::quiet_NaN());
  }
};

TEST(PoseConventions, goldenNumbersOfEachPresetAndLayout) {
  const Golden golden;
  ASSERT_EQ(golden.rows.size(), 70U);
  for (const NamedConvention& preset : convention_presets) {
    EXPECT_TRUE(golden.matrix(std::string(preset.name)).allFinite()) << "no golden numbers of " << preset.name;
  }
  for (const Golden::Row& row : golden.rows) {
    Convention c = *conventionPreset(row.name);
    ASSERT_TRUE(setConventionField(c, "layout", row.layout));
    const PackedCovariance packed = packCovariance(c, toConvention(c, golden.g));
    ASSERT_EQ(packed.size, row.numbers.size()) << row.name << " " << row.layout;
    ASSERT_EQ(packed.size, layoutSize(c.layout));
    const Matrix6 M = golden.matrix(row.name);
    const double largest = M.diagonal().maxCoeff();
    for (std::size_t k = 0; k < packed.size; ++k) {
      EXPECT_NEAR(packed.storage[k], row.numbers[k], 1e-13 * largest) << row.name << " " << row.layout << " " << k;
    }
    // Back: what the layout has is the matrix, and the rest is unknown.
    const auto unpacked = unpackCovariance(c, row.numbers);
    ASSERT_TRUE(unpacked);
    int n_known = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        if (std::isnan((*unpacked)(i, j))) continue;
        ++n_known;
        EXPECT_EQ((*unpacked)(i, j), M(i, j)) << row.name << " " << row.layout;
      }
    }
    EXPECT_EQ(n_known, row.layout == "blocks12" ? 18 : row.layout == "diag6" ? 6 : 36) << row.layout;
    if (n_known == 36) {
      EXPECT_LE(scaledGap(fromConvention(c, golden.g.mean, *unpacked).covariance, golden.g.covariance), 1e-12)
          << row.name;
    }
    EXPECT_FALSE(unpackCovariance(c, std::span(row.numbers).first(row.numbers.size() - 1)));
  }
}

TEST(PoseConventions, planarLayoutsHaveTheirOwnSequence) {
  Matrix6 M;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) M(i, j) = 10 * std::min(i, j) + std::max(i, j);
  }
  const auto numbers = [&](const Convention& c) {
    const PackedCovariance packed = packCovariance(c, M);
    return std::vector<double>(packed.numbers().begin(), packed.numbers().end());
  };
  EXPECT_EQ(numbers({.layout = CovarianceLayout::planar6}), (std::vector<double>{0, 1, 5, 11, 15, 55}));
  EXPECT_EQ(numbers({.layout = CovarianceLayout::toro6}), (std::vector<double>{0, 1, 11, 55, 5, 15}));
  // Rotation first, x y z are the last three, yaw the third; and yaw comes first of three angles.
  EXPECT_EQ(numbers({.order = CovarianceOrder::rotation_translation, .layout = CovarianceLayout::toro6}),
            (std::vector<double>{33, 34, 44, 22, 23, 24}));
  EXPECT_EQ(numbers({.perturbation = Perturbation::yaw_pitch_roll, .layout = CovarianceLayout::planar6}),
            (std::vector<double>{0, 1, 3, 11, 13, 33}));
  const std::vector<double> skew = [] {
    std::vector<double> v(36, 0.0);
    for (std::size_t i = 0; i < 6; ++i) v[7 * i] = 4;
    v[1] = 1, v[6] = -1;
    return v;
  }();
  EXPECT_DOUBLE_EQ(asymmetry(std::span<const double, 36>(skew)), 0.5);
}

TEST(PoseConventions, planarPosesStayPlanar) {
  // x, y and yaw of a pose in the plane do not depend on what is not known of z, roll and pitch.
  const SE3d T(SO3d::rotZ(0.7), Eigen::Vector3d(3, -2, 0));
  const std::vector<double> numbers = {0.04, 0.01, 0.003, 0.09, -0.004, 0.0025};
  for (const Convention& c : allCoordinates()) {
    if (c.perturbation == Perturbation::rotation_vector) continue;
    Convention planar = c;
    planar.layout = CovarianceLayout::planar6;
    planar.content = CovarianceContent::information;
    const Matrix6 known = *unpackCovariance({.layout = CovarianceLayout::planar6}, numbers);
    const Matrix6 there = toConvention(planar, {T, known});
    const PackedCovariance packed = packCovariance(planar, there);
    for (const double v : packed.numbers()) EXPECT_TRUE(std::isfinite(v)) << conventionName(planar);
    EXPECT_TRUE(std::isnan(there(planar.order == CovarianceOrder::translation_rotation ? 2 : 5, 0)));
    const Matrix6 back = fromConvention(planar, T, *unpackCovariance(planar, packed.numbers())).covariance;
    for (const int i : {0, 1, 5}) {
      for (const int j : {0, 1, 5}) EXPECT_NEAR(back(i, j), known(i, j), 1e-14) << conventionName(planar);
    }
  }
}

TEST(PoseConventions, unknownStaysUnknownAndNothingElseBecomes) {
  const Golden golden;
  Matrix6 blocks = golden.g.covariance;
  blocks.topRightCorner<3, 3>().setConstant(std::numeric_limits<double>::quiet_NaN());
  blocks.bottomLeftCorner<3, 3>().setConstant(std::numeric_limits<double>::quiet_NaN());
  // Each block for itself where the perturbation does not mix them.
  const Matrix6 fixed = toConvention(*conventionPreset("ros-fixed"), {golden.g.mean, blocks});
  const Matrix6 expected = golden.matrix("ros-fixed");
  EXPECT_LE((fixed.topLeftCorner<3, 3>() - expected.topLeftCorner<3, 3>()).norm(), 1e-15);
  EXPECT_LE((fixed.bottomRightCorner<3, 3>() - expected.bottomRightCorner<3, 3>()).norm(), 1e-15);
  EXPECT_TRUE((fixed.topRightCorner<3, 3>().array().isNaN()).all());
  // About the world's origin the translation's block depends on the cross block, the rotation's does not.
  const Matrix6 left = toConvention(*conventionPreset("left"), {golden.g.mean, blocks});
  EXPECT_TRUE((left.topLeftCorner<3, 3>().array().isNaN()).all());
  EXPECT_LE((left.bottomRightCorner<3, 3>() - golden.matrix("left").bottomRightCorner<3, 3>()).norm(), 1e-15);
  // No block of an information matrix is known without the cross block.
  EXPECT_TRUE(toConvention(*conventionPreset("g2o-full"), {golden.g.mean, blocks}).array().isNaN().all());
  // An indefinite information matrix has no covariance.
  Matrix6 indefinite = Matrix6::Identity();
  indefinite(0, 1) = indefinite(1, 0) = 2;
  EXPECT_TRUE(
      fromConvention(*conventionPreset("g2o-full"), golden.g.mean, indefinite).covariance.array().isNaN().all());
}

TEST(PoseConventions, sigmasKeepTheCorrelations) {
  const Golden golden;
  const Matrix6 S = covarianceAsContent(CovarianceContent::sigmas, golden.g.covariance);
  for (int i = 0; i < 6; ++i) {
    EXPECT_DOUBLE_EQ(S(i, i), std::sqrt(golden.g.covariance(i, i)));
    for (int j = 0; j < 6; ++j) {
      const double r = golden.g.covariance(i, j) / std::sqrt(golden.g.covariance(i, i) * golden.g.covariance(j, j));
      EXPECT_NEAR(S(i, j) / std::sqrt(S(i, i) * S(j, j)), r, 1e-15);
    }
  }
  EXPECT_LE(scaledGap(covarianceFromContent(CovarianceContent::sigmas, S), golden.g.covariance), 1e-14);
  Matrix6 diagonal = Matrix6::Zero();
  diagonal.diagonal() << 0.1, 0.2, 0.3, 0, 0.5, 0.6;
  const Matrix6 squares = diagonal.cwiseAbs2();
  EXPECT_LE((covarianceFromContent(CovarianceContent::sigmas, diagonal) - squares).norm(), 1e-16);
  EXPECT_LE((covarianceAsContent(CovarianceContent::sigmas, squares) - diagonal).norm(), 1e-16);
}

// --- Mistakes that must show -----------------------------------------------------------------------------------------

TEST(PoseConventions, shortcutsAreFarFromTheGoldenNumbers) {
  const Golden golden;
  const Eigen::Matrix3d R = golden.g.mean.rotationMatrix();
  const auto blockDiagonal = [](const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
    Matrix6 J = Matrix6::Zero();
    J.topLeftCorner<3, 3>() = a;
    J.bottomRightCorner<3, 3>() = b;
    return J;
  };
  const Matrix6 rotated = blockDiagonal(R, R);
  Matrix6 swap = Matrix6::Zero();
  swap.topRightCorner<3, 3>().setIdentity(), swap.bottomLeftCorner<3, 3>().setIdentity();
  using Mutant = std::pair<const char*, std::function<Matrix6(const Matrix6&, const Convention&)>>;
  const std::vector<Mutant> mutants = {
      {"the foreign matrix rotated as tf2 does",
       [&](const Matrix6& C, const Convention&) -> Matrix6 { return rotated * C * rotated.transpose(); }},
      {"the foreign matrix rotated back",
       [&](const Matrix6& C, const Convention&) -> Matrix6 { return rotated.transpose() * C * rotated; }},
      {"the order alone changed", [&](const Matrix6& C, const Convention&) -> Matrix6 { return swap * C * swap; }},
      {"blocks swapped, cross block left where it was",
       [&](const Matrix6& C, const Convention&) {
         Matrix6 D = C;
         D.topLeftCorner<3, 3>() = C.bottomRightCorner<3, 3>();
         D.bottomRightCorner<3, 3>() = C.topLeftCorner<3, 3>();
         return D;
       }},
      {"the cross block with the wrong sign",
       [&](const Matrix6& C, const Convention&) -> Matrix6 {
         const Matrix6 s = blockDiagonal(Eigen::Matrix3d::Identity(), -Eigen::Matrix3d::Identity());
         return s * C * s;
       }},
      {"half of the angle",
       [&](const Matrix6& C, const Convention&) -> Matrix6 {
         const Matrix6 s = blockDiagonal(Eigen::Matrix3d::Identity(), 0.5 * Eigen::Matrix3d::Identity());
         return s * C * s;
       }},
      {"twice the angle",
       [&](const Matrix6& C, const Convention&) -> Matrix6 {
         const Matrix6 s = blockDiagonal(Eigen::Matrix3d::Identity(), 2 * Eigen::Matrix3d::Identity());
         return s * C * s;
       }},
      {"the inverse used for the matrix", [&](const Matrix6& C, const Convention&) -> Matrix6 { return C.inverse(); }},
      {"the Jacobian transposed",
       [&](const Matrix6&, const Convention& c) -> Matrix6 {
         const Matrix6 J = conventionJacobian(c, golden.g.mean);
         return covarianceAsContent(c.content, J.transpose() * golden.g.covariance * J);
       }},
      {"the Jacobian of the inverse pose",
       [&](const Matrix6&, const Convention& c) -> Matrix6 {
         const Matrix6 J = conventionJacobian(c, golden.g.mean.inverse());
         return covarianceAsContent(c.content, J * golden.g.covariance * J.transpose());
       }},
      {"right taken for this", [&](const Matrix6&, const Convention&) -> Matrix6 { return golden.g.covariance; }}};
  for (const NamedConvention& preset : convention_presets) {
    const Convention& c = preset.convention;
    const Matrix6 correct = golden.matrix(std::string(preset.name));
    const Matrix6 ours = toConvention(c, golden.g);
    ASSERT_LE(scaledGap(ours, correct), 1e-12) << preset.name;
    for (const auto& [what, mutant] : mutants) {
      // J = I on each block, or a multiple of it, is its own transpose, and the same at any pose.
      const bool identity = c.perturbation == Perturbation::right || c.perturbation == Perturbation::body_axes;
      if (identity && std::string(what).find("the Jacobian") == 0) continue;
      if (c == Convention{} && std::string(what).find("right") == 0) continue;
      EXPECT_GT(scaledGap(mutant(ours, c), correct), 0.02) << preset.name << ": " << what;
    }
  }
  // The nearest to pass: the derivative of the rotation vector taken for the rotation in the body's axes, 7 % at 1 rad.
  Convention rvec = *conventionPreset("opencv-rvec");
  rvec.perturbation = Perturbation::world_body_axes;
  EXPECT_GT(scaledGap(toConvention(rvec, golden.g), golden.matrix("opencv-rvec")), 0.02);
}

// --- What commutes with a conversion ---------------------------------------------------------------------------------

TEST(PoseConventions, compositionInverseAndReframingCommute) {
  CounterRng rng(21, 0);
  for (int trial = 0; trial < 3; ++trial) {
    const Gaussian<SE3d> a = fullGaussian(rng), b = fullGaussian(rng);
    const SE3d A = fullGaussian(rng).mean;
    for (const NamedConvention& named : allNamed()) {
      Convention c = named.convention;
      c.content = CovarianceContent::covariance;
      const Matrix6 C_a = toConvention(c, a), C_b = toConvention(c, b);
      const auto at = [&](const SE3d& T, const Vector6& x) { return conventionExp(c, T, x); };
      // a·b with the errors of the convention's own coordinates, without any of the closed forms.
      const SE3d ab = a.mean * b.mean;
      const Matrix6 J_a =
          jacobianAtZero([&](const Vector6& x) { return conventionLog(c, ab, at(a.mean, x) * b.mean); });
      const Matrix6 J_b =
          jacobianAtZero([&](const Vector6& x) { return conventionLog(c, ab, a.mean * at(b.mean, x)); });
      const Matrix6 composed = J_a * C_a * J_a.transpose() + J_b * C_b * J_b.transpose();
      EXPECT_LE(scaledGap(toConvention(c, compose(a, b)), composed), 1e-12) << named.name;
      EXPECT_LE(scaledGap(fromConvention(c, ab, composed).covariance, compose(a, b).covariance), 1e-12) << named.name;
      const SE3d inverted = a.mean.inverse();
      const Matrix6 J_i =
          jacobianAtZero([&](const Vector6& x) { return conventionLog(c, inverted, at(a.mean, x).inverse()); });
      EXPECT_LE(scaledGap(toConvention(c, inverse(a)), J_i * C_a * J_i.transpose()), 1e-12) << named.name;
      // Another world: only `right` does not see it.
      const SE3d moved = A * a.mean;
      const Matrix6 J_w = jacobianAtZero([&](const Vector6& x) { return conventionLog(c, moved, A * at(a.mean, x)); });
      EXPECT_LE(scaledGap(toConvention(c, act(A, a)), J_w * C_a * J_w.transpose()), 1e-12) << named.name;
    }
  }
}

/// The closed forms of programs, which agree with conversions to rounding.
TEST(PoseConventions, closedFormsOfOtherProgramsCommute) {
  CounterRng rng(22, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const Gaussian<SE3d> a = fullGaussian(rng), b = fullGaussian(rng);
    const SE3d A = fullGaussian(rng).mean;
    const Convention left = *conventionPreset("left"), fixed = *conventionPreset("ros-fixed");
    // pytransform3d, globally: C1 + Ad(T1) C2 Ad(T1)ᵀ.
    const Matrix6 Ad = a.mean.Adj();
    const Matrix6 concatenated = toConvention(left, a) + Ad * toConvention(left, b) * Ad.transpose();
    EXPECT_LE(scaledGap(toConvention(left, compose(a, b)), concatenated), 1e-12);
    // `left` of T is `right` of the inverse, number by number.
    EXPECT_LE(scaledGap(toConvention(left, a), inverse(a).covariance), 1e-12);
    // tf2: another world turns both blocks.
    Matrix6 turned = Matrix6::Zero();
    turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = A.rotationMatrix();
    EXPECT_LE(scaledGap(toConvention(fixed, act(A, a)), turned * toConvention(fixed, a) * turned.transpose()), 1e-12);
    // A composition along the world's axes, as robot_localization writes it: the lever arm of b.
    Matrix6 by_a = Matrix6::Identity(), by_b = Matrix6::Zero();
    const Eigen::Vector3d arm = a.mean.so3() * b.mean.translation();
    by_a.topRightCorner<3, 3>() = -SO3d::hat(arm);
    by_b.topLeftCorner<3, 3>() = by_b.bottomRightCorner<3, 3>() = a.mean.rotationMatrix();
    const Matrix6 sum =
        by_a * toConvention(fixed, a) * by_a.transpose() + by_b * toConvention(fixed, b) * by_b.transpose();
    EXPECT_LE(scaledGap(toConvention(fixed, compose(a, b)), sum), 1e-12);
    EXPECT_EQ(act(A, a).covariance, a.covariance);
  }
}

TEST(PoseConventions, familiesAreLinearAtAnySize) {
  CounterRng rng(23, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean;
    Vector6 xi = rng.normalVector<6>();
    xi.tail<3>() *= 0.6;
    const SE3d T = T_hat * SE3d::exp(xi);
    for (const Perturbation p : all_perturbations) {
      for (const Perturbation q : all_perturbations) {
        if (family(p) != family(q)) continue;
        const Convention from{.perturbation = p}, to{.perturbation = q};
        const Vector6 x = conventionLog(from, T_hat, T);
        const Vector6 y = conventionJacobian(to, T_hat) * (conventionJacobianInverse(from, T_hat) * x);
        EXPECT_LE((y - conventionLog(to, T_hat, T)).norm(), 1e-12) << name(p) << " to " << name(q);
      }
    }
  }
}

// --- What is lost -----------------------------------------------------------------------------------------------------

TEST(PoseConventions, farOriginsLoseDigitsWithinTheBound) {
  CounterRng rng(31, 0);
  const Convention right, left = *conventionPreset("left");
  double worst_gap = 0;
  for (const double distance : {1.0, 100.0, 1e4, 5e6}) {
    for (int trial = 0; trial < 50; ++trial) {
      Gaussian<SE3d> g = fullGaussian(rng, 1e-4);
      g.mean = SE3d(g.mean.so3(), distance * rng.unitVector<3>());
      const ConversionLoss loss = conversionLoss(right, left, g);
      const double gap = scaledGap(fromConvention(left, g.mean, toConvention(left, g)).covariance, g.covariance);
      EXPECT_LE(gap, loss.round_trip) << distance;
      worst_gap = std::max(worst_gap, gap);
      // Other pairs do not see the distance.
      const Convention fixed = *conventionPreset("ros-fixed");
      EXPECT_LE(conversionLoss(right, fixed, g).round_trip, 65 * eps);
      EXPECT_LE(scaledGap(fromConvention(fixed, g.mean, toConvention(fixed, g)).covariance, g.covariance), 65 * eps);
      EXPECT_TRUE(distance > 100 || loss.problem == ConversionProblem::none) << distance;
      EXPECT_TRUE(distance < 5e6 || loss.problem == ConversionProblem::far_origin) << distance;
    }
  }
  EXPECT_GT(worst_gap, 1e-6) << "the refusal is not idle";
}

TEST(PoseConventions, eulerAnglesLoseDigitsNearTheirPole) {
  CounterRng rng(32, 0);
  const Convention right, rpy = *conventionPreset("ros-rpy");
  for (const double from_pole : {0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-7}) {
    for (int trial = 0; trial < 50; ++trial) {
      Gaussian<SE3d> g = fullGaussian(rng, 1e-12 * from_pole);
      g.mean = SE3d(fromRollPitchYaw(rng.uniform(-3, 3), pi / 2 - from_pole, rng.uniform(-3, 3)), g.mean.translation());
      const ConversionLoss loss = conversionLoss(right, rpy, g);
      const double gap = scaledGap(fromConvention(rpy, g.mean, toConvention(rpy, g)).covariance, g.covariance);
      EXPECT_LE(gap, loss.round_trip) << from_pole;
      EXPECT_TRUE(from_pole > 1e-7 || loss.problem != ConversionProblem::none);
      EXPECT_TRUE(from_pole < 1e-3 || loss.problem == ConversionProblem::none) << from_pole;
    }
  }
  // A sigma of 0.1 rad is 2 rad of roll and yaw at 0.05 rad from the pole.
  Gaussian<SE3d> g{SE3d(fromRollPitchYaw(0.3, 1.52, 0.2), Eigen::Vector3d(1, 2, 3)), 0.01 * Matrix6::Identity()};
  EXPECT_EQ(conversionLoss(right, rpy, g).problem, ConversionProblem::undefined_angles);
  EXPECT_GT(conversionLoss(right, rpy, g).angle_sigma, 0.5);
  EXPECT_EQ(conversionLoss(rpy, *conventionPreset("mrpt-ypr"), g).problem, ConversionProblem::none);
}

TEST(PoseConventions, largeRotationsAskForSamples) {
  Gaussian<SE3d> g;
  g.covariance.diagonal() << 1, 1, 1, 0.02, 0.005, 0.005;
  EXPECT_TRUE(conversionLoss({}, *conventionPreset("ros-rpy"), g).firstOrderFails());
  EXPECT_FALSE(conversionLoss({}, *conventionPreset("left"), g).firstOrderFails()) << "linear at any size";
  g.covariance(3, 3) = 0.009;
  EXPECT_FALSE(conversionLoss({}, *conventionPreset("ros-rpy"), g).firstOrderFails());
}

TEST(PoseConventions, sampledMomentsKeepTheLawThatTheFirstOrderLoses) {
  CounterRng rng(33, 0);
  const Convention rpy = *conventionPreset("ros-rpy"), right;
  const SE3d T_hat(fromRollPitchYaw(0.4, -0.6, 1.1), Eigen::Vector3d(1, -0.8, 1.3));
  // Translations of a metre, rotations of 0.4 rad, correlated.
  Matrix6 C = fullGaussian(rng, 0.4).covariance;
  C.rightCols<3>() *= 0.3, C.bottomRows<3>() *= 0.3;
  const SampledMoments moments = sampledConversion(rpy, right, T_hat, C, 20000, 1, 0);
  const Matrix6 first_order = toConvention(right, fromConvention(rpy, T_hat, C));
  const detail::SemidefiniteRoot<double, 6> root(C);
  double sampled = 0, linear = 0;
  constexpr int trials = 40000;
  for (int k = 0; k < trials; ++k) {
    const Vector6 x = root * rng.normalVector<6>();
    const Vector6 xi = conventionLog(right, T_hat, conventionExp(rpy, T_hat, x));
    sampled += mahalanobisSquared<double, 6>(xi, moments.second_moment) / (6 * trials);
    linear += mahalanobisSquared<double, 6>(xi, first_order) / (6 * trials);
  }
  // E[xᵀ M⁻¹ x] = 6; four standard errors of the trials (variance of d² below 4·12) and those of the moments.
  EXPECT_NEAR(sampled, 1, 4 * std::sqrt(48.0 / trials) / 6 + 4 * moments.relative_error);
  EXPECT_GT(linear, 1.1);
  EXPECT_LT(moments.relative_error, 0.03);
  // Small errors: the sampled part vanishes, and few samples do.
  const Matrix6 small = 1e-6 * C;
  const SampledMoments exact = sampledConversion(rpy, right, T_hat, small, 10, 1, 0);
  EXPECT_LE(scaledGap(exact.second_moment, fromConvention(rpy, T_hat, small).covariance), 1e-4);
  Matrix6 unknown = C;
  unknown(0, 1) = unknown(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(sampledConversion(rpy, right, T_hat, unknown, 10, 1, 0).second_moment.array().isNaN().all());
}

}  // namespace
}  // namespace liestat
