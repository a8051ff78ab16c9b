// The view of `liestat motion`: the motion of each frame, its standard deviations, flags, and errors against a truth.
#pragma once

#include <fusion/motion/results.hpp>

#include <string>

namespace liestat::cli {

/// Verdict, a table of at most twenty frames, and the medians of the errors where the truth is known.
std::string formatMotion(const MotionResult& result);

/// A line per frame.
std::string motionCsv(const MotionResult& result);

}  // namespace liestat::cli
