// Operations on arrays of rotations and rigid motions of the plane for lie/detail/array_kernel.hpp: the formulas of
// So2Math (lie/so2.hpp) and Se2Math (lie/se2.hpp) on packs.
#pragma once

#include <lie/detail/array_kernel.hpp>
#include <lie/detail/array_rotations.hpp>
#include <lie/detail/pack_angle.hpp>
#include <lie/detail/rotation_polynomials.hpp>

#include <cstddef>
#include <numbers>

namespace liestat::detail {

/// A complex number re + i im: a point, a rotation, or re I + im J as a matrix.
template <class P>
struct PackComplex {
  P re, im;

  LIESTAT_ALWAYS_INLINE PackComplex conjugate() const { return {re, -im}; }
  LIESTAT_ALWAYS_INLINE friend PackComplex operator+(const PackComplex& a, const PackComplex& b) {
    return {a.re + b.re, a.im + b.im};
  }
  LIESTAT_ALWAYS_INLINE friend PackComplex operator-(const PackComplex& a) { return {-a.re, -a.im}; }
  LIESTAT_ALWAYS_INLINE friend PackComplex operator*(const PackComplex& a, const PackComplex& b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  }
};
template <class P>
LIESTAT_ALWAYS_INLINE PackComplex<P> readComplex(const P* in) {
  return {in[0], in[1]};
}
template <class P>
LIESTAT_ALWAYS_INLINE void writeComplex(P* out, const PackComplex<P>& z) {
  out[0] = z.re, out[1] = z.im;
}
/// The product of rotations, renormalised in float.
template <class P>
LIESTAT_ALWAYS_INLINE PackComplex<P> rotationProduct(const PackComplex<P>& a, const PackComplex<P>& b) {
  const PackComplex<P> z = a * b;
  if constexpr (is_single_precision<P>) {
    using S = typename P::Scalar;
    const P scale = S(0.5) * (S(3) - (z.re * z.re + z.im * z.im));
    return {scale * z.re, scale * z.im};
  } else {
    return z;
  }
}

/// Operations on tangent vectors whose angle is number At; angles beyond the range of the polynomials are special.
template <std::size_t A, std::size_t At, std::size_t Out, std::size_t Rows = 0>
struct AngleOperation : ArrayOperation<A, 0, Out, Rows> {
  static constexpr bool variants = true;
  template <class P>
  LIESTAT_ALWAYS_INLINE static typename P::Mask special(const P (&in)[A]) {
    return PackAngle<true, P>::isLarge(in[At] * in[At]);
  }
};

/// The exponential of tangent vectors whose angle θ is number At.
template <std::size_t A, std::size_t At, std::size_t Out>
struct AngleExponential : AngleOperation<A, At, Out> {
  static constexpr std::size_t coefficients = 2;  ///< sin θ/θ, (1 - cos θ)/θ²
  template <bool special, class P>
  LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[A], P (&c)[coefficients]) {
    using S = typename P::Scalar;
    const PackAngle<special, P> angle(in[At] * in[At]);
    c[0] = angle.sinc * angle.cos, c[1] = S(0.5) * (angle.sinc * angle.sinc);
  }
  /// (cos θ, sin θ)
  template <class P>
  LIESTAT_ALWAYS_INLINE static PackComplex<P> rotation(const P& theta, const P (&c)[coefficients]) {
    using S = typename P::Scalar;
    return {S(1) - theta * theta * c[1], theta * c[0]};
  }
};

/// The logarithm of elements that begin with a complex number; what is not of norm one is special.
template <std::size_t A, std::size_t Out>
struct ComplexLogarithm : ArrayOperation<A, 0, Out> {
  static constexpr bool variants = true;
  static constexpr std::size_t coefficients = 1;  ///< 1/|z|
  template <class P>
  LIESTAT_ALWAYS_INLINE static typename P::Mask special(const P (&in)[A]) {
    using S = typename P::Scalar;
    return absolute(squaredNorm(in) - S(1)) > small_norm_excess<S>;
  }
  template <bool special, class P>
  LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[A], P (&c)[coefficients]) {
    c[0] = inverseNorm<special>(squaredNorm(in));
  }

 private:
  template <class P>
  LIESTAT_ALWAYS_INLINE static P squaredNorm(const P (&in)[A]) {
    return in[0] * in[0] + in[1] * in[1];
  }
};

/// The angle θ in [-π, π] of a unit complex number, and ½ θ cot ½θ.
template <class P>
struct PackArgument {
  P theta, half_cotangent;

  LIESTAT_ALWAYS_INLINE explicit PackArgument(const PackComplex<P>& z) {
    using S = typename P::Scalar;
    // θ/sin θ of the angle to the nearer half of the real axis: a polynomial of its cosine.
    const P ratio = S(0.5) * evaluatePolynomial(any_rotation<S>.log, S(1) - S(2) * absolute(z.re));
    const P arc = z.im * ratio, pi(std::numbers::pi_v<S>);
    const auto near = z.re > S(0);
    theta = select(near, arc, select(z.im < S(0), -pi, pi) - arc);
    // sin θ/(1 - cos θ) = (1 + cos θ)/sin θ is the cotangent; neither cancels where it is taken.
    half_cotangent = S(0.5) * select(near, ratio * (S(1) + z.re), theta * z.im / (S(1) - smaller(z.re, P::zero())));
  }
};

/// The operations of SO2: elements cos, sin.
struct PlaneRotationArrays {
  static constexpr std::size_t DoF = 1, num_parameters = 2, Dim = 2;

  struct Exp : AngleExponential<1, 0, 2> {
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[1], const P (&c)[coefficients], P (&result)[2]) {
      writeComplex(result, rotation(in[0], c));
    }
  };
  struct Log : ComplexLogarithm<2, 1> {
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[2], const P (&c)[coefficients], P (&result)[1]) {
      result[0] = PackArgument<P>(PackComplex<P>{in[0] * c[0], in[1] * c[0]}).theta;
    }
  };
  struct Product : ArrayOperation<2, 2, 2> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&left)[A], const P (&right)[B], P (&result)[N]) {
      writeComplex(result, rotationProduct(readComplex(left), readComplex(right)));
    }
  };
  struct Inverse : ArrayOperation<2, 0, 2> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      writeComplex(result, readComplex(in).conjugate());
    }
  };
  struct Act : ArrayOperation<2, 2, 2> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&point)[B], P (&result)[N]) {
      writeComplex(result, readComplex(in) * readComplex(point));
    }
  };
  /// The group is commutative: its adjoint and its Jacobians are one.
  template <std::size_t A>
  struct One : ArrayOperation<A, 0, 1, 1> {
    template <class P, std::size_t NumbersIn, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&)[NumbersIn], const P (&)[B], P (&result)[N]) {
      using S = typename P::Scalar;
      result[0] = P(S(1));
    }
  };
  using Adjoint = One<2>;
  template <int sign>
  using Jacobian = One<1>;
  template <int sign>
  using JacobianInverse = One<1>;
};

/// The operations of SE2: elements cos, sin and the translation, tangents translation first.
struct PlaneMotionArrays {
  static constexpr std::size_t DoF = 3, num_parameters = 4, Dim = 2;

  struct Exp : AngleExponential<3, 2, 4> {
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[4]) {
      writeComplex(result, rotation(in[2], c));
      writeComplex(result + 2, PackComplex<P>{c[0], in[2] * c[1]} * readComplex(in));
    }
  };
  struct Log : ComplexLogarithm<4, 3> {
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[4], const P (&c)[coefficients], P (&result)[3]) {
      using S = typename P::Scalar;
      const PackArgument<P> argument(PackComplex<P>{in[0] * c[0], in[1] * c[0]});
      writeComplex(result, PackComplex<P>{argument.half_cotangent, S(-0.5) * argument.theta} * readComplex(in + 2));
      result[2] = argument.theta;
    }
  };
  struct Product : ArrayOperation<4, 4, 4> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&left)[A], const P (&right)[B], P (&result)[N]) {
      const PackComplex<P> a = readComplex(left), b = readComplex(right);
      const PackComplex<P> t = a * readComplex(right + 2) + readComplex(left + 2);
      writeComplex(result, rotationProduct(a, b));
      writeComplex(result + 2, t);
    }
  };
  struct Inverse : ArrayOperation<4, 0, 4> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      const PackComplex<P> z = readComplex(in).conjugate(), t = readComplex(in + 2);
      writeComplex(result, z);
      writeComplex(result + 2, -(z * t));
    }
  };
  struct Act : ArrayOperation<4, 2, 2> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&point)[B], P (&result)[N]) {
      writeComplex(result, readComplex(in) * readComplex(point) + readComplex(in + 2));
    }
  };
  struct Adjoint : ArrayOperation<4, 0, 9, 3> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      writeBlocks(result, readComplex(in), PackComplex<P>{in[3], -in[2]});
    }
  };
  /// sign -1: the right Jacobian.
  template <int sign>
  struct Jacobian : AngleOperation<3, 2, 9, 3> {
    static constexpr std::size_t coefficients = 3;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[3], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackAngle<special, P> angle(in[2] * in[2]);
      c[0] = angle.sinc * angle.cos, c[1] = S(0.5) * (angle.sinc * angle.sinc), c[2] = angle.beta3();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[9]) {
      using S = typename P::Scalar;
      const P theta = S(sign) * in[2];
      writeBlocks(result, PackComplex<P>{c[0], theta * c[1]}, coupling<sign>(in, c[1], c[2]));
    }
  };
  template <int sign>
  struct JacobianInverse : AngleOperation<3, 2, 9, 3> {
    static constexpr std::size_t coefficients = 3;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[3], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackAngle<special, P> angle(in[2] * in[2]);
      c[0] = angle.cos / angle.sinc, c[1] = S(0.5) * (angle.sinc * angle.sinc), c[2] = angle.beta3();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[9]) {
      using S = typename P::Scalar;
      const PackComplex<P> inverse{c[0], S(-0.5 * sign) * in[2]};
      writeBlocks(result, inverse, -(inverse * coupling<sign>(in, c[1], c[2])));
    }
  };

 private:
  /// The last column of the Jacobian, but for its one: (½ sinc² ½θ + θ β₃ J)(-J υ).
  template <int sign, class P>
  LIESTAT_ALWAYS_INLINE static PackComplex<P> coupling(const P (&in)[3], const P& half_sinc2, const P& beta3) {
    using S = typename P::Scalar;
    return PackComplex<P>{half_sinc2, S(sign) * in[2] * beta3} * PackComplex<P>{S(sign) * in[1], S(-sign) * in[0]};
  }
  /// [matrix column; 0 0 1]
  template <class P>
  LIESTAT_ALWAYS_INLINE static void writeBlocks(P* out, const PackComplex<P>& matrix, const PackComplex<P>& column) {
    using S = typename P::Scalar;
    out[0] = out[4] = matrix.re;
    out[1] = matrix.im, out[3] = -matrix.im;
    out[6] = column.re, out[7] = column.im, out[8] = P(S(1));
  }
};

}  // namespace liestat::detail
