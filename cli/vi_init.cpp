#include <cli/vi_init.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <utility>

#include <cli/io/input_error.hpp>
#include <experiments/summary.hpp>
#include <cli/vi_fusion.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr double most_windows = 2e4;

/// The angle between two directions.
double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// A pixel as a bearing in the body's axes.
struct Bearing {
  std::size_t track = 0;
  Eigen::Vector3d bearing;
  double deviation = 0;  ///< rad a pixel
};

/// What does not change from window to window.
class Initialiser {
 public:
  Initialiser(const ViRecording& recording, const ViInitOptions& options, ViInitResult& result)
      : recording_(recording), options_(options) {
    readBearings(result);
    for (std::size_t j = 0; j < recording.tracks.times.size(); ++j) {
      times_.push_back(recording.tracks.times[j] + recording.camera.timeshift_cam_imu);
      const bool covered =
          times_[j] >= recording.imu.samples.front().time && times_[j] <= recording.imu.samples.back().time;
      covered_.push_back(covered);
      result.images_outside += !covered;
    }
    noise_ = recording.noise;
    for (double* density :
         {&noise_.gyroscope, &noise_.accelerometer, &noise_.gyroscope_walk, &noise_.accelerometer_walk})
      *density *= options.noise_factor;
  }

  const std::vector<double>& times() const { return times_; }
  bool covered(std::size_t image) const { return covered_[image]; }
  double bearingNoise() const { return bearing_noise_; }

  /// The images of a window that begins at image `first`; empty where the recording ends before.
  std::vector<std::size_t> imagesFrom(std::size_t first) const {
    std::vector<std::size_t> images{first};
    // Clocks jitter: a twentieth of the distance is none of their business.
    const double least = options_.image_rate > 0 ? 0.95 / options_.image_rate : 0,
                 end = times_[first] + options_.window;
    const double slack = 0.5 * std::max(least, 0.01);
    std::size_t j = first + 1;
    for (; j < times_.size() && times_[j] <= end + slack; ++j) {
      if (covered_[j] && times_[j] - times_[images.back()] >= least) images.push_back(j);
    }
    const bool whole = times_[images.back()] >= end - 1.05 * std::max(least, 0.06);
    return whole ? images : std::vector<std::size_t>{};
  }

  ViWindow estimate(const std::vector<std::size_t>& images, const ImuBias<double>& start, std::size_t number) const {
    ViWindow w;
    w.images = images;
    w.begin = times_[images.front()];
    w.end = times_[images.back()];
    chooseTracks(w);
    const std::optional<GroundTruth> truth = truthAt(recording_.truth, w.begin);
    // Where there is no truth at the time, its biases are not known.
    w.known_biases = options_.true_biases ? truth.has_value() : options_.known_biases;
    w.integrated = options_.true_biases && truth ? truth->bias : start;
    w.measured.motions = integrate(w, w.integrated);
    if (w.fault != FaultKind::none) return w;
    findMotion(w, number);
    if (options_.refinement) refineWindow(w, 1, w.refined);
    compare(w);
    return w;
  }

  /// A window again, with a part of the prior.
  std::optional<RefinementResult> withPartOfPrior(ViWindow window, std::size_t n) const {
    std::optional<RefinementResult> refined;
    refineWindow(window, n, refined);
    return refined;
  }

  Preintegration<double> motion(double from, double to, const ImuBias<double>& bias) const {
    const auto whole = preintegrateBetween(from, to, bias);
    return whole.ok() ? whole.motion : Preintegration<double>({.noise = noise_, .bias = bias});
  }
  bool hasReadings(double from, double to) const { return from >= to || preintegrateBetween(from, to, {}).ok(); }

 private:
  RecordingResult<double> preintegrateBetween(double from, double to, const ImuBias<double>& bias) const {
    return preintegrate<double>(std::span<const ImuSample<double>>(recording_.imu.samples), from, to,
                                {.preintegration = {.noise = noise_, .bias = bias},
                                 .scheme = options_.scheme,
                                 .largest_gap = options_.largest_gap});
  }

  void readBearings(ViInitResult& result) {
    const Camera& camera = recording_.camera.camera;
    const SO3d imu_R_cam = recording_.camera.imu_T_cam.so3();
    std::vector<double> deviations;
    by_image_.resize(recording_.tracks.times.size());
    for (const PixelObservation& seen : recording_.tracks.observations) {
      const std::optional<BearingWithSigma> ray = camera.bearingWithSigma({seen.u, seen.v});
      if (!ray) {
        ++result.observations_outside;
        continue;
      }
      by_image_[seen.image].push_back({seen.track, imu_R_cam * ray->direction, ray->sigma});
      deviations.push_back(ray->sigma);
    }
    bearing_unit_ = quantile(deviations, 0.5);
    bearing_noise_ = options_.pixel_noise * bearing_unit_;
    result.bearing_noise = bearing_noise_;
  }

  void chooseTracks(ViWindow& w) const {
    std::vector<FeatureTrack> all(recording_.tracks.track_ids.size());
    for (std::size_t j = 0; j < w.images.size(); ++j) {
      for (const Bearing& seen : by_image_[w.images[j]])
        all[seen.track].push_back({j, seen.bearing, seen.deviation / bearing_unit_});
    }
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].size() >= options_.least_observations) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return all[a].size() > all[b].size(); });
    if (options_.features > 0 && order.size() > options_.features) order.resize(options_.features);
    std::sort(order.begin(), order.end());
    w.tracks = order;
    for (const std::size_t i : order) w.measured.features.push_back(std::move(all[i]));
    w.measured.camera = recording_.camera.imu_T_cam.translation();
  }

  std::vector<Preintegration<double>> integrate(ViWindow& w, const ImuBias<double>& bias) const {
    std::vector<Preintegration<double>> motions;
    for (std::size_t j = 1; j < w.images.size(); ++j) {
      const auto step = preintegrateBetween(times_[w.images[j - 1]], times_[w.images[j]], bias);
      if (!step.ok()) {
        w.fault = step.fault;
        w.fault_time = recording_.imu.samples[step.sample].time;
        return {};
      }
      motions.push_back(step.motion);
    }
    return motions;
  }

  ClosedFormOptions closedFormOptions(bool known) const {
    // An accelerometer's bias is only told in two seconds or more (design note, 3.5).
    return {.gravity = options_.gravity,
            .bearing_noise = bearing_noise_,
            .estimate_bias = !known && options_.window >= 2,
            .bias_deviation = options_.accelerometer_deviation};
  }

  void findMotion(ViWindow& w, std::size_t number) const {
    const ClosedFormOptions closed_form = closedFormOptions(w.known_biases);
    RobustInitialisation& found = w.found;
    const auto integrateAnew = [&](const ImuBias<double>& bias) {
      ViWindow again = w;
      return integrate(again, bias);
    };
    found.gyroscope_bias = w.integrated.gyroscope;
    if (options_.consensus) {
      std::mt19937_64 generator(options_.seed + 0x9E3779B97F4A7C15ULL * number);
      if (w.known_biases) {
        ConsensusResult consensus = solveClosedFormRobustly(closedFormWindow(w.measured, w.integrated),
                                                                   generator, {.closed_form = closed_form});
        found.result = std::move(consensus.result);
        found.inliers = std::move(consensus.inliers);
        found.outliers = std::move(consensus.outliers);
        found.hypotheses = consensus.hypotheses;
        return;
      }
      RobustInitialisationOptions options;
      options.ransac.closed_form = closed_form;
      options.prior = options_.prior.gyroscope;
      options.prior_deviation = options_.gyroscope_deviation;
      found = initialiseRobustly(w.measured, generator, options, integrateAnew);
    } else {
      for (std::size_t i = 0; i < w.measured.features.size(); ++i) found.inliers.push_back(i);
      if (w.known_biases) {
        found.result = solveClosedForm(closedFormWindow(w.measured, w.integrated), closed_form);
        return;
      }
      GyroscopeBiasOptions options;
      options.closed_form = closed_form;
      options.prior = options_.prior.gyroscope;
      options.prior_deviation = options_.gyroscope_deviation;
      GyroscopeBiasResult estimate = estimateGyroscopeBias(w.measured, options, integrateAnew);
      found.bias_status = estimate.status;
      found.result = std::move(estimate.result);
      if (estimate.status == FusionStatus::ok) found.gyroscope_bias = estimate.bias;
    }
    w.integrated.gyroscope = found.gyroscope_bias;
    w.measured.motions = integrate(w, w.integrated);
  }

  /// The window with the tracks that agree; the others keep their places.
  static InertialWindow agreeing(const ViWindow& w) {
    InertialWindow kept = w.measured;
    for (const std::size_t i : w.found.outliers) kept.features[i].clear();
    return kept;
  }

  void refineWindow(ViWindow& w, std::size_t parts, std::optional<RefinementResult>& refined) const {
    const ClosedFormResult& closed = w.closedForm();
    if (closed.solutions.empty() || closed.status == FusionStatus::stationary ||
        closed.status == FusionStatus::scale_unobservable) {
      return;
    }
    RefinementOptions options;
    options.bearing_noise = bearing_noise_;
    options.gravity = options_.gravity;
    options.prior = options_.prior;
    options.gyroscope_deviation = options_.gyroscope_deviation;
    options.accelerometer_deviation = options_.accelerometer_deviation;
    if (w.known_biases) {
      // As good as exact.
      options.prior = w.integrated;
      options.gyroscope_deviation = options.accelerometer_deviation = 1e-6;
    }
    options = withSharedPrior(options, parts);
    InertialWindow kept = agreeing(w);
    ImuBias<double> bias = w.integrated;
    ClosedFormSolution start = closed.solutions[0];
    for (int pass = 0; pass < 4; ++pass) {
      const RefinementResult result = refine(kept, start, bias, options);
      refined = result;
      if (result.states.empty() || !result.must_reintegrate) return;
      // Too far for a first-order update: the readings again with these biases, and on from there.
      bias = result.bias;
      start.velocity = result.velocity();
      start.gravity = result.gravity;
      start.accelerometer_bias.setZero();
      start.features = result.features;
      kept.motions = integrate(w, bias);
    }
  }

  /// With the truth, where that is known.
  void compare(ViWindow& w) const {
    std::vector<GroundTruth> truth;
    for (const std::size_t j : w.images) {
      const std::optional<GroundTruth> at = truthAt(recording_.truth, times_[j]);
      if (!at) return;
      truth.push_back(*at);
    }
    const SO3d back = SO3d(truth[0].state.so3()).inverse();
    const Eigen::Vector3d V = back * Eigen::Vector3d(truth[0].state.velocity());
    const Eigen::Vector3d G = back * Eigen::Vector3d(0, 0, -options_.gravity.value_or(9.81));
    const auto errorOf = [&](const Eigen::Vector3d& velocity, const Eigen::Vector3d& gravity,
                             const std::vector<SE23d>& states) {
      double both = 0, own = 0;
      for (std::size_t j = 0; j < states.size(); ++j) {
        const Eigen::Vector3d p = back * Eigen::Vector3d(truth[j].state.translation() - truth[0].state.translation());
        both += p.dot(states[j].translation());
        own += p.squaredNorm();
      }
      return ViError{(velocity - V).norm(), angleBetween(gravity, G), both / own - 1};
    };
    const ClosedFormResult& closed = w.closedForm();
    if (!closed.solutions.empty()) {
      const ClosedFormSolution& s = closed.solutions[0];
      ViWindow only = w;
      only.refined.reset();
      w.closed_form_error = errorOf(s.velocity, s.gravity, only.states());
    }
    w.gyroscope_error = (w.bias().gyroscope - truth[0].bias.gyroscope).norm();
    if (!w.refined || w.refined->status != FusionStatus::ok) return;
    w.refined_error = errorOf(w.refined->velocity(), w.refined->gravity, w.refined->states);
    if (options_.gravity) w.nees = neesOf(*w.refined, V, G);
  }

  /// Of V and G, G on its sphere.
  static double neesOf(const RefinementResult& refined, const Eigen::Vector3d& V, const Eigen::Vector3d& G) {
    Eigen::Matrix<double, 5, 6> J = Eigen::Matrix<double, 5, 6>::Zero();
    J.topLeftCorner<3, 3>().setIdentity();
    // Two axes across gravity.
    J.bottomRightCorner<2, 3>() = detail::tangentRows(refined.gravity.normalized());
    Eigen::Matrix<double, 6, 1> error;
    error << refined.velocity() - V, refined.gravity - G;
    return mahalanobisSquared<double, 5>(
        J * error, Eigen::Matrix<double, 5, 5>(J * refined.covariance.topLeftCorner<6, 6>() * J.transpose()));
  }

  const ViRecording& recording_;
  const ViInitOptions& options_;
  ImuNoise<double> noise_;
  std::vector<std::vector<Bearing>> by_image_;
  std::vector<double> times_;
  std::vector<bool> covered_;
  double bearing_unit_ = 0, bearing_noise_ = 0;
};

}  // namespace

ImuBias<double> ViWindow::bias() const {
  if (refined && refined->status == FusionStatus::ok) return refined->bias;
  ImuBias<double> best = integrated;
  if (!closedForm().solutions.empty()) best.accelerometer += closedForm().solutions[0].accelerometer_bias;
  return best;
}

std::vector<SE23d> ViWindow::states() const {
  if (refined && refined->status == FusionStatus::ok) return refined->states;
  std::vector<SE23d> list;
  if (closedForm().solutions.empty()) return list;
  const ClosedFormSolution& s = closedForm().solutions[0];
  ImuBias<double> used = integrated;
  used.accelerometer += s.accelerometer_bias;
  for (const BiasedImage& b : biasedImages(measured.motions, used)) {
    const double t = b.image.time;
    list.emplace_back(SO3d(b.image.rotation),
                      Eigen::Vector3d(t * s.velocity + (0.5 * t * t) * s.gravity + b.image.displacement),
                      Eigen::Vector3d(s.velocity + t * s.gravity + b.speed));
  }
  return list;
}

bool ViWindow::ok() const {
  if (fault != FaultKind::none || closedForm().status != FusionStatus::ok) return false;
  if (refined) return refined->ok();
  return closedForm().consistent && !found.inliers.empty();
}

std::string ViWindow::status() const {
  if (fault != FaultKind::none) return fault == FaultKind::gap ? "gap" : "no_readings";
  const ClosedFormResult& closed = closedForm();
  if (tracks.empty() || closed.fault == FaultKind::no_feature) return "no_features";
  if (closed.status != FusionStatus::ok) return name(closed.status);
  if (found.inliers.empty()) return "no_consensus";
  if (ok()) return "ok";
  if (refined && refined->status != FusionStatus::ok) return "not_refined";
  return "inconsistent";
}

ViInitResult initialise(const ViRecording& recording, const ViInitOptions& options,
                        const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  ViInitResult result;
  const Initialiser initialiser(recording, options, result);
  const std::vector<double>& times = initialiser.times();
  const double begin = options.begin.value_or(times.front()), last = options.end.value_or(times.back());
  const double stride = options.stride > 0 ? options.stride : options.window;
  if (!((last - begin) / stride < most_windows)) {
    throw InputError("liestat vi-init", 0,
                     fmt::format("{:.3g} windows from {} to {} s", (last - begin) / stride, begin, last),
                     fmt::format("at most {:g}", most_windows));
  }
  std::vector<std::vector<std::size_t>> windows;
  std::size_t previous = times.size();
  for (std::size_t k = 0;; ++k) {
    const double from = begin + static_cast<double>(k) * stride;
    const auto at = std::lower_bound(times.begin(), times.end(), from - 1e-6);
    if (at == times.end() || from + options.window > last + 0.5 * options.window) break;
    auto first = static_cast<std::size_t>(at - times.begin());
    while (first < times.size() && !initialiser.covered(first)) ++first;
    if (first == times.size() || first == previous) continue;
    previous = first;
    std::vector<std::size_t> images = initialiser.imagesFrom(first);
    if (images.size() >= 2 && times[images.back()] <= last + 1e-6) windows.push_back(std::move(images));
  }
  if (windows.empty()) {
    throw InputError("liestat vi-init", 0,
                     fmt::format("no window of {} s fits: {} images from {:.6g} to {:.6g} s, {} of them outside of the "
                                 "readings' {:.6g} to {:.6g} s",
                                 options.window, times.size(), times.front(), times.back(), result.images_outside,
                                 recording.imu.samples.front().time, recording.imu.samples.back().time),
                     "images that the readings cover, on the same clock");
  }
  ImuBias<double> bias = options.prior;
  for (const std::vector<std::size_t>& images : windows) {
    progress(result.windows.size(), windows.size());
    result.windows.push_back(initialiser.estimate(images, bias, result.windows.size()));
    // Biases hardly change from window to window.
    const ViWindow& w = result.windows.back();
    if (!options.known_biases && w.ok() && w.refined) bias = w.refined->bias;
  }
  if (options.stretch > 0) {
    result.fusions = fuseStretches(
        result.windows, recording, options,
        {.refine = [&](const ViWindow& w, std::size_t n) { return initialiser.withPartOfPrior(w, n); },
         .motion = [&](double from, double to, const ImuBias<double>& b) { return initialiser.motion(from, to, b); },
         .has_readings = [&](double from, double to) { return initialiser.hasReadings(from, to); }});
  }
  return result;
}

}  // namespace liestat::cli
