// Frame2: a point of the plane with an orthonormal pair of axes, as a Riemannian manifold under SE(2).
//
// Storage        cos sin tx ty, the same data as SE2
// Tangent        (translation m, angle rad), in the frame: exp(x, v) = (t + R v_t, angle + v_r)
// Action         of SE2 from the left
// Origin         the identity
// Metric         d² = |translation|² + angle², left-invariant, flat, injectivity radius pi in the rotation
// Bad input      NaN in, NaN out
#pragma once

#include <lie/se2.hpp>

namespace liestat {

/// Interface of Frame2 over owned or viewed memory.
template <class Derived>
class Frame2Base : public detail::PlanarPoseAccess<Derived, detail::Shell<Derived>> {
 public:
  using Scalar = typename detail::Shell<Derived>::Scalar;
  /// The same data as a rigid motion: the transformation that places the frame.
  SE2<Scalar> se2() const { return SE2<Scalar>::fromParams(this->params()); }
};

template <class Scalar_, int Options_ = 0>
class Frame2;

using Frame2d = Frame2<double>;
using Frame2f = Frame2<float>;

}  // namespace liestat

LIESTAT_TRAITS(Frame2, liestat::detail::Se2Math)

namespace liestat {

/// A frame of the plane; see the header comment.
template <class Scalar_, int Options_>
class Frame2 : public Frame2Base<Frame2<Scalar_, Options_>> {
  LIESTAT_OWNER(Frame2, Frame2Base);

 public:
  using Vector2 = Eigen::Matrix<Scalar_, 2, 1>;

  template <class D>
  Frame2(const SE2Base<D>& pose) : storage_(pose.params()) {}  // NOLINT: the casts between SE2 and Frame2 are free
  template <class D>
  Frame2(const SO2Base<D>& rotation, const Vector2& translation)
      : storage_(Shell::Math::join(rotation.params(), translation)) {}
};

/// The frame under the product metric of SO(2) × R^2 (docs/theory/means.md, section 1.2).
template <class S, int O>
struct ManifoldTraits<Frame2<S, O>> : TrivialIsotropy<Frame2<S, O>, SE2<S>> {
  using M = Frame2<S, O>;
  using Base = TrivialIsotropy<M, SE2<S>>;
  using typename Base::Group, typename Base::Square, typename Base::Tangent;
  using Math = detail::Se2Math<S>;

  static M act(const Group& f, const M& x) { return M::fromParams(Math::product(f.params(), x.params())); }
  static Group placement(const M& x) { return Group::fromParams(x.params()); }
  static M expOrigin(const Tangent& v) {
    return M::fromParams(Math::join(Math::Rotation::exp(typename Math::Angle(v[2])), v.template head<2>()));
  }
  static Tangent logOrigin(const M& x) {
    return Tangent(x.params()[2], x.params()[3], Math::Rotation::log(Math::complex(x.params()))[0]);
  }
  static Square dlogOrigin(const M& x) {
    Square m = Square::Identity();
    m.template topLeftCorner<2, 2>() = Math::Rotation::matrix(Math::complex(x.params()));
    return m;
  }
  static Square dexpOrigin(const Tangent& v) { return dlogOrigin(expOrigin(v)).transpose(); }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(0); }
  static Square hessianHalfSquaredDistance(const Tangent&) { return Square::Identity(); }
  /// ∂(D(z)ᵀ a)/∂z: only the angle turns the translation part.
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) {
    const typename Math::Vector2 turned =
        Math::Rotation::act(Math::Rotation::exp(typename Math::Angle(-z[2])), a.template head<2>());
    Square m = Square::Zero();
    m(0, 2) = turned[1], m(1, 2) = -turned[0];
    return m;
  }
  /// ∂(L(z)ᵀ a)/∂z: the last row of Lᵀ a is -(J z_t)·a_t - a_r.
  static Square dlogBaseTransposed(const Tangent&, const Tangent& a) {
    Square m = Square::Zero();
    m(2, 0) = -a[1], m(2, 1) = a[0];
    return m;
  }
  static detail::VolumeElement<S, 3> logVolume(const Tangent&) { return {}; }

  using ChordalMoments = detail::ComplexMoments<M>;
  static constexpr CompactFactor compact_factor = CompactFactor::circle;
  static constexpr int compact_begin = 2;
  static Eigen::Matrix<S, 2, 1> compactCoordinates(const M& x) { return Math::complex(x.params()); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::translation, 0, 2}, {TangentPart::rotation, 2, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(Frame2, liestat::Frame2Base)
