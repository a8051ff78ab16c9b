#include <cli/split.hpp>

#include <lie/lie.hpp>
#include <stats/inference.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace liestat::cli {
namespace detail {

template <class M>
SplitResult split(const Measures&, const SplitPlan&, int);

}  // namespace detail

namespace {

SplitResult dispatch(const Measures& m, const SplitPlan& plan, int threads) {
  switch (m.feature) {
    case Feature::point:
      return detail::split<Eigen::Vector3d>(m, plan, threads);
    case Feature::rotation:
      return detail::split<SO3d>(m, plan, threads);
    case Feature::semi_oriented_frame:
      return detail::split<SemiOrientedFrame3d>(m, plan, threads);
    case Feature::non_oriented_frame:
      return detail::split<NonOrientedFrame3d>(m, plan, threads);
    case Feature::se3:
      return detail::split<SE3d>(m, plan, threads);
    case Feature::direction:
      return detail::split<S2d>(m, plan, threads);
    case Feature::frame:
      break;
  }
  return detail::split<Frame3d>(m, plan, threads);
}

/// The law of the squared distance of two halves. With equal halves the sum of both residual covariances is twice the
/// pooled one, which has n - 2 degrees of freedom.
ReferenceLaw lawOfHalves(const Measures& measures) {
  const int k = degreesOfFreedom(measures.feature);
  const auto n = static_cast<int>(std::min<std::size_t>(measures.size(), 1000000000));
  return measures.known_noise ? ReferenceLaw::chiSquared(k) : ReferenceLaw::hotelling(k, n - 1);
}

/// Deals `units` groups out to two halves at random, as many to each as to the other; true: the first half.
std::vector<char> deal(std::size_t units, CounterRng& rng) {
  std::vector<std::size_t> order(units);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t i = units; i > 1; --i) {
    const auto j = static_cast<std::size_t>(rng.uniform() * static_cast<double>(i));
    std::swap(order[i - 1], order[std::min(j, i - 1)]);
  }
  std::vector<char> is_first(units, 0);
  for (std::size_t i = 0; i < units / 2; ++i) is_first[order[i]] = 1;
  return is_first;
}

/// Rows in the order of time, each with the block that it belongs to.
struct Timeline {
  std::vector<std::size_t> rows;
  std::size_t blocks;

  std::size_t blockOf(std::size_t position) const { return position * blocks / rows.size(); }
};

Timeline timelineOf(const FeatureFile& file, std::size_t blocks) {
  Timeline timeline{std::vector<std::size_t>(file.size()), blocks};
  std::iota(timeline.rows.begin(), timeline.rows.end(), std::size_t{0});
  if (!file.times.empty()) {
    std::stable_sort(timeline.rows.begin(), timeline.rows.end(),
                     [&](std::size_t a, std::size_t b) { return file.times[a] < file.times[b]; });
  }
  return timeline;
}

Halves halvesOf(const Timeline& timeline, const std::vector<char>& is_first, bool by_blocks) {
  Halves halves;
  for (std::size_t i = 0; i < timeline.rows.size(); ++i) {
    const bool first = is_first[by_blocks ? timeline.blockOf(i) : i] != 0;
    (first ? halves.first : halves.second).push_back(timeline.rows[i]);
  }
  return halves;
}

/// What a measure tells, as a number: its weight, or det(Σ)^(-1/k).
double information(const Measures& m, std::size_t row) {
  if (m.criterion != Criterion::maha) return m.weights[row];
  const Covariance& covariance = m.file.covariances[row];
  const Eigen::LLT<Covariance> factor(covariance);
  double sum = 0;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) sum += std::log(factor.matrixLLT()(i, i));
  return std::exp(-2 * sum / static_cast<double>(covariance.rows()));
}

/// Degrees of freedom of the mean over the splits of the squared distance, per dimension, by Satterthwaite: 1/tr((M
/// D)²) for the mean form M = Σ a aᵀ/(c S), where a deals the units' errors of variances D = diag(1/w) out to the
/// halves and c = aᵀ D a.
double dealtDegreesOfFreedom(const std::vector<double>& w, const std::vector<std::vector<char>>& deals) {
  const auto n = static_cast<Eigen::Index>(w.size());
  const Eigen::VectorXd weight = Eigen::Map<const Eigen::VectorXd>(w.data(), n);
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(n, n);
  for (const std::vector<char>& is_first : deals) {
    Eigen::VectorXd sign(n);
    for (Eigen::Index i = 0; i < n; ++i) sign[i] = is_first[static_cast<std::size_t>(i)] != 0 ? 1 : 0;
    const double first = weight.dot(sign), second = weight.sum() - first;
    const Eigen::VectorXd a = (sign * (1 / first + 1 / second)).array() - 1 / second;
    const Eigen::VectorXd scaled = weight.cwiseSqrt().cwiseProduct(a);  // D^(1/2) times the errors' weights
    form += scaled * scaled.transpose() / ((1 / first + 1 / second) * static_cast<double>(deals.size()));
  }
  return 1 / form.squaredNorm();
}

void summarise(SplitSeries& series, double dof) {
  double sum = 0;
  std::size_t count = 0;
  for (const double d : series.distances) {
    if (std::isfinite(d)) sum += d, ++count;
  }
  series.failures = series.distances.size() - count;
  series.index = count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
  series.dof = dof;
}

}  // namespace

double SplitSeries::standardError() const { return dof * std::sqrt(2 / effective_dof); }

double SplitSeries::pValue() const { return chiSquaredSurvival(factor() * effective_dof, effective_dof); }

double SplitSeries::factorLow(double confidence) const {
  return factor() * effective_dof / chiSquaredThreshold((1 - confidence) / 2, effective_dof);
}

double SplitSeries::factorHigh(double confidence) const {
  return factor() * effective_dof / chiSquaredQuantile((1 - confidence) / 2, effective_dof);
}

std::size_t fewestMeasures(const Measures& measures, const SplitOptions& options) {
  const auto k = static_cast<std::size_t>(degreesOfFreedom(measures.feature));
  return std::max(options.blocks, measures.known_noise ? std::size_t{2} : 2 * (k + 1));
}

SplitResult splitMeasures(const Measures& measures, const SplitOptions& options, const std::function<void()>& advance) {
  const std::size_t n = measures.size();
  const Timeline timeline = timelineOf(measures.file, options.blocks);
  const auto dealt = [&](std::size_t split, bool by_blocks) {
    CounterRng rng(options.seed, split, by_blocks ? 1 : 0);
    return deal(by_blocks ? options.blocks : n, rng);
  };
  std::vector<char> early(n, 0);
  std::fill(early.begin(), early.begin() + static_cast<std::ptrdiff_t>(n / 2), char{1});
  SplitPlan plan;
  plan.splits = options.splits;
  plan.deal = [&](std::size_t split, bool by_blocks) { return halvesOf(timeline, dealt(split, by_blocks), by_blocks); };
  plan.in_time = halvesOf(timeline, early, false);
  const ReferenceLaw law = lawOfHalves(measures);
  plan.equivalentChiSquared = [&](double d) {
    const double same_rank = law.equivalentChiSquared(d);
    // So far out that the probability is zero in doubles the rank is lost, and the distance itself says enough.
    return std::isinf(same_rank) ? d : same_rank;
  };
  plan.advance = advance;
  SplitResult result = dispatch(measures, plan, options.threads);
  result.p_value = law.survival(result.squared_distance);
  result.law = law.name();

  std::vector<std::vector<char>> deals;
  for (std::size_t s = 0; s < options.splits; ++s) deals.push_back(dealt(s, true));
  const double k = degreesOfFreedom(measures.feature);
  summarise(result.random, k);
  summarise(result.by_blocks, k);
  std::vector<double> in_block(options.blocks, 0.0);
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double w = information(measures, timeline.rows[i]);
    in_block[timeline.blockOf(i)] += w;
    sum += w;
    squares += w * w;
  }
  result.by_blocks.effective_dof = k * dealtDegreesOfFreedom(in_block, deals);
  // As if each measure were a block; the share of the finite number of splits added.
  const double measures_dof = std::max(1.0, sum * sum / squares - 1);
  result.random.effective_dof = k / (1 / measures_dof + 1 / static_cast<double>(options.splits));
  return result;
}

SplitSeries pooled(const std::vector<SplitSeries>& series) {
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

}  // namespace liestat::cli
