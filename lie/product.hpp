// Product<M1, M2, …>: several features as one, such as a rotation with a bias, or a frame with a direction; and
// ProductGroup<G1, G2, …>, the group of tuples of transformations, which acts on it part by part.
//
// Parts          any manifolds of one scalar type: the library's, Eigen vectors, products, a user's own by traits
// Storage        a std::tuple; params() are those of the parts, one after the other, by value
// Tangent        that of each part, in the order of the parts; tangentBlock<I>, covarianceBlock<I, J>
// Action         of the product of the parts' groups, part by part
// Origin         the parts' origins; the identity of a group
// Metric         if all parts have one: d² is the sum of theirs; injectivity radius the least of theirs, sectional
//                curvature at most the largest of theirs (or zero). If a part is a quotient, so is the product.
// Bad input      what the parts make of it
#pragma once

#include <lie/detail/part_tuple.hpp>
#include <lie/detail/product_representatives.hpp>
#include <lie/rn.hpp>

#include <array>
#include <iterator>
#include <limits>
#include <tuple>

namespace liestat {
namespace detail {

// A concept and not a requires-expression where it is used: clang 14 takes one within a generic lambda for false.
template <class G>
concept HasNormalize = requires(G& g) {
  g.normalize();
};

}  // namespace detail

/// A tuple of features; see the header comment. auto [rotation, bias] = x; names its parts.
template <Homogeneous... Ms>
class Product : public detail::PartTuple<Product, Ms...> {
 public:
  using detail::PartTuple<Product, Ms...>::PartTuple;
};

/// The direct product of groups: every operation part by part.
template <LieGroup... Gs>
class ProductGroup : public detail::PartTuple<ProductGroup, Gs...> {
  using Base = detail::PartTuple<ProductGroup, Gs...>;

 public:
  using Base::Base, Base::num_parts, Base::DoF, Base::tangentBlock, Base::get;
  using typename Base::Scalar, typename Base::Sizes, typename Base::Square, typename Base::Tangent;
  using Adjoint = Square;
  template <std::size_t I>
  using Part = typename Base::template Part<I>;

  ProductGroup operator*(const ProductGroup& other) const {
    return make([&](auto i) { return Part<i>(this->template get<i>() * other.template get<i>()); });
  }
  ProductGroup& operator*=(const ProductGroup& other) { return *this = *this * other; }
  ProductGroup inverse() const {
    return make([&](auto i) { return Part<i>(this->template get<i>().inverse()); });
  }
  static ProductGroup exp(const Tangent& v) {
    return make([&](auto i) { return Part<i>(Part<i>::exp(Base::template tangentBlock<i>(v))); });
  }
  Tangent log() const {
    Tangent v;
    detail::forEachIndex<num_parts>([&](auto i) { Base::template tangentBlock<i>(v) = this->template get<i>().log(); });
    return v;
  }
  Adjoint Adj() const {
    return blocks([&](auto i) { return this->template get<i>().Adj(); });
  }
  static Adjoint ad(const Tangent& v) {
    return blocks([&](auto i) { return Part<i>::ad(Base::template tangentBlock<i>(v)); });
  }
  static Square leftJacobian(const Tangent& v) {
    return blocks([&](auto i) { return Part<i>::leftJacobian(Base::template tangentBlock<i>(v)); });
  }
  static Square leftJacobianInverse(const Tangent& v) {
    return blocks([&](auto i) { return Part<i>::leftJacobianInverse(Base::template tangentBlock<i>(v)); });
  }
  static Square rightJacobian(const Tangent& v) { return leftJacobian(Tangent(-v)); }
  static Square rightJacobianInverse(const Tangent& v) { return leftJacobianInverse(Tangent(-v)); }
  /// Projects the parts' parameters back on their constraints.
  void normalize() {
    detail::forEachIndex<num_parts>([&](auto i) {
      using P = Part<i>;
      if constexpr (detail::HasNormalize<P>) this->template get<i>().normalize();
    });
  }

 private:
  template <class F>
  static ProductGroup make(const F& part) {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return ProductGroup(part(std::integral_constant<std::size_t, I>{})...);
    }
    (std::make_index_sequence<num_parts>{});
  }
  template <class F>
  static Square blocks(const F& block) {
    return detail::blockDiagonal<Scalar>(Sizes{}, Sizes{}, block);
  }
};

namespace detail {

template <class M>
concept HasTransvection = requires(const M& x) {
  ManifoldTraits<M>::transvection(x);
};
template <class M>
concept HasTransvectionJacobian = requires {
  ManifoldTraits<M>::transvectionJacobian();
};
template <class M>
concept HasLogVolume = requires(const typename ManifoldTraits<M>::Tangent& z) {
  ManifoldTraits<M>::logVolume(z);
};
template <class M>
concept DifferentiatesDlog = requires(const typename ManifoldTraits<M>::Tangent& z) {
  ManifoldTraits<M>::dlogFeatureTransposed(z, z);
  ManifoldTraits<M>::dlogBaseTransposed(z, z);
};
/// The parts' tangent blocks, one part after the other; none unless every part says them.
template <class... Ms>
struct ProductTangentParts {};
template <class... Ms>
  requires(HasTangentParts<Ms>&&...)
struct ProductTangentParts<Ms...> {
  static constexpr auto tangent_parts = [] {
    std::array<TangentBlock, (std::size(ManifoldTraits<Ms>::tangent_parts) + ...)> all;
    std::size_t k = 0;
    int begin = 0;
    const auto append = [&](const auto& parts, int dimension) {
      for (const TangentBlock& b : parts) all[k++] = {b.part, begin + b.begin, b.size};
      begin += dimension;
    };
    (append(ManifoldTraits<Ms>::tangent_parts, ManifoldTraits<Ms>::DoF), ...);
    return all;
  }();
};

template <class M>
concept CovarianceModelsCoincide = requires {
  requires ManifoldTraits<M>::covariance_models_coincide;
};

/// Traits of a product M of the manifolds Ms: what each part's traits say, side by side.
template <class M, class... Ms>
struct ProductManifold : std::conditional_t<(Quotient<Ms> || ...), ProductRepresentatives<M, Ms...>, NoRepresentatives>,
                         ProductTangentParts<Ms...> {
  using Group = ProductGroup<typename ManifoldTraits<Ms>::Group...>;
  using Scalar = typename M::Scalar;
  static constexpr int DoF = M::DoF;
  using Tangent = typename M::Tangent;
  using Square = typename M::Square;
  template <std::size_t I>
  using T = ManifoldTraits<std::tuple_element_t<I, std::tuple<Ms...>>>;
  using Sizes = typename M::Sizes;
  using GroupSizes = typename Group::Sizes;

  static constexpr bool trivial_isotropy = (HasTrivialIsotropy<Ms> && ...);
  static constexpr bool covariance_models_coincide = (CovarianceModelsCoincide<Ms> && ...);
  static constexpr bool frames_of_factors = true;
  /// The parts, in whose criteria that of the product separates, and back.
  static const std::tuple<Ms...>& factors(const M& x) { return x.parts(); }
  static M fromFactors(const std::tuple<Ms...>& parts) { return M(parts); }

  static M origin() { return M(); }
  static M act(const Group& f, const M& x) {
    return make<M>([&](auto i) { return T<i>::act(f.template get<i>(), x.template get<i>()); });
  }
  static Group placement(const M& x) {
    return make<Group>([&](auto i) { return T<i>::placement(x.template get<i>()); });
  }
  static M expOrigin(const Tangent& v) {
    return make<M>([&](auto i) { return T<i>::expOrigin(M::template tangentBlock<i>(v)); });
  }
  static Tangent logOrigin(const M& x) {
    return stack([&](auto i) { return T<i>::logOrigin(x.template get<i>()); });
  }
  static Square dexpOrigin(const Tangent& v) {
    return blocks([&](auto i) { return T<i>::dexpOrigin(M::template tangentBlock<i>(v)); });
  }
  static Square dlogOrigin(const M& x) {
    return blocks([&](auto i) { return T<i>::dlogOrigin(x.template get<i>()); });
  }
  static Square isotropy(const Group& f, const M& x) {
    return blocks([&](auto i) { return T<i>::isotropy(f.template get<i>(), x.template get<i>()); });
  }
  static auto originProjection() {
    return blockDiagonal<Scalar>(Sizes{}, GroupSizes{}, [](auto i) { return T<i>::originProjection(); });
  }
  static auto placementJacobian(const M& x) {
    return blockDiagonal<Scalar>(GroupSizes{}, Sizes{},
                                 [&](auto i) { return T<i>::placementJacobian(x.template get<i>()); });
  }
  static bool isPlacementSmooth(const M& x) {
    bool smooth = true;
    forEachIndex<sizeof...(Ms)>([&](auto i) { smooth = T<i>::isPlacementSmooth(x.template get<i>()) && smooth; });
    return smooth;
  }
  static Group transvection(const M& x) requires(HasTransvection<Ms> || ...) {
    return make<Group>([&](auto i) { return liestat::transvection(x.template get<i>()); });
  }
  static auto transvectionJacobian() requires(HasTransvectionJacobian<Ms> || ...) {
    return blockDiagonal<Scalar>(GroupSizes{}, Sizes{}, [](auto i) {
      if constexpr (HasTransvectionJacobian<std::tuple_element_t<i, std::tuple<Ms...>>>) {
        return T<i>::transvectionJacobian();
      } else {
        return T<i>::placementJacobian(T<i>::origin());
      }
    });
  }

  static Tangent metricWeights() requires(Metric<Ms>&&...) {
    return stack([](auto i) { return T<i>::metricWeights(); });
  }
  static Scalar injectivityRadius() requires(Metric<Ms>&&...) {
    Scalar least(std::numeric_limits<double>::infinity());
    forEachIndex<sizeof...(Ms)>([&](auto i) {
      const Scalar r(T<i>::injectivityRadius());
      least = select(r < least, r, least);
    });
    return least;
  }
  static Scalar maxSectionalCurvature() requires(Metric<Ms>&&...) {
    Scalar largest(0);
    forEachIndex<sizeof...(Ms)>([&](auto i) {
      const Scalar c(T<i>::maxSectionalCurvature());
      largest = select(c > largest, c, largest);
    });
    return largest;
  }
  static Square hessianHalfSquaredDistance(const Tangent& z) requires(Metric<Ms>&&...) {
    return blocks([&](auto i) { return T<i>::hessianHalfSquaredDistance(M::template tangentBlock<i>(z)); });
  }
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) requires(DifferentiatesDlog<Ms>&&...) {
    return blocks([&](auto i) {
      return T<i>::dlogFeatureTransposed(M::template tangentBlock<i>(z), M::template tangentBlock<i>(a));
    });
  }
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) requires(DifferentiatesDlog<Ms>&&...) {
    return blocks([&](auto i) {
      return T<i>::dlogBaseTransposed(M::template tangentBlock<i>(z), M::template tangentBlock<i>(a));
    });
  }
  static VolumeElement<Scalar, DoF> logVolume(const Tangent& z) requires(HasLogVolume<Ms>&&...) {
    VolumeElement<Scalar, DoF> v;
    forEachIndex<sizeof...(Ms)>([&](auto i) {
      const auto part = T<i>::logVolume(M::template tangentBlock<i>(z));
      v.value += part.value;
      M::template tangentBlock<i>(v.gradient) = part.gradient;
      M::template covarianceBlock<i, i>(v.hessian) = part.hessian;
    });
    return v;
  }

 private:
  template <class Type, class F>
  static Type make(const F& part) {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return Type(part(std::integral_constant<std::size_t, I>{})...);
    }
    (std::make_index_sequence<sizeof...(Ms)>{});
  }
  template <class F>
  static Tangent stack(const F& part) {
    Tangent v;
    forEachIndex<sizeof...(Ms)>([&](auto i) { M::template tangentBlock<i>(v) = part(i); });
    return v;
  }
  template <class F>
  static Square blocks(const F& block) {
    return blockDiagonal<Scalar>(Sizes{}, Sizes{}, block);
  }
};

}  // namespace detail

template <class... Ms>
struct ManifoldTraits<Product<Ms...>> : detail::ProductManifold<Product<Ms...>, Ms...> {};

/// The group acts on itself, by what its parts' traits say of them.
template <class... Gs>
  requires(Homogeneous<Gs>&&...)
struct ManifoldTraits<ProductGroup<Gs...>> : detail::ProductManifold<ProductGroup<Gs...>, Gs...> {};

}  // namespace liestat

// Structured bindings: auto [a, b] = x;
template <class... Ms>
struct std::tuple_size<liestat::Product<Ms...>> : std::integral_constant<std::size_t, sizeof...(Ms)> {};
template <std::size_t I, class... Ms>
struct std::tuple_element<I, liestat::Product<Ms...>> : std::tuple_element<I, std::tuple<Ms...>> {};
template <class... Gs>
struct std::tuple_size<liestat::ProductGroup<Gs...>> : std::integral_constant<std::size_t, sizeof...(Gs)> {};
template <std::size_t I, class... Gs>
struct std::tuple_element<I, liestat::ProductGroup<Gs...>> : std::tuple_element<I, std::tuple<Gs...>> {};
