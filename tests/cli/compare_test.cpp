// `liestat compare` and `liestat fit --law`: files in, verdict, JSON and page out, and what is refused.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include <cli/program_output.hpp>
#include <fmt/format.h>
#include <lie/s2.hpp>
#include <stats/random.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

/// Directions about one that is `away` from the z axis.
std::string directions(int n, double away, std::uint64_t seed, const std::string& label = "") {
  CounterRng rng(seed);
  const S2d centre = exp(S2d(), Eigen::Vector2d(away, 0));
  std::string rows;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d x = exp(centre, Eigen::Vector2d(0.1 * rng.normalVector<2>())).params();
    rows += fmt::format("{:.17g},{:.17g},{:.17g}{}\n", x[0], x[1], x[2], label.empty() ? "" : "," + label);
  }
  return rows;
}
const std::string header = "dx,dy,dz\n";

struct CompareCommand : testing::Test {
  TemporaryDirectory directory;
  std::string file(const std::string& name, const std::string& text) const {
    directory.write(name, text);
    return directory / name;
  }
  Json json(std::vector<std::string> words, int code = 0) const {
    words.insert(words.end(), {"--json", "-"});
    const ProgramOutput program = run(words);
    EXPECT_EQ(program.exit_code, code) << program.error;
    return Json::parse(program.output);
  }
};

TEST_F(CompareCommand, filesAndColumnsSayTheSame) {
  const std::string a = file("a.csv", header + directions(30, 0, 1)),
                    b = file("b.csv", header + directions(30, 0.15, 2));
  const std::string all = file(
      "all.csv", "dx,dy,dz,dose\n" + directions(30, 0, 1, "low") + "# a comment\n\n" + directions(30, 0.15, 2, "high"));
  const Json files = json({"compare", a, b}), by = json({"compare", all, "--by", "dose"});
  EXPECT_LT(files["means"]["p"], 1e-4);
  EXPECT_EQ(files["consistent"], false);
  EXPECT_EQ(files["feature"], "direction");
  EXPECT_EQ(files["means"], by["means"]);
  EXPECT_EQ(by["groups"][1]["name"], "high");
  EXPECT_NEAR(files["pairs"][0]["difference"][0].get<double>(), 0.15, 0.08);
  const ProgramOutput program = run({"compare", a, b, "--report", directory / "page"});
  EXPECT_NE(program.output.find("the means differ: p"), std::string::npos) << program.output;
  EXPECT_TRUE(std::filesystem::exists(directory / "page/index.html"));
}

TEST_F(CompareCommand, pairsAndRefusals) {
  const std::string a = file("a.csv", header + directions(30, 0, 1)), b = file("b.csv", header + directions(29, 0, 2));
  EXPECT_EQ(json({"compare", a, a, "--paired"}, 3)["status"], "ill_defined");
  const std::string heading = file("c.csv", "heading_deg\n1\n2\n");
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"compare", a},
                                             {"compare", a, b, "--paired"},
                                             {"compare", a, heading},
                                             {"compare", a, "--by", "dose"},
                                             {"compare", a, b, "--feature", "rotation"},
                                             {"compare", a, directory / "none.csv"}}) {
    const ProgramOutput program = run(words);
    EXPECT_EQ(program.exit_code, 2) << words.back();
    EXPECT_FALSE(program.error.empty());
  }
  EXPECT_EQ(json({"compare", file("few.csv", header + directions(5, 0, 3)), a})["status"], "too_few");
}

TEST_F(CompareCommand, fitOfALaw) {
  const std::string a = file("a.csv", header + directions(60, 0, 5));
  const Json fit = json({"fit", a, "--law", "vmf"});
  EXPECT_EQ(fit["status"], "ok");
  EXPECT_NEAR(fit["kappa"][0].get<double>(), 100, 60);
  EXPECT_EQ(fit["law"], "vmf");
  const ProgramOutput program = run({"fit", a, "--law", "vmf", "--report", directory / "page"});
  EXPECT_NE(program.output.find("the features follow the law vmf"), std::string::npos) << program.output;
  EXPECT_NE(program.output.find("rotational symmetry"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(directory / "page/index.html"));
  const std::string two = file("two.csv", header + directions(50, 0, 6) + directions(12, 1.5, 7));
  EXPECT_EQ(json({"fit", two, "--law", "vmf"}, 3)["status"], "inconsistent");
  std::string headings = "heading_deg\n";
  for (int i = 0; i < 30; ++i) headings += fmt::format("{}\n", 350 + i);
  EXPECT_EQ(json({"fit", file("h.csv", headings), "--law", "von-mises"})["names"][0], "kappa");
}

TEST_F(CompareCommand, refusedFits) {
  const std::string a = file("a.csv", header + directions(20, 0, 1));
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"fit", a},
                                             {"fit", a, "--law", "von-mises"},
                                             {"fit", a, "--law", "vmf", "--model", "line"},
                                             {"fit", a, "--law", "vmf", "--sigma", "1"},
                                             {"fit", a, "--law", "gauss"}}) {
    EXPECT_EQ(run(words).exit_code, 2) << words.back();
  }
}

}  // namespace
}  // namespace liestat::cli
