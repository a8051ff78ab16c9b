// The median of a sample.
#pragma once

#include <stats/quantile.hpp>

#include <utility>
#include <vector>

namespace liestat::detail {

/// The median of some values, the upper of the middle two if their number is even; 0 for none. No value may be NaN.
inline double median(std::vector<double> values) { return values.empty() ? 0 : quantile(std::move(values), 0.5); }

}  // namespace liestat::detail
