// The alignment of a trajectory that its covariances weight, and what it leaves of the errors; docs/theory/trajectories.md,
// sections 2 and 3.
//
// Parameters are taken about the centroid c of the aligned positions, t ← c + δt + exp(δσ) Exp(δφ)(t - c): about a far origin
// translation and rotation could not be told apart in double precision.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/trajectories.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace liestat::detail {

using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

/// The parameters that a model leaves free, of (δt, δφ, δσ).
inline std::array<bool, 7> freeParameters(AlignmentModel model) {
  switch (model) {
    case AlignmentModel::posyaw:
      return {true, true, true, false, false, true, false};
    case AlignmentModel::origin:
    case AlignmentModel::se3:
      return {true, true, true, true, true, true, false};
    case AlignmentModel::sim3:
      return {true, true, true, true, true, true, true};
    default:
      return {};
  }
}

/// The error of one aligned pose in the estimate's units, its covariance before alignment, and its derivative by the
/// parameters, ξ(δ) = ξ - J δ. The translation is divided by the scale, so that the covariance does not depend on it: with
/// weights that follow the scale its estimate would be biased.
struct AlignedError {
  Eigen::Matrix<double, 6, 1> error;
  Eigen::Matrix<double, 6, 6> covariance;
  Eigen::Matrix<double, 6, 7> jacobian;

  AlignedError(const MatchedPose& p, const Alignment& a, const Eigen::Vector3d& centre,
               const std::array<bool, 7>& is_free) {
    const SE3d moved = a(p.estimate.mean);
    const double s = a.scale;
    error = (moved.inverse() * p.reference.mean).log();
    const Eigen::Matrix3d Rt = moved.so3().inverse().matrix();
    const Eigen::Vector3d arm = moved.translation() - centre;
    jacobian.topLeftCorner<3, 3>() = Rt / s;
    jacobian.block<3, 3>(0, 3) = -(Rt * skew(arm)) / s;
    jacobian.bottomLeftCorner<3, 3>().setZero();
    jacobian.block<3, 3>(3, 3) = Rt;
    jacobian.col(6) << (Rt * arm + error.head<3>()) / s, Eigen::Vector3d::Zero();
    for (int k = 0; k < 7; ++k) {
      if (!is_free[static_cast<std::size_t>(k)]) jacobian.col(k).setZero();
    }
    error.head<3>() /= s;
    covariance = p.reference.covariance;
    if (s != 1) covariance.topRows<3>() /= s, covariance.leftCols<3>() /= s;
    covariance += p.estimate.covariance;
  }
};

/// Normal equations of the alignment: information H, gradient Σ Jᵀ Σ⁻¹ ξ, cost Σ ξᵀ Σ⁻¹ ξ.
struct AlignmentSums {
  Matrix7 information = Matrix7::Zero();
  Vector7 gradient = Vector7::Zero();
  double cost = 0;
  std::size_t indefinite = 0;

  void add(const AlignedError& e) {
    const Cholesky<double, 6> root(e.covariance);
    if (!root.ok()) {
      ++indefinite;
      return;
    }
    const Eigen::Matrix<double, 6, 7> W = root.halfSolve<7>(e.jacobian);
    const Eigen::Matrix<double, 6, 1> z = root.halfSolve<1>(e.error);
    for (int j = 0; j < 7; ++j) {
      for (int i = j; i < 7; ++i) {
        double sum = 0;
        for (int k = 0; k < 6; ++k) sum += W(k, i) * W(k, j);
        information(i, j) += sum;
      }
      double sum = 0;
      for (int k = 0; k < 6; ++k) sum += W(k, j) * z[k];
      gradient[j] += sum;
    }
    cost += z.squaredNorm();
  }
  /// Fills the upper triangle and makes the fixed parameters harmless: a one on their diagonal.
  void finish(const std::array<bool, 7>& is_free) {
    for (int j = 0; j < 7; ++j) {
      for (int i = 0; i < j; ++i) information(i, j) = information(j, i);
      if (!is_free[static_cast<std::size_t>(j)]) information(j, j) = 1;
    }
  }
};

/// The centroid of the aligned positions.
inline Eigen::Vector3d centroid(std::span<const MatchedPose> poses, const Alignment& a) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const MatchedPose& p : poses) sum += a(p.estimate.mean).translation();
  return poses.empty() ? sum : Eigen::Vector3d(sum / static_cast<double>(poses.size()));
}

inline AlignmentSums alignmentSums(std::span<const MatchedPose> poses, const Alignment& a,
                                   const Eigen::Vector3d& centre, const std::array<bool, 7>& is_free) {
  AlignmentSums sums;
  for (const MatchedPose& p : poses) sums.add(AlignedError(p, a, centre, is_free));
  sums.finish(is_free);
  return sums;
}

/// The ratio of the extreme eigenvalues of an information matrix in units of its diagonal; infinite if it is singular.
inline double scaledCondition(const Matrix7& information) {
  Matrix7 scaled = information;
  for (int i = 0; i < 7; ++i) {
    const double root = std::sqrt(information(i, i));
    if (!(root > 0)) return infinity;
    scaled.row(i) /= root, scaled.col(i) /= root;
  }
  const SymmetricEigen eigen(scaled);
  return eigen.values[0] > 0 ? eigen.values[6] / eigen.values[0] : infinity;
}

/// A condition above which a direction is not determined in double precision.
inline constexpr double worst_condition = 1e12;
/// A standard deviation of the logarithm of the scale above which noise alone explains the positions.
inline constexpr double worst_log_scale_sigma = 0.3;

/// The covariance of (δt, δφ, δσ) about the centroid, as one of the parameters of an Alignment: δt there is the motion of t.
inline Matrix7 aboutOrigin(const Matrix7& about_centroid, const Eigen::Vector3d& arm) {
  Matrix7 B = Matrix7::Identity();
  B.block<3, 3>(0, 3) = -skew(arm);
  B.block<3, 1>(0, 6) = arm;
  return congruence(B, about_centroid);
}
inline void clearFixed(Matrix7& covariance, const std::array<bool, 7>& is_free) {
  for (int k = 0; k < 7; ++k) {
    if (is_free[static_cast<std::size_t>(k)]) continue;
    covariance.row(k).setZero(), covariance.col(k).setZero();
  }
}

/// The covariance of a least-squares alignment of positions: M (Σ Kᵀ P K) M, M = (Σ Kᵀ K)⁻¹. NaN where the scale is free.
inline Matrix7 umeyamaCovariance(std::span<const MatchedPose> poses, const Alignment& a) {
  const std::array<bool, 7> is_free = freeParameters(a.model);
  Matrix7 unknown = Matrix7::Constant(not_a_number);
  if (is_free[6]) return unknown;
  const Eigen::Vector3d centre = centroid(poses, a);
  AlignmentSums plain, noise;
  for (const MatchedPose& p : poses) {
    const SE3d moved = a(p.estimate.mean);
    Eigen::Matrix<double, 3, 7> K = Eigen::Matrix<double, 3, 7>::Zero();
    K.leftCols<3>().setIdentity();
    K.middleCols<3>(3) = -skew(Eigen::Vector3d(moved.translation() - centre));
    for (int k = 0; k < 7; ++k) {
      if (!is_free[static_cast<std::size_t>(k)]) K.col(k).setZero();
    }
    const Eigen::Matrix3d R = moved.rotationMatrix(), G = p.reference.mean.rotationMatrix();
    const Eigen::Matrix3d P = R * p.estimate.covariance.topLeftCorner<3, 3>() * R.transpose() +
                              G * p.reference.covariance.topLeftCorner<3, 3>() * G.transpose();
    plain.information += K.transpose() * K;
    noise.information += K.transpose() * P * K;
  }
  plain.finish(is_free);
  const Cholesky<double, 7> root(plain.information);
  if (!root.ok()) return unknown;
  Matrix7 covariance = congruence(root.inverse(), noise.information);
  clearFixed(covariance, is_free);
  return aboutOrigin(covariance, a.transform.translation() - centre);
}

/// Gauss-Newton from the better of two starts: the positions' least squares and the first pose.
inline Alignment weightedAlignment(std::span<const MatchedPose> poses, AlignmentModel model, std::size_t n_to_align) {
  Alignment a;
  a.model = model;
  a.weighted = true;
  if (model == AlignmentModel::none) {
    a.ok = true;
    return a;
  }
  const std::array<bool, 7> is_free = freeParameters(model);
  a.parameters = static_cast<int>(std::count(is_free.begin(), is_free.end(), true));
  a.covariance.setConstant(not_a_number);
  if (a.parameters == 0) {
    a.fault = "a scale alone has no weighted alignment; use sim3";
    return a;
  }
  a.poses = model == AlignmentModel::origin ? 1 : n_to_align == 0 ? poses.size() : std::min(n_to_align, poses.size());
  if (poses.empty() || (model == AlignmentModel::sim3 && a.poses < 2)) {
    a.fault = poses.empty() ? "no poses" : "one pose does not determine a scale";
    return a;
  }
  const std::span<const MatchedPose> used = poses.first(std::min(a.poses, poses.size()));
  a.poses = used.size();

  Alignment start = a;
  const SE3d first = used[0].reference.mean * used[0].estimate.mean.inverse();
  if (model == AlignmentModel::posyaw) {
    const Eigen::Matrix3d R = first.rotationMatrix();
    const SO3d yaw = SO3d::rotZ(std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)));
    start.transform =
        SE3d(yaw, Eigen::Vector3d(used[0].reference.mean.translation() - yaw * used[0].estimate.mean.translation()));
  } else {
    start.transform = first;
  }
  a.transform = start.transform;
  if (used.size() >= 3 && model != AlignmentModel::origin) {
    Alignment positions = alignUmeyama(used, model);
    if (positions.ok && positions.scale > 0) {
      const auto cost = [&](const Alignment& x) { return alignmentSums(used, x, centroid(used, x), is_free).cost; };
      if (cost(positions) < cost(start)) a.transform = positions.transform, a.scale = positions.scale;
    }
  }
  bool converged = false;
  for (; a.iterations < 50 && !converged; ++a.iterations) {
    const Eigen::Vector3d centre = centroid(used, a);
    const AlignmentSums sums = alignmentSums(used, a, centre, is_free);
    if (sums.indefinite > 0) {
      a.fault = "covariances that are not positive definite";
      return a;
    }
    a.condition = scaledCondition(sums.information);
    if (!(a.condition < worst_condition)) {
      a.fault = "the poses do not determine all parameters of the alignment";
      return a;
    }
    const Cholesky<double, 7> root(sums.information);
    Vector7 step = root.solve<1>(sums.gradient);
    step[6] = std::clamp(step[6], -1., 1.);  // a scale far off is approached in factors of e
    converged = step.dot(sums.information * step) < 1e-12;
    const SO3d turn = SO3d::exp(step.segment<3>(3));
    const double growth = std::exp(step[6]);
    const Eigen::Vector3d arm = a.transform.translation() - centre;
    a.transform = SE3d(turn * a.transform.so3(), Eigen::Vector3d(centre + step.head<3>() + growth * (turn * arm)));
    a.scale *= growth;
    if (converged) {
      a.covariance = root.inverse();
      clearFixed(a.covariance, is_free);
      a.covariance = aboutOrigin(a.covariance, a.transform.translation() - centre);
    }
  }
  a.ok = converged && a.transform.params().allFinite();
  if (!a.ok) a.fault = "the iterations did not converge";
  if (a.ok && is_free[6] && !(a.covariance(6, 6) < worst_log_scale_sigma * worst_log_scale_sigma)) {
    a.ok = false;
    a.fault = "the positions of the estimate do not determine the scale";
  }
  return a;
}

/// A sum of squares ξᵀ P ξ of one part of the errors with the exact mean and variance that the alignment leaves, scaled to χ²
/// of the same two moments. `sign`: -1 for errors that were aligned, +1 for others.
inline ResidualTest scaledPart(double sum, double n, const Matrix7& C, const Matrix7& G, int sign) {
  const Matrix7 CG = product(C, G);
  double trace = 0, squared = 0;
  for (int i = 0; i < 7; ++i) {
    trace += CG(i, i);
    for (int k = 0; k < 7; ++k) squared += CG(i, k) * CG(k, i);
  }
  const double mean = 3 * n + sign * trace, half_variance = 3 * n + 2 * sign * trace + squared;
  if (!(mean > 0) || !(half_variance > 1e-9 * mean)) return {};
  const double unit = half_variance / mean;
  return neesTest(sum / unit, mean / unit);
}

inline Consistency consistencyOf(std::span<const MatchedPose> poses, const Alignment& a) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  Consistency r;
  if (!a.ok) {
    r.fault = "no alignment: " + a.fault;
    return r;
  }
  if (!a.weighted && a.model != AlignmentModel::none) {
    r.fault = "NEES after an alignment by least squares does not follow chi2: use the weighted one";
    return r;
  }
  if (poses.size() < a.poses) {
    r.fault = "fewer poses than were aligned";
    return r;
  }
  const std::array<bool, 7> is_free = freeParameters(a.model);
  const std::span<const MatchedPose> used = poses.first(a.poses);
  const Eigen::Vector3d centre = centroid(used, a);
  Matrix7 C = Matrix7::Zero(), prior = Matrix7::Zero();
  if (a.parameters > 0) {
    prior = alignmentSums(used, a, centre, is_free).information;
    const Cholesky<double, 7> root(prior);
    C = root.inverse();
    clearFixed(C, is_free);
  }
  const bool all_aligned = a.poses == poses.size();
  const int sign = all_aligned ? -1 : 1;
  AlignmentSums tested;
  Matrix7 G_position = Matrix7::Zero(), G_rotation = Matrix7::Zero();
  double position = 0, rotation = 0;
  r.errors.reserve(poses.size());
  std::vector<PoseResidual> residuals;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const AlignedError e(poses[i], a, centre, is_free);
    PoseError out;
    out.error = e.error;
    const Cholesky<double, 6> root(e.covariance);
    if (!root.ok()) {
      r.indefinite.push_back(i);
      out.covariance.setConstant(not_a_number), out.nees = out.leverage = not_a_number;
      r.errors.push_back(out);
      continue;
    }
    const Eigen::Matrix<double, 6, 7> JC = product(e.jacobian, C);
    const Matrix6 taken = productTransposed(JC, e.jacobian);
    const bool aligned = i < a.poses;
    out.covariance = aligned ? Matrix6(e.covariance - taken) : Matrix6(e.covariance + taken);
    out.leverage = 0;
    if (aligned && a.parameters > 0) {
      // tr(Σ⁻¹ J C Jᵀ) by the whitened halves of both sides.
      out.leverage = root.halfSolve<7>(e.jacobian).cwiseProduct(root.halfSolve<7>(JC)).sum();
    }
    const Cholesky<double, 6> left(out.covariance);
    // A direction of the pose that the alignment explains entirely leaves nothing to test; rounding decides near it.
    const bool regular = left.ok() && out.leverage < 6 - 1e-6;
    out.nees = regular ? left.halfSolve<1>(e.error).squaredNorm() : not_a_number;
    r.errors.push_back(out);
    if (aligned && !all_aligned) continue;
    residuals.push_back({e.error, regular ? out.covariance : e.covariance});
    tested.add(e);
    for (const int from : {0, 3}) {
      const Cholesky<double, 3> part(Eigen::Matrix3d(e.covariance.block<3, 3>(from, from)));
      const double squared = part.halfSolve<1>(Eigen::Vector3d(e.error.segment<3>(from))).squaredNorm();
      (from == 0 ? position : rotation) += squared;
      const Eigen::Matrix<double, 3, 7> J =
          part.halfSolve<7>(Eigen::Matrix<double, 3, 7>(e.jacobian.middleRows<3>(from)));
      Matrix7& G = from == 0 ? G_position : G_rotation;
      for (int k = 0; k < 7; ++k) {
        for (int l = 0; l < 7; ++l) G(k, l) += J(0, k) * J(0, l) + J(1, k) * J(1, l) + J(2, k) * J(2, l);
      }
    }
  }
  r.n = residuals.size();
  if (!r.indefinite.empty()) {
    r.fault = "covariances that are not positive definite";
    return r;
  }
  if (r.n == 0) {
    r.fault = "no poses beside those that were aligned";
    return r;
  }
  const auto n = static_cast<double>(r.n);
  if (all_aligned) {
    r.joint = neesTest(tested.cost, 6 * n - a.parameters);
  } else if (a.parameters == 0) {
    r.joint = neesTest(tested.cost, 6 * n);
  } else {
    tested.finish(is_free);
    Matrix7 information = prior + tested.information;
    const Vector7 b = tested.gradient;
    r.joint = neesTest(tested.cost - b.dot(Cholesky<double, 7>(information).solve<1>(b)), 6 * n);
  }
  r.position = scaledPart(position, n, C, G_position, sign);
  r.rotation = scaledPart(rotation, n, C, G_rotation, sign);
  r.tests = testWhitenedResiduals(residuals);
  r.tests.joint = r.joint, r.tests.position = r.position, r.tests.rotation = r.rotation;
  r.ok = r.joint.applies();
  if (!r.ok) r.fault = "too few poses for the parameters of the alignment";
  return r;
}

}  // namespace liestat::detail
