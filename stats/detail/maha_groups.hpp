// The sums of the Mahalanobis mean from the kernels of stats/detail/maha_kernel.hpp.
#pragma once

#include <lie/frame3.hpp>
#include <lie/so3.hpp>
#include <stats/detail/maha_kernel.hpp>
#include <stats/detail/rotation_sums.hpp>
#include <stats/executor.hpp>

#include <cmath>
#include <concepts>
#include <cstddef>
#include <vector>

namespace liestat::detail {

template <class M>
concept HasMahaGroups = std::same_as<M, SO3<double>> || std::same_as<M, Frame3<double>>;

/// Measurements with the information of each, as the kernel reads them.
template <class M>
class MahaGroups {};

template <HasMahaGroups M>
class MahaGroups<M> {
  static constexpr bool frame = ManifoldTraits<M>::DoF == 6;
  using Kernel = MahaKernel<frame>;
  using Square = typename ManifoldTraits<M>::Square;
  static constexpr int k = ManifoldTraits<M>::DoF;

 public:
  void reserve(std::size_t n) { values_.reserve((n + Kernel::lanes - 1) / Kernel::lanes * Kernel::group_size); }
  std::size_t size() const { return size_; }
  /// False, and the measurement is not taken, if its quaternion is not a unit one to 1e-5.
  bool add(const M& x, const Square& information) {
    const std::size_t lane = size_ % Kernel::lanes;
    const double* const q = x.data();
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(std::abs(norm - 1) < 1e-5)) return false;
    if (lane == 0) {
      // Lanes that nobody fills have no information, and a rotation.
      values_.resize(values_.size() + Kernel::group_size, 0.0);
      for (std::size_t j = 0; j < Kernel::lanes; ++j) group()[3 * Kernel::lanes + j] = 1;
    }
    double* p = group() + lane;
    for (std::size_t c = 0; c < Kernel::parameters; ++c, p += Kernel::lanes) *p = c < 4 ? q[c] / norm : q[c];
    for (int i = 0; i < k; ++i) {
      for (int j = 0; j <= i; ++j, p += Kernel::lanes) *p = information(i, j);
    }
    ++size_;
    return true;
  }

  /// Sums of the type Sums, with members cost, gradient, gauss_newton and hessian, at y.
  template <class Sums, Executor E>
  Sums evaluate(const E& executor, const M& y) const {
    const std::size_t groups = values_.size() / Kernel::group_size, chunks = chunkCount(groups, 128);
    const InstructionSet set = instructionSetOf(executor);
    return executor.reduce(
        chunks,
        [&](std::size_t chunk) {
          const ChunkRange range = chunkRange(groups, chunks, chunk);
          typename Kernel::Arguments arguments;
          arguments.groups = values_.data() + range.begin * Kernel::group_size;
          arguments.count = range.size();
          for (std::size_t c = 0; c < Kernel::parameters; ++c) arguments.reference[c] = y.data()[c];
          const Eigen::Matrix3d to_y =
              So3Math<double>::matrix(Eigen::Vector4d(-y.data()[0], -y.data()[1], -y.data()[2], y.data()[3]));
          for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j) arguments.to_y[i][j] = to_y(i, j);
          }
          runKernel<Kernel>(set, arguments);
          return sumsOf<Sums>(arguments);
        },
        [](Sums& a, const Sums& b) { a += b; });
  }

 private:
  double* group() { return values_.data() + (values_.size() - Kernel::group_size); }

  template <class Sums, class Arguments>
  static Sums sumsOf(const Arguments& a) {
    Sums sums;
    sums.cost = a.cost;
    for (int i = 0; i < k; ++i) sums.gradient[i] = a.gradient[i];
    sums.gauss_newton = symmetricFromTriangle<Square>(a.gauss_newton);
    sums.hessian = sums.gauss_newton;
    sums.hessian.template bottomRightCorner<3, 3>() +=
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(a.curvature);
    if constexpr (frame) {
      sums.hessian.template topRightCorner<3, 3>() +=
          SO3<double>::hat(Eigen::Vector3d(sums.gradient.template head<3>()));
    }
    return sums;
  }

  std::vector<double> values_;
  std::size_t size_ = 0;
};

}  // namespace liestat::detail
