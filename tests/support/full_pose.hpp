// Poses whose covariances show every mistake: full, of any eigenvalues, far from isotropic.
#pragma once

#include <lie/se3.hpp>
#include <stats/gaussian.hpp>
#include <stats/random.hpp>

#include <cmath>

namespace liestat_test {

using liestat::CounterRng, liestat::Gaussian, liestat::SE3d, liestat::SO3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A rotation of 1 rad or so, a position 2 m away, a full covariance of condition 14/0.8 or less, scaled.
inline Gaussian<SE3d> fullGaussian(CounterRng& rng, double scale = 1) {
  const SE3d T(SO3d::exp(rng.unitVector<3>() * rng.uniform(0.7, 1.3)), 2 * rng.unitVector<3>());
  Matrix6 V = 0.8 * Matrix6::Identity();
  for (const double eigenvalue : {2.0, 4.0, 7.2}) {
    const Vector6 u = rng.unitVector<6>();
    V += eigenvalue * u * u.transpose();
  }
  return {T, scale * V};
}

/// The largest |A - B| of an entry (i, j) in units of σ_i σ_j of B.
inline double scaledGap(const Matrix6& A, const Matrix6& B) {
  double largest = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double gap = std::abs(A(i, j) - B(i, j)) / std::sqrt(B(i, i) * B(j, j));
      if (!(gap <= largest)) largest = gap;  // NaN stays
    }
  }
  return largest;
}

}  // namespace liestat_test
