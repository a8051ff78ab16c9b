// Refinement, the fusion of windows, the run over a recording and a filter's start, compiled once; see
// initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/init/detail/closed_form_states.hpp>
#include <fusion/init/detail/fuse_windows.hpp>
#include <fusion/init/detail/initialise_recording.hpp>
#include <fusion/init/detail/refine.hpp>
#include <fusion/init/detail/start_filter.hpp>
