// Trajectories of known truth with pose errors of known covariance: independent errors, dead reckoning, and dead reckoning
// with position fixes. For tests, the ledger of convention bugs and an example.
#pragma once

#include <lie/linear.hpp>
#include <lie/se3.hpp>
#include <stats/gaussian.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>

#include <Eigen/Core>
#include <Eigen/QR>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::experiments {

/// The body's motion: 3-D rotations of 1.5 rad (rms), free yaw with roll and pitch of 5 degrees, a car in the plane, or
/// rotations below 0.14 rad. Positions are some 4 m from the origin.
enum class SceneMotion { space, yaw, planar, small };

/// The shape of the covariances: full, diagonal, s_t² I and s_r² I, or those of a car (x, y and yaw correlated, the rest
/// apart).
enum class SceneNoise { full, diagonal, isotropic, planar };

struct TrajectorySceneOptions {
  SceneMotion motion = SceneMotion::space;
  SceneNoise noise = SceneNoise::full;
  std::size_t n = 200;
  double sigma_translation = 0.05, sigma_rotation = 0.01;  ///< m, rad
  double step = 0.1;                                       ///< s
};

struct TrajectoryScene {
  std::vector<double> times;
  std::vector<SE3d> truth;
  std::vector<Gaussian<SE3d>> estimate;  ///< covariance of ξ, T = T̂ Exp(ξ)

  std::vector<Gaussian<SE3d>> reference() const {
    std::vector<Gaussian<SE3d>> poses;
    for (const SE3d& T : truth) poses.push_back({T, Eigen::Matrix<double, 6, 6>::Zero()});
    return poses;
  }
};

inline SE3d scenePose(SceneMotion motion, const Eigen::Matrix<double, 12, 1>& phase, double t) {
  const auto wave = [&](int k, double frequency) { return std::sin(frequency * t + phase[k]); };
  Eigen::Vector3d p(4 * wave(0, 0.23), 4 * wave(1, 0.31), 1.5 * wave(2, 0.17)), r;
  switch (motion) {
    case SceneMotion::space:
      r << 1.3 * wave(3, 0.41) + 0.3, 1.2 * wave(4, 0.37), 1.2 * wave(5, 0.29);
      return SE3d(SO3d::exp(r), p);
    case SceneMotion::yaw:
      return SE3d(SO3d::rotZ(2.5 * wave(3, 0.13) + 0.4 * wave(6, 0.5)) * SO3d::rotY(0.09 * wave(4, 0.7)) *
                      SO3d::rotX(0.09 * wave(5, 0.9)),
                  p);
    case SceneMotion::planar:
      p[2] = 0;
      return SE3d(SO3d::rotZ(2.5 * wave(3, 0.13) + 0.4 * wave(6, 0.5)), p);
    case SceneMotion::small:
      r << 0.08 * wave(3, 0.41), 0.08 * wave(4, 0.37), 0.08 * wave(5, 0.29);
      return SE3d(SO3d::exp(r), p);
  }
  return {};
}

inline Eigen::Matrix<double, 6, 6> sceneCovariance(const TrajectorySceneOptions& o, CounterRng& rng) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(o.sigma_translation), Eigen::Vector3d::Constant(o.sigma_rotation);
  Matrix6 shape = Matrix6::Identity();
  if (o.noise == SceneNoise::full) {
    // Eigenvalues from 0.8 to 14, as spread as those of filters are.
    Matrix6 random;
    for (int k = 0; k < 6; ++k) random.col(k) = rng.normalVector<6>();
    const Matrix6 Q = Eigen::HouseholderQR<Matrix6>(random).householderQ();
    Eigen::Matrix<double, 6, 1> values;
    values << 0.3, 0.5, 0.8, 1.3, 2.1, 3.5;
    shape = Q * values.asDiagonal() * Q.transpose();
  } else if (o.noise == SceneNoise::diagonal) {
    for (int k = 0; k < 6; ++k) shape(k, k) = std::exp(0.8 * (2 * rng.uniform() - 1) + (k % 3 - 1) * 0.7);
  } else if (o.noise == SceneNoise::planar) {
    // Along, across, up; roll, pitch, yaw: the lateral error goes with the yaw.
    shape.diagonal() << 2.5, 0.8, 0.3, 0.4, 0.4, 1.5;
    shape(1, 5) = shape(5, 1) = 0.6, shape(0, 1) = shape(1, 0) = 0.4;
    shape *= std::exp(0.5 * (2 * rng.uniform() - 1));
  }
  return sigma.asDiagonal() * shape * sigma.asDiagonal();
}

inline TrajectoryScene emptyScene(const TrajectorySceneOptions& o, CounterRng& rng) {
  TrajectoryScene scene;
  Eigen::Matrix<double, 12, 1> phase;
  for (int k = 0; k < 12; ++k) phase[k] = 6.28 * rng.uniform();
  for (std::size_t i = 0; i < o.n; ++i) {
    scene.times.push_back(o.step * static_cast<double>(i));
    scene.truth.push_back(scenePose(o.motion, phase, scene.times.back()));
  }
  return scene;
}

/// Poses with errors independent of each other.
inline TrajectoryScene independentScene(const TrajectorySceneOptions& o, CounterRng& rng) {
  TrajectoryScene scene = emptyScene(o, rng);
  for (const SE3d& T : scene.truth) {
    const Eigen::Matrix<double, 6, 6> covariance = sceneCovariance(o, rng);
    const SE3d error = sample(Gaussian<SE3d>{SE3d(), covariance}, rng);
    scene.estimate.push_back({T * error.inverse(), covariance});
  }
  return scene;
}

/// Dead reckoning: each step adds an independent error, and the covariance is that of the sum. With fix_every > 0 a position
/// is measured at each such pose (sigma: that of a step times three) and fused.
inline TrajectoryScene deadReckoningScene(const TrajectorySceneOptions& o, CounterRng& rng, std::size_t fix_every = 0) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  TrajectoryScene scene = emptyScene(o, rng);
  Matrix6 covariance = sceneCovariance(o, rng);
  SE3d pose = scene.truth[0] * sample(Gaussian<SE3d>{SE3d(), covariance}, rng).inverse();
  scene.estimate.push_back({pose, covariance});
  for (std::size_t i = 1; i < o.n; ++i) {
    const SE3d motion = scene.truth[i - 1].inverse() * scene.truth[i];
    const Matrix6 step = sceneCovariance(o, rng);
    const SE3d measured = motion * sample(Gaussian<SE3d>{SE3d(), step}, rng).inverse();
    pose = pose * measured;
    const Matrix6 A = measured.inverse().Adj();
    covariance = A * covariance * A.transpose() + step;
    if (fix_every > 0 && i % fix_every == 0) {
      const double sigma = 3 * o.sigma_translation;
      const Eigen::Matrix3d R = pose.rotationMatrix();
      const Eigen::Vector3d z = scene.truth[i].translation() + sigma * rng.normalVector<3>() - pose.translation();
      Eigen::Matrix<double, 3, 6> H = Eigen::Matrix<double, 3, 6>::Zero();
      H.leftCols<3>() = R;
      const Eigen::Matrix3d S = H * covariance * H.transpose() + sigma * sigma * Eigen::Matrix3d::Identity();
      const Eigen::Matrix<double, 6, 3> K = covariance * H.transpose() * Cholesky<double, 3>(S).inverse();
      pose = pose * SE3d::exp(Eigen::Matrix<double, 6, 1>(K * z));
      const Matrix6 left = Matrix6::Identity() - K * H;
      covariance = left * covariance * left.transpose() + sigma * sigma * K * K.transpose();
    }
    scene.estimate.push_back({pose, covariance});
  }
  return scene;
}

}  // namespace liestat::experiments
