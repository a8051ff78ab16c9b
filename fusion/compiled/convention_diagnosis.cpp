// Diagnosis of conventions, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_TRAJECTORIES
#define LIESTAT_COMPILED_TRAJECTORIES
#endif

#include <fusion/detail/diagnose_conventions.hpp>
#include <fusion/detail/diagnosis_words.hpp>
