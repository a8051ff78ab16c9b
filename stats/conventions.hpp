// Covariances from and to other conventions than the library's.
//
// The library's own: x·Exp(e), e ~ N(0, Σ), coordinates along the axes that x carries, translation before rotation.
// For any group or feature:
//   left             Exp(e)·x: the error is a motion of the world about its origin (Barfoot; GTSAM is right, as here)
//   world axes       rotation R ← Exp(δ)·R, position t ← t + τ, each along the axes of the world
//                    (ROS' PoseWithCovariance)
//   rotation first   GTSAM, Barrau and Bonnabel
//   chart            principalChartCovariance in stats/gaussian.hpp
// A type's tangent order is that of its traits' tangent_parts (lie/concepts.hpp).
//
// For poses, `Convention` states any convention of the field as five independent answers: order, perturbation, unit of
// the rotation, content, layout. Named conventions (ROS, GTSAM, g2o, Ceres …) are in stats/convention_presets.hpp, the
// layouts in stats/convention_layouts.hpp, the exact coordinates in stats/convention_charts.hpp, and what a conversion
// loses in stats/convention_losses.hpp. Derivations: docs/theory/conventions.md.
#pragma once

#include <lie/detail/small_products.hpp>
#include <lie/euler.hpp>
#include <lie/se3.hpp>
#include <lie/units.hpp>
#include <stats/gaussian.hpp>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace liestat {

/// Covariance of the left perturbation of a group, Exp(e)·mean: Adj Σ Adjᵀ; exact, in the library's tangent order.
template <LieGroup G>
SquareOf<G> leftCovariance(const Gaussian<G>& g) {
  const SquareOf<G> J = g.mean.Adj();
  return detail::congruence(J, g.covariance);
}
/// The Gaussian of a mean and the covariance of its left perturbation; inverse of leftCovariance.
template <LieGroup G>
Gaussian<G> fromLeftCovariance(const G& mean, const SquareOf<G>& left_covariance) {
  const SquareOf<G> J = mean.inverse().Adj();
  return {mean, detail::congruence(J, left_covariance)};
}

/// The order of rotation, translation, then the rest. Parts that a type does not have are passed over, so it serves SE2
/// as well as SE23.
inline constexpr std::initializer_list<TangentPart> rotation_first = {TangentPart::rotation,    TangentPart::direction,
                                                                      TangentPart::translation, TangentPart::point,
                                                                      TangentPart::velocity,    TangentPart::log_scale};

namespace detail {

/// How the tangent coordinates at x turn into world axes, part by part: the diagonal blocks of the adjoint matrix of
/// the placement, diag(sR, R, sR, 1) for a similarity with a velocity.
template <HasTangentParts M>
SquareOf<M> worldAxes(const M& x) {
  using T = ManifoldTraits<M>;
  static_assert(T::Group::DoF == T::DoF, "tangent vectors at directions and the like have no axes of their own");
  const SquareOf<M> Adj = T::placement(x).Adj();
  SquareOf<M> J = SquareOf<M>::Zero();
  for (const TangentBlock& b : T::tangent_parts) {
    for (int i = b.begin; i < b.begin + b.size; ++i) {
      for (int j = b.begin; j < b.begin + b.size; ++j) J(i, j) = Adj(i, j);
    }
  }
  return J;
}

}  // namespace detail

/// The permutation P with P·v the tangent vector v of the library's order in another order of its parts, each of which
/// keeps its own coordinates. `order` names every part of M once; parts that M does not have are passed over.
///   tangentPermutation<SE23d>({TangentPart::rotation, TangentPart::velocity, TangentPart::translation})
template <HasTangentParts M>
Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> tangentPermutation(std::initializer_list<TangentPart> order) {
  Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> P;
  P.setIdentity();
  int to = 0;
  for (const TangentPart part : order) {
    for (const TangentBlock& b : ManifoldTraits<M>::tangent_parts) {
      if (b.part != part) continue;
      for (int i = 0; i < b.size; ++i) P.indices()[b.begin + i] = to++;
    }
  }
  eigen_assert(to == ManifoldTraits<M>::DoF);
  return P;
}

/// A covariance of the library's tangent order in another one, and back; see tangentPermutation.
///   covarianceInOrder<SE3d>(g.covariance, rotation_first)
template <HasTangentParts M>
SquareOf<M> covarianceInOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P * covariance * P.transpose();
}
template <HasTangentParts M>
SquareOf<M> covarianceFromOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P.transpose() * covariance * P;
}

/// Covariance along the axes of the world, each part for itself: R ← Exp(δ)·R, t ← t + τ (and the velocity likewise).
/// Exact for rotations and Frame3, first order for the groups of motions. It differs from leftCovariance by the lever
/// arm: there a turn of the world about its origin also moves t.
template <HasTangentParts M>
SquareOf<M> worldAxesCovariance(const Gaussian<M>& g) {
  const SquareOf<M> J = detail::worldAxes(g.mean);
  return detail::congruence(J, g.covariance);
}
/// The Gaussian of a mean and its covariance along the axes of the world; inverse of worldAxesCovariance.
template <HasTangentParts M>
Gaussian<M> fromWorldAxesCovariance(const M& mean, const SquareOf<M>& world_covariance) {
  const SquareOf<M> J = detail::inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(detail::worldAxes(mean));
  return {mean, detail::congruence(J, world_covariance)};
}

// --- Conventions of poses -------------------------------------------------------------------------------------------

/// Order of the six coordinates of an error.
enum class CovarianceOrder { translation_rotation, rotation_translation };

/// The error x = (x_t, x_r) that a covariance belongs to, by how it leads from the estimate (R, p) to the truth. The
/// names of axes say along which axes translation and rotation are measured, each for itself.
/// docs/theory/conventions.md, section 2.
enum class Perturbation {
  right,                ///< T·Exp(x): GTSAM, liestat
  left,                 ///< Exp(x)·T: Barfoot, pytransform3d
  body_axes,            ///< p + R x_t, R Exp(x_r): g2o; Frame3. Differs from `right` in second order only
  world_axes,           ///< p + x_t, Exp(x_r) R: tf2, KDL
  world_body_axes,      ///< p + x_t, R Exp(x_r): OpenVINS
  roll_pitch_yaw,       ///< p + x_t, (roll, pitch, yaw) + x_r of R = Rz Ry Rx: robot_localization, MAVLink, TORO
  yaw_pitch_roll,       ///< the same angles in the order yaw, pitch, roll: MRPT
  rotation_vector,      ///< p + x_t, Log(R) + x_r: OpenCV
  world_axes_reversed,  ///< p + x_t, Exp(-x_r) R: the residual of Ceres' pose_graph_3d
  transposed_axes       ///< R x_t and R x_r are the errors of `right`: a rotation by Rᵀ that should not be there
};
inline constexpr Perturbation all_perturbations[] = {Perturbation::right,
                                                     Perturbation::left,
                                                     Perturbation::body_axes,
                                                     Perturbation::world_axes,
                                                     Perturbation::world_body_axes,
                                                     Perturbation::roll_pitch_yaw,
                                                     Perturbation::yaw_pitch_roll,
                                                     Perturbation::rotation_vector,
                                                     Perturbation::world_axes_reversed,
                                                     Perturbation::transposed_axes};

/// Unit of the rotation's coordinates: `half_angle` is that of a quaternion's vector part, `double_angle` its opposite.
enum class RotationUnit { radian, half_angle, double_angle, degree };

/// The matrix that is given. `sigmas` has the standard deviations σ_i on its diagonal and r_ij √(σ_i σ_j) beside it,
/// with r the correlations.
enum class CovarianceContent { covariance, information, sigmas };

/// The numbers that are given of the 6×6 matrix, and their sequence: stats/convention_layouts.hpp.
enum class CovarianceLayout {
  full36,    ///< row by row
  upper21,   ///< the upper triangle, row by row
  lower21,   ///< the lower triangle, row by row
  blocks12,  ///< the upper triangles of the first and of the second diagonal 3×3 block: 6 + 6, no cross block
  diag6,     ///< the diagonal
  planar6,   ///< the upper triangle of (x, y, yaw), row by row: g2o's EDGE_SE2
  toro6      ///< 11 12 22 33 13 23 of (x, y, yaw): TORO's EDGE2
};

/// The meaning of the numbers of a pose's covariance: five independent answers. The default is the library's own.
struct Convention {
  CovarianceOrder order = CovarianceOrder::translation_rotation;
  Perturbation perturbation = Perturbation::right;
  RotationUnit unit = RotationUnit::radian;
  CovarianceContent content = CovarianceContent::covariance;
  CovarianceLayout layout = CovarianceLayout::full36;
  friend constexpr bool operator==(const Convention&, const Convention&) = default;
};

/// Coordinates of the unit per radian.
constexpr double unitsPerRadian(RotationUnit unit) {
  switch (unit) {
    case RotationUnit::half_angle:
      return 0.5;
    case RotationUnit::double_angle:
      return 2;
    case RotationUnit::degree:
      return 1 / units::degree;
    default:
      return 1;
  }
}

namespace detail {

/// The Jacobian of a perturbation's coordinates, [translation, coupling; 0, rotation], in order translation, rotation.
struct PoseBlocks {
  Eigen::Matrix3d translation, coupling, rotation;
};

/// E⁻¹R and its inverse: rates of roll, pitch, yaw from rates about the body's axes.
inline Eigen::Matrix3d rollPitchYawRates(const SO3d& R) {
  const Eigen::Vector3d a = toRollPitchYaw(R);
  const double sr = std::sin(a[0]), cr = std::cos(a[0]), cp = std::cos(a[1]), tp = std::sin(a[1]) / cp;
  Eigen::Matrix3d J;
  J << 1, sr * tp, cr * tp, 0, cr, -sr, 0, sr / cp, cr / cp;
  return J;
}
inline Eigen::Matrix3d bodyRatesOfRollPitchYaw(const SO3d& R) {
  const Eigen::Vector3d a = toRollPitchYaw(R);
  const double sr = std::sin(a[0]), cr = std::cos(a[0]), sp = std::sin(a[1]), cp = std::cos(a[1]);
  Eigen::Matrix3d J;
  J << 1, 0, -sp, 0, cr, cp * sr, 0, -sr, cp * cr;
  return J;
}

/// x = J ξ of a perturbation, in radians.
inline PoseBlocks perturbationBlocks(Perturbation perturbation, const SE3d& T) {
  using Matrix = Eigen::Matrix3d;
  const Matrix R = T.rotationMatrix();
  PoseBlocks J{R, Matrix::Zero(), R};
  switch (perturbation) {
    case Perturbation::right:
    case Perturbation::body_axes:
      return {Matrix::Identity(), Matrix::Zero(), Matrix::Identity()};
    case Perturbation::left:
      J.coupling = skewTimes(Eigen::Vector3d(T.translation()), R);
      break;
    case Perturbation::world_axes:
      break;
    case Perturbation::world_body_axes:
      J.rotation = Matrix::Identity();
      break;
    case Perturbation::roll_pitch_yaw:
      J.rotation = rollPitchYawRates(T.so3());
      break;
    case Perturbation::yaw_pitch_roll:
      J.rotation = rollPitchYawRates(T.so3()).colwise().reverse();
      break;
    case Perturbation::rotation_vector:
      J.rotation = SO3d::rightJacobianInverse(T.so3().log());
      break;
    case Perturbation::world_axes_reversed:
      J.rotation = -R;
      break;
    case Perturbation::transposed_axes:
      J.translation = J.rotation = T.so3().inverse().matrix();
      break;
  }
  return J;
}
/// ξ = J⁻¹ x, in closed form.
inline PoseBlocks perturbationBlocksInverse(Perturbation perturbation, const SE3d& T) {
  using Matrix = Eigen::Matrix3d;
  // Not R.transpose(): Eigen's check for aliasing makes g++ warn.
  const Matrix R = T.rotationMatrix(), Rt = T.so3().inverse().matrix();
  PoseBlocks J{Rt, Matrix::Zero(), Rt};
  switch (perturbation) {
    case Perturbation::right:
    case Perturbation::body_axes:
      return {Matrix::Identity(), Matrix::Zero(), Matrix::Identity()};
    case Perturbation::left:
      // -Rᵀ [p]
      J.coupling = product(Rt, skew(Eigen::Vector3d(-T.translation())));
      break;
    case Perturbation::world_axes:
      break;
    case Perturbation::world_body_axes:
      J.rotation = Matrix::Identity();
      break;
    case Perturbation::roll_pitch_yaw:
      J.rotation = bodyRatesOfRollPitchYaw(T.so3());
      break;
    case Perturbation::yaw_pitch_roll:
      J.rotation = bodyRatesOfRollPitchYaw(T.so3()).rowwise().reverse();
      break;
    case Perturbation::rotation_vector:
      J.rotation = SO3d::rightJacobian(T.so3().log());
      break;
    case Perturbation::world_axes_reversed:
      J.rotation = -Rt;
      break;
    case Perturbation::transposed_axes:
      J.translation = J.rotation = R;
      break;
  }
  return J;
}

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A C Aᵀ where entries of C may be unknown (NaN): an entry of the result is unknown exactly if it depends on one, by
/// factors that are not zero. Symmetric to the last bit.
inline Matrix6d congruenceOfKnown(const Matrix6d& A, const Matrix6d& C) {
  Matrix6d half = Matrix6d::Zero(), result = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      if (A(i, k) == 0) continue;
      for (int j = 0; j < 6; ++j) half(i, j) += A(i, k) * C(k, j);
    }
  }
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      for (int k = 0; k < 6; ++k) {
        if (A(j, k) != 0) result(i, j) += half(i, k) * A(j, k);
      }
      result(j, i) = result(i, j);
    }
  }
  return result;
}

/// The inverse of a positive definite matrix in which whole coordinates may be absent (NaN on the diagonal): that of the
/// coordinates that are there. NaN if another entry is unknown, or the matrix is not positive definite.
inline Matrix6d inverseOfKnown(const Matrix6d& C) {
  Matrix6d padded = C;
  for (int i = 0; i < 6; ++i) {
    if (!std::isnan(C(i, i))) continue;
    padded.row(i).setZero();
    padded.col(i).setZero();
    padded(i, i) = 1;
  }
  Matrix6d X = Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (!padded.allFinite()) return X;
  const Matrix6d inverted = Cholesky<double, 6>(padded).inverse();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      if (!std::isnan(C(i, i)) && !std::isnan(C(j, j))) X(i, j) = inverted(i, j);
    }
  }
  return X;
}

}  // namespace detail

/// The Jacobian J at the pose T_hat of a convention's error coordinates, x = J ξ to first order, with ξ the error of the
/// library (T = T_hat·Exp(ξ), translation first): a covariance of the convention is J Σ Jᵀ. Order, perturbation and unit
/// of the convention decide; content and layout do not matter. Infinite at pitch ±90° for Euler angles.
/// docs/theory/conventions.md, section 2.
inline Eigen::Matrix<double, 6, 6> conventionJacobian(const Convention& convention, const SE3d& T_hat) {
  const detail::PoseBlocks b = detail::perturbationBlocks(convention.perturbation, T_hat);
  const double unit = unitsPerRadian(convention.unit);
  const int t = convention.order == CovarianceOrder::translation_rotation ? 0 : 3, r = 3 - t;
  detail::Matrix6d J = detail::Matrix6d::Zero();
  J.block<3, 3>(t, 0) = b.translation;
  J.block<3, 3>(t, 3) = b.coupling;
  J.block<3, 3>(r, 3) = unit * b.rotation;
  return J;
}
/// The inverse of conventionJacobian, ξ = J⁻¹ x, in closed form.
inline Eigen::Matrix<double, 6, 6> conventionJacobianInverse(const Convention& convention, const SE3d& T_hat) {
  const detail::PoseBlocks b = detail::perturbationBlocksInverse(convention.perturbation, T_hat);
  const double unit = 1 / unitsPerRadian(convention.unit);
  const int t = convention.order == CovarianceOrder::translation_rotation ? 0 : 3, r = 3 - t;
  detail::Matrix6d J = detail::Matrix6d::Zero();
  J.block<3, 3>(0, t) = b.translation;
  J.block<3, 3>(0, r) = unit * b.coupling;
  J.block<3, 3>(3, r) = unit * b.rotation;
  return J;
}

/// log |det J| of conventionJacobian: what a density in the convention's coordinates lacks to one in the library's.
/// Zero but for units, Euler angles (-log cos pitch) and rotation vectors.
inline double conventionLogDeterminant(const Convention& convention, const SE3d& T_hat) {
  double value = 3 * std::log(unitsPerRadian(convention.unit));
  if (convention.perturbation == Perturbation::roll_pitch_yaw ||
      convention.perturbation == Perturbation::yaw_pitch_roll) {
    value -= std::log(std::cos(toRollPitchYaw(T_hat.so3())[1]));
  } else if (convention.perturbation == Perturbation::rotation_vector) {
    value -= detail::So3Math<double>::logVolume(T_hat.so3().log()).value;
  }
  return value;
}

/// A covariance as the content of a convention, and back: its information matrix, or its matrix of sigmas. Unknown
/// entries are NaN; coordinates whose variance is unknown count as absent, and an information matrix is that of the
/// others. NaN if a matrix has no inverse; see CovarianceContent.
inline Eigen::Matrix<double, 6, 6> covarianceAsContent(CovarianceContent content,
                                                       const Eigen::Matrix<double, 6, 6>& covariance) {
  if (content == CovarianceContent::information) return detail::inverseOfKnown(covariance);
  if (content == CovarianceContent::covariance) return covariance;
  detail::Matrix6d M;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double c = covariance(i, j), sigmas = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      M(i, j) = c == 0 ? 0 : c / std::sqrt(sigmas);
    }
  }
  return M;
}
inline Eigen::Matrix<double, 6, 6> covarianceFromContent(CovarianceContent content,
                                                         const Eigen::Matrix<double, 6, 6>& matrix) {
  if (content == CovarianceContent::information) return detail::inverseOfKnown(matrix);
  if (content == CovarianceContent::covariance) return matrix;
  detail::Matrix6d C;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      C(i, j) = i == j ? matrix(i, i) * matrix(i, i) : matrix(i, j) * std::sqrt(matrix(i, i) * matrix(j, j));
    }
  }
  return C;
}

/// The matrix of a convention (its order, perturbation, unit and content; the layout is packCovariance's business) of a
/// pose with its covariance; first order. T_hat is the pose as it is written beside the matrix: re-frame or align
/// afterwards. Entries that depend on unknown ones (NaN) are unknown.
inline Eigen::Matrix<double, 6, 6> toConvention(const Convention& convention, const Gaussian<SE3d>& g) {
  return covarianceAsContent(convention.content,
                             detail::congruenceOfKnown(conventionJacobian(convention, g.mean), g.covariance));
}
/// The Gaussian of a pose and its matrix in a convention; inverse of toConvention. Entries that the matrix does not
/// determine, and those of an information matrix that is not positive definite, are NaN.
inline Gaussian<SE3d> fromConvention(const Convention& convention, const SE3d& T_hat,
                                     const Eigen::Matrix<double, 6, 6>& matrix) {
  return {T_hat, detail::congruenceOfKnown(conventionJacobianInverse(convention, T_hat),
                                           covarianceFromContent(convention.content, matrix))};
}

/// The matrix of one convention in another, at the pose as it is written beside it. With the same content there is no
/// inversion, so that singular matrices pass, and with the same coordinates every digit stays.
inline Eigen::Matrix<double, 6, 6> convertConvention(const Convention& from, const Convention& to, const SE3d& T_hat,
                                                     const Eigen::Matrix<double, 6, 6>& matrix) {
  if (from.content == to.content && from.order == to.order && from.perturbation == to.perturbation &&
      from.unit == to.unit) {
    return matrix;
  }
  if (from.content != to.content || from.content == CovarianceContent::sigmas) {
    return toConvention(to, fromConvention(from, T_hat, matrix));
  }
  const bool information = from.content == CovarianceContent::information;
  const Convention& a = information ? to : from;
  const Convention& b = information ? from : to;
  const detail::Matrix6d J = detail::product(conventionJacobian(b, T_hat), conventionJacobianInverse(a, T_hat));
  return detail::congruenceOfKnown(information ? detail::Matrix6d(J.transpose()) : J, matrix);
}

}  // namespace liestat
