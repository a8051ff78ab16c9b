#include <cli/show/vi_init.hpp>
#include <cli/show/vi_init_summary.hpp>

#include <string>
#include <vector>

namespace liestat::cli {
namespace {

/// Points as rows.
Eigen::MatrixXd rowsOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  return rows;
}

JsonObject toJson(const ClosedFormSolution& s) {
  JsonObject o;
  o.set("velocity", s.velocity).set("gravity", s.gravity).set("accelerometer_bias_change", s.accelerometer_bias);
  o.set("roll", s.roll()).set("pitch", s.pitch()).set("cost", s.cost).set("negative_depths", s.negative_depths);
  return o.set("features", rowsOf(s.features));
}

JsonObject toJson(const RefinementResult& r, const ViWindow& w, const std::vector<double>& times) {
  JsonObject o;
  o.set("status", r.converged() ? "refined" : describe(r.status)).set("consistent", r.consistent()).set("cost", r.cost);
  o.set("degrees_of_freedom", r.degrees_of_freedom).set("features_used", r.features_used);
  if (!r.converged()) return o;
  o.set("scale_sigma", r.scale_sigma).set("tilt_sigma", r.tilt_sigma).set("prior_p", r.prior_p);
  o.set("velocity", r.velocity()).set("gravity", r.gravity);
  o.set("gyroscope_bias", r.bias.gyroscope).set("accelerometer_bias", r.bias.accelerometer);
  o.set("last_gyroscope_bias", r.last_bias.gyroscope).set("last_accelerometer_bias", r.last_bias.accelerometer);
  o.set("covariance", r.covariance.atFirst());
  o.set("covariance_order", "velocity gravity gyroscope_bias accelerometer_bias");
  o.set("covariance_frame", "axes of the body at the first image, m/s m/s^2 rad/s m/s^2");
  o.set("covariance_content", "image noise, inertial noise and the priors of the biases");
  o.set("last_covariance", r.covariance.atLast());
  o.set("last_covariance_order", "position rotation velocity gravity gyroscope_bias accelerometer_bias");
  o.set("last_covariance_side", "right: of the last state in its own axes; gravity in those of the first image");
  std::vector<JsonObject> states;
  for (std::size_t j = 0; j < r.states.size(); ++j) {
    JsonObject state;
    state.set("t", times[w.images[j]]).set("quaternion_xyzw", Eigen::Vector4d(r.states[j].so3().params()));
    state.set("position", Eigen::Vector3d(r.states[j].translation()));
    state.set("velocity", Eigen::Vector3d(r.states[j].velocity()));
    states.push_back(state);
  }
  return o.set("states", states).set("features", rowsOf(r.features));
}

JsonObject toJson(const ViError& e) {
  JsonObject o;
  return o.set("speed", e.speed).set("gravity", e.gravity).set("scale", e.scale);
}

JsonObject toJson(const ViWindow& w, const ViRecording& recording, const std::vector<double>& times) {
  JsonObject o;
  o.set("begin", w.begin).set("end", w.end).set("status", std::string(name(w.verdict()))).set("ok", w.ok());
  o.set("images", w.images.size()).set("tracks", w.tracks.size());
  if (w.fault) return o.set("fault_time", w.fault_time);
  const ClosedFormResult& c = w.closedForm();
  o.set("closed_form_status", name(c.status)).set("in_words", describe(c.status)).set("consistent", c.consistent);
  o.set("null_dimension", c.null_dimension).set("singular_values", c.singular_values);
  o.set("largest_singular_value", c.largest_singular_value);
  std::vector<JsonObject> solutions;
  for (const ClosedFormSolution& s : c.solutions) solutions.push_back(toJson(s));
  o.set("solutions", solutions);
  std::vector<JsonObject> features;
  for (std::size_t i = 0; i < c.features.size(); ++i) {
    const ClosedFormFeature& f = c.features[i];
    JsonObject feature;
    feature.set("track", recording.tracks.track_ids[w.tracks[i]]).set("observations", f.observations);
    feature.set("used", f.used).set("residual", f.residual).set("parallax", f.parallax);
    feature.set("depth_deviation", f.depth_sigma);
    features.push_back(feature);
  }
  o.set("features", features).set("features_used", c.features_used);
  o.set("features_rejected", w.found.outliers.size()).set("images_used", c.images_used);
  o.set("hypotheses", w.found.hypotheses).set("degrees_of_freedom", c.degrees_of_freedom);
  if (c.covariance.size() > 0) {
    o.set("covariance", Eigen::MatrixXd(c.covariance));
  } else {
    o.set("covariance", nullptr);
  }
  o.set("covariance_content", describe(c.covariance_content));
  o.set("covariance_order", c.covariance.rows() == 9 ? "velocity gravity accelerometer_bias" : "velocity gravity");
  o.set("scale_deviation", c.scale_sigma).set("tilt_deviation", c.tilt_sigma);
  o.set("unseen_speed_per_depth", c.unseen_speed_per_depth);
  if (const auto& second = w.found.second) {
    JsonObject motion;
    motion.set("tracks", second->inliers.size()).set("velocity", second->result.solutions[0].velocity);
    motion.set("gravity", second->result.solutions[0].gravity);
    if (second->result.covariance.size() > 0) motion.set("covariance", Eigen::MatrixXd(second->result.covariance));
    o.set("second_motion", motion);
  } else {
    o.set("second_motion", nullptr);
  }
  o.set("integrated_gyroscope_bias", w.measured.bias().gyroscope);
  o.set("integrated_accelerometer_bias", w.measured.bias().accelerometer);
  o.set("gyroscope_bias", w.found.gyroscope_bias)
      .set("gyroscope_bias_status",
           w.found.bias_status == FusionStatus::ok ? "the gyroscope's bias was found" : describe(w.found.bias_status));
  if (w.refined) {
    o.set("refined", toJson(*w.refined, w, times));
  } else {
    o.set("refined", nullptr);
  }
  if (w.closed_form_error) o.set("closed_form_error", toJson(*w.closed_form_error));
  if (w.refined_error) o.set("refined_error", toJson(*w.refined_error));
  if (w.gyroscope_error) o.set("gyroscope_bias_error", *w.gyroscope_error);
  if (w.nees) o.set("nees", *w.nees);
  return o;
}

JsonObject toJson(const NoiseFactor& factor) {
  JsonObject o;
  return o.set("factor", factor.factor).set("low", factor.low).set("high", factor.high);
}

JsonObject toJson(const NoiseCalibration& found) {
  JsonObject o;
  o.set("status", name(found.status)).set("windows", found.windows).set("meetings", found.meetings);
  o.set("chi2", found.chi2).set("calibrated_chi2", found.calibrated_chi2);
  o.set("degrees_of_freedom", found.degrees_of_freedom).set("common", toJson(found.common));
  o.set("common_p", found.common_p).set("separable", found.separable);
  o.set("gyroscope", toJson(found.gyroscope)).set("accelerometer", toJson(found.accelerometer));
  JsonObject noise;
  noise.set("gyroscope", found.noise.gyroscope).set("accelerometer", found.noise.accelerometer);
  noise.set("gyroscope_walk", found.noise.gyroscope_walk).set("accelerometer_walk", found.noise.accelerometer_walk);
  return o.set("noise", noise);
}

JsonObject toJson(const ViFusion& f) {
  JsonObject o;
  o.set("begin", f.begin).set("end", f.end).set("windows", f.windows.size()).set("chi2", f.chi2);
  o.set("degrees_of_freedom", f.degrees_of_freedom).set("p", f.p).set("ok", f.ok());
  o.set("inflation", f.inflation).set("inflated", f.inflated);
  if (!f.has_state) return o;
  o.set("gravity_direction", f.down).set("velocity", f.velocity).set("gyroscope_bias", f.gyroscope_bias);
  o.set("accelerometer_bias", f.accelerometer_bias).set("covariance", f.state.covariance);
  o.set("covariance_order", "gravity_direction(2) velocity gyroscope_bias resting_force");
  o.set("covariance_frame", "axes of the body at the end; the direction's in the frame of its placement");
  o.set("speed_error", f.speed_error).set("gravity_error", f.gravity_error);
  o.set("gyroscope_bias_error", f.gyroscope_error).set("accelerometer_bias_error", f.accelerometer_error);
  return o.set("nees", f.nees);
}

}  // namespace

void setViInit(JsonObject& object, const ViRecording& recording, const ViInitResult& result) {
  object.set("readings", recording.imu.samples.size()).set("start_ns", recording.imu.start_ns);
  object.set("images", recording.tracks.times.size()).set("tracks", recording.tracks.track_ids.size());
  object.set("camera_pose_assumed", recording.pose_assumed);
  object.set("tracks_seen_once", recording.tracks.seen_once).set("images_outside", result.images_outside);
  object.set("observations_outside", result.observations_outside).set("bearing_noise", result.bearing_noise);
  if (result.windows_left > 0) object.set("interrupted", true).set("windows_left", result.windows_left);
  object.set("gravity", result.gravity);
  object.set("noise_calibration", result.noise ? std::optional(toJson(*result.noise)) : std::nullopt);
  const ViInitSummary summary(result);
  JsonObject statuses;
  for (const auto& [status, count] : summary.statuses) statuses.set(status, count);
  object.set("statuses", statuses);
  if (summary.closed_form.size() > 0) object.set("closed_form_errors", summary.closed_form.json());
  if (summary.refined.size() > 0) object.set("refined_errors", summary.refined.json());
  if (!summary.gyroscope.empty()) {
    object.set("gyroscope_bias_error_median", experiments::quantile(summary.gyroscope, 0.5));
    object.set("gyroscope_bias_error_95", experiments::quantile(summary.gyroscope, 0.95));
  }
  if (summary.with_nees > 0) object.set("nees_mean", summary.nees / static_cast<double>(summary.with_nees));
  if (summary.degrees_of_freedom > 0) {
    object.set("refined_chi2_per_degree", summary.cost / static_cast<double>(summary.degrees_of_freedom));
  }
  std::vector<double> times;
  for (const double t : recording.tracks.times) times.push_back(t + recording.camera.timeshift_cam_imu);
  std::vector<JsonObject> windows, fusions;
  for (const ViWindow& w : result.windows) windows.push_back(toJson(w, recording, times));
  for (const ViFusion& f : result.fusions) fusions.push_back(toJson(f));
  object.set("frame", "axes of the body at the first image of each window; gravity points down");
  object.set("windows", windows).set("fusions", fusions);
}

}  // namespace liestat::cli
