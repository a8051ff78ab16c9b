#include <cli/commands/command_line.hpp>

#include <cli/commands/self_description.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/json.hpp>
#include <lie/instruction_set.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <type_traits>

namespace liestat::cli {
namespace {

/// Refuses what the conversion to a number would take and nobody means: NaN, which passes every comparison with a
/// bound, and a sign before an unsigned number, which wraps.
template <class T>
CLI::Validator meantAsNumber() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        if constexpr (std::is_unsigned_v<T>) {
          if (!text.empty() && text.front() == '-') return printable(text) + " is negative";
        }
        double number = 0;
        if (CLI::detail::lexical_cast(text, number) && std::isnan(number)) return printable(text) + " is not a number";
        return {};
      },
      std::string());
}

/// The number of an option, or of each element of a list; void for words.
template <class T>
struct NumberOf {
  using type = std::conditional_t<std::is_arithmetic_v<T>, T, void>;
};
template <class T>
struct NumberOf<std::vector<T>> : NumberOf<T> {};
template <class T>
struct NumberOf<std::optional<T>> : NumberOf<T> {};

/// ", did you mean …?" with the word that is nearest to what was typed, or nothing where none is near.
std::string nearest(std::string_view typed, const std::vector<std::string>& words) {
  // A text longer than any word is near none, and the distance takes the product of the lengths.
  if (typed.size() > 40) return {};
  const auto begun = std::find_if(words.begin(), words.end(), [&](const std::string& word) {
    return typed.find_first_not_of('-') != std::string_view::npos && word.starts_with(typed);
  });
  const std::string best = begun != words.end() ? *begun : nearestName(typed, words);
  return best.empty() ? best : fmt::format(", did you mean {}?", best);
}

}  // namespace

Option Option::required() const {
  option_->required();
  return *this;
}
namespace {
/// A check whose own message would name the largest double, with all of its digits.
CLI::Validator inWords(const CLI::Validator& check, const char* fault) {
  return CLI::Validator(
      [check, fault](std::string text) {
        return check(text).empty() ? std::string() : fmt::format("{} {}", printable(text), fault);
      },
      check.get_description());
}
}  // namespace

template <class T>
Option Option::range(T least, T most) const {
  const CLI::Validator range = CLI::Range(least, most);
  option_->check(CLI::Validator(
      [range, least, most](std::string text) {
        return range(text).empty() ? std::string()
                                   : fmt::format("{} is not between {} and {}", printable(text), least, most);
      },
      range.get_description()));
  return *this;
}
Option Option::positive() const {
  option_->check(inWords(CLI::PositiveNumber, "is not a finite positive number"));
  return *this;
}
Option Option::notNegative() const {
  option_->check(inWords(CLI::NonNegativeNumber, "is negative or not finite"));
  return *this;
}
Option Option::oneOf(const std::vector<std::string>& values) const {
  option_->check(CLI::IsMember(values));
  return *this;
}
Option Option::oneOfNumbers(const std::vector<double>& values) const {
  option_->check(CLI::IsMember(values));
  return *this;
}
Option Option::list() const {
  option_->delimiter(',');
  return *this;
}
Option Option::list(int least, int most) const {
  option_->delimiter(',')->expected(least, most);
  return *this;
}
Option Option::excludes(const std::string& other) const {
  option_->excludes(other);
  return *this;
}
Option Option::excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}

template Option Option::range(int, int) const;
template Option Option::range(double, double) const;
template Option Option::range(unsigned long, unsigned long) const;
template Option Option::range(unsigned long long, unsigned long long) const;

template <class T>
Option Command::option(const std::string& name, T& value, const std::string& description) const {
  CLI::Option* option = app_->add_option(name, value, description);
  using Number = typename NumberOf<T>::type;
  if constexpr (!std::is_void_v<Number>) option->check(meantAsNumber<Number>());
  // A page is several files, so it cannot be standard output, which is what - means to the options of files.
  if (name == "--report") {
    option->check(CLI::Validator(
        [](const std::string& text) {
          return text == "-" ? std::string("- is standard output; a directory is expected") : std::string();
        },
        std::string()));
  }
  return Option(option);
}
template Option Command::option(const std::string&, int&, const std::string&) const;
template Option Command::option(const std::string&, double&, const std::string&) const;
template Option Command::option(const std::string&, unsigned long&, const std::string&) const;
template Option Command::option(const std::string&, unsigned long long&, const std::string&) const;
template Option Command::option(const std::string&, std::string&, const std::string&) const;
template Option Command::option(const std::string&, std::optional<double>&, const std::string&) const;
template Option Command::option(const std::string&, std::vector<double>&, const std::string&) const;
template Option Command::option(const std::string&, std::vector<std::size_t>&, const std::string&) const;
template Option Command::option(const std::string&, std::vector<std::string>&, const std::string&) const;

Option Command::flag(const std::string& name, bool& value, const std::string& description) const {
  return Option(app_->add_flag(name, value, description));
}
Option Command::word(const std::string& name, const std::vector<std::string>& words,
                     std::function<void(const std::string&)> take, const std::string& description) const {
  return Option(app_->add_option_function<std::string>(name, take, description)->check(CLI::IsMember(words)));
}
void Command::run(Run work) const {
  app_->callback([chosen = chosen_, work = std::move(work)] { *chosen = work; });
}

Command CommandList::add(const std::string& name, const std::string& description) const {
  return {app_->add_subcommand(name, description), chosen_};
}

namespace {

int complain(const std::string& message) {
  std::fputs((printableLines(message) + "\n").c_str(), stderr);
  return exit_bad_input;
}

/// The complaint where mpirun or srun started several tasks, of which each would do all of the work; empty if they did
/// not, or the command line says which part of it is this task's. A batch script of Slurm is no such task, and has
/// SLURM_NTASKS alone.
std::string faultOfTasks(int argc, char** argv) {
  const bool is_part = std::any_of(argv, argv + argc, [](const char* word) {
    return std::string_view(word) == "--part" || std::string_view(word).starts_with("--part=");
  });
  if (is_part) return {};
  for (const char* const variable : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"}) {
    const char* const value = std::getenv(variable);
    double tasks = 0;
    if (value == nullptr || parseNumber(value, tasks) != NumberKind::finite || tasks < 2) continue;
    return fmt::format(
        "liestat: started as {} tasks of mpirun or srun ({}), each of which would do all of the work: start one, or "
        "give each its share of a validation by --part; MPI is of the headers (env -u {} where each task has work of "
        "its "
        "own)",
        printable(value), variable, variable);
  }
  return {};
}

/// The complaint where the first words of the command line are no command: the word, the nearest command and all of
/// them.
std::string faultOfCommand(int argc, char** argv, const CLI::App& app) {
  const CLI::App* parent = &app;
  std::string before;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::vector<std::string> names;
    for (const CLI::App* command : parent->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(command->get_name());
    }
    // A command's own arguments, and options such as --help, are the parser's.
    if (names.empty() || word.starts_with('-')) return {};
    if (std::find(names.begin(), names.end(), word) == names.end()) {
      const std::string near = nearest(word, names);
      return fmt::format("{} is no {}command{} Commands: {}", printable(word), before, near.empty() ? "." : near,
                         fmt::join(names, ", "));
    }
    parent = parent->get_subcommand(word);
    before += word + " ";
  }
  return {};
}

/// The option that an unknown one may have been meant to be, for the command that was given.
std::string nearestOption(const CLI::ExtrasError& error, const CLI::App& app) {
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  const std::string_view message = error.what();
  const std::size_t begin = message.find("--");
  if (begin == std::string_view::npos) return {};
  const std::string typed(message.substr(begin, message.find_first_of("= ,]", begin) - begin));
  std::vector<std::string> names;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return nearest(typed, names);
}

/// Invocation::options.
std::vector<std::string> givenOptions(const CLI::App& app) {
  const CLI::App* command = &app;
  std::string name;
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += (name.empty() ? "" : " ") + command->get_name();
  }
  std::vector<std::string> given;
  for (const CLI::Option* option : command->get_options()) {
    if (option->count() > 0)
      given.push_back(fmt::format("{}={}", option->get_name(), fmt::join(option->results(), ",")));
  }
  std::sort(given.begin(), given.end());
  given.insert(given.begin(), name);
  return given;
}

int parseAndRun(int argc, char** argv, const std::vector<CommandGroup>& groups) {
  CLI::App app("Statistics of rotations, poses and other geometric features, with their uncertainty.", "liestat");
  app.set_version_flag("--version", "liestat " + std::string(programVersion()));
  // Declared for the help; they are looked at before the parser, which would miss a command.
  bool alone = false;
  app.add_flag("--man", alone, "Write the manual page (liestat --man | man -l -)");
  app.add_flag("--completion", alone, "Write the completion for bash (source <(liestat --completion))");
  app.require_subcommand(1);
  const auto chosen = std::make_shared<Command::Run>();
  for (const CommandGroup& group : groups) {
    CLI::App* parent = &app;
    if (!group.name.empty()) {
      parent = app.add_subcommand(group.name, group.description);
      parent->require_subcommand(1);
    }
    for (const auto add : group.commands) add(CommandList(parent, chosen));
  }
  if (argc == 2 && (std::string_view(argv[1]) == "--man" || std::string_view(argv[1]) == "--completion")) {
    const bool manual = std::string_view(argv[1]) == "--man";
    writeOutput("-", manual ? manualPage(app, std::string(programVersion())) : bashCompletion(app));
    return exit_fine;
  }
  const std::string fault = faultOfCommand(argc, argv, app);
  if (!fault.empty()) return complain("liestat: " + fault + " (liestat --help explains the usage)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ExtrasError& error) {
    return complain("liestat: " + printable(error.what(), 1000) + nearestOption(error, app) +
                    " (liestat --help explains the usage)");
  } catch (const CLI::ParseError& error) {
    // Help and version end the parsing too.
    if (error.get_exit_code() == 0) return app.exit(error);
    return complain("liestat: " + printable(error.what(), 1000) + " (liestat --help explains the usage)");
  }
  const int code = (*chosen)({commandLine(argc, argv), givenOptions(app)});
  // A result that nobody could read is no success: the disk is full, or the pipe is closed.
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    return complain(std::string("standard output: cannot be written: ") + std::strerror(errno));
  }
  return code;
}

}  // namespace

int runCommandLine(int argc, char** argv, const std::vector<CommandGroup>& groups) {
  try {
    instructionSet();
  } catch (const std::invalid_argument& error) {
    return complain(std::string("liestat: ") + error.what());
  }
  if (const std::string fault = faultOfTasks(argc, argv); !fault.empty()) return complain(fault);
  try {
    return parseAndRun(argc, argv, groups);
  } catch (const InputError& error) {
    return complain(error.what());
  } catch (const OptionError& error) {
    return complain(error.what());
  } catch (const std::bad_alloc&) {
    return complain("liestat: not enough memory");
  } catch (const std::exception& error) {
    return complain(std::string("liestat: internal error: ") + error.what());
  }
}

}  // namespace liestat::cli
