// Inertial readings and true states from files of EuRoC and TUM-VI, or readings from CSV.
#pragma once

#include <fusion/imu/ground_truth.hpp>
#include <fusion/imu/readings.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// The readings of an inertial sensor out of a file.
struct ImuFile {
  std::vector<ImuSample<double>> samples;  ///< in the order of time, which is in seconds since `start_ns`
  std::vector<std::size_t> lines;          ///< the line, or in bags the message, that each stands in
  /// The first time stamp, in nanoseconds: those of a clock that counts from 1970 do not fit into a double. Zero where
  /// the file has seconds.
  std::int64_t start_ns = 0;
  std::string format;              ///< euroc, csv or bag
  std::vector<std::string> notes;  ///< sentences on what reading has decided

  double duration() const { return samples.back().time - samples.front().time; }
};

/// Reads `#timestamp [ns],w x y z [rad/s],a x y z [m/s²]` (EuRoC, TUM-VI), or a CSV file with the columns t (s), wx,
/// wy, wz, ax, ay, az; `-` is standard input; or a topic of sensor_msgs/Imu in a bag (`run.bag:/imu`, or the only one),
/// in the order of its stamps, of which rates and forces alone are taken. Throws InputError, also where times do not
/// ascend, where a topic says that it has no rates or forces (-1 as a covariance), and where the numbers are those of
/// other units: forces of some 1 (g), rates of hundreds (degrees a second).
ImuFile readImu(const std::string& path);
/// The same from memory.
ImuFile parseImu(std::string_view text, const std::string& name);

/// Reads EuRoC's ground truth: timestamp [ns], p x y z, q w x y z, v x y z and, if there, b_w x y z, b_a x y z. Throws
/// InputError.
std::vector<GroundTruth> readGroundTruth(const std::string& path, std::int64_t start_ns);
/// The same from memory.
std::vector<GroundTruth> parseGroundTruth(std::string_view text, const std::string& name, std::int64_t start_ns);

/// The time stamp of the first row of one of EuRoC's files, ns. Throws InputError.
std::int64_t firstStamp(std::string_view text, const std::string& name);

}  // namespace liestat
