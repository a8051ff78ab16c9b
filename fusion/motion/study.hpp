// The figures of one frame of a sequence: residuals, runs of the filters, structure (fusion/motion/study_types.hpp).
//
//   liestat::MotionWindow window;                          // or window(25)
//   … estimateMotion(frames, options, gyroscope, [&](const MotionFrame& frame, const MotionFilter& filter) {
//       window.add(frame.frame, filter.pairs(), filter.tracks(), filter.stepEstimate());
//     });
//   if (window.has_looked_at()) … studyFrame(window, result)
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/motion/results.hpp>
#include <fusion/motion/study_types.hpp>

namespace liestat {

/// The window has seen the frame that it looks at, which is one of the result's.
LIESTAT_FUSION_API MotionFrameStudy studyFrame(const MotionWindow& window, const MotionResult& result);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/motion/detail/motion_study.hpp>
#endif
