#include <cli/show/units.hpp>
#include <cli/show/vi_init.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include <experiments/summary.hpp>
#include <cli/show/table.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// What a line says of a window, refined or not.
struct Best {
  Eigen::Vector3d velocity, gravity;

  explicit Best(const ViWindow& w) {
    if (w.refined && w.refined->status == FusionStatus::ok) {
      velocity = w.refined->velocity();
      gravity = w.refined->gravity;
    } else {
      velocity = w.closedForm().solutions[0].velocity;
      gravity = w.closedForm().solutions[0].gravity;
    }
  }
  double roll() const { return std::atan2(-gravity.y(), -gravity.z()); }
  double pitch() const { return std::atan2(gravity.x(), std::hypot(gravity.y(), gravity.z())); }
};

bool hasSolution(const ViWindow& w) { return !w.closedForm().solutions.empty(); }

/// Standard deviation of the length of V over that length: of the scale.
double scaleDeviation(const ViWindow& w) {
  if (!w.refined || w.refined->status != FusionStatus::ok) return w.closedForm().scale_sigma;
  const Eigen::Vector3d u = w.refined->velocity().normalized();
  return std::sqrt(u.dot(w.refined->covariance.of<InitialCovariance::first_velocity>() * u)) /
         w.refined->velocity().norm();
}

double costPerDegree(const ViWindow& w) {
  if (w.refined && w.refined->degrees_of_freedom > 0) {
    return w.refined->cost / static_cast<double>(w.refined->degrees_of_freedom);
  }
  const ClosedFormResult& closed = w.closedForm();
  return closed.degrees_of_freedom > 0 ? closed.solutions[0].cost / static_cast<double>(closed.degrees_of_freedom)
                                       : not_a_number;
}

std::optional<ViError> errorOf(const ViWindow& w) { return w.refined_error ? w.refined_error : w.closed_form_error; }

std::string windowTable(const ViInitResult& result, bool with_truth) {
  // With the errors it still fits into 80 columns.
  std::vector<std::string> headers = {"s", "status", "m/s", "roll", "pitch", "sd %", "chi2", "tracks"};
  if (with_truth) headers.insert(headers.end(), {"off m/s", "deg", "%"});
  Table table(headers);
  for (const ViWindow& w : result.windows) {
    std::vector<std::string> cells = {fmt::format("{:.1f}", w.begin), std::string(name(w.verdict()))};
    if (!w.fault && hasSolution(w)) {
      const Best best(w);
      const bool has_scale = w.closedForm().status != FusionStatus::scale_unobservable &&
                             w.closedForm().status != FusionStatus::stationary;
      cells.push_back(has_scale ? fmt::format("{:.2f}", best.velocity.norm()) : "");
      cells.push_back(fmt::format("{:.1f}", degrees * best.roll()));
      cells.push_back(fmt::format("{:.1f}", degrees * best.pitch()));
      cells.push_back(has_scale ? fmt::format("{:.1f}", 100 * scaleDeviation(w)) : "");
      cells.push_back(has_scale ? fmt::format("{:.2f}", costPerDegree(w)) : "");
      cells.push_back(fmt::format("{}/{}", w.found.inliers.size(), w.tracks.size()));
      if (const auto error = errorOf(w); error && has_scale) {
        cells.push_back(fmt::format("{:.3f}", error->speed));
        cells.push_back(fmt::format("{:.2f}", degrees * error->gravity));
        cells.push_back(fmt::format("{:.1f}", 100 * error->scale));
      }
    }
    table.row(cells);
  }
  return table.str();
}

std::string fusionTable(const ViInitResult& result, bool with_truth) {
  std::vector<std::string> headers = {"to s", "n", "chi2/dof", "p", "sd deg", "rad/s", "m/s2"};
  if (with_truth) headers.insert(headers.end(), {"off m/s", "deg", "rad/s", "m/s2"});
  Table table(headers);
  for (const ViFusion& f : result.fusions) {
    if (!f.has_state) continue;
    const std::size_t dof = f.degrees_of_freedom;
    std::vector<std::string> cells = {fmt::format("{:.1f}", f.end),
                                      fmt::format("{}", f.windows.size()),
                                      dof == 0 ? "" : fmt::format("{:.2f}", f.chi2 / static_cast<double>(dof)),
                                      dof == 0 ? "" : fmt::format("{:.1g}", f.p_value),
                                      fmt::format("{:.2f}", degrees * f.down_sigma),
                                      fmt::format("{:.4f}", f.gyroscope_sigma),
                                      fmt::format("{:.3f}", f.accelerometer_sigma)};
    if (f.speed_error) {
      cells.push_back(fmt::format("{:.3f}", *f.speed_error));
      cells.push_back(fmt::format("{:.2f}", degrees * *f.gravity_error));
      cells.push_back(fmt::format("{:.4f}", *f.gyroscope_error));
      cells.push_back(fmt::format("{:.3f}", *f.accelerometer_error));
    }
    table.row(cells);
  }
  return table.str();
}

/// Medians and 95 % of what is known of errors.
class ErrorSummary {
 public:
  void add(const ViError& e) {
    speed_.push_back(e.speed);
    gravity_.push_back(degrees * e.gravity);
    scale_.push_back(100 * std::abs(e.scale));
  }
  std::size_t size() const { return speed_.size(); }
  std::string str() const {
    return fmt::format("{:.3g} / {:.3g} m/s, {:.3g} / {:.3g} deg, scale {:.3g} / {:.3g} %", quantile(speed_, 0.5),
                       quantile(speed_, 0.95), quantile(gravity_, 0.5), quantile(gravity_, 0.95), quantile(scale_, 0.5),
                       quantile(scale_, 0.95));
  }
  JsonObject json() const {
    JsonObject o;
    o.set("windows", size());
    o.set("speed_median", quantile(speed_, 0.5)).set("speed_95", quantile(speed_, 0.95));
    o.set("gravity_deg_median", quantile(gravity_, 0.5)).set("gravity_deg_95", quantile(gravity_, 0.95));
    o.set("scale_percent_median", quantile(scale_, 0.5)).set("scale_percent_95", quantile(scale_, 0.95));
    return o;
  }

 private:
  std::vector<double> speed_, gravity_, scale_;
};

struct Summary {
  std::map<std::string, std::size_t> statuses;
  ErrorSummary closed_form, refined;
  std::vector<double> gyroscope;
  double nees = 0, cost = 0;
  std::size_t with_nees = 0, degrees_of_freedom = 0;

  explicit Summary(const ViInitResult& result) {
    for (const ViWindow& w : result.windows) {
      ++statuses[std::string(name(w.verdict()))];
      // Of all windows that claim a scale, not only of those that came out well.
      const FusionStatus status = w.closedForm().status;
      if (status == FusionStatus::scale_unobservable || status == FusionStatus::stationary) continue;
      if (w.closed_form_error) closed_form.add(*w.closed_form_error);
      if (w.refined_error) refined.add(*w.refined_error);
      if (w.refined_error && w.gyroscope_error) gyroscope.push_back(*w.gyroscope_error);
      if (w.nees) {
        nees += *w.nees;
        ++with_nees;
      }
      if (w.refined && w.refined->status == FusionStatus::ok) {
        cost += w.refined->cost;
        degrees_of_freedom += w.refined->degrees_of_freedom;
      }
    }
  }
};

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
  o.set("status", r.status == FusionStatus::ok ? "refined" : describe(r.status))
      .set("consistent", r.consistent())
      .set("cost", r.cost);
  o.set("degrees_of_freedom", r.degrees_of_freedom).set("features_used", r.features_used);
  if (r.status != FusionStatus::ok) return o;
  o.set("velocity", r.velocity()).set("gravity", r.gravity);
  o.set("gyroscope_bias", r.bias.gyroscope).set("accelerometer_bias", r.bias.accelerometer);
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

JsonObject toJson(const ViFusion& f) {
  JsonObject o;
  o.set("begin", f.begin).set("end", f.end).set("windows", f.windows.size()).set("chi2", f.chi2);
  o.set("degrees_of_freedom", f.degrees_of_freedom).set("p", f.p_value).set("ok", f.has_state);
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

std::string viInitTable(const ViRecording& recording, const ViInitResult& result) {
  const bool with_truth = !recording.truth.empty();
  std::string text = windowTable(result, with_truth);
  const Summary summary(result);
  text += fmt::format("\n{} windows:", result.windows.size());
  for (const auto& [status, count] : summary.statuses) text += fmt::format(" {} {}", count, status);
  text += "\n";
  if (with_truth) {
    const bool with_biases = result.biases_given;
    if (summary.closed_form.size() > 0) {
      text += "closed form, median / 95 %: " + summary.closed_form.str() + "\n";
    }
    if (summary.refined.size() > 0) text += "refined, median / 95 %:     " + summary.refined.str() + "\n";
    if (!with_biases && !summary.gyroscope.empty()) {
      text += fmt::format("gyroscope's bias, median / 95 %: {:.2g} / {:.2g} rad/s\n", quantile(summary.gyroscope, 0.5),
                          quantile(summary.gyroscope, 0.95));
    }
    if (summary.with_nees > 0) {
      text += fmt::format("NEES of velocity and gravity: {:.3g} in the mean, 5 expected\n",
                          summary.nees / static_cast<double>(summary.with_nees));
    }
  }
  if (summary.degrees_of_freedom > 0) {
    text += fmt::format("chi2 per degree of freedom of the refinements: {:.3f}\n",
                        summary.cost / static_cast<double>(summary.degrees_of_freedom));
  }
  if (!result.fusions.empty()) {
    text +=
        "\nDisjoint windows together, at the last image of each stretch; chi2 and its p say\nwhether they agree; then "
        "deviations of gravity and the biases";
    text += with_truth ? ", and what is off:\n" : ":\n";
    text += fusionTable(result, with_truth);
  }
  std::vector<std::string> notes;
  if (recording.tracks.seen_once > 0) {
    notes.push_back(fmt::format("{} tracks were seen once", recording.tracks.seen_once));
  }
  if (result.images_outside > 0) {
    notes.push_back(fmt::format("{} images are outside of the readings", result.images_outside));
  }
  if (result.observations_outside > 0) {
    notes.push_back(fmt::format("{} pixels have no direction by the lens' model", result.observations_outside));
  }
  for (const std::string& note : notes) text += "note: " + note + ", and not used\n";
  return text;
}

void setViInit(JsonObject& object, const ViRecording& recording, const ViInitResult& result) {
  object.set("readings", recording.imu.samples.size()).set("start_ns", recording.imu.start_ns);
  object.set("images", recording.tracks.times.size()).set("tracks", recording.tracks.track_ids.size());
  object.set("tracks_seen_once", recording.tracks.seen_once).set("images_outside", result.images_outside);
  object.set("observations_outside", result.observations_outside).set("bearing_noise", result.bearing_noise);
  object.set("gravity", result.gravity);
  const Summary summary(result);
  JsonObject statuses;
  for (const auto& [status, count] : summary.statuses) statuses.set(status, count);
  object.set("statuses", statuses);
  if (summary.closed_form.size() > 0) object.set("closed_form_errors", summary.closed_form.json());
  if (summary.refined.size() > 0) object.set("refined_errors", summary.refined.json());
  if (!summary.gyroscope.empty()) {
    object.set("gyroscope_bias_error_median", quantile(summary.gyroscope, 0.5));
    object.set("gyroscope_bias_error_95", quantile(summary.gyroscope, 0.95));
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
