// Recursive motion from point tracks, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/motion_engine_run.hpp>
#include <fusion/detail/motion_filter_run.hpp>
#include <fusion/detail/motion_gyroscope.hpp>
#include <fusion/detail/motion_sequence.hpp>
#include <fusion/detail/motion_study.hpp>
