// The sums of the Mahalanobis mean of points, directions, and plane rotations and frames whose covariances are those of
// the measurements, a register of measurements at a time. Measurements lie in groups as in stats/detail/maha_kernel.hpp.
#pragma once

#include <stats/detail/direction_kernel.hpp>

#include <cstddef>

namespace liestat::detail {

/// Numbers of a measurement, and groups of them: the parameters, then the lower triangle of the information.
template <class S, std::size_t Parameters, std::size_t Dimension>
struct MahaGroupLayout {
  static constexpr std::size_t parameters = Parameters, entries = Dimension * (Dimension + 1) / 2,
                               lanes = 64 / sizeof(S), numbers = parameters + entries, group_size = numbers * lanes;
  template <class P>
  LIESTAT_ALWAYS_INLINE static P parameter(const S* p, std::size_t which) {
    return P::load(p + which * lanes);
  }
  /// Row i, column j of the information.
  template <class P>
  LIESTAT_ALWAYS_INLINE static P information(const S* p, std::size_t i, std::size_t j) {
    return P::load(p + (parameters + (i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i)) * lanes);
  }
};

/// Points of N coordinates: the error y - x has the derivative I.
template <class S, std::size_t N>
struct MahaPointKernel : MahaGroupLayout<S, N, N> {
  using Group = MahaGroupLayout<S, N, N>;
  using Group::entries, Group::lanes, Group::group_size;
  struct Arguments {
    const S* groups = nullptr;
    std::size_t count = 0;  ///< groups
    S reference[N] = {};
    S cost, defect = 0, gradient[N], gauss_newton[entries];
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    P cost = P::zero(), gradient[N], gauss_newton[entries];
    LIESTAT_UNROLL for (P& x : gradient) x = P::zero();
    LIESTAT_UNROLL for (P& x : gauss_newton) x = P::zero();
    for (std::size_t i = 0; i < arguments.count; ++i) {
      for (std::size_t j = 0; j < lanes; j += P::size) {
        const S* const p = arguments.groups + i * group_size + j;
        P z[N];
        LIESTAT_UNROLL for (std::size_t a = 0; a < N; ++a) {
          z[a] = arguments.reference[a] - Group::template parameter<P>(p, a);
        }
        LIESTAT_UNROLL for (std::size_t a = 0; a < N; ++a) {
          P sum = Group::template information<P>(p, a, 0) * z[0];
          LIESTAT_UNROLL for (std::size_t b = 1; b < N; ++b) sum += Group::template information<P>(p, a, b) * z[b];
          gradient[a] += sum;
          cost += sum * z[a];
        }
        LIESTAT_UNROLL for (std::size_t e = 0; e < entries; ++e) {
          gauss_newton[e] += Group::template parameter<P>(p, N + e);
        }
      }
    }
    arguments.cost = S(0.5) * sumOf(cost);
    for (std::size_t a = 0; a < N; ++a) arguments.gradient[a] = sumOf(gradient[a]);
    for (std::size_t e = 0; e < entries; ++e) arguments.gauss_newton[e] = sumOf(gauss_newton[e]);
  }
};

/// Unit vectors. The error of x in space is z = h u with u = y - c x, c = <x, y>, h and g as in
/// stats/detail/direction_kernel.hpp. B is the information in the axes of space, with B x = 0, so the criterion is
/// ½ h² q with q = yᵀ B y; with b = B y and g = -h'(c) it has the gradient h² b - g h q x, the Gauss–Newton matrix
///
///   h² B + g² q x xᵀ - g h (x bᵀ + b xᵀ),
///
/// and the Hessian on the sphere is this plus -h g' q x xᵀ - g h (x bᵀ + b xᵀ) - h q (h - g c) I.
template <class S>
struct MahaDirectionKernel : MahaGroupLayout<S, 3, 3> {
  using Group = MahaGroupLayout<S, 3, 3>;
  using Group::lanes, Group::group_size;
  struct Arguments {
    const S* groups = nullptr;
    std::size_t count = 0;
    S reference[3] = {};
    S cost, defect, gradient[3], gauss_newton[6];
    S curvature[6], radial;  ///< the Hessian's further part, whose multiple of I is subtracted
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  template <class P>
  struct Run {
    P cost = P::zero(), defect = P::zero(), radial = P::zero(), gradient[3], gauss_newton[6], curvature[6];

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (P& x : gradient) x = P::zero();
      LIESTAT_UNROLL for (std::size_t e = 0; e < 6; ++e) gauss_newton[e] = curvature[e] = P::zero();
    }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      Run sums;
      for (std::size_t i = 0; i < arguments.count; ++i) {
        for (std::size_t j = 0; j < lanes; j += P::size) {
          sums.add(arguments.groups + i * group_size + j, arguments.reference);
        }
      }
      arguments.cost = S(0.5) * sumOf(sums.cost);
      arguments.defect = largestOf(sums.defect);
      arguments.radial = sumOf(sums.radial);
      for (std::size_t a = 0; a < 3; ++a) arguments.gradient[a] = sumOf(sums.gradient[a]);
      for (std::size_t e = 0; e < 6; ++e) {
        arguments.gauss_newton[e] = sumOf(sums.gauss_newton[e]), arguments.curvature[e] = sumOf(sums.curvature[e]);
      }
    }
    LIESTAT_ALWAYS_INLINE void add(const S* p, const S (&y)[3]) {
      P x[3], u[3], b[3];
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) x[a] = Group::template parameter<P>(p, a);
      const P c = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) u[a] = y[a] - c * x[a];
      const P s2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
      AngleOverSine<P> angle;
      P slope;
      if (anyOf(c < S(0.01))) {
        angle.template evaluate<true, true, true>(c, s2, any_rotation<S>);
        defect = larger(angle.antipode, defect);
        slope = select(c > S(0), slopeOf(larger(c, P::zero())), (angle.h - S(3) * c * angle.g) / s2);
      } else {
        angle.template evaluate<false, true, true>(c, s2, any_rotation<S>);
        slope = slopeOf(c);
      }
      const P &h = angle.h, &g = angle.g;
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) {
        b[a] = Group::template information<P>(p, a, 0) * u[0] + Group::template information<P>(p, a, 1) * u[1] +
               Group::template information<P>(p, a, 2) * u[2];
      }
      const P q = u[0] * b[0] + u[1] * b[1] + u[2] * b[2], h2 = h * h, hq = h * q, gh = g * h, ghq = g * hq;
      cost += h * hq;
      radial += hq * (h - g * c);
      const P square = g * g * q, bend = hq * slope;
      LIESTAT_UNROLL for (std::size_t a = 0; a < 3; ++a) gradient[a] += h2 * b[a] - ghq * x[a];
      LIESTAT_UNROLL for (std::size_t a = 0, e = 0; a < 3; ++a) {
        LIESTAT_UNROLL for (std::size_t l = 0; l <= a; ++l, ++e) {
          const P outer = x[a] * x[l], mixed = gh * (x[a] * b[l] + b[a] * x[l]);
          gauss_newton[e] += h2 * Group::template information<P>(p, a, l) + square * outer - mixed;
          curvature[e] += bend * outer - mixed;
        }
      }
    }
    /// -g'(c), c >= 0.
    LIESTAT_ALWAYS_INLINE static P slopeOf(const P& c) {
      const auto& polynomials = any_rotation<S>;
      return evaluatePolynomial(polynomials.hessian_slope,
                                P((S(1) - c) * static_cast<S>(1 / polynomials.range) - S(1)));
    }
  };
};

/// Plane rotations x (cos, sin), and with Frame their translations: the error's angle is that of x⁻¹y, whose derivative
/// is 1, and its translation R_xᵀ (t_y - t_x), whose derivative in the axes of y is the rotation x⁻¹y.
template <class S, bool Frame>
struct MahaPlanarKernel : MahaGroupLayout<S, Frame ? 4 : 2, Frame ? 3 : 1> {
  static constexpr std::size_t k = Frame ? 3 : 1, numbers_of_y = Frame ? 4 : 2;
  using Group = MahaGroupLayout<S, numbers_of_y, k>;
  using Group::entries, Group::lanes, Group::group_size;
  struct Arguments {
    const S* groups = nullptr;
    std::size_t count = 0;
    S reference[numbers_of_y] = {};
    S cost, defect, gradient[k], gauss_newton[entries];
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    Run<Pack<Set, S>>::all(arguments);
  }

 private:
  template <class P>
  struct Run {
    P cost = P::zero(), defect = P::zero(), gradient[k], gauss_newton[entries];

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (P& x : gradient) x = P::zero();
      LIESTAT_UNROLL for (P& x : gauss_newton) x = P::zero();
    }
    LIESTAT_ALWAYS_INLINE static void all(Arguments& arguments) {
      Run sums;
      for (std::size_t i = 0; i < arguments.count; ++i) {
        for (std::size_t j = 0; j < lanes; j += P::size) {
          sums.add(arguments.groups + i * group_size + j, arguments.reference);
        }
      }
      arguments.cost = S(0.5) * sumOf(sums.cost);
      arguments.defect = largestOf(sums.defect);
      for (std::size_t a = 0; a < k; ++a) arguments.gradient[a] = sumOf(sums.gradient[a]);
      for (std::size_t e = 0; e < entries; ++e) arguments.gauss_newton[e] = sumOf(sums.gauss_newton[e]);
    }
    LIESTAT_ALWAYS_INLINE void add(const S* p, const S (&y)[numbers_of_y]) {
      const P x0 = Group::template parameter<P>(p, 0), x1 = Group::template parameter<P>(p, 1);
      const P c = x0 * y[0] + x1 * y[1], s = x0 * y[1] - x1 * y[0];
      AngleOverSine<P> angle;
      if (anyOf(c < S(0.01))) {
        angle.template evaluate<true, false, false>(c, s * s, any_rotation<S>);
        defect = larger(angle.antipode, defect);
      } else {
        angle.template evaluate<false, false, false>(c, s * s, any_rotation<S>);
      }
      P z[k], a[k];
      z[k - 1] = angle.h * s;
      if constexpr (Frame) {
        const P t0 = y[2] - Group::template parameter<P>(p, 2), t1 = y[3] - Group::template parameter<P>(p, 3);
        z[0] = x0 * t0 + x1 * t1, z[1] = x0 * t1 - x1 * t0;
      }
      LIESTAT_UNROLL for (std::size_t i = 0; i < k; ++i) {
        a[i] = Group::template information<P>(p, i, 0) * z[0];
        LIESTAT_UNROLL for (std::size_t j = 1; j < k; ++j) a[i] += Group::template information<P>(p, i, j) * z[j];
        cost += a[i] * z[i];
      }
      gradient[k - 1] += a[k - 1];
      gauss_newton[entries - 1] += Group::template information<P>(p, k - 1, k - 1);
      if constexpr (Frame) {
        gradient[0] += c * a[0] + s * a[1], gradient[1] += c * a[1] - s * a[0];
        const P b00 = Group::template information<P>(p, 0, 0), b10 = Group::template information<P>(p, 1, 0),
                b11 = Group::template information<P>(p, 1, 1), r0 = Group::template information<P>(p, 2, 0),
                r1 = Group::template information<P>(p, 2, 1);
        // B R, then Rᵀ B R.
        const P m00 = b00 * c + b10 * s, m01 = b10 * c - b00 * s, m10 = b10 * c + b11 * s, m11 = b11 * c - b10 * s;
        gauss_newton[0] += c * m00 + s * m10;
        gauss_newton[1] += c * m10 - s * m00;
        gauss_newton[2] += c * m11 - s * m01;
        gauss_newton[3] += r0 * c + r1 * s;
        gauss_newton[4] += r1 * c - r0 * s;
      }
    }
  };
};

}  // namespace liestat::detail
