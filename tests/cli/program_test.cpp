// The built program, as a user runs it: exit codes, messages, JSON.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <report/run_program.hpp>
#include <cli/words.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;
constexpr double pi = 3.14159265358979323846;

// Under the sanitizers, which slow estimates down tenfold, the same properties are asked of smaller runs; all bounds
// here go with the size.
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LIESTAT_INSTRUMENTED
#endif
#endif
#if defined(LIESTAT_INSTRUMENTED) || defined(__SANITIZE_ADDRESS__)
constexpr bool instrumented = true;
#else
constexpr bool instrumented = false;
#endif

/// One run in a directory of its own.
struct ProgramRun {
  int status = -1;
  std::string errors;
  Json json;  ///< null if none was written
};

class Program : public ::testing::Test {
 protected:
  ProgramRun run(Words arguments) const {
    arguments.insert(arguments.begin(), LIESTAT_PROGRAM);
    const ProgramResult result = runProgram(arguments, directory_.path().string());
    EXPECT_TRUE(result.found) << result.errors;
    ProgramRun done{result.status, result.errors, nullptr};
    if (std::filesystem::exists(directory_ / "out.json")) done.json = Json::parse(contentOf(directory_ / "out.json"));
    std::filesystem::remove(directory_ / "out.json");
    return done;
  }

  /// `liestat mean` of a text, with JSON.
  ProgramRun mean(const std::string& text, const Words& options = {}) const {
    directory_.write("f.csv", text);
    return run(Words{"mean", "f.csv", "--json", "out.json"} + options);
  }

  /// The message of a run that must end with exit code 2 and one line.
  std::string refusal(const std::string& text, const Words& options = {}) const {
    const ProgramRun r = mean(text, options);
    EXPECT_EQ(r.status, 2) << text;
    EXPECT_TRUE(r.json.is_null()) << "nothing is written";
    EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
    return r.errors;
  }

  TemporaryDirectory directory_;
};

/// Repeatable noise with a standard deviation near one, without a distribution whose bits differ between libraries.
class Noise {
 public:
  double operator()() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) {
      state_ = state_ * 6364136223846793005U + 1442695040888963407U;
      sum += static_cast<double>(state_ >> 11) * 0x1p-53;
    }
    return sum;
  }

 private:
  std::uint64_t state_ = 1;
};

std::string rotations(std::size_t n, double sd) {
  Noise noise;
  std::string text = "rx,ry,rz\n";
  for (std::size_t i = 0; i < n; ++i) {
    const double x = sd * noise(), y = sd * noise(), z = sd * noise();
    text += fmt::format("{:.9f},{:.9f},{:.9f}\n", x, y, z);
  }
  return text;
}

std::string frames(std::size_t n) {
  Noise noise;
  std::string text = "tx,ty,tz,rx,ry,rz\n";
  for (std::size_t i = 0; i < n; ++i) {
    text += fmt::format("{},{},{},", 5 + noise(), noise(), noise());
    text += fmt::format("{},{},{}\n", 1 + 0.2 * noise(), 0.2 * noise(), 0.2 * noise());
  }
  return text;
}

TEST_F(Program, HelpAndVersion) {
  EXPECT_EQ(run({"--help"}).status, 0);
  EXPECT_EQ(run({"--version"}).status, 0);
  EXPECT_EQ(run({"mean", "--help"}).status, 0);
  EXPECT_EQ(run({"validate", "split", "--help"}).status, 0);
}

TEST_F(Program, BadUsageIsOneLineAndTwo) {
  for (const Words& arguments : {Words{},
                                 {"mean"},
                                 {"no_such_command"},
                                 {"validate"},
                                 {"mean", "f.csv", "--feature", "line"},
                                 {"mean", "f.csv", "--threads", "-1"},
                                 {"mean", "f.csv", "--norm-tolerance", "much"},
                                 {"mean", "f.csv", "--norm-tolerance", "nan"},
                                 {"mean", "f.csv", "--budget", "-1"},
                                 {"validate", "means", "--seed", "-1"},
                                 {"validate", "means", "--spread", "1,-nan"},
                                 {"vi-init", "--imu", "i", "--tracks", "t", "--max-gap", "nan"},
                                 {"simulate", "vi", "--output", "d", "--box", "1,nan,1"},
                                 {"motion"},
                                 {"motion", "t.csv", "--sigma", "-1"},
                                 {"motion", "t.csv", "--passes", "0"},
                                 {"motion", "t.csv", "--imu", "i", "--rates", "r"},
                                 {"motion", "t.csv", "--gyroscope-bias", "1,inf,0"},
                                 {"simulate", "motion"},
                                 {"simulate", "motion", "--output", "d", "--frames", "1"},
                                 {"validate", "split"},
                                 {"validate", "split", "f.csv", "--blocks", "3"}}) {
    const ProgramRun r = run(arguments);
    EXPECT_EQ(r.status, 2) << ::testing::PrintToString(arguments);
    EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
  }
}

TEST_F(Program, SeveralTasksOfMpiDoNotDoTheSameWork) {
  for (const std::string variable : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"}) {
    const auto under = [&](const std::string& tasks) {
      return runProgram({"env", variable + "=" + tasks, "SLURM_NTASKS=4", LIESTAT_PROGRAM, "--version"}, ".");
    };
    const ProgramResult several = under("4");
    EXPECT_EQ(several.status, 2);
    EXPECT_TRUE(several.errors.find("started as 4 tasks") != std::string::npos &&
                several.errors.find(variable) != std::string::npos)
        << several.errors;
    EXPECT_EQ(std::count(several.errors.begin(), several.errors.end(), '\n'), 1);
    EXPECT_EQ(under("1").status, 0);
  }
}

TEST_F(Program, AMistypedWordIsNamedWithTheNearest) {
  const auto complaint = [this](const Words& arguments) {
    const ProgramRun r = run(arguments);
    EXPECT_EQ(r.status, 2) << ::testing::PrintToString(arguments);
    return r.errors;
  };
  const std::string commands =
      "Commands: compare, convert, doctor, evaluate, fit, hand-eye, mean, merge, motion, preintegrate, "
      "tag-pose, track, two-view, vi-init, simulate, validate (liestat --help explains the usage)\n";
  EXPECT_EQ(complaint({"bogus"}), "liestat: bogus is no command. " + commands);
  EXPECT_EQ(complaint({"maen", "f.csv"}), "liestat: maen is no command, did you mean mean? " + commands);
  EXPECT_EQ(complaint({"viinit"}), "liestat: viinit is no command, did you mean vi-init? " + commands);
  EXPECT_EQ(complaint({std::string(10000, 'x')}).rfind(commands),
            complaint({std::string(10000, 'x')}).size() - commands.size());
  EXPECT_EQ(complaint({"validate", "men"}).substr(0, 62),
            "liestat: men is no validate command, did you mean means? Comma");
  EXPECT_EQ(complaint({"mean", "f.csv", "--theads", "2"}),
            "liestat: The following arguments were not expected: 2 --theads, did you mean --threads? (liestat --help "
            "explains the usage)\n");
  // A page is several files.
  for (const std::string command : {"mean", "motion"}) {
    EXPECT_EQ(complaint({command, "f.csv", "--report", "-"}),
              "liestat: --report: - is standard output; a directory is expected (liestat --help explains the usage)\n");
  }
}

TEST_F(Program, TheManualAndTheCompletionNameEveryCommand) {
  const auto output = [this](const std::string& command) {
    const ProgramResult result =
        runProgram({"bash", "-c", command + " > out.txt", LIESTAT_PROGRAM}, directory_.path().string());
    EXPECT_EQ(result.status, 0) << command << ": " << result.errors;
    return contentOf(directory_ / "out.txt");
  };
  const std::string manual = output("\"$0\" --man"), completion = output("\"$0\" --completion");
  for (const std::string command :
       {"compare", "convert", "fit", "hand-eye", "mean", "merge", "motion", "preintegrate", "two-view", "vi-init",
        "simulate vi", "simulate hand-eye", "validate split", "validate two-view", "validate vi-init"}) {
    EXPECT_NE(manual.find(".SS \"liestat " + command), std::string::npos) << command;
    EXPECT_NE(completion.find('"' + command + "\")\n"), std::string::npos) << command;
  }
  EXPECT_NE(manual.find("\\fB\\-\\-json\\fR"), std::string::npos);
  directory_.write("completion.bash", completion);
  const auto completed = [&](const std::string& words) {
    return output("source ./completion.bash; COMP_WORDS=(liestat " + words +
                  "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _liestat; echo \"${COMPREPLY[*]}\"");
  };
  EXPECT_EQ(completed("me"), "mean merge\n");
  EXPECT_EQ(completed("validate spl"), "split\n");
  EXPECT_EQ(completed("mean poses.txt --crit"), "--criterion\n");
  EXPECT_EQ(completed("mean poses.txt --criterion ''"), "lsq wlsq maha\n");
  EXPECT_EQ(completed("mean ''"), "\n") << "file names are bash's own business";
}

TEST_F(Program, BoundsOfAnOptionAreSaid) {
  EXPECT_EQ(run({"validate", "means", "--spread", "0"}).errors,
            "liestat: --spread: 0 is not between 1e-09 and 10 (liestat --help explains the usage)\n");
  EXPECT_EQ(run({"validate", "means", "--seed", "-1"}).errors,
            "liestat: --seed: -1 is negative (liestat --help explains the usage)\n");
}

TEST_F(Program, AValidationThatJudgesNothingHasNotPassed) {
  const std::string run = "cd '" + directory_.path().string() +
                          "' && '" LIESTAT_PROGRAM
                          "' validate means --feature frame --n 2 --criterion lsq --trials 50 > out.txt 2>&1";
  EXPECT_EQ(WEXITSTATUS(std::system(run.c_str())), 1);
  const std::string text = contentOf(directory_ / "out.txt");
  EXPECT_NE(text.find("nothing was judged\nFAILED\n"), std::string::npos) << text;
}

TEST_F(Program, AFullDiskIsNoSuccess) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  std::ofstream(directory_ / "f.csv") << "x,y,z\n1,2,3\n1,2,4\n2,2,3\n1,3,3\n";
  const std::string command = "cd '" + directory_.path().string() + "' && '" LIESTAT_PROGRAM "' mean f.csv ";
  EXPECT_EQ(WEXITSTATUS(std::system((command + ">/dev/null 2>&1").c_str())), 0);
  EXPECT_EQ(WEXITSTATUS(std::system((command + ">/dev/full 2>&1").c_str())), 2);
}

TEST_F(Program, MissingFile) {
  const ProgramRun r = run({"mean", "absent.csv"});
  EXPECT_EQ(r.status, 2);
  EXPECT_EQ(r.errors, "absent.csv: no such file\n");
}

TEST_F(Program, BadInputNamesFileAndLine) {
  EXPECT_EQ(refusal(""), "f.csv: the file is empty\n");
  EXPECT_EQ(refusal("# nothing\n"), "f.csv: the file has no data, only blank lines and comments\n");
  EXPECT_EQ(refusal("x,y,w\n1,2,3\n").substr(0, 27), "f.csv:1: unknown column 'w'");
  EXPECT_EQ(refusal("x,y,z\n1,2,3\n1,two,3\n").substr(0, 9), "f.csv:3: ");
  EXPECT_EQ(refusal("x,y,z\n1,nan,3\n").substr(0, 9), "f.csv:2: ");
  EXPECT_EQ(refusal("x,y,z\n1,2,3\n\n1,2,inf\n").substr(0, 9), "f.csv:4: ");
  EXPECT_EQ(refusal("qx,qy,qz,qw\n0,0,0,1\n0,0,0,2\n"),
            "f.csv:3: the norm of the quaternion is 2, expected 1 within 0.001, or a larger --norm-tolerance\n");
  EXPECT_EQ(refusal("x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n1,2,3,1,2,0,1,0,1\n").substr(0, 49),
            "f.csv:2: the covariance is not positive definite ");
  EXPECT_EQ(refusal("x,y,z,weight\n1,2,3,0\n"), "f.csv:2: every weight is 0, expected one above 0\n");
  EXPECT_EQ(refusal("x,y,z,weight\n1,2,3,-1\n"), "f.csv:2: weight is -1, expected 0 or more\n");
}

TEST_F(Program, WishesThatDoNotFitTheFile) {
  const std::string covariances =
      "tx,ty,tz,rx,ry,rz,cov_00,cov_01,cov_02,cov_03,cov_04,cov_05,cov_11,cov_12,cov_13,cov_14,cov_15,"
      "cov_22,cov_23,cov_24,cov_25,cov_33,cov_34,cov_35,cov_44,cov_45,cov_55\n"
      "1,2,3,0,0,0,1,0,0,0,0,0,1,0,0,0,0,1,0,0,0,1,0,0,1,0,1\n";
  EXPECT_NE(refusal(covariances).find("--covariance-at measured"), std::string::npos);
  EXPECT_NE(refusal(covariances, {"--criterion", "maha"}).find("--covariance-at measured"), std::string::npos);
  EXPECT_EQ(mean(covariances, {"--criterion", "lsq"}).status, 0);
  EXPECT_EQ(mean(covariances, {"--covariance-at", "estimated"}).status, 0);
  EXPECT_EQ(mean(covariances, {"--feature", "se3", "--criterion", "maha"}).status, 0);
  EXPECT_NE(refusal("x,y,z\n1,2,3\n", {"--criterion", "maha"}).find("cov_00"), std::string::npos);
  EXPECT_NE(refusal("x,y,z\n1,2,3\n", {"--criterion", "wlsq"}).find("weight"), std::string::npos);
  EXPECT_NE(refusal("x,y,z\n1,2,3\n", {"--likelihood"}).find("maha"), std::string::npos);
  EXPECT_NE(refusal("x,y,z\n1,2,3\n", {"--feature", "rotation"}).find("does not fit"), std::string::npos);
  EXPECT_NE(refusal(frames(9), {"--feature", "se3", "--criterion", "lsq"}).find("barycentre"), std::string::npos);
}

TEST_F(Program, QuaternionsNearUnitNormAreNormalisedAndCounted) {
  const std::string text = "qx,qy,qz,qw\n0,0,0,1.0005\n0,0,0,1\n0,0,0.1,0.99498743710662\n0,0.1,0,0.99498743710662\n";
  const ProgramRun r = mean(text);
  EXPECT_EQ(r.status, 0);
  EXPECT_EQ(r.json["n_normalised"], 1);
  EXPECT_EQ(mean(text, {"--norm-tolerance", "1e-4"}).status, 2);
}

TEST_F(Program, OneMeasurementIsItsMean) {
  const ProgramRun r = mean("rx,ry,rz\n0.1,0.2,0.3\n");
  EXPECT_EQ(r.status, 0) << r.errors;
  EXPECT_EQ(r.json["n"], 1);
  EXPECT_NEAR(r.json["mean"]["rotation_vector"][2].get<double>(), 0.3, 1e-12);
  EXPECT_TRUE(r.json["covariance"].is_null());
  EXPECT_EQ(r.json["covariance_status"], "not_applicable");
  EXPECT_EQ(r.json["status"], "not_applicable");
  EXPECT_EQ(r.json["unique"], "unique");
}

TEST_F(Program, FiveFramesHaveNoCovariance) {
  const ProgramRun r = mean(frames(5));
  EXPECT_EQ(r.status, 0);
  EXPECT_TRUE(r.json["covariance"].is_null());
  EXPECT_TRUE(r.json["standard_deviations"].is_null());
  EXPECT_EQ(r.json["covariance_status"], "not_applicable");
  EXPECT_EQ(mean(frames(7)).json["covariance"].size(), 6U);
}

TEST_F(Program, TwoAntipodalRotationsAreAmbiguous) {
  const ProgramRun r = mean(fmt::format("rx,ry,rz\n0,0,0\n{},0,0\n", pi));
  EXPECT_EQ(r.status, 3);
  EXPECT_EQ(r.json["status"], "ambiguous");
  EXPECT_EQ(r.json["unique"], "ambiguous");
  ASSERT_GE(r.json["rivals"].size(), 1U);
  const double one = r.json["mean"]["rotation_vector"][0], other = r.json["rivals"][0]["rotation_vector"][0];
  EXPECT_NEAR(std::abs(one), pi / 2, 1e-6);
  EXPECT_NEAR(one + other, 0, 1e-6);
  EXPECT_TRUE(r.json["covariance"].is_null());
  // The report says so first and draws the rival in both charts.
  EXPECT_EQ(mean(fmt::format("rx,ry,rz\n0,0,0\n{},0,0\n", pi), {"--report", "report"}).status, 3);
  const std::string page = contentOf(directory_ / "report/index.html");
  EXPECT_NE(page.find("</h1>\n<p class=\"verdict bad\">✗ Not to be trusted (ambiguous)"), std::string::npos);
  const std::string csv = contentOf(directory_ / "report/mean.csv");
  for (const char* chart : {"Principal chart", "Exponential chart about the mean"}) {
    EXPECT_NE(csv.find(fmt::format("\n{},rivals of the mean,", chart)), std::string::npos) << chart;
  }
  EXPECT_EQ(mean("rx,ry,rz\n0,0,0\n0.1,0,0\n0,0.2,0\n0,0,0.1\n0.1,0,0.1\n", {"--report", "report"}).status, 0);
  EXPECT_EQ(contentOf(directory_ / "report/mean.csv").find("rivals"), std::string::npos);
}

TEST_F(Program, AnInterruptEndsTheSearchForOtherMeansAndLeavesTheMean) {
  // Frames without orientation all over the rotations: the search would take minutes.
  Noise noise;
  std::string text = "qx,qy,qz,qw,tx,ty,tz\n";
  for (int i = 0; i < 8000; ++i) {
    const double x = noise(), y = noise(), z = noise(), w = noise(),
                 norm = std::hypot(std::hypot(x, y), std::hypot(z, w));
    text += fmt::format("{:.9f},{:.9f},{:.9f},{:.9f},0,0,0\n", x / norm, y / norm, z / norm, w / norm);
  }
  directory_.write("f.csv", text);
  // An interrupt before the search begins ends the program at once, so a busy machine gets more time. Where the tests
  // run in the background interrupts are ignored, and the program would heed that.
  ProgramResult result;
  for (const char* seconds : {"1", "4", "16", "64"}) {
    result = runProgram({"env", "--default-signal=INT", "timeout", "--foreground", "--preserve-status", "-s", "INT",
                         seconds, LIESTAT_PROGRAM, "mean", "f.csv", "--feature", "non_oriented_frame", "--budget",
                         "1000000000000", "--json", "out.json", "--report", "report"},
                        directory_.path().string());
    if (std::filesystem::exists(directory_ / "report/index.html")) break;
  }
  EXPECT_EQ(result.status, 130) << result.errors;
  EXPECT_NE(result.errors.find("liestat: interrupted"), std::string::npos) << result.errors;
  const Json json = Json::parse(contentOf(directory_ / "out.json"));
  EXPECT_EQ(json["interrupted"], true);
  EXPECT_EQ(json["unique"], "not_certified");
  EXPECT_EQ(json["mean"]["rotation_vector"].size(), 3U);
  EXPECT_NE(contentOf(directory_ / "report/index.html").find("interrupted: the search for other means did not go on"),
            std::string::npos);
}

TEST_F(Program, IdenticalMeasurements) {
  std::string text = "qx,qy,qz,qw\n";
  for (int i = 0; i < 20; ++i) text += "0.5,0.5,0.5,0.5\n";
  const ProgramRun r = mean(text);
  EXPECT_EQ(r.status, 0);
  EXPECT_EQ(r.json["status"], "ok");
  for (const auto& row : r.json["covariance"]) {
    for (const auto& entry : row) EXPECT_NEAR(entry.get<double>(), 0, 1e-28);
  }
  EXPECT_NE(r.json["notes"][0].get<std::string>().find("equal"), std::string::npos);
}

TEST_F(Program, AMillionRotations) {
  const std::size_t many = instrumented ? 100000 : 1000000;
  const std::string text = rotations(many, 0.8);
  const auto start = std::chrono::steady_clock::now();
  const ProgramRun r = mean(text);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(r.status, 0) << r.errors;
  EXPECT_EQ(r.json["n"], many);
  EXPECT_NE(r.json["unique"], "ambiguous");
  // Some seconds alone; tests share the machine and may be built with sanitizers.
  EXPECT_LT(elapsed.count(), 240);
}

TEST_F(Program, EveryFeatureFillsItsFields) {
  struct Case {
    std::string text, feature;
    Words fields;
    std::size_t dof;
  };
  const Words pose{"quaternion_xyzw", "rotation_vector", "translation"};
  const std::vector<Case> cases{
      {rotations(30, 0.2), "rotation", {"quaternion_xyzw", "rotation_vector"}, 3},
      {frames(30), "frame", pose, 6},
      {frames(30), "semi_oriented_frame", pose, 6},
      {frames(30), "non_oriented_frame", pose, 6},
      {frames(30), "se3", pose, 6},
      {frames(30), "point", {"point"}, 3},
      {"x,y,z\n1,2,3\n2,3,5\n1,1,1\n4,0,1\n", "point", {"point"}, 3},
      {"dx,dy,dz\n0,0,1\n0,0.6,0.8\n0.6,0,0.8\n0.36,0.48,0.8\n", "direction", {"direction"}, 2}};
  for (const Case& c : cases) {
    const ProgramRun r = mean(c.text, {"--feature", c.feature});
    SCOPED_TRACE(c.feature);
    ASSERT_EQ(r.status, 0) << r.errors;
    for (const std::string& field :
         wordsOf("schema_version program version command_line n mean covariance iterations converged status unique "
                 "rivals covariance_order covariance_side covariance_frame standard_deviations dispersion r_star cells "
                 "n_normalised covariance_status")) {
      EXPECT_TRUE(r.json.contains(field)) << field;
    }
    EXPECT_EQ(r.json["feature"], c.feature);
    EXPECT_EQ(r.json["status"], "ok");
    EXPECT_EQ(r.json["unique"], "unique");
    EXPECT_EQ(r.json["converged"], true);
    EXPECT_EQ(r.json["mean"].size(), c.fields.size());
    for (const std::string& field : c.fields) EXPECT_TRUE(r.json["mean"].contains(field)) << field;
    EXPECT_EQ(r.json["covariance"].size(), c.dof);
    EXPECT_EQ(r.json["dispersion"].size(), c.dof);
  }
}

TEST_F(Program, PointsAgreeWithTheArithmeticMean) {
  const ProgramRun r = mean("x,y,z,weight\n1,0,0,1\n4,3,0,2\n0,0,3,1\n0,1,0,1\n2,1,5,1\n");
  ASSERT_EQ(r.status, 0);
  EXPECT_EQ(r.json["criterion"], "wlsq");
  EXPECT_NEAR(r.json["mean"]["point"][0].get<double>(), 11.0 / 6, 1e-12);
  EXPECT_NEAR(r.json["mean"]["point"][1].get<double>(), 8.0 / 6, 1e-12);
  EXPECT_NEAR(r.json["mean"]["point"][2].get<double>(), 8.0 / 6, 1e-12);
}

TEST_F(Program, KnownCovariancesAreInverseVarianceWeights) {
  const ProgramRun r = mean(
      "x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n"
      "0,0,0,1,0,0,1,0,1\n"
      "4,4,4,3,0,0,3,0,3\n");
  ASSERT_EQ(r.status, 0);
  EXPECT_EQ(r.json["criterion"], "maha");
  EXPECT_NEAR(r.json["mean"]["point"][0].get<double>(), 1, 1e-12);
  EXPECT_NEAR(r.json["covariance"][0][0].get<double>(), 0.75, 1e-12);
  EXPECT_EQ(r.json["covariance_from"], "noise");
}

TEST_F(Program, TheSameBitsForAnyNumberOfThreads) {
  std::string text = "rx,ry,rz,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
  Noise noise;
  for (int i = 0; i < 5000; ++i) {
    text += fmt::format("{},{},{},", 0.3 * noise(), 0.2 * noise(), 0.1 * noise()) + "0.09,0,0,0.04,0,0.01\n";
  }
  for (const char* criterion : {"lsq", "maha"}) {
    Json one = mean(text, {"--criterion", criterion, "--threads", "1"}).json;
    Json two = mean(text, {"--criterion", criterion, "--threads", "2"}).json;
    ASSERT_FALSE(one.is_null());
    one.erase("command_line");
    two.erase("command_line");
    EXPECT_EQ(one.dump(), two.dump()) << criterion;
  }
}

TEST_F(Program, StandardInputAndOutput) {
  directory_.write("f.csv", "x,y,z\n1,2,3\n");
  const ProgramResult result = runProgram({"sh", "-c", "\"$0\" mean - --json - < f.csv > out.json", LIESTAT_PROGRAM},
                                          directory_.path().string());
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(Json::parse(contentOf(directory_ / "out.json"))["n"], 1) << "nothing but JSON";
}

TEST_F(Program, ValidationsWriteNothingButJsonWhereItGoesToStandardOutput) {
  for (const char* what : {"means --feature point --noise iid --n 5", "propagation --feature rotation --spread 0.1",
                           "preintegration --window 0.1 --noise 1"}) {
    const std::string command = std::string("\"$0\" validate ") + what + " --trials 20 --json - > out.json";
    const ProgramResult result = runProgram({"sh", "-c", command, LIESTAT_PROGRAM}, directory_.path().string());
    EXPECT_EQ(result.status, 0) << result.errors;
    const Json json = Json::parse(contentOf(directory_ / "out.json"));
    EXPECT_FALSE(json["rows"].empty()) << what;
    EXPECT_EQ(json["passed"], true) << what;
  }
}

TEST_F(Program, ReportIsWritten) {
  const ProgramRun r = mean(frames(40), {"--report", "report"});
  ASSERT_EQ(r.status, 0);
  EXPECT_NE(contentOf(directory_ / "report/index.html").find("</html>"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(directory_ / "report/mean.csv"));
}

/// A point measured 2000 times with the covariance that the file says, and, of that variance, a share that changes only
/// every 400 measurements.
std::string series(double shared) {
  Noise noise;
  std::string text = "t,x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
  double slow[3] = {0, 0, 0};
  for (int i = 0; i < 2000; ++i) {
    if (i % 400 == 0) {
      for (double& s : slow) s = std::sqrt(shared) * noise();
    }
    text += fmt::format("{}", 0.1 * i);
    for (const double s : slow) text += fmt::format(",{}", s + std::sqrt(1 - shared) * noise());
    text += ",1,0,0,1,0,1\n";
  }
  return text;
}

TEST_F(Program, SplitsOfIndependentMeasurementsPass) {
  // One false alarm in 1e5 seeds; this one is fixed.
  directory_.write("f.csv", series(0));
  const ProgramRun r =
      run({"validate", "split", "f.csv", "--splits", "200", "--json", "out.json", "--report", "report"});
  EXPECT_EQ(r.status, 0) << r.errors;
  EXPECT_EQ(r.json["passed"], true);
  EXPECT_NEAR(r.json["random"]["index"].get<double>(), 3, 4 * r.json["random"]["index_se"].get<double>());
  EXPECT_NEAR(r.json["by_blocks"]["index"].get<double>(), 3, 4 * r.json["by_blocks"]["index_se"].get<double>());
  EXPECT_EQ(r.json["merged"]["n"], 2000);
  const std::string page = contentOf(directory_ / "report/index.html");
  EXPECT_NE(page.find("</h1>\n<p class=\"verdict good\">✓ PASSED: halves"), std::string::npos);
  // The advice, too, fits a terminal.
  const std::size_t begin = page.find("\nPASSED: ") + 1, end = page.find("</pre>", begin);
  std::istringstream lines(page.substr(begin, end - begin));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST_F(Program, SplitsByBlocksRevealSharedErrors) {
  directory_.write("f.csv", series(0.2));
  const ProgramRun r = run({"validate", "split", "f.csv", "--splits", "200", "--json", "out.json"});
  EXPECT_EQ(r.status, 1) << r.errors;
  EXPECT_EQ(r.json["passed"], false);
  EXPECT_LT(r.json["random"]["index"].get<double>(), 4);
  EXPECT_GT(r.json["inflation_low"].get<double>(), 10) << "blocks of 200 share a fifth of the variance";
}

TEST_F(Program, SplitsDoNotDependOnThreads) {
  directory_.write("f.csv", frames(60));
  Json one = run({"validate", "split", "f.csv", "--threads", "1", "--splits", "20", "--json", "out.json"}).json;
  Json two = run({"validate", "split", "f.csv", "--threads", "2", "--splits", "20", "--json", "out.json"}).json;
  ASSERT_FALSE(one.is_null());
  one.erase("command_line");
  two.erase("command_line");
  EXPECT_EQ(one.dump(), two.dump());
}

TEST_F(Program, SplitsNeedEnoughMeasurements) {
  directory_.write("f.csv", "x,y,z\n1,2,3\n1,2,4\n");
  const ProgramRun r = run({"validate", "split", "f.csv"});
  EXPECT_EQ(r.status, 2);
  EXPECT_EQ(r.errors, "f.csv: 2 measurements, too few to be split, expected 10 at least (--blocks is 10)\n");
}

std::string dataDirectory() {
  const char* data = std::getenv("LIESTAT_DATA");
  return data == nullptr ? "" : data;
}

TEST_F(Program, RealGroundTruth) {
  if (dataDirectory().empty()) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the measurements";
  const std::string path = std::filesystem::absolute(dataDirectory()) / "vi/euroc/V1_02_medium_gt.csv";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "skipped: there is no " << path;
  for (const char* feature : {"frame", "se3", "point"}) {
    const ProgramRun r = run(
        {"mean", path, "--feature", feature, "--budget", instrumented ? "1000000" : "100000000", "--json", "out.json"});
    ASSERT_FALSE(r.json.is_null()) << r.errors;
    EXPECT_EQ(r.json["format"], "euroc");
    EXPECT_GT(r.json["n"], 16000);
    EXPECT_EQ(r.json["converged"], true);
  }
}

TEST_F(Program, StereoLandmarksShareErrorsInTime) {
  if (dataDirectory().empty()) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the measurements";
  const std::string prefix = std::filesystem::absolute(dataDirectory()) / "tracks/starry_night";
  if (!std::filesystem::exists(prefix + "_tracks.csv")) GTEST_SKIP() << "skipped: there is no " << prefix;
  const ProgramRun r =
      run({"validate", "split", "--stereo", prefix, "--splits", instrumented ? "20" : "50", "--json", "out.json"});
  EXPECT_EQ(r.status, 1) << r.errors;
  ASSERT_FALSE(r.json.is_null());
  EXPECT_EQ(r.json["landmarks"].size(), 20U);
  EXPECT_NEAR(r.json["survey_rms"].get<double>(), 0.0108, 0.0005) << "m";
  EXPECT_GT(r.json["by_blocks"]["index"], 5 * r.json["random"]["index"].get<double>());
}

}  // namespace
}  // namespace liestat::cli
