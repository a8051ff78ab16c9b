// Poses of bags: a topic of poses or transforms, or a chain of /tf and /tf_static.
#include <formats/bag.hpp>
#include <formats/detail/bag_file.hpp>
#include <formats/detail/bag_messages.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

namespace liestat::detail {
namespace {

constexpr const char* pose_types =
    "PoseStamped, PoseWithCovarianceStamped, Odometry, Path, TransformStamped, TFMessage";

bool isPoses(const BagTopic& t) {
  const std::optional<BagType> type = bagTypeOf(t.type);
  return type && *type != BagType::imu && (t.encoding == "ros1" || t.encoding == "cdr");
}
bool isTransforms(const BagTopic& t) { return bagTypeOf(t.type) == BagType::transforms; }

void appendStamp(Trajectory& trajectory, std::int64_t ns, std::size_t line) {
  appendTime(trajectory, fmt::format("{}.{:09}", ns / 1000000000, ns % 1000000000), line);
}

// --- Chains of transforms ---------------------------------------------------------------------------------------------

/// A transform parent_T_child over time.
struct BagEdge {
  std::string parent;
  bool fixed = true;  ///< by tf_static alone
  std::vector<std::pair<std::int64_t, SE3d>> samples = {};
};
using BagTree = std::map<std::string, BagEdge>;  ///< by the child

/// A frame and what is above it, up to the root. Throws InputError where that leads back.
std::vector<std::string> frameAndAncestors(const BagTree& tree, std::string frame, const std::string& name) {
  std::vector<std::string> frames = {std::move(frame)};
  for (auto edge = tree.find(frames[0]); edge != tree.end(); edge = tree.find(frames.back())) {
    frames.push_back(edge->second.parent);
    if (frames.size() > tree.size() + 1) {
      throw InputError(name, 0, "the parents of frame '" + printable(frames[0]) + "' lead back to it", "a tree");
    }
  }
  return frames;
}

/// A transform at a time between its samples, as tf2 interpolates; `gap` is the distance of those around it, ns.
SE3d transformAt(const BagEdge& edge, std::int64_t time, std::int64_t& gap) {
  gap = 0;
  if (edge.fixed) return edge.samples.back().second;
  const auto after = std::lower_bound(edge.samples.begin(), edge.samples.end(), time,
                                      [](const auto& sample, std::int64_t t) { return sample.first < t; });
  if (after->first == time) return after->second;
  const auto& [t0, a] = *(after - 1);
  const auto& [t1, b] = *after;
  gap = t1 - t0;
  const double s = static_cast<double>(time - t0) / static_cast<double>(gap);
  return SE3d(a.unit_quaternion().slerp(s, b.unit_quaternion()),
              Eigen::Vector3d((1 - s) * a.translation() + s * b.translation()));
}

void readChain(const std::string& file, const std::string& topic, const TrajectoryOptions& options, Trajectory& t) {
  const std::size_t colon = options.reading.frames.find(':');
  const auto bare = [](const std::string& frame) { return frame.starts_with('/') ? frame.substr(1) : frame; };
  const std::string to = bare(options.reading.frames.substr(0, colon));
  const std::string from = colon == std::string::npos ? "" : bare(options.reading.frames.substr(colon + 1));
  if (to.empty() || from.empty() || to == from) {
    throw OptionError("--frames", "'" + printable(options.reading.frames) + "'", "two frames: map:base_link");
  }
  BagTree tree;
  std::vector<std::string> chain;  // children of the edges that are taken; none: all, without their samples
  const auto collect = [&](BagPass& pass) {
    std::map<std::string, std::size_t> numbers;
    pass.wanted = [&](const BagTopic& b) {
      return isTransforms(b) && isPoses(b) && (b.name == topic || b.name == topic + "_static");
    };
    pass.take = [&](const BagTopic& b, std::int64_t, std::string_view data) {
      const std::size_t number = ++numbers[b.name];
      for (const BagPose& p : posesOf(b, data, t.name, number)) {
        const std::string parent = bare(p.frame), child = bare(p.child);
        const bool kept = std::find(chain.begin(), chain.end(), child) != chain.end();
        if (!chain.empty() && !kept) continue;
        const auto [place, fresh] = tree.emplace(child, BagEdge{parent});
        BagEdge& edge = place->second;
        if (edge.parent != parent) {
          throw InputError(t.name, number,
                           fmt::format("the parent of frame '{}' is '{}', and '{}' before", printable(child),
                                       printable(parent), printable(edge.parent)),
                           "one parent for each frame");
        }
        if (!b.name.ends_with("_static")) edge.fixed = false;
        if (kept) {
          edge.samples.emplace_back(p.stamp_ns, poseOf(p.position, p.xyzw, options.reading.norm_tolerance, t, number));
        }
      }
    };
    readBagFile(file, options.reading.largest_file, pass);
  };
  BagPass first;
  collect(first);
  if (tree.empty()) {
    throw InputError(t.name, 0, fmt::format("there are no transforms of '{}' and '{}_static'", topic, topic),
                     "topics of TFMessage");
  }
  // Both ways up to where they meet.
  std::vector<std::string> up = frameAndAncestors(tree, from, t.name), other = frameAndAncestors(tree, to, t.name);
  if (up.back() != other.back()) {
    std::vector<std::string> known;
    for (const auto& [child, edge] : tree) {
      if (known.size() < 30) known.push_back(printable(child));
    }
    throw InputError(t.name, 0, fmt::format("no transforms lead from '{}' to '{}'", printable(from), printable(to)),
                     "frames of one tree, such as " + joined(known, ", "));
  }
  while (up.size() > 1 && other.size() > 1 && up[up.size() - 2] == other[other.size() - 2]) {
    up.pop_back(), other.pop_back();
  }
  up.pop_back(), other.pop_back();
  chain = up, chain.insert(chain.end(), other.begin(), other.end());
  tree.clear();
  BagPass second;
  collect(second);
  t.notes = second.notes;
  const BagEdge* fastest = nullptr;
  for (auto& [child, edge] : tree) {
    std::stable_sort(edge.samples.begin(), edge.samples.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    edge.samples.erase(std::unique(edge.samples.begin(), edge.samples.end(),
                                   [](const auto& a, const auto& b) { return a.first == b.first; }),
                       edge.samples.end());
    if (fastest == nullptr ||
        std::pair(!edge.fixed, edge.samples.size()) > std::pair(!fastest->fixed, fastest->samples.size())) {
      fastest = &edge;
    }
  }
  std::size_t outside = 0;
  std::map<std::string, std::int64_t> gaps;
  const auto climb = [&](const std::vector<std::string>& frames, std::int64_t time, bool& covered) {
    SE3d pose;
    for (const std::string& child : frames) {
      const BagEdge& edge = tree.at(child);
      if (!edge.fixed && (time < edge.samples.front().first || time > edge.samples.back().first)) {
        covered = false;
        return pose;
      }
      std::int64_t gap = 0;
      pose = transformAt(edge, time, gap) * pose;
      gaps[child] = std::max(gaps[child], gap);
    }
    return pose;
  };
  for (const auto& [time, sample] : fastest->samples) {
    bool covered = true;
    const SE3d pose = climb(other, time, covered).inverse() * climb(up, time, covered);
    if (!covered) {
      ++outside;
      continue;
    }
    t.poses.push_back(pose), t.lines.push_back(0), appendStamp(t, time, 0);
  }
  for (const auto& [child, gap] : gaps) {
    if (gap == 0) continue;
    t.notes.push_back(fmt::format("{} -> {} is interpolated, between transforms that are up to {:.3g} s apart",
                                  printable(tree.at(child).parent), printable(child), 1e-9 * static_cast<double>(gap)));
  }
  if (outside > 0) {
    t.notes.push_back(fmt::format("{} of {} stamps are outside of the time of another transform: left out", outside,
                                  fastest->samples.size()));
  }
  if (t.poses.empty())
    throw InputError(t.name, 0, "the transforms of the chain have no time in common", "at least one");
  t.frames = {to, from};
}

// --- Topics -----------------------------------------------------------------------------------------------------------

/// Appends a message; all are to be of the same frames.
void appendBagPose(const BagPose& p, std::int64_t recorded, std::size_t number, const TrajectoryOptions& options,
                   std::size_t& unstamped, Trajectory& t) {
  const std::vector<std::string> frames = {printable(p.frame), printable(p.child)};
  if (number == 1) t.frames = frames;
  if (t.frames != frames) {
    throw InputError(t.name, number,
                     fmt::format("the frames are '{}' and '{}', and '{}' and '{}' before", frames[0], frames[1],
                                 t.frames[0], t.frames[1]),
                     "poses of one frame in one other; a chain of /tf by --frames");
  }
  if (p.stamp_ns == 0) ++unstamped;
  appendStamp(t, p.stamp_ns == 0 ? std::max<std::int64_t>(recorded, 0) : p.stamp_ns, number);
  t.poses.push_back(poseOf(p.position, p.xyzw, options.reading.norm_tolerance, t, number));
  t.lines.push_back(number);
  if (p.covariance.empty()) return;
  std::vector<double> numbers = p.covariance;
  applySentinels(numbers, CovarianceLayout::full36, options.unmeasured, t);
  appendCovariance(t, {}, numbers, number);
}

/// Appends the poses of the last of so many messages; without times where their stamps do not ascend, as those of a
/// plan.
void appendPath(const std::vector<BagPose>& poses, std::size_t messages, const TrajectoryOptions& options,
                Trajectory& t) {
  bool timed = true;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    timed = timed && poses[i].stamp_ns > (i > 0 ? poses[i - 1].stamp_ns : 0);
    std::size_t unstamped = 0;
    appendBagPose(poses[i], 0, i + 1, options, unstamped, t);
  }
  if (!timed) t.times.clear(), t.time_texts = {};
  t.notes.push_back(fmt::format("the poses are those of the last of {} messages{}", messages,
                                timed ? "" : "; their stamps do not ascend, so that they have no times"));
}

void readPoseTopic(const std::string& file, const std::string& topic, const TrajectoryOptions& options, Trajectory& t) {
  BagPass pass;
  bool found = false;
  std::size_t number = 0, unstamped = 0;
  // A path grows from message to message, so that the last one is all of it.
  std::optional<BagTopic> path_topic;
  std::string path;
  pass.wanted = [&](const BagTopic& b) {
    if (b.name != topic) return false;
    if (isTransforms(b)) throw InputError(t.name, 0, "transforms of many frames", "--frames map:base_link with two");
    if (!isPoses(b)) {
      throw InputError(t.name, 0, fmt::format("messages of type {} in {}", printable(b.type), printable(b.encoding)),
                       pose_types);
    }
    return found = true;
  };
  pass.take = [&](const BagTopic& b, std::int64_t recorded, std::string_view data) {
    ++number;
    if (bagTypeOf(b.type) == BagType::path) {
      path_topic = b, path = data;
      return;
    }
    appendBagPose(posesOf(b, data, t.name, number).front(), recorded, number, options, unstamped, t);
  };
  readBagFile(file, options.reading.largest_file, pass);
  if (!found) requireBagTopic(t.name, topic, pass.topics);
  t.notes = pass.notes;
  if (path_topic) appendPath(posesOf(*path_topic, path, t.name, number), number, options, t);
  if (unstamped > 0) t.notes.push_back(fmt::format("{} messages have no stamp: when they were recorded", unstamped));
  const auto unknown = [](const Matrix6d& C) { return C.array().isNaN().all(); };
  if (std::all_of(t.covariances.begin(), t.covariances.end(), unknown)) {
    if (t.hasCovariances()) t.notes.emplace_back("no message has a covariance: zeros, -1 or NaN throughout");
    t.covariances.clear();
  }
  if (t.hasCovariances()) t.covariance_source = t.name;
  if (t.frames.size() == 2 && t.frames[1].empty()) t.frames.pop_back();
}

}  // namespace

void requireBagTopic(const std::string& name, const std::string& topic, const std::vector<BagTopic>& topics) {
  std::vector<std::string> known;
  for (const BagTopic& b : topics) {
    if (known.size() < 30) known.push_back(printable(b.name));
  }
  std::sort(known.begin(), known.end());
  throw InputError(name, 0, fmt::format("there is no topic '{}'", printable(topic)),
                   known.empty() ? "a bag with topics" : "one of " + joined(known, ", "));
}

Trajectory readBagTrajectory(const std::string& path, const TrajectoryOptions& options) {
  auto [file, topic] = bagPath(path);
  Trajectory t;
  t.name = sourceName(path), t.format = "bag", t.stamp_decimals = 9;
  if (!options.reading.frames.empty() && (topic.empty() || topic.ends_with("/tf"))) {
    readChain(file, topic.empty() ? "/tf" : topic, options, t);
    return t;
  }
  std::string chosen;
  if (topic.empty()) {
    std::vector<std::string> candidates;
    for (const BagTopic& b : listBag(file, options.reading.largest_file).topics) {
      if (!isPoses(b) || b.messages == 0) continue;
      candidates.push_back(b.name);
      if (!isTransforms(b)) chosen += (chosen.empty() ? "" : "\n") + b.name;
    }
    if (chosen.empty() || chosen.find('\n') != std::string::npos) {
      throw InputError(t.name, 0, fmt::format("{} topics of poses", candidates.size()),
                       candidates.empty()
                           ? std::string("messages of type ") + pose_types
                           : "one of them after a colon, or --frames map:base_link: " + joined(candidates, ", "));
    }
    topic = chosen, t.name += ":" + chosen;
  }
  readPoseTopic(file, topic, options, t);
  if (t.poses.empty()) throw InputError(t.name, 0, "the topic has no messages, or its path no poses", "at least one");
  if (!chosen.empty()) t.notes.push_back("the poses are those of " + chosen);
  return t;
}

void readBag(const TrajectorySource&, Trajectory& trajectory) {
  throw InputError(trajectory.name, 0, "this is no bag", "a file .bag, .db3 or .mcap, no pipe");
}

}  // namespace liestat::detail
