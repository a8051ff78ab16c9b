#include <report/page.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include <report/run_program.hpp>
#include <report/plots.hpp>
#include <report/json.hpp>
#include <formats/output_file.hpp>
#include <lie/linear.hpp>
#include <formats/text.hpp>

namespace liestat {
namespace {

constexpr std::string_view style_sheet = R"css(
:root { color-scheme: light dark; --ink: #1c1f23; --soft: #5b6470; --rule: #d9dde2; --page: #ffffff; --stripe: #f5f6f8; --link: #0b62a8; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #9aa4b0; --rule: #3a414a; --page: #16191d; --stripe: #1e2227; --link: #6db7f2; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 75rem; padding: 2.5rem 1.25rem 4rem; background: var(--page); color: var(--ink);
  font: 16px/1.55 "Helvetica Neue", Helvetica, Arial, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.25; overflow-wrap: anywhere; margin: 0 0 1.5rem; padding-bottom: .6rem; border-bottom: 2px solid var(--rule); }
h2 { font-size: 1.2rem; margin: 2.5rem 0 .8rem; }
p { max-width: 46rem; margin: 0 0 1rem; }
a { color: var(--link); }
pre { background: var(--stripe); border: 1px solid var(--rule); border-radius: 4px; padding: .7rem .9rem; white-space: pre-wrap; overflow-wrap: anywhere; font-size: .85rem; }
.scroll { overflow-x: auto; margin: 0 0 1.5rem; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
caption { caption-side: bottom; text-align: left; color: var(--soft); padding-top: .5rem; }
th, td { padding: .3rem .8rem; text-align: left; }
th { border-bottom: 2px solid var(--rule); font-weight: 600; vertical-align: bottom; }
td { border-bottom: 1px solid var(--rule); }
tbody tr:nth-child(even) { background: var(--stripe); }
td.number { text-align: right; white-space: nowrap; }
th.number { text-align: right; }
figure { margin: 1.5rem 0 2rem; }
.plot { background: #ffffff; border: 1px solid var(--rule); border-radius: 6px; padding: .5rem 0; display: flex; flex-wrap: wrap; justify-content: center; }
.plot svg { display: block; max-width: 100%; height: auto; }
.drawing { position: absolute; width: 0; height: 0; overflow: hidden; }
@media (prefers-color-scheme: dark) {
  .plot { background: #161616; }
  .plot svg { filter: invert(.914) hue-rotate(180deg); }
}
.plot text { font-family: Helvetica, Arial, sans-serif; }
figcaption { color: var(--soft); font-size: .88rem; margin-top: .5rem; }
.verdict { overflow-wrap: anywhere; border: 2px solid; border-radius: 6px; padding: .6rem .9rem; max-width: none; font-weight: 600; }
.good { border-color: #2e8b57; }
.bad { border-color: #c8452f; }
.none { border-color: var(--rule); }
.contents { columns: 2; padding-left: 1.2rem; max-width: 46rem; }
.notice { border-left: 4px solid #d99a00; background: var(--stripe); padding: .6rem .9rem; max-width: none; }
/* On a narrow screen the rows of a wide table stand one below the other. */
@media (max-width: 56rem) {
  body { padding: 1rem .6rem 2rem; }
  pre { padding: .4rem .3rem; font-size: min(.85rem, 1.85vw); }
  .contents { columns: 1; }
  th, td { overflow-wrap: anywhere; padding: .3rem .4rem; }
  .wide table, .wide tbody, .wide tr, .wide caption { display: block; }
  .wide thead { display: none; }
  .wide tr { border-bottom: 2px solid var(--rule); padding: .3rem 0; }
  .wide td { display: flex; justify-content: space-between; gap: 1rem; border: 0; padding: .1rem .4rem; text-align: right; }
  .wide td:empty { display: none; }
  .wide td::before { content: attr(data-label); color: var(--soft); text-align: left; flex: none; max-width: 60%; }
}
footer { margin-top: 3rem; padding-top: .8rem; border-top: 1px solid var(--rule); color: var(--soft); font-size: .85rem; }
)css";

std::string escaped(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

bool isNumeric(const std::vector<std::vector<std::string>>& rows, std::size_t column) {
  bool any = false;
  for (const auto& row : rows) {
    if (column >= row.size() || row[column].empty() || row[column] == "-" || row[column] == "n/a") continue;
    double value = 0;
    if (parseNumber(row[column], value) == NumberKind::no_number) return false;
    any = true;
  }
  return any;
}

/// The drawing alone, without the lines that only a file of its own may begin with.
std::string_view svgElement(std::string_view svg) {
  const std::size_t start = svg.find("<svg");
  return start == std::string_view::npos ? std::string_view{} : svg.substr(start);
}

/// gnuplot gives its symbols the same identifiers in every drawing, but on one page they must differ.
std::string withOwnIdentifiers(std::string_view svg, const std::string& name) {
  std::string result;
  while (true) {
    std::size_t next = std::string_view::npos;
    for (const std::string_view mark :
         {"id='gp", "id='textbox", "id='greybox", "href='#gp", "url(#textbox", "url(#greybox"}) {
      const std::size_t found = svg.find(mark);
      if (found < next) next = found;
    }
    if (next == std::string_view::npos) return result.append(svg);
    next = svg.find_first_of("'#(", next) + 1;
    while (svg[next] == '#') ++next;
    result.append(svg.substr(0, next)).append(name).append("_");
    svg.remove_prefix(next);
  }
}

/// The title of a drawing, for whoever cannot see it: the titles of its panels, or its caption.
std::string titleOf(const Plot& plot) {
  std::string title;
  for (const Panel& panel : plot.panels) {
    if (panel.title.empty() || title.find(panel.title) != std::string::npos) continue;
    title += (title.empty() ? "" : "; ") + panel.title;
  }
  if (!title.empty()) return title;
  return plot.caption.empty() ? plot.name : plot.caption;
}

/// The drawing as one image with a title, in place of gnuplot's own, which is the same for all.
std::string named(std::string svg, const std::string& name, const std::string& title) {
  const std::string element = fmt::format("<title id=\"{}_title\">{}</title>", name, escaped(title));
  const std::size_t begin = svg.find("<title>"), end = svg.find("</title>");
  const std::size_t first_end = svg.find('>');
  if (first_end == std::string::npos) return svg;
  if (begin != std::string::npos && end != std::string::npos && begin < end) {
    svg.replace(begin, end + 8 - begin, element);
  } else {
    svg.insert(first_end + 1, element);
  }
  svg.insert(4, fmt::format(" role=\"img\" aria-labelledby=\"{}_title\"", name));
  return svg;
}

/// Width and height that the drawing was made for, from its viewBox: wider would blow up its letters.
std::pair<int, int> svgSize(std::string_view svg) {
  const std::size_t start = svg.find("viewBox=\"0 0 ");
  if (start == std::string_view::npos) return {680, 440};
  std::string_view rest = svg.substr(start + 13);
  rest = rest.substr(0, rest.find('"'));
  const std::size_t blank = rest.find(' ');
  double width = 0, height = 0;
  if (blank == std::string_view::npos || parseNumber(rest.substr(0, blank), width) != NumberKind::finite ||
      parseNumber(rest.substr(blank + 1), height) != NumberKind::finite) {
    return {680, 440};
  }
  return {static_cast<int>(width), static_cast<int>(height)};
}

/// The drawing as the page has it: one panel as it is, several each by itself, so that they stand side by side where there
/// is room, and one below the other where there is not. A panel is a view of its part of the drawing.
std::string inPanels(const std::string& drawing, const Plot& plot, const std::string& name) {
  const auto [width, height] = svgSize(drawing);
  const std::size_t n = plot.panels.size();
  std::string text = fmt::format("<div class=\"plot\" style=\"max-width:{}px\">", width + 18);
  if (n < 2) {
    std::string sized = drawing;
    sized.insert(4, fmt::format(" style=\"width:{}px\"", width));
    return text + sized + "</div>\n";
  }
  const std::size_t columns = panelColumns(plot), rows = (n + columns - 1) / columns;
  // Letters of 12 px stay at 10 px.
  const int w = width / static_cast<int>(columns), h = height / static_cast<int>(rows);
  std::string whole = drawing;
  whole.insert(4, fmt::format(" id=\"{}_drawing\"", name));
  text += "<div class=\"drawing\">" + whole + "</div>";
  for (std::size_t k = 0; k < n; ++k) {
    text += fmt::format(
        "<svg viewBox=\"{} {} {} {}\" style=\"flex:1 1 {}px;max-width:min({}px,100%)\" aria-hidden=\"true\"><use "
        "href=\"#{}_drawing\" width=\"{}\" "
        "height=\"{}\"/></svg>",
        static_cast<int>(k % columns) * w, static_cast<int>(k / columns) * h, w, h, w * 10 / 12, w, name, width,
        height);
  }
  return text + "</div>\n";
}

/// gnuplot repeats the command, points at the place in it and says what is wrong last.
std::string lastLine(std::string text) {
  text.erase(text.find_last_not_of(" \n\r\t") + 1);
  return text.empty() ? "no message" : text.substr(text.rfind('\n') + 1);
}

}  // namespace

Series ellipse(std::string name, const Eigen::Vector2d& centre, const Eigen::Matrix2d& covariance, double chi2) {
  constexpr int steps = 96;
  Series series{.name = std::move(name), .style = Style::lines};
  // NaN, which draws nothing, where the covariance has no factor.
  const Eigen::Matrix2d axes = std::sqrt(chi2) * Cholesky<double, 2>(covariance).lower();
  for (int i = 0; i <= steps; ++i) {
    const double angle = 2 * std::numbers::pi * i / steps;
    const Eigen::Vector2d point = centre + axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    series.x.push_back(point.x());
    series.y.push_back(point.y());
  }
  return series;
}

Series histogram(std::string name, const std::vector<double>& values, double low, double high, std::size_t bins,
                 bool density) {
  Series series{.name = std::move(name), .style = Style::boxes};
  const double width = (high - low) / static_cast<double>(bins);
  std::vector<double> counts(bins, 0.0);
  for (const double value : values) {
    // The upper end belongs to the last bin.
    if (value >= low && value <= high) counts[std::min(bins - 1, static_cast<std::size_t>((value - low) / width))] += 1;
  }
  const double scale = density && !values.empty() ? 1 / (static_cast<double>(values.size()) * width) : 1;
  for (std::size_t i = 0; i < bins; ++i) {
    series.x.push_back(low + (static_cast<double>(i) + 0.5) * width);
    series.y.push_back(scale * counts[i]);
    series.width.push_back(width);
  }
  return series;
}

Series contours(std::string name, const Grid& grid, const std::vector<double>& levels) {
  Series series{.name = std::move(name), .style = Style::contours};
  const std::size_t columns = grid.x.size(), rows = grid.y.size();
  // An edge of the grid by the number of its first corner: even to the right, odd upwards. A line goes from edge to edge,
  // and each edge has at most one neighbour in either of its two cells.
  using Ends = std::pair<std::size_t, std::size_t>;
  for (const double level : levels) {
    std::map<std::size_t, std::vector<std::size_t>> neighbours;
    const auto above = [&](std::size_t i, std::size_t j) { return grid.at(i, j) >= level; };
    const auto join = [&](const Ends& ends) {
      neighbours[ends.first].push_back(ends.second), neighbours[ends.second].push_back(ends.first);
    };
    for (std::size_t j = 0; j + 1 < rows; ++j) {
      for (std::size_t i = 0; i + 1 < columns; ++i) {
        const double sum = grid.at(i, j) + grid.at(i + 1, j) + grid.at(i, j + 1) + grid.at(i + 1, j + 1);
        if (!std::isfinite(sum)) continue;
        const std::size_t corner = j * columns + i;
        const std::size_t bottom = 2 * corner, left = bottom + 1, top = 2 * (corner + columns), right = left + 2;
        std::vector<std::size_t> crossed;
        if (above(i, j) != above(i + 1, j)) crossed.push_back(bottom);
        if (above(i + 1, j) != above(i + 1, j + 1)) crossed.push_back(right);
        if (above(i, j + 1) != above(i + 1, j + 1)) crossed.push_back(top);
        if (above(i, j) != above(i, j + 1)) crossed.push_back(left);
        if (crossed.size() == 2) join({crossed[0], crossed[1]});
        if (crossed.size() != 4) continue;
        // A saddle: its centre says which corners belong together.
        const bool with_first = (0.25 * sum >= level) == above(i, j);
        join({bottom, with_first ? right : left}), join({top, with_first ? left : right});
      }
    }
    const auto add = [&](std::size_t edge) {
      const std::size_t corner = edge / 2, i = corner % columns, j = corner / columns;
      const std::size_t i2 = edge % 2 == 0 ? i + 1 : i, j2 = edge % 2 == 0 ? j : j + 1;
      const double a = grid.at(i, j), b = grid.at(i2, j2), t = (level - a) / (b - a);
      series.x.push_back(grid.x[i] + t * (grid.x[i2] - grid.x[i]));
      series.y.push_back(grid.y[j] + t * (grid.y[j2] - grid.y[j]));
      series.value.push_back(level);
    };
    // Open lines first, from one of their ends; what is left is closed.
    for (const bool open : {true, false}) {
      for (auto& [start, ends] : neighbours) {
        if (ends.empty() || (open && ends.size() != 1)) continue;
        std::size_t edge = start;
        add(edge);
        while (!neighbours[edge].empty()) {
          const std::size_t next = neighbours[edge].back();
          neighbours[edge].pop_back();
          std::vector<std::size_t>& back = neighbours[next];
          back.erase(std::find(back.begin(), back.end(), edge));
          edge = next;
          add(edge);
        }
        for (auto* list : {&series.x, &series.y}) list->push_back(std::numeric_limits<double>::quiet_NaN());
        series.value.push_back(level);
      }
    }
  }
  return series;
}

Report::Report(std::string directory, std::string title) : directory_(std::move(directory)), title_(std::move(title)) {
  createDirectory(directory_);
}

void Report::writeOwn(const std::string& file, std::string_view content) const {
  std::error_code ignored;
  if (std::filesystem::is_symlink(path(file), ignored)) std::filesystem::remove(path(file), ignored);
  writeOutput(path(file), content);
}

std::string Report::path(const std::string& file) const { return (std::filesystem::path(directory_) / file).string(); }

std::string Report::uniqueName(std::string_view name) {
  // gnuplot takes such names, and only such, for the identifiers in its drawings.
  const auto isLetter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  std::string clean;
  for (const char c : name.substr(0, 80)) clean += isLetter(c) || (c >= '0' && c <= '9') ? c : '_';
  if (clean.empty() || !isLetter(clean.front())) clean.insert(0, "plot_");
  std::string candidate = clean;
  for (int i = 2; std::find(names_.begin(), names_.end(), candidate) != names_.end(); ++i)
    candidate = fmt::format("{}_{}", clean, i);
  names_.push_back(candidate);
  return candidate;
}

void Report::verdict(Verdict::Answer answer, std::string_view text) {
  const auto [style, sign] = answer == Verdict::Answer::yes  ? std::pair("good", "✓")
                             : answer == Verdict::Answer::no ? std::pair("bad", "✗")
                                                             : std::pair("none", "–");
  verdict_ = fmt::format("<p class=\"verdict {}\">{} {}</p>\n", style, sign, escaped(text));
}

void Report::section(std::string_view title) {
  sections_.emplace_back(title);
  body_ += fmt::format("<h2 id=\"section-{}\">{}</h2>\n", sections_.size(), escaped(title));
}

void Report::paragraph(std::string_view text) { body_ += fmt::format("<p>{}</p>\n", escaped(text)); }

void Report::code(std::string_view text) { body_ += fmt::format("<pre>{}</pre>\n", escaped(text)); }

void Report::table(const std::vector<std::string>& headers, const std::vector<std::vector<std::string>>& rows,
                   std::string_view caption) {
  std::vector<std::string_view> classes;
  for (std::size_t i = 0; i < headers.size(); ++i) classes.push_back(isNumeric(rows, i) ? " class=\"number\"" : "");
  const bool wide = headers.size() > 4;
  body_ += fmt::format("<div class=\"scroll{}\"><table>\n", wide ? " wide" : "");
  if (!caption.empty()) body_ += fmt::format("<caption>{}</caption>\n", escaped(caption));
  body_ += "<thead><tr>";
  for (std::size_t i = 0; i < headers.size(); ++i)
    body_ += fmt::format("<th scope=\"col\"{}>{}</th>", classes[i], escaped(headers[i]));
  body_ += "</tr></thead>\n<tbody>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (std::size_t i = 0; i < headers.size(); ++i) {
      body_ += fmt::format("<td{}{}>{}</td>", classes[i],
                           wide ? fmt::format(" data-label=\"{}\"", escaped(headers[i])) : std::string(),
                           i < row.size() ? escaped(row[i]) : std::string());
    }
    body_ += "</tr>\n";
  }
  body_ += "</tbody></table></div>\n";
}

void Report::plot(const Plot& plot) {
  const std::string name = uniqueName(plot.name);
  writeOwn(name + ".csv", plotCsv(plot));
  // A drawing of an earlier run would pass for one of this.
  std::error_code ignored;
  std::filesystem::remove(path(name + ".svg"), ignored);

  std::string notice;
  std::string svg;
  const std::string script = plotScript(plot, name);
  if (script.empty()) {
    notice = "There is nothing finite to draw.";
  } else {
    writeOwn(name + ".gp", script);
    const ProgramResult run = runProgram({"gnuplot", "-d", name + ".gp"}, directory_);
    if (!run.found) {
      has_gnuplot_ = false;
      notice = "gnuplot is not installed, so this plot was not drawn (Debian and Ubuntu: gnuplot-nox).";
    } else if (run.status != 0 || !std::filesystem::exists(path(name + ".svg"), ignored)) {
      notice = "gnuplot could not draw this plot: " + lastLine(run.errors);
    } else {
      svg = loadText(path(name + ".svg")).text;
    }
  }

  body_ += "<figure>\n";
  if (!svg.empty()) {
    body_ += inPanels(named(withOwnIdentifiers(svgElement(svg), name), name, titleOf(plot)), plot, name);
  } else {
    body_ += fmt::format("<p class=\"notice\">{}</p>\n", escaped(notice));
  }
  std::string caption = plot.caption;
  for (const Panel& panel : plot.panels) {
    for (const Series& series : panel.series) {
      if (series.style == Style::points && series.x.size() > most_points_drawn) {
        caption += fmt::format(" Of the {} points {}one in {} is drawn.", series.x.size(),
                               series.name.empty() ? "" : "of '" + series.name + "' ",
                               (series.x.size() + most_points_drawn - 1) / most_points_drawn);
      }
    }
  }
  const std::string separator = caption.empty() ? "" : " ";
  body_ += fmt::format("<figcaption>{}{}<a href=\"{}.csv\">Data (CSV)</a>", escaped(caption), separator, name);
  if (!svg.empty()) body_ += fmt::format(", <a href=\"{0}.svg\">SVG</a>, <a href=\"{0}.gp\">gnuplot script</a>", name);
  body_ += "</figcaption>\n</figure>\n";
}

std::string Report::write() {
  std::string contents;
  if (sections_.size() > 4) {
    contents = "<nav aria-label=\"Contents\"><ol class=\"contents\">\n";
    for (std::size_t i = 0; i < sections_.size(); ++i) {
      contents += fmt::format("<li><a href=\"#section-{}\">{}</a></li>\n", i + 1, escaped(sections_[i]));
    }
    contents += "</ol></nav>\n";
  }
  const std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{0}</title>\n<style>{1}</style>\n</head>\n<body>\n<h1>{0}</h1>\n{2}{3}{4}"
      "<footer>liestat {5}</footer>\n</body>\n</html>\n",
      escaped(title_), style_sheet, verdict_, contents, body_, programVersion());
  writeOwn("index.html", page);
  return path("index.html");
}

}  // namespace liestat
