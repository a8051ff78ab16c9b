// The alignment of a trajectory that its covariances weight, and what it leaves of the errors;
// docs/theory/trajectories.md, sections 2 and 3.
//
// Parameters are taken about the centroid c of the aligned positions, t ← c + δt + exp(δσ) Exp(δφ)(t - c): about a far
// origin translation and rotation could not be told apart in double precision.
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

/// The error of one aligned pose in the estimate's units and along the body's axes, its covariance before alignment,
/// and its derivative by the parameters, ξ(δ) = ξ - J δ. The translation is divided by the scale, so that the
/// covariance does not depend on it: with weights that follow the scale its estimate would be biased.
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

  /// The reduction to the judged components, along their axes.
  AlignedError reduced(const NoiseComponents& components, const SO3d& rotation) const {
    AlignedError r = *this;
    if (!components.omits()) return r;
    if (components.in_world) {
      const Eigen::Matrix<double, 6, 6> B = inWorld(rotation);
      r.error = B * error, r.covariance = congruence(B, covariance), r.jacobian = product(B, jacobian);
    }
    components.reduce(r.error, r.covariance);
    for (int k = 0; k < 6; ++k) {
      if (!components.keeps(k)) r.jacobian.row(k).setZero();
    }
    return r;
  }
  /// From the body's axes to those of its world.
  static Eigen::Matrix<double, 6, 6> inWorld(const SO3d& rotation) {
    Eigen::Matrix<double, 6, 6> B = Eigen::Matrix<double, 6, 6>::Zero();
    B.topLeftCorner<3, 3>() = B.bottomRightCorner<3, 3>() = rotation.matrix();
    return B;
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
inline Eigen::Vector3d centroid(MatchedRange poses, const Alignment& a) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < poses.size(); ++i) sum += a(poses.estimate(i)).translation();
  return poses.empty() ? sum : Eigen::Vector3d(sum / static_cast<double>(poses.size()));
}

inline AlignmentSums alignmentSums(MatchedRange poses, const Alignment& a, const Eigen::Vector3d& centre,
                                   const std::array<bool, 7>& is_free) {
  AlignmentSums sums;
  for (const MatchedPose& p : poses) {
    sums.add(AlignedError(p, a, centre, is_free).reduced(a.components, p.estimate.mean.so3()));
  }
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

/// The covariance of (δt, δφ, δσ) about the centroid, as one of the parameters of an Alignment: δt there is the motion
/// of t.
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

/// The covariance of a least-squares alignment of positions: M (Σ Kᵀ P K) M, M = (Σ Kᵀ K)⁻¹. NaN where the scale is
/// free.
inline Matrix7 umeyamaCovariance(MatchedRange poses, const Alignment& a) {
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

/// Gauss-Newton in the directions that the judged components determine, from the better of two starts: the positions'
/// least squares and the alignment that is given.
inline void refine(MatchedRange used, Alignment& a) {
  const std::array<bool, 7> is_free = freeParameters(a.model);
  const int fixed = static_cast<int>(std::count(is_free.begin(), is_free.end(), false));
  a.ok = false, a.iterations = 0;
  bool converged = false;
  for (; a.iterations < 50 && !converged; ++a.iterations) {
    const Eigen::Vector3d centre = centroid(used, a);
    AlignmentSums sums = alignmentSums(used, a, centre, is_free);
    if (sums.indefinite > 0) {
      a.fault = "covariances that are not positive definite";
      return;
    }
    a.condition = scaledCondition(sums.information);
    // A planar robot's height of the world stays as it is where heights are not judged: nothing determines it.
    const double least = leastDetermined(a.components);
    const bool whole = a.condition < (a.components.omits() ? 1 / least : worst_condition);
    if (!whole && !a.components.omits()) {
      a.fault = "the poses do not determine all parameters of the alignment";
      return;
    }
    const DeterminedInverse determined(sums.information, least);
    const Matrix7 inverse = whole ? Cholesky<double, 7>(sums.information).inverse() : determined.inverse;
    a.parameters = (whole ? 7 : determined.rank) - fixed;
    Vector7 step = inverse * sums.gradient;
    step[6] = std::clamp(step[6], -1., 1.);  // a scale far off is approached in factors of e
    converged = step.dot(sums.information * step) < 1e-12;
    const SO3d turn = SO3d::exp(step.segment<3>(3));
    const double growth = std::exp(step[6]);
    const Eigen::Vector3d arm = a.transform.translation() - centre;
    a.transform = SE3d(turn * a.transform.so3(), Eigen::Vector3d(centre + step.head<3>() + growth * (turn * arm)));
    a.scale *= growth;
    if (converged) {
      a.covariance = inverse;
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
}

/// The components that carry noise, by the errors under an alignment that has no errors in the others: along the axes
/// of the body or, where more are left out so (matrices of ROS), along those of the world.
inline NoiseComponents noiseComponents(MatchedRange poses, const Alignment& a) {
  NoiseComponentScan in_body, in_world;
  for (const MatchedPose& p : poses) {
    const SE3d moved = a(p.estimate.mean);
    const Eigen::Matrix<double, 6, 1> error = (moved.inverse() * p.reference.mean).log();
    const double length = moved.translation().norm() + p.estimate.mean.translation().norm();
    in_body.add(error, p.estimate.covariance, length);
    const Eigen::Matrix<double, 6, 6> B = AlignedError::inWorld(p.estimate.mean.so3());
    in_world.add(B * error, congruence(B, p.estimate.covariance), length);
  }
  NoiseComponents body = in_body.components(), world = in_world.components();
  world.in_world = true;
  // Products with unknown entries are unknown: such matrices have their axes only.
  bool known = true;
  for (const MatchedPose& p : poses) known = known && p.estimate.covariance.allFinite();
  return known && world.count() < body.count() ? world : body;
}

/// The components found before an alignment, with fillers that the errors after it exceed.
inline NoiseComponents withExceededFillers(MatchedRange used, const Alignment& a, const NoiseComponents& found) {
  const auto is_filler = [](ComponentRole role) { return role == ComponentRole::filler; };
  if (std::none_of(found.roles.begin(), found.roles.end(), is_filler)) return found;
  const Eigen::Vector3d centre = centroid(used, a);
  NoiseComponentScan scan;
  for (const MatchedPose& p : used) {
    AlignedError e(p, a, centre, freeParameters(a.model));
    if (found.in_world) {
      const Eigen::Matrix<double, 6, 6> B = AlignedError::inWorld(p.estimate.mean.so3());
      e.error = B * e.error, e.covariance = congruence(B, e.covariance);
    }
    scan.add(e.error, e.covariance);
  }
  return scan.withExceededFillers(found);
}

/// `given`: components that are judged whatever the covariances are.
inline Alignment weightedAlignment(MatchedRange poses, AlignmentModel model, std::size_t n_to_align,
                                   const NoiseComponents* given = nullptr) {
  Alignment a;
  a.model = model;
  a.weighted = true;
  const std::array<bool, 7> is_free = freeParameters(model);
  a.parameters = static_cast<int>(std::count(is_free.begin(), is_free.end(), true));
  if (a.parameters == 0 && model != AlignmentModel::none) {
    a.covariance.setConstant(not_a_number);
    a.fault = "a scale alone has no weighted alignment; use sim3";
    return a;
  }
  if (model == AlignmentModel::none) {
    a.components = withExceededFillers(poses, a, noiseComponents(poses, a));
    a.ok = true;
    return a;
  }
  a.covariance.setConstant(not_a_number);
  a.poses = model == AlignmentModel::origin ? 1 : n_to_align == 0 ? poses.size() : std::min(n_to_align, poses.size());
  if (poses.empty() || (model == AlignmentModel::sim3 && a.poses < 2)) {
    a.fault = poses.empty() ? "no poses" : "one pose does not determine a scale";
    return a;
  }
  const MatchedRange used = poses.first(a.poses);
  const SE3d first = used.reference(0) * used.estimate(0).inverse();
  a.transform = first;
  if (model == AlignmentModel::posyaw) {
    const Eigen::Matrix3d R = first.rotationMatrix();
    const SO3d yaw = SO3d::rotZ(std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)));
    a.transform = SE3d(yaw, Eigen::Vector3d(used.reference(0).translation() - yaw * used.estimate(0).translation()));
  }
  const NoiseComponents found = given != nullptr ? *given : noiseComponents(poses, a);
  a.components = found;
  for (ComponentRole& role : a.components.roles) {
    if (role == ComponentRole::filler) role = ComponentRole::judged;
  }
  if (used.size() >= 3 && model != AlignmentModel::origin) {
    Alignment positions = alignUmeyama(used, model);
    if (positions.ok && positions.scale > 0) {
      Alignment other = a;
      other.transform = positions.transform, other.scale = positions.scale;
      const auto cost = [&](const Alignment& x) { return alignmentSums(used, x, centroid(used, x), is_free).cost; };
      if (cost(other) < cost(a)) a = other;
    }
  }
  refine(used, a);
  if (a.ok && found.roles != a.components.roles) {
    const NoiseComponents judged = withExceededFillers(used, a, found);
    const bool fewer = judged.roles != a.components.roles;
    a.components = judged;
    if (fewer) refine(used, a);
  }
  return a;
}

inline Consistency consistencyOf(MatchedRange poses, const Alignment& a) {
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
  const MatchedRange used = poses.first(a.poses);
  const Eigen::Vector3d centre = centroid(used, a);
  const bool sharing = a.parameters > 0, all_aligned = a.poses == poses.size();
  Matrix7 C = Matrix7::Zero(), information = Matrix7::Zero();
  if (sharing) {
    information = alignmentSums(used, a, centre, is_free).information;
    for (int k = 0; k < 7; ++k) {
      if (!is_free[static_cast<std::size_t>(k)]) information(k, k) = 0;
    }
    C = DeterminedInverse(information, leastDetermined(a.components)).inverse;
  }
  SharedParameters shared;
  if (sharing && !all_aligned) shared.prior = information;
  r.tests.components = a.components;
  r.errors.reserve(poses.size());
  std::vector<PoseResidual> residuals;
  AlignmentSums seen;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const AlignedError whole(poses[i], a, centre, is_free);
    const AlignedError e = whole.reduced(a.components, poses.estimate(i).so3());
    const bool aligned = i < a.poses;
    const double sign = aligned ? -1 : 1;
    PoseError out;
    out.error = whole.error;
    out.covariance = whole.covariance + sign * productTransposed(product(whole.jacobian, C), whole.jacobian);
    const Cholesky<double, 6> root(e.covariance);
    if (!root.ok()) {
      r.indefinite.push_back(i);
      out.covariance.setConstant(not_a_number), out.nees = out.leverage = not_a_number;
      r.errors.push_back(out);
      continue;
    }
    const Eigen::Matrix<double, 6, 7> JC = product(e.jacobian, C);
    const Cholesky<double, 6> left(Matrix6(e.covariance + sign * productTransposed(JC, e.jacobian)));
    // tr(Σ⁻¹ J C Jᵀ) by the whitened halves of both sides.
    out.leverage = aligned ? root.halfSolve<7>(e.jacobian).cwiseProduct(root.halfSolve<7>(JC)).sum() : 0;
    // A direction of the pose that the alignment explains entirely leaves nothing to test; rounding decides near it.
    const bool regular = left.ok() && out.leverage < a.components.count() - 1e-6;
    out.nees = regular ? left.halfSolve<1>(e.error).squaredNorm() : not_a_number;
    r.errors.push_back(out);
    if (aligned && !all_aligned) continue;
    residuals.push_back({e.error, e.covariance});
    if (sharing) shared.jacobians.push_back(e.jacobian), seen.add(e);
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
  if (shared.prior && a.components.omits()) {
    seen.finish(freeParameters(AlignmentModel::sim3));
    const double least = leastDetermined(a.components);
    if (DeterminedInverse(information + seen.information, least).rank > DeterminedInverse(information, least).rank) {
      r.fault = "the aligned poses do not determine the alignment by the components that are judged";
      return r;
    }
  }
  r.tests = testWhitenedResiduals(residuals, a.components, shared);
  r.joint = r.tests.joint, r.position = r.tests.position, r.rotation = r.tests.rotation;
  r.ok = r.joint.applies();
  if (!r.ok) r.fault = "too few poses for the parameters of the alignment";
  return r;
}

}  // namespace liestat::detail
