// One update of the direction of translation by the flow of one frame, in information form: two passes over the points,
// 2×2 and 3×3 matrices, no allocation.
//
// The rows of fusion/motion/flow_rows.hpp, each of weight w = 1/variance, leave for V ← Exp_V(E ξ) and the rotation
//
//   Hxx = Σ w GᵀG,   Hxo = -Σ w Gᵀhᵀ,   M = Σ w h hᵀ,   bx = Σ w e Gᵀ,   bo = -Σ w e h
//
// Taken at the rotation that minimises the frame's cost, where bo and the prior's gradient cancel, the elimination of
// the rotation leaves S = Hxx - Hxo M⁻¹ Hxoᵀ and the gradient g = bx, and the step is ξ = -(P⁻¹ + S)⁻¹ g. It is the
// update of the dense implicit filter (Soatto and Perona 1994, section 3, with the Jacobian of the constraint in the
// gain, a minus, and a pseudo-inverse, as the innovation has rank N - 3), to rounding: the term of the constraint's
// derivative that is missing from G is orthogonal to its range (L. Kaufman, BIT 15, 1975).
//
// A gyroscope, Ω = Ω_g + n with n of information Λ, adds Λ to M, whose rank it completes, and |Ω - Ω_g|²_Λ to the cost,
// which then follows χ²_N instead of χ²_{N-3}.
#pragma once

#include <fusion/motion/flow_rows.hpp>
#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <type_traits>

namespace liestat {

/// Prior knowledge of the rotation: its mean (rad per frame) and information (rad⁻²); zero: nothing.
template <class S>
struct RotationPrior {
  Eigen::Matrix<S, 3, 1> mean = Eigen::Matrix<S, 3, 1>::Zero();
  Eigen::Matrix<S, 3, 3> information = Eigen::Matrix<S, 3, 3>::Zero();
};

/// M = Σ w h hᵀ and Σ w q h.
template <class S>
struct FlowRotationSums {
  Eigen::Matrix<S, 3, 3> M = Eigen::Matrix<S, 3, 3>::Zero();
  Eigen::Matrix<S, 3, 1> right = Eigen::Matrix<S, 3, 1>::Zero();

  /// The rotation that minimises Σ w e² + |Ω - mean|²; NaN where it is not determined.
  Eigen::Matrix<S, 3, 1> solve(const RotationPrior<S>& prior) const {
    const Eigen::Matrix<S, 3, 3> all = M + prior.information;
    const Eigen::Matrix<S, 3, 1> b = right + prior.information * prior.mean;
    return detail::Cholesky<S, 3>(all).template solve<1>(b);
  }
};

/// First pass: fills the rows of the points at V; rows is as long as points.
template <class S>
void flowRows(std::span<const FlowPoint<S>> points, const Eigen::Matrix<S, 3, 1>& V, std::span<FlowRow<S>> rows) {
  for (std::size_t i = 0; i < points.size(); ++i) rows[i] = flowRow(points[i], V);
}

template <class S>
FlowRotationSums<S> rotationSums(std::span<const FlowRow<S>> rows) {
  S m00(0), m01(0), m02(0), m11(0), m12(0), m22(0), r0(0), r1(0), r2(0);
  for (const FlowRow<S>& row : rows) {
    const S w0 = row.weight * row.h0, w1 = row.weight * row.h1, w2 = row.weight * row.h2;
    m00 += w0 * row.h0, m01 += w0 * row.h1, m02 += w0 * row.h2;
    m11 += w1 * row.h1, m12 += w1 * row.h2, m22 += w2 * row.h2;
    r0 += w0 * row.q, r1 += w1 * row.q, r2 += w2 * row.q;
  }
  FlowRotationSums<S> sums;
  sums.M << m00, m01, m02, m01, m11, m12, m02, m12, m22;
  sums.right << r0, r1, r2;
  return sums;
}

/// The sums over the points at a direction V, with basis E, and a rotation. `Cxx`, `Cox` are Hxx, Hox = Hxoᵀ with the second
/// derivatives of e: they have the information as expectation, where Hxx counts the noise of the flow along t as signal
/// (E along² = (ρ|a|)² + variance). The term with e·along·d²ψ, of zero mean, is left out.
template <class S>
struct SubspaceSums {
  Eigen::Matrix<S, 2, 2> Hxx, Cxx;
  Eigen::Matrix<S, 3, 2> Hox, Cox;
  Eigen::Matrix<S, 3, 3> M;
  Eigen::Matrix<S, 2, 1> bx;
  Eigen::Matrix<S, 3, 1> bo;
  S cost = S(0);  ///< Σ w e²
  // Depths: ω = w|a|².
  S depth_weight = S(0), depth = S(0);  ///< Σ ω, Σ ω ρ
  Eigen::Matrix<S, 3, 1> depth_lever;   ///< Σ ω (tᵀB)ᵀ/|a|

  /// The information-weighted mean of ρ, and its variance where the rotation has information ML.
  S meanInverseDepth() const { return depth / depth_weight; }
  S meanInverseDepthVariance(const detail::Cholesky<S, 3>& ML) const {
    const Eigen::Matrix<S, 3, 1> k = depth_lever / depth_weight;
    return S(1) / depth_weight + k.dot(ML.template solve<1>(k));
  }
};

/// Second pass: everything at the rotation Omega. (M is that of rotationSums.)
template <class S>
SubspaceSums<S> subspaceSums(std::span<const FlowPoint<S>> points, std::span<const FlowRow<S>> rows,
                             const Eigen::Matrix<S, 3, 2>& E, const Eigen::Matrix<S, 3, 1>& Omega,
                             const Eigen::Matrix<S, 3, 3>& M) {
  S hxx0(0), hxx1(0), hxx2(0), dxx0(0), dxx1(0), dxx2(0), cost(0), weight(0), depth(0);
  S b0(0), b1(0), o0(0), o1(0), o2(0), k0(0), k1(0), k2(0);
  S ho00(0), ho01(0), ho02(0), ho10(0), ho11(0), ho12(0), co00(0), co01(0), co02(0), co10(0), co11(0), co12(0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const FlowPoint<S>& p = points[i];
    const FlowRow<S>& row = rows[i];
    const S t0 = row.n1, t1 = -row.n0, s = p.x * t0 + p.y * t1;
    const S B0 = -(p.y * s) - t1, B1 = p.x * s + t0, B2 = p.x * t1 - p.y * t0;
    const S e = row.q - (row.h0 * Omega[0] + row.h1 * Omega[1] + row.h2 * Omega[2]);
    const S along = t0 * p.u + t1 * p.v - (B0 * Omega[0] + B1 * Omega[1] + B2 * Omega[2]);
    const S a = row.n0 * row.inverse_length, b = row.n1 * row.inverse_length, c = -(p.x * a + p.y * b);
    const S turn0 = a * E(0, 0) + b * E(1, 0) + c * E(2, 0), turn1 = a * E(0, 1) + b * E(1, 1) + c * E(2, 1);
    const S w = row.weight, we = w * e, wa = w * along;
    // G = -along·turn.
    cost += we * e;
    const S second = we * e, first = wa * along, wae = we * along;
    hxx0 += first * turn0 * turn0, hxx1 += first * turn0 * turn1, hxx2 += first * turn1 * turn1;
    dxx0 += second * turn0 * turn0, dxx1 += second * turn0 * turn1, dxx2 += second * turn1 * turn1;
    b0 -= wae * turn0, b1 -= wae * turn1;
    o0 -= we * row.h0, o1 -= we * row.h1, o2 -= we * row.h2;
    const S g0 = wa * turn0, g1 = wa * turn1, f0 = we * turn0, f1 = we * turn1;
    ho00 += g0 * row.h0, ho01 += g0 * row.h1, ho02 += g0 * row.h2;
    ho10 += g1 * row.h0, ho11 += g1 * row.h1, ho12 += g1 * row.h2;
    co00 += f0 * B0, co01 += f0 * B1, co02 += f0 * B2;
    co10 += f1 * B0, co11 += f1 * B1, co12 += f1 * B2;
    // ω = w|a|², ω ρ = w|a| along; a row of zeros has no depth.
    const S length = row.inverse_length > S(0) ? S(1) / row.inverse_length : row.inverse_length;
    const S wl = w * length;
    weight += wl * length, depth += wl * along;
    k0 += wl * B0, k1 += wl * B1, k2 += wl * B2;
  }
  SubspaceSums<S> sums;
  sums.Hxx << hxx0, hxx1, hxx1, hxx2;
  sums.Cxx << hxx0 - dxx0, hxx1 - dxx1, hxx1 - dxx1, hxx2 - dxx2;
  sums.Hox << ho00, ho10, ho01, ho11, ho02, ho12;
  sums.Cox << ho00 + co00, ho10 + co10, ho01 + co01, ho11 + co11, ho02 + co02, ho12 + co12;
  sums.M = M;
  sums.bx << b0, b1;
  sums.bo << o0, o1, o2;
  sums.cost = cost;
  sums.depth_weight = weight, sums.depth = depth;
  sums.depth_lever << k0, k1, k2;
  return sums;
}

/// Information of D unknowns from one frame: S, the same with second derivatives, and the gradient of half the cost.
template <class S, int D>
struct FrameInformation {
  Eigen::Matrix<S, D, D> gauss_newton, corrected;
  Eigen::Matrix<S, D, 1> gradient;
  S cost = S(0);   ///< at ξ = 0, minimised over what was eliminated: the score of a hypothesis
  S start = S(0);  ///< the same where all unknowns are as predicted; less updateCovariance()'s reduction it follows χ²
};

/// The direction alone, the rotation eliminated; Omega must minimise the cost of these sums with the prior.
template <class S>
FrameInformation<S, 2> eliminateRotation(const SubspaceSums<S>& sums, const Eigen::Matrix<S, 3, 1>& Omega,
                                         const RotationPrior<S>& prior) {
  const detail::Cholesky<S, 3> ML(Eigen::Matrix<S, 3, 3>(sums.M + prior.information));
  const Eigen::Matrix<S, 3, 1> from_prior = Omega - prior.mean;
  const Eigen::Matrix<S, 3, 2> H = ML.template halfSolve<2>(sums.Hox), C = ML.template halfSolve<2>(sums.Cox);
  FrameInformation<S, 2> f;
  f.gauss_newton = sums.Hxx - H.transpose() * H;
  f.corrected = sums.Cxx - C.transpose() * C;
  f.gradient = sums.bx;
  f.cost = f.start = sums.cost + from_prior.dot(prior.information * from_prior);
  return f;
}

/// The direction and the gyroscope's bias, Ω = Ω_g - b - n, n eliminated. `prior` is that of Ω for the present bias;
/// Omega is where the sums were taken, best at the minimum for the information (Λ⁻¹ + P_b)⁻¹ in place of Λ. The cost is
/// that of the direction alone, minimised over the bias with this information `marginal`.
template <class S>
FrameInformation<S, 5> eliminateRotationWithBias(const SubspaceSums<S>& sums, const Eigen::Matrix<S, 3, 1>& Omega,
                                                 const RotationPrior<S>& prior,
                                                 const Eigen::Matrix<S, 3, 3>& marginal) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  const Matrix3& L = prior.information;
  const detail::Cholesky<S, 3> ML(Matrix3(sums.M + L));
  const Eigen::Matrix<S, 3, 1> from_prior = Omega - prior.mean, pull = L * from_prior, bo = sums.bo + pull;
  const Eigen::Matrix<S, 3, 2> H = ML.template halfSolve<2>(sums.Hox), C = ML.template halfSolve<2>(sums.Cox);
  const Matrix3 K = ML.template halfSolve<3>(L);
  const Eigen::Matrix<S, 3, 1> half = ML.template halfSolve<1>(bo);
  FrameInformation<S, 5> f;
  const auto fill = [&](Eigen::Matrix<S, 5, 5>& to, const Eigen::Matrix<S, 2, 2>& xx, const Eigen::Matrix<S, 3, 2>& X) {
    to.template topLeftCorner<2, 2>() = xx - X.transpose() * X;
    to.template topRightCorner<2, 3>() = -(X.transpose() * K);
    to.template bottomLeftCorner<3, 2>() = -(K.transpose() * X);
    to.template bottomRightCorner<3, 3>() = L - K.transpose() * K;
  };
  fill(f.gauss_newton, sums.Hxx, H);
  fill(f.corrected, sums.Cxx, C);
  f.gradient << sums.bx - H.transpose() * half, pull - K.transpose() * half;
  f.cost = sums.cost + from_prior.dot(marginal * from_prior);
  f.start = sums.cost + from_prior.dot(pull) - half.squaredNorm();
  return f;
}

/// The direction and the rotation, both states (essential filter): rows [G, -hᵀ]. With a gyroscope's measurement Ω_g of
/// information Λ, as a prior of this frame.
template <class S>
FrameInformation<S, 5> keepRotation(const SubspaceSums<S>& sums, const Eigen::Matrix<S, 3, 1>& Omega,
                                    const RotationPrior<S>& prior) {
  const Eigen::Matrix<S, 3, 1> from_prior = Omega - prior.mean, pull = prior.information * from_prior;
  FrameInformation<S, 5> f;
  f.gauss_newton << sums.Hxx, sums.Hox.transpose(), sums.Hox, sums.M + prior.information;
  f.corrected << sums.Cxx, sums.Cox.transpose(), sums.Cox, sums.M + prior.information;
  f.gradient << sums.bx, sums.bo + pull;
  f.cost = f.start = sums.cost + from_prior.dot(pull);
  return f;
}

/// The direction, the rotation and the gyroscope's bias (essential filter): the same, Ω = Ω_g - b - n. `prior` is that of
/// the increment Ω for the present bias, Ω = prior.mean - turn·b to first order; the cost, a hypothesis' score, has the
/// gyroscope with the information `marginal` that it has while the bias is unknown.
template <class S>
FrameInformation<S, 8> keepRotationAndBias(const SubspaceSums<S>& sums, const Eigen::Matrix<S, 3, 1>& Omega,
                                           const RotationPrior<S>& prior, const Eigen::Matrix<S, 3, 3>& turn,
                                           const Eigen::Matrix<S, 3, 3>& marginal) {
  const Eigen::Matrix<S, 3, 1> from_prior = Omega - prior.mean, pull = prior.information * from_prior;
  const Eigen::Matrix<S, 3, 3> across = prior.information * turn;
  FrameInformation<S, 8> f;
  const auto fill = [&](Eigen::Matrix<S, 8, 8>& to, const Eigen::Matrix<S, 2, 2>& xx,
                        const Eigen::Matrix<S, 3, 2>& ox) {
    to.setZero();
    to.template topLeftCorner<2, 2>() = xx;
    to.template block<3, 2>(2, 0) = ox;
    to.template block<2, 3>(0, 2) = ox.transpose();
    to.template block<3, 3>(2, 2) = sums.M + prior.information;
    to.template block<3, 3>(2, 5) = across;
    to.template block<3, 3>(5, 2) = across.transpose();
    to.template block<3, 3>(5, 5) = turn.transpose() * across;
  };
  fill(f.gauss_newton, sums.Hxx, sums.Hox);
  fill(f.corrected, sums.Cxx, sums.Cox);
  f.gradient << sums.bx, sums.bo + pull, turn.transpose() * pull;
  f.cost = sums.cost + from_prior.dot(marginal * from_prior);
  f.start = sums.cost + from_prior.dot(pull);
  return f;
}

/// The covariance that steers the gain (that of Gauss-Newton), and the one that is reported.
template <class S, int D>
struct FilterCovariance {
  Eigen::Matrix<S, D, D> gain = Eigen::Matrix<S, D, D>::Identity();
  Eigen::Matrix<S, D, D> reported = Eigen::Matrix<S, D, D>::Identity();
};

/// Result of an update: the step and the reduction of the cost by it (the normalised innovation is cost - reduction).
template <class S, int D>
struct FilterStep {
  Eigen::Matrix<S, D, 1> step;
  S reduction = S(0);
};

/// C cut to what a frame can say: eigenvalues of L⁻¹ C L⁻ᵀ to [-1/2, 1], S = L Lᵀ. Second derivatives of points near the
/// focus of expansion scatter, and may call the information of a frame negative. A singular S leaves C as it is, and so
/// does a scalar with derivatives, for which the update without the cut is meant.
template <class S, int D>
Eigen::Matrix<S, D, D> cutInformation(const Eigen::Matrix<S, D, D>& C, const Eigen::Matrix<S, D, D>& information) {
  if constexpr (std::is_floating_point_v<S>) {
    using Matrix = Eigen::Matrix<S, D, D>;
    if (detail::Cholesky<S, D>(C).ok() && detail::Cholesky<S, D>(Matrix(information - C)).ok()) return C;
    const detail::Cholesky<S, D> factor(information);
    if (!factor.ok()) return C;
    const Matrix half = factor.template halfSolve<D>(C), turned = half.transpose();
    const Matrix white = factor.template halfSolve<D>(turned);
    const detail::SymmetricEigen<Matrix> eigen(white);
    const Matrix inverse_factor = factor.template halfSolve<D>(Matrix::Identity());
    const Matrix axes = Matrix(information * inverse_factor.transpose()) * eigen.vectors;
    return axes * eigen.values.cwiseMax(S(-0.5)).cwiseMin(S(1)).asDiagonal() * axes.transpose();
  } else {
    return C;
  }
}

/// J = P_g⁻¹ + S, ξ = -J⁻¹ g, P_g ← J⁻¹, and the reported covariance in the two-sided form that a gain of any kind asks
/// for: P ← Γ P Γᵀ + J⁻¹ S J⁻¹, Γ = I - J⁻¹ C with C cut. The step is cut to max_step in the first two coordinates. NaN
/// where P_g is not positive definite.
template <class S, int D>
FilterStep<S, D> updateCovariance(FilterCovariance<S, D>& P, const FrameInformation<S, D>& frame, const S& max_step,
                                  bool second_derivatives = true) {
  using std::sqrt;
  using Matrix = Eigen::Matrix<S, D, D>;
  const Matrix J = detail::Cholesky<S, D>(P.gain).inverse() + frame.gauss_newton;
  const Matrix inverse = detail::Cholesky<S, D>(J).inverse();
  FilterStep<S, D> result;
  result.step = -(inverse * frame.gradient);
  result.reduction = -frame.gradient.dot(result.step);
  const S length = sqrt(result.step.template head<2>().squaredNorm());
  if (length > max_step) result.step *= max_step / length;
  P.gain = inverse;
  if (second_derivatives) {
    const Matrix Gamma = Matrix::Identity() - inverse * cutInformation<S, D>(frame.corrected, frame.gauss_newton);
    P.reported = Matrix(Gamma * P.reported) * Gamma.transpose() + Matrix(inverse * frame.gauss_newton) * inverse;
    P.reported = Matrix(S(0.5) * (P.reported + P.reported.transpose()));
  } else {
    P.reported = inverse;
  }
  return result;
}

/// A symmetric 2×2 matrix as U diag(values) Uᵀ, the larger value first.
struct SymmetricPair {
  Eigen::Vector2d values;
  Eigen::Matrix2d U;

  explicit SymmetricPair(const Eigen::Matrix2d& A) {
    const double mean = 0.5 * (A(0, 0) + A(1, 1)), difference = 0.5 * (A(0, 0) - A(1, 1));
    const double radius = std::hypot(difference, A(0, 1)), angle = 0.5 * std::atan2(A(0, 1), difference);
    const double c = std::cos(angle), s = std::sin(angle);
    values << mean + radius, mean - radius;
    U << c, -s, s, c;
  }
};

/// P ← diag(T, I) P diag(T, I)ᵀ.
template <int D>
void turnDirection(Eigen::Matrix<double, D, D>& P, const Eigen::Matrix2d& T) {
  P.template topRows<2>() = (T * P.template topRows<2>()).eval();
  P.template leftCols<2>() = (P.template leftCols<2>() * T.transpose()).eval();
}

/// Bounds the covariance of a direction, the first two coordinates, by congruences that keep the whole positive
/// semi-definite: eigenvalues between `least` and `most` (rad²), and no less in any direction than that of Gauss-Newton,
/// as a gain that happens to cancel the error of one frame tells nothing of those before.
template <int D>
void boundDirection(FilterCovariance<double, D>& P, double most = 1, double least = 1e-12) {
  for (Eigen::Matrix<double, D, D>* m : {&P.gain, &P.reported}) {
    (*m)(0, 0) += least, (*m)(1, 1) += least;
    if (!((*m)(0, 0) + (*m)(1, 1) > most)) continue;
    const SymmetricPair pair(m->template topLeftCorner<2, 2>());
    const Eigen::Vector2d f = (most / pair.values.array().max(most)).sqrt();
    turnDirection<D>(*m, pair.U * f.asDiagonal() * pair.U.transpose());
  }
  const double l00 = std::sqrt(P.gain(0, 0)), l10 = P.gain(1, 0) / l00;
  const double l11 = std::sqrt(std::max(P.gain(1, 1) - l10 * l10, 1e-300));
  Eigen::Matrix2d L, inverse;
  L << l00, 0, l10, l11;
  inverse << 1 / l00, 0, -l10 / (l00 * l11), 1 / l11;
  const Eigen::Matrix2d own = P.reported.template topLeftCorner<2, 2>();
  const SymmetricPair pair(Eigen::Matrix2d(inverse * own * inverse.transpose()));
  if (pair.values[1] >= 1) return;
  const Eigen::Vector2d f = pair.values.array().max(1e-12).inverse().max(1).sqrt();
  turnDirection<D>(P.reported, L * (pair.U * f.asDiagonal() * pair.U.transpose()) * inverse);
}

}  // namespace liestat
