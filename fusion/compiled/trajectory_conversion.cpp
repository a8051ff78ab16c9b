// Conversion of the covariances of trajectories, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/trajectories/detail/convert_trajectory.hpp>
