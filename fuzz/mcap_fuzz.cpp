// Any bytes as a file of MCAP (fuzz/bag_checks.hpp).
//
//   build/sanitize/fuzz/mcap_fuzz -max_total_time=120 new_corpus fuzz/corpus/bag

#include <fuzz/bag_checks.hpp>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  liestat::checkBag(data, size, {"\x89MCAP0\r\n", 8});
  return 0;
}
