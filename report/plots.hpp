#pragma once

#include <string>

#include <report/page.hpp>

namespace liestat {

/// The data of a plot as CSV: panel,series,x,y,low,high,width, and value in one with images or contours. Series are separated by two blank lines, by which
/// gnuplot counts.
std::string plotCsv(const Plot& plot);

/// The number of panels in a row of a plot's drawing, whose panels are all of one size.
std::size_t panelColumns(const Plot& plot);

/// The largest number of points of a series that are drawn.
inline constexpr std::size_t most_points_drawn = 5000;

/// A script that draws the CSV of that name into `name`.svg. Empty if there is nothing finite to draw. Whatever the
/// texts of the plot hold, gnuplot takes it as text.
std::string plotScript(const Plot& plot, const std::string& name);

}  // namespace liestat
