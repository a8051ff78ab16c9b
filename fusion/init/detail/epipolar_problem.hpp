// Pairs of images as functions of the gyroscope's bias: epipolar constraints with a free translation a pair, or
// directions that do not move; sums over tracks that may be wrong.
//
// Everything is in the axes of t0. For a pair (j, k) with a translation along t, directions u of j and u' of k,
//   r = t·(u × u') / s,    s² = σ_j² |u' × t|² + σ_k² |u × t|²,
// is a residual of variance one to first order (Kneip's and Lynen's normal epipolar constraint, with the noise of the
// normal); without a translation (u - u')/√(σ_j² + σ_k²) has two. A track counts by the mean of its squares.
#pragma once

#include <fusion/init/detail/closed_form_blocks.hpp>
#include <fusion/init/detail/epipolar_matches.hpp>
#include <fusion/init/detail/epipolar_residual.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat::detail {

/// The residuals at a bias, with translations and weights of the tracks that the caller sets.
class EpipolarProblem {
 public:
  using Pair = EpipolarPair;
  using Match = EpipolarMatch;
  using Sight = EpipolarSight;
  /// The problem of the bias where the translations are the best.
  struct Normal {
    Eigen::Matrix3d H;
    Eigen::Vector3d g;
    double cost;
  };

  EpipolarProblem(const InertialWindow& window, double bearing_noise)
      : weight(window.features.size(), 1.),
        square(weight.size(), 0.),
        count(weight.size(), 0),
        window_(&window),
        tracks_(window, bearing_noise) {}

  /// See EpipolarMatches.
  void setAllPairs() { tracks_.setAllPairs(); }
  void setPairs(std::size_t shortest, std::size_t longest) { tracks_.setPairs(shortest, longest); }
  std::size_t bestStep() const { return tracks_.bestStep(); }
  double freedom(std::size_t i) const { return tracks_.freedom(i); }

  /// How fast the direction of each track moves at the present bias (rad/s, RMS over pairs), of tracks that are in any.
  std::vector<double> rates() const {
    std::vector<double> sum(weight.size(), 0.), result;
    std::vector<std::size_t> matches(weight.size(), 0);
    for (const Pair& pair : tracks_.pairs) {
      const double dt = images_[pair.second].image.time - images_[pair.first].image.time;
      for (std::size_t m = pair.begin; m < pair.end; ++m) {
        const Match& match = tracks_.matches[m];
        sum[match.track] += (tracks_.sights[match.first].u - tracks_.sights[match.second].u).squaredNorm() / (dt * dt);
        ++matches[match.track];
      }
    }
    for (std::size_t i = 0; i < sum.size(); ++i) {
      if (matches[i] > 0) result.push_back(std::sqrt(sum[i] / static_cast<double>(matches[i])));
    }
    return result;
  }
  /// Tracks with residuals, as linearise() left them.
  std::size_t tracks() const {
    return static_cast<std::size_t>(std::count_if(count.begin(), count.end(), [](std::size_t c) { return c > 0; }));
  }
  /// Another recording of the same window, integrated anew.
  void setWindow(const InertialWindow& window) { window_ = &window; }

  void setBias(const ImuBias<double>& bias) {
    bias_ = bias;
    images_ = biasedImages(window_->motions(), bias);
    for (Sight& s : tracks_.sights) s.u = images_[s.image].image.rotation * s.bearing;
  }
  const ImuBias<double>& bias() const { return bias_; }
  const std::vector<Pair>& pairs() const { return tracks_.pairs; }
  std::size_t usedPairs() const {
    return static_cast<std::size_t>(
        std::count_if(tracks_.pairs.begin(), tracks_.pairs.end(), [](const Pair& p) { return p.used; }));
  }

  /// The translations that fit the present bias best, by the eigenvector of least eigenvalue, twice: with equal
  /// weights, then with those of the noise.
  void fitTranslations() {
    for (Pair& pair : tracks_.pairs) {
      for (int pass = 0; pass < 2; ++pass) {
        Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
        for (std::size_t m = pair.begin; m < pair.end; ++m) {
          const Sight &a = tracks_.sights[tracks_.matches[m].first], &b = tracks_.sights[tracks_.matches[m].second];
          const Eigen::Vector3d n = a.u.cross(b.u);
          const double s2 = pass == 0 ? a.variance + b.variance : varianceAlong(a, b, pair.t);
          M += (weight[tracks_.matches[m].track] / s2) * n * n.transpose();
        }
        const SmallSvd svd(SmallMatrix::of<3, 3>(M));
        pair.t = Eigen::Vector3d(svd.v(2, 0), svd.v(2, 1), svd.v(2, 2));
      }
    }
  }
  /// Leaves out pairs whose directions move, beyond what any rotation explains, by less than `min` sigmas (RMS of
  /// tracks, by their weights), or that have too few of them to say anything beside their translation. What a rotation
  /// may explain does not count, so that a wrong bias neither brings parallax nor takes it away.
  void selectByParallax(double min) {
    for (Pair& pair : tracks_.pairs) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero(), inverse;
      Eigen::Vector3d g = Eigen::Vector3d::Zero();
      double sum = 0, weights = 0, most = 0;
      for (std::size_t m = pair.begin; m < pair.end; ++m) {
        const Sight &a = tracks_.sights[tracks_.matches[m].first], &b = tracks_.sights[tracks_.matches[m].second];
        const double w = weight[tracks_.matches[m].track], information = w / (a.variance + b.variance);
        H += information * (Eigen::Matrix3d::Identity() - b.u * b.u.transpose());
        g += information * a.u.cross(b.u);
        sum += information * (a.u - b.u).squaredNorm();
        weights += w;
        most = std::max(most, w);
      }
      pair.used = weights > min_full_matches * most;
      if (min > 0 && pair.used) {
        pair.used = invertPositive(H, inverse) && sum - g.dot(inverse * g) > 2 * min * min * weights;
      }
    }
  }

  /// Tracks' sums of squares and counts, and the problem's normal equations: of epipolar constraints or, with
  /// `rotation`, of directions that stay.
  Normal linearise(bool rotation) {
    Normal normal{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero(), 0};
    std::fill(square.begin(), square.end(), 0.);
    std::fill(count.begin(), count.end(), std::size_t{0});
    if (!rotation) parts_.resize(tracks_.pairs.size());
    for (std::size_t p = 0; p < tracks_.pairs.size(); ++p) {
      const Pair& pair = tracks_.pairs[p];
      if (!pair.used && !rotation) continue;
      const Eigen::Matrix3d A = turn(pair);
      if (rotation) {
        addRotation(pair, A, normal);
      } else {
        addEpipolar(pair, A, parts_[p], normal);
      }
    }
    return normal;
  }

  /// Moves the translations to where they are the best, to first order, after a step of the bias.
  void moveTranslations(const Eigen::Vector3d& step) {
    before_.clear();
    for (std::size_t p = 0; p < tracks_.pairs.size(); ++p) {
      before_.push_back(tracks_.pairs[p].t);
      if (!tracks_.pairs[p].used) continue;
      const Part& part = parts_[p];
      Eigen::Vector2d move = -(part.offset + part.gain.transpose() * step);
      // A translation that is hardly known must not run around.
      move *= std::min(1., 0.3 / std::max(move.norm(), 1e-300));
      tracks_.pairs[p].t = (tracks_.pairs[p].t + part.across.transpose() * move).normalized();
    }
  }
  void restoreTranslations() {
    for (std::size_t p = 0; p < before_.size(); ++p) tracks_.pairs[p].t = before_[p];
  }

  /// The share of the squared parallax of the pairs in use that is against the rest of its pair: features behind the
  /// camera. Noise has little of it; a wrong rotation, which takes the mean off all parallaxes, up to a half.
  double wrongWay() const {
    double all = 0, wrong = 0;
    for (const Pair& pair : tracks_.pairs) {
      if (!pair.used) continue;
      double forward = 0, back = 0;
      for (std::size_t m = pair.begin; m < pair.end; ++m) {
        const Sight &a = tracks_.sights[tracks_.matches[m].first], &b = tracks_.sights[tracks_.matches[m].second];
        const double parallax = a.u.cross(b.u).dot(a.u.cross(pair.t));
        (parallax > 0 ? forward : back) +=
            weight[tracks_.matches[m].track] * parallax * parallax / (a.variance + b.variance);
      }
      all += forward + back;
      wrong += std::min(forward, back);
    }
    return all > 0 ? wrong / all : 0;
  }

  /// Covariance of the normal equations' right side, from the noise of the bearings and of the motions where they have
  /// one: pairs share both. After linearise().
  Eigen::Matrix3d gradientCovariance(bool rotation) const {
    using Matrix3 = Eigen::Matrix3d;
    std::vector<Matrix3> of_sight(tracks_.sights.size(), Matrix3::Zero()), of_motion(images_.size(), Matrix3::Zero());
    for (std::size_t p = 0; p < tracks_.pairs.size(); ++p) {
      const Pair& pair = tracks_.pairs[p];
      if (!pair.used && !rotation) continue;
      const Matrix3 A = turn(pair);
      Matrix3 by_turn = Matrix3::Zero();
      for (std::size_t m = pair.begin; m < pair.end; ++m) {
        const Match& match = tracks_.matches[m];
        const double w = weight[match.track];
        if (!(w > 0)) continue;
        const Sight &a = tracks_.sights[match.first], &b = tracks_.sights[match.second];
        if (rotation) {
          const Matrix3 B = (w / (a.variance + b.variance)) * A.transpose();
          of_sight[match.first] -= B * skew(b.u);
          of_sight[match.second] += B * skew(a.u);
          by_turn += B * (Matrix3::Identity() - b.u * b.u.transpose());
        } else {
          const EpipolarRow row = rowOf(a, b, pair.t);
          const Part& part = parts_[p];
          const Eigen::Vector3d J = A.transpose() * row.by_turn - part.gain * (part.across * row.by_t);
          of_sight[match.first] += (w * row.scale) * J * b.u.cross(pair.t).transpose();
          of_sight[match.second] += (w * row.scale) * J * pair.t.cross(a.u).transpose();
          by_turn += w * J * row.by_turn.transpose();
        }
      }
      for (std::size_t k = pair.first; k < pair.second; ++k) of_motion[k] += by_turn;
    }
    Matrix3 sum = Matrix3::Zero();
    for (std::size_t i = 0; i < tracks_.sights.size(); ++i) {
      const Sight& s = tracks_.sights[i];
      const Eigen::Vector3d along = of_sight[i] * s.u;
      sum += s.variance * (of_sight[i] * of_sight[i].transpose() - along * along.transpose());
    }
    for (std::size_t k = 0; k < window_->motions().size(); ++k) {
      // In the axes of the motion's end.
      const Matrix3 D = of_motion[k] * images_[k + 1].image.rotation;
      sum += D * window_->motions()[k].gaussian().covariance.template block<3, 3>(3, 3) * D.transpose();
    }
    return sum;
  }

  std::vector<double> weight;      ///< weight of each track
  std::vector<double> square;      ///< Σ r² of a track, as linearise() left it
  std::vector<std::size_t> count;  ///< number of these residuals
  /// The mean square of a track's residuals, infinite for one without.
  double meanSquare(std::size_t i) const {
    return count[i] > 0 ? square[i] / static_cast<double>(count[i]) : std::numeric_limits<double>::infinity();
  }

  /// A pair is used if its matches weigh more than so many of its best one. The direction of translation takes up two
  /// equations: it needs a third match, and leaves tracks that are weighted down somewhat a part in it.
  static constexpr double min_full_matches = 2.5;

 private:
  /// A pair whose translation is eliminated: after a step δb of the bias it is best at t - acrossᵀ (offset + gainᵀ δb).
  struct Part {
    Eigen::Matrix<double, 2, 3> across;
    Eigen::Matrix<double, 3, 2> gain;
    Eigen::Vector2d offset;
  };
  /// Rotation of the second image against the first, by the bias.
  Eigen::Matrix3d turn(const Pair& pair) const {
    return images_[pair.second].rotation_by_gyroscope - images_[pair.first].rotation_by_gyroscope;
  }
  void addRotation(const Pair& pair, const Eigen::Matrix3d& A, Normal& normal) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t m = pair.begin; m < pair.end; ++m) {
      const Match& match = tracks_.matches[m];
      const Sight &a = tracks_.sights[match.first], &b = tracks_.sights[match.second];
      const double information = 1 / (a.variance + b.variance), w = weight[match.track];
      const double squared = information * (a.u - b.u).squaredNorm();
      square[match.track] += squared;
      count[match.track] += 2;
      normal.cost += w * squared;
      H += (w * information) * (Eigen::Matrix3d::Identity() - b.u * b.u.transpose());
      g += (w * information) * a.u.cross(b.u);
    }
    normal.H += A.transpose() * H * A;
    normal.g += A.transpose() * g;
  }

  void addEpipolar(const Pair& pair, const Eigen::Matrix3d& A, Part& part, Normal& normal) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> cross = Eigen::Matrix<double, 3, 2>::Zero();
    Eigen::Matrix2d of_t = Eigen::Matrix2d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    Eigen::Vector2d g_t = Eigen::Vector2d::Zero();
    part.across = tangentRows(pair.t);
    for (std::size_t m = pair.begin; m < pair.end; ++m) {
      const Match& match = tracks_.matches[m];
      const double w = weight[match.track];
      const EpipolarRow row = rowOf(tracks_.sights[match.first], tracks_.sights[match.second], pair.t);
      const double squared = row.value * row.value;
      square[match.track] += squared;
      ++count[match.track];
      normal.cost += w * squared;
      if (!(w > 0)) continue;
      const Eigen::Vector2d by_t = part.across * row.by_t;
      H += (w * row.by_turn) * row.by_turn.transpose();
      cross += (w * row.by_turn) * by_t.transpose();
      of_t += (w * by_t) * by_t.transpose();
      g += (w * row.value) * row.by_turn;
      g_t += (w * row.value) * by_t;
    }
    const double rounding = 1e-9 * (of_t(0, 0) + of_t(1, 1)) + 1e-300;
    of_t(0, 0) += rounding;
    of_t(1, 1) += rounding;
    const double determinant = of_t(0, 0) * of_t(1, 1) - of_t(0, 1) * of_t(1, 0);
    Eigen::Matrix2d inverse;
    inverse << of_t(1, 1), -of_t(0, 1), -of_t(1, 0), of_t(0, 0);
    inverse /= determinant;
    const Eigen::Matrix<double, 3, 2> of_bias = A.transpose() * cross;
    part.gain = of_bias * inverse;
    part.offset = inverse * g_t;
    normal.H += A.transpose() * H * A - part.gain * of_bias.transpose();
    normal.g += A.transpose() * g - part.gain * g_t;
  }

  const InertialWindow* window_;
  EpipolarMatches tracks_;
  ImuBias<double> bias_;
  std::vector<BiasedImage> images_;
  std::vector<Part> parts_;
  std::vector<Eigen::Vector3d> before_;
};

}  // namespace liestat::detail
