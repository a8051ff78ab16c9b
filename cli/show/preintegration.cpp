#include <cli/show/preintegration.hpp>

#include <cli/show/table.hpp>
#include <cli/show/units.hpp>
#include <experiments/summary.hpp>

#include <fmt/format.h>

namespace liestat::cli {

std::string statusOf(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::none:
      return "ok";
    case FaultKind::bad_interval:
      return "bad interval";
    case FaultKind::not_covered:
      return "not covered";
    case FaultKind::not_ascending:
      return "times not ascending";
    case FaultKind::not_finite:
      return "not finite";
    case FaultKind::gap:
      return "gap";
    default:
      break;
  }
  return "unknown";
}

IncrementDeviations deviationsOf(const Preintegration<double>& motion) {
  const Eigen::Matrix<double, 9, 1> sd = motion.gaussian().covariance.diagonal().cwiseSqrt();
  return {motion.duration(), sd.segment<3>(3).maxCoeff(), sd.tail<3>().maxCoeff(), sd.head<3>().maxCoeff()};
}

namespace {

using experiments::quantile;

JsonObject toJson(const PreintegratedWindow& w, bool with_noise) {
  JsonObject o;
  o.set("begin", w.begin).set("status", statusOf(w.result.fault)).set("duration", w.result.motion.duration());
  o.set("largest_gap", w.result.max_gap);
  if (!w.result.ok()) {
    if (w.fault_end) o.set("fault_time", *w.fault_end);
    return o;
  }
  const SE23d& x = w.result.motion.increment();
  o.set("quaternion_xyzw", Eigen::Vector4d(x.so3().params())).set("rotation_vector", Eigen::Vector3d(x.so3().log()));
  o.set("position", Eigen::Vector3d(x.translation())).set("velocity", Eigen::Vector3d(x.velocity()));
  if (with_noise) {
    o.set("covariance", w.result.motion.gaussian().covariance);
  } else {
    o.set("covariance", nullptr);
  }
  o.set("bias_jacobian", w.result.motion.biasJacobian());
  if (w.error) {
    o.set("error", *w.error);
    if (with_noise) o.set("squared_distance", w.squared_distance);
  }
  return o;
}

/// Where the readings of windows without a result fail.
std::string faultLines(const std::vector<PreintegratedWindow>& windows) {
  std::string text;
  for (const PreintegratedWindow& w : windows) {
    if (w.result.ok() || !w.fault_end) continue;
    text += fmt::format("window from {:.3f} s: {} ", w.begin, statusOf(w.result.fault));
    text += w.result.fault == FaultKind::gap && w.fault_begin
                ? fmt::format("in the readings from {:.6f} to {:.6f} s\n", *w.fault_begin, *w.fault_end)
                : fmt::format("at the reading of {:.6f} s\n", *w.fault_end);
  }
  return text.empty() ? text : "\n" + text;
}

std::string errorSummary(const std::vector<PreintegratedWindow>& windows, bool with_noise) {
  std::vector<double> rotation, velocity, position;
  double index = 0;
  for (const PreintegratedWindow& w : windows) {
    if (!w.error) continue;
    rotation.push_back(w.error->segment<3>(3).norm());
    velocity.push_back(w.error->tail<3>().norm());
    position.push_back(w.error->head<3>().norm());
    index += w.squared_distance;
  }
  if (rotation.empty()) return {};
  std::string text =
      fmt::format("\nagainst the truth, {} windows: medians {:.3g} rad, {:.3g} m/s, {:.3g} m\n", rotation.size(),
                  quantile(rotation, 0.5), quantile(velocity, 0.5), quantile(position, 0.5));
  if (!with_noise) return text;
  const double mean = index / static_cast<double>(rotation.size());
  return text + fmt::format("squared distance under the covariance: {:.4g} in the mean, 9 expected\n", mean);
}

}  // namespace

std::vector<std::string> preintegrationHeaders(const PreintegrationResult& result) {
  std::vector<std::string> headers = {"begin s", "duration", "turn deg", "velocity m/s", "position m"};
  if (result.with_noise) headers.insert(headers.end(), {"sd turn deg", "sd velocity", "sd position"});
  if (result.with_truth) headers.insert(headers.end(), {"error deg", "error m/s", "error m"});
  return headers;
}

std::vector<std::vector<std::string>> preintegrationRows(const PreintegrationResult& result) {
  std::vector<std::vector<std::string>> rows;
  for (const PreintegratedWindow& w : result.windows) {
    const SE23d& x = w.result.motion.increment();
    if (!w.result.ok()) {
      rows.push_back({number(w.begin, 9), statusOf(w.result.fault)});
      continue;
    }
    std::vector<std::string> cells = {number(w.begin, 9), number(w.result.motion.duration()),
                                      number(degrees * x.so3().log().norm()), number(x.velocity().norm()),
                                      number(x.translation().norm())};
    if (result.with_noise) {
      const IncrementDeviations sd = deviationsOf(w.result.motion);
      for (const double value : {degrees * sd.rotation, sd.velocity, sd.position}) cells.push_back(number(value, 3));
    }
    if (result.with_truth && w.error) {
      for (const double e :
           {degrees * w.error->segment<3>(3).norm(), w.error->tail<3>().norm(), w.error->head<3>().norm()})
        cells.push_back(number(e, 3));
    }
    rows.push_back(cells);
  }
  return rows;
}

std::string preintegrationRemarks(const PreintegrationResult& result) {
  return faultLines(result.windows) + errorSummary(result.windows, result.with_noise);
}

std::string formatPreintegration(const PreintegrationResult& result) {
  Table table(preintegrationHeaders(result));
  for (const std::vector<std::string>& cells : preintegrationRows(result)) table.row(cells);
  return table.str() + preintegrationRemarks(result);
}

void setPreintegration(JsonObject& object, const PreintegrationResult& result) {
  object.set("covariance_order", "position rotation velocity").set("covariance_side", "right");
  object.set("covariance_frame", "axes of the body at the end of the window, m rad m/s");
  std::vector<JsonObject> list;
  for (const PreintegratedWindow& w : result.windows) list.push_back(toJson(w, result.with_noise));
  object.set("windows", list);
}

}  // namespace liestat::cli
