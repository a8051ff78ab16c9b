// groupMean: the exponential barycentre of a Lie group, Σ p_i Log(ȳ⁻¹ x_i) = 0. Equivariant under translations from
// both sides and under inversion, which no Riemannian mean of poses is (docs/theory/means.md, section 5.5). It is not a
// Fréchet mean.
#pragma once

#include <lie/detail/small_products.hpp>
#include <stats/concentration.hpp>
#include <stats/detail/angular_part.hpp>
#include <stats/detail/pose_sums.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>

namespace liestat {

/// The result of groupMean(). Matrices are in the body frame at the mean.
template <LieGroup G>
struct GroupMeanResult {
  G mean;
  Status status = Status::too_few;
  int iterations = 0;
  double residual = 0, tolerance = 0;
  std::size_t n = 0;
  double sum_of_weights = 0;
  SquareOf<G> scatter = SquareOf<G>::Zero();   ///< Σ p_i z_i z_iᵀ
  SquareOf<G> jacobian = SquareOf<G>::Zero();  ///< Σ p_i J_l⁻¹(z_i): minus the derivative of Σ p_i z_i
  Concentration concentration;  ///< concentration of the rotations, the most scattered where there are several

  /// Σ p_i z_i z_iᵀ / Σ p_i
  SquareOf<G> dispersion() const { return scatter / ScalarOf<G>(sum_of_weights); }
  /// Covariance of the barycentre from the residuals, A⁻¹ (Σ p_i z_i z_iᵀ) A⁻ᵀ Σp_i/(n-1), A the jacobian; NaN for one
  /// measurement, and where the rotations are as scattered as uniform ones, which have no mean.
  SquareOf<G> covarianceFromResiduals() const {
    using S = ScalarOf<G>;
    if (n < 2 || !concentration.concentrated) return SquareOf<G>::Constant(std::numeric_limits<S>::quiet_NaN());
    const SquareOf<G> inverse = detail::inverse<S, G::DoF>(jacobian);
    return detail::congruence(inverse, scatter) * (S(sum_of_weights) / (S(n) - S(1)));
  }
};

namespace detail {

template <LieGroup G>
struct GroupMeanSums {
  TangentOf<G> sum = TangentOf<G>::Zero();
  SquareOf<G> jacobian = SquareOf<G>::Zero(), scatter = SquareOf<G>::Zero();
  double weight = 0;

  void operator+=(const GroupMeanSums& other) {
    sum += other.sum;
    jacobian += other.jacobian;
    scatter += other.scatter;
    weight += other.weight;
  }
  std::vector<double> pack() const { return packed(sum, jacobian, scatter, weight); }
  static GroupMeanSums unpack(std::span<const double> list) {
    GroupMeanSums s;
    unpackInto(list, s.sum, s.jacobian, s.scatter, s.weight);
    return s;
  }
};

template <LieGroup G, Executor E, class R, class W>
GroupMeanSums<G> groupMeanSums(const E& executor, const R& samples, const W& weights, const G& y) {
  using S = ScalarOf<G>;
  const G to_mean = y.inverse();
  return sumOverData<GroupMeanSums<G>>(executor, std::ranges::size(samples), [&](std::size_t k, GroupMeanSums<G>& s) {
    const S p = S(weights[k]);
    const TangentOf<G> z = (to_mean * samples[k]).log();
    s.sum += p * z;
    s.jacobian += p * G::leftJacobianInverse(z);
    s.scatter += p * z * z.transpose();
    s.weight += weights[k];
  });
}

/// Newton's method from y on sums(y), which the result keeps; returns the sums of the last pass.
template <LieGroup G, class MakeSums>
auto iterateBarycentre(G y, GroupMeanResult<G>& result, const MakeSums& sums_at) {
  using S = ScalarOf<G>;
  auto sums = sums_at(y);
  for (int i = 0; i < 100; ++i) {
    result.scatter = sums.scatter;
    result.jacobian = sums.jacobian;
    result.sum_of_weights = sums.weight;
    const TangentOf<G> step = detail::inverse<S, G::DoF>(sums.jacobian) * sums.sum;
    result.residual = static_cast<double>(step.norm());
    if (!std::isfinite(result.residual)) break;
    ++result.iterations;
    y = y * G::exp(step);
    if (result.residual <= result.tolerance) {
      result.status = Status::ok;
      break;
    }
    if (i < 99) sums = sums_at(y);
  }
  result.mean = y;
  return sums;
}

/// The barycentre of poses by their kernels: its rotation is the rotations' mean, and then its translation solves a
/// linear system. False, with a result that says nothing, where the kernels don't apply or the rotations have no mean.
template <HasPoseSums G, Executor E, class R, class W>
bool poseBarycentre(const E& executor, const R& samples, const W& weights, const std::optional<G>& start,
                    GroupMeanResult<G>& result) {
  using S = ScalarOf<G>;
  using Rotation = typename RotationOfPose<G>::type;
  constexpr int d = G::Dim, angles_begin = d, rotation_dof = G::DoF - d;
  MeanOptions<Rotation> options;
  if (start) options.start = RotationOfPose<G>::of(*start);
  const auto rotation = frechetMean<Rotation>(executor, RotationPart<G, R>{samples}, weights, options);
  if (rotation.status != Status::ok) return false;
  // A system about any of the translations; one of them, so that nothing cancels far from the origin.
  G y(rotation.mean, G(samples[0]).translation());
  const PoseSums<G> first = poseSums<false>(executor, samples, weights, y);
  if (first.refused > 0) return false;
  y = y * G(Rotation(),
            detail::inverse<S, d>(first.jacobian.template topLeftCorner<d, d>()) * first.sum.template head<d>());
  result.tolerance = automaticTolerance<S>(1 + static_cast<double>(y.log().norm()));
  result.iterations = rotation.iterations;
  const PoseSums<G> sums =
      iterateBarycentre(y, result, [&](const G& at) { return poseSums<true>(executor, samples, weights, at); });
  if (sums.refused > 0 || result.status != Status::ok) return false;
  ScatterOfAngles angles;
  angles.weight = sums.weight, angles.squared_weight = sums.squared_weight;
  angles.sum =
      static_cast<double>(sums.scatter.template block<rotation_dof, rotation_dof>(angles_begin, angles_begin).trace());
  angles.plain = sums.squared_angle, angles.n = static_cast<double>(result.n);
  result.concentration.worsen(angles.judge(rotation_dof == 1 ? circleLaw() : rotationLaw()));
  return true;
}

template <LieGroup G, Executor E, class R, class W>
GroupMeanResult<G> groupBarycentre(const E& executor, const R& samples, const W& weights,
                                   const std::optional<G>& start) {
  using S = ScalarOf<G>;
  GroupMeanResult<G> result;
  result.n = std::ranges::size(samples);
  if (result.n == 0) return result;
  result.status = Status::not_converged;
  if constexpr (HasPoseSums<G>) {
    GroupMeanResult<G> by_kernels = result;
    if (poseBarycentre(executor, samples, weights, start, by_kernels)) return by_kernels;
  }
  const G y = start ? *start : startOfMean<G>(executor, samples, weights);
  result.tolerance = automaticTolerance<S>(1 + static_cast<double>(y.log().norm()));
  iterateBarycentre(y, result, [&](const G& at) { return groupMeanSums(executor, samples, weights, at); });
  result.concentration = angularConcentration<G>(samples, weights, result.mean);
  return result;
}

/// States in one sentence why a range of features has no exponential barycentre; `ok` where it has one.
template <AnyRange R>
struct RequireGroupMean : RequireSamples<R> {
  static constexpr bool ok = RequireSamples<R>::ok && LieGroup<SampleInSignature<R>>;
  static_assert(LieGroup<SampleInSignature<R>>,
                "groupMean needs elements of a Lie group; features of another manifold have mean and maha.");
};
template <class R>
using GroupInSignature = std::conditional_t<LieGroup<SampleInSignature<R>>, SampleInSignature<R>, SO3<double>>;

}  // namespace detail

/// Exponential barycentre of a range of group elements, weighted or not, by Newton's method. Empty: too_few. The same
/// bits on any executor. What may be passed, and what weights are, is said at mean().
template <Executor E, detail::AnyRange R, class G = detail::GroupInSignature<R>>
GroupMeanResult<G> groupMean(const E& executor, R&& samples, const std::optional<std::type_identity_t<G>>& start = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok) {
    return detail::groupBarycentre<G>(executor, detail::asSamples(samples), detail::UnitWeights{}, start);
  } else {
    return {};
  }
}
template <detail::AnyRange R, class G = detail::GroupInSignature<R>>
GroupMeanResult<G> groupMean(R&& samples, const std::optional<std::type_identity_t<G>>& start = {}) {
  return groupMean(SerialExecutor{}, samples, start);
}
template <Executor E, detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
GroupMeanResult<G> groupMean(const E& executor, R&& samples, W&& weights,
                             const std::optional<std::type_identity_t<G>>& start = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<G>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::groupBarycentre<G>(executor, features, numbers, start);
        },
        [] { return detail::without<GroupMeanResult<G>>(Status::not_applicable); });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
GroupMeanResult<G> groupMean(R&& samples, W&& weights, const std::optional<std::type_identity_t<G>>& start = {}) {
  return groupMean(SerialExecutor{}, samples, weights, start);
}

}  // namespace liestat
