// Numbers in the sentences of results. (Needs the standard library alone.)
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace liestat {

/// A number for people, with so many significant digits; `n/a` for what is not finite.
inline std::string significant(double value, int digits = 4) {
  if (!std::isfinite(value)) return "n/a";
  char text[64];
  std::snprintf(text, sizeof text, "%.*g", digits < 1 ? 1 : digits > 17 ? 17 : digits, value);
  return text;
}

}  // namespace liestat
