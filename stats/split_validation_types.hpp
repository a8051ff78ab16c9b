// Options and results of stats/split_validation.hpp that are the same for all types, and their verdict (needs
// Boost.Math).
#pragma once

#include <stats/feature_value.hpp>
#include <stats/laws.hpp>
#include <stats/mean_summary.hpp>
#include <stats/shown.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// Options of validateBySplitting() and of the functions that call it.
struct SplitOptions {
  std::size_t splits = 200;
  std::size_t blocks = 10;  ///< blocks of time; even, for half of them make a half
  std::uint64_t seed = 1;
  std::function<void()> advance = [] {};  ///< called twice a split, on any thread
};

/// Many splits of one kind.
struct SplitSeries {
  std::vector<double> distances;  ///< squared, as χ² of the same rank; NaN where an estimate failed
  double index = 0;               ///< their mean
  double dof = 0;                 ///< expected index
  /// The index times this over `dof` follows χ² of so many degrees of freedom: the splits share their measurements, so
  /// they tell no more than the blocks (or measurements) that were dealt out.
  double effective_dof = 0;
  std::size_t failures = 0;

  double factor() const { return index / dof; }
  /// Standard error of the index, if the covariances are true.
  double standardError() const { return dof * std::sqrt(2 / effective_dof); }
  /// Probability of so large an index.
  double pValue() const { return chiSquaredSurvival(factor() * effective_dof, effective_dof); }
  /// Ends of the confidence interval of the factor.
  double factorLow(double confidence = 0.95) const {
    return factor() * effective_dof / chiSquaredThreshold((1 - confidence) / 2, effective_dof);
  }
  double factorHigh(double confidence = 0.95) const {
    return factor() * effective_dof / chiSquaredQuantile((1 - confidence) / 2, effective_dof);
  }
};

/// Several objects measured at the same times: the indices averaged, their degrees of freedom added.
inline SplitSeries pooled(const std::vector<SplitSeries>& series) {
  SplitSeries pool;
  double inverse = 0;
  const auto count = static_cast<double>(series.size());
  for (const SplitSeries& s : series) {
    pool.distances.insert(pool.distances.end(), s.distances.begin(), s.distances.end());
    pool.index += s.index / count;
    pool.failures += s.failures;
    pool.dof = s.dof;
    inverse += 1 / (s.effective_dof * count * count);
  }
  pool.effective_dof = 1 / inverse;
  return pool;
}

/// The fewest measurements that can be split.
inline std::size_t fewestMeasurements(int dof, bool known_noise, const SplitOptions& options) {
  return std::max(options.blocks, known_noise ? std::size_t{2} : 2 * (static_cast<std::size_t>(dof) + 1));
}

/// A split fails when the blocks' index is too large by chance with less than this probability.
inline constexpr double split_false_alarm = 1e-5;

template <class V>
void describe(V& v, const SplitSeries& s) {
  v("splits", s.distances.size(), "that were done")("failures", s.failures, "splits without an estimate, left out");
  v("index", s.index, "mean squared distance of the halves");
  v("index_expected", s.dof)("index_se", s.standardError(), "standard error of the index");
  v("effective_dof", s.effective_dof, "degrees of freedom of the index");
  v("p", s.pValue(), "probability of so large an index, if errors are independent");
  v("factor", s.factor(), "index over what is expected");
  v("factor_low", s.factorLow(), "lower end of its 95 % interval")("factor_high", s.factorHigh(), "upper end");
}

/// A validation by splits, whatever the measurements are: of one object, or of several pooled.
struct SplitOutcome {
  std::string feature = {};  ///< the type's name
  int dof = 0;
  bool known_noise = true;  ///< covariances follow from those of the measurements, not from residuals
  SplitOptions settings = {};
  std::size_t objects = 1;  ///< each was to be split so often
  SplitSeries random, by_blocks;

  std::size_t planned() const { return 2 * settings.splits * objects; }
  std::size_t done() const { return random.distances.size() + by_blocks.distances.size(); }
  bool interrupted() const { return done() < planned(); }
  /// Not after an interrupt.
  bool passed() const { return !interrupted() && !(by_blocks.pValue() < split_false_alarm); }

  /// Verdict: do halves made of blocks of time agree as well as the covariances say? None after an interrupt.
  Verdict verdict() const {
    const std::string factor = significant(by_blocks.factor(), 3);
    std::vector<std::string> causes;
    const bool random_fails = random.pValue() < split_false_alarm;
    if (random_fails) {
      causes.push_back("Already at random the halves differ by " + significant(random.factor(), 3) +
                       " times the expected squared distance: the measurements scatter more than their covariances "
                       "say.");
    }
    if (interrupted()) {
      std::string text =
          "INTERRUPTED: " + std::to_string(done()) + " of " + std::to_string(planned()) + " splits were done";
      text += by_blocks.distances.empty() ? ", none of them by blocks of time, from which the verdict comes."
                                          : ". Halves made of blocks of time differ by " + factor +
                                                " times the expected squared distance so far.";
      return Verdict::none(std::move(text), std::move(causes));
    }
    const std::string range =
        "95 %: " + significant(by_blocks.factorLow(), 3) + " to " + significant(by_blocks.factorHigh(), 3);
    if (passed()) {
      Verdict verdict =
          Verdict::yes("PASSED: halves made of blocks of time agree as well as their covariances say (factor " +
                       factor + ", " + range + "). Nothing speaks against independent errors.");
      verdict.causes = std::move(causes);
      return verdict;
    }
    return Verdict::no(
        "FAILED: halves made of blocks of time differ by " + factor + " times the expected squared distance" +
            (random_fails ? "" : ", which halves at random do not show") +
            ". The errors of successive measurements are not independent: multiply the covariance of the mean by " +
            factor + " (" + range + "), its standard deviations by " + significant(std::sqrt(by_blocks.factor()), 3) +
            "; by more if the errors hold on for longer than a block.",
        std::move(causes));
  }
};

template <class V>
void describe(V& v, const SplitOutcome& o) {
  v("feature", o.feature, "the type of the measurements")("dof", o.dof, "degrees of freedom of a measurement");
  v("known_noise", o.known_noise, "covariances follow from those of the measurements, not from residuals");
  v("splits", o.settings.splits, "of each kind")("blocks", o.settings.blocks, "of time");
  v("random", o.random, "halves drawn at random")("by_blocks", o.by_blocks,
                                                  "halves made of alternating blocks of time");
  v("inflation", o.by_blocks.factor(), "by which the covariance of the mean is too small");
  v("inflation_low", o.by_blocks.factorLow(), "lower end of its 95 % interval");
  v("inflation_high", o.by_blocks.factorHigh(), "upper end");
  v("false_alarm", split_false_alarm, "probability that independent errors fail");
  v("passed", o.passed(), "halves made of blocks agree; false after an interrupt");
  if (shown(v, o.interrupted())) {
    v("interrupted", o.interrupted(), "only then")("trials_done", o.done(), "splits of both kinds");
    v("trials_planned", o.planned(), "splits of both kinds");
  }
}

/// The mean of a part of the measurements, whatever their type.
struct SplitHalf {
  std::size_t n = 0;
  std::span<const TangentBlock> parts = {};
  FeatureValue mean = {};
  Eigen::MatrixXd covariance = {};  ///< empty if there is none
};

template <class V>
void describe(V& v, const SplitHalf& h) {
  v("n", h.n, "measurements")("mean", h.mean);
  v("covariance", h.covariance.size() > 0 ? std::optional(h.covariance) : std::nullopt, "of the mean, in its own axes");
  v("standard_deviations", partDeviations(h.parts, h.covariance), "by parts, in degrees and metres");
}

/// A SplitValidation of measurements of any type: splitMean() of stats/summarized_mean_splits.hpp.
struct SplitSummary : SplitOutcome {
  std::size_t n = 0;
  std::span<const TangentBlock> parts = {};
  bool group = false;  ///< the type has no invariant metric (SE3)
  Criterion criterion = Criterion::maha;
  std::optional<CovarianceAt> covariance_at = {};  ///< nothing where it does not matter
  SplitHalf first, second;                         ///< in time
  SplitHalf merged;                                ///< both fused
  double squared_distance = 0;                     ///< distance of the halves in time
  double p_value = 0;
  std::string law;  ///< chi2 or hotelling
};

template <class V>
void describe(V& v, const SplitSummary& s) {
  describe(v, static_cast<const SplitOutcome&>(s));
  v("n", s.n, "measurements")("criterion", name(s.criterion));
  v("covariance_at",
    s.covariance_at ? std::optional(std::string(name(*s.covariance_at))) : std::optional<std::string>(),
    "frame of the measurements' covariances; null where it does not matter");
  describe(v, covarianceWords(s.parts, s.group));
  v("first", s.first, "the first half in time")("second", s.second)("merged", s.merged, "both halves fused");
  v("squared_distance", s.squared_distance, "of the halves in time")("law", s.law,
                                                                     "of that distance: chi2 or hotelling");
  v("p", s.p_value, "probability of a larger distance");
}

}  // namespace liestat
