// The result of visual-inertial initialisation as programs show it: windows and stretches with their errors against a
// truth (fusion/visual_inertial_truth.hpp), the verdict, and the description of all of it.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/visual_inertial_types.hpp>
#include <stats/quantile.hpp>
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
  std::optional<double> gyroscope_error;  ///< rad/s, of the best known bias
  std::optional<double> nees;             ///< the refined V and G's, 5 degrees of freedom
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

/// A recording's windows and stretches.
struct ComparedRecording {
  std::vector<ComparedWindow> windows;
  std::vector<ComparedStretch> stretches;
  std::optional<double> gravity;   ///< |G| that was given, m/s²
  double bearing_noise = 0;        ///< rad
  std::size_t images_outside = 0;  ///< that the readings do not cover
  std::size_t windows_left = 0;    ///< not estimated, because of an interrupt

  std::size_t okWindows() const;
  /// Verdict on the result: trusted if nothing was interrupted, a window is ok, and, where windows were fused, those
  /// of a stretch agree.
  Verdict verdict() const;
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
  v("track", x.track)("observations", x.feature.observations)("used", x.feature.used)("residual", x.feature.residual);
  v("parallax", x.feature.parallax)("depth_deviation", x.feature.depth_sigma);
}

/// A refinement with the times of its states.
struct TimedRefinement {
  RefinementResult result;
  std::vector<double> times;
};
template <class V>
void describe(V& v, const TimedRefinement& x) {
  const RefinementResult& r = x.result;
  v("status", r.converged() ? "refined" : liestat::describe(r.status))("consistent", r.consistent())("cost", r.cost);
  v("degrees_of_freedom", r.degrees_of_freedom)("features_used", r.features_used);
  if (!r.converged()) return;
  v("scale_sigma", r.scale_sigma)("tilt_sigma", r.tilt_sigma, "", "rad")("prior_p", r.prior_p);
  v("velocity", r.velocity(), "", "m/s")("gravity", r.gravity, "", "m/s²");
  v("gyroscope_bias", r.bias.gyroscope)("accelerometer_bias", r.bias.accelerometer);
  v("last_gyroscope_bias", r.last_bias.gyroscope)("last_accelerometer_bias", r.last_bias.accelerometer);
  v("covariance", r.covariance.atFirst());
  v("covariance_order", "velocity gravity gyroscope_bias accelerometer_bias");
  v("covariance_frame", "axes of the body at the first image, m/s m/s^2 rad/s m/s^2");
  v("covariance_content", "image noise, inertial noise and the priors of the biases");
  v("last_covariance", r.covariance.atLast());
  v("last_covariance_order", "position rotation velocity gravity gyroscope_bias accelerometer_bias");
  v("last_covariance_side", "right: of the last state in its own axes; gravity in those of the first image");
  std::vector<TimedState> states;
  for (std::size_t j = 0; j < r.states.size() && j < x.times.size(); ++j) states.push_back({x.times[j], r.states[j]});
  v("states", states)("features", rowsOfPoints(r.features));
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
  v("accelerometer_bias_change", s.accelerometer_bias)("roll", s.roll())("pitch", s.pitch());
  v("cost", s.cost)("negative_depths", s.negative_depths)("features", detail::rowsOfPoints(s.features));
}

template <class V>
void describe(V& v, const SecondMotion& second) {
  v("tracks", second.inliers.size());
  if (second.result.solutions.empty()) return;
  v("velocity", second.result.solutions[0].velocity)("gravity", second.result.solutions[0].gravity);
  if (second.result.covariance.size() > 0) v("covariance", Eigen::MatrixXd(second.result.covariance));
}

template <class V>
void describe(V& v, const InitialisationError& e) {
  v("speed", e.speed, "", "m/s")("gravity", e.gravity, "of its direction", "rad")("scale", e.scale, "relative");
}

/// Fields of a window; those of its steps only where the readings had no fault.
template <class V>
void describe(V& v, const ComparedWindow& w) {
  v("begin", w.begin, "", "s")("end", w.end, "", "s")("status", name(w.verdict()))("ok", w.ok());
  v("images", w.images.size())("tracks", w.tracks.size());
  if (w.fault) {
    v("fault_time", w.fault_time, "", "s");
    return;
  }
  const ClosedFormResult& c = w.closedForm();
  v("closed_form_status", name(c.status))("in_words", describe(c.status))("consistent", c.consistent);
  v("null_dimension", c.null_dimension)("singular_values", c.singular_values);
  v("largest_singular_value", c.largest_singular_value)("solutions", c.solutions);
  std::vector<detail::TrackedFeature> features;
  for (std::size_t i = 0; i < c.features.size(); ++i) features.push_back({w.track_names[i], c.features[i]});
  v("features", features)("features_used", c.features_used)("features_rejected", w.found.outliers.size());
  v("images_used", c.images_used)("hypotheses", w.found.hypotheses)("degrees_of_freedom", c.degrees_of_freedom);
  v("covariance", c.covariance.size() > 0 ? std::optional(Eigen::MatrixXd(c.covariance)) : std::nullopt);
  v("covariance_content", describe(c.covariance_content));
  v("covariance_order", c.covariance.rows() == 9 ? "velocity gravity accelerometer_bias" : "velocity gravity");
  v("scale_deviation", c.scale_sigma)("tilt_deviation", c.tilt_sigma);
  v("unseen_speed_per_depth", c.unseen_speed_per_depth)("second_motion", w.found.second);
  v("integrated_gyroscope_bias", w.measured.bias().gyroscope);
  v("integrated_accelerometer_bias", w.measured.bias().accelerometer)("gyroscope_bias", w.found.gyroscope_bias);
  v("gyroscope_bias_status",
    w.found.bias_status == FusionStatus::ok ? "the gyroscope's bias was found" : describe(w.found.bias_status));
  v("refined", w.refined ? std::optional(detail::TimedRefinement{*w.refined, w.image_times}) : std::nullopt);
  if (w.closed_form_error) v("closed_form_error", *w.closed_form_error);
  if (w.refined_error) v("refined_error", *w.refined_error);
  if (w.gyroscope_error) v("gyroscope_bias_error", *w.gyroscope_error, "", "rad/s");
  if (w.nees) v("nees", *w.nees, "of velocity and gravity, 5 expected");
}

/// The best known of a window: refined, else of the closed form's first solution.
template <class V>
void describeSeries(V& v, const ComparedWindow& w) {
  const ClosedFormResult& c = w.closedForm();
  const bool refined = w.isRefined(), any = !c.solutions.empty();
  const auto of = [&](const Eigen::Vector3d& fine, const auto& coarse) {
    return refined ? std::optional(fine) : any ? std::optional<Eigen::Vector3d>(coarse()) : std::nullopt;
  };
  v("reason", w.fault ? describe(w.fault) : std::string(describe(w.verdict())));
  v("velocity", of(refined ? w.refined->velocity() : Eigen::Vector3d::Zero(), [&] { return c.solutions[0].velocity; }));
  v("gravity", of(refined ? w.refined->gravity : Eigen::Vector3d::Zero(), [&] { return c.solutions[0].gravity; }));
  const ImuBias<double> bias = w.bias();
  v("best_gyroscope_bias", bias.gyroscope, "", "rad/s")("accelerometer_bias", bias.accelerometer, "", "m/s²");
  using Joint = Eigen::Matrix<double, 27, 27>;
  v("joint_covariance", refined ? std::optional<Joint>(w.refined->covariance.joint) : std::nullopt);
  v("scale_sigma", refined ? w.refined->scale_sigma : c.scale_sigma);
  v("tilt_sigma", refined ? w.refined->tilt_sigma : c.tilt_sigma, "", "rad");
  v("chi2", refined ? w.refined->cost : any ? c.solutions[0].cost : std::numeric_limits<double>::quiet_NaN());
  std::vector<std::uint64_t> inliers;
  for (const std::size_t i : w.found.inliers) inliers.push_back(w.track_names[i]);
  v("image_indices", w.images)("track_names", w.track_names)("inliers", inliers);
}

template <class V>
void describe(V& v, const ComparedStretch& f) {
  v("begin", f.begin, "", "s")("end", f.end, "", "s")("windows", f.windows.size())("chi2", f.chi2);
  v("degrees_of_freedom", f.degrees_of_freedom)("p", f.p)("ok", f.ok());
  v("inflation", f.inflation)("inflated", f.inflated);
  if (!f.has_state) return;
  v("gravity_direction", f.down)("velocity", f.velocity, "", "m/s")("gyroscope_bias", f.gyroscope_bias, "", "rad/s");
  v("accelerometer_bias", f.accelerometer_bias, "", "m/s²")("covariance", f.state.covariance);
  v("covariance_order", "gravity_direction(2) velocity gyroscope_bias resting_force");
  v("covariance_frame", "axes of the body at the end; the direction's in the frame of its placement");
  v("speed_error", f.speed_error, "", "m/s")("gravity_error", f.gravity_error, "", "rad");
  v("gyroscope_bias_error", f.gyroscope_error, "", "rad/s");
  v("accelerometer_bias_error", f.accelerometer_error, "", "m/s²")("nees", f.nees, "11 expected");
}

template <class V>
void describe(V& v, const InitialisationErrors& e) {
  v("windows", e.size())("speed_median", quantile(e.speed, 0.5), "", "m/s")("speed_95", quantile(e.speed, 0.95));
  v("gravity_deg_median", quantile(e.gravity, 0.5))("gravity_deg_95", quantile(e.gravity, 0.95));
  v("scale_percent_median", quantile(e.scale, 0.5))("scale_percent_95", quantile(e.scale, 0.95));
}

template <class V>
void describe(V& v, const ComparedRecording& r) {
  const Verdict verdict = r.verdict();
  v("ok", verdict.isYes())("in_words", verdict.text)("images_outside", r.images_outside);
  v("bearing_noise", r.bearing_noise, "", "rad");
  if (r.windows_left > 0) v("interrupted", true)("windows_left", r.windows_left);
  v("gravity", r.gravity, "that was given", "m/s²");
  const InitialisationSummary summary = r.summary();
  v("statuses", detail::StatusCounts{summary.statuses});
  if (summary.closed_form.size() > 0) v("closed_form_errors", summary.closed_form);
  if (summary.refined.size() > 0) v("refined_errors", summary.refined);
  if (!summary.gyroscope.empty()) {
    v("gyroscope_bias_error_median", quantile(summary.gyroscope, 0.5), "", "rad/s");
    v("gyroscope_bias_error_95", quantile(summary.gyroscope, 0.95), "", "rad/s");
  }
  if (summary.with_nees > 0) v("nees_mean", summary.nees / static_cast<double>(summary.with_nees), "5 expected");
  if (summary.degrees_of_freedom > 0) {
    v("refined_chi2_per_degree", summary.cost / static_cast<double>(summary.degrees_of_freedom));
  }
  v("frame", "axes of the body at the first image of each window; gravity points down");
  v("windows", r.windows)("fusions", r.stretches);
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/detail/initialisation_summary.hpp>
#endif
