// Visual-inertial initialisation in closed form: velocity, gravity and the positions of features out of a second or
// more of images and inertial readings, without a first guess.
//
//   liestat::ClosedFormWindow window;             // images: C_j, S_j of preintegration; features: their bearings
//   const auto result = liestat::solveClosedForm(window, {.bearing_noise = 1. / 450});
//   if (result.ok()) … result.solutions[0].velocity, .gravity, .features
//
// For a feature P seen along u from image j at dt, in the body's axes at the first image,
//   P - V dt - G dt²/2 - S_j - C_j p_c  is a multiple of u,
// which is linear in P, V and G (A. Martinelli, "Closed-form solution to the structure from motion problem by fusing
// visual and inertial sensing", 2012; the design note on visual-inertial initialisation, section 3). Two equations an
// observation, across the bearing; features are eliminated one by one; gravity's length makes the rest a least-squares
// problem on a sphere, which has up to two minima. Both are returned, with a status that says whether the data decide.
//
// It is in double only: its ranks are decided at 1e-10.
#pragma once

#include <fusion/closed_form_types.hpp>
#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/closed_form_solver.hpp>
#include <fusion/detail/closed_form_status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat {

/// The factor γ₂ by which the second solution's scene and motion are the first one's scaled, for an acceleration that
/// is constant or seen by three images only: A the specific force (with three images its mean, meanSpecificForce), G
/// gravity (m/s²). The second solution is (γ₂ P, γ₂ (V + L) - L, γ₂ (A + G) - A), L = S₂/dt₂ - A dt₂/2, which is 0 for a
/// constant acceleration. γ₂ = 1: a double root; γ₂ ≤ 0 (|A| ≤ |G|): the
/// second has its features behind the camera. A camera away from the body's origin (p_c) fixes the scale and voids it
/// where the body rotates. Design note 3.3.
inline double secondSolutionScale(const Eigen::Vector3d& specific_force, const Eigen::Vector3d& gravity) {
  return (specific_force.squaredNorm() - gravity.squaredNorm()) / (specific_force + gravity).squaredNorm();
}

/// The mean specific force in the body's axes at the first image that three images feel: the second divided difference
/// of S at the first, second and third. Any accelerations.
inline Eigen::Vector3d meanSpecificForce(const WindowImage& second, const WindowImage& third) {
  return 2 / (third.time - second.time) * (third.displacement / third.time - second.displacement / second.time);
}

namespace detail {

/// One solve: a class only to hold what its steps share.
class ClosedFormRun {
 public:
  ClosedFormRun(RayTable& table, const ClosedFormOptions& options, ClosedFormResult& result)
      : table_(table), options_(options), result_(result), solver_(table, options) {}

  void run() {
    const bool exact = !(options_.bearing_noise > 0);
    if (exact || options_.singular_values) {
      const RankDiagnosis ranks = solver_.diagnose();
      result_.null_dimension = ranks.motion_null + ranks.feature_null;
      result_.largest_singular_value = ranks.largest;
      result_.singular_values = ranks.values;
      if (exact) solveExactly(ranks);
    }
    if (!exact) solveNoisy();
    report(exact);
  }

 private:
  using Candidate = MotionCandidate;
  using Status = ClosedFormStatus;

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
      for (const auto& by_motion : ranks.by_motion) c.P.push_back(apply(by_motion, c.y));
      if (status == Status::scale_unobservable) normaliseScale(c);
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
    solver_.resetWeights();
    candidates_ = weightedMinima();
    if (candidates_.empty()) {
      result_.status = Status::no_parallax;  // no finite answer
      return;
    }
    // Each minimiser with the weights of its own depths; one with most features behind the camera is beyond help.
    for (Candidate& c : candidates_) {
      for (int pass = 0; pass < options_.weight_passes && isInFront(c); ++pass) {
        solver_.setWeights(c);
        const std::vector<Candidate> next = weightedMinima();
        if (next.empty()) break;
        const bool second = next.size() == 2 && gravityAngle(next[1], c) < gravityAngle(next[0], c);
        c = next[second ? 1 : 0];
      }
    }
    order();
    // Both may have gone to the same minimum.
    if (candidates_.size() == 2 && gravityAngle(candidates_[0], candidates_[1]) < 1e-6) candidates_.pop_back();
    deviations();
    classify();
  }

  /// The minimisers at the present weights.
  std::vector<Candidate> weightedMinima() {
    Triangle root = Triangle::cholesky(solver_.eliminate().Q);
    if (solver_.hasPrior()) solver_.addPrior(root);
    std::vector<Candidate> minima = solver_.minimise(root, 1e-12);
    for (Candidate& c : minima) {
      for (std::size_t i = 0; i < table_.features(); ++i) c.P.push_back(solver_.feature(i, c.y));
      solver_.evaluate(c);
    }
    return minima;
  }

  bool isInFront(const Candidate& c) const { return 2 * c.negative < table_.features(); }

  /// The one whose features are in front of the camera, then the cheaper.
  void order() {
    if (candidates_.size() < 2) return;
    const bool first = isInFront(candidates_[0]), second = isInFront(candidates_[1]);
    if (first != second ? second : candidates_[1].cost < candidates_[0].cost) {
      std::swap(candidates_[0], candidates_[1]);
    }
  }

  /// Whether the data decide between the minimisers of exact data with a null space.
  void decideExactly() {
    order();
    Status& status = result_.status;
    if (candidates_.empty()) return;
    if (status == Status::mirror_gravity && !hasRival()) status = Status::ok;
    if (status != Status::ambiguous) return;
    // A line that touches the sphere: the two are one to the root of rounding.
    if (candidates_.size() < 2 || gravityAngle(candidates_[0], candidates_[1]) < 1e-5) {
      status = Status::double_root;
    } else if (!hasRival() || candidates_[1].negative > 0) {
      status = Status::ok;
    }
  }
  /// Whether the second minimiser explains the data as well as the first.
  bool hasRival() const {
    return candidates_.size() == 2 && candidates_[1].cost - candidates_[0].cost <= chi_squared_1_95;
  }

  /// V and P may be scaled together: a length for both, before it is normalised.
  void addScale(const RankDiagnosis& ranks, Candidate& c) const {
    for (int k = 0; k < solver_.motionSize(); ++k) c.y[k] += ranks.vectors.back()[k];
  }
  /// Features in front of the camera, at a median distance of one.
  void normaliseScale(Candidate& c) const {
    std::vector<double> distances;
    double front = 0;
    for (std::size_t i = 0; i < c.P.size(); ++i) {
      distances.push_back(c.P[i].norm());
      front += table_.of(i).front().u.dot(c.P[i]);
    }
    const double factor = std::copysign(1 / median(distances), front);
    c.y.set(0, factor * c.y.velocity());
    for (Eigen::Vector3d& p : c.P) p *= factor;
  }

  /// Predicted deviations and covariances at the first minimiser.
  void deviations() {
    const Candidate& best = candidates_[0];
    Triangle root = Triangle::cholesky(solver_.eliminatePredicted(best).Q);
    if (solver_.hasPrior()) solver_.addPrior(root);
    SmallMatrix scaled(1, 1);
    const bool determined = solver_.covariance(root, best.y, scaled);
    const int m = solver_.motionSize();
    if (determined) {
      // The larger of the two deviations across G.
      const Eigen::Vector3d G = best.y.gravity();
      const Eigen::Matrix<double, 2, 3> across = tangentRows(G.normalized());
      const Eigen::Matrix2d tilt = across * scaled.matrix3(m - 3, m - 3) * across.transpose();
      const double half = 0.5 * (tilt(0, 0) + tilt(1, 1)), spread = std::hypot(0.5 * (tilt(0, 0) - tilt(1, 1)), tilt(0, 1));
      result_.tilt_deviation = std::sqrt(half + spread) / G.norm();

      // From (V', [b'], G') to (V, G, [b]).
      result_.covariance.resize(m, m);
      const auto from = [m](int i) { return i < 3 ? i : i < 6 ? m - 6 + i : i - 3; };
      const auto unit = [&](int i) { return i < 3 ? 1 / table_.window : solver_.gravityScale(); };
      for (int i = 0; i < m; ++i) {
        for (int j = 0; j < m; ++j) result_.covariance(i, j) = unit(i) * unit(j) * scaled(from(i), from(j));
      }
      result_.covariance_content =
          solver_.hasPrior() ? CovarianceContent::image_noise_bias_prior : CovarianceContent::image_noise;
    }
    std::vector<double> relative;
    for (std::size_t i = 0; i < table_.features(); ++i) {
      const EliminatedFeature& e = solver_.eliminated()[i];
      ClosedFormFeature& feature = result_.features[table_.feature[i]];
      const Eigen::Vector3d u = table_.of(i).front().u;
      if (!determined || e.rank < 3) continue;
      double variance = u.dot(e.covariance * u);
      for (int a = 0; a < m; ++a) {
        for (int b = 0; b < m; ++b) {
          variance += u.dot(e.by_motion.vector3(0, a)) * scaled(a, b) * u.dot(e.by_motion.vector3(0, b));
        }
      }
      feature.depth_deviation = std::sqrt(variance);
      feature.depth_determined = feature.parallax > 2 * solver_.sigma();
      relative.push_back(feature.depth_deviation / std::abs(u.dot(best.P[i])));
    }
    if (!relative.empty()) result_.scale_deviation = median(relative);
  }

  void classify() {
    Status& status = result_.status;
    const std::size_t features = table_.features(), rows = 2 * table_.rays.size();
    const double sigma = solver_.sigma();
    const bool parallax = std::any_of(result_.features.begin(), result_.features.end(), [&](const auto& f) {
      return f.used && f.parallax > 2 * sigma;
    });
    const Candidate& best = candidates_[0];
    if (genericNullDimension(result_.images_used, features, solver_.bias()) >= 2 ||
        rows + 1 < 3 * features + static_cast<std::size_t>(solver_.motionSize())) {
      status = Status::too_few_images;
    } else if (!parallax) {
      status = relativeMotion(table_, best.y) < 0.01 ? Status::stationary : Status::no_parallax;
    } else if (coplanarityMatters(result_.images_used, features) && outOfPlane(table_.rays) < 3 * sigma) {
      status = Status::coplanar;
    } else if (result_.scale_deviation > options_.largest_scale_deviation) {
      status = Status::scale_unobservable;
    } else {
      const bool in_front = candidates_.size() == 2 && 2 * candidates_[1].negative < features;
      status = hasRival() && in_front ? Status::ambiguous : Status::ok;
    }
  }

  void report(bool exact) {
    const double T = table_.window, g = solver_.gravityScale();
    for (const Candidate& c : candidates_) {
      ClosedFormSolution s;
      s.velocity = c.y.velocity() / T;
      s.gravity = g * c.y.gravity();
      s.accelerometer_bias = g * c.y.bias();
      s.features.assign(result_.features.size(),
                        Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
      for (std::size_t i = 0; i < table_.features(); ++i) s.features[table_.feature[i]] = c.P[i];
      s.cost = c.cost;
      s.negative_depths = c.negative;
      result_.solutions.push_back(std::move(s));
    }
    const std::size_t rows = 2 * table_.rays.size() + (!exact && solver_.hasPrior() ? 3 : 0);
    const std::size_t unknowns =
        3 * table_.features() + static_cast<std::size_t>(solver_.motionSize()) - (options_.gravity ? 1 : 0);
    result_.degrees_of_freedom = rows > unknowns ? rows - unknowns : 0;
    if (candidates_.empty()) return;
    for (std::size_t i = 0; i < table_.features(); ++i) {
      double square = 0;
      for (const Ray& ray : table_.of(i)) {
        const Eigen::Vector3d d = relativePosition(table_.images[ray.image], candidates_[0].P[i], candidates_[0].y);
        square += ray.u.cross(d).squaredNorm() / d.squaredNorm();
      }
      result_.features[table_.feature[i]].residual = std::sqrt(square / static_cast<double>(table_.of(i).size()));
    }
  }

  RayTable& table_;
  const ClosedFormOptions& options_;
  ClosedFormResult& result_;
  ClosedFormSolver solver_;
  std::vector<Candidate> candidates_;
};

}  // namespace detail

/// Velocity, gravity and features of a window. Input that can't be used gives bad_input with a fault, never a crash.
inline ClosedFormResult solveClosedForm(const ClosedFormWindow& window, const ClosedFormOptions& options = {}) {
  ClosedFormResult result;
  result.fault = detail::faultOf(window, options, result.fault_index);
  if (result.fault != ClosedFormFault::none) return result;
  detail::RayTable table = detail::rayTable(window, result);
  if (table.features() == 0) {
    result.fault = ClosedFormFault::no_feature;
    return result;
  }
  detail::ClosedFormRun(table, options, result).run();
  return result;
}

}  // namespace liestat
