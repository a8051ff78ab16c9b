// Robust estimates of one two-view model, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/two_view/detail/robust_two_view.hpp>
