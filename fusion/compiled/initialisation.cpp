// The estimators of a window's motion and biases, compiled once. Add the files of fusion/compiled/ to your own target and
// define LIESTAT_COMPILED_FUSION for all of its units: their headers then declare the estimators only.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/init/detail/estimate_epipolar_gyroscope_bias.hpp>
#include <fusion/init/detail/estimate_gyroscope_bias.hpp>
#include <fusion/imu/detail/inertial_window.hpp>
#include <fusion/init/detail/initialise_robustly.hpp>
#include <fusion/init/detail/solve_closed_form.hpp>
#include <fusion/init/detail/solve_closed_form_robustly.hpp>
