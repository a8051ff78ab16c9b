// The interface that every group shares, over the stateless mathematics of its own header. Names are Sophus'.
#pragma once

#include <lie/detail/shell.hpp>
#include <lie/detail/uniform.hpp>

#include <cstddef>
#include <ostream>
#include <type_traits>
#include <vector>

namespace liestat::detail {

/// The scalar that Eigen gives an operation between two scalars: double and Jet give Jet.
template <class A, class B>
using CommonScalar = typename Eigen::ScalarBinaryOpTraits<A, B>::ReturnType;

/// Two types, owned or viewed, of one group, with scalars that go together.
template <class A, class B>
concept SameGroup =
    std::is_same_v<typename ShellTraits<A>::template Rebind<float>, typename ShellTraits<B>::template Rebind<float>>;

/// The vector in another scalar type: a copy, or itself if it is of that type.
template <class S, class D>
inline decltype(auto) promoted(const Eigen::MatrixBase<D>& v) {
  if constexpr (std::is_same_v<S, typename D::Scalar>) {
    return (v.derived());
  } else {
    return v.template cast<S>().eval();
  }
}

/// Members of every group G with tangent dimension DoF. Tangent order: translation first, then rotation, then
/// logarithm of the scale. Perturbations are on the right: x·Exp(v).
template <class Derived>
class GroupBase : public Shell<Derived> {
  using Base = Shell<Derived>;
  template <class S>
  using Rebind = typename ShellTraits<Derived>::template Rebind<S>;
  template <class S>
  using MathOf = typename ShellTraits<Rebind<S>>::Math;

 public:
  using Base::DoF, Base::num_parameters, Base::params;
  using typename Base::Math, typename Base::Params, typename Base::Plain, typename Base::Scalar, typename Base::Tangent;
  using Adjoint = Eigen::Matrix<Scalar, DoF, DoF>;
  /// Homogeneous or rotation matrix, and the matrix of hat.
  using Transformation = typename Math::MatrixType;
  static constexpr int N = Math::N;      ///< rows of matrix()
  static constexpr int Dim = Math::Dim;  ///< dimension of the points that the group acts on
  using Point = Eigen::Matrix<Scalar, Dim, 1>;
  using HomogeneousPoint = Eigen::Matrix<Scalar, Dim + 1, 1>;
  using Line = Eigen::ParametrizedLine<Scalar, Dim>;
  using Hyperplane = Eigen::Hyperplane<Scalar, Dim>;

  // Types of results under Sophus' names; Other is a group's element or an Eigen vector.
  template <class Other>
  using ReturnScalar = CommonScalar<Scalar, typename Other::Scalar>;
  template <class Other>
  using GroupProduct = Rebind<ReturnScalar<Other>>;  ///< SO3Product, SE3Product … of the groups
  template <class Other>
  using PointProduct = Eigen::Matrix<ReturnScalar<Other>, Dim, 1>;
  template <class Other>
  using HomogeneousPointProduct = Eigen::Matrix<ReturnScalar<Other>, Dim + 1, 1>;

  /// Group product, also between scalars that Eigen lets meet (double and Jet). No square root is taken: call
  /// normalize() after long chains of products in double.
  template <class Other>
    requires SameGroup<Derived, Other>
  auto operator*(const GroupBase<Other>& other) const {
    using S = CommonScalar<Scalar, typename ShellTraits<Other>::Scalar>;
    return Rebind<S>::fromParams(MathOf<S>::product(promoted<S>(params()), promoted<S>(other.params())));
  }
  template <class Other>
  requires SameGroup<Derived, Other> Derived& operator*=(const GroupBase<Other>& other) {
    this->derived().mutableStorage() = Math::product(params(), promoted<Scalar>(other.params()));
    return this->derived();
  }
  /// Action on a point of R^Dim.
  template <class D>
    requires(D::RowsAtCompileTime == Dim && D::ColsAtCompileTime == 1)
  auto operator*(const Eigen::MatrixBase<D>& point) const {
    using S = CommonScalar<Scalar, typename D::Scalar>;
    return Eigen::Matrix<S, Dim, 1>(MathOf<S>::act(promoted<S>(params()), promoted<S>(point)));
  }
  /// Action on each column of a Dim×N matrix, through matrix(): for more than a few points cheaper than one by one.
  template <class D>
    requires(D::RowsAtCompileTime == Dim && D::ColsAtCompileTime != 1)
  auto operator*(const Eigen::MatrixBase<D>& points) const {
    using S = CommonScalar<Scalar, typename D::Scalar>;
    using Points = Eigen::Matrix<S, Dim, D::ColsAtCompileTime>;
    const auto& promoted_points = promoted<S>(points);
    const Eigen::Ref<const Points, 0, Eigen::OuterStride<>> in(promoted_points);
    const AffineMap<S> map(promoted<S>(params()));
    Points out(Dim, in.cols());
    for (Eigen::Index j = 0; j < in.cols(); ++j) map.apply(in.data() + j * in.outerStride(), out.data() + j * Dim);
    return out;
  }
  /// Action on each point of a container or span, through matrix(); the results come as a vector of points.
  template <class Range>
    requires requires(const Range& r) {
      r.begin();
      r.size();
      requires Range::value_type::RowsAtCompileTime == Dim&& Range::value_type::ColsAtCompileTime == 1;
    }
  auto operator*(const Range& points) const {
    using S = CommonScalar<Scalar, typename Range::value_type::Scalar>;
    using ImageOfPoint = Eigen::Matrix<S, Dim, 1>;
    const AffineMap<S> map(promoted<S>(params()));
    std::vector<ImageOfPoint> out(points.size());
    auto image = out.begin();
    for (const auto& point : points) {
      const ImageOfPoint p = promoted<S>(point);
      map.apply(p.data(), (image++)->data());
    }
    return out;
  }
  /// Action on a homogeneous point (w p, w): the last coordinate stays.
  template <class D>
    requires(D::RowsAtCompileTime == Dim + 1 && D::ColsAtCompileTime == 1)
  auto operator*(const Eigen::MatrixBase<D>& point) const {
    using S = CommonScalar<Scalar, typename D::Scalar>;
    const auto& p = promoted<S>(params());
    Eigen::Matrix<S, Dim + 1, 1> result = promoted<S>(point);
    result.template head<Dim>() = MathOf<S>::linear(p, Eigen::Matrix<S, Dim, 1>(result.template head<Dim>()));
    if constexpr (requires { MathOf<S>::translation(p); }) {
      result.template head<Dim>() += result[Dim] * MathOf<S>::translation(p);
    }
    return result;
  }
  /// Action on a line o + t d: the origin moves as a point, the direction is turned and keeps its norm.
  Line operator*(const Line& line) const {
    return Line(*this * line.origin(), Math::rotate(params(), Point(line.direction())));
  }
  /// Action on a hyperplane {p : n·p + c = 0}: x lies on it if and only if *this * x lies on the result; the normal is
  /// turned and keeps its norm.
  Hyperplane operator*(const Hyperplane& plane) const {
    const Point normal = Math::rotate(params(), Point(plane.normal()));
    return Hyperplane(normal, scaleOf() * plane.offset() - normal.dot(*this * Point(Point::Zero())));
  }

  Plain inverse() const { return Plain::fromParams(Math::inverse(params())); }
  /// Tangent vector v with exp(v) = *this, rotation angle in [0, pi].
  Tangent log() const { return Math::log(params()); }
  /// Group exponential.
  static Plain exp(const Tangent& v) { return Plain::fromParams(Math::exp(v)); }
  Transformation matrix() const { return Math::matrix(params()); }
  /// Adjoint: x·Exp(v)·x⁻¹ = Exp(Adj v).
  Adjoint Adj() const { return Math::Adj(params()); }
  /// Matrix of the Lie bracket: ad(v) w = vee([hat v, hat w]).
  static Adjoint ad(const Tangent& v) { return Math::ad(v); }
  static Transformation hat(const Tangent& v) { return Math::hat(v); }
  static Tangent vee(const Transformation& m) { return Math::vee(m); }
  /// The i-th basis vector of the algebra, hat(e_i).
  static Transformation generator(int i) { return Math::hat(Tangent::Unit(i)); }
  static Tangent lieBracket(const Tangent& a, const Tangent& b) { return Math::ad(a) * b; }
  /// Exp(v + d) = Exp(leftJacobian(v) d + O(d²))·Exp(v).
  static Adjoint leftJacobian(const Tangent& v) { return Math::leftJacobian(v); }
  /// Inverse of leftJacobian, regular at rotation angle pi, singular at 2 pi.
  static Adjoint leftJacobianInverse(const Tangent& v) { return Math::leftJacobianInverse(v); }
  /// Exp(v + d) = Exp(v)·Exp(rightJacobian(v) d + O(d²)).
  static Adjoint rightJacobian(const Tangent& v) { return Math::leftJacobian(negative(v)); }
  /// Inverse of rightJacobian: Log(Exp(v)·Exp(d)) = v + rightJacobianInverse(v) d + O(d²).
  static Adjoint rightJacobianInverse(const Tangent& v) { return Math::leftJacobianInverse(negative(v)); }
  /// Projects the parameters back on their constraint (unit quaternion or complex number).
  void normalize() { this->derived().mutableStorage() = Math::normalized(params()); }

  using ParameterJacobian = Eigen::Matrix<Scalar, num_parameters, DoF>;
  /// (*this · Exp(d)).params() = params() + Dx_this_mul_exp_x_at_0() d + O(d²)
  ParameterJacobian Dx_this_mul_exp_x_at_0() const { return Math::productJacobian(params()); }
  /// Log(this⁻¹ · x) = Dx_log_this_inv_by_x_at_this() (x.params() - params()) + O(·²), for x on the group.
  Eigen::Matrix<Scalar, DoF, num_parameters> Dx_log_this_inv_by_x_at_this() const {
    return Math::quotientJacobian(params());
  }
  /// Exp(v + d).params() = Exp(v).params() + Dx_exp_x(v) d + O(d²)
  static ParameterJacobian Dx_exp_x(const Tangent& v) { return Math::productJacobian(Math::exp(v)) * rightJacobian(v); }
  static ParameterJacobian Dx_exp_x_at_0() { return Math::productJacobian(Math::identity()); }
  /// Exp(d)·p = p + Dx_exp_x_times_point_at_0(p) d + O(d²)
  static Eigen::Matrix<Scalar, Dim, DoF> Dx_exp_x_times_point_at_0(const Point& p) {
    Eigen::Matrix<Scalar, Dim, DoF> J;
    for (int i = 0; i < DoF; ++i) {
      const Transformation G = generator(i);
      J.col(i) = G.template topLeftCorner<Dim, Dim>() * p;
      if constexpr (N > Dim) J.col(i) += G.template block<Dim, 1>(0, translation_column);
    }
    return J;
  }
  /// Exp(d).matrix() = I + Σ d_i Dxi_exp_x_matrix_at_0(i) + O(d²)
  static Transformation Dxi_exp_x_matrix_at_0(int i) { return generator(i); }

  /// A random element: rotation uniform, translation uniform in [-1, 1]^Dim (m), log2 of the scale uniform in [-1, 1].
  /// Any generator of the standard library's kind (result_type, min(), max(), operator()).
  template <class Generator>
  static Plain sampleUniform(Generator& generator) {
    return Plain::fromParams(Math::sampleUniform(generator));
  }

 private:
  /// p ↦ L p + t of an element.
  template <class S>
  struct AffineMap {
    Eigen::Matrix<S, Dim, Dim> linear;
    Eigen::Matrix<S, Dim, 1> translation = Eigen::Matrix<S, Dim, 1>::Zero();

    explicit AffineMap(const typename MathOf<S>::Params& params) {
      const typename MathOf<S>::MatrixType m = MathOf<S>::matrix(params);
      linear = m.template topLeftCorner<Dim, Dim>();
      if constexpr (N > Dim) translation = m.template block<Dim, 1>(0, translation_column);
    }
    EIGEN_ALWAYS_INLINE void apply(const S* p, S* image) const {
      S result[static_cast<std::size_t>(Dim)];
      for (int i = 0; i < Dim; ++i) {
        result[i] = translation[i];
        for (int k = 0; k < Dim; ++k) result[i] += linear(i, k) * p[k];
      }
      for (int i = 0; i < Dim; ++i) image[i] = result[i];
    }
  };

  /// Column of matrix() that moves points; the last but for groups that carry more than one vector.
  static constexpr int translation_column = Dim;

  /// -v, coordinate by coordinate: the Jacobians read it so, and would wait for numbers stored in packets.
  static EIGEN_ALWAYS_INLINE Tangent negative(const Tangent& v) {
    Tangent result;
    for (int i = 0; i < DoF; ++i) result[i] = -v[i];
    return result;
  }
  Scalar scaleOf() const {
    if constexpr (requires { Math::scale(params()); }) {
      return Math::scale(params());
    } else {
      return Scalar(1);
    }
  }
};

template <class Derived>
std::ostream& operator<<(std::ostream& os, const Shell<Derived>& x) {
  return os << x.params().transpose();
}

}  // namespace liestat::detail
