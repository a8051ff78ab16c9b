// Two-view models whose parameter is a pose, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/two_view/detail/pose_models.hpp>
