#include <experiments/motion_validation.hpp>
#include <lie/units.hpp>

#include <stats/quantile.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/plan.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/track_pairs.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <span>
#include <utility>

namespace liestat::experiments {
namespace {

using units::degree;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// A run's error (degrees) and ξᵀ P⁻¹ ξ/2 at the frames, NaN where there is no covariance.
struct Trial {
  std::array<double, 3> error{}, consistency{};
  int converged = 0;  ///< first frame from which on the error stays below 10°; 0: none
  bool usable = false;
  double usable_frames = 0, wrong_frames = 0;  ///< shares of the frames from the first of motion_frames on
};

/// A filter behind one interface.
class Runner {
 public:
  Runner() = default;
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;
  virtual ~Runner() = default;
  virtual void update(const MotionScene& scene) = 0;
  virtual const MotionEstimate& estimate() const = 0;
};

template <class Filter>
class FilterRunner : public Runner {
 public:
  explicit FilterRunner(Filter filter) : filter_(std::move(filter)) {}
  void update(const MotionScene& scene) override {
    if (scene.hasGyroscope()) {
      filter_.update(scene.pairs, scene.gyroscope);
    } else {
      filter_.update(scene.pairs);
    }
  }
  const MotionEstimate& estimate() const override { return filter_.estimate(); }

 private:
  Filter filter_;
};

/// Pairs over several frames.
class IntervalRunner : public Runner {
 public:
  IntervalRunner(const MotionFilterOptions& options, std::size_t frames, const MotionScene& scene)
      : filter_(options), tracks_({.frames = frames}) {
    observe(scene);
  }
  void update(const MotionScene& scene) override { filter_.update(observe(scene)); }
  const MotionEstimate& estimate() const override { return filter_.estimate(); }

 private:
  std::span<const PointPair> observe(const MotionScene& scene) {
    seen_.clear();
    for (const MotionTrack& track : scene.observed) seen_.push_back({track.track, track.at, scene.toldSigma()});
    return tracks_.add(seen_);
  }
  SubspaceFilter filter_;
  TrackPairs tracks_;
  std::vector<TrackObservation> seen_;
};

class SearchRunner : public Runner {
 public:
  void update(const MotionScene& scene) override {
    estimate_.direction.mean = S2d(search_.update(scene.pairs));
    estimate_.direction.covariance.setConstant(nothing);
    ++estimate_.frame;
  }
  const MotionEstimate& estimate() const override { return estimate_; }

 private:
  SphereSearch search_;
  MotionEstimate estimate_;
};

std::unique_ptr<Runner> runnerOf(const MotionRow& row, const MotionScene& scene, std::uint64_t seed,
                                 std::uint64_t number) {
  MotionFilterOptions options;
  options.outliers = row.scene.outliers > 0;
  options.flow = planOf({}, {.given = row.scene.gyroscope_sigma > 0}).settings.flow;
  CounterRng rng(seed, number, 4);
  switch (row.method) {
    case MotionMethod::single_start:
    case MotionMethod::near_start: {
      options.lost_innovation = std::numeric_limits<double>::infinity();
      SubspaceFilter filter(options);
      Gaussian<S2d> start;
      start.mean = S2d(rng.unitVector<3>());
      if (row.method == MotionMethod::near_start) {
        const Eigen::Vector2d off = 10 * degree * rng.unitVector<2>();
        start.mean = exp(S2d(scene.velocity), off);
        start.covariance *= 0.5 * std::pow(10 * degree, 2);
      }
      filter.start(start);
      return std::make_unique<FilterRunner<SubspaceFilter>>(std::move(filter));
    }
    case MotionMethod::forward:
      options.flow = Flow::forward;
      break;
    case MotionMethod::discrete:
      options.flow = Flow::discrete;
      break;
    case MotionMethod::gauss_newton:
      options.second_derivatives = false;
      break;
    case MotionMethod::released:
      options.positive_depth = false;
      break;
    case MotionMethod::search:
      return std::make_unique<SearchRunner>();
    case MotionMethod::essential:
      return std::make_unique<FilterRunner<EssentialFilter>>(EssentialFilter(options));
    case MotionMethod::essential_near: {
      EssentialFilter filter(options);
      const Eigen::Vector2d off = 0.3 * rng.unitVector<2>();
      const Eigen::Vector3d Omega = scene.rotationOf(1);
      const Eigen::Vector3d turn = 0.3 * Omega.norm() * rng.unitVector<3>();
      const S2d T(Eigen::Vector3d(SO3d::leftJacobian(Omega) * scene.velocity));
      Gaussian<Essentiald> start;
      start.mean = Essentiald(SO3d::exp(Eigen::Vector3d(Omega + turn)), exp(T, off));
      start.covariance.setZero();
      start.covariance.diagonal() << 0.045, 0.045, Eigen::Vector3d::Constant(turn.squaredNorm() / 3);
      filter.start(start);
      return std::make_unique<FilterRunner<EssentialFilter>>(std::move(filter));
    }
    case MotionMethod::essential_bias:
      options.estimate_bias = true, options.bias_sigma = row.scene.gyroscope_bias * degree;
      return std::make_unique<FilterRunner<EssentialFilter>>(EssentialFilter(options));
    case MotionMethod::upset:
      options.outliers = false;
      [[fallthrough]];
    case MotionMethod::composition:
      return std::make_unique<FilterRunner<MotionFilter>>(MotionFilter(options));
    case MotionMethod::intervals:
      return std::make_unique<IntervalRunner>(options, row.scene.world == MotionWorld::orbit ? 6 : 4, scene);
    case MotionMethod::gyroscope_bias:
      options.estimate_bias = true, options.bias_sigma = row.scene.gyroscope_bias * degree;
      break;
    case MotionMethod::gyroscope:
    case MotionMethod::gyroscope_robust:
    case MotionMethod::subspace:
      break;
  }
  return std::make_unique<FilterRunner<SubspaceFilter>>(SubspaceFilter(options));
}

Trial runTrial(const MotionRow& row, const MotionValidation& validation, std::uint64_t number) {
  MotionSceneOptions options = row.scene;
  options.sigma *= validation.noise_factor;
  MotionScene scene(options, validation.run.seed, number);
  scene.told_sigma = row.scene.sigma;
  const auto runner = runnerOf(row, scene, validation.run.seed, number);
  Trial trial;
  std::size_t next = 0;
  for (int frame = 1; frame <= motion_frames.back(); ++frame) {
    scene.advance();
    runner->update(scene);
    const MotionEstimate& e = runner->estimate();
    const S2d truth(e.meaning == DirectionMeaning::velocity ? scene.velocity : scene.translation);
    const double error = distance(e.direction.mean, truth) / degree;
    if (!(error < motion_success)) {
      trial.converged = 0;
    } else if (trial.converged == 0) {
      trial.converged = frame;
    }
    if (frame >= motion_frames.front()) {
      const double of = 1. / (motion_frames.back() - motion_frames.front() + 1);
      trial.usable_frames += e.ok() ? of : 0, trial.wrong_frames += e.ok() && !(error < motion_success) ? of : 0;
    }
    if (frame != motion_frames[next]) continue;
    trial.error[next] = error;
    trial.consistency[next] = mahalanobisSquared(e.direction, truth) / 2;
    trial.usable = e.ok();
    ++next;
  }
  return trial;
}

MotionRow summarised(MotionRow row, const std::vector<Trial>& trials) {
  row.trials = trials.size();
  const auto n = static_cast<double>(trials.size());
  for (std::size_t k = 0; k < motion_frames.size(); ++k) {
    std::vector<double> errors;
    double sum = 0;
    for (const Trial& trial : trials) {
      errors.push_back(std::isfinite(trial.error[k]) ? trial.error[k] : 180);
      if (!(trial.error[k] < motion_success)) continue;
      ++row.successes[k];
      sum += trial.consistency[k];
    }
    row.median[k] = quantile(errors, 0.5);
    row.consistency[k] = sum / static_cast<double>(row.successes[k]);
  }
  std::vector<double> converged;
  double covered = 0, usable = 0, wrong = 0;
  for (const Trial& trial : trials) {
    if (trial.converged > 0) converged.push_back(trial.converged);
    const bool success = trial.error.back() < motion_success;
    covered += success && 2 * trial.consistency.back() <= chiSquaredQuantile(0.95, 2) ? 1 : 0;
    usable += trial.usable ? 1 : 0, wrong += trial.usable && !success ? 1 : 0;
  }
  row.convergence = quantile(converged, 0.5);
  row.coverage = std::isnan(row.consistency.back()) ? nothing : covered / static_cast<double>(row.successes.back());
  const auto meanOf = [&](double Trial::*share, double& mean, double& error) {
    double sum = 0, squares = 0;
    for (const Trial& trial : trials) sum += trial.*share, squares += trial.*share * (trial.*share);
    mean = sum / n, error = std::sqrt(std::max(squares / n - mean * mean, 0.0) / n);
  };
  meanOf(&Trial::usable_frames, row.usable_frames, row.usable_error);
  meanOf(&Trial::wrong_frames, row.wrong_frames, row.wrong_error);
  row.usable = usable / n, row.usable_wrong = usable > 0 ? wrong / usable : 0;
  return row;
}

/// The promise of docs/motion.md on a cell: a little less than what 2000 trials showed.
struct PromisedCell {
  MotionMethod method;
  MotionWorld world;
  double sigma, rotation, gyroscope, bias, outliers;
  std::size_t points;
  MotionPromise promise;
  MotionUpset upset = MotionUpset::none;
};
using M = MotionMethod;
using W = MotionWorld;
constexpr PromisedCell promised_cells[] = {
    {M::subspace, W::orbit, 1, 5, 0, 0, 0, 20, {{0.98, 0.99, 0.99}, {0.49, 0.33, 0.32}, 0.95}},
    {M::subspace, W::orbit, 4, 5, 0, 0, 0, 20, {{0.62, 0.78, 0.86}, {7.29, 4.38, 3.01}, 0.95}},
    {M::subspace, W::orbit, 8, 5, 0, 0, 0, 20, {{0, 0.32, 0.45}, {0, 0, 11.47}, 0.95}},
    {M::subspace, W::general, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.92, 0.62, 0.57}, 0.95}},
    {M::subspace, W::general, 4, 5, 0, 0, 0, 20, {{0.69, 0.83, 0.89}, {7.24, 4.43, 3.07}, 0.95}},
    {M::subspace, W::general, 8, 5, 0, 0, 0, 20, {{0, 0.31, 0.45}, {0, 0, 11.6}, 0.95}},
    {M::subspace, W::orbit, 8, 10, 0, 0, 0, 20, {{0.64, 0.77, 0.87}, {7.02, 4.45, 3.05}, 0.95}},
    {M::subspace, W::orbit, 1, 5, 0, 0, 0.15, 20, {{0.95, 0.97, 0.97}, {1.35, 1, 0.97}, 0}},
    {M::subspace, W::general, 1, 5, 0, 0, 0.15, 20, {{0.98, 0.98, 0.99}, {2.11, 1.57, 1.36}, 0}},
    {M::subspace, W::turning, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.92, 0.62, 0.57}, 0.95}},
    {M::subspace, W::turning, 4, 5, 0, 0, 0, 20, {{0.69, 0.82, 0.89}, {7.08, 4.35, 3.07}, 0.95}},
    {M::essential, W::orbit, 1, 5, 0, 0, 0, 20, {{0.97, 0.99, 0.99}, {1.02, 0.48, 0.29}, 0.95}},
    {M::essential, W::general, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.98, 0.61, 0.53}, 0.95}},
    {M::essential_near, W::orbit, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.5, 0.29, 0.23}, 0.95}},
    {M::essential_near, W::orbit, 4, 5, 0, 0, 0, 20, {{0.91, 0.93, 0.96}, {3.4, 2.16, 1.46}, 0.95}},
    {M::essential_near, W::orbit, 8, 5, 0, 0, 0, 20, {{0.72, 0.83, 0.88}, {7.23, 5.63, 4.52}, 0}},
    {M::essential_near, W::general, 1, 5, 0, 0, 0, 20, {{0.91, 0.99, 0.99}, {1.52, 0.71, 0.57}, 0.95}},
    {M::essential_near, W::general, 4, 5, 0, 0, 0, 20, {{0.69, 0.74, 0.77}, {6.92, 5.78, 5.34}, 0}},
    {M::essential_near, W::general, 8, 5, 0, 0, 0, 20, {{0.48, 0.57, 0.64}, {10.88, 9.35, 8.05}, 0}},
    {M::composition, W::orbit, 1, 5, 0, 0, 0, 20, {{0.98, 0.99, 0.99}, {0.48, 0.26, 0.22}, 0.95}},
    {M::composition, W::orbit, 4, 5, 0, 0, 0, 20, {{0.62, 0.78, 0.85}, {7.29, 4.38, 3.13}, 0.95}},
    {M::composition, W::orbit, 8, 5, 0, 0, 0, 20, {{0, 0.32, 0.45}, {0, 0, 11.47}, 0.95}},
    {M::composition, W::general, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.87, 0.6, 0.54}, 0.95}},
    {M::composition, W::general, 4, 5, 0, 0, 0, 20, {{0.69, 0.83, 0.89}, {7.24, 4.43, 3.2}, 0.95}},
    {M::composition, W::general, 8, 5, 0, 0, 0, 20, {{0, 0.31, 0.45}, {0, 0, 11.6}, 0.95}},
    {M::composition, W::turning, 1, 5, 0, 0, 0, 20, {{0.99, 0.98, 0.99}, {0.92, 0.62, 0.57}, 0.95}},
    {M::intervals, W::orbit, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.27, 0.29, 0.29}, 0.95}},
    {M::intervals, W::orbit, 4, 5, 0, 0, 0, 20, {{0.98, 0.99, 0.99}, {0.6, 0.43, 0.43}, 0.95}},
    {M::intervals, W::orbit, 8, 5, 0, 0, 0, 20, {{0.95, 0.98, 0.98}, {1.58, 0.72, 0.61}, 0.95}},
    {M::intervals, W::general, 1, 5, 0, 0, 0, 20, {{0.99, 0.99, 0.99}, {1.01, 0.93, 0.96}, 0}},
    {M::intervals, W::general, 4, 5, 0, 0, 0, 20, {{0.94, 0.98, 0.99}, {2.89, 1.93, 1.56}, 0}},
    {M::intervals, W::general, 8, 5, 0, 0, 0, 20, {{0.67, 0.83, 0.91}, {7.27, 4.25, 2.96}, 0}},
    {M::intervals, W::orbit, 10, 5, 0, 0, 0, 20, {{0.9, 0.97, 0.98}, {2.3, 1.01, 0.73}, 0.95}},
    {M::intervals, W::general, 10, 5, 0, 0, 0, 20, {{0.52, 0.73, 0.83}, {10.15, 6.21, 4.16}, 0}},
    {M::gyroscope, W::orbit, 1, 5, 0.02, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.22, 0.18, 0.18}, 0.95}},
    {M::gyroscope, W::orbit, 1, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.32, 0.29, 0.27}, 0.95}},
    {M::gyroscope, W::orbit, 1, 5, 0.5, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.39, 0.31, 0.3}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.02, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.59, 0.34, 0.26}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.69, 0.44, 0.35}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.5, 0, 0, 20, {{0.98, 0.98, 0.98}, {1.37, 0.87, 0.7}, 0.95}},
    {M::gyroscope, W::orbit, 8, 5, 0.02, 0, 0, 20, {{0.97, 0.98, 0.98}, {1.57, 0.92, 0.65}, 0.95}},
    {M::gyroscope, W::orbit, 8, 5, 0.1, 0, 0, 20, {{0.97, 0.98, 0.98}, {1.63, 0.96, 0.71}, 0.95}},
    {M::gyroscope, W::orbit, 8, 5, 0.5, 0, 0, 20, {{0.97, 0.98, 0.98}, {2.48, 1.52, 1.18}, 0.95}},
    {M::gyroscope, W::orbit, 10, 5, 0.1, 0, 0, 20, {{0.96, 0.97, 0.97}, {2.33, 1.39, 1}, 0.95}},
    {M::gyroscope, W::general, 1, 5, 0.02, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.3, 0.29, 0.3}, 0.95}},
    {M::gyroscope, W::general, 1, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.44, 0.43, 0.44}, 0.95}},
    {M::gyroscope, W::general, 1, 5, 0.5, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.79, 0.58, 0.58}, 0.95}},
    {M::gyroscope, W::general, 4, 5, 0.02, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.87, 0.61, 0.53}, 0.95}},
    {M::gyroscope, W::general, 4, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {1.02, 0.7, 0.61}, 0.95}},
    {M::gyroscope, W::general, 4, 5, 0.5, 0, 0, 20, {{0.98, 0.99, 0.99}, {2.28, 1.46, 1.15}, 0.95}},
    {M::gyroscope, W::general, 8, 5, 0.02, 0, 0, 20, {{0.98, 0.99, 0.99}, {2.28, 1.46, 1.04}, 0.95}},
    {M::gyroscope, W::general, 8, 5, 0.1, 0, 0, 20, {{0.98, 0.99, 0.99}, {2.31, 1.51, 1.08}, 0.95}},
    {M::gyroscope, W::general, 8, 5, 0.5, 0, 0, 20, {{0.95, 0.97, 0.99}, {3.9, 2.53, 1.81}, 0.95}},
    {M::gyroscope, W::general, 10, 5, 0.1, 0, 0, 20, {{0.95, 0.97, 0.99}, {3.29, 2.18, 1.53}, 0.95}},
    {M::gyroscope, W::orbit, 1, 5, 0.1, 0, 0, 2, {{0.93, 0.97, 0.98}, {1.1, 0.57, 0.46}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.1, 0, 0, 2, {{0.8, 0.93, 0.96}, {3.68, 1.72, 1.06}, 0.95}},
    {M::gyroscope, W::orbit, 1, 5, 0.1, 0, 0, 3, {{0.98, 0.99, 0.99}, {0.68, 0.43, 0.36}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.1, 0, 0, 3, {{0.91, 0.97, 0.98}, {2.31, 1.08, 0.71}, 0.95}},
    {M::gyroscope, W::orbit, 1, 5, 0.1, 0, 0, 5, {{0.99, 0.99, 0.99}, {0.51, 0.35, 0.31}, 0.95}},
    {M::gyroscope, W::orbit, 4, 5, 0.1, 0, 0, 5, {{0.97, 0.99, 0.99}, {1.54, 0.76, 0.52}, 0.95}},
    {M::gyroscope, W::plane, 1, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {0.58, 0.53, 0.53}, 0.95}},
    {M::gyroscope, W::plane, 4, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {1.35, 0.97, 0.86}, 0.95}},
    {M::gyroscope, W::narrow, 1, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {1.19, 0.88, 0.79}, 0.95}},
    {M::gyroscope, W::narrow, 4, 5, 0.1, 0, 0, 20, {{0.79, 0.92, 0.97}, {5.19, 3.24, 2.29}, 0.95}},
    {M::gyroscope, W::turning, 1, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {2.07, 1.85, 1.85}, 0}},
    {M::gyroscope, W::turning, 4, 5, 0.1, 0, 0, 20, {{0.99, 0.99, 0.99}, {2.69, 2.12, 2.26}, 0}},
    {M::gyroscope_bias, W::orbit, 1, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {0.4, 0.3, 0.29}, 0.95}},
    {M::gyroscope_bias, W::orbit, 4, 5, 0.1, 0.115, 0, 20, {{0.98, 0.98, 0.99}, {1.37, 0.98, 0.82}, 0.95}},
    {M::gyroscope_bias, W::orbit, 8, 5, 0.1, 0.115, 0, 20, {{0.97, 0.98, 0.98}, {2.44, 1.81, 1.54}, 0.95}},
    {M::gyroscope_bias, W::general, 1, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {0.79, 0.61, 0.55}, 0.95}},
    {M::gyroscope_bias, W::general, 4, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {2.25, 1.83, 1.63}, 0.95}},
    {M::gyroscope_bias, W::general, 8, 5, 0.1, 0.115, 0, 20, {{0.97, 0.97, 0.97}, {3.7, 3.05, 2.74}, 0.95}},
    {M::gyroscope_robust, W::orbit, 1, 5, 0.1, 0, 0.15, 20, {{0.99, 0.99, 0.99}, {0.54, 0.44, 0.43}, 0}},
    {M::gyroscope_robust, W::orbit, 4, 5, 0.1, 0, 0.15, 20, {{0.96, 0.98, 0.98}, {2.49, 1.46, 0.98}, 0}},
    {M::gyroscope_robust, W::general, 1, 5, 0.1, 0, 0.15, 20, {{0.99, 0.99, 0.99}, {0.73, 0.58, 0.58}, 0}},
    {M::gyroscope_robust, W::general, 4, 5, 0.1, 0, 0.15, 20, {{0.98, 0.99, 0.99}, {2.54, 1.48, 1.09}, 0}},
    {M::essential_bias, W::orbit, 1, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {0.38, 0.31, 0.29}, 0.95}},
    {M::essential_bias, W::orbit, 4, 5, 0.1, 0.115, 0, 20, {{0.98, 0.98, 0.99}, {1.4, 1.04, 0.8}, 0.95}},
    {M::essential_bias, W::orbit, 8, 5, 0.1, 0.115, 0, 20, {{0.97, 0.98, 0.98}, {2.45, 1.84, 1.53}, 0.95}},
    {M::essential_bias, W::general, 1, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {0.79, 0.61, 0.56}, 0.95}},
    {M::essential_bias, W::general, 4, 5, 0.1, 0.115, 0, 20, {{0.99, 0.99, 0.99}, {2.2, 1.84, 1.59}, 0.95}},
    {M::essential_bias, W::general, 8, 5, 0.1, 0.115, 0, 20, {{0.97, 0.97, 0.97}, {3.73, 3.03, 2.65}, 0.95}},
    {M::upset, W::general, 1, 5, 0, 0, 0, 20, {.usable_frames = 0.97, .wrong_frames = 0.005}},
    {M::upset, W::general, 1, 5, 0, 0, 0.1, 20, {.usable_frames = 0, .wrong_frames = 0.005}},
    {M::upset, W::general, 1, 5, 0, 0, 0, 20, {.usable_frames = 0, .wrong_frames = 0.01}, MotionUpset::second_object},
    {M::upset, W::general, 1, 5, 0, 0, 0, 20, {.usable_frames = 0.85, .wrong_frames = 0.0175}, MotionUpset::reversal},
    {M::upset, W::general, 1, 5, 0, 0, 0, 20, {.usable_frames = 0.9, .wrong_frames = 0.01}, MotionUpset::turning},
    {M::upset, W::general, 1, 5, 0.1, 0, 0, 20, {.usable_frames = 0.97, .wrong_frames = 0.005}},
    {M::upset, W::general, 1, 5, 0.1, 0, 0, 20, {.usable_frames = 0, .wrong_frames = 0.005}, MotionUpset::wrong_sign},
    {M::upset, W::general, 1, 5, 0.1, 0, 0, 20, {.usable_frames = 0, .wrong_frames = 0.005}, MotionUpset::dead},
};
std::optional<MotionPromise> promiseOf(MotionMethod method, const MotionSceneOptions& scene) {
  for (const PromisedCell& cell : promised_cells) {
    if (cell.method == method && cell.world == scene.world && cell.sigma == scene.sigma &&
        cell.rotation == scene.rotation && cell.gyroscope == scene.gyroscope_sigma &&
        cell.bias == scene.gyroscope_bias && cell.outliers == scene.outliers && cell.points == scene.points &&
        cell.upset == scene.upset) {
      return cell.promise;
    }
  }
  return {};
}

std::size_t testsOf(const MotionPromise& promise) {
  std::size_t tests = (promise.coverage > 0 ? 1U : 0U) + (promise.wrong_frames > 0 ? 2U : 0U);
  for (std::size_t k = 0; k < 3; ++k) tests += (promise.success[k] > 0 ? 1U : 0U) + (promise.median[k] > 0 ? 1U : 0U);
  return tests;
}

/// Each promise is a probability that an event has at least; so few events as were seen, or fewer, must not be less
/// likely than the false alarm.
void judge(MotionRow& row, const std::vector<Trial>& trials, double false_alarm) {
  if (!row.promise) return;
  const auto kept = [&](std::size_t events, std::size_t of, double probability) {
    return binomialSurvival(of - events, of, 1 - probability) >= false_alarm;
  };
  const auto fail = [&](std::string why) { row.reason += (row.reason.empty() ? "" : ", ") + std::move(why); };
  for (std::size_t k = 0; k < motion_frames.size(); ++k) {
    const std::string frame = " at frame " + std::to_string(motion_frames[k]);
    if (row.promise->success[k] > 0 && !kept(row.successes[k], row.trials, row.promise->success[k])) {
      fail("too few successes" + frame);
    }
    if (!(row.promise->median[k] > 0)) continue;
    std::size_t below = 0;
    for (const Trial& trial : trials) below += trial.error[k] < row.promise->median[k] ? 1U : 0U;
    if (!kept(below, row.trials, 0.5)) fail("median error too large" + frame);
  }
  if (row.promise->coverage > 0) {
    const auto covered =
        static_cast<std::size_t>(std::lround(row.coverage * static_cast<double>(row.successes.back())));
    if (!kept(covered, row.successes.back(), row.promise->coverage)) fail("covariance too small");
  }
  if (row.promise->wrong_frames > 0) {
    // Frames of a trial depend on one another: the mean of the trials is judged.
    const double errors = twoSidedNormalQuantile(2 * false_alarm);
    if (row.wrong_frames - errors * row.wrong_error > row.promise->wrong_frames) {
      fail("too many usable frames are wrong");
    }
    if (row.usable_frames + errors * row.usable_error < row.promise->usable_frames) fail("too few usable frames");
  }
  row.passed = row.reason.empty();
}

}  // namespace

std::string name(MotionMethod method) {
  constexpr const char* names[] = {"subspace",       "single_start", "forward",   "discrete",       "gauss_newton",
                                   "released",       "near_start",   "search",    "essential",      "essential_near",
                                   "composition",    "intervals",    "gyroscope", "gyroscope_bias", "gyroscope_robust",
                                   "essential_bias", "upset"};
  return names[static_cast<std::size_t>(method)];
}

std::vector<MotionRow> motionCells(const std::vector<MotionMethod>& methods) {
  std::vector<MotionRow> cells;
  const auto add = [&](M method, const MotionSceneOptions& scene) {
    if (std::find(methods.begin(), methods.end(), method) == methods.end()) return;
    MotionRow row;
    row.method = method, row.scene = scene, row.promise = promiseOf(method, scene);
    cells.push_back(row);
  };
  using enum MotionWorld;
  const auto scene = [](MotionWorld world, double sigma) {
    MotionSceneOptions options;
    options.world = world, options.sigma = sigma;
    return options;
  };
  const auto inertial = [&](MotionWorld world, double sigma, double gyroscope = 0.1, double bias = 0) {
    MotionSceneOptions options = scene(world, sigma);
    options.gyroscope_sigma = gyroscope, options.gyroscope_bias = bias;
    return options;
  };
  const auto wrong = [](MotionSceneOptions options) {
    options.outliers = 0.15;
    return options;
  };
  MotionSceneOptions fast = scene(orbit, 8);
  fast.rotation = 10;
  // Methods, and of each the worlds with the noises.
  const auto over = [&](std::initializer_list<M> of, std::initializer_list<MotionWorld> worlds,
                        std::initializer_list<double> sigmas, const auto& make) {
    for (const M method : of) {
      for (const MotionWorld world : worlds) {
        for (const double sigma : sigmas) add(method, make(world, sigma));
      }
    }
  };
  const auto usual = [&](MotionWorld world, double sigma) { return inertial(world, sigma); };
  const auto biased = [&](MotionWorld world, double sigma) { return inertial(world, sigma, 0.1, 0.115); };

  over({M::subspace}, {orbit, general}, {1, 4, 8}, scene);
  add(M::subspace, fast);
  over({M::subspace}, {orbit, general}, {1, 4}, [&](auto world, double sigma) { return wrong(scene(world, sigma)); });
  over({M::subspace}, {plane, narrow, turning}, {1, 4}, scene);
  over({M::single_start, M::forward, M::discrete}, {orbit, general}, {1, 4, 8}, scene);
  over({M::gauss_newton}, {orbit}, {1, 8}, scene);
  add(M::gauss_newton, fast);
  over({M::released}, {orbit, general}, {1}, scene);
  for (const double sigma : {12., 16.}) {
    for (const double rotation : {5., 10.}) {
      MotionSceneOptions options = scene(orbit, sigma);
      options.rotation = rotation;
      add(M::near_start, options);
    }
  }
  over({M::search}, {orbit, general}, {4}, scene);
  over({M::essential, M::essential_near, M::composition, M::intervals}, {orbit, general}, {1, 4, 8}, scene);
  over({M::essential, M::composition}, {turning}, {1}, scene);
  over({M::intervals}, {orbit, general}, {10}, scene);
  for (const MotionWorld world : {orbit, general}) {
    for (const double sigma : {1., 4., 8.}) {
      for (const double gyroscope : {0.02, 0.1, 0.5}) add(M::gyroscope, inertial(world, sigma, gyroscope));
    }
    add(M::gyroscope, inertial(world, 10));
  }
  for (const std::size_t points : {2U, 3U, 5U}) {
    for (const double sigma : {1., 4.}) {
      MotionSceneOptions options = inertial(orbit, sigma);
      options.points = points;
      add(M::gyroscope, options);
    }
  }
  over({M::gyroscope}, {plane, narrow, turning}, {1, 4}, usual);
  add(M::gyroscope, biased(orbit, 1));  // a bias that is not modelled
  over({M::gyroscope_bias, M::essential_bias}, {orbit, general}, {1, 4, 8}, biased);
  over({M::gyroscope_robust}, {orbit, general}, {1, 4},
       [&](auto world, double sigma) { return wrong(usual(world, sigma)); });
  for (const bool inertially : {false, true}) {
    for (const MotionUpset upset : all_motion_upsets) {
      const bool of_gyroscope = upset == MotionUpset::wrong_sign || upset == MotionUpset::dead;
      if (upset != MotionUpset::none && of_gyroscope != inertially) continue;
      MotionSceneOptions options = inertially ? inertial(general, 1) : scene(general, 1);
      options.upset = upset;
      add(M::upset, options);
    }
  }
  MotionSceneOptions tenth = scene(general, 1);
  tenth.outliers = 0.1;
  add(M::upset, tenth);
  return cells;
}

std::string sceneOf(const MotionRow& row) {
  const MotionSceneOptions normal;
  std::string text = nameOf(row.scene.world);
  if (row.scene.rotation != normal.rotation) text += fmt::format(" {:g} deg", row.scene.rotation);
  if (row.scene.points != normal.points) text += fmt::format(" N={}", row.scene.points);
  if (row.scene.gyroscope_sigma > 0) text += fmt::format(" g {:g}", row.scene.gyroscope_sigma);
  if (row.scene.gyroscope_bias > 0) text += fmt::format(" b {:g}", row.scene.gyroscope_bias);
  if (row.scene.upset != normal.upset) text += std::string(" ") + nameOf(row.scene.upset);
  if (row.scene.outliers > 0) text += fmt::format(" {:g} % out", 100 * row.scene.outliers);
  return text;
}

std::vector<MotionRow> validateMotion(const MotionValidation& validation, const RunProgress& progress) {
  const std::vector<MotionRow> cells = motionCells(validation.methods);
  std::vector<CellSize> sizes;
  std::size_t tests = 0;
  for (const MotionRow& cell : cells) {
    sizes.push_back({validation.run.trials, cell.method == MotionMethod::search ? 20. : 1.});
    tests += cell.promise ? testsOf(*cell.promise) : 0;
  }
  CellRun run(validation.run, sizes, progress);
  std::vector<MotionRow> rows;
  for (const MotionRow& cell : cells) {
    const auto trials = run.outcomes([&](std::uint64_t number) { return runTrial(cell, validation, number); });
    if (run.ended()) continue;
    rows.push_back(summarised(cell, trials));
    judge(rows.back(), trials, run_false_alarm / static_cast<double>(std::max<std::size_t>(tests, 1)));
  }
  return rows;
}

Judgement judgementOf(const std::vector<MotionRow>& rows) {
  Judgement judgement{.promises = {}, .where = "with a promise"};
  for (const MotionRow& row : rows) {
    judgement.promises.push_back(
        {fmt::format("{}, {}, {:g} px", name(row.method), sceneOf(row), row.scene.sigma), row.passed, row.reason});
  }
  return judgement;
}

}  // namespace liestat::experiments
