// The sums of a mean over directions, plane rotations and frames, and points, a register of features at a time.
//
// With c = <y, x> of unit vectors and u = x - c y, log(y, x) = h(c) u with h(c) = θ/sin θ, cos θ = c, and the Hessian of
// ½ d² is h c I + g(c) u uᵀ with g(c) = (1 - h c)/(1 - c²) = -h'(c). On c >= 0 both are the polynomials of rotations by
// twice the angle (stats/detail/rotation_kernel.hpp); beyond, h is that of half the angle divided by its cosine.
#pragma once

#include <lie/detail/arccosine.hpp>
#include <stats/detail/rotation_kernel.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

namespace liestat::detail {

/// h and g of the angle whose cosine is c and whose squared sine is s2 = 1 - c², which is more exact near 0 and π.
template <class P>
struct AngleOverSine {
  using S = typename P::Scalar;
  P h, g;
  P antipode = P::zero();  ///< 1 where the angle is so near π that the direction of u is lost

  /// Wide for all angles, else for c > -0.01 in every lane; g where Slope says so, and to eight digits only if not Exact.
  template <bool Wide, bool Slope, bool Exact, class Polynomials>
  LIESTAT_ALWAYS_INLINE void evaluate(const P& c, const P& s2, const Polynomials& polynomials) {
    const S factor = static_cast<S>(1 / polynomials.range);
    if constexpr (!Wide) {
      const P variable = (S(1) - c) * factor - S(1);
      h = S(0.5) * evaluatePolynomial(polynomials.log, variable);
      if constexpr (Slope) g = slope<Exact>(variable, polynomials);
    } else {
      const P variable = (S(1) - larger(c, P::zero())) * factor - S(1);
      // The cosine w of half the angle, from the sine where 1 + c would cancel.
      const P w2 = s2 / (S(2) - S(2) * smaller(c, P::zero()));
      const P inverse_w = inverseSquareRoot(w2);
      const P half_variable = (S(1) - w2 * inverse_w) * factor - S(1);
      const auto near = c > S(0);
      h = S(0.5) * select(near, evaluatePolynomial(polynomials.log, variable),
                          evaluatePolynomial(polynomials.log, half_variable) * inverse_w);
      if constexpr (Slope) {
        g = select(near, slope<Exact>(variable, polynomials), (S(1) - h * c) / s2);
      }
      // There the direction of u is a rounding error, which may even lie along y; a few 10^-10 rad in double.
      constexpr S lost = sizeof(S) == 8 ? S(1e-20) : S(1e-9);
      antipode = select(near, P::zero(), select(w2 > lost, P::zero(), P(S(1))));
    }
  }

 private:
  template <bool Exact, class Polynomials>
  LIESTAT_ALWAYS_INLINE static P slope(const P& variable, const Polynomials& polynomials) {
    if constexpr (Exact) {
      return evaluatePolynomial(polynomials.exact_hessian, variable);
    } else {
      return evaluatePolynomial(polynomials.newton_hessian, variable);
    }
  }
};

/// Unit vectors x about the reference y. All sums are in the axes of the space.
template <class S, bool Weighted, KernelPass Pass>
struct DirectionKernel {
  static constexpr std::size_t max_count = 1024;
  struct Arguments {
    Layout<const S> features;
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[3] = {};
    S cost, largest, largest_angle, fourth, defect, weight;
    S gradient[3];                       ///< Σ p h u
    S across;                            ///< Σ p h c
    S along[6], scatter[6], squared[6];  ///< Σ p g u uᵀ, Σ p h² u uᵀ, Σ p² h² u uᵀ
    /// In the tangent plane at y, whose two `axes` stand one after the other.
    ResidualColumns<S> residuals = nullptr;
    S axes[6] = {};
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  /// x - c y, c, the weight.
  static constexpr std::size_t columns = 5, block = 64;

  template <class P>
  struct Run {
    ResidualSums<P, 3, Weighted, Pass == KernelPass::last> residuals;
    P defect = P::zero(), across = P::zero(), along[6];

    LIESTAT_ALWAYS_INLINE Run() { LIESTAT_UNROLL for (P& x : along) x = P::zero(); }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      alignas(64) S data[columns][block];
      Run sums;
      for (std::size_t i = 0; i < arguments.count; i += block) {
        const std::size_t count = std::min(arguments.count - i, block);
        loadColumns<P::set, 3>(arguments.features, 0, i, count, data);
        // The last register is filled up with y, with weight 0; without weights it counts once in Σ h c.
        for (std::size_t j = count; j % P::size != 0; ++j) {
          for (std::size_t c = 0; c < 3; ++c) data[c][j] = arguments.reference[c];
          data[4][j] = 0;
        }
        if constexpr (Weighted) std::memcpy(data[4], arguments.weights + i, count * sizeof(S));
        P least(S(1));
        for (std::size_t j = 0; j < count; j += P::size) sums.project(data, j, arguments.reference, least);
        const S min_cosine = -largestOf(-least);
        if (min_cosine > static_cast<S>(small_rotation_cosine)) {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<false>(data, j, arguments, i, small_rotation<S>);
        } else if (min_cosine > S(0)) {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<false>(data, j, arguments, i, any_rotation<S>);
        } else {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<true>(data, j, arguments, i, any_rotation<S>);
        }
      }
      const std::size_t surplus = (P::size - arguments.count % P::size) % P::size;
      sums.residuals.finish(arguments);
      arguments.across = sumOf(sums.across) - (Weighted ? S(0) : static_cast<S>(surplus));
      arguments.defect = largestOf(sums.defect);
      LIESTAT_UNROLL for (std::size_t a = 0; a < 6; ++a) arguments.along[a] = sumOf(sums.along[a]);
    }
    /// Replaces unit vectors x by x - c y and c.
    LIESTAT_ALWAYS_INLINE void project(S (&data)[columns][block], std::size_t j, const S (&y)[3], P& least) {
      const P x0 = P::load(data[0] + j), x1 = P::load(data[1] + j), x2 = P::load(data[2] + j);
      const P excess = x0 * x0 + x1 * x1 + x2 * x2 - S(1), scale = unitScale(excess);
      defect = larger(absolute(excess), defect);
      const P c = (x0 * y[0] + x1 * y[1] + x2 * y[2]) * scale;
      least = smaller(c, least);
      (x0 * scale - c * y[0]).store(data[0] + j);
      (x1 * scale - c * y[1]).store(data[1] + j);
      (x2 * scale - c * y[2]).store(data[2] + j);
      c.store(data[3] + j);
    }
    template <bool Wide, class Polynomials>
    LIESTAT_ALWAYS_INLINE void add(const S (&data)[columns][block], std::size_t j, const Arguments& arguments,
                                   std::size_t i, const Polynomials& polynomials) {
      const P u[3] = {P::load(data[0] + j), P::load(data[1] + j), P::load(data[2] + j)}, c = P::load(data[3] + j);
      const P s2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
      AngleOverSine<P> angle;
      angle.template evaluate<Wide, true, Pass != KernelPass::step>(c, s2, polynomials);
      defect = larger(angle.antipode, defect);
      P v[3], gu[3], hc = angle.h * c, p(S(1));
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) v[a] = angle.h * u[a], gu[a] = angle.g * u[a];
      if constexpr (Weighted) {
        p = P::load(data[4] + j);
        hc *= p;
        LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) gu[a] *= p;
      }
      const P angle2 = angle.h * angle.h * s2;
      residuals.addAngle(angle2, p);
      residuals.add(v, angle2, p);
      across += hc;
      addOuter(along, u, gu, std::make_index_sequence<6>());
      if constexpr (Pass == KernelPass::residuals) {
        const S* const e = arguments.axes;
        P z[2];
        LIESTAT_UNROLL for (std::size_t a = 0; a < 2; ++a) {
          z[a] = e[3 * a] * v[0] + e[3 * a + 1] * v[1] + e[3 * a + 2] * v[2];
        }
        storeResiduals(z, arguments.residuals, i + j);
      }
    }
  };
};

/// Plane rotations (cos, sin) about the reference, and with Frame their translations less that of the reference, in
/// the axes of the plane.
template <class S, bool Frame, bool Weighted, KernelPass Pass>
struct PlanarKernel {
  static constexpr std::size_t max_count = 1024, k = Frame ? 3 : 1, entries = k * (k + 1) / 2, numbers = Frame ? 4 : 2;
  struct Arguments {
    Layout<const S> features;
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[4] = {};
    S cost, largest, largest_angle, fourth, defect, weight, gradient[k], scatter[entries], squared[entries];
    ResidualColumns<S> residuals = nullptr;  ///< in the frame of the reference
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  /// Cosine and sine of the angle from y, the translation, the weight.
  static constexpr std::size_t columns = numbers + 1, block = 64;

  template <class P>
  struct Run {
    ResidualSums<P, k, Weighted, Pass == KernelPass::last> residuals;
    P defect = P::zero();

    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      alignas(64) S data[columns][block];
      Run sums;
      const S(&y)[4] = arguments.reference;
      for (std::size_t i = 0; i < arguments.count; i += block) {
        const std::size_t count = std::min(arguments.count - i, block);
        loadColumns<P::set, numbers>(arguments.features, 0, i, count, data);
        if constexpr (Weighted) std::memcpy(data[numbers], arguments.weights + i, count * sizeof(S));
        for (std::size_t j = count; j % P::size != 0; ++j) {
          for (std::size_t c = 0; c < numbers; ++c) data[c][j] = y[c];
          data[numbers][j] = 0;
        }
        P least(S(1));
        for (std::size_t j = 0; j < count; j += P::size) sums.turn(data, j, y, least);
        const S min_cosine = -largestOf(-least);
        if (min_cosine > static_cast<S>(small_rotation_cosine)) {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<false>(data, j, arguments, i, small_rotation<S>);
        } else if (min_cosine > S(0)) {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<false>(data, j, arguments, i, any_rotation<S>);
        } else {
          for (std::size_t j = 0; j < count; j += P::size)
            sums.template add<true>(data, j, arguments, i, any_rotation<S>);
        }
      }
      sums.residuals.finish(arguments);
      arguments.defect = largestOf(sums.defect);
    }
    LIESTAT_ALWAYS_INLINE void turn(S (&data)[columns][block], std::size_t j, const S (&y)[4], P& least) {
      const P a = P::load(data[0] + j), b = P::load(data[1] + j);
      const P excess = a * a + b * b - S(1), scale = unitScale(excess);
      defect = larger(absolute(excess), defect);
      const P c = scale * (a * y[0] + b * y[1]);
      least = smaller(c, least);
      c.store(data[0] + j);
      (scale * (b * y[0] - a * y[1])).store(data[1] + j);
    }
    template <bool Wide, class Polynomials>
    LIESTAT_ALWAYS_INLINE void add(const S (&data)[columns][block], std::size_t j, const Arguments& arguments,
                                   std::size_t i, const Polynomials& polynomials) {
      const S(&y)[4] = arguments.reference;
      const P c = P::load(data[0] + j), s = P::load(data[1] + j);
      AngleOverSine<P> angle;
      angle.template evaluate<Wide, false, false>(c, s * s, polynomials);
      defect = larger(angle.antipode, defect);
      P v[k], p(S(1));
      v[k - 1] = angle.h * s;
      P length2 = v[k - 1] * v[k - 1];
      if constexpr (Weighted) p = P::load(data[numbers] + j);
      residuals.addAngle(length2, p);
      if constexpr (Frame) {
        v[0] = P::load(data[2] + j) - y[2];
        v[1] = P::load(data[3] + j) - y[3];
        length2 += v[0] * v[0] + v[1] * v[1];
      }
      residuals.add(v, length2, p);
      if constexpr (Pass == KernelPass::residuals) {
        if constexpr (Frame) {
          const P a = v[0], b = v[1];
          v[0] = y[0] * a + y[1] * b;
          v[1] = y[0] * b - y[1] * a;
        }
        storeResiduals(v, arguments.residuals, i + j);
      }
    }
  };
};

/// Points of N coordinates less those of the reference.
template <class S, std::size_t N, bool Weighted, KernelPass Pass>
struct PointKernel {
  static constexpr std::size_t max_count = 1024, entries = N * (N + 1) / 2;
  struct Arguments {
    Layout<const S> features;
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[N] = {};
    S cost, largest, largest_angle, fourth, defect = 0, weight, gradient[N], scatter[entries], squared[entries];
    ResidualColumns<S> residuals = nullptr;
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    constexpr std::size_t block = 64;
    alignas(64) S data[N + 1][block];
    ResidualSums<P, N, Weighted, Pass == KernelPass::last> residuals;
    for (std::size_t i = 0; i < arguments.count; i += block) {
      const std::size_t count = std::min(arguments.count - i, block);
      loadColumns<Set, N>(arguments.features, 0, i, count, data);
      if constexpr (Weighted) std::memcpy(data[N], arguments.weights + i, count * sizeof(S));
      for (std::size_t j = count; j % P::size != 0; ++j) {
        for (std::size_t c = 0; c < N; ++c) data[c][j] = arguments.reference[c];
        data[N][j] = 0;
      }
      for (std::size_t j = 0; j < count; j += P::size) {
        P v[N], length2 = P::zero(), p(S(1));
        LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) {
          v[c] = P::load(data[c] + j) - arguments.reference[c];
          length2 += v[c] * v[c];
        }
        if constexpr (Weighted) p = P::load(data[N] + j);
        residuals.add(v, length2, p);
        if constexpr (Pass == KernelPass::residuals) storeResiduals(v, arguments.residuals, i + j);
      }
    }
    residuals.finish(arguments);
  }
};

}  // namespace liestat::detail
