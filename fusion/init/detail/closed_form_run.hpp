// One solve of the closed form: exact data by ranks, noisy data by weights, noise and what is left of it.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/init/detail/closed_form_candidates.hpp>
#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/init/detail/closed_form_ranks.hpp>
#include <fusion/init/detail/closed_form_uncertainty.hpp>
#include <fusion/init/detail/closed_form_solver.hpp>
#include <fusion/init/detail/closed_form_status.hpp>
#include <fusion/init/detail/rest_parallax.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::detail {

/// One solve: a class only to hold what its steps share.
class ClosedFormRun {
 public:
  ClosedFormRun(RayTable& table, const InitialisationOptions& options, ClosedFormResult& result)
      : table_(table), options_(options), result_(result), solver_(table, options) {}

  void run() {
    const bool exact = !(options_.bearing_noise > 0);
    if (exact || options_.closed_form.singular_values) {
      const RankDiagnosis ranks = diagnoseRanks(table_, solver_.bias());
      result_.null_dimension = ranks.motion_null + ranks.feature_null;
      result_.largest_singular_value = ranks.largest;
      result_.singular_values = ranks.values;
      if (exact) solveExactly(ranks);
    }
    if (!exact) solveNoisy();
    report();
  }

 private:
  using Candidate = MotionCandidate;
  /// Measured (docs/closed_form.md): at constant velocity or acceleration 0.91 and more in 1800 windows.
  static constexpr double lost_share = 0.8;
  /// Distance, in standard deviations of the tilt, up to which the two solutions of a lost direction are one double root:
  /// the tilt is predicted to first order, which near a double root is short of what noise moves it by.
  static constexpr double double_root_sigmas = 5;
  /// Angle (rad) within which two minimisers of exact data are one double root, where a line touches the sphere. They
  /// depend on the data by a square root there: a relative error of 1e-10 by rounding moves them by as much.
  static constexpr double exact_double_root_angle = 1e-5;
  /// A lost direction involves gravity if it moves G T²/2 by more than this fraction of V T. Measured
  /// (docs/closed_form.md): below 0.06 in 98 % of the windows of constant velocity, above 0.19 otherwise.
  static constexpr double gravity_part = 0.1;
  /// Distance from a plane, in standard deviations, up to which directions count as coplanar.
  static constexpr double coplanar_sigmas = 3;
  /// Fraction of noise above which a second direction counts as lost besides the first; being the second, it is smaller.
  static constexpr double second_lost_share = 0.5 * lost_share;
  using Status = FusionStatus;

  void solveExactly(const RankDiagnosis& ranks) {
    Status& status = result_.status;
    status = statusOfRanks(ranks, table_, result_.images_used, options_.gravity.has_value());
    const bool has_prior = solver_.hasPrior();
    const bool infinite = ranks.motion_null > 1 || status == Status::no_parallax || status == Status::too_few_images ||
                          status == Status::gravity_undetermined || status == Status::coplanar;
    const bool finite_plane = status == Status::coplanar && ranks.motion_null == 1 && options_.gravity;
    if (infinite && !finite_plane && !(status == Status::bias_unobservable && has_prior)) return;

    solver_.resetWeights();
    Triangle root = ranks.root;
    for (double& x : root.r.value) x /= solver_.sigma();
    // Where the data decide, exact data decide alone.
    const bool needs_prior = has_prior && ranks.motion_null > 0;
    if (needs_prior) solver_.addPrior(root);
    candidates_ = solver_.minimise(root, needs_prior ? 1e-13 : solver_.rankTolerance());
    for (Candidate& c : candidates_) {
      if (status == Status::scale_unobservable) addScale(ranks, c);
      const double reach = 1 + 2 * farthest(table_, c.y);
      for (std::size_t i = 0; i < table_.features(); ++i) {
        c.P.push_back(apply(ranks.by_motion[i], c.y));
        // A depth that is free: anywhere in front of the camera.
        if (ranks.feature_rank[i] < 3) c.P.back() += reach * table_.of(i).front().u;
      }
      if (status == Status::scale_unobservable) normaliseScale(c, table_);
      solver_.evaluate(c);
    }
    for (std::size_t i = 0; i < table_.features(); ++i) {
      result_.features[table_.feature[i]].depth_determined =
          ranks.feature_rank[i] == 3 && status != Status::scale_unobservable;
    }
    if (status == Status::stationary) {
      if (candidates_.empty() || relativeMotion(table_, candidates_[0].y) > 1e-6) status = Status::no_parallax;
    }
    // Gravity is determined by itself here: the sphere's other minimum is no solution.
    if (status == Status::stationary || status == Status::scale_unobservable || status == Status::no_parallax) {
      candidates_.resize(std::min<std::size_t>(candidates_.size(), 1));
    }
    decideExactly();
  }

  void solveNoisy() {
    // A feature without parallax says nothing on the motion but that it is small, which is wrong.
    RayTable near = withParallax(table_, result_, options_.closed_form.min_parallax * solver_.sigma());
    if (near.features() == 0) {
      result_.status = solveAtRest() ? Status::stationary : Status::no_parallax;
      return;
    }
    std::swap(table_, near);
    countUsed();
    if (tooFew()) {
      result_.status = Status::too_few_images;
      return;
    }
    solver_.resetWeights();
    Triangle root = Triangle::cholesky(solver_.eliminate().Q);
    if (solver_.hasPrior()) solver_.addPrior(root);
    candidates_ = minima(root);
    if (candidates_.empty()) return;                 // not finite
    const Candidate least_squares = candidates_[0];  // the global minimum, whatever its angles
    order(candidates_, table_);
    solver_.setWeights(candidates_[0]);
    NoiseShare share = solver_.withoutNoise();
    candidates_ = minima(share.root);
    // Each minimiser with the weights of its own depths; one with most features behind the camera is beyond help.
    for (Candidate& c : candidates_) {
      for (int pass = 1; pass < options_.closed_form.weight_passes && isInFront(c, table_); ++pass) {
        solver_.setWeights(c);
        const std::vector<Candidate> next = minima(solver_.withoutNoise().root);
        if (next.empty()) break;
        const bool second = next.size() == 2 && gravityAngle(next[1], c) < gravityAngle(next[0], c);
        c = next[second ? 1 : 0];
      }
    }
    order(candidates_, table_);
    // Both may have gone to the same minimum.
    if (candidates_.size() == 2 && gravityAngle(candidates_[0], candidates_[1]) < 1e-6) candidates_.pop_back();
    solver_.setWeights(candidates_[0]);
    share = solver_.withoutNoise();
    result_.noise_share = share.shares[0];
    lost_features_.clear();
    for (std::size_t i = 0; i < table_.features(); ++i) {
      lost_features_.push_back(solver_.feature(i, share.directions[0]));
    }
    predictUncertainty(solver_, table_, candidates_[0], result_);
    classify(share);
    withhold(least_squares, share);
  }

  /// The minimisers of a problem, with the features as they were eliminated last.
  std::vector<Candidate> minima(const Triangle& root) {
    std::vector<Candidate> found = solver_.minimise(root, 1e-12);
    for (Candidate& c : found) {
      for (std::size_t i = 0; i < table_.features(); ++i) c.P.push_back(solver_.feature(i, c.y));
      solver_.evaluate(c);
    }
    return found;
  }
  bool tooFew() const {
    const std::size_t features = table_.features(), rows = 2 * table_.rays.size();
    return genericNullDimension(result_.images_used, features, solver_.bias()) >= 2 ||
           rows + 1 < 3 * features + static_cast<std::size_t>(solver_.motionSize());
  }
  void countUsed() {
    for (ClosedFormFeature& feature : result_.features) feature.used = false;
    for (const std::size_t i : table_.feature) result_.features[i].used = true;
    std::vector<bool> seen(table_.times(), false);
    for (const Ray& ray : table_.rays) seen[table_.timeOf(ray)] = true;
    result_.images_used = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), true));
    result_.features_used = table_.features();
    result_.observations_used = table_.rays.size();
  }
  /// True if forces and tracks are those of a body at rest: then that is the solution, with depths, which are free, of
  /// 1 m.
  bool solveAtRest() {
    const std::optional<Eigen::Vector3d> G =
        gravityAtRest(table_, options_.gravity, solver_.gravityScale(), options_.prior.accelerometer_sigma);
    if (!G) return false;
    const RestParallax parallax = RestParallaxTest(table_).run();
    if (!parallax.atRest()) return false;
    result_.unseen_speed_per_depth = parallax.unseen_speed;
    Candidate rest{Motion(solver_.bias()), {}};
    rest.y.set(rest.y.size - 4, *G);
    for (std::size_t i = 0; i < table_.features(); ++i) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const Ray& ray : table_.of(i)) mean += ray.u;
      rest.P.push_back(table_.images[0].s + mean.normalized());
    }
    solver_.evaluate(rest);
    candidates_ = {rest};
    return true;
  }

  /// Decides whether the data tell the minimisers of exact data with a null space apart.
  void decideExactly() {
    order(candidates_, table_);
    Status& status = result_.status;
    if (candidates_.empty()) return;
    if (status == Status::mirror_gravity && !hasRival(candidates_)) status = Status::ok;
    if (status != Status::ambiguous) return;
    if (candidates_.size() < 2 || gravityAngle(candidates_[0], candidates_[1]) < exact_double_root_angle) {
      status = Status::double_root;
    } else if (!hasRival(candidates_) || candidates_[1].negative > 0) {
      status = Status::ok;
    }
  }
  /// V and P may be scaled together: a length for both, before it is normalised.
  void addScale(const RankDiagnosis& ranks, Candidate& c) const {
    for (int k = 0; k < solver_.motionSize(); ++k) c.y[k] += ranks.vectors.back()[k];
  }
  /// The case with noise. A direction of the motion is lost where noise is nearly all that is known of it.
  void classify(const NoiseShare& share) { result_.status = caseOf(share); }

  Status caseOf(const NoiseShare& share) {
    const Motion& weak = share.directions[0];
    const bool lost = share.shares[0] > lost_share;
    // Plain least squares never quite fit, and that says nothing on the case.
    const bool misfit = options_.closed_form.remove_noise_bias && !isConsistent();
    // A bias may make up for what gravity gains.
    const bool moves_gravity = (weak.gravity() - weak.bias()).norm() > gravity_part * weak.velocity().norm();
    const Eigen::Vector3d G = candidates_[0].y.gravity(), along = weak.gravity().normalized();
    // Where the lost direction leaves the sphere of gravity again: the other solution.
    const Eigen::Vector3d other = G - 2 * G.dot(along) * along;
    const double chord = std::atan2(G.cross(other).norm(), G.dot(other));
    // Without a lost direction two minima within a sigma are one, not quite converged.
    if (candidates_.size() == 2 && !lost && gravityAngle(candidates_[0], candidates_[1]) < result_.tilt_sigma) {
      candidates_.pop_back();
    }
    const bool rival = hasRival(candidates_) && isInFront(candidates_[1], table_);
    if (coplanarityMatters(result_.images_used, table_.features()) &&
        outOfPlane(table_.rays) < coplanar_sigmas * solver_.sigma()) {
      return Status::coplanar;
    }
    if (lost && !moves_gravity) return Status::scale_unobservable;
    if (lost && (share.shares[1] > second_lost_share || !options_.gravity || misfit)) {
      return Status::gravity_undetermined;
    }
    if (rival && solver_.bias() && isMirror(candidates_)) return Status::mirror_gravity;
    if (lost && !(chord > double_root_sigmas * result_.tilt_sigma)) return Status::double_root;
    if (rival) return Status::ambiguous;
    if (!(result_.tilt_sigma <= options_.closed_form.max_tilt_sigma)) return Status::gravity_undetermined;
    if (!(result_.scale_sigma <= options_.closed_form.max_scale_sigma)) return Status::scale_unobservable;
    return biasRestsOnPrior(result_, options_) ? Status::bias_unobservable : Status::ok;
  }

  /// Keeps of the solutions what the status promises.
  void withhold(const Candidate& least_squares, const NoiseShare& share) {
    const Status status = result_.status;
    const bool vague = !(result_.tilt_sigma <= options_.closed_form.max_tilt_sigma) ||
                       !(result_.scale_sigma <= options_.closed_form.max_scale_sigma);
    if (status == Status::gravity_undetermined || (status == Status::coplanar && vague)) candidates_.clear();
    if (status == Status::scale_unobservable) {
      candidates_.resize(1);
      Candidate& c = candidates_[0];
      if (share.shares[0] > lost_share) {
        // Noise has drawn least squares to a scale of nothing, which is where gravity is told best; the direction of
        // the motion and its features are those of the lost direction.
        c = least_squares;
        c.y.set(0, share.directions[0].velocity());
        for (std::size_t i = 0; i < c.P.size(); ++i) c.P[i] = lost_features_[i];
      }
      normaliseScale(c, table_);
      solver_.evaluate(c);
    }
    if (candidates_.empty() || status == Status::scale_unobservable) {
      result_.covariance.resize(0, 0);
      result_.covariance_content = ClosedFormCovarianceContent::none;
      for (ClosedFormFeature& feature : result_.features) {
        feature.depth_determined = false;
        feature.depth_sigma = std::numeric_limits<double>::infinity();
      }
    }
  }

  std::size_t degreesOfFreedom() const {
    const std::size_t rows =
        2 * table_.rays.size() + (options_.bearing_noise > 0 && solver_.hasPrior() ? std::size_t{3} : 0);
    const std::size_t unknowns =
        3 * table_.features() + static_cast<std::size_t>(solver_.motionSize()) - (options_.gravity ? 1 : 0);
    return rows > unknowns ? rows - unknowns : 0;
  }
  /// True if noise alone explains the first minimiser's cost.
  bool isConsistent() const { return candidates_[0].cost <= noiseLimit(static_cast<double>(degreesOfFreedom())); }

  void report() {
    const double T = table_.window, g = solver_.gravityScale();
    for (const Candidate& c : candidates_) {
      ClosedFormSolution s;
      s.velocity = c.y.velocity() / T;
      s.gravity = g * c.y.gravity();
      s.accelerometer_bias = g * c.y.bias();
      s.features.assign(result_.features.size(), Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
      for (std::size_t i = 0; i < table_.features(); ++i) s.features[table_.feature[i]] = c.P[i];
      s.cost = c.cost;
      s.negative_depths = c.negative;
      result_.solutions.push_back(std::move(s));
    }
    result_.degrees_of_freedom = degreesOfFreedom();
    // With a scale that is made up there is no cost to speak of.
    result_.consistent = result_.status == Status::scale_unobservable || (!candidates_.empty() && isConsistent());
    if (candidates_.empty()) return;
    for (std::size_t i = 0; i < table_.features(); ++i) {
      double square = 0;
      for (const Ray& ray : table_.of(i)) {
        const Eigen::Vector3d d = relativePosition(table_.images[ray.image], candidates_[0].P[i], candidates_[0].y);
        square += ray.precision * ray.precision * ray.u.cross(d).squaredNorm() / d.squaredNorm();
      }
      ClosedFormFeature& feature = result_.features[table_.feature[i]];
      feature.residual = feature.relative_sigma * std::sqrt(square / static_cast<double>(table_.of(i).size()));
    }
  }

  RayTable& table_;
  const InitialisationOptions& options_;
  ClosedFormResult& result_;
  ClosedFormSolver solver_;
  std::vector<Candidate> candidates_;
  std::vector<Eigen::Vector3d> lost_features_;  ///< where the features go along the direction that is known least
};

}  // namespace liestat::detail
