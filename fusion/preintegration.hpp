// Preintegration: the readings of an inertial sensor between two times as one relative motion with its covariance and
// its derivatives with respect to the biases, free of gravity and of the state at the start.
//
//   liestat::Preintegration<double> motion({.noise = {1.7e-4, 2e-3}});
//   for (…) motion.add(h, angular_rate, specific_force);
//
// With R, p, v the orientation, position and velocity in a world where gravity is g, over t seconds:
//   R_j = R_i ΔR,  v_j = v_i + g t + R_i Δv,  p_j = p_i + v_i t + g t²/2 + R_i Δp.
// The increment (ΔR, Δp, Δv) is an element of SE_2(3), and its covariance, in the library's right tangent (position,
// rotation, velocity), makes it a Gaussian<SE23>.
//
// A step of h seconds takes X = (ΔR, Δp, Δv) to Φ_h(X) Υ: Φ_h(X) = (ΔR, Δp + h Δv, Δv) is an automorphism of SE_2(3),
// and Υ = (Exp θ, G2 f h², G1 f h), θ = ω h, is what a constant rate ω and force f do in the body's axes, exactly. So
// errors obey ξ ← Ad(Υ⁻¹) F ξ, F the derivative of Φ_h: linear for errors of any size (Barrau and Bonnabel 2017;
// Brossard et al. 2022). Turned to the axes of the start, ξ̃ = ΔR ξ, the rotation cancels from that matrix,
//   p̃ ← p̃ - [u] φ̃ + h ṽ,   φ̃ ← φ̃,   ṽ ← ṽ - [w] φ̃,   u = ΔR G2 f h²,   w = ΔR G1 f h,
// and a covariance is carried over a step by a dozen cross products in place of products of 9×9 matrices.
//
// G1, G2 and their derivatives have no small-angle shortcuts. Source of the integrals: the design note on
// visual-inertial initialisation, section 2; C. Forster et al., "On-manifold preintegration", IEEE T-RO 33, 2017.
#pragma once

#include <fusion/imu.hpp>
#include <lie/se23.hpp>
#include <stats/gaussian.hpp>

#include <cstddef>

namespace liestat {

/// What a preintegration assumes.
template <class S>
struct PreintegrationOptions {
  ImuNoise<S> noise = {};
  ImuBias<S> bias = {};  ///< taken off every reading
};

namespace detail {

/// 2 d/dt of Σ (-1)^k t^k/(2k + offset - 2)!, the slopes of (1 - cos θ)/θ² (offset 4) and of its integrals.
template <int offset>
inline constexpr auto slope_series = factorialSeries<14>(offset, [](int k) { return -2 * (k + 1); });
inline constexpr auto beta2_series = factorialSeries<14>(2, [](int) { return 1; });

/// Coefficients of a step by the angle t = θ²: b = (1 - cos θ)/θ², c = (θ - sin θ)/θ³, d = (θ²/2 - 1 + cos θ)/θ⁴, and
/// their derivatives by θ over θ.
template <class S>
struct StepCoefficients {
  S b, c, d, b_slope, c_slope, d_slope;

  explicit StepCoefficients(const S& t) {
    // The rates of a vehicle turn by hundredths of a radian in a sample: five terms are exact for a quarter.
    if (t < S(0.0625)) {
      evaluate<6>(t);
    } else {
      evaluate<14>(t);
    }
  }

 private:
  template <std::size_t terms>
  void evaluate(const S& t) {
    b = evaluatePolynomial<terms>(beta2_series, t);
    c = evaluatePolynomial<terms>(beta3_series, t);
    d = evaluatePolynomial<terms>(beta4_series, t);
    b_slope = evaluatePolynomial<terms>(slope_series<4>, t);
    c_slope = evaluatePolynomial<terms>(slope_series<5>, t);
    d_slope = evaluatePolynomial<terms>(slope_series<6>, t);
  }
};

/// ∂(k0 a + k1 θ×a + k2 θ×(θ×a))/∂θ for coefficients k1, k2 that are functions of |θ|, with slopes q1, q2 (derivative
/// over |θ|).
template <class S>
Eigen::Matrix<S, 3, 3> integralSlope(const Eigen::Matrix<S, 3, 1>& theta, const Eigen::Matrix<S, 3, 1>& a, const S& k1,
                                     const S& k2, const S& q1, const S& q2) {
  const Eigen::Matrix<S, 3, 1> w = theta.cross(a), ww = theta.cross(w);
  Eigen::Matrix<S, 3, 3> D =
      (q1 * w + q2 * ww - (S(2) * k2) * a) * theta.transpose() + (k2 * theta) * a.transpose() - skew(k1 * a);
  // d/dθ of θ×(θ×a) = θ (θ·a) - a |θ|² is (θ·a) I + θ aᵀ - 2 a θᵀ.
  D.diagonal().array() += k2 * theta.dot(a);
  return D;
}

}  // namespace detail

/// An increment that grows with every reading, with its covariance and its derivatives by the biases; no allocation.
template <class S>
class Preintegration {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Matrix9 = Eigen::Matrix<S, 9, 9>;
  using Matrix96 = Eigen::Matrix<S, 9, 6>;

  /// An increment of no duration.
  explicit Preintegration(const PreintegrationOptions<S>& options = {}) : options_(options) {}

  /// Adds a step of h > 0 seconds with constant rate (rad/s) and force (m/s²) in the body's axes, as measured.
  void add(const S& h, const Vector3& angular_rate, const Vector3& specific_force) {
    const Vector3 theta = h * (angular_rate - options_.bias.gyroscope);
    const Vector3 force = specific_force - options_.bias.accelerometer;
    const detail::StepCoefficients<S> k(theta.dot(theta));
    const Vector3 w = theta.cross(force), ww = theta.cross(w);
    const Vector3 velocity = h * (force + k.b * w + k.c * ww);
    const Vector3 position = (h * h) * (S(0.5) * force + k.c * w + k.d * ww);
    advance(h, theta, position, velocity, force, k);
  }

  /// The same over a step within which rate and force vary: their means, for the covariance, and what they do: the
  /// rotation vector (rad), and position (m) and velocity (m/s) gained, in the body's axes at the start of the step.
  void addVarying(const S& h, const Vector3& angular_rate, const Vector3& specific_force, const Vector3& rotation,
                  const Vector3& position, const Vector3& velocity) {
    const Vector3 theta = h * (angular_rate - options_.bias.gyroscope);
    advance(h, rotation, position, velocity, specific_force - options_.bias.accelerometer,
            detail::StepCoefficients<S>(theta.dot(theta)));
  }

  /// Seconds.
  const S& duration() const { return duration_; }
  const PreintegrationOptions<S>& options() const { return options_; }
  /// (ΔR, Δp, Δv).
  const SE23<S>& increment() const { return increment_; }
  /// The same for other biases, to first order in their change. Over 0.2 s at 1.5 rad/s and 3 m/s² a change of the
  /// gyroscope's by 0.01 rad/s costs 3e-7 rad and 1e-6 m/s; mustReintegrate says when that is too much.
  template <class T = S>
  SE23<T> increment(const ImuBias<T>& bias) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Vector g = bias.gyroscope - options_.bias.gyroscope.template cast<T>();
    const Vector a = bias.accelerometer - options_.bias.accelerometer.template cast<T>();
    const auto by = [](const Matrix3& J, const Vector& change) { return Vector(J.template cast<T>() * change); };
    const SE23<T> increment = increment_.template cast<T>();
    return SE23<T>(SO3<T>::exp(by(bias_.rg, g)) * SO3<T>(increment.so3()),
                   Vector(increment.translation() + by(bias_.pg, g) + by(bias_.pa, a)),
                   Vector(increment.velocity() + by(bias_.vg, g) + by(bias_.va, a)));
  }
  /// Whether other biases are so far that the readings should be integrated anew: a change of the gyroscope's by more
  /// than 0.05 rad/s, or by more than 0.05 rad over the duration.
  bool mustReintegrate(const ImuBias<S>& bias) const {
    const S change = (bias.gyroscope - options_.bias.gyroscope).norm();
    return !(change <= S(0.05) && change * duration_ <= S(0.05));
  }

  /// The increment with its 9×9 covariance, in the library's tangent: right, (position, rotation, velocity).
  Gaussian<SE23<S>> gaussian() const {
    const Matrix3 R = increment_.so3().matrix();
    return {increment_, covariance_.assembled(Matrix3(R.transpose()))};
  }
  /// ∂increment/∂(gyroscope's bias, accelerometer's bias), 9×6, in that tangent.
  Matrix96 biasJacobian() const { return biasJacobian(options_.bias); }
  /// The same at other biases, of increment(bias); exact for that function.
  Matrix96 biasJacobian(const ImuBias<S>& bias) const {
    const Vector3 turn = bias_.rg * (bias.gyroscope - options_.bias.gyroscope);
    const Matrix3 back = increment(bias).so3().matrix().transpose();
    // Exp(φ + d) R = Exp(φ) R Exp(R⁻¹ J_r(φ) d), and increment(bias) is turned by Exp(φ).
    Matrix96 J;
    J << back * bias_.pg, back * bias_.pa, back * SO3<S>::leftJacobian(turn) * bias_.rg, Matrix3::Zero(),
        back * bias_.vg, back * bias_.va;
    return J;
  }
  /// The covariance of additive errors in the axes of the start, order (rotation, velocity, position), the rotation's
  /// on the right: the form in which most of the literature writes it.
  Matrix9 additiveCovariance() const {
    const Matrix9 sigma = covariance_.assembled(Matrix3(Matrix3::Identity()));
    Matrix9 T = Matrix9::Zero();
    T.template block<3, 3>(0, 3) = increment_.so3().matrix().transpose();
    T.template block<3, 3>(3, 6) = T.template block<3, 3>(6, 0) = Matrix3::Identity();
    return T * sigma * T.transpose();
  }

  /// This interval and the one that follows it as one; exact, also for covariance and Jacobians. Both must have been
  /// made with the same options.
  Preintegration operator*(const Preintegration& next) const {
    Preintegration all(options_);
    const SO3<S> R = increment_.so3();
    const Matrix3 turn = R.matrix();
    const Vector3 u = R * Vector3(next.increment_.translation()), w = R * Vector3(next.increment_.velocity());
    all.duration_ = duration_ + next.duration_;
    all.increment_ = SE23<S>(R * SO3<S>(next.increment_.so3()),
                             Vector3(increment_.translation() + next.duration_ * increment_.velocity() + u),
                             Vector3(increment_.velocity() + w));
    all.covariance_ = covariance_;
    all.bias_ = bias_;
    all.carry(next.duration_, u, w);
    const auto add = [&turn](Matrix3& sum, const Matrix3& block) { sum += turn * block * turn.transpose(); };
    const Covariance& n = next.covariance_;
    Covariance& c = all.covariance_;
    add(c.pp, n.pp), add(c.rp, n.rp), add(c.vp, n.vp), add(c.rr, n.rr), add(c.vr, n.vr), add(c.vv, n.vv);
    all.bias_.pg += turn * next.bias_.pg, all.bias_.pa += turn * next.bias_.pa, all.bias_.rg += turn * next.bias_.rg;
    all.bias_.vg += turn * next.bias_.vg, all.bias_.va += turn * next.bias_.va;
    return all;
  }

 private:
  /// The blocks on and below the diagonal, of position, rotation and velocity, in the axes of the start. Each by itself
  /// in memory: a block of a larger matrix is read in other pieces than it was written in, which costs a wait.
  struct Covariance {
    Matrix3 pp = Matrix3::Zero(), rp = Matrix3::Zero(), vp = Matrix3::Zero();
    Matrix3 rr = Matrix3::Zero(), vr = Matrix3::Zero(), vv = Matrix3::Zero();

    /// The 9×9 matrix, each block between T and Tᵀ.
    Matrix9 assembled(const Matrix3& T) const {
      const auto turned = [&T](const Matrix3& block) { return Matrix3(T * block * T.transpose()); };
      Matrix9 m = Matrix9::Zero();
      m << turned(pp), Matrix3::Zero(), Matrix3::Zero(), turned(rp), turned(rr), Matrix3::Zero(), turned(vp),
          turned(vr), turned(vv);
      // Symmetric to the last bit.
      for (int j = 0; j < 9; ++j) {
        for (int i = 0; i < j; ++i) m(i, j) = m(j, i);
      }
      return m;
    }
  };
  /// Derivatives by the biases of gyroscope and accelerometer, in the axes of the start; the rotation does not feel the
  /// accelerometer.
  struct BiasJacobian {
    Matrix3 pg = Matrix3::Zero(), pa = Matrix3::Zero(), rg = Matrix3::Zero();
    Matrix3 vg = Matrix3::Zero(), va = Matrix3::Zero();
  };

  /// Covariance and Jacobian over a step of h seconds with gains u of position and w of velocity, in the axes of the
  /// start, without noise.
  void carry(const S& h, const Vector3& u, const Vector3& w) {
    Covariance& c = covariance_;
    const Matrix3 U = detail::skew(u), W = detail::skew(w);
    // p' = p - [u] r + h v first, then v' = v - [w] r.
    const Matrix3 vr_t = c.vr.transpose();
    const Matrix3 rp = c.rp + c.rr * U + h * vr_t;
    const Matrix3 vp = c.vp + c.vr * U + h * c.vv;
    c.pp += h * (c.vp + vp.transpose()) - U * c.rp - (U * rp).transpose();
    c.rp = rp;
    c.vp = vp - W * rp;
    const Matrix3 vr = c.vr - W * c.rr;
    c.vv -= W * vr_t + (W * vr.transpose()).transpose();
    c.vr = vr;

    bias_.pg += h * bias_.vg - U * bias_.rg;
    bias_.pa += h * bias_.va;
    bias_.vg -= W * bias_.rg;
  }

  /// A step whose gains are given in the body's axes at its start.
  void advance(const S& h, const Vector3& rotation, const Vector3& position, const Vector3& velocity,
               const Vector3& force, const detail::StepCoefficients<S>& k) {
    const Matrix3 R = increment_.so3().matrix();
    const Vector3 u = R * position, w = R * velocity;
    carry(h, u, w);

    // What an error of rate and force does within the step: dR [D2 h³; G1 h; D1 h²] and dR [G2 h²; 0; G1 h].
    const Matrix3 G1 = detail::rotationPolynomial(rotation, S(1), k.b, k.c);
    const Matrix3 G2 = detail::rotationPolynomial(rotation, S(0.5), k.c, k.d);
    const Matrix3 turn = h * (R * G1);
    const Matrix3 slide = (h * h) * (R * G2);
    const Matrix3 speed = (h * h) * (R * detail::integralSlope<S>(rotation, force, k.b, k.c, k.b_slope, k.c_slope));
    const Matrix3 drift = (h * h * h) * (R * detail::integralSlope<S>(rotation, force, k.c, k.d, k.c_slope, k.d_slope));
    bias_.pg -= drift;
    bias_.pa -= slide;
    bias_.rg -= turn;
    bias_.vg -= speed;
    bias_.va -= turn;

    const S gyroscope = options_.noise.gyroscope * options_.noise.gyroscope / h;
    const S accelerometer = options_.noise.accelerometer * options_.noise.accelerometer / h;
    const Matrix3 turn_t = turn.transpose(), square = turn * turn_t;
    covariance_.pp += gyroscope * (drift * drift.transpose()) + accelerometer * (slide * slide.transpose());
    covariance_.rp += gyroscope * (turn * drift.transpose());
    covariance_.vp += gyroscope * (speed * drift.transpose()) + accelerometer * (turn * slide.transpose());
    covariance_.rr += gyroscope * square;
    covariance_.vr += gyroscope * (speed * turn_t);
    covariance_.vv += gyroscope * (speed * speed.transpose()) + accelerometer * square;

    increment_.translation() += h * Vector3(increment_.velocity()) + u;
    increment_.velocity() += w;
    increment_.so3() *= SO3<S>::exp(rotation);
    duration_ += h;
  }

  PreintegrationOptions<S> options_;
  S duration_ = S(0);
  SE23<S> increment_;
  Covariance covariance_;
  BiasJacobian bias_;
};

}  // namespace liestat
