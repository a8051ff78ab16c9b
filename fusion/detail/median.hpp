// The median of a sample.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// The median of some values, the upper of the middle two if their number is even; 0 for none. No value may be NaN.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace liestat::detail
