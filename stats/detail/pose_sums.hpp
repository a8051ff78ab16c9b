// The sums of the exponential barycentres of SE(3) and SE(2) from the kernels of stats/detail/group_kernel.hpp and
// stats/detail/planar_group_kernel.hpp.
#pragma once

#include <lie/se3.hpp>
#include <stats/concentration.hpp>
#include <stats/detail/feature_layout.hpp>
#include <stats/detail/group_kernel.hpp>
#include <stats/detail/packing.hpp>
#include <stats/detail/planar_group_kernel.hpp>
#include <stats/detail/rotation_sums.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace liestat {

// The name alone: units without motions of the plane need no more of these classes.
template <class Scalar_, int Options_>
class SO2;
template <class Scalar_, int Options_>
class SE2;

}  // namespace liestat

namespace liestat::detail {

/// SE(2) as the library keeps it, in double and float.
template <class G>
concept HasPlanarPoseSums = std::same_as<G, SE2<double, 0>> || std::same_as<G, SE2<float, 0>>;
/// SE(3) and SE(2).
template <class G>
concept HasPoseSums = std::same_as<G, SE3<double>> || std::same_as<G, SE3<float>> || HasPlanarPoseSums<G>;

/// The rotations of poses.
template <class G>
struct RotationOfPose {
  using type = SO3<typename G::Scalar>;
  static type of(const G& x) { return x.so3(); }
};
template <HasPlanarPoseSums G>
struct RotationOfPose<G> {
  using type = SO2<typename G::Scalar, 0>;
  static type of(const G& x) { return x.so2(); }
};

/// The rotations of poses, as features of their own.
template <HasPoseSums G, class R>
struct RotationPart {
  using S = typename G::Scalar;
  const R& samples;

  std::size_t size() const { return std::ranges::size(samples); }
  typename RotationOfPose<G>::type operator[](std::size_t i) const { return RotationOfPose<G>::of(samples[i]); }
  Layout<const S> layout() const requires ContiguousFeatures<R, G> {
    return FeatureBlock<G, G::num_parameters, 1>().layout(samples, 0, size());
  }
};

/// Σ over some poses about a reference, in its body axes. Full false leaves out the scatter and what lies off the
/// jacobian's diagonal.
template <HasPoseSums G>
struct PoseSums {
  using S = typename G::Scalar;
  using Tangent = Eigen::Matrix<S, G::DoF, 1>;
  using Square = Eigen::Matrix<S, G::DoF, G::DoF>;
  static constexpr bool planar = HasPlanarPoseSums<G>;
  static constexpr std::size_t numbers = G::num_parameters;
  Tangent sum = Tangent::Zero();  ///< Σ p z
  Square jacobian = Square::Zero(), scatter = Square::Zero();
  double weight = 0, squared_weight = 0, squared_angle = 0;
  double refused = 0;  ///< 1 where a quaternion is not a unit one

  void operator+=(const PoseSums& other) {
    sum += other.sum, jacobian += other.jacobian, scatter += other.scatter;
    weight += other.weight, squared_weight += other.squared_weight, squared_angle += other.squared_angle;
    refused = std::max(refused, other.refused);
  }
  std::vector<double> pack() const {
    return packed(sum, jacobian, scatter, weight, squared_weight, squared_angle, refused);
  }
  static PoseSums unpack(std::span<const double> list) {
    PoseSums s;
    unpackInto(list, s.sum, s.jacobian, s.scatter, s.weight, s.squared_weight, s.squared_angle, s.refused);
    return s;
  }

  template <bool Weighted, bool Full, class R, class W>
  void add(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end, const G& y) {
    using Kernel = std::conditional_t<planar, PlanarPoseKernel<S, Weighted, Full>, PoseKernel<S, Weighted, Full>>;
    typename Kernel::Arguments arguments;
    for (std::size_t c = 0; c < numbers; ++c) arguments.reference[c] = y.data()[c];
    runOnFeatures<Kernel, G, numbers, Weighted>(set, samples, weights, begin, end, arguments, [&](std::size_t) {
      if (!(arguments.defect < largest_excess<S>)) refused = 1;
      weight += static_cast<double>(arguments.weight), squared_weight += static_cast<double>(arguments.squared_weight);
      if constexpr (Full) squared_angle += static_cast<double>(arguments.squared_angle);
      if constexpr (planar) {
        addPlanarSums<Full>(arguments, y);
      } else {
        addSums<Full>(arguments, y);
      }
      return true;
    });
  }

 private:
  /// From the axes of the world to those of the body.
  template <bool Full, class Arguments>
  void addSums(const Arguments& a, const G& y) {
    using Vector3 = Eigen::Matrix<S, 3, 1>;
    using Matrix3 = Eigen::Matrix<S, 3, 3>;
    const Matrix3 to_body = y.so3().inverse().matrix();
    const auto turned = [&](const Matrix3& m) -> Matrix3 { return (to_body * m).eval() * to_body.transpose(); };
    const Vector3 rho(a.rho[0], a.rho[1], a.rho[2]), phi(a.phi[0], a.phi[1], a.phi[2]);
    sum.template head<3>() += to_body * rho;
    sum.template tail<3>() += to_body * phi;
    // Σ p V⁻¹ = Σ p (I - ½ [φ] + g (u uᵀ - |u|² I)).
    Matrix3 diagonal = symmetricFromTriangle<Matrix3>(a.outer);
    diagonal.diagonal().array() += a.weight - diagonal.trace();
    diagonal -= S(0.5) * SO3<S>::hat(phi);
    diagonal = turned(diagonal);
    jacobian.template topLeftCorner<3, 3>() += diagonal;
    jacobian.template bottomRightCorner<3, 3>() += diagonal;
    if constexpr (Full) {
      jacobian.template topRightCorner<3, 3>() +=
          turned(symmetricFromTriangle<Matrix3>(a.mixed) - S(0.5) * SO3<S>::hat(rho));
      Square outer = symmetricFromTriangle<Square>(a.scatter);
      for (int i = 0; i < 6; i += 3) {
        outer.template middleRows<3>(i) = (to_body * outer.template middleRows<3>(i)).eval();
      }
      for (int i = 0; i < 6; i += 3) {
        outer.template middleCols<3>(i) = (outer.template middleCols<3>(i) * to_body.transpose()).eval();
      }
      scatter += outer;
    }
  }
  template <bool Full, class Arguments>
  void addPlanarSums(const Arguments& a, const G& y) {
    using Vector2 = Eigen::Matrix<S, 2, 1>;
    Square to_body = Square::Identity();
    const S cosine = y.data()[0], sine = y.data()[1];
    to_body(0, 0) = to_body(1, 1) = cosine, to_body(0, 1) = sine, to_body(1, 0) = -sine;
    const auto turned = [&](const S* v) -> Vector2 {
      return Vector2(cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0]);
    };
    const Vector2 rho = turned(a.rho);
    sum += Tangent(rho[0], rho[1], a.theta);
    // Σ p V⁻¹, the same in all axes.
    jacobian(0, 0) += a.weight - a.excess, jacobian(1, 1) += a.weight - a.excess;
    jacobian(0, 1) += S(0.5) * a.theta, jacobian(1, 0) -= S(0.5) * a.theta;
    jacobian(2, 2) += a.weight;
    if constexpr (Full) {
      const Vector2 mixed = turned(a.mixed);
      jacobian(0, 2) += mixed[0] - S(0.5) * rho[1], jacobian(1, 2) += mixed[1] + S(0.5) * rho[0];
      scatter += to_body * (symmetricFromTriangle<Square>(a.scatter) * to_body.transpose()).eval();
    }
  }
};

/// One pass over the poses.
template <bool Full, HasPoseSums G, Executor E, class R, class W>
PoseSums<G> poseSums(const E& executor, const R& samples, const W& weights, const G& y) {
  const std::size_t n = std::ranges::size(samples), chunks = chunkCount(n);
  const InstructionSet set = instructionSetOf(executor);
  return executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        PoseSums<G> sums;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        sums.template add<!std::same_as<W, UnitWeights>, Full>(set, samples, weights, range.begin, range.end, y);
        return sums;
      },
      [](PoseSums<G>& a, const PoseSums<G>& b) { a += b; });
}

}  // namespace liestat::detail
