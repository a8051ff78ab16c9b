// Operations on arrays of rigid motions for lie/detail/array_kernel.hpp: the formulas of Se3Math (lie/se3.hpp) on packs.
#pragma once

#include <lie/detail/array_rotations.hpp>

#include <cstddef>

namespace liestat::detail {

/// The operations of SE3: elements x y z w and the translation, tangents translation first.
struct MotionArrays {
  static constexpr std::size_t DoF = 6, num_parameters = 7, Dim = 3;

  struct Exp : RotationVectorOperation<6, 3, 7, 0> {
    template <bool special, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      using S = typename P::Scalar;
      const PackVector<P> v = readVector(in), omega = readVector(in + 3);
      const PackAngle<special, P> angle(dot(omega, omega));
      const PackVector<P> ov = cross(omega, v);
      writeQuaternion(result, PackQuaternion<P>{(S(0.5) * angle.sinc) * omega, angle.cos});
      writeVector(result + 4, v + (S(0.5) * angle.sinc * angle.sinc) * ov + angle.beta3() * cross(omega, ov));
    }
  };
  struct Log : QuaternionOperation<7, 6> {
    template <bool special, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      using S = typename P::Scalar;
      const PackQuaternion<P> q = readQuaternion(in);
      const PackVector<P> t = readVector(in + 4);
      const PackLogarithm<P> log = PackLogarithm<P>::template of<special, true>(q);
      const PackVector<P> ut = cross(q.u, t);
      writeVector(result, t + (S(-0.5) * log.f) * ut + log.g * cross(q.u, ut));
      writeVector(result + 3, log.f * q.u);
    }
  };
  struct Product : ArrayOperation<7, 7, 7> {
    template <bool, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&left)[A], const P (&right)[B], P (&result)[N]) {
      const PackQuaternion<P> p = readQuaternion(left), q = readQuaternion(right);
      const PackVector<P> t = p.rotate(readVector(right + 4)) + readVector(left + 4);
      writeQuaternion(result, product(p, q));
      writeVector(result + 4, t);
    }
  };
  struct Inverse : ArrayOperation<7, 0, 7> {
    template <bool, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      const PackQuaternion<P> q = readQuaternion(in).conjugate();
      const PackVector<P> t = readVector(in + 4);
      writeQuaternion(result, q);
      writeVector(result + 4, -q.rotate(t));
    }
  };
  struct Act : ArrayOperation<7, 3, 3> {
    template <bool, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&point)[B], P (&result)[N]) {
      writeVector(result, readQuaternion(in).rotate(readVector(point)) + readVector(in + 4));
    }
  };
  struct Adjoint : ArrayOperation<7, 0, 36, 6> {
    template <bool, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      const PackVector<P> t = readVector(in + 4);
      const PackMatrix<P> R = PackMatrix<P>::rotation(readQuaternion(in));
      writeBlocks(result, R, PackMatrix<P>::skewTimes(t, R));
    }
  };
  template <int sign>
  struct Jacobian : RotationVectorOperation<6, 3, 36, 6> {
    template <bool special, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      using S = typename P::Scalar;
      const PackVector<P> rho = signedVector<sign>(readVector(in)), phi = signedVector<sign>(readVector(in + 3));
      const P t = dot(phi, phi), d = dot(phi, rho);
      const PackAngle<special, P> angle(t);
      const P beta2 = S(0.5) * (angle.sinc * angle.sinc), beta3 = angle.beta3(), b5 = S(-2) * d * angle.beta5();
      const PackVector<P> axial = beta2 * rho + (d * (S(2) * angle.beta4() - beta3)) * phi;
      const PackVector<P> b = beta3 * rho + (S(0.5) * b5) * phi;
      writeBlocks(result, PackMatrix<P>::rotationPolynomial(phi, P(S(1)), beta2, beta3),
                  PackMatrix<P>::symmetricPlusSkew(b, phi, S(-2) * d * beta3 - b5 * t, axial));
    }
  };
  template <int sign>
  struct JacobianInverse : RotationVectorOperation<6, 3, 36, 6> {
    template <bool special, class P, std::size_t A, std::size_t B, std::size_t N>
    LIESTAT_ALWAYS_INLINE static void apply(const P (&in)[A], const P (&)[B], P (&result)[N]) {
      using S = typename P::Scalar;
      const PackVector<P> rho = signedVector<sign>(readVector(in)), phi = signedVector<sign>(readVector(in + 3));
      const P t = dot(phi, phi), d = dot(phi, rho);
      const PackAngle<special, P> angle(t);
      const P c = angle.cotangentExcess(), slope = d * angle.cotangentExcessSlope();
      const PackVector<P> b = c * rho + (S(0.5) * slope) * phi;
      writeBlocks(result, PackMatrix<P>::rotationPolynomial(phi, P(S(1)), P(S(-0.5)), c),
                  PackMatrix<P>::symmetricPlusSkew(b, phi, S(-2) * c * d - slope * t, P(S(-0.5)) * rho));
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
