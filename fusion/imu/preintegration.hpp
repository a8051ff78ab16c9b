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

#include <fusion/imu/detail/increment_covariance.hpp>
#include <fusion/imu/detail/step_matrices.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/detail/always_inline.hpp>
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
  /// Readings per second (Hz) of the sensor, which with the densities gives the variance of a reading: density²·rate,
  /// however long the step is that it is used for. Not positive: add() takes a reading for the mean over its step, and
  /// preintegrate() measures the rate, see readingRate().
  S rate = S(0);
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
    add(h, angular_rate, specific_force, noiseTime(h));
  }
  /// The same with the variance of the noise integrated over the step as density² times noise_time (s): h for white
  /// noise over the step, rate·h² for a reading that is held longer or shorter than the sensor's period.
  void add(const S& h, const Vector3& angular_rate, const Vector3& specific_force, const S& noise_time) {
    const Matrix3 R = increment_.so3().matrix();
    const Vector3 rotation = h * (angular_rate - options_.bias.gyroscope);
    const Vector3 force = specific_force - options_.bias.accelerometer;
    // All that follows in the axes of the start.
    const detail::StepVectors<S> step(R * rotation, R * force);
    const detail::StepCoefficients<S> k(rotation.squaredNorm());
    const Vector3 velocity = h * (step.force + k.b * step.once + k.c * step.twice);
    const Vector3 position = (h * h) * (S(0.5) * step.force + k.c * step.once + k.d * step.twice);
    advance(h, R, rotation, force, position, velocity, step, k, noise_time);
  }

  /// The same over a step within which rate and force vary: the mean force, for the covariance, and what they do: the
  /// rotation vector (rad), and position (m) and velocity (m/s) gained, in the body's axes at the start of the step,
  /// without the biases.
  void addVarying(const S& h, const Vector3& specific_force, const Vector3& rotation, const Vector3& position,
                  const Vector3& velocity) {
    addVarying(h, specific_force, rotation, position, velocity, noiseTime(h));
  }
  void addVarying(const S& h, const Vector3& specific_force, const Vector3& rotation, const Vector3& position,
                  const Vector3& velocity, const S& noise_time) {
    const Matrix3 R = increment_.so3().matrix();
    const Vector3 force = specific_force - options_.bias.accelerometer;
    const detail::StepVectors<S> step(R * rotation, R * force);
    advance(h, R, rotation, force, R * position, R * velocity, step,
            detail::StepCoefficients<S>(rotation.squaredNorm()), noise_time);
  }

  /// Adds an error of the increment so far to its covariance: one standard deviation of position (m), rotation (rad)
  /// and velocity (m/s), along the one direction of all nine, in the axes of the start.
  void addError(const Vector3& position, const Vector3& rotation, const Vector3& velocity) {
    const auto p = Columns::column(position), v = Columns::column(velocity), r = Columns::column(rotation);
    covariance_.pp.addOuter(p, position);
    covariance_.pr.addOuter(p, rotation);
    covariance_.pv.addOuter(p, velocity);
    covariance_.rr.addOuter(r, rotation);
    covariance_.vr.addOuter(v, rotation);
    covariance_.vv.addOuter(v, velocity);
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
    const auto by = [](const Columns& transposed, const Vector& change) {
      return Vector(transposed.matrix().transpose().template cast<T>() * change);
    };
    const SE23<T> increment = increment_.template cast<T>();
    return SE23<T>(SO3<T>::exp(by(bias_.gr, g)) * SO3<T>(increment.so3()),
                   Vector(increment.translation() + by(bias_.gp, g) + by(bias_.ap, a)),
                   Vector(increment.velocity() + by(bias_.gv, g) + by(bias_.av, a)));
  }
  /// True if other biases are so far that the readings should be integrated anew: a change of the gyroscope's by more
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
    const Vector3 turn = bias_.gr.matrix().transpose() * (bias.gyroscope - options_.bias.gyroscope);
    const Matrix3 back = increment(bias).so3().matrix().transpose();
    // Exp(φ + d) R = Exp(φ) R Exp(R⁻¹ J_r(φ) d), and increment(bias) is turned by Exp(φ).
    Matrix96 J;
    J << back * bias_.gp.matrix().transpose(), back * bias_.ap.matrix().transpose(),
        back * SO3<S>::leftJacobian(turn) * bias_.gr.matrix().transpose(), Matrix3::Zero(),
        back * bias_.gv.matrix().transpose(), back * bias_.av.matrix().transpose();
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
    m.template block<9, 6>(0, 9) << T * walk_.gp.matrix().transpose(), T * walk_.ap.matrix().transpose(),
        T * walk_.gr.matrix().transpose(), Matrix3::Zero(), T * walk_.gv.matrix().transpose(),
        T * walk_.av.matrix().transpose();
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
    all.carry(next.duration_, u, w);
    const auto turned = [&R](const Columns& block) { return (R * block).timesTransposed(R); };
    const Covariance& n = next.covariance_;
    Covariance& c = all.covariance_;
    c.pp += turned(n.pp), c.pr += turned(n.pr), c.pv += turned(n.pv);
    c.rr += turned(n.rr), c.vr += turned(n.vr), c.vv += turned(n.vv);
    // The drift of the biases since the start acts on the second interval as a whole.
    const auto carried = [&R](const BiasBlocks& b) {
      return BiasBlocks{b.gp.timesTransposed(R), b.ap.timesTransposed(R), b.gr.timesTransposed(R),
                        b.gv.timesTransposed(R), b.av.timesTransposed(R)};
    };
    const BiasBlocks response = carried(next.bias_);
    if (has_walk_) {
      all.drift(response, duration_);
      all.walk_ += carried(next.walk_);
    }
    all.bias_ += response;
    return all;
  }

 private:
  using Columns = detail::Columns<S>;
  using BiasBlocks = detail::BiasBlocks<S>;
  using Covariance = detail::IncrementCovariance<S>;

  /// Seconds of white noise over a step of h seconds.
  S noiseTime(const S& h) const { return options_.rate > S(0) ? options_.rate * h * h : h; }
  /// Variance of a bias that has walked for t seconds.
  S gyroscopeWalk(const S& t) const { return options_.noise.gyroscope_walk * options_.noise.gyroscope_walk * t; }
  S accelerometerWalk(const S& t) const {
    return options_.noise.accelerometer_walk * options_.noise.accelerometer_walk * t;
  }

  /// Covariance and Jacobian over a step of h seconds with gains u of position and w of velocity, in the axes of the
  /// start, without noise.
  void carry(const S& h, const Vector3& u, const Vector3& w) {
    covariance_.carry(h, u, w);
    bias_.carry(h, u, w);
    if (has_walk_) walk_.carry(h, u, w);
  }

  /// Adds what biases that have walked for t seconds do through a response J to them. Few sensors are given a walk, so
  /// that its registers are not those of a step.
  LIESTAT_NO_INLINE void drift(const BiasBlocks& J, const S& t) {
    BiasBlocks now = walk_;
    now += J.scaled(gyroscopeWalk(t), accelerometerWalk(t));
    covariance_.drift(walk_, now, J);
    walk_ = now;
  }

  /// A step by its rotation vector and its force in the body's axes at its start, whose orientation is R, and its gains in
  /// the axes of the start of the interval.
  void advance(const S& h, const Matrix3& R, const Vector3& rotation, const Vector3& force, const Vector3& position,
               const Vector3& velocity, const detail::StepVectors<S>& step, const detail::StepCoefficients<S>& k,
               const S& noise_time) {
    // First what the next reading waits for: a processor looks ahead by less than a reading's instructions.
    increment_.translation() += h * Vector3(increment_.velocity()) + position;
    increment_.velocity() += velocity;
    increment_.so3() *= SO3<S>::exp(rotation);
    carry(h, position, velocity);
    const BiasBlocks response = readingResponse(h, R, rotation, force, step, k);
    if (has_walk_) drift(response.scaled(-h, -h), duration_);
    bias_.gp.addScaled(response.gp, -h);
    bias_.ap.addScaled(response.ap, -h);
    bias_.gr.addScaled(response.gr, -h);
    bias_.gv.addScaled(response.gv, -h);
    bias_.av.addScaled(response.av, -h);

    // Over a step white noise is an error of the reading with this variance over h², the same along all axes, so that R
    // cancels from its covariance. So do products of polynomials in K, by K³ = -|θ|² K.
    const S gyroscope = options_.noise.gyroscope * options_.noise.gyroscope * noise_time;
    const S accelerometer = options_.noise.accelerometer * options_.noise.accelerometer * noise_time;
    const S& t = step.squared_angle;
    const S turned = S(2) * k.c - k.b * k.b - k.c * k.c * t;  // G1 G1ᵀ = I + turned K²
    const S bend = k.c * k.c - k.b * k.d;
    const Columns pg = response.gp.transposed() * gyroscope, vg = response.gv.transposed() * gyroscope;
    Covariance& c = covariance_;
    c.pp.addProduct(pg, response.gp);
    // G2 G2ᵀ, and the position that the reading does not know: it is the force's mean, and where in the step the force
    // acted is as unknown as white noise leaves it. That adds h²/12 to h²/4, as of noise integrated twice.
    const S p = accelerometer * h * h;
    step.addSymmetric(c.pp, S(1. / 3) * p, (k.d - k.c * k.c - k.d * k.d * t) * p);
    c.pr.addProduct(pg, response.gr);
    c.pv.addProduct(pg, response.gv);
    const S v = accelerometer * h;  // G2 G1ᵀ
    step.addPolynomial(c.pv, S(0.5) * v, (k.c - S(0.5) * k.b - t * bend) * v,
                       (k.d + S(0.5) * k.c - k.b * k.c - t * k.c * k.d) * v);
    step.addSymmetric(c.rr, gyroscope, turned * gyroscope);
    c.vr.addProduct(vg, response.gr);
    c.vv.addProduct(vg, response.gv);
    step.addSymmetric(c.vv, accelerometer, turned * accelerometer);
    duration_ += h;
  }

  /// The effect of errors of the rate and of the force during a step, over its seconds: [h² D2 R; G1 R; h D1 R] and
  /// [h G2 R; 0; G1 R], transposed, with G1 = I + b K + c K² and G2 = I/2 + c K + d K², K = [θ], and D1, D2 the derivatives
  /// of G1 f and G2 f by θ. All of them are made of Rᵀ and its products with skew matrices, for Rᵀ θ and Rᵀ f are what is
  /// measured.
  static EIGEN_ALWAYS_INLINE BiasBlocks readingResponse(const S& h, const Matrix3& R, const Vector3& rotation,
                                                        const Vector3& force, const detail::StepVectors<S>& step,
                                                        const detail::StepCoefficients<S>& k) {
    const Columns T = Columns::of(Matrix3(R.transpose()));
    const Columns once = T.timesSkew(step.phi), twice = once.timesSkew(step.phi), across = T.timesSkew(step.force);
    const auto theta = Columns::column(rotation), pulled = Columns::column(force);
    // Rᵀ Dᵀ with D = s θᵀ + k2 θ fᵀ - k1 [f] + k2 (θ·f) I, s = q1 θ×f + q2 θ×(θ×f) - 2 k2 f: the derivative of
    // k1 θ×f + k2 θ×(θ×f) whose coefficients have the slopes q1 and q2 (derivative over |θ|).
    const auto slope = [&](const S& k1, const S& k2, const S& q1, const S& q2) {
      Columns m = detail::outer<S>(theta, Vector3(q1 * step.once + q2 * step.twice - (S(2) * k2) * step.force));
      m.addOuter(pulled, Vector3(k2 * step.phi));
      m.addScaled(across, k1);
      m.addScaled(T, k2 * step.along);
      return m;
    };
    BiasBlocks J;
    J.gr = T;
    J.gr.addScaled(once, -k.b);
    J.gr.addScaled(twice, k.c);
    J.av = J.gr;
    J.ap = T * (S(0.5) * h);
    J.ap.addScaled(once, -h * k.c);
    J.ap.addScaled(twice, h * k.d);
    J.gv = slope(h * k.b, h * k.c, h * k.b_slope, h * k.c_slope);
    const S hh = h * h;
    J.gp = slope(hh * k.c, hh * k.d, hh * k.c_slope, hh * k.d_slope);
    return J;
  }

  PreintegrationOptions<S> options_;
  bool has_walk_ = false;
  S duration_ = S(0);
  SE23<S> increment_;
  Covariance covariance_;
  BiasBlocks bias_, walk_;
};

}  // namespace liestat
