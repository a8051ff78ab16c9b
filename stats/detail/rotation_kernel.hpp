// The sums of a mean over rotations, frames and their quotients, a register of features at a time.
//
// With w = |<y, q>| of unit quaternions and u the vector part of y⁻¹q, log(y, q) = ±f(w) u, and the Hessian of ½ d² is
// I + g(w) (u uᵀ - |u|² I): one polynomial each (lie/detail/rotation_polynomials.hpp), without atan2, square root,
// division or branch.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>
#include <lie/detail/rotation_polynomials.hpp>
#include <stats/detail/moment_kernel.hpp>

#include <cstddef>
#include <utility>

namespace liestat::detail {

/// True if kernels have a case of its own for small rotations: not for processors without AVX2, whose users are too few
/// for what it takes to compile.
template <class P>
inline constexpr bool has_small_rotations = LIESTAT_HAS_DISPATCH == 0 || P::set != InstructionSet::baseline;

/// Features modulo half-turns about the axes whose bits are set, 1 for x, 2 for y, 4 for z.
template <class S, bool Frame, unsigned HalfTurns, bool Weighted, KernelPass Pass>
struct RotationKernel {
  static constexpr bool exact = Pass != KernelPass::step;
  static constexpr std::size_t k = Frame ? 6 : 3, entries = k * (k + 1) / 2;
  /// Features per call, at most.
  static constexpr std::size_t max_count = 1024;

  struct Arguments {
    Layout<const S> features;  ///< quaternion x y z w, and for frames the translation
    const S* weights = nullptr;
    std::size_t count = 0;
    S reference[7] = {};  ///< y, laid out like a feature
    /// Σ in the axes of y for rotations, in those of the world for translations.
    S cost, largest, defect, weight, gradient[k], hessian[6], scatter[entries], squared[entries];
    S largest_angle, fourth;  ///< rotations: the largest squared angle, Σ p θ⁴
    /// For quotients, roughly: the cosine of half the distance to the cut locus of each feature, and the largest.
    S gap_cosines[HalfTurns != 0 && exact ? max_count : 1], largest_gap_cosine;
    /// In the frame of y, to whose axes `to_reference` turns translations: a matrix, row by row.
    ResidualColumns<S> residuals = nullptr;
    S to_reference[9] = {};
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  /// Columns of a block: x y z w of the quaternion, the weight, the translation less that of y.
  static constexpr std::size_t columns = Frame ? 9 : 5, block = 64;

  template <class P>
  struct Run {
    ResidualSums<P, k, Weighted, Pass == KernelPass::last> residuals;
    P defect = P::zero(), largest_gap_cosine = P(S(-1)), hessian[6];

    LIESTAT_ALWAYS_INLINE Run() { LIESTAT_UNROLL for (P& x : hessian) x = P::zero(); }

    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      alignas(64) S data[columns][block];
      Run sums;
      for (std::size_t i = 0; i < arguments.count; i += block) {
        const std::size_t count = arguments.count - i < block ? arguments.count - i : block;
        P cosine(S(1));
        bool turned = false;
        if constexpr (loads_rows<P>) {
          turned = arguments.features.component == 1;
          if (turned) sums.template turnAll<true>(data, arguments, i, count, cosine);
        }
        if (!turned) sums.template turnAll<false>(data, arguments, i, count, cosine);
        if constexpr (Weighted) {
          std::memcpy(data[4], arguments.weights + i, count * sizeof(S));
          for (std::size_t j = count; j % P::size != 0; ++j) data[4][j] = 0;
        }
        bool small = false;
        if constexpr (has_small_rotations<P>) small = -largestOf(-cosine) > static_cast<S>(small_rotation_cosine);
        if (small) {
          if constexpr (has_small_rotations<P>) sums.addAll(data, count, arguments, i, small_rotation<S>);
        } else {
          sums.addAll(data, count, arguments, i, any_rotation<S>);
        }
      }
      sums.residuals.finish(arguments);
      arguments.defect = largestOf(sums.defect);
      LIESTAT_UNROLL for (std::size_t a = 0; a < 6; ++a) arguments.hessian[a] = sumOf(sums.hessian[a]);
      if constexpr (HalfTurns != 0 && exact) arguments.largest_gap_cosine = largestOf(sums.largest_gap_cosine);
    }

    /// The columns of features i …, relative to y: by rows, else by way of the columns themselves. The last pack is filled
    /// up with y itself, which adds nothing. cosine becomes the least |w|.
    template <bool ByRows>
    LIESTAT_ALWAYS_INLINE void turnAll(S (&data)[columns][block], Arguments& arguments, std::size_t i,
                                       std::size_t count, P& cosine) {
      const Layout<const S> features = arguments.features;
      const S* const y = arguments.reference;
      if constexpr (!ByRows) {
        loadFilled<P, 4>(features, 0, i, count, y, data);
        if constexpr (Frame) loadFilled<P, 3>(features, 4, i, count, y + 4, data + 6);
      }
      const P reference[4] = {P(y[0]), P(y[1]), P(y[2]), P(y[3])};
      for (std::size_t j = 0; j < count; j += P::size) {
        P q[4];
        if constexpr (ByRows) {
          loadRows(features, 0, i + j, count - j, y, q);
        } else {
          LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) q[c] = P::load(data[c] + j);
        }
        turn(q, reference, data, j, arguments, i, cosine);
        if constexpr (Frame) {
          // Four numbers at a time: w again, and the translation.
          P t[4];
          if constexpr (ByRows) {
            loadRows(features, 3, i + j, count - j, y + 3, t);
          } else {
            LIESTAT_UNROLL for (std::size_t c = 1; c < 4; ++c) t[c] = P::load(data[5 + c] + j);
          }
          LIESTAT_UNROLL for (std::size_t c = 1; c < 4; ++c)(t[c] - y[3 + c]).store(data[5 + c] + j);
        }
      }
    }

    /// Replaces quaternions q by y⁻¹q, of quotients the nearest representative.
    LIESTAT_ALWAYS_INLINE void turn(const P (&feature)[4], const P (&reference)[4], S (&data)[columns][block],
                                    std::size_t j, Arguments& arguments, std::size_t i, P& cosine) {
      const P &x = feature[0], &y = feature[1], &z = feature[2], &s = feature[3];
      const P &a = reference[0], &b = reference[1], &c = reference[2], &d = reference[3];
      P q[4] = {d * x - a * s + (c * y - b * z), d * y - b * s + (a * z - c * x), d * z - c * s + (b * x - a * y),
                a * x + b * y + (c * z + d * s)};
      if constexpr (HalfTurns != 0) {
        const P gap_cosine = nearest(q);
        if constexpr (exact) {
          // The lanes beyond the last feature hold y, and store nothing.
          const std::size_t rest = arguments.count - i - j;
          if (rest >= P::size) {
            gap_cosine.store(arguments.gap_cosines + i + j);
          } else {
            S lanes[P::size];
            gap_cosine.store(lanes);
            for (std::size_t l = 0; l < rest; ++l) arguments.gap_cosines[i + j + l] = lanes[l];
          }
          largest_gap_cosine = larger(gap_cosine, largest_gap_cosine);
        }
      }
      // To unit length and w >= 0 here already: what waits for the polynomials' variable is long enough without it.
      const P excess = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]) - S(1), scale = unitScale(excess);
      defect = larger(absolute(excess), defect);
      const P signed_scale = select(q[3] < S(0), -scale, scale);
      LIESTAT_UNROLL for (std::size_t l = 0; l < 4; ++l) q[l] *= signed_scale;
      cosine = smaller(q[3], cosine);
      LIESTAT_UNROLL for (std::size_t l = 0; l < 4; ++l) q[l].store(data[l] + j);
    }

    /// The half-turn that brings the largest component b to w. The second largest, s, belongs to the representative
    /// that comes next: half the angle between the two is acos(s) - acos(b), whose cosine comes back.
    LIESTAT_ALWAYS_INLINE static P nearest(P (&q)[4]) {
      const P x = q[0], y = q[1], z = q[2], w = q[3];
      P best = absolute(w), second = P(S(-1));
      if constexpr ((HalfTurns & 1) != 0) take(absolute(x), best, second, q, w, z, -y, -x);
      if constexpr ((HalfTurns & 2) != 0) take(absolute(y), best, second, q, -z, w, x, -y);
      if constexpr ((HalfTurns & 4) != 0) take(absolute(z), best, second, q, y, -x, w, -z);
      if constexpr (exact) {
        const P sines = absolute((S(1) - best * best) * (S(1) - second * second));
        return best * second + sines * inverseSquareRoot(sines);
      }
      return best;
    }
    LIESTAT_ALWAYS_INLINE static void take(const P& c, P& best, P& second, P (&q)[4], const P& x, const P& y,
                                           const P& z, const P& w) {
      const auto better = c > best;
      second = larger(select(better, best, c), second);
      best = select(better, c, best);
      q[0] = select(better, x, q[0]), q[1] = select(better, y, q[1]);
      q[2] = select(better, z, q[2]), q[3] = select(better, w, q[3]);
    }

    template <class Polynomials>
    LIESTAT_ALWAYS_INLINE void addAll(const S (&data)[columns][block], std::size_t count, const Arguments& arguments,
                                      std::size_t i, const Polynomials& polynomials) {
      for (std::size_t j = 0; j < count; j += P::size) add(data, j, arguments, i, polynomials);
    }
    template <class Polynomials>
    LIESTAT_ALWAYS_INLINE void add(const S (&data)[columns][block], std::size_t j, const Arguments& arguments,
                                   std::size_t i, const Polynomials& polynomials) {
      const P q[4] = {P::load(data[0] + j), P::load(data[1] + j), P::load(data[2] + j), P::load(data[3] + j)};
      const P xx = q[0] * q[0], yy = q[1] * q[1], zz = q[2] * q[2], u2 = xx + yy + zz;
      const double slope = -1 / polynomials.range;
      const P variable = q[3] * static_cast<S>(slope) + static_cast<S>(-1 - slope);
      const P f = evaluatePolynomial(polynomials.log, variable);
      P p(S(1)), g;
      if constexpr (exact) {
        g = evaluatePolynomial(polynomials.exact_hessian, variable);
      } else {
        g = evaluatePolynomial(polynomials.newton_hessian, variable);
      }
      if constexpr (Weighted) {
        p = P::load(data[4] + j);
        g *= p;
      }
      const P gx = g * q[0], gy = g * q[1];
      hessian[0] += g * xx, hessian[1] += gx * q[1], hessian[2] += gx * q[2];
      hessian[3] += g * yy, hessian[4] += gy * q[2], hessian[5] += g * zz;

      constexpr std::size_t r0 = Frame ? 3 : 0;
      P v[k], length2 = f * f * u2;
      residuals.addAngle(length2, p);
      LIESTAT_UNROLL for (std::size_t c = 0; c < 3; ++c) v[r0 + c] = f * q[c];
      if constexpr (Frame) {
        LIESTAT_UNROLL for (std::size_t c = 0; c < 3; ++c) {
          v[c] = P::load(data[6 + c] + j);
          length2 += v[c] * v[c];
        }
      }
      residuals.add(v, length2, p);
      if constexpr (Pass == KernelPass::residuals) {
        if constexpr (Frame) {
          const P x = v[0], y = v[1], z = v[2];
          const S* const r = arguments.to_reference;
          LIESTAT_UNROLL for (std::size_t c = 0; c < 3; ++c) v[c] = r[3 * c] * x + r[3 * c + 1] * y + r[3 * c + 2] * z;
        }
        storeResiduals(v, arguments.residuals, i + j);
      }
    }
  };
};

}  // namespace liestat::detail
