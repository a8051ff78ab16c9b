// The sums of the Mahalanobis mean from the kernels of stats/detail/maha_kernel.hpp and maha_simple_kernel.hpp.
#pragma once

#include <lie/frame3.hpp>
#include <lie/so3.hpp>
#include <stats/detail/feature_layout.hpp>
#include <stats/detail/maha_kernel.hpp>
#include <stats/detail/maha_simple_kernel.hpp>
#include <stats/detail/rotation_sums.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

namespace liestat {

// Only the names: a unit that has none of these features need not read their headers.
template <class Scalar_, int Options_>
class SO2;
template <class Scalar_, int Options_>
class S2;
template <class Scalar_, int Options_>
class Frame2;
template <class Scalar_, int Options_>
class SemiOrientedFrame3;
template <class Scalar_, int Options_>
class NonOrientedFrame3;

}  // namespace liestat

namespace liestat::detail {

/// The kernel of the sums of M; `unit` is how many of the first parameters have the length one. Points have none.
template <class M>
struct MahaKernelOf {};
template <PackScalar S>
struct MahaKernelOf<SO3<S, 0>> {
  using type = MahaKernel<S, false>;
  static constexpr std::size_t unit = 4;
};
template <PackScalar S>
struct MahaKernelOf<Frame3<S, 0>> {
  using type = MahaKernel<S, true>;
  static constexpr std::size_t unit = 4;
};
template <PackScalar S>
struct MahaKernelOf<SemiOrientedFrame3<S, 0>> {
  using type = MahaKernel<S, true, halfTurns<SemiOrientedFrame3<S, 0>>()>;
  static constexpr std::size_t unit = 4;
};
template <PackScalar S>
struct MahaKernelOf<NonOrientedFrame3<S, 0>> {
  using type = MahaKernel<S, true, halfTurns<NonOrientedFrame3<S, 0>>()>;
  static constexpr std::size_t unit = 4;
};
template <PackScalar S>
struct MahaKernelOf<SO2<S, 0>> {
  using type = MahaPlanarKernel<S, false>;
  static constexpr std::size_t unit = 2;
};
template <PackScalar S>
struct MahaKernelOf<Frame2<S, 0>> {
  using type = MahaPlanarKernel<S, true>;
  static constexpr std::size_t unit = 2;
};
template <PackScalar S>
struct MahaKernelOf<S2<S, 0>> {
  using type = MahaDirectionKernel<S>;
  static constexpr std::size_t unit = 3;
};
template <PackScalar S, int N>
  requires(N >= 1 && N <= 6)
struct MahaKernelOf<Eigen::Matrix<S, N, 1>> {
  using type = MahaPointKernel<S, static_cast<std::size_t>(N)>;
  static constexpr std::size_t unit = 0;
};

template <class M>
concept HasMahaGroups = requires {
  typename MahaKernelOf<M>::type;
};
/// Covariances of the estimate are those of the measurement.
template <class M>
concept MahaModelsCoincide = requires {
  requires ManifoldTraits<M>::covariance_models_coincide;
};

/// Measurements with the information of each, as the kernel reads them.
template <class M>
class MahaGroups {};

template <HasMahaGroups M>
class MahaGroups<M> {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;
  using Kernel = typename MahaKernelOf<M>::type;
  using Square = typename T::Square;
  static constexpr int k = T::DoF;
  static constexpr std::size_t unit = MahaKernelOf<M>::unit;
  static constexpr bool spatial = unit == 4, planar = unit == 2, direction = unit == 3,
                        frame = spatial ? k == 6 : k == 3;
  static constexpr std::size_t lanes = Kernel::lanes;

 public:
  void reserve(std::size_t n) { values_.reserve((n + lanes - 1) / lanes * Kernel::group_size); }
  std::size_t size() const { return size_; }
  /// False, and the measurement is not taken, if its unit quaternion, complex number or vector has not the length one
  /// to 1e-5 (float: 5e-4).
  bool add(const M& x, const Square& information) {
    const std::size_t lane = size_ % lanes;
    const S* const q = x.data();
    S norm = 1;
    if constexpr (unit > 0) {
      norm = 0;
      for (std::size_t c = 0; c < unit; ++c) norm += q[c] * q[c];
      norm = std::sqrt(norm);
      if (!(std::abs(norm - 1) < (sizeof(S) == 8 ? S(1e-5) : S(5e-4)))) return false;
    }
    if (lane == 0) values_.resize(values_.size() + Kernel::group_size, S(0));
    S* p = group() + lane;
    for (std::size_t c = 0; c < Kernel::parameters; ++c, p += lanes) {
      *p = c < unit ? q[c] / norm : q[c];
      // Lanes that nobody fills have no information, and the parameters of the first.
      if (lane == 0) std::fill(p, p + lanes, *p);
    }
    if constexpr (direction) {
      const Eigen::Matrix<S, 3, 2> axes = T::placement(x).matrix().template leftCols<2>();
      addTriangle(Eigen::Matrix<S, 3, 3>(axes * information * axes.transpose()), p);
    } else {
      addTriangle(information, p);
    }
    ++size_;
    return true;
  }

  /// Sums of the type Sums, with members cost, gradient, gauss_newton and hessian, at y; general(i, sums) adds the
  /// measurement i where a kernel refuses: at half a turn from y, on the cut locus of a quotient. There the Hessian is NaN if it is not one of those
  /// that the general formulas have.
  template <class Sums, bool GeneralHessian, Executor E, class General>
  Sums evaluate(const E& executor, const M& y, const General& general) const {
    const std::size_t groups = values_.size() / Kernel::group_size, chunks = chunkCount(groups, 1024 / lanes);
    const InstructionSet set = instructionSetOf(executor);
    return executor.reduce(
        chunks,
        [&](std::size_t chunk) {
          const ChunkRange range = chunkRange(groups, chunks, chunk);
          typename Kernel::Arguments arguments;
          arguments.groups = values_.data() + range.begin * Kernel::group_size;
          arguments.count = range.size();
          for (std::size_t c = 0; c < Kernel::parameters; ++c) arguments.reference[c] = y.data()[c];
          if constexpr (spatial) {
            using Vector4 = Eigen::Matrix<S, 4, 1>;
            const Eigen::Matrix<S, 3, 3> to_y =
                So3Math<S>::matrix(Vector4(-y.data()[0], -y.data()[1], -y.data()[2], y.data()[3]));
            for (int i = 0; i < 3; ++i) {
              for (int j = 0; j < 3; ++j) arguments.to_y[i][j] = to_y(i, j);
            }
          }
          runKernel<Kernel>(set, arguments);
          if constexpr (planar || direction || Quotient<M>) {
            if (arguments.defect > 0) {
              Sums sums;
              for (std::size_t i = range.begin * lanes; i < std::min(range.end * lanes, size_); ++i) general(i, sums);
              if (!GeneralHessian) sums.hessian.setConstant(std::numeric_limits<S>::quiet_NaN());
              return sums;
            }
          }
          return sumsOf<Sums>(arguments, y);
        },
        [](Sums& a, const Sums& b) { a += b; });
  }

 private:
  S* group() { return values_.data() + (values_.size() - Kernel::group_size); }

  template <class Matrix>
  static void addTriangle(const Matrix& m, S* p) {
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
      for (Eigen::Index j = 0; j <= i; ++j, p += lanes) *p = m(i, j);
    }
  }

  template <class Sums, class Arguments>
  static Sums sumsOf(const Arguments& a, [[maybe_unused]] const M& y) {
    Sums sums;
    sums.cost = a.cost;
    if constexpr (direction) {
      using Matrix3 = Eigen::Matrix<S, 3, 3>;
      const Eigen::Matrix<S, 3, 2> axes = T::placement(y).matrix().template leftCols<2>();
      const auto inPlane = [&](const S* triangle) -> Square {
        return axes.transpose() * (symmetricFromTriangle<Matrix3>(triangle) * axes).eval();
      };
      sums.gradient = axes.transpose() * Eigen::Map<const Eigen::Matrix<S, 3, 1>>(a.gradient);
      sums.gauss_newton = inPlane(a.gauss_newton);
      sums.hessian = sums.gauss_newton + inPlane(a.curvature) - a.radial * Square::Identity();
    } else {
      for (int i = 0; i < k; ++i) sums.gradient[i] = a.gradient[i];
      sums.gauss_newton = symmetricFromTriangle<Square>(a.gauss_newton);
      sums.hessian = sums.gauss_newton;
      if constexpr (spatial) {
        sums.hessian.template bottomRightCorner<3, 3>() +=
            Eigen::Map<const Eigen::Matrix<S, 3, 3, Eigen::RowMajor>>(a.curvature);
        if constexpr (frame) {
          sums.hessian.template topRightCorner<3, 3>() +=
              SO3<S>::hat(Eigen::Matrix<S, 3, 1>(sums.gradient.template head<3>()));
        }
      } else if constexpr (planar && frame) {
        sums.hessian(0, 2) += sums.gradient[1], sums.hessian(1, 2) -= sums.gradient[0];
      }
    }
    return sums;
  }

  std::vector<S> values_;
  std::size_t size_ = 0;
};

}  // namespace liestat::detail
