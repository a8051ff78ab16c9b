// Windows of an inertial recording, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/imu/detail/preintegrate_windows.hpp>
#include <fusion/imu/detail/recording_windows_verdict.hpp>
