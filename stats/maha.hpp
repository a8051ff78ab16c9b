// maha: the feature of least sum of squared Mahalanobis distances to measurements that each have their covariance, and
// fuse. Pennec 1998, section 4.2, with the exact gradient and Hessian (means.md, section 4; the report's printed ones
// are in stats/printed.hpp).
//
// Two models that coincide on points, rotations and every group, and differ on frames:
//   CovarianceAt::measured   S_i lives in the frame of measurement x_i (a sensor's): w = log(x_i, y), μ² = wᵀ S_i⁻¹ w
//   CovarianceAt::estimated  V_i lives in the frame of the estimate (an object's): z = log(y, x_i), μ² = zᵀ V_i⁻¹ z;
//                            the noise x_i = exp(x, e_i), Cov(e_i) = V_i, of the report's experiments
// Feeding noise of one model to the other gives a wrong answer, not a rough one: the caller says which it is.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/packing.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/mean.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <concepts>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// The frame in which a measurement's covariance is expressed.
enum class CovarianceAt { measured, estimated };

enum class MahaMethod {
  newton,       ///< exact Hessian where the manifold offers it and it is positive definite, else Gauss-Newton's
  gauss_newton  ///< Σ Jᵀ S⁻¹ J: linear convergence at large spread
};

/// Options of maha().
template <Homogeneous M>
struct MahaOptions {
  MahaMethod method = MahaMethod::newton;
  /// Stop when a step's norm (rad, m) falls below; unset: max(1e-12, 4 eps (scale of the data)). Steps that rounding
  /// keeps above it end the iteration too, once they are below √eps standard deviations of the estimate.
  std::optional<double> tolerance = {};
  int max_iterations = 100;
  /// Where to start; unset: the chordal mean weighted by det(Σ_i)^(-1/k), for quotients the best of several data.
  std::optional<M> start = {};
  /// Adds the log-determinant of the volume element: the maximum likelihood of noise that is Gaussian in the chart.
  bool likelihood = false;
};

/// What maha() returns. Matrices are in the local frame at the mean.
template <Homogeneous M>
struct MahaResult {
  M mean = ManifoldTraits<M>::origin();
  Status status = Status::too_few;
  int iterations = 0;    ///< steps taken, the last one below the tolerance
  double residual = 0;   ///< norm of the last step
  double tolerance = 0;  ///< the one that was used
  std::size_t n = 0;
  ScalarOf<M> cost = 0;                            ///< ½ Σ μ_i², with the volume terms if likelihood was asked for
  SquareOf<M> hessian = SquareOf<M>::Zero();       ///< exact Hessian of the cost
  SquareOf<M> gauss_newton = SquareOf<M>::Zero();  ///< Σ Jᵀ S⁻¹ J
  /// H⁻¹ H_GN H⁻¹, or H⁻¹ with likelihood (means.md, section 4.3); NaN where H is not positive definite.
  SquareOf<M> covariance = SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());

  /// Mean and covariance together.
  Gaussian<M> estimate() const { return {mean, covariance}; }
};

/// det(Σ)^(-1/k): the weight that WLSQ gives to a measurement of covariance Σ (Pennec 1998, section 5.1).
template <class S, int N>
S scalarWeight(const Eigen::Matrix<S, N, N>& covariance) {
  using std::exp;
  return exp(-detail::Cholesky<S, N>(covariance).logDeterminant() / S(N));
}

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

/// What maha() iterates on: the measurements with their information matrices.
template <Homogeneous M, class R>
struct MahaProblem {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  static constexpr bool second_order = HasSecondOrder<M>;

  const R& samples;
  std::vector<SquareOf<M>> information;
  CovarianceAt at;
  bool likelihood;

  /// One measurement's part of the sums at y.
  void add(std::size_t i, const M& y, MahaSums<M>& sums) const {
    const M& x = samples[i].mean;
    const bool measured = at == CovarianceAt::measured;
    const ErrorVector<M> e = measured ? errorVector(x, y) : errorVector(y, x);
    const SquareOf<M>& J = measured ? e.by_feature : e.by_base;
    SquareOf<M> B = information[i];
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
    MahaSums<M> sums =
        sumOverData<MahaSums<M>>(executor, information.size(), [&](std::size_t i, MahaSums<M>& s) { add(i, y, s); });
    sums.hessian = S(0.5) * (sums.hessian + sums.hessian.transpose()).eval();
    return sums;
  }

  /// The exact Hessian at y, by central differences of the exact gradient where the manifold has no second order.
  template <Executor E>
  SquareOf<M> hessian(const E& executor, const M& y, const MahaSums<M>& sums) const {
    if constexpr (second_order) {
      return sums.hessian;
    } else {
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

  MahaProblem<M, R> problem{samples, {}, at, options.likelihood};
  problem.information.reserve(result.n);
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
    problem.information.push_back(factor.inverse());
    if (!options.start) weights.push_back(scalarWeight(g.covariance)), features.push_back(g.mean);
  }

  M y =
      options.start ? *options.start : startOfMean<M>(Samples<M>(std::move(features)), Samples<S>(std::move(weights)));
  MahaSums<M> sums = problem.evaluate(executor, y);
  {
    double scale = 1 + static_cast<double>(T::logOrigin(y).norm());
    result.tolerance = options.tolerance.value_or(automaticTolerance<S>(scale));
  }
  result.status = Status::not_converged;
  bool reached = false;
  while (result.iterations < options.max_iterations) {
    TangentOf<M> step;
    bool newton = false;
    if (MahaProblem<M, R>::second_order && options.method == MahaMethod::newton) {
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
    const S rounding = S(16) * std::numeric_limits<S>::epsilon() * (S(1) + std::abs(sums.cost));
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
/// The manifold of a range of features with covariances; for other ranges something that compiles, and RequireGaussians
/// says what is wrong.
template <class>
struct FeatureOfGaussian {
  using type = SO3<double>;
};
template <class M>
struct FeatureOfGaussian<Gaussian<M>> {
  using type = M;
};
template <AnyRange R>
using FeatureInSignature = typename FeatureOfGaussian<ElementOf<R>>::type;

/// States in one sentence why a range has no Mahalanobis mean; `ok` where it has one. `ModelGiven`: the caller said in
/// which frame the covariances are.
template <AnyRange R, bool ModelGiven = true>
struct RequireGaussians {
  using M = FeatureInSignature<R>;
  static constexpr bool gaussians = std::same_as<ElementOf<R>, Gaussian<M>>;
  static constexpr bool one_model = requires { requires ManifoldTraits<M>::covariance_models_coincide; };
  static constexpr bool ok = MultiPass<R> && gaussians && (ModelGiven || one_model);
  static_assert(MultiPass<R>, "liestat: the data can be gone through only once; copy them into a std::vector first.");
  static_assert(gaussians, "liestat: maha and fuse take a range of liestat::Gaussian, features with their covariance.");
  static_assert(ModelGiven || one_model,
                "liestat: on this manifold the frame of the covariances matters: say CovarianceAt::measured (a "
                "sensor's, in the frame of the measurement) or CovarianceAt::estimated (an object's, in the frame of "
                "the estimate).");
};

}  // namespace detail

/// Mahalanobis mean of a range of Gaussian<M>. Status ill_defined if a covariance is not positive definite, too_few for
/// an empty range, not_converged if the data are not finite, not_applicable for CovarianceAt::estimated with an
/// anisotropic covariance on a manifold without a continuous placement (directions) and for likelihood where a user's
/// manifold has no logVolume.
template <Executor E, detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(const E& executor, R&& samples, CovarianceAt at,
                   const MahaOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireGaussians<R>::ok) {
    return detail::mahalanobisMean<M>(executor, detail::asValues<Gaussian<M>>(samples), at, options);
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(R&& samples, CovarianceAt at, const MahaOptions<std::type_identity_t<M>>& options = {}) {
  return maha(SerialExecutor{}, samples, at, options);
}
/// The same where both models coincide (points, rotations, groups); elsewhere it does not compile.
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(R&& samples, const MahaOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireGaussians<R, false>::ok) {
    return maha(SerialExecutor{}, samples, CovarianceAt::measured, options);
  } else {
    return {};
  }
}

/// A range of Gaussians to one: mean and covariance of maha(). The covariance is NaN if there is no trustworthy
/// estimate.
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
Gaussian<M> fuse(R&& samples, CovarianceAt at) {
  return maha(samples, at).estimate();
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
Gaussian<M> fuse(R&& samples) {
  return maha(samples).estimate();
}

}  // namespace liestat
