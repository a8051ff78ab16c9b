// Refinement, the fusion of windows and the run over a recording, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/closed_form_states.hpp>
#include <fusion/detail/fuse_windows.hpp>
#include <fusion/detail/initialise_recording.hpp>
#include <fusion/detail/refine.hpp>
