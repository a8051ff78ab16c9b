// The closed form of visual-inertial initialisation on tracks of which many are wrong: consensus over features.
//
//   const auto robust = liestat::solveClosedFormRobustly(window, {.bearing_noise = 1. / 450});
//   if (robust.ok()) … robust.result.solutions[0], robust.outliers
//
// A feature enters the problem of the motion as a 7×7 block (10×10 with the accelerometer's bias), and blocks add up:
// a hypothesis is the sum of those of a few features drawn at random, and costs no elimination. Source: the design note
// on visual-inertial initialisation, section 3.8; M. Fischler and R. Bolles, "Random sample consensus", 1981; the
// truncated cost and the local optimisation of hypotheses are P. Torr and A. Zisserman's (MLESAC, 2000) and O. Chum, J.
// Matas and J. Kittler's (LO-RANSAC, 2003).
#pragma once

#include <fusion/init/closed_form.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// Indices are the window's. Features that fewer than two images have seen are in neither list.
struct ConsensusResult {
  ClosedFormResult result;                     ///< of the inliers; of all features where there is no consensus
  std::vector<std::size_t> inliers, outliers;  ///< ascending; no inliers: no consensus
  std::size_t hypotheses = 0;                  ///< that were tried; 0: too few features to choose from, all are taken

  /// Exactly one answer, which explains the data of the inliers.
  bool ok() const { return !inliers.empty() && result.ok(); }
};

namespace detail {

/// The search for the motion that most features agree with.
class MotionConsensus {
 public:
  struct Score {
    double cost;  ///< Σ min(mean square angle / limit, 1)
    std::size_t agreeing = 0;
  };

  /// `result` is that of rayTable.
  MotionConsensus(RayTable& table, const ClosedFormResult& result, const InitialisationOptions& options)
      : table_(table),
        options_(options),
        solver_(table, options),
        limit_(std::pow(options.consensus.max_residual * options.bearing_noise, 2)) {
    solver_.resetWeights();
    solver_.eliminate();
    const double min_parallax = options.closed_form.min_parallax * options.bearing_noise;
    for (std::size_t i = 0; i < table.features(); ++i) {
      has_parallax_.push_back(hasParallax(result.features[table.feature[i]], min_parallax));
      if (has_parallax_.back()) drawable_.push_back(i);
    }
    best_.cost = static_cast<double>(table.features());
  }

  /// Whether there is anything to choose from.
  bool possible() const { return drawable_.size() > options_.consensus.features_drawn; }
  const std::vector<bool>& agreeing() const { return agreeing_; }
  /// More than those that a hypothesis is made of.
  bool found() const { return best_.agreeing > options_.consensus.features_drawn; }

  /// Draws hypotheses until it is improbable that there is a better one; returns how many.
  std::size_t search(CounterRng& random) {
    std::size_t tried = 0;
    for (double enough = 1; static_cast<double>(tried) < enough && tried < options_.consensus.max_hypotheses; ++tried) {
      draw(random);
      MotionBlock sum(solver_.bias());
      for (std::size_t k = 0; k < options_.consensus.features_drawn; ++k)
        sum += solver_.eliminated()[drawable_[k]].block;
      Triangle root = Triangle::cholesky(sum.Q);
      if (solver_.hasPrior()) solver_.addPrior(root);
      for (const MotionCandidate& c : solver_.minimise(root, 1e-12)) {
        if (keepIfBetter(c.y)) improve();
      }
      enough = hypothesesNeeded();
    }
    return tried;
  }

 private:
  /// A random sample at the head of the list, without replacement.
  void draw(CounterRng& random) {
    for (std::size_t k = 0; k < options_.consensus.features_drawn; ++k) {
      const std::size_t left = drawable_.size() - k;
      // Rounding may bring the largest number to 1.
      const auto chosen = std::min(left - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(left)));
      std::swap(drawable_[k], drawable_[k + chosen]);
    }
  }

  /// The mean squared angle, relative to each bearing's own sigma, of a feature with its best position for a
  /// motion; the limit, where it is beyond or behind.
  double meanSquare(std::size_t i, const Motion& y) const {
    const Eigen::Vector3d P = solver_.feature(i, y);
    const std::span<const Ray> rays = table_.of(i);
    const double most = limit_ * static_cast<double>(rays.size());
    double sum = 0;
    for (const Ray& ray : rays) {
      const Eigen::Vector3d d = relativePosition(table_.images[ray.image], P, y);
      // Without parallax the sign of a depth is noise. NaN is out.
      if (has_parallax_[i] && !(ray.u.dot(d) > 0)) return limit_;
      sum += ray.precision * ray.precision * ray.u.cross(d).squaredNorm() / d.squaredNorm();
      if (!(sum < most)) return limit_;
    }
    return sum / static_cast<double>(rays.size());
  }

  bool keepIfBetter(const Motion& y) {
    Score score{0};
    scratch_.assign(table_.features(), false);
    for (std::size_t i = 0; i < table_.features(); ++i) {
      const double square = meanSquare(i, y);
      scratch_[i] = square < limit_;
      score.agreeing += scratch_[i];
      score.cost += square / limit_;
      if (!(score.cost < best_.cost)) return false;
    }
    best_ = score;
    motion_ = y;
    std::swap(agreeing_, scratch_);
    return true;
  }

  /// Solves again for all that agree with the best, with the weights of their depths and without the bias of noise.
  void improve() {
    for (std::size_t pass = 0; pass < options_.consensus.local_passes && found(); ++pass) {
      RayTable table;
      table.window = table_.window;
      table.images = table_.images;
      table.cameras = table_.cameras;
      MotionCandidate candidate{motion_, {}};
      for (std::size_t i = 0; i < table_.features(); ++i) {
        if (!agreeing_[i] || !has_parallax_[i]) continue;
        const std::span<const Ray> rays = table_.of(i);
        table.rays.insert(table.rays.end(), rays.begin(), rays.end());
        table.begin.push_back(table.rays.size());
        table.feature.push_back(i);
        candidate.P.push_back(solver_.feature(i, motion_));
      }
      if (table.features() == 0) return;
      ClosedFormSolver solver(table, options_);
      solver.setWeights(candidate);
      bool better = false;
      for (const MotionCandidate& c : solver.minimise(solver.withoutNoise().root, 1e-12)) {
        better = keepIfBetter(c.y) || better;
      }
      if (!better) return;
    }
  }

  double hypothesesNeeded() const {
    const double right = static_cast<double>(best_.agreeing) / static_cast<double>(table_.features());
    const double miss = 1 - std::pow(right, static_cast<double>(options_.consensus.features_drawn));
    return miss < 1 && found() ? std::log1p(-options_.consensus.confidence) / std::log(std::max(miss, 1e-300))
                               : static_cast<double>(options_.consensus.max_hypotheses);
  }

  RayTable& table_;
  const InitialisationOptions& options_;
  ClosedFormSolver solver_;
  double limit_;
  std::vector<bool> has_parallax_, agreeing_, scratch_;
  std::vector<std::size_t> drawable_;  ///< features with parallax
  Motion motion_;
  Score best_{0};
};

/// The features of a solution whose squared angles are too large for noise, by χ²: what drifts slowly passes the limit
/// of a hypothesis. Where most are larger than noise the motion is to blame, such as a bias: their median is the
/// scale.
inline std::vector<std::size_t> misfits(const ClosedFormResult& result, const InitialisationOptions& options) {
  std::vector<std::size_t> used;
  std::vector<double> relative;
  const auto freedom = [&](std::size_t i) { return 2 * static_cast<double>(result.features[i].observations) - 3; };
  for (std::size_t i = 0; i < result.features.size() && !result.solutions.empty(); ++i) {
    const ClosedFormFeature& feature = result.features[i];
    if (!feature.used || !(freedom(i) > 0)) continue;
    const double angle = feature.residual / (feature.relative_sigma * options.bearing_noise);
    used.push_back(i);
    relative.push_back(angle * angle * static_cast<double>(feature.observations) / freedom(i));
  }
  const double scale = std::max(1., median(relative));
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < used.size(); ++k) {
    const double limit = 1 + options.consensus.misfit_sigmas * std::sqrt(2 / freedom(used[k]));
    if (relative[k] > scale * limit) found.push_back(used[k]);
  }
  return found;
}

}  // namespace detail

/// Velocity, gravity and features of a window of which up to half of the tracks, and more with more hypotheses, are
/// wrong. Bad input: see result.fault; options that make no sense, such as no noise, are bad_option.
inline ConsensusResult solveClosedFormRobustly(const ClosedFormWindow& window, const InitialisationOptions& options) {
  ConsensusResult robust;
  ClosedFormResult& result = robust.result;
  const ConsensusOptions& own = options.consensus;
  result.fault = detail::faultOf(window, options);
  if (!result.fault && (!(options.bearing_noise > 0) || !(own.max_residual > 0) || own.features_drawn == 0 ||
                        !(own.misfit_sigmas > 0) || !(own.confidence >= 0 && own.confidence < 1))) {
    result.fault = FaultKind::bad_option;
  }
  if (result.fault) return robust;
  detail::RayTable table = detail::rayTable(window, result);
  std::vector<bool> agreeing(table.features(), true);
  if (table.features() > 0) {
    detail::MotionConsensus consensus(table, result, options);
    if (consensus.possible()) {
      CounterRng random(own.seed);
      robust.hypotheses = consensus.search(random);
      agreeing.assign(table.features(), false);
      if (consensus.found()) agreeing = consensus.agreeing();
    }
  }
  ClosedFormWindow kept = window;
  const bool found = std::find(agreeing.begin(), agreeing.end(), true) != agreeing.end();
  for (std::size_t i = 0; i < table.features(); ++i) {
    const std::size_t feature = table.feature[i];
    (agreeing[i] ? robust.inliers : robust.outliers).push_back(feature);
    // A feature without observations keeps its place.
    if (found && !agreeing[i]) kept.features[feature].clear();
  }
  result = solveClosedForm(kept, options);
  if (robust.hypotheses == 0 || !found) return robust;
  for (std::size_t pass = 0; pass < own.local_passes; ++pass) {
    const std::vector<std::size_t> wrong = detail::misfits(result, options);
    if (wrong.empty() || robust.inliers.size() < wrong.size() + own.features_drawn) break;
    for (const std::size_t i : wrong) {
      kept.features[i].clear();
      robust.inliers.erase(std::find(robust.inliers.begin(), robust.inliers.end(), i));
      robust.outliers.push_back(i);
    }
    result = solveClosedForm(kept, options);
  }
  std::sort(robust.outliers.begin(), robust.outliers.end());
  for (const std::size_t i : robust.outliers) result.features[i].observations = window.features[i].size();
  return robust;
}

}  // namespace liestat
