#pragma once

#include <string>

#include <cli/commands/vi_init_result.hpp>

namespace liestat::cli {

/// A line a window, what stretches of them say together, and a summary; for the terminal.
std::string viInitTable(const ViRecording& recording, const ViInitResult& result);

/// A page with the trajectory, gravity, scale and biases over the windows, and the two solutions where there are two.
void writeViInitReport(const std::string& directory, const std::string& command_line, const ViRecording& recording,
                       const ViInitResult& result);

}  // namespace liestat::cli
