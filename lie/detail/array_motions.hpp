// Operations on arrays of rigid motions for lie/detail/array_kernel.hpp: the formulas of Se3Math (lie/se3.hpp) on
// packs.
#pragma once

#include <lie/detail/array_rotations.hpp>

#include <cstddef>

namespace liestat::detail {

/// The operations of SE3: elements x y z w and the translation, tangents translation first.
struct MotionArrays {
  static constexpr std::size_t DoF = 6, num_parameters = 7, Dim = 3;

  struct Exp : RotationVectorOperation<6, 3, 7, 0> {
    static constexpr std::size_t coefficients = 4;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[6], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackVector<P> v = readVector(in + 3);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = S(0.5) * angle.sinc, c[1] = angle.cos, c[2] = c[0] * angle.sinc, c[3] = angle.beta3();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[6], const P (&c)[coefficients], P (&result)[7]) {
      const PackVector<P> v = readVector(in), omega = readVector(in + 3), ov = cross(omega, v);
      writeQuaternion(result, PackQuaternion<P>{c[0] * omega, c[1]});
      writeVector(result + 4, v + c[2] * ov + c[3] * cross(omega, ov));
    }
  };
  struct Log : QuaternionOperation<7, 6> {
    static constexpr std::size_t coefficients = 2;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[7], P (&c)[coefficients]) {
      const PackLogarithm<P> log = PackLogarithm<P>::template of<special, true>(readQuaternion(in));
      c[0] = log.f, c[1] = log.g;
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[7], const P (&c)[coefficients], P (&result)[6]) {
      using S = typename P::Scalar;
      const PackVector<P> u = readVector(in), t = readVector(in + 4), ut = cross(u, t);
      writeVector(result, t + (S(-0.5) * c[0]) * ut + c[1] * cross(u, ut));
      writeVector(result + 3, c[0] * u);
    }
  };
  struct Product : ArrayOperation<7, 7, 7> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&left)[A], const P (&right)[B], P (&result)[N]) {
      const PackQuaternion<P> p = readQuaternion(left), q = readQuaternion(right);
      const PackVector<P> t = p.rotate(readVector(right + 4)) + readVector(left + 4);
      writeQuaternion(result, product(p, q));
      writeVector(result + 4, t);
    }
  };
  struct Inverse : ArrayOperation<7, 0, 7> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      const PackQuaternion<P> q = readQuaternion(in).conjugate();
      const PackVector<P> t = readVector(in + 4);
      writeQuaternion(result, q);
      writeVector(result + 4, -q.rotate(t));
    }
  };
  struct Act : ArrayOperation<7, 3, 3> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&point)[B], P (&result)[N]) {
      writeVector(result, readQuaternion(in).rotate(readVector(point)) + readVector(in + 4));
    }
  };
  struct Adjoint : ArrayOperation<7, 0, 36, 6> {
    template <class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      const PackVector<P> t = readVector(in + 4);
      const PackMatrix<P> R = PackMatrix<P>::rotation(readQuaternion(in));
      writeBlocks(result, R, PackMatrix<P>::skewTimes(t, R));
    }
  };
  template <int sign>
  struct Jacobian : RotationVectorOperation<6, 3, 36, 6> {
    static constexpr std::size_t coefficients = 4;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[6], P (&c)[coefficients]) {
      using S = typename P::Scalar;
      const PackVector<P> v = readVector(in + 3);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = S(0.5) * (angle.sinc * angle.sinc);
      c[1] = angle.beta3(), c[2] = angle.beta4(), c[3] = angle.beta5();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[6], const P (&c)[coefficients], P (&result)[36]) {
      using S = typename P::Scalar;
      const PackVector<P> rho = signedVector<sign>(readVector(in)), phi = signedVector<sign>(readVector(in + 3));
      const P d = dot(phi, rho), b5 = S(-2) * d * c[3];
      const PackVector<P> axial = c[0] * rho + (d * (S(2) * c[2] - c[1])) * phi;
      const PackVector<P> b = c[1] * rho + (S(0.5) * b5) * phi;
      writeBlocks(result, PackMatrix<P>::rotationPolynomial(phi, P(S(1)), c[0], c[1]),
                  PackMatrix<P>::symmetricPlusSkew(b, phi, S(-2) * d * c[1] - b5 * dot(phi, phi), axial));
    }
  };
  template <int sign>
  struct JacobianInverse : RotationVectorOperation<6, 3, 36, 6> {
    static constexpr std::size_t coefficients = 3;
    template <bool special, class P>
    LIESTAT_ALWAYS_INLINE static void prepare(const P (&in)[6], P (&c)[coefficients]) {
      const PackVector<P> v = readVector(in + 3);
      const PackAngle<special, P> angle(dot(v, v));
      c[0] = angle.sinc, c[1] = angle.halfExcess(), c[2] = angle.halfExcessSlope();
    }
    template <class P>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[6], const P (&c)[coefficients], P (&result)[36]) {
      using S = typename P::Scalar;
      const PackVector<P> rho = signedVector<sign>(readVector(in)), phi = signedVector<sign>(readVector(in + 3));
      // cotangentExcess and d times cotangentExcessSlope of lie/detail/trig.hpp.
      const P d = dot(phi, rho), excess = c[1] / (S(4) * c[0]);
      const P slope = d * (c[2] * c[0] + S(0.5) * c[1] * c[1]) / (S(8) * c[0] * c[0]);
      const PackVector<P> b = excess * rho + (S(0.5) * slope) * phi;
      writeBlocks(
          result, PackMatrix<P>::rotationPolynomial(phi, P(S(1)), P(S(-0.5)), excess),
          PackMatrix<P>::symmetricPlusSkew(b, phi, S(-2) * excess * d - slope * dot(phi, phi), P(S(-0.5)) * rho));
    }
  };

 private:
  template <int sign, class P>
  LIESTAT_ALWAYS_INLINE static PackVector<P> signedVector(const PackVector<P>& v) {
    if constexpr (sign > 0) return v;
    return -v;
  }
  /// [diagonal coupling; 0 diagonal]
  template <class P>
  LIESTAT_ALWAYS_INLINE static void writeBlocks(P* out, const PackMatrix<P>& diagonal, const PackMatrix<P>& coupling) {
    writeBlock<6>(out, 0, 0, diagonal);
    writeBlock<6>(out, 3, 3, diagonal);
    writeBlock<6>(out, 0, 3, coupling);
  }
};

}  // namespace liestat::detail
