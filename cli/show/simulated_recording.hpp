#pragma once

#include <experiments/simulate_vi.hpp>

#include <string>

namespace liestat::cli {

/// The simulated recording of `liestat simulate vi` and the files it was written to, in lines for the terminal.
/// `as_recorded`: the readings are not simulated.
std::string formatSimulatedRecording(const experiments::SimulatedRecording& recording,
                                     const experiments::ViSceneOptions& scene, bool as_recorded,
                                     const std::string& directory);

/// The command line that initialises from the files of writeRecording.
std::string nextCommand(const std::string& directory);

}  // namespace liestat::cli
