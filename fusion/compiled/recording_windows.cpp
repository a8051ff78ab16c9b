// Windows of an inertial recording, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/preintegrate_windows.hpp>
#include <fusion/detail/recording_windows_verdict.hpp>
