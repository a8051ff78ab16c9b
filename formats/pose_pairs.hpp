// Two files of poses whose rows belong together, by their times or by their order.
#pragma once

#include <formats/features.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// Options of readPosePairs().
struct PosePairOptions {
  ReadingOptions reading = {};  ///< how both files are read
  bool by_row = false;          ///< also where both files have times
  double tolerance = 0.01;      ///< s, between times that belong together
  std::size_t least = 3;        ///< pairs
};

/// A row of each file.
struct PoseRows {
  std::size_t a = 0, b = 0;            ///< from 0
  std::size_t line_a = 0, line_b = 0;  ///< in the files
  std::optional<double> time;          ///< time stamp of the first file's row (s)
};

/// Two files of frames, and the rows of them that belong together.
struct PosePairs {
  FeatureFile a, b;
  std::vector<PoseRows> rows;  ///< by time, or in the order of the files
  bool by_time = false;
  double largest_gap = 0;                        ///< s, between the times of a pair
  std::size_t unmatched_a = 0, unmatched_b = 0;  ///< rows without a partner
};

/// Reads two files of frames. Where both have times, rows whose times are nearest to each other in both directions and
/// within the tolerance are pairs; else row i belongs to row i. Throws InputError: a file of something else than poses,
/// different lengths, a time that appears twice with different poses, times that do not overlap, too few pairs.
PosePairs readPosePairs(const std::string& path_a, const std::string& path_b, const PosePairOptions& options);
/// The same where the second list of poses is no file; `name_b` stands for it in messages.
PosePairs readPosePairs(const std::string& path_a, FeatureFile b, const std::string& name_b,
                        const PosePairOptions& options);

}  // namespace liestat
