// Windows of an inertial recording, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/detail/preintegrate_windows.hpp>
#include <fusion/detail/recording_windows_verdict.hpp>
