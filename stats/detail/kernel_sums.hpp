// The sums of a mean over directions, plane rotations and frames, and points, from the kernels of
// stats/detail/direction_kernel.hpp; and those of any manifold that has a kernel.
#pragma once

#include <lie/detail/chordal.hpp>
#include <stats/detail/direction_kernel.hpp>
#include <stats/detail/rotation_sums.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace liestat::detail {

template <class M, template <class> class Moments>
concept HasMomentsLike = HasParameterSums<M> && std::same_as<typename ManifoldTraits<M>::ChordalMoments, Moments<M>>;
/// S², SO(2), Frame2 and R^n up to six dimensions as the library keeps them in memory, in double and float.
template <class M>
concept HasDirectionSums = HasMomentsLike<M, DirectionMoments>;
template <class M>
concept HasPlanarSums = HasMomentsLike<M, ComplexMoments> && Metric<M> &&
    (ManifoldTraits<M>::DoF == 1 || ManifoldTraits<M>::DoF == 3);
template <class M>
concept HasPointSums = HasMomentsLike<M, FlatMoments> && Metric<M> &&(ManifoldTraits<M>::DoF <= 6);

/// Σ over some features about a reference y, in the frame of y, like RotationSums.
template <class M>
  requires(HasDirectionSums<M> || HasPlanarSums<M> || HasPointSums<M>)
class SimpleSums {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;
  using Tangent = typename T::Tangent;
  using Square = typename T::Square;
  static constexpr int k = T::DoF;
  static constexpr std::size_t numbers = T::ChordalMoments::Sums::linear;

  template <bool Weighted, KernelPass Pass>
  static auto kernel() {
    if constexpr (HasDirectionSums<M>) {
      return std::type_identity<DirectionKernel<S, Weighted, Pass>>();
    } else if constexpr (HasPlanarSums<M>) {
      return std::type_identity<PlanarKernel<S, k == 3, Weighted, Pass>>();
    } else {
      return std::type_identity<PointKernel<S, numbers, Weighted, Pass>>();
    }
  }

 public:
  /// As RotationSums::add; false also for directions and plane rotations opposite to y.
  template <bool Weighted, KernelPass Pass, class R, class W>
  static bool add(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end,
                  const M& y, MeanPass<M>& pass, ResidualColumns<S> residuals = nullptr) {
    using Kernel = typename decltype(kernel<Weighted, Pass>())::type;
    typename Kernel::Arguments arguments;
    for (std::size_t c = 0; c < numbers; ++c) arguments.reference[c] = parametersOf(y)[c];
    arguments.residuals = residuals;
    if constexpr (HasDirectionSums<M> && Pass == KernelPass::residuals) {
      Eigen::Map<Eigen::Matrix<S, 3, 2>>(arguments.axes) = T::placement(y).matrix().template leftCols<2>();
    }
    return runOnFeatures<Kernel, M, numbers, Weighted>(set, samples, weights, begin, end, arguments,
                                                       [&](std::size_t) {
                                                         if (!(arguments.defect < largest_excess<S>)) return false;
                                                         addSums<Pass == KernelPass::last>(arguments, y, pass);
                                                         return true;
                                                       }) &&
           isFinite(pass.sums);
  }

 private:
  template <bool Scatter, class Arguments>
  static void addSums(const Arguments& a, const M& y, MeanPass<M>& pass) {
    MeanSums<M>& sums = pass.sums;
    ScatterSums<M>& scatter = pass.scatter;
    sums.cost += a.cost, sums.weight += static_cast<double>(a.weight);
    if constexpr (Scatter) {
      scatter.largest = std::max(scatter.largest, static_cast<S>(std::sqrt(a.largest)));
      scatter.largest_angle = std::max(scatter.largest_angle, static_cast<S>(std::sqrt(a.largest_angle)));
      scatter.fourth += static_cast<double>(a.fourth);
    }
    if constexpr (HasDirectionSums<M>) {
      using Matrix3 = Eigen::Matrix<S, 3, 3>;
      const Eigen::Matrix<S, 3, 2> axes = T::placement(y).matrix().template leftCols<2>();
      const auto inPlane = [&](const S* triangle) -> Square {
        return axes.transpose() * (symmetricFromTriangle<Matrix3>(triangle) * axes).eval();
      };
      sums.gradient += axes.transpose() * Eigen::Map<const Eigen::Matrix<S, 3, 1>>(a.gradient);
      sums.hessian += inPlane(a.along) + a.across * Square::Identity();
      if constexpr (Scatter) scatter.scatter += inPlane(a.scatter), scatter.squared += inPlane(a.squared);
    } else {
      // Translations are in the axes of the world.
      Square axes = Square::Identity();
      if constexpr (HasPlanarSums<M> && k == 3) {
        const S c = parametersOf(y)[0], s = parametersOf(y)[1];
        axes(0, 0) = axes(1, 1) = c, axes(0, 1) = -s, axes(1, 0) = s;
      }
      const auto inFrame = [&](const S* triangle) -> Square {
        return axes.transpose() * (symmetricFromTriangle<Square>(triangle) * axes).eval();
      };
      sums.gradient += axes.transpose() * Eigen::Map<const Tangent>(a.gradient);
      sums.hessian.diagonal().array() += a.weight;
      if constexpr (Scatter) scatter.scatter += inFrame(a.scatter), scatter.squared += inFrame(a.squared);
    }
  }
};

/// The class that makes the sums of M by kernels.
template <class M>
struct KernelSumsOf {};
template <HasRotationSums M>
struct KernelSumsOf<M> {
  using type = RotationSums<M>;
};
template <class M>
  requires(HasDirectionSums<M> || HasPlanarSums<M> || HasPointSums<M>)
struct KernelSumsOf<M> {
  using type = SimpleSums<M>;
};
template <class M>
concept HasKernelSums = requires {
  typename KernelSumsOf<M>::type;
};

}  // namespace liestat::detail
