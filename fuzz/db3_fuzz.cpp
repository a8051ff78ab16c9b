// Any bytes as a database of ROS 2 (fuzz/bag_checks.hpp).
//
//   build/sanitize/fuzz/db3_fuzz -max_total_time=120 new_corpus fuzz/corpus/bag

#include <fuzz/bag_checks.hpp>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  liestat::checkBag(data, size, {"SQLite format 3\0", 16});
  return 0;
}
