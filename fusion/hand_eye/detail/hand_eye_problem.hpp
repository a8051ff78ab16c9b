// The equations of hand-eye calibration, Log(X⁻¹ A⁻¹ Y B) = 0, their derivatives, and the sums over the pairs that a
// Gauss–Newton step and the question what the motions determine are made of.
#pragma once

#include <fusion/hand_eye.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/product.hpp>
#include <stats/constrained_types.hpp>
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

/// AX = YB for stats/constrained.hpp: the parameter is (X, Y), a measurement (A, B).
struct RobotWorldEquation {
  using Parameter = Product<SE3d, SE3d>;
  using Measurement = Product<SE3d, SE3d>;

  static HandEyeValue value(const Parameter& q) { return {q.get<0>(), q.get<1>()}; }
  static Parameter parameter(const HandEyeValue& v) { return Parameter(v.X, v.Y); }

  Vector6 operator()(const Parameter& q, const Measurement& m) const {
    return handEyeError(value(q), m.get<0>(), m.get<1>());
  }
  EquationDerivatives<6, 12, 12> linearize(const Parameter& q, const Measurement& m) const {
    const HandEyeJacobians J(value(q), m.get<0>(), m.get<1>());
    EquationDerivatives<6, 12, 12> d;
    d.value = J.e;
    d.by_parameter << J.X, J.Y;
    d.by_measurement << J.A, J.B;
    return d;
  }
};

/// AX = XB: the parameter is X.
struct HandEyeEquation {
  using Parameter = SE3d;
  using Measurement = Product<SE3d, SE3d>;

  static HandEyeValue value(const Parameter& q) { return {q, q}; }
  static Parameter parameter(const HandEyeValue& v) { return v.X; }

  Vector6 operator()(const Parameter& q, const Measurement& m) const {
    return handEyeError(value(q), m.get<0>(), m.get<1>());
  }
  EquationDerivatives<6, 6, 12> linearize(const Parameter& q, const Measurement& m) const {
    const HandEyeJacobians J(value(q), m.get<0>(), m.get<1>());
    EquationDerivatives<6, 6, 12> d;
    d.value = J.e;
    d.by_parameter = J.X + J.Y;
    d.by_measurement << J.A, J.B;
    return d;
  }
};

/// The noise of a pair: a block for each pose. A NoiseModel of stats/measurement_noise.hpp.
class PosePairNoise {
 public:
  static constexpr int dimension = 12;
  using Vector = Eigen::Matrix<double, 12, 1>;
  using Matrix = Eigen::Matrix<double, 12, 12>;

  PosePairNoise(const Matrix6& a, const Matrix6& b) : a_(a), b_(b) {
    const auto information = [this](const Matrix6& V) -> Matrix6 {
      if (!V.allFinite() || !(V - V.transpose()).isZero(1e-9 * V.cwiseAbs().maxCoeff())) {
        valid_ = false;
        return V;
      }
      const Cholesky<double, 6> factor(V);
      if (factor.ok()) return factor.inverse();
      const SemidefiniteParts<6> parts(V);
      valid_ = valid_ && parts.valid;
      rank_ -= parts.null_dimension;
      return parts.inverse;
    };
    information_a_ = information(a), information_b_ = information(b);
  }

  bool valid() const { return valid_; }
  /// True if both covariances together have the ranks that errors of a pose need: six, three of them of the rotation, which
  /// translations do not move.
  bool coversAllDirections() const {
    const auto open = [](const Matrix6& V) {
      return SemidefiniteParts<3>(Eigen::Matrix3d(V.bottomRightCorner<3, 3>())).null_dimension;
    };
    return rank_ >= 6 && (rank_ == 12 || open(a_) + open(b_) <= 3);
  }
  template <int P>
  Eigen::Matrix<double, 12, P> spread(const Eigen::Matrix<double, P, 12>& D) const {
    Eigen::Matrix<double, 12, P> result;
    result << productTransposed(a_, Eigen::Matrix<double, P, 6>(D.template leftCols<6>())),
        productTransposed(b_, Eigen::Matrix<double, P, 6>(D.template rightCols<6>()));
    return result;
  }
  double squaredNorm(const Vector& e) const {
    const Vector6 a = e.head<6>(), b = e.tail<6>();
    return a.dot(product(information_a_, a)) + b.dot(product(information_b_, b));
  }
  Matrix covariance() const { return blocks(a_, b_); }
  Matrix information() const { return blocks(information_a_, information_b_); }

 private:
  static Matrix blocks(const Matrix6& a, const Matrix6& b) {
    Matrix m = Matrix::Zero();
    m.topLeftCorner<6, 6>() = a, m.bottomRightCorner<6, 6>() = b;
    return m;
  }
  Matrix6 a_, b_, information_a_, information_b_;
  bool valid_ = true;
  int rank_ = 12;
};

/// Sums over pairs at one value. Blocks y, y for both kinds of problem; of AX = XB `x` is not used.
struct HandEyeSums {
  Matrix6 xx = Matrix6::Zero(), xy = Matrix6::Zero(), yy = Matrix6::Zero();
  Vector6 x = Vector6::Zero(), y = Vector6::Zero();
  double cost = 0;  ///< Σ eᵀ S⁻¹ e
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
HandEyeSums handEyeSums(const HandEyeValue& at, const std::vector<PosePair>& pairs, const Indices& indices,
                        bool world) {
  HandEyeSums sums;
  for (const std::size_t i : indices) {
    const HandEyeJacobians J(at, pairs[i].a.mean, pairs[i].b.mean);
    const Cholesky<double, 6> S = handEyeErrorFactor(J.A, J.B, pairs[i]);
    const Vector6 e = S.halfSolve<1>(J.e);
    const Matrix6 y = S.halfSolve<6>(world ? J.Y : Matrix6(J.X + J.Y));
    sums.yy += product(y.transpose(), y);
    sums.y += product(y.transpose(), e);
    if (world) {
      const Matrix6 x = S.halfSolve<6>(J.X);
      sums.xx += product(x.transpose(), x);
      sums.xy += product(x.transpose(), y);
      sums.x += product(x.transpose(), e);
    }
    sums.cost += e.squaredNorm();
  }
  return sums;
}

/// Σ eᵀ S⁻¹ e.
template <class Indices>
double handEyeCost(const HandEyeValue& at, const std::vector<PosePair>& pairs, const Indices& indices) {
  double cost = 0;
  for (const std::size_t i : indices) cost += handEyeSquaredError(at, pairs[i]);
  return cost;
}

/// Information of the motions on Y (on X for AX = XB) once X is eliminated, against what the noise of B would say if there
/// were no motion at all.
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
HandEyeExcitation handEyeExcitation(const HandEyeValue& at, const std::vector<PosePair>& pairs, const Indices& indices,
                                    bool world) {
  Matrix6 L = Matrix6::Zero(), N = Matrix6::Zero(), xx = Matrix6::Zero(), xy = Matrix6::Zero();
  const Matrix6 to_camera = at.X.inverse().Adj();
  double n = 0;
  for (const std::size_t i : indices) {
    const PosePair& pair = pairs[i];
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
