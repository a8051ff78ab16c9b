// Preintegrated motions as factors for Ceres (needs Ceres 2.1; nothing else in fusion/ does).
//
//   problem.AddParameterBlock(state.data(), 10, new liestat::CeresManifold<liestat::SE23d>);   // lie/compat/ceres.hpp
//   problem.AddResidualBlock(new liestat::PreintegrationCost(motion), nullptr, first.data(), second.data(),
//                            bias.data(), gravity.data());
//   problem.SetParameterBlockConstant(gravity.data());
//
// States are the parameters of SE23 (quaternion x y z w, position, velocity), biases six numbers (gyroscope rad/s,
// accelerometer m/s²), gravity three (m/s², in the axes of the states' world; on a sphere or constant where its length
// is known).
#pragma once

#include <fusion/imu/factor.hpp>
#include <lie/detail/small_matrix.hpp>

#include <ceres/sized_cost_function.h>

namespace liestat {
namespace detail {

inline SE23d readState(const double* data) { return SE23d::fromParams(Eigen::Map<const SE23d::Params>(data)); }
inline ImuBias<double> readBias(const double* data) {
  return {Eigen::Map<const Eigen::Vector3d>(data), Eigen::Map<const Eigen::Vector3d>(data + 3)};
}
/// By the parameters of a state from by its tangent: along what leaves the group, Ceres' manifold takes nothing.
inline Eigen::Matrix<double, 9, 10> byParameters(const Eigen::Matrix<double, 9, 9>& by_tangent, const SE23d& state) {
  return by_tangent * state.Dx_log_this_inv_by_x_at_this();
}

/// L⁻¹ J to where Ceres wants it, if it does.
template <int N, int K>
void writeWhitened(double* target, const Cholesky<double, N>& factor, const Eigen::Matrix<double, N, K>& J) {
  if (target == nullptr) return;
  Eigen::Map<Eigen::Matrix<double, N, K, Eigen::RowMajor>> result(target);
  result = factor.halfSolve(J);
}

}  // namespace detail

/// The residual of preintegrationResidual() divided by its standard deviations, L⁻¹ r with L Lᵀ the increment's
/// covariance: nine residuals of variance one. Parameter blocks: first state (10), second state (10), bias (6), gravity
/// (3). Evaluation fails, which Ceres reports, where the covariance is not positive definite: an increment without
/// noise or of no duration.
class PreintegrationCost final : public ceres::SizedCostFunction<9, 10, 10, 6, 3> {
 public:
  explicit PreintegrationCost(const Preintegration<double>& motion)
      : motion_(motion), factor_(motion.gaussian().covariance) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    if (!factor_.ok()) return false;
    const SE23d first = detail::readState(parameters[0]), second = detail::readState(parameters[1]);
    const Eigen::Vector3d gravity = Eigen::Map<const Eigen::Vector3d>(parameters[3]);
    const auto r = preintegrationResidual(motion_, first, second, detail::readBias(parameters[2]), gravity);
    Eigen::Map<Eigen::Matrix<double, 9, 1>> value(residuals);
    value = factor_.halfSolve(r.value);
    if (jacobians != nullptr) {
      detail::writeWhitened(jacobians[0], factor_, detail::byParameters(r.by_first, first));
      detail::writeWhitened(jacobians[1], factor_, detail::byParameters(r.by_second, second));
      detail::writeWhitened(jacobians[2], factor_, r.by_bias);
      detail::writeWhitened(jacobians[3], factor_, r.by_gravity);
    }
    return value.allFinite();
  }

 private:
  Preintegration<double> motion_;
  detail::Cholesky<double, 9> factor_;
};

/// The same with biases that walk: besides the nine, the six changes of the biases, all divided by the root of
/// covarianceWithBias(). Fifteen residuals; parameter blocks: first state (10), its bias (6), second state (10), its
/// bias (6), gravity (3). Both walks must have a density, or evaluation fails.
class PreintegrationWalkCost final : public ceres::SizedCostFunction<15, 10, 6, 10, 6, 3> {
 public:
  explicit PreintegrationWalkCost(const Preintegration<double>& motion)
      : motion_(motion), factor_(motion.covarianceWithBias()) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    if (!factor_.ok()) return false;
    const SE23d first = detail::readState(parameters[0]), second = detail::readState(parameters[2]);
    const Eigen::Vector3d gravity = Eigen::Map<const Eigen::Vector3d>(parameters[4]);
    const auto r = preintegrationResidual(motion_, first, second, detail::readBias(parameters[1]), gravity);
    Eigen::Matrix<double, 15, 1> whole;
    whole.head<9>() = r.value;
    for (int i = 0; i < 6; ++i) whole[9 + i] = parameters[3][i] - parameters[1][i];
    Eigen::Map<Eigen::Matrix<double, 15, 1>> value(residuals);
    value = factor_.halfSolve(whole);
    if (jacobians != nullptr) {
      write<10>(jacobians[0], detail::byParameters(r.by_first, first), 0);
      write<6>(jacobians[1], r.by_bias, -1);
      write<10>(jacobians[2], detail::byParameters(r.by_second, second), 0);
      write<6>(jacobians[3], Eigen::Matrix<double, 9, 6>::Zero(), 1);
      write<3>(jacobians[4], r.by_gravity, 0);
    }
    return value.allFinite();
  }

 private:
  /// [J; s I], whitened.
  template <int K>
  void write(double* target, const Eigen::Matrix<double, 9, K>& J, double s) const {
    Eigen::Matrix<double, 15, K> whole = Eigen::Matrix<double, 15, K>::Zero();
    whole.template topRows<9>() = J;
    if constexpr (K == 6) whole.template bottomRows<6>().diagonal().setConstant(s);
    detail::writeWhitened(target, factor_, whole);
  }

  Preintegration<double> motion_;
  detail::Cholesky<double, 15> factor_;
};

}  // namespace liestat
