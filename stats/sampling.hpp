// Random features from counter-based random numbers: Gaussian, and with any orientation at places in a cube.
#pragma once

#include <lie/lie.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/gaussian.hpp>
#include <stats/random.hpp>

namespace liestat {

/// Draws mean·exp(e), e ~ N(0, covariance): the noise model of Pennec 1998, section 5. The covariance may be singular.
template <Homogeneous M>
M sample(const Gaussian<M>& g, CounterRng& rng) {
  constexpr int N = ManifoldTraits<M>::DoF;
  const TangentOf<M> standard = rng.normalVector<N>().template cast<ScalarOf<M>>();
  return exp(g.mean, TangentOf<M>(detail::SemidefiniteRoot<ScalarOf<M>, N>(g.covariance) * standard));
}

namespace detail {

/// A transformation whose rotations are uniform and whose translations are uniform in a cube.
template <LieGroup G>
G uniformTransformation(CounterRng& rng, double half_width) {
  using S = typename G::Scalar;
  const auto inCube = [&]<int N>(std::integral_constant<int, N>) {
    Eigen::Matrix<S, N, 1> v;
    for (int i = 0; i < N; ++i) v[i] = S(half_width * (2 * rng.uniform() - 1));
    return v;
  };
  constexpr std::integral_constant<int, 2> plane{};
  constexpr std::integral_constant<int, 3> space{};
  if constexpr (requires { G::num_parts; }) {
    G g;
    forEachIndex<G::num_parts>([&](auto i) {
      using Part = typename G::template Part<i>;
      g.template get<i>() = uniformTransformation<Part>(rng, half_width);
    });
    return g;
  } else if constexpr (requires(const G& g) { g.scale(); }) {  // the logarithm of the scale is uniform too
    G g = G::sampleUniform(rng);
    if constexpr (requires { g.translation(); }) g.translation() *= S(half_width);
    return g;
  } else if constexpr (std::is_constructible_v<G, Eigen::Quaternion<S>>) {  // SO3
    return G(rng.unitQuaternion().cast<S>());
  } else if constexpr (G::DoF == 9 && requires(const G& g) { g.velocity(); }) {  // SE23
    const Eigen::Quaternion<S> q = rng.unitQuaternion().cast<S>();
    const Eigen::Matrix<S, 3, 1> position = inCube(space);
    return G(q, position, inCube(space));
  } else if constexpr (G::DoF == 6 && requires(const G& g) { g.so3(); }) {  // SE3
    const Eigen::Quaternion<S> q = rng.unitQuaternion().cast<S>();
    return G(q, inCube(space));
  } else if constexpr (G::DoF == 3 && requires(const G& g) { g.so2(); }) {  // SE2
    const S angle = S(EIGEN_PI * (2 * rng.uniform() - 1));
    return G(angle, inCube(plane));
  } else if constexpr (G::DoF == 1 && requires(const G& g) { g.unit_complex(); }) {  // SO2
    return G(S(EIGEN_PI * (2 * rng.uniform() - 1)));
  } else {  // translations
    return G::exp(inCube(std::integral_constant<int, G::DoF>{}));
  }
}

}  // namespace detail

/// A feature whose orientation is uniform and whose position is uniform in the cube [-half_width, half_width]^d (m);
/// where there is a scale, its logarithm to base 2 is uniform in [-1, 1]. (A group's static
/// sampleUniform(generator), which is Sophus', takes any generator, has no width and draws other numbers.)
template <Homogeneous M>
M sampleInCube(CounterRng& rng, double half_width = 1) {
  using T = ManifoldTraits<M>;
  return T::act(detail::uniformTransformation<typename T::Group>(rng, half_width), T::origin());
}

}  // namespace liestat
