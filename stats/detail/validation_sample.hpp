// The trials of a validation run as they are collected, sent to other processes, and summarised.
#pragma once

#include <stats/validation_report.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

namespace liestat::detail {

/// An outcome with statistics of its own, see TrialOutcome.
template <class Outcome>
concept HasStatistics = requires {
  Outcome::statistics.size();
};

/// The trials of a chunk, or of several one after the other.
struct ValidationSample {
  std::vector<double> mu2;  ///< in the order of the trials
  std::size_t trials = 0, failures = 0, exceptions = 0;
  double iterations = 0;
  int max_iterations = 0;
  std::vector<std::vector<double>> statistics;  ///< finite values of each member, in the order of the outcome's list

  template <class Outcome>
  void add(const Outcome& outcome) {
    ++trials;
    iterations += outcome.iterations;
    max_iterations = std::max(max_iterations, outcome.iterations);
    if (outcome.failed || !std::isfinite(outcome.mu2) || outcome.mu2 < 0) {
      ++failures;
      return;
    }
    mu2.push_back(outcome.mu2);
    if constexpr (HasStatistics<Outcome>) {
      statistics.resize(Outcome::statistics.size());
      for (std::size_t i = 0; i < statistics.size(); ++i) {
        const double value = outcome.*Outcome::statistics[i];
        if (std::isfinite(value)) statistics[i].push_back(value);
      }
    }
  }

  void append(const ValidationSample& other) {
    mu2.insert(mu2.end(), other.mu2.begin(), other.mu2.end());
    trials += other.trials;
    failures += other.failures;
    exceptions += other.exceptions;
    iterations += other.iterations;
    max_iterations = std::max(max_iterations, other.max_iterations);
    statistics.resize(std::max(statistics.size(), other.statistics.size()));
    for (std::size_t i = 0; i < other.statistics.size(); ++i) {
      statistics[i].insert(statistics[i].end(), other.statistics[i].begin(), other.statistics[i].end());
    }
  }

  /// As a list of doubles, for executors that send results to other processes. Counts below 2^53 are exact.
  void packInto(std::vector<double>& out) const {
    for (const std::size_t count : {trials, failures, exceptions}) out.push_back(static_cast<double>(count));
    out.push_back(iterations);
    out.push_back(max_iterations);
    out.push_back(static_cast<double>(mu2.size()));
    out.insert(out.end(), mu2.begin(), mu2.end());
    out.push_back(static_cast<double>(statistics.size()));
    for (const auto& values : statistics) {
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
    sample.statistics.resize(static_cast<std::size_t>(take()));
    for (auto& values : sample.statistics) values = takeList();
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

inline TrialStatistic statisticOf(const std::vector<double>& values) {
  const auto [mean, variance] = meanAndVariance(values);
  return {values.size(), mean, std::sqrt(variance)};
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

}  // namespace liestat::detail
