// Any text as a calibration, as tracks or as a ground truth: what keeps its promises, or an InputError of one line.
// Anything else is a finding. A line of three dots parts the input into the file of tracks and that of the images'
// times.
//
//   build/sanitize/fuzz/recording_fuzz -max_total_time=120 new_corpus fuzz/corpus/recording

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include <fuzz/checks.hpp>
#include <formats/calibration.hpp>
#include <formats/tracks.hpp>
#include <formats/imu.hpp>

namespace liestat {
namespace {

void check(const Calibration& calibration) {
  require(calibration.imu || !calibration.cameras.empty());
  for (const auto& [name, camera, imu_T_cam, timeshift] : calibration.cameras) {
    require(!name.empty() && std::isfinite(timeshift) && imu_T_cam.params().allFinite());
    require(std::abs(imu_T_cam.so3().params().norm() - 1) < 1e-12);
    require(camera.fu > 0 && camera.fv > 0 && camera.width >= 0 && camera.height >= 0);
    for (const double u : {camera.cu, camera.cu + camera.fu, camera.cu - 0.1 * camera.fu, 0.0}) {
      const auto bearing = camera.bearing({u, camera.cv - 0.3 * camera.fv});
      if (bearing) require(std::abs(bearing->norm() - 1) < 1e-12 && camera.project(*bearing).has_value());
    }
  }
}

void check(const ImageTracks& tracks) {
  require(tracks.frames.size() == tracks.times.size() && !tracks.observations.empty());
  for (std::size_t i = 0; i < tracks.times.size(); ++i) {
    require(std::isfinite(tracks.times[i]) && (i == 0 || tracks.times[i] > tracks.times[i - 1]));
  }
  for (const auto& o : tracks.observations) {
    require(o.image < tracks.times.size() && o.track < tracks.track_ids.size());
    require(std::isfinite(o.u) && std::isfinite(o.v) && o.line > 0);
  }
  require(tracks.seen_once <= tracks.track_ids.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  mayRefuse([&] { check(parseCalibration(text, "fuzz")); });
  mayRefuse([&] { check(Calibration{{}, parseCameras(text, "fuzz")}); });
  mayRefuse([&] { (void)parseImuNoise(text, "fuzz"); });
  mayRefuse([&] { check(parseImageTracks(text, "fuzz", {}, {}, 1403715523912143104)); });
  mayRefuse([&] {
    const std::int64_t start_ns = firstStamp(text, "fuzz");
    const auto truth = parseGroundTruth(text, "fuzz", start_ns);
    require(!truth.empty() && truth.front().time == 0);
    for (const auto& row : truth) require(row.state.params().allFinite() && std::isfinite(row.time));
    const auto at = liestat::truthAt(truth, 0.5 * truth.back().time);
    require(!at || at->state.params().allFinite());
  });
  const std::size_t dots = text.find("\n...\n");
  if (dots != std::string_view::npos) {
    mayRefuse([&] { check(parseImageTracks(text.substr(0, dots + 1), "fuzz", text.substr(dots + 5), "times", 0)); });
  }
  return 0;
}

}  // namespace liestat
