#include <formats/output_file.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include <formats/input_error.hpp>

namespace liestat {
namespace {

[[noreturn]] void throwUnwritable(const std::string& name, int error) {
  throw InputError(name, 0, std::string("cannot be written: ") + std::strerror(error));
}

/// False and errno if not everything could be written.
bool writeAll(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t count = ::write(descriptor, content.data(), content.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    content.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

/// Devices and pipes cannot be replaced by a file; they are written to as they are.
void writeInPlace(const std::string& path, std::string_view content) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) throwUnwritable(path, errno);
  const bool written = writeAll(descriptor, content);
  const int error = errno;
  ::close(descriptor);
  if (!written) throwUnwritable(path, error);
}

mode_t usualMode() {
  // The mask can only be read by setting it.
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return 0666 & ~mask;
}

/// writeOutput() and writeDurably().
void write(const std::string& path, std::string_view content, bool durably) {
  if (path == "-") {
    std::fflush(stdout);
    if (!writeAll(STDOUT_FILENO, content)) throwUnwritable("standard output", errno);
    return;
  }
  std::string target = path;
  struct stat status {};
  mode_t mode = usualMode();
  if (::stat(path.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) throwUnwritable(path, EISDIR);
    if (!S_ISREG(status.st_mode)) return writeInPlace(path, content);
    if (::access(path.c_str(), W_OK) != 0) throwUnwritable(path, errno);
    mode = status.st_mode & 07777;
    // A link stays a link: what it points to is replaced.
    std::error_code ignored;
    const std::filesystem::path resolved = std::filesystem::canonical(path, ignored);
    if (!ignored) target = resolved.string();
  }
  std::string temporary = target + (durably ? ".new" : ".XXXXXX");
  const int descriptor =
      durably ? ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode) : ::mkstemp(temporary.data());
  if (descriptor < 0) throwUnwritable(path, errno);
  bool written =
      writeAll(descriptor, content) && ::fchmod(descriptor, mode) == 0 && (!durably || ::fsync(descriptor) == 0);
  int error = errno;
  if (::close(descriptor) != 0 && written) {
    written = false;
    error = errno;
  }
  if (written && ::rename(temporary.c_str(), target.c_str()) != 0) {
    written = false;
    error = errno;
  }
  if (!written) {
    ::unlink(temporary.c_str());
    throwUnwritable(path, error);
  }
  if (!durably) return;
  // The new name, too, is on the disk; not all file systems can say so of a directory.
  const std::string directory = std::filesystem::path(target).parent_path().string();
  const int of_directory = ::open(directory.empty() ? "." : directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (of_directory < 0) return;
  ::fsync(of_directory);
  ::close(of_directory);
}

}  // namespace

void writeOutput(const std::string& path, std::string_view content) { write(path, content, false); }
void writeDurably(const std::string& path, std::string_view content) { write(path, content, true); }

void printLines(std::string_view text) {
  const std::string lines = printableLines(text);
  std::fwrite(lines.data(), 1, lines.size(), stdout);
}

void createDirectory(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path, 0, "the directory cannot be made: " + error.message());
  if (!std::filesystem::is_directory(path, error)) throw InputError(path, 0, "this is a file", "a directory");
}

}  // namespace liestat
