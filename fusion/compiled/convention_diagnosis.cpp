// Diagnosis of conventions, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/trajectories/detail/diagnose_runs.hpp>
#include <fusion/trajectories/detail/diagnosis_words.hpp>
