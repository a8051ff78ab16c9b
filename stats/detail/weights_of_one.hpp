// Weights that nobody gave.
#pragma once

#include <cstddef>

namespace liestat::detail {

/// Stands for weights that are all one.
struct UnitWeights {
  double operator[](std::size_t) const { return 1; }
};

}  // namespace liestat::detail
