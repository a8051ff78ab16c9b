// The motion between two images, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/estimate_two_view_motion.hpp>
#include <fusion/detail/physical_parameters.hpp>
#include <fusion/detail/two_view_results.hpp>
