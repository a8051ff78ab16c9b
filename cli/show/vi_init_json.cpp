#include <cli/show/vi_init.hpp>

namespace liestat::cli {

void setViInit(JsonObject& object, const ViRecording& recording, const ViInitResult& result) {
  object.set("readings", recording.imu.samples.size()).set("start_ns", recording.imu.start_ns);
  object.set("images", recording.tracks.times.size()).set("tracks", recording.tracks.track_ids.size());
  object.set("camera_pose_assumed", recording.pose_assumed).set("tracks_seen_once", recording.tracks.seen_once);
  object.set("observations_outside", result.observations_outside)("noise_calibration", result.noise);
  object.fieldsOf(static_cast<const ComparedRecording&>(result));
}

}  // namespace liestat::cli
