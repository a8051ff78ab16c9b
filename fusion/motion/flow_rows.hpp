// The flow of one point, and its row of the subspace constraint in compact form: what is left of two equations when the
// point's depth has been eliminated.
//
//   ẋ = ρ A(x) V + B(x) Ω,   A = [1 0 -x; 0 1 -y],   B = [-xy 1+x² -y; -(1+y²) xy x],   ρ = |V|/Z
//
// With a = A V, t = a/|a|, n = (-t₂, t₁): q = nᵀẋ, h = Bᵀn, and e = q - hᵀΩ vanishes for the true V and Ω whatever the
// depth; |a| e = (X̃ × V)·(ẋ~ - Ω × X̃) is the continuous epipolar constraint. The dense constraint of Soatto and Perona
// 1994, (5), P ẋ = 0 with P the projector on the complement of the columns [A V | B], is P = Nᵀ(I - H H⁺) N, N the rows
// nᵀ and H the rows hᵀ: |P ẋ|² is the least sum of e² over Ω. (tests/fusion/subspace_update_test.cpp)
//
// Everything here is a function of one point, for double and ceres::Jet; NaN in gives NaN out.
#pragma once

#include <fusion/motion/types.hpp>

#include <Eigen/Core>

#include <cmath>

namespace liestat {

/// A point and its flow over one frame.
template <class S>
struct FlowPoint {
  S x = S(0), y = S(0);  ///< where the constraint is taken
  S u = S(0), v = S(0);  ///< ẋ, per frame
  S variance = S(0);     ///< variance of each coordinate of ẋ, from the errors in both frames
  S frames = S(1);       ///< length of the interval
};

/// A(x), 2×3.
template <class S>
Eigen::Matrix<S, 2, 3> flowByVelocity(const S& x, const S& y) {
  Eigen::Matrix<S, 2, 3> A;
  A << S(1), S(0), -x, S(0), S(1), -y;
  return A;
}

/// B(x), 2×3.
template <class S>
Eigen::Matrix<S, 2, 3> flowByRotation(const S& x, const S& y) {
  Eigen::Matrix<S, 2, 3> B;
  B << -x * y, S(1) + x * x, -y, -(S(1) + y * y), x * y, x;
  return B;
}

/// ∂(B(x) Ω)/∂x, 2×2; exact.
template <class S>
Eigen::Matrix<S, 2, 2> rotationFlowJacobian(const S& x, const S& y, const Eigen::Matrix<S, 3, 1>& Omega) {
  Eigen::Matrix<S, 2, 2> J;
  J << -y * Omega[0] + S(2) * x * Omega[1], -x * Omega[0] - Omega[2],  //
      y * Omega[1] + Omega[2], S(-2) * y * Omega[0] + x * Omega[1];
  return J;
}

/// The flow of a pair without its rotation: Flow::forward and Flow::midpoint.
inline FlowPoint<double> flowOf(const PointPair& pair, Flow flow) {
  const double k = 1 / pair.frames;
  FlowPoint<double> p;
  const Eigen::Vector2d at = flow == Flow::forward ? pair.first : Eigen::Vector2d(0.5 * (pair.first + pair.second));
  p.x = at.x(), p.y = at.y();
  p.u = k * (pair.second.x() - pair.first.x()), p.v = k * (pair.second.y() - pair.first.y());
  p.variance = 2 * pair.sigma * pair.sigma * k * k;
  p.frames = pair.frames;
  return p;
}

/// The flow that is left of a pair after its first point was turned by R: Flow::discrete. (X̃ × V)·ẋ~ at its middle is
/// then the epipolar constraint det[X̃₁', V, X̃₂], and 1/|a| there its normalisation of Sampson. NaN where the point is
/// turned out of sight.
inline FlowPoint<double> flowAfter(const Eigen::Matrix3d& R, const PointPair& pair) {
  FlowPoint<double> p;
  const double x = pair.first.x(), y = pair.first.y();
  const double z = R(2, 0) * x + R(2, 1) * y + R(2, 2);
  const double inverse = z > 0 ? 1 / z : std::numeric_limits<double>::quiet_NaN();
  const double x1 = (R(0, 0) * x + R(0, 1) * y + R(0, 2)) * inverse;
  const double y1 = (R(1, 0) * x + R(1, 1) * y + R(1, 2)) * inverse;
  p.x = 0.5 * (x1 + pair.second.x()), p.y = 0.5 * (y1 + pair.second.y());
  p.u = pair.second.x() - x1, p.v = pair.second.y() - y1;
  p.variance = 2 * pair.sigma * pair.sigma;
  return p;
}

/// The parts of a point's row at a direction V, before the rotation is known.
template <class S>
struct FlowRow {
  S n0 = S(0), n1 = S(0);             ///< n, across the flow of the translation; t = (n₁, -n₀)
  S inverse_length = S(0);            ///< 1/|a|
  S q = S(0);                         ///< nᵀẋ
  S h0 = S(0), h1 = S(0), h2 = S(0);  ///< Bᵀn
  S weight = S(0);                    ///< 1/variance of e; 0: not used
};

/// The row at V, of unit length. A point at the focus of expansion, where a = 0, has no direction of flow and gets a row
/// of zeros.
template <class S>
FlowRow<S> flowRow(const FlowPoint<S>& p, const Eigen::Matrix<S, 3, 1>& V) {
  using detail::select;
  using std::sqrt;
  FlowRow<S> row;
  const S a0 = V[0] - p.x * V[2], a1 = V[1] - p.y * V[2], squared = a0 * a0 + a1 * a1;
  const auto seen = !(squared <= S(1e-24));  // NaN stays NaN
  row.inverse_length = select(seen, S(S(1) / sqrt(select(seen, squared, S(1)))), S(0));
  const S t0 = a0 * row.inverse_length, t1 = a1 * row.inverse_length;
  row.n0 = -t1, row.n1 = t0;
  row.q = row.n0 * p.u + row.n1 * p.v;
  // Bᵀ n = X̃ × (n₁, -n₀, ·): with s = x n₀ + y n₁, (-y s - n₁, x s + n₀, x n₁ - y n₀).
  const S s = p.x * row.n0 + p.y * row.n1;
  row.h0 = -(p.y * s) - row.n1, row.h1 = p.x * s + row.n0, row.h2 = p.x * row.n1 - p.y * row.n0;
  row.weight = S(1) / p.variance;
  return row;
}

/// The row's residual and depth for a rotation.
template <class S>
struct FlowResidual {
  S e = S(0);                 ///< q - hᵀΩ
  S along = S(0);             ///< tᵀ(ẋ - B Ω)
  S rho = S(0);               ///< |V|/Z, along/|a|: with Ω the least-squares solution for the point's depth
  Eigen::Matrix<S, 1, 3> tB;  ///< tᵀB
};

template <class S>
FlowResidual<S> flowResidual(const FlowPoint<S>& p, const FlowRow<S>& row, const Eigen::Matrix<S, 3, 1>& Omega) {
  FlowResidual<S> r;
  const S t0 = row.n1, t1 = -row.n0, s = p.x * t0 + p.y * t1;
  r.tB << -(p.y * s) - t1, p.x * s + t0, p.x * t1 - p.y * t0;
  r.e = row.q - (row.h0 * Omega[0] + row.h1 * Omega[1] + row.h2 * Omega[2]);
  r.along = t0 * p.u + t1 * p.v - (r.tB[0] * Omega[0] + r.tB[1] * Omega[1] + r.tB[2] * Omega[2]);
  r.rho = r.along * row.inverse_length;
  return r;
}

/// How the direction of the flow turns with V ← Exp_V(E ξ), E an orthonormal basis of the tangent plane: dψ = nᵀA E/|a|,
/// and e(ξ) = e + G ξ + O(ξ²) with G = -along·dψ. By the rotation, e(Ω + δ) = e - hᵀδ exactly.
template <class S>
Eigen::Matrix<S, 1, 2> flowTurn(const FlowPoint<S>& p, const FlowRow<S>& row, const Eigen::Matrix<S, 3, 2>& E) {
  const S a = row.n0 * row.inverse_length, b = row.n1 * row.inverse_length, c = -(p.x * a + p.y * b);
  Eigen::Matrix<S, 1, 2> turn;
  turn << a * E(0, 0) + b * E(1, 0) + c * E(2, 0), a * E(0, 1) + b * E(1, 1) + c * E(2, 1);
  return turn;
}

/// The variance of e of a forward difference: y₁ enters as position and as flow, σ²(1 + |nᵀF|²) with F = (1 - ρ V_z) I +
/// ∂(B Ω)/∂x, first order in the noise. (Flow::midpoint and Flow::discrete have p.variance = 2σ² in both directions.)
template <class S>
S forwardVariance(const FlowPoint<S>& p, const FlowRow<S>& row, const S& rho, const Eigen::Matrix<S, 3, 1>& V,
                  const Eigen::Matrix<S, 3, 1>& Omega) {
  const Eigen::Matrix<S, 2, 2> J = rotationFlowJacobian(p.x, p.y, Omega);
  const S own = S(1) - p.frames * rho * V[2];
  const S f0 = row.n0 * own + p.frames * (row.n0 * J(0, 0) + row.n1 * J(1, 0));
  const S f1 = row.n1 * own + p.frames * (row.n0 * J(0, 1) + row.n1 * J(1, 1));
  return S(0.5) * p.variance * (S(1) + f0 * f0 + f1 * f1);
}

}  // namespace liestat
