// The calibration of the inertial sensor's noise, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/init/detail/calibrate_noise.hpp>
