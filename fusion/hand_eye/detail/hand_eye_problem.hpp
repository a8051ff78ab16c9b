// The equations of hand-eye calibration, Log(X⁻¹ A⁻¹ Y B) = 0, their derivatives, and the sums over the pairs that a
// Gauss–Newton step and the question what the motions determine are made of.
#pragma once

#include <fusion/hand_eye.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat::detail {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// X and Y; for AX = XB both are the same.
struct HandEyeValue {
  SE3d X, Y;
};

inline Vector6 handEyeError(const HandEyeValue& at, const SE3d& A, const SE3d& B) {
  return (at.X.inverse() * A.inverse() * at.Y * B).log();
}

/// Derivatives of the error: e(X·Exp(x), Y·Exp(y), A·Exp(a), B·Exp(b)) = e + X x + Y y + A a + B b + O(²).
struct HandEyeJacobians {
  Vector6 e;
  Matrix6 X, Y, A, B;

  HandEyeJacobians(const HandEyeValue& at, const SE3d& a, const SE3d& b) : e(handEyeError(at, a, b)) {
    const Matrix6 left = SE3d::leftJacobianInverse(e);
    B = SE3d::rightJacobianInverse(e);
    X = -left;
    A = -product(left, at.X.inverse().Adj());
    Y = product(B, b.inverse().Adj());
  }
};

/// True for covariances that are positive semidefinite and together have the ranks that errors of a pose need: six,
/// three of them of the rotation, which translations do not move.
inline bool coverAllDirections(const Matrix6& a, const Matrix6& b) {
  const auto rankOf = [](const Matrix6& V) {
    if (!V.allFinite()) return -1;
    if (Cholesky<double, 6>(V).ok()) return 6;
    const SemidefiniteParts<6> parts(V);
    return parts.valid ? 6 - parts.null_dimension : -1;
  };
  const auto open = [](const Matrix6& V) {
    return SemidefiniteParts<3>(Eigen::Matrix3d(V.bottomRightCorner<3, 3>())).null_dimension;
  };
  const int of_a = rankOf(a), of_b = rankOf(b);
  if (of_a < 0 || of_b < 0) return false;
  return of_a + of_b >= 6 && (of_a + of_b == 12 || open(a) + open(b) <= 3);
}

/// Sums over pairs at one value. Blocks y, y for both kinds of problem; of AX = XB `x` is not used.
struct HandEyeSums {
  Matrix6 xx = Matrix6::Zero(), xy = Matrix6::Zero(), yy = Matrix6::Zero();
  Vector6 x = Vector6::Zero(), y = Vector6::Zero();
  double cost = 0;  ///< Σ eᵀ S⁻¹ e

  /// Adds a pair with the error e and the factor of S.
  void add(const HandEyeJacobians& J, const Cholesky<double, 6>& S, const Vector6& error, bool world) {
    const Vector6 e = S.halfSolve<1>(error);
    const Matrix6 by_y = S.halfSolve<6>(world ? J.Y : Matrix6(J.X + J.Y));
    yy += product(by_y.transpose(), by_y);
    y += product(by_y.transpose(), e);
    if (world) {
      const Matrix6 by_x = S.halfSolve<6>(J.X);
      xx += product(by_x.transpose(), by_x);
      xy += product(by_x.transpose(), by_y);
      x += product(by_x.transpose(), e);
    }
    cost += e.squaredNorm();
  }
};

/// The factor of S, the covariance of the error of a pair.
inline Cholesky<double, 6> handEyeErrorFactor(const Matrix6& by_a, const Matrix6& by_b, const PosePair& pair) {
  return Cholesky<double, 6>(congruence(by_a, pair.a.covariance) + congruence(by_b, pair.b.covariance));
}

/// eᵀ S⁻¹ e; NaN where S is singular.
inline double handEyeSquaredError(const HandEyeValue& at, const PosePair& pair) {
  const HandEyeJacobians J(at, pair.a.mean, pair.b.mean);
  return handEyeErrorFactor(J.A, J.B, pair).halfSolve<1>(J.e).squaredNorm();
}

/// Normal equations of Σ eᵀ S⁻¹ e over the pairs of an index list.
template <class Indices>
HandEyeSums handEyeSums(const HandEyeValue& at, const PosePairList& pairs, const Indices& indices, bool world) {
  HandEyeSums sums;
  for (const std::size_t i : indices) {
    const PosePair pair = pairs[i];
    const HandEyeJacobians J(at, pair.a.mean, pair.b.mean);
    sums.add(J, handEyeErrorFactor(J.A, J.B, pair), J.e, world);
  }
  return sums;
}

/// Σ eᵀ S⁻¹ e.
template <class Indices>
double handEyeCost(const HandEyeValue& at, const PosePairList& pairs, const Indices& indices) {
  double cost = 0;
  for (const std::size_t i : indices) cost += handEyeSquaredError(at, pairs[i]);
  return cost;
}

/// Information of the motions on Y (on X for AX = XB) once X is eliminated, against what the noise of B would say if
/// there were no motion at all.
struct HandEyeExcitation {
  Vector6 values;    ///< ascending, 1 is that of noise
  Matrix6 vectors;   ///< columns v, twists of Y (X for AX = XB), vᵀ N v = 1
  Matrix6 metric;    ///< N
  Matrix6 x_from_y;  ///< the twist of X that goes with one of Y
};

/// λ of L v = λ N v, where L = H_yy - H_yx H_xx⁻¹ H_xy is the information at the corrected poses and N that which their
/// remaining errors b ~ N(0, Σ_b - Σ_b S⁻¹ Σ_b) make up: Σ Ad(B⁻¹)ᵀ E[ad(b)ᵀ S⁻¹ ad(b)] Ad(B⁻¹), less one of the n
/// terms where X is eliminated, which takes a mean off. Without units; no eigenvalue of H says as much, because noise
/// alone makes H regular.
template <class Indices>
HandEyeExcitation handEyeExcitation(const HandEyeValue& at, const PosePairList& pairs, const Indices& indices,
                                    bool world) {
  Matrix6 L = Matrix6::Zero(), N = Matrix6::Zero(), xx = Matrix6::Zero(), xy = Matrix6::Zero();
  const Matrix6 to_camera = at.X.inverse().Adj();
  double n = 0;
  for (const std::size_t i : indices) {
    const PosePair pair = pairs[i];
    const Cholesky<double, 6> S = handEyeErrorFactor(to_camera, Matrix6::Identity(), pair);
    const Vector6 e = handEyeError(at, pair.a.mean, pair.b.mean);
    // To first order: B̂ = B·Exp(b), b = -Σ_b S⁻¹ e.
    const Vector6 b = -product(pair.b.covariance, S.solve<1>(e));
    const Matrix6 by_y = (pair.b.mean * SE3d::exp(b)).inverse().Adj();
    const Matrix6 spread = S.halfSolve<6>(pair.b.covariance);
    const SemidefiniteRoot<double, 6> root(pair.b.covariance - product(spread.transpose(), spread));
    Matrix6 noise = Matrix6::Zero();
    for (int k = 0; k < 6; ++k) {
      const Matrix6 ad = S.halfSolve<6>(SE3d::ad(root * Vector6(Vector6::Unit(k))));
      noise += product(ad.transpose(), ad);
    }
    N += congruence(by_y.transpose(), noise);
    const Matrix6 y = S.halfSolve<6>(world ? by_y : Matrix6(by_y - Matrix6::Identity()));
    L += product(y.transpose(), y);
    if (world) {
      const Matrix6 x = -S.halfSolve<6>(Matrix6::Identity());
      xx += product(x.transpose(), x);
      xy += product(x.transpose(), y);
    }
    ++n;
  }
  HandEyeExcitation result;
  // Where B is exact there is no such noise, and rounding decides.
  N.diagonal() += 1e-14 * L.diagonal() + Vector6::Constant(std::numeric_limits<double>::min());
  result.x_from_y = Matrix6::Identity();
  if (world) {
    N *= (n - 1) / n;
    result.x_from_y = -Cholesky<double, 6>(xx).solve<6>(xy);
    L += product(xy.transpose(), result.x_from_y);
  }
  result.metric = N;
  const Cholesky<double, 6> factor(N);
  const Matrix6 half = factor.halfSolve<6>(L);
  const Matrix6 whitened = factor.halfSolve<6>(half.transpose());
  const SmallSvd svd(BasicSmallMatrix<6>::of<6, 6>(0.5 * (whitened + whitened.transpose())));
  for (int k = 0; k < 6; ++k) {
    result.values[k] = svd.value(5 - k);
    for (int i = 0; i < 6; ++i) result.vectors(i, k) = svd.v(5 - k, i);
  }
  // v = C⁻ᵀ u with N = C Cᵀ: N⁻¹ C u = C⁻ᵀ u, and C⁻ᵀ = (C⁻¹)ᵀ.
  const Matrix6 inverse_factor = factor.halfSolve<6>(Matrix6::Identity());
  result.vectors = product(inverse_factor.transpose(), result.vectors);
  return result;
}

}  // namespace liestat::detail
