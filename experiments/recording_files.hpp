#pragma once

#include <experiments/recording.hpp>
#include <experiments/simulate_vi.hpp>

#include <optional>
#include <string>

namespace liestat::experiments {

/// Writes imu.csv, images.csv and truth.csv as EuRoC does, tracks.csv (frame,track,u,v; the frame is the row of
/// images.csv), calibration.yaml in Kalibr's form and landmarks.csv (track,x,y,z,outlier). Image times are on the
/// camera's clock. liestat.txt tells these files, as they were written, from others of the same names. Throws InputError
/// where the directory cannot be written.
void writeRecording(const experiments::SimulatedRecording& recording, const std::string& directory);

/// A chain of one camera and its sensor in Kalibr's form.
std::string calibrationText(const CameraCalibration& camera, const std::optional<ImuNoise<double>>& noise);

/// Throws InputError where writeRecording() would replace a file that it has not written itself, or that was changed
/// since.
void requireOwnFiles(const std::string& directory);

}  // namespace liestat::experiments
