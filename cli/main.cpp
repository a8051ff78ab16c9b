#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include <cli/commands/commands.hpp>
#include <cli/io/input_error.hpp>
#include <cli/show/json.hpp>

namespace {

using namespace liestat::cli;

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
  addMeanCommand(app, invocation);
  addPreintegrateCommand(app, invocation);
  addViInitCommand(app, invocation);
  CLI::App* simulate = app.add_subcommand("simulate", "Files of simulated measurements with their truth");
  simulate->require_subcommand(1);
  addSimulateViCommand(*simulate, invocation);
  CLI::App* validate = app.add_subcommand("validate", "Does an estimator keep what its covariance promises?");
  validate->require_subcommand(1);
  addValidateMeansCommand(*validate, invocation);
  addValidatePreintegrationCommand(*validate, invocation);
  addValidatePropagationCommand(*validate, invocation);
  addValidateSplitCommand(*validate, invocation);
  addValidateViInitCommand(*validate, invocation);
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
