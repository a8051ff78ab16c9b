// The sums of the Mahalanobis mean of rotations and frames whose covariances are those of the measurements, a register
// of measurements at a time.
//
// With u the vector part of x⁻¹y, taken with a real part w >= 0, and f, g, -g' as in stats/detail/rotation_kernel.hpp,
// the error z = log(x, y) has the rotation z_r = f u and its derivative by a rotation of y in its own axes
//
//   J = I + ½ f [u] + g [u]²,
//
// and for frames z_t = R (R_yᵀ (t_y - t_x)), R the matrix of x⁻¹y, which is its derivative by a translation in the axes
// of y. With the information B and a = B z the criterion ½ zᵀ B z has the gradient (Rᵀ a_t, Jᵀ a_r) and the Hessian
// diag(R, J)ᵀ B diag(R, J) plus, symmetric part of, [Rᵀ a_t] where translation meets rotation and (∂Jᵀ a_r/∂z_r) J:
// (docs/theory/means.md, section 4.2)
//
//   ∂Jᵀ a/∂z = ½ [a] + g/f ((u·a) I + u aᵀ - 2 a uᵀ) + k (u (u·a) - |u|² a) uᵀ,  k = (-g' f - 4 g²)/(2 f).
//
// Frames modulo half-turns have the u and w of the nearest representative y h of y. With K the signs of h on the
// axes of y, J K stands for J and K ∂Jᵀ a/∂z for ∂Jᵀ a/∂z; the translation does not change.
#pragma once

#include <stats/detail/rotation_kernel.hpp>

#include <cstddef>
#include <limits>
#include <utility>

namespace liestat::detail {

/// Measurements lie in groups of 64 bytes a number, in a group number after number: the quaternion, the translation, and the lower
/// triangle of the information, row by row. Frames modulo the half-turns of RotationKernel.
template <class S, bool Frame, unsigned HalfTurns = 0>
struct MahaKernel {
  static constexpr std::size_t k = Frame ? 6 : 3, entries = k * (k + 1) / 2, parameters = Frame ? 7 : 4,
                               lanes = 64 / sizeof(S), numbers = parameters + entries, group_size = numbers * lanes;
  struct Arguments {
    const S* groups = nullptr;
    std::size_t count = 0;  ///< groups
    S reference[7] = {};
    S to_y[3][3] = {};         ///< R_yᵀ
    S ones[4] = {1, 1, 1, 1};  ///< not constants, see turnToNearest
    S cost, gradient[k], gauss_newton[entries];
    S curvature[9];  ///< Σ (∂Jᵀ a/∂z) J, row by row
    /// Positive if two representatives are equally near, up to rounding: the general formulas say which one counts.
    S defect;
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  template <class P>
  struct Run {
    P cost = P::zero(), defect = P::zero(), gradient[k], gauss_newton[entries], curvature[9];

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (P& x : gradient) x = P::zero();
      LIESTAT_UNROLL for (P& x : gauss_newton) x = P::zero();
      LIESTAT_UNROLL for (P& x : curvature) x = P::zero();
    }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      Run sums;
      for (std::size_t i = 0; i < arguments.count; ++i) {
        const S* const group = arguments.groups + i * group_size;
        for (std::size_t j = 0; j < lanes; j += P::size) sums.add(arguments, group + j);
      }
      arguments.cost = S(0.5) * sumOf(sums.cost);
      for (std::size_t a = 0; a < k; ++a) arguments.gradient[a] = sumOf(sums.gradient[a]);
      for (std::size_t a = 0; a < entries; ++a) arguments.gauss_newton[a] = sumOf(sums.gauss_newton[a]);
      for (std::size_t a = 0; a < 9; ++a) arguments.curvature[a] = sumOf(sums.curvature[a]);
      arguments.defect = HalfTurns != 0 ? largestOf(sums.defect) : S(0);
    }

    LIESTAT_ALWAYS_INLINE static P number(const S* p, std::size_t which) { return P::load(p + which * lanes); }
    /// Index in the lower triangle of row i, column j of a symmetric matrix.
    static constexpr std::size_t entry(std::size_t i, std::size_t j) {
      return i >= j ? i * (i + 1) / 2 + j : entry(j, i);
    }

    LIESTAT_ALWAYS_INLINE void add(const Arguments& arguments, const S* p) {
      const S a = arguments.reference[0], b = arguments.reference[1], c = arguments.reference[2],
              d = arguments.reference[3];
      const P x0 = number(p, 0), x1 = number(p, 1), x2 = number(p, 2), x3 = number(p, 3);
      // x⁻¹ y.
      P u[3] = {x3 * a - x0 * d + (x2 * b - x1 * c), x3 * b - x1 * d + (x0 * c - x2 * a),
                x3 * c - x2 * d + (x1 * a - x0 * b)};
      const P real = x0 * a + x1 * b + (x2 * c + x3 * d), given[4] = {u[0], u[1], u[2], real};
      P w = absolute(real), signs[3];
      if constexpr (HalfTurns != 0) {
        turnToNearest(arguments.ones, given, u, w, signs);
      } else {
        const auto back = real < S(0);
        LIESTAT_UNROLL for (P& e : u) e = select(back, -e, e);
      }

      const auto& polynomials = any_rotation<S>;
      const P variable = (S(1) - w) * static_cast<S>(1 / polynomials.range) - S(1);
      const P f = evaluatePolynomial(polynomials.log, variable),
              g = evaluatePolynomial(polynomials.exact_hessian, variable),
              slope = evaluatePolynomial(polynomials.hessian_slope, variable);
      const P u2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], half = S(0.5) * f, diagonal = S(1) - g * u2;
      P gu[3], hu[3], z[k], J[3][3], R[3][3];
      constexpr std::size_t r = Frame ? 3 : 0;
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) gu[i] = g * u[i], hu[i] = half * u[i], z[r + i] = f * u[i];
      J[0][0] = diagonal + gu[0] * u[0], J[1][1] = diagonal + gu[1] * u[1], J[2][2] = diagonal + gu[2] * u[2];
      J[0][1] = gu[0] * u[1] - hu[2], J[1][0] = gu[0] * u[1] + hu[2];
      J[0][2] = gu[0] * u[2] + hu[1], J[2][0] = gu[0] * u[2] - hu[1];
      J[1][2] = gu[1] * u[2] - hu[0], J[2][1] = gu[1] * u[2] + hu[0];
      if constexpr (HalfTurns != 0) {
        LIESTAT_UNROLL for (std::size_t e = 0; e < 9; ++e) J[e / 3][e % 3] *= signs[e % 3];
      }
      if constexpr (Frame) {
        rotationMatrix(given, R);
        const P t0 = arguments.reference[4] - number(p, 4), t1 = arguments.reference[5] - number(p, 5),
                t2 = arguments.reference[6] - number(p, 6);
        const auto& M = arguments.to_y;
        const P s0 = t0 * M[0][0] + t1 * M[0][1] + t2 * M[0][2], s1 = t0 * M[1][0] + t1 * M[1][1] + t2 * M[1][2],
                s2 = t0 * M[2][0] + t1 * M[2][1] + t2 * M[2][2];
        LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) z[i] = R[i][0] * s0 + R[i][1] * s1 + R[i][2] * s2;
      }

      // a = B z and the criterion.
      P Bz[k];
      LIESTAT_UNROLL for (std::size_t i = 0; i < k; ++i) {
        P sum = number(p, parameters + entry(i, 0)) * z[0];
        LIESTAT_UNROLL for (std::size_t j = 1; j < k; ++j) sum += number(p, parameters + entry(i, j)) * z[j];
        Bz[i] = sum;
        cost += sum * z[i];
      }
      const P ar[3] = {Bz[r], Bz[r + 1], Bz[r + 2]};
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
        gradient[r + i] += J[0][i] * ar[0] + J[1][i] * ar[1] + J[2][i] * ar[2];
      }
      addCongruence<r, r>(p, J, J);
      if constexpr (Frame) {
        LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
          gradient[i] += R[0][i] * Bz[0] + R[1][i] * Bz[1] + R[2][i] * Bz[2];
        }
        addCongruence<0, 0>(p, R, R);
        addCongruence<3, 0>(p, J, R);
      }

      const P inverse_f = S(1) / f, first = g * inverse_f;
      const P ua = u[0] * ar[0] + u[1] * ar[1] + u[2] * ar[2];
      const P second = (slope * f - S(4) * g * g) * (S(0.5) * inverse_f);
      // Row i of ∂Jᵀ a/∂z is first u_i aᵀ + row_i uᵀ + first (u·a) e_iᵀ + half of [a].
      P M[3][3], fu[3], row[3];
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
        fu[i] = first * u[i];
        row[i] = second * (u[i] * ua - u2 * ar[i]) - (first + first) * ar[i];
      }
      const P fua = first * ua, h0 = S(0.5) * ar[0], h1 = S(0.5) * ar[1], h2 = S(0.5) * ar[2];
      M[0][0] = fu[0] * ar[0] + row[0] * u[0] + fua;
      M[1][1] = fu[1] * ar[1] + row[1] * u[1] + fua;
      M[2][2] = fu[2] * ar[2] + row[2] * u[2] + fua;
      M[0][1] = fu[0] * ar[1] + row[0] * u[1] - h2, M[1][0] = fu[1] * ar[0] + row[1] * u[0] + h2;
      M[0][2] = fu[0] * ar[2] + row[0] * u[2] + h1, M[2][0] = fu[2] * ar[0] + row[2] * u[0] - h1;
      M[1][2] = fu[1] * ar[2] + row[1] * u[2] - h0, M[2][1] = fu[2] * ar[1] + row[2] * u[1] + h0;
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
        LIESTAT_UNROLL for (std::size_t j = 0; j < 3; ++j) {
          const P product = M[i][0] * J[0][j] + M[i][1] * J[1][j] + M[i][2] * J[2][j];
          if constexpr (HalfTurns != 0) {
            curvature[3 * i + j] += signs[i] * product;
          } else {
            curvature[3 * i + j] += product;
          }
        }
      }
    }

    LIESTAT_ALWAYS_INLINE static void rotationMatrix(const P (&u)[4], P (&R)[3][3]) {
      const P u2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
      P twice[3], wu[3];
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) twice[i] = u[i] + u[i], wu[i] = u[3] * twice[i];
      const P scalar = S(1) - S(2) * u2;
      R[0][0] = scalar + twice[0] * u[0], R[1][1] = scalar + twice[1] * u[1], R[2][2] = scalar + twice[2] * u[2];
      R[0][1] = twice[0] * u[1] - wu[2], R[1][0] = twice[0] * u[1] + wu[2];
      R[0][2] = twice[0] * u[2] + wu[1], R[2][0] = twice[0] * u[2] - wu[1];
      R[1][2] = twice[1] * u[2] - wu[0], R[2][1] = twice[1] * u[2] + wu[0];
    }

    /// The half-turn that brings the largest component of q to the real part, as in the manifold's nearestRepresentative,
    /// and its signs. g++ 12 joins masks that select equal values, and joins them lane by lane: so each half-turn has a
    /// one of its own, and nothing that has been selected is compared with a constant.
    LIESTAT_ALWAYS_INLINE void turnToNearest(const S (&ones)[4], const P (&q)[4], P (&u)[3], P& w, P (&signs)[3]) {
      const P one = P(ones[3]);
      P second = P(S(-1)), sign = select(q[3] < S(0), -one, one);
      signs[0] = signs[1] = signs[2] = one;
      if constexpr ((HalfTurns & 1) != 0) {
        const P x = P(ones[0]);
        const auto better = take(absolute(q[0]), w, second);
        turn(better, u, q[3], q[2], -q[1]);
        turn(better, signs, x, -x, -x);
        sign = select(better, select(q[0] > S(0), -x, x), sign);
      }
      if constexpr ((HalfTurns & 2) != 0) {
        const P y = P(ones[1]);
        const auto better = take(absolute(q[1]), w, second);
        turn(better, u, -q[2], q[3], q[0]);
        turn(better, signs, -y, y, -y);
        sign = select(better, select(q[1] > S(0), -y, y), sign);
      }
      if constexpr ((HalfTurns & 4) != 0) {
        const P z = P(ones[2]);
        const auto better = take(absolute(q[2]), w, second);
        turn(better, u, q[1], -q[0], q[3]);
        turn(better, signs, -z, -z, z);
        sign = select(better, select(q[2] > S(0), -z, z), sign);
      }
      LIESTAT_UNROLL for (P& e : u) e *= sign;
      // Components have the rounding of a product of unit quaternions.
      constexpr S rounding = S(16) * std::numeric_limits<S>::epsilon();
      defect = larger(select(w - second < P(rounding), one, P::zero()), defect);
    }
    LIESTAT_ALWAYS_INLINE static typename P::Mask take(const P& c, P& best, P& second) {
      const auto better = c > best;
      second = larger(select(better, best, c), second);
      best = select(better, c, best);
      return better;
    }
    LIESTAT_ALWAYS_INLINE static void turn(const typename P::Mask& where, P (&u)[3], const P& x, const P& y,
                                           const P& z) {
      u[0] = select(where, x, u[0]), u[1] = select(where, y, u[1]), u[2] = select(where, z, u[2]);
    }

    /// The block at (row, column) of the Gauss–Newton matrix: Aᵀ B C; of a diagonal block the lower triangle.
    template <std::size_t row, std::size_t column>
    LIESTAT_ALWAYS_INLINE void addCongruence(const S* p, const P (&A)[3][3], const P (&C)[3][3]) {
      P BC[3][3];
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
        const P b0 = number(p, parameters + entry(row + i, column)),
                b1 = number(p, parameters + entry(row + i, column + 1)),
                b2 = number(p, parameters + entry(row + i, column + 2));
        LIESTAT_UNROLL for (std::size_t j = 0; j < 3; ++j) BC[i][j] = b0 * C[0][j] + b1 * C[1][j] + b2 * C[2][j];
      }
      LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) {
        LIESTAT_UNROLL for (std::size_t j = 0; j < 3; ++j) {
          if (row == column && j > i) continue;
          gauss_newton[entry(row + i, column + j)] += A[0][i] * BC[0][j] + A[1][i] * BC[1][j] + A[2][i] * BC[2][j];
        }
      }
    }
  };
};

}  // namespace liestat::detail
