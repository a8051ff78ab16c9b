// A covariance in another convention by sampling, for rotations so large that the first order fails (needs Random123).
#pragma once

#include <stats/convention_charts.hpp>
#include <stats/random.hpp>

#include <lie/detail/small_matrix.hpp>

#include <cmath>
#include <cstdint>
#include <limits>

namespace liestat {

/// Second moments of an error in a convention's coordinates, with their sampling error.
struct SampledMoments {
  Eigen::Matrix<double, 6, 6> second_moment;  ///< E[x xᵀ]: mean² included, so that E[xᵀ M⁻¹ x] = 6
  Eigen::Matrix<double, 6, 1> mean;           ///< E[x]; zero to first order
  /// Standard error of the diagonal of second_moment, relative to it, the largest.
  double relative_error = 0;
};

/// The moments in convention `to` of an error that is N(0, covariance) in the coordinates of `from` at T_hat. Draws are
/// functions of (seed, trial) alone and come in pairs of opposite sign; the linear part is exact and only what the first
/// order leaves out is sampled, so that small errors need few samples. NaN if the covariance has unknown entries.
/// docs/theory/conventions.md, section 5.3.
inline SampledMoments sampledConversion(const Convention& from, const Convention& to, const SE3d& T_hat,
                                        const Eigen::Matrix<double, 6, 6>& covariance, int samples, std::uint64_t seed,
                                        std::uint64_t trial) {
  using Vector = Eigen::Matrix<double, 6, 1>;
  using Matrix = Eigen::Matrix<double, 6, 6>;
  SampledMoments moments;
  if (!covariance.allFinite()) {
    moments.second_moment.setConstant(std::numeric_limits<double>::quiet_NaN());
    moments.mean.setConstant(std::numeric_limits<double>::quiet_NaN());
    return moments;
  }
  const Matrix J = detail::product(conventionJacobian(to, T_hat), conventionJacobianInverse(from, T_hat));
  const detail::SemidefiniteRoot<double, 6> root(covariance);
  CounterRng rng(seed, trial);
  Matrix excess = Matrix::Zero();
  Vector sum = Vector::Zero(), squares = Vector::Zero();
  const int pairs = std::max(1, samples / 2);
  for (int k = 0; k < pairs; ++k) {
    const Vector x = root * rng.normalVector<6>(), linear = J * x;
    const Vector a = conventionLog(to, T_hat, conventionExp(from, T_hat, x));
    const Vector b = conventionLog(to, T_hat, conventionExp(from, T_hat, Vector(-x)));
    Vector difference;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) excess(i, j) += 0.5 * (a[i] * a[j] + b[i] * b[j]) - linear[i] * linear[j];
      difference[i] = 0.5 * (a[i] * a[i] + b[i] * b[i]) - linear[i] * linear[i];
    }
    squares += difference.cwiseAbs2();
    sum += 0.5 * (a + b);
  }
  moments.mean = sum / pairs;
  excess /= pairs;
  moments.second_moment = detail::congruence(J, covariance) + excess;
  for (int i = 0; i < 6; ++i) {
    const double variance = std::max(0.0, squares[i] / pairs - excess(i, i) * excess(i, i));
    const double error = std::sqrt(variance / pairs) / moments.second_moment(i, i);
    if (error > moments.relative_error) moments.relative_error = error;
  }
  return moments;
}

}  // namespace liestat
