// `liestat validate two-view --pairs`: the reader, the comparison with labels, and what the hierarchy makes of the real
// pairs, as far as LIESTAT_DATA names their directory.

#include <formats/two_view_pairs.hpp>
#include <cli/show/validations.hpp>
#include <experiments/plane_scene.hpp>
#include <formats/tracks.hpp>
#include <fusion/two_view/contradictions.hpp>
#include <fusion/two_view/two_view.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <report/run_program.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

namespace fs = std::filesystem;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// The real pairs of a family; empty without data.
std::vector<TwoViewPair> realPairs(std::initializer_list<PairFamily> families) {
  std::vector<TwoViewPair> pairs;
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr || !fs::is_directory(fs::path(data) / "two-view")) return pairs;
  for (TwoViewPair& pair : readTwoViewPairs(std::string(data) + "/two-view")) {
    if (std::find(families.begin(), families.end(), pair.family) != families.end()) pairs.push_back(std::move(pair));
  }
  return pairs;
}

TEST(Contradictions, ArePointsWithTwoPartners) {
  const MatchNoise noise{1, 2};
  const std::vector<Eigen::Vector4d> matches{
      {0, 0, 100, 100},     // 0 contradicts 1: one first point, two second ones
      {1, 1, 200, 100},     // 1
      {50, 50, 300, 300},   // 2 and 3 are one match found twice
      {51, 50, 303, 300},   //
      {70, 50, 400, 400},   // 4 contradicts 5: one second point, two first ones
      {100, 50, 402, 402},  // 5
      {10, 90, 500, 500},   // 6 and 7 are near, but not one point in any image
      {13, 90, 505, 500},  {std::numeric_limits<double>::quiet_NaN(), 90, 100, 100},
  };
  EXPECT_EQ(independentMatches(matches, noise), (std::vector<std::size_t>{2, 3, 6, 7, 8}));
  EXPECT_EQ(independentMatches(matches, noise, true), (std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
  const std::vector<bool> nearer = contradictedMatches(matches, noise, 0.5);
  EXPECT_EQ(std::count(nearer.begin(), nearer.end(), true), 0);
  EXPECT_TRUE(contradictedMatches({}, noise).empty());
  // Points that were found twice: each pair within the reach in one image is beyond twice the reach in the other with the
  // probability exp(-4), 1.8 %.
  CounterRng rng(5);
  std::vector<Eigen::Vector4d> twice;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector4d at(100 * i, 0, 100 * i, 50);
    for (int k = 0; k < 2; ++k) twice.push_back(at + rng.normalVector<4>());
  }
  // P(one within 2, the other beyond 4) = 2 (1 - e⁻¹) e⁻⁴ = 2.3 % of the pairs; four standard errors are 1.9 %.
  const std::size_t left = independentMatches(twice, {1, 1}).size();
  EXPECT_NEAR(1 - static_cast<double>(left) / 2000, 0.0232, 0.019);
}

TEST(EqualMatches, CountOnce) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector4d a(1, 2, 3, 4), b(1, 2, 3, 4.5), broken(nan, 2, 3, 4);
  const std::vector<Eigen::Vector4d> matches{b, a, broken, a, b, a, broken};
  EXPECT_EQ(firstOfEqualMatches(matches), (std::vector<std::size_t>{0, 1, 2, 1, 0, 1, 6}));
  EXPECT_EQ(independentMatches(matches, {0.01, 0.01}, true), (std::vector<std::size_t>{0, 1, 2, 6}));
  // One first point and two second ones, each twice.
  EXPECT_EQ(independentMatches(matches, {0.1, 0.1}), (std::vector<std::size_t>{2, 6}));
}

TEST(Contradictions, AreThoseOfAllPairsInAnyOrder) {
  CounterRng rng(3);
  std::vector<Eigen::Vector4d> matches(200);
  for (auto& m : matches) {
    // On a grid of 25 by 25 px, so that points coincide often.
    for (int k = 0; k < 4; ++k) m[k] = std::floor(25 * rng.uniform());
  }
  std::vector<bool> expected(matches.size(), false);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    for (std::size_t j = 0; j < matches.size(); ++j) {
      const double first = (matches[i] - matches[j]).head<2>().norm(),
                   second = (matches[i] - matches[j]).tail<2>().norm();
      if ((first <= 1 && second > 2) || (second <= 1 && first > 2)) expected[i] = true;
    }
  }
  EXPECT_GT(std::count(expected.begin(), expected.end(), true), 50);
  EXPECT_GT(std::count(expected.begin(), expected.end(), false), 5);
  EXPECT_EQ(contradictedMatches(matches, {0.5, 0.5}), expected);
  std::reverse(matches.begin(), matches.end());
  std::reverse(expected.begin(), expected.end());
  EXPECT_EQ(contradictedMatches(matches, {0.5, 0.5}), expected);
}

TEST(BestAssignment, IsTheBestOfAll) {
  CounterRng rng(8);
  for (const auto& [rows, columns] : {std::pair<int, int>{4, 4}, {3, 5}, {5, 3}, {1, 4}, {4, 1}}) {
    for (int trial = 0; trial < 20; ++trial) {
      Eigen::MatrixXd overlaps(rows, columns);
      for (int k = 0; k < overlaps.size(); ++k) overlaps.data()[k] = std::floor(8 * rng.uniform());
      const auto found = bestAssignment(overlaps);
      ASSERT_EQ(found.size(), static_cast<std::size_t>(rows));
      double sum = 0, best = 0;
      std::vector<int> given(static_cast<std::size_t>(columns), 0);
      for (int i = 0; i < rows; ++i) {
        const auto j = static_cast<int>(found[static_cast<std::size_t>(i)]);
        if (j == columns) continue;
        sum += overlaps(i, j);
        EXPECT_EQ(++given[static_cast<std::size_t>(j)], 1) << "given twice";
      }
      // All ways to give rows, or none, to columns: permutations of columns filled up with places without a label.
      std::vector<int> order(static_cast<std::size_t>(std::max(rows, columns)));
      std::iota(order.begin(), order.end(), 0);
      do {
        double value = 0;
        for (int i = 0; i < rows; ++i) {
          const int j = order[static_cast<std::size_t>(i)];
          if (j < columns) value += overlaps(i, j);
        }
        best = std::max(best, value);
      } while (std::next_permutation(order.begin(), order.end()));
      EXPECT_EQ(sum, best) << overlaps;
    }
  }
  EXPECT_EQ(bestAssignment(Eigen::MatrixXd::Zero(2, 3)), (std::vector<std::size_t>{3, 3})) << "no overlap, no label";
  EXPECT_TRUE(bestAssignment(Eigen::MatrixXd(0, 3)).empty());
}

TEST(TwoViewPairs, SimulatedPlanesAreFoundOneAfterTheOther) {
  // Sixty such scenes have 3.8 % of wrong labels (docs/hierarchy.md), with a standard deviation of 5 % between scenes, so the
  // mean of twelve has one of 1.5 %: three of these. One scene of sixty hides a plane behind another that is alike.
  std::vector<TwoViewPair> scenes;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) scenes.push_back(simulatePlanes({}, seed));
  TwoViewPairsValidation validation;
  validation.sigma = 0.5, validation.run.trials = 1;
  double wrong = 0, found = 0;
  for (const PairStructures& row : validateTwoViewPairs(scenes, validation).structures) {
    EXPECT_EQ(row.labelled, 3u);
    EXPECT_EQ(row.matches, 240u);
    found += row.found, wrong += row.wrong / 240;
  }
  EXPECT_NEAR(found, 36, 1);
  EXPECT_LT(wrong / 12, 0.083);
}

TEST(TwoViewPairs, FilesThatCannotBeRead) {
  const TemporaryDirectory directory;
  const auto error = [&](const std::string& content, PairFamily family) {
    const std::string path = directory.write("p.csv", content);
    return errorOf([&] { readTwoViewPair(path, family); });
  };
  const std::string header = "x1,y1,x2,y2,validation\n";
  EXPECT_TRUE(
      contains(error("x1,y1,x2,y2\n1,2,3,4\n", PairFamily::homogr), "p.csv:1: there is no column 'validation'"));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n1,2,3,x,0\n", PairFamily::homogr), "p.csv:3: "));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n1,2,3,nan,0\n", PairFamily::homogr), "p.csv:3: "));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n5,6,7\n", PairFamily::kusvod2), "p.csv:3: 3 fields, expected 5"));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n5,6,7,8,2\n", PairFamily::kusvod2), "p.csv:3: validation is 2"));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n5,6,7,8,0.5\n", PairFamily::kusvod2), "p.csv:3: validation is 0.5"));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,0\n5,6,7,8,0\n", PairFamily::kusvod2), "no point validates"));
  EXPECT_TRUE(contains(error(header + "1,2,3,4,1\n5,6,7,8,1\n", PairFamily::kusvod2), "all points validate"));
  EXPECT_TRUE(contains(error(header, PairFamily::kusvod2), "there is a header but no data"));
  EXPECT_TRUE(contains(error(header + "1,2,1,2,0\n1,5,1,2,1\n", PairFamily::homogr), "all points are on one line"));
  EXPECT_TRUE(contains(error("x1,y1,x2,y2,structure\n1,2,3,4,-1\n", PairFamily::adelaide), "p.csv:2: structure is -1"));
  EXPECT_EQ(error(header + "1,2,3,4,0\n5,6,7,8,1\n", PairFamily::homogr), "");
}

TEST(TwoViewPairs, DirectoriesAndTheirManifests) {
  const TemporaryDirectory directory;
  const std::string root = directory.path().string();
  EXPECT_TRUE(contains(errorOf([&] { readTwoViewPairs(root); }), "there are no pairs in it"));
  EXPECT_TRUE(contains(errorOf([&] { readTwoViewPairs(root + "/nowhere"); }), "this is no directory"));
  fs::create_directory(directory / "homogr");
  fs::create_directory(directory / "evd");
  directory.write("homogr/b.csv", "x1,y1,x2,y2,validation\n10,2,3,4,0\n5,6,7,8,1\n9,9,9,9,0\n");
  directory.write("homogr/a.csv", "x1,y1,x2,y2,validation\n1,2,3,4,0\n5,6,7,8,1\n");
  directory.write("homogr/a_model.csv", "m1,m2,m3\n1,0,0\n");
  directory.write("evd/a.csv", "x1,y1,x2,y2,detector,inlier\n1,2,3,4,MSER,1\n5,6,7,8,SIFT,0\n");
  auto pairs = readTwoViewPairs(root);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[0].name, "a");
  EXPECT_EQ(pairs[1].name, "b");
  EXPECT_EQ(pairs[1].matches.size(), 2u);
  EXPECT_EQ(pairs[1].matches[1], Eigen::Vector4d(9, 9, 9, 9));
  EXPECT_EQ(pairs[1].validation.size(), 1u);
  EXPECT_EQ(pairs[1].corner, Eigen::Vector2d(3, 2)) << "without a manifest the box of all points";
  EXPECT_EQ(pairs[1].size, Eigen::Vector2d(7, 7));
  EXPECT_EQ(pairs[2].family, PairFamily::evd);
  EXPECT_EQ(pairs[2].labels, (std::vector<std::size_t>{1, 0}));
  directory.write("manifest.csv", "family,pair,note\nhomogr,b,imsize=480x640 th=0\nhomogr,a,\n");
  pairs = readTwoViewPairs(root);
  EXPECT_EQ(pairs[1].corner, Eigen::Vector2d(0, 0));
  EXPECT_EQ(pairs[1].size, Eigen::Vector2d(640, 480));
  EXPECT_EQ(pairs[0].size, Eigen::Vector2d(6, 6));
  for (const char* note : {"imsize=480", "imsize=0x5", "imsize=axb"}) {
    directory.write("manifest.csv", std::string("family,pair,note\n\nhomogr,b,") + note + "\n");
    EXPECT_TRUE(contains(errorOf([&] { readTwoViewPairs(root); }), "manifest.csv:3: the note is")) << note;
  }
  directory.write("manifest.csv", "family,pair\nhomogr,b\n");
  EXPECT_TRUE(contains(errorOf([&] { readTwoViewPairs(root); }), "manifest.csv:1: there is no column 'note'"));
}

TEST(RealPairs, PlanesAndDepthAreToldApart) {
  const std::vector<TwoViewPair> pairs = realPairs({PairFamily::homogr, PairFamily::kusvod2});
  if (pairs.empty()) GTEST_SKIP() << "LIESTAT_DATA has no two-view";
  TwoViewPairsValidation validation;
  validation.run.trials = 2;
  const TwoViewPairsResult result = validateTwoViewPairs(pairs, validation);
  ASSERT_EQ(result.choices.size(), 24u);
  double right[2] = {0, 0};
  int beyond[2] = {0, 0};
  for (const PairChoice& row : result.choices) {
    const int k = row.family == PairFamily::homogr ? 0 : 1;
    right[k] += static_cast<double>(row.right) / static_cast<double>(row.runs);
    beyond[k] += !(row.validation_error <= (k == 0 ? 2.0 : 1.3));
    EXPECT_LE(row.kept, row.tentative);
  }
  // The promises over ten seeds; of the errors on homogr, where two of ten runs of a pair may be off, one pair more.
  EXPECT_GE(right[0], 7);
  EXPECT_GE(right[1], 8);
  EXPECT_GE(right[0] + right[1], 16);
  EXPECT_LE(beyond[0], 2);
  EXPECT_LE(beyond[1], 2);
  std::istringstream lines(viewOf(result).text());
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

/// The model and the status of all matches of a file, for several seeds.
std::vector<std::pair<std::string, Status>> answersOf(const std::vector<Eigen::Vector4d>& matches) {
  std::vector<std::pair<std::string, Status>> answers;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    TwoViewMotionOptions options;
    options.search.seed = seed;
    const TwoViewMotionEstimate found = estimateTwoViewMotion(matches, options);
    answers.emplace_back(found.chosenModel().name, found.status);
  }
  return answers;
}

TEST(RealPairs, TheSeedDoesNotDecide) {
  // Pairs of which one model or another was found, or one estimate or another of it.
  const std::vector<std::string> names = {"Boston", "BruggeSquare", "LePoint1", "graf",
                                          "corr",   "graff",        "kampa",    "shout"};
  std::size_t seen = 0;
  for (const TwoViewPair& pair : realPairs({PairFamily::homogr, PairFamily::kusvod2})) {
    if (std::find(names.begin(), names.end(), pair.name) == names.end()) continue;
    ++seen;
    const auto answers = answersOf(pair.matches);
    for (const auto& [model, status] : answers) {
      EXPECT_EQ(model, answers[0].first) << pair.name;
      // The fundamental matrix of the 42 matches of kampa is curved on the scale of their noise.
      const bool curved = pair.name == "kampa" && status == Status::ill_defined;
      // The lenses of these are bent: k1 is more than three standard deviations from zero.
      const std::vector<std::string> bent = {"Boston", "corr", "graf"};
      const bool is_bent = std::find(bent.begin(), bent.end(), pair.name) != bent.end();
      EXPECT_TRUE(status == Status::ok || status == Status::contested || curved ||
                  (is_bent && status == Status::inconsistent))
          << pair.name << " " << name(status);
    }
  }
  if (seen == 0) GTEST_SKIP() << "LIESTAT_DATA has no two-view";
  EXPECT_EQ(seen, names.size());
}

TEST(InputsThatFail, OverlaysAndZoomsOfOneAreMarked) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr || !fs::is_directory(fs::path(data) / "inputs-that-fail")) {
    GTEST_SKIP() << "LIESTAT_DATA has no inputs-that-fail";
  }
  const std::string directory = std::string(data) + "/inputs-that-fail/";
  // A third does not move, the rest follows a loose translation.
  for (const auto& [model, status] : answersOf(readMatches(directory + "zoom_or_none.csv").points)) {
    EXPECT_NE(model, "zoom");
    EXPECT_NE(status, Status::ok) << model;
  }
  const auto found = estimateTwoViewMotion(readMatches(directory + "static_overlay.csv").points, {});
  EXPECT_EQ(found.status, Status::contested);
  ASSERT_EQ(found.rivals.size(), 1u);
  EXPECT_EQ(found.rivals[0].model, "none");
  EXPECT_NEAR(static_cast<double>(found.rivals[0].inliers), 150, 5) << "60 % of 250";
  EXPECT_NEAR(static_cast<double>(found.inliers), 99, 5) << "the others";
}

TEST(RealPairs, LabelsOfSinglePlanes) {
  std::vector<TwoViewPair> pairs;
  for (TwoViewPair& pair : realPairs({PairFamily::adelaide})) {
    if (pair.name == "bonython" || pair.name == "unionhouse" || pair.name == "sene") pairs.push_back(std::move(pair));
  }
  if (pairs.empty()) GTEST_SKIP() << "LIESTAT_DATA has no two-view";
  ASSERT_EQ(pairs.size(), 3u);
  TwoViewPairsValidation validation;
  validation.run.trials = 3;
  const TwoViewPairsResult result = validateTwoViewPairs(pairs, validation);
  for (const PairStructures& row : result.structures) {
    if (row.labelled == 1) {
      EXPECT_LE(row.first_wrong, row.name == "bonython" ? 4 : 6) << row.name;
    }
    if (row.name == "sene") {
      EXPECT_EQ(row.found, 2);
      EXPECT_LE(row.wrong, 5) << "two of a hundred";
      EXPECT_GE(row.purity, 0.98);
    }
  }
  EXPECT_EQ(judgementOf(result).judged(), 2u);
  EXPECT_TRUE(judgementOf(result).passed());
}

TEST(RealPairsProgram, WritesTablesJsonAndAPage) {
  const TemporaryDirectory directory;
  fs::create_directory(directory / "adelaide-rmf");
  std::ostringstream text;
  text.precision(17);
  text << "x1,y1,x2,y2,structure\n";
  const TwoViewPair scene = simulatePlanes({.planes = 2}, 4);
  for (std::size_t i = 0; i < scene.matches.size(); ++i) {
    for (int k = 0; k < 4; ++k) text << scene.matches[i][k] << ',';
    text << scene.labels[i] << '\n';
  }
  directory.write("adelaide-rmf/walls.csv", text.str());
  const std::string where = directory.path().string();
  const ProgramResult result = runProgram({LIESTAT_PROGRAM, "validate", "two-view", "--pairs", ".", "--trials", "2",
                                           "--json", "out.json", "--report", "page"},
                                          where);
  ASSERT_EQ(result.status, 0) << result.errors;
  const auto json = nlohmann::json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["structures"].size(), 1u);
  EXPECT_EQ(json["structures"][0]["planes"], 2);
  EXPECT_EQ(json["structures"][0]["matches"], 180);
  EXPECT_TRUE(contains(contentOf(directory / "page/index.html"), "walls"));
}

}  // namespace
}  // namespace liestat::cli
