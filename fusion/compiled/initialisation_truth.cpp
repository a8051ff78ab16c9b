// Initialisations against a truth, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/init/detail/compare_with_truth.hpp>
#include <fusion/init/detail/initialisation_summary.hpp>
