#pragma once

#include <cstddef>
#include <cstdlib>

namespace liestat {

/// True where the complete acceptance is asked for (LIESTAT_FULL=1, as `./run validate --full` sets it): the trials of
/// the published tables instead of a part of them.
inline bool isFullRun() {
  const char* value = std::getenv("LIESTAT_FULL");
  return value != nullptr && *value == '1';
}

/// The trials of a table's cell: all, or a share of them.
inline std::size_t trialsOf(std::size_t full, std::size_t share = 5) { return isFullRun() ? full : full / share; }

}  // namespace liestat
