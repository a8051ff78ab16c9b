// The output of a command, on the terminal and as JSON.
#pragma once

#include <formats/output_file.hpp>
#include <report/json.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace liestat {

/// Prints the text, unless JSON goes to standard output (whoever asks for that wants nothing else there), and writes the
/// JSON to the file, if it has a name: the first fields, and those that fill(object) sets. Throws InputError.
template <class Fill>
void publishResult(const std::string& json, const std::string& text, const std::string& command_line,
                   std::optional<std::uint64_t> seed, const Fill& fill) {
  if (json != "-") printLines(text);
  if (json.empty()) return;
  JsonObject object = jsonEnvelope(command_line, seed);
  fill(object);
  writeJson(json, object);
}

/// The same for an output that describes itself.
template <Described T>
void publishResult(const std::string& json, const std::string& text, const std::string& command_line,
                   std::optional<std::uint64_t> seed, const T& output) {
  publishResult(json, text, command_line, seed, [&](JsonObject& object) { object.fieldsOf(output); });
}

}  // namespace liestat
