// `liestat doctor`: verdicts and exit codes on files, without truth, the plan, several runs, edges of graphs, bad
// input.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <cli/program_output.hpp>
#include <support/temporary_directory.hpp>
#include <support/trajectory_files.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;
using experiments::TrajectoryScene;

Json json(Words words, int exit_code) {
  words.insert(words.end(), {"--json", "-"});
  const ProgramOutput out = run(words);
  EXPECT_EQ(out.exit_code, exit_code) << out.error << out.output;
  return out.output.empty() ? Json() : Json::parse(out.output);
}
Convention convention(Perturbation perturbation, RotationUnit unit = RotationUnit::radian) {
  Convention c;
  c.perturbation = perturbation, c.unit = unit;
  return c;
}

/// A scene whose covariances stand as 36 numbers in each row.
struct Files {
  TemporaryDirectory directory;
  TrajectoryScene scene;
  std::string truth, estimate;
  explicit Files(const Convention& c, bool dead_reckoning = false, double scale = 1) {
    CounterRng rng(4);
    experiments::TrajectorySceneOptions options{.n = 150};
    if (dead_reckoning) options.sigma_translation = 0.01, options.sigma_rotation = 0.002;
    scene =
        dead_reckoning ? experiments::deadReckoningScene(options, rng) : experiments::independentScene(options, rng);
    for (auto& g : scene.estimate) g.covariance *= scale;
    truth = directory.write("gt.tum", tumOf(scene.times, scene.truth));
    estimate = directory.write("est.txt", tumWithCovariance(scene.times, scene.estimate, c));
  }
  Words words(Words more = {}) const {
    return Words{"doctor", estimate, truth, "--format", "tum", "--cov-layout", "full36"} + more;
  }
};

/// The page of a run, and the files beside it.
struct Page {
  TemporaryDirectory directory;
  std::string html;
  Page(Words words, int exit_code) {
    words.insert(words.end(), {"--report", directory / "page"});
    const ProgramOutput out = run(words);
    EXPECT_EQ(out.exit_code, exit_code) << out.error;
    html = contentOf(directory / "page/index.html");
  }
  std::string csv(const std::string& name) const { return contentOf(directory / "page/" + name + ".csv"); }
  bool has(const std::string& name) const { return std::filesystem::exists(directory / "page/" + name + ".csv"); }
};

TEST(DoctorCommand, SaysFirstWhatIsNoNoise) {
  Files files(convention(Perturbation::world_axes));
  const Json clean = json(files.words({"--misfit"}), 0);
  EXPECT_EQ(clean["misfit"]["searched"], true);
  EXPECT_EQ(clean["verdict"], "identified") << clean["sentence"];
  // Positions 20 % too large, and errors with them.
  for (auto& g : files.scene.estimate) g.mean = SE3d(SO3d(g.mean.so3()), Eigen::Vector3d(1.2 * g.mean.translation()));
  files.directory.write(
      "est.txt", tumWithCovariance(files.scene.times, files.scene.estimate, convention(Perturbation::world_axes)));
  const ProgramOutput out = run(files.words({"--misfit", "--json", files.directory / "out.json"}));
  EXPECT_NE(out.exit_code, 0);
  EXPECT_EQ(out.output.find("MISFIT: explained "), 0U) << out.output;
  EXPECT_NE(out.output.find(" % too large"), std::string::npos) << out.output;
  EXPECT_EQ(out.output.find("--cov-from"), std::string::npos) << "nothing to copy";
  const Json found = Json::parse(contentOf(files.directory / "out.json"));
  EXPECT_EQ(found["misfit"]["explanations"][0]["faults"][0], "scale");
  // A column of stamps in ms.
  std::vector<double> ms;
  for (const double t : files.scene.times) ms.push_back(1e3 * t);
  files.directory.write("est.txt", tumWithCovariance(ms, files.scene.estimate, convention(Perturbation::world_axes)));
  const std::string in_ms = "the times are in ms (--time-unit ms): the motion then agrees";
  EXPECT_NE(run(files.words()).output.find(in_ms), std::string::npos) << "the pose at zero has a partner";
  const ProgramOutput evaluated = run({"evaluate", files.truth, files.estimate, "--format", "tum", "--cov-layout",
                                       "full36", "--cov-from", "ros-fixed", "--t_start", "1"});
  EXPECT_NE(evaluated.error.find(in_ms), std::string::npos) << "none has" << evaluated.error;
}

TEST(DoctorCommand, NamesTheConvention) {
  const Files files(convention(Perturbation::world_axes));
  const Json found = json(files.words(), 0);
  EXPECT_EQ(found["verdict"], "identified") << found["reason"];
  EXPECT_EQ(found["accepted"], Json::array({"ros-fixed"}));
  EXPECT_EQ(found["hypotheses"].size(), 216U);
  const ProgramOutput text = run(files.words());
  EXPECT_EQ(text.output.rfind("identified: ", 0), 0U) << text.output;
  EXPECT_TRUE(contains(text.output, "--cov-from ros-fixed")) << text.output;
  // The answer is a convention that the other commands read.
  EXPECT_EQ(run({"evaluate", files.truth, files.estimate, "--format", "tum", "--cov-layout", "full36", "--cov-from",
                 "ros-fixed", "--fail-if", "consistent<1"})
                .exit_code,
            0);
}

TEST(DoctorCommand, ScalesAreInconsistent) {
  const Files files(convention(Perturbation::left), false, 0.25);
  const Json found = json(files.words(), 5);
  EXPECT_EQ(found["verdict"], "inconsistent");
  EXPECT_EQ(found["accepted"], Json::array({"left"}));
  EXPECT_TRUE(contains(found["reason"], "overconfident")) << found["reason"];
  EXPECT_NEAR(found["scale"]["translation"].get<double>(), 0.25, 0.06);
}

TEST(DoctorCommand, DeadReckoningWithAndWithoutTruth) {
  const Files files(convention(Perturbation::right, RotationUnit::half_angle), true);
  const Json with = json(files.words(), 0);
  EXPECT_EQ(with["correlated"], true);
  EXPECT_EQ(with["accepted"], Json::array({"right,unit=half"}));
  const Json without = json({"doctor", files.estimate, "--format", "tum", "--cov-layout", "full36", "--no-truth"}, 0);
  EXPECT_EQ(without["chain"]["accepted"], Json::array({"right,unit=half"}));
  const Json plan = json({"doctor", files.estimate, "--format", "tum", "--cov-layout", "full36", "--plan"}, 0);
  EXPECT_EQ(plan["plan"].size(), 18U);
  EXPECT_GT(plan["plan"][0]["divergence"], 0);
}

TEST(DoctorCommand, SeveralRunsAreOneResidualEach) {
  const TemporaryDirectory directory;
  Words words{"doctor"};
  experiments::TrajectorySceneOptions options{.n = 40, .sigma_translation = 0.01, .sigma_rotation = 0.002};
  std::string truth;
  for (std::uint64_t r = 0; r < 30; ++r) {
    // One path, and another error in each run.
    CounterRng path(9), noise(10, r);
    TrajectoryScene scene = experiments::deadReckoningScene(options, path);
    const TrajectoryScene other = experiments::deadReckoningScene(options, noise);
    for (std::size_t i = 0; i < 40; ++i) {
      const SE3d error = other.estimate[i].mean.inverse() * other.truth[i];
      scene.estimate[i] = {scene.truth[i] * error.inverse(), other.estimate[i].covariance};
    }
    truth = directory.write("gt.tum", tumOf(scene.times, scene.truth));
    words.push_back(directory.write(fmt::format("run{}.txt", r),
                                    tumWithCovariance(scene.times, scene.estimate, convention(Perturbation::right))));
  }
  words.insert(words.end(), {truth, "--format", "tum", "--ref-format", "tum", "--cov-layout", "full36"});
  // At one pose frames are hardly told apart, but the errors are independent, and the truth is among those accepted.
  const Json found = json(words, 4);
  EXPECT_EQ(found["correlated"], false);
  EXPECT_NE(std::find(found["accepted"].begin(), found["accepted"].end(), "right"), found["accepted"].end());
  EXPECT_LT(found["accepted"].size(), 10U);
  EXPECT_EQ(found["n"], 30);
  const Page page(words, 4);
  EXPECT_TRUE(contains(page.html, "<p class=\"verdict none\">– UNDECIDABLE: ")) << page.html.substr(0, 3000);
  EXPECT_TRUE(page.has("errors"));
}

TEST(DoctorCommand, EdgesOfAGraph) {
  CounterRng rng(6);
  const TemporaryDirectory directory;
  std::vector<SE3d> poses;
  std::string vertices, edges;
  for (int i = 0; i < 80; ++i) {
    poses.emplace_back(SO3d(rng.unitQuaternion()), Eigen::Vector3d(5 * rng.normalVector<3>()));
    const Eigen::Vector3d t = poses.back().translation();
    const Eigen::Vector4d q = poses.back().so3().params();
    vertices += fmt::format("VERTEX_SE3:QUAT {} {} {} {} {} {} {} {}\n", i, t[0], t[1], t[2], q[0], q[1], q[2], q[3]);
  }
  Convention c = convention(Perturbation::right, RotationUnit::half_angle);
  c.content = CovarianceContent::information, c.layout = CovarianceLayout::upper21;
  for (int i = 0; i + 1 < 80; ++i) {
    const auto covariance = experiments::sceneCovariance({}, rng);
    const SE3d error = sample(Gaussian<SE3d>{SE3d(), covariance}, rng);
    const auto a = static_cast<std::size_t>(i);
    const SE3d Z = poses[a].inverse() * poses[a + 1] * error.inverse();
    const Eigen::Vector3d t = Z.translation();
    const Eigen::Vector4d q = Z.so3().params();
    edges +=
        fmt::format("EDGE_SE3:QUAT {} {} {} {} {} {} {} {} {}", i, i + 1, t[0], t[1], t[2], q[0], q[1], q[2], q[3]);
    const PackedCovariance packed = packCovariance(c, toConvention(c, {Z, covariance}));
    for (const double x : packed.numbers()) edges += fmt::format(" {}", x);
    edges += "\n";
  }
  const std::string graph = directory.write("graph.g2o", edges), truth = directory.write("truth.g2o", vertices);
  const Json found = json({"doctor", graph, truth}, 0);
  EXPECT_EQ(found["what"], "edges");
  ASSERT_EQ(found["accepted"].size(), 1U) << found["reason"];
  EXPECT_EQ(found["accepted"][0], "g2o-full,unit=half");
  const Page page({"doctor", graph, truth}, 0);
  EXPECT_TRUE(contains(page.csv("errors"), "3 sd, g2o-full,unit=half"));
  EXPECT_TRUE(contains(page.csv("errors"), "\"3 sd, g2o-full\",")) << "the information that the format fixes stays";
}

TEST(DoctorReport, ShowsTheConventionsAndTheErrorsBeforeAndAfter) {
  const Files files(convention(Perturbation::world_axes));
  const Page page(files.words(), 0);
  EXPECT_TRUE(contains(page.html, "</h1>\n<p class=\"verdict good\">✓ identified: ")) << page.html.substr(0, 3000);
  EXPECT_TRUE(contains(page.html, "<th scope=\"col\">--cov-from</th>"));
  EXPECT_TRUE(contains(page.html, ">ros-fixed</td>"));
  const std::string errors = page.csv("errors");
  EXPECT_TRUE(contains(errors, "3 sd, ros-fixed")) << "after";
  EXPECT_TRUE(contains(errors, "3 sd, right")) << "before";
  EXPECT_TRUE(contains(page.csv("conventions"), "explain the errors"));
  EXPECT_TRUE(page.has("calibration"));
  // In one of the two rows the index is that of the right convention: near one.
  const std::string row =
      "<td data-label=\"read as\">ros-fixed</td><td class=\"number\" data-label=\"poses\">150</td>"
      "<td class=\"number\" data-label=\"calibration index\">";
  const std::size_t begin = page.html.find(row);
  ASSERT_NE(begin, std::string::npos);
  const Json found = json(files.words(), 0);
  const double index = std::stod(page.html.substr(begin + row.size()));
  EXPECT_NEAR(index, found["hypotheses"][0]["nees_ratio"].get<double>(), 0.01);
}

TEST(DoctorReport, OneReadingWhereTheAssumedOneIsRight) {
  const Files files(convention(Perturbation::right));
  const Page page(files.words(), 0);
  EXPECT_FALSE(contains(page.html, "dashed: as"));
  EXPECT_FALSE(contains(page.csv("errors"), "ros-fixed"));
}

TEST(DoctorReport, InconsistentDeadReckoningAndPlan) {
  const Files scaled(convention(Perturbation::left), false, 0.25);
  EXPECT_TRUE(contains(Page(scaled.words(), 5).html, "<p class=\"verdict bad\">✗ INCONSISTENT: "));
  const Files files(convention(Perturbation::right, RotationUnit::half_angle), true);
  const Page with(files.words(), 0);
  EXPECT_TRUE(contains(with.html, "Neighbouring errors are correlated"));
  EXPECT_TRUE(contains(with.html, "Chain condition</h2>"));
  EXPECT_TRUE(contains(with.csv("errors"), "3 sd, right,unit=half"));
  const Words alone{"doctor", files.estimate, "--format", "tum", "--cov-layout", "full36"};
  Words words = alone;
  words.push_back("--no-truth");
  const Page without(words, 0);
  EXPECT_TRUE(contains(without.csv("deviations"), "right,unit=half"));
  EXPECT_FALSE(without.has("errors")) << "there is no truth";
  words = alone;
  words.push_back("--plan");
  const Page plan(words, 0);
  EXPECT_TRUE(contains(plan.html, "<p class=\"verdict good\">✓ With its 150 poses this file tells "));
  EXPECT_TRUE(contains(plan.html, "poses needed"));
}

TEST(DoctorReport, AnAlignedEstimate) {
  const Files files(convention(Perturbation::right, RotationUnit::half_angle));
  const Page page(files.words({"--align", "se3"}), 0);
  EXPECT_TRUE(contains(page.csv("errors"), "3 sd, right,unit=half"));
}

TEST(DoctorReport, StandardOutputIsNoDirectory) {
  const Files files(convention(Perturbation::right));
  const ProgramOutput out = run(files.words({"--report", "-"}));
  EXPECT_EQ(out.exit_code, 2);
  EXPECT_TRUE(contains(out.error, "a directory is expected")) << out.error;
}

TEST(DoctorCommand, BadInputIsSaid) {
  const Files files(convention(Perturbation::right));
  const auto error = [](const Words& words) {
    const ProgramOutput out = run(words);
    EXPECT_EQ(out.exit_code, 2) << out.output;
    return out.error;
  };
  EXPECT_TRUE(contains(error({"doctor", files.estimate}), "no ground truth"));
  EXPECT_TRUE(contains(error({"doctor", files.truth, files.truth}), "has no covariances"));
  EXPECT_TRUE(contains(error({"doctor", "/nowhere", files.truth}), "nowhere"));
  EXPECT_TRUE(contains(error({"doctor", files.estimate, files.truth, "--cov-layout", "full35"}), "--cov-layout"));
  const std::string late = files.directory.write("late.tum", "100 0 0 0 0 0 0 1\n101 0 0 0 0 0 0 1\n");
  Words words = files.words();
  words[2] = late;
  EXPECT_TRUE(contains(error(words), "do not overlap"));
}

}  // namespace
}  // namespace liestat::cli
