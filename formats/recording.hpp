// Recordings of a camera and an inertial sensor as they lie on disk: which of a folder's files are what.
//
//   const liestat::FoundRecording found = liestat::findRecording("V1_01_easy");
//   if (!found.imu.empty()) const liestat::ImuFile imu = liestat::readImu(found.imu);
#pragma once

#include <string>
#include <vector>

namespace liestat {

/// The files of a recording, as paths that begin with the folder's; empty: there is none.
struct FoundRecording {
  std::string folder;
  std::string camera;                    ///< the name of its folder (cam0)
  std::string images;                    ///< a folder of images
  std::string image_times;               ///< CSV; empty: names of images are their times, or nothing says them
  std::string imu;                       ///< readings
  std::vector<std::string> calibration;  ///< of this camera and of the sensor's noise
  std::string truth;
  std::vector<std::string> notes;  ///< sentences: files that are passed over, and why

  /// A path without the folder's.
  std::string shortly(const std::string& path) const;
};

/// Looks through a recording: an EuRoC/ASL folder (mav0, or the one that has it: cam0/data, cam0/data.csv,
/// cam0/sensor.yaml, imu0/data.csv, imu0/sensor.yaml, state_groundtruth_estimate0/data.csv), or a folder with images, or
/// with one folder of them, and CSV files, which are told apart by their first lines: readings (ns and six numbers, or
/// t,wx,wy,wz,ax,ay,az), times (ns,file or frame,t_s), truth (ns and EuRoC's ten numbers or more). Calibrations are
/// sensor.yaml of this camera and of the sensor, then Kalibr's and other chains in the folder or one below. `camera` is
/// the name of a folder of images (empty: the first), or else of a camera in a calibration, which is not looked at here.
/// Nothing is written, and no link leads out of the folder and back for ever: two levels are looked at. Throws
/// InputError where there is no folder, and where a sensor.yaml is wrong.
FoundRecording findRecording(const std::string& folder, const std::string& camera = {});

}  // namespace liestat
