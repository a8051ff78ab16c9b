#pragma once

#include <string>
#include <string_view>

namespace liestat::cli {

/// Writes a whole file, `-` is standard output. Whoever reads the path sees the old content or the new one, never a
/// part: the text goes to a file beside it that then takes its name. Throws InputError where the path cannot be
/// written.
void writeOutput(const std::string& path, std::string_view content);

/// Creates a directory and its parents; throws InputError where that is not possible.
void createDirectory(const std::string& path);

}  // namespace liestat::cli
