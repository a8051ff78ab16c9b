#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat::experiments {

/// The value below which a share p of all values lies, one of them; NaN for none. Values that are not finite must not
/// be among them.
inline double quantile(std::vector<double> values, double p) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace liestat::experiments
