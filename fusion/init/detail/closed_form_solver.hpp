// The closed form's passes: weights, minimisers, costs, covariance.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/init/detail/closed_form_blocks.hpp>
#include <fusion/init/detail/closed_form_ranks.hpp>
#include <fusion/detail/median.hpp>
#include <fusion/init/sphere_least_squares.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// A noise for exact data (rad): far above rounding, far below anything a wrong solution leaves.
inline constexpr double exact_noise = 1e-9;
/// Quantile of χ² with one degree of freedom at 0.95: what two costs differ by when the data tell minimisers apart.
inline constexpr double chi_squared_1_95 = 3.841458820694124;

/// The least depth that weights assume: in metres, and as a fraction of the median depth. A feature that one pass puts
/// next to the camera would otherwise outweigh all others in the next (docs/theory/visual_inertial.md, section 3.4).
inline constexpr double min_weighted_depth = 0.2, min_weighted_depth_ratio = 0.01;

/// A minimiser in scaled unknowns.
struct MotionCandidate {
  Motion y;
  std::vector<Eigen::Vector3d> P;
  double cost = 0;           ///< in the units of ClosedFormSolution
  std::size_t negative = 0;  ///< features behind a camera
};

/// The motion's problem less the noise in it.
struct NoiseShare {
  Triangle root;
  std::vector<double> shares;      ///< noise fraction of the information on each direction, descending, 0 to about 1
  std::vector<Motion> directions;  ///< directions of the motion, their last entry 0
};

class ClosedFormSolver {
 public:
  ClosedFormSolver(RayTable& table, const InitialisationOptions& options)
      : table_(table), options_(options), sigma_(options.bearing_noise > 0 ? options.bearing_noise : exact_noise) {}

  double sigma() const { return sigma_; }
  const RayTable& table() const { return table_; }
  /// V' = V T and so on: what a scaled unknown is worth.
  double gravityScale() const { return 2 / (table_.window * table_.window); }
  /// The largest that is zero to rounding, relative.
  double rankTolerance() const { return detail::rankTolerance(bias()); }
  bool bias() const { return options_.closed_form.estimate_bias; }
  /// A prior that says something.
  bool hasPrior() const { return bias() && std::isfinite(options_.prior.accelerometer_sigma); }
  /// Unknowns of the motion.
  int motionSize() const { return bias() ? 9 : 6; }

  /// All weights those of a depth of one.
  void resetWeights() {
    for (Ray& ray : table_.rays) ray.weight = ray.precision / sigma_;
  }
  /// Weights of the depths in a solution, floored (docs/theory/visual_inertial.md, section 3.4).
  void setWeights(const MotionCandidate& solution) {
    std::vector<double> depths;
    depths.reserve(table_.rays.size());
    forEachRay([&](std::size_t i, Ray& ray) {
      depths.push_back(std::abs(ray.u.dot(relativePosition(table_.images[ray.image], solution.P[i], solution.y))));
    });
    const double floor = std::max(min_weighted_depth, min_weighted_depth_ratio * median(depths));
    std::size_t k = 0;
    forEachRay([&](std::size_t, Ray& ray) { ray.weight = ray.precision / (sigma_ * std::max(depths[k++], floor)); });
  }

  /// Features taken out at the present weights; their sum is the motion's problem. With `noise` (rad) less what noise
  /// of that size adds to it, see eliminateFeature.
  MotionBlock eliminate(double noise = 0) {
    MotionBlock sum(bias());
    features_.clear();
    features_.reserve(table_.features());
    for (std::size_t i = 0; i < table_.features(); ++i) {
      features_.push_back(eliminateFeature(table_.of(i), table_.images, bias(), noise));
      sum += features_.back().block;
    }
    return sum;
  }
  /// The motion's problem with its prior and without the noise of the bearings. Of what the noisy problem says on a
  /// direction (eigenvectors of one relative to the other) the share of noise is taken off; a direction that is nothing
  /// but noise is left free.
  NoiseShare withoutNoise() {
    const MotionBlock clean = eliminate(sigma_);
    std::vector<EliminatedFeature> of_clean = std::move(features_);
    const MotionBlock noisy = eliminate(0);
    // Features go with the problem that is solved.
    if (options_.closed_form.remove_noise_bias) features_ = std::move(of_clean);
    const int m = motionSize(), n = m + 1;
    Triangle root = Triangle::cholesky(noisy.Q);
    if (hasPrior()) addPrior(root);
    const SmallMatrix inverse = root.inverse(n);
    SmallMatrix difference(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        difference(i, j) = i <= j ? noisy.Q(i, j) - clean.Q(i, j) : noisy.Q(j, i) - clean.Q(j, i);
      }
    }
    const SmallSvd share(transposed(inverse) * difference * inverse);
    NoiseShare result{Triangle(n), {}, {}};
    SmallMatrix rows(n, n);
    for (int k = 0; k < n; ++k) {
      const double left = options_.closed_form.remove_noise_bias ? std::sqrt(std::max(0., 1 - share.value(k))) : 1;
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i <= j; ++i) rows(k, j) += left * share.v(k, i) * root.r(i, j);
      }
    }
    result.root.add(rows);
    // The same for the directions of the motion alone, without the constant column.
    const SmallMatrix of_motion = inverse.block(0, 0, m, m);
    const SmallSvd motion(transposed(of_motion) * difference.block(0, 0, m, m) * of_motion);
    for (int k = 0; k < m; ++k) {
      Motion y(bias());
      for (int i = 0; i < m; ++i) {
        for (int j = i; j < m; ++j) y[i] += of_motion(i, j) * motion.v(k, j);
      }
      y[m] = 0;
      result.shares.push_back(motion.value(k));
      result.directions.push_back(y);
    }
    return result;
  }
  const std::vector<EliminatedFeature>& eliminated() const { return features_; }
  Eigen::Vector3d feature(std::size_t i, const Motion& y) const { return apply(features_[i].by_motion, y); }

  /// The prior of the bias as rows of the motion's problem.
  void addPrior(Triangle& root) const {
    SmallMatrix rows(3, root.size());
    for (int k = 0; k < 3; ++k) rows(k, 3 + k) = gravityScale() / options_.prior.accelerometer_sigma;
    root.add(rows);
  }

  /// The motions that minimise |root y|² for the gravity that is asked for; the directions that `tolerance` (relative)
  /// leaves free in V (and b) are left out.
  std::vector<MotionCandidate> minimise(const Triangle& root, double tolerance) const {
    const int leading = motionSize() - 3;
    const LeadingElimination lead(root, leading, tolerance * root.r.block(0, 0, leading, leading).norm());
    const Eigen::Matrix3d R = lead.rest.r.matrix3(0, 0);
    const Eigen::Vector3d r = lead.rest.r.vector3(0, 3);
    SphereMinima minima;
    if (options_.gravity) {
      minima = minimiseOnSphere(R, r, *options_.gravity / gravityScale());
    } else if (R.allFinite() && r.allFinite()) {
      minima.count = 1;
      minima.point[0] = -apply3(LeadingElimination(lead.rest, 3, 0).gain);
    }
    std::vector<MotionCandidate> found;
    for (int k = 0; k < minima.count; ++k) {
      MotionCandidate candidate{Motion(bias()), {}};
      const Eigen::Vector3d& G = minima.point[k];
      for (int i = 0; i < leading; ++i) {
        candidate.y[i] = -(lead.gain(i, 0) * G[0] + lead.gain(i, 1) * G[1] + lead.gain(i, 2) * G[2] + lead.gain(i, 3));
      }
      candidate.y.set(leading, G);
      found.push_back(candidate);
    }
    return found;
  }

  /// Cost and depth signs of a motion with its features, in angles.
  void evaluate(MotionCandidate& candidate) const {
    candidate.cost = 0;
    candidate.negative = 0;
    for (std::size_t i = 0; i < table_.features(); ++i) {
      bool behind = false;
      for (const Ray& ray : table_.of(i)) {
        const Eigen::Vector3d d = relativePosition(table_.images[ray.image], candidate.P[i], candidate.y);
        const double scale = ray.precision / sigma_;
        candidate.cost += scale * scale * ray.u.cross(d).squaredNorm() / d.squaredNorm();
        behind = behind || ray.u.dot(d) < 0;
      }
      candidate.negative += behind;
    }
    if (hasPrior())
      candidate.cost += (gravityScale() / options_.prior.accelerometer_sigma * candidate.y.bias()).squaredNorm();
  }

  /// Covariance of the scaled motion (V', [b'], G') at a root, with gravity's length fixed where it is known; false
  /// where not all of it is determined.
  bool covariance(Triangle root, const Motion& y, SmallMatrix& result) const {
    const int m = motionSize();
    if (options_.gravity) {
      // A stiff row along G: its length has no freedom.
      SmallMatrix row(1, m + 1);
      const Eigen::Vector3d stiff = 1e6 * root.r.norm() * y.gravity().normalized();
      for (int k = 0; k < 3; ++k) row(0, m - 3 + k) = stiff[k];
      root.add(row);
    }
    double smallest = std::numeric_limits<double>::infinity(), largest = 0;
    for (int k = 0; k < m; ++k) {
      smallest = std::min(smallest, std::abs(root.r(k, k)));
      largest = std::max(largest, std::abs(root.r(k, k)));
    }
    if (!(smallest > 1e-14 * largest)) return false;
    const SmallMatrix inverse = root.inverse(m);
    result = SmallMatrix(m, m);
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < m; ++j) {
        for (int k = std::max(i, j); k < m; ++k) result(i, j) += inverse(i, k) * inverse(j, k);
      }
    }
    return true;
  }

  /// Features taken out along the directions that a solution predicts, with its depths as weights: the information of
  /// the angles at the solution. Measured directions would not do: their noise turns depth into information on what the
  /// data do not tell, such as the scale at constant velocity.
  MotionBlock eliminatePredicted(const MotionCandidate& solution) {
    const std::vector<Ray> measured = table_.rays;
    forEachRay([&](std::size_t i, Ray& ray) {
      const Eigen::Vector3d d = relativePosition(table_.images[ray.image], solution.P[i], solution.y);
      const double depth = d.norm();
      ray.u = depth > 0 ? Eigen::Vector3d(d / depth) : ray.u;
      ray.weight = depth > 0 ? ray.precision / (sigma_ * depth) : 0;
    });
    const MotionBlock block = eliminate();
    table_.rays = measured;
    return block;
  }

  template <class F>
  void forEachRay(const F& f) {
    for (std::size_t i = 0; i < table_.features(); ++i) {
      for (std::size_t k = table_.begin[i]; k < table_.begin[i + 1]; ++k) f(i, table_.rays[k]);
    }
  }

 private:
  /// The single column of a matrix of three rows.
  static Eigen::Vector3d apply3(const SmallMatrix& column) { return column.vector3(0, 0); }

  RayTable& table_;
  const InitialisationOptions& options_;
  double sigma_;
  std::vector<EliminatedFeature> features_;
};

}  // namespace liestat::detail
