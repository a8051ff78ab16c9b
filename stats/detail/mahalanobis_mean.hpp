// The iteration of maha() of stats/maha.hpp: sums over the measurements and Newton's method on them.
#pragma once

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

/// The problem that maha() iterates on: the measurements with their information matrices.
template <Homogeneous M, class R>
struct MahaProblem {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  static constexpr bool second_order = HasSecondOrder<M>;

  const R& samples;
  CovarianceAt at;
  bool likelihood;
  std::vector<SquareOf<M>> information = {};
  /// The measurements for kernels, where there are such for these; then there is no information above.
  MahaGroups<M> groups = {};
  bool by_kernels = HasMahaGroups<M> && (MahaModelsCoincide<M> || at == CovarianceAt::measured) && !likelihood;

  void reserve(std::size_t n) {
    if constexpr (HasMahaGroups<M>) {
      if (by_kernels) return groups.reserve(n);
    }
    information.reserve(n);
  }
  /// The next measurement, whose covariance has this factor.
  void append(const M& x, const Cholesky<S, T::DoF>& factor) {
    if constexpr (HasMahaGroups<M>) {
      if (by_kernels) {
        if (groups.add(x, factor.inverse())) return;
        // The general formulas say what comes out of quaternions that are not unit ones.
        by_kernels = false;
        for (std::size_t i = 0; i < groups.size(); ++i) {
          information.push_back(Cholesky<S, T::DoF>(samples[i].covariance).inverse());
        }
      }
    }
    information.push_back(factor.inverse());
  }

  /// True where the sums have the exact Hessian: the manifold's, or the kernel's.
  bool hasHessian(const MahaSums<M>& sums) const { return second_order || (by_kernels && sums.hessian.allFinite()); }

  /// One measurement's part of the sums at y.
  void add(std::size_t i, const M& y, MahaSums<M>& sums) const { add(i, information[i], y, sums); }
  /// The same with its information B.
  void add(std::size_t i, SquareOf<M> B, const M& y, MahaSums<M>& sums) const {
    const M& x = samples[i].mean;
    const bool measured = at == CovarianceAt::measured;
    const ErrorVector<M> e = measured ? errorVector(x, y) : errorVector(y, x);
    const SquareOf<M>& J = measured ? e.by_feature : e.by_base;
    TangentOf<M> a = B * e.z;
    sums.cost += S(0.5) * e.z.dot(a);
    const SquareOf<M> BJ = B * J;
    sums.gauss_newton += J.transpose() * BJ;
    if constexpr (requires { T::logVolume(e.z); }) {
      if (likelihood) {
        const auto volume = T::logVolume(e.z);
        sums.cost += volume.value;
        a += volume.gradient;
        B += volume.hessian;
      }
    }
    sums.gradient += J.transpose() * a;
    if constexpr (second_order) {
      // J = D(z) Q with Q = D⁻¹ J constant in z to the order that counts: isotropy and the representative's half-turn.
      if (measured) {
        const SquareOf<M> Q = T::dexpOrigin(e.z) * J;
        sums.hessian += J.transpose() * B * J + Q.transpose() * T::dlogFeatureTransposed(e.z, a) * J;
      } else {
        sums.hessian += J.transpose() * B * J + T::dlogBaseTransposed(e.z, a) * J;
      }
    }
  }

  template <Executor E>
  MahaSums<M> evaluate(const E& executor, const M& y) const {
    MahaSums<M> sums;
    if (by_kernels) {
      if constexpr (HasMahaGroups<M>) {
        const auto general = [&](std::size_t i, MahaSums<M>& s) {
          add(i, Cholesky<S, T::DoF>(samples[i].covariance).inverse(), y, s);
        };
        sums = groups.template evaluate<MahaSums<M>, second_order>(executor, y, general);
      }
    } else {
      sums =
          sumOverData<MahaSums<M>>(executor, information.size(), [&](std::size_t i, MahaSums<M>& s) { add(i, y, s); });
    }
    sums.hessian = S(0.5) * (sums.hessian + sums.hessian.transpose()).eval();
    return sums;
  }

  /// The exact Hessian at y, by central differences of the exact gradient where the manifold has no second order.
  template <Executor E>
  SquareOf<M> hessian(const E& executor, const M& y, const MahaSums<M>& sums) const {
    if constexpr (second_order) {
      return sums.hessian;
    } else {
      if (hasHessian(sums)) return sums.hessian;
      using std::cbrt;
      const S h = cbrt(std::numeric_limits<S>::epsilon());
      SquareOf<M> H;
      for (int k = 0; k < T::DoF; ++k) {
        const TangentOf<M> step = h * TangentOf<M>::Unit(k);
        const M ahead = exp(y, step), behind = exp(y, TangentOf<M>(-step));
        H.col(k) = (frameTransport(y, ahead).transpose() * evaluate(executor, ahead).gradient -
                    frameTransport(y, behind).transpose() * evaluate(executor, behind).gradient) /
                   (S(2) * h);
      }
      return S(0.5) * (H + H.transpose());
    }
  }
};

template <Homogeneous M, Executor E, class R>
MahaResult<M> mahalanobisMean(const E& executor, const R& samples, CovarianceAt at, const MahaOptions<M>& options) {
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

  MahaProblem<M, R> problem{samples, at, options.likelihood};
  problem.reserve(result.n);
  std::vector<S> weights;
  std::vector<M> features;
  if (!options.start) weights.reserve(result.n), features.reserve(result.n);
  for (const Gaussian<M>& g : samples) {
    const Cholesky<S, T::DoF> factor(g.covariance);
    const bool finite = g.covariance.allFinite();
    if (finite && !factor.ok()) {
      result.status = Status::ill_defined;
      return result;
    }
    if constexpr (T::Group::DoF != T::DoF) {
      const S v = g.covariance.trace() / S(T::DoF);
      if (at == CovarianceAt::estimated && (g.covariance - v * SquareOf<M>::Identity()).norm() > S(1e-6) * v) {
        result.status = Status::not_applicable;
        return result;
      }
    }
    problem.append(g.mean, factor);
    if (!options.start) weights.push_back(scalarWeight(g.covariance)), features.push_back(g.mean);
  }

  M y = options.start ? *options.start
                      : startOfMean<M>(executor, Samples<M>(std::move(features)), Samples<S>(std::move(weights)));
  MahaSums<M> sums = problem.evaluate(executor, y);
  const S scale = S(1) + T::logOrigin(y).norm();
  result.tolerance = options.tolerance.value_or(automaticTolerance<S>(static_cast<double>(scale)));
  result.status = Status::not_converged;
  bool reached = false;
  while (result.iterations < options.max_iterations) {
    TangentOf<M> step;
    bool newton = false;
    if (options.method == MahaMethod::newton && problem.hasHessian(sums)) {
      const Cholesky<S, T::DoF> factor(sums.hessian);
      newton = factor.ok();
      if (newton) step = -factor.solve(sums.gradient);
    }
    if (!newton) step = -Cholesky<S, T::DoF>(sums.gauss_newton).solve(sums.gradient);
    const double previous = result.iterations > 0 ? result.residual : std::numeric_limits<double>::infinity();
    result.residual = static_cast<double>(step.norm());
    if (!std::isfinite(result.residual)) break;
    // Where standard deviations differ by factors of hundreds, the rounding of the precise measurements moves the
    // estimate along its less certain directions by more than the tolerance, for ever. Steps that no longer shrink,
    // and are below √eps standard deviations of the estimate, are such rounding.
    const bool stalled =
        result.residual > 0.5 * previous && step.dot(sums.gauss_newton * step) < std::numeric_limits<S>::epsilon();
    ++result.iterations;
    // Halving until the cost decreases keeps the iteration from cycling between two sets of representatives.
    // The cost's rounding: of its sum, and of the errors, whose coordinates are rounded in units of the scale; a change
    // of an error changes the cost by the root of its information, however many deviations the scale has.
    const S rounding = std::numeric_limits<S>::epsilon() *
                       (S(16) * (S(1) + std::abs(sums.cost)) +
                        S(4) * scale * std::sqrt(S(2) * std::abs(sums.cost) * sums.gauss_newton.trace()));
    M next = exp(y, step);
    MahaSums<M> next_sums = problem.evaluate(executor, next);
    bool accepted = next_sums.cost <= sums.cost + rounding;
    for (int halving = 0; !accepted && halving < 30; ++halving) {
      step *= S(0.5);
      next = exp(y, step);
      next_sums = problem.evaluate(executor, next);
      accepted = next_sums.cost <= sums.cost + rounding;
    }
    if (!accepted) {
      // A kink of the criterion: no descent along an exact descent direction. Or the rounding of the cost, which is
      // large where coordinates are large in deviations: not of steps that are nothing.
      reached = result.residual <= result.tolerance;
      break;
    }
    y = next, sums = next_sums;
    if (result.residual <= result.tolerance || stalled) {
      reached = true;
      break;
    }
  }

  result.mean = y;
  result.cost = sums.cost;
  result.gauss_newton = sums.gauss_newton;
  if (!reached) return result;
  result.hessian = problem.hessian(executor, y, sums);
  const Cholesky<S, T::DoF> factor(result.hessian);
  result.status = factor.ok() ? Status::ok : Status::ill_defined;
  if (result.status == Status::ok) {
    const SquareOf<M> inverse = factor.inverse();
    result.covariance = options.likelihood ? inverse : SquareOf<M>(inverse * sums.gauss_newton * inverse);
  }
  return result;
}

}  // namespace detail
}  // namespace liestat
