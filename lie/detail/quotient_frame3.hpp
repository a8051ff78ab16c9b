// Frames of R^3 modulo the right action of a group of half-turns about their own axes.
#pragma once

#include <lie/frame3.hpp>

namespace liestat {

/// The index of the representative of a quotient feature that is nearest to the origin.
template <class Scalar>
struct RepresentativeChoice {
  int index = 0;            ///< 0 = as stored, else the half-turn about axis index - 1 (x, y, z)
  Scalar angle = 0;         ///< rotation angle of the nearest representative, rad
  Scalar second_angle = 0;  ///< rotation angle of the second nearest, rad
  /// Second-best angle minus best: how far the feature is from the cut locus, rad.
  Scalar gap() const { return second_angle - angle; }
};

namespace detail {

/// Traits of a frame modulo half-turns; Axes lists the axes of the group's half-turns (0, 1, 2 = x, y, z).
///
/// Right multiplication of (x, y, z, w) by a half-turn permutes the absolute values of the components, so the
/// representative of least rotation angle is the one with the largest |w| (docs/theory/means.md, section 1.3). Ties go
/// to the first.
template <class M, int... Axes>
struct QuotientFrameManifold : FrameManifold<M> {
  using Base = FrameManifold<M>;
  using typename Base::Math, typename Base::Scalar, typename Base::Square, typename Base::Tangent;
  using Choice = RepresentativeChoice<Scalar>;
  static constexpr int num_representatives = 1 + static_cast<int>(sizeof...(Axes));
  /// The indices that name them, as in RepresentativeChoice.
  static constexpr int representatives[] = {0, (Axes + 1)...};

  /// The representative of x that is nearest to the origin.
  static Choice nearestRepresentative(const M& x) {
    using std::abs, std::atan2, std::sqrt;
    const auto& q = x.params();
    // The component that a half-turn brings to w, and the axis; axis 3 is the identity.
    Scalar best = abs(q[3]), second = Scalar(-1);
    int best_axis = 3, second_axis = 3;
    const auto consider = [&](int axis) {
      const Scalar c = abs(q[axis]);
      const bool better = c > best, second_better = c > second;
      second = select(better, best, select(second_better, c, second));
      second_axis = select(better, best_axis, select(second_better, axis, second_axis));
      best = select(better, c, best);
      best_axis = select(better, axis, best_axis);
    };
    (consider(Axes), ...);
    // From the other components, not from 1 - c², which leaves eight digits of a small angle.
    const auto angle = [&q](int axis, const Scalar& c) {
      Scalar s2(0);
      for (int i = 0; i < 4; ++i) s2 += i == axis ? Scalar(0) : Scalar(q[i] * q[i]);
      return Scalar(2) * atan2(sqrt(s2), c);
    };
    return {best_axis == 3 ? 0 : best_axis + 1, angle(best_axis, best), angle(second_axis, second)};
  }
  /// The i-th representative of x (index as in RepresentativeChoice): the same feature, other parameters.
  static M representative(const M& x, int index) {
    typename M::Params p = x.params();
    const Eigen::Matrix<Scalar, 4, 1> q = p.template head<4>();
    // q times the unit quaternion of the axis: a permutation with signs.
    if (index == 1) p.template head<4>() << q[3], q[2], -q[1], -q[0];
    if (index == 2) p.template head<4>() << -q[2], q[3], q[0], -q[1];
    if (index == 3) p.template head<4>() << q[1], -q[0], q[3], -q[2];
    return M::fromParams(p);
  }
  /// How the tangent frame at x relates to that of representative(x, index): diag(k, k), k the half-turn.
  static Square representativeJacobian(int index) {
    Tangent d = Tangent::Ones();
    if (index > 0) {
      for (int i = 0; i < 3; ++i) d[i] = d[i + 3] = Scalar(i == index - 1 ? 1 : -1);
    }
    return d.asDiagonal();
  }

  static Tangent logOrigin(const M& x) { return Math::log(representative(x, nearestRepresentative(x).index).params()); }
  static Square dlogOrigin(const M& x) {
    const int index = nearestRepresentative(x).index;
    const Tangent z = Math::log(representative(x, index).params());
    return Math::dlog(z.template tail<3>()) * representativeJacobian(index);
  }
  static Scalar injectivityRadius() { return Scalar(EIGEN_PI / 2); }
};

}  // namespace detail
}  // namespace liestat

/// Defines the quotient frame Type in namespace liestat, its Maps and aliases.
#define LIESTAT_QUOTIENT_FRAME(Type, ...)                                                                       \
  namespace liestat {                                                                                           \
  template <class Scalar_, int Options_ = 0>                                                                    \
  class Type;                                                                                                   \
  using Type##d = Type<double>;                                                                                 \
  using Type##f = Type<float>;                                                                                  \
  }                                                                                                             \
  LIESTAT_TRAITS(Type, liestat::detail::Se3Math)                                                                \
  namespace liestat {                                                                                           \
  template <class S, int O>                                                                                     \
  struct ManifoldTraits<Type<S, O>> : detail::QuotientFrameManifold<Type<S, O>, __VA_ARGS__> {};                \
                                                                                                                \
  template <class Scalar_, int Options_>                                                                        \
  class Type : public Frame3Base<Type<Scalar_, Options_>> {                                                     \
    LIESTAT_OWNER(Type, Frame3Base);                                                                            \
                                                                                                                \
   public:                                                                                                      \
    using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;                                                               \
    /** Keeps the representative that it is given; a covariance belongs to that one. */                         \
    template <class D>                                                                                          \
    explicit Type(const SE3Base<D>& pose) : storage_(pose.params()) {}                                          \
    template <class D>                                                                                          \
    Type(const SO3Base<D>& rotation, const Vector3& translation)                                                \
        : storage_(Shell::Math::join(rotation.params(), translation)) {}                                        \
    template <class D>                                                                                          \
    Type(const Eigen::QuaternionBase<D>& q, const Vector3& translation) : Type(SO3<Scalar_>(q), translation) {} \
    /** The representative of least rotation angle; a covariance moves with representativeJacobian. */          \
    Type canonical() const {                                                                                    \
      using T = ManifoldTraits<Type>;                                                                           \
      return T::representative(*this, T::nearestRepresentative(*this).index);                                   \
    }                                                                                                           \
  };                                                                                                            \
  }                                                                                                             \
  LIESTAT_MAPS(Type, liestat::Frame3Base)
