#include <experiments/means_verdicts.hpp>

#include <experiments/means_experiment.hpp>
#include <experiments/scattered_features.hpp>
#include <lie/crystal_orientation.hpp>
#include <lie/units.hpp>
#include <stats/certified_mean.hpp>
#include <stats/laws.hpp>
#include <stats/random.hpp>
#include <stats/robust_mean.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace liestat::experiments {
namespace {

constexpr double pi = static_cast<double>(EIGEN_PI);

/// A quotient's rotations meet their rivals half as far away.
template <class M>
constexpr double fold = Quotient<M> ? 0.5 : 1.0;

/// Draws the features of a cell, whose truth is the origin.
template <class M>
class Sampler {
 public:
  explicit Sampler(const VerdictCell& cell)
      : cell_(cell), fisher_(cell.law == VerdictLaw::fisher ? cell.parameter : turned_concentration) {
    if (cell.law == VerdictLaw::flips || cell.law == VerdictLaw::half_turns) findTruth();
  }

  /// The covariance that is stated, the same for all features; none where the residuals speak.
  std::vector<SquareOf<M>> statedNoise() const {
    const double variance = cell_.law == VerdictLaw::stated          ? 0.1 * 0.1 / cell_.parameter
                            : cell_.law == VerdictLaw::stated_clouds ? 0.05 * 0.05
                                                                     : 0;
    if (!(variance > 0)) return {};
    return {SquareOf<M>(variance * SquareOf<M>::Identity())};
  }

  /// The region is that of a bootstrap.
  bool isBootstrapped() const {
    return cell_.law == VerdictLaw::exponential || cell_.law == VerdictLaw::log_normal ||
           cell_.law == VerdictLaw::normal;
  }

  /// The loss of a robust mean, if that is judged.
  std::optional<RobustLoss> loss() const {
    if (cell_.law == VerdictLaw::huber_uniform || cell_.law == VerdictLaw::huber_cluster) return RobustLoss::huber;
    if (cell_.law == VerdictLaw::median_uniform || cell_.law == VerdictLaw::median_cluster) return RobustLoss::median;
    return std::nullopt;
  }

  /// The population's mean, or all of them: points of a circle or sphere about the origin.
  const std::vector<M>& truths() const { return truths_; }

  M draw(std::size_t i, CounterRng& rng) const {
    constexpr int k = ManifoldTraits<M>::DoF, angles = std::min(k, 3);
    if (cell_.law == VerdictLaw::fisher) return fisher_.draw(rng);
    if (isTurned()) return drawTurned(rng);
    if (loss()) return drawContaminated(i, rng);
    TangentOf<M> e = rng.template normalVector<k>();
    if (isBootstrapped()) {
      for (int j = 0; j < k; ++j) e[j] = 0.05 * skewed(e[j]);
      return exp(ManifoldTraits<M>::origin(), e);
    }
    if (cell_.law == VerdictLaw::strip) {
      TangentOf<M> along = TangentOf<M>::Zero();
      along[0] = rng.uniform(-cell_.parameter, cell_.parameter);
      e[0] = 0;
      return exp(exp(ManifoldTraits<M>::origin(), along), TangentOf<M>(0.05 * e));
    }
    if (cell_.law == VerdictLaw::lever) {
      if constexpr (k == 6) {
        e.template tail<3>() *= 0.8;
        e.template head<3>() = 0.1 * e.template head<3>() + cell_.parameter * e.template tail<3>();
      }
      return exp(ManifoldTraits<M>::origin(), e);
    }
    if (cell_.law == VerdictLaw::stated) return exp(ManifoldTraits<M>::origin(), TangentOf<M>(0.1 * e));
    if (cell_.law == VerdictLaw::clouds || cell_.law == VerdictLaw::stated_clouds) {
      TangentOf<M> side = TangentOf<M>::Zero();
      side[k - 1] = (i % 2 == 0 ? 0.5 : -0.5) * fold<M> * cell_.parameter * units::degree;
      return exp(exp(ManifoldTraits<M>::origin(), side), TangentOf<M>(0.05 * e));
    }
    for (int j = 0; j < angles; ++j) {
      e[k - angles + j] *= cell_.parameter * (cell_.law == VerdictLaw::report ? 0.3 * (j + 1) : 1.0);
    }
    return exp(ManifoldTraits<M>::origin(), e);
  }

 private:
  static constexpr double turned_concentration = 20;

  bool isTurned() const {
    return cell_.law == VerdictLaw::flips || cell_.law == VerdictLaw::half_turns || cell_.law == VerdictLaw::outliers;
  }
  /// Normal errors with outliers: the first of the measurements.
  M drawContaminated(std::size_t i, CounterRng& rng) const {
    constexpr double sd = 0.1;
    constexpr int k = ManifoldTraits<M>::DoF, angles = std::min(k, 3);
    TangentOf<M> e = sd * rng.template normalVector<k>();
    const bool uniform = cell_.law == VerdictLaw::huber_uniform || cell_.law == VerdictLaw::median_uniform;
    if (static_cast<double>(i) < (uniform ? cell_.parameter : 0.2) * static_cast<double>(cell_.n)) {
      if (uniform) {
        const M anywhere = FisherLaw<M>(0).draw(rng);
        e = logOfOrigin(anywhere);
        for (int j = 0; j < k - angles; ++j) e[j] = rng.uniform(-2, 2);
      } else {
        TangentOf<M> away = TangentOf<M>::Zero();
        away[0] = away[k - 1] = cell_.parameter * sd * (k == angles ? std::sqrt(0.5) : 1);
        e = away + 0.1 * e;
      }
    }
    return exp(ManifoldTraits<M>::origin(), e);
  }
  static TangentOf<M> logOfOrigin(const M& x) { return log(ManifoldTraits<M>::origin(), x); }
  /// An error of mean 0 and variance 1 from a standard normal one.
  double skewed(double z) const {
    if (cell_.law == VerdictLaw::normal) return z;
    if (cell_.law == VerdictLaw::exponential) return -std::log(0.5 * std::erfc(z / std::numbers::sqrt2)) - 1;
    const double s2 = cell_.parameter * cell_.parameter, mean = std::exp(0.5 * s2);
    return (std::exp(cell_.parameter * z) - mean) / (mean * std::sqrt(std::exp(s2) - 1));
  }
  /// A feature of Fisher's law, which with the probability of the cell's parameter becomes another one.
  M drawTurned(CounterRng& rng) const {
    const M x = fisher_.draw(rng);
    const bool turned = rng.uniform() < cell_.parameter;
    if constexpr (std::is_same_v<M, S2d>) {
      const Eigen::Vector3d anywhere = rng.unitVector<3>(), back = -x.unit_vector();
      return !turned ? x : S2d(cell_.law == VerdictLaw::outliers ? anywhere : back);
    } else if constexpr (std::is_same_v<M, SO3d>) {
      const Eigen::Vector3d axis = cell_.law == VerdictLaw::half_turns ? Eigen::Vector3d::UnitZ() : rng.unitVector<3>();
      const Eigen::Vector4d q = rng.unitVector<4>();
      const SO3d anywhere(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
      return !turned ? x : cell_.law == VerdictLaw::outliers ? anywhere : x * SO3d::exp(pi * axis);
    } else {
      return x;
    }
  }
  /// The population's criterion is symmetric about the last axis, and its minima are as far from the origin as the
  /// least of its values along a geodesic, across that axis for random axes and along it for half-turns about it.
  void findTruth() {
    std::vector<M> some;
    CounterRng rng(1);
    for (int i = 0; i < 20000; ++i) some.push_back(drawTurned(rng));
    TangentOf<M> direction = TangentOf<M>::Zero();
    direction[cell_.law == VerdictLaw::half_turns ? ManifoldTraits<M>::DoF - 1 : 0] = 1;
    double least = 0, radius = 0;
    for (int degrees = 0; degrees <= 90; ++degrees) {
      double cost = 0;
      // Both ways, so that the draws are as symmetric as the law.
      for (const double side : {1.0, -1.0}) {
        const M y = exp(ManifoldTraits<M>::origin(), TangentOf<M>(side * degrees * units::degree * direction));
        for (const M& x : some) {
          const double d = distance(y, x);
          cost += d * d;
        }
      }
      // The same but for the draws: a single minimum is at the origin.
      if (degrees == 0 || cost < least * (1 - 1e-4)) {
        least = cost;
        radius = degrees * units::degree;
      }
    }
    if (radius == 0) return;
    truths_.clear();
    const auto add = [&](const TangentOf<M>& u) {
      truths_.push_back(exp(ManifoldTraits<M>::origin(), TangentOf<M>(radius * u)));
    };
    if (cell_.law == VerdictLaw::half_turns) {
      add(direction), add(-direction);
    } else {
      CounterRng any(2);
      for (int i = 0; i < 72; ++i) add(any.unitVector<ManifoldTraits<M>::DoF>());
    }
  }

  VerdictCell cell_;
  FisherLaw<M> fisher_;
  std::vector<M> truths_{ManifoldTraits<M>::origin()};
};

/// Orientations of crystals about one of them, each as any of its copies.
class CrystalSampler {
 public:
  explicit CrystalSampler(const VerdictCell& cell)
      : cell_(cell), truths_{CrystalOrientation(SO3d::exp({0.4, -0.2, 0.7}), *cell.symmetry)} {}

  std::vector<Eigen::Matrix3d> statedNoise() const { return {}; }
  bool isBootstrapped() const { return false; }
  std::optional<RobustLoss> loss() const { return std::nullopt; }
  const std::vector<CrystalOrientation>& truths() const { return truths_; }
  CrystalOrientation draw(std::size_t, CounterRng& rng) const {
    using T = ManifoldTraits<CrystalOrientation>;
    const double sd = cell_.parameter * T::injectivityRadius(truths_[0]);
    const CrystalOrientation x = exp(truths_[0], Eigen::Vector3d(sd * rng.normalVector<3>()));
    const Eigen::Vector4d q = rng.unitVector<4>();
    if (cell_.law == VerdictLaw::fisher) return {SO3d::fromParams(q), *cell_.symmetry};
    const auto copies = T::representativesOf(x);
    return T::representative(x, copies[static_cast<std::size_t>(rng.uniform() * static_cast<double>(copies.size()))]);
  }

 private:
  VerdictCell cell_;
  std::vector<CrystalOrientation> truths_;
};

/// The outcomes of one trial: counts of 0 and 1.
struct Outcome {
  bool ok = false, ambiguous = false, ill_defined = false, outside = false, wrong = false, plain_outside = false;
  bool widened = false, inconsistent = false;
};

template <class M>
Outcome judgeRobust(const std::vector<M>& samples, RobustLoss loss, const M& truth, double quantile) {
  const RobustMean<M> result = robustMean(samples, loss);
  const auto misses = [&](const Gaussian<M>& estimate) { return !(mahalanobisSquared(estimate, truth) <= quantile); };
  const MeanResult<M> plain = mean(samples);
  return {.ok = result.status == Status::ok,
          .ambiguous = result.status == Status::ambiguous,
          .ill_defined = result.status == Status::ill_defined,
          .outside = result.estimate && misses(*result.estimate),
          .plain_outside = misses({plain.mean, covarianceFromResiduals(plain)}),
          .inconsistent = result.status == Status::inconsistent};
}

template <class M, class Draws>
Outcome judgeTrial(const Draws& sampler, double quantile, std::size_t n, CounterRng& rng) {
  std::vector<M> samples;
  samples.reserve(n);
  for (std::size_t i = 0; i < n; ++i) samples.push_back(sampler.draw(i, rng));
  if (sampler.loss()) return judgeRobust(samples, *sampler.loss(), sampler.truths().front(), quantile);
  CertifiedMeanOptions<M> options;
  // A certificate that is not found changes no verdict; a rival that is, is found early.
  options.uniqueness.budget = 200'000;
  options.known_noise = sampler.statedNoise();
  if (sampler.isBootstrapped()) options.region = MeanRegion::bootstrap;
  const CertifiedMean<M> result = certifiedMean(samples, options);
  const std::vector<M>& truths = sampler.truths();
  const auto misses = [&](const SquareOf<M>& covariance) {
    return std::any_of(truths.begin(), truths.end(), [&](const M& truth) {
      return !(mahalanobisSquared(Gaussian<M>{result.mean.mean, covariance}, truth) <= quantile);
    });
  };
  Outcome outcome{.ok = result.status == Status::ok,
                  .ambiguous = result.status == Status::ambiguous,
                  .ill_defined = result.status == Status::ill_defined,
                  .plain_outside = misses(options.known_noise.empty()
                                              ? covarianceFromResiduals(result.mean)
                                              : covarianceFromCommonNoise(result.mean, options.known_noise[0])),
                  .inconsistent = result.status == Status::inconsistent};
  if (!outcome.ok) return outcome;
  outcome.outside = misses(result.estimate->covariance);
  outcome.widened = result.region_factor > 1;
  const TangentOf<M> error = log(result.mean.mean, truths.front());
  outcome.wrong = std::abs(error[ManifoldTraits<M>::DoF - 1]) > 0.25 * fold<M> * pi;
  return outcome;
}

template <Metric M, class Draws = Sampler<M>>
VerdictRow judge(const VerdictCell& cell, std::uint64_t seed, CellRun& run) {
  const Draws sampler(cell);
  constexpr int k = ManifoldTraits<M>::DoF;
  const ReferenceLaw law = sampler.statedNoise().empty() ? ReferenceLaw::hotelling(k, static_cast<int>(cell.n))
                                                         : ReferenceLaw::chiSquared(k);
  const double quantile = law.quantile(0.95);
  VerdictRow row;
  row.cell = cell;
  // Its rates are of all of its trials.
  for (const Outcome& o : run.outcomes(
           [&](std::uint64_t number) {
             CounterRng rng(seed, number, 7);
             return judgeTrial<M>(sampler, quantile, cell.n, rng);
           },
           true)) {
    row.ok += o.ok, row.ambiguous += o.ambiguous, row.ill_defined += o.ill_defined;
    row.outside += o.outside, row.wrong += o.wrong, row.plain_outside += o.plain_outside, row.widened += o.widened;
    row.inconsistent += o.inconsistent;
  }
  return row;
}

/// Compares a rate with its bound, give or take four standard errors of that many trials.
void compare(VerdictRow& row, const char* what, const std::optional<double>& bound, double rate, double trials,
             bool at_most) {
  if (!bound) return;
  const double margin = 4 * std::sqrt(*bound * (1 - *bound) / trials);
  const bool kept = at_most ? rate <= *bound + margin : rate >= *bound - margin;
  row.passed = row.passed.value_or(true) && kept;
  if (!kept) row.failure += fmt::format("{}{} {:.4f}", row.failure.empty() ? "" : ", ", what, rate);
}

void giveVerdict(VerdictRow& row) {
  const VerdictPromise& p = row.promise;
  const double trials = static_cast<double>(row.cell.trials);
  compare(row, "ok but outside", p.max_outside, row.rate(row.outside), trials, true);
  if (2 * row.ok >= row.cell.trials) {
    compare(row, "coverage", p.min_coverage, row.coverage(), static_cast<double>(row.ok), false);
  }
  compare(row, "kept", p.min_kept, row.rate(row.ok), trials, false);
  compare(row, "kept", p.max_kept, row.rate(row.ok), trials, true);
  compare(row, "ambiguous", p.max_ambiguous, row.rate(row.ambiguous), trials, true);
  compare(row, "ill-defined", p.max_ill_defined, row.rate(row.ill_defined), trials, true);
  compare(row, "inconsistent", p.max_inconsistent, row.rate(row.inconsistent), trials, true);
  compare(row, "wrong side", p.max_wrong, row.rate(row.wrong), trials, true);
}

}  // namespace

std::string name(VerdictLaw law) {
  constexpr const char* names[] = {"fisher",         "report",        "isotropic",     "clouds", "flips",
                                   "half_turns",     "outliers",      "strip",         "lever",  "stated",
                                   "stated_clouds",  "exponential",   "log_normal",    "normal", "huber_uniform",
                                   "median_uniform", "huber_cluster", "median_cluster"};
  return names[static_cast<std::size_t>(law)];
}

VerdictPromise promiseOf(const VerdictCell& cell) {
  const bool quotient = cell.feature == Feature::semi_oriented_frame || cell.feature == Feature::non_oriented_frame;
  const double x = cell.parameter;
  VerdictPromise promise;
  if (cell.law == VerdictLaw::clouds) {
    if (x >= 174) promise.max_wrong = 0.01;
    // Directions that lie on opposite sides of a mean are as scattered as uniform ones while they are few.
    if (x <= 160 && cell.feature == Feature::rotation) promise.max_ambiguous = promise.max_ill_defined = 0;
    return promise;
  }
  if (cell.law == VerdictLaw::stated_clouds || (cell.law == VerdictLaw::stated && x >= 4)) {
    promise.max_kept = 0.001;
    return promise;
  }
  if (cell.law == VerdictLaw::normal || cell.law == VerdictLaw::exponential || cell.law == VerdictLaw::log_normal) {
    const bool few = cell.law == VerdictLaw::log_normal && cell.n < 50;
    promise.min_coverage = cell.law == VerdictLaw::normal ? 0.945 : few ? 0.90 : 0.93;
    promise.min_kept = 0.99;
    return promise;
  }
  promise.max_outside = 0.07;
  if (cell.law == VerdictLaw::huber_uniform || cell.law == VerdictLaw::median_uniform) {
    promise.min_coverage = 0.93;
    promise.min_kept = 0.85;
    return promise;
  }
  // A cluster within the noise of 20 measurements is not told from it.
  if (cell.law == VerdictLaw::huber_cluster || cell.law == VerdictLaw::median_cluster) {
    if (x < 4 && cell.n < 50) promise.max_outside = std::nullopt;
    if (cell.n >= 50) promise.max_outside = 0.03;
    return promise;
  }
  if (cell.law == VerdictLaw::stated) {
    promise.max_inconsistent = 0.01;
    promise.min_coverage = 0.93;
    promise.min_kept = 0.98;
    return promise;
  }
  if (cell.law == VerdictLaw::flips || cell.law == VerdictLaw::half_turns) {
    // Three or four of thirty directions are so few that their score is far from normal.
    if (x == 0.15 && cell.n <= 30) promise.max_outside = 0.10;
    if (x <= 0.1 && cell.n >= 30 && cell.law == VerdictLaw::flips) promise.min_kept = 0.85;
    return promise;
  }
  if (cell.law == VerdictLaw::lever) promise.max_outside = 0.075;
  promise.min_coverage = 0.925;
  if (cell.law == VerdictLaw::lever) return promise;
  promise.min_coverage = 0.93;
  if (cell.law == VerdictLaw::outliers || cell.law == VerdictLaw::strip) {
    if (cell.n >= 30) promise.min_kept = 0.98;
    return promise;
  }
  if (cell.law == VerdictLaw::fisher) {
    if (x == 0) promise.max_kept = 0.02;
    const bool direction = cell.feature == Feature::direction;
    if (cell.n >= 10 && (x >= 20 || (x >= 4 && !quotient))) promise.min_kept = 0.95;
    if (direction && cell.n >= 30 && x >= 2) promise.min_kept = 0.95;
    return promise;
  }
  if (cell.law == VerdictLaw::report && cell.feature == Feature::rotation && x == 1) {
    if (cell.n >= 30) {
      promise.min_kept = 0.98;
    } else {
      promise.max_ambiguous = 0.05, promise.max_ill_defined = 0.08;
    }
  }
  if (cell.law == VerdictLaw::report && quotient && x == 1) {
    // Beyond any expansion: few are kept, and their coverage is not promised.
    promise.min_coverage = std::nullopt;
  }
  if (cell.symmetry && cell.law == VerdictLaw::isotropic && x <= 0.2 && cell.n >= 10) promise.min_kept = 0.95;
  if (cell.law == VerdictLaw::isotropic && quotient && x <= 0.5 && cell.n >= 30) promise.min_kept = 0.90;
  return promise;
}

std::vector<VerdictCell> verdictCells(bool full) {
  std::vector<VerdictCell> cells;
  const auto add_cell = [&](Feature feature, VerdictLaw law, double parameter, std::size_t n, std::size_t trials) {
    if (n > static_cast<std::size_t>(degreesOfFreedom(feature))) cells.push_back({feature, law, parameter, n, trials});
  };
  const auto add_crystals = [&](const char* group, VerdictLaw law, double parameter, std::size_t n,
                                std::size_t trials) {
    cells.push_back({Feature::rotation, law, parameter, n, trials, PointGroup::fromName(group)});
  };
  if (!full) {
    for (const Feature feature : {Feature::direction, Feature::rotation}) {
      add_cell(feature, VerdictLaw::fisher, 0, 10, 400);
      add_cell(feature, VerdictLaw::fisher, 0.5, 30, 200);
      add_cell(feature, VerdictLaw::fisher, 1, 30, 200);
      add_cell(feature, VerdictLaw::fisher, 2, 30, 200);
      add_cell(feature, VerdictLaw::fisher, 4, 10, 400);
    }
    add_cell(Feature::semi_oriented_frame, VerdictLaw::fisher, 2, 10, 200);
    add_cell(Feature::semi_oriented_frame, VerdictLaw::isotropic, 0.5, 30, 200);
    add_cell(Feature::non_oriented_frame, VerdictLaw::fisher, 20, 10, 200);
    add_cell(Feature::non_oriented_frame, VerdictLaw::isotropic, 0.5, 30, 200);
    add_cell(Feature::rotation, VerdictLaw::report, 1, 10, 400);
    add_cell(Feature::rotation, VerdictLaw::report, 1, 30, 200);
    for (const double degrees : {160.0, 178.0, 180.0})
      add_cell(Feature::rotation, VerdictLaw::clouds, degrees, 40, 200);
    add_cell(Feature::direction, VerdictLaw::flips, 0.1, 100, 200);
    add_cell(Feature::direction, VerdictLaw::flips, 0.15, 30, 400);
    add_cell(Feature::direction, VerdictLaw::flips, 0.25, 30, 400);
    add_cell(Feature::direction, VerdictLaw::outliers, 0.2, 30, 200);
    add_cell(Feature::rotation, VerdictLaw::flips, 0.3, 30, 200);
    add_cell(Feature::rotation, VerdictLaw::half_turns, 0.15, 30, 200);
    add_cell(Feature::frame, VerdictLaw::lever, 20, 30, 200);
    for (const Feature feature : {Feature::direction, Feature::rotation, Feature::frame}) {
      cells.push_back({feature, VerdictLaw::stated, 1, 5, 400});
      cells.push_back({feature, VerdictLaw::stated, 10, 9, 200});
    }
    cells.push_back({Feature::rotation, VerdictLaw::stated_clouds, 179, 40, 200});
    add_cell(Feature::direction, VerdictLaw::exponential, 0, 20, 400);
    add_cell(Feature::rotation, VerdictLaw::log_normal, 1, 50, 400);
    for (const Feature feature : {Feature::direction, Feature::rotation, Feature::frame, Feature::non_oriented_frame}) {
      for (const double part : {0.0, 0.3}) add_cell(feature, VerdictLaw::huber_uniform, part, 20, 400);
      add_cell(feature, VerdictLaw::huber_cluster, 12, 20, 200);
      add_cell(feature, VerdictLaw::median_uniform, 0.3, 20, 200);
    }
    for (const char* group : {"432", "622"}) {
      add_crystals(group, VerdictLaw::fisher, 0, 10, 200);
      add_crystals(group, VerdictLaw::isotropic, 0.2, 10, 400);
      add_crystals(group, VerdictLaw::isotropic, 0.4, 30, 200);
    }
    return cells;
  }
  for (const Feature feature : {Feature::point, Feature::direction, Feature::rotation, Feature::frame}) {
    for (const std::size_t n : {20, 50, 100}) {
      add_cell(feature, VerdictLaw::normal, 0, n, 2000);
      add_cell(feature, VerdictLaw::exponential, 0, n, 2000);
      for (const double s : {0.5, 1.0}) add_cell(feature, VerdictLaw::log_normal, s, n, 2000);
    }
  }
  for (const Feature feature : {Feature::direction, Feature::rotation, Feature::frame, Feature::semi_oriented_frame,
                                Feature::non_oriented_frame}) {
    for (const std::size_t n : {20, 50, 200}) {
      for (const double part : {0.0, 0.1, 0.2, 0.3}) {
        add_cell(feature, VerdictLaw::huber_uniform, part, n, 2000);
        add_cell(feature, VerdictLaw::median_uniform, part, n, 2000);
      }
      for (const double away : {2.0, 3.0, 4.0, 6.0, 12.0}) {
        add_cell(feature, VerdictLaw::huber_cluster, away, n, 2000);
        add_cell(feature, VerdictLaw::median_cluster, away, n, 2000);
      }
    }
  }
  for (const char* group : {"2", "222", "3", "32", "4", "422", "6", "622", "23", "432"}) {
    for (const std::size_t n : {5, 10, 30, 100}) {
      add_crystals(group, VerdictLaw::fisher, 0, n, 1000);
      for (const double part : {0.1, 0.2, 0.3, 0.4, 0.5, 0.7}) {
        add_crystals(group, VerdictLaw::isotropic, part, n, 1000);
      }
    }
  }
  for (const Feature feature : all_features) {
    // Points have no cut locus, rigid motions no metric.
    if (feature == Feature::point || !info(feature).has_metric) continue;
    for (const double kappa : {0.0, 0.2, 0.5, 1.0, 2.0, 4.0, 20.0}) {
      for (const std::size_t n : {5, 10, 30, 100}) add_cell(feature, VerdictLaw::fisher, kappa, n, 4000);
    }
    for (const double spread : {1.0 / 3, 1.0}) {
      for (const std::size_t n : {10, 30, 100}) {
        if (feature != Feature::direction) add_cell(feature, VerdictLaw::report, spread, n, 4000);
      }
    }
    for (const std::size_t n : {10, 30, 100}) add_cell(feature, VerdictLaw::isotropic, 0.5, n, 4000);
    if (feature == Feature::direction || feature == Feature::rotation) {
      for (const double part : {0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4}) {
        for (const std::size_t n : {30, 100, 300}) {
          add_cell(feature, VerdictLaw::flips, part, n, 2000);
          if (feature == Feature::rotation) add_cell(feature, VerdictLaw::half_turns, part, n, 2000);
        }
      }
      for (const double part : {0.1, 0.2, 0.3}) {
        for (const std::size_t n : {10, 30, 100}) add_cell(feature, VerdictLaw::outliers, part, n, 2000);
      }
    }
    if (feature == Feature::direction) {
      for (const double half : {0.8, 1.2, 1.5}) {
        for (const std::size_t n : {10, 30, 100}) add_cell(feature, VerdictLaw::strip, half, n, 2000);
      }
    }
    if (feature == Feature::frame) {
      for (const double lever : {0.5, 2.0, 20.0}) {
        for (const std::size_t n : {10, 30, 100}) add_cell(feature, VerdictLaw::lever, lever, n, 2000);
      }
    }
    for (const std::size_t n : {2, 5, 10, 30, 100}) cells.push_back({feature, VerdictLaw::stated, 1, n, 5000});
    // χ²/ν of 4, 10, 100 at 40, 15 and 6 degrees of freedom at least.
    cells.push_back({feature, VerdictLaw::stated, 4, 22, 5000});
    cells.push_back({feature, VerdictLaw::stated, 10, 9, 5000});
    cells.push_back({feature, VerdictLaw::stated, 100, 4, 5000});
    for (const double degrees : {30.0, 60.0, 120.0, 178.0, 179.0, 179.5, 180.0}) {
      cells.push_back({feature, VerdictLaw::stated_clouds, degrees, 40, 5000});
    }
    for (const double degrees : {150.0, 160.0, 170.0, 174.0, 176.0, 178.0, 179.0, 180.0}) {
      for (const std::size_t n : {10, 40, 1000}) {
        add_cell(feature, VerdictLaw::clouds, degrees, n, n < 1000 ? 4000 : 400);
      }
    }
  }
  return cells;
}

std::vector<VerdictRow> judgeVerdicts(const std::vector<VerdictCell>& cells, std::uint64_t seed, int threads,
                                      const RunProgress& progress) {
  std::vector<CellSize> sizes;
  for (const VerdictCell& cell : cells) sizes.push_back({cell.trials, static_cast<double>(cell.n * cell.trials)});
  CellRun run({.seed = seed, .threads = threads}, sizes, progress);
  std::vector<VerdictRow> rows;
  for (const VerdictCell& cell : cells) {
    VerdictRow row = cell.symmetry ? judge<CrystalOrientation, CrystalSampler>(cell, seed, run)
                                   : withFeature(cell.feature, [&]<class M>() -> VerdictRow {
                                       if constexpr (ExperimentFeature<M>) {
                                         return judge<M>(cell, seed, run);
                                       } else {
                                         return {};
                                       }
                                     });
    if (run.ended()) continue;
    row.promise = promiseOf(cell);
    giveVerdict(row);
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace liestat::experiments
