// R^n: fixed-size Eigen vectors as manifolds, under the group of translations. Points, and anything flat.
//
// Storage        an Eigen column vector as it is; no wrapper
// Tangent        the difference, in the unit of the coordinates
// Action         of Translation<S, N>: p + t
// Metric         Euclidean
#pragma once

#include <lie/detail/chordal.hpp>
#include <lie/manifold.hpp>

#include <limits>

namespace liestat {

/// The additive group of R^N: a vector with the interface of a group.
template <class Scalar_, int N_>
class Translation {
 public:
  using Scalar = Scalar_;
  static constexpr int DoF = N_, num_parameters = N_, N = N_ + 1, Dim = N_;
  using Tangent = Eigen::Matrix<Scalar, DoF, 1>;
  using Square = Eigen::Matrix<Scalar, DoF, DoF>;
  using Params = Tangent;

  /// The identity: zero.
  Translation() : v_(Tangent::Zero()) {}
  explicit Translation(const Tangent& v) : v_(v) {}
  static Translation fromParams(const Params& v) { return Translation(v); }
  const Tangent& params() const { return v_; }
  const Scalar* data() const { return v_.data(); }
  Scalar* data() { return v_.data(); }
  template <class S>
  Translation<S, N_> cast() const {
    return Translation<S, N_>(v_.template cast<S>());
  }
  Translation operator*(const Translation& other) const { return Translation(v_ + other.v_); }
  Translation inverse() const { return Translation(-v_); }
  static Translation exp(const Tangent& v) { return Translation(v); }
  Tangent log() const { return v_; }
  Square Adj() const { return Square::Identity(); }
  static Square ad(const Tangent&) { return Square::Zero(); }
  static Square leftJacobian(const Tangent&) { return Square::Identity(); }
  static Square leftJacobianInverse(const Tangent&) { return Square::Identity(); }
  static Square rightJacobian(const Tangent&) { return Square::Identity(); }
  static Square rightJacobianInverse(const Tangent&) { return Square::Identity(); }

 private:
  Tangent v_;
};

namespace detail {

/// Traits shared by flat spaces, M a vector or a translation: no curvature, derivatives that are identities.
template <class M, class S, int N>
struct FlatManifold : TrivialIsotropy<M, Translation<S, N>> {
  using Base = TrivialIsotropy<M, Translation<S, N>>;
  using typename Base::Square, typename Base::Tangent;

  static Square dexpOrigin(const Tangent&) { return Square::Identity(); }
  static Square dlogOrigin(const M&) { return Square::Identity(); }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(std::numeric_limits<double>::infinity()); }
  static S maxSectionalCurvature() { return S(0); }
  static Square hessianHalfSquaredDistance(const Tangent&) { return Square::Identity(); }
  static Square dlogFeatureTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static Square dlogBaseTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static VolumeElement<S, N> logVolume(const Tangent&) { return {}; }
  static constexpr bool covariance_models_coincide = true;

  using ChordalMoments = FlatMoments<M>;
  static constexpr CompactFactor compact_factor = CompactFactor::none;
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::point, 0, N}};
};

}  // namespace detail

/// Fixed-size column vectors; dynamic sizes and integers are not manifolds.
template <class S, int N, int O>
  requires(N > 0 && !std::is_integral_v<S>)
struct ManifoldTraits<Eigen::Matrix<S, N, 1, O, N, 1>> : detail::FlatManifold<Eigen::Matrix<S, N, 1, O, N, 1>, S, N> {
  using M = Eigen::Matrix<S, N, 1, O, N, 1>;
  using Group = Translation<S, N>;
  using Tangent = Eigen::Matrix<S, N, 1>;

  static M origin() { return M::Zero(); }
  static M act(const Group& f, const M& x) { return x + f.params(); }
  static Group placement(const M& x) { return Group(x); }
  static M expOrigin(const Tangent& v) { return v; }
  static Tangent logOrigin(const M& x) { return x; }
};

/// The group of translations, acting on itself.
template <class S, int N>
struct ManifoldTraits<Translation<S, N>> : detail::FlatManifold<Translation<S, N>, S, N> {
  using M = Translation<S, N>;

  static M act(const M& f, const M& x) { return f * x; }
  static M placement(const M& x) { return x; }
  static M expOrigin(const typename M::Tangent& v) { return M(v); }
  static typename M::Tangent logOrigin(const M& x) { return x.params(); }
};

}  // namespace liestat
