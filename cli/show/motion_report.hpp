// The page of `liestat motion --report`: the figures of Soatto and Perona 1994, 2 to 13, for a sequence of tracks.
#pragma once

#include <cli/show/motion.hpp>
#include <fusion/motion/types.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat::cli {

/// The pairs of one frame, the track of each, and what the filter made of them.
struct MotionPairs {
  std::size_t frame = 0;
  MotionEstimate motion;
  std::vector<PointPair> pairs;
  std::vector<std::uint64_t> tracks;
};

/// The frames that the figures of one moment are made of: the last sixty up to the one that is looked at.
class MotionWindow {
 public:
  static constexpr std::size_t last_frame = std::numeric_limits<std::size_t>::max(), most_frames = 60;

  /// Looks at the frame of this number, or at the last one.
  explicit MotionWindow(std::size_t looked_at = last_frame) : looked_at_(looked_at) {}

  /// The next frame; one whose number is not larger begins anew.
  void add(std::size_t frame, std::span<const PointPair> pairs, std::span<const std::uint64_t> tracks,
           const MotionEstimate& motion);
  std::span<const MotionPairs> frames() const { return frames_; }
  std::size_t looked_at() const { return looked_at_; }
  /// True once the frame that is looked at has come.
  bool has_looked_at() const {
    return !frames_.empty() && (looked_at_ == last_frame || frames_.back().frame == looked_at_);
  }

 private:
  std::size_t looked_at_, newest_ = 0;
  std::vector<MotionPairs> frames_;
};

/// Throws InputError where the directory cannot be written, or the window has not seen the frame that it looks at. Its
/// frames are among those of the result.
void writeMotionReport(const std::string& directory, const std::string& command_line, const MotionResult& result,
                       const MotionWindow& window, const MotionFilterOptions& options);

}  // namespace liestat::cli
