// Hand-eye calibration, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/hand_eye/detail/estimate_hand_eye.hpp>
#include <fusion/hand_eye/detail/hand_eye_results.hpp>
