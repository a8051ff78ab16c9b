// Faults of whole trajectories, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/trajectories/detail/find_misfit.hpp>
#include <fusion/trajectories/detail/misfit_times.hpp>
