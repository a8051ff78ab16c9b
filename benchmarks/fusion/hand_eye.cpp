// Hand-eye calibration beside OpenCV's seven methods, on the same scenes.
//
// 100 scenes of absolute poses (experiments/hand_eye_scene.hpp), three kinds of noise, 8, 20 and 50 pairs, and motions on
// which closed forms fail; one thread. One iteration estimates each of the scenes once. Counters:
//
//   ms           median over the scenes of the shortest time of an estimate
//   rms_deg      root mean square of the errors of X: rotation (degrees)
//   rms_mm       translation (mm); of planar motion that across the axis, which alone is determined
//   worst_deg    the largest error of the rotation
//   failed       scenes without an estimate (not finite), if any; they are left out of the errors
#include <experiments/hand_eye_scene.hpp>
#include <fusion/hand_eye.hpp>
#include <lie/units.hpp>

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#ifdef LIESTAT_OPENCV
#include <opencv2/calib3d.hpp>
#endif

namespace liestat::bench {
namespace {

using experiments::HandEyeMotion;
using experiments::HandEyeNoise;
using experiments::HandEyeScene;
using experiments::HandEyeSceneOptions;

constexpr std::uint64_t scene_count = 100;

/// A scene in the forms that the candidates take.
struct Problem {
  HandEyeScene scene;
#ifdef LIESTAT_OPENCV
  // calibrateHandEye takes gripper-to-base (A) and target-to-camera (B⁻¹), calibrateRobotWorldHandEye world-to-camera
  // (B⁻¹) and base-to-gripper (A⁻¹).
  std::vector<cv::Mat> R_a = {}, t_a = {}, R_a_inverse = {}, t_a_inverse = {}, R_b_inverse = {}, t_b_inverse = {};
#endif
};
using Estimate = std::function<SE3d(const Problem&)>;

#ifdef LIESTAT_OPENCV
void append(const SE3d& T, std::vector<cv::Mat>& R, std::vector<cv::Mat>& t) {
  cv::Mat rotation(3, 3, CV_64F), translation(3, 1, CV_64F);
  const Eigen::Matrix3d matrix = T.rotationMatrix();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation.at<double>(i, j) = matrix(i, j);
    translation.at<double>(i) = T.translation()[i];
  }
  R.push_back(rotation), t.push_back(translation);
}
SE3d fromCv(const cv::Mat& R, const cv::Mat& t) {
  Eigen::Matrix3d matrix;
  Eigen::Vector3d translation;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) matrix(i, j) = R.at<double>(i, j);
    translation[i] = t.at<double>(i);
  }
  return SE3d(SO3d::fitToSO3(matrix), translation);
}
/// An exception is a failure: some methods throw where a matrix turns out singular.
SE3d failed() { return SE3d(SO3d(), Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())); }
SE3d theirHandEye(const Problem& p, cv::HandEyeCalibrationMethod method) {
  cv::Mat R, t;
  try {
    cv::calibrateHandEye(p.R_a, p.t_a, p.R_b_inverse, p.t_b_inverse, R, t, method);
  } catch (const cv::Exception&) {
    return failed();
  }
  return fromCv(R, t);
}
SE3d theirRobotWorld(const Problem& p, cv::RobotWorldHandEyeCalibrationMethod method) {
  cv::Mat R_world, t_world, R, t;
  try {
    cv::calibrateRobotWorldHandEye(p.R_b_inverse, p.t_b_inverse, p.R_a_inverse, p.t_a_inverse, R_world, t_world, R, t,
                                   method);
  } catch (const cv::Exception&) {
    return failed();
  }
  return fromCv(R, t).inverse();
}
#endif

void measure(benchmark::State& state, const HandEyeSceneOptions& options, const Estimate& estimate) {
  std::vector<Problem> problems;
  for (std::uint64_t trial = 0; trial < scene_count; ++trial) {
    problems.push_back({HandEyeScene(options, 1, trial)});
#ifdef LIESTAT_OPENCV
    for (const PosePair& pair : problems.back().scene.pairs) {
      Problem& p = problems.back();
      append(pair.a.mean, p.R_a, p.t_a);
      append(pair.a.mean.inverse(), p.R_a_inverse, p.t_a_inverse);
      append(pair.b.mean.inverse(), p.R_b_inverse, p.t_b_inverse);
    }
#endif
  }
  std::vector<SE3d> answers(problems.size());
  std::vector<double> shortest(problems.size(), std::numeric_limits<double>::infinity());
  for (auto _ : state) {
    for (std::size_t i = 0; i < problems.size(); ++i) {
      const auto start = std::chrono::steady_clock::now();
      answers[i] = estimate(problems[i]);
      const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
      shortest[i] = std::min(shortest[i], taken.count());
    }
  }
  double rotation = 0, translation = 0, worst = 0, n = 0;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    if (!answers[i].params().allFinite()) continue;
    const SE3d truth = problems[i].scene.nearestTruth(answers[i]);
    const double angle = (answers[i].so3().inverse() * truth.so3()).log().norm() / units::degree;
    rotation += angle * angle, worst = std::max(worst, angle);
    translation += (answers[i].translation() - truth.translation()).squaredNorm();
    ++n;
  }
  std::sort(shortest.begin(), shortest.end());
  state.counters["ms"] = shortest[shortest.size() / 2];
  state.counters["rms_deg"] = std::sqrt(rotation / n);
  state.counters["rms_mm"] = 1e3 * std::sqrt(translation / n);
  state.counters["worst_deg"] = worst;
  if (n < static_cast<double>(scene_count)) state.counters["failed"] = static_cast<double>(scene_count) - n;
}

void add(const std::string& name, const HandEyeSceneOptions& options, const Estimate& estimate) {
  benchmark::RegisterBenchmark(("HandEye/" + name).c_str(), [=](benchmark::State& state) {
    measure(state, options, estimate);
  })->Unit(benchmark::kMillisecond);
}

void addAll(const std::string& name, const HandEyeSceneOptions& options) {
  add(name + "/liestat", options, [](const Problem& p) { return estimateRobotWorld(p.scene.pairs).X.mean; });
#ifdef LIESTAT_OPENCV
  const auto hand_eye = [&](const char* method, cv::HandEyeCalibrationMethod which) {
    add(name + "/" + method, options, [=](const Problem& p) { return theirHandEye(p, which); });
  };
  hand_eye("TSAI", cv::CALIB_HAND_EYE_TSAI);
  hand_eye("PARK", cv::CALIB_HAND_EYE_PARK);
  hand_eye("HORAUD", cv::CALIB_HAND_EYE_HORAUD);
  hand_eye("ANDREFF", cv::CALIB_HAND_EYE_ANDREFF);
  hand_eye("DANIILIDIS", cv::CALIB_HAND_EYE_DANIILIDIS);
  const auto robot_world = [&](const char* method, cv::RobotWorldHandEyeCalibrationMethod which) {
    add(name + "/" + method, options, [=](const Problem& p) { return theirRobotWorld(p, which); });
  };
  robot_world("SHAH", cv::CALIB_ROBOT_WORLD_HAND_EYE_SHAH);
  robot_world("LI", cv::CALIB_ROBOT_WORLD_HAND_EYE_LI);
#endif
}

const bool registered = [] {
#ifdef LIESTAT_OPENCV
  cv::setNumThreads(1);
#endif
  for (const HandEyeNoise noise : experiments::all_hand_eye_noises) {
    for (const std::size_t pairs : {8, 20, 50}) {
      addAll(std::string(name(noise)) + "/" + std::to_string(pairs), {.noise = noise, .pairs = pairs});
    }
  }
  for (const HandEyeMotion motion : {HandEyeMotion::half_turns, HandEyeMotion::planar}) {
    addAll(std::string(name(motion)) + "/20", {.motion = motion, .pairs = 20});
  }
  // Six pairs of twenty are wrong.
  addAll("outliers/20", {.pairs = 20, .outliers = 0.3});
  return true;
}();

}  // namespace
}  // namespace liestat::bench
