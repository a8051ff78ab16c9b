// The requirements that all fuzz targets share.
#pragma once

#include <cstdlib>
#include <string_view>
#include <utility>

#include <formats/input_error.hpp>

namespace liestat {

inline void require(bool condition) {
  if (!condition) std::abort();
}

/// Runs a function that may throw an InputError, whose message is one line.
template <class Function>
void mayRefuse(Function&& function) {
  try {
    std::forward<Function>(function)();
  } catch (const InputError& error) {
    require(std::string_view(error.what()).find('\n') == std::string_view::npos);
  }
}

}  // namespace liestat
