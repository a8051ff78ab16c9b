// The sums of the exponential barycentre of SE(3), a register of poses at a time.
//
// About y = (R, t), in axes of the world at t: log(y⁻¹x) = (ρ, φ) with φ = f u, u the vector part of q R⁻¹ taken with a
// real part w >= 0, f and g as in stats/detail/rotation_kernel.hpp, and with τ = t_x - t
//
//   ρ = V⁻¹ τ,  V⁻¹ = I - ½ f [u] + g [u]².
//
// J_l⁻¹ = [[V⁻¹, B], [0, V⁻¹]], B the derivative of V⁻¹ along ρ: with c = g/f² = (1 - θ/2 cot θ/2)/θ² and its derivative
// c' = (-g' f - 4 g²)/(4 f⁴) with respect to θ²,
//
//   B = -½ [ρ] + g/f (ρ uᵀ + u ρᵀ - 2 (u·ρ) I) + 2 c' f³ (u·ρ) (u uᵀ - |u|² I).
#pragma once

#include <stats/detail/rotation_kernel.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

namespace liestat::detail {

/// Full false makes the sums that the translation's linear system needs, and no others.
template <class S, bool Weighted, bool Full>
struct PoseKernel {
  static constexpr std::size_t max_count = 1024;
  struct Arguments {
    Layout<const S> features;  ///< quaternion x y z w, translation
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[7] = {};
    S defect, weight, squared_weight;
    S rho[3], phi[3];  ///< Σ p ρ, Σ p φ
    S outer[6];        ///< Σ p g u uᵀ
    S mixed[6];        ///< Σ of the symmetric part of p B
    S scatter[21];     ///< Σ p z zᵀ, z = (ρ, φ)
    S squared_angle;   ///< Σ θ², without weights
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  /// u, w and the length's square of the quaternion's excess; τ; the weight.
  static constexpr std::size_t columns = 9, block = 64;

  template <class P>
  struct Run {
    P defect = P::zero(), weight = P::zero(), squared_weight = P::zero(), squared_angle = P::zero(), rho[3], phi[3],
      outer[6], mixed[6], scatter[21];

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) rho[a] = phi[a] = P::zero();
      LIESTAT_UNROLL for (std::size_t a = 0; a < 6; ++a) outer[a] = mixed[a] = P::zero();
      LIESTAT_UNROLL for (P& x : scatter) x = P::zero();
    }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      alignas(64) S data[columns][block];
      Run sums;
      const S(&y)[7] = arguments.reference;
      for (std::size_t i = 0; i < arguments.count; i += block) {
        const std::size_t count = std::min(arguments.count - i, block);
        loadColumns<P::set, 4>(arguments.features, 0, i, count, data);
        if (arguments.features.component == 1) {
          loadColumns<P::set, 4>(arguments.features, 3, i, count, data + 4);  // w again, and the translation
        } else {
          loadColumns<P::set, 3>(arguments.features, 4, i, count, data + 5);
        }
        if constexpr (Weighted) std::memcpy(data[8], arguments.weights + i, count * sizeof(S));
        for (std::size_t j = count; j % P::size != 0; ++j) {
          for (std::size_t c = 0; c < 4; ++c) data[c][j] = y[c];
          for (std::size_t c = 4; c < 7; ++c) data[c + 1][j] = y[c];
          data[8][j] = 0;
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
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) arguments.rho[a] = sumOf(sums.rho[a]),
                                                         arguments.phi[a] = sumOf(sums.phi[a]);
      LIESTAT_UNROLL for (std::size_t a = 0; a < 6; ++a) arguments.outer[a] = sumOf(sums.outer[a]);
      if constexpr (Full) {
        for (std::size_t a = 0; a < 6; ++a) arguments.mixed[a] = sumOf(sums.mixed[a]);
        for (std::size_t a = 0; a < 21; ++a) arguments.scatter[a] = sumOf(sums.scatter[a]);
      }
    }
    /// Replaces quaternions q by q y⁻¹ with w >= 0, translations by τ.
    LIESTAT_ALWAYS_INLINE void turn(S (&data)[columns][block], std::size_t j, const S (&y)[7], P& cosine) {
      const P x0 = P::load(data[0] + j), x1 = P::load(data[1] + j), x2 = P::load(data[2] + j),
              x3 = P::load(data[3] + j);
      const S a = y[0], b = y[1], c = y[2], d = y[3];
      P u0 = d * x0 - a * x3 + (b * x2 - c * x1), u1 = d * x1 - b * x3 + (c * x0 - a * x2),
        u2 = d * x2 - c * x3 + (a * x1 - b * x0);
      const P w = a * x0 + b * x1 + (c * x2 + d * x3);
      const auto back = w < S(0);
      u0 = select(back, -u0, u0), u1 = select(back, -u1, u1), u2 = select(back, -u2, u2);
      const P positive = absolute(w);
      cosine = smaller(positive, cosine);
      u0.store(data[0] + j), u1.store(data[1] + j), u2.store(data[2] + j), positive.store(data[3] + j);
      LIESTAT_UNROLL for (std::size_t l = 0; l < 3; ++l)(P::load(data[5 + l] + j) - y[4 + l]).store(data[5 + l] + j);
    }
    template <class Polynomials>
    LIESTAT_ALWAYS_INLINE void add(const S (&data)[columns][block], std::size_t j, const Polynomials& polynomials) {
      P u[3] = {P::load(data[0] + j), P::load(data[1] + j), P::load(data[2] + j)};
      const P raw = P::load(data[3] + j);
      const P excess = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + raw * raw - S(1);
      const P scale = unitScale(excess);
      defect = larger(absolute(excess), defect);
      LIESTAT_UNROLL for (P& x : u) x *= scale;
      const P variable = (S(1) - scale * raw) * static_cast<S>(1 / polynomials.range) - S(1);
      const P f = evaluatePolynomial(polynomials.log, variable),
              g = evaluatePolynomial(polynomials.exact_hessian, variable);
      const P t[3] = {P::load(data[5] + j), P::load(data[6] + j), P::load(data[7] + j)};
      const P ut[3] = {u[1] * t[2] - u[2] * t[1], u[2] * t[0] - u[0] * t[2], u[0] * t[1] - u[1] * t[0]};
      const P uut[3] = {u[1] * ut[2] - u[2] * ut[1], u[2] * ut[0] - u[0] * ut[2], u[0] * ut[1] - u[1] * ut[0]};
      P z[6], weighted[6], gu[3];
      const P half = S(0.5) * f;
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) {
        z[a] = t[a] - half * ut[a] + g * uut[a];
        z[3 + a] = f * u[a];
        gu[a] = g * u[a];
      }
      P p(S(1));
      if constexpr (Weighted) {
        p = P::load(data[8] + j);
        weight += p, squared_weight += p * p;
      }
      LIESTAT_UNROLL for (std::size_t a = 0; a < 6; ++a) {
        weighted[a] = z[a];
        if constexpr (Weighted) weighted[a] *= p;
      }
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) {
        rho[a] += weighted[a], phi[a] += weighted[3 + a];
        if constexpr (Weighted) gu[a] *= p;
      }
      addOuter(outer, u, gu, std::make_index_sequence<6>());
      if constexpr (Full) {
        const P squared_u = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        squared_angle += f * f * squared_u;
        addOuter(scatter, z, weighted, std::make_index_sequence<21>());
        const P slope = evaluatePolynomial(polynomials.hessian_slope, variable), inverse_f = S(1) / f;
        P first = g * inverse_f;
        P second = (slope * f - S(4) * g * g) * (S(0.5) * inverse_f);
        if constexpr (Weighted) first *= p, second *= p;
        const P along = u[0] * z[0] + u[1] * z[1] + u[2] * z[2];
        second *= along;
        const P diagonal = second * squared_u + S(2) * first * along;
        P a[3], b[3];
        const P r[3] = {z[0], z[1], z[2]};
        LIESTAT_UNROLL for (std::size_t l = 0; l < 3; ++l) a[l] = first * z[l] + second * u[l], b[l] = first * u[l];
        // a uᵀ + b ρᵀ, symmetric.
        addOuter(mixed, u, a, std::make_index_sequence<6>());
        addOuter(mixed, r, b, std::make_index_sequence<6>());
        mixed[0] -= diagonal, mixed[2] -= diagonal, mixed[5] -= diagonal;
      }
    }
  };
};

}  // namespace liestat::detail
