// Preintegration: the readings of an inertial sensor between two times as one relative motion with its covariance and
// its derivatives with respect to the biases, free of gravity and of the state at the start.
//
//   liestat::Preintegration<double> motion({.noise = {.gyroscope = 1.7e-4, .accelerometer = 2e-3}});
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
// G1, G2 and their derivatives have no small-angle shortcuts. Derivation of the integrals:
// docs/theory/visual_inertial.md, section 2; C. Forster et al., "On-manifold preintegration", IEEE T-RO 33, 2017.
#pragma once

#include <fusion/detail/increment_covariance.hpp>
#include <fusion/detail/step_matrices.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/se23.hpp>
#include <stats/gaussian.hpp>

#include <cstddef>

namespace liestat {

/// The noise and the biases that a preintegration assumes.
template <class S>
struct PreintegrationOptions {
  ImuNoise<S> noise = {};
  ImuBias<S> bias = {};  ///< taken off every reading
};

/// An increment that grows with every reading, with its covariance and its derivatives by the biases; no allocation.
template <class S>
class Preintegration {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Matrix9 = Eigen::Matrix<S, 9, 9>;
  using Matrix96 = Eigen::Matrix<S, 9, 6>;
  using Matrix15 = Eigen::Matrix<S, 15, 15>;

  /// An increment of no duration.
  explicit Preintegration(const PreintegrationOptions<S>& options = {})
      : options_(options), has_walk_(options.noise.gyroscope_walk > S(0) || options.noise.accelerometer_walk > S(0)) {}

  /// Adds a step of h > 0 seconds with constant rate (rad/s) and force (m/s²) in the body's axes, as measured.
  void add(const S& h, const Vector3& angular_rate, const Vector3& specific_force) {
    const Columns R = Columns::of(increment_.so3().matrix());
    const Vector3 rotation = h * (angular_rate - options_.bias.gyroscope);
    // All that follows in the axes of the start.
    const Vector3 theta = R * rotation, force = R * Vector3(specific_force - options_.bias.accelerometer);
    const detail::StepCoefficients<S> k(theta.dot(theta));
    const Vector3 w = theta.cross(force), ww = theta.cross(w);
    const Vector3 velocity = h * (force + k.b * w + k.c * ww);
    const Vector3 position = (h * h) * (S(0.5) * force + k.c * w + k.d * ww);
    advance(h, R, rotation, position, velocity, detail::StepMatrices<S>(theta, force), k);
  }

  /// The same over a step within which rate and force vary: the mean force, for the covariance, and what they do: the
  /// rotation vector (rad), and position (m) and velocity (m/s) gained, in the body's axes at the start of the step,
  /// without the biases.
  void addVarying(const S& h, const Vector3& specific_force, const Vector3& rotation, const Vector3& position,
                  const Vector3& velocity) {
    const Columns R = Columns::of(increment_.so3().matrix());
    const detail::StepMatrices<S> step(R * rotation, R * Vector3(specific_force - options_.bias.accelerometer));
    advance(h, R, rotation, R * position, R * velocity, step, detail::StepCoefficients<S>(step.squaredAngle()));
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
    const auto by = [](const Columns& J, const Vector& change) {
      return Vector(J.matrix().template cast<T>() * change);
    };
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

  /// The increment with its 9×9 covariance, in the library's tangent: right, (position, rotation, velocity). For the
  /// biases at the start: their random walk since then is in it, their uncertainty there is not.
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
    J << back * bias_.pg.matrix(), back * bias_.pa.matrix(), back * SO3<S>::leftJacobian(turn) * bias_.rg.matrix(),
        Matrix3::Zero(), back * bias_.vg.matrix(), back * bias_.va.matrix();
    return J;
  }
  /// The covariance of additive errors in the axes of the start, order (rotation, velocity, position), the rotation's
  /// on the right: the form in which most of the literature writes it.
  Matrix9 additiveCovariance() const {
    const Matrix9 sigma = covariance_.assembled(Matrix3(Matrix3::Identity()));
    Matrix9 T = Matrix9::Zero();
    T.template block<3, 3>(0, 3) = increment_.so3().matrix().transpose();
    T.template block<3, 3>(3, 6) = T.template block<3, 3>(6, 0) = Matrix3::Identity();
    return detail::congruence(T, sigma);
  }

  /// The increment's covariance with that of the biases at the end, 15×15, order (position, rotation, velocity,
  /// gyroscope, accelerometer): what their random walk since the start adds. A tangent of
  /// `Product<SE23<S>, Vector3, Vector3>`.
  Matrix15 covarianceWithBias() const {
    const Matrix3 T = increment_.so3().matrix().transpose();
    Matrix15 m = Matrix15::Zero();
    m.template topLeftCorner<9, 9>() = covariance_.assembled(T);
    m.template block<9, 6>(0, 9) << T * walk_.pg.matrix(), T * walk_.pa.matrix(), T * walk_.rg.matrix(),
        Matrix3::Zero(), T * walk_.vg.matrix(), T * walk_.va.matrix();
    m.template block<6, 9>(9, 0) = m.template block<9, 6>(0, 9).transpose();
    m.diagonal().template segment<3>(9).array() = gyroscopeWalk(duration_);
    m.diagonal().template tail<3>().array() = accelerometerWalk(duration_);
    return m;
  }

  /// This interval and the one that follows it as one; exact, also for covariance and Jacobians. Both must have been
  /// made with the same options.
  Preintegration operator*(const Preintegration& next) const {
    Preintegration all(*this);
    const SO3<S> rotation = increment_.so3();
    const Columns R = Columns::of(rotation.matrix());
    const Vector3 u = R * Vector3(next.increment_.translation()), w = R * Vector3(next.increment_.velocity());
    all.duration_ += next.duration_;
    all.increment_ = SE23<S>(rotation * SO3<S>(next.increment_.so3()),
                             Vector3(increment_.translation() + next.duration_ * increment_.velocity() + u),
                             Vector3(increment_.velocity() + w));
    all.carry(next.duration_, Columns::skew(u), Columns::skew(w));
    const auto turned = [&R](const Columns& block) { return (R * block).timesTransposed(R); };
    const Covariance& n = next.covariance_;
    Covariance& c = all.covariance_;
    c.pp += turned(n.pp), c.pr += turned(n.pr), c.pv += turned(n.pv);
    c.rr += turned(n.rr), c.vr += turned(n.vr), c.vv += turned(n.vv);
    // The drift of the biases since the start acts on the second interval as a whole.
    const BiasBlocks response{R * next.bias_.pg, R * next.bias_.pa, R * next.bias_.rg, R * next.bias_.vg,
                              R * next.bias_.va};
    if (has_walk_) {
      all.drift(response, duration_);
      all.walk_ += {R * next.walk_.pg, R * next.walk_.pa, R * next.walk_.rg, R * next.walk_.vg, R * next.walk_.va};
    }
    all.bias_ += response;
    return all;
  }

 private:
  using Columns = detail::Columns<S>;
  using BiasBlocks = detail::BiasBlocks<S>;
  using Covariance = detail::IncrementCovariance<S>;

  /// Variance of a bias that has walked for t seconds.
  S gyroscopeWalk(const S& t) const { return options_.noise.gyroscope_walk * options_.noise.gyroscope_walk * t; }
  S accelerometerWalk(const S& t) const {
    return options_.noise.accelerometer_walk * options_.noise.accelerometer_walk * t;
  }

  /// Covariance and Jacobian over a step of h seconds with gains u of position (U = [u]) and w of velocity, in the axes
  /// of the start, without noise.
  void carry(const S& h, const Columns& U, const Columns& W) {
    covariance_.carry(h, U, W);
    bias_.carry(h, U, W);
    if (has_walk_) walk_.carry(h, U, W);
  }

  /// Adds what biases that have walked for t seconds do through a response J to them.
  void drift(const BiasBlocks& J, const S& t) {
    BiasBlocks now = walk_;
    now += J.scaled(gyroscopeWalk(t), accelerometerWalk(t));
    covariance_.drift(walk_, now, J);
    walk_ = now;
  }

  /// A step by its rotation vector in the body's axes at its start and its gains in those of the start of the interval.
  void advance(const S& h, const Columns& R, const Vector3& rotation, const Vector3& position, const Vector3& velocity,
               const detail::StepMatrices<S>& step, const detail::StepCoefficients<S>& k) {
    carry(h, Columns::skew(position), Columns::skew(velocity));

    // Errors of rate and force within the step move the increment by h [h² D2; G1; h D1] and h [h G2; 0; G1].
    const Columns G1 = step.polynomial(S(1), k.b, k.c), G2 = step.polynomial(S(0.5), k.c, k.d);
    const Columns D1 = step.slope(k.b, k.c, k.b_slope, k.c_slope) * h;
    const Columns D2 = step.slope(k.c, k.d, k.c_slope, k.d_slope) * (h * h);
    const Columns minus = R * S(-h), turn = G1 * minus;
    const BiasBlocks response{D2 * minus, (G2 * minus) * h, turn, D1 * minus, turn};
    if (has_walk_) drift(response, duration_);
    bias_ += response;

    // White noise has the same variance along all axes, so R cancels from its covariance, and so do products of
    // polynomials in [θ], by [θ]³ = -|θ|² [θ].
    const S t = step.squaredAngle();
    const S gyroscope = options_.noise.gyroscope * options_.noise.gyroscope * h;
    const S accelerometer = options_.noise.accelerometer * options_.noise.accelerometer * h;
    const Columns turned = step.polynomial(S(1), S(0), S(2) * k.c - k.b * k.b - k.c * k.c * t);  // G1 G1ᵀ
    const S bend = k.c * k.c - k.b * k.d;
    const Columns slid =  // G2 G1ᵀ
        step.polynomial(S(0.5), k.c - S(0.5) * k.b - t * bend, k.d + S(0.5) * k.c - k.b * k.c - t * k.c * k.d);
    const Columns E1 = D1 * gyroscope, E2 = D2 * gyroscope;
    Covariance& c = covariance_;
    c.pp.addProductTransposed(E2, D2);
    c.pp += step.polynomial(S(0.25), S(0), k.d - k.c * k.c - k.d * k.d * t) * (accelerometer * h * h);  // G2 G2ᵀ
    c.pr.addProductTransposed(E2, G1);
    c.pv.addProductTransposed(E2, D1);
    c.pv += slid * (accelerometer * h);
    c.rr += turned * gyroscope;
    c.vr.addProductTransposed(E1, G1);
    c.vv.addProductTransposed(E1, D1);
    c.vv += turned * accelerometer;

    increment_.translation() += h * Vector3(increment_.velocity()) + position;
    increment_.velocity() += velocity;
    increment_.so3() *= SO3<S>::exp(rotation);
    duration_ += h;
  }

  PreintegrationOptions<S> options_;
  bool has_walk_ = false;
  S duration_ = S(0);
  SE23<S> increment_;
  Covariance covariance_;
  BiasBlocks bias_, walk_;
};

}  // namespace liestat
