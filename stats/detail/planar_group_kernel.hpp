// The sums of the exponential barycentre of SE(2), a register of motions at a time.
//
// About y = (R, t), in axes of the world at t: with the relative angle θ, u = sin θ/2 and w = cos θ/2 >= 0, and f and g
// as in stats/detail/rotation_kernel.hpp, log(y⁻¹x) = (ρ, θ) with θ = f u and with τ = t_x - t
//
//   ρ = V⁻¹ τ,  V⁻¹ = c I - θ/2 [J],  c = θ/2 cot θ/2 = 1 - g u²,  J the quarter-turn.
//
// J_l⁻¹ = [[V⁻¹, b], [0, 1]] with b = (1 - c)/θ ρ + ½ J ρ, and (1 - c)/θ = g u/f.
#pragma once

#include <stats/detail/rotation_kernel.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

namespace liestat::detail {

/// Full false makes the sums that the translation's linear system needs, and no others.
template <class S, bool Weighted, bool Full>
struct PlanarPoseKernel {
  static constexpr std::size_t max_count = 1024;
  struct Arguments {
    Layout<const S> features;  ///< cos, sin, translation
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[4] = {};
    S defect, weight, squared_weight;
    S rho[2], theta;  ///< Σ p ρ, Σ p θ
    S excess;         ///< Σ p (1 - c)
    S mixed[2];       ///< Σ p (1 - c)/θ ρ
    S scatter[6];     ///< Σ p z zᵀ, z = (ρ, θ)
    S squared_angle;  ///< Σ θ², without weights
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  /// u, w, the translation less that of the reference, the weight.
  static constexpr std::size_t columns = 5, block = 64;

  template <class P>
  struct Run {
    P defect = P::zero(), weight = P::zero(), squared_weight = P::zero(), squared_angle = P::zero(), theta = P::zero(),
      excess = P::zero(), rho[2], mixed[2], scatter[6];

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (std::size_t a = 0; a < 2; ++a) rho[a] = mixed[a] = P::zero();
      LIESTAT_UNROLL for (P& x : scatter) x = P::zero();
    }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      alignas(64) S data[columns][block];
      Run sums;
      const S(&y)[4] = arguments.reference;
      for (std::size_t i = 0; i < arguments.count; i += block) {
        const std::size_t count = std::min(arguments.count - i, block);
        loadColumns<P::set, 4>(arguments.features, 0, i, count, data);
        if constexpr (Weighted) std::memcpy(data[4], arguments.weights + i, count * sizeof(S));
        // The last register is filled up with y, which adds nothing.
        for (std::size_t j = count; j % P::size != 0; ++j) {
          for (std::size_t c = 0; c < 4; ++c) data[c][j] = y[c];
          data[4][j] = 0;
        }
        P cosine(S(1));
        for (std::size_t j = 0; j < count; j += P::size) sums.turn(data, j, y, cosine);
        if (-largestOf(-cosine) > static_cast<S>(small_rotation_cosine)) {
          for (std::size_t j = 0; j < count; j += P::size) sums.add(data, j, small_rotation<S>);
        } else {
          for (std::size_t j = 0; j < count; j += P::size) sums.add(data, j, any_rotation<S>);
        }
      }
      arguments.defect = largestOf(sums.defect);
      arguments.weight = Weighted ? sumOf(sums.weight) : static_cast<S>(arguments.count);
      arguments.squared_weight = Weighted ? sumOf(sums.squared_weight) : arguments.weight;
      arguments.squared_angle = sumOf(sums.squared_angle);
      arguments.theta = sumOf(sums.theta), arguments.excess = sumOf(sums.excess);
      for (std::size_t a = 0; a < 2; ++a) arguments.rho[a] = sumOf(sums.rho[a]);
      if constexpr (Full) {
        for (std::size_t a = 0; a < 2; ++a) arguments.mixed[a] = sumOf(sums.mixed[a]);
        for (std::size_t a = 0; a < 6; ++a) arguments.scatter[a] = sumOf(sums.scatter[a]);
      }
    }
    /// Replaces (cos, sin) by u and w of the angle from y, translations by τ; cosine becomes the least w.
    LIESTAT_ALWAYS_INLINE void turn(S (&data)[columns][block], std::size_t j, const S (&y)[4], P& cosine) {
      const P a = P::load(data[0] + j), b = P::load(data[1] + j);
      const P length = a * a + b * b - S(1), scale = unitScale(length);
      defect = larger(absolute(length), defect);
      const P c = scale * (a * y[0] + b * y[1]), s = scale * (b * y[0] - a * y[1]);
      // The square of cos θ/2, from the sine where 1 + cos θ would cancel. A half-turn has w = 0 and u = 1.
      const P w2 = select(c > S(0), S(0.5) + S(0.5) * c, s * s / (S(2) - S(2) * smaller(c, P::zero())));
      const P inverse_w = inverseSquareRoot(w2), w = w2 * inverse_w;
      const P u = S(0.5) * s * inverse_w;
      // The direction of a half-turn is a rounding error (stats/detail/direction_kernel.hpp).
      constexpr S lost = sizeof(S) == 8 ? S(1e-20) : S(1e-9);
      defect = larger(select(w2 > lost, P::zero(), P(S(1))), defect);
      cosine = smaller(w, cosine);
      u.store(data[0] + j), w.store(data[1] + j);
      LIESTAT_UNROLL for (std::size_t l = 0; l < 2; ++l)(P::load(data[2 + l] + j) - y[2 + l]).store(data[2 + l] + j);
    }
    template <class Polynomials>
    LIESTAT_ALWAYS_INLINE void add(const S (&data)[columns][block], std::size_t j, const Polynomials& polynomials) {
      const P u = P::load(data[0] + j), w = P::load(data[1] + j);
      const P variable = (S(1) - w) * static_cast<S>(1 / polynomials.range) - S(1);
      const P f = evaluatePolynomial(polynomials.log, variable),
              g = evaluatePolynomial(polynomials.exact_hessian, variable);
      const P t[2] = {P::load(data[2] + j), P::load(data[3] + j)};
      const P angle = f * u, half = S(0.5) * angle, gu = g * u;
      P e = gu * u;
      const P z[3] = {t[0] - e * t[0] + half * t[1], t[1] - e * t[1] - half * t[0], angle};
      P weighted[3], p(S(1));
      if constexpr (Weighted) {
        p = P::load(data[4] + j);
        weight += p, squared_weight += p * p;
        e *= p;
      }
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) {
        weighted[a] = z[a];
        if constexpr (Weighted) weighted[a] *= p;
      }
      rho[0] += weighted[0], rho[1] += weighted[1], theta += weighted[2];
      excess += e;
      if constexpr (Full) {
        const P factor = gu / f;
        mixed[0] += factor * weighted[0], mixed[1] += factor * weighted[1];
        squared_angle += angle * angle;
        addOuter(scatter, z, weighted, std::make_index_sequence<6>());
      }
    }
  };
};

}  // namespace liestat::detail
