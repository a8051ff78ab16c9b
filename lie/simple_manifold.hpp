// SimpleManifold: a type that carries the same data as a manifold of the library becomes a manifold itself, by two
// functions that convert between both.
//
//   struct DronePose { Eigen::Vector3d position; Eigen::Quaterniond attitude; };
//   liestat::Frame3d toFrame(const DronePose& x) { return {liestat::SO3d(x.attitude), x.position}; }
//   DronePose fromFrame(const liestat::Frame3d& f) { return {f.translation(), f.unit_quaternion()}; }
//
//   template <>
//   struct liestat::ManifoldTraits<DronePose>
//       : liestat::SimpleManifold<DronePose, liestat::Frame3d, toFrame, fromFrame> {};
//
// Model          a group (SE3d: the group's exponential, no metric) or any manifold (Frame3d: means of poses)
// toModel        M to Model, fromModel back; inverses of each other. Functions or lambdas without captures; the addresses
//                of templates (&toFrame<S>) where M is a template of its scalar
// Tangent        that of the model at toModel(x): order, units and frame. A pose that is perturbed from the left,
//                Exp(d)·x, is modelled by its inverse: exp(x, v) is then Exp(-v)·x
// Bad input      what the model makes of it
#pragma once

#include <lie/manifold.hpp>

#include <optional>

namespace liestat {
namespace detail {

template <class M, class Model, auto toModel, auto fromModel>
struct SimpleChordalMoments {};
template <class M, class Model, auto toModel, auto fromModel>
  requires HasChordalMoments<Model>
struct SimpleChordalMoments<M, Model, toModel, fromModel> {
  /// Those of the model.
  class ChordalMoments {
   public:
    void add(const M& x, const typename ManifoldTraits<Model>::Scalar& weight) { sums_.add(toModel(x), weight); }
    std::optional<M> mean() const {
      const std::optional<Model> nearest = sums_.mean();
      return nearest ? std::optional<M>(fromModel(*nearest)) : std::nullopt;
    }

   private:
    typename ManifoldTraits<Model>::ChordalMoments sums_;
  };
};

template <class Model>
struct SimpleTangentParts {};
template <HasTangentParts Model>
struct SimpleTangentParts<Model> {
  static constexpr const auto& tangent_parts = ManifoldTraits<Model>::tangent_parts;
};

}  // namespace detail

/// The traits of a type M that is a Model in other clothes; see the header comment.
template <class M, Homogeneous Model, auto toModel, auto fromModel>
struct SimpleManifold : detail::SimpleChordalMoments<M, Model, toModel, fromModel>, detail::SimpleTangentParts<Model> {
  using Traits = ManifoldTraits<Model>;
  using Group = typename Traits::Group;
  using Scalar = typename Traits::Scalar;
  static constexpr int DoF = Traits::DoF;
  using Tangent = typename Traits::Tangent;
  using Square = typename Traits::Square;
  static_assert(!Quotient<Model>, "a quotient's representatives are those of its own type: write the traits yourself");

  static constexpr bool trivial_isotropy = detail::HasTrivialIsotropy<Model>;
  static constexpr bool covariance_models_coincide = [] {
    if constexpr (requires { Traits::covariance_models_coincide; }) {
      return Traits::covariance_models_coincide;
    } else {
      return false;
    }
  }();
  static constexpr CompactFactor compact_factor = detail::compactFactor<Model>();
  static constexpr int compact_begin = [] {
    if constexpr (requires { Traits::compact_begin; }) {
      return Traits::compact_begin;
    } else {
      return 0;
    }
  }();

  static M origin() { return fromModel(Traits::origin()); }
  static M act(const Group& f, const M& x) { return fromModel(Traits::act(f, toModel(x))); }
  static Group placement(const M& x) { return Traits::placement(toModel(x)); }
  static M expOrigin(const Tangent& v) { return fromModel(Traits::expOrigin(v)); }
  static Tangent logOrigin(const M& x) { return Traits::logOrigin(toModel(x)); }
  static Square dexpOrigin(const Tangent& v) { return Traits::dexpOrigin(v); }
  static Square dlogOrigin(const M& x) { return Traits::dlogOrigin(toModel(x)); }
  static Square isotropy(const Group& f, const M& x) { return Traits::isotropy(f, toModel(x)); }
  static auto originProjection() { return Traits::originProjection(); }
  static auto placementJacobian(const M& x) { return Traits::placementJacobian(toModel(x)); }
  static bool isPlacementSmooth(const M& x) { return Traits::isPlacementSmooth(toModel(x)); }

  static Tangent metricWeights() requires Metric<Model> { return Traits::metricWeights(); }
  static Scalar injectivityRadius() requires Metric<Model> { return Traits::injectivityRadius(); }
  static Scalar maxSectionalCurvature() requires Metric<Model> { return Traits::maxSectionalCurvature(); }
  static Square hessianHalfSquaredDistance(const Tangent& z) requires Metric<Model> {
    return Traits::hessianHalfSquaredDistance(z);
  }

  // Optional members of the model's traits.
  static auto transvection(const M& x) requires requires(const Model& y) { Traits::transvection(y); }
  { return Traits::transvection(toModel(x)); }
  static auto transvectionJacobian() requires requires { Traits::transvectionJacobian(); }
  { return Traits::transvectionJacobian(); }
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) requires requires {
    Traits::dlogFeatureTransposed(z, a);
  }
  { return Traits::dlogFeatureTransposed(z, a); }
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) requires requires {
    Traits::dlogBaseTransposed(z, a);
  }
  { return Traits::dlogBaseTransposed(z, a); }
  static auto logVolume(const Tangent& z) requires requires { Traits::logVolume(z); }
  { return Traits::logVolume(z); }
  static auto compactCoordinates(const M& x) requires requires(const Model& y) { Traits::compactCoordinates(y); }
  { return Traits::compactCoordinates(toModel(x)); }
  static auto metricTwin(const M& x) requires HasMetricTwin<Model> { return Traits::metricTwin(toModel(x)); }
  template <class Twin>
  static M fromMetricTwin(const Twin& y) requires HasMetricTwin<Model> {
    return fromModel(Traits::fromMetricTwin(y));
  }
};

}  // namespace liestat
