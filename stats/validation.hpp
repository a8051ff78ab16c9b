#pragma once

// Is an estimator's covariance right? A Monte-Carlo harness for anybody's estimator (needs Boost.Math and Random123).
//
// Draw a scene of which the truth is known, estimate it, and take the squared Mahalanobis distance of the truth under
// the estimate's own covariance. If the covariance is right, these distances follow χ²_k (or Hotelling's T² where it
// came from residuals). Their mean is the validation index I of X. Pennec, "Computing the mean of geometric features",
// INRIA RR-3371, 1998, section 5.2: I > k says that the covariance is too small, I < k that it is too large.
//
//   const auto report = liestat::validate(liestat::SerialExecutor{}, {.trials = 1000},
//                                         liestat::ReferenceLaw::chiSquared(3),
//                                         [](liestat::CounterRng& rng, std::uint64_t trial) {
//                                           …
//                                           return liestat::TrialOutcome{.mu2 = …};
//                                         });
//   std::cout << report;
//   return report.passed() ? 0 : 1;
//
// Reports are the same to the bit for every executor and every number of threads or ranks: trial i draws from
// CounterRng(seed, i), and all sums are made in the order of the trials.

#include <lie/detail/small_matrix.hpp>
#include <stats/executor.hpp>
#include <stats/inference.hpp>
#include <stats/kolmogorov.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <ostream>
#include <span>
#include <sstream>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// What one trial says. A trial has failed if it says so, or if mu2 is not a finite number ≥ 0.
struct TrialOutcome {
  /// Squared Mahalanobis distance of the truth from the estimate under the estimate's covariance.
  double mu2 = std::numeric_limits<double>::quiet_NaN();
  /// Iterations of the estimator; counted for failed trials too.
  int iterations = 0;
  /// The estimator says itself that this is not to be used: not converged, ambiguous, withdrawn.
  bool failed = false;
  /// Up to four numbers of which the report gives mean and standard deviation: norms of errors, logarithms of ratios of
  /// errors between two estimators. Not finite: absent in this trial. Ignored in failed trials.
  std::array<double, 4> extra = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(),
                                 std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
};

/// How many trials, and which.
struct ValidationOptions {
  std::size_t trials = 1000;
  std::uint64_t seed = 0;
  /// Trials are numbered from here: a run is continued, or shared out by hand, by number.
  std::uint64_t first_trial = 0;
  /// Trials in a task. It has no influence on the distances, their order and their statistics.
  std::size_t chunk_size = 16;
  /// Called now and then with the number of trials done, from any thread but never twice at the same time (under MPI on
  /// rank 0 only).
  std::function<void(std::size_t done, std::size_t trials)> progress = {};
};

/// How far from perfect an estimator may be and still pass. Zero asks for the law itself, which a covariance of first
/// order in the noise can only satisfy up to a certain number of trials.
struct ValidationTolerance {
  double index = 0;             ///< relative deviation of the validation index
  double ks = 0;                ///< Kolmogorov-Smirnov distance between the true law of mu2 and the reference law
  double failure_fraction = 0;  ///< probability that a trial fails
  /// How much more often than due, 0.1 %, mu2 may exceed the 99.9 % quantile of the law. A covariance of first order is
  /// far too small now and then, where the second order exceeds the least noise of a datum; where that noise can be as
  /// small as it likes, P(mu2 > m) falls as slowly as 1/m and mu2 has no mean that an index could be compared with. So
  /// with a tolerance here a distance beyond the quantile counts in the index as the law's mean of those, however far
  /// off it is, and it is the number of them that is judged. Zero: none of this, all distances count as they are.
  double tail = 0;
};

/// What ValidationTolerance::tail is about.
inline constexpr double tail_level = 0.999;

/// Observed frequency of mu2 ≤ the quantile of the reference law at `level`.
struct Coverage {
  double level = 0;
  double observed = 0;
  double standard_error = 0;  ///< of `observed` under the reference law (binomial)
};

/// Mean and standard deviation of one of TrialOutcome::extra over the trials that gave it; NaN where there are none.
struct ExtraStatistic {
  std::size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double deviation = std::numeric_limits<double>::quiet_NaN();
};

/// A bin of a histogram of mu2, with densities to be drawn over each other.
struct HistogramBin {
  double lower = 0, upper = 0;
  std::size_t count = 0;
  double density = 0;   ///< observed: count/(number of distances · width)
  double expected = 0;  ///< the mean density of the reference law over the bin
};

/// What a validation run found. Numbers that cannot be computed (no trial succeeded; a law without variance) are NaN or
/// infinite.
struct ValidationReport {
  ReferenceLaw law = ReferenceLaw::chiSquared(0);   ///< what mu2 was expected to follow
  int dof = 0;                                      ///< the law's dimension k
  std::size_t trials = 0;                           ///< all
  std::size_t failures = 0;                         ///< those among them that gave no distance
  std::size_t exceptions = 0;                       ///< those among the failures that ended in an exception
  double index = detail::not_a_number;              ///< validation index I: mean of mu2; law.mean() is expected
  double index_se = detail::not_a_number;           ///< standard error of I, from the sample
  double index_se_expected = detail::not_a_number;  ///< the same from the law; √(2k/N) for χ²
  double index_p_value = detail::not_a_number;      ///< two-sided, exact, see passed()
  double variance = detail::not_a_number;           ///< of mu2; law.variance() is expected
  double ks_statistic = detail::not_a_number;       ///< Kolmogorov-Smirnov distance of the sample from the law
  double ks_p_value = detail::not_a_number;         ///< its p-value
  std::array<Coverage, 4> coverage = {};            ///< at 50, 90, 95 and 99 %
  double mean_iterations = detail::not_a_number;    ///< over all trials
  int max_iterations = 0;
  std::array<ExtraStatistic, 4> extra = {};
  std::vector<double> mu2;         ///< the distances of the trials that did not fail, ascending
  double equivalent_chi2_sum = 0;  ///< of ReferenceLaw::equivalentChiSquared over mu2

  /// Number of distances N.
  std::size_t size() const { return mu2.size(); }

  /// Number of distances beyond the law's quantile at tail_level.
  std::size_t tailCount() const {
    return static_cast<std::size_t>(mu2.end() - std::upper_bound(mu2.begin(), mu2.end(), law.quantile(tail_level)));
  }

  /// The verdict. With probability 1 - false_alarm at least, an estimator passes whose distances follow the reference
  /// law up to the tolerance. It fails if none of the trials succeeded, or at an equal share of false_alarm each if
  /// - more trials failed than a probability tolerance.failure_fraction of failing explains (zero: none may);
  /// - the index is out of bounds. The bound is exact, not a normal approximation: N·I is χ² with kN degrees of
  ///   freedom. Distances that should follow Hotelling's law are first carried over to χ²_k, rank by rank, because
  ///   their own mean may have no variance;
  /// - the Kolmogorov-Smirnov statistic is out of bounds;
  /// - more distances are beyond the law's 99.9 % quantile than 0.1 % + tolerance.tail explains, if tail is not zero.
  bool passed(double false_alarm = 1e-5, const ValidationTolerance& tolerance = {}) const {
    return reasonToFail(false_alarm, tolerance).empty();
  }

  /// Why passed() is false, in a few words; empty where it is true.
  std::string reasonToFail(double false_alarm = 1e-5, const ValidationTolerance& tolerance = {}) const {
    if (size() == 0) return "no trial succeeded";
    const double share = false_alarm / (2 + (tolerance.failure_fraction > 0) + (tolerance.tail > 0));
    // Written so that NaN (a law that does not exist) fails.
    if (!(binomialSurvival(failures, trials, std::min(1., tolerance.failure_fraction)) >= share)) {
      return "too many trials failed";
    }
    const bool bounded = tolerance.tail > 0;
    if (!(indexPValue(tolerance.index, bounded) >= share)) {
      return chi2Sum(bounded) > static_cast<double>(dof) * static_cast<double>(size())
                 ? "the index is too large: covariances are too small"
                 : "the index is too small: covariances are too large";
    }
    if (!(kolmogorovPValue(size(), std::max(0., ks_statistic - tolerance.ks)) >= share)) {
      return "the distances do not follow the law";
    }
    if (bounded && !(binomialSurvival(tailCount(), size(), std::min(1., 1 - tail_level + tolerance.tail)) >= share)) {
      return "too many distances are far beyond the law";
    }
    return {};
  }

  /// Two-sided p-value of the index when its expectation is anywhere within law.mean()·(1 ± tolerance) (for Hotelling's
  /// law: of the equivalent χ² index). tolerance ≥ 0. `bounded`: a distance beyond the law's quantile at tail_level
  /// counts as the law's mean of those. Under the law that leaves the index its expectation and takes away variance, so
  /// the p-value errs to the careful side.
  double indexPValue(double tolerance = 0, bool bounded = false) const {
    if (size() == 0 || !(tolerance >= 0)) return detail::not_a_number;
    const double sum = chi2Sum(bounded), sum_dof = static_cast<double>(dof) * static_cast<double>(size());
    const double above = chiSquaredSurvival(sum / (1 + tolerance), sum_dof);
    const double below = tolerance < 1 ? chiSquaredCdf(sum / (1 - tolerance), sum_dof) : 1;
    if (std::isnan(above) || std::isnan(below)) return detail::not_a_number;
    return std::min(1., 2 * std::min(above, below));
  }

  /// Equal bins over [0, quantile of the law at 0.999], or up to `upper` if it is given (> 0). Larger distances are in
  /// no bin, but in the number that the densities are divided by. Empty for bins < 1 or a law that does not exist.
  std::vector<HistogramBin> histogram(int bins, double upper = 0) const {
    std::vector<HistogramBin> result;
    const double end = upper > 0 ? upper : law.quantile(0.999);
    if (bins < 1 || !std::isfinite(end)) return result;
    const double width = end / bins;
    auto first = mu2.begin();
    for (int i = 0; i < bins; ++i) {
      HistogramBin bin;
      bin.lower = i * width;
      bin.upper = i + 1 == bins ? end : (i + 1) * width;
      const auto last = std::upper_bound(first, mu2.end(), bin.upper);
      bin.count = static_cast<std::size_t>(last - first);
      first = last;
      if (size() > 0) bin.density = static_cast<double>(bin.count) / (static_cast<double>(size()) * width);
      bin.expected = (law.cdf(bin.upper) - law.cdf(bin.lower)) / width;
      result.push_back(bin);
    }
    return result;
  }

  /// Stores the distances as CSV, ascending, each with its probability under the law: columns mu2, law_cdf.
  void writeCsv(std::ostream& os) const {
    std::ostringstream text;  // the stream's own format stays as it was
    text.precision(17);
    text << "mu2,law_cdf\n";
    for (const double d : mu2) text << d << ',' << law.cdf(d) << '\n';
    os << text.str();
  }

  /// Writes a gnuplot script that draws the histogram of the distances with the law's density; it needs no other file
  /// (gnuplot -p SCRIPT, or with a terminal and an output set before it).
  void writeGnuplot(std::ostream& os, int bins = 30) const {
    std::ostringstream text;
    text.precision(9);
    text << "$bins << END\n";
    for (const HistogramBin& bin : histogram(bins)) {
      text << 0.5 * (bin.lower + bin.upper) << ' ' << bin.density << ' ' << bin.expected << '\n';
    }
    text << "END\nset xlabel 'squared Mahalanobis distance'\nset ylabel 'density'\nset yrange [0:*]\n"
         << "set style fill solid 0.4\nset title 'index " << index << ", " << law.mean() << " expected, K-S p "
         << ks_p_value << "'\n"
         << "plot $bins using 1:2 with boxes title '" << size() << " trials', $bins using 1:3 with lines lw 2 title '"
         << law.name() << "'\n";
    os << text.str();
  }

 private:
  /// The sum of the equivalent χ² distances that the index is judged by.
  double chi2Sum(bool bounded) const {
    if (!bounded) return equivalent_chi2_sum;
    double sum = 0;
    const std::size_t inside = size() - tailCount();
    for (std::size_t i = 0; i < inside; ++i) sum += law.equivalentChiSquared(mu2[i]);
    // E[X | X > q] of X ~ χ²_k is k P(χ²_{k+2} > q)/P(χ²_k > q).
    const double q = chiSquaredQuantile(tail_level, dof);
    const double beyond = dof * chiSquaredSurvival(q, dof + 2) / (1 - tail_level);
    return sum + beyond * static_cast<double>(size() - inside);
  }
};

namespace detail {

/// The trials of a chunk, or of several one after the other.
struct ValidationSample {
  std::vector<double> mu2;  ///< in the order of the trials
  std::size_t trials = 0, failures = 0, exceptions = 0;
  double iterations = 0;
  int max_iterations = 0;
  std::array<std::vector<double>, 4> extra;

  void add(const TrialOutcome& outcome) {
    ++trials;
    iterations += outcome.iterations;
    max_iterations = std::max(max_iterations, outcome.iterations);
    if (outcome.failed || !std::isfinite(outcome.mu2) || outcome.mu2 < 0) {
      ++failures;
      return;
    }
    mu2.push_back(outcome.mu2);
    for (std::size_t i = 0; i < extra.size(); ++i) {
      if (std::isfinite(outcome.extra[i])) extra[i].push_back(outcome.extra[i]);
    }
  }

  void append(const ValidationSample& other) {
    mu2.insert(mu2.end(), other.mu2.begin(), other.mu2.end());
    trials += other.trials;
    failures += other.failures;
    exceptions += other.exceptions;
    iterations += other.iterations;
    max_iterations = std::max(max_iterations, other.max_iterations);
    for (std::size_t i = 0; i < extra.size(); ++i) {
      extra[i].insert(extra[i].end(), other.extra[i].begin(), other.extra[i].end());
    }
  }

  /// As a list of doubles, for executors that send results to other processes. Counts below 2^53 are exact.
  void packInto(std::vector<double>& out) const {
    for (const std::size_t count : {trials, failures, exceptions}) out.push_back(static_cast<double>(count));
    out.push_back(iterations);
    out.push_back(max_iterations);
    out.push_back(static_cast<double>(mu2.size()));
    out.insert(out.end(), mu2.begin(), mu2.end());
    for (const auto& values : extra) {
      out.push_back(static_cast<double>(values.size()));
      out.insert(out.end(), values.begin(), values.end());
    }
  }

  static ValidationSample unpackFrom(std::span<const double>& in) {
    const auto take = [&in] {
      const double value = in.front();
      in = in.subspan(1);
      return value;
    };
    const auto takeList = [&in, &take] {
      const auto size = static_cast<std::size_t>(take());
      std::vector<double> list(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(size));
      in = in.subspan(size);
      return list;
    };
    ValidationSample sample;
    sample.trials = static_cast<std::size_t>(take());
    sample.failures = static_cast<std::size_t>(take());
    sample.exceptions = static_cast<std::size_t>(take());
    sample.iterations = take();
    sample.max_iterations = static_cast<int>(take());
    sample.mu2 = takeList();
    for (auto& values : sample.extra) values = takeList();
    return sample;
  }
};

/// One sample for each estimator that sees the same scenes.
struct ValidationSamples {
  std::vector<ValidationSample> list;

  std::vector<double> pack() const {
    std::vector<double> out;
    for (const ValidationSample& sample : list) sample.packInto(out);
    return out;
  }
  static ValidationSamples unpack(std::span<const double> in) {
    ValidationSamples samples;
    while (!in.empty()) samples.list.push_back(ValidationSample::unpackFrom(in));
    return samples;
  }
};

/// Mean and variance (unbiased) in two passes, in the order of the values.
inline std::pair<double, double> meanAndVariance(const std::vector<double>& values) {
  const auto n = static_cast<double>(values.size());
  if (values.empty()) return {not_a_number, not_a_number};
  double sum = 0;
  for (const double x : values) sum += x;
  const double mean = sum / n;
  double squares = 0;
  for (const double x : values) squares += (x - mean) * (x - mean);
  return {mean, n > 1 ? squares / (n - 1) : not_a_number};
}

inline ValidationReport summarize(ValidationSample sample, const ReferenceLaw& law) {
  ValidationReport report;
  report.law = law;
  report.dof = law.dof();
  report.trials = sample.trials;
  report.failures = sample.failures;
  report.exceptions = sample.exceptions;
  report.max_iterations = sample.max_iterations;
  if (sample.trials > 0) report.mean_iterations = sample.iterations / static_cast<double>(sample.trials);
  for (std::size_t i = 0; i < report.extra.size(); ++i) {
    const auto [mean, variance] = meanAndVariance(sample.extra[i]);
    report.extra[i] = {sample.extra[i].size(), mean, std::sqrt(variance)};
  }

  report.mu2 = std::move(sample.mu2);
  std::sort(report.mu2.begin(), report.mu2.end());
  const auto n = static_cast<double>(report.size());
  std::tie(report.index, report.variance) = meanAndVariance(report.mu2);
  report.index_se = std::sqrt(report.variance / n);
  report.index_se_expected = report.size() > 0 ? std::sqrt(law.variance() / n) : not_a_number;
  for (const double mu2 : report.mu2) report.equivalent_chi2_sum += law.equivalentChiSquared(mu2);
  report.index_p_value = report.indexPValue();
  report.ks_statistic = ksStatistic(report.mu2, [&law](double mu2) { return law.cdf(mu2); });
  report.ks_p_value = kolmogorovPValue(report.size(), report.ks_statistic);

  constexpr std::array<double, 4> levels = {0.5, 0.9, 0.95, 0.99};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double level = levels[i], bound = law.quantile(level);
    const auto inside = std::upper_bound(report.mu2.begin(), report.mu2.end(), bound) - report.mu2.begin();
    const bool defined = report.size() > 0 && !std::isnan(bound);
    report.coverage[i] = {level, defined ? static_cast<double>(inside) / n : not_a_number,
                          defined ? std::sqrt(level * (1 - level) / n) : not_a_number};
  }
  return report;
}

inline std::span<const TrialOutcome> outcomes(const TrialOutcome& outcome) { return {&outcome, 1}; }
template <std::size_t M>
std::span<const TrialOutcome> outcomes(const std::array<TrialOutcome, M>& list) {
  return list;
}
inline std::span<const TrialOutcome> outcomes(const std::vector<TrialOutcome>& list) { return list; }

}  // namespace detail

/// Validates several estimators on the same scenes: `trial(CounterRng&, std::uint64_t number)` returns a
/// std::vector<TrialOutcome> or std::array<TrialOutcome, M> with an outcome for each law; an outcome that is missing
/// counts as failed. One report for each law, in their order.
///
/// An exception derived from std::exception fails the trial (all its outcomes) and is counted; the run goes on.
template <Executor E, class Trial>
std::vector<ValidationReport> validateAll(const E& executor, const ValidationOptions& options,
                                          const std::vector<ReferenceLaw>& laws, Trial&& trial) {
  const std::size_t n_chunks = chunkCount(options.trials, options.chunk_size);
  detail::ValidationSamples samples = executor.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        detail::ValidationSamples part;
        part.list.resize(laws.size());
        const ChunkRange range = chunkRange(options.trials, n_chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) {
          const std::uint64_t number = options.first_trial + i;
          CounterRng rng(options.seed, number);
          const TrialOutcome absent{.failed = true};
          try {
            const auto outcome = std::invoke(trial, rng, number);
            const auto list = detail::outcomes(outcome);
            for (std::size_t m = 0; m < laws.size(); ++m) part.list[m].add(m < list.size() ? list[m] : absent);
          } catch (const std::exception&) {
            for (auto& sample : part.list) {
              sample.add(absent);
              ++sample.exceptions;
            }
          }
        }
        return part;
      },
      [&](detail::ValidationSamples& done, const detail::ValidationSamples& next) {
        for (std::size_t m = 0; m < laws.size(); ++m) done.list[m].append(next.list[m]);
        if (options.progress && !laws.empty()) options.progress(done.list[0].trials, options.trials);
      });
  samples.list.resize(laws.size());  // no trials at all: no lists either

  std::vector<ValidationReport> reports;
  for (std::size_t m = 0; m < laws.size(); ++m) {
    reports.push_back(detail::summarize(std::move(samples.list[m]), laws[m]));
  }
  return reports;
}

/// Validates one estimator: `trial(CounterRng&, std::uint64_t number) -> TrialOutcome` draws a scene from the generator
/// and from nothing else, estimates, and says how far off the truth was. It is called on several threads at the same
/// time if the executor has them. See validateAll for exceptions.
template <Executor E, class Trial>
  requires std::is_same_v<std::invoke_result_t<Trial&, CounterRng&, std::uint64_t>, TrialOutcome> ValidationReport
  validate(const E& executor, const ValidationOptions& options, const ReferenceLaw& law, Trial&& trial) {
    return std::move(validateAll(executor, options, {law}, trial).front());
  }

/// The squared Mahalanobis distance (mean - truth)ᵀ covariance⁻¹ (mean - truth) for Eigen vectors; for other types what
/// argument-dependent look-up finds as mahalanobisSquared(estimate, truth), as for liestat::Gaussian. NaN if the
/// covariance is not positive definite.
struct DefaultMahalanobis {
  template <class Truth, class Estimate>
  double operator()(const Truth& truth, const Estimate& estimate) const {
    if constexpr (std::derived_from<Truth, Eigen::MatrixBase<Truth>>) {
      using Matrix = std::remove_cvref_t<decltype(estimate.covariance)>;
      const detail::Cholesky<typename Matrix::Scalar, Matrix::RowsAtCompileTime> factor(estimate.covariance);
      return static_cast<double>(factor.halfSolve(Truth(truth - estimate.mean)).squaredNorm());
    } else {
      return static_cast<double>(mahalanobisSquared(estimate, truth));
    }
  }
};

namespace detail {

/// Seen through a pointer or an optional, which may be empty.
template <class Estimate>
concept MaybeEmpty = requires(const Estimate& estimate) {
  static_cast<bool>(estimate);
  *estimate;
};

template <class Truth, class Estimate, class Mahalanobis>
TrialOutcome judge(const Truth& truth, const Estimate& estimate, const Mahalanobis& mahalanobis2) {
  if constexpr (MaybeEmpty<Estimate>) {
    return estimate ? judge(truth, *estimate, mahalanobis2) : TrialOutcome{.failed = true};
  } else {
    TrialOutcome outcome;
    if constexpr (requires { static_cast<int>(estimate.iterations); }) {
      outcome.iterations = static_cast<int>(estimate.iterations);
    }
    if constexpr (requires { static_cast<bool>(estimate.converged); }) outcome.failed = !estimate.converged;
    if (!outcome.failed) outcome.mu2 = static_cast<double>(std::invoke(mahalanobis2, truth, estimate));
    return outcome;
  }
}

}  // namespace detail

/// Validates an estimator given as its two halves:
/// - `draw_scene(CounterRng&) -> Scene`, a type with a member `truth` and whatever the estimator needs;
/// - `estimate(const Scene&) -> Estimate`, a type with members `mean` and `covariance` (or what `mahalanobis2` takes),
/// or
///   a std::optional of it, empty when the estimator gives up. Members `iterations` (a number) and `converged` (false:
///   the trial failed) are used where they exist;
/// - `mahalanobis2(truth, estimate) -> double`, see DefaultMahalanobis.
template <Executor E, class DrawScene, class Estimate, class Mahalanobis = DefaultMahalanobis>
  requires std::invocable<DrawScene&, CounterRng&> ValidationReport
  validate(const E& executor, const ValidationOptions& options, const ReferenceLaw& law, DrawScene&& draw_scene,
           Estimate&& estimate, const Mahalanobis& mahalanobis2 = {}) {
    return validate(executor, options, law, [&](CounterRng& rng, std::uint64_t) -> TrialOutcome {
      const auto scene = std::invoke(draw_scene, rng);
      return detail::judge(scene.truth, std::invoke(estimate, scene), mahalanobis2);
    });
  }

/// Prints the report as a table of at most 80 columns, the verdict last.
inline void print(std::ostream& out, const ValidationReport& report, double false_alarm = 1e-5,
                  const ValidationTolerance& tolerance = {}) {
  const auto number = [](double value, int digits) {
    std::ostringstream text;
    text.precision(digits);
    text << value;
    return text.str();
  };
  const auto padded = [](std::string text, std::size_t width) {
    if (text.size() < width) text.insert(0, width - text.size(), ' ');
    return text;
  };
  const auto line = [&](const std::string& label, double observed, double expected, const std::string& rest) {
    out << "  " << label << std::string(18 - label.size(), ' ') << padded(number(observed, 4), 11)
        << padded(number(expected, 4), 11) << (rest.empty() ? "" : "   ") << rest << '\n';
  };

  out << report.trials << " trials, " << report.failures << " failed";
  if (report.exceptions > 0) out << " (" << report.exceptions << " by an exception)";
  out << "\nlaw " << report.law.name() << ", k = " << report.dof;
  if (report.law.is_hotelling()) out << ", n = " << report.law.samples();
  out << '\n' << std::string(23, ' ') << "observed   expected\n";
  line("validation index", report.index, report.law.mean(),
       "SE " + number(report.index_se, 2) + ", p = " + number(report.index_p_value, 2));
  line("variance", report.variance, report.law.variance(), "");
  for (const Coverage& coverage : report.coverage) {
    line("inside " + number(100 * coverage.level, 3) + " %", 100 * coverage.observed, 100 * coverage.level,
         "SE " + number(100 * coverage.standard_error, 2));
  }
  line("K-S distance", report.ks_statistic, 0, "p = " + number(report.ks_p_value, 2));
  out << "  iterations        " << padded(number(report.mean_iterations, 4), 11) << std::string(14, ' ') << "at most "
      << report.max_iterations << '\n';
  const std::string reason = report.reasonToFail(false_alarm, tolerance);
  out << (reason.empty() ? "passed" : "FAILED: " + reason) << '\n';
}

/// print() with a false-alarm probability of 1e-5 and no tolerance.
inline std::ostream& operator<<(std::ostream& out, const ValidationReport& report) {
  print(out, report);
  return out;
}

}  // namespace liestat
