// A simulated hand-eye calibration: a camera on a gripper that looks at a target, with noise in both poses, and wrong
// pairs if wanted.
//
//   liestat::experiments::HandEyeScene scene({.motion = HandEyeMotion::planar, .pairs = 20}, seed, trial);
//   … scene.pairs[i] (A, B with their covariances), scene.inlier[i], scene.X, scene.Y …
//
// The camera is 0.4 to 0.7 m from the target, looks at it from within 60 degrees of its normal and is turned, from a
// first pose, by up to 60 degrees about any axis. X moves by some decimetres and turns by any angle, Y by a metre.
// Degenerate motions are those of the gripper, by up to 60 degrees and 0.3 m from a first pose. Independent motions
// (`relative`) are of the same sizes.
//
// A scene is a function of its options, the seed and the trial, with any compiler: X, Y and motions are drawn from stream
// 0, noise from stream 1, wrong pairs from stream 2.
#pragma once

#include <fusion/hand_eye.hpp>
#include <lie/linear.hpp>
#include <lie/se3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

using liestat::name;

/// The motions of the gripper, with the dimension of what they leave open.
enum class HandEyeMotion {
  general,           ///< 0
  about_point,       ///< 0: rotations about a fixed point
  half_turns,        ///< 0: half-turns about any axis
  parallel_axes,     ///< 1: rotations about one direction, translations in space
  planar,            ///< 1: the same with translations at right angles to it
  one_axis,          ///< 2: rotations about a fixed line
  pure_translation,  ///< 3
  collinear          ///< 4: translations along a line
};
inline constexpr std::array all_hand_eye_motions = {
    HandEyeMotion::general, HandEyeMotion::about_point, HandEyeMotion::half_turns,       HandEyeMotion::parallel_axes,
    HandEyeMotion::planar,  HandEyeMotion::one_axis,    HandEyeMotion::pure_translation, HandEyeMotion::collinear};
constexpr auto words(HandEyeMotion) {
  return std::array{"general", "about_point", "half_turns",       "parallel_axes",
                    "planar",  "one_axis",    "pure_translation", "collinear"};
}
/// Dimension of what the motion leaves open.
inline int openDimension(HandEyeMotion motion) {
  constexpr int dimensions[] = {0, 0, 0, 1, 1, 2, 3, 4};
  return dimensions[static_cast<std::size_t>(motion)];
}

enum class HandEyeNoise {
  isotropic,    ///< A and B: 1 mm, 0.2°
  anisotropic,  ///< the same, but B five times as much along the camera's axis and about the others
  target        ///< A 0.1 mm, 0.02°; B (0.2, 0.2, 1) mm, (0.2, 0.2, 0.04)° in the camera's axes at the target
};
inline constexpr std::array all_hand_eye_noises = {HandEyeNoise::isotropic, HandEyeNoise::anisotropic,
                                                   HandEyeNoise::target};
constexpr auto words(HandEyeNoise) { return std::array{"isotropic", "anisotropic", "target"}; }

/// The kinds of wrong pairs; errors are in B.
enum class HandEyeOutliers {
  gross,   ///< any pose near the target
  mild,    ///< 5 to 15 degrees and 2 to 8 cm off
  flips,   ///< the second solution of a planar target's pose, mirrored at the line of sight; by 10 degrees or more
  cluster  ///< all by the same motion: they agree with each other
};
inline constexpr std::array all_hand_eye_outliers = {HandEyeOutliers::gross, HandEyeOutliers::mild,
                                                     HandEyeOutliers::flips, HandEyeOutliers::cluster};
constexpr auto words(HandEyeOutliers) { return std::array{"gross", "mild", "flips", "cluster"}; }

struct HandEyeSceneOptions {
  HandEyeMotion motion = HandEyeMotion::general;
  HandEyeNoise noise = HandEyeNoise::isotropic;
  double noise_factor = 1;
  std::size_t pairs = 20;
  bool relative = false;  ///< independent motions, AX = XB
  double outliers = 0;    ///< share of the pairs, rounded to a whole number of them
  HandEyeOutliers outlier_kind = HandEyeOutliers::gross;
};

class HandEyeScene {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  SE3d X, Y;                                       ///< gripper_T_camera, base_T_target
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  ///< axis of the motion, where it has one, in the gripper's frame
  std::vector<PosePair> pairs, truth;
  std::vector<bool> inlier;

  explicit HandEyeScene(const HandEyeSceneOptions& options, std::uint64_t seed, std::uint64_t trial = 0)
      : options_(options), draw_(seed, trial, 0) {
    X = SE3d(SO3d(draw_.unitQuaternion()), vector(0.15));
    Y = SE3d(SO3d(draw_.unitQuaternion()), vector(1.0));
    drawMotions();
    CounterRng noise(seed, trial, 1);
    for (const PosePair& pair : truth) {
      PosePair measured = pair;
      setCovariances(measured);
      measured.a.mean = pair.a.mean * SE3d::exp(drawn(measured.a.covariance, noise));
      measured.b.mean = pair.b.mean * SE3d::exp(drawn(measured.b.covariance, noise));
      pairs.push_back(measured);
    }
    CounterRng wrong(seed, trial, 2);
    addOutliers(wrong);
  }

  const HandEyeSceneOptions& options() const { return options_; }
  /// That of the X which the motion can't tell from the true one that is nearest to an estimate, where what is open are
  /// translations: the truth moved along them.
  SE3d nearestTruth(const SE3d& estimate) const {
    const Eigen::Vector3d off = estimate.translation() - X.translation();
    const int open = openDimension(options_.motion);
    const Eigen::Vector3d along = open == 1 ? Eigen::Vector3d(axis.dot(off) * axis) : off;
    return open == 1 || open == 3 ? SE3d::trans(along) * X : X;
  }

 private:
  /// Uniform in a cube.
  Eigen::Vector3d vector(double half_width) {
    Eigen::Vector3d v;
    for (int i = 0; i < 3; ++i) v[i] = draw_.uniform(-half_width, half_width);
    return v;
  }
  /// About any axis.
  SO3d turn(double largest) {
    const Eigen::Vector3d any = draw_.unitVector<3>();
    return SO3d::exp(draw_.uniform(0.0, largest) * any);
  }
  /// target_T_camera: the camera looks at the target, turned by a rotation.
  SE3d camera() {
    const SO3d R = SO3d::rotX(std::numbers::pi) * turn(60 * units::degree);
    const double distance = draw_.uniform(0.4, 0.7);
    Eigen::Vector3d target_in_camera(0, 0, distance);
    for (int i = 0; i < 2; ++i) target_in_camera[i] = draw_.uniform(-0.05, 0.05);
    return SE3d(R, -(R * target_in_camera));
  }

  void drawMotions() {
    if (options_.relative) {
      axis = draw_.unitVector<3>();
      const Eigen::Vector3d point = vector(0.3);
      for (std::size_t i = 0; i < options_.pairs; ++i) {
        const SE3d A = motion(point);
        add(A, X.inverse() * A * X);
      }
      return;
    }
    if (options_.motion == HandEyeMotion::general) {
      for (std::size_t i = 0; i < options_.pairs; ++i) {
        const SE3d B = camera();
        add(Y * B * X.inverse(), B);
      }
      return;
    }
    const SE3d first = Y * camera() * X.inverse();
    axis = draw_.unitVector<3>();
    const Eigen::Vector3d point = vector(0.3);
    for (std::size_t i = 0; i < options_.pairs; ++i) {
      const SE3d A = first * motion(point);
      add(A, Y.inverse() * A * X);
    }
  }
  void add(const SE3d& A, const SE3d& B) {
    PosePair pair;
    pair.a.mean = A, pair.b.mean = B;
    truth.push_back(pair);
    inlier.push_back(true);
  }

  /// A motion of the gripper in its own frame.
  SE3d motion(const Eigen::Vector3d& point) {
    const double angle = draw_.uniform(-60 * units::degree, 60 * units::degree);
    const Eigen::Vector3d shift = vector(0.3);
    switch (options_.motion) {
      case HandEyeMotion::general:
        return SE3d(turn(60 * units::degree), shift);
      case HandEyeMotion::about_point:
        return about(turn(60 * units::degree), point);
      case HandEyeMotion::half_turns: {
        const Eigen::Vector3d any = draw_.unitVector<3>();
        return SE3d(SO3d::exp(std::numbers::pi * any), shift);
      }
      case HandEyeMotion::parallel_axes:
        return SE3d(SO3d::exp(angle * axis), shift);
      case HandEyeMotion::planar:
        return SE3d(SO3d::exp(angle * axis), shift - axis.dot(shift) * axis);
      case HandEyeMotion::one_axis:
        return about(SO3d::exp(angle * axis), point);
      case HandEyeMotion::pure_translation:
        return SE3d::trans(shift);
      case HandEyeMotion::collinear:
        return SE3d::trans(shift[0] * axis);
    }
    return {};
  }
  static SE3d about(const SO3d& R, const Eigen::Vector3d& point) { return SE3d(R, point - R * point); }

  void setCovariances(PosePair& pair) const {
    const double mm = 1e-3 * options_.noise_factor, deg = units::degree * options_.noise_factor;
    const auto diagonal = [](const Vector6& sigmas) -> Matrix6 { return sigmas.cwiseAbs2().asDiagonal(); };
    const auto equal = [&](double t, double r) { return diagonal((Vector6() << t, t, t, r, r, r).finished()); };
    switch (options_.noise) {
      case HandEyeNoise::isotropic:
        pair.a.covariance = pair.b.covariance = equal(mm, 0.2 * deg);
        break;
      case HandEyeNoise::anisotropic:
        pair.a.covariance = equal(mm, 0.2 * deg);
        pair.b.covariance = diagonal((Vector6() << mm, mm, 5 * mm, deg, deg, 0.2 * deg).finished());
        break;
      case HandEyeNoise::target: {
        pair.a.covariance = equal(0.1 * mm, 0.02 * deg);
        const Matrix6 at_target =
            diagonal((Vector6() << 0.2 * mm, 0.2 * mm, mm, 0.2 * deg, 0.2 * deg, 0.04 * deg).finished());
        // An error in the camera's axes at the target's origin, carried to the camera.
        const Matrix6 Ad = SE3d::trans(pair.b.mean.inverse().translation()).Adj();
        pair.b.covariance = Ad * at_target * Ad.transpose();
        break;
      }
    }
  }
  static Vector6 drawn(const Matrix6& covariance, CounterRng& rng) {
    const Vector6 z = rng.normalVector<6>();
    return SemidefiniteRoot<double, 6>(covariance) * z;
  }

  void addOutliers(CounterRng& rng) {
    const std::size_t n = pairs.size();
    const auto wrong = static_cast<std::size_t>(options_.outliers * static_cast<double>(n) + 0.5);
    const Eigen::Vector3d common_axis = rng.unitVector<3>(), common_direction = rng.unitVector<3>();
    std::vector<std::size_t> order(n);
    for (std::size_t i = 0; i < n; ++i) order[i] = i;
    for (std::size_t k = 0; k < wrong; ++k) {
      std::swap(order[k], order[k + static_cast<std::size_t>(rng() % (n - k))]);
      const std::size_t i = order[k];
      inlier[i] = false;
      SE3d& B = pairs[i].b.mean;
      const Eigen::Vector3d turned = rng.unitVector<3>(), direction = rng.unitVector<3>();
      const double u = rng.uniform(), v = rng.uniform();
      switch (options_.outlier_kind) {
        case HandEyeOutliers::gross:
          B = SE3d(SO3d::exp(u * std::numbers::pi * turned), (0.2 + v) * direction);
          break;
        case HandEyeOutliers::mild:
          B = B * SE3d(SO3d::exp((5 + 10 * u) * units::degree * turned), (0.02 + 0.06 * v) * direction);
          break;
        case HandEyeOutliers::flips: {
          // The normal of the target in C = camera_T_target is mirrored at the line of sight.
          const SE3d C = B.inverse();
          const Eigen::Vector3d sight = C.translation().normalized(), normal = C.so3() * Eigen::Vector3d(0, 0, 1);
          const Eigen::Vector3d mirrored = 2 * sight.dot(normal) * sight - normal;
          const Eigen::Vector3d cross = normal.cross(mirrored);
          const double angle = std::atan2(cross.norm(), normal.dot(mirrored));
          // Both solutions of a target that is seen frontally are nearly one: no pair to be found.
          if (angle < 10 * units::degree) {
            inlier[i] = true;
            break;
          }
          const SO3d flip = SO3d::exp(angle * cross.normalized());
          B = SE3d(flip * C.so3(), C.translation()).inverse();
          break;
        }
        case HandEyeOutliers::cluster:
          B = B * SE3d(SO3d::exp(20 * units::degree * common_axis), 0.1 * common_direction);
          break;
      }
    }
  }

  HandEyeSceneOptions options_;
  CounterRng draw_;
};

/// A pose of the truth.
struct TruePose {
  SE3d pose;
};
template <class V>
void describe(V& v, const TruePose& x) {
  v("translation", Eigen::Vector3d(x.pose.translation()), "", "m");
  v("quaternion_xyzw", Eigen::Vector4d(x.pose.so3().params()));
  v("rotation_vector", Eigen::Vector3d(x.pose.so3().log()), "", "rad");
}
/// The truth of a scene.
template <class V>
void describe(V& v, const HandEyeScene& scene) {
  const HandEyeSceneOptions& o = scene.options();
  v("problem", o.relative ? "AX = XB" : "AX = YB")("motion", name(o.motion))("noise", name(o.noise));
  v("noise_factor", o.noise_factor)("pairs", o.pairs)("outlier_kind", name(o.outlier_kind));
  v("open_dimension", openDimension(o.motion), "of what the motion leaves open")("X", TruePose{scene.X});
  v("Y", o.relative ? std::nullopt : std::optional(TruePose{scene.Y}))("inlier", scene.inlier);
}

}  // namespace liestat::experiments
