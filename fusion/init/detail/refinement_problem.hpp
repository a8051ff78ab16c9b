// The posterior of a window as a function of states, gravity, biases and features, for the refinement.
#pragma once

#include <fusion/init/detail/bearing_rows.hpp>
#include <fusion/init/detail/reduced_system.hpp>
#include <fusion/init/results.hpp>
#include <fusion/imu/factor.hpp>
#include <fusion/imu/window.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Which of the two biases walk within a window.
struct WalkingBiases {
  bool gyroscope = false, accelerometer = false;

  explicit WalkingBiases(const std::vector<Preintegration<double>>& motions) {
    if (motions.empty()) return;
    double seconds = 0;
    for (const Preintegration<double>& motion : motions) seconds += motion.duration();
    const ImuNoise<double>& noise = motions.front().options().noise;
    // Below a millionth of what white noise hides of it, a walk is none to sixteen digits.
    gyroscope = noise.gyroscope_walk * seconds > 1e-6 * noise.gyroscope;
    accelerometer = noise.accelerometer_walk * seconds > 1e-6 * noise.accelerometer;
  }
  bool any() const { return gyroscope || accelerometer; }
};

/// The rows of a motion between two images: the residual's covariance, whitened.
struct MotionWeight {
  Eigen::Matrix<double, 9, 9> root;  ///< lower triangular, rootᵀ root = covariance⁻¹
  /// Regression of the residual on the biases' walk to the end of the motion: E(residual | walk) = by_walk · walk.
  Eigen::Matrix<double, 9, 6> by_walk = Eigen::Matrix<double, 9, 6>::Zero();
  double gyroscope_walk = 0, accelerometer_walk = 0;  ///< standard deviations; 0: it does not walk

  /// The same with the walk of the biases given by unknowns at both ends. False as in set().
  bool set(const Preintegration<double>& motion, const WalkingBiases& walks, double factor) {
    Eigen::Matrix<double, 9, 9> covariance = motion.gaussian().covariance;
    if (walks.any()) {
      const Eigen::Matrix<double, 15, 15> all = motion.covarianceWithBias();
      for (int k = 0; k < 6; ++k) {
        if (k < 3 ? walks.gyroscope : walks.accelerometer)
          by_walk.col(k) = all.block<9, 1>(0, 9 + k) / all(9 + k, 9 + k);
      }
      if (walks.gyroscope) gyroscope_walk = std::sqrt(all(9, 9));
      if (walks.accelerometer) accelerometer_walk = std::sqrt(all(12, 12));
      covariance -= product(by_walk, Eigen::Matrix<double, 6, 9>(all.block<6, 9>(9, 0)));
    }
    return set(covariance, factor);
  }

  /// False where the covariance is not positive definite.
  bool set(const Eigen::Matrix<double, 9, 9>& covariance, double factor) {
    Eigen::Matrix<double, 9, 9> L = Eigen::Matrix<double, 9, 9>::Zero();
    root.setZero();
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j <= i; ++j) {
        double sum = covariance(i, j);
        for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
        if (i == j && (!(sum > 0) || !std::isfinite(sum))) return false;
        L(i, j) = i == j ? std::sqrt(sum) : sum / L(j, j);
      }
    }
    for (int c = 0; c < 9; ++c) {
      for (int i = c; i < 9; ++i) {
        double sum = i == c ? 1 / factor : 0;
        for (int k = c; k < i; ++k) sum -= L(i, k) * root(k, c);
        root(i, c) = sum / L(i, i);
      }
    }
    return true;
  }
  /// root times a matrix of nine rows, from its column on.
  template <class Matrix>
  Eigen::Matrix<double, 9, 3> times(const Matrix& J, int column) const {
    Eigen::Matrix<double, 9, 3> result = Eigen::Matrix<double, 9, 3>::Zero();
    for (int k = 0; k < 9; ++k) {
      for (int i = k; i < 9; ++i) {
        for (int c = 0; c < 3; ++c) result(i, c) += root(i, k) * J(k, column + c);
      }
    }
    return result;
  }
};

/// The posterior as a function of states, G, biases and features. Where a bias walks, what it has walked to at each image
/// is an unknown beside the bias at the first: so steps of a bias are damped alike however little it walks. Blocks: v of
/// the first image; v and the walks of each of the others in turn; (p, φ) of each of these; G, b_g, b_a: what only
/// motions tie to other unknowns is eliminated while rows are sparse.
class RefinementProblem {
 public:
  struct State {
    std::vector<SE23d> X;
    Eigen::Vector3d gravity;
    std::vector<ImuBias<double>> bias;  ///< at each image
    std::vector<Eigen::Vector3d> P;
  };

  RefinementProblem(const InertialWindow& window, const InitialisationOptions& options)
      : window_(window), options_(options), walks_(window.motions()) {}

  /// The body stays where it is: so much may its velocity and its position be off.
  void holdStill() { still_ = true; }
  static constexpr double still_speed = 1e-5, still_position = 1e-6;  ///< m/s, m
  /// χ² of the readings' velocities and displacements alone, of which there are six for each motion, rotations aside.
  double inertialCost() const {
    double cost = 0;
    for (std::size_t k = 0; k < window_.motions().size(); ++k) {
      const Preintegration<double>& motion = window_.motions()[k];
      const Eigen::Matrix<double, 9, 1> all =
          preintegrationError<double>(motion, state_.X[k], state_.X[k + 1], state_.bias[k], state_.gravity);
      const Eigen::Matrix<double, 9, 9> covariance = motion.gaussian().covariance;
      Eigen::Matrix<double, 6, 1> r;
      r << all.head<3>(), all.tail<3>();
      Eigen::Matrix<double, 6, 6> C;
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) C(i, j) = covariance(i + (i > 2 ? 3 : 0), j + (j > 2 ? 3 : 0));
      }
      const Cholesky<double, 6> factor(C);
      if (!factor.ok()) return std::numeric_limits<double>::infinity();
      cost += factor.template halfSolve<1>(r).squaredNorm();
    }
    return cost / (options_.inertial_noise_factor * options_.inertial_noise_factor);
  }

  /// False where a motion has no covariance.
  bool setWeights() {
    for (const Preintegration<double>& motion : window_.motions()) {
      weights_.emplace_back();
      if (!weights_.back().set(motion, walks_, options_.inertial_noise_factor)) return false;
    }
    return true;
  }
  /// Starts at a solution, or at the states and biases of a former result for the same images; features that are not in
  /// front of all their cameras are left out.
  void start(const ClosedFormSolution& s, const ImuBias<double>& bias, const RefinementResult* former) {
    state_.bias.assign(window_.size(), bias);
    state_.gravity = s.gravity;
    if (options_.gravity) state_.gravity *= *options_.gravity / s.gravity.norm();
    if (former != nullptr && former->states.size() == window_.size()) {
      state_.X = former->states;
      for (std::size_t j = 1; j < state_.bias.size(); ++j) {
        const double part = static_cast<double>(j) / static_cast<double>(state_.bias.size() - 1);
        if (walks_.gyroscope) {
          state_.bias[j].gyroscope += part * (former->last_bias.gyroscope - former->bias.gyroscope);
        }
        if (walks_.accelerometer) {
          state_.bias[j].accelerometer += part * (former->last_bias.accelerometer - former->bias.accelerometer);
        }
      }
    } else {
      startFromReadings(s, bias);
    }
    for (std::size_t i = 0; i < window_.features.size() && i < s.features.size(); ++i) {
      const FeatureTrack& track = window_.features[i];
      const auto isBehind = [&](const TrackedBearing& seen) {
        return !(bearingInBody(window_.cameras, seen).dot(inCamera(state_.X[seen.image], s.features[i], lever(seen))) >
                 0);
      };
      if (track.size() < 2 || !s.features[i].allFinite() || std::any_of(track.begin(), track.end(), isBehind)) continue;
      for (const TrackedBearing& seen : track) observations_.emplace_back(window_, seen, state_.P.size());
      state_.P.push_back(s.features[i]);
      feature_.push_back(i);
    }
  }

  const State& state() const { return state_; }
  const std::vector<std::size_t>& features() const { return feature_; }
  std::size_t observations() const { return observations_.size(); }
  int blocks() const { return gravityBlock() + 3; }
  int gravityBlock() const { return poseBlocks() + 2 * moved(); }
  int gyroscopeBlock() const { return gravityBlock() + 1; }
  int accelerometerBlock() const { return gravityBlock() + 2; }
  /// The block of a part of a state: 0 position, 1 rotation, 2 velocity. The first state has the velocity alone.
  int stateBlock(std::size_t j, int part) const {
    const int image = static_cast<int>(j);
    if (part == 2) return image == 0 ? 0 : 1 + blocksAhead() * (image - 1);
    return poseBlocks() + 2 * (image - 1) + part;
  }
  /// The blocks of what the biases have walked to at an image but the first.
  int gyroscopeWalkBlock(std::size_t j) const { return stateBlock(j, 2) + 1; }
  int accelerometerWalkBlock(std::size_t j) const { return stateBlock(j, 2) + 1 + walks_.gyroscope; }
  const WalkingBiases& walks() const { return walks_; }

  double linearise(ReducedSystem& system) {
    system.clear();
    return run(state_, &system);
  }
  double costAfter(const ReducedSystem& system) {
    next_ = state_;
    next_.X[0].velocity() += system.shared(stateBlock(0, 2));
    for (std::size_t j = 1; j < next_.X.size(); ++j) {
      Eigen::Matrix<double, 9, 1> step;
      step << system.shared(stateBlock(j, 0)), system.shared(stateBlock(j, 1)), system.shared(stateBlock(j, 2));
      if (!step.allFinite()) return std::numeric_limits<double>::infinity();
      next_.X[j] *= SE23d::exp(step);
    }
    takeStep(system, gravityBlock(), options_.gravity, next_.gravity, next_.P);
    for (std::size_t j = 0; j < next_.bias.size(); ++j) {
      next_.bias[j].gyroscope += system.shared(gyroscopeBlock());
      next_.bias[j].accelerometer += system.shared(accelerometerBlock());
      if (j > 0 && walks_.gyroscope) next_.bias[j].gyroscope += system.shared(gyroscopeWalkBlock(j));
      if (j > 0 && walks_.accelerometer) next_.bias[j].accelerometer += system.shared(accelerometerWalkBlock(j));
    }
    return run(next_, nullptr);
  }
  void accept() { std::swap(state_, next_); }

 private:
  /// The states that velocity, gravity and readings predict.
  void startFromReadings(const ClosedFormSolution& s, const ImuBias<double>& bias) {
    for (const BiasedImage& b : biasedImages(window_.motions(), bias)) {
      const double t = b.image.time;
      state_.X.emplace_back(SO3d(b.image.rotation),
                            Eigen::Vector3d(t * s.velocity + (0.5 * t * t) * state_.gravity + b.image.displacement),
                            Eigen::Vector3d(s.velocity + t * state_.gravity + b.speed));
    }
  }
  /// Images but the first.
  int moved() const { return static_cast<int>(state_.X.size()) - 1; }
  /// Blocks of each moved image that precede all poses.
  int blocksAhead() const { return 1 + walks_.gyroscope + walks_.accelerometer; }
  int poseBlocks() const { return 1 + blocksAhead() * moved(); }
  Eigen::Vector3d lever(const TrackedBearing& seen) const { return window_.cameras[seen.camera].translation(); }
  /// From a camera to a feature, in the body's axes.
  static Eigen::Vector3d inCamera(const SE23d& X, const Eigen::Vector3d& P, const Eigen::Vector3d& lever) {
    return X.so3().inverse() * Eigen::Vector3d(P - X.translation()) - lever;
  }

  double run(const State& state, ReducedSystem* system) const {
    double cost = 0;
    for (std::size_t k = 0; k < window_.motions().size(); ++k) cost += addMotion(state, k, system);
    const BiasPrior& prior = options_.prior;
    const ImuBias<double>& bias = state.bias.front();
    cost += addPrior(bias.gyroscope - prior.mean.gyroscope, prior.gyroscope_sigma, gyroscopeBlock(), system);
    cost += addPrior(bias.accelerometer - prior.mean.accelerometer, prior.accelerometer_sigma, accelerometerBlock(),
                     system);
    if (system && options_.gravity) holdLength(state.gravity, gravityBlock(), *system);
    if (still_) cost += addStillness(state, system);
    Eigen::Matrix<double, 2, 3> by_d;
    std::size_t image = state.X.size();
    Eigen::Matrix3d back = Eigen::Matrix3d::Identity();  // rotation into the body's axes at the last image seen
    for (const BearingObservation& seen : observations_) {
      if (seen.image != image) {
        image = seen.image;
        back = state.X[image].so3().matrix().transpose();
      }
      const Eigen::Vector3d b = back * (state.P[seen.feature] - state.X[image].translation());
      ResidualRows rows(2);
      if (!bearingResidual(b - seen.lever, seen, options_.bearing_noise, rows, by_d)) {
        return std::numeric_limits<double>::infinity();
      }
      cost += rows.squared();
      if (!system) continue;
      if (image > 0) {
        // X Exp(δ): the point moves by -δp + b × δφ in the body.
        rows.add(stateBlock(image, 0), Eigen::Matrix<double, 2, 3>(-by_d));
        rows.add(stateBlock(image, 1), Eigen::Matrix<double, 2, 3>(by_d * skew(b)));
      }
      system->add(rows, seen.feature, Eigen::Matrix<double, 2, 3>(by_d * back));
    }
    return cost;
  }

  double addMotion(const State& state, std::size_t k, ReducedSystem* system) const {
    const SE23d &from = state.X[k], &to = state.X[k + 1];
    const MotionWeight& weight = weights_[k];
    ResidualRows rows(9);
    const auto set = [&](const Eigen::Matrix<double, 9, 1>& value) {
      for (int i = 0; i < 9; ++i) {
        double sum = 0;
        for (int j = 0; j <= i; ++j) sum += weight.root(i, j) * value[j];
        rows.value[static_cast<std::size_t>(i)] = sum;
      }
      return rows.squared();
    };
    const ImuBias<double>&bias = state.bias[k], &end = state.bias[k + 1];
    Eigen::Matrix<double, 6, 1> walk;
    walk << end.gyroscope - bias.gyroscope, end.accelerometer - bias.accelerometer;
    double cost = 0;
    if (walks_.gyroscope) {
      cost += addWalk(walk.head<3>(), weight.gyroscope_walk, k, &RefinementProblem::gyroscopeWalkBlock, system);
    }
    if (walks_.accelerometer) {
      cost += addWalk(walk.tail<3>(), weight.accelerometer_walk, k, &RefinementProblem::accelerometerWalkBlock, system);
    }
    const auto expected = [&] { return Eigen::Matrix<double, 9, 1>(weight.by_walk * walk); };
    if (!system) {
      return cost + set(preintegrationError<double>(window_.motions()[k], from, to, bias, state.gravity) - expected());
    }
    PreintegrationResidual<double> r =
        preintegrationResidual<double>(window_.motions()[k], from, to, bias, state.gravity);
    cost += set(r.value - expected());
    for (int c = k == 0 ? 2 : 0; c < 3; ++c) rows.add(stateBlock(k, c), weight.times(r.by_first, 3 * c));
    for (int c = 0; c < 3; ++c) rows.add(stateBlock(k + 1, c), weight.times(r.by_second, 3 * c));
    rows.add(gravityBlock(), weight.times(r.by_gravity, 0));
    rows.add(gyroscopeBlock(), weight.times(r.by_bias, 0));
    rows.add(accelerometerBlock(), weight.times(r.by_bias, 3));
    if (walks_.any()) {
      const Eigen::Matrix<double, 9, 6> by_first = r.by_bias + weight.by_walk, by_second = -weight.by_walk;
      if (k > 0 && walks_.gyroscope) rows.add(gyroscopeWalkBlock(k), weight.times(by_first, 0));
      if (k > 0 && walks_.accelerometer) rows.add(accelerometerWalkBlock(k), weight.times(by_first, 3));
      if (walks_.gyroscope) rows.add(gyroscopeWalkBlock(k + 1), weight.times(by_second, 0));
      if (walks_.accelerometer) rows.add(accelerometerWalkBlock(k + 1), weight.times(by_second, 3));
    }
    system->add(rows);
    return cost;
  }

  double addStillness(const State& state, ReducedSystem* system) const {
    double cost = addPrior(state.X[0].velocity(), still_speed, stateBlock(0, 2), system);
    for (std::size_t j = 1; j < state.X.size(); ++j) {
      // In the body's axes, in which the steps are.
      const SO3d back = SO3d(state.X[j].so3()).inverse();
      cost += addPrior(back * Eigen::Vector3d(state.X[j].velocity()), still_speed, stateBlock(j, 2), system);
      cost += addPrior(back * Eigen::Vector3d(state.X[j].translation()), still_position, stateBlock(j, 0), system);
    }
    return cost;
  }

  /// The rows of a bias that walks from image k to the next.
  double addWalk(const Eigen::Vector3d& walk, double sigma, std::size_t k,
                 int (RefinementProblem::*block)(std::size_t) const, ReducedSystem* system) const {
    ResidualRows rows(3);
    for (int i = 0; i < 3; ++i) rows.value[static_cast<std::size_t>(i)] = walk[i] / sigma;
    if (!system) return rows.squared();
    const Eigen::Matrix3d by = Eigen::Matrix3d::Identity() / sigma;
    if (k > 0) rows.add((this->*block)(k), Eigen::Matrix3d(-by));
    rows.add((this->*block)(k + 1), by);
    system->add(rows);
    return rows.squared();
  }

  const InertialWindow& window_;
  const InitialisationOptions& options_;
  WalkingBiases walks_;
  bool still_ = false;
  State state_, next_;
  std::vector<MotionWeight> weights_;
  std::vector<BearingObservation> observations_;
  std::vector<std::size_t> feature_;
};

}  // namespace liestat::detail
