// Bags: those of ROS' own writers (tests/data/bags, and fresh ones where the writers are installed), and bags written here
// that are cut off, damaged, hostile, or of rarer encodings.
#include <formats/bag.hpp>
#include <formats/features.hpp>
#include <formats/imu.hpp>
#include <formats/trajectory.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// The package without which this build cannot read a bag, empty if it can.
std::string lacking(const std::string& name) {
  std::vector<std::pair<const char*, const char*>> absent;
#ifndef LIESTAT_HAS_BZ2
  absent.emplace_back("bz2", "libbz2-dev");
#endif
#ifndef LIESTAT_HAS_LZ4
  absent.emplace_back("lz4", "liblz4-dev");
#endif
#ifndef LIESTAT_HAS_ZSTD
  absent.emplace_back("zstd", "libzstd-dev"), absent.emplace_back("unindexed", "libzstd-dev");
#endif
#ifndef LIESTAT_HAS_SQLITE_LIBRARY
  absent.emplace_back("db3", "libsqlite3-dev");
#endif
  for (const auto& [part, package] : absent) {
    if (contains(name, part)) return package;
  }
  return {};
}

/// The scene of tests/formats/bags/write_ros1.py: so many readings at 200 Hz, a pose for five of them.
void expectScene(const std::string& path, int count) {
  SCOPED_TRACE(path);
  if (const std::string package = lacking(path); !package.empty()) {
    EXPECT_TRUE(contains(errorOf([&] { listBag(path); }), package)) << errorOf([&] { listBag(path); });
    return;
  }
  if (contains(path, "split") && !lacking("zstd").empty()) return;  // some of its messages
  const auto poses = static_cast<std::size_t>((count + 4) / 5), n = static_cast<std::size_t>(count);
  const BagContents bag = listBag(path);
  EXPECT_TRUE(bag.notes.empty()) << bag.notes[0];
  ASSERT_EQ(bag.topics.size(), 7U);
  const char* const names[] = {"/imu", "/moved", "/odom", "/pose", "/pose_cov", "/tf", "/tf_static"};
  constexpr std::int64_t start = 1700000000000000000;
  for (std::size_t k = 0; k < 7; ++k) {
    const BagTopic& t = bag.topics[k];
    EXPECT_EQ(t.name, names[k]);
    EXPECT_EQ(t.messages, k == 0 ? n : k == 6 ? 1 : poses);
    EXPECT_EQ(t.first_ns, start);
    EXPECT_EQ(t.last_ns, k == 6 ? start : start + 5000000 * (k == 0 ? count - 1 : 5 * static_cast<int>(poses - 1)));
  }
  EXPECT_EQ(bag.topics[2].type, "nav_msgs/Odometry");
  const ImuFile imu = readImu(path);
  ASSERT_EQ(imu.samples.size(), n);
  EXPECT_EQ(imu.start_ns, start);
  EXPECT_TRUE(imu.notes.empty());
  for (std::size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(imu.samples[i].time, 0.005 * static_cast<double>(i), 1e-12);
    EXPECT_EQ(imu.samples[i].angular_rate, Eigen::Vector3d(0, 0, 0.1));
    EXPECT_EQ(imu.samples[i].specific_force, Eigen::Vector3d(0.001 * static_cast<double>(i), 0, 9.81));
  }
  const auto odom_T_base = [](std::size_t k) {
    const double i = 5 * static_cast<double>(k);
    return SE3d(SO3d::exp({0, 0, 0.01 * i}), Eigen::Vector3d(0.1 * i, std::sin(0.01 * i), 0));
  };
  for (const char* topic : {"/odom", "/pose", "/pose_cov", "/moved"}) {
    const Trajectory t = readTrajectory(path + ":" + topic);
    ASSERT_EQ(t.size(), poses) << topic;
    for (std::size_t k = 0; k < poses; ++k) {
      EXPECT_LT((t.poses[k].inverse() * odom_T_base(k)).log().norm(), 1e-14);
      EXPECT_EQ(t.time_texts[k], fmt::format("{}.{:09}", 1700000000 + 25 * k / 1000, 25 * k % 1000 * 1000000));
    }
    EXPECT_EQ(t.frames[0], "odom");
    EXPECT_FALSE(t.stated_convention) << "ROS' comment and tf2 differ: the user says it, as for ros-csv";
    if (std::string(topic) != "/odom") {
      EXPECT_FALSE(t.hasCovariances()) << "zeros throughout are unknown, not exact";
      continue;
    }
    Matrix6d C = (0.01 * Eigen::Matrix<double, 6, 1>::LinSpaced(1, 6)).asDiagonal();
    C(0, 1) = C(1, 0) = 0.001;
    ASSERT_EQ(t.covariances.size(), poses);
    EXPECT_LT((t.covariances.back() - C).norm(), 1e-15);
    EXPECT_EQ(t.frames[1], "base_link");
    EXPECT_LT((gaussiansOf(t, "ros-fixed")[2].covariance -
               fromConvention(conventionNamed("ros-fixed", ""), t.poses[2], t.covariances[2]).covariance)
                  .norm(),
              1e-15);
  }
  const FeatureFile features = readFeatureFile(path + ":/odom");
  ASSERT_EQ(features.size(), poses);
  EXPECT_EQ(featuresOf<Frame3d>(features)[3].params(), readTrajectory(path + ":/odom").poses[3].params());
  ASSERT_EQ(features.notes.size(), 1U);
  EXPECT_TRUE(contains(features.notes[0], "covariances are not used") && features.covariances.empty());
  // map -> odom comes with each fourth pose; its height grows evenly, so that interpolation is exact.
  TrajectoryOptions chain;
  chain.reading.frames = "map:camera";
  const Trajectory t = readTrajectory(path, chain);
  ASSERT_EQ(t.size(), 4 * ((poses - 1) / 4) + 1);
  chain.reading.frames = "camera:map";
  const Trajectory inverse = readTrajectory(path + ":/tf", chain);
  for (std::size_t k = 0; k < t.size(); ++k) {
    const SE3d map_T_odom(SO3d(), Eigen::Vector3d(0, 0, 1 + 0.05 * static_cast<double>(k)));
    const SE3d expected = map_T_odom * odom_T_base(k) * SE3d(SO3d(), Eigen::Vector3d(0.5, 0, 0.25));
    EXPECT_LT((t.poses[k].inverse() * expected).log().norm(), 1e-13) << k;
    EXPECT_LT((inverse.poses[k] * expected).log().norm(), 1e-13) << k;
  }
  ASSERT_EQ(t.notes.size(), t.size() == poses ? 1U : 2U);
  EXPECT_TRUE(contains(t.notes[0], "map -> odom is interpolated, between transforms that are up to 0.1 s apart"));
}

TEST(Bag, goldenBags) {
  for (const char* name : {"bz2.bag", "lz4.bag", "lz4.mcap", "unindexed.mcap", "run.db3.zstd"}) {
    expectScene(std::string(LIESTAT_SOURCE_DIR "/tests/data/bags/") + name, 25);
  }
}

#ifdef LIESTAT_ROS1_WRITER
TEST(Bag, freshBagsOfRos1) {
  const TemporaryDirectory directory;
  ASSERT_EQ(std::system((LIESTAT_ROS1_WRITER " " + directory.path().string()).c_str()), 0);
  for (const char* name : {"none.bag", "bz2.bag", "lz4.bag"}) expectScene(directory / name, 200);
}
#endif
#ifdef LIESTAT_ROS2_WRITER
TEST(Bag, freshBagsOfRos2) {
  const TemporaryDirectory directory;
  ASSERT_EQ(std::system((LIESTAT_ROS2_WRITER " " + directory.path().string()).c_str()), 0);
  for (const char* name : {"none.mcap", "lz4.mcap", "zstd.mcap", "unchunked.mcap", "unindexed.mcap", "run.db3",
                           "run.db3.zstd", "split_db3"}) {
    expectScene(directory / name, 200);
  }
}
#endif

// --- Bags of our own --------------------------------------------------------------------------------------------------

/// A whole number of n bytes.
std::string bytes(std::uint64_t value, int n, bool big = false) {
  std::string text;
  for (int i = 0; i < n; ++i) {
    const int place = big ? n - 1 - i : i;
    text += place < 8 ? static_cast<char>(value >> 8 * place) : '\0';
  }
  return text;
}
std::string text4(const std::string& text) { return bytes(text.size(), 4) + text; }

/// A message's bytes: CDR of a version and byte order, or ROS 1's.
struct Writer {
  enum Encoding { ros1, big1, little1, big2, little2 } encoding = little1;
  std::string data = encoding == ros1 ? "" : std::string{'\0', "\0\0\1\6\7"[encoding], '\0', '\0'};

  bool cdr() const { return encoding != ros1; }
  void number(std::uint64_t value, std::size_t n) {
    const std::size_t step = encoding >= big2 ? std::min<std::size_t>(n, 4) : n;
    while (cdr() && (data.size() - 4) % step != 0) data += '\0';
    data += bytes(value, static_cast<int>(n), encoding == big1 || encoding == big2);
  }
  void text(const std::string& t) {
    number(t.size() + (cdr() ? 1 : 0), 4), data += t + (cdr() ? std::string(1, '\0') : "");
  }
  void header(const std::string& frame, std::uint32_t s, std::uint32_t ns) {
    if (!cdr()) number(7, 4);
    number(s, 4), number(ns, 4), text(frame);
  }
  void numbers(const std::vector<double>& list) {
    for (const double v : list) number(std::bit_cast<std::uint64_t>(v), 8);
  }
};
constexpr auto encodings = {Writer::ros1, Writer::big1, Writer::little1, Writer::big2, Writer::little2};

std::string record(int op, const std::string& body) {
  return bytes(static_cast<unsigned>(op), 1) + bytes(body.size(), 8) + body;
}
const std::string mcap_magic = "\x89MCAP0\r\n";
/// An MCAP file of one topic, without chunks.
std::string mcap(const std::string& type, bool cdr, const std::vector<std::string>& messages,
                 const std::string& topic = "/x") {
  std::string file = mcap_magic + record(1, text4("") + text4("test")) +
                     record(3, bytes(1, 2) + text4(type) + text4("ros2msg") + text4("")) +
                     record(4, bytes(0, 2) + bytes(1, 2) + text4(topic) + text4(cdr ? "cdr" : "ros1") + text4(""));
  for (std::size_t i = 0; i < messages.size(); ++i) {
    file += record(5, bytes(0, 2) + bytes(i, 4) + bytes(1000 + i, 8) + bytes(1000 + i, 8) + messages[i]);
  }
  return file + record(15, bytes(0, 4)) + record(2, std::string(20, '\0')) + mcap_magic;
}
std::string poseOf(Writer w, std::uint32_t s, double x, double qw = 1, const std::string& frame = "map") {
  w.header(frame, s, 5), w.numbers({x, 2, 3, 0, 0, 0, qw});
  return w.data;
}
std::string transformsOf(Writer w, const std::vector<std::array<std::string, 2>>& edges, std::uint32_t s = 1) {
  w.number(edges.size(), 4);
  for (const auto& [parent, child] : edges) w.header(parent, s, 0), w.text(child), w.numbers({1, 0, 0, 0, 0, 0, 1});
  return w.data;
}

TEST(Bag, bagsOfEveryEncoding) {
  const TemporaryDirectory directory;
  for (const Writer::Encoding e : encodings) {
    const Writer w{e};
    // Frames of all lengths modulo 8, since what follows is aligned.
    for (const char* frame : {"", "m", "map", "world", "odom_ned", "odom_ned_"}) {
      const std::string path = directory.write(
          "x.mcap", mcap("geometry_msgs/PoseStamped", w.cdr(), {poseOf(w, 1, 9, 1, frame), poseOf(w, 2, 8, 1, frame)}));
      const Trajectory t = readTrajectory(path);
      ASSERT_EQ(t.size(), 2U);
      EXPECT_EQ(t.poses[1].translation(), Eigen::Vector3d(8, 2, 3));
      EXPECT_EQ(t.time_texts[0], "1.000000005");
      EXPECT_EQ(t.frames[0], frame);
    }
  }
}

TEST(Bag, pathsAreTheirLastMessage) {
  const TemporaryDirectory directory;
  const auto pathOf = [](Writer w, const std::vector<std::uint32_t>& stamps, const std::string& frame) {
    w.header("map", 9, 0), w.number(stamps.size(), 4);
    for (const std::uint32_t s : stamps) w.header(frame, s, 5), w.numbers({double(s), 2, 3, 0, 0, 0, 1});
    return w.data;
  };
  for (const Writer::Encoding e : encodings) {
    const Writer w{e};
    const std::string path = directory.write(
        "x.mcap", mcap("nav_msgs/msg/Path", w.cdr(), {pathOf(w, {1, 2}, "map"), pathOf(w, {1, 2, 4}, "")}));
    const Trajectory t = readTrajectory(path + ":/x");
    ASSERT_EQ(t.size(), 3U);
    EXPECT_EQ(t.poses[2].translation(), Eigen::Vector3d(4, 2, 3));
    EXPECT_EQ(t.time_texts[2], "4.000000005") << "its own stamp";
    EXPECT_EQ(t.frames[0], "map") << "that of the path, where a pose has none";
    EXPECT_TRUE(contains(t.notes.back(), "the last of 2 messages"));
    // A plan: one stamp for all.
    const Trajectory plan =
        readTrajectory(directory.write("x.mcap", mcap("nav_msgs/msg/Path", w.cdr(), {pathOf(w, {7, 7, 7}, "map")})));
    EXPECT_EQ(plan.size(), 3U);
    EXPECT_FALSE(plan.hasTimes());
    const std::string cut = pathOf(w, {1, 2}, "map");
    EXPECT_TRUE(contains(errorOf([&] {
                           readTrajectory(directory.write(
                               "x.mcap", mcap("nav_msgs/msg/Path", w.cdr(), {cut.substr(0, cut.size() - 9)})));
                         }),
                         "nav_msgs/Path"));
  }
}

TEST(Bag, framesForFeatures) {
  const TemporaryDirectory directory;
  const Writer w;
  const std::string path = directory.write("x.mcap", mcap("tf2_msgs/msg/TFMessage", w.cdr(),
                                                          {transformsOf(w, {{"map", "odom"}, {"odom", "base"}}),
                                                           transformsOf(w, {{"map", "odom"}, {"odom", "base"}}, 2)},
                                                          "/tf"));
  const FeatureFile file = readFeatureFile(path, {.frames = "map:base"});
  ASSERT_EQ(file.size(), 2U);
  EXPECT_EQ(file.positions[1], Eigen::Vector3d(2, 0, 0));
  EXPECT_EQ(file.times[1], 2);
}

TEST(Bag, topicsWithoutPoses) {
  const TemporaryDirectory directory;
  const auto error = [&](const std::string& content, const std::string& topic = ":/x", const std::string& frames = "") {
    TrajectoryOptions o;
    o.reading.frames = frames;
    return errorOf([&] { readTrajectory(directory.write("x.mcap", content) + topic, o); });
  };
  const std::string stamped = "geometry_msgs/msg/PoseStamped", transforms = "tf2_msgs/msg/TFMessage";
  const Writer w;
  const std::string pose = poseOf(w, 1, 1);
  EXPECT_TRUE(contains(error(mcap(stamped, true, {pose}), ":/y"), "there is no topic '/y', expected one of /x"));
  EXPECT_TRUE(
      contains(error(mcap("sensor_msgs/msg/Image", true, {pose})), "messages of type sensor_msgs/Image in cdr"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {})), "the topic has no messages"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {pose, pose.substr(0, 30)})), ":2: the message ends"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {pose + std::string(9, 'x')})), "9 bytes too many"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {"\1" + pose.substr(1)})), "no plain CDR's first bytes"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {poseOf(w, 1, 1, 0)})), ":1: the quaternion is zero"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {poseOf(w, 0x80000000, 1)})), "has the stamp -2147483648 s"));
  EXPECT_TRUE(contains(error(mcap(stamped, true, {pose, poseOf(w, 2, 1, 1, "odom")})), "poses of one frame"));
  EXPECT_TRUE(contains(error(mcap(transforms, true, {})), "--frames map:base_link"));
  // Chains that lead nowhere, back, or to two parents.
  const auto chain = [&](const std::vector<std::array<std::string, 2>>& edges, const std::string& frames) {
    return error(mcap(transforms, true, {transformsOf(w, edges)}, "/tf"), "", frames);
  };
  EXPECT_TRUE(contains(chain({{"a", "b"}, {"c", "d"}}, "a:d"), "no transforms lead from 'd' to 'a'"));
  EXPECT_TRUE(contains(chain({{"a", "b"}, {"b", "a"}}, "a:b"), "lead back to it"));
  EXPECT_TRUE(contains(chain({{"a", "b"}, {"c", "b"}}, "a:b"), "the parent of frame 'b' is 'c', and 'a' before"));
  EXPECT_TRUE(contains(chain({{"a", "b"}}, "a"), "--frames: 'a', expected two frames"));
  EXPECT_EQ(chain({{"/a", "b"}, {"b", "c"}, {"b", "e"}}, "c:/e"), "");
  // Files that are none.
  EXPECT_TRUE(contains(errorOf([&] { readTrajectory(directory / "none.bag:/x"); }), "none.bag: no such file"));
  EXPECT_TRUE(contains(errorOf([&] { listBag(directory.write("x.txt", "1 2 3")); }), "this is no bag"));
  EXPECT_TRUE(contains(errorOf([&] { listBag(directory.write("x.bag", "#ROSBAG V1.2\n")); }), "an older format"));
}

TEST(Bag, readingsWithoutSensor) {
  const TemporaryDirectory directory;
  const auto imu = [](std::uint32_t s, double rate_covariance, double force_covariance, double force = 9.8) {
    Writer w;
    w.header("imu", s, 0);
    w.numbers({0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.1});
    w.numbers({rate_covariance, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, force, force_covariance, 0, 0, 0, 0, 0, 0, 0, 0});
    return w.data;
  };
  const auto read = [&](const std::vector<std::string>& messages) {
    return readImu(directory.write("i.mcap", mcap("sensor_msgs/msg/Imu", true, messages)) + ":/x");
  };
  EXPECT_TRUE(contains(errorOf([&] { read({imu(1, -1, 0), imu(2, -1, 0)}); }), "has no angular rates"));
  EXPECT_TRUE(contains(errorOf([&] { read({imu(1, 0, 0), imu(2, 0, -1)}); }), ":2: the sensor has no accelerations"));
  EXPECT_TRUE(contains(errorOf([&] { read({imu(1, 0, 0, 1), imu(2, 0, 0, 1)}); }), "in g?"));
  EXPECT_TRUE(contains(errorOf([&] { read({imu(1, 0, 0)}); }), "one reading at most"));
  // Out of order, and one twice.
  const ImuFile file = read({imu(3, 1e-4, 0), imu(2, 0, 0), imu(3, 1e-4, 0)});
  ASSERT_EQ(file.samples.size(), 2U);
  EXPECT_EQ(file.start_ns, 2000000000);
  EXPECT_EQ(file.notes.size(), 3U);
}

TEST(Bag, stampsOfZeroAndUnknownCovariances) {
  const TemporaryDirectory directory;
  const Writer w;
  Writer zero;
  zero.header("map", 0, 0), zero.numbers({1, 2, 3, 0, 0, 0, 1});
  const Trajectory t = readTrajectory(directory.write("x.mcap", mcap("geometry_msgs/PoseStamped", true, {zero.data})));
  EXPECT_EQ(t.time_texts[0], "0.000001000");
  EXPECT_TRUE(contains(t.notes[0], "1 messages have no stamp"));
  std::vector<double> C(36, 0);
  for (int k = 0; k < 6; ++k) C[7 * static_cast<std::size_t>(k)] = k == 5 ? 1e6 : 0.1;
  std::vector<std::string> messages;
  for (const double first : {0.1, -1.0}) {
    Writer p;
    C[0] = first, p.header("map", 1 + static_cast<std::uint32_t>(messages.size()), 0);
    p.numbers({1, 2, 3, 0, 0, 0, 1}), p.numbers(C), messages.push_back(p.data);
  }
  const Trajectory u =
      readTrajectory(directory.write("x.mcap", mcap("geometry_msgs/PoseWithCovarianceStamped", true, messages)));
  EXPECT_TRUE(std::isnan(u.covariances[0](5, 5)) && u.covariances[0](1, 1) == 0.1);
  EXPECT_TRUE(u.covariances[1].array().isNaN().all());
}

/// Reads a file in every way; an InputError is all that may be thrown.
std::size_t readAll(const std::string& path) {
  std::size_t read = 0;
  TrajectoryOptions chain;
  chain.reading.frames = "map:camera";
  const std::function<void()> ways[] = {[&] { read += listBag(path).notes.size(); },
                                        [&] { read += readTrajectory(path + ":/odom").size(); },
                                        [&] { readTrajectory(path, chain); }, [&] { readImu(path + ":/imu"); }};
  for (const auto& way : ways) errorOf(way);
  return read;
}

TEST(Bag, damagedBags) {
  const TemporaryDirectory directory;
  int n = 0;  // each file has a name of its own: writing one again waits for the disk
  for (const char* name : {"bz2.bag", "lz4.bag", "lz4.mcap", "unindexed.mcap", "run.db3.zstd"}) {
    SCOPED_TRACE(name);
    if (!lacking(name).empty()) continue;
    const std::string whole = contentOf(std::string(LIESTAT_SOURCE_DIR "/tests/data/bags/") + name);
    for (std::size_t k = 0; k < 60; ++k) {
      const std::size_t place = k * whole.size() / 60 + k % 3;
      readAll(directory.write(fmt::format("{}{}", ++n, name), whole.substr(0, place)));
      std::string damaged = whole;
      for (std::size_t i = place; i < std::min(place + 3, whole.size()); ++i)
        damaged[i] = static_cast<char>(damaged[i] ^ (k % 2 ? 0xFF : 0x10));
      readAll(directory.write(fmt::format("{}{}", ++n, name), damaged));
    }
    // Half of a file gives something, with a note.
    if (std::string(name).ends_with("db3.zstd") || std::string(name) == "unindexed.mcap") continue;
    EXPECT_GT(readAll(directory.write(name, whole.substr(0, whole.size() * 3 / 4))), 1U);
  }
  if (lacking("zstd").empty()) {
    std::string mcap = contentOf(LIESTAT_SOURCE_DIR "/tests/data/bags/unindexed.mcap");
    const std::size_t checksum = mcap.find(text4("zstd")) - 4;
    mcap[checksum] = static_cast<char>(mcap[checksum] ^ 1);
    const BagContents bag = listBag(directory.write("c.mcap", mcap));
    EXPECT_TRUE(!bag.notes.empty() && contains(bag.notes[0], "its checksum is not that of its records"));
  }
  // Wherever a bag ends before its index, a note says so.
  const std::string small = contentOf(LIESTAT_SOURCE_DIR "/fuzz/corpus/bag/small.bag");
  EXPECT_TRUE(listBag(directory.write("s.bag", small)).notes.empty());
  for (std::size_t size = 14; size <= 4649; size += size < 400 ? 1 : 7) {
    EXPECT_FALSE(listBag(directory.write(fmt::format("{}.bag", ++n), small.substr(0, size))).notes.empty()) << size;
  }
  // A bag of a recorder that was killed: what is whole is read.
  const std::string whole = mcap("geometry_msgs/PoseStamped", true, std::vector<std::string>(10, poseOf({}, 1, 1)));
  const Trajectory t = readTrajectory(directory.write("k.mcap", whole.substr(0, whole.size() - 150)));
  EXPECT_EQ(t.size(), 9U);
  EXPECT_TRUE(contains(t.notes[0], "what stands before it is read"));
}

TEST(Bag, hostileBags) {
  const TemporaryDirectory directory;
  const std::string start = mcap_magic + record(1, text4("") + text4(""));
  const auto note = [&](const std::string& content) {
    const BagContents bag = listBag(directory.write("h.mcap", content));
    return bag.notes.empty() ? "" : bag.notes[0];
  };
  const std::string huge = bytes(std::uint64_t{1} << 60, 8);
  EXPECT_TRUE(contains(note(start + bytes(5, 1) + huge), "ends, or is damaged"));
  for (const char* how : {"lz4", "zstd", "bz2"}) {
    const std::string chunk = bytes(0, 16) + huge + bytes(0, 4) + text4(how) + bytes(4, 8) + "abcd";
    EXPECT_TRUE(contains(note(start + record(6, chunk) + record(2, "")), "bytes, 134217728 at most")) << how;
  }
  EXPECT_TRUE(contains(errorOf([&] {
                         note(start +
                              record(6, bytes(0, 16) + bytes(9, 8) + bytes(0, 4) + text4("rar") + bytes(1, 8) + "a"));
                       }),
                       "compressed by 'rar'"));
#if defined(LIESTAT_HAS_ZSTD)
  // A text of zeros expands a thousandfold.
  std::string bomb = "\x28\xB5\x2F\xFD";
  bomb += '\0', bomb += '\x58';  // a window of 2 MiB, no size
  for (int i = 0; i < 3000; ++i) bomb += bytes(2 | (131072U << 3U) | (i == 2999 ? 1 : 0), 3) + '\0';
  EXPECT_TRUE(contains(
      note(start +
           record(6, bytes(0, 16) + bytes(1000, 8) + bytes(0, 4) + text4("zstd") + bytes(bomb.size(), 8) + bomb) +
           record(2, "")),
      "more than the 1000 bytes that it states"));
  EXPECT_TRUE(contains(errorOf([&] { listBag(directory.write("b.db3.zstd", bomb), 0.1); }),
                       "at most 0.1 GB, or --largest-file"));
#endif
}

}  // namespace
}  // namespace liestat
