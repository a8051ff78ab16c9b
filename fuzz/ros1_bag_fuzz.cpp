// Any bytes as a bag of ROS 1 (fuzz/bag_checks.hpp).
//
//   build/sanitize/fuzz/ros1_bag_fuzz -max_total_time=120 new_corpus fuzz/corpus/bag

#include <fuzz/bag_checks.hpp>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  liestat::checkBag(data, size, {"#ROSBAG V2.0\n", 13});
  return 0;
}
