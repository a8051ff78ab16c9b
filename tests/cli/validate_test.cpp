// `liestat validate`, all subjects: what they write is described, fits the terminal, and says the same everywhere. What
// they find: tests/experiments/.

#include <cli/commands/measurement_options.hpp>
#include <cli/commands/split.hpp>
#include <cli/show/split.hpp>
#include <experiments/estimator_validation.hpp>
#include <experiments/groups_validation.hpp>
#include <experiments/hand_eye_validation.hpp>
#include <experiments/laws_validation.hpp>
#include <experiments/means_validation.hpp>
#include <experiments/motion_validation.hpp>
#include <experiments/preintegration_validation.hpp>
#include <experiments/propagation_validation.hpp>
#include <experiments/robust_validation.hpp>
#include <experiments/table1.hpp>
#include <experiments/two_solutions.hpp>
#include <experiments/two_view_answers.hpp>
#include <experiments/two_view_pairs.hpp>
#include <experiments/two_view_rules.hpp>
#include <experiments/two_view_validation.hpp>
#include <experiments/vi_init_validation.hpp>
#include <report/describe.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <report/run_program.hpp>
#include <cli/words.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

using Json = nlohmann::ordered_json;

/// The names of the fields of a described type, without those of nested ones.
template <class T>
Words fields() {
  Words names;
  for (const FieldDescription& field : fieldsOf<T>()) names.push_back(field.name);
  return names;
}

/// One way to run a subject.
struct Subject {
  std::string command;                 ///< after `validate`: a short run that keeps its promises
  std::map<std::string, Words> lists;  ///< in JSON: lists of described rows, and their fields
  std::string broken = {};             ///< a run with a noise that the estimators are not told
  std::string long_run = {};           ///< a run that an interrupt ends
  std::vector<std::string> refused = {};
  std::size_t width = 80;  ///< columns on the terminal
  bool promises = true;
};

const std::vector<Subject>& subjects() {
  static const std::vector<Subject> list = {
      {"estimator --trials 30 --experiment rotation,conic",
       {{"rows", fields<EstimatorRow>()}},
       "estimator --trials 200 --experiment rotation --noise-factor 1.3",
       "estimator --trials 100000 --experiment rotation",
       {"--experiment circle", "--noise-factor 0", "--trials 0"}},
      {"hand-eye --trials 2 --experiment accuracy,outliers",
       {{"rows", fields<HandEyeRow>()}},
       "hand-eye --trials 20 --experiment accuracy --noise-factor 1.5",
       "hand-eye --trials 100000 --experiment motions",
       {"--experiment dance", "--noise-factor 0", "--trials 0"}},
      {"means --trials 10 --feature rotation",
       {{"rows", fields<MeansRow>()}, {"verdicts", fields<VerdictRow>()}},
       "",
       "means --trials 1000000 --feature rotation --n 5",
       {"--feature line", "--noise loud", "--n 1", "--spread 0", "--trials 0"},
       110},
      {"motion --trials 3 --method gyroscope_bias,gauss_newton",
       {{"rows", fields<MotionRow>()}},
       "motion --trials 30 --method gyroscope_bias --noise-factor 4",
       "motion --trials 100000 --method gyroscope",
       {"--method luck", "--noise-factor 0", "--trials 0"}},
      {"groups --trials 4", {{"rows", fields<GroupRow>()}}, "", "groups --trials 1000000", {"--trials 0"}, 110},
      {"laws --trials 4 --kappa 5 --law vmf,bingham",
       {{"rows", fields<LawRow>()}},
       "",
       "laws --trials 1000000 --law vmf",
       {"--law cauchy", "--kappa 0", "--n 9", "--trials 0"}},
      {"preintegration --trials 20 --window 0.1",
       {{"rows", fields<PreintegrationRow>()}},
       "",
       "preintegration --trials 1000000",
       {"--check speed", "--window 0", "--noise 0", "--trials 0"},
       110},
      {"propagation --trials 200 --spread 0.05,1 --feature pose --operation compose,act",
       {{"rows", fields<PropagationRow>()}},
       "",
       "propagation --trials 100000000 --feature rotation --operation inverse",
       {"--feature line", "--operation divide", "--spread 0", "--trials 0"}},
      {"robust --trials 4 --outliers 0.2,0.6 --score relevance,inlier_count",
       {{"rows", fields<RobustRow>()}, {"thresholds", fields<ThresholdRow>()}},
       "robust --trials 40 --outliers 0.2 --structure conic --score relevance --noise-factor 2",
       "robust --trials 100000",
       {"--structure spiral", "--score luck", "--outliers 1", "--measurements 3", "--confidence 1", "--trials 0"}},
      {"two-view --trials 4 --motion rotation,affine",
       {{"rows", fields<TwoViewRow>()}, {"choices", fields<TwoViewChoice>()}},
       "two-view --trials 20 --motion fundamental --matches 60 --outliers 0.9",
       "two-view --trials 100000 --motion rotation",
       {"--motion dolly", "--outliers 1", "--sigma 0", "--matches 3", "--trials 0", "--pairs nowhere",
        "--pairs . --motion zoom", "--pairs . --full"}},
      {"two-view --rules --trials 2",
       {{"rules", fields<TwoViewRuleRow>()}},
       "",
       "two-view --rules --trials 100000",
       {},
       80,
       false},
      {"two-view --answers --trials 2",
       {{"answers", fields<TwoViewAnswerRow>()}},
       "",
       "two-view --answers --trials 100000",
       {"--answers --rules"},
       110},
      {"vi-init --trials 20 --check consistency,rest,drift --window 1,2",
       {{"rows", fields<ViInitRow>()}},
       "vi-init --trials 40 --check closed_form --window 2 --noise 3",
       "vi-init --trials 100000 --check closed_form",
       {"--check speed", "--window 1.5", "--noise 0", "--trials 0", "--scene fig3 --report x", "--scene fig1",
        "--table1 --check drift", "--check drift --window 1"},
       110},
      {"vi-init --table1 --trials 3", {{"rows", fields<Table1Row>()}}, "", "vi-init --table1 --trials 100000", {}, 110},
      {"vi-init --scene fig2", {{"solutions", fields<SolutionOfTwo>()}}, "", "", {}, 100000, false},
  };
  return list;
}

/// A run of the program in a directory: exit code, standard output, out.json and the page.
struct ValidationRun {
  TemporaryDirectory directory;
  ProgramResult result;
  std::string text, page;
  Json json;

  explicit ValidationRun(const std::string& command, const Words& before = {}) {
    const Words shell{"sh", "-c", "\"$@\" > out.txt", "sh"}, program{LIESTAT_PROGRAM, "validate"};
    result = runProgram(shell + before + program + wordsOf(command + " --json out.json --report page"),
                        directory.path().string());
    text = contentOf(directory / "out.txt");
    if (!std::filesystem::exists(directory.path() / "out.json")) return;
    json = Json::parse(contentOf(directory / "out.json"));
    page = contentOf(directory / "page/index.html");
  }
};

/// Columns of a line: bytes that begin a character.
std::size_t widthOf(std::string_view line) {
  return static_cast<std::size_t>(std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

/// The last two lines of the terminal, the verdict's word first; and that the page says the same.
std::pair<std::string, std::string> verdictOf(const ValidationRun& run, const Subject& subject) {
  std::istringstream stream(run.text);
  std::string last, before;
  for (std::string line; std::getline(stream, line);) {
    // Reasons of failures, and how much of a run was done, are sentences of any length.
    if (!line.starts_with("FAILED ") && !line.starts_with("partial: ")) {
      EXPECT_LE(widthOf(line), subject.width) << subject.command << ": " << line;
    }
    before = std::exchange(last, line);
  }
  const char* style = last == "PASSED" ? "good\">✓" : last == "FAILED" ? "bad\">✗" : "none\">–";
  if (subject.promises) {
    EXPECT_NE(run.page.find(fmt::format("</h1>\n<p class=\"verdict {} {}: {}</p>", style, last, before)),
              std::string::npos)
        << subject.command << ": the page's verdict is not " << last << ": " << before;
  }
  EXPECT_NE(run.page.find("</html>"), std::string::npos) << subject.command;
  return {last, before};
}

/// The same run by parts, with other numbers of threads: the text and the JSON are those of the whole run.
void expectPartsMerge(const std::string& command, const ValidationRun& whole) {
  const TemporaryDirectory directory;
  const auto run = [&](const std::string& options) {
    return runProgram(
        Words{"sh", "-c", "\"$@\" > out.txt", "sh", LIESTAT_PROGRAM, "validate"} + wordsOf(command + " " + options),
        directory.path().string());
  };
  for (int k = 1; k <= 3; ++k) {
    const ProgramResult part = run(fmt::format("--part {}/3 --state {}.state --threads {}", k, k, 1 + k % 2));
    ASSERT_EQ(part.status, 0) << command << ": " << part.errors;
  }
  const ProgramResult merged = run("--merge 3.state 1.state 2.state --json out.json");
  EXPECT_EQ(merged.errors, "") << command;
  EXPECT_EQ(merged.status, whole.result.status) << command;
  EXPECT_EQ(contentOf(directory / "out.txt"), whole.text) << command;
  Json json = Json::parse(contentOf(directory / "out.json")), all = whole.json;
  json.erase("command_line"), all.erase("command_line");
  EXPECT_EQ(json.dump(), all.dump()) << command;
}

TEST(Validate, WritesWhatIsDescribedAndSaysTheSameEverywhere) {
  for (const Subject& subject : subjects()) {
    const ValidationRun run(subject.command);
    ASSERT_EQ(run.result.status, 0) << subject.command << "\n" << run.text << run.result.errors;
    if (subject.command.find("--scene") == std::string::npos) expectPartsMerge(subject.command, run);
    const std::string word = verdictOf(run, subject).first;
    EXPECT_EQ(run.json["seed"], 1) << subject.command;
    EXPECT_EQ(run.json.contains("passed"), subject.promises) << subject.command;
    EXPECT_FALSE(run.json.contains("interrupted")) << subject.command;
    if (subject.promises) {
      EXPECT_EQ(word, "PASSED") << subject.command;
      EXPECT_EQ(run.json["passed"], true) << subject.command;
      EXPECT_EQ(run.json["false_alarm"], run_false_alarm) << subject.command;
    }
    for (const auto& [key, described] : subject.lists) {
      ASSERT_FALSE(run.json[key].empty()) << subject.command << ": no " << key;
      for (const Json& row : run.json[key]) {
        Words names;
        for (const auto& [name, value] : row.items()) {
          // Bounds of a promise are there where there is one.
          const bool bound =
              name.starts_with("promised_") && std::find(described.begin(), described.end(), name) == described.end();
          if (!bound) names.push_back(name);
        }
        EXPECT_EQ(names, described) << subject.command << ", " << key;
      }
    }
  }
}

TEST(Validate, ABrokenPromiseIsSaidEverywhere) {
  for (const Subject& subject : subjects()) {
    if (subject.broken.empty()) continue;
    const ValidationRun run(subject.broken);
    EXPECT_EQ(run.result.status, 1) << subject.broken << "\n" << run.result.errors;
    EXPECT_EQ(verdictOf(run, subject).first, "FAILED") << subject.broken;
    EXPECT_NE(run.text.find("\nFAILED "), std::string::npos) << subject.broken << ": no line says which row failed";
    EXPECT_EQ(run.json["passed"], false) << subject.broken;
  }
}

TEST(Validate, AnInterruptLeavesWhatWasComputed) {
  for (const Subject& subject : subjects()) {
    if (subject.long_run.empty()) continue;
    // timeout sends it, once: without --foreground it sends it to the program and to its group. Hours are left. Where the
    // tests run in the background interrupts are ignored, and the program would heed that.
    const ValidationRun run(subject.long_run, {"env", "--default-signal=INT", "timeout", "--foreground",
                                               "--preserve-status", "-s", "INT", "0.7"});
    EXPECT_EQ(run.result.status, 130) << subject.long_run << "\n" << run.result.errors;
    EXPECT_NE(run.result.errors.find("liestat: interrupted"), std::string::npos) << run.result.errors;
    // A run that takes longer to begin says that it computed nothing.
    if (run.result.errors.find("nothing to write") != std::string::npos) continue;
    const auto [word, sentence] = verdictOf(run, subject);
    EXPECT_EQ(word, "INTERRUPTED") << subject.long_run;
    EXPECT_EQ(run.json["interrupted"], true) << subject.long_run;
    EXPECT_LT(run.json["trials_done"].get<std::uint64_t>(), run.json["trials_planned"].get<std::uint64_t>());
    EXPECT_TRUE(sentence.starts_with(fmt::format("partial: {} of {} trials were done",
                                                 run.json["trials_done"].get<std::uint64_t>(),
                                                 run.json["trials_planned"].get<std::uint64_t>())))
        << sentence;
    if (subject.promises) {
      EXPECT_EQ(run.json["passed"], false) << subject.long_run;
    }
  }
}

TEST(Validate, RefusesWhatItDoesNotKnow) {
  for (const Subject& subject : subjects()) {
    for (const std::string& options : subject.refused) {
      const Words words{LIESTAT_PROGRAM, "validate", wordsOf(subject.command)[0]};
      const ProgramResult result = runProgram(words + wordsOf(options), ".");
      EXPECT_EQ(result.status, 2) << subject.command << ": " << options;
      EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    }
  }
}

/// Points with covariances, in the order of time.
std::string pointsFile(std::size_t n) {
  CounterRng rng(5);
  std::string text = "x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d x = rng.normalVector<3>();
    text += fmt::format("{},{},{},1,0,0,1,0,1\n", x[0], x[1], x[2]);
  }
  return text;
}

TEST(ValidateSplit, SaysTheSameEverywhereAndAfterAnInterrupt) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("points.csv", pointsFile(2000));
  const ValidationRun whole("split " + file + " --splits 20");
  ASSERT_EQ(whole.result.status, 0) << whole.result.errors;
  EXPECT_NE(whole.text.find("\nPASSED: "), std::string::npos) << whole.text;
  EXPECT_NE(whole.page.find("<p class=\"verdict good\">✓ PASSED: "), std::string::npos);
  EXPECT_EQ(whole.json["passed"], true);
  expectPartsMerge("split " + file + " --splits 20", whole);
  for (const std::string& name : fields<SplitSummary>()) {
    const bool interrupted = name == "interrupted" || name.starts_with("trials_");
    EXPECT_EQ(whole.json.contains(name), !interrupted) << name;
  }
  const ValidationRun run(
      "split " + file + " --splits 1000000",
      {"env", "--default-signal=INT", "timeout", "--foreground", "--preserve-status", "-s", "INT", "1.5"});
  EXPECT_EQ(run.result.status, 130) << run.result.errors;
  if (run.result.errors.find("nothing to write") != std::string::npos) return;
  EXPECT_EQ(run.json["passed"], false);
  EXPECT_EQ(run.json["interrupted"], true);
  EXPECT_EQ(run.json["trials_planned"], 2000000U);
  EXPECT_EQ(run.json["trials_done"],
            run.json["random"]["splits"].get<int>() + run.json["by_blocks"]["splits"].get<int>());
  EXPECT_NE(run.page.find("<p class=\"verdict none\">– INTERRUPTED: "), std::string::npos);
}

/// Splits of a file in the process, which an interrupt stops.
struct StoppedSplits {
  Measurements measurements;
  SplitSettings settings;

  StoppedSplits() {
    const TemporaryDirectory directory;
    MeasurementInput input;
    input.file = directory.write("f.csv", pointsFile(60));
    measurements = input.read("test");
    settings.threads = 1;
    settings.split.splits = 20;
  }
  ~StoppedSplits() { start(0); }
  SplitSummary run(std::size_t splits) {
    settings.split.splits = splits;
    start(splits);
    return splitMeasurements(measurements, settings);
  }
  /// An interrupt comes after so many splits of both kinds.
  SplitSummary stoppedAfter(std::size_t count) {
    settings.split.splits = 20;
    start(20);
    std::size_t done = 0;
    return splitMeasurements(measurements, settings, [&] { trials_of_run.stop = ++done >= count; });
  }
  void start(std::size_t splits) const {
    TrialsOfRun& run = trials_of_run;
    run.stop = false, run.done = 0, run.planned = 2 * splits;
  }
  /// The lines on the terminal, as they are now.
  static std::string textOf(const SplitSummary& result) {
    const FileSplit split{result, "f.csv", "", {}};
    return formatSplit(split);
  }
};

std::vector<double> firstOf(const std::vector<double>& list, std::size_t n) {
  return {list.begin(), list.begin() + static_cast<std::ptrdiff_t>(n)};
}

TEST(ValidateSplit, anInterruptLeavesTheFirstSplitsWithTheirDegreesOfFreedom) {
  StoppedSplits splits;
  const SplitSummary whole = splits.run(20), seven = splits.run(7);
  const SplitSummary early = splits.stoppedAfter(7);
  EXPECT_EQ(trials_of_run.done, 7U);
  EXPECT_EQ(early.random.distances, firstOf(whole.random.distances, 7));
  EXPECT_EQ(early.random.effective_dof, seven.random.effective_dof);
  EXPECT_NE(early.random.effective_dof, whole.random.effective_dof);
  EXPECT_TRUE(early.by_blocks.distances.empty());
  EXPECT_EQ(early.merged.mean.point, whole.merged.mean.point);
  const std::string text = splits.textOf(early);
  EXPECT_NE(text.find("halves of 10 blocks    none was done\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\nINTERRUPTED: 7 of 40 splits were done, none of them by blocks of time,"), std::string::npos)
      << text;

  const SplitSummary late = splits.stoppedAfter(27);
  EXPECT_EQ(late.random.distances, whole.random.distances);
  EXPECT_EQ(late.random.effective_dof, whole.random.effective_dof);
  EXPECT_EQ(late.by_blocks.distances, firstOf(whole.by_blocks.distances, 7));
  EXPECT_EQ(late.by_blocks.effective_dof, seven.by_blocks.effective_dof);
  EXPECT_NE(splits.textOf(late).find("\nINTERRUPTED: 27 of 40 splits were done. Halves"), std::string::npos);

  // One that comes after the last split interrupts nothing.
  const SplitSummary ended = splits.stoppedAfter(40);
  EXPECT_EQ(ended.by_blocks.distances, whole.by_blocks.distances);
  EXPECT_NE(splits.textOf(ended).find("\nPASSED: "), std::string::npos);
}

}  // namespace
}  // namespace liestat::cli
