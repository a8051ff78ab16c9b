// Any bytes as a bag of each container: topics, poses that keep their promises, readings, chains, or an InputError of one
// line. Anything else is a finding. What is no bag becomes one of three by its first byte, so that all of them are reached.
//
//   build/sanitize/fuzz/bag_fuzz -max_total_time=120 new_corpus fuzz/corpus/bag

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
namespace {

void check(const Trajectory& t) {
  require(t.size() > 0 && t.lines.size() == t.size() && t.times.size() == t.size());
  require(t.covariances.empty() || t.covariances.size() == t.size());
  for (const auto& pose : t.poses) require(std::abs(pose.unit_quaternion().norm() - 1) < 1e-14);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string path =
      (std::filesystem::temp_directory_path() / ("liestat_bag_fuzz_" + std::to_string(::getpid()))).string();
  std::string bytes(reinterpret_cast<const char*>(data), size);
  static constexpr std::string_view magics[] = {
      {"#ROSBAG V2.0\n", 13}, {"\x89MCAP0\r\n", 8}, {"SQLite format 3\0", 16}};
  if (size > 0 && bytes[0] != '#' && bytes[0] != '\x89' && bytes[0] != 'S' && bytes[0] != '\x28') {
    bytes.insert(0, magics[data[0] % 3]);
  }
  std::ofstream(path, std::ios::binary) << bytes;
  mayRefuse([&] {
    const BagContents bag = listBag(path, 0.01);
    TrajectoryOptions options;
    options.reading.largest_file = 0.01;
    for (std::size_t i = 0; i < bag.topics.size() && i < 8; ++i) {
      mayRefuse([&] { check(readTrajectory(path + ":" + bag.topics[i].name, options)); });
      mayRefuse([&] { (void)readImu(path + ":" + bag.topics[i].name); });
    }
    options.frames = "map:base";
    mayRefuse([&] { check(readTrajectory(path, options)); });
    options.frames = "base_link:map";
    mayRefuse([&] { check(readTrajectory(path, options)); });
  });
  std::filesystem::remove(path);
  return 0;
}

}  // namespace liestat
