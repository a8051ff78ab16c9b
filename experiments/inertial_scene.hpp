// A simulated scene of visual-inertial initialisation: a body with a camera and an inertial sensor moves among
// features.
//
//   liestat::experiments::InertialScene scene({.images = 21, .features = 20}, 1);  // seed 1
//   liestat::CounterRng random(1, 0, 1);                                           // the same seed, stream 1
//   scene.addNoise(1. / 450, random);
//   const auto result = liestat::solveClosedForm(scene.window, {.bearing_noise = 1. / 450});
//   … (result.solutions[0].velocity - scene.velocity).norm()
//
// The motion is analytic (sums of sines, or constant), bearings and the twice integrated force are exact to rounding.
// An inertial sensor's readings of it: experiments/scene_readings.hpp. The world's z axis points upwards. Each scene is
// a function of its options and its seed alone, the same with every standard library: it is drawn from stream 0 of the
// seed, and noise of another stream is independent of it.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/so3.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// How the body moves. Those that vary accelerate by four sines of 0.2 to 1 Hz on top of a velocity of 1 m/s.
enum class SceneMotion {
  varying,                ///< in all directions
  constant_acceleration,  ///< 1.2 to 2.2 times InertialSceneOptions::acceleration
  constant_velocity,      ///< 1 m/s
  stationary,             ///< it turns, but does not move
  straight,               ///< varying, along a line
  planar,                 ///< varying, in a plane
  free_fall               ///< with 1 m/s at first
};
/// How it turns.
enum class SceneTurn { general, fixed_axis, none };
/// Where the features are.
enum class SceneLayout {
  general,   ///< in a cone of 80 degrees, 2 to 8 m from the middle of the motion
  plane,     ///< features in a plane that the motion leaves
  line,      ///< features in a line
  coplanar,  ///< features in the plane of a planar motion
  ahead      ///< the first feature on the line of a straight motion
};

/// The parameters of the drawing.
struct InertialSceneOptions {
  std::size_t images = 6;    ///< at about equal distances; two at least for a window that can be solved
  std::size_t features = 8;  ///< all are seen in all images
  SceneMotion motion = SceneMotion::varying;
  SceneTurn turn = SceneTurn::general;
  SceneLayout layout = SceneLayout::general;
  double window = 2;                                 ///< s, from the first image to the last
  double far = 1;                                    ///< features this many times farther
  double acceleration = 1.5;                         ///< m/s², RMS per axis of the varying part
  double turn_rate = 0.5;                            ///< rad/s, RMS per axis
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();  ///< p_c: its centre in the body (m)
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();    ///< accelerometer's bias (m/s²), left in S_j
  bool level_acceleration = false;                   ///< constant acceleration at a right angle to gravity
  std::size_t on_object = 0;                         ///< the first features are on a body that moves uniformly
  double object_speed = 0.5;                         ///< m/s, in a direction that is drawn
};

/// A body's motion and what it sees. Options that are not finite make a window that the solvers refuse.
class InertialScene {
 public:
  static constexpr double g = 9.81;  ///< m/s²

  /// Draws the scene from CounterRng(seed).
  InertialScene(const InertialSceneOptions& options, std::uint64_t seed) : options_(options) {
    CounterRng random(seed);
    drawMotion(random);
    drawTimes(random);
    drawFeatures(random);
    if (options.on_object > 0) object_velocity = options.object_speed * random.unitVector<3>();
    build();
  }

  ClosedFormWindow window;                ///< measurements of camera and inertial sensor
  Eigen::Vector3d velocity, gravity;      ///< V (m/s), G (m/s²) in the body's axes at the first image
  std::vector<Eigen::Vector3d> features;  ///< P_i in the body's axes at the first image, from its origin (m)
  std::vector<double> times;              ///< times of the images (s), the first 0
  /// Velocity of the body with the first features, in the body's axes at the first image (m/s).
  Eigen::Vector3d object_velocity = Eigen::Vector3d::Zero();

  /// In the world: m, m/s, m/s².
  Eigen::Vector3d position(double t) const {
    Eigen::Vector3d p = t * velocity_ + 0.5 * t * t * acceleration_;
    for (const Wave& w : move_) p += w.amplitude * std::sin(w.rate * t + w.phase);
    return p;
  }
  Eigen::Vector3d speed(double t) const {
    Eigen::Vector3d v = velocity_ + t * acceleration_;
    for (const Wave& w : move_) v += w.amplitude * (w.rate * std::cos(w.rate * t + w.phase));
    return v;
  }
  Eigen::Vector3d accelerationAt(double t) const {
    Eigen::Vector3d a = acceleration_;
    for (const Wave& w : move_) a -= w.amplitude * (w.rate * w.rate * std::sin(w.rate * t + w.phase));
    return a;
  }
  /// world_R_body.
  SO3d attitude(double t) const { return start_ * SO3d::exp(angle(t)); }
  /// Rate and specific force in the body's axes, without noise and bias.
  ImuSample<double> reading(double t) const {
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();
    for (const Wave& w : turn_) rate += w.amplitude * (w.rate * std::cos(w.rate * t + w.phase));
    return {t, SO3d::rightJacobian(angle(t)) * rate,
            attitude(t).inverse() * Eigen::Vector3d(accelerationAt(t) + g * Eigen::Vector3d::UnitZ())};
  }
  const InertialSceneOptions& options() const { return options_; }
  /// Adds to each bearing a noise across it with a standard deviation of so many rad in each direction.
  void addNoise(double sigma, CounterRng& random) {
    for (auto& track : window.features) {
      for (auto& seen : track) {
        const Eigen::Vector3d noise = sigma * random.normalVector<3>();
        seen.bearing = (seen.bearing + noise - seen.bearing.dot(noise) * seen.bearing).normalized();
      }
    }
  }
  /// The first `count` features walk away: each from image to image by steps with a standard deviation of so many rad
  /// in each direction.
  void addDrift(std::size_t count, double step, CounterRng& random) {
    for (std::size_t i = 0; i < std::min(count, window.features.size()); ++i) {
      Eigen::Vector3d walk = Eigen::Vector3d::Zero();
      for (TrackedBearing& seen : window.features[i]) {
        if (seen.image > 0) walk += step * random.normalVector<3>();
        seen.bearing = (seen.bearing + walk - seen.bearing.dot(walk) * seen.bearing).normalized();
      }
    }
  }

 private:
  struct Wave {
    Eigen::Vector3d amplitude;
    double rate, phase;
  };

  Eigen::Vector3d angle(double t) const {
    Eigen::Vector3d a = Eigen::Vector3d::Zero();
    for (const Wave& w : turn_) a += w.amplitude * std::sin(w.rate * t + w.phase);
    return a;
  }

  void drawMotion(CounterRng& random) {
    using M = SceneMotion;
    const M kind = options_.motion;
    // One draw in an expression: in which order the operands of a product are evaluated is the compiler's choice.
    const Eigen::Vector3d turned = random.unitVector<3>();
    start_ = SO3d::exp(3 * random.uniform(0, 1) * turned);
    velocity_ = random.unitVector<3>();
    acceleration_ = Eigen::Vector3d::Zero();
    const Eigen::Vector3d line = random.unitVector<3>(), normal = random.unitVector<3>();
    if (kind == M::constant_acceleration) {
      const Eigen::Vector3d direction = random.unitVector<3>();
      acceleration_ = options_.acceleration * 1.7 * random.uniform(0.7, 1.3) * direction;
      if (options_.level_acceleration) acceleration_.z() = 0;
    }
    if (kind == M::free_fall) acceleration_ = -g * Eigen::Vector3d::UnitZ();
    const auto flat = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
      if (kind == M::straight) return line.dot(x) * line;
      return flatten(x, normal);
    };
    const bool restricted = kind == M::straight || kind == M::planar;
    for (int k = 0; k < 4 && (kind == M::varying || restricted); ++k) {
      const double rate = 6.283185307179586 * random.uniform(0.2, 1);
      const Eigen::Vector3d amplitude =
          options_.acceleration / std::sqrt(2.) / (rate * rate) * random.normalVector<3>();
      const double phase = random.uniform(0, 6.283185307179586);
      move_.push_back({restricted ? flat(amplitude) : amplitude, rate, phase});
    }
    if (restricted) velocity_ = flat(velocity_).normalized();
    if (kind == M::stationary) velocity_.setZero();
    normal_ = normal;
    const Eigen::Vector3d axis = random.unitVector<3>();
    for (int k = 0; k < 3 && options_.turn != SceneTurn::none; ++k) {
      const double rate = 6.283185307179586 * random.uniform(0.2, 0.8);
      Eigen::Vector3d amplitude = options_.turn_rate * std::sqrt(2. / 3) / rate * random.normalVector<3>();
      if (options_.turn == SceneTurn::fixed_axis) amplitude = amplitude.sum() * axis;
      turn_.push_back({amplitude, rate, 0});
    }
  }

  void drawTimes(CounterRng& random) {
    const double step = options_.images < 2 ? 0 : options_.window / static_cast<double>(options_.images - 1);
    for (std::size_t j = 0; j < options_.images; ++j) {
      const double jitter = j == 0 || j + 1 == options_.images ? 0 : random.uniform(-0.2, 0.2);
      times.push_back(step * (static_cast<double>(j) + jitter));
    }
  }

  void drawFeatures(CounterRng& random) {
    const Eigen::Vector3d centre = position(0.5 * options_.window), ahead = random.unitVector<3>();
    const Eigen::Vector3d along = random.unitVector<3>(), plane = random.unitVector<3>();
    for (std::size_t i = 0; i < options_.features; ++i) {
      // A cone of 80 degrees, 2 to 8 m away.
      const Eigen::Vector3d aside = random.unitVector<3>();
      const Eigen::Vector3d direction = ahead + 0.7 * random.uniform(0, 1) * aside;
      Eigen::Vector3d p = centre + options_.far * random.uniform(2, 8) * direction.normalized();
      if (options_.layout == SceneLayout::coplanar) p = position(0) + flatten(p - position(0), normal_);
      if (options_.layout == SceneLayout::plane) p = centre + 4 * ahead + 2 * flatten(random.normalVector<3>(), plane);
      if (options_.layout == SceneLayout::line) p = centre + 4 * ahead + random.uniform(-2, 2) * along;
      if (options_.layout == SceneLayout::ahead && i == 0) {
        p = position(0) + 10 * (position(options_.window) - position(0)).normalized();
      }
      points_.push_back(p);
    }
  }
  static Eigen::Vector3d flatten(const Eigen::Vector3d& x, const Eigen::Vector3d& normal) {
    return x - normal.dot(x) * normal;
  }

  /// -∫ (t - s) C(s) ds by Gauss' rule with five points in 64 panels.
  Eigen::Matrix3d displacementByBias(double t) const {
    constexpr std::array<double, 5> node{-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                         0.9061798459386640};
    constexpr std::array<double, 5> weight{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                           0.4786286704993665, 0.2369268850561891};
    const SO3d back = attitude(0).inverse();
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    const double h = t / 64;
    for (int panel = 0; panel < 64; ++panel) {
      for (std::size_t k = 0; k < 5; ++k) {
        const double s = h * (panel + 0.5 + 0.5 * node[k]);
        sum -= 0.5 * h * weight[k] * (t - s) * (back * attitude(s)).matrix();
      }
    }
    return sum;
  }

  void build() {
    const SO3d body_R_world = attitude(0).inverse();
    velocity = body_R_world * speed(0);
    gravity = body_R_world * Eigen::Vector3d(0, 0, -g);
    window.cameras = {SE3d(SO3d(), options_.camera)};
    for (const double t : times) {
      WindowImage image;
      image.time = t;
      image.rotation = (body_R_world * attitude(t)).matrix();
      if (t == 0) image.rotation.setIdentity();
      const Eigen::Vector3d moved = body_R_world * Eigen::Vector3d(position(t) - position(0));
      image.displacement_by_bias = displacementByBias(t);
      image.displacement = moved - t * velocity - 0.5 * t * t * gravity - image.displacement_by_bias * options_.bias;
      window.images.push_back(image);
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d& point = points_[i];
      const Eigen::Vector3d drift = i < options_.on_object ? object_velocity : Eigen::Vector3d::Zero();
      const Eigen::Vector3d P = body_R_world * Eigen::Vector3d(point - position(0));
      features.push_back(P);
      FeatureTrack track;
      for (std::size_t j = 0; j < times.size(); ++j) {
        const Eigen::Matrix3d back = window.images[j].rotation.transpose();
        const Eigen::Vector3d moved = body_R_world * Eigen::Vector3d(position(times[j]) - position(0));
        track.push_back({j, (back * (P + times[j] * drift - moved) - options_.camera).normalized()});
      }
      window.features.push_back(std::move(track));
    }
  }

  InertialSceneOptions options_;
  SO3d start_;
  Eigen::Vector3d velocity_, acceleration_, normal_;
  std::vector<Wave> move_, turn_;
  std::vector<Eigen::Vector3d> points_;
};

}  // namespace liestat::experiments
