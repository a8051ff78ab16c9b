#pragma once

#include <report/table.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace liestat {

/// The style in which a series is drawn.
enum class Style {
  lines,         ///< through x, y; a NaN breaks the line, so one series may hold several curves
  points,        ///< at x, y
  stars,         ///< the same, of a few points that matter
  linespoints,   ///< both
  errorbars,     ///< a point at x, y with a bar from low to high
  spans,         ///< a box of `width` about x from low to high
  boxes,         ///< histogram bars at x of height y; `width` where they are not as wide as their distance
  filled_curve,  ///< the area between low and high over x
  image,         ///< a coloured cell about each x, y of a grid, by its `value`; NaN is left white
  contours,      ///< lines, coloured by their `value`
  label,         ///< the series' name as a text at its first point, not in the legend
};

/// Data of one name. Lists that the style does not use stay empty, the others have the same length.
struct Series {
  std::string name = {};  ///< for the legend and the CSV; series without a name are not in the legend
  Style style = Style::lines;
  std::vector<double> x = {};
  std::vector<double> y = {};
  std::vector<double> low = {};
  std::vector<double> high = {};
  std::vector<double> width = {};
  std::vector<double> value = {};          ///< values of images and contours, or of any line that they colour
  std::optional<std::size_t> colour = {};  ///< the number of the palette's colour; series of one colour belong together
  bool dashed = false;

  /// Adds a point; NaN is a gap in a line.
  void add(double at, double ordinate) { x.push_back(at), y.push_back(ordinate); }
  /// Adds a point with a bar from middle - reach to middle + reach.
  void addBar(double at, double middle, double reach) { add(at, middle), addBand(at, middle - reach, middle + reach); }
  /// Adds a place of an area; behind a point, its bar.
  void addBand(double at, double from, double to) {
    if (x.size() == low.size()) x.push_back(at);
    low.push_back(from), high.push_back(to);
  }
};

/// An empty series.
inline Series seriesOf(std::string name, Style style, std::size_t colour, bool dashed = false) {
  return {.name = std::move(name), .style = style, .colour = colour, .dashed = dashed};
}

/// One axis of a panel.
struct Axis {
  std::string label = {};
  std::optional<double> low = {};  ///< else from the data
  std::optional<double> high = {};
  bool logarithmic = false;
  bool numbers = true;  ///< false: the scale means nothing
};

/// A dotted line across the panel.
struct ReferenceLine {
  enum class Direction { horizontal, vertical };
  Direction direction = Direction::horizontal;
  double at = 0;
};

/// One pair of axes with what is drawn in it, the first series at the back.
struct Panel {
  std::string title = {};
  Axis x = {};
  Axis y = {};
  Axis colour = {};  ///< the scale of images and contours
  std::vector<Series> series = {};
  std::vector<ReferenceLine> references = {};
  bool equal_aspect = false;  ///< a unit is as long on both axes

  /// Adds the series that have points.
  void add(std::initializer_list<Series> list) {
    for (const Series& one : list) {
      if (!one.x.empty()) series.push_back(one);
    }
  }
};

/// A figure of one panel or several.
struct Plot {
  std::string name;          ///< the name of its files: letters, digits and `_`; others are replaced
  std::string caption = {};  ///< plain text below the figure
  std::vector<Panel> panels = {};
  std::size_t columns = 2;  ///< panels in a row, if there are several
};

/// Points of the ellipse (x − c)ᵀ Σ⁻¹ (x − c) = chi2, as a series of lines.
Series ellipse(std::string name, const Eigen::Vector2d& centre, const Eigen::Matrix2d& covariance, double chi2);

/// A histogram as a series of boxes. `density` scales it to a total area of one; what is not finite or outside is left
/// out, and counts in the total.
Series histogram(std::string name, const std::vector<double>& values, double low, double high, std::size_t bins,
                 bool density);

/// Values over a grid of x and y, row by row (all x at the first y, …); NaN where there is none.
struct Grid {
  std::vector<double> x = {}, y = {}, value = {};
  double at(std::size_t column, std::size_t row) const { return value[row * x.size() + column]; }
};

/// Lines of equal value, joined across the cells and interpolated linearly within them. A cell without all of its four
/// corners has none.
Series contours(std::string name, const Grid& grid, const std::vector<double>& levels);

/// A directory with an index.html that needs nothing else, and beside it for each plot the CSV with all of its data,
/// the gnuplot script and the SVG. Without gnuplot the page says so and keeps tables and CSV.
class Report {
 public:
  /// Makes the directory; throws InputError where that is not possible.
  Report(std::string directory, std::string title);

  /// The answer in one sentence, in a box below the title whenever it is given. A sign says the same as its colour; an
  /// answer that is neither yes nor no is drawn as neither.
  void verdict(Verdict::Answer answer, std::string_view text);
  void verdict(const Verdict& verdict) { this->verdict(verdict.answer, verdict.text); }
  void verdict(bool good, std::string_view text) { verdict(good ? Verdict::Answer::yes : Verdict::Answer::no, text); }
  /// A heading. Pages with many of them begin with a list of contents.
  void section(std::string_view title);
  /// Plain text.
  void paragraph(std::string_view text);
  /// Text as it is typed, for command lines.
  void code(std::string_view text);
  /// Columns whose cells are all numbers are set to the right.
  void table(const std::vector<std::string>& headers, const std::vector<std::vector<std::string>>& rows,
             std::string_view caption = {});
  void table(const TableRows& table, std::string_view caption = {}) { this->table(table.headers, table.rows, caption); }
  /// Draws at once and writes the plot's files. Of very many points only a part is drawn, and the caption says so.
  void plot(const Plot& plot);

  /// Writes index.html and returns its path.
  std::string write();

  /// False once a plot could not be drawn because there is no gnuplot.
  bool has_gnuplot() const { return has_gnuplot_; }

 private:
  std::string path(const std::string& file) const;
  std::string uniqueName(std::string_view name);
  /// Writes a file of the directory. A link under its name is replaced, not followed out of the directory.
  void writeOwn(const std::string& file, std::string_view content) const;

  std::string directory_;
  std::string title_;
  std::string verdict_;
  std::string body_;
  std::vector<std::string> names_;
  std::vector<std::string> sections_;
  bool has_gnuplot_ = true;
};

}  // namespace liestat
