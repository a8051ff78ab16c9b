// Random features: Gaussian and uniform, from counter-based random numbers.
#pragma once

#include <lie/lie.hpp>
#include <stats/gaussian.hpp>
#include <stats/random.hpp>

#include <Eigen/Cholesky>

namespace liestat {

/// Draws mean·exp(e), e ~ N(0, covariance): the noise model of Pennec 1998, section 5. The covariance may be singular.
template <Homogeneous M>
M sample(const Gaussian<M>& g, CounterRng& rng) {
  constexpr int N = ManifoldTraits<M>::DoF;
  // LDLᵀ with pivoting factors semi-definite matrices too.
  const Eigen::LDLT<SquareOf<M>> factor(g.covariance);
  const TangentOf<M> standard = rng.normalVector<N>().template cast<ScalarOf<M>>();
  TangentOf<M> e = factor.vectorD().cwiseMax(ScalarOf<M>(0)).cwiseSqrt().cwiseProduct(standard);
  e = factor.matrixL() * e;
  e = factor.transpositionsP().transpose() * e;
  return exp(g.mean, e);
}

/// A feature whose orientation is uniform and whose position is uniform in the cube [-half_width, half_width]^d (m).
template <Homogeneous M>
M sampleUniform(CounterRng& rng, double half_width = 1) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  const auto position = [&](int dimension) {
    Eigen::VectorXd v(dimension);
    for (int i = 0; i < dimension; ++i) v[i] = half_width * (2 * rng.uniform() - 1);
    return v;
  };
  using Group = typename T::Group;
  if constexpr (requires { typename Group::Quaternion; }) {  // SO3 acts
    return T::act(Group(rng.unitQuaternion().cast<S>()), T::origin());
  } else if constexpr (Group::DoF == 6 && requires(Group g) { g.so3(); }) {  // SE3 acts
    const Eigen::Quaternion<S> q = rng.unitQuaternion().cast<S>();
    return T::act(Group(q, position(3).template cast<S>()), T::origin());
  } else if constexpr (requires(Group g) { g.so2(); }) {  // SE2 acts
    const S angle = S(EIGEN_PI * (2 * rng.uniform() - 1));
    return T::act(Group(angle, position(2).template cast<S>()), T::origin());
  } else if constexpr (requires(Group g) { g.unit_complex(); }) {  // SO2 acts
    return T::act(Group(S(EIGEN_PI * (2 * rng.uniform() - 1))), T::origin());
  } else {  // translations
    return T::act(Group::exp(position(T::DoF).template cast<S>()), T::origin());
  }
}

}  // namespace liestat
