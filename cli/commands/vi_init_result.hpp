#pragma once

#include <formats/calibration.hpp>
#include <formats/tracks.hpp>
#include <formats/imu.hpp>
#include <fusion/visual_inertial_truth_types.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {

/// The input of `liestat vi-init`. Times of images are on the inertial sensor's clock.
struct ViRecording {
  ImuFile imu;
  ImageTracks tracks;
  CameraCalibration camera;
  bool pose_assumed = false;  ///< no calibration has the camera's pose on the sensor: it is taken as the identity
  ImuNoise<double> noise;
  std::vector<GroundTruth> truth;  ///< empty: not known
  std::vector<std::string> found;  ///< in a folder: what was found where, in words, and notes
};
template <class V>
void describe(V& v, const ViRecording& r) {
  v("readings", r.imu.samples.size())("start_ns", r.imu.start_ns, "the time of the first reading", "ns");
  v("images", r.tracks.times.size())("tracks", r.tracks.track_ids.size())("camera_pose_assumed", r.pose_assumed);
  v("tracks_seen_once", r.tracks.seen_once)("found", r.found, "in a folder: what was found where");
}

/// The result that the command shows.
struct ViInitResult : ComparedRecording {
  bool biases_given = false;             ///< and not estimated
  bool show_filter_start = false;        ///< in the table; JSON always has it
  std::size_t observations_outside = 0;  ///< pixels that the lens' model can't explain
};
template <class V>
void describe(V& v, const ViInitResult& r) {
  v("observations_outside", r.observations_outside, "pixels without a direction");
  describe(v, static_cast<const ComparedRecording&>(r));
}

}  // namespace liestat::cli
