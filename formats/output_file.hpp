// Output that is complete or not there: files, directories, lines on standard output.
#pragma once

#include <string>
#include <string_view>

namespace liestat {

/// Writes a whole file, `-` is standard output. Whoever reads the path sees the old content or the new one, never a
/// part: the text goes to a file beside it that then takes its name. Throws InputError where the path cannot be
/// written.
void writeOutput(const std::string& path, std::string_view content);

/// The same, and what is there before survives a kill, a crash of the machine and a full disk: the content is on the disk
/// before it takes the name. The file beside it is always `path`.new, so that kills leave one at most.
void writeDurably(const std::string& path, std::string_view content);

/// Shows lines on standard output, without the control characters that a name out of a file or a command line may have.
/// The program checks at its end whether they arrived.
void printLines(std::string_view text);

/// Creates a directory and its parents; throws InputError where that is not possible.
void createDirectory(const std::string& path);

}  // namespace liestat
