// The containers of ROS: their topics, and their messages one after the other, in bounded memory. Layouts: ROS 1 bag
// format 2.0 (wiki.ros.org/Bags/Format/2.0), MCAP (mcap.dev/spec), rosbag2's tables in SQLite.
#pragma once

#include <formats/bag.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::detail {

/// The largest chunk of compressed records that is expanded, and the largest message that is read, bytes.
inline constexpr std::size_t largest_chunk = std::size_t{1} << 27, largest_message = std::size_t{1} << 24;

/// One pass over a bag: what it is to do, and what it finds.
class BagPass {
 public:
  /// Chooses the topics whose messages are taken; without it the pass counts.
  std::function<bool(const BagTopic&)> wanted;
  /// Takes a message, and when it was recorded (ns).
  std::function<void(const BagTopic&, std::int64_t, std::string_view)> take;

  std::vector<BagTopic> topics;
  std::vector<std::string> notes;

  /// The place of a topic in the list, to which it is added if it is new.
  std::size_t topic(std::string name, std::string type, std::string encoding);
  bool counts() const { return !wanted; }
  bool takes(std::size_t topic) const { return taken_[topic]; }
  void count(std::size_t topic, std::size_t n, std::int64_t first, std::int64_t last);

 private:
  std::map<std::string, std::size_t> places_;
  std::vector<bool> taken_;
};

/// True if the first bytes of a file are a bag's.
bool beginsAsBag(const std::string& path);

/// Reads a bag, or the bags of a directory in the order of their names. Notes say what could not be read. Throws
/// InputError where it is no bag, or of a kind that this build cannot read, and what `take` throws.
void readBagFile(const std::string& path, double largest, BagPass& pass);

/// A text expanded by bz2, lz4 (frames) or zstd, up to `limit` bytes, and the reason why it ends early, if it does.
/// Throws InputError in the name of the file where the build has no such library.
struct Expanded {
  std::string text, fault;
};
Expanded expanded(std::string_view compression, std::string_view bytes, std::size_t limit, const std::string& file);

}  // namespace liestat::detail
