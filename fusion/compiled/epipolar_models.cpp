// Two-view models of epipolar geometries, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/two_view/detail/epipolar_models.hpp>
