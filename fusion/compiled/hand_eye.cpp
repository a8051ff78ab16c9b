// Hand-eye calibration, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/estimate_hand_eye.hpp>
#include <fusion/detail/hand_eye_results.hpp>
