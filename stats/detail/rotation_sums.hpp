// The sums of a mean over rotations, frames and their quotients, from the kernels of stats/detail/rotation_kernel.hpp.
#pragma once

#include <lie/so3.hpp>
#include <stats/detail/feature_layout.hpp>
#include <stats/detail/mean_sums.hpp>
#include <stats/detail/rotation_kernel.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace liestat::detail {

/// Manifolds whose sums are made here: SO3, Frame3, the quotients of Frame3 and whatever else shows its parameters, in
/// double and float.
template <class M>
concept HasRotationSums = HasRotationParameters<M> && PackScalar<typename ManifoldTraits<M>::Scalar>;

/// The half-turns that a quotient's features are equal under, as bits: x, y, z.
template <class M>
constexpr unsigned halfTurns() {
  unsigned bits = 0;
  if constexpr (Quotient<M>) {
    for (const int i : ManifoldTraits<M>::representatives) bits |= i > 0 ? 1U << (i - 1) : 0U;
  }
  return bits;
}

/// A symmetric matrix from its lower triangle, row by row.
template <class Square, class S>
Square symmetricFromTriangle(const S* entries) {
  Square m;
  for (Eigen::Index i = 0, e = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++e) m(i, j) = m(j, i) = entries[e];
  }
  return m;
}

/// True if all sums of a kernel are finite: the cost bounds the residuals, and the weight the rest.
template <class M>
bool isFinite(const MeanSums<M>& sums) {
  return std::isfinite(sums.cost) && std::isfinite(sums.weight);
}

/// Σ over some features about a reference y, in the frame of y. The Hessian is exact where the scatter is asked for,
/// else good to eight digits, as Newton's method needs it.
template <HasRotationSums M>
class RotationSums {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;
  static constexpr int k = T::DoF;
  static constexpr bool frame = k == 6;

  using Tangent = typename T::Tangent;
  using Square = typename T::Square;

 public:
  /// Adds the sums over the features begin … end-1 to those of an empty pass; Weighted false takes all weights as one.
  /// False, and nothing of value in the pass, if a quaternion is not a unit one to 1e-5 (float: 1e-3) or something is not
  /// finite: then the general formulas say what comes out. The residuals of at most residual_block features are stored
  /// where the pass asks for them.
  template <bool Weighted, KernelPass Pass, class R, class W>
  static bool add(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end,
                  const M& y, MeanPass<M>& pass, ResidualColumns<S> residuals = nullptr) {
    using Kernel = RotationKernel<S, frame, halfTurns<M>(), Weighted, Pass>;
    constexpr bool scatter_too = Pass == KernelPass::last;
    typename Kernel::Arguments arguments;
    for (int i = 0; i < (frame ? 7 : 4); ++i) arguments.reference[i] = T::parameters(y)[i];
    arguments.residuals = residuals;
    if constexpr (frame && Pass == KernelPass::residuals) {
      Eigen::Map<Eigen::Matrix<S, 3, 3, Eigen::RowMajor>>(arguments.to_reference) = toAxesOf(y);
    }
    const bool good = runOnFeatures < Kernel, M, frame ? 7 : 4,
               Weighted > (set, samples, weights, begin, end, arguments, [&](std::size_t i) {
                 if (!(arguments.defect < largest_excess<S>)) return false;
                 addSums<scatter_too>(arguments, pass);
                 if constexpr (Kernel::exact && halfTurns<M>() != 0)
                   closestToCutLocus(arguments, samples, i, y, pass.scatter.smallest_gap);
                 return true;
               });
    if constexpr (frame) toReference<scatter_too>(y, pass);
    return good && isFinite(pass.sums);
  }

 private:
  template <bool Scatter, class Arguments>
  static void addSums(const Arguments& a, MeanPass<M>& pass) {
    MeanSums<M>& sums = pass.sums;
    constexpr int r0 = frame ? 3 : 0;
    sums.cost += a.cost;
    sums.weight += static_cast<double>(a.weight);
    for (int i = 0; i < k; ++i) sums.gradient[i] += a.gradient[i];
    const S *h = a.hessian, rest = a.weight - (h[0] + h[3] + h[5]);
    Square& H = sums.hessian;
    H(r0, r0) += h[0] + rest, H(r0 + 1, r0 + 1) += h[3] + rest, H(r0 + 2, r0 + 2) += h[5] + rest;
    H(r0 + 1, r0) += h[1], H(r0 + 2, r0) += h[2], H(r0 + 2, r0 + 1) += h[4];
    H(r0, r0 + 1) += h[1], H(r0, r0 + 2) += h[2], H(r0 + 1, r0 + 2) += h[4];
    if constexpr (frame) H.template topLeftCorner<3, 3>().diagonal().array() += a.weight;
    if constexpr (Scatter) addScatter(a, pass.scatter);
  }
  template <class Arguments>
  static void addScatter(const Arguments& a, ScatterSums<M>& sums) {
    sums.scatter += symmetricFromTriangle<Square>(a.scatter);
    sums.squared += symmetricFromTriangle<Square>(a.squared);
    sums.largest = std::max(sums.largest, static_cast<S>(std::sqrt(a.largest)));
    sums.largest_angle = std::max(sums.largest_angle, static_cast<S>(std::sqrt(a.largest_angle)));
    sums.fourth += static_cast<double>(a.fourth);
  }
  /// The kernel's cosine is for choosing: the angle itself is worked out for the few features that may have the least.
  template <class Arguments, class R>
  static void closestToCutLocus(const Arguments& a, const R& samples, std::size_t begin, const M& y, S& smallest_gap) {
    const typename T::Group to_y = T::placement(y).inverse();
    const S margin = S(1e-4);
    S threshold = a.largest_gap_cosine - margin;
    if (std::isfinite(smallest_gap)) threshold = std::max(threshold, std::cos(S(0.5) * smallest_gap) - margin);
    for (std::size_t j = 0; j < a.count; ++j) {
      if (a.gap_cosines[j] < threshold) continue;
      const S gap = T::nearestRepresentative(T::act(to_y, M(samples[begin + j]))).gap();
      smallest_gap = std::min(smallest_gap, gap);
      threshold = std::max(threshold, std::cos(S(0.5) * smallest_gap) - margin);
    }
  }
  static Eigen::Matrix<S, 3, 3> toAxesOf(const M& y) {
    const S* const q = T::parameters(y);
    return So3Math<S>::matrix(Eigen::Matrix<S, 4, 1>(-q[0], -q[1], -q[2], q[3]));
  }
  /// Translations from the axes of the world to those of y.
  template <bool Scatter>
  static void toReference(const M& y, MeanPass<M>& pass) {
    const Eigen::Matrix<S, 3, 3> to_y = toAxesOf(y);
    Tangent& gradient = pass.sums.gradient;
    gradient.template head<3>() = (to_y * gradient.template head<3>()).eval();
    if constexpr (Scatter) {
      for (Square* m : {&pass.scatter.scatter, &pass.scatter.squared}) {
        m->template topRows<3>() = (to_y * m->template topRows<3>()).eval();
        m->template leftCols<3>() = (m->template leftCols<3>() * to_y.transpose()).eval();
      }
    }
  }
};

}  // namespace liestat::detail
