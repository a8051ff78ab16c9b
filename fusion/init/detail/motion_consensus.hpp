// The search for the motion that most features of a window agree with; see fusion/init/consensus.hpp.
#pragma once

#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/init/detail/closed_form_solver.hpp>
#include <fusion/init/closed_form_types.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace liestat::detail {

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

  /// True if there are more features to draw from than a hypothesis takes.
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

}  // namespace liestat::detail
