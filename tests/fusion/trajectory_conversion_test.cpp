// Conversion of trajectories: each fault, each figure, the verdict, and the matrices themselves.
#include <fusion/trajectory_conversion.hpp>
#include <report/describe.hpp>
#include <stats/convention_losses.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace liestat {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Poses {
  std::vector<SE3d> poses;
  std::vector<Matrix6> matrices;
};
Poses somePoses(std::size_t n, double scale = 1e-4, double distance = 3) {
  CounterRng rng(7, 1);
  Poses p;
  for (std::size_t k = 0; k < n; ++k) {
    p.poses.emplace_back(rng.unitQuaternion(), distance * rng.unitVector<3>());
    Matrix6 C = scale * Matrix6::Identity();
    for (int m = 0; m < 4; ++m) {
      const Eigen::Matrix<double, 6, 1> u = rng.normalVector<6>();
      C += scale * u * u.transpose();
    }
    p.matrices.push_back(C);
  }
  return p;
}
Convention named(const char* text) { return *parseConvention(text); }
TrajectoryConversion convert(const Poses& p, const char* from, const char* to, const ConversionOptions& options = {}) {
  return convertTrajectory(p.poses, p.matrices, named(from), named(to), options);
}
bool hasNote(const TrajectoryConversion& c, const std::string& part) {
  return std::any_of(c.notes.begin(), c.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

TEST(TrajectoryConversion, ConvertsEachMatrixAtItsPose) {
  const Poses p = somePoses(5);
  for (const NamedConvention& preset : convention_presets) {
    const TrajectoryConversion there = convertTrajectory(p.poses, p.matrices, {}, preset.convention);
    ASSERT_TRUE(there.verdict().isYes()) << preset.name << ": " << there.verdict().text;
    EXPECT_EQ(there.from, Convention{});
    EXPECT_EQ(there.to, preset.convention);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(there.matrices[i], convertConvention({}, preset.convention, p.poses[i], p.matrices[i])) << preset.name;
    }
    const TrajectoryConversion back = convertTrajectory(p.poses, there.matrices, preset.convention, {});
    for (std::size_t i = 0; i < 5; ++i) {
      // The tolerance covers the stated rounding, of entries in sigmas, and the condition of an information matrix.
      EXPECT_LE((back.matrices[i] - p.matrices[i]).cwiseAbs().maxCoeff(), 1e-11 * p.matrices[i].maxCoeff());
    }
  }
  // The same convention in another layout keeps each digit.
  const TrajectoryConversion same = convert(p, "left,layout=upper21", "left,layout=lower21");
  EXPECT_EQ(same.matrices, p.matrices);
  EXPECT_EQ(same.round_trip_bound, 0);
}

TEST(TrajectoryConversion, UnknownEntriesStayUnknownAndAreCounted) {
  Poses p = somePoses(3);
  p.matrices[0].setConstant(nan);
  p.matrices[1].topRightCorner<3, 3>().setConstant(nan), p.matrices[1].bottomLeftCorner<3, 3>().setConstant(nan);
  const TrajectoryConversion c = convert(p, "right", "ros-fixed");
  EXPECT_EQ(c.unknown, 1U);
  EXPECT_EQ(c.partly_unknown, 1U);
  EXPECT_TRUE(c.matrices[0].array().isNaN().all());
  EXPECT_TRUE((c.matrices[1].topLeftCorner<3, 3>().allFinite()));
  EXPECT_TRUE((c.matrices[1].topRightCorner<3, 3>().array().isNaN().all()));
  EXPECT_TRUE(hasNote(c, "1 covariances are unknown as a whole"));
  EXPECT_TRUE(hasNote(c, "1 covariances have unknown entries"));
  EXPECT_TRUE(c.verdict().isYes());
  // Zeros where they are asked for, and only between known components.
  const TrajectoryConversion assumed = convert(p, "right", "ros-fixed", {.assume_uncorrelated = true});
  EXPECT_EQ(assumed.assumed_uncorrelated, 1U);
  EXPECT_EQ(assumed.partly_unknown, 0U);
  EXPECT_EQ((assumed.matrices[1].topRightCorner<3, 3>()), Eigen::Matrix3d::Zero());
}

TEST(TrajectoryConversion, FaultsAreNamedAndTheOthersConverted) {
  struct Case {
    ConversionFault fault;
    Poses poses;
    const char *to, *said;
  };
  Poses indefinite = somePoses(3), far = somePoses(3), pole = somePoses(3), angles = somePoses(3), cross = somePoses(3),
        bare = somePoses(3);
  indefinite.matrices[1](0, 1) = indefinite.matrices[1](1, 0) = 1;
  far.poses[1] = SE3d(far.poses[1].so3(), Eigen::Vector3d(5e6, 0, 0));
  // Pitch 90° less 1e-5: cos² is 1e-10, and the angles' standard deviations of 1e-8 are 1e-3 there.
  const double pitch = std::acos(-1.) / 2 - 1e-5;
  pole.poses[1] =
      SE3d(SO3d(Eigen::Quaterniond(std::cos(pitch / 2), 0, std::sin(pitch / 2), 0)), Eigen::Vector3d(1, 2, 3));
  pole.matrices[1] = 1e-16 * Matrix6::Identity();
  angles.poses[1] = pole.poses[1];
  cross.matrices[1].topRightCorner<3, 3>().setConstant(nan),
      cross.matrices[1].bottomLeftCorner<3, 3>().setConstant(nan);
  bare.matrices[1].setConstant(nan), bare.matrices[1](0, 0) = 1;
  const std::vector<Case> cases{
      {ConversionFault::indefinite, indefinite, "g2o-full", "the matrix is indefinite"},
      {ConversionFault::far_origin, far, "left", "|p| is 5e+06 m: the origin is so far away"},
      {ConversionFault::near_pole, pole, "ros-rpy", "the pitch is so near to 90 degrees"},
      {ConversionFault::undefined_angles, angles, "ros-rpy", "the standard deviation of an Euler angle"},
      {ConversionFault::unknown_cross, cross, "g2o-full", "the matrix does not determine one of 'g2o-full'"},
      {ConversionFault::undetermined, bare, "left", "the matrix does not determine one of 'left'"}};
  for (const Case& k : cases) {
    const TrajectoryConversion c = convert(k.poses, "right", k.to);
    ASSERT_EQ(c.faults.size(), 1U) << name(k.fault);
    EXPECT_EQ(name(c.faults[0].fault), std::string(name(k.fault)));
    EXPECT_EQ(c.faults[0].row, 1U) << name(k.fault);
    EXPECT_EQ(c.faults[0].found.rfind(k.said, 0), 0U) << c.faults[0].found;
    EXPECT_TRUE(c.matrices[1].array().isNaN().all()) << name(k.fault);
    EXPECT_TRUE(c.matrices[0].allFinite() && c.matrices[2].allFinite()) << name(k.fault);
    const Verdict verdict = c.verdict();
    EXPECT_TRUE(verdict.isNo());
    EXPECT_EQ(verdict.text, "not converted: 1 of 3 matrices");
    EXPECT_EQ(verdict.causes, std::vector<std::string>{c.faults[0].found});
  }
}

TEST(TrajectoryConversion, IndefiniteMatricesAreConvertedAndNotTrusted) {
  Poses p = somePoses(5);
  for (const std::size_t i : {1U, 3U, 4U}) p.matrices[i](0, 1) = p.matrices[i](1, 0) = 1;
  TrajectoryConversion c = convert(p, "right", "left");
  EXPECT_EQ(c.indefinite, (std::vector<std::size_t>{1, 3, 4}));
  EXPECT_TRUE(c.faults.empty());
  EXPECT_TRUE(hasNote(c, "3 of 5 matrices are indefinite (row 1, 3, 4)"));
  EXPECT_TRUE(c.verdict().isNo());
  EXPECT_EQ(c.verdict().text, "not trusted: 3 of 5 matrices are indefinite");
  c = convert(p, "right", "left", {.lines = {2, 3, 4, 7, 8}});
  EXPECT_TRUE(hasNote(c, "3 of 5 matrices are indefinite (line 3, 7, 8)"));
  // A singular one is no indefinite one.
  p = somePoses(1);
  p.matrices[0].row(2).setZero(), p.matrices[0].col(2).setZero();
  c = convert(p, "right", "ros-fixed");
  EXPECT_EQ(c.zero_variances, 1U);
  EXPECT_TRUE(c.verdict().isYes());
}

TEST(TrajectoryConversion, LossesAreBounded) {
  // From far away: the digits were lost by whoever wrote it.
  Poses distant = somePoses(2, 1e-6, 5e6);
  for (std::size_t i = 0; i < 2; ++i)
    distant.matrices[i] = leftCovariance<SE3d>({distant.poses[i], distant.matrices[i]});
  const TrajectoryConversion far = convert(distant, "left", "right");
  EXPECT_EQ(far.far_input, 2U);
  EXPECT_GT(far.round_trip_bound, largest_round_trip);
  EXPECT_TRUE(hasNote(far, "2 matrices are about an origin so far away"));
  // Beyond the first order, and by sampling, which is told apart from it.
  const Poses large = somePoses(3, 0.02);
  const TrajectoryConversion first = convert(large, "right", "ros-fixed");
  EXPECT_EQ(first.beyond_first_order, 3U);
  EXPECT_GT(first.largest_rotation_sigma, first_order_sigma);
  EXPECT_TRUE(hasNote(first, "first order fails, use `sampled`"));
  const TrajectoryConversion sampled = convert(large, "right", "ros-fixed", {.sampled = true});
  EXPECT_FALSE(hasNote(sampled, "first order fails"));
  EXPECT_TRUE(hasNote(sampled, "second moments by sampling"));
  EXPECT_GT(sampled.sampling_error, 0);
  EXPECT_LT(sampled.sampling_error, 0.1);
  EXPECT_GT((sampled.matrices[0] - first.matrices[0]).norm(), 0.01 * first.matrices[0].norm());
  // Reproducible, and another seed gives other numbers.
  EXPECT_EQ(convert(large, "right", "ros-fixed", {.sampled = true}).matrices, sampled.matrices);
  EXPECT_NE(convert(large, "right", "ros-fixed", {.sampled = true, .seed = 2}).matrices, sampled.matrices);
  // Within a family of perturbations there is nothing to sample.
  EXPECT_EQ(convert(large, "right", "left", {.sampled = true}).sampling_error, 0);
}

TEST(TrajectoryConversion, NothingIsNoVerdict) {
  const TrajectoryConversion c = convert({}, "right", "left");
  EXPECT_TRUE(c.verdict().isNone());
  EXPECT_TRUE(TrajectoryConversion{}.verdict().isNone());
  const std::vector<FieldDescription> fields = fieldsOf<TrajectoryConversion>();
  EXPECT_EQ(fields.front().name, "covariances");
  EXPECT_EQ(fields.at(1).fields.at(2).name, "perturbation");
  EXPECT_EQ(fields.back().name, "notes");
}

}  // namespace
}  // namespace liestat
