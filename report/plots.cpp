#include <report/axes.hpp>
#include <report/plots.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>

namespace liestat {
namespace {

// Distinct in hue and in lightness, also to eyes that miss red or green.
constexpr std::array<std::string_view, 7> palette = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                     "#e69f00", "#56b4e9", "#555555"};

constexpr int single_width = 680;
constexpr int single_height = 440;
constexpr int panel_width = 460;
constexpr int panel_height = 360;

/// A gnuplot string. In single quotes nothing is special but the quote itself. Its escape, the quote doubled, fails at
/// the beginning of a string (what follows would be taken as commands), so the typographic apostrophe stands for it.
std::string quotedText(std::string_view text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') {
      result += "’";
    } else {
      result += static_cast<unsigned char>(c) < 0x20U ? ' ' : c;
    }
  }
  return result + "'";
}

std::string csvText(std::string_view text) {
  if (text.find_first_of(",\"\n\r") == std::string_view::npos) return std::string(text);
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') {
      result += "\"\"";
    } else {
      result += static_cast<unsigned char>(c) < 0x20U ? ' ' : c;
    }
  }
  return result + "\"";
}

std::string cell(const std::vector<double>& values, std::size_t i) {
  if (i >= values.size()) return {};
  return std::isfinite(values[i]) ? fmt::format("{}", values[i]) : "NaN";
}

/// Can be shown on the axis at all.
bool drawable(double value, const Axis& axis) { return std::isfinite(value) && (!axis.logarithmic || value > 0); }

bool drawable(const Series& series, const Panel& panel) {
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!drawable(series.x[i], panel.x)) continue;
    if (series.style != Style::filled_curve && i < series.y.size() && drawable(series.y[i], panel.y)) return true;
    if (series.style == Style::filled_curve && i < series.low.size() && i < series.high.size() &&
        drawable(series.low[i], panel.y) && drawable(series.high[i], panel.y)) {
      return true;
    }
  }
  return false;
}

bool drawable(const Panel& panel) {
  return std::any_of(panel.series.begin(), panel.series.end(),
                     [&](const Series& series) { return drawable(series, panel); });
}

/// The least and the greatest of the data that can be shown on an axis.
struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void add(double value, const Axis& axis) {
    if (!drawable(value, axis)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void add(const std::vector<double>& values, const Axis& axis) {
    for (const double value : values) add(value, axis);
  }
  bool empty() const { return !(low <= high); }
};

/// The smallest distance between different values; 0 if there is only one.
double spacing(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  double least = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double distance = values[i] - values[i - 1];
    if (distance > 0 && std::isfinite(distance) && (least == 0 || distance < least)) least = distance;
  }
  return least;
}

bool hasMarkers(const Series& series) {
  return series.style == Style::points || series.style == Style::stars || series.style == Style::linespoints ||
         series.style == Style::errorbars || series.style == Style::label;
}
bool isImage(const Series& series) { return series.style == Style::image; }
bool isBoxes(const Series& series) { return series.style == Style::boxes; }

/// The data along one axis: what is drawn there, and whether it may touch the ends.
Extent extentOf(const Panel& panel, bool horizontal) {
  const Axis& axis = horizontal ? panel.x : panel.y;
  Extent extent;
  for (const Series& series : panel.series) {
    const double half = isBoxes(series) || isImage(series) ? 0.5 * spacing(horizontal ? series.x : series.y) : 0;
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (horizontal) {
        const double reach = i < series.width.size() ? 0.5 * series.width[i] : half;
        extent.add(series.x[i] - reach, axis), extent.add(series.x[i] + reach, axis);
        continue;
      }
      const double x = series.x[i];
      if ((panel.x.low && x < std::min(*panel.x.low, panel.x.high.value_or(*panel.x.low))) ||
          (panel.x.high && x > std::max(*panel.x.high, panel.x.low.value_or(*panel.x.high)))) {
        continue;  // not seen
      }
      if (series.style != Style::filled_curve && i < series.y.size()) {
        const double reach = isImage(series) ? half : 0;
        extent.add(series.y[i] - reach, axis), extent.add(series.y[i] + reach, axis);
      }
      for (const auto* values : {&series.low, &series.high}) {
        if (i < values->size()) extent.add((*values)[i], axis);
      }
      if (isBoxes(series)) extent.add(0, axis);
    }
  }
  return extent;
}

/// The range of an axis: the ends that are asked for, else the data with a margin.
struct Range {
  double low = 0, high = 0;
  bool given() const { return low != high; }
  double width() const { return std::abs(high - low); }
};

Range rangeOf(const Axis& axis, const Extent& data, double low_margin, double high_margin) {
  const auto usable = [&](const std::optional<double>& end) { return end && drawable(*end, axis); };
  Range range{usable(axis.low) ? *axis.low : data.low, usable(axis.high) ? *axis.high : data.high};
  if (usable(axis.low) && usable(axis.high)) return range;
  if (!std::isfinite(range.low) || !std::isfinite(range.high)) return {};
  if (axis.logarithmic) {
    if (!usable(axis.low)) range.low /= 1.25;
    if (!usable(axis.high)) range.high *= 1.25;
    return range.low < range.high && std::isfinite(range.high) && range.low > 0 ? range : Range{};
  }
  if (!isRange(range.low, range.high)) {
    // All are equal, but for rounding; a tenth of it shows that.
    const double size = std::max(std::abs(range.low), std::abs(range.high));
    const double margin = size > 1e-290 ? 0.1 * size : 1;
    if (!usable(axis.low)) range.low -= margin;
    if (!usable(axis.high)) range.high = std::max(range.high, range.low) + margin;
  } else {
    const double width = range.high - range.low;
    // Values that are never negative have no margin below zero.
    if (!usable(axis.low))
      range.low = range.low >= 0 ? std::max(0.0, range.low - low_margin * width) : range.low - low_margin * width;
    if (!usable(axis.high)) range.high += high_margin * width;
  }
  return isRange(range.low, range.high) ? range : Range{};
}

std::string tickText(std::string_view letter, const Ticks& ticks) {
  std::string list;
  for (const Tick& tick : ticks.marks) list += fmt::format("{}'{}' {}", list.empty() ? "" : ", ", tick.label, tick.at);
  return list.empty() ? fmt::format("set {}tics auto\n", letter) : fmt::format("set {}tics ({})\n", letter, list);
}

/// The label of an axis; one whose marks have an offset says so.
std::string labelText(std::string_view letter, const Axis& axis, const Ticks& ticks) {
  std::string label = axis.label;
  if (ticks.offset != 0) {
    label += fmt::format(" {} {:.15g}", ticks.offset > 0 ? "−" : "+", std::abs(ticks.offset));
  }
  return fmt::format("set {}label {}{}\n", letter, quotedText(label), letter == "x" ? " offset 0,0.6" : "");
}

/// Range, marks and label of an axis. gnuplot's own marks overlap on short axes, repeat themselves where the values have
/// many digits in common, and leave most of a logarithmic axis empty.
std::string axisText(std::string_view letter, const Axis& axis, const Range& range, const Ticks& ticks) {
  std::string script = labelText(letter, axis, ticks);
  script += fmt::format("set format {} '{}'\n{} logscale {}\n", letter, axis.numbers ? "% .6g" : "",
                        axis.logarithmic ? "set" : "unset", letter);
  script += range.given() ? fmt::format("set {}range [{}:{}]\n", letter, range.low, range.high)
                          : fmt::format("set {}range [*:*]\n", letter);
  return script + (axis.numbers ? tickText(letter, ticks) : fmt::format("set {}tics auto\n", letter));
}

Ticks ticksOf(const Axis& axis, const Range& range, const AxisOnPaper& paper, double min_step = 0) {
  if (!range.given()) return {};
  const double low = std::min(range.low, range.high), high = std::max(range.low, range.high);
  return axis.logarithmic ? logarithmicTicks(low, high, paper) : linearTicks(low, high, paper, min_step);
}

/// Width and height of the area inside a panel's axes, px, about.
struct PanelSize {
  double width = 0, height = 0;
};

std::string axesText(const Panel& panel, const PanelSize& size) {
  bool markers = false, images = false, boxes = false;
  for (const Series& series : panel.series) {
    markers = markers || hasMarkers(series), images = images || isImage(series), boxes = boxes || isBoxes(series);
  }
  // Symbols on the frame would be cut in half, or hide in it.
  const double y_margin = images ? 0 : 0.05;
  const double x_margin = images ? 0 : panel.equal_aspect ? y_margin : markers ? 0.03 : 0;
  const Extent x_data = extentOf(panel, true), y_data = extentOf(panel, false);
  Range x = rangeOf(panel.x, x_data, x_margin, x_margin);
  Range y = rangeOf(panel.y, y_data, boxes && !panel.y.logarithmic && y_data.low >= 0 ? 0 : y_margin, y_margin);
  AxisOnPaper x_paper{.horizontal = true, .length = size.width}, y_paper{.horizontal = false, .length = size.height};
  const bool equal = panel.equal_aspect && x.given() && y.given() && !panel.x.logarithmic && !panel.y.logarithmic;
  if (equal) {
    // A strip has no room for marks.
    const auto widen = [](Range& range, const Axis& axis, double least) {
      if (axis.low || axis.high || range.width() >= least) return;
      const double middle = 0.5 * (range.low + range.high);
      range = {middle - 0.5 * least, middle + 0.5 * least};
    };
    widen(x, panel.x, 0.5 * y.width());
    widen(y, panel.y, 0.5 * x.width());
    const double scale = std::min(size.width / x.width(), size.height / y.width());
    x_paper.length = scale * x.width(), y_paper.length = scale * y.width();
  }
  Ticks x_ticks = ticksOf(panel.x, x, x_paper), y_ticks = ticksOf(panel.y, y, y_paper);
  if (equal) {
    // Equal steps show that a unit is as long on both axes.
    const double step = std::max(x_ticks.step, y_ticks.step);
    Ticks x_same = ticksOf(panel.x, x, x_paper, step), y_same = ticksOf(panel.y, y, y_paper, step);
    if (x_same.marks.size() > 1 && y_same.marks.size() > 1) x_ticks = std::move(x_same), y_ticks = std::move(y_same);
  }
  return axisText("x", panel.x, x, x_ticks) + axisText("y", panel.y, y, y_ticks);
}

/// Clouds are drawn with small points, so that their density shows.
double pointSize(const Series& series) { return series.x.size() > 1000 ? 0.18 : series.x.size() > 100 ? 0.3 : 0.5; }

std::string styleText(const Series& series, std::string_view colour) {
  const std::string_view dash = series.dashed ? " dt 2" : "";
  switch (series.style) {
    case Style::lines:
      return fmt::format("with lines lw 1.8 lc rgb '{}'{}", colour, dash);
    case Style::points:
      return fmt::format("with points pt 7 ps {} lc rgb '{}'", pointSize(series), colour);
    case Style::stars:
      return fmt::format("with points pt 3 ps 1.1 lw 1.6 lc rgb '{}'", colour);
    case Style::linespoints:
      return fmt::format("with linespoints pt 7 ps 0.45 lw 1.6 lc rgb '{}'{}", colour, dash);
    case Style::errorbars:
      return fmt::format("with yerrorbars pt 7 ps 0.45 lw 1.3 lc rgb '{}'", colour);
    case Style::spans:
      return fmt::format("with boxxyerror lw 0.8 lc rgb '{0}' fs solid 0.35 border lc rgb '{0}'", colour);
    case Style::boxes:
      return fmt::format("with boxes lw 0.8 lc rgb '{0}' fs solid 0.35 border lc rgb '{0}'", colour);
    case Style::filled_curve:
      return fmt::format("with filledcurves fs transparent solid 0.18 noborder lc rgb '{}'", colour);
    case Style::image:
      return "with image";
    case Style::contours:
      return "with lines lw 1.6 lc palette";
    case Style::label:
      break;
  }
  return {};
}

std::string usingText(const Series& series) {
  switch (series.style) {
    case Style::errorbars:
      return "3:4:5:6";
    case Style::spans:
      return "3:4:($3-0.5*$7):($3+0.5*$7):5:6";
    case Style::boxes:
      return series.width.empty() ? "3:4" : "3:4:7";
    case Style::filled_curve:
      return "3:5:6";
    case Style::image:
    case Style::contours:
      return "3:4:8";
    default:
      return "3:4";
  }
}

bool isColoured(const Series& series) { return series.style == Style::image || series.style == Style::contours; }
bool isColoured(const Panel& panel) {
  return std::any_of(panel.series.begin(), panel.series.end(), [](const Series& series) { return isColoured(series); });
}
bool isColoured(const Plot& plot) {
  return std::any_of(plot.panels.begin(), plot.panels.end(), [](const Panel& panel) { return isColoured(panel); });
}

std::string colourText(const Panel& panel, const PanelSize& size) {
  const Axis& axis = panel.colour;
  Extent data;
  for (const Series& series : panel.series) data.add(series.value, axis);
  const Range range = rangeOf(axis, data, 0, 0);
  return axisText("cb", axis, range, ticksOf(axis, range, {.horizontal = false, .length = size.height}));
}

/// Every k-th point of a scatter that nobody could tell apart anyway, and that no browser could show.
std::size_t stride(const Series& series) {
  return series.style == Style::points ? (series.x.size() + most_points_drawn - 1) / most_points_drawn : 1;
}

void appendPanel(std::string& script, const Plot& plot, std::size_t number, const std::string& csv,
                 const PanelSize& size) {
  const Panel& panel = plot.panels[number];
  // The index counts the blocks of the CSV: all series before, without the empty ones.
  std::size_t index = 0;
  bool is_first_block = true;
  for (std::size_t i = 0; i < number; ++i) {
    for (const Series& series : plot.panels[i].series) index += series.x.empty() ? 0 : 1;
  }
  is_first_block = index == 0;

  script += fmt::format("\nset title {}\n", quotedText(panel.title)) + axesText(panel, size);
  if (isColoured(panel)) script += colourText(panel, size);
  script += panel.equal_aspect ? "set size ratio -1\n" : "set size noratio\n";
  script += "unset arrow\nunset label\n";
  for (const ReferenceLine& line : panel.references) {
    const bool horizontal = line.direction == ReferenceLine::Direction::horizontal;
    if (!drawable(line.at, horizontal ? panel.y : panel.x)) continue;
    if (horizontal) {
      script += fmt::format(
          "set arrow from graph 0, first {0} to graph 1, first {0} nohead back lt 1 dt 3 lw 1.4 lc rgb '#555555'\n",
          line.at);
    } else {
      script += fmt::format(
          "set arrow from first {0}, graph 0 to first {0}, graph 1 nohead back lt 1 dt 3 lw 1.4 lc rgb '#555555'\n",
          line.at);
    }
  }
  const auto named = std::count_if(panel.series.begin(), panel.series.end(), [&](const Series& series) {
    return !series.name.empty() && series.style != Style::label && !isColoured(series) && drawable(series, panel);
  });
  for (const Series& series : panel.series) {
    if (series.style != Style::label || series.x.empty() || series.y.empty()) continue;
    if (!drawable(series.x[0], panel.x) || !drawable(series.y[0], panel.y)) continue;
    script += fmt::format("set label {} at first {}, first {} center front\n", quotedText(series.name), series.x[0],
                          series.y[0]);
  }
  script += named > 1 ? "set key\n" : "unset key\n";

  std::string commands;
  std::size_t colour = 0;
  for (const Series& series : panel.series) {
    const bool is_label = series.style == Style::label;
    const std::size_t own = series.colour || is_label || isColoured(series) ? series.colour.value_or(0) : colour++;
    if (series.x.empty()) continue;
    if (!is_label && drawable(series, panel)) {
      const bool enlarged = named > 1 && series.style == Style::points && !series.name.empty();
      const bool in_legend = named > 1 && !enlarged && !isColoured(series);
      // The header is part of the first block.
      commands +=
          fmt::format("{}{} index {} every {}::{} using {} {} title {}", commands.empty() ? "plot " : ", \\\n     ",
                      quotedText(csv), index, stride(series), is_first_block ? 1 : 0, usingText(series),
                      styleText(series, palette[own % palette.size()]), in_legend ? quotedText(series.name) : "''");
      // A point as small as in the cloud would be lost in the legend.
      if (enlarged)
        commands += fmt::format(", \\\n     keyentry with points pt 7 ps 0.6 lc rgb '{}' title {}",
                                palette[own % palette.size()], quotedText(series.name));
    }
    is_first_block = false;
    ++index;
  }
  // A panel without data keeps its place and says so.
  if (commands.empty()) {
    script +=
        "set xrange [0:1]\nset yrange [0:1]\nunset logscale\nset xtics auto\nset ytics auto\nset label 1 'no finite "
        "data' at graph 0.5, graph 0.5 center\n";
    script += "plot NaN notitle\nunset label 1\n";
    return;
  }
  script += commands + "\n";
}

}  // namespace

std::string plotCsv(const Plot& plot) {
  const bool coloured = isColoured(plot);
  std::string text = fmt::format("panel,series,x,y,low,high,width{}\n", coloured ? ",value" : "");
  bool first = true;
  for (const Panel& panel : plot.panels) {
    for (const Series& series : panel.series) {
      if (series.x.empty()) continue;
      if (!first) text += "\n\n";
      first = false;
      const std::string names = csvText(panel.title) + "," + csvText(series.name);
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        text += fmt::format("{},{},{},{},{},{}", names, cell(series.x, i), cell(series.y, i), cell(series.low, i),
                            cell(series.high, i), cell(series.width, i));
        text += coloured ? fmt::format(",{}\n", cell(series.value, i)) : "\n";
      }
    }
  }
  return text;
}

std::size_t panelColumns(const Plot& plot) {
  return std::max<std::size_t>(1, std::min(plot.panels.size(), plot.columns));
}

std::string plotScript(const Plot& plot, const std::string& name) {
  if (std::none_of(plot.panels.begin(), plot.panels.end(), [](const Panel& panel) { return drawable(panel); }))
    return {};
  const std::size_t n = plot.panels.size();
  const std::size_t columns = panelColumns(plot);
  const std::size_t rows = (n + columns - 1) / columns;
  const int width = n == 1 ? single_width : static_cast<int>(columns) * panel_width;
  // If a unit is as long on both axes, a square leaves the least paper empty.
  const bool square =
      std::all_of(plot.panels.begin(), plot.panels.end(), [](const Panel& panel) { return panel.equal_aspect; });
  const int height = n == 1 ? single_height : static_cast<int>(rows) * (square ? panel_width : panel_height);
  // The name keeps the identifiers of several drawings on one page apart.
  std::string script = fmt::format(
      "# Draws {0}.svg from {0}.csv: gnuplot {0}.gp\n"
      "set terminal svg size {1},{2} dynamic font 'Helvetica,12' noenhanced name '{0}' background '#ffffff'\n"
      "set output '{0}.svg'\n"
      "set encoding utf8\n"
      "set datafile separator comma\n"
      "set border 3 lw 0.8 lc rgb '#444444'\n"
      "set tics nomirror out scale 0.6 textcolor rgb '#333333'\n"
      "set xtics offset 0,0.25\n"
      "set grid lt 1 lw 0.5 lc rgb '#dddddd'\n"
      "set title font 'Helvetica,13' textcolor rgb '#222222'\n"
      // The empty title keeps the legend off the axis' label.
      "set key below center horizontal Left reverse samplen 1.8 spacing 1.1 width 1 title ' ' font ',5'\n"
      // Else each point with an error bar stands on a white disc; 0 would mean 1.
      "set pointintervalbox 0.01\n"
      "set errorbars 0.6\n",
      name, width, height);
  if (isColoured(plot)) {
    // Light is small; lightness rises steadily, also to eyes that miss red or green.
    script +=
        "set palette defined (0 '#fde725', 1 '#7ad151', 2 '#22a884', 3 '#2a788e', 4 '#414487', 5 '#440154')\n"
        "set cbtics format '%.6g'\n";
  }
  if (n > 1) script += fmt::format("set multiplot layout {},{}\n", rows, columns);
  // Without the labels, the title and the legend.
  const double right = isColoured(plot) ? 90 : 0;
  const PanelSize size{static_cast<double>(width) / static_cast<double>(n == 1 ? 1 : columns) - 105 - right,
                       static_cast<double>(height) / static_cast<double>(n == 1 ? 1 : rows) - 120};
  for (std::size_t i = 0; i < n; ++i) appendPanel(script, plot, i, name + ".csv", size);
  if (n > 1) script += "\nunset multiplot\n";
  return script;
}

}  // namespace liestat
