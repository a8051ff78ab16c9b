// The requirements on bags that the fuzz targets of their containers share: topics, poses that keep their promises,
// readings, chains, or an InputError of one line. Anything else is a finding.
#pragma once

#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <fuzz/checks.hpp>
#include <formats/bag.hpp>
#include <formats/imu.hpp>
#include <formats/trajectory.hpp>

namespace liestat {

inline void check(const Trajectory& t) {
  require(t.size() > 0 && t.lines.size() == t.size());
  require(t.times.empty() || t.times.size() == t.size());
  require(t.covariances.empty() || t.covariances.size() == t.size());
  for (const auto& pose : t.poses) require(std::abs(pose.unit_quaternion().norm() - 1) < 1e-14);
}

/// Any bytes as a bag: what does not begin as its container does is put behind that beginning.
inline void checkBag(const std::uint8_t* data, std::size_t size, std::string_view magic) {
  static const std::string path =
      (std::filesystem::temp_directory_path() / ("liestat_bag_fuzz_" + std::to_string(::getpid()))).string();
  std::string bytes(reinterpret_cast<const char*>(data), size);
  if (!bytes.starts_with(magic)) bytes.insert(0, magic);
  std::ofstream(path, std::ios::binary) << bytes;
  mayRefuse([&] {
    const BagContents bag = listBag(path, 0.01);
    TrajectoryOptions options;
    options.reading.largest_file = 0.01;
    for (std::size_t i = 0; i < bag.topics.size() && i < 8; ++i) {
      mayRefuse([&] { check(readTrajectory(path + ":" + bag.topics[i].name, options)); });
      mayRefuse([&] { (void)readImu(path + ":" + bag.topics[i].name); });
    }
    options.reading.frames = "map:base";
    mayRefuse([&] { check(readTrajectory(path, options)); });
    options.reading.frames = "base_link:map";
    mayRefuse([&] { check(readTrajectory(path, options)); });
  });
  std::filesystem::remove(path);
}

}  // namespace liestat
