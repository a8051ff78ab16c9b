// The view of `liestat motion`: the motion of each frame, its standard deviations, flags, and errors against a truth.
#pragma once

#include <fusion/motion/results.hpp>
#include <fusion/motion/study_types.hpp>

#include <string>

namespace liestat::cli {

/// Verdict, a table of at most twenty frames, and the medians of the errors where the truth is known.
std::string formatMotion(const MotionResult& result);

/// A line per frame.
std::string motionCsv(const MotionResult& result);

/// The page: the figures of Soatto and Perona 1994, 2 to 13, for a sequence of tracks. Throws InputError where the
/// directory cannot be written.
void writeMotionReport(const std::string& directory, const std::string& command_line, const MotionResult& result,
                       const MotionFrameStudy& study);

}  // namespace liestat::cli
