// Evaluation of a trajectory, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/trajectories/detail/evaluate_trajectory.hpp>
