// Is a propagated covariance the one that the function's own derivative, and errors put through the function, have?
// The checks see the function from coordinates to coordinates, so they are compiled once for all manifolds.
#pragma once

#include <lie/testing.hpp>
#include <stats/propagation.hpp>
#include <stats/random.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace liestat_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Positive definite, of some sd².
inline MatrixXd randomCovariance(liestat::CounterRng& rng, int n, double sd) {
  MatrixXd A(n, n);
  for (int i = 0; i < n * n; ++i) A.data()[i] = rng.normal();
  return sd * sd * (A * A.transpose() / n + 0.2 * MatrixXd::Identity(n, n));
}

/// An element of a group with some covariance.
template <class G>
liestat::Gaussian<G> randomGaussian(liestat::CounterRng& rng, double sd) {
  return {G::sampleUniform(rng), randomCovariance(rng, G::DoF, sd)};
}

/// Two features and the covariance of both errors together.
template <class A, class B>
struct Pair {
  static constexpr int n_a = liestat::ManifoldTraits<A>::DoF, n_b = liestat::ManifoldTraits<B>::DoF;
  liestat::Gaussian<A> a;
  liestat::Gaussian<B> b;
  MatrixXd joint;

  Pair(const A& at_a, const B& at_b, liestat::CounterRng& rng, double sd)
      : joint(randomCovariance(rng, n_a + n_b, sd)) {
    a = {at_a, joint.topLeftCorner(n_a, n_a)};
    b = {at_b, joint.bottomRightCorner(n_b, n_b)};
  }
  liestat::CrossCovariance<A, B> cross() const { return joint.topRightCorner(n_a, n_b); }
  /// Joint covariance of independent errors.
  MatrixXd independent() const {
    MatrixXd m = joint;
    m.topRightCorner(n_a, n_b).setZero();
    m.bottomLeftCorner(n_b, n_a).setZero();
    return m;
  }
};

/// f(a, b) in local coordinates: errors of the inputs to the error of the result.
template <class A, class B, class N, class F>
std::function<VectorXd(const VectorXd&)> inCoordinates(const Pair<A, B>& p, const N& value, const F& f) {
  return [=](const VectorXd& e) -> VectorXd {
    const liestat::TangentOf<A> e_a = e.head(Pair<A, B>::n_a);
    const liestat::TangentOf<B> e_b = e.tail(Pair<A, B>::n_b);
    return liestat::log(value, N(f(A(liestat::exp(p.a.mean, e_a)), B(liestat::exp(p.b.mean, e_b)))));
  };
}

/// The covariance is J Σ Jᵀ with the derivative by differences. These are right to some 1e-10 of the derivative.
inline void expectDerivative(const std::function<VectorXd(const VectorXd&)>& f, const MatrixXd& covariance,
                             const MatrixXd& propagated, const char* what) {
  const MatrixXd J = liestat::detail::centralDifferences(f, covariance.rows(), 1e-3);
  const MatrixXd expected = J * covariance * J.transpose();
  EXPECT_LT((propagated - expected).norm(), 1e-9 * expected.norm()) << what;
}

/// Errors of that covariance, put through f, have the propagated one. 4000 draws: the standard error of an entry of the
/// whitened covariance is √(2/4000) at most; five of them are a false alarm in 3e-5 of the seeds for 45 entries. Errors
/// of 1e-3 have a second order of no account.
inline void expectSampled(const std::function<VectorXd(const VectorXd&)>& f, const MatrixXd& covariance,
                          const MatrixXd& propagated, liestat::CounterRng& rng, const char* what) {
  constexpr int trials = 4000;
  const MatrixXd root = covariance.llt().matrixL();
  const Eigen::LLT<MatrixXd> whitening(propagated);
  MatrixXd sum = MatrixXd::Zero(propagated.rows(), propagated.rows());
  VectorXd e(covariance.rows());
  for (int i = 0; i < trials; ++i) {
    for (double& x : e) x = rng.normal();
    const VectorXd z = whitening.matrixL().solve(f(root * e));
    sum += z * z.transpose() / trials;
  }
  sum.diagonal().array() -= 1;
  EXPECT_LT(sum.cwiseAbs().maxCoeff(), 5 * std::sqrt(2.0 / trials)) << what;
}

/// The same Gaussian, up to the rounding of some products of numbers of the size of one.
template <class M>
void expectSame(const liestat::Gaussian<M>& g, const liestat::Gaussian<M>& expected, const char* what) {
  EXPECT_LT(liestat::log(expected.mean, g.mean).norm(), 1e-13) << what;
  EXPECT_LT((g.covariance - expected.covariance).norm(), 1e-13 * (1 + expected.covariance.norm())) << what;
}

}  // namespace liestat_test
