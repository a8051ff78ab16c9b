// The iteration of maha() of stats/maha.hpp: sums over the measurements and Newton's method on them.
#pragma once

#include <lie/detail/small_factors.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/maha_groups.hpp>
#include <stats/detail/packing.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/maha_types.hpp>
#include <stats/mean.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <ranges>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

template <Homogeneous M>
struct MahaSums {
  ScalarOf<M> cost = 0;
  TangentOf<M> gradient = TangentOf<M>::Zero();
  SquareOf<M> gauss_newton = SquareOf<M>::Zero(), hessian = SquareOf<M>::Zero();

  void operator+=(const MahaSums& other) {
    cost += other.cost;
    gradient += other.gradient;
    gauss_newton += other.gauss_newton;
    hessian += other.hessian;
  }
  std::vector<double> pack() const { return packed(cost, gradient, gauss_newton, hessian); }
  static MahaSums unpack(std::span<const double> list) {
    MahaSums s;
    unpackInto(list, s.cost, s.gradient, s.gauss_newton, s.hessian);
    return s;
  }
};

/// The manifold differentiates its Jacobians, so the exact Hessian costs one pass.
template <class M>
concept HasSecondOrder = requires(const TangentOf<M>& z) {
  ManifoldTraits<M>::dlogFeatureTransposed(z, z);
  ManifoldTraits<M>::dlogBaseTransposed(z, z);
};

/// The problem that maha() iterates on: the measurements, whitened by W with WᵀW = S⁻¹.
template <Homogeneous M, class R>
struct MahaProblem {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  static constexpr bool second_order = HasSecondOrder<M>;

  const R& samples;
  CovarianceAt at;
  bool likelihood;
  std::span<const SquareOf<M>> factors = {};  ///< those of the covariances, more exact than these; or none
  std::vector<SquareOf<M>> whitening = {};
  /// The measurements for kernels, where there are such for these; then there is no list above.
  MahaGroups<M> groups = {};
  bool by_kernels = HasMahaGroups<M> && (MahaModelsCoincide<M> || at == CovarianceAt::measured) && !likelihood;

  void reserve(std::size_t n) {
    if constexpr (HasMahaGroups<M>) {
      if (by_kernels) return groups.reserve(n);
    }
    whitening.reserve(n);
  }
  /// The next measurement, whose covariance has this factor.
  void append(const M& x, const Cholesky<S, T::DoF>& factor) {
    if constexpr (HasMahaGroups<M>) {
      if (by_kernels) {
        if (groups.add(x, factor.inverse())) return;
        by_kernels = false;
      }
    }
    appendWhitening(factor);
  }

  /// True where the sums have the exact Hessian: the manifold's, or the kernel's.
  bool hasHessian(const MahaSums<M>& sums) const { return second_order || (by_kernels && sums.hessian.allFinite()); }

  /// One measurement's part of the sums at y, in coordinates v of the tangent vectors axes·v; none: those themselves.
  void add(std::size_t i, const SquareOf<M>& W, const M& y, const SquareOf<M>* axes, MahaSums<M>& sums) const {
    const M& x = samples[i].mean;
    const bool measured = at == CovarianceAt::measured;
    const ErrorVector<M> e = measured ? errorVector(x, y) : errorVector(y, x);
    SquareOf<M> J = measured ? e.by_feature : e.by_base;
    if (axes != nullptr) J = product(J, *axes);
    // Squares of what is whitened: in products with S⁻¹ its small eigenvalues would drown in the rounding of the large.
    const SquareOf<M> whitened = product(W, J);
    const TangentOf<M> residual = product(W, e.z);
    sums.cost += S(0.5) * residual.squaredNorm();
    sums.gradient += whitened.transpose() * residual;
    const SquareOf<M> square = whitened.transpose() * whitened;
    sums.gauss_newton += square;
    [[maybe_unused]] TangentOf<M> a = W.transpose() * residual;
    if constexpr (second_order) sums.hessian += square;
    if constexpr (requires { T::logVolume(e.z); }) {
      if (likelihood) {
        const auto volume = T::logVolume(e.z);
        sums.cost += volume.value;
        sums.gradient += J.transpose() * volume.gradient;
        a += volume.gradient;
        if constexpr (second_order) sums.hessian += J.transpose() * volume.hessian * J;
      }
    }
    if constexpr (second_order) {
      // J = D(z) Q with Q = D⁻¹ J constant in z to the order that counts: isotropy and the representative's half-turn.
      if (measured) {
        const SquareOf<M> Q = T::dexpOrigin(e.z) * J;
        sums.hessian += Q.transpose() * T::dlogFeatureTransposed(e.z, a) * J;
      } else if (axes == nullptr) {
        sums.hessian += T::dlogBaseTransposed(e.z, a) * J;
      } else {
        sums.hessian += axes->transpose() * T::dlogBaseTransposed(e.z, a) * J;
      }
    }
  }

  /// The sums at y, in the coordinates of add(): by kernels in those of tangent vectors alone.
  template <Executor E>
  MahaSums<M> evaluate(const E& executor, const M& y, const SquareOf<M>* axes = nullptr) const {
    MahaSums<M> sums;
    if (by_kernels && axes == nullptr) {
      if constexpr (HasMahaGroups<M>) {
        const auto general = [&](std::size_t i, MahaSums<M>& s) { add(i, whiteningOf(i), y, nullptr, s); };
        sums = groups.template evaluate<MahaSums<M>, second_order>(executor, y, general);
      }
    } else {
      sums = sumOverData<MahaSums<M>>(executor, std::ranges::size(samples), [&](std::size_t i, MahaSums<M>& s) {
        if (whitening.empty()) return add(i, whiteningOf(i), y, axes, s);
        add(i, whitening[i], y, axes, s);
      });
    }
    sums.hessian = S(0.5) * (sums.hessian + sums.hessian.transpose()).eval();
    return sums;
  }

  /// The exact Hessian at y in the coordinates of the axes, of which the sums are. Where the manifold has no second
  /// order, the sums' one if they are those of a kernel; else what bends the errors by central differences.
  template <Executor E>
  SquareOf<M> hessian(const E& executor, const M& y, const MahaSums<M>& sums, const SquareOf<M>* axes = nullptr) const {
    if constexpr (second_order) {
      return sums.hessian;
    } else {
      if (axes == nullptr && hasHessian(sums)) return sums.hessian;
      const SquareOf<M> bend = curvature(executor, y, axes != nullptr ? *axes : SquareOf<M>(SquareOf<M>::Identity()));
      return sums.gauss_newton + S(0.5) * (bend + bend.transpose());
    }
  }

 private:
  /// Apart from append(), whose loop it would slow down.
  LIESTAT_NO_INLINE void appendWhitening(const Cholesky<S, T::DoF>& factor) {
    if constexpr (HasMahaGroups<M>) {
      // The general formulas say what comes out of quaternions that are not unit ones.
      while (whitening.size() < groups.size()) whitening.push_back(whiteningOf(whitening.size()));
    }
    whitening.push_back(whiteningOf(whitening.size(), factor));
  }
  SquareOf<M> whiteningOf(std::size_t i) const { return whiteningOf(i, Cholesky<S, T::DoF>(samples[i].covariance)); }
  SquareOf<M> whiteningOf(std::size_t i, const Cholesky<S, T::DoF>& factor) const {
    if (factors.empty()) return factor.template halfSolve<T::DoF>(SquareOf<M>::Identity());
    return inverse<S, T::DoF>(factors[i]);
  }
  /// Σ ∂(Jᵀ a)/∂y with a = S⁻¹ z kept, in the coordinates of the axes: what the Hessian has beyond Gauss and Newton's
  /// matrix, by central differences. With likelihood, with the volume's.
  template <Executor E>
  SquareOf<M> curvature(const E& executor, const M& y, const SquareOf<M>& axes) const {
    struct Sum {
      SquareOf<M> value = SquareOf<M>::Zero();
      void operator+=(const Sum& other) { value += other.value; }
      std::vector<double> pack() const { return packed(value); }
      static Sum unpack(std::span<const double> list) {
        Sum s;
        unpackInto(list, s.value);
        return s;
      }
    };
    using std::cbrt;
    // Half of what balances rounding and the error of the differences, which grows towards cut loci.
    const S h = S(0.5) * cbrt(std::numeric_limits<S>::epsilon());
    std::vector<M> moved;
    std::vector<SquareOf<M>> transport;
    TangentOf<M> scale;
    for (int k = 0; k < T::DoF; ++k) {
      const S length = axes.col(k).norm();
      scale[k] = length < S(1) ? h / length : h;
      for (const S side : {S(-1), S(1)}) {
        moved.push_back(exp(y, TangentOf<M>(side * scale[k] * axes.col(k))));
        transport.push_back(frameTransport(y, moved.back()));
      }
    }
    const bool measured = at == CovarianceAt::measured;
    return sumOverData<Sum>(
               executor, std::ranges::size(samples),
               [&](std::size_t i, Sum& sum) {
                 const M& x = samples[i].mean;
                 const SquareOf<M> W = whitening.empty() ? whiteningOf(i) : whitening[i];
                 const ErrorVector<M> e = measured ? errorVector(x, y) : errorVector(y, x);
                 TangentOf<M> a = W.transpose() * (W * e.z);
                 if constexpr (requires { T::logVolume(e.z); }) {
                   if (likelihood) {
                     const auto volume = T::logVolume(e.z);
                     a += volume.gradient;
                     const SquareOf<M> J = product(measured ? e.by_feature : e.by_base, axes);
                     sum.value += J.transpose() * volume.hessian * J;
                   }
                 }
                 for (std::size_t k = 0; k < static_cast<std::size_t>(T::DoF); ++k) {
                   const auto bent = [&](std::size_t j) {
                     const M& at_y = moved[2 * k + j];
                     const ErrorVector<M> there = measured ? errorVector(x, at_y) : errorVector(at_y, x);
                     const SquareOf<M>& carried = transport[2 * k + j];
                     // Errors in the frame of the estimate, and with them a, are carried along.
                     const TangentOf<M> there_a = measured ? a : TangentOf<M>(carried * a);
                     const SquareOf<M>& J = measured ? there.by_feature : there.by_base;
                     return TangentOf<M>(axes.transpose() * (carried.transpose() * (J.transpose() * there_a)));
                   };
                   const int c = static_cast<int>(k);
                   sum.value.col(c) += (bent(1) - bent(0)) / (S(2) * scale[c]);
                 }
               })
        .value;
  }
};

/// The symmetric part of a matrix, symmetric to the last bit.
template <class S, int N>
Eigen::Matrix<S, N, N> symmetricPart(const Eigen::Matrix<S, N, N>& A) {
  return S(0.5) * (A + A.transpose());
}

/// How many times the variance of a coordinate is what it would be if the others were known, at most: a condition of an
/// information matrix L Lᵀ that does not depend on units, from L⁻¹. NaN where there is none.
template <class S, int N>
S varianceInflation(const Eigen::Matrix<S, N, N>& information, const Eigen::Matrix<S, N, N>& half) {
  S most(0);
  for (int j = 0; j < N; ++j) {
    const S inflation = information(j, j) * half.col(j).squaredNorm();
    if (!(inflation <= most)) most = inflation;
  }
  return most;
}

/// Axes at y in which Gauss and Newton's matrix is near the identity, and the sums in them, from any axes: factors of
/// the matrix in one system give the next, until rounding no longer counts. False if the data are not finite.
template <Homogeneous M, Executor E, class R>
bool settleAxes(const E& executor, const MahaProblem<M, R>& problem, const M& y, SquareOf<M>& axes, MahaSums<M>& sums) {
  using S = ScalarOf<M>;
  constexpr int D = ManifoldTraits<M>::DoF;
  for (int i = 0; i < 10; ++i) {
    sums = problem.evaluate(executor, y, &axes);
    if ((sums.gauss_newton - SquareOf<M>::Identity()).norm() < S(0.5)) return true;
    SquareOf<M> regular = sums.gauss_newton;
    // Rounding is all that is left of directions that the data hardly determine; the next system sees them.
    const S rounding = S(4 * D) * std::numeric_limits<S>::epsilon() * regular.trace();
    if (!Cholesky<S, D>(regular).ok()) regular.diagonal().array() += rounding;
    const Cholesky<S, D> factor(regular);
    if (!factor.ok()) return false;
    axes = principalFactor<S, D>(
        product(axes, SquareOf<M>(factor.template halfSolve<D>(SquareOf<M>::Identity()).transpose())));
  }
  return sums.gauss_newton.allFinite() && Cholesky<S, D>(sums.gauss_newton).ok();
}

/// A factor of the covariance A H⁻² Aᵀ, with likelihood A H⁻¹ Aᵀ, from axes A and the Hessian H in them.
template <class S, int N>
Eigen::Matrix<S, N, N> covarianceFactor(const Eigen::Matrix<S, N, N>& axes, const Eigen::Matrix<S, N, N>& hessian,
                                        bool likelihood) {
  using Square = Eigen::Matrix<S, N, N>;
  const Cholesky<S, N> inner(likelihood ? hessian : squareOfFactor<S, N>(hessian));
  // Short axes come first, and each column of the upper triangle mixes in shorter ones alone.
  return product(axes, Square(inner.template halfSolve<N>(Square::Identity()).transpose()));
}

/// Reads the measurements of a problem, and for a start their features and weights. Status ill_defined for a covariance
/// that is not positive definite, not_applicable for an anisotropic one in the frame of an estimate that has none.
template <Homogeneous M, class R>
LIESTAT_NO_INLINE Status readMeasurements(MahaProblem<M, R>& problem, bool for_start, std::vector<ScalarOf<M>>& weights,
                                          std::vector<M>& features) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  const std::size_t n = std::ranges::size(problem.samples);
  problem.reserve(n);
  if (for_start) weights.reserve(n), features.reserve(n);
  for (const Gaussian<M>& g : problem.samples) {
    const Cholesky<S, T::DoF> factor(g.covariance);
    const bool finite = g.covariance.allFinite();
    if (finite && !factor.ok()) return Status::ill_defined;
    if constexpr (T::Group::DoF != T::DoF) {
      const S v = g.covariance.trace() / S(T::DoF);
      if (problem.at == CovarianceAt::estimated && (g.covariance - v * SquareOf<M>::Identity()).norm() > S(1e-6) * v) {
        return Status::not_applicable;
      }
    }
    problem.append(g.mean, factor);
    if (for_start) weights.push_back(scalarWeight(g.covariance)), features.push_back(g.mean);
  }
  return Status::ok;
}

template <Homogeneous M, Executor E, class R>
MahaResult<M> mahalanobisMean(const E& executor, const R& samples, CovarianceAt at, const MahaOptions<M>& options,
                              std::span<const SquareOf<M>> factors = {}) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  MahaResult<M> result;
  result.n = std::ranges::size(samples);
  if (result.n == 0) return result;
  if constexpr (!requires(const TangentOf<M>& z) { T::logVolume(z); }) {
    if (options.likelihood) {
      result.status = Status::not_applicable;
      return result;
    }
  }

  MahaProblem<M, R> problem{samples, at, options.likelihood, factors};
  std::vector<S> weights;
  std::vector<M> features;
  if (const Status status = readMeasurements(problem, !options.start, weights, features); status != Status::ok) {
    result.status = status;
    return result;
  }

  M y = options.start ? *options.start
                      : startOfMean<M>(executor, Samples<M>(std::move(features)), Samples<S>(std::move(weights)));
  MahaSums<M> sums = problem.evaluate(executor, y);
  const S scale = S(1) + T::logOrigin(y).norm();
  result.tolerance = options.tolerance.value_or(automaticTolerance<S>(static_cast<double>(scale)));
  result.status = Status::not_converged;
  // Sums in coordinates of tangent vectors lose as many digits as the condition of their matrices has. Where that
  // counts, and for factors, which have more digits than their squares, sums are taken in axes of their own.
  constexpr S small_step = S(0.01);     // squared, in standard deviations: what is left may be rounding
  std::optional<bool> ill_conditioned;  // a measurement; looked for at most once
  bool own_axes = false, reached = false;
  SquareOf<M> axes = SquareOf<M>::Identity(), half;  // half: L⁻¹ of Gauss and Newton's matrix L Lᵀ
  S information = sums.gauss_newton.trace();
  const auto takeAxes = [&] {
    own_axes = true;
    const Cholesky<S, T::DoF> factor(sums.gauss_newton);
    axes = factor.ok() ? SquareOf<M>(factor.template halfSolve<T::DoF>(SquareOf<M>::Identity()).transpose())
                       : SquareOf<M>(SquareOf<M>::Identity());
    axes = principalFactor<S, T::DoF>(axes);
    const bool settled = settleAxes(executor, problem, y, axes, sums);
    information = inverse<S, T::DoF>(axes).squaredNorm();
    return settled;
  };
  const auto evaluate = [&](const M& at_y) { return problem.evaluate(executor, at_y, own_axes ? &axes : nullptr); };
  const auto tangent = [&](const TangentOf<M>& v) { return own_axes ? TangentOf<M>(product(axes, v)) : v; };
  while (result.iterations < options.max_iterations) {
    TangentOf<M> step;
    bool newton = false;
    if (options.method == MahaMethod::newton && (own_axes ? problem.second_order : problem.hasHessian(sums))) {
      const Cholesky<S, T::DoF> factor(sums.hessian);
      newton = factor.ok();
      if (newton) step = -factor.solve(sums.gradient);
    }
    if (!newton) step = -Cholesky<S, T::DoF>(sums.gauss_newton).solve(sums.gradient);
    const double previous = result.iterations > 0 ? result.residual : std::numeric_limits<double>::infinity();
    result.residual = static_cast<double>(tangent(step).norm());
    if (!std::isfinite(result.residual)) {
      if (!own_axes && sums.gauss_newton.allFinite() && takeAxes()) continue;
      break;
    }
    // Where standard deviations differ by factors of hundreds, the rounding of the precise measurements moves the
    // estimate along its less certain directions by more than the tolerance, for ever. Steps that no longer shrink,
    // and are below √eps standard deviations of the estimate, are such rounding.
    const S length = step.dot(sums.gauss_newton * step);
    // In axes of their own the errors' rounding is all that is left, which moves a step by that many deviations.
    const S moved = S(4) * scale * std::numeric_limits<S>::epsilon();
    const bool tiny =
        length < std::max(std::numeric_limits<S>::epsilon(), own_axes ? moved * moved * information : S(0));
    const bool stalled = result.residual > 0.5 * previous && tiny;
    ++result.iterations;
    // Halving until the cost decreases keeps the iteration from cycling between two sets of representatives.
    // The cost's rounding: of its sum, and of the errors, whose coordinates are rounded in units of the scale; a change
    // of an error changes the cost by the root of its information, however many deviations the scale has.
    if (!own_axes) information = sums.gauss_newton.trace();
    const S rounding =
        std::numeric_limits<S>::epsilon() *
        (S(16) * (S(1) + std::abs(sums.cost)) + S(4) * scale * std::sqrt(S(2) * std::abs(sums.cost) * information));
    M next = exp(y, tangent(step));
    MahaSums<M> next_sums = evaluate(next);
    bool accepted = next_sums.cost <= sums.cost + rounding;
    for (int halving = 0; !accepted && halving < 30; ++halving) {
      step *= S(0.5);
      next = exp(y, tangent(step));
      next_sums = evaluate(next);
      accepted = next_sums.cost <= sums.cost + rounding;
    }
    // Not accepted: a kink of the criterion, no descent along an exact descent direction. Or the rounding of the cost,
    // which is large where coordinates are large in deviations: not of steps that are nothing.
    if (accepted) y = next, sums = next_sums;
    reached = (result.residual <= result.tolerance && (tiny || !own_axes)) || (accepted && stalled);
    const bool stuck = !accepted || (result.residual > 0.5 * previous && length < small_step);
    if (!reached && !stuck) continue;
    // Beyond two thirds of the digits; one third, in the sum or in a measurement, where the steps no longer shrink.
    const S epsilon = std::numeric_limits<S>::epsilon(), many = S(1) / (std::cbrt(epsilon) * std::cbrt(epsilon));
    const auto inverseFactor = [](const SquareOf<M>& matrix) {
      return Cholesky<S, T::DoF>(matrix).template halfSolve<T::DoF>(SquareOf<M>::Identity());
    };
    half = inverseFactor(sums.gauss_newton);
    bool drowns = false;
    if (!own_axes) {
      const S inflation = varianceInflation<S, T::DoF>(sums.gauss_newton, half), some = std::sqrt(many);
      drowns = !(inflation < (reached ? many : some)) || (reached && !factors.empty());
      if (!drowns && !reached) {
        if (!ill_conditioned) {
          ill_conditioned = std::ranges::any_of(samples, [&](const Gaussian<M>& g) {
            return !(varianceInflation<S, T::DoF>(g.covariance, inverseFactor(g.covariance)) < some);
          });
        }
        drowns = *ill_conditioned;
      }
    }
    if (drowns && takeAxes()) continue;
    if (reached || !accepted) break;
  }

  result.mean = y;
  result.cost = sums.cost;
  const auto inTangents = [&](const SquareOf<M>& matrix, const SquareOf<M>& of_axes) {
    const SquareOf<M> back = inverse<S, T::DoF>(of_axes);
    return symmetricPart(SquareOf<M>(back.transpose() * matrix * back));
  };
  result.gauss_newton = own_axes ? inTangents(sums.gauss_newton, axes) : sums.gauss_newton;
  if (!reached) return result;
  result.axes = half.transpose();
  if (own_axes) result.axes = product(axes, result.axes);
  if (problem.second_order || (!own_axes && problem.hasHessian(sums))) {
    const SquareOf<M> bend = product(half, SquareOf<M>(sums.hessian - sums.gauss_newton));
    result.relative_hessian = SquareOf<M>::Identity() + productTransposed(bend, half);
  } else {
    MahaSums<M> unit;
    unit.gauss_newton = SquareOf<M>::Identity();
    result.relative_hessian = problem.hessian(executor, y, unit, &result.axes);
  }
  result.relative_hessian = symmetricPart(result.relative_hessian);
  const bool summed = problem.hasHessian(sums) && !own_axes;
  result.hessian = summed ? sums.hessian : inTangents(result.relative_hessian, result.axes);
  result.status = Cholesky<S, T::DoF>(result.relative_hessian).ok() ? Status::ok : Status::ill_defined;
  if (result.status == Status::ok) {
    result.factor = covarianceFactor<S, T::DoF>(result.axes, result.relative_hessian, options.likelihood);
    result.covariance = squareOfFactor<S, T::DoF>(result.factor);
    if (!result.covariance.allFinite()) result.status = Status::ill_defined;
  }
  return result;
}

}  // namespace detail
}  // namespace liestat
