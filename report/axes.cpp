#include <report/axes.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <report/table.hpp>

namespace liestat {
namespace {

constexpr double letter_width = 7, letter_gap = 9, line_height = 20;  // px, of 12 px letters
constexpr double max_digits = 6;                                      // in a label

std::string labelOf(double value) { return fmt::format("{:.6g}", value == 0 ? 0 : value); }

/// Distance that two neighbouring labels need, px.
double neededFor(const std::string& a, const std::string& b, const AxisOnPaper& paper) {
  if (!paper.horizontal) return line_height;
  return 0.5 * letter_width * static_cast<double>(displayWidth(a) + displayWidth(b)) + letter_gap;
}

/// No two labels touch; position(value) is in px.
template <class Position>
bool fits(const std::vector<Tick>& marks, const AxisOnPaper& paper, const Position& position) {
  for (std::size_t i = 1; i < marks.size(); ++i) {
    const double distance = position(marks[i].at) - position(marks[i - 1].at);
    if (!(distance >= neededFor(marks[i - 1].label, marks[i].label, paper))) return false;
  }
  return true;
}

/// The number with the fewest digits within a distance of a value.
double roundestNear(double value, double distance) {
  double unit = std::pow(10.0, std::ceil(std::log10(std::abs(value))));
  for (int i = 0; i < 16; ++i, unit /= 10) {
    const double round = std::round(value / unit) * unit;
    if (round != 0 && std::abs(round - value) <= distance) return round;
  }
  return value;
}

/// The marks at the multiples of a step, and the offset without which their labels would be too long.
Ticks multiples(double low, double high, double step) {
  Ticks ticks;
  ticks.step = step;
  const double largest = std::max(std::abs(low), std::abs(high));
  if (std::floor(std::log10(largest)) - std::floor(std::log10(step)) + 1 > max_digits) {
    ticks.offset = roundestNear(0.5 * (low + high), 3 * (high - low));
  }
  const double slack = 1e-9 * step;
  // The inverse of a step below one is a whole number, and a quotient is rounded once.
  const double inverse = std::round(1 / step);
  const auto multiple = [&](double k) { return step < 1 && inverse < 1e15 ? k / inverse : k * step; };
  const double first = std::ceil((low - ticks.offset - slack) / step);
  for (double k = first; k * step <= high - ticks.offset + slack; k += 1) {
    ticks.marks.push_back({ticks.offset + multiple(k), labelOf(multiple(k))});
  }
  return ticks;
}

/// The steps from about the given one on.
template <class Try>
Ticks firstThatFits(double least, const Try& tried) {
  int exponent = static_cast<int>(std::floor(std::log10(least)));
  for (int i = 0; i < 60; ++i, ++exponent) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double step = digit * std::pow(10.0, exponent);
      if (step < least * (1 - 1e-9)) continue;
      std::pair<Ticks, bool> result = tried(step);
      if (result.second) return result.first;
    }
  }
  return {};
}

}  // namespace

bool isRange(double low, double high) {
  const double width = high - low;
  return std::isfinite(low) && std::isfinite(high) && std::isfinite(width) && width > 1e-290 &&
         width > 1e-12 * std::max(std::abs(low), std::abs(high));
}

Ticks linearTicks(double low, double high, const AxisOnPaper& paper, double min_step) {
  if (!isRange(low, high)) return {};
  const double scale = paper.length / (high - low);
  const double max_marks = paper.horizontal ? 9 : 8;
  const auto position = [&](double value) { return (value - low) * scale; };
  return firstThatFits(std::max((high - low) / max_marks, min_step), [&](double step) {
    Ticks ticks = multiples(low, high, step);
    const bool fit = fits(ticks.marks, paper, position);
    return std::pair(std::move(ticks), fit);
  });
}

Ticks logarithmicTicks(double low, double high, const AxisOnPaper& paper) {
  if (!(low > 0) || !(low < high) || !std::isfinite(high)) return {};
  const double scale = paper.length / std::log10(high / low);
  const auto position = [&](double value) { return std::log10(value / low) * scale; };
  const int first = static_cast<int>(std::floor(std::log10(low)));
  const int last = static_cast<int>(std::ceil(std::log10(high)));
  const auto marksAt = [&](const std::vector<double>& digits, int stride) {
    Ticks ticks;
    for (int exponent = first; exponent <= last; ++exponent) {
      if (exponent % stride != 0) continue;
      for (const double digit : digits) {
        const double at = digit * std::pow(10.0, exponent);
        if (at >= low * (1 - 1e-9) && at <= high * (1 + 1e-9)) ticks.marks.push_back({at, labelOf(at)});
      }
    }
    return ticks;
  };
  const auto good = [&](const Ticks& ticks) {
    return ticks.marks.size() > 1 && ticks.marks.size() <= 12 && fits(ticks.marks, paper, position);
  };
  if (Ticks ticks = marksAt({1, 2, 5}, 1); good(ticks)) return ticks;
  for (int stride = 1; stride <= last - first; ++stride) {
    if (Ticks ticks = marksAt({1}, stride); good(ticks)) return ticks;
  }
  return firstThatFits((high - low) / 8, [&](double step) {
    Ticks ticks = multiples(low, high, step);
    const bool fit = fits(ticks.marks, paper, position);
    return std::pair(std::move(ticks), fit);
  });
}

}  // namespace liestat
