// Initialisations against a truth, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/compare_with_truth.hpp>
#include <fusion/detail/initialisation_summary.hpp>
