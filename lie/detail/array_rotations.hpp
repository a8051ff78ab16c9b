// Operations on arrays of rotations for lie/detail/array_kernel.hpp: the formulas of So3Math (lie/so3.hpp) on packs.
#pragma once

#include <lie/detail/array_kernel.hpp>
#include <lie/detail/pack_angle.hpp>
#include <lie/detail/rotation_polynomials.hpp>

#include <cstddef>

namespace liestat::detail {

template <class P>
struct PackVector {
  P x, y, z;

  LIESTAT_ALWAYS_INLINE friend PackVector operator+(const PackVector& a, const PackVector& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  LIESTAT_ALWAYS_INLINE friend PackVector operator-(const PackVector& a) { return {-a.x, -a.y, -a.z}; }
  LIESTAT_ALWAYS_INLINE friend PackVector operator*(const P& s, const PackVector& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
  LIESTAT_ALWAYS_INLINE friend P dot(const PackVector& a, const PackVector& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
  }
  LIESTAT_ALWAYS_INLINE friend PackVector cross(const PackVector& a, const PackVector& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
};
template <class P>
LIESTAT_ALWAYS_INLINE PackVector<P> readVector(const P* in) {
  return {in[0], in[1], in[2]};
}
template <class P>
LIESTAT_ALWAYS_INLINE void writeVector(P* out, const PackVector<P>& v) {
  out[0] = v.x, out[1] = v.y, out[2] = v.z;
}

template <class P>
struct PackQuaternion {
  PackVector<P> u;
  P w;

  LIESTAT_ALWAYS_INLINE PackQuaternion conjugate() const { return {-u, w}; }
  LIESTAT_ALWAYS_INLINE friend P dot(const PackQuaternion& a, const PackQuaternion& b) {
    return (a.u.x * b.u.x + a.u.y * b.u.y) + (a.u.z * b.u.z + a.w * b.w);
  }
  LIESTAT_ALWAYS_INLINE friend PackQuaternion product(const PackQuaternion& a, const PackQuaternion& b) {
    const PackQuaternion q{{a.w * b.u.x + a.u.x * b.w + (a.u.y * b.u.z - a.u.z * b.u.y),
                            a.w * b.u.y + a.u.y * b.w + (a.u.z * b.u.x - a.u.x * b.u.z),
                            a.w * b.u.z + a.u.z * b.w + (a.u.x * b.u.y - a.u.y * b.u.x)},
                           a.w * b.w - a.u.x * b.u.x - (a.u.y * b.u.y + a.u.z * b.u.z)};
    if constexpr (is_single_precision<P>) {
      using S = typename P::Scalar;
      const P scale = S(0.5) * (S(3) - dot(q, q));
      return {scale * q.u, scale * q.w};
    } else {
      return q;
    }
  }
  LIESTAT_ALWAYS_INLINE PackVector<P> rotate(const PackVector<P>& p) const {
    using S = typename P::Scalar;
    const PackVector<P> t = cross(P(S(2)) * u, p);
    return p + w * t + cross(u, t);
  }
};
template <class P>
LIESTAT_ALWAYS_INLINE PackQuaternion<P> readQuaternion(const P* in) {
  return {readVector(in), in[3]};
}
template <class P>
LIESTAT_ALWAYS_INLINE void writeQuaternion(P* out, const PackQuaternion<P>& q) {
  writeVector(out, q.u);
  out[3] = q.w;
}

/// |q|² - 1 from which 1/|q| follows to second order.
template <class S>
inline constexpr S small_norm_excess = sizeof(S) == 8 ? S(5e-6) : S(1e-3);

/// A 3×3 matrix, m[row][column].
template <class P>
struct PackMatrix {
  P m[3][3];

  /// a I + b [v] + c [v]²
  LIESTAT_ALWAYS_INLINE static PackMatrix rotationPolynomial(const PackVector<P>& v, const P& a, const P& b,
                                                             const P& c) {
    const P xx = c * v.x * v.x, yy = c * v.y * v.y, zz = c * v.z * v.z;
    const P xy = c * v.x * v.y, xz = c * v.x * v.z, yz = c * v.y * v.z;
    const PackVector<P> w = b * v;
    return {{{a - yy - zz, xy - w.z, xz + w.y}, {xy + w.z, a - xx - zz, yz - w.x}, {xz - w.y, yz + w.x, a - xx - yy}}};
  }
  LIESTAT_ALWAYS_INLINE static PackMatrix rotation(const PackQuaternion<P>& q) {
    using S = typename P::Scalar;
    const P tx = S(2) * q.u.x, ty = S(2) * q.u.y, tz = S(2) * q.u.z;
    const P wx = tx * q.w, wy = ty * q.w, wz = tz * q.w, xx = tx * q.u.x, xy = ty * q.u.x, xz = tz * q.u.x,
            yy = ty * q.u.y, yz = tz * q.u.y, zz = tz * q.u.z;
    return {{{S(1) - (yy + zz), xy - wz, xz + wy},
             {xy + wz, S(1) - (xx + zz), yz - wx},
             {xz - wy, yz + wx, S(1) - (xx + yy)}}};
  }
  /// a bᵀ + b aᵀ + s I + [v]
  LIESTAT_ALWAYS_INLINE static PackMatrix symmetricPlusSkew(const PackVector<P>& a, const PackVector<P>& b, const P& s,
                                                            const PackVector<P>& v) {
    using S = typename P::Scalar;
    const P xy = a.x * b.y + a.y * b.x, xz = a.x * b.z + a.z * b.x, yz = a.y * b.z + a.z * b.y;
    return {{{S(2) * a.x * b.x + s, xy - v.z, xz + v.y},
             {xy + v.z, S(2) * a.y * b.y + s, yz - v.x},
             {xz - v.y, yz + v.x, S(2) * a.z * b.z + s}}};
  }
  /// [v] M
  LIESTAT_ALWAYS_INLINE static PackMatrix skewTimes(const PackVector<P>& v, const PackMatrix& M) {
    PackMatrix r;
    LIESTAT_UNROLL for (std::size_t j = 0; j < 3; ++j) {
      r.m[0][j] = v.y * M.m[2][j] - v.z * M.m[1][j];
      r.m[1][j] = v.z * M.m[0][j] - v.x * M.m[2][j];
      r.m[2][j] = v.x * M.m[1][j] - v.y * M.m[0][j];
    }
    return r;
  }
};
/// As the block at (row, column) of a matrix of `rows` rows.
template <std::size_t rows, class P>
LIESTAT_ALWAYS_INLINE void writeBlock(P* out, std::size_t row, std::size_t column, const PackMatrix<P>& M) {
  LIESTAT_UNROLL for (std::size_t j = 0; j < 3; ++j) {
    LIESTAT_UNROLL for (std::size_t i = 0; i < 3; ++i) out[(column + j) * rows + row + i] = M.m[i][j];
  }
}

/// Operations on tangent vectors whose rotation vector begins at number First; angles beyond the range of the
/// polynomials are special.
template <std::size_t A, std::size_t First, std::size_t Out, std::size_t Rows = 0>
struct RotationVectorOperation : ArrayOperation<A, 0, Out, Rows> {
  static constexpr bool variants = true;
  template <class P>
  LIESTAT_ALWAYS_INLINE static typename P::Mask special(const P (&in)[A]) {
    const PackVector<P> v = readVector(in + First);
    return PackAngle<true, P>::isLarge(dot(v, v));
  }
};

/// Operations on elements that begin with a quaternion; those that are not of norm one are special.
template <std::size_t A, std::size_t Out>
struct QuaternionOperation : ArrayOperation<A, 0, Out> {
  static constexpr bool variants = true;
  template <class P>
  LIESTAT_ALWAYS_INLINE static typename P::Mask special(const P (&in)[A]) {
    using S = typename P::Scalar;
    const PackQuaternion<P> q = readQuaternion(in);
    return absolute(dot(q, q) - S(1)) > small_norm_excess<S>;
  }
};

/// One by the root of a squared norm, of norms that are not one only if AnyNorm; not-a-number for zero.
template <bool AnyNorm, class P>
LIESTAT_ALWAYS_INLINE P inverseNorm(const P& squared) {
  using S = typename P::Scalar;
  const P excess = squared - S(1);
  const P near = S(1) - excess * (S(0.5) - S(0.375) * excess);
  if constexpr (!AnyNorm) return near;
  return select(absolute(excess) > small_norm_excess<S>, inverseSquareRoot(squared) * (squared / squared), near);
}

/// The logarithm of a quaternion q: rotation vector f u, u the vector part of q; and g with
/// leftJacobianInverse(f u) a = a - ½ f u×a + g u×(u×a).
template <class P>
struct PackLogarithm {
  P f, g;

  template <bool AnyNorm, bool WithG>
  LIESTAT_ALWAYS_INLINE static PackLogarithm of(const PackQuaternion<P>& q) {
    using S = typename P::Scalar;
    const P scale = inverseNorm<AnyNorm>(dot(q, q));
    const P signed_scale = select(q.w < S(0), -scale, scale);
    const P variable = S(1) - S(2) * (q.w * signed_scale);
    PackLogarithm log;
    log.f = evaluatePolynomial(any_rotation<S>.log, variable) * signed_scale;
    if constexpr (WithG) log.g = evaluatePolynomial(any_rotation<S>.exact_hessian, variable) * (scale * scale);
    return log;
  }
};

/// The operations of SO3: elements x y z w.
struct RotationArrays {
  static constexpr std::size_t DoF = 3, num_parameters = 4, Dim = 3;

  struct Exp : RotationVectorOperation<3, 0, 4, 0> {
    static constexpr std::size_t coefficients = 2;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[3], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackVector<P> v = readVector(in);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = S(0.5) * angle.sinc, c[1] = angle.cos;
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[4]) {
      writeQuaternion(result, PackQuaternion<P>{c[0] * readVector(in), c[1]});
    }
  };
  struct Log : QuaternionOperation<4, 3> {
    static constexpr std::size_t coefficients = 1;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[4], P (&c)[coefficients]) {
      c[0] = PackLogarithm<P>::template of<special, false>(readQuaternion(in)).f;
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[4], const P (&c)[coefficients], P (&result)[3]) {
      writeVector(result, c[0] * readVector(in));
    }
  };
  struct Product : ArrayOperation<4, 4, 4> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&left)[A], const P (&right)[B], P (&result)[N]) {
      writeQuaternion(result, product(readQuaternion(left), readQuaternion(right)));
    }
  };
  struct Inverse : ArrayOperation<4, 0, 4> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      writeQuaternion(result, readQuaternion(in).conjugate());
    }
  };
  struct Act : ArrayOperation<4, 3, 3> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&point)[B], P (&result)[N]) {
      writeVector(result, readQuaternion(in).rotate(readVector(point)));
    }
  };
  struct Adjoint : ArrayOperation<4, 0, 9, 3> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      writeBlock<3>(result, 0, 0, PackMatrix<P>::rotation(readQuaternion(in)));
    }
  };
  /// sign -1: the right Jacobian.
  template <int sign>
  struct Jacobian : RotationVectorOperation<3, 0, 9, 3> {
    static constexpr std::size_t coefficients = 2;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[3], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackVector<P> v = readVector(in);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = S(0.5) * (angle.sinc * angle.sinc), c[1] = angle.beta3();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[9]) {
      using S = typename P::Scalar;
      writeBlock<3>(result, 0, 0, PackMatrix<P>::rotationPolynomial(readVector(in), P(S(1)), S(sign) * c[0], c[1]));
    }
  };
  template <int sign>
  struct JacobianInverse : RotationVectorOperation<3, 0, 9, 3> {
    static constexpr std::size_t coefficients = 1;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[3], P (&c)[coefficients]) {
      const PackVector<P> v = readVector(in);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = angle.cotangentExcess();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[3], const P (&c)[coefficients], P (&result)[9]) {
      using S = typename P::Scalar;
      writeBlock<3>(result, 0, 0, PackMatrix<P>::rotationPolynomial(readVector(in), P(S(1)), P(S(-0.5 * sign)), c[0]));
    }
  };
};

}  // namespace liestat::detail
