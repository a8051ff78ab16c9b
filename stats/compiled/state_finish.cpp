// Results of states (stats/state.hpp).
#include <lie/detail/chordal.hpp>
#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/state.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat {
namespace detail {
namespace {

/// The moments of a state, each divided by Σ p.
template <int numbers>
struct Moments {
  Eigen::Matrix<double, numbers, 1> linear = Eigen::Matrix<double, numbers, 1>::Zero();
  Eigen::Matrix<double, numbers, numbers> products;
  double weight, effective;  ///< Σ p, and (Σ p)²/Σ p² rows

  Moments(const StateView& view, const StateLayout& layout) : weight(view.value(layout.weight())) {
    effective = weight * weight / view.value(layout.weight() + 1);
    for (int c = 0; c < layout.linear(); ++c) linear[c] = view.value(c) / weight;
    for (int c = 0, e = layout.linear(); c < numbers; ++c) {
      for (int b = 0; b <= c; ++b, ++e) products(c, b) = products(b, c) = view.value(e) / weight;
    }
  }
};

/// A chordal mean with its estimating function's derivative H and the scatter S of its terms, per unit of weight.
template <class M>
struct ChordalTerms {
  M mean;
  double resultant;
  double uniform_chi2;  ///< of uniform features it follows this law
  std::size_t uniform_dof;
  SquareOf<M> H, S;
};

ChordalTerms<SO2d> chordalTerms(const Moments<2>& m, std::type_identity<SO2d>) {
  const double r = m.linear.norm(), c = m.linear[0] / r, s = m.linear[1] / r;
  const double across = s * s * m.products(0, 0) - 2 * s * c * m.products(1, 0) + c * c * m.products(1, 1);
  return {SO2d(c, s), r, 2 * m.effective * r * r, 2, SquareOf<SO2d>(r), SquareOf<SO2d>(across)};
}
ChordalTerms<S2d> chordalTerms(const Moments<3>& m, std::type_identity<S2d>) {
  const double r = m.linear.norm();
  const S2d mean(m.linear);
  const Eigen::Matrix<double, 3, 2> axes = ManifoldTraits<S2d>::placement(mean).matrix().template leftCols<2>();
  return {mean,
          r,
          3 * m.effective * r * r,
          3,
          SquareOf<S2d>(r * SquareOf<S2d>::Identity()),
          SquareOf<S2d>(axes.transpose() * m.products * axes)};
}
ChordalTerms<SO3d> chordalTerms(const Moments<4>& m, std::type_identity<SO3d>) {
  Symmetric4<double> A;
  for (int i = 0, e = 0; i < 4; ++i) {
    for (int j = 0; j <= i; ++j, ++e) A.lower[e] = m.products(i, j);
  }
  const Eigen::Vector4d q = dominantEigenvector(A);
  Eigen::Matrix4d to_mean;
  to_mean << q[3], q[2], -q[1], -q[0],  //
      -q[2], q[3], q[0], -q[1],         //
      q[1], -q[0], q[3], -q[2],         //
      q[0], q[1], q[2], q[3];
  const Eigen::Matrix4d local = to_mean * m.products * to_mean.transpose();
  const Eigen::Matrix3d B = local.topLeftCorner<3, 3>();
  const double largest = local(3, 3);
  return {SO3d::fromParams(q),
          std::sqrt(std::max(largest, 0.0)),
          12 * m.effective * (m.products.squaredNorm() - 0.25),
          9,
          SquareOf<SO3d>(0.5 * (largest * Eigen::Matrix3d::Identity() - B)),
          B};
}

}  // namespace
}  // namespace detail

template <Metric M>
ChordalMean<M> MomentState<M>::finish() const {
  constexpr int k = ManifoldTraits<M>::DoF;
  const detail::StateView view = this->view();
  ChordalMean<M> result;
  result.n = this->n();
  const auto without = [&](Status status, const char* reason) {
    result.status = status, result.reason = reason;
    return result;
  };
  const detail::Moments<static_cast<int>(MomentState::row)> moments(view, MomentState::layout);
  if (result.n == 0 || !(moments.weight > 0)) return without(Status::too_few, detail::no_features_reason);
  const auto terms = detail::chordalTerms(moments, std::type_identity<M>());
  result.resultant = terms.resultant;
  // Vectors that cancel have no mean.
  if (!(terms.resultant > 1e-15)) return without(Status::ill_defined, detail::scattered_reason);
  result.mean = terms.mean;
  if (result.n <= static_cast<std::size_t>(k)) return without(Status::too_few, detail::too_few_reason);
  if (!(detail::chiSquaredTail(terms.uniform_chi2, terms.uniform_dof) < 0.01)) {
    return without(Status::ill_defined, detail::scattered_reason);
  }
  const detail::Cholesky<double, k> factor(terms.H);
  if (!factor.ok()) return without(Status::ill_defined, detail::hessian_reason);
  const SquareOf<M> half = factor.template solve<k>(terms.S);
  const SquareOf<M> full = factor.template solve<k>(SquareOf<M>(half.transpose()));
  // As covarianceFromResiduals: weights are precisions.
  const SquareOf<M> covariance = 0.5 * (full + full.transpose()) / static_cast<double>(result.n - 1);
  const double n = static_cast<double>(result.n);
  // Hotelling's 95 % region reaches no farther than 0.5 rad along its longest axis, which the trace bounds.
  const auto reaches = [&](double variance) { return !(detail::hotellingTail(0.25 / variance, k, n) < 0.05); };
  if (reaches(covariance.trace()) && reaches(detail::SymmetricEigen<SquareOf<M>>(covariance).values[k - 1])) {
    return without(Status::ill_defined, detail::wide_region_reason);
  }
  result.estimate = Gaussian<M>{result.mean, covariance};
  result.status = Status::ok;
  return result;
}

template <Metric M>
CertifiedMean<M> SumState<M>::finish(const CertifiedMeanOptions<M>& options) const {
  constexpr int k = ManifoldTraits<M>::DoF;
  constexpr detail::StateLayout at = SumState::layout;
  const detail::StateView view = this->view();
  CertifiedMean<M> result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status, result.reason = reason;
    return result;
  };
  MeanResult<M>& mean = result.mean;
  mean.n = this->n();
  mean.mean = reference();
  const double weight = view.value(at.weight());
  if (mean.n == 0 || !(weight > 0)) return without(Status::too_few, detail::no_features_reason);

  const auto symmetric = [&](int first) {
    SquareOf<M> A;
    for (int c = 0, e = first; c < k; ++c) {
      for (int b = 0; b <= c; ++b, ++e) A(c, b) = A(b, c) = view.value(e);
    }
    return A;
  };
  TangentOf<M> gradient;
  for (int c = 0; c < k; ++c) gradient[c] = view.value(at.gradient() + c);
  // Σ p (I - g (|u|² I - u uᵀ))
  SquareOf<M> hessian = weight * SquareOf<M>::Identity();
  if constexpr (k > 1) {
    const SquareOf<M> curved = symmetric(at.hessian());
    hessian += curved - curved.trace() * SquareOf<M>::Identity();
  }
  const SquareOf<M> scatter = symmetric(at.scatter());
  TangentOf<M> step;
  const double reach = static_cast<double>(ManifoldTraits<M>::injectivityRadius());
  if (!detail::solveStep(hessian, gradient, step) || !(step.norm() < reach)) step = gradient / weight;
  mean.mean = exp(mean.mean, step);
  mean.iterations = pass();
  mean.residual = step.norm();
  mean.tolerance = options.mean.tolerance.value_or(1e-12);
  mean.status = mean.residual <= mean.tolerance ? Status::ok : Status::not_converged;
  // The scale of the weights goes back into what it divided: powers of two, which round nothing.
  const double scale = std::ldexp(1.0, this->weight_exponent());
  mean.sum_of_weights = scale * weight;
  mean.cost = 0.5 * scale * scatter.trace();
  mean.hessian = scale * hessian;
  mean.scatter = scale * scatter;
  mean.squared_weight_scatter = scale * scale * symmetric(at.squared());
  mean.largest_angle = mean.largest_distance = std::sqrt(view.largest());
  mean.angle_fourth_moment = scale * view.value(at.fourth());
  if (mean.status != Status::ok) return without(Status::not_converged, detail::not_converged_reason);
  if (mean.n <= static_cast<std::size_t>(k)) return without(Status::too_few, detail::too_few_reason);

  const detail::WeightSums weights{static_cast<double>(mean.n), mean.sum_of_weights,
                                   scale * scale * view.value(at.weight() + 1), !this->weighted()};
  CertifiedMean<M> certified{.mean = mean};
  // Beyond this angle the curvature of directions was cut off (stats/compiled/state.cpp).
  const bool complete = k != 2 || mean.largest_angle < 3.11;
  if (complete && detail::certifyBySums(weights, options, certified)) return certified;
  const bool decided = detail::concentrationBySums(mean, weights, result.concentration);
  if (decided && !result.concentration.concentrated) return without(Status::ill_defined, detail::scattered_reason);
  if (!covarianceFromResiduals(mean).allFinite()) return without(Status::ill_defined, detail::hessian_reason);
  result.uniqueness.minimiser = mean.mean, result.uniqueness.cost = mean.cost;
  if (complete) detail::isUniqueBySums(mean, options.uniqueness.tie_tolerance, result.uniqueness);
  return without(Status::not_applicable, detail::sums_reason);
}

template class MomentState<SO2d>;
template class MomentState<S2d>;
template class MomentState<SO3d>;
template class SumState<SO2d>;
template class SumState<S2d>;
template class SumState<SO3d>;

namespace detail {
namespace {

template <class M, class Result>
void fill(liestat_mean& out, const M& mean, const Result& result) {
  constexpr int k = ManifoldTraits<M>::DoF;
  // Nothing, and vectors that cancel, have no mean.
  if (out.n > 0 && !(out.resultant < 1e-15)) std::copy_n(mean.data(), M::num_parameters, out.mean);
  if (result.estimate) {
    for (int i = 0; i < k * k; ++i) out.covariance[i] = result.estimate->covariance(i / k, i % k);
  }
  out.status = name(result.status), out.reason = result.reason;
}

template <class M>
int finishAs(const void* state, const StateLayout& layout, liestat_mean& out) {
  const std::span<const std::byte> bytes(static_cast<const std::byte*>(state), 8 * layout.words());
  StateError error = StateError::none;
  if (layout.kind == LIESTAT_MOMENTS) {
    const auto moments = MomentState<M>::fromBytes(bytes, &error);
    if (!moments) return static_cast<int>(error);
    const ChordalMean<M> mean = moments->finish();
    out.n = mean.n, out.left_out = moments->left_out();
    if (out.n > 0) out.resultant = mean.resultant;
    fill(out, mean.mean, mean);
  } else {
    const auto sums = SumState<M>::fromBytes(bytes, &error);
    if (!sums) return static_cast<int>(error);
    const CertifiedMean<M> mean = sums->finish();
    out.step = mean.mean.residual, out.n = mean.mean.n, out.left_out = sums->left_out();
    fill(out, mean.mean.mean, mean);
    out.another_pass = sums->needsPass(mean) ? 1 : 0;
  }
  return LIESTAT_STATE_OK;
}

}  // namespace
}  // namespace detail
}  // namespace liestat

int liestat_state_finish(const void* state, liestat_mean* result) {
  using namespace liestat;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  *result = {};
  std::fill_n(result->mean, 4, nan), std::fill_n(result->covariance, 9, nan);
  result->resultant = result->step = nan;
  double copy[2];
  std::memcpy(copy, state, sizeof copy);
  const detail::StateLayout layout = detail::StateView(copy).layout();
  switch (layout.manifold) {
    case LIESTAT_HEADING:
      return detail::finishAs<SO2d>(state, layout, *result);
    case LIESTAT_DIRECTION:
      return detail::finishAs<S2d>(state, layout, *result);
    case LIESTAT_ROTATION:
      return detail::finishAs<SO3d>(state, layout, *result);
    default:
      return LIESTAT_STATE_FOREIGN;
  }
}
