// Comparisons of groups of vectors, compiled once.
#ifndef LIESTAT_COMPILED_LAWS
#define LIESTAT_COMPILED_LAWS
#endif
#include <stats/compare_groups.hpp>

#include <stats/detail/tail_probabilities.hpp>
#include <stats/noise_fit.hpp>
#include <stats/random.hpp>
#include <stats/repeated_rows.hpp>
#include <stats/words.hpp>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Sample {
  double n = 0;
  VectorXd mean;
  MatrixXd covariance;

  explicit Sample(const MatrixXd& rows) : n(static_cast<double>(rows.rows())), mean(rows.colwise().mean()) {
    const MatrixXd centred = rows.rowwise() - mean.transpose();
    covariance = centred.transpose() * centred / (n - 1);
  }
};

/// P(F > f).
double fisherTail(double f, double dof1, double dof2) {
  return f > 0 ? detail::incompleteBeta(0.5 * dof2, 0.5 * dof1, dof2 / (dof2 + dof1 * f)) : 1;
}

double logDeterminant(const MatrixXd& a) { return 2 * MatrixXd(a.llt().matrixL()).diagonal().array().log().sum(); }

/// A matrix that is positive definite beyond rounding, in whatever units.
bool isDefinite(const MatrixXd& a) {
  const VectorXd scale = a.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return false;
  const Eigen::LLT<MatrixXd> factor(MatrixXd(scale.asDiagonal() * a * scale.asDiagonal()));
  return factor.info() == Eigen::Success && MatrixXd(factor.matrixL()).diagonal().minCoeff() > 1e-7;
}

/// James' statistic Σ (m_g - m)ᵀ W_g (m_g - m), W_g = (S_g/n_g)⁻¹, m the mean under these weights.
double jamesStatistic(const std::vector<Sample>& groups) {
  const Index d = groups[0].mean.size();
  MatrixXd total = MatrixXd::Zero(d, d);
  VectorXd pulled = VectorXd::Zero(d);
  double statistic = 0;
  for (const Sample& g : groups) {
    const MatrixXd weight = g.n * g.covariance.llt().solve(MatrixXd::Identity(d, d));
    const VectorXd weighted = weight * g.mean;
    total += weight, pulled += weighted, statistic += g.mean.dot(weighted);
  }
  return statistic - pulled.dot(total.llt().solve(pulled));
}

/// A standard gamma variable of shape a ≥ 1/2 (Marsaglia and Tsang 2000).
double gammaOf(double a, CounterRng& rng) {
  if (a < 1) return gammaOf(a + 1, rng) * std::pow(rng.uniform(), 1 / a);
  const double d = a - 1.0 / 3, c = 1 / std::sqrt(9 * d);
  for (;;) {
    const double x = rng.normal(), v = std::pow(1 + c * x, 3);
    if (v > 0 && std::log(rng.uniform()) < 0.5 * x * x + d * (1 - v + std::log(v))) return d * v;
  }
}

/// Whether draws go on, and the p of those that were made (Besag and Clifford 1991): they end once enough are above.
struct Draws {
  std::size_t most = 0, enough = 50, made = 0, above = 0;
  bool goOn() const { return made < most && above < enough; }
  void add(bool is_above) { ++made, above += is_above ? 1 : 0; }
  double p() const {
    const auto more = static_cast<std::size_t>(above < enough ? 1 : 0);
    return static_cast<double>(above + more) / static_cast<double>(made + more);
  }
};

/// Equal means whatever the covariances. Of two groups James' statistic by the law of Krishnamoorthy and Yu (2004), of more
/// by a parametric bootstrap of normal samples (Krishnamoorthy and Lu 2010): the laws of James and Johansen reject 5 % in
/// up to 9 % of small samples.
EqualityTest unequalTest(const std::vector<Sample>& groups, const ComparisonOptions& options) {
  const Index d = groups[0].mean.size();
  const double p = static_cast<double>(d);
  EqualityTest test;
  test.statistic = jamesStatistic(groups);
  if (groups.size() == 2) {
    MatrixXd sum = MatrixXd::Zero(d, d);
    for (const Sample& g : groups) sum += g.covariance / g.n;
    double spread = 0;
    for (const Sample& g : groups) {
      const MatrixXd share = sum.llt().solve(g.covariance / g.n);
      spread += ((share * share).trace() + share.trace() * share.trace()) / (g.n - 1);
    }
    const double nu = (p + p * p) / spread;
    test.numerator_dof = p, test.denominator_dof = nu - p + 1;
    test.p = fisherTail(test.statistic * (nu - p + 1) / (nu * p), p, nu - p + 1);
    return test;
  }
  std::vector<MatrixXd> factors;
  factors.reserve(groups.size());
  for (const Sample& g : groups) factors.emplace_back(g.covariance.llt().matrixL());
  std::vector<Sample> drawn = groups;
  Draws draws{options.resamples};
  CounterRng rng(options.seed, 1);
  while (draws.goOn()) {
    for (std::size_t i = 0; i < groups.size(); ++i) {
      // Bartlett's factor of a Wishart matrix.
      MatrixXd factor = MatrixXd::Zero(d, d);
      VectorXd normal(d);
      for (Index r = 0; r < d; ++r) {
        normal[r] = rng.normal() / std::sqrt(groups[i].n);
        factor(r, r) = std::sqrt(2 * gammaOf(0.5 * (groups[i].n - 1 - static_cast<double>(r)), rng));
        for (Index c = 0; c < r; ++c) factor(r, c) = rng.normal();
      }
      const MatrixXd root = factors[i] * factor;
      drawn[i].mean = factors[i] * normal, drawn[i].covariance = root * root.transpose() / (groups[i].n - 1);
    }
    draws.add(!(jamesStatistic(drawn) < test.statistic));
  }
  test.p = draws.p();
  return test;
}

/// Wilks' Λ by Rao's F, of two groups Hotelling's test, which is exact.
EqualityTest alikeTest(const std::vector<Sample>& groups) {
  const Index d = groups[0].mean.size();
  const double p = static_cast<double>(d), k = static_cast<double>(groups.size()), q = k - 1;
  double n = 0;
  VectorXd centre = VectorXd::Zero(d);
  MatrixXd within = MatrixXd::Zero(d, d), between = within;
  for (const Sample& g : groups) n += g.n, centre += g.n * g.mean;
  centre /= n;
  for (const Sample& g : groups) {
    within += (g.n - 1) * g.covariance;
    between += g.n * (g.mean - centre) * (g.mean - centre).transpose();
  }
  const double log_lambda = logDeterminant(within) - logDeterminant(within + between);
  const double terms = p * p + q * q - 5, s = terms > 0 ? std::sqrt((p * p * q * q - 4) / terms) : 1;
  EqualityTest test;
  test.numerator_dof = p * q;
  test.denominator_dof = (n - 1 - 0.5 * (p + k)) * s - 0.5 * p * q + 1;
  test.statistic = std::expm1(-log_lambda / s) * test.denominator_dof / test.numerator_dof;
  test.p = fisherTail(test.statistic, test.numerator_dof, test.denominator_dof);
  return test;
}

/// Bartlett's statistic Σ (n_g - 1)(log|S| - log|S_g|) of residuals about the groups' means, by permutation of these, which
/// are first given the variance of errors.
EqualityTest dispersionTest(const std::vector<MatrixXd>& groups, const ComparisonOptions& options) {
  const Index d = groups[0].cols();
  Index n = 0;
  for (const MatrixXd& g : groups) n += g.rows();
  MatrixXd residuals(d, n);
  std::vector<Index> order;
  Index at = 0;
  for (const MatrixXd& g : groups) {
    const double factor = std::sqrt(static_cast<double>(g.rows()) / static_cast<double>(g.rows() - 1));
    residuals.middleCols(at, g.rows()) = factor * (g.rowwise() - g.colwise().mean()).transpose();
    at += g.rows();
  }
  for (Index i = 0; i < n; ++i) order.push_back(i);
  const auto statistic = [&] {
    MatrixXd pooled = MatrixXd::Zero(d, d);
    double sum = 0, dof = 0;
    Index from = 0;
    for (const MatrixXd& g : groups) {
      MatrixXd square = MatrixXd::Zero(d, d);
      VectorXd mean = VectorXd::Zero(d);
      for (Index i = from; i < from + g.rows(); ++i) {
        const auto r = residuals.col(order[static_cast<std::size_t>(i)]);
        square += r * r.transpose(), mean += r;
      }
      const double m = static_cast<double>(g.rows());
      square -= mean * mean.transpose() / m;
      sum -= (m - 1) * logDeterminant(square / (m - 1)), dof += m - 1;
      pooled += square, from += g.rows();
    }
    return sum + dof * logDeterminant(pooled / dof);
  };
  EqualityTest test{statistic()};
  // Some ten seconds at most.
  constexpr double most_rows = 2e8;
  Draws draws{std::min(options.resamples,
                       std::max<std::size_t>(199, static_cast<std::size_t>(most_rows / static_cast<double>(n))))};
  CounterRng rng(options.seed, 2);
  while (draws.goOn()) {
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[static_cast<std::size_t>(rng.uniform() * static_cast<double>(i))]);
    }
    draws.add(!(statistic() < test.statistic));
  }
  test.p = draws.p();
  return test;
}

ComparedPair pairOf(const std::vector<Sample>& samples, std::size_t i, std::size_t j) {
  ComparedPair pair{i, j};
  pair.difference = samples[j].mean - samples[i].mean;
  pair.covariance = samples[i].covariance / samples[i].n + samples[j].covariance / samples[j].n;
  pair.means = unequalTest({samples[i], samples[j]}, {});
  return pair;
}

void adjustByHolm(std::vector<ComparedPair>& pairs) {
  std::vector<ComparedPair*> order;
  order.reserve(pairs.size());
  for (ComparedPair& pair : pairs) order.push_back(&pair);
  std::sort(order.begin(), order.end(), [](const auto* a, const auto* b) { return a->means.p < b->means.p; });
  double largest = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    largest = std::max(largest, std::min(1.0, static_cast<double>(order.size() - i) * order[i]->means.p));
    order[i]->adjusted_p = largest;
  }
}

/// Fills the groups; false, with the status, where they cannot be compared.
bool takeGroups(const std::vector<MatrixXd>& groups, std::vector<Sample>& samples, GroupComparison& result) {
  const Index d = groups[0].cols();
  for (const MatrixXd& rows : groups) {
    result.groups.push_back({std::to_string(result.groups.size() + 1), static_cast<std::size_t>(rows.rows())});
  }
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (groups[i].cols() != d || d == 0 || !groups[i].allFinite()) {
      result.status = Status::not_applicable;
      result.reason = "group " + std::to_string(i + 1) + " has another dimension, or a number that is not finite";
      return false;
    }
    if (groups[i].rows() < d + 2) {
      result.reason = "group " + std::to_string(i + 1) + " has " + std::to_string(groups[i].rows()) + " features, of " +
                      std::to_string(d) + " dimensions";
      return false;
    }
    samples.emplace_back(groups[i]);
    result.groups[i].offset = samples.back().mean, result.groups[i].dispersion = samples.back().covariance;
  }
  return true;
}

/// Mardia's skewness of rows about their mean, and its p.
struct RowSkewness {
  double b = 0, p = 1;
};
RowSkewness skewnessOf(const MatrixXd& rows) {
  const Sample sample(rows);
  const double n = sample.n;
  const Index d = rows.cols();
  const MatrixXd centred = rows.rowwise() - sample.mean.transpose();
  const MatrixXd scatter = centred.transpose() * centred / n;
  const MatrixXd w = scatter.llt().matrixL().solve(centred.transpose());
  double b = 0;
  for (Index i = 0; i < d; ++i) {
    for (Index j = i; j < d; ++j) {
      for (Index k = j; k < d; ++k) {
        const double third = w.row(i).cwiseProduct(w.row(j)).dot(w.row(k)) / n;
        b += (i == k ? 1 : i == j || j == k ? 3 : 6) * third * third;
      }
    }
  }
  const double p = static_cast<double>(d), few = (n + 1) * (n + 3) * (p + 1) / (n * ((n + 1) * (p + 1) - 6));
  return {b, detail::chiSquaredTail(n * b / 6 * few, static_cast<std::size_t>(d * (d + 1) * (d + 2) / 6))};
}

/// Skewed noise moves the means of a small group by more than that of a large one, and its own covariance with them: where
/// sizes differ, or all there is are differences, means that are equal are called different in 10 to 45 %.
void checkSkewness(const std::vector<MatrixXd>& lists, GroupComparison& result) {
  // A share of b/n of the smallest group is worth some percent of wrong rejections.
  constexpr double equal_sizes = 1.5, min_effect = 0.05;
  const auto [least, most] =
      std::minmax_element(lists.begin(), lists.end(), [](const auto& a, const auto& b) { return a.rows() < b.rows(); });
  if (result.status != Status::ok) return;
  if (lists.size() > 1 && static_cast<double>(most->rows()) < equal_sizes * static_cast<double>(least->rows())) return;
  for (const MatrixXd& rows : lists) {
    const RowSkewness skewness = skewnessOf(rows);
    const double p = std::min(1.0, static_cast<double>(lists.size()) * skewness.p);
    if (!(p < refutation_level) || !(skewness.b > min_effect * static_cast<double>(least->rows()))) continue;
    result.status = Status::inconsistent;
    result.reason = (lists.size() > 1
                         ? "the features of group " + result.groups[static_cast<std::size_t>(&rows - lists.data())].name
                         : std::string("the differences")) +
                    " are skewed (p " + significant(p, 2) + "): no p here holds";
    return;
  }
}

/// Rows that stand in a group more often than once make means more certain than they are.
void checkRepeats(const std::vector<MatrixXd>& lists, GroupComparison& result) {
  for (const MatrixXd& rows : lists) {
    const RepeatedRows repeated =
        repeatedRows(static_cast<std::size_t>(rows.rows()), static_cast<int>(rows.cols()),
                     [&](std::size_t i) { return VectorXd(rows.row(static_cast<Index>(i)).transpose()); });
    if (!repeated.matters || result.status != Status::ok) continue;
    result.status = Status::inconsistent;
    result.reason =
        (lists.size() > 1 ? "group " + result.groups[static_cast<std::size_t>(&rows - lists.data())].name + ": "
                          : std::string()) +
        repeated.inWords() + ": no p here holds";
  }
}

/// The status of a comparison that was made.
void setStatus(Index d, GroupComparison& result) {
  const auto least = static_cast<std::size_t>(std::max<Index>(10, 4 * d));
  for (const ComparedGroup& g : result.groups) {
    if (g.n >= least) continue;
    result.reason = "group " + g.name + " has " + std::to_string(g.n) + " features; p was validated from " +
                    std::to_string(least) + " on";
    return;
  }
  result.status = Status::ok;
}

}  // namespace

GroupComparison compareVectors(const std::vector<MatrixXd>& groups, const ComparisonOptions& options) {
  GroupComparison result;
  result.level = options.level;
  std::vector<Sample> samples;
  if (groups.size() < 2) return result.reason = "there are fewer than two groups", result;
  if (!takeGroups(groups, samples, result)) return result;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (isDefinite(samples[i].covariance)) continue;
    result.status = Status::ill_defined;
    result.reason = "the features of group " + result.groups[i].name + " do not scatter in every direction";
    return result;
  }
  result.means = unequalTest(samples, options), result.means_if_alike = alikeTest(samples);
  result.dispersions = dispersionTest(groups, options);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (std::size_t j = i + 1; j < samples.size(); ++j) result.pairs.push_back(pairOf(samples, i, j));
  }
  adjustByHolm(result.pairs);
  setStatus(groups[0].cols(), result);
  checkRepeats(groups, result), checkSkewness(groups, result);
  return result;
}

GroupComparison compareVectorPairs(const MatrixXd& first, const MatrixXd& second, const ComparisonOptions& options) {
  GroupComparison result;
  result.level = options.level, result.paired = true;
  std::vector<Sample> samples;
  if (first.rows() != second.rows()) {
    result.status = Status::not_applicable, result.reason = "pairs of lists of two lengths";
    return result;
  }
  if (!takeGroups({first, second}, samples, result)) return result;
  const Sample differences(second - first);
  if (!isDefinite(differences.covariance)) {
    result.status = Status::ill_defined;
    result.reason = "the differences do not scatter in every direction";
    return result;
  }
  const double p = static_cast<double>(first.cols()), n = differences.n;
  EqualityTest& test = result.means;
  test.statistic = n * differences.mean.dot(differences.covariance.llt().solve(differences.mean));
  test.numerator_dof = p, test.denominator_dof = n - p;
  test.p = detail::hotellingTail(test.statistic, static_cast<int>(first.cols()), n);
  result.pairs.push_back({0, 1, differences.mean, MatrixXd(differences.covariance / n), test, test.p});
  setStatus(first.cols(), result);
  checkRepeats({second - first}, result), checkSkewness({second - first}, result);
  return result;
}

Verdict GroupComparison::verdict() const {
  if (!ok()) return Verdict::none("the groups were not compared: " + reason);
  const std::string tested = "p " + significant(means.p, 2);
  const bool alike = paired || !(dispersions.p < level);
  const std::string spread = paired ? "" : alike ? "; dispersions do not differ, p " : "; dispersions differ, p ";
  const std::string text = tested + (paired ? "" : spread + significant(dispersions.p, 2));
  return means.p < level ? Verdict::no("the means differ: " + text) : Verdict::yes("consistent with one mean: " + text);
}

}  // namespace liestat
