// How fusion/visual_inertial.hpp slides windows over a recording and fuses them.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/detail/median.hpp>
#include <fusion/init/detail/second_motion.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <fusion/init/window_fusion.hpp>
#include <fusion/visual_inertial_types.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The run over one recording: all that stays the same from window to window.
class RecordingRun {
 public:
  RecordingRun(const VisualInertialRecording& recording, const VisualInertialOptions& options,
               VisualInertialResult& result)
      : recording_(recording),
        options_(options),
        noise_(recording.noise),
        rate_(readingRate<double>(recording.readings, options.max_gap)) {
    std::vector<double> sigmas;
    by_image_.resize(times().size());
    for (std::size_t i = 0; i < recording.observations.size(); ++i) {
      const BearingMeasurement& seen = recording.observations[i];
      if (seen.image >= by_image_.size() || seen.camera >= recording.cameras.size()) {
        result.fault = {FaultKind::wrong_index, i};
        return;
      }
      by_image_[seen.image].push_back(&seen);
      sigmas.push_back(seen.sigma);
      tracks_ = std::max(tracks_, seen.track + 1);
    }
    if (!sigmas.empty()) bearing_noise_ = median(std::move(sigmas));
    result.bearing_noise = bearing_noise_;
    for (const double time : times()) {
      covered_.push_back(!recording.readings.empty() && time >= recording.readings.front().time &&
                         time <= recording.readings.back().time);
      result.images_outside += !covered_.back();
    }
  }

  /// The images of all windows.
  std::vector<std::vector<std::size_t>> windows() const {
    std::vector<std::vector<std::size_t>> windows;
    const double begin = options_.begin.value_or(times().front()), last = options_.end.value_or(times().back());
    std::size_t previous = times().size();
    for (std::size_t k = 0;; ++k) {
      const double from = begin + static_cast<double>(k) * stride();
      const auto at = std::lower_bound(times().begin(), times().end(), from - 1e-6);
      if (at == times().end() || from + options_.window > last + 0.5 * options_.window) break;
      auto first = static_cast<std::size_t>(at - times().begin());
      while (first < times().size() && !covered_[first]) ++first;
      if (first == times().size() || first == previous) continue;
      previous = first;
      std::vector<std::size_t> images = imagesFrom(first);
      if (images.size() >= 2 && times()[images.back()] <= last + 1e-6) windows.push_back(std::move(images));
    }
    return windows;
  }
  double stride() const { return options_.stride > 0 ? options_.stride : options_.window; }

  InitialisedWindow estimate(const std::vector<std::size_t>& images, const ImuBias<double>& start,
                             std::size_t number) const {
    InitialisedWindow w;
    w.images = images;
    w.begin = times()[images.front()];
    w.end = times()[images.back()];
    const std::optional<ImuBias<double>> known = options_.known_bias ? options_.known_bias(w.begin) : std::nullopt;
    w.known_biases = known.has_value();
    std::vector<double> image_times;
    image_times.reserve(images.size());
    for (const std::size_t j : images) image_times.push_back(times()[j]);
    std::vector<FeatureTrack> tracks = chooseTracks(w);
    w.measured = InertialWindow(recording_.readings, std::move(image_times), how(known.value_or(start)),
                                std::move(tracks), recording_.cameras);
    w.fault = w.measured.fault();
    if (w.fault) {
      if (w.fault.index < recording_.readings.size()) w.fault_time = recording_.readings[w.fault.index].time;
      return w;
    }
    const InitialisedWindow measured = w;
    findMotion(w, number, 1);
    if (options_.refinement) w.refined = refined(w, 1);
    // The search takes the motion that the readings tell for exact. Where their noise is larger than that of the
    // bearings, no motion fits these: the search is given more noise, as much as the readings can bring, and what agrees
    // in the end is judged by the refinement, which knows both.
    if (!options_.refinement || !options_.consensus) return w;
    for (double widening = 3; widening * bearing_noise_ < inertialAngle(w); widening *= 3) {
      const FusionStatus verdict = w.verdict();
      if (verdict != FusionStatus::no_consensus && verdict != FusionStatus::inconsistent) return w;
      InitialisedWindow wider = measured;
      findMotion(wider, number, widening);
      wider.refined = refined(wider, 1);
      dropMisfits(wider);
      if (wider.verdict() != FusionStatus::ok) continue;
      if (2 * wider.found.inliers.size() >= wider.tracks.size()) return wider;
    }
    return w;
  }

  /// A window refined with the n-th part of the information of the prior of the biases; empty: nothing to start from.
  /// Converged where the cost decreases by less than min_decrease; where that is infinite only the covariance is new.
  std::optional<RefinementResult> refined(const InitialisedWindow& w, std::size_t n,
                                          std::optional<double> min_decrease = {}) const {
    const bool at_rest = w.closedForm().status == FusionStatus::stationary && !w.closedForm().solutions.empty();
    if (!at_rest && !w.closedForm().hasMotion()) return std::nullopt;
    InitialisationOptions options = optionsOf(w);
    if (min_decrease) options.refinement.min_decrease = *min_decrease;
    if (std::isinf(options.refinement.min_decrease)) options.refinement.max_iterations = 0;
    if (w.known_biases) options.prior = {w.measured.bias(), 1e-6, 1e-6};  // as good as exact
    if (at_rest) {
      if (n == 1 && w.found.rest) return w.found.rest;
      return refineAtRest(w.measured.without(w.found.outliers), w.closedForm().solutions[0].gravity, w.measured.bias(),
                          options);
    }
    const ClosedFormSolution& closed = w.closedForm().solutions[0];
    if (!w.isRefined()) {
      return refine(w.measured.without(w.found.outliers), closed, w.measured.bias(), withSharedPrior(options, n));
    }
    // Again, with another noise or prior.
    return refine(w.measured.without(w.found.outliers), *w.refined, withSharedPrior(options, n));
  }

  /// Disjoint windows that are ok, in stretches, each as one.
  std::vector<FusedStretch> fuse(const std::vector<InitialisedWindow>& windows) const {
    std::vector<FusedStretch> stretches =
        stretchesOf(windows, [](const InitialisedWindow& w) { return w.ok() && w.refined; });
    for (FusedStretch& stretch : stretches) fuse(windows, estimates(windows, stretch), stretch);
    return stretches;
  }

  /// The windows that take part, in stretches.
  template <class TakesPart>
  std::vector<FusedStretch> stretchesOf(const std::vector<InitialisedWindow>& windows,
                                        const TakesPart& takes_part) const {
    std::vector<FusedStretch> stretches;
    double free_from = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < windows.size(); ++i) {
      const InitialisedWindow& w = windows[i];
      if (!takes_part(w) || w.begin < free_from) continue;
      const bool begins = stretches.empty() || w.end > stretches.back().begin + options_.stretch * (1 + 1e-9) ||
                          !hasReadings(stretches.back().end, w.begin);
      if (begins) stretches.emplace_back().begin = w.begin;
      stretches.back().windows.push_back(i);
      stretches.back().end = free_from = w.end;
    }
    return stretches;
  }

  /// The run with readings of another noise, whose windows are to be integrated with it (InertialWindow::withNoise).
  RecordingRun withNoise(const ImuNoise<double>& noise) const {
    RecordingRun other = *this;
    other.noise_ = noise;
    return other;
  }
  /// A window of a run with another noise. Which tracks agree and where the motion starts are questions of the bearings;
  /// a window that has no motion is estimated anew, because rest is a question of the readings.
  InitialisedWindow withThisNoise(const InitialisedWindow& window, std::size_t number) const {
    if (window.fault) return window;
    if (window.closedForm().status != FusionStatus::ok || !window.isRefined()) {
      return estimate(window.images, window.bias(), number);
    }
    InitialisedWindow w = window;
    w.measured = w.measured.withNoise(noise_);
    w.refined = refined(w, 1);
    return w;
  }

  /// A window's meeting with those before it.
  struct Meeting {
    std::size_t window;  ///< index in the result's windows
    WindowFusion::Meeting outcome;
  };
  /// The windows of a stretch, each with its part of the prior.
  std::vector<std::optional<RefinementResult>> estimates(const std::vector<InitialisedWindow>& windows,
                                                         const FusedStretch& stretch,
                                                         std::optional<double> min_decrease = {}) const {
    const std::size_t n = stretch.windows.size();
    std::vector<std::optional<RefinementResult>> all;
    for (const std::size_t i : stretch.windows) {
      all.push_back(n == 1 && !min_decrease ? windows[i].refined : refined(windows[i], n, min_decrease));
    }
    return all;
  }
  /// Fuses a stretch of such estimates; returns its meetings.
  std::vector<Meeting> fuse(const std::vector<InitialisedWindow>& windows,
                            const std::vector<std::optional<RefinementResult>>& estimates,
                            FusedStretch& stretch) const {
    stretch.gravity =
        options_.initialisation.gravity.value_or(windows[stretch.windows.front()].refined->gravity.norm());
    WindowFusion fusion(stretch.gravity);
    double end = 0;
    std::vector<std::size_t> used;
    std::vector<Meeting> meetings;
    for (std::size_t k = 0; k < stretch.windows.size(); ++k) {
      const std::size_t i = stretch.windows[k];
      const InitialisedWindow& w = windows[i];
      const std::optional<RefinementResult>& estimate = estimates[k];
      if (!estimate) continue;
      const auto meeting = fusion.add(windowStates(*estimate), [&](const ImuBias<double>& bias) {
        const auto between = motion(end, w.begin, bias);
        return between.ok() ? between.motion : Preintegration<double>({.noise = noise_, .bias = bias});
      });
      if (meeting.status != Status::ok) continue;
      if (meeting.degrees_of_freedom > 0) meetings.push_back({i, meeting});
      used.push_back(i);
      stretch.end = end = w.end;
    }
    stretch.windows = used;
    stretch.has_state = fusion.hasState();
    stretch.chi2 = fusion.chi2();
    stretch.degrees_of_freedom = fusion.degrees_of_freedom();
    stretch.p = fusion.p();
    stretch.inflation = fusion.inflation();
    stretch.state = fusion.state();
    if (options_.inflate && stretch.tested() && !stretch.ok()) {
      stretch.inflated = true;
      stretch.state.covariance *= stretch.inflation;
    }
    return meetings;
  }

 private:
  const std::vector<double>& times() const { return recording_.image_times; }
  RecordingOptions<double> how(const ImuBias<double>& bias) const {
    return {.preintegration = {.noise = noise_, .bias = bias, .rate = rate_},
            .scheme = options_.scheme,
            .max_gap = options_.max_gap,
            .chained = true};
  }
  RecordingResult<double> motion(double from, double to, const ImuBias<double>& bias) const {
    return preintegrate<double>(recording_.readings, from, to, how(bias));
  }
  bool hasReadings(double from, double to) const { return from >= to || motion(from, to, {}).ok(); }

  /// The images of a window that begins at image `first`; empty where the recording ends before.
  std::vector<std::size_t> imagesFrom(std::size_t first) const {
    std::vector<std::size_t> images{first};
    // Tolerates 5 % jitter in the images' times.
    const double least = options_.image_rate > 0 ? 0.95 / options_.image_rate : 0;
    const double end = times()[first] + options_.window, slack = 0.5 * std::max(least, 0.01);
    for (std::size_t j = first + 1; j < times().size() && times()[j] <= end + slack; ++j) {
      if (covered_[j] && times()[j] - times()[images.back()] >= least) images.push_back(j);
    }
    const bool whole = times()[images.back()] >= end - 1.05 * std::max(least, 0.06);
    return whole ? images : std::vector<std::size_t>{};
  }

  std::vector<FeatureTrack> chooseTracks(InitialisedWindow& w) const {
    std::vector<FeatureTrack> all(tracks_), chosen;
    for (std::size_t j = 0; j < w.images.size(); ++j) {
      for (const BearingMeasurement* seen : by_image_[w.images[j]]) {
        const std::optional<double> time = seen->time ? std::optional(*seen->time - w.begin) : std::nullopt;
        all[seen->track].push_back({j, seen->bearing, seen->sigma / bearing_noise_, seen->camera, time});
      }
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].size() >= options_.min_observations) w.tracks.push_back(i);
    }
    std::stable_sort(w.tracks.begin(), w.tracks.end(),
                     [&](std::size_t a, std::size_t b) { return all[a].size() > all[b].size(); });
    if (options_.max_features > 0 && w.tracks.size() > options_.max_features) w.tracks.resize(options_.max_features);
    std::sort(w.tracks.begin(), w.tracks.end());
    for (const std::size_t i : w.tracks) chosen.push_back(std::move(all[i]));
    return chosen;
  }

  InitialisationOptions optionsOf(const InitialisedWindow& w) const {
    InitialisationOptions options = options_.initialisation;
    options.bearing_noise = bearing_noise_;
    options.closed_form.estimate_bias = !w.known_biases && options_.window >= 2;
    return options;
  }

  /// rad: the error that the white noise of the readings brings by the end of a window to the bearing of a feature a
  /// metre away.
  double inertialAngle(const InitialisedWindow& w) const {
    const double T = w.end - w.begin, factor = options_.initialisation.inertial_noise_factor;
    return factor * std::hypot(noise_.gyroscope * std::sqrt(T), noise_.accelerometer * std::sqrt(T * T * T / 3));
  }

  /// Tracks that a wide search has taken for right and that the refined motion leaves too far for their noise: they go to
  /// the outliers, and the rest is refined anew.
  void dropMisfits(InitialisedWindow& w) const {
    const ConsensusOptions& own = options_.initialisation.consensus;
    for (std::size_t pass = 0; pass < own.local_passes && w.isRefined() && !w.refined->consistent(); ++pass) {
      std::vector<std::size_t> kept;
      for (const std::size_t i : w.found.inliers) {
        const FeatureTrack& track = w.measured.features[i];
        double chi2 = 0;
        for (const TrackedBearing& seen : track) {
          const SE23d& x = w.refined->states[seen.image];
          const SE3d body(SO3d(x.so3()), Eigen::Vector3d(x.translation()));
          const Eigen::Vector3d d = (body * w.measured.cameras[seen.camera]).inverse() * w.refined->features[i];
          const double sine = d.normalized().cross(seen.bearing.normalized()).norm();
          chi2 += std::pow(sine / (seen.relative_sigma * bearing_noise_), 2);
        }
        const double freedom = 2 * static_cast<double>(track.size()) - 3;
        const bool fits = chi2 <= freedom + own.misfit_sigmas * std::sqrt(2 * freedom);
        (fits ? kept : w.found.outliers).push_back(i);
      }
      if (kept.size() == w.found.inliers.size() || kept.size() <= own.features_drawn) break;
      w.found.inliers = std::move(kept);
      std::sort(w.found.outliers.begin(), w.found.outliers.end());
      w.refined = refined(w, 1);
    }
  }

  /// `widening`: factor of the bearings' noise in the search.
  void findMotion(InitialisedWindow& w, std::size_t number, double widening) const {
    InitialisationOptions options = optionsOf(w);
    options.bearing_noise *= widening;
    options.consensus.seed = CounterRng(options.consensus.seed, number)();
    RobustInitialisation& found = w.found;
    found.gyroscope_bias = w.measured.bias().gyroscope;
    if (w.known_biases && options_.consensus) {
      ConsensusResult consensus = solveClosedFormRobustly(closedFormWindow(w.measured), options);
      found.result = std::move(consensus.result);
      found.inliers = std::move(consensus.inliers);
      found.outliers = std::move(consensus.outliers);
      found.hypotheses = consensus.hypotheses;
      addSecondMotion(w.measured, w.measured.bias(), options, found);
      return;
    }
    if (options_.consensus) {
      found = initialiseRobustly(w.measured, options);
    } else {
      for (std::size_t i = 0; i < w.measured.features.size(); ++i) found.inliers.push_back(i);
      if (w.known_biases) {
        found.result = solveClosedForm(closedFormWindow(w.measured), options);
        return;
      }
      GyroscopeBiasResult estimate = estimateGyroscopeBias(w.measured, options);
      found.bias_status = estimate.status;
      found.result = std::move(estimate.result);
      if (estimate.status == FusionStatus::ok) found.gyroscope_bias = estimate.bias;
    }
    w.measured.integrate({found.gyroscope_bias, w.measured.bias().accelerometer});
  }

  const VisualInertialRecording& recording_;
  const VisualInertialOptions& options_;
  ImuNoise<double> noise_;
  double rate_;  ///< of the readings, Hz
  std::vector<std::vector<const BearingMeasurement*>> by_image_;
  std::vector<bool> covered_;
  std::size_t tracks_ = 0;
  double bearing_noise_ = 0;
};

/// The calibration of a recording's noise by its windows (fusion/noise_calibration.hpp). goesOn() is asked after each of at
/// most `max_noise_passes` passes over all of them; once it says no, the status is not_converged. Windows are left as the
/// last pass has estimated them: starts for an estimate with the calibrated noise.
inline constexpr std::size_t max_noise_passes = 11;
LIESTAT_FUSION_API NoiseCalibration calibrateWindows(const VisualInertialRecording& recording, const RecordingRun& run,
                                                     std::vector<InitialisedWindow>& windows,
                                                     const std::function<bool()>& goesOn);

}  // namespace liestat::detail
