// Essential: the relative pose of two calibrated views, as far as they show it: a rotation and the direction of the
// translation. For a_T_b = (R, t), which takes coordinates in b to coordinates in a, it is (R, t/|t|), its matrix is
// E = [t/|t|] R, and bearing vectors x_a, x_b to one point obey x_aᵀ E x_b = 0.
//
// Storage        qx qy qz qw dx dy dz, the direction of unit norm: an SE3 whose translation has norm one
// Tangent        (direction rad, rotation rad), 2 + 3 coordinates, along axes in a of which the third is the direction
//                d: exp(x, v) = (Exp(A v_r) R, A·exp(v_d)), A the rotation of least angle from (0, 0, 1) to d. In the
//                body of b that is R·Exp(Rᵀ A v_r).
// Action         of SO3 × SO3, which turns both views: (f_a, f_b)⋆(R, d) = (f_a R f_b⁻¹, f_a d); E becomes f_a E f_bᵀ
// Origin         no rotation, direction (0, 0, 1)
// Placement      (A, Rᵀ A): smooth but at the direction (0, 0, -1). What leaves the origin is the turn about d.
// Metric         d² = angle of the directions² + angle of the rotations², invariant; sectional curvature at most 1,
//                injectivity radius pi
// Symmetries     E and -E, and the rotation R turned by pi about d, make the same epipolar constraint: four points of
//                this manifold, in the same order as decomposeEssential. Cheirality tells which.
// Bad input      NaN in, NaN out; constructors normalise, a zero translation gives NaN
#pragma once

#include <lie/detail/essential_matrix.hpp>
#include <lie/product.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>

#include <array>
#include <cstddef>
#include <iterator>
#include <tuple>
#include <vector>

namespace liestat {
namespace detail {

/// Parameters of the relative pose.
template <class S>
struct EssentialMath {
  static constexpr int DoF = 5, num_parameters = 7;
  using Params = Eigen::Matrix<S, 7, 1>;
  static Params identity() { return Se3Math<S>::join(So3Math<S>::identity(), S2Math<S>::identity()); }
};

}  // namespace detail

/// x_aᵀ E x_b and its derivatives, exact: by the tangent of the relative pose, and by the two bearing vectors.
template <class S>
struct EpipolarResidual {
  S value;
  Eigen::Matrix<S, 1, 5> by_pose;
  Eigen::Matrix<S, 1, 3> by_a, by_b;
};

/// Interface of Essential over owned or viewed memory.
template <class Derived>
class EssentialBase : public detail::Shell<Derived> {
 public:
  using detail::Shell<Derived>::data;
  using Scalar = typename detail::Shell<Derived>::Scalar;
  using Vector3 = Eigen::Matrix<Scalar, 3, 1>;
  using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

  /// The rotation R of a_T_b, viewed in place.
  Eigen::Map<const SO3<Scalar>> so3() const { return Eigen::Map<const SO3<Scalar>>(data()); }
  detail::PartView<Derived, SO3<Scalar>> so3() { return detail::PartView<Derived, SO3<Scalar>>(data()); }
  /// The direction d of the translation, in a, viewed in place.
  Eigen::Map<const S2<Scalar>> direction() const { return Eigen::Map<const S2<Scalar>>(data() + 4); }
  detail::PartView<Derived, S2<Scalar>> direction() { return detail::PartView<Derived, S2<Scalar>>(data() + 4); }

  /// a_T_b with a translation of the given length (m).
  SE3<Scalar> se3(const Scalar& scale) const {
    return SE3<Scalar>(SO3<Scalar>(so3()), Vector3(scale * direction().unit_vector()));
  }
  /// E = [d] R; singular values 1, 1, 0.
  Matrix3 essentialMatrix() const { return detail::skew(direction().unit_vector()) * so3().matrix(); }
  /// Derivative of E's entries, column after column, by the tangent; exact.
  Eigen::Matrix<Scalar, 9, 5> essentialMatrixJacobian() const {
    const Matrix3 A = frame(), R = so3().matrix(), D = detail::skew(direction().unit_vector());
    Eigen::Matrix<Scalar, 9, 5> J;
    for (int k = 0; k < 3; ++k) {
      // Column k is d × r; d moves by A v_d, r by A v_r × r.
      const Matrix3 turned = detail::skew(R.col(k)) * A;
      J.template block<3, 2>(3 * k, 0) = -turned.template leftCols<2>();
      J.template block<3, 3>(3 * k, 2) = -D * turned;
    }
    return J;
  }
  /// x_aᵀ E x_b of two bearing vectors, of any lengths, with its derivatives.
  EpipolarResidual<Scalar> epipolarResidual(const Vector3& x_a, const Vector3& x_b) const {
    const Matrix3 A = frame(), R = so3().matrix();
    const Vector3 d = direction().unit_vector(), y = R * x_b, n = d.cross(y), m = x_a.cross(d);
    EpipolarResidual<Scalar> r;
    r.value = x_a.dot(n);
    // d moves by A v_d: v_dᵀ Aᵀ (y × x_a); y by A v_r × y: v_rᵀ Aᵀ (y × m).
    r.by_pose.template head<2>() = y.cross(x_a).transpose() * A.template leftCols<2>();
    r.by_pose.template tail<3>() = y.cross(m).transpose() * A;
    r.by_a = n.transpose();
    r.by_b = m.transpose() * R;
    return r;
  }

 private:
  /// The axes of the tangent, in a.
  Matrix3 frame() const { return ManifoldTraits<S2<Scalar>>::placement(direction()).matrix(); }
};

template <class Scalar_, int Options_ = 0>
class Essential;

using Essentiald = Essential<double>;
using Essentialf = Essential<float>;

}  // namespace liestat

LIESTAT_TRAITS(Essential, liestat::detail::EssentialMath)

namespace liestat {

/// The relative pose of two views up to scale; see the header comment.
template <class Scalar_, int Options_>
class Essential : public EssentialBase<Essential<Scalar_, Options_>> {
  LIESTAT_OWNER(Essential, EssentialBase);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;

  template <class R, class D>
  Essential(const SO3Base<R>& rotation, const S2Base<D>& direction)
      : storage_(detail::Se3Math<Scalar_>::join(rotation.params(), direction.params())) {}
  /// From a rotation and a translation of any positive length.
  template <class R>
  Essential(const SO3Base<R>& rotation, const Vector3& translation) : Essential(rotation, S2<Scalar_>(translation)) {}
  /// From a_T_b, whose translation is normalised.
  template <class D>
  explicit Essential(const SE3Base<D>& a_T_b) : Essential(a_T_b.so3(), Vector3(a_T_b.translation())) {}
};

/// Relative poses up to scale under the product metric and SO(3) × SO(3).
template <class S, int O>
struct ManifoldTraits<Essential<S, O>> {
  using M = Essential<S, O>;
  using Sphere = ManifoldTraits<S2<S>>;
  using Rotation = detail::So3Math<S>;
  using Group = ProductGroup<SO3<S>, SO3<S>>;
  using Scalar = S;
  static constexpr int DoF = 5;
  using Tangent = Eigen::Matrix<S, 5, 1>;
  using Square = Eigen::Matrix<S, 5, 5>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static M origin() { return M(); }
  static M act(const Group& f, const M& x) {
    return M(f.template get<0>() * x.so3() * f.template get<1>().inverse(),
             Sphere::act(f.template get<0>(), x.direction()));
  }
  static Group placement(const M& x) {
    const SO3<S> A = Sphere::placement(x.direction());
    return Group(A, x.so3().inverse() * A);
  }
  static M expOrigin(const Tangent& v) {
    return M(SO3<S>::exp(v.template tail<3>()), Sphere::expOrigin(v.template head<2>()));
  }
  /// Direction (pi, 0) at the antipode.
  static Tangent logOrigin(const M& x) {
    Tangent v;
    v << Sphere::logOrigin(x.direction()), x.so3().log();
    return v;
  }
  static Square diagonal(const Matrix2& direction, const Matrix3& rotation) {
    Square m = Square::Zero();
    m.template topLeftCorner<2, 2>() = direction;
    m.template bottomRightCorner<3, 3>() = rotation;
    return m;
  }
  static Square dexpOrigin(const Tangent& v) {
    const Eigen::Matrix<S, 2, 1> d = v.template head<2>();
    return diagonal(Sphere::dexpOrigin(d), Sphere::placement(Sphere::expOrigin(d)).matrix().transpose() *
                                               Rotation::leftJacobian(v.template tail<3>()));
  }
  static Square dlogOrigin(const M& x) {
    return diagonal(Sphere::dlogOrigin(x.direction()),
                    Rotation::leftJacobianInverse(x.so3().log()) * Sphere::placement(x.direction()).matrix());
  }
  /// The turn about the direction that f makes beyond carrying the axes from x to f x.
  static Square isotropy(const Group& f, const M& x) {
    const S2<S> d = x.direction();
    const SO3<S>& f_a = f.template get<0>();
    const SO3<S> h = Sphere::placement(Sphere::act(f_a, d)).inverse() * f_a * Sphere::placement(d);
    const Matrix3 turn = h.matrix();
    return diagonal(turn.template topLeftCorner<2, 2>(), turn);
  }
  /// Exp(a, b) turns the direction by a, and the rotation by a - b.
  static Eigen::Matrix<S, 5, 6> originProjection() {
    Eigen::Matrix<S, 5, 6> m;
    m << Sphere::originProjection(), Eigen::Matrix<S, 2, 3>::Zero(), Matrix3::Identity(), -Matrix3::Identity();
    return m;
  }
  static Eigen::Matrix<S, 6, 5> placementJacobian(const M& x) {
    const Eigen::Matrix<S, 3, 2> turn = Sphere::placementJacobian(x.direction());
    Eigen::Matrix<S, 6, 5> m;
    m << turn, Matrix3::Zero(), turn, -Matrix3::Identity();
    return m;
  }
  /// Everywhere but at the direction opposite to the origin's.
  static bool isPlacementSmooth(const M& x) { return Sphere::isPlacementSmooth(x.direction()); }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(1); }
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    return diagonal(Sphere::hessianHalfSquaredDistance(z.template head<2>()),
                    ManifoldTraits<SO3<S>>::hessianHalfSquaredDistance(z.template tail<3>()));
  }
  static detail::VolumeElement<S, 5> logVolume(const Tangent& z) {
    const detail::VolumeElement<S, 2> direction = Sphere::logVolume(z.template head<2>());
    const detail::VolumeElement<S, 3> rotation = Rotation::logVolume(z.template tail<3>());
    detail::VolumeElement<S, 5> v;
    v.value = direction.value + rotation.value;
    v.gradient << direction.gradient, rotation.gradient;
    v.hessian = diagonal(direction.hessian, rotation.hessian);
    return v;
  }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::direction, 0, 2}, {TangentPart::rotation, 2, 3}};
  /// Direction and rotation, of which the squared distance is the sum.
  static std::tuple<S2<S>, SO3<S>> factors(const M& x) { return {x.direction(), x.so3()}; }
  static M fromFactors(const std::tuple<S2<S>, SO3<S>>& f) { return M(std::get<1>(f), std::get<0>(f)); }
};

/// The four relative poses that an essential matrix may mean: the first two have the matrix E up to its norm, the last
/// two -E; the second of each pair is the twisted one, its rotation turned by pi about the direction, seen the other
/// way. E of any positive norm; of a matrix that is not quite essential, the nearest rotations. Zero or NaN gives NaN.
template <class S>
std::array<Essential<S>, 4> decomposeEssential(const Eigen::Matrix<S, 3, 3>& E) {
  const detail::EssentialParts<S> parts = detail::essentialParts(E);
  const SO3<S> R = SO3<S>::fitToSO3(parts.rotation), twisted = SO3<S>::fitToSO3(parts.twisted);
  const S2<S> d(parts.direction), opposite(Eigen::Matrix<S, 3, 1>(-parts.direction));
  return {Essential<S>(R, d), Essential<S>(twisted, opposite), Essential<S>(twisted, d), Essential<S>(R, opposite)};
}

/// Which of several relative poses puts most of the points seen in front of both views.
struct Cheirality {
  std::size_t best = 0;             ///< index of the pose with the most points; the first of equals
  std::vector<std::size_t> counts;  ///< points in front of both views, for each pose
};
/// a[i] and b[i] are bearing vectors of one point; points whose rays are parallel count for no pose.
template <class Poses, class Bearings>
Cheirality chooseByCheirality(const Poses& poses, const Bearings& a, const Bearings& b) {
  eigen_assert(std::size(a) == std::size(b));
  Cheirality result;
  for (const auto& pose : poses) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < std::size(a); ++i) count += detail::isInFront(pose, a[i], b[i]) ? 1U : 0U;
    result.counts.push_back(count);
    if (count > result.counts[result.best]) result.best = result.counts.size() - 1;
  }
  return result;
}

}  // namespace liestat

LIESTAT_MAPS(Essential, liestat::EssentialBase)
