// The implicit filter at fixed sizes, for comparison: what the library did before its core was compiled once
// (stats/detail/filter_core.hpp), for updates that do not fail.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_reduced.hpp>
#include <stats/detail/measurement_block.hpp>
#include <stats/implicit_ekf.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat_test {

using namespace liestat;

template <Homogeneous X>
class ReferenceEkf {
  static constexpr int N = ManifoldTraits<X>::DoF;

 public:
  Gaussian<X> state;
  ImplicitEkfOptions options;

  template <Homogeneous M, class Noise, class Equation>
  auto update(const M& y, const Noise& noise, const Equation& equation, double gate) {
    constexpr int P = detail::equation_count<Equation, X, M>, K = ManifoldTraits<M>::DoF;
    DenseFilterUpdate<X, P> result;
    const SquareOf<X> prior = state.covariance;
    TangentOf<X> v = TangentOf<X>::Zero();
    Eigen::Matrix<double, K, 1> w = Eigen::Matrix<double, K, 1>::Zero();
    Gaussian<X> posterior = state;
    for (bool settled = false; result.iterations < options.max_iterations && !settled;) {
      const bool first = result.iterations++ == 0;
      const EquationDerivatives<P, N, K> J = linearized(equation, v, y, w);
      const Eigen::Matrix<double, P, 1> r = J.value - J.by_parameter * v - J.by_measurement * w;
      const Eigen::Matrix<double, N, P> PC = prior * J.by_parameter.transpose();
      const Eigen::Matrix<double, K, P> RD = noise.template spread<P>(J.by_measurement);
      const Eigen::Matrix<double, P, P> S = J.by_parameter * PC + J.by_measurement * RD;
      const detail::ReducedRoot<double, P> root(S, detail::Pivoting::largest, detail::equationRank<Equation, P>());
      const Eigen::Matrix<double, P, 1> whitened = root.template halfSolve<1>(r);
      const Eigen::Matrix<double, P, 1> multipliers = root.halfSolveTransposed(whitened);
      const TangentOf<X> next = -PC * multipliers;
      settled = !first && hasSettled(next, v);
      v = next, w = -RD * multipliers;
      if (first) {
        result.innovation = r, result.innovation_covariance = S, result.step = v;
        result.nis = whitened.squaredNorm(), result.degrees_of_freedom = root.rank();
        result.gated = !(result.nis <= gate);
        result.status = FilterStatus::gated;
        if (result.gated > 0) return result;
      }
      if (!first && !settled) continue;
      const Eigen::Matrix<double, P, N> half = root.template halfSolve<N>(PC.transpose());
      Eigen::Matrix<double, N, P> gain;
      for (int i = 0; i < N; ++i) gain.row(i) = root.halfSolveTransposed(half.col(i)).transpose();
      const SquareOf<X> left = SquareOf<X>::Identity() - gain * J.by_parameter;
      const Eigen::Matrix<double, N, K> by_noise = gain * J.by_measurement;
      posterior = moved(v, left * prior * left.transpose() + by_noise * noise.template spread<N>(by_noise));
      result.step = v;
      result.status = settled || options.max_iterations == 1 ? FilterStatus::ok : FilterStatus::not_converged;
    }
    result.measurements = 1;
    state = posterior;
    return result;
  }

  template <class M, class Noise, class EquationOf>
  FilterUpdate<X> updateAll(const std::vector<M>& measured, const Noise& noise, const EquationOf& equation_of,
                            double gate) {
    using Equation = decltype(equation_of(0));
    constexpr int P = detail::equation_count<Equation, X, M>, K = ManifoldTraits<M>::DoF;
    using Block = detail::MeasurementBlock<P, N, K>;
    FilterUpdate<X> result;
    const SquareOf<X> prior = detail::Cholesky<double, N>(state.covariance).inverse();
    TangentOf<X> v = TangentOf<X>::Zero();
    Gaussian<X> posterior = state;
    for (bool settled = false; result.iterations < options.max_iterations && !settled;) {
      const bool first = result.iterations++ == 0;
      SquareOf<X> A = prior;
      TangentOf<X> b = TangentOf<X>::Zero();
      double squared = 0;
      for (std::size_t i = 0; i < measured.size(); ++i) {
        Block block;
        typename Block::Correction w = Block::Correction::Zero();
        const auto build = [&](const TangentOf<X>& at) {
          const EquationDerivatives<P, N, K> J = linearized(equation_of(i), at, measured[i], w);
          block.build(noise, J.value, J.by_parameter, J.by_measurement, w, detail::equationRank<Equation, P>());
        };
        build(TangentOf<X>::Zero());
        const Eigen::Matrix<double, P, P> S =
            Eigen::Matrix<double, P, P>::Identity() + block.C * state.covariance * block.C.transpose();
        if (!(detail::Cholesky<double, P>(S).template halfSolve<1>(block.r).squaredNorm() <= gate)) {
          result.gated += first;
          continue;
        }
        for (int k = 0; k < 10 && !first; ++k) {
          build(v);
          const typename Block::Correction next = block.correction(Block::Step::Zero());
          const bool found = !((next - w).norm() > 1e-10 * next.norm());
          w = next;
          if (found) break;
        }
        if (!first) build(v);
        A += block.C.transpose() * block.C;
        b += block.C.transpose() * (block.r + block.C * v);
        squared += block.r.squaredNorm();
        if (first) result.degrees_of_freedom += block.root.rank(), ++result.measurements;
      }
      const detail::Cholesky<double, N> information(A);
      const TangentOf<X> next = information.template solve<1>(b);
      settled = !first && hasSettled(next, v);
      v = next;
      if (first) result.nis = squared - b.dot(v);
      if (!first && !settled) continue;
      posterior = moved(v, information.inverse());
      result.step = v;
      result.status = settled || options.max_iterations == 1 ? FilterStatus::ok : FilterStatus::not_converged;
    }
    state = posterior;
    return result;
  }

 private:
  template <class Equation, class M, class Correction>
  auto linearized(const Equation& equation, const TangentOf<X>& v, const M& y, const Correction& w) const {
    auto J = equation.linearize(exp(state.mean, v), exp(y, w));
    J.by_parameter *= detail::expJacobian(state.mean, v);
    J.by_measurement *= detail::expJacobian(y, w);
    return J;
  }
  bool hasSettled(const TangentOf<X>& next, const TangentOf<X>& v) const {
    double largest = 0;
    for (int i = 0; i < N; ++i) {
      largest = std::max(largest, std::abs(next[i] - v[i]) / std::sqrt(state.covariance(i, i)));
    }
    return largest <= options.tolerance;
  }
  Gaussian<X> moved(const TangentOf<X>& v, const SquareOf<X>& covariance) const {
    const SquareOf<X> J = detail::expJacobian(state.mean, v);
    return {exp(state.mean, v), J * covariance * J.transpose()};
  }
};

}  // namespace liestat_test
