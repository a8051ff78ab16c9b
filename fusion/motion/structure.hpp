// The points' depths over time, one small filter for each track, fed by the motion and its covariance: the "structure from
// motion module" behind the filter of Soatto and Perona 1994, and the test that tells its rigid interpretation from the
// "rubbery" one of a direction with the wrong sign (section 3.2, fig. 12).
//
//   liestat::MotionStructure structure;
//   … filter.update(pairs);
//   structure.update(tracks, pairs, filter.inverse_depths(), filter.estimate());
//   … structure.points()
//
// Lengths are in units of the camera's way in one frame, which must be constant. Positions are in the camera's axes at the
// middle of the last interval. With the direction turned round all depths are negative: the points are rigid, behind the
// camera, and mirrored through it they would be the true ones. What is seen lies in front: brought there by mirroring the
// depths about their mean, it is not rigid and turns the other way.
#pragma once

#include <fusion/motion/types.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace liestat {

struct MotionStructureOptions {
  double process_noise = 1e-5;  ///< per frame, of the inverse depth, for a speed that is not quite constant
  double gate = 4;              ///< standard deviations beyond which a depth is not taken over
};

/// Inverse depths by track, each a scalar filter: predicted by the motion, updated by the depth of the frame. Errors of the
/// rotation are common to all points and count in each variance; those of the direction in the prediction.
class MotionStructure {
 public:
  explicit MotionStructure(const MotionStructureOptions& options = {}) : options_(options) {}

  /// The next frame: the track of each pair, the pairs, and what the motion filter says of them (Flow::midpoint). Tracks
  /// that are missing are forgotten; a frame without a usable motion is only predicted.
  void update(std::span<const std::uint64_t> tracks, std::span<const PointPair> pairs,
              std::span<const InverseDepth> depths, const MotionEstimate& motion) {
    const Eigen::Matrix3d R = motion.rotation.mean.matrix();
    const Eigen::Vector3d V = motion.direction.mean.unit_vector();
    const Eigen::Vector3d T = SO3d::leftJacobian(motion.rotation.mean.log()) * V;
    next_.clear();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      StructurePoint point;
      point.track = tracks[i];
      point.at = 0.5 * (pairs[i].first + pairs[i].second);
      const auto known =
          std::find_if(points_.begin(), points_.end(), [&](const StructurePoint& p) { return p.track == tracks[i]; });
      // A motion that has changed its sign has changed that of all depths.
      const bool same = known != points_.end() && known->inverse_depth != 0 && V.dot(last_) > 0;
      if (same) predict(*known, R, T, motion, point);
      const InverseDepth& z = depths[i];
      if (z.inlier && std::isfinite(z.value) && z.variance > 0) {
        if (point.frames == 0) {
          point.inverse_depth = z.value, point.variance = z.variance, point.frames = 1;
        } else {
          const double innovation = z.value - point.inverse_depth, S = z.variance + point.variance;
          if (innovation * innovation <= options_.gate * options_.gate * S) {
            const double gain = point.variance / S;
            point.inverse_depth += gain * innovation;
            point.variance *= 1 - gain;
            ++point.frames;
          }
        }
      }
      if (point.frames > 0) next_.push_back(point);
    }
    std::swap(points_, next_);
    last_ = V;
  }

  std::span<const StructurePoint> points() const { return points_; }
  /// The information-weighted mean of the inverse depths; NaN without points.
  double meanInverseDepth() const {
    double sum = 0, weight = 0;
    for (const StructurePoint& p : points_) sum += p.inverse_depth / p.variance, weight += 1 / p.variance;
    return weight > 0 ? sum / weight : std::numeric_limits<double>::quiet_NaN();
  }
  /// Points in front of the camera: as they are, or, where their mean is behind it, with depths that are mirrored
  /// about the mean, ρ + 2|mean|.
  std::vector<StructurePoint> inFront() const {
    std::vector<StructurePoint> seen = points_;
    const double mean = meanInverseDepth();
    for (StructurePoint& p : seen) p.inverse_depth += mean < 0 ? -2 * mean : 0;
    return seen;
  }
  /// The other interpretation of the same tracks, in front of the camera too: that of the direction turned round, whose
  /// depths are -ρ. "Rubbery" if the mean of points() is in front of the camera, rigid if it is behind it.
  std::vector<StructurePoint> turnedRound() const {
    std::vector<StructurePoint> seen = points_;
    const double mean = meanInverseDepth();
    for (StructurePoint& p : seen) p.inverse_depth = (mean < 0 ? 0 : 2 * mean) - p.inverse_depth;
    return seen;
  }

 private:
  /// X ← R X + T, and the inverse depth's variance with that of the motion.
  void predict(const StructurePoint& before, const Eigen::Matrix3d& R, const Eigen::Vector3d& T,
               const MotionEstimate& motion, StructurePoint& to) const {
    const double rho = before.inverse_depth;
    const Eigen::Vector3d ray = R * before.at.homogeneous(), X = ray / rho + T;
    const double next = 1 / X.z();
    if (!(next * rho > 0)) return;  // through the camera's plane: it begins anew
    // dρ' = ρ'²/ρ² (R x)_z dρ - ρ'² (e_zᵀ dT + (δ × R X)_z).
    const double by_depth = next * next / (rho * rho) * ray.z();
    const Eigen::Matrix<double, 3, 2> E = ManifoldTraits<S2d>::placement(motion.direction.mean).matrix().leftCols<2>();
    const Eigen::RowVector2d by_direction = -next * next * E.row(2);
    const Eigen::RowVector3d by_rotation = -next * next * Eigen::RowVector3d(ray.y(), -ray.x(), 0) / rho * R;
    to.inverse_depth = next;
    to.variance = by_depth * by_depth * before.variance + by_direction.dot(by_direction * motion.direction.covariance) +
                  by_rotation.dot(by_rotation * motion.rotation.covariance) + options_.process_noise;
    to.frames = before.frames;
  }

  MotionStructureOptions options_;
  std::vector<StructurePoint> points_, next_;
  Eigen::Vector3d last_ = Eigen::Vector3d::Zero();
};

/// The test that points keep their distances: snapshots of the same points, in any axes.
class RigidityTest {
 public:
  /// The positions of the same points in the same order each time; another number of them begins anew.
  void add(std::span<const Eigen::Vector3d> positions) {
    const std::size_t n = positions.size(), pairs = n * (n - 1) / 2;
    if (snapshots_ == 0 || first_.size() != n) {
      first_.assign(positions.begin(), positions.end());
      sum_.assign(n > 0 ? pairs : 0, 0), squares_ = sum_;
      snapshots_ = 0;
    }
    std::size_t k = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < i; ++j, ++k) {
        const double d = std::log((positions[i] - positions[j]).norm());
        sum_[k] += d, squares_[k] += d * d;
      }
    }
    last_.assign(positions.begin(), positions.end());
    ++snapshots_;
  }
  std::size_t snapshots() const { return snapshots_; }
  /// The median over all pairs of points of the relative standard deviation of their distance: small where the points are
  /// rigid. NaN of fewer than two snapshots or points.
  double spread() const {
    if (snapshots_ < 2 || sum_.empty()) return std::numeric_limits<double>::quiet_NaN();
    std::vector<double> deviations;
    for (std::size_t k = 0; k < sum_.size(); ++k) deviations.push_back(deviation(k));
    const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
    std::nth_element(deviations.begin(), middle, deviations.end());
    return *middle;
  }
  /// The relative standard deviation of the distance between points 2k and 2k + 1, for each k: no point is in two.
  std::vector<double> separateSpreads() const {
    std::vector<double> deviations;
    if (snapshots_ < 2) return deviations;
    for (std::size_t i = 1; i < first_.size(); i += 2) deviations.push_back(deviation(i * (i - 1) / 2 + i - 1));
    return deviations;
  }
  /// The rotation vector (rad) that takes the first snapshot to the last one best, about their centroids, up to scale.
  Eigen::Vector3d rotation() const {
    Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = a;
    const auto n = static_cast<double>(first_.size());
    for (std::size_t i = 0; i < first_.size(); ++i) a += first_[i] / n, b += last_[i] / n;
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < first_.size(); ++i) moments += (last_[i] - b) * (first_[i] - a).transpose();
    return SO3d::fitToSO3(moments).log();
  }

 private:
  /// The standard deviation of the k-th distance's logarithm.
  double deviation(std::size_t k) const {
    const auto n = static_cast<double>(snapshots_);
    return std::sqrt(std::max(0.0, (squares_[k] - sum_[k] * sum_[k] / n) / (n - 1)));
  }

  std::vector<Eigen::Vector3d> first_, last_;
  std::vector<double> sum_, squares_;
  std::size_t snapshots_ = 0;
};

/// Wilcoxon's signed-rank test (F. Wilcoxon, Biometrics Bulletin 1, 1945; its exact law up to fifty distances, the normal
/// one above) of the spreads of separate distances: it needs no covariance, and errors of the motion, common to all points,
/// are the same in both. Snapshots of the same points in the same order.
inline RigidityComparison compareRigidity(const RigidityTest& first, const RigidityTest& second) {
  const std::vector<double> a = first.separateSpreads(), b = second.separateSpreads();
  RigidityComparison result;
  std::vector<double> gains;  // positive where the first is steadier
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) {
    const double gain = std::log(b[k] / a[k]);
    if (std::isfinite(gain) && gain != 0) gains.push_back(gain);
  }
  const std::size_t n = gains.size();
  if (n == 0 || a.size() != b.size()) return result;
  std::sort(gains.begin(), gains.end(), [](double x, double y) { return std::abs(x) < std::abs(y); });
  std::size_t sum = 0;  // sum of the ranks where the first is steadier
  for (std::size_t k = 0; k < n; ++k) {
    if (gains[k] > 0) sum += k + 1, ++result.steadier;
  }
  result.distances = n;
  const std::size_t most = n * (n + 1) / 2;
  if (n > 50) {
    const auto count = static_cast<double>(n);
    const double mean = 0.25 * count * (count + 1), variance = mean * (2 * count + 1) / 6;
    result.p_value = 0.5 * std::erfc((static_cast<double>(sum) - 0.5 - mean) / std::sqrt(2 * variance));
    return result;
  }
  // The number of subsets of the ranks with each sum.
  std::vector<double> subsets(most + 1, 0);
  subsets[0] = 1;
  for (std::size_t rank = 1; rank <= n; ++rank) {
    for (std::size_t s = most; s >= rank; --s) subsets[s] += subsets[s - rank];
  }
  double above = 0;
  for (std::size_t s = sum; s <= most; ++s) above += subsets[s];
  result.p_value = above * std::pow(0.5, static_cast<double>(n));
  return result;
}

}  // namespace liestat
