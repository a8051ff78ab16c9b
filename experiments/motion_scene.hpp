// Points in front of a moving camera, frame by frame, as tracks and as pairs of successive frames, with noise, outliers,
// a gyroscope, and the true motion.
//
//   liestat::experiments::MotionScene scene({.world = MotionWorld::orbit, .sigma = 1}, seed, trial);
//   for (…) { scene.advance(); … scene.pairs, scene.gyroscope, scene.velocity, scene.translation, scene.rotation … }
//
// The camera's axes: x right, y down, z forward; one frame is the unit of time; motions are those of the points, dX/dt =
// Ω × X + V in the camera's axes, X₂ = Exp(Ω) X₁ + J_l(Ω) V. An observation has one error, which the pairs of both of
// its intervals share. Outliers are of flows: the second point of a pair lies anywhere in ±0.2 about the first.
//
// Each trial is a function of its options, seed and number alone, with any compiler: the motion and the points are drawn
// from stream 0, noise from stream 1, outliers from stream 2, the gyroscope's errors from stream 3.
#pragma once

#include <fusion/motion/types.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

namespace liestat::experiments {

/// The world in front of the camera, and how it moves.
enum class MotionWorld {
  orbit,  ///< a ball of radius 0.5 at depth 1.5 turns about its centre, axis near the image plane: points stay in view
  general,  ///< random directions of V (0.1 per frame) and Ω; depths of 1 to 2; points that leave are replaced
  plane,    ///< the same with points anew in each frame, on a plane that is fixed in the camera's axes
  narrow,   ///< the same as general in a quarter of the image's width, depths of 1.4 to 1.6
  turning   ///< the same as general, the axis of Ω turns round once in 40 frames
};
inline constexpr std::array all_motion_worlds = {MotionWorld::orbit, MotionWorld::general, MotionWorld::plane,
                                                 MotionWorld::narrow, MotionWorld::turning};
inline const char* nameOf(MotionWorld world) {
  constexpr const char* names[] = {"orbit", "general", "plane", "narrow", "turning"};
  return names[static_cast<std::size_t>(world)];
}

/// Something that the filters are not told.
enum class MotionUpset {
  none,
  second_object,  ///< every fifth point follows another motion of the same size
  reversal,       ///< V becomes -V at frame 50
  turning,        ///< V turns by 0.3 degrees a frame about one axis, and Ω stays
  wrong_sign,     ///< the gyroscope's readings are the rotation's with the other sign
  dead            ///< the gyroscope's readings are zero
};
inline constexpr std::array all_motion_upsets = {MotionUpset::none,       MotionUpset::second_object,
                                                 MotionUpset::reversal,   MotionUpset::turning,
                                                 MotionUpset::wrong_sign, MotionUpset::dead};
inline const char* nameOf(MotionUpset upset) {
  constexpr const char* names[] = {"none", "second_object", "reversal", "turning", "wrong_sign", "dead"};
  return names[static_cast<std::size_t>(upset)];
}

struct MotionSceneOptions {
  MotionWorld world = MotionWorld::orbit;
  std::size_t points = 20;
  double sigma = 1;                        ///< px
  double rotation = 5;                     ///< degrees per frame
  double speed = 0.1;                      ///< |V| of all worlds but the orbit
  double outliers = 0;                     ///< probability of a flow to be one
  double gyroscope_sigma = 0;              ///< degrees per frame and axis; 0: none
  double gyroscope_bias = 0;               ///< degrees per frame, standard deviation of each axis
  double focal_length = 500, width = 512;  ///< px
  MotionUpset upset = MotionUpset::none;
};

/// One point of a frame.
struct MotionTrack {
  std::size_t track = 0;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< measured, calibrated
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

class MotionScene {
 public:
  MotionSceneOptions options;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();     ///< V, per frame
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();     ///< Ω of the last interval, rad per frame
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< T of the last interval
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();       ///< centre of the ball (orbit)
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();         ///< gyroscope's bias, rad per frame
  std::size_t frame = 0;
  std::vector<MotionTrack> observed;     ///< all tracks that the present frame sees
  std::vector<MotionTrack> tracks;       ///< those of them that the next frame sees too
  std::vector<PointPair> pairs;          ///< matches of the last interval
  std::vector<std::size_t> pair_tracks;  ///< the track of each pair
  std::vector<double> depths;            ///< depth of each pair at the first frame
  std::vector<bool> inlier;              ///< true for right pairs
  GyroscopeRotation gyroscope;

  MotionScene(const MotionSceneOptions& scene_options, std::uint64_t seed, std::uint64_t trial = 0)
      : options(scene_options),
        world_(seed, trial, 0),
        noise_(seed, trial, 1),
        wrong_(seed, trial, 2),
        inertial_(seed, trial, 3) {
    drawMotion();
    if (options.upset == MotionUpset::turning) {
      const Eigen::Vector3d turn = 0.3 * units::degree * velocity.unitOrthogonal();
      turn_ = SO3d::exp(turn).matrix();
    }
    if (options.upset == MotionUpset::second_object) {
      const Eigen::Vector3d Omega = options.rotation * units::degree * world_.unitVector<3>();
      const Eigen::Vector3d V = velocity.norm() * world_.unitVector<3>();
      second_ = {SO3d::exp(Omega).matrix(), SO3d::leftJacobian(Omega) * V};
    }
    for (std::size_t i = 0; i < options.points; ++i) tracks.push_back(freshTrack(motionOf(1)));
    observed = tracks;
    const double s = options.gyroscope_bias * units::degree;
    const Eigen::Vector3d unit = inertial_.normalVector<3>();
    bias = s * unit;
  }

  /// px: what the pairs say about their noise; 0: the truth.
  double told_sigma = 0;

  bool hasGyroscope() const { return options.gyroscope_sigma > 0; }
  /// Standard deviation of a calibrated coordinate.
  double sigma() const { return options.sigma / options.focal_length; }
  double toldSigma() const { return (told_sigma > 0 ? told_sigma : options.sigma) / options.focal_length; }
  /// Ω of an interval, rad per frame; the first is 1.
  Eigen::Vector3d rotationOf(std::size_t of_frame) const {
    if (options.world != MotionWorld::turning) return options.rotation * units::degree * axis_;
    const double angle = 2 * std::numbers::pi * static_cast<double>(of_frame) / 40;
    return options.rotation * units::degree * (std::cos(angle) * axis_ + std::sin(angle) * second_axis_);
  }

  /// The next frame. Every track of a frame is seen in the next one too: there are `points` pairs in each interval.
  void advance() {
    ++frame;
    if (options.upset == MotionUpset::reversal && frame == 50) velocity = -velocity;
    if (options.upset == MotionUpset::turning) velocity = turn_ * velocity;
    rotation = rotationOf(frame);
    translation = SO3d::leftJacobian(rotation) * velocity;
    const Motion common = motionOf(frame), common_next = motionOf(frame + 1);
    pairs.clear(), pair_tracks.clear(), depths.clear(), inlier.clear(), observed.clear();
    for (MotionTrack& track : tracks) {
      const bool other = options.upset == MotionUpset::second_object && pairs.size() % 5 == 0;
      const Motion &now = other ? second_ : common, &next = other ? second_ : common_next;
      if (options.world == MotionWorld::plane) track = freshTrack(now);
      const MotionTrack before = track;
      track.position = now(track.position);
      track.at = measured(track.position);
      PointPair pair{before.at, track.at, toldSigma()};
      bool right = true;
      if (options.outliers > 0) {
        const double luck = wrong_.uniform(), dx = wrong_.uniform(-0.2, 0.2), dy = wrong_.uniform(-0.2, 0.2);
        right = luck >= options.outliers;
        if (!right) pair.second = pair.first + Eigen::Vector2d(dx, dy);
      }
      pairs.push_back(pair), pair_tracks.push_back(track.track);
      depths.push_back(before.position.z()), inlier.push_back(right);
      observed.push_back(track);
      if (!inView(next(track.position))) {
        track = freshTrack(next);
        observed.push_back(track);
      }
    }
    const double s = options.gyroscope_sigma * units::degree;
    const Eigen::Vector3d unit = inertial_.normalVector<3>();
    gyroscope.rotation = rotation + bias + s * unit;
    if (options.upset == MotionUpset::wrong_sign) gyroscope.rotation = -gyroscope.rotation;
    if (options.upset == MotionUpset::dead) gyroscope.rotation.setZero();
    gyroscope.covariance = s * s * Eigen::Matrix3d::Identity();
  }

 private:
  /// The motion of an interval.
  struct Motion {
    Eigen::Matrix3d R;
    Eigen::Vector3d T;
    Eigen::Vector3d operator()(const Eigen::Vector3d& X) const { return R * X + T; }
  };
  Motion motionOf(std::size_t of_frame) const {
    const Eigen::Vector3d Omega = rotationOf(of_frame);
    return {SO3d::exp(Omega).matrix(), SO3d::leftJacobian(Omega) * velocity};
  }

  void drawMotion() {
    if (options.world == MotionWorld::orbit) {
      centre << 0, 0, 1.5;
      const Eigen::Vector3d unit = world_.unitVector<3>();
      axis_ = Eigen::Vector3d(unit.x(), unit.y(), 0.3 * unit.z()).normalized();
      velocity = -rotationOf(0).cross(centre);
      return;
    }
    velocity = options.speed * world_.unitVector<3>();
    axis_ = world_.unitVector<3>();
    const Eigen::Vector3d other = world_.unitVector<3>();
    second_axis_ = axis_.cross(other).normalized();
    const double a = world_.uniform(-0.5, 0.5), b = world_.uniform(-0.5, 0.5);
    plane_ = Eigen::Vector3d(a, b, 1);
  }
  double half() const {
    const double whole = 0.5 * options.width / options.focal_length;
    return options.world == MotionWorld::narrow ? 0.25 * whole : whole;
  }
  double nearest() const { return options.world == MotionWorld::narrow ? 1.4 : 1; }
  double farthest() const { return options.world == MotionWorld::narrow ? 1.6 : 2; }
  /// Points of the orbit stay, those of the plane are not followed.
  bool inView(const Eigen::Vector3d& X) const {
    if (options.world == MotionWorld::orbit) return true;
    if (!(X.z() > 0.1)) return false;
    const bool in_image = std::abs(X.x()) < half() * X.z() && std::abs(X.y()) < half() * X.z();
    return options.world == MotionWorld::plane || (in_image && X.z() > nearest() && X.z() < farthest());
  }
  Eigen::Vector2d measured(const Eigen::Vector3d& X) {
    const Eigen::Vector2d error = noise_.normalVector<2>();
    return X.head<2>() / X.z() + sigma() * error;
  }
  /// A new track that is seen after the next motion too. (Where hardly any is, the last one drawn.)
  MotionTrack freshTrack(const Motion& next) {
    MotionTrack track;
    track.track = next_track_++;
    for (int tries = 0; tries < 1000; ++tries) {
      track.position = freshPosition();
      if (inView(next(track.position))) break;
    }
    track.at = measured(track.position);
    return track;
  }
  Eigen::Vector3d freshPosition() {
    if (options.world == MotionWorld::orbit) {
      Eigen::Vector3d in_ball;
      do {
        for (int k = 0; k < 3; ++k) in_ball[k] = world_.uniform(-1, 1);
      } while (in_ball.squaredNorm() > 1);
      return centre + 0.5 * in_ball;
    }
    const double x = world_.uniform(-half(), half()), y = world_.uniform(-half(), half());
    const double depth = world_.uniform(nearest(), farthest());
    const Eigen::Vector3d ray(x, y, 1);
    return options.world == MotionWorld::plane ? Eigen::Vector3d(1.5 / plane_.dot(ray) * ray)
                                               : Eigen::Vector3d(depth * ray);
  }

  CounterRng world_, noise_, wrong_, inertial_;
  Eigen::Vector3d axis_ = Eigen::Vector3d::UnitX(), second_axis_ = Eigen::Vector3d::UnitY(),
                  plane_ = Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();
  Motion second_{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()};
  std::size_t next_track_ = 0;
};

}  // namespace liestat::experiments
