// Constrained estimation at fixed sizes, for comparison: plain Gauss–Newton steps, each measurement by
// detail::MeasurementBlock, the step of the parameter by a dense decomposition. No line search and no curvature, so that it
// converges from near by and where residuals are small.
#pragma once

#include <stats/constrained.hpp>
#include <stats/detail/measurement_block.hpp>

#include <Eigen/Dense>

#include <cstddef>
#include <vector>

namespace liestat_test {

using namespace liestat;

template <class Q, class Channel>
struct ReferenceEstimate {
  using Front = detail::ChannelFront<Q, Channel>;
  static constexpr int N = Front::N, K = Front::K, P = Front::P;
  using Block = detail::MeasurementBlock<P, N, K>;

  Q parameter;
  std::vector<Eigen::Matrix<double, K, 1>> corrections;
  Eigen::Matrix<double, N, N> information, covariance;
  double chi2 = 0;

  template <class Constraint>
  ReferenceEstimate(const Q& start, const Channel& channel, const Constraint& constraint, int steps = 40)
      : parameter(start), corrections(channel.size(), Eigen::Matrix<double, K, 1>::Zero()) {
    std::vector<Block> blocks(channel.size());
    for (int step = 0; step < steps; ++step) {
      information.setZero();
      Eigen::Matrix<double, N, 1> b = Eigen::Matrix<double, N, 1>::Zero();
      for (std::size_t i = 0; i < channel.size(); ++i) {
        const auto& m = channel.measurements[i];
        const auto at = exp(m, corrections[i]);
        const auto J = channel.equationOf(i).linearize(parameter, at);
        using M = typename Channel::Measurement;
        blocks[i].build(channel.noiseOf(i), J.value, J.by_parameter,
                        detail::inCoordinatesAt<M, P>(m, at, J.by_measurement), corrections[i],
                        detail::equationRank<typename Channel::Equation, P>());
        information += blocks[i].C.transpose() * blocks[i].C;
        b += blocks[i].C.transpose() * blocks[i].r;
      }
      const Eigen::VectorXd delta = solved(constraint, b);
      parameter = exp(parameter, TangentOf<Q>(delta));
      chi2 = 0;
      for (std::size_t i = 0; i < channel.size(); ++i) {
        corrections[i] = blocks[i].correction(delta);
        chi2 += channel.noiseOf(i).squaredNorm(corrections[i]);
      }
    }
  }

 private:
  template <class Constraint>
  Eigen::VectorXd solved(const Constraint& constraint, const Eigen::Matrix<double, N, 1>& b) {
    Eigen::MatrixXd G(0, N);
    Eigen::VectorXd c(0);
    if constexpr (!std::is_same_v<Constraint, NoConstraint>) {
      const auto J = constraint.linearize(parameter);
      G = J.by_parameter, c = J.value;
    }
    // In units of the information, so that the system is as well conditioned as the problem.
    const double unit = information.norm();
    const Eigen::Index p = G.rows();
    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(N + p, N + p);
    kkt << information / unit, G.transpose(), G, Eigen::MatrixXd::Zero(p, p);
    Eigen::VectorXd right(N + p);
    right << b / unit, -c;
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor(kkt);
    covariance = factor.pseudoInverse().topLeftCorner(N, N) / unit;
    return factor.solve(right).head(N);
  }
};

}  // namespace liestat_test
