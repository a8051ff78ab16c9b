// The result of visual-inertial initialisation as programs show it: windows and stretches with their errors against a
// truth (fusion/visual_inertial_truth.hpp), the verdict, and the description of all of it.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/visual_inertial_types.hpp>
#include <stats/quantile.hpp>
#include <stats/shown.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// The errors of an estimate against the ground truth.
struct InitialisationError {
  double speed = 0;    ///< m/s, of the velocity at the first image
  double gravity = 0;  ///< rad, of its direction
  double scale = 0;    ///< relative, of the trajectory of the window: (Σ p·p_true)/(Σ p_true²) − 1
};

/// One window, compared with the ground truth where that is known.
struct ComparedWindow : InitialisedWindow {
  std::vector<double> image_times;         ///< s
  std::vector<std::uint64_t> track_names;  ///< numbers by which tracks are shown: the recording's, or a file's
  std::optional<InitialisationError> closed_form_error, refined_error;
  std::optional<double> gyroscope_error;              ///< rad/s, of the best known bias
  std::optional<double> nees;                         ///< the refined V and G's, 5 degrees of freedom
  std::optional<double> velocity_nees, gravity_nees;  ///< each by itself, 3 and 2 degrees of freedom

  bool hasSolution() const { return !closedForm().solutions.empty(); }
  /// The motion does not leave the scale open.
  bool hasScale() const {
    return closedForm().status != FusionStatus::scale_unobservable && closedForm().status != FusionStatus::stationary;
  }
  /// The best known motion at the first image: the refined one, else the closed form's first; zero without either.
  ClosedFormSolution best() const {
    ClosedFormSolution motion = hasSolution() ? closedForm().solutions[0] : ClosedFormSolution();
    if (isRefined()) motion.velocity = refined->velocity(), motion.gravity = refined->gravity;
    return motion;
  }
  /// Predicted standard deviations of the best known scale (relative) and vertical (rad).
  double scaleSigma() const { return isRefined() ? refined->scale_sigma : closedForm().scale_sigma; }
  double tiltSigma() const { return isRefined() ? refined->tilt_sigma : closedForm().tilt_sigma; }
  /// χ² over its degrees of freedom, of the refinement or else of the closed form; NaN without degrees of freedom.
  double costPerDegree() const {
    if (refined && refined->degrees_of_freedom > 0) {
      return refined->cost / static_cast<double>(refined->degrees_of_freedom);
    }
    return hasSolution() && closedForm().degrees_of_freedom > 0
               ? closedForm().solutions[0].cost / static_cast<double>(closedForm().degrees_of_freedom)
               : std::numeric_limits<double>::quiet_NaN();
  }
  /// The error of the best known motion, with a truth.
  const std::optional<InitialisationError>& error() const { return refined_error ? refined_error : closed_form_error; }
};

/// The state that disjoint windows give together, compared with the ground truth where that is known.
struct ComparedStretch : FusedStretch {
  /// In the body's axes: a unit vector, m/s, rad/s, m/s², with the RMS of the standard deviations of their coordinates.
  Eigen::Vector3d down = Eigen::Vector3d::Zero(), velocity = down, gyroscope_bias = down, accelerometer_bias = down;
  double down_sigma = 0, velocity_sigma = 0, gyroscope_sigma = 0, accelerometer_sigma = 0;
  std::optional<double> speed_error, gravity_error, gyroscope_error, accelerometer_error;  ///< m/s, rad, rad/s, m/s²
  std::optional<double> nees;                                                              ///< 11 degrees of freedom
};

/// Medians and 95 % of errors.
struct InitialisationErrors {
  std::vector<double> speed, gravity, scale;  ///< m/s, degrees, percent

  void add(const InitialisationError& error);
  std::size_t size() const { return speed.size(); }
};

/// Errors and test values over all windows.
struct InitialisationSummary {
  std::map<std::string, std::size_t> statuses;  ///< how many windows ended so
  InitialisationErrors closed_form, refined;
  std::vector<double> gyroscope;  ///< rad/s
  double nees = 0, cost = 0;      ///< sums
  std::size_t with_nees = 0, degrees_of_freedom = 0;
  std::size_t compared = 0, compared_not_ok = 0;  ///< windows whose errors these are
};

/// The errors of several estimates against the truth: the mean of their NEES.
struct InitialisationTest {
  std::size_t n = 0;  ///< estimates that claim to be right and that the truth covers
  double nees = 0;    ///< mean
  int expected = 0;   ///< degrees of freedom of each
  /// Bound of the probability of a larger mean. Windows of a recording share its biases and their prior, so their errors
  /// depend on each other, and the sum does not follow χ²: the bound holds for any dependence.
  double p = 1;
};

/// A recording's windows and stretches.
struct ComparedRecording {
  std::vector<ComparedWindow> windows;
  std::vector<ComparedStretch> stretches;
  std::optional<NoiseCalibration> noise_calibration;  ///< as of VisualInertialResult, as is the next
  FilterStart filter_start;
  std::optional<double> gravity;   ///< |G| that was given, m/s²
  double bearing_noise = 0;        ///< rad
  std::size_t images_outside = 0;  ///< that the readings do not cover
  std::size_t windows_left = 0;    ///< not estimated, because of an interrupt

  std::size_t okWindows() const;
  /// NEES of velocity and gravity of the windows that are ok (5), and of the states of the stretches that are ok (11).
  InitialisationTest windowTest() const;
  InitialisationTest stretchTest() const;
  /// Verdict on the covariances against the truth: no, if one of these tests has a p below `false_alarm`. The errors of the
  /// truth are in no covariance: they must be small. None where no estimate that is ok is covered by the truth.
  Verdict againstTruth(double false_alarm = 1e-5) const;
  /// Verdict on the result: trusted if nothing was interrupted, a window is ok, those of a stretch of two and more
  /// agree, and with a truth the errors follow the covariances. Windows that were not fused are not tested.
  Verdict verdict() const;
  /// True if the recording's windows tell the densities of its sensor's noise.
  bool noiseIsVerified() const {
    return noise_calibration && noise_calibration->evidence != NoiseEvidence::unverified_noise;
  }
  /// Notes on what the covariances rest on, each beginning with its name: unverified_noise.
  std::vector<std::string> notes() const;
  /// Summary of all windows that claim a scale, not only of those that came out well.
  InitialisationSummary summary() const;
};

// --- Descriptions, of the steps' results as well ---------------------------------------------------------------------

namespace detail {

/// Points as rows.
inline Eigen::Matrix<double, Eigen::Dynamic, 3> rowsOfPoints(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix<double, Eigen::Dynamic, 3> rows(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return rows;
}

/// A state of a refined window at a time.
struct TimedState {
  double time = 0;
  SE23d state;
};
template <class V>
void describe(V& v, const TimedState& x) {
  v("t", x.time, "", "s")("quaternion_xyzw", Eigen::Vector4d(x.state.so3().params()));
  v("position", Eigen::Vector3d(x.state.translation()), "", "m");
  v("velocity", Eigen::Vector3d(x.state.velocity()), "", "m/s");
}

/// A feature of the closed form with its track.
struct TrackedFeature {
  std::uint64_t track = 0;
  ClosedFormFeature feature;
};
template <class V>
void describe(V& v, const TrackedFeature& x) {
  v("track", x.track, "its name")("observations", x.feature.observations, "images that see it")("used", x.feature.used);
  v("residual", x.feature.residual, "of its equations")("parallax", x.feature.parallax, "", "rad");
  v("depth_deviation", x.feature.depth_sigma, "standard deviation of its depth", "m");
}

/// A refinement with the times of its states.
struct TimedRefinement {
  RefinementResult result;
  std::vector<double> times;
};
template <class V>
void describe(V& v, const TimedRefinement& x) {
  const RefinementResult& r = x.result;
  v("status", r.converged() ? "refined" : liestat::describe(r.status),
    "refined, or why not: then the fields from "
    "scale_sigma on are missing");
  v("consistent", r.consistent(), "the cost is that of the stated noise")("cost", r.cost, "chi-squared");
  v("degrees_of_freedom", r.degrees_of_freedom, "of the cost")("features_used", r.features_used);
  if (!shown(v, r.converged())) return;
  v("scale_sigma", r.scale_sigma, "predicted standard deviation of the scale, relative");
  v("tilt_sigma", r.tilt_sigma, "that of the vertical", "rad")("prior_p", r.prior_p, "of the biases under their prior");
  v("velocity", r.velocity(), "", "m/s")("gravity", r.gravity, "", "m/s²");
  v("gyroscope_bias", r.bias.gyroscope, "at the first image", "rad/s");
  v("accelerometer_bias", r.bias.accelerometer, "at the first image", "m/s²");
  v("last_gyroscope_bias", r.last_bias.gyroscope, "at the last image: another one if biases follow a random walk",
    "rad/s");
  v("last_accelerometer_bias", r.last_bias.accelerometer, "", "m/s²");
  v("covariance", r.covariance.atFirst(), "at the first image");
  v("covariance_order", "velocity gravity gyroscope_bias accelerometer_bias", "in words");
  v("covariance_frame", "axes of the body at the first image, m/s m/s^2 rad/s m/s^2", "in words");
  v("covariance_content", "image noise, inertial noise and the priors of the biases", "noise that it accounts for");
  v("last_covariance", r.covariance.atLast(), "at the last image");
  v("last_covariance_order", "position rotation velocity gravity gyroscope_bias accelerometer_bias", "in words");
  v("last_covariance_side", "right: of the last state in its own axes; gravity in those of the first image",
    "in words");
  std::vector<TimedState> states;
  for (std::size_t j = 0; j < r.states.size() && j < x.times.size(); ++j) states.push_back({x.times[j], r.states[j]});
  v("states", states, "at all images")("features", rowsOfPoints(r.features), "those that were used", "m");
}

struct StatusCounts {
  std::map<std::string, std::size_t> counts;
};
template <class V>
void describe(V& v, const StatusCounts& x) {
  for (const auto& [status, count] : x.counts) v(status.c_str(), count);
}

}  // namespace detail

template <class V>
void describe(V& v, const ClosedFormSolution& s) {
  v("velocity", s.velocity, "", "m/s")("gravity", s.gravity, "", "m/s²");
  v("accelerometer_bias_change", s.accelerometer_bias, "against the one with which the readings were integrated",
    "m/s²");
  v("roll", s.roll(), "", "rad")("pitch", s.pitch(), "", "rad")("cost", s.cost, "chi-squared, or squared residuals");
  v("negative_depths", s.negative_depths, "features behind a camera");
  v("features", detail::rowsOfPoints(s.features), "a row for each track; null: not used", "m");
}

template <class V>
void describe(V& v, const SecondMotion& second) {
  v("tracks", second.inliers.size(), "that agree on it");
  const auto& solutions = second.result.solutions;
  if (!shown(v, !solutions.empty())) return;
  const ClosedFormSolution solution = solutions.empty() ? ClosedFormSolution() : solutions[0];
  v("velocity", solution.velocity, "", "m/s")("gravity", solution.gravity, "", "m/s²");
  if (shown(v, second.result.covariance.size() > 0)) {
    v("covariance", Eigen::MatrixXd(second.result.covariance), "if it is known");
  }
}

template <class V>
void describe(V& v, const InitialisationError& e) {
  v("speed", e.speed, "", "m/s")("gravity", e.gravity, "of its direction", "rad")("scale", e.scale, "relative");
}

/// Fields of a window; those of its steps only where the readings had no fault.
template <class V>
void describe(V& v, const ComparedWindow& w) {
  v("begin", w.begin, "", "s")("end", w.end, "", "s")("status", name(w.verdict()), "of the whole window");
  v("ok", w.ok(), "the window is to be trusted")("images", w.images.size(), "the number of those used");
  v("tracks", w.tracks.size(), "the number of those used");
  if (shown(v, bool(w.fault)))
    v("fault_time", w.fault_time, "of readings at fault; the fields below are then missing", "s");
  if (!shown(v, !w.fault)) return;
  const ClosedFormResult& c = w.closedForm();
  v("closed_form_status", name(c.status))("in_words", describe(c.status), "the status of the closed form");
  v("consistent", c.consistent, "its cost is that of the stated noise");
  v("null_dimension", c.null_dimension, "of the scaled linear system")("singular_values", c.singular_values);
  v("largest_singular_value", c.largest_singular_value)("solutions", c.solutions, "both, if there are two");
  std::vector<detail::TrackedFeature> features;
  for (std::size_t i = 0; i < c.features.size(); ++i) features.push_back({w.track_names[i], c.features[i]});
  v("features", features, "of the tracks")("features_used", c.features_used, "their number");
  v("features_rejected", w.found.outliers.size(), "outliers")("images_used", c.images_used, "their number");
  v("hypotheses", w.found.hypotheses, "random samples of the consensus")("degrees_of_freedom", c.degrees_of_freedom);
  v("covariance", c.covariance.size() > 0 ? std::optional(Eigen::MatrixXd(c.covariance)) : std::nullopt,
    "of the closed form");
  v("covariance_content", describe(c.covariance_content), "noise that it accounts for");
  v("covariance_order", c.covariance.rows() == 9 ? "velocity gravity accelerometer_bias" : "velocity gravity",
    "in words");
  v("scale_deviation", c.scale_sigma, "predicted standard deviation of the scale, relative");
  v("tilt_deviation", c.tilt_sigma, "that of the vertical", "rad");
  v("unseen_speed_per_depth", c.unseen_speed_per_depth,
    "of a stationary window: uniform speed per metre of depth above which motion would have been detected", "1/s");
  v("second_motion", w.found.second, "of an ambiguous window: that on which another group of tracks agrees");
  v("integrated_gyroscope_bias", w.measured.bias().gyroscope, "with which the readings were integrated", "rad/s");
  v("integrated_accelerometer_bias", w.measured.bias().accelerometer, "likewise", "m/s²");
  v("gyroscope_bias", w.found.gyroscope_bias, "that was estimated", "rad/s");
  v("gyroscope_bias_status",
    w.found.bias_status == FusionStatus::ok ? "the gyroscope's bias was found" : describe(w.found.bias_status),
    "in words");
  v("refined", w.refined ? std::optional(detail::TimedRefinement{*w.refined, w.image_times}) : std::nullopt,
    "by all measurements");
  const auto known = [&](const char* name, const auto& error, const char* meaning, const char* unit = "") {
    using Error = std::remove_cvref_t<decltype(*error)>;
    if (shown(v, error.has_value())) v(name, error ? *error : Error(), meaning, unit);
  };
  known("closed_form_error", w.closed_form_error, "with a truth");
  known("refined_error", w.refined_error, "with a truth");
  known("gyroscope_bias_error", w.gyroscope_error, "with a truth", "rad/s");
  known("nees", w.nees, "with a truth: of velocity and gravity, 5 expected");
}

/// The best known of a window: refined, else of the closed form's first solution.
template <class V>
void describeSeries(V& v, const ComparedWindow& w) {
  const ClosedFormResult& c = w.closedForm();
  const bool refined = w.isRefined(), any = w.hasSolution();
  const auto where = [&](const Eigen::Vector3d& value) { return refined || any ? std::optional(value) : std::nullopt; };
  v("reason", w.fault ? describe(w.fault) : std::string(describe(w.verdict())), "the status in words");
  v("velocity", where(w.best().velocity), "at the first image, the best known", "m/s");
  v("gravity", where(w.best().gravity), "likewise", "m/s²");
  const ImuBias<double> bias = w.bias();
  v("best_gyroscope_bias", bias.gyroscope, "", "rad/s")("accelerometer_bias", bias.accelerometer, "", "m/s²");
  using Joint = Eigen::Matrix<double, 27, 27>;
  v("joint_covariance", refined ? std::optional<Joint>(w.refined->covariance.joint) : std::nullopt,
    "its blocks by `block`; None where the window was not refined");
  v("scale_sigma", w.scaleSigma(), "relative")("tilt_sigma", w.tiltSigma(), "", "rad");
  v("chi2", refined ? w.refined->cost : any ? c.solutions[0].cost : std::numeric_limits<double>::quiet_NaN());
  std::vector<std::uint64_t> inliers;
  for (const std::size_t i : w.found.inliers) inliers.push_back(w.track_names[i]);
  v("image_indices", w.images)("track_names", w.track_names)("inliers", inliers);
}

template <class V>
void describe(V& v, const ComparedStretch& f) {
  v("begin", f.begin, "", "s")("end", f.end, "", "s")("windows", f.windows.size(), "their number");
  v("chi2", f.chi2, "of their disagreement")("degrees_of_freedom", f.degrees_of_freedom, "of chi2");
  v("p", f.p, "probability of a larger chi2");
  v("ok", f.ok(), "windows met, and p is 0.001 or more, or the covariance was inflated");
  v("status", f.word(), "ok, inconsistent, untested (a single window: nothing could contradict it) or no_state");
  v("inflation", f.inflation, "factor by which the covariances are too small");
  v("inflated", f.inflated, "the covariance was multiplied by it");
  if (!shown(v, f.has_state)) return;
  v("gravity_direction", f.down, "unit vector, downwards")("velocity", f.velocity, "", "m/s")(
      "gyroscope_bias", f.gyroscope_bias, "", "rad/s");
  v("accelerometer_bias", f.accelerometer_bias, "", "m/s²")("covariance", f.state.covariance);
  v("covariance_order", "gravity_direction(2) velocity gyroscope_bias resting_force", "in words");
  v("covariance_frame", "axes of the body at the end; the direction's in the frame of its placement", "in words");
  v("speed_error", f.speed_error, "null without a truth", "m/s")("gravity_error", f.gravity_error, "likewise", "rad");
  v("gyroscope_bias_error", f.gyroscope_error, "likewise", "rad/s");
  v("accelerometer_bias_error", f.accelerometer_error, "likewise", "m/s²")("nees", f.nees, "11 expected");
}

template <class V>
void describe(V& v, const InitialisationErrors& e) {
  v("windows", e.size(), "that were compared")("speed_median", quantile(e.speed, 0.5), "", "m/s");
  v("speed_95", quantile(e.speed, 0.95), "95 % quantile", "m/s");
  v("gravity_deg_median", quantile(e.gravity, 0.5), "", "deg")("gravity_deg_95", quantile(e.gravity, 0.95), "", "deg");
  v("scale_percent_median", quantile(e.scale, 0.5), "", "%")("scale_percent_95", quantile(e.scale, 0.95), "", "%");
}

template <class V>
void describe(V& v, const ComparedRecording& r) {
  const Verdict verdict = r.verdict();
  v("ok", verdict.isYes(), "the result is to be trusted")("in_words", verdict.text, "the verdict");
  v("causes", verdict.causes, "with a truth: tests that speak against it, each with its likely cause");
  v("notes", r.notes(), "on what the covariances rest on: unverified_noise");
  v("noise_calibration", r.noise_calibration,
    "what the windows say of the densities; null: not asked for, or could "
    "not be");
  v("images_outside", r.images_outside, "that the readings do not cover");
  v("bearing_noise", r.bearing_noise, "standard deviation of the bearings", "rad");
  if (shown(v, r.windows_left > 0)) {
    v("interrupted", true, "only then")("windows_left", r.windows_left, "not estimated, because of an interrupt");
  }
  v("gravity", r.gravity, "that was given; null: it was free", "m/s²");
  const InitialisationSummary summary = r.summary();
  v("statuses", detail::StatusCounts{summary.statuses}, "number of windows of each status");
  if (shown(v, summary.closed_form.size() > 0)) v("closed_form_errors", summary.closed_form, "with a truth");
  if (shown(v, summary.refined.size() > 0)) v("refined_errors", summary.refined, "with a truth");
  if (shown(v, !summary.gyroscope.empty())) {
    v("gyroscope_bias_error_median", quantile(summary.gyroscope, 0.5), "with a truth", "rad/s");
    v("gyroscope_bias_error_95", quantile(summary.gyroscope, 0.95), "with a truth: 95 % quantile", "rad/s");
  }
  if (shown(v, summary.with_nees > 0)) {
    v("nees_mean", summary.nees / static_cast<double>(summary.with_nees), "with a truth: 5 expected");
  }
  if (shown(v, summary.degrees_of_freedom > 0)) {
    v("refined_chi2_per_degree", summary.cost / static_cast<double>(summary.degrees_of_freedom), "1 expected");
  }
  v("filter_start", r.filter_start, "state and covariance from which a filter starts");
  v("frame", "axes of the body at the first image of each window; gravity points down", "in words");
  v("windows", r.windows)("fusions", r.stretches, "of disjoint windows, for each stretch");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/initialisation_summary.hpp>
#endif
