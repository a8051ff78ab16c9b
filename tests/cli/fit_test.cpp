// `liestat fit`: points in, parameters with their covariance, JSON and page out.

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include <cli/program_output.hpp>
#include <fmt/format.h>
#include <stats/random.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

/// Points of an ellipse about (10, -4), semi-axes 3 and 1.5, turned by 0.4 rad.
std::string ellipsePoints(double sigma) {
  CounterRng rng(4, 0);
  std::string text = "x,y\n";
  for (int i = 0; i < 40; ++i) {
    const double u = 3 * std::cos(0.157 * i), v = 1.5 * std::sin(0.157 * i);
    text += fmt::format("{},{}\n", 10 + u * std::cos(0.4) - v * std::sin(0.4) + sigma * rng.normal(),
                        -4 + u * std::sin(0.4) + v * std::cos(0.4) + sigma * rng.normal());
  }
  return text;
}

TEST(FitCommand, findsTheEllipseAndTestsSigma) {
  const TemporaryDirectory directory;
  directory.write("points.csv", ellipsePoints(0.02));
  const std::string file = directory / "points.csv";
  const ProgramOutput out = run({"fit", file, "--model", "ellipse", "--sigma", "0.02", "--json", directory / "out.json",
                                 "--report", directory / "page"});
  ASSERT_EQ(out.exit_code, 0) << out.error;
  EXPECT_NE(out.output.find("semi_major"), std::string::npos) << out.output;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["distances"].size(), 40U);
  const double truth[] = {10, -4, 3, 1.5, 0.4};
  for (std::size_t i = 0; i < 5; ++i) {
    const double sd = std::sqrt(json["covariance"][i][i].get<double>());
    EXPECT_LT(std::abs(json["parameter"][i].get<double>() - truth[i]), 4 * sd) << i;
  }
  const std::string page = contentOf(directory / "page/index.html");
  for (const char* word : {"the points follow the ellipse", "semi_major", "Covariance", "farthest"}) {
    EXPECT_NE(page.find(word), std::string::npos) << word;
  }

  const ProgramOutput refuted = run({"fit", file, "--model", "ellipse", "--sigma", "0.002"});
  EXPECT_EQ(refuted.exit_code, 3);
  EXPECT_NE(refuted.output.find("the points refute the stated sigma"), std::string::npos) << refuted.output;
  EXPECT_NE(refuted.output.find("n/a"), std::string::npos) << "no deviation where there is no covariance";
  EXPECT_EQ(run({"fit", file, "--model", "ellipse", "--sigma", "0.002", "--birge"}).exit_code, 0);
}

TEST(FitCommand, namesWhatIsWrong) {
  const TemporaryDirectory directory;
  directory.write("points.csv", "x,y\n1,2\n3,4\n5,inf\n");
  directory.write("few.csv", "x,y\n1,2\n3,4\n");
  const ProgramOutput infinite = run({"fit", directory / "points.csv", "--model", "line"});
  EXPECT_EQ(infinite.exit_code, 2);
  EXPECT_NE(infinite.error.find("points.csv:4: y is 'inf'"), std::string::npos) << infinite.error;
  EXPECT_NE(run({"fit", directory / "few.csv", "--model", "plane"}).error.find("there is no column 'z'"),
            std::string::npos);
  EXPECT_EQ(run({"fit", directory / "few.csv"}).exit_code, 2) << "without a model";
  const ProgramOutput few = run({"fit", directory / "few.csv", "--model", "ellipse"});
  EXPECT_EQ(few.exit_code, 3);
  EXPECT_NE(few.output.find("too few points"), std::string::npos) << few.output;
}

}  // namespace
}  // namespace liestat::cli
