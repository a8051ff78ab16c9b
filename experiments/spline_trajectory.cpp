#include <experiments/spline_trajectory.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace liestat::experiments {
namespace {

constexpr int order = SplineTrajectory::degree + 1;

/// The uniform B-splines of degrees 0 to 5 that are not zero on a piece, at 0 <= u <= 1 of it: row p has p + 1, the one
/// of the earliest control point first (de Boor's recursion).
std::array<std::array<double, order>, order> basis(double u) {
  std::array<std::array<double, order>, order> b{};
  b[0][0] = 1;
  for (std::size_t p = 1; p < order; ++p) {
    for (std::size_t s = 0; s <= p; ++s) {
      const auto degree = static_cast<double>(p), place = static_cast<double>(s);
      if (s > 0) b[p][s] += (u + degree - place) / degree * b[p - 1][s - 1];
      if (s < p) b[p][s] += (place + 1 - u) / degree * b[p - 1][s];
    }
  }
  return b;
}

}  // namespace

SplineTrajectory::SplineTrajectory(double first, double spacing, std::vector<SE3d> world_T_body)
    : first_(first), spacing_(spacing), poses_(std::move(world_T_body)) {
  eigen_assert(spacing > 0 && poses_.size() >= order);
}

Kinematics SplineTrajectory::at(double time) const {
  // The piece between poses 2 and 3 is that of the first six.
  const double place = (time - first_) / spacing_ - 2;
  const double last = static_cast<double>(poses_.size()) - order;
  const double piece = std::clamp(std::floor(place), 0.0, last);
  const double u = place - piece;
  const auto b = basis(u);
  const SE3d* pose = poses_.data() + static_cast<std::size_t>(piece);

  // A derivative of a B-spline is the B-spline of one degree less, of the control points' differences.
  std::array<Eigen::Vector3d, order> point;
  for (std::size_t s = 0; s < order; ++s) point[s] = pose[s].translation();
  Kinematics k;
  k.position = b[5][0] * point[0];
  k.velocity.setZero();
  k.acceleration.setZero();
  for (std::size_t s = 1; s < order; ++s) k.position += b[5][s] * point[s];
  for (std::size_t s = 1; s < order; ++s) k.velocity += b[4][s - 1] / spacing_ * (point[s] - point[s - 1]);
  for (std::size_t s = 2; s < order; ++s) {
    k.acceleration += b[3][s - 2] / (spacing_ * spacing_) * (point[s] - 2 * point[s - 1] + point[s - 2]);
  }

  k.world_R_body = pose[0].so3();
  k.angular_rate.setZero();
  double cumulative = 1;
  for (std::size_t s = 1; s < order; ++s) {
    cumulative -= b[5][s - 1];
    const Eigen::Vector3d turn = (SO3d(pose[s - 1].so3()).inverse() * SO3d(pose[s].so3())).log();
    const SO3d part = SO3d::exp(cumulative * turn);
    k.world_R_body = k.world_R_body * part;
    k.angular_rate = part.inverse() * k.angular_rate + b[4][s - 1] / spacing_ * turn;
  }
  // A dozen products leave a few ulps off the unit sphere.
  k.world_R_body = SO3d(Eigen::Quaterniond(Eigen::Vector4d(k.world_R_body.params())));
  return k;
}

}  // namespace liestat::experiments
