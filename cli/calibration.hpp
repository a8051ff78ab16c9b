#pragma once

#include <fusion/imu.hpp>

#include <string>
#include <string_view>

namespace liestat::cli {

/// Reads gyroscope_noise_density, gyroscope_random_walk, accelerometer_noise_density and accelerometer_random_walk out
/// of a YAML file: EuRoC's sensor.yaml, or the section imu0 of Kalibr's and OpenVINS' chains. OpenCV's first line
/// %YAML:1.0 is passed over. Throws InputError with the line, where a density is missing or not a number of zero or
/// more.
ImuNoise<double> readImuNoise(const std::string& path);
/// The same from memory.
ImuNoise<double> parseImuNoise(std::string_view text, const std::string& name);

}  // namespace liestat::cli
