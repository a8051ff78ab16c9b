#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include <cli/commands/commands.hpp>
#include <cli/io/input_error.hpp>
#include <cli/show/json.hpp>

namespace {

using namespace liestat::cli;

using AddCommand = void (*)(CLI::App& parent, Invocation& invocation);

/// Commands that begin with the same word; those of the first group stand by themselves.
struct Group {
  const char* name;
  const char* description;
  std::vector<AddCommand> commands;
};

/// All commands, in the order in which the help lists them.
const Group groups[] = {
    {"", "", {addMeanCommand, addPreintegrateCommand, addViInitCommand}},
    {"simulate", "Files of simulated measurements with their truth", {addSimulateViCommand}},
    {"validate",
     "Does an estimator keep what its covariance promises?",
     {addValidateMeansCommand, addValidatePreintegrationCommand, addValidatePropagationCommand, addValidateSplitCommand,
      addValidateViInitCommand}},
};

int complain(const std::string& message) {
  std::fputs((message + "\n").c_str(), stderr);
  return exit_bad_input;
}

int run(int argc, char** argv) {
  Invocation invocation;
  invocation.command_line = commandLine(argc, argv);
  CLI::App app("Statistics of rotations, poses and other geometric features, with their uncertainty.", "liestat");
  app.set_version_flag("--version", "liestat " + std::string(programVersion()));
  app.require_subcommand(1);
  for (const Group& group : groups) {
    CLI::App* parent = &app;
    if (*group.name != '\0') {
      parent = app.add_subcommand(group.name, group.description);
      parent->require_subcommand(1);
    }
    for (const AddCommand add : group.commands) add(*parent, invocation);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version end the parsing too.
    if (error.get_exit_code() == 0) return app.exit(error);
    return complain("liestat: " + printable(error.what(), 1000) + " (liestat --help explains the usage)");
  }
  return invocation.run();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const liestat::cli::InputError& error) {
    return complain(error.what());
  } catch (const std::bad_alloc&) {
    return complain("liestat: not enough memory");
  } catch (const std::exception& error) {
    return complain(std::string("liestat: internal error: ") + error.what());
  }
}
