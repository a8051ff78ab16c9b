#pragma once

#include <stats/words.hpp>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace liestat::cli {

/// The exit code of the program.
enum ExitCode : int {
  exit_fine = 0,
  exit_validation_failed = 1,
  exit_bad_input = 2,      ///< bad usage or bad input
  exit_not_trusted = 3,    ///< the estimate exists but is not to be trusted
  exit_undecidable = 4,    ///< doctor: several conventions explain the errors
  exit_inconsistent = 5,   ///< doctor: the errors do not follow the covariances, or no convention explains them
  exit_interrupted = 130,  ///< an interrupt stopped the command; what was computed is written
};

/// The circumstances of a command's run, besides its options.
struct Invocation {
  std::string command_line;  ///< as one could type it again
  /// The command, and each option that was given as name=value[,value…], in order of the names.
  std::vector<std::string> options = {};
};

// The parser of the command line behind a wall: CLI11's headers would cost each command five seconds of compile time, and
// what holds for all options of a kind is stated once, in command_line.cpp.

/// An option that was declared; the calls below say what it takes and can be chained.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option required() const;
  /// Values between two bounds, both included. T: double, int, or an unsigned integer.
  template <class T>
  Option range(T least, T most) const;
  Option positive() const;
  Option notNegative() const;
  Option oneOf(const std::vector<std::string>& values) const;
  Option oneOfNumbers(const std::vector<double>& values) const;
  /// Values between commas, any number of them or between two bounds.
  Option list() const;
  Option list(int least, int most) const;
  /// May not be given together with another.
  Option excludes(const std::string& other) const;
  Option excludes(const Option& other) const;

 private:
  CLI::Option* option_;
};

/// A command that is being declared.
class Command {
 public:
  using Run = std::function<int(const Invocation&)>;

  Command(CLI::App* app, std::shared_ptr<Run> chosen) : app_(app), chosen_(std::move(chosen)) {}

  /// An option whose value goes to a variable, which must outlive the parsing. T: double, int, an unsigned integer,
  /// std::string, std::optional<double>, or a vector of double, of std::size_t or of std::string.
  template <class T>
  Option option(const std::string& name, T& value, const std::string& description) const;
  /// An option without a value.
  Option flag(const std::string& name, bool& value, const std::string& description) const;
  /// An option that names one of the values of an enumeration.
  template <class Enum>
  Option choice(const std::string& name, Enum& value, const std::map<std::string, Enum>& values,
                const std::string& description) const {
    std::vector<std::string> names;
    for (const auto& [word, meaning] : values) names.push_back(word);
    return word(
        name, names, [&value, values](const std::string& given) { value = values.at(given); }, description);
  }
  /// The same of an enumeration with words, or of an optional one.
  template <Worded Enum>
  Option choice(const std::string& name, Enum& value, const std::string& description) const {
    return word(
        name, wordsOf<Enum>(), [&value](const std::string& given) { value = *named<Enum>(given); }, description);
  }
  template <Worded Enum>
  Option choice(const std::string& name, std::optional<Enum>& value, const std::string& description) const {
    return word(
        name, wordsOf<Enum>(), [&value](const std::string& given) { value = named<Enum>(given); }, description);
  }
  /// The same of some values of an enumeration, in this order; nothing where the option is not given.
  template <class Enum>
  Option choice(const std::string& name, std::optional<Enum>& value,
                const std::vector<std::pair<std::string, Enum>>& values, const std::string& description) const {
    std::vector<std::string> names;
    for (const auto& [word, meaning] : values) names.push_back(word);
    return word(
        name, names,
        [&value, values](const std::string& given) {
          for (const auto& [word, meaning] : values) {
            if (word == given) value = meaning;
          }
        },
        description);
  }
  /// The work: returns the exit code, and may throw InputError or OptionError.
  void run(Run work) const;

 private:
  template <Worded Enum>
  static std::vector<std::string> wordsOf() {
    const auto all = words(Enum{});
    return {all.begin(), all.end()};
  }
  Option word(const std::string& name, const std::vector<std::string>& words,
              std::function<void(const std::string&)> take, const std::string& description) const;

  CLI::App* app_;
  std::shared_ptr<Run> chosen_;
};

/// The place to which commands are added: the program itself, or a word that several of them begin with.
class CommandList {
 public:
  CommandList(CLI::App* app, std::shared_ptr<Command::Run> chosen) : app_(app), chosen_(std::move(chosen)) {}
  Command add(const std::string& name, const std::string& description) const;

 private:
  CLI::App* app_;
  std::shared_ptr<Command::Run> chosen_;
};

/// Commands that begin with the same word; those of a group without a name stand by themselves.
struct CommandGroup {
  std::string name, description;
  std::vector<void (*)(const CommandList&)> commands;
};

/// The whole program: parses the command line, runs the command that was asked for and returns its exit code. Errors are
/// a line on standard error.
int runCommandLine(int argc, char** argv, const std::vector<CommandGroup>& groups);

}  // namespace liestat::cli
