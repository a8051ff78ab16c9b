// `liestat evaluate`: figures, verdicts, JSON, page, evo's result file, conditions for pipelines, bad input.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <formats/evo_result.hpp>
#include <formats/result_zip.hpp>
#include <formats/trajectory.hpp>
#include <fusion/evaluate.hpp>
#include <cli/program_output.hpp>
#include <support/temporary_directory.hpp>
#include <support/trajectory_files.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

/// A scene in files: the reference at twice the rate, the estimate in another world, covariances in a side file.
struct Files {
  TemporaryDirectory directory;
  experiments::TrajectoryScene scene;
  std::string reference, estimate;

  explicit Files(std::size_t n = 60, double scale = 1, bool dead_reckoning = false, std::uint64_t seed = 3) {
    CounterRng rng(seed);
    experiments::TrajectorySceneOptions options{.n = n};
    if (dead_reckoning) options.sigma_translation = 0.01, options.sigma_rotation = 0.002;
    scene =
        dead_reckoning ? experiments::deadReckoningScene(options, rng) : experiments::independentScene(options, rng);
    for (auto& g : scene.estimate) {
      g.mean = SE3d(SO3d::rotZ(0.7), Eigen::Vector3d(3, -2, 1)) * g.mean;
      g.covariance *= scale;
    }
    reference = directory.write("gt.tum", tumOf(scene.times, scene.truth));
    estimate = directory.write("est.tum", tumOf(scene.times, posesOf(scene.estimate)));
    directory.write("est.tum.cov", covarianceFileOf(scene.times, scene.estimate, {}));
  }
  Json json(Words options, int exit_code = 0) const {
    const ProgramOutput out = run(Words{"evaluate", reference, estimate, "--json", "-"} + options);
    EXPECT_EQ(out.exit_code, exit_code) << out.error << out.output;
    return out.output.empty() ? Json() : Json::parse(out.output);
  }
};

TEST(EvaluateCommand, JudgesCovariances) {
  const Files right;
  const Json good = right.json({"-a"})["estimates"][0];
  EXPECT_EQ(good["consistent"], true) << good["verdict"];
  EXPECT_EQ(good["tests"]["joint_nees"]["degrees_of_freedom"], 6 * 60 - 6);
  EXPECT_NEAR(good["tests"]["joint_nees"]["ratio"], 1, 0.3);
  EXPECT_EQ(good["matched"], 60);
  EXPECT_EQ(good["weighted_alignment"]["model"], "se3");
  EXPECT_NEAR(good["weighted_alignment"]["translation"][0].get<double>(), -0.7 - 0.3, 2);  // the inverse motion
  const Files small(60, 0.25);
  const Json bad = small.json({"-a"})["estimates"][0];
  EXPECT_EQ(bad["consistent"], false);
  EXPECT_TRUE(contains(bad["verdict"], "OVERCONFIDENT")) << bad["verdict"];
  EXPECT_NEAR(bad["tests"]["joint_nees"]["ratio"], 4, 1.2);
  // APE does not see the covariances.
  EXPECT_EQ(good["ape"], bad["ape"]);
  const ProgramOutput text = run({"evaluate", right.reference, right.estimate, "-a"});
  EXPECT_EQ(text.output.rfind("est.tum: consistent", 0), 0U) << text.output;
}

TEST(EvaluateCommand, CorrelatedErrorsHaveNoVerdictOnAbsoluteOnes) {
  const Files files(200, 1, true);
  const Json without = files.json({"-a"})["estimates"][0];
  EXPECT_TRUE(without["consistent"].is_null());
  EXPECT_TRUE(contains(without["verdict"], "correlated")) << without["verdict"];
  const Json chain = files.json({"-a", "--pairs-model", "chain"})["estimates"][0];
  EXPECT_EQ(chain["consistent"], true) << chain["verdict"];
  EXPECT_NEAR(chain["rpe_nees"]["ratio"], 1, 0.2);
}

TEST(EvaluateCommand, FiguresByHand) {
  const TemporaryDirectory directory;
  const std::string reference =
      directory.write("gt.txt", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n3 3 0 0 0 0 0 1\n");
  const std::string estimate = directory.write(
      "e.txt",
      "0 0 0 0 0 0 0 1\n1 1 3 0 0 0 0 1\n2 2 0 1 0 0 0 1\n3 3 0 2 0 0 0.7071067811865476 0.7071067811865476\n");
  const auto of = [&](Words words) {
    words.insert(words.begin(), {"evaluate", reference, estimate, "--json", "-"});
    return Json::parse(run(words).output)["estimates"][0];
  };
  const Json none = of({});
  EXPECT_NEAR(none["ape"]["rmse"], std::sqrt(14. / 4), 1e-12);
  EXPECT_NEAR(none["ape"]["mean"], 1.5, 1e-12);
  EXPECT_NEAR(none["ape"]["median"], 1.5, 1e-12);
  EXPECT_NEAR(none["ape"]["std"], std::sqrt(14. / 4 - 2.25), 1e-12);
  EXPECT_NEAR(none["ape"]["sse"], 14, 1e-12);
  EXPECT_TRUE(none["consistent"].is_null());
  EXPECT_NEAR(of({"-r", "angle_deg"})["ape"]["max"], 90, 1e-9);
  EXPECT_NEAR(of({"-r", "rot_part"})["ape"]["max"], 2, 1e-12);
  EXPECT_NEAR(of({"-r", "full"})["ape"]["sse"], 9 + 1 + 4 + 4, 1e-12);
  EXPECT_NEAR(of({"--change_unit", "cm"})["ape"]["sse"], 14e4, 1e-6);
  EXPECT_NEAR(of({"--project_to_plane", "xy"})["ape"]["sse"], 9, 1e-12);
  EXPECT_NEAR(of({"--delta", "3"})["rpe"]["max"], 2, 1e-12);
  EXPECT_EQ(of({"-u", "m"})["rpe_pairs"], 2);
  EXPECT_EQ(of({"--t_start", "1.5"})["matched"], 2);
  EXPECT_EQ(of({"--downsample", "2"})["matched"], 2);
  EXPECT_NEAR(of({"--align_origin"})["ape"]["max"], 3, 1e-12);
}

TEST(EvaluateCommand, ResultFileIsThatOfEvo) {
  const Files files;
  const std::string path = files.directory / "ape.zip", rpe = files.directory / "rpe.zip";
  const Json json =
      files.json({"-a", "--association", "nearest", "--save_results", path, "--save_rpe", rpe})["estimates"][0];
  const std::vector<ZipMember> members = readZipArchive(contentOf(path), path);
  const auto member = [&](const std::vector<ZipMember>& list, const std::string& name) -> std::string {
    for (const ZipMember& m : list) {
      if (m.name == name) return m.content;
    }
    ADD_FAILURE() << name;
    return {};
  };
  const auto numbers = [](const std::string& npy, const std::string& shape) {
    EXPECT_EQ(npy.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
    const std::size_t length = static_cast<unsigned char>(npy[8]) + 256U * static_cast<unsigned char>(npy[9]);
    EXPECT_EQ((10 + length) % 64, 0U);
    EXPECT_EQ(npy[9 + length], '\n');
    EXPECT_TRUE(contains(npy.substr(10, length), "'descr': '<f8', 'fortran_order': False, 'shape': " + shape))
        << npy.substr(10, length);
    std::vector<double> values((npy.size() - 10 - length) / 8);
    std::memcpy(values.data(), npy.data() + 10 + length, 8 * values.size());
    return values;
  };
  const Json info = Json::parse(member(members, "info.json")), stats = Json::parse(member(members, "stats.json"));
  EXPECT_EQ(info["title"], "APE w.r.t. translation part (m)\n(with SE(3) Umeyama alignment)");
  EXPECT_EQ(info["label"], "APE (m)");
  EXPECT_EQ(info["ref_name"], "gt.tum");
  EXPECT_EQ(stats["rmse"], json["ape"]["rmse"]);
  EXPECT_EQ(stats.size(), 7U);
  const std::vector<double> errors = numbers(member(members, "error_array.npy"), "(60,)");
  double sse = 0;
  for (const double e : errors) sse += e * e;
  EXPECT_NEAR(sse, stats["sse"], 1e-12);
  EXPECT_EQ(numbers(member(members, "alignment_transformation_sim3.npy"), "(4, 4)").size(), 16U);
  EXPECT_EQ(numbers(member(members, "nees.npy"), "(60,)").size(), 60U);
  EXPECT_NEAR(numbers(member(members, "seconds_from_start.npy"), "(60,)").back(), 5.9, 1e-9);
  const std::string tum = member(members, "est.tum.tum");
  EXPECT_NE(tum.back(), '\n');
  EXPECT_FALSE(contains(tum, "  "));
  EXPECT_FALSE(contains(tum, " \n"));
  // RPE arrays begin at the second pose, trajectories at the first.
  const std::vector<ZipMember> relative = readZipArchive(contentOf(rpe), rpe);
  EXPECT_EQ(numbers(member(relative, "error_array.npy"), "(59,)").size(), 59U);
  EXPECT_EQ(numbers(member(relative, "timestamps.npy"), "(59,)").size(), 59U);
  EXPECT_EQ(Json::parse(member(relative, "info.json"))["title"],
            "RPE w.r.t. translation part (m)\nfor delta = 1 (frames) using consecutive pairs\n(with SE(3) Umeyama "
            "alignment)");
  // From C++: the same bytes.
  const Trajectory truth = readTrajectory(files.reference), estimate = readTrajectory(files.estimate);
  const EvaluationOptions how{.association = {.rule = AssociationRule::nearest}, .alignment = AlignmentModel::se3};
  const TrajectoryEvaluation evaluated = evaluateTrajectory(
      {.times = truth.times, .poses = exactPoses(truth.poses)},
      {.times = estimate.times, .poses = gaussiansOf(estimate, "right"), .has_covariances = true}, how);
  EXPECT_EQ(evoResult(evaluated, how, EvoErrors::ape, {"gt.tum", "est.tum"}), contentOf(path));
  EXPECT_EQ(evoResult(evaluated, how, EvoErrors::rpe, {"gt.tum", "est.tum"}), contentOf(rpe));
  // Python's own reader, where there is one.
  const ProgramResult python = runProgram({"python3", "-c",
                                           "import sys, zipfile, json\n"
                                           "z = zipfile.ZipFile(sys.argv[1])\n"
                                           "assert z.testzip() is None\n"
                                           "json.loads(z.read('info.json'))\n"
                                           "assert z.getinfo('error_array.npy').compress_type == zipfile.ZIP_STORED\n",
                                           path},
                                          ".");
  if (python.found) {
    EXPECT_EQ(python.status, 0) << python.errors;
  }
  EXPECT_EQ(crc32("123456789"), 0xcbf43926u);
  // A file that is no archive is named.
  EXPECT_TRUE(contains(errorOf([] { readZipArchive("nonsense", "x.zip"); }), "x.zip"));
}

TEST(EvaluateCommand, PageAndSeveralEstimates) {
  const Files files;
  const std::string second = files.directory.write("second.tum", contentOf(files.estimate));
  const std::string page = files.directory / "page";
  const ProgramOutput out = run({"evaluate", files.reference, files.estimate, second, "-a", "--report", page});
  EXPECT_EQ(out.exit_code, 0) << out.error;
  const std::string html = contentOf(page + "/index.html");
  EXPECT_TRUE(contains(html, "consistent"));
  EXPECT_TRUE(contains(html, "second.tum"));
  for (const char* plot :
       {"/trajectories.csv", "/errors_over_time.csv", "/path_1.csv", "/path_2.csv", "/segments.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(page + plot)) << plot;
  }
  EXPECT_LT(html.find("<table"), html.find("<figure")) << "numbers first";
  EXPECT_TRUE(contains(contentOf(page + "/errors_over_time.csv"), ",second.tum,0,")) << "time from the start";
  EXPECT_TRUE(std::filesystem::exists(page + "/errors_1.csv"));
  EXPECT_TRUE(std::filesystem::exists(page + "/nees_1.csv"));
  EXPECT_TRUE(contains(out.output, "second.tum: no verdict: the estimate has no covariances"));
  // An estimate that was not tested has neither passed nor failed.
  EXPECT_TRUE(contains(html, "<p class=\"verdict none\">–")) << html.substr(0, 6000);
  EXPECT_FALSE(contains(html, "✗"));
  EXPECT_FALSE(contains(html, "✓"));
  const auto sign = [&page](const Files& f, Words words) {
    words.insert(words.begin(), {"evaluate", f.reference, f.estimate});
    words.insert(words.end(), {"--report", page});
    run(words);
    const std::string text = contentOf(page + "/index.html");
    return std::string(contains(text, "✓") ? "yes" : contains(text, "✗") ? "no" : "none");
  };
  EXPECT_EQ(sign(files, {"-a"}), "yes");
  EXPECT_EQ(sign(Files(60, 0.25), {"-a"}), "no");
  EXPECT_EQ(sign(files, {"-a", "--fail-if", "ape_rmse>0"}), "no");
}

TEST(EvaluateCommand, EstimatesOfOneNameAreToldApart) {
  const Files files;
  const auto& d = files.directory;
  for (const char* folder : {"a", "b"}) {
    std::filesystem::create_directory(d.path() / folder);
    d.write(std::string(folder) + "/est.tum", contentOf(files.estimate));
  }
  const std::string table = d / "table.csv";
  run({"evaluate", files.reference, d / "a/est.tum", d / "b/est.tum", d / "b/est.tum", "-a", "--table", table});
  const std::string csv = contentOf(table);
  EXPECT_TRUE(contains(csv, "file,ape_rmse,")) << csv;
  EXPECT_TRUE(contains(csv, "\n\"a/est.tum\",")) << csv;
  EXPECT_TRUE(contains(csv, "b/est.tum (1)\",")) << csv;
  EXPECT_TRUE(contains(csv, "b/est.tum (2)\",")) << csv;
  // Each file is read once, so that a pipe is as good as a file.
  const ProgramResult pipes = runProgram(
      {"bash", "-c", "\"$0\" evaluate <(cat \"$1\") <(cat \"$2\") -a && \"$0\" convert <(cat \"$2\") - --to csv",
       LIESTAT_PROGRAM, files.reference, files.estimate},
      ".");
  EXPECT_EQ(pipes.status, 0) << pipes.errors;
}

TEST(EvaluateCommand, ErrorsByTheLengthOfASegment) {
  // A straight line of 100 m that is 2 % too long: each segment is 2 % off.
  const TemporaryDirectory d;
  std::string truth, estimate;
  for (int i = 0; i <= 400; ++i) {
    truth += fmt::format("{} {} 0 0 0 0 0 1\n", 0.1 * i, 0.25 * i);
    estimate += fmt::format("{} {} 0 0 0 0 0 1\n", 0.1 * i, 0.255 * i);
  }
  const ProgramOutput out = run({"evaluate", d.write("gt.tum", truth), d.write("est.tum", estimate), "--json", "-"});
  const Json segments = Json::parse(out.output)["estimates"][0]["segments"];
  ASSERT_EQ(segments.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k) {
    const double length = 16 * static_cast<double>(k + 1);
    EXPECT_EQ(segments[k]["length"], length);
    EXPECT_NEAR(segments[k]["translation"]["median"].get<double>(), 0.02 * length, 1e-6);
    EXPECT_NEAR(segments[k]["rotation"]["max"].get<double>(), 0, 1e-6);
  }
}

TEST(EvaluateCommand, ScaleAloneIsJudgedBySim3) {
  const Files files;
  const Json scale = files.json({"-s"})["estimates"][0];
  EXPECT_EQ(scale["alignment"]["model"], "scale");
  EXPECT_EQ(scale["weighted_alignment"]["model"], "sim3");
  EXPECT_EQ(scale, files.json({"--alignment", "scale"})["estimates"][0]);
}

TEST(EvaluateCommand, ConditionsForPipelines) {
  const Files files;
  EXPECT_EQ(run({"evaluate", files.reference, files.estimate, "-a", "--fail-if", "ape_rmse>10,consistent<1"}).exit_code,
            0);
  const ProgramOutput failed = run({"evaluate", files.reference, files.estimate, "-a", "--fail-if", "ape_rmse>0.001"});
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_TRUE(contains(failed.output, "failed: est.tum: ape_rmse>0.001")) << failed.output;
  const ProgramOutput unknown = run({"evaluate", files.reference, files.estimate, "--fail-if", "ape_rms>1"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(contains(unknown.error, "ape_rmse")) << unknown.error;
  EXPECT_EQ(run({"evaluate", files.reference, files.estimate, "--fail-if", "ape_rmse"}).exit_code, 2);
  // A figure that is not known does not pass.
  EXPECT_EQ(run({"evaluate", files.reference, files.estimate, "--fail-if", "rpe_nees>2"}).exit_code, 1);
}

TEST(EvaluateCommand, ConventionsAreAppliedBeforeTheAlignment) {
  const Files files(100);
  Convention ros;
  ros.perturbation = Perturbation::world_axes;
  const std::string rows =
      files.directory.write("ros.txt", tumWithCovariance(files.scene.times, files.scene.estimate, ros));
  const Words base{"evaluate", files.reference, rows, "--json", "-", "-a", "--format", "tum", "--cov-layout", "full36"};
  const auto with = [&](const std::string& convention) {
    Words words = base;
    words.insert(words.end(), {"--cov-from", convention});
    return Json::parse(run(words).output)["estimates"][0];
  };
  EXPECT_EQ(with("ros-fixed")["consistent"], true);
  EXPECT_EQ(with("right")["consistent"], false);
  // A convention that no file states is asked for.
  const ProgramOutput unsaid = run(base);
  EXPECT_EQ(unsaid.exit_code, 2);
  EXPECT_TRUE(contains(unsaid.error, "--cov-from")) << unsaid.error;
}

TEST(EvaluateCommand, BadInputIsSaid) {
  const Files files(20);
  const auto error = [&](const Words& words) {
    const ProgramOutput out = run(words);
    EXPECT_EQ(out.exit_code, 2) << out.output;
    return out.error;
  };
  const auto& d = files.directory;
  const std::string late = d.write("late.tum", "100 0 0 0 0 0 0 1\n101 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(contains(error({"evaluate", files.reference, late}), "do not overlap"));
  const std::string one = d.write("one.tum", "0.5 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(contains(error({"evaluate", files.reference, one}), "at least two"));
  const std::string twice = d.write("twice.tum", "0.5 0 0 0 0 0 0 1\n0.6 0 0 0 0 0 0 1\n0.6 1 0 0 0 0 0 1\n");
  EXPECT_TRUE(contains(error({"evaluate", files.reference, twice}), "twice.tum:3: the time 0.6 stands in line 2 too"));
  // A rule for it, rows that are not sorted, another unit: read, and said.
  const ProgramOutput dropped = run({"evaluate", files.reference, twice, "--duplicates", "drop"});
  EXPECT_TRUE(contains(dropped.output, "1 stamp has different poses (first line 3): the first is taken"))
      << dropped.error;
  const std::string back = d.write("back.tum", "0.6 0 0 0 0 0 0 1\n0.4 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(contains(run({"evaluate", files.reference, back}).output, "sorted by time"));
  const std::string ns =
      d.write("ns.tum", "200000000 0 0 0 0 0 0 1\n300000000 0 0 0 0 0 0 1\n400000000 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(contains(error({"evaluate", files.reference, ns}), "--time-unit ns"));
  EXPECT_EQ(run({"evaluate", files.reference, ns, "--time-unit", "ns"}).exit_code, 0);
  const std::string truth = d.write("truth.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n");
  const std::string graph = d.write("graph.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 2 2 0 0\n");
  EXPECT_TRUE(contains(error({"evaluate", truth, graph}), "graph.g2o: there is no vertex 1"));
  const std::string mixed = d.write("mixed.tum", "0.5 0 0 0 0 0 0 1\n0.6 0 0 0 0 0 0 1 5\n");
  EXPECT_TRUE(contains(error({"evaluate", files.reference, mixed, "--format", "tum"}), "mixed.tum:2"));
  EXPECT_TRUE(contains(error({"evaluate", files.reference, files.estimate, "--change_unit", "deg"}), "--change_unit"));
  EXPECT_TRUE(contains(error({"evaluate", files.reference, files.estimate, "-d", "0.5"}), "--delta"));
  // Indefinite covariances: how many, where.
  auto spoiled = files.scene.estimate;
  spoiled[4].covariance(0, 1) = spoiled[4].covariance(1, 0) = 2 * spoiled[4].covariance.diagonal().maxCoeff();
  d.write("est.tum.cov", covarianceFileOf(files.scene.times, spoiled, {}));
  const ProgramOutput out = run({"evaluate", files.reference, files.estimate, "-a"});
  EXPECT_EQ(out.exit_code, 3) << out.error;
  EXPECT_TRUE(contains(out.output, "1 of 20 covariances are not positive definite or not known (line 5)"))
      << out.output;
}

// Golden results of evo 1.36.5 (data/evaluate/README.md): statistics, titles and labels of 23 sets of options.
TEST(EvaluateCommand, EqualsEvosGoldenResults) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const std::string folder = std::string(data) + "/evaluate/";
  const TemporaryDirectory directory;
  const std::string path = directory / "evo.zip";
  const Json golden = Json::parse(contentOf(folder + "evo.json"));
  ASSERT_EQ(golden["results"].size(), 23U);
  for (const Json& result : golden["results"]) {
    const bool ape = result["command"] == "ape";
    Words words{"evaluate",
                folder + "reference.tum",
                folder + "estimate.tum",
                "--association",
                "nearest",
                "--json",
                "-",
                ape ? "--save_results" : "--save_rpe",
                path};
    for (const Json& option : result["options"]) words.push_back(option);
    const std::string what = result["command"].get<std::string>() + " " + result["options"].dump();
    const ProgramOutput out = run(words);
    ASSERT_EQ(out.exit_code, 0) << what << out.error;
    const Json ours = Json::parse(out.output)["estimates"][0][ape ? "ape" : "rpe"];
    for (const auto& [figure, value] : result["stats"].items()) {
      const double expected = value;
      // Thousands of poses' sums are rounded, relative to them.
      EXPECT_NEAR(ours[figure].get<double>(), expected, 1e-10 * std::max(1., expected)) << what << ' ' << figure;
    }
    const std::vector<ZipMember> members = readZipArchive(contentOf(path), path);
    ASSERT_EQ(members[0].name, "info.json");
    const Json info = Json::parse(members[0].content);
    EXPECT_EQ(info["title"], result["title"]) << what;
    EXPECT_EQ(info["label"], result["label"]) << what;
  }
}

// V1_02 with exact covariances, 35 mm: a reference of 200 Hz has no note, one of 5 Hz a note and no false verdict, of 1 Hz no
// verdict on the covariances at all. 5 Hz was OVERCONFIDENT, and 1 Hz had an APE of 0.104 m without a word.
TEST(EvaluateCommand, CoarseReferencesAreSaid) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const TemporaryDirectory directory;
  const Trajectory truth = readTrajectory(std::string(data) + "/vi/euroc/V1_02_medium_gt.csv");
  CounterRng rng(78);
  std::vector<double> times;
  std::vector<Gaussian<SE3d>> estimate;
  for (std::size_t i = 3; i < truth.size(); i += 37) {
    const Matrix6d C = experiments::sceneCovariance({.sigma_translation = 0.017, .sigma_rotation = 0.01}, rng);
    times.push_back(truth.times[i]);
    estimate.push_back({truth.poses[i] * sample(Gaussian<SE3d>{SE3d(), C}, rng).inverse(), C});
  }
  const std::string file = directory.write("est.tum", tumOf(times, posesOf(estimate)));
  directory.write("est.tum.cov", covarianceFileOf(times, estimate, {}));
  const auto thinned = [&](std::size_t every) {
    std::vector<double> stamps;
    std::vector<SE3d> poses;
    for (std::size_t i = 0; i < truth.size(); i += every) {
      stamps.push_back(truth.times[i]), poses.push_back(truth.poses[i]);
    }
    const ProgramOutput out = run({"evaluate", directory.write("gt.tum", tumOf(stamps, poses)), file, "--json", "-"});
    return Json::parse(out.output)["estimates"][0];
  };
  const auto note = [](const Json& json) { return contains(json["notes"].dump(), "the reference is coarse"); };
  const Json fine = thinned(1), coarse = thinned(40), coarsest = thinned(200);
  EXPECT_EQ(fine["consistent"], true) << fine["verdict"];
  EXPECT_FALSE(note(fine));
  EXPECT_EQ(coarse["consistent"], true) << coarse["verdict"];
  EXPECT_TRUE(note(coarse));
  EXPECT_NEAR(coarse["interpolation_rotation"].get<double>(), 0.006, 0.003);
  EXPECT_TRUE(coarsest["consistent"].is_null()) << coarsest["verdict"];
  EXPECT_TRUE(note(coarsest));
  EXPECT_GT(coarsest["ape"]["rmse"].get<double>(), 0.06);
}

// The commonest file of ROS: x, y and yaw are right, the others have fillers.
TEST(EvaluateCommand, PlanarRobotsOfRos) {
  for (const double filler : {1e-6, 1e-9, 0., 1e6, 99999., 1e308}) {
    CounterRng rng(12);
    const experiments::TrajectoryScene scene =
        experiments::emptyScene({.motion = experiments::SceneMotion::planar, .n = 100}, rng);
    std::string rows;
    for (std::size_t i = 0; i < 100; ++i) {
      const double sigma = 0.05 * std::exp(rng.uniform() - 0.5);
      const Eigen::Vector3d e = sigma * rng.normalVector<3>();
      const SE3d& T = scene.truth[i];
      const SE3d at(T.so3() * SO3d::rotZ(e[2]), Eigen::Vector3d(T.translation() + Eigen::Vector3d(e[0], e[1], 0)));
      rows += tumOf({scene.times[i]}, {at});
      rows.pop_back();
      for (int k = 0; k < 36; ++k) {
        const bool in_plane = k / 6 < 2 || k / 6 == 5;
        rows += fmt::format(" {}", k / 6 != k % 6 ? 0. : in_plane ? sigma * sigma : filler);
      }
      rows += "\n";
    }
    const TemporaryDirectory directory;
    const ProgramOutput out =
        run({"evaluate", directory.write("gt.tum", tumOf(scene.times, scene.truth)), directory.write("e.tum", rows),
             "--format", "tum", "--cov-layout", "full36", "--cov-from", "ros-fixed"});
    EXPECT_TRUE(contains(out.output, "consistent in x, y, rotation z: NEES")) << filler << out.error << out.output;
    EXPECT_TRUE(contains(out.output, "not judged: z, rotation x, rotation y (errors are zero in every row)"))
        << out.output;
  }
}

TEST(EvaluateCommand, QuaternionsWithWFirstAreSuspected) {
  const Files files(100);
  std::string text;
  for (std::size_t i = 0; i < 100; ++i) {
    const SE3d& T = files.scene.estimate[i].mean;
    const Eigen::Vector4d q = T.so3().params();
    text += fmt::format("{:.9f} {} {} {} {} {} {} {}\n", files.scene.times[i], T.translation()[0], T.translation()[1],
                        T.translation()[2], q[3], q[0], q[1], q[2]);
  }
  const std::string w_first = files.directory.write("w.tum", text);
  EXPECT_TRUE(contains(run({"evaluate", files.reference, w_first}).output, "w.tum look as if w came first"));
  EXPECT_FALSE(contains(run({"evaluate", files.reference, files.estimate}).output, "w came first"));
}

}  // namespace
}  // namespace liestat::cli
