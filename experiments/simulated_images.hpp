#pragma once

#include <experiments/simulate_vi.hpp>

#include <cstdint>
#include <vector>

namespace liestat::experiments {

/// The uses of random numbers. Each has its own stream, so that more of one leaves the others as they are.
enum Stream : std::uint32_t { landmark_stream, choice_stream, pixel_stream, outlier_stream, imu_stream, motion_stream };

/// Adds what the recording's camera sees from these poses of the body, one at each of its image_times, of landmarks on
/// a box around the motion. Throws ImpossibleMotion.
void addImages(const std::vector<SE3d>& world_T_body, const ViSceneOptions& options, SimulatedRecording& recording);

}  // namespace liestat::experiments
