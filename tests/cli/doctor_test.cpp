// `liestat doctor`: verdicts and exit codes on files, without truth, the plan, several runs, edges of graphs, bad input.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <cli/program_output.hpp>
#include <cli/temporary_directory.hpp>
#include <support/trajectory_files.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;
using Words = std::vector<std::string>;
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
    Words all{"doctor", estimate, truth, "--format", "tum", "--cov-layout", "full36"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

TEST(DoctorCommand, NamesTheConvention) {
  const Files files(convention(Perturbation::world_axes));
  const Json found = json(files.words(), 0);
  EXPECT_EQ(found["verdict"], "identified") << found["reason"];
  EXPECT_EQ(found["accepted"], Json::array({"ros-fixed"}));
  EXPECT_EQ(found["hypotheses"].size(), 168U);
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
  EXPECT_EQ(plan["plan"].size(), 14U);
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
    const auto covariance = experiments::detail::sceneCovariance({}, rng);
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
