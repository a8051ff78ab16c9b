// Increments, covariances and bias Jacobians against differences and Monte Carlo; schemes against analytic motion; bad
// recordings.

#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/factor.hpp>

#include <stats/maha.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using Vector3 = Eigen::Vector3d;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

struct Steps {
  std::vector<double> h;
  std::vector<Vector3> rate, force;

  Preintegration<double> run(const PreintegrationOptions<double>& options, std::size_t begin, std::size_t end) const {
    Preintegration<double> motion(options);
    for (std::size_t i = begin; i < end; ++i) motion.add(h[i], rate[i], force[i]);
    return motion;
  }
  Preintegration<double> run(const PreintegrationOptions<double>& options) const { return run(options, 0, h.size()); }
};

/// Irregular steps of a body that turns at some 2 rad/s.
Steps someSteps(std::size_t n) {
  std::mt19937 generator(3);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  Steps steps;
  for (std::size_t i = 0; i < n; ++i) {
    steps.h.push_back(0.005 * (1.5 + draw()));
    steps.rate.push_back(2 * Vector3(draw(), draw(), draw()));
    steps.force.push_back(Vector3(draw(), draw(), 9 + draw()));
  }
  return steps;
}

const PreintegrationOptions<double> some_options{.noise = {.gyroscope = 1.7e-3, .accelerometer = 2e-2},
                                                 .bias = {Vector3(0.01, 0.02, -0.01), Vector3(0.1, -0.2, 0.05)}};

Vector9 difference(const SE23d& from, const SE23d& to) { return (from.inverse() * to).log(); }

TEST(Preintegration, AConstantRateAndForceAreIntegratedExactly) {
  // One step is a thousand, at every angle of the step.
  for (const double angle : {1e-9, 1e-3, 0.24, 0.26, 1.0, 3.0}) {
    const Vector3 rate = angle * Vector3(1, -2, 2) / 3, force(1, 2, 9);
    Preintegration<double> one, many;
    one.add(1, rate, force);
    for (int i = 0; i < 1000; ++i) many.add(0.001, rate, force);
    EXPECT_LE(difference(one.increment(), many.increment()).norm(), 1e-11) << angle;
    EXPECT_NEAR(one.duration(), many.duration(), 1e-12);
  }
  // Free fall without rotation: a parabola.
  Preintegration<double> fall;
  fall.add(2, Vector3::Zero(), Vector3(0, 0, 3));
  EXPECT_EQ(fall.increment().translation(), Vector3(0, 0, 6));
  EXPECT_EQ(fall.increment().velocity(), Vector3(0, 0, 6));
}

TEST(Preintegration, BiasJacobianAgreesWithDifferences) {
  const Steps steps = someSteps(40);
  const auto motion = steps.run(some_options);
  const double e = 1e-5;
  const auto analytic = motion.biasJacobian();
  for (int k = 0; k < 6; ++k) {
    auto plus = some_options, minus = some_options;
    (k < 3 ? plus.bias.gyroscope[k] : plus.bias.accelerometer[k - 3]) += e;
    (k < 3 ? minus.bias.gyroscope[k] : minus.bias.accelerometer[k - 3]) -= e;
    const Vector9 numeric = (difference(motion.increment(), steps.run(plus).increment()) -
                             difference(motion.increment(), steps.run(minus).increment())) /
                            (2 * e);
    // e² and eps/e are both some 1e-10.
    EXPECT_LE((numeric - analytic.col(k)).norm(), 1e-9) << "bias " << k;
  }
}

// The noise of each reading by itself, carried to the end by differences of the whole chain.
TEST(Preintegration, CovarianceIsTheSumOverTheReadings) {
  const Steps steps = someSteps(30);
  const auto motion = steps.run(some_options);
  const double e = 1e-5;
  Matrix9 sum = Matrix9::Zero();
  for (std::size_t i = 0; i < steps.h.size(); ++i) {
    for (int k = 0; k < 6; ++k) {
      Steps plus = steps, minus = steps;
      (k < 3 ? plus.rate[i][k] : plus.force[i][k - 3]) += e;
      (k < 3 ? minus.rate[i][k] : minus.force[i][k - 3]) -= e;
      const Vector9 column = (difference(motion.increment(), plus.run(some_options).increment()) -
                              difference(motion.increment(), minus.run(some_options).increment())) /
                             (2 * e);
      const double density = k < 3 ? some_options.noise.gyroscope : some_options.noise.accelerometer;
      sum += density * density / steps.h[i] * column * column.transpose();
    }
    // The position within the step, which the mean force leaves open.
    const double h = steps.h[i], density = some_options.noise.accelerometer;
    sum.topLeftCorner<3, 3>() += density * density * h * h * h / 12 * Eigen::Matrix3d::Identity();
  }
  const Matrix9 covariance = motion.gaussian().covariance;
  EXPECT_LE((covariance - sum).norm(), 1e-8 * sum.norm());
  EXPECT_EQ(covariance, covariance.transpose());
}

PreintegrationOptions<double> withWalk() {
  PreintegrationOptions<double> options = some_options;
  options.noise.gyroscope_walk = 3e-3;
  options.noise.accelerometer_walk = 4e-2;
  return options;
}

// A step of the walk shifts all readings that follow it, and the bias at the end.
TEST(Preintegration, BiasWalksAreTheSumOverTheirSteps) {
  const Steps steps = someSteps(30);
  const auto options = withWalk();
  const auto motion = steps.run(options);
  const double e = 1e-5;
  using Matrix15 = Eigen::Matrix<double, 15, 15>;
  Matrix15 sum = Matrix15::Zero();
  sum.topLeftCorner<9, 9>() = steps.run(some_options).gaussian().covariance;
  for (std::size_t i = 0; i < steps.h.size(); ++i) {
    for (int k = 0; k < 6; ++k) {
      Steps plus = steps, minus = steps;
      for (std::size_t j = i + 1; j < steps.h.size(); ++j) {
        // A bias that grew means that the truth was less than what was measured.
        (k < 3 ? plus.rate[j][k] : plus.force[j][k - 3]) -= e;
        (k < 3 ? minus.rate[j][k] : minus.force[j][k - 3]) += e;
      }
      Eigen::Matrix<double, 15, 1> column = Eigen::Matrix<double, 15, 1>::Unit(9 + k);
      column.head<9>() = (difference(motion.increment(), plus.run(options).increment()) -
                          difference(motion.increment(), minus.run(options).increment())) /
                         (2 * e);
      const double density = k < 3 ? options.noise.gyroscope_walk : options.noise.accelerometer_walk;
      sum += density * density * steps.h[i] * column * column.transpose();
    }
  }
  const Matrix15 covariance = motion.covarianceWithBias();
  EXPECT_LE((covariance - sum).norm(), 1e-8 * sum.norm());
  // Block by block too, for their sizes differ.
  for (int a = 0; a < 15; a += 3) {
    for (int b = 0; b < 15; b += 3) {
      EXPECT_LE((covariance.block<3, 3>(a, b) - sum.block<3, 3>(a, b)).norm(),
                1e-7 * std::sqrt(sum.block<3, 3>(a, a).norm() * sum.block<3, 3>(b, b).norm()))
          << a << ", " << b;
    }
  }
  EXPECT_EQ(covariance, covariance.transpose());
  EXPECT_EQ(Matrix9(covariance.topLeftCorner<9, 9>()), motion.gaussian().covariance);
  // And without a walk the biases are certain.
  const Matrix15 still = steps.run(some_options).covarianceWithBias();
  EXPECT_EQ(still.bottomRows<6>().norm(), 0);
}

TEST(Preintegration, TheCovarianceIsTrue) {
  const Steps truth = someSteps(100);
  const auto exact = truth.run(some_options).increment();
  std::mt19937_64 generator(8);
  std::normal_distribution<double> normal;
  const int trials = 400;
  double index = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Steps measured = truth;
    for (std::size_t i = 0; i < truth.h.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        measured.rate[i][k] += some_options.noise.gyroscope / std::sqrt(truth.h[i]) * normal(generator);
        measured.force[i][k] += some_options.noise.accelerometer / std::sqrt(truth.h[i]) * normal(generator);
      }
    }
    index += mahalanobisSquared(measured.run(some_options).gaussian(), exact) / trials;
  }
  // The mean of 400 χ²_9: standard error √(18/400). Five of them are exceeded once in two million seeds.
  EXPECT_NEAR(index, 9, 5 * std::sqrt(18. / trials));
}

TEST(Preintegration, ConsecutiveIntervalsMergeExactly) {
  const Steps steps = someSteps(40);
  const auto options = withWalk();
  const auto whole = steps.run(options), merged = steps.run(options, 0, 17) * steps.run(options, 17, 40);
  EXPECT_LE((whole.covarianceWithBias() - merged.covarianceWithBias()).norm(),
            1e-14 * whole.covarianceWithBias().norm());
  EXPECT_LE(difference(whole.increment(), merged.increment()).norm(), 1e-14);
  const Matrix9 covariance = whole.gaussian().covariance;
  EXPECT_LE((covariance - merged.gaussian().covariance).norm(), 1e-14 * covariance.norm());
  EXPECT_LE((whole.biasJacobian() - merged.biasJacobian()).norm(), 1e-14);
  EXPECT_DOUBLE_EQ(whole.duration(), merged.duration());
}

TEST(Preintegration, AdditiveCovarianceIsANamedConversion) {
  const auto motion = someSteps(20).run(some_options);
  const Matrix9 library = motion.gaussian().covariance, additive = motion.additiveCovariance();
  const Eigen::Matrix3d R = motion.increment().so3().matrix();
  // Order (rotation, velocity, position); velocity and position in the axes of the start.
  EXPECT_LE((additive.block<3, 3>(0, 0) - library.block<3, 3>(3, 3)).norm(), 1e-16);
  EXPECT_LE((additive.block<3, 3>(3, 3) - R * library.block<3, 3>(6, 6) * R.transpose()).norm(), 1e-16);
  EXPECT_LE((additive.block<3, 3>(0, 6) - library.block<3, 3>(3, 0) * R.transpose()).norm(), 1e-16);
}

// The update of docs/theory/visual_inertial.md, section 2.2, over 0.2 s at 1.5 rad/s and 3 m/s²: errors of an
// independent prototype.
TEST(Preintegration, BiasUpdateWithoutReintegration) {
  Steps steps;
  for (int i = 0; i < 40; ++i) {
    const double s = 0.3 * i;
    steps.h.push_back(0.005);
    steps.rate.push_back(1.5 * Vector3(std::cos(s), std::sin(s), 0.5).normalized());
    steps.force.push_back(3 * Vector3(std::sin(s), 0.4, std::cos(s)).normalized());
  }
  const PreintegrationOptions<double> options;
  const auto motion = steps.run(options);
  struct Row {
    double change, rotation, velocity;
  };
  for (const auto& [change, rotation, velocity] :
       {Row{0.001, 3e-9, 6e-8}, Row{0.01, 3e-7, 1e-6}, Row{0.05, 8e-6, 4e-5}}) {
    PreintegrationOptions<double> other = options;
    other.bias.gyroscope = change * Vector3(1, 1, 1).normalized();
    const Vector9 error = difference(steps.run(other).increment(), motion.increment(other.bias));
    // Another motion than the prototype's: within a factor of four, and quadratic in the change.
    EXPECT_LE(error.segment<3>(3).norm(), 4 * rotation) << change;
    EXPECT_LE(error.tail<3>().norm(), 4 * velocity) << change;
    EXPECT_GE(error.segment<3>(3).norm(), rotation / 20) << "the update is an approximation";
  }
  ImuBias<double> bias;
  bias.gyroscope[0] = 0.04;
  EXPECT_FALSE(motion.mustReintegrate(bias));
  bias.gyroscope[0] = 0.06;
  EXPECT_TRUE(motion.mustReintegrate(bias));
  bias.gyroscope[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(motion.mustReintegrate(bias));
}

TEST(PreintegrationFactor, ResidualAndItsDerivatives) {
  const auto motion = someSteps(60).run(some_options);
  const SE23d first(SO3d::exp({0.3, -1, 2}), Vector3(1, 2, 3), Vector3(-1, 0.5, 2));
  const Vector3 gravity(0, 0.1, -9.81);
  ImuBias<double> bias = some_options.bias;
  bias.gyroscope += Vector3(0.01, -0.02, 0.015);
  bias.accelerometer += Vector3(0.1, 0.05, -0.2);
  // The state that the motion leads to has no residual.
  const double t = motion.duration();
  const SE23d D = motion.increment(bias);
  const SO3d R(first.so3());
  const SE23d reached(
      R * SO3d(D.so3()),
      Vector3(first.translation() + t * first.velocity() + 0.5 * t * t * gravity + R * Vector3(D.translation())),
      Vector3(first.velocity() + t * gravity + R * Vector3(D.velocity())));
  EXPECT_LE(preintegrationResidual(motion, first, reached, bias, gravity).value.norm(), 1e-14);

  // Elsewhere: a residual of some size, for derivatives that are exact there too.
  const SE23d second = reached * SE23d::exp(Vector9::LinSpaced(9, -0.4, 0.5));
  const auto r = preintegrationResidual(motion, first, second, bias, gravity);
  EXPECT_LE((r.value - preintegrationError(motion, first, second, bias, gravity)).norm(), 1e-15);
  const double e = 1e-5;
  for (int k = 0; k < 9; ++k) {
    const Vector9 d = e * Vector9::Unit(k);
    const auto by = [&](const Vector9& a, const Vector9& b) {
      return preintegrationError(motion, SE23d(first * SE23d::exp(a)), SE23d(second * SE23d::exp(b)), bias, gravity);
    };
    const Vector9 zero = Vector9::Zero();
    EXPECT_LE(((by(d, zero) - by(-d, zero)) / (2 * e) - r.by_first.col(k)).norm(), 1e-8) << k;
    EXPECT_LE(((by(zero, d) - by(zero, -d)) / (2 * e) - r.by_second.col(k)).norm(), 1e-8) << k;
  }
  for (int k = 0; k < 9; ++k) {
    const auto by = [&](double change) {
      ImuBias<double> b = bias;
      Vector3 g = gravity;
      (k < 3 ? b.gyroscope[k] : k < 6 ? b.accelerometer[k - 3] : g[k - 6]) += change;
      return preintegrationError(motion, first, second, b, g);
    };
    const Vector9 numeric = (by(e) - by(-e)) / (2 * e);
    const Vector9 analytic = k < 6 ? Vector9(r.by_bias.col(k)) : Vector9(r.by_gravity.col(k - 6));
    EXPECT_LE((numeric - analytic).norm(), 1e-8) << k;
  }
}

/// Readings of an agile motion: R(t) = Exp(a(t)) with a, and the position, sums of sines; no gravity.
struct AnalyticMotion {
  static Vector3 turn(double t) {
    return Vector3(0.5 * std::sin(2.1 * t), 0.4 * std::cos(3.3 * t), 0.6 * std::sin(4 * t));
  }
  static Vector3 turnRate(double t) {
    return Vector3(1.05 * std::cos(2.1 * t), -1.32 * std::sin(3.3 * t), 2.4 * std::cos(4 * t));
  }
  static Vector3 position(double t) { return Vector3(std::sin(2 * t), 0.7 * std::cos(3 * t), 0.3 * std::sin(5 * t)); }
  static Vector3 velocity(double t) {
    return Vector3(2 * std::cos(2 * t), -2.1 * std::sin(3 * t), 1.5 * std::cos(5 * t));
  }
  static Vector3 acceleration(double t) {
    return Vector3(-4 * std::sin(2 * t), -6.3 * std::cos(3 * t), -7.5 * std::sin(5 * t));
  }
  static SE23d state(double t) { return SE23d(SO3d::exp(turn(t)), position(t), velocity(t)); }
  static ImuSample<double> sample(double t) {
    return {t, SO3d::rightJacobian(turn(t)) * turnRate(t), SO3d::exp(turn(t)).inverse() * acceleration(t)};
  }
  static std::vector<ImuSample<double>> samples(double rate) {
    std::vector<ImuSample<double>> list;
    for (int i = -3; i <= 1.2 * rate; ++i) list.push_back(sample(i / rate));
    return list;
  }
};

double errorOf(ImuScheme scheme, double rate) {
  const auto list = AnalyticMotion::samples(rate);
  // Both ends lie between readings.
  const double begin = 0.0123, end = 1.0391;
  const auto result = preintegrate<double>(list, begin, end, {.scheme = scheme});
  EXPECT_TRUE(result.ok());
  EXPECT_NEAR(result.motion.duration(), end - begin, 1e-12);
  return preintegrationError<double>(result.motion, AnalyticMotion::state(begin), AnalyticMotion::state(end), {},
                                     Vector3::Zero())
      .norm();
}

// States of a world that turns, by Euler's steps of its equations of motion.
TEST(PreintegrationFactor, AWorldMayTurn) {
  const Vector3 world(1e-3, 2e-3, -3e-3), g(0, 0, -9.81), rate(0.3, -0.2, 0.5), force(3, 50, 20);
  const SE23d first(SO3d::exp(Vector3(0.3, 0.1, -2)), Vector3(30, -20, 10), Vector3(100, 50, -20));
  constexpr int n = 200000;
  constexpr double t = 2, h = t / n;
  SO3d R(first.so3());
  Vector3 p = first.translation(), v = first.velocity();
  for (int i = 0; i < n; ++i) {
    const SO3d half = SO3d::exp(-0.5 * h * world) * R * SO3d::exp(0.5 * h * rate);
    // At the middle of the step, to second order.
    const auto acceleration = [&](const Vector3& at, const Vector3& moving) {
      return Vector3(half * force + g - 2 * world.cross(moving) - world.cross(world.cross(at)));
    };
    const Vector3 a = acceleration(p, v), a_middle = acceleration(p + 0.5 * h * v, v + 0.5 * h * a);
    p += h * v + 0.5 * h * h * a_middle;
    v += h * a_middle;
    R = SO3d::exp(-h * world) * R * SO3d::exp(h * rate);
  }
  const SE23d second(R, p, v);
  Preintegration<double> motion;
  motion.add(t, rate, force);
  const auto error = [&](const Vector3& turning) {
    const auto [from, to] = statesInFixedAxes<double>(first, second, t, g, turning);
    return preintegrationError<double>(motion, from, to, {}, g).norm();
  };
  // Gravity's gains are exact to the third power of the world's angle, 4e-7; Euler's steps to h².
  EXPECT_LE(error(world), 2e-6);
  EXPECT_GE(error(Vector3::Zero()), 0.1) << "which is what the world's rotation does here";
}

TEST(Schemes, HaveTheirOrders) {
  // Doubling the rate divides the error by 2^order.
  const double held = errorOf(ImuScheme::held, 200) / errorOf(ImuScheme::held, 400);
  const double averaged = errorOf(ImuScheme::averaged, 200) / errorOf(ImuScheme::averaged, 400);
  const double cubic = errorOf(ImuScheme::cubic, 100) / errorOf(ImuScheme::cubic, 200);
  EXPECT_NEAR(held, 2, 0.3) << "instantaneous readings held: half a reading late";
  EXPECT_NEAR(averaged, 4, 0.8);
  EXPECT_GE(cubic, 7) << "of third order at least";
  EXPECT_LE(errorOf(ImuScheme::averaged, 200), 1e-3);
  EXPECT_LE(errorOf(ImuScheme::cubic, 200), 1e-5);
}

TEST(Recordings, HeldReadingsAreDeltaAngles) {
  // Readings that are means over the time to the next lose nothing.
  const std::vector<ImuSample<double>> list{{0, Vector3(0.1, 0, 2), Vector3(1, 2, 3)},
                                            {0.1, Vector3(1, -1, 0), Vector3(0, 2, 9)},
                                            {0.2, Vector3::Zero(), Vector3::Zero()}};
  Preintegration<double> expected;
  expected.add(0.1, list[0].angular_rate, list[0].specific_force);
  expected.add(0.05, list[1].angular_rate, list[1].specific_force);
  const auto result = preintegrate<double>(list, 0., 0.15, {.scheme = ImuScheme::held, .max_gap = 0.2});
  ASSERT_TRUE(result.ok());
  EXPECT_LE(difference(expected.increment(), result.motion.increment()).norm(), 1e-15);
}

TEST(Preintegration, OneReadingHasACovarianceWithAFactor) {
  std::mt19937 generator(5);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  PreintegrationOptions<double> options = some_options;
  options.noise.gyroscope_walk = 2e-5, options.noise.accelerometer_walk = 3e-3;
  for (int i = 0; i < 1000; ++i) {
    Preintegration<double> motion(options);
    motion.add(std::pow(10, -2.5 + draw()), 5 * Vector3(draw(), draw(), draw()), 100 * Vector3(draw(), draw(), draw()));
    ASSERT_EQ(Eigen::LLT<Matrix9>(motion.gaussian().covariance).info(), Eigen::Success) << i;
    ASSERT_EQ((Eigen::LLT<Eigen::Matrix<double, 15, 15>>(motion.covarianceWithBias()).info()), Eigen::Success) << i;
  }
}

/// Readings of which every third and fourth of seven is missing.
std::vector<ImuSample<double>> withDropouts(double rate) {
  std::vector<ImuSample<double>> list;
  std::size_t i = 0;
  for (const ImuSample<double>& s : AnalyticMotion::samples(rate)) {
    if (i % 7 != 2 && i % 7 != 3) list.push_back(s);
    ++i;
  }
  return list;
}

// Each reading's noise by itself, with the variance density²·rate however long its steps are.
TEST(Recordings, NoiseBelongsToTheReading) {
  constexpr double rate = 200;
  const auto list = withDropouts(rate);
  for (const ImuScheme scheme : {ImuScheme::averaged, ImuScheme::held, ImuScheme::cubic}) {
    RecordingOptions<double> options{.preintegration = {.noise = {1e-1, 1e1}}, .scheme = scheme};
    const double begin = 0.1013, end = 0.4027;
    const auto result = preintegrate<double>(list, begin, end, options);
    ASSERT_TRUE(result.ok());
    EXPECT_NEAR(result.rate, rate, 1e-9 * rate) << "measured";
    Matrix9 sum = Matrix9::Zero();
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (std::abs(list[i].time - 0.25) > 0.2) continue;
      for (int k = 0; k < 6; ++k) {
        auto moved = list;
        constexpr double e = 1e-5;
        (k < 3 ? moved[i].angular_rate[k] : moved[i].specific_force[k - 3]) += e;
        const Vector9 column =
            difference(result.motion.increment(), preintegrate<double>(moved, begin, end, options).motion.increment()) /
            e;
        const double density = k < 3 ? 1e-1 : 1e1;
        sum += density * density * rate * column * column.transpose();
      }
    }
    // The scheme's error is nothing beside so much noise.
    const Eigen::Matrix3d rotation = result.motion.gaussian().covariance.block<3, 3>(3, 3);
    EXPECT_NEAR((rotation.inverse() * sum.block<3, 3>(3, 3)).trace() / 3, 1, 0.02) << static_cast<int>(scheme);
    EXPECT_NEAR((result.motion.gaussian().covariance.inverse() * sum).trace() / 9, 1, 0.12) << static_cast<int>(scheme);
    // Two intervals of a chain have the variance of both together, with one reading shared.
    options.chained = true;
    const auto first = preintegrate<double>(list, begin, 0.25, options),
               second = preintegrate<double>(list, 0.25, end, options);
    const Matrix9 chained = (first.motion * second.motion).gaussian().covariance;
    EXPECT_NEAR((chained.block<3, 3>(3, 3).inverse() * sum.block<3, 3>(3, 3)).trace() / 3, 1, 0.05)
        << static_cast<int>(scheme);
  }
}

TEST(Recordings, TheRateIsThatOfTheSensor) {
  const auto rateOf = [](const std::vector<double>& times) {
    std::vector<ImuSample<double>> list;
    for (const double t : times) list.push_back({t, Vector3::Zero(), Vector3::Zero()});
    return readingRate<double>(list);
  };
  std::mt19937 generator(9);
  const auto uniform = [&] { return static_cast<double>(generator()) * 0x1p-32; };
  std::vector<double> even, halved, jitter, bunched, hole;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.005 * i;
    even.push_back(t);
    if (uniform() < 0.5) halved.push_back(t);
    jitter.push_back(t + 0.001 * (uniform() - 0.5));
    bunched.push_back(0.02 * (i / 4) + 2e-5 * (i % 4));
    hole.push_back(t + (i > 100 ? 3 : 0) + (i > 200 ? 0.05 : 0));
  }
  EXPECT_NEAR(rateOf(even), 200, 1e-9);
  EXPECT_NEAR(rateOf(halved), 200, 1e-9);
  EXPECT_NEAR(rateOf(jitter), 200, 2);
  EXPECT_NEAR(rateOf(bunched), 200, 2);
  EXPECT_NEAR(rateOf(hole), 200, 1e-9);
  EXPECT_EQ(rateOf({}), 0);
  EXPECT_EQ(rateOf({1}), 0);
  EXPECT_EQ(rateOf({1, std::nan("")}), 0);
}

// The squared length of the scheme's own error under a covariance that has it: d²/(1 + d²) of a d² that may be
// thousands.
TEST(Recordings, TheErrorOfTheSchemeIsInTheCovariance) {
  const PreintegrationOptions<double> noise{.noise = {.gyroscope = 1e-6, .accelerometer = 1e-5}};
  for (const double rate : {50., 100., 200.}) {
    const auto list = AnalyticMotion::samples(rate);
    for (const double begin : {0.0123, 0.1}) {
      const double end = begin + 0.9;
      for (const ImuScheme scheme : {ImuScheme::averaged, ImuScheme::cubic}) {
        const auto result = preintegrate<double>(list, begin, end, {.preintegration = noise, .scheme = scheme});
        const Vector9 error = preintegrationError<double>(result.motion, AnalyticMotion::state(begin),
                                                          AnalyticMotion::state(end), {}, Vector3::Zero());
        const double d2 = mahalanobisSquared<double, 9>(error, result.motion.gaussian().covariance);
        if (scheme == ImuScheme::averaged) {
          EXPECT_GE(result.scheme_error, 1e3) << rate;
          EXPECT_EQ(result.sampling, ImuSampling::undersampled) << rate;
          EXPECT_LE(d2, 1 + 0.003 * result.scheme_error) << "an estimate to 5 %";
        } else {
          EXPECT_LE(result.sampling == ImuSampling::undersampled ? 0 : d2, 3) << rate;
        }
      }
    }
  }
  // At this noise there is nothing to say.
  const auto list = AnalyticMotion::samples(200);
  EXPECT_EQ(preintegrate<double>(list, 0., 1., {.preintegration = {.noise = {1e-3, 1e-1}}}).sampling,
            ImuSampling::adequate);
}

TEST(Recordings, TimesOfArrivalAndWantOfReadingsAreSaid) {
  const PreintegrationOptions<double> noise{.noise = {.gyroscope = 1e-3, .accelerometer = 1e-1}};
  std::vector<ImuSample<double>> bunched, jitter;
  std::mt19937 generator(2);
  int i = 0;
  for (ImuSample<double> s : AnalyticMotion::samples(200)) {
    const int place = i++ % 4;
    ImuSample<double> late = s;
    s.time -= place * (0.005 - 2e-5);
    bunched.push_back(s);
    late.time += 1e-3 * (static_cast<double>(generator()) * 0x1p-32 - 0.5);
    jitter.push_back(late);
  }
  for (const ImuScheme scheme : {ImuScheme::averaged, ImuScheme::held, ImuScheme::cubic}) {
    EXPECT_EQ(preintegrate<double>(bunched, 0.1, 0.9, {.preintegration = noise, .scheme = scheme}).sampling,
              ImuSampling::bunched);
    EXPECT_EQ(
        preintegrate<double>(jitter, 0.1, 0.9, {.preintegration = {.noise = {3e-5, 1e-3}}, .scheme = scheme}).sampling,
        ImuSampling::rough);
  }
  const auto list = AnalyticMotion::samples(200);
  const std::vector<ImuSample<double>> two(list.begin() + 10, list.begin() + 12);
  EXPECT_EQ(preintegrate<double>(two, two[0].time, two[1].time, {.preintegration = noise}).sampling,
            ImuSampling::untested);
  // A fault beside the interval is no fault of it, and not in its covariance.
  auto broken = list;
  broken[42].angular_rate[2] = broken[85].specific_force[0] = std::nan("");
  const auto result = preintegrate<double>(broken, list[43].time, list[84].time, {.preintegration = noise});
  ASSERT_TRUE(result.ok());
  EXPECT_TRUE(result.motion.gaussian().covariance.allFinite());
}

TEST(Recordings, FaultsAreNamed) {
  auto list = AnalyticMotion::samples(200);
  const auto fault = [&](double begin, double end) {
    const auto result = preintegrate<double>(list, begin, end);
    return std::pair(result.fault.kind, result.fault.index);
  };
  EXPECT_EQ(fault(0.2, 0.4).first, FaultKind::none);
  EXPECT_EQ(fault(0.4, 0.2).first, FaultKind::bad_interval);
  EXPECT_EQ(fault(0.4, 0.4).first, FaultKind::bad_interval);
  EXPECT_EQ(fault(std::nan(""), 0.4).first, FaultKind::bad_interval);
  EXPECT_EQ(fault(-1, 0.4).first, FaultKind::not_covered);
  EXPECT_EQ(fault(0.2, 9), std::pair(FaultKind::not_covered, list.size() - 1));
  const auto good = list;
  list[50].specific_force[1] = std::nan("");
  EXPECT_EQ(fault(0.2, 0.4), std::pair(FaultKind::not_finite, std::size_t{50}));
  list = good;
  list[50].time = std::nan("");
  EXPECT_EQ(fault(0.2, 0.4), std::pair(FaultKind::not_finite, std::size_t{50}));
  list = good;
  list[50].time = list[49].time;
  EXPECT_EQ(fault(0.2, 0.4), std::pair(FaultKind::not_ascending, std::size_t{50})) << "duplicated";
  list = good;
  std::swap(list[60], list[61]);
  EXPECT_EQ(fault(0.2, 0.4).first, FaultKind::not_ascending);
  list = good;
  list.erase(list.begin() + 50, list.begin() + 80);
  EXPECT_EQ(fault(0.2, 0.4), std::pair(FaultKind::gap, std::size_t{50}));
  EXPECT_EQ(fault(0.01, 0.2).first, FaultKind::none) << "the gap is elsewhere";
  list.clear();
  EXPECT_EQ(fault(0.2, 0.4).first, FaultKind::not_covered);
}

// A recording may be long and its windows many: what they do not use is not looked at.
TEST(Recordings, OnlyWhatIsUsedIsChecked) {
  const auto good = AnalyticMotion::samples(200);
  // 0.2 s is between readings 42 and 43, 0.4 s is before reading 84.
  const double begin = 0.1975, end = 0.4025;
  const std::size_t first = 42, last = 84;
  ASSERT_LT(good[first].time, begin);
  ASSERT_GT(good[first + 1].time, begin);
  ASSERT_LT(good[last - 1].time, end);
  ASSERT_GT(good[last].time, end);
  for (const ImuScheme scheme : {ImuScheme::averaged, ImuScheme::held, ImuScheme::cubic}) {
    // The cubic scheme has one more reading at each end.
    const std::size_t more = scheme == ImuScheme::cubic ? 1 : 0;
    const auto expected = preintegrate<double>(good, begin, end, {.scheme = scheme});
    ASSERT_TRUE(expected.ok());
    for (std::size_t i = 0; i < good.size(); ++i) {
      auto list = good;
      list[i].angular_rate[2] = std::nan("");
      const auto result = preintegrate<double>(list, begin, end, {.scheme = scheme});
      if (i + more >= first && i <= last + more) {
        EXPECT_EQ(result.fault, FaultKind::not_finite) << i;
        EXPECT_EQ(result.fault.index, i);
      } else {
        ASSERT_TRUE(result.ok()) << i;
        EXPECT_TRUE(result.motion.increment().matrix() == expected.motion.increment().matrix()) << i;
      }
    }
    // A gap next to the interval matters to the cubic scheme alone.
    auto list = good;
    for (std::size_t i = 0; i < first; ++i) list[i].time -= 0.2;
    EXPECT_EQ(preintegrate<double>(list, begin, end, {.scheme = scheme}).fault,
              more ? FaultKind::gap : FaultKind::none);
  }
}

// Bisection of what is not sorted: a fault, or the increment of readings that ascend from begin to end.
TEST(Recordings, InAnyOrderThereIsNoWrongAnswer) {
  const auto good = AnalyticMotion::samples(200);
  std::mt19937_64 generator(7);
  std::size_t faults = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    auto list = good;
    const std::size_t changes = 1 + generator() % 20;
    for (std::size_t k = 0; k < changes; ++k) {
      const std::size_t i = generator() % list.size();
      if (generator() % 3 == 0) {
        list[i].time = generator() % 2 == 0 ? std::nan("") : std::numeric_limits<double>::infinity();
      } else {
        std::swap(list[i], list[generator() % list.size()]);
      }
    }
    const auto result = preintegrate<double>(list, 0.2, 0.4);
    if (!result.ok()) {
      ++faults;
      continue;
    }
    // No reading is counted twice or left out without a gap that shows.
    EXPECT_NEAR(result.motion.duration(), 0.2, 1e-12);
    EXPECT_LE(result.max_gap, 0.1);
  }
  EXPECT_GE(faults, 1000u);
  EXPECT_LT(faults, 2000u);
}

}  // namespace
