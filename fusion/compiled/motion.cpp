// Recursive motion from point tracks, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/motion/detail/motion_engine_run.hpp>
#include <fusion/motion/detail/motion_filter_run.hpp>
#include <fusion/motion/detail/motion_gyroscope.hpp>
#include <fusion/motion/detail/motion_sequence.hpp>
#include <fusion/motion/detail/motion_study.hpp>
