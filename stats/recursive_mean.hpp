// RecursiveMean: mean and covariance of a stream of features, one at a time, in fixed memory and without allocation.
//
// For Metric manifolds it follows the Fréchet mean of stats/mean.hpp, for groups without a metric (SE2, SE3 …) the
// exponential barycentre of stats/group_mean.hpp. Each feature takes one Newton step on gradient and Hessian of all
// features so far, which are then carried to the new mean to second order (docs/theory/means.md, section 5.6). How far
// it is from the mean of the same features in one batch is measured in docs/recursive_mean.md. Needs Eigen alone.
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/status.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace liestat {

/// Options of RecursiveMean.
struct RecursiveMeanOptions {
  /// Factor in (0, 1] by which each new feature multiplies the weights of all earlier ones: with 1 none is forgotten,
  /// with less than 1 the last 1/(1 - forgetting) or so determine the mean.
  double forgetting = 1;
};

namespace detail {

/// Derivatives of the error vector that RecursiveMean needs: those of ½ d² where there is a metric, those of the group's
/// logarithm else.
template <class M>
struct RecursiveGeometry {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  using Vector = TangentOf<M>;
  using Square = SquareOf<M>;
  static constexpr int k = T::DoF;

  static Vector metric() {
    if constexpr (Metric<M>) {
      return T::metricWeights();
    } else {
      return Vector::Ones();
    }
  }
  /// Minus the derivative of metric·log(y, x) with respect to y: the Hessian of ½ d², or the group's J_l⁻¹.
  static Square hessian(const Vector& z) {
    if constexpr (Metric<M>) {
      return T::hessianHalfSquaredDistance(z);
    } else {
      return M::leftJacobianInverse(z);
    }
  }
  static Vector solve(const Square& hessian, const Vector& gradient) {
    if constexpr (Metric<M>) {
      return Cholesky<S, k>(hessian).template solve<1>(gradient);
    } else {
      return product(detail::inverse<S, k>(hessian), gradient);
    }
  }
  static Square inverse(const Square& hessian) {
    if constexpr (Metric<M>) {
      return Cholesky<S, k>(hessian).inverse();
    } else {
      return detail::inverse<S, k>(hessian);
    }
  }
  static S largestStep() {
    if constexpr (Metric<M>) {
      return T::injectivityRadius();
    } else {
      return std::numeric_limits<S>::infinity();
    }
  }
};

/// The mixed second derivative of z = log(y, x) for x and y ← exp(y, ω) at x = y: z becomes z - ω + turn(ω) z, up to
/// ω² and z². In a frame that is carried along by the group it is minus half the bracket, or minus the whole.
template <class M>
class FrameTurn {
  using G = RecursiveGeometry<M>;
  using S = ScalarOf<M>;

 public:
  FrameTurn() {
    if constexpr (Metric<M>) {
      using T = ManifoldTraits<M>;
      using std::cbrt;
      // Central differences of an analytic function: within 1e-9 of the constants in double, far less than what is
      // neglected with z².
      const S h = cbrt(std::numeric_limits<S>::epsilon());
      for (int j = 0; j < G::k; ++j) {
        const TangentOf<M> e = h * TangentOf<M>::Unit(j);
        const M plus = T::expOrigin(e), minus = T::expOrigin(-e);
        by_z_[static_cast<std::size_t>(j)] = (logBaseJacobian(plus, SquareOf<M>(T::dlogOrigin(plus))) -
                                              logBaseJacobian(minus, SquareOf<M>(T::dlogOrigin(minus)))) *
                                             (S(0.5) / h);
      }
    }
  }
  SquareOf<M> operator()(const TangentOf<M>& omega) const {
    SquareOf<M> turn;
    if constexpr (Metric<M>) {
      for (int j = 0; j < G::k; ++j) turn.col(j) = product(by_z_[static_cast<std::size_t>(j)], omega);
    } else {
      turn = S(-0.5) * M::ad(omega);
    }
    return turn;
  }

 private:
  struct None {};
  using Derivatives = std::array<SquareOf<M>, static_cast<std::size_t>(G::k)>;
  [[no_unique_address]] std::conditional_t<Metric<M>, Derivatives, None> by_z_;
};

}  // namespace detail

/// Mean and covariance of a stream of features; see the header comment. M is a Metric manifold or a Lie group. Matrices
/// are in the local frame at the mean, in M's tangent order; they are zero before the first feature.
template <class M>
  requires(Metric<M> || (Homogeneous<M> && LieGroup<M>))
class RecursiveMean {
  using T = ManifoldTraits<M>;
  using G = detail::RecursiveGeometry<M>;

 public:
  using Scalar = ScalarOf<M>;
  using Tangent = TangentOf<M>;
  using Square = SquareOf<M>;

  explicit RecursiveMean(const RecursiveMeanOptions& options = {}) : options_(options) {
    eigen_assert(options.forgetting > 0 && options.forgetting <= 1);
  }

  /// Forgets as much as the options say, then takes in a feature, or a value that stands for one (a view, an
  /// Eigen::Quaternion for SO3). Weights are relative and inversely proportional to variances, as those of mean().
  /// Returns false, and changes nothing, if the feature or the weight is not finite or the weight is not positive.
  template <class V>
    requires std::is_same_v<PointOf<V>, M>
  bool add(const V& value, Scalar weight = Scalar(1)) {
    const M x = PointTraits<std::remove_cvref_t<V>>::from(value);
    const Tangent metric = G::metric();
    if (!(weight > Scalar(0)) || !(weight <= std::numeric_limits<Scalar>::max())) return false;
    if (n_ == 0) {
      if (!T::logOrigin(x).allFinite()) return false;
      mean_ = x;
      hessian_ = weight * G::hessian(Tangent::Zero());
      count(weight);
      return true;
    }
    const Tangent z = log(mean_, x);
    if (!z.allFinite()) return false;
    forget(options_.forgetting);

    // Newton's step, or that of the report's eq. (4) where it is none.
    const Tangent gradient = gradient_ + weight * metric.cwiseProduct(z);
    Tangent step = G::solve(Square(hessian_ + weight * G::hessian(z)), gradient);
    if (!step.allFinite() || !(step.dot(metric.cwiseProduct(step)) < G::largestStep() * G::largestStep())) {
      step = gradient.cwiseQuotient(metric) / (sum_of_weights_ + weight);
    }
    const M next = exp(mean_, step);
    carry(next, step, metric);
    mean_ = next;

    const Tangent rest = log(mean_, x);
    gradient_ += weight * metric.cwiseProduct(rest);
    hessian_ += weight * G::hessian(rest);
    scatter_ += weight * rest * rest.transpose();
    count(weight);
    return true;
  }

  /// Multiplies the weights of all features so far by a factor in (0, 1], for instance exp(-Δt/τ) before a feature that
  /// arrives after an interval Δt. Mean and dispersion stay, the covariance grows.
  void forget(double factor) {
    eigen_assert(factor > 0 && factor <= 1);
    const Scalar f = Scalar(factor);
    count_ *= f;
    sum_of_weights_ *= f;
    squared_ *= f * f;
    gradient_ *= f;
    hessian_ *= f;
    scatter_ *= f;
  }

  /// Starts again without features.
  void reset() { *this = RecursiveMean(options_); }

  /// The mean; the origin before the first feature.
  const M& mean() const { return mean_; }
  /// too_few before the first feature, not_converged where the Hessian is not positive definite or not finite, else ok.
  Status status() const {
    if (n_ == 0) return Status::too_few;
    return G::inverse(hessian_).allFinite() ? Status::ok : Status::not_converged;
  }
  /// Features taken in.
  std::size_t n() const { return n_; }
  Scalar sum_of_weights() const { return sum_of_weights_; }
  /// The number of equally weighted features, none forgotten, whose mean has the same covariance. n() without
  /// forgetting; it tends to (1 + λ)/(1 - λ) with the factor λ.
  Scalar effective_n() const { return n_ == 0 ? Scalar(0) : count_ * sum_of_weights_ / squared_; }
  /// Σ p_i Hess ½d²(·, x_i) at the mean; of groups without a metric Σ p_i J_l⁻¹(z_i).
  const Square& hessian() const { return hessian_; }
  /// Σ p_i z_i z_iᵀ.
  const Square& scatter() const { return scatter_; }
  /// Σ p_i z_i z_iᵀ / Σ p_i, the dispersion of the features about their mean.
  Square dispersion() const { return scatter_ / sum_of_weights_; }
  /// Intrinsic norm (rad, m) of the step that is left to the stationary point of what is carried along; an estimate of
  /// how far the mean is from that of a batch.
  Scalar residual() const {
    using std::sqrt;
    if (n_ == 0) return Scalar(0);
    const Tangent step = G::solve(hessian_, gradient_);
    return sqrt(step.dot(G::metric().cwiseProduct(step)));
  }

  /// Covariance of the mean from the residuals, as covarianceFromResiduals() of a batch (ResidualNoise::scaled), to
  /// which it reduces if nothing is forgotten: independent noise with covariance Σ/p_i, one unknown Σ. It is the
  /// uncertainty of the weighted average of features about one truth, and does not include what a truth that moves has
  /// moved in the meantime. NaN for fewer than two features, and where all but one are forgotten.
  Square covarianceFromResiduals() const {
    const Scalar degrees = count_ - squared_ / sum_of_weights_;
    // Rounding leaves a difference of the order of epsilon where only the last feature counts.
    if (n_ < 2 || !(degrees > Scalar(16) * std::numeric_limits<Scalar>::epsilon() * count_)) {
      return Square::Constant(std::numeric_limits<Scalar>::quiet_NaN());
    }
    return covarianceFromCommonNoise(Square(scatter_ / degrees));
  }
  /// Covariance of the mean if a feature of weight one has noise of covariance V (local frame), one of weight p V/p.
  Square covarianceFromCommonNoise(const Square& V) const {
    const Square gain = G::inverse(hessian_) * G::metric().asDiagonal();
    return detail::congruence(gain, Square(squared_ * V));
  }

 private:
  void count(Scalar weight) {
    ++n_;
    count_ += Scalar(1);
    sum_of_weights_ += weight;
    squared_ += weight;
  }

  /// The sums of the features so far, from the frame at the mean to that at exp(mean, step): z becomes E (z - step), E
  /// the exponential of the frame's turn, and the Hessian grows by that of the step, for the sum of the z is that of the
  /// gradient.
  void carry(const M& next, const Tangent& step, const Tangent& metric) {
    const Square turn = turn_(step), square = detail::product(turn, turn);
    const Square even = Square::Identity() + Scalar(0.5) * square + detail::product(square, square) / Scalar(24);
    const Square odd = turn + detail::product(turn, square) / Scalar(6);
    Square forward = even + odd, backward = even - odd;
    if constexpr (!detail::HasTrivialIsotropy<M>) {
      const Square transport = frameTransport(mean_, next);
      forward = detail::product(transport, forward);
      backward = detail::productTransposed(backward, transport);
    }
    const Tangent sum = gradient_.cwiseQuotient(metric);
    for (int j = 0; j < T::DoF; ++j) {
      for (int i = 0; i < T::DoF; ++i) {
        scatter_(i, j) += sum_of_weights_ * step[i] * step[j] - sum[i] * step[j] - step[i] * sum[j];
      }
    }
    scatter_ = detail::congruence(forward, scatter_);
    gradient_ -= detail::product(hessian_, step);
    const Square growth = G::hessian(Tangent(-step)) - G::hessian(Tangent::Zero());
    hessian_ += sum_of_weights_ * growth;
    if constexpr (Metric<M>) {
      const Square transposed = backward.transpose();
      hessian_ = detail::congruence(transposed, hessian_);
      gradient_ = detail::product(transposed, gradient_);
    } else {
      hessian_ = detail::product(detail::product(forward, hessian_), backward);
    }
  }

  RecursiveMeanOptions options_;
  detail::FrameTurn<M> turn_;
  M mean_ = T::origin();
  std::size_t n_ = 0;
  /// Σ f_i, Σ f_i p_i and Σ f_i² p_i of the factors f_i that forgetting left and the weights p_i.
  Scalar count_ = Scalar(0), sum_of_weights_ = Scalar(0), squared_ = Scalar(0);
  Tangent gradient_ = Tangent::Zero();  // Σ p_i metric·z_i, what Newton's steps have left of it
  Square hessian_ = Square::Zero(), scatter_ = Square::Zero();
};

}  // namespace liestat
