#include <cli/show/preintegration.hpp>

#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <stats/quantile.hpp>

#include <fmt/format.h>

namespace liestat::cli {

namespace {

/// Where the readings of windows without a result fail.
std::string faultLines(const std::vector<RecordingWindow>& windows) {
  std::string text;
  for (const RecordingWindow& w : windows) {
    if (w.ok() || !w.fault_time) continue;
    text += fmt::format("window from {:.3f} s: {} ", w.begin, w.status());
    text += w.result.fault == FaultKind::gap && w.time_before_fault
                ? fmt::format("in the readings from {:.6f} to {:.6f} s\n", *w.time_before_fault, *w.fault_time)
                : fmt::format("at the reading of {:.6f} s\n", *w.fault_time);
  }
  return text.empty() ? text : "\n" + text;
}

std::string errorSummary(const RecordingWindows& result) {
  std::vector<double> rotation, velocity, position;
  for (const RecordingWindow& w : result.windows) {
    if (!w.error) continue;
    rotation.push_back(w.error->segment<3>(3).norm());
    velocity.push_back(w.error->tail<3>().norm());
    position.push_back(w.error->head<3>().norm());
  }
  if (rotation.empty()) return {};
  std::string text =
      fmt::format("\nagainst the truth, {} windows: medians {:.3g} rad, {:.3g} m/s, {:.3g} m\n", rotation.size(),
                  quantile(rotation, 0.5), quantile(velocity, 0.5), quantile(position, 0.5));
  if (const auto test = result.test()) {
    text += fmt::format("squared distance under the covariance: {:.4g} in the mean, 9 expected\n", 9 * test->ratio());
  }
  return text;
}

}  // namespace

TableRows preintegrationTable(const RecordingWindows& result) {
  TableRows table{{"begin s", "duration", "turn deg", "velocity m/s", "position m"}};
  std::vector<std::string>& headers = table.headers;
  if (result.with_noise) headers.insert(headers.end(), {"sd turn deg", "sd velocity", "sd position"});
  if (result.with_truth) headers.insert(headers.end(), {"error deg", "error m/s", "error m"});
  for (const RecordingWindow& w : result.windows) {
    const SE23d& x = w.result.motion.increment();
    if (!w.ok()) {
      table.rows.push_back({number(w.begin, 9), w.status()});
      continue;
    }
    std::vector<std::string> cells = {number(w.begin, 9), number(w.result.motion.duration()),
                                      number(degrees * x.so3().log().norm()), number(x.velocity().norm()),
                                      number(x.translation().norm())};
    if (result.with_noise) {
      const IncrementSigmas sd = incrementSigmas(w.result.motion);
      for (const double value : {degrees * sd.rotation, sd.velocity, sd.position}) cells.push_back(number(value, 3));
    }
    if (result.with_truth && w.error) {
      for (const double e :
           {degrees * w.error->segment<3>(3).norm(), w.error->tail<3>().norm(), w.error->head<3>().norm()})
        cells.push_back(number(e, 3));
    }
    table.rows.push_back(cells);
  }
  return table;
}

std::string preintegrationRemarks(const RecordingWindows& result) {
  return faultLines(result.windows) + errorSummary(result);
}

std::string formatPreintegration(const RecordingWindows& result) {
  std::string text = Table(preintegrationTable(result)).str() + preintegrationRemarks(result);
  if (!result.with_truth) return text;
  const Verdict verdict = result.verdict();
  for (const std::string& cause : verdict.causes) text += cause + "\n";
  return text + verdict.text + "\n";
}

}  // namespace liestat::cli
