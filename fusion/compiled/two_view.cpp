// The motion between two images, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/two_view/detail/estimate_two_view_motion.hpp>
#include <fusion/two_view/detail/physical_parameters.hpp>
#include <fusion/two_view/detail/two_view_results.hpp>
