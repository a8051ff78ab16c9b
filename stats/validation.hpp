#pragma once

// Is an estimator's covariance right? A Monte-Carlo harness for anybody's estimator (needs Boost.Math and Random123).
//
// Draw a scene of which the truth is known, estimate it, and take the squared Mahalanobis distance of the truth under
// the estimate's own covariance. If the covariance is right, these distances follow χ²_k (or Hotelling's T² where it
// came from residuals). Their mean is the validation index I of X. Pennec, "Computing the mean of geometric features",
// INRIA RR-3371, 1998, section 5.2: I > k says that the covariance is too small, I < k that it is too large.
//
//   using namespace liestat;
//   const ValidationReport report = validate(SerialExecutor{}, {.trials = 1000}, ReferenceLaw::chiSquared(3),
//                                            [](CounterRng& rng, std::uint64_t trial) {
//                                              …
//                                              return TrialOutcome{.mu2 = …};
//                                            });
//   std::cout << report;
//   return report.passed() ? 0 : 1;
//
// Reports are the same to the bit for every executor and every number of threads or ranks: trial i draws from
// CounterRng(seed, i), and all sums are made in the order of the trials.

#include <lie/detail/small_matrix.hpp>
#include <stats/detail/validation_sample.hpp>
#include <stats/executor.hpp>
#include <stats/laws.hpp>
#include <stats/random.hpp>
#include <stats/status.hpp>
#include <stats/validation_report.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <ranges>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// The number of trials and their seed.
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
  /// Asked before each task, from any thread. From the first true on no task begins, and the reports are those of the
  /// trials done by then, the first ones of the run (perhaps none).
  std::function<bool()> stop = {};
};

namespace detail {

template <class Outcome>
struct ReportOfOutcome {
  using type = ValidationReport;
};
template <HasStatistics Outcome>
struct ReportOfOutcome<Outcome> {
  using type = ValidationReportOf<Outcome>;
};

/// The outcome in what a trial returns: one, or a range of them.
template <class Returned>
struct OutcomeOf {
  using type = Returned;
};
template <std::ranges::contiguous_range Returned>
struct OutcomeOf<Returned> {
  using type = std::ranges::range_value_t<Returned>;
};
template <class Returned>
std::span<const typename OutcomeOf<Returned>::type> outcomes(const Returned& returned) {
  if constexpr (std::ranges::contiguous_range<Returned>) {
    return returned;
  } else {
    return {&returned, 1};
  }
}
template <class Trial>
using OutcomeOfTrial =
    typename OutcomeOf<std::remove_cvref_t<std::invoke_result_t<Trial&, CounterRng&, std::uint64_t>>>::type;
template <class Trial>
using ReportOfTrial = typename ReportOfOutcome<OutcomeOfTrial<Trial>>::type;

template <class Outcome>
typename ReportOfOutcome<Outcome>::type reportOf(ValidationSample sample, const ReferenceLaw& law) {
  typename ReportOfOutcome<Outcome>::type report;
  if constexpr (HasStatistics<Outcome>) {
    sample.statistics.resize(report.statistics.size());
    for (std::size_t i = 0; i < report.statistics.size(); ++i) {
      report.statistics[i] = statisticOf(sample.statistics[i]);
    }
  }
  static_cast<ValidationReport&>(report) = summarize(std::move(sample), law);
  return report;
}

}  // namespace detail

/// The report of trials that were run elsewhere: their squared Mahalanobis distances in order, NaN for those that failed,
/// of which `exceptions` by an exception.
inline ValidationReport reportOfDistances(std::span<const double> mu2, const ReferenceLaw& law,
                                          std::size_t exceptions = 0) {
  detail::ValidationSample sample;
  for (const double distance : mu2) sample.add(TrialOutcome{.mu2 = distance});
  sample.exceptions = exceptions;
  return detail::summarize(std::move(sample), law);
}

/// Validates several estimators on the same scenes: `trial(CounterRng&, std::uint64_t number)` returns a
/// std::vector or std::array of TrialOutcome, or of a type derived from it, with an outcome for each law; an outcome that
/// is missing counts as failed. One report for each law, in their order: ValidationReport, or ValidationReportOf the
/// derived type.
///
/// An exception derived from std::exception fails the trial (all its outcomes) and is counted; the run goes on.
template <Executor E, class Trial>
std::vector<detail::ReportOfTrial<Trial>> validateAll(const E& executor, const ValidationOptions& options,
                                                      const std::vector<ReferenceLaw>& laws, Trial&& trial) {
  using Outcome = detail::OutcomeOfTrial<Trial>;
  const std::size_t n_chunks = chunkCount(options.trials, options.chunk_size);
  bool cut = false;
  detail::ValidationSamples samples = executor.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        detail::ValidationSamples part;
        part.list.resize(laws.size());
        if (options.stop && options.stop()) return part;
        const ChunkRange range = chunkRange(options.trials, n_chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) {
          const std::uint64_t number = options.first_trial + i;
          CounterRng rng(options.seed, number);
          Outcome absent;
          absent.failed = true;
          try {
            const auto outcome = std::invoke(trial, rng, number);
            const std::span<const Outcome> list = detail::outcomes(outcome);
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
        // A task that began a little before the stop may come after one that did not.
        cut = cut || (!laws.empty() && (done.list[0].trials == 0 || next.list[0].trials == 0));
        if (cut) return;
        for (std::size_t m = 0; m < laws.size(); ++m) done.list[m].append(next.list[m]);
        if (options.progress && !laws.empty()) options.progress(done.list[0].trials, options.trials);
      });
  samples.list.resize(laws.size());  // no trials at all: no lists either

  std::vector<detail::ReportOfTrial<Trial>> reports;
  for (std::size_t m = 0; m < laws.size(); ++m) {
    reports.push_back(detail::reportOf<Outcome>(std::move(samples.list[m]), laws[m]));
  }
  return reports;
}

/// Validates one estimator: `trial(CounterRng&, std::uint64_t number)` draws a scene from the generator and from nothing
/// else, estimates, and says how far off the truth was, as a TrialOutcome or a type derived from it. It is called on
/// several threads at the same time if the executor has them. See validateAll for exceptions.
template <Executor E, class Trial>
  requires std::derived_from<detail::OutcomeOfTrial<Trial>, TrialOutcome>
auto validate(const E& executor, const ValidationOptions& options, const ReferenceLaw& law, Trial&& trial) {
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
    if constexpr (requires { static_cast<bool>(converged(estimate.status)); }) {
      outcome.failed = !converged(estimate.status);
    } else if constexpr (requires { static_cast<bool>(estimate.converged); }) {
      outcome.failed = !estimate.converged;
    }
    if (!outcome.failed) outcome.mu2 = static_cast<double>(std::invoke(mahalanobis2, truth, estimate));
    return outcome;
  }
}

}  // namespace detail

/// Validates an estimator given as its two halves:
/// - `draw_scene(CounterRng&) -> Scene`, a type with a member `truth` and whatever the estimator needs;
/// - `estimate(const Scene&) -> Estimate`, a type with members `mean` and `covariance` (or what `mahalanobis2` takes), or
///   a std::optional of it, empty when the estimator gives up. A member `iterations` (a number) is used where it exists,
///   and one that says whether the estimate converged, else the trial failed: `status`, for which a function
///   converged(status) exists as for liestat::Status, or `converged`;
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

}  // namespace liestat
