#include <cli/commands/self_description.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include <string_view>
#include <vector>

namespace liestat::cli {
namespace {

std::vector<const CLI::App*> commandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

/// Calls visit(command, words) for each command that is not only the first word of others, in the order of the help.
template <class Visit>
void forEachCommand(const CLI::App& app, const std::string& before, const Visit& visit) {
  for (const CLI::App* command : commandsOf(app)) {
    const std::string words = before + command->get_name();
    if (commandsOf(*command).empty()) {
      visit(*command, words);
    } else {
      forEachCommand(*command, words + " ", visit);
    }
  }
}

/// The values of an option that names one of several, between blanks; empty for any other.
std::string valuesOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos || end < begin) return {};
  std::string values = type.substr(begin + 1, end - begin - 1);
  for (char& c : values) {
    if (c == ',') c = ' ';
  }
  return values;
}

/// The names of an option, -h, --help, with a separator between them; an argument without dashes has none.
std::string namesOf(const CLI::Option& option, const std::string& separator) {
  std::string names;
  const auto add = [&](const std::string& dashes, const std::string& name) {
    if (!names.empty()) names += separator;
    names += dashes + name;
  };
  for (const std::string& name : option.get_snames()) add("-", name);
  for (const std::string& name : option.get_lnames()) add("--", name);
  return names;
}

/// Text that roff shows as it is.
std::string roff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) {
      out += std::string("\\&") + c;
    } else {
      out += c;
    }
  }
  return out;
}

std::string entry(const CLI::Option& option) {
  const std::string names = namesOf(option, ", ");
  std::string head = fmt::format("\\fB{}\\fR", roff(names.empty() ? option.get_name(true) : names));
  const std::string values = valuesOf(option);
  if (!values.empty()) {
    head += fmt::format(" \\fI{}\\fR", roff(values));
  } else if (!names.empty() && option.get_items_expected_max() > 0) {
    // The first word of the type; what follows a colon is a check in the parser's own words.
    const std::string type = option.get_type_name();
    head += fmt::format(" \\fI{}\\fR", roff(type.substr(0, type.find(':'))));
  }
  return fmt::format(".TP\n{}\n{}.\n", head, roff(option.get_description()));
}

}  // namespace

std::string manualPage(const CLI::App& app, const std::string& version) {
  const std::string name = app.get_name();
  std::string page = fmt::format(".TH {} 1 \"\" \"{} {}\" \"User Commands\"\n", name, name, version);
  page += fmt::format(".SH NAME\n{} \\- {}\n", name, "statistics of rotations, poses and other geometric features");
  page += fmt::format(".SH SYNOPSIS\n.B {}\n\\fICOMMAND\\fR [\\fIOPTION\\fR]...\n", name);
  page += fmt::format(".SH DESCRIPTION\n{}\n", roff(app.get_description()));
  page += ".SH COMMANDS\n";
  forEachCommand(app, "", [&](const CLI::App& command, const std::string& words) {
    std::string arguments;
    for (const CLI::Option* option : command.get_options()) {
      if (option->get_positional()) arguments += " " + option->get_name(true);
    }
    page += fmt::format(".SS \"{} {}{}\"\n{}.\n", name, words, roff(arguments), roff(command.get_description()));
    for (const CLI::Option* option : command.get_options()) page += entry(*option);
  });
  page +=
      ".SH EXIT STATUS\n.TP\n.B 0\nThe result holds, or the validation has passed.\n.TP\n.B 1\nA validation has "
      "failed.\n.TP\n.B 2\nBad usage or bad input; one line on standard error says what.\n.TP\n.B 3\nThere is an "
      "estimate, and it is not to be trusted; the reason is in the output.\n";
  return page;
}

std::string bashCompletion(const CLI::App& app) {
  const std::string name = app.get_name();
  std::string groups, cases;
  const auto offer = [](const CLI::App& command) {
    std::string words;
    for (const CLI::App* next : commandsOf(command)) words += next->get_name() + " ";
    return words;
  };
  const auto options = [](const CLI::App& command) {
    std::string words;
    for (const CLI::Option* option : command.get_options()) {
      for (const std::string& long_name : option->get_lnames()) words += "--" + long_name + " ";
    }
    return words;
  };
  // The words that lead on to further commands.
  groups += fmt::format("    \"\") words=\"{}{}\" ;;\n", offer(app), options(app));
  std::string leading;
  for (const CLI::App* command : commandsOf(app)) {
    leading += fmt::format("      \" {}\") ;;\n", command->get_name());
    if (commandsOf(*command).empty()) continue;
    groups += fmt::format("    \"{}\") words=\"{}\" ;;\n", command->get_name(), offer(*command));
    for (const CLI::App* next : commandsOf(*command)) {
      leading += fmt::format("      \"{} {}\") ;;\n", command->get_name(), next->get_name());
    }
  }
  forEachCommand(app, "", [&](const CLI::App& command, const std::string& words) {
    std::string values;
    for (const CLI::Option* option : command.get_options()) {
      const std::string of = valuesOf(*option);
      if (!of.empty()) values += fmt::format("        {}) values=\"{}\" ;;\n", namesOf(*option, " | "), of);
    }
    cases += fmt::format("    \"{}\")\n      options=\"{}\"\n", words, options(command));
    if (!values.empty()) cases += fmt::format("      case \"$previous\" in\n{}      esac\n", values);
    cases += "      ;;\n";
  });
  return fmt::format(R"(# Completion of {0} for bash: source this file.
_{0}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} command="" words="" options="" values="" i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "$command ${{COMP_WORDS[i]}}" in
{1}      *) continue ;;
    esac
    command=${{command:+$command }}${{COMP_WORDS[i]}}
  done
  case "$command" in
{2}{3}  esac
  # Options where one has been begun; file names, bash's own, where nothing here fits.
  if [ -n "$values" ]; then
    words=$values
  elif [[ $current == -* ]]; then
    words="$words $options"
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o default -F _{0} {0}
)",
                     name, leading, groups, cases);
}

}  // namespace liestat::cli
