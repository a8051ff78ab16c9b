// The page of `liestat motion --report`: the figures of Soatto and Perona 1994, 2 to 13, for a sequence of tracks.
#pragma once

#include <cli/show/motion.hpp>
#include <fusion/motion/study_types.hpp>

#include <string>

namespace liestat::cli {

/// Throws InputError where the directory cannot be written.
void writeMotionReport(const std::string& directory, const std::string& command_line, const MotionResult& result,
                       const MotionFrameStudy& study);

}  // namespace liestat::cli
