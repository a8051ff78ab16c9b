// Bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, also below .zstd): their topics (docs/bags.md). Poses are read by
// readTrajectory("run.bag:/odom") of formats/trajectory.hpp, inertial readings by readImu of formats/imu.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace liestat {

/// A topic of a bag.
struct BagTopic {
  std::string name;
  std::string type;                        ///< as ROS 1 spells it: nav_msgs/Odometry
  std::string encoding;                    ///< ros1 or cdr; MCAP files have others, which are listed, not read
  std::size_t messages = 0;                ///< their number, by the bag's index where it has one
  std::int64_t first_ns = 0, last_ns = 0;  ///< when the first and the last were recorded; since 1970
};
template <class V>
void describe(V& v, const BagTopic& t) {
  v("topic", t.name)("type", t.type, "of its messages, as ROS 1 spells it")("encoding", t.encoding, "ros1 or cdr");
  v("messages", t.messages)("first", 1e-9 * static_cast<double>(t.first_ns), "when it was recorded, since 1970", "s");
  v("last", 1e-9 * static_cast<double>(t.last_ns), "likewise", "s");
}

/// The contents of a bag.
struct BagContents {
  std::vector<BagTopic> topics;    ///< by their names
  std::vector<std::string> notes;  ///< sentences on what could not be read
};
template <class V>
void describe(V& v, const BagContents& bag) {
  v("topics", bag.topics, "of the bag")("notes", bag.notes, "on what could not be read");
}

/// The file (or the directory of a ROS 2 bag) and the topic of `FILE` or `FILE:TOPIC`.
struct BagPath {
  std::string file, topic;
};

/// True if a path, with or without a topic after a colon, is that of a bag: by its first bytes, or by the ending of its
/// name if there is no such file.
bool isBag(const std::string& path);
/// Parts of such a path; without a topic, or where it is no bag's, all of it is the file.
BagPath bagPath(const std::string& path);

/// The topics of a bag, by its index, without expanding chunks that are indexed. `largest` limits what a .zstd file
/// around a bag expands to, GB. Throws InputError where it is no bag, or this build cannot read it.
BagContents listBag(const std::string& path, double largest = 1);

}  // namespace liestat
