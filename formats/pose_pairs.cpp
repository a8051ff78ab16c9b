#include <formats/pose_pairs.hpp>
#include <fusion/nearest_in_time.hpp>

#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace liestat {
namespace {

FeatureFile readPoses(const std::string& path, const ReadingOptions& options) {
  FeatureFile file = readFeatureFile(path, options);
  if (file.kind == Feature::frame) return file;
  throw InputError(sourceName(path), file.lines.front(), fmt::format("the file has {}", info(file.kind).plural),
                   "poses: a translation beside each rotation (TUM, KITTI, EuRoC, or the columns tx,ty,tz of a CSV)");
}

/// Times in ascending order, with the rows that they belong to.
class TimeLine {
 public:
  /// A row that repeats another, as logs of transformations have them, stands for both.
  TimeLine(const FeatureFile& file, const std::string& name) : rows_(file.size()) {
    std::iota(rows_.begin(), rows_.end(), std::size_t{0});
    std::sort(rows_.begin(), rows_.end(),
              [&](std::size_t i, std::size_t j) { return std::pair(file.times[i], i) < std::pair(file.times[j], j); });
    const auto repeats = [&](std::size_t i, std::size_t j) {
      return file.times[i] == file.times[j] && file.positions[i] == file.positions[j] &&
             file.rotations[i].coeffs() == file.rotations[j].coeffs() &&
             (file.covariances.empty() || file.covariances[i] == file.covariances[j]);
    };
    rows_.erase(std::unique(rows_.begin(), rows_.end(), repeats), rows_.end());
    for (const std::size_t row : rows_) times_.push_back(file.times[row]);
    for (std::size_t k = 1; k < rows_.size(); ++k) {
      if (time(k) == time(k - 1)) {
        throw InputError(name, file.lines[rows_[k]],
                         fmt::format("the time {:.10g} stands in line {} too", time(k), file.lines[rows_[k - 1]]),
                         "each time once, or --by-row");
      }
    }
  }

  std::size_t size() const { return rows_.size(); }
  double time(std::size_t k) const { return times_[k]; }
  std::size_t row(std::size_t k) const { return rows_[k]; }
  std::string interval() const { return fmt::format("{:.10g} to {:.10g} s", time(0), time(size() - 1)); }
  bool meets(const TimeLine& other, double tolerance) const {
    return time(0) <= other.time(other.size() - 1) + tolerance && other.time(0) <= time(size() - 1) + tolerance;
  }
  /// The place of the nearest time.
  std::size_t nearest(double t) const { return nearestInTime(times_, t); }

 private:
  std::vector<double> times_;
  std::vector<std::size_t> rows_;
};

void associateByTime(PosePairs& pairs, const std::string& name_a, const std::string& name_b, double tolerance) {
  const TimeLine a(pairs.a, name_a), b(pairs.b, name_b);
  if (!a.meets(b, tolerance)) {
    throw InputError(name_a, 0,
                     fmt::format("its times, {}, do not overlap those of {}, {}", a.interval(), name_b, b.interval()),
                     "times of one clock, or --by-row");
  }
  for (std::size_t k = 0; k < a.size(); ++k) {
    const std::size_t m = b.nearest(a.time(k));
    const double gap = std::abs(a.time(k) - b.time(m));
    if (!(gap <= tolerance) || a.nearest(b.time(m)) != k) continue;
    pairs.largest_gap = std::max(pairs.largest_gap, gap);
    pairs.rows.push_back({a.row(k), b.row(m), pairs.a.lines[a.row(k)], pairs.b.lines[b.row(m)], a.time(k)});
  }
  pairs.unmatched_a = pairs.a.size() - pairs.rows.size();
  pairs.unmatched_b = pairs.b.size() - pairs.rows.size();
}

std::string countOf(const FeatureFile& file, const std::string& name) {
  return fmt::format("{} {} in {}", file.size(), file.size() == 1 ? "pose" : "poses", name);
}

/// A pair is a pair of whole poses.
void requireMeasured(const FeatureFile& file, const std::string& name) {
  if (file.unmeasured.empty()) return;
  throw InputError(
      name, file.lines[file.unmeasured.front()],
      fmt::format("a variance of -1 or of {:g} and more says that the rotation was not measured", unmeasured_variance),
      "covariances of whole poses");
}

}  // namespace

PosePairs readPosePairs(const std::string& path_a, const std::string& path_b, const PosePairOptions& options) {
  if (path_a == "-" && path_b == "-") {
    throw InputError(sourceName(path_a), 0, "both files are standard input", "a file for one");
  }
  return readPosePairs(path_a, readPoses(path_b, options.reading), sourceName(path_b), options);
}

PosePairs readPosePairs(const std::string& path_a, FeatureFile b, const std::string& name_b,
                        const PosePairOptions& options) {
  const std::string name_a = sourceName(path_a);
  PosePairs pairs;
  pairs.a = readPoses(path_a, options.reading), pairs.b = std::move(b);
  requireMeasured(pairs.a, name_a), requireMeasured(pairs.b, name_b);
  pairs.by_time = !options.by_row && !pairs.a.times.empty() && !pairs.b.times.empty();
  const std::string at_least = fmt::format("at least {}", options.least);
  if (pairs.by_time) {
    associateByTime(pairs, name_a, name_b, options.tolerance);
    if (pairs.rows.size() < options.least) {
      throw InputError(name_a, 0,
                       fmt::format("{} pairs with times within {:g} s ({}, {})", pairs.rows.size(), options.tolerance,
                                   countOf(pairs.a, name_a), countOf(pairs.b, name_b)),
                       at_least + ", by a larger --tolerance or --by-row");
    }
    return pairs;
  }
  if (pairs.a.size() != pairs.b.size()) {
    throw InputError(name_a, 0, countOf(pairs.a, name_a) + ", " + countOf(pairs.b, name_b),
                     "as many in each, since rows belong together; times in both files (a column t, or TUM) are "
                     "another way");
  }
  for (std::size_t i = 0; i < pairs.a.size(); ++i) {
    pairs.rows.push_back({i, i, pairs.a.lines[i], pairs.b.lines[i], std::nullopt});
    if (!pairs.a.times.empty()) pairs.rows.back().time = pairs.a.times[i];
  }
  if (pairs.rows.size() < options.least) {
    throw InputError(name_a, 0, fmt::format("{}, {}", countOf(pairs.a, name_a), countOf(pairs.b, name_b)), at_least);
  }
  return pairs;
}

}  // namespace liestat
