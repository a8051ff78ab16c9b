#pragma once

#include <experiments/cell_run.hpp>
#include <formats/feature.hpp>
#include <lie/point_group.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The verdicts of certifiedMean and robustMean: what it hands out a covariance for, what it withholds one from, and whether the
/// regions of those that it hands out hold the truth. Where `validate means` judges the formulas on means that were
/// started at the truth, this judges the front door, with its own starts and its own refusals.

/// The law from which the features of a cell are drawn.
enum class VerdictLaw {
  fisher,     ///< the matrix Fisher law with F = κ/2 · I, von Mises and Fisher's on directions; of frames N(0, 1) m
  report,     ///< normal in the chart, the report's standard deviations (0.3, 0.6, 0.9) rad times the parameter
  isotropic,  ///< normal in the chart, the parameter in rad along each axis
  clouds,     ///< two clouds 0.05 rad wide, the parameter in degrees apart (of quotient frames half of it)
  flips,  ///< Fisher's with κ = 20, of which this fraction is turned half a turn: directions are reversed, rotations
          ///< turned about random axes. From about a tenth of directions and a quarter of rotations on the minima of
          ///< the population's criterion lie on a circle or sphere about the axis, all of which is the truth
  half_turns,  ///< the same turned about the third axis of the rotation; both of two minima are the truth
  outliers,    ///< Fisher's with κ = 20, of which this fraction is uniform
  strip,       ///< directions within ± the parameter (rad) on a great circle, 0.05 rad beside it
  lever,       ///< normal in the chart, 0.8 rad; translations 0.1 m and the rotation's error by the parameter, m/rad
  stated,      ///< normal in the chart, 0.1 rad and m; the covariances that are stated are too small by the parameter
  stated_clouds,  ///< clouds, each with its true covariance
  exponential,    ///< independent exponential errors about their mean in each coordinate, 0.05 rad and m; the region is
                  ///< that of a bootstrap, as for the two laws below
  log_normal,     ///< the same of log-normal errors, the parameter the standard deviation of the logarithm
  normal,         ///< the same of normal errors
  huber_uniform,  ///< normal in the chart, 0.1 rad and m, of which this fraction is uniform, translations within 2 m;
                  ///< judged is Huber's mean, as below
  median_uniform,  ///< the same for the geodesic median
  huber_cluster,   ///< a fifth in a cluster the parameter times 0.1 rad and m away, a tenth as wide
  median_cluster   ///< the same for the geodesic median
};
/// The name in tables and JSON fields.
std::string name(VerdictLaw law);

/// One cell of the table.
struct VerdictCell {
  Feature feature = Feature::rotation;
  VerdictLaw law = VerdictLaw::fisher;
  double parameter = 0;
  std::size_t n = 10, trials = 400;
  /// Rotations are orientations of crystals of this group: the parameter is then in units of the injectivity radius,
  /// half of the group's least angle. Fisher's law with 0, or isotropic.
  std::optional<PointGroup> symmetry = {};

  /// The feature, or the point group.
  std::string what() const { return symmetry ? "crystal_" + std::string(symmetry->name()) : liestat::name(feature); }
};

/// Bounds promised for a cell's rates; absent bounds are not judged.
struct VerdictPromise {
  std::optional<double> max_outside;   ///< ok, and the truth outside of the 95 % region
  std::optional<double> min_coverage;  ///< fraction of ok results that hold the truth, where ok are half of all
  std::optional<double> min_kept, max_kept;
  std::optional<double> max_ambiguous, max_ill_defined, max_inconsistent;
  std::optional<double> max_wrong;  ///< ok, and the mean on the wrong side
};
/// The promise of docs/uniqueness.md for a cell.
VerdictPromise promiseOf(const VerdictCell& cell);

/// Counts of the outcomes of a cell's trials.
struct VerdictRow {
  VerdictCell cell;
  VerdictPromise promise;
  std::size_t ok = 0, ambiguous = 0, ill_defined = 0;
  std::size_t inconsistent = 0;   ///< the stated covariances are refuted
  std::size_t outside = 0;        ///< ok, but the truth, or some of it, outside the 95 % region
  std::size_t wrong = 0;          ///< ok, but the mean of two clouds on the other side
  std::size_t widened = 0;        ///< ok, the region widened to the length of a valley
  std::size_t plain_outside = 0;  ///< the same of all trials, with the first-order covariance, which nothing withholds
  std::optional<bool> passed;     ///< within four standard errors of every bound
  std::string failure = {};       ///< which bound was not kept

  double rate(std::size_t count) const { return static_cast<double>(count) / static_cast<double>(cell.trials); }
  double coverage() const { return ok > 0 ? 1 - static_cast<double>(outside) / static_cast<double>(ok) : 1; }
};

template <class V>
void describe(V& v, const VerdictRow& row) {
  v("feature", row.cell.what())("law", name(row.cell.law))("parameter", row.cell.parameter);
  v("n", row.cell.n)("trials", row.cell.trials)("ok", row.rate(row.ok), "fraction of the trials");
  v("ambiguous", row.rate(row.ambiguous))("ill_defined", row.rate(row.ill_defined));
  v("inconsistent", row.rate(row.inconsistent), "the covariances that are stated are refuted");
  v("ok_but_outside", row.rate(row.outside))("coverage", row.coverage(), "of those that are ok");
  v("ok_but_widened", row.rate(row.widened), "the region was widened to the length of a ring or a valley");
  v("ok_on_the_wrong_side", row.rate(row.wrong))("first_order_coverage", 1 - row.rate(row.plain_outside));
  v("passed", row.passed);
}

/// The cells of a default run, or all of them with 4000 trials each (400 of two clouds of 1000).
std::vector<VerdictCell> verdictCells(bool full);

/// Runs the cells; the same counts on any number of threads.
std::vector<VerdictRow> judgeVerdicts(const std::vector<VerdictCell>& cells, std::uint64_t seed, int threads,
                                      const RunProgress& progress = {});

}  // namespace liestat::experiments
