#pragma once

#include <string>

namespace CLI {
class App;
}

namespace liestat::cli {

/// The program's page for man(1), in roff: every command with its arguments and options, and the exit codes.
std::string manualPage(const CLI::App& app, const std::string& version);

/// A script for bash that completes commands, options and the values of enumerations; files where nothing else fits.
std::string bashCompletion(const CLI::App& app);

}  // namespace liestat::cli
