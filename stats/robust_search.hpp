// Robust estimation of one model by random minimal samples (Viéville, Lingrand and Gaspard 2000, section 4): a
// hypothesis for each draw, scored by the errors of all measurements under it; the best is refined once on its inliers.
//
//   RobustSearch search(model, Relevance{2 * threshold}, {.inlier_threshold = threshold, .seed = 1});
//   while (!stop(search.history(), search.draws())) search.iterate();
//   const auto estimate = search.refined();
//
// One hypothesis is one iterate(), and best() is what has been found so far: the search may be stopped at any time. The
// same seed gives the same draws. docs/robust.md has the options and what they cost.
#pragma once

#include <stats/random.hpp>
#include <stats/robust.hpp>
#include <stats/status.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// A model and the measurements that it is fitted to. `solve` appends the parameters that a minimal sample allows to a
/// list (none for a degenerate sample); `errors` writes the squared error of each measurement in units of its noise;
/// `refine` estimates from several measurements, started at a parameter, and returns nothing where that fails.
template <class T>
concept RobustModel = requires(const T& model, const typename T::Parameter& parameter,
                               std::span<const std::size_t> measurements, std::span<double> errors,
                               std::vector<typename T::Parameter>& solutions) {
  {std::integral_constant<std::size_t, T::sample_size>{}};
  { model.size() } -> std::convertible_to<std::size_t>;
  model.solve(measurements, solutions);
  model.errors(parameter, errors);
  { model.refine(parameter, measurements) } -> std::convertible_to<std::optional<typename T::Parameter>>;
};

/// A model that also has the errors of some measurements, in the order in which they are named: hypotheses are then
/// given up as soon as they cannot be better than the best.
template <class T>
concept ModelOfSome = RobustModel<T> && requires(const T& model, const typename T::Parameter& parameter,
                                                 std::span<const std::size_t> measurements, std::span<double> errors) {
  model.errors(parameter, measurements, errors);
};

/// A model with a cheap estimate from several measurements, a linear one or a few Gauss–Newton steps: each hypothesis that
/// is better than those before it is then improved by it (O. Chum, J. Matas and J. Kittler, Locally optimized RANSAC, 2003).
template <class T>
concept PolishedModel = RobustModel<T> &&
    requires(const T& model, const typename T::Parameter& parameter, std::span<const std::size_t> measurements) {
  { model.polish(parameter, measurements) } -> std::convertible_to<std::optional<typename T::Parameter>>;
};

struct RobustSearchOptions {
  /// A measurement is an inlier if its squared error is below this, in units of the noise: χ²_{0.99} of its equations.
  double inlier_threshold = 6.6349;
  std::uint64_t seed = 1;
  /// Give hypotheses up as soon as the measurements left cannot make them the best (a ModelOfSome and a BoundedRule).
  /// This changes no result.
  bool early_rejection = true;
  /// The probability at which a hypothesis that would be the best may be given up by mistake, because the measurements
  /// seen so far, drawn at random, speak against it (Hoeffding's bound). 0: never. At 1e-3 most wrong hypotheses cost a
  /// few dozen measurements, however many there are.
  double rejection_risk = 0;
  /// Hypotheses that score no more than this are nothing: they never become the best, and are given up early before
  /// there is any.
  double min_score = -std::numeric_limits<double>::infinity();
  /// Improve each hypothesis that is better than those before it by the model's polish(), where it has one.
  bool local_optimisation = true;
  int polish_rounds = 4;  ///< at most; fewer where the score does not rise
};

/// The result of a search. Without a parameter nothing fitted yet.
template <class Parameter>
struct RobustEstimate {
  std::optional<Parameter> parameter;
  double score = -std::numeric_limits<double>::infinity();
  std::vector<std::size_t> inliers;  ///< ascending
  std::size_t draw = 0;              ///< in which it was found
  bool refined = false;              ///< estimated from the inliers of what the draw gave
  /// The stated noise under the parameter; refined() tests it. Where it is larger than stated the inliers are too few,
  /// and a covariance from them is too small.
  NoiseCheck noise = {};

  Status status() const {
    return !parameter ? Status::not_converged : noise.refuted() ? Status::inconsistent : Status::ok;
  }
};

/// The search for one model, a hypothesis at a time. It keeps a reference to the model, whose measurements must not
/// change. iterate() allocates nothing, but where the model or the rule does.
template <RobustModel Model, ScoringRule Rule>
class RobustSearch {
 public:
  using Parameter = typename Model::Parameter;
  static constexpr std::size_t sample_size = Model::sample_size;

  RobustSearch(const Model& model, const Rule& rule, const RobustSearchOptions& options = {})
      : model_(&model), rule_(rule), options_(options), errors_(model.size()) {
    best_.inliers.reserve(model.size());
    candidate_.inliers.reserve(model.size());
    polished_.inliers.reserve(model.size());
    scratch_.reserve(model.size());
    solutions_.reserve(16);
    history_.reserve(64);
    if constexpr (rejects) orderMeasurements();
  }
  RobustSearch(const Model&&, const Rule&, const RobustSearchOptions& = {}) = delete;  // the model must live on

  /// One draw: a minimal sample, its solutions, their scores. True if the best improved. With fewer measurements than a
  /// sample needs, or none, nothing happens.
  bool iterate() {
    ++draws_;
    if (model_->size() < std::max<std::size_t>(sample_size, 1)) return false;
    CounterRng rng(options_.seed, draws_);
    drawSample(rng);
    solutions_.clear();
    model_->solve(std::span<const std::size_t>(sample_), solutions_);
    bool improved = false;
    for (const Parameter& solution : solutions_) {
      if (isHopeless(solution, rng) || !evaluate(solution, unpolished_, candidate_)) continue;
      unpolished_ = candidate_.score;
      if constexpr (PolishedModel<Model>) polish();
      if (!(candidate_.score > best_.score)) continue;
      std::swap(best_, candidate_);
      best_.draw = draws_;
      improved = true;
    }
    if (improved) history_.add(draws_, best_.score);
    return improved;
  }

  std::size_t draws() const { return draws_; }
  const RobustEstimate<Parameter>& best() const { return best_; }
  /// The scores of the best, when it improved.
  const BestHistory& history() const { return history_; }
  /// How many errors of measurements were computed.
  std::size_t evaluatedErrors() const { return evaluated_; }

  /// How many draws hold, with this probability, a sample of inliers alone, if the inliers are those of the best.
  std::size_t neededDraws(double confidence) const {
    return sampleCount(best_.inliers.size(), model_->size(), sample_size, confidence);
  }
  /// So many draws are done.
  bool confidenceReached(double confidence) const { return draws_ >= neededDraws(confidence); }

  /// The best, refined once: estimated from its inliers, classified again, estimated again. To repeat that until
  /// nothing changes makes a threshold that follows the scale collapse. An estimate stands if the cost that it
  /// minimises, the truncated one, is not higher; the score may be lower where the rule is another. Else what was best.
  RobustEstimate<Parameter> refined() const {
    RobustEstimate<Parameter> result = best_;
    if (!result.parameter) return result;
    const TruncatedCost cost{options_.inlier_threshold};
    std::vector<double> errors(model_->size());
    model_->errors(*result.parameter, errors);
    double before = cost(errors);
    for (int pass = 0; pass < 2; ++pass) {
      const std::optional<Parameter> next = model_->refine(*result.parameter, result.inliers);
      if (!next) break;
      model_->errors(*next, errors);
      const double after = cost(errors);
      if (!(after >= before)) break;
      result.parameter = next, result.score = rule_(errors), result.refined = true;
      listInliers(errors, result.inliers);
      before = after;
    }
    model_->errors(*result.parameter, errors);
    result.noise = checkNoise(errors, options_.inlier_threshold, equations);
    return result;
  }

 private:
  static constexpr bool rejects = ModelOfSome<Model> && BoundedRule<Rule>;
  static constexpr std::size_t block = 16;
  static constexpr int equations = [] {
    if constexpr (requires { Model::equations; }) {
      return static_cast<int>(Model::equations);
    } else {
      return 1;
    }
  }();

  /// Distinct measurements, each set with the same probability (Floyd's algorithm).
  void drawSample(CounterRng& rng) {
    const std::size_t n = model_->size();
    for (std::size_t k = 0; k != sample_size; ++k) {
      const std::size_t j = n - sample_size + k, i = below(j + 1, rng);
      const auto end = sample_.begin() + static_cast<std::ptrdiff_t>(k);
      sample_[k] = std::find(sample_.begin(), end, i) == end ? i : j;
    }
  }
  static std::size_t below(std::size_t n, CounterRng& rng) {
    return std::min(static_cast<std::size_t>(rng.uniform() * static_cast<double>(n)), n - 1);
  }

  /// A random order of the measurements, twice, so that each hypothesis starts elsewhere in it.
  void orderMeasurements() {
    const std::size_t n = model_->size();
    CounterRng rng(options_.seed, 0, 1);
    order_.resize(2 * n);
    for (std::size_t i = 0; i < n; ++i) order_[i] = i;
    for (std::size_t i = n; i > 1; --i) std::swap(order_[i - 1], order_[below(i, rng)]);
    std::copy_n(order_.begin(), n, order_.begin() + static_cast<std::ptrdiff_t>(n));
  }

  /// True if the hypothesis cannot become the best, or does not with all but the probability `rejection_risk`: the mean
  /// of k numbers of [0, 1] drawn at random from several with the mean μ is m < μ or less with no more than the
  /// probability exp(-k D), D = m log(m/μ) + (1 - m) log((1 - m)/(1 - μ)) (W. Hoeffding 1963, theorem 1 and section 6).
  /// The j-th look takes 6/(πj)² of the risk, which adds up to all of it.
  bool isHopeless([[maybe_unused]] const Parameter& parameter, [[maybe_unused]] CounterRng& rng) {
    if constexpr (rejects) {
      const double to_beat = std::max(unpolished_, options_.min_score);
      if (!options_.early_rejection || !(to_beat > -std::numeric_limits<double>::infinity())) return false;
      const std::size_t n = model_->size();
      const double all = static_cast<double>(n), range = 1 - Rule::lowest;
      const double required = rule_.required(n, to_beat) - 1e-9 * all;  // whatever the order of a sum rounds
      const double risk = options_.rejection_risk * 6 / (3.14159265358979323846 * 3.14159265358979323846);
      const double mean = std::min((required / all - Rule::lowest) / range, 1.0);
      const std::size_t* measurements = order_.data() + below(n, rng);
      std::array<double, block> errors;
      double sum = 0;
      std::size_t look = 1;
      for (std::size_t k = 0; k < n; ++look) {
        const std::size_t count = std::min(block, n - k);
        model_->errors(parameter, std::span<const std::size_t>(measurements + k, count),
                       std::span<double>(errors.data(), count));
        evaluated_ += count;
        for (std::size_t i = 0; i < count; ++i) sum += rule_.contribution(errors[i], to_beat);
        k += count;
        const double seen = static_cast<double>(k);
        if (sum + (all - seen) < required) return true;
        const double m = (sum / seen - Rule::lowest) / range;
        if (!(risk > 0) || !(m < mean)) continue;
        const double divergence = (m > 0 ? m * std::log(m / mean) : 0) + (1 - m) * std::log((1 - m) / (1 - mean));
        if (seen * divergence > std::log(static_cast<double>(look * look) / risk)) return true;
      }
    }
    return false;
  }

  /// Makes an estimate of the parameter; true if it scores higher than that and has inliers.
  bool evaluate(const Parameter& parameter, double to_beat, RobustEstimate<Parameter>& estimate) {
    model_->errors(parameter, errors_);
    evaluated_ += errors_.size();
    if constexpr (requires { rule_(errors_, scratch_); }) {
      estimate.score = rule_(errors_, scratch_);
    } else {
      estimate.score = rule_(errors_);
    }
    if (!(estimate.score > std::max(to_beat, options_.min_score))) return false;
    listInliers(errors_, estimate.inliers);
    estimate.parameter = parameter;
    estimate.refined = false;
    return !estimate.inliers.empty();
  }

  /// The candidate; where it has hardly an inlier that the best has not, that would lead to the best again.
  void polish() {
    if (!options_.local_optimisation) return;
    if (candidate_.score <= best_.score && 10 * inliersOfCandidateAlone() <= candidate_.inliers.size()) return;
    for (int round = 0; round < options_.polish_rounds && candidate_.inliers.size() > sample_size; ++round) {
      const std::optional<Parameter> better = model_->polish(*candidate_.parameter, candidate_.inliers);
      if (!better || !evaluate(*better, candidate_.score, polished_)) return;
      std::swap(candidate_, polished_);
      candidate_.refined = true;
    }
  }

  std::size_t inliersOfCandidateAlone() const {
    std::size_t alone = 0;
    auto other = best_.inliers.begin();
    for (const std::size_t i : candidate_.inliers) {
      while (other != best_.inliers.end() && *other < i) ++other;
      alone += other == best_.inliers.end() || *other != i;
    }
    return alone;
  }

  void listInliers(std::span<const double> errors, std::vector<std::size_t>& list) const {
    list.clear();
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (errors[i] < options_.inlier_threshold) list.push_back(i);
    }
  }

  const Model* model_;
  Rule rule_;
  RobustSearchOptions options_;
  RobustEstimate<Parameter> best_, candidate_, polished_;
  /// The best score of a hypothesis before it was polished. Hypotheses compete with each other: against a wrong one that
  /// was polished a right one of a noisy sample would have no chance.
  double unpolished_ = -std::numeric_limits<double>::infinity();
  BestHistory history_;
  std::array<std::size_t, sample_size> sample_{};
  std::vector<Parameter> solutions_;
  std::vector<double> errors_, scratch_;
  std::vector<std::size_t> order_;
  std::size_t draws_ = 0, evaluated_ = 0;
};

}  // namespace liestat
