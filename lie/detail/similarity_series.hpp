// The exponential's integrals for similarities: φ(A) = Σ Aᵏ/(k+1)! and ψ(A) = Σ Aᵏ/(k+2)! of A = σ + [ω], and the
// coupling of translation and rotation in the left Jacobian of Sim(3).
//
// Closed forms divide by σ, θ and σ² + θ², each of which may vanish alone; and their remedies, one series for each
// case, lose digits between the cases. Here all functions are evaluated at A/2^k, where one series holds for all, and
// doubled back:
//   φ(2A) = φ(A) (e^A + 1)/2,  ψ(2A) = (φ(A)² + 2 ψ(A))/4,
// with e^A taken anew at every step, so that errors add up but do not double. Everything is a power series in (σ, θ²):
// derivatives are right at zero too. Beyond an angle of eight, where doublings would have to be more and more, θ and
// |σ + iθ| are far from zero and the closed forms in the plane of rotation lose nothing; along the axis A is σ alone.
#pragma once

#include <lie/detail/trig.hpp>

#include <array>
#include <cstddef>

namespace liestat::detail {

/// a + b x + c x², where x³ = -t x: the matrices that commute with the rotations about ω, x = [ω], t = |ω|².
template <class S>
struct Axial {
  S a, b, c;

  static Axial constant(const S& s) { return {s, S(0), S(0)}; }
  /// scale · Exp(x)
  static Axial exponential(const S& scale, const S& t) {
    const S s = halfAngle(t).sinc;
    return scale * Axial{S(1), halfAngle(S(S(4) * t)).sinc, S(0.5) * s * s};
  }
  /// (σ + x) p
  Axial timesArgument(const S& sigma, const S& t) const { return {sigma * a, sigma * b + a - t * c, sigma * c + b}; }
  /// The element as one in 2x.
  Axial ofTwice() const { return {a, S(0.5) * b, S(0.25) * c}; }

  friend Axial operator+(const Axial& p, const Axial& q) { return {p.a + q.a, p.b + q.b, p.c + q.c}; }
  friend Axial operator*(const S& s, const Axial& p) { return {s * p.a, s * p.b, s * p.c}; }
  /// p q
  static Axial product(const Axial& p, const Axial& q, const S& t) {
    const S cubic = p.b * q.c + p.c * q.b, quartic = p.c * q.c;
    return {p.a * q.a, p.a * q.b + p.b * q.a - t * cubic, p.a * q.c + p.b * q.b + p.c * q.a - t * quartic};
  }
  /// The element of which the value on the axis and that on the plane are given.
  static Axial joined(const S& axis, const S& plane, const S& plane_turned, const S& t) {
    return {axis, plane_turned, (axis - plane) / t};
  }
  /// 1/p
  static Axial inverse(const Axial& p, const S& t) {
    // On the axis the element is a; on the plane the complex number (a - c t) + i b θ.
    const S re = p.a - p.c * t, norm = re * re + p.b * p.b * t;
    return {S(1) / p.a, -p.b / norm, (p.b * p.b - re * p.c) / (p.a * norm)};
  }
  Eigen::Matrix<S, 3, 3> matrix(const Eigen::Matrix<S, 3, 1>& omega) const {
    return rotationPolynomial(omega, a, b, c);
  }
  Eigen::Matrix<S, 3, 1> apply(const Eigen::Matrix<S, 3, 1>& omega, const Eigen::Matrix<S, 3, 1>& v) const {
    const Eigen::Matrix<S, 3, 1> w = omega.cross(v);
    return a * v + b * w + c * omega.cross(w);
  }
};

/// a + b y, where y² = -θ²: the same in the plane, y = θ times the quarter-turn.
template <class S>
struct Planar {
  S a, b;

  static Planar constant(const S& s) { return {s, S(0)}; }
  static Planar exponential(const S& scale, const S& t) {
    const HalfAngle<S> h = halfAngle(S(S(4) * t));
    return scale * Planar{h.cos, h.sinc};
  }
  Planar timesArgument(const S& sigma, const S& t) const { return {sigma * a - t * b, sigma * b + a}; }
  Planar ofTwice() const { return {a, S(0.5) * b}; }

  friend Planar operator+(const Planar& p, const Planar& q) { return {p.a + q.a, p.b + q.b}; }
  friend Planar operator*(const S& s, const Planar& p) { return {s * p.a, s * p.b}; }
  static Planar product(const Planar& p, const Planar& q, const S& t) {
    return {p.a * q.a - t * p.b * q.b, p.a * q.b + p.b * q.a};
  }
  static Planar joined(const S&, const S& plane, const S& plane_turned, const S&) { return {plane, plane_turned}; }
  static Planar inverse(const Planar& p, const S& t) {
    const S norm = p.a * p.a + t * p.b * p.b;
    return {p.a / norm, -p.b / norm};
  }
};

/// Doublings that bring σ + iθ with |σ| ≤ 23.03 (the range of the scale) and θ ≤ 8 into the unit disc.
inline constexpr int similarity_doublings = 5;
/// Terms of the series in the unit disc: 1/(n+2)! < eps/4.
template <class S>
inline constexpr std::size_t similarity_terms = is_single_precision<S> ? 10 : 18;

/// True if the series holds without doubling.
template <class S>
inline auto inUnitDisc(const S& sigma, const S& t) {
  return sigma * sigma + t < S(1);
}

/// True if the angle is far enough from zero for the closed forms.
template <class S>
inline auto isFarTurned(const S& t) {
  return S(64) < t;
}

/// 1/k!
inline constexpr auto inverse_factorials = [] {
  std::array<double, 24> f{1};
  for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] / static_cast<double>(k);
  return f;
}();

/// Σ Aᵏ/(k + offset)!, A = σ + x, in the unit disc.
template <class Element, std::size_t offset, class S>
inline Element similaritySeries(const S& sigma, const S& t) {
  constexpr std::size_t last = similarity_terms<S> + offset;
  Element sum = Element::constant(S(inverse_factorials[last]));
  for (std::size_t k = last; k-- > offset;) {
    sum = sum.timesArgument(sigma, t) + Element::constant(S(inverse_factorials[k]));
  }
  return sum;
}

/// φ(A) and ψ(A).
template <class Element>
struct SimilarityIntegrals {
  Element phi, psi;
};

/// Both by doublings, for |σ + iθ| < 32.
template <class Element, class S>
inline SimilarityIntegrals<Element> similarityIntegralsByDoubling(const S& sigma, const S& t) {
  using std::exp;
  constexpr double shrink = 1.0 / (1 << similarity_doublings);
  const Element one = Element::constant(S(1));
  S s = S(shrink) * sigma, u = S(shrink * shrink) * t;
  Element psi = similaritySeries<Element, 2>(s, u);
  Element phi = psi.timesArgument(s, u) + one;
  for (int k = 0; k < similarity_doublings; ++k) {
    const Element e = Element::exponential(S(exp(s)), u);
    psi = (S(0.25) * (Element::product(phi, phi, u) + S(2) * psi)).ofTwice();
    phi = (S(0.5) * Element::product(phi, e + one, u)).ofTwice();
    s *= S(2), u *= S(4);
  }
  return {phi, psi};
}

/// Both on the plane of rotation in closed form: (e^A - 1)/A and (φ(A) - 1)/A, for large angles.
template <class S>
inline SimilarityIntegrals<Planar<S>> planarIntegralsFarTurned(const S& sigma, const S& t) {
  using std::exp;
  const Planar<S> one = Planar<S>::constant(S(1)), by_argument = Planar<S>::inverse({sigma, S(1)}, t);
  const Planar<S> e = Planar<S>::exponential(S(exp(sigma)), t);
  const Planar<S> phi = Planar<S>::product(e + S(-1) * one, by_argument, t);
  return {phi, Planar<S>::product(phi + S(-1) * one, by_argument, t)};
}

/// φ(A) and ψ(A), A = σ + x, from σ and t = θ². The relative error grows with the angle as that of its sine does.
template <class Element, class S>
inline SimilarityIntegrals<Element> similarityIntegrals(const S& sigma, const S& t) {
  return branch(
      inUnitDisc(sigma, t),
      [&] {
        const Element psi = similaritySeries<Element, 2>(sigma, t);
        return SimilarityIntegrals<Element>{psi.timesArgument(sigma, t) + Element::constant(S(1)), psi};
      },
      [&] {
        return branch(
            isFarTurned(t),
            [&] {
              const auto axis = similarityIntegralsByDoubling<Planar<S>>(sigma, S(0));
              const auto plane = planarIntegralsFarTurned(sigma, t);
              return SimilarityIntegrals<Element>{Element::joined(axis.phi.a, plane.phi.a, plane.phi.b, t),
                                                  Element::joined(axis.psi.a, plane.psi.a, plane.psi.b, t)};
            },
            [&] { return similarityIntegralsByDoubling<Element>(sigma, t); });
      });
}

/// A combination of products of [ω] and [υ], of first degree in υ, which they all reduce to by
///   [ω][υ][ω] = -d [ω],  [ω]²[υ] + [υ][ω]² = -t [υ] - d [ω],  d = ω·υ, t = |ω|².
template <class S>
struct CouplingForm {
  S v, wv, vw, wwv, dw, dww;  ///< coefficients of [υ], [ω][υ], [υ][ω], [ω]²[υ], d[ω], d[ω]²

  friend CouplingForm operator+(const CouplingForm& p, const CouplingForm& q) {
    return {p.v + q.v, p.wv + q.wv, p.vw + q.vw, p.wwv + q.wwv, p.dw + q.dw, p.dww + q.dww};
  }
  friend CouplingForm operator*(const S& s, const CouplingForm& p) {
    return {s * p.v, s * p.wv, s * p.vw, s * p.wwv, s * p.dw, s * p.dww};
  }
  /// [ω] p
  CouplingForm fromLeft(const S& t) const { return {S(0), v - t * wwv, S(0), wv, -vw - t * dww, dw}; }
  /// p [ω]
  CouplingForm fromRight(const S& t) const { return {-t * vw, S(0), v, -vw, -wv - vw - t * dww, dw - wwv}; }
  /// q p and p q
  CouplingForm fromLeft(const Axial<S>& q, const S& t) const {
    return q.a * *this + (q.b * *this + q.c * fromLeft(t)).fromLeft(t);
  }
  CouplingForm fromRight(const Axial<S>& q, const S& t) const {
    return q.a * *this + (q.b * *this + q.c * fromRight(t)).fromRight(t);
  }
  Eigen::Matrix<S, 3, 3> matrix(const Eigen::Matrix<S, 3, 1>& omega, const Eigen::Matrix<S, 3, 1>& upsilon) const {
    const S d = omega.dot(upsilon), t = omega.dot(omega);
    const Eigen::Matrix<S, 3, 1> w = omega.cross(upsilon);
    // [ω][υ] = υ ωᵀ - d, [υ][ω] = ω υᵀ - d, [ω]²[υ] = (ω × υ) ωᵀ - d [ω], [ω]² = ω ωᵀ - t.
    Eigen::Matrix<S, 3, 3> m = (wv * upsilon + wwv * w + (dww * d) * omega) * omega.transpose() +
                               (vw * omega) * upsilon.transpose() + skew(v * upsilon + (d * (dw - wwv)) * omega);
    m.diagonal().array() -= d * (wv + vw + dww * t);
    return m;
  }
};

/// The block Q of the left Jacobian of Sim(3) that takes rotations to translations:
/// Σ_n 1/(n+1)! Σ_{i+j=n-1} Aⁱ [υ] [ω]ʲ, A = σ + [ω].
template <class S>
inline CouplingForm<S> similarityCouplingInUnitDisc(const S& sigma, const S& t) {
  const S zero(0);
  // T_{n+1} = A T_n + [υ][ω]ⁿ
  CouplingForm<S> T{S(1), zero, zero, zero, zero, zero}, power = T, sum = S(0.5) * T;
  for (std::size_t n = 2; n <= similarity_terms<S>; ++n) {
    power = power.fromRight(t);
    T = sigma * T + T.fromLeft(t) + power;
    sum = sum + S(inverse_factorials[n + 1]) * T;
  }
  return sum;
}
template <class S>
inline CouplingForm<S> similarityCouplingByDoubling(const S& sigma, const S& t) {
  using std::exp;
  constexpr double shrink = 1.0 / (1 << similarity_doublings);
  const S zero(0);
  S s = S(shrink) * sigma, u = S(shrink * shrink) * t;
  CouplingForm<S> Q = similarityCouplingInUnitDisc(s, u);
  const CouplingForm<S> V{S(1), zero, zero, zero, zero, zero};
  const Axial<S> one = Axial<S>::constant(S(1));
  Axial<S> phi = similaritySeries<Axial<S>, 1>(s, u);
  for (int k = 0; k < similarity_doublings; ++k) {
    // The block of φ(2M) = φ(M)(e^M + 1)/2, M = (A, [υ]; 0, [ω]); that of e^M is φ(A)[υ] + Q[ω].
    const Axial<S> R = Axial<S>::exponential(S(1), u);
    const Axial<S> e = S(exp(s)) * R;
    const CouplingForm<S> corner = V.fromLeft(phi, u) + Q.fromRight(u);
    const CouplingForm<S> twice = S(0.5) * (corner.fromLeft(phi, u) + Q.fromRight(R + one, u));
    // In υ/2, ω/2 up to here.
    Q = {S(0.5) * twice.v,     S(0.25) * twice.wv,  S(0.25) * twice.vw,
         S(0.125) * twice.wwv, S(0.125) * twice.dw, S(0.0625) * twice.dww};
    phi = (S(0.5) * Axial<S>::product(phi, e + one, u)).ofTwice();
    s *= S(2), u *= S(4);
  }
  return Q;
}
/// In closed form, for large angles. Q takes eigenvectors of [ω] to eigenvectors, from the eigenvalue μ to λ, by the
/// divided difference φ[σ + λ, μ] of φ(z) = (e^z - 1)/z: from the axis to the plane, from the plane to the axis, and,
/// along the axis of υ, from the plane to itself. None of their denominators is smaller than θ.
template <class S>
inline CouplingForm<S> similarityCouplingFarTurned(const S& sigma, const S& t) {
  const S scaled = similarityIntegralsByDoubling<Planar<S>>(sigma, S(0)).phi.a;  // φ(σ)
  const Planar<S> turned = planarIntegralsFarTurned(S(0), t).phi;                // φ(iθ)
  const Planar<S> by_argument = Planar<S>::inverse({sigma, S(1)}, t);            // 1/(σ + iθ)
  const Planar<S> to_plane = planarIntegralsFarTurned(sigma, t).psi;
  const Planar<S> to_axis =
      Planar<S>::product({scaled - turned.a, -turned.b}, Planar<S>::inverse({sigma, S(-1)}, t), t);
  const Planar<S> along = Planar<S>::product(Planar<S>::exponential(scaled, t) + S(-1) * turned, by_argument, t);
  const S wwv = (to_axis.a - to_plane.a) / t;
  return {
      to_axis.a, to_plane.b, to_axis.b, wwv, (along.a - to_axis.a) / t + wwv, (along.b - to_plane.b - to_axis.b) / t};
}
template <class S>
inline CouplingForm<S> similarityCoupling(const S& sigma, const S& t) {
  return branch(
      inUnitDisc(sigma, t), [&] { return similarityCouplingInUnitDisc(sigma, t); },
      [&] {
        return branch(
            isFarTurned(t), [&] { return similarityCouplingFarTurned(sigma, t); },
            [&] { return similarityCouplingByDoubling(sigma, t); });
      });
}

}  // namespace liestat::detail
