// The range of an axis of a plot and the marks on it.
#pragma once

#include <string>
#include <vector>

namespace liestat {

/// A mark on an axis.
struct Tick {
  double at = 0;
  std::string label = {};
};

/// The marks of an axis. Their labels neither overlap nor repeat.
struct Ticks {
  std::vector<Tick> marks = {};
  /// Labels state the value minus this, where the values themselves have more than six digits in common.
  double offset = 0;
  double step = 0;  ///< between the marks of a linear axis
};

/// The direction of an axis and its length on paper.
struct AxisOnPaper {
  bool horizontal = true;
  double length = 300;  ///< px
};

/// True if an axis from low to high can be drawn: finite, low < high, and the marks between them are different numbers.
bool isRange(double low, double high);

/// Marks at the multiples of a step 1, 2 or 5 · 10ᵏ, at least `min_step`, between low < high.
Ticks linearTicks(double low, double high, const AxisOnPaper& paper, double min_step = 0);

/// Marks between 0 < low < high on a logarithmic axis: at 1, 2, 5 · 10ᵏ, else at powers of ten, else at every second one
/// and so on; on an axis shorter than a decade at the multiples of a step.
Ticks logarithmicTicks(double low, double high, const AxisOnPaper& paper);

}  // namespace liestat
