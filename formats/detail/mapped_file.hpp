// Files mapped into memory, read from front to back.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace liestat::detail {

/// A regular file that is not empty.
class MappedFile {
 public:
  /// Throws InputError where it cannot be mapped.
  explicit MappedFile(const std::string& path);

  /// True for what can be mapped; not for pipes, directories, empty files and what is not there.
  static bool isPossible(const std::string& path);

  std::string_view bytes() const { return {map_.get(), size_}; }
  /// The bytes before this one are not needed for now: they take no memory until they are read again.
  void forget(std::size_t end) const;

 private:
  std::shared_ptr<const char> map_;
  std::size_t size_ = 0;
};

}  // namespace liestat::detail
