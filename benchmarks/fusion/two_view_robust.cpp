// Robust estimation of one two-view model beside OpenCV, and what it is made of.
//
// 1000 matches, 1280×960 px, f = 800 px, noise of 1 px in both images, 30 and 60 % outliers, 20 scenes; thresholds of 2 px
// for epipolar geometry and 4 px for homographies, confidence 0.9999; one thread. One iteration estimates each of the
// 20 scenes once. Counters, medians over the scenes:
//
//   ms           the shortest of the iterations' times of an estimate
//   error_px     of the right matches without noise, root mean square: Sampson's distance from F, transfer error of H
//   rotation     error of the pose (degrees); direction: that of the translation
//   draws        hypotheses
//   failed       scenes without an estimate, if any
//
// OpenCV's default of 1000 hypotheses (2000 for H) ends its search before that confidence at 60 % outliers: the rows
// "capped" have it on both sides, the others 100000; RANSAC, which would take minutes, 10000.
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/detail/robust_two_view.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/robust.hpp>
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

using experiments::TwoViewMotion;
using experiments::TwoViewScene;

constexpr double focal_length = 800, width = 1280, height = 960;
constexpr double no_estimate = std::numeric_limits<double>::infinity();

TwoViewScene sceneOf(TwoViewMotion motion, double outliers, std::uint64_t seed) {
  return TwoViewScene({.motion = motion,
                       .matches = 1000,
                       .outliers = outliers,
                       .sigma = 1,
                       .width = width,
                       .height = height,
                       .focal_length = focal_length},
                      seed);
}

struct Answer {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();  ///< H or F in px
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  double draws = 0;
};
struct Errors {
  double first = no_estimate, second = no_estimate;
};

/// A match in px, without noise.
Eigen::Vector4d exactInPx(const TwoViewScene& scene, std::size_t i) {
  return focal_length * scene.exact[i] + 0.5 * Eigen::Vector4d(width, height, width, height);
}
/// Root mean square of a function of the right matches without noise.
template <class Squared>
double rms(const TwoViewScene& scene, const Squared& squared) {
  double sum = 0, n = 0;
  for (std::size_t i = 0; i < scene.exact.size(); ++i) {
    if (!scene.inlier[i]) continue;
    sum += squared(exactInPx(scene, i));
    ++n;
  }
  return std::sqrt(sum / n);
}
Errors errorsOfHomography(const TwoViewScene& scene, const Answer& a) {
  if (a.matrix.isZero()) return {};
  return {rms(scene,
              [&](const Eigen::Vector4d& m) {
                const Eigen::Vector3d p = a.matrix * Eigen::Vector3d(m[0], m[1], 1);
                return (p.head<2>() / p.z() - m.tail<2>()).squaredNorm();
              }),
          0};
}
Errors errorsOfFundamental(const TwoViewScene& scene, const Answer& a) {
  if (a.matrix.isZero()) return {};
  return {rms(scene, [&](const Eigen::Vector4d& m) { return epipolarError(a.matrix, m, {1, 1}); }), 0};
}
Errors errorsOfPose(const TwoViewScene& scene, const Answer& a) {
  if (a.R.isZero()) return {};
  const Eigen::Vector3d t = a.t.normalized(), truth = scene.t.normalized();
  return {Eigen::AngleAxisd(Eigen::Matrix3d(a.R * scene.R.transpose())).angle() / units::degree,
          std::atan2(t.cross(truth).norm(), t.dot(truth)) / units::degree};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/// A problem in the forms that the candidates take.
struct Problem {
  TwoViewScene scene;
#ifdef LIESTAT_OPENCV
  std::vector<cv::Point2d> first = {}, second = {};
#endif
};
using Estimate = std::function<Answer(const Problem&)>;
using Judge = Errors (*)(const TwoViewScene&, const Answer&);

void measure(benchmark::State& state, TwoViewMotion motion, double outliers, const Estimate& estimate, Judge judge) {
  std::vector<Problem> problems;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    problems.push_back({sceneOf(motion, outliers, seed)});
#ifdef LIESTAT_OPENCV
    for (const Eigen::Vector4d& m : problems.back().scene.pixels) {
      problems.back().first.emplace_back(m[0], m[1]);
      problems.back().second.emplace_back(m[2], m[3]);
    }
#endif
  }
  std::vector<Answer> answers(problems.size());
  std::vector<double> shortest(problems.size(), no_estimate);
  for (auto _ : state) {
    for (std::size_t i = 0; i < problems.size(); ++i) {
      const auto start = std::chrono::steady_clock::now();
      answers[i] = estimate(problems[i]);
      const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
      shortest[i] = std::min(shortest[i], taken.count());
    }
  }
  std::vector<double> first, second, draws;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Errors errors = judge(problems[i].scene, answers[i]);
    first.push_back(errors.first);
    second.push_back(errors.second);
    draws.push_back(answers[i].draws);
  }
  state.counters["ms"] = median(shortest);
  if (judge == &errorsOfPose) {
    state.counters["rotation"] = median(first);
    state.counters["direction"] = median(second);
  } else {
    state.counters["error_px"] = median(first);
  }
  const auto failed = std::count(first.begin(), first.end(), no_estimate);
  if (failed > 0) state.counters["failed"] = static_cast<double>(failed);
  if (median(draws) > 0) state.counters["draws"] = median(draws);
}

constexpr double confidence = 0.9999;

// The same thresholds: 2 px from an epipolar line in units of 1 px of noise; 4 px of the transfer error, of which both
// images have a half.
TwoViewRobustOptions optionsOf(double threshold, std::size_t max_draws) {
  return {.confidence = confidence, .threshold = threshold, .max_draws = max_draws};
}
Answer ourHomography(const Problem& p, std::size_t max_draws) {
  const RobustHomography found = robustHomography(p.scene.pixels, {1, 1}, optionsOf(8, max_draws));
  if (!found.ok()) return {};
  return {.matrix = found.H, .draws = static_cast<double>(found.draws)};
}
Answer ourFundamental(const Problem& p, std::size_t max_draws) {
  const RobustFundamental found = robustFundamental(p.scene.pixels, {1, 1}, optionsOf(4, max_draws));
  if (!found.ok()) return {};
  return {.matrix = found.F, .draws = static_cast<double>(found.draws)};
}
Answer ourPose(const Problem& p, std::size_t max_draws) {
  // From px, as the other has it.
  std::vector<Eigen::Vector4d> matches;
  matches.reserve(p.scene.pixels.size());
  for (const Eigen::Vector4d& m : p.scene.pixels) {
    matches.emplace_back((m - 0.5 * Eigen::Vector4d(width, height, width, height)) / focal_length);
  }
  const RobustEssential found = robustEssential(matches, {1 / focal_length, 1 / focal_length}, optionsOf(4, max_draws));
  if (!found.ok()) return {};
  const TwoViewPose pose = toPose(found.pose.mean);
  return {.R = pose.R, .t = pose.t, .draws = static_cast<double>(found.draws)};
}

#ifdef LIESTAT_OPENCV
Eigen::Matrix3d fromCv(const cv::Mat& m) {
  if (m.rows < 3 || m.cols != 3) return Eigen::Matrix3d::Zero();
  Eigen::Matrix3d M;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) M(i, j) = m.at<double>(i, j);
  }
  return M;
}
Answer theirHomography(const Problem& p, int method, int max_draws) {
  return {.matrix = fromCv(cv::findHomography(p.first, p.second, method, 4, cv::noArray(), max_draws, confidence))};
}
Answer theirFundamental(const Problem& p, int method, int max_draws) {
  return {.matrix = fromCv(cv::findFundamentalMat(p.first, p.second, method, 2, confidence, max_draws))};
}
Answer theirPose(const Problem& p, int method, int max_draws) {
  const cv::Matx33d K(focal_length, 0, 0.5 * width, 0, focal_length, 0.5 * height, 0, 0, 1);
  cv::Mat inliers, R, t;
  const cv::Mat E = cv::findEssentialMat(p.first, p.second, K, method, confidence, 2, max_draws, inliers);
  if (E.rows < 3) return {};
  cv::recoverPose(E.rowRange(0, 3), p.first, p.second, K, R, t, inliers);
  return {.R = fromCv(R), .t = Eigen::Vector3d(t.at<double>(0), t.at<double>(1), t.at<double>(2))};
}
#endif

void add(const std::string& name, TwoViewMotion motion, int outliers, const Estimate& estimate, Judge judge) {
  const std::string full = "TwoViewRobust/" + name + "/" + std::to_string(outliers);
  benchmark::RegisterBenchmark(full.c_str(), [=](benchmark::State& state) {
    measure(state, motion, 0.01 * outliers, estimate, judge);
  })->Unit(benchmark::kMillisecond);
}

template <class Ours, class Theirs>
void addRow(const std::string& name, TwoViewMotion motion, int cap, Judge judge, const Ours& ours,
            [[maybe_unused]] const Theirs& theirs) {
  for (const int outliers : {30, 60}) {
    // At 30 % all are done before.
    for (const int most : {100000, cap}) {
      if (most == cap && outliers == 30) continue;
      const std::string kind = most == cap ? name + " capped/" : name + "/";
      add(
          kind + "liestat", motion, outliers, [=](const Problem& p) { return ours(p, static_cast<std::size_t>(most)); },
          judge);
#ifdef LIESTAT_OPENCV
      add(
          kind + "USAC_MAGSAC", motion, outliers, [=](const Problem& p) { return theirs(p, cv::USAC_MAGSAC, most); },
          judge);
      add(
          kind + "USAC_DEFAULT", motion, outliers, [=](const Problem& p) { return theirs(p, cv::USAC_DEFAULT, most); },
          judge);
      add(
          kind + "RANSAC", motion, outliers,
          [=](const Problem& p) { return theirs(p, cv::RANSAC, std::min(most, 10000)); }, judge);
#endif
    }
  }
}

/// A minimal sample, its solutions, and their scores against a hypothesis that is as good as the truth.
template <class Kind>
void hypothesis(benchmark::State& state, TwoViewMotion motion, double outliers) {
  const TwoViewScene scene = sceneOf(motion, outliers, 1);
  const MatchNoise noise{1 / focal_length, 1 / focal_length};
  const detail::RobustTwoViewModel<Kind> model(scene.matches, noise);
  const double threshold = Kind::equations == 2 ? 9.2103 : 6.6349;
  std::vector<double> errors(scene.matches.size());
  model.errors(isEpipolar(motion) ? scene.F : scene.H, errors);
  RobustSearchOptions options;
  options.inlier_threshold = threshold;
  options.rejection_risk = 1e-3;
  options.min_score = TruncatedCost{threshold}(errors);
  options.local_optimisation = false;
  RobustSearch search(model, TruncatedCost{threshold}, options);
  for (auto _ : state) search.iterate();
  state.counters["errors"] = static_cast<double>(search.evaluatedErrors()) / static_cast<double>(search.draws());
}

/// Normal equations of a Gauss–Newton step, per match.
template <class Kind>
void normalEquations(benchmark::State& state, TwoViewMotion motion) {
  const TwoViewScene scene = sceneOf(motion, 0, 1);
  const MatchNoise noise{1 / focal_length, 1 / focal_length};
  const detail::RobustTwoViewModel<Kind> model(scene.matches, noise);
  const std::vector<double> weights(scene.matches.size(), 1.0);
  const Eigen::Matrix3d M = isEpipolar(motion) ? scene.F : scene.H;
  for (auto _ : state) {
    Eigen::Matrix3d moved = M;
    double squared_length = 0;
    detail::entryStep<Kind>(model.sums(moved, weights), moved, squared_length);
    benchmark::DoNotOptimize(moved);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(scene.matches.size()));
}

template <class Kind>
void addParts(const std::string& name, TwoViewMotion motion) {
  benchmark::RegisterBenchmark(("TwoViewRobust/hypothesis/" + name).c_str(),
                               [=](benchmark::State& state) { hypothesis<Kind>(state, motion, 0.6); });
  benchmark::RegisterBenchmark(("TwoViewRobust/step/" + name).c_str(),
                               [=](benchmark::State& state) { normalEquations<Kind>(state, motion); });
}

const bool registered = [] {
#ifdef LIESTAT_OPENCV
  cv::setNumThreads(1);
  addRow("homography", TwoViewMotion::homography, 2000, errorsOfHomography, ourHomography, theirHomography);
  addRow("fundamental", TwoViewMotion::fundamental, 1000, errorsOfFundamental, ourFundamental, theirFundamental);
  addRow("pose", TwoViewMotion::essential, 1000, errorsOfPose, ourPose, theirPose);
#else
  addRow("homography", TwoViewMotion::homography, 2000, errorsOfHomography, ourHomography, nullptr);
  addRow("fundamental", TwoViewMotion::fundamental, 1000, errorsOfFundamental, ourFundamental, nullptr);
  addRow("pose", TwoViewMotion::essential, 1000, errorsOfPose, ourPose, nullptr);
#endif
  addParts<detail::HomographyKind>("homography", TwoViewMotion::homography);
  addParts<detail::FundamentalKind>("fundamental", TwoViewMotion::fundamental);
  addParts<detail::EssentialKind>("essential", TwoViewMotion::essential);
  return true;
}();

}  // namespace
}  // namespace liestat::bench
