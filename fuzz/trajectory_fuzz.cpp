// Any text as a trajectory or a graph, in any format: poses that keep their promises and go to every format, or an
// InputError of one line. Anything else is a finding.
//
//   build/sanitize/fuzz/trajectory_fuzz -max_total_time=120 new_corpus fuzz/corpus/trajectory

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include <fuzz/checks.hpp>
#include <formats/pose_graph.hpp>
#include <formats/trajectory.hpp>

namespace liestat {
namespace {

void check(const Trajectory& trajectory) {
  const std::size_t n = trajectory.size();
  require(n > 0 && trajectory.lines.size() == n);
  require(trajectory.times.size() == trajectory.time_texts.size());
  require(trajectory.times.empty() || trajectory.times.size() == n);
  require(trajectory.covariances.empty() || trajectory.covariances.size() == n);
  for (const auto& pose : trajectory.poses) {
    require(pose.translation().allFinite() && std::abs(pose.unit_quaternion().norm() - 1) < 1e-14);
  }
  for (const double time : trajectory.times) require(std::isfinite(time));
  require(trajectory.ids.empty() || trajectory.ids.size() == n);
  for (const auto& C : trajectory.covariances) {
    for (int i = 0; i < 6; ++i) require(std::isnan(C(i, i)) || C(i, i) >= 0);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::vector<std::string> formats = trajectoryFormatNames();
  for (const std::string& format : formats) {
    mayRefuse([&] {
      TrajectoryOptions options;
      options.format = format;
      const Trajectory trajectory = parseTrajectory(text, "fuzz", options);
      check(trajectory);
      for (const std::string& to : trajectoryFormatNames(false)) {
        if (to != "auto") mayRefuse([&] { (void)formatTrajectory(trajectory, to, {}); });
      }
      for (const DuplicateRule rule : {DuplicateRule::drop, DuplicateRule::mean}) {
        mayRefuse([&] {
          Trajectory ordered = trajectory;
          orderInTime(ordered, rule);
          check(ordered);
          for (std::size_t i = 1; i < ordered.times.size(); ++i) require(ordered.times[i] > ordered.times[i - 1]);
        });
      }
    });
  }
  for (const StampUnit unit : {StampUnit::s, StampUnit::ms, StampUnit::us, StampUnit::ns}) {
    mayRefuse([&] { check(parseTrajectory(text, "fuzz", {.time_unit = unit})); });
  }
  mayRefuse([&] {
    TrajectoryOptions by_number;
    by_number.reading.columns = {"t=1", "tx=2", "ty=3", "tz=4", "qx=5", "qy=6", "qz=7", "qw=8"};
    check(parseTrajectory(text, "fuzz", by_number));
  });
  mayRefuse([&] {
    const PoseGraph graph = parseGraph(text, "fuzz");
    for (const GraphFormat to : {GraphFormat::g2o, GraphFormat::toro})
      mayRefuse([&] { (void)formatGraph(graph, to, {}); });
  });
  return 0;
}

}  // namespace liestat
