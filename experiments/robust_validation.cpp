#include <experiments/robust_validation.hpp>

#include <experiments/conic_scene.hpp>
#include <experiments/semidefinite_distance.hpp>
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/robust_search.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <span>
#include <utility>

namespace liestat::experiments {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
constexpr double conic_sigma = 0.005;
constexpr double inlier_share = 0.99;  // fraction of the inliers' errors below the threshold
constexpr double histogram_T = 16;     // four standard deviations

/// The elements of a list that are named.
template <class T>
std::vector<T> selected(const std::vector<T>& all, std::span<const std::size_t> named) {
  std::vector<T> list;
  for (const std::size_t i : named) list.push_back(all[i]);
  return list;
}

/// A conic through points (stats/robust_search.hpp, RobustModel). Hypotheses and local optimisation are linear.
struct ConicModel {
  using Parameter = Conic;
  static constexpr std::size_t sample_size = 5;
  static constexpr int equations = 1, free_parameters = 5;
  ConicScene scene;

  ConicModel(std::size_t inliers, std::size_t outliers, double noise_factor, CounterRng& rng)
      : scene(inliers, outliers, noise_factor * conic_sigma, rng) {}

  const std::vector<bool>& truth() const { return scene.inlier; }
  std::size_t size() const { return scene.points.size(); }
  void solve(std::span<const std::size_t> sample, std::vector<Conic>& solutions) const {
    if (const auto q = fitted(sample)) solutions.push_back(*q);
  }
  /// Sampson's error.
  double error(const Conic& q, std::size_t i) const {
    const auto J = OnConic{}.linearize(q, scene.points[i]);
    return J.value[0] * J.value[0] / (conic_sigma * conic_sigma * J.by_measurement.squaredNorm());
  }
  void errors(const Conic& q, std::span<double> out) const {
    for (std::size_t i = 0; i < size(); ++i) out[i] = error(q, i);
  }
  void errors(const Conic& q, std::span<const std::size_t> some, std::span<double> out) const {
    for (std::size_t k = 0; k < some.size(); ++k) out[k] = error(q, some[k]);
  }
  std::optional<Conic> polish(const Conic&, std::span<const std::size_t> inliers) const { return fitted(inliers); }
  std::optional<Conic> refine(const Conic& q, std::span<const std::size_t> inliers) const {
    const ConstrainedResult<Conic> r = estimate(q, inliers);
    return r.ok() ? std::optional<Conic>(r.parameter) : std::nullopt;
  }
  /// The squared distance of the truth from the estimate that starts at q; NaN where there is none.
  double distance(const Conic& q, std::span<const std::size_t> inliers) const {
    const ConstrainedResult<Conic> r = estimate(q, inliers);
    return r.ok() ? squaredDistanceFromTruth(r) : nothing;
  }

 private:
  std::optional<Conic> fitted(std::span<const std::size_t> chosen) const {
    Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
    for (const std::size_t i : chosen) addConicSquare(scene.points[i], A);
    return leastConic(A);
  }
  ConstrainedResult<Conic> estimate(const Conic& q, std::span<const std::size_t> inliers) const {
    const ConicChannel channel{selected(scene.points, inliers), {IsotropicNoise<2>(conic_sigma)}, {OnConic{}}, {}};
    ConicEstimator estimator(q, UnitConic{}, {.noise = StatedNoise::trusted}, channel);
    while (estimator.iterate()) {
    }
    return estimator.result();
  }
};

/// The homography of a plane in two images.
struct PlaneModel {
  using Parameter = Eigen::Matrix3d;
  static constexpr std::size_t sample_size = 4;
  static constexpr int equations = 2, free_parameters = 8;
  TwoViewScene scene;
  MatchNoise noise;
  std::shared_ptr<const TwoViewModel> model;

  PlaneModel(const TwoViewSceneOptions& options, double noise_factor, std::uint64_t seed) : scene(options, seed) {
    noise.first = noise.second = options.sigma / noise_factor / options.focal_length;
    const Eigen::Vector2d image = Eigen::Vector2d(options.width, options.height) / options.focal_length;
    for (const auto& one : twoViewModels({noise, image})) {
      if (one->name() == nameOf(TwoViewMotion::homography)) model = one;
    }
  }

  const std::vector<bool>& truth() const { return scene.inlier; }
  std::size_t size() const { return scene.matches.size(); }
  void solve(std::span<const std::size_t> sample, std::vector<Eigen::Matrix3d>& solutions) const {
    std::array<Eigen::Vector4d, sample_size> matches;
    for (std::size_t k = 0; k < sample_size; ++k) matches[k] = scene.matches[sample[k]];
    for (const Eigen::Matrix3d& H : solveHomography(matches)) solutions.push_back(H);
  }
  void errors(const Eigen::Matrix3d& H, std::span<double> out) const { homographyErrors(H, scene.matches, noise, out); }
  void errors(const Eigen::Matrix3d& H, std::span<const std::size_t> some, std::span<double> out) const {
    for (std::size_t k = 0; k < some.size(); ++k) out[k] = homographyError(H, scene.matches[some[k]], noise);
  }
  std::optional<Eigen::Matrix3d> polish(const Eigen::Matrix3d&, std::span<const std::size_t> inliers) const {
    const auto solutions = solveHomography(selected(scene.matches, inliers));
    return solutions.empty() ? std::nullopt : std::optional<Eigen::Matrix3d>(solutions[0]);
  }
  std::optional<Eigen::Matrix3d> refine(const Eigen::Matrix3d& H, std::span<const std::size_t> inliers) const {
    const auto r = estimate(H, inliers);
    return r.usable() ? std::optional<Eigen::Matrix3d>(r.parameter.matrix) : std::nullopt;
  }
  double distance(const Eigen::Matrix3d& H, std::span<const std::size_t> inliers) const {
    const auto r = estimate(H, inliers);
    if (!r.usable()) return nothing;
    const Eigen::Matrix3d& found = r.parameter.matrix;
    const Eigen::Matrix3d e = ((scene.H.array() * found.array()).sum() < 0 ? -1 : 1) * scene.H - found;
    return squaredDistance(Eigen::Map<const Eigen::Matrix<double, 9, 1>>(e.data()), r.covariance, free_parameters);
  }

 private:
  ModelEstimate<TwoViewMotionModel> estimate(const Eigen::Matrix3d& H, std::span<const std::size_t> inliers) const {
    TwoViewMotionModel start;
    start.matrix = H;
    return model->estimate(start, selected(scene.matches, inliers), {});
  }
};

/// RobustRow::cut_factor. An estimate that leaves out errors beyond t is an M-estimate with ψ(e) = e inside and 0 outside:
/// its variance is E ψ²/(E ψ′)² = 1/P(χ²_{p+2} < t) in units of that without a cut, where its information says
/// 1/P(χ²_p < t) (P. Huber, Robust statistics, 1981, section 3.2).
double cutFactor(int equations) {
  return inlier_share / chiSquaredCdf(chiSquaredQuantile(inlier_share, equations), equations + 2);
}

/// The outcome of one search.
struct Search {
  bool found = false;
  double distance = nothing, right = 0, wrong = nothing;
  std::size_t draws = 0;
};
/// The thresholds of one trial, as lengths; NaN where there is none.
struct Thresholds {
  double histogram = nothing, moments = nothing;
};
struct Trial {
  std::array<Search, 4> searches;  ///< of as many scores
  std::size_t n = 0;               ///< none if it ended in an exception
  Thresholds thresholds;
};

template <class Model, class Rule>
Search searched(const Model& model, const Rule& rule, double threshold, std::size_t max_draws, double confidence,
                double draw_factor, std::uint64_t seed, Thresholds& thresholds) {
  RobustSearch search(model, rule, {.inlier_threshold = threshold, .seed = seed});
  const auto done = [&] {
    const auto draws = static_cast<double>(search.draws());
    return search.draws() > 0 && draws >= draw_factor * static_cast<double>(search.neededDraws(confidence));
  };
  while (!done() && search.draws() < max_draws) search.iterate();
  const auto found = search.refined();
  Search result;
  result.draws = search.draws();
  if (!found.parameter) return result;
  std::size_t right = 0, inliers = 0;
  for (const std::size_t i : found.inliers) right += model.truth()[i] ? 1U : 0U;
  for (const bool one : model.truth()) inliers += one ? 1U : 0U;
  result.right = static_cast<double>(right) / static_cast<double>(inliers);
  if (model.size() > inliers) {
    result.wrong = static_cast<double>(found.inliers.size() - right) / static_cast<double>(model.size() - inliers);
  }
  result.found = 10 * right >= 9 * inliers;
  if (!result.found) return result;
  result.distance = model.distance(*found.parameter, found.inliers) / cutFactor(Model::equations);
  if (Model::equations == 1) {
    std::vector<double> errors(model.size());
    model.errors(*found.parameter, errors);
    const ErrorThreshold by_histogram = histogramThreshold(errors, histogram_T, threshold);
    thresholds = Thresholds{};
    if (by_histogram.found) thresholds.histogram = std::sqrt(by_histogram.squared);
    const MomentScale by_moments = scaleFromMoments(errors, {.minimal_sample = Model::sample_size});
    if (by_moments.ok()) thresholds.moments = std::sqrt(by_moments.T);
  }
  return result;
}

template <class Model>
Trial searchedByAll(const Model& model, const RobustValidation& validation, double share, std::size_t needed,
                    std::uint64_t seed) {
  const double threshold = chiSquaredQuantile(inlier_share, Model::equations);
  const auto max_draws = 1000 + static_cast<std::size_t>(20 * validation.draw_factor * static_cast<double>(needed));
  Trial trial;
  for (const RobustScore score : validation.scores) {
    Thresholds thresholds;
    const auto run = [&](const auto& rule) {
      trial.searches.at(trial.n++) =
          searched(model, rule, threshold, max_draws, validation.confidence, validation.draw_factor, seed, thresholds);
    };
    switch (score) {
      case RobustScore::relevance:
        run(Relevance{2 * threshold});
        break;
      case RobustScore::truncated_cost:
        run(TruncatedCost{threshold});
        break;
      case RobustScore::inlier_count:
        run(InlierCount{threshold});
        break;
      case RobustScore::trimmed_quantile:
        run(TrimmedQuantile{0.5 * share});  // the quantile that the report takes
        break;
    }
    if (score == validation.scores.front()) trial.thresholds = thresholds;
  }
  return trial;
}

/// A model without its local optimisation: hypotheses are what minimal samples give, as in the report.
template <class Model>
struct Unpolished {
  using Parameter = typename Model::Parameter;
  static constexpr std::size_t sample_size = Model::sample_size;
  static constexpr int equations = Model::equations, free_parameters = Model::free_parameters;
  const Model* model;

  std::size_t size() const { return model->size(); }
  void solve(std::span<const std::size_t> sample, std::vector<Parameter>& solutions) const {
    model->solve(sample, solutions);
  }
  void errors(const Parameter& q, std::span<double> out) const { model->errors(q, out); }
  void errors(const Parameter& q, std::span<const std::size_t> some, std::span<double> out) const {
    model->errors(q, some, out);
  }
  std::optional<Parameter> refine(const Parameter& q, std::span<const std::size_t> inliers) const {
    return model->refine(q, inliers);
  }
};

/// The best relevance over the draws, as steps: of a conic on 40 of 100 points.
template <class Model>
FigureCurve bestRelevance(const std::string& name, const Model& model, std::uint64_t seed) {
  constexpr std::size_t draws = 3000;
  const double threshold = chiSquaredQuantile(inlier_share, Model::equations);
  RobustSearch search(model, Relevance{2 * threshold}, {.inlier_threshold = threshold, .seed = seed});
  while (search.draws() < draws) search.iterate();
  FigureCurve curve{.name = name, .x = {}, .y = {}};
  const auto add = [&](std::size_t draw, double score) {
    curve.x.push_back(static_cast<double>(draw)), curve.y.push_back(score);
  };
  for (const BestHistory::Entry& entry : search.history().entries()) {
    if (!curve.y.empty()) add(entry.draw, curve.y.back());
    add(entry.draw, entry.score);
  }
  if (!curve.y.empty()) add(draws, curve.y.back());
  return curve;
}
std::vector<FigureCurve> relevanceOverDraws(std::uint64_t seed) {
  CounterRng rng(seed, 9);
  const ConicModel model(40, 60, 1, rng);
  return {bestRelevance("minimal samples", Unpolished<ConicModel>{&model}, seed),
          bestRelevance("with local optimisation", model, seed)};
}

struct Case {
  RobustStructure structure;
  double outliers;
  std::size_t bad, needed;
};

Trial runTrial(const Case& one, const RobustValidation& validation, std::uint64_t number, CounterRng& rng) {
  const std::size_t good = validation.measurements - one.bad;
  const double share = static_cast<double>(good) / static_cast<double>(validation.measurements);
  const std::uint64_t seed = validation.run.seed * 1000003 + number;
  if (one.structure == RobustStructure::conic) {
    return searchedByAll(ConicModel(good, one.bad, validation.noise_factor, rng), validation, share, one.needed, seed);
  }
  TwoViewSceneOptions options{
      .motion = TwoViewMotion::homography, .matches = validation.measurements, .outliers = one.outliers};
  options.sigma *= validation.noise_factor;
  return searchedByAll(PlaneModel(options, validation.noise_factor, seed), validation, share, one.needed, seed);
}

/// The k-th smallest of several numbers, k a share of their number; NaN of none.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return nothing;
  const auto k = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

ThresholdRow thresholdRow(const Case& one, const std::vector<Trial>& trials) {
  ThresholdRow row;
  row.structure = one.structure, row.outliers = one.outliers, row.trials = trials.size();
  std::vector<double> histogram, moments;
  for (const Trial& trial : trials) {
    if (std::isfinite(trial.thresholds.histogram)) histogram.push_back(trial.thresholds.histogram);
    if (std::isfinite(trial.thresholds.moments)) moments.push_back(trial.thresholds.moments);
  }
  const auto n = static_cast<double>(trials.size()), m = static_cast<double>(histogram.size());
  double sum = 0, squares = 0;
  for (const double x : histogram) sum += x, squares += x * x;
  row.histogram_found = m / n;
  row.histogram_mean = sum / m;
  row.histogram_sd = std::sqrt(std::max(0.0, squares / m - sum * sum / (m * m)));
  row.moments_found = static_cast<double>(moments.size()) / n;
  row.moments_median = quantile(moments, 0.5);
  row.moments_tenth = quantile(moments, 0.1);
  return row;
}

/// The promise of docs/robust.md about the refined estimate's covariance.
std::optional<ValidationTolerance> promiseOf(const Case& one) {
  if (one.outliers > robust_promise) return {};
  // Outliers that fit by chance: 2 % of those of a conic, hardly one of a homography. Whether the structure was found is
  // judged by itself.
  const bool conic = one.structure == RobustStructure::conic;
  return ValidationTolerance{
      .index = conic ? 0.1 : 0.04, .ks = conic ? 0.05 : 0.03, .failure_fraction = 1, .tail = 0.005};
}

}  // namespace

std::string name(RobustStructure structure) { return structure == RobustStructure::conic ? "conic" : "homography"; }

std::string name(RobustScore score) {
  constexpr const char* names[] = {"relevance", "truncated_cost", "inlier_count", "trimmed_quantile"};
  return names[static_cast<std::size_t>(score)];
}

Judgement judgementOf(const RobustValidationResult& result) {
  Judgement judgement{.promises = {}, .where = fmt::format("with up to {:g} % outliers", 100 * robust_promise)};
  for (const RobustRow& row : result.rows) {
    const std::string which =
        fmt::format("{}, {:g} % outliers, {}", name(row.structure), 100 * row.outliers, name(row.score));
    judgement.promises.push_back(
        {which, row.found_passed,
         fmt::format("found in {} of {} trials, {:g} % are promised", row.found, row.trials, 100 * row.confidence),
         static_cast<double>(row.found), row.confidence * static_cast<double>(row.trials)});
    judgement.promises.push_back(promiseAbout(row, which));
  }
  return judgement;
}

RobustValidationResult validateRobust(const RobustValidation& validation, const RunProgress& progress) {
  std::vector<Case> cases;
  std::vector<CellSize> sizes;
  double judged = 0;
  for (const RobustStructure structure : validation.structures) {
    for (const double outliers : validation.outliers) {
      const auto bad = static_cast<std::size_t>(std::lround(outliers * static_cast<double>(validation.measurements)));
      const std::size_t sample =
          structure == RobustStructure::conic ? ConicModel::sample_size : PlaneModel::sample_size;
      cases.push_back(
          {structure, outliers, bad,
           sampleCount(validation.measurements - bad, validation.measurements, sample, validation.confidence)});
      sizes.push_back({validation.run.trials, 30 + static_cast<double>(cases.back().needed)});
      judged += static_cast<double>(validation.scores.size()) * (promiseOf(cases.back()) ? 2 : 0);
    }
  }
  CellRun run(validation.run, sizes, progress);
  RobustValidationResult result;
  if (validation.figures) {
    result.figures = vievilleFigures(validation.run.seed);
    result.figures.relevance = relevanceOverDraws(validation.run.seed);
  }
  for (const Case& one : cases) {
    const bool conic = one.structure == RobustStructure::conic;
    const int k = conic ? ConicModel::free_parameters : PlaneModel::free_parameters;
    const int equations = conic ? ConicModel::equations : PlaneModel::equations;
    const std::vector<Trial> trials = run.outcomes([&](std::uint64_t number) {
      CounterRng rng(validation.run.seed, number);
      try {
        return runTrial(one, validation, number, rng);
      } catch (const std::exception&) {
        return Trial{};
      }
    });
    if (run.ended()) continue;
    const std::size_t n_trials = trials.size();
    for (std::size_t i = 0; i < validation.scores.size(); ++i) {
      RobustRow& row = result.rows.emplace_back();
      row.structure = one.structure, row.score = validation.scores[i], row.outliers = one.outliers;
      row.confidence = validation.confidence, row.needed = one.needed, row.trials = n_trials;
      const auto n = static_cast<double>(n_trials);
      std::vector<double> distances;
      for (const Trial& trial : trials) {
        const Search& search = trial.searches[i];  // found nothing if it ended in an exception
        distances.push_back(search.found ? search.distance : nothing);
        if (trial.n <= i) continue;
        row.found += search.found ? 1U : 0U;
        row.right += search.right / n, row.draws += static_cast<double>(search.draws) / n;
        row.wrong += search.wrong / n;
      }
      row.cut_factor = cutFactor(equations);
      row.conclude(reportOfDistances(distances, ReferenceLaw::chiSquared(k)), promiseOf(one), run_false_alarm / judged);
      if (row.promise) {
        row.found_passed =
            binomialSurvival(row.trials - row.found, row.trials, 1 - validation.confidence) >= run_false_alarm / judged;
      }
    }
    if (one.structure == RobustStructure::conic) result.thresholds.push_back(thresholdRow(one, trials));
  }
  return result;
}

}  // namespace liestat::experiments
