// The sums of a mean over rotations, frames and their quotients, from the kernels of stats/detail/rotation_kernel.hpp.
#pragma once

#include <lie/so3.hpp>
#include <stats/detail/feature_layout.hpp>
#include <stats/detail/rotation_kernel.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <vector>

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

/// The sums of a pass, in the frame of its reference.
template <class M>
struct TangentSums {
  using S = typename ManifoldTraits<M>::Scalar;
  using Tangent = typename ManifoldTraits<M>::Tangent;
  using Square = typename ManifoldTraits<M>::Square;

  S cost = 0;
  double weight = 0;
  Tangent gradient = Tangent::Zero();
  Square hessian = Square::Zero(), scatter = Square::Zero(), squared = Square::Zero();
  S largest = 0, largest_angle = 0, smallest_gap = std::numeric_limits<S>::infinity();
  double fourth = 0;

  bool isFinite() const { return std::isfinite(cost) && gradient.allFinite() && hessian.allFinite(); }
};

/// Σ over some features about a reference y, in the frame of y. The Hessian is exact where the scatter is asked for,
/// else good to eight digits, as Newton's method needs it.
template <HasRotationSums M>
class RotationSums : public TangentSums<M> {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;
  static constexpr int k = T::DoF;
  static constexpr bool frame = k == 6;

 public:
  using Base = TangentSums<M>;
  using Base::cost, Base::weight, Base::gradient, Base::hessian, Base::scatter, Base::squared, Base::largest,
      Base::largest_angle, Base::smallest_gap, Base::fourth;
  using typename Base::Square, typename Base::Tangent;

  /// Sums over the features begin … end-1; Weighted false takes all weights as one. False, and nothing of value in the
  /// sums, if a quaternion is not a unit one to 1e-5 (float: 1e-3) or something is not finite: then the general
  /// formulas say what comes out.
  /// The residuals of at most residual_block features are stored where the pass asks for them.
  template <bool Weighted, KernelPass Pass, class R, class W>
  bool add(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end, const M& y,
           ResidualColumns<S> residuals = nullptr) {
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
                 addSums<scatter_too>(arguments);
                 if constexpr (Kernel::exact && halfTurns<M>() != 0) closestToCutLocus(arguments, samples, i, y);
                 return true;
               });
    if constexpr (frame) toReference<scatter_too>(y);
    return good && this->isFinite();
  }

 private:
  template <bool Scatter, class Arguments>
  void addSums(const Arguments& a) {
    constexpr int r0 = frame ? 3 : 0;
    cost += a.cost;
    weight += static_cast<double>(a.weight);
    for (int i = 0; i < k; ++i) gradient[i] += a.gradient[i];
    const S *h = a.hessian, trace = h[0] + h[3] + h[5];
    Eigen::Matrix<S, 3, 3> rotation;
    rotation << h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5];
    rotation.diagonal().array() += a.weight - trace;
    hessian.template block<3, 3>(r0, r0) += rotation;
    if constexpr (frame) hessian.template topLeftCorner<3, 3>().diagonal().array() += a.weight;
    if constexpr (Scatter) {
      scatter += symmetricFromTriangle<Square>(a.scatter);
      squared += symmetricFromTriangle<Square>(a.squared);
      largest = std::max(largest, static_cast<S>(std::sqrt(a.largest)));
      largest_angle = std::max(largest_angle, static_cast<S>(std::sqrt(a.largest_angle)));
      fourth += static_cast<double>(a.fourth);
    }
  }
  /// The kernel's cosine is for choosing: the angle itself is worked out for the few features that may have the least.
  template <class Arguments, class R>
  void closestToCutLocus(const Arguments& a, const R& samples, std::size_t begin, const M& y) {
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
  void toReference(const M& y) {
    const Eigen::Matrix<S, 3, 3> to_y = toAxesOf(y);
    gradient.template head<3>() = (to_y * gradient.template head<3>()).eval();
    if constexpr (Scatter) {
      for (Square* m : {&scatter, &squared}) {
        m->template topRows<3>() = (to_y * m->template topRows<3>()).eval();
        m->template leftCols<3>() = (m->template leftCols<3>() * to_y.transpose()).eval();
      }
    }
  }
};

}  // namespace liestat::detail
