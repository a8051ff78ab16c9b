#include <report/page.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <report/run_program.hpp>
#include <report/axes.hpp>
#include <report/plots.hpp>
#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

bool hasGnuplot() { return runProgram({"gnuplot", "--version"}, ".").found; }

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

/// A figure with every style, as the program's own reports use them.
Plot everyStyle() {
  Series band{.name = "99 % band", .style = Style::filled_curve, .colour = 6};
  Series index{.name = "LSQ", .style = Style::errorbars};
  Series curve{.name = "WLSQ", .style = Style::linespoints, .dashed = true};
  for (const double n : {5.0, 10.0, 20.0, 50.0, 100.0}) {
    for (Series* series : {&band, &index, &curve}) series->x.push_back(n);
    band.low.push_back(2.85);
    band.high.push_back(3.15);
    index.y.push_back(3 + 1 / n);
    index.low.push_back(2.9 + 1 / n);
    index.high.push_back(3.1 + 1 / n);
    curve.y.push_back(3 - 1 / n);
  }
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) values.push_back(-std::log((i + 0.5) / 1000));
  Series density{.name = "density", .style = Style::lines};
  for (int i = 0; i <= 50; ++i) {
    density.x.push_back(0.1 * i);
    density.y.push_back(std::exp(-0.1 * i));
  }
  const Eigen::Matrix2d covariance{{1, 0.5}, {0.5, 0.41}};
  Series points{.name = "measurements", .style = Style::points, .x = {0, 1, nan, 2}, .y = {1, 0, 1, 0.5}};
  const Panel left{.title = "Index",
                   .x = {.label = "n", .logarithmic = true},
                   .y = {.label = "index"},
                   .series = {band, index, curve},
                   .references = {{ReferenceLine::Direction::horizontal, 3}}};
  const Panel middle{.title = "Histogram",
                     .x = {.label = "µ²", .low = 0.0},
                     .y = {.label = "density"},
                     .series = {histogram("trials", values, 0, 5, 20, true), density},
                     .references = {{ReferenceLine::Direction::vertical, 3}}};
  const Panel right{.title = "Chart",
                    .x = {.label = "r_x"},
                    .y = {.label = "r_y"},
                    .series = {points, ellipse("χ² = 6", {0.5, 0}, covariance, 6)},
                    .equal_aspect = true};
  const Panel empty{.title = "Empty",
                    .series = {Series{.name = "nothing", .x = {nan}, .y = {1}}, Series{.name = "none"}}};
  return {.name = "every style", .caption = "One of each.", .panels = {left, middle, right, empty}};
}

TEST(Columns, DescribeTheTerminalAndThePage) {
  struct Row {
    std::string word;
    double x;
    std::optional<int> n;
    double twice() const { return 2 * x; }
  };
  const Columns<Row> columns{{"word", &Row::word},
                             {"x", &Row::x, 2},
                             {"twice", &Row::twice, fixed(1), ShownOn::page},
                             {"n", &Row::n, ShownOn::terminal},
                             {"sign", [](const Row& row) { return row.x < 0 ? "-" : ""; }}};
  const BothTables tables = tablesOf(columns, std::vector<Row>{{"a", -1.234, {}}, {"b", nan, 3}});
  using Cells = std::vector<std::string>;
  EXPECT_EQ(tables.terminal.headers, (Cells{"word", "x", "n", "sign"}));
  EXPECT_EQ(tables.terminal.rows, (std::vector<Cells>{{"a", "-1.2", "", "-"}, {"b", "n/a", "3", ""}}));
  EXPECT_EQ(tables.page.headers, (Cells{"word", "x", "twice", "sign"}));
  EXPECT_EQ(tables.page.rows, (std::vector<Cells>{{"a", "-1.2", "-2.5", "-"}, {"b", "n/a", "nan", ""}}));
}

TEST(Report, PageHoldsTextTablesAndPlots) {
  const TemporaryDirectory directory;
  const std::string path = directory / "deep/report";
  Report report(path, "Means <of> rotations & more");
  report.section("Result");
  report.paragraph("1 < 2 & \"quoted\"");
  report.code("liestat mean 'f.csv'");
  report.table({"criterion", "index"}, {{"lsq", "3.01"}, {"<b>", "n/a"}}, "A caption.");
  report.plot(everyStyle());
  report.plot(everyStyle());
  EXPECT_EQ(report.write(), path + "/index.html");

  const std::string page = contentOf(path + "/index.html");
  EXPECT_TRUE(contains(page, "<title>Means &lt;of&gt; rotations &amp; more</title>"));
  EXPECT_TRUE(contains(page, "<p>1 &lt; 2 &amp; &quot;quoted&quot;</p>"));
  EXPECT_TRUE(contains(page, "<td class=\"number\">3.01</td>"));
  EXPECT_TRUE(contains(page, "<td>&lt;b&gt;</td>"));
  EXPECT_TRUE(contains(page, "<a href=\"every_style.csv\">"));
  EXPECT_TRUE(contains(page, "<a href=\"every_style_2.csv\">")) << "no plot overwrites another";
  EXPECT_FALSE(contains(page, "src=")) << "the page needs nothing else";
  const std::string csv = contentOf(path + "/every_style.csv");
  EXPECT_EQ(csv.substr(0, 80), "panel,series,x,y,low,high,width\nIndex,99 % band,5,,2.85,3.15,\nIndex,99 % band,10");
  if (!hasGnuplot()) GTEST_SKIP() << "skipped what follows: gnuplot is not installed";
  EXPECT_TRUE(report.has_gnuplot());
  // The two drawings, and a view of each of their four panels.
  EXPECT_EQ(count(page, "<svg"), 10U);
  EXPECT_EQ(count(page, "<svg viewBox"), 8U);
  EXPECT_EQ(count(page, "class=\"notice\""), 0U);
  EXPECT_TRUE(contains(page, "no finite data"));
  EXPECT_EQ(count(page, "id='every_style_gpPt6'"), 1U) << "identifiers differ between the drawings";
  EXPECT_EQ(count(page, "id='gpPt6'"), 0U);
  // Whoever cannot see a drawing is told what it shows.
  EXPECT_TRUE(contains(page, "role=\"img\" aria-labelledby=\"every_style_title\""));
  EXPECT_TRUE(contains(page, "<title id=\"every_style_title\">Index; Histogram; Chart; Empty</title>"));
  EXPECT_FALSE(contains(page, "<title>Gnuplot</title>"));
  // A narrow screen has the panels one below the other: the fourth is the right one of the second row.
  EXPECT_TRUE(contains(page, "<svg viewBox=\"460 360 460 360\" style=\"flex:1 1 383px;max-width:min(460px,100%)\""));
  EXPECT_TRUE(contains(page, "<use href=\"#every_style_drawing\" width=\"920\" height=\"720\"/>"));
}

TEST(Report, TheVerdictIsFirstAndManySectionsHaveContents) {
  const TemporaryDirectory directory;
  Report report(directory / "report", "A page");
  for (const char* title : {"One", "Two", "Three", "Four"}) report.section(title);
  EXPECT_FALSE(contains(contentOf(report.write()), "class=\"contents\"")) << "a short page needs none";
  report.section("Five & more");
  report.table({"a", "b"}, {{"1", "x"}});
  report.table({"a", "b", "c", "d", "<e>"}, {{"1", "x", "y", "z", "v"}});
  report.verdict(false, "FAILED: 1 of 2 rows");
  const std::string page = contentOf(report.write());
  EXPECT_TRUE(contains(page, "</h1>\n<p class=\"verdict bad\">✗ FAILED: 1 of 2 rows</p>\n<nav"));
  EXPECT_TRUE(contains(page, "<li><a href=\"#section-5\">Five &amp; more</a></li>"));
  EXPECT_TRUE(contains(page, "<h2 id=\"section-5\">Five &amp; more</h2>"));
  EXPECT_TRUE(contains(page, "<th scope=\"col\" class=\"number\">a</th><th scope=\"col\">b</th>"));
  // A wide table's cells know their columns, for screens that have no room for the header.
  EXPECT_EQ(count(page, "data-label"), 1U + 5U) << "the style sheet and one wide row";
  EXPECT_TRUE(contains(page, "<td data-label=\"&lt;e&gt;\">v</td>"));
  report.verdict(true, "PASSED");
  EXPECT_TRUE(contains(contentOf(report.write()), "<p class=\"verdict good\">✓ PASSED</p>"));
  report.verdict(Verdict::none("no verdict: not tested"));
  EXPECT_TRUE(contains(contentOf(report.write()), "<p class=\"verdict none\">– no verdict: not tested</p>"));
}

TEST(Report, LinksInItsDirectoryAreReplaced) {
  const TemporaryDirectory directory;
  directory.write("outside.txt", "precious");
  std::filesystem::create_directory(directory.path() / "report");
  for (const char* file : {"index.html", "every_style.csv", "every_style.gp", "every_style.svg"}) {
    std::filesystem::create_symlink(directory.path() / "outside.txt", directory.path() / "report" / file);
  }
  Report report(directory / "report", "Links");
  report.plot(everyStyle());
  report.write();
  EXPECT_EQ(contentOf(directory / "outside.txt"), "precious");
  EXPECT_TRUE(contains(contentOf(directory / "report/index.html"), "</html>"));
  EXPECT_FALSE(std::filesystem::is_symlink(directory.path() / "report/index.html"));
}

TEST(Report, ContoursAreTheLinesOfEqualValue) {
  // x² + y² over ±2 in steps of 0.1 (linear interpolation: 0.0013 off), with a corner that has no values.
  Grid grid;
  for (int k = -20; k <= 20; ++k) grid.x.push_back(0.1 * k), grid.y.push_back(0.1 * k);
  for (const double y : grid.y) {
    for (const double x : grid.x) grid.value.push_back(x > 1.45 && y > 1.45 ? nan : x * x + y * y);
  }
  const Series lines = contours("circles", grid, {1, 5});
  ASSERT_EQ(lines.x.size(), lines.y.size());
  ASSERT_EQ(lines.x.size(), lines.value.size());
  std::size_t breaks = 0;
  double length = 0;
  for (std::size_t i = 0; i < lines.x.size(); ++i) {
    if (!std::isfinite(lines.x[i])) {
      breaks += lines.value[i] == 1 ? 1U : 0U;
      continue;
    }
    EXPECT_NEAR(std::hypot(lines.x[i], lines.y[i]), std::sqrt(lines.value[i]), 0.003);
    if (lines.value[i] == 1 && i > 0 && std::isfinite(lines.x[i - 1])) {
      length += std::hypot(lines.x[i] - lines.x[i - 1], lines.y[i] - lines.y[i - 1]);
    }
  }
  // The inner circle is one closed line.
  EXPECT_EQ(breaks, 1U);
  EXPECT_NEAR(length, 2 * std::numbers::pi, 0.02);
  EXPECT_TRUE(contours("none", grid, {-1, 100}).x.empty());
  // A saddle keeps its lines apart.
  const Grid saddle{.x = {0, 1}, .y = {0, 1}, .value = {1, 0, 0, 1}};
  EXPECT_EQ(contours("saddle", saddle, {0.4}).x.size(), 6U);
}

TEST(Report, ImagesAndContoursHaveAScaleOfColours) {
  const TemporaryDirectory directory;
  Grid grid{.x = {0, 1, 2}, .y = {0, 1, 2}, .value = {1, 2, 3, 2, 5, 8, 3, 8, nan}};
  Series image{.name = "cells", .style = Style::image, .value = grid.value};
  for (const double y : grid.y) {
    for (const double x : grid.x) image.x.push_back(x), image.y.push_back(y);
  }
  const Panel panel{
      .title = "map",
      .colour = {.label = "cost", .logarithmic = true},
      .series = {image, contours("level", grid, {2.5}), {.name = "star", .style = Style::stars, .x = {1}, .y = {1}}}};
  const Plot plot{.name = "map", .panels = {panel}};
  const std::string csv = plotCsv(plot), script = plotScript(plot, "map");
  EXPECT_EQ(csv.substr(0, 62), "panel,series,x,y,low,high,width,value\nmap,cells,0,0,,,,1\nmap,c");
  EXPECT_TRUE(contains(script, "with image"));
  EXPECT_TRUE(contains(script, "lc palette"));
  EXPECT_TRUE(contains(script, "set logscale cb"));
  EXPECT_TRUE(contains(script, "set cblabel 'cost'"));
  EXPECT_FALSE(contains(plotScript(everyStyle(), "s"), "palette"));
  if (!hasGnuplot()) GTEST_SKIP() << "skipped what follows: gnuplot is not installed";
  Report report(directory / "report", "Colours");
  report.plot(plot);
  const std::string page = contentOf(report.write());
  EXPECT_EQ(count(page, "<svg"), 1U);
  EXPECT_TRUE(contains(page, "data:image/png;base64"));
  EXPECT_FALSE(contains(page, "could not draw"));
}

TEST(Report, TextsAreNeverCommands) {
  const TemporaryDirectory directory;
  const std::string path = directory / "report";
  const std::vector<std::string> texts = {"'; system('touch pwned') # \" `touch pwned` @x \\\n!touch pwned",
                                          "'';system(\"touch pwned\")#'",
                                          "\";system(\"touch pwned\")#",
                                          "\nsystem(\"touch pwned\")",
                                          "`touch pwned`",
                                          "'"};
  Report report(path, texts[0]);
  for (const std::string& text : texts) {
    Panel panel{.title = text, .x = {.label = text}, .y = {.label = text}};
    panel.series = {Series{.name = text, .x = {1, 2}, .y = {1, 2}},
                    Series{.name = "|touch pwned", .x = {1, 2}, .y = {2, 1}}};
    report.plot({.name = "-e ../" + text, .panels = {panel}});
  }
  report.write();
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory.path())) {
    EXPECT_NE(entry.path().filename(), "pwned");
    EXPECT_NE(entry.path().filename().string().front(), '-');
  }
  const std::string page = contentOf(path + "/index.html");
  if (!hasGnuplot()) GTEST_SKIP() << "skipped what follows: gnuplot is not installed";
  EXPECT_EQ(count(page, "<svg"), texts.size()) << page.substr(page.find("class=\"notice\""), 400);
}

TEST(Report, WithoutGnuplotItSaysSoAndKeepsTheData) {
  const TemporaryDirectory directory;
  const char* old = std::getenv("PATH");
  const std::string saved = old == nullptr ? "" : old;
  ::setenv("PATH", directory.path().c_str(), 1);
  Report report(directory / "report", "No gnuplot");
  report.plot(everyStyle());
  ::setenv("PATH", saved.c_str(), 1);
  EXPECT_FALSE(report.has_gnuplot());
  const std::string page = contentOf(report.write());
  EXPECT_TRUE(contains(page, "gnuplot is not installed, so this plot was not drawn"));
  EXPECT_FALSE(contains(page, "<svg"));
  EXPECT_TRUE(std::filesystem::exists(directory / "report/every_style.csv"));
}

TEST(Report, NothingFinite) {
  const TemporaryDirectory directory;
  Report report(directory / "report", "Nothing");
  report.plot({.name = "a", .panels = {Panel{.series = {Series{.x = {nan}, .y = {1}}}}}});
  report.plot({.name = "b", .panels = {Panel{.y = {.logarithmic = true}, .series = {Series{.x = {1}, .y = {-1}}}}}});
  report.plot({.name = "c"});
  EXPECT_EQ(count(contentOf(report.write()), "There is nothing finite to draw."), 3U);
}

TEST(Report, OddButFiniteDataIsDrawn) {
  if (!hasGnuplot()) GTEST_SKIP() << "skipped: gnuplot is not installed";
  const TemporaryDirectory directory;
  Report report(directory / "report", "Odd");
  const Series point{.name = "one", .style = Style::points, .x = {2}, .y = {3}};
  const Series constant{.name = "constant", .x = {1, 2, 3}, .y = {1e-300, 1e-300, 1e-300}};
  const Series mixed{.name = "mixed", .x = {1, 2, 3, 4}, .y = {-1, nan, 10, 1e5}};
  report.plot({.name = "a", .panels = {Panel{.series = {point}}}});
  report.plot({.name = "b", .panels = {Panel{.series = {constant}}}});
  report.plot({.name = "c",
               .panels = {Panel{.x = {.logarithmic = true}, .y = {.logarithmic = true}, .series = {mixed, point}}}});
  report.plot({.name = "d",
               .panels = {Panel{.x = {.low = 10.0, .high = 20.0}, .y = {.low = 0.0, .high = 1.0}, .series = {point}}}});
  const std::string page = contentOf(report.write());
  EXPECT_EQ(count(page, "<svg"), 4U) << page.substr(page.find("class=\"notice\""), 300);
}

TEST(Report, MarksOfAlmostEqualValuesDiffer) {
  Series ratio{.name = "ratio", .style = Style::linespoints};
  for (int i = 0; i < 20; ++i) ratio.x.push_back(i), ratio.y.push_back(1 + 1e-8 * std::sin(i));
  Panel panel{.y = {.label = "ratio"}, .series = {ratio}};
  EXPECT_TRUE(contains(plotScript({.name = "a", .panels = {panel}}, "a"), "set ylabel 'ratio − 1'\n"));
  // Rounding is not magnified.
  for (double& y : panel.series[0].y) y = 1 + 1e-8 * (y - 1);
  const std::string script = plotScript({.name = "a", .panels = {panel}}, "a");
  EXPECT_TRUE(contains(script, "set ylabel 'ratio'\n"));
  EXPECT_TRUE(contains(script, "set ytics ('0.9' 0.9, '0.95' 0.95, '1' 1, ")) << script;
}

TEST(Report, StripsOfEqualAspectHaveRoomForMarks) {
  Series path{.name = "path"};
  for (int i = 0; i < 50; ++i) path.x.push_back(0.01 * std::sin(i)), path.y.push_back(std::cos(i));
  const std::string script = plotScript({.name = "a", .panels = {Panel{.series = {path}, .equal_aspect = true}}}, "a");
  EXPECT_TRUE(contains(script, "set xtics ('-0.5' -0.5, '0' 0, '0.5' 0.5)\n")) << script;
  EXPECT_TRUE(contains(script, "set ytics ('-1' -1, '-0.5' -0.5, '0' 0, '0.5' 0.5, '1' 1)\n")) << script;
}

/// Marks in their order whose labels differ, do not touch, and state their places to six digits of the range.
void expectLegible(const Ticks& ticks, double low, double high, const AxisOnPaper& paper, bool logarithmic) {
  const auto position = [&](double x) {
    return paper.length * (logarithmic ? std::log(x / low) / std::log(high / low) : (x - low) / (high - low));
  };
  ASSERT_FALSE(ticks.marks.empty() && paper.length >= 150);
  EXPECT_LE(ticks.marks.size(), 12U);
  for (std::size_t i = 0; i < ticks.marks.size(); ++i) {
    const Tick& tick = ticks.marks[i];
    EXPECT_GE(tick.at, low - 1e-6 * (high - low));
    EXPECT_LE(tick.at, high + 1e-6 * (high - low));
    const double stated = ticks.offset + std::stod(tick.label);
    EXPECT_NEAR(stated, tick.at, logarithmic ? 1e-5 * tick.at : 1e-2 * ticks.step + 4e-16 * std::abs(tick.at));
    if (i == 0) continue;
    const Tick& last = ticks.marks[i - 1];
    EXPECT_NE(tick.label, last.label);
    const double letters = 0.5 * static_cast<double>(tick.label.size() + last.label.size());
    EXPECT_GE(position(tick.at) - position(last.at), paper.horizontal ? 7 * letters : 15) << tick.label;
  }
}

TEST(Axes, MarksAreLegibleAtAnyRange) {
  for (const double centre : {0.0, 1.0, -1.0, 0.123456789, 1e-6, 4512345.25, 1403636579.763, -1e12, 1e100}) {
    for (int decade = -11; decade <= 9; ++decade) {
      for (const double digit : {1.0, 1.7, 3.3, 9.9}) {
        const double width = digit * std::pow(10.0, decade) * (centre == 0 ? 1 : std::abs(centre));
        const double low = centre - 0.37 * width, high = centre + 0.63 * width;
        for (const bool horizontal : {true, false}) {
          for (const double length : {60.0, 150.0, 350.0, 575.0}) {
            SCOPED_TRACE(fmt::format("{} to {} on {} px, {}", low, high, length, horizontal));
            const AxisOnPaper paper{horizontal, length};
            expectLegible(linearTicks(low, high, paper), low, high, paper, false);
          }
        }
      }
    }
  }
  EXPECT_TRUE(linearTicks(1, 1, {}).marks.empty());
  EXPECT_TRUE(linearTicks(1, nan, {}).marks.empty());
  EXPECT_TRUE(linearTicks(-1.7e308, 1.7e308, {}).marks.empty());
}

TEST(Axes, LogarithmicMarksAreLegibleAtAnyRange) {
  for (int exponent = -300; exponent <= 200; exponent += 20) {
    for (const double ratio : {1.5, 1.9, 3.0, 9.0, 30.0, 1e3, 1e5, 1e10, 1e20, 1e80}) {
      const double low = 1.3 * std::pow(10.0, exponent), high = low * ratio;
      for (const bool horizontal : {true, false}) {
        for (const double length : {150.0, 350.0, 575.0}) {
          SCOPED_TRACE(fmt::format("{} to {} on {} px, {}", low, high, length, horizontal));
          const AxisOnPaper paper{horizontal, length};
          expectLegible(logarithmicTicks(low, high, paper), low, high, paper, true);
        }
      }
    }
  }
  EXPECT_TRUE(logarithmicTicks(0, 1, {}).marks.empty());
}

TEST(Report, OfAMillionPointsAPartIsDrawn) {
  Series cloud{.style = Style::points, .x = std::vector<double>(1000000, 1.0), .y = std::vector<double>(1000000, 2.0)};
  const Plot plot{.name = "cloud", .panels = {Panel{.series = {cloud}}}};
  EXPECT_TRUE(contains(plotScript(plot, "cloud"), "every 200::1 "));
}

TEST(Report, DirectoriesThatCannotBeMade) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("file", "");
  EXPECT_EQ(errorOf([&] { Report report(file, "x"); }).substr(0, file.size()), file);
  EXPECT_EQ(errorOf([&] { Report report(file + "/below", "x"); }).substr(0, file.size()), file);
}

TEST(Ellipse, LiesAtTheDistanceAskedFor) {
  const Eigen::Matrix2d covariance{{2, 0.7}, {0.7, 0.5}};
  const Eigen::Vector2d centre(1, -2);
  const Series series = ellipse("e", centre, covariance, 6);
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const Eigen::Vector2d d = Eigen::Vector2d(series.x[i], series.y[i]) - centre;
    EXPECT_NEAR(d.dot(covariance.inverse() * d), 6, 1e-12);
  }
  EXPECT_TRUE(std::isnan(ellipse("none", centre, -covariance, 6).x[0]));
}

TEST(Histogram, CountsAndDensity) {
  const std::vector<double> values = {0, 0.5, 1, 1.5, 2, 3, -1, nan};
  const Series counts = histogram("h", values, 0, 2, 2, false);
  EXPECT_EQ(counts.x, (std::vector<double>{0.5, 1.5}));
  EXPECT_EQ(counts.y, (std::vector<double>{2, 3})) << "the upper end belongs to the last bin";
  EXPECT_EQ(histogram("h", {0.5, 1.5, 1.6, 1.7}, 0, 2, 2, true).y, (std::vector<double>{0.25, 0.75}));
}

TEST(RunProgram, SaysWhatHappened) {
  EXPECT_FALSE(runProgram({"no-such-program-here"}, ".").found);
  const ProgramResult failed = runProgram({"ls", "/no such; directory"}, "/");
  EXPECT_TRUE(failed.found);
  EXPECT_NE(failed.status, 0);
  EXPECT_TRUE(contains(failed.errors, "/no such; directory"));
  EXPECT_EQ(runProgram({"true"}, "/").status, 0);
}

}  // namespace
}  // namespace liestat
