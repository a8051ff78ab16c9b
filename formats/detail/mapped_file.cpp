#include <formats/detail/mapped_file.hpp>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <formats/input_error.hpp>
#include <formats/text.hpp>

namespace liestat::detail {
bool MappedFile::isPossible(const std::string& path) {
  // A pipe is not opened, for it would be read from, or waited for.
  struct stat status {};
  return path != "-" && ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0 &&
         ::access(path.c_str(), R_OK) == 0;
}

MappedFile::MappedFile(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) throw InputError(sourceName(path), 0, std::string("cannot be read: ") + std::strerror(errno));
  struct stat status {};
  if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode)) size_ = static_cast<std::size_t>(status.st_size);
  void* const map = size_ > 0 ? ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, file, 0) : MAP_FAILED;
  ::close(file);
  if (map == MAP_FAILED) {
    throw InputError(sourceName(path), 0, "the file cannot be mapped", "a regular file that is not empty");
  }
  map_ = std::shared_ptr<const char>(static_cast<const char*>(map),
                                     [map, size = size_](const char*) { ::munmap(map, size); });
  ::madvise(map, size_, MADV_SEQUENTIAL);
}

void MappedFile::forget(std::size_t end) const {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  ::madvise(const_cast<char*>(map_.get()), end / page * page, MADV_DONTNEED);
}

}  // namespace liestat::detail
