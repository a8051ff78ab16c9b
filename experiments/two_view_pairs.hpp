// Validation of the two-view hierarchy on real pairs of images whose truth is known in part: `liestat validate two-view
// --pairs DIR`. The kinds of pairs are in formats/two_view_pairs.hpp.
//
// One set of parameters for all: noise of σ px in both images, nothing known of the cameras, the hierarchy's
// defaults but for ten hypotheses of a model that are refined.
#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judgement.hpp>
#include <formats/two_view_pairs.hpp>
#include <stats/hierarchy_types.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace liestat::experiments {

struct TwoViewPairsValidation {
  double sigma = 1;           ///< px
  RunSize run{.trials = 10};  ///< runs of a pair; medians are over these
  /// Matches that others contradict (fusion/two_view/contradictions.hpp) take part.
  bool contradicted = false;
};

/// The choice between a plane and depth, of one pair.
struct PairChoice {
  PairFamily family = PairFamily::homogr;
  std::string name;
  std::size_t tentative = 0, kept = 0;                      ///< matches, and those that took part
  std::vector<std::pair<std::string, std::size_t>> chosen;  ///< models and how often they were
  std::size_t right = 0, runs = 0;  ///< runs that chose a homography (homogr) or a fundamental matrix (kusvod2)
  double homography_inliers = 0, fundamental_inliers = 0;  ///< medians
  /// The test of support between the two, medians: matches far from the homography, those of them that the fundamental
  /// matrix explains, and how many chance and its freedom explain.
  double far = 0, explained = 0, allowed = 0;
  /// Residuals 2L²/r of the two over the inliers of both, medians.
  double homography_cost = 0, fundamental_cost = 0;
  /// Runs in which DEGENSAC's rule says that a plane dominates: five of the seven matches that made the best fundamental
  /// matrix are on one.
  std::size_t degenerate = 0;
  /// The median distance (Sampson's, px) of the validation points from the homography (homogr) or the fundamental matrix
  /// (kusvod2), whichever was chosen; a more specific model's where the walk did not reach that one.
  double validation_error = 0;
  bool chosenRight() const { return 2 * right > runs; }
};

/// Labels against the structures that were extracted with homographies alone.
struct PairStructures {
  std::string name;
  std::size_t matches = 0, labelled = 0;  ///< and structures that are labelled
  /// With the best assignment of structures to labels, medians: structures found, wrong labels, the share of inliers with
  /// the label of their structure (purity), the share of labelled matches that are inliers of theirs (coverage).
  double found = 0, wrong = 0, purity = 0, coverage = 0;
  double first_wrong = 0;  ///< wrong labels of the first structure alone, where one is labelled
};

/// A dominant plane among few right matches.
struct PairPlane {
  std::string name;
  std::size_t matches = 0, labelled = 0;  ///< and right ones
  double inliers = 0, right = 0;  ///< medians: inliers of the homography, and those of them that are labelled right
  double label_error = 0;         ///< median distance (px) of right matches from it
  std::size_t supported = 0, runs = 0;  ///< runs that found a homography that chance does not explain
};

/// The models that were chosen and how often, as fields.
struct ChosenInPair {
  const PairChoice* choice = nullptr;
};
template <class V>
void describe(V& v, const ChosenInPair& chosen) {
  if (chosen.choice == nullptr) return;
  for (const auto& [model, count] : chosen.choice->chosen) v(model.c_str(), count, "runs");
}
template <class V>
void describe(V& v, const PairChoice& row) {
  v("family", name(row.family))("pair", row.name)("tentative", row.tentative, "matches")("kept", row.kept);
  v("runs", row.runs)("right", row.right)("chosen", ChosenInPair{&row});
  v("homography_inliers", row.homography_inliers)("fundamental_inliers", row.fundamental_inliers);
  v("far", row.far)("explained", row.explained)("explained_by_chance", row.allowed);
  v("homography_cost", row.homography_cost)("fundamental_cost", row.fundamental_cost);
  v("degenerate_samples", row.degenerate, "runs")("validation_error_px", row.validation_error, "", "px");
}
template <class V>
void describe(V& v, const PairStructures& row) {
  v("pair", row.name)("matches", row.matches)("planes", row.labelled)("found", row.found)("wrong", row.wrong);
  v("purity", row.purity)("coverage", row.coverage)("first_wrong", row.first_wrong);
}
template <class V>
void describe(V& v, const PairPlane& row) {
  v("pair", row.name)("matches", row.matches)("right", row.labelled)("runs", row.runs)("runs_found", row.supported);
  v("inliers", row.inliers)("inliers_right", row.right)("distance_px", row.label_error, "", "px");
}

struct TwoViewPairsResult {
  std::vector<PairChoice> choices;
  std::vector<PairStructures> structures;
  std::vector<PairPlane> planes;
  std::vector<Promise> checks;  ///< promises about all pairs of a kind, and counts to compare them with
};
template <class V>
void describe(V& v, const TwoViewPairsResult& result) {
  v("choices", result.choices)("structures", result.structures)("planes", result.planes)("checks", result.checks);
}

/// Runs everything, in the order of the pairs.
TwoViewPairsResult validateTwoViewPairs(const std::vector<TwoViewPair>& pairs, const TwoViewPairsValidation& validation,
                                        const RunProgress& progress = {});

/// The promises: bounds, which no chance excuses.
Judgement judgementOf(const TwoViewPairsResult& result);

/// For each row of a table of overlaps the column that it is given, so that their sum is largest and no column is given
/// twice; columns() for none.
std::vector<std::size_t> bestAssignment(const Eigen::MatrixXd& overlaps);

}  // namespace liestat::experiments
