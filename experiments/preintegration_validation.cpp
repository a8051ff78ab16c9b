#include <experiments/preintegration_validation.hpp>

#include <experiments/recording.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <stats/laws.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace liestat::experiments {
namespace {

constexpr double rate = 200;

/// An agile motion: sums of sines with phases of their own in every trial.
class Motion {
 public:
  explicit Motion(CounterRng& rng) {
    for (Eigen::Vector3d* v : {&phase_, &other_}) {
      for (int i = 0; i < 3; ++i) (*v)[i] = 2 * EIGEN_PI * rng.uniform();
    }
  }
  Eigen::Vector3d angularRate(double t) const {
    return 1.5 * ((Eigen::Array3d(3, 4, 5) * t + phase_.array()).sin()).matrix();
  }
  Eigen::Vector3d specificForce(double t) const {
    return Eigen::Vector3d(0, 0, 9.81) + 3 * ((Eigen::Array3d(6, 7, 5) * t + other_.array()).sin()).matrix();
  }

 private:
  Eigen::Vector3d phase_, other_;
};

/// The squared distance of the truth in one trial: a motion whose rate and force are constant in each step, and
/// readings of it with white noise and biases that walk, from known biases at the start.
double trial(PreintegrationCheck check, double window, double scale, CounterRng& rng) {
  const bool walks = check != PreintegrationCheck::motion;
  PreintegrationOptions<double> options;
  options.noise = {.gyroscope = scale * adis16448.gyroscope, .accelerometer = scale * adis16448.accelerometer};
  if (walks) {
    options.noise.gyroscope_walk = scale * adis16448.gyroscope_walk;
    options.noise.accelerometer_walk = scale * adis16448.accelerometer_walk;
  }
  options.bias = {0.02 * rng.normalVector<3>(), 0.1 * rng.normalVector<3>()};
  const Motion motion(rng);
  const auto steps = static_cast<int>(std::lround(window * rate));
  const double h = window / steps, root = std::sqrt(h);
  Preintegration<double> truth, first(options), second(options);
  Eigen::Matrix<double, 6, 1> drift = Eigen::Matrix<double, 6, 1>::Zero();
  for (int i = 0; i < steps; ++i) {
    const Eigen::Vector3d w = motion.angularRate(i * h), f = motion.specificForce(i * h);
    truth.add(h, w, f);
    const Eigen::Matrix<double, 6, 1> noise = rng.normalVector<6>();
    const Eigen::Vector3d w_measured =
        w + options.bias.gyroscope + drift.head<3>() + options.noise.gyroscope / root * noise.head<3>();
    const Eigen::Vector3d f_measured =
        f + options.bias.accelerometer + drift.tail<3>() + options.noise.accelerometer / root * noise.tail<3>();
    (2 * i < steps ? first : second).add(h, w_measured, f_measured);
    if (walks) {
      const Eigen::Matrix<double, 6, 1> walk = rng.normalVector<6>();
      drift.head<3>() += options.noise.gyroscope_walk * root * walk.head<3>();
      drift.tail<3>() += options.noise.accelerometer_walk * root * walk.tail<3>();
    }
  }
  const Preintegration<double> whole = first * second;
  Eigen::Matrix<double, 15, 1> error;
  error << (whole.increment().inverse() * truth.increment()).log(), drift;
  if (check == PreintegrationCheck::motion_and_bias) {
    return mahalanobisSquared<double, 15>(error, whole.covarianceWithBias());
  }
  return mahalanobisSquared<double, 9>(Eigen::Matrix<double, 9, 1>(error.head<9>()), whole.gaussian().covariance);
}

/// Disturbances of the times of a recording's readings.
enum class Readings { regular, dropped, jitter, bunched, one };

/// A recording: a motion, readings of it, and how they are integrated.
struct Scene {
  const char* motion;
  double rate;  ///< Hz
  Readings readings = Readings::regular;
  double dropped = 0;
  ImuScheme scheme = ImuScheme::averaged;

  std::string name() const {
    const char* schemes[] = {"averaged", "held", "cubic"};
    const std::string what = readings == Readings::dropped   ? fmt::format(", {:g} % dropped", 100 * dropped)
                             : readings == Readings::jitter  ? ", jitter 0.5 ms"
                             : readings == Readings::bunched ? ", bunched"
                             : readings == Readings::one     ? ", one reading"
                                                             : "";
    return fmt::format("{} {:g} Hz{}, {}", motion, rate, what, schemes[static_cast<int>(scheme)]);
  }
};

std::vector<Scene> scenes(bool all) {
  constexpr ImuScheme averaged = ImuScheme::averaged, held = ImuScheme::held, cubic = ImuScheme::cubic;
  if (!all) {
    return {{"calm", 200},
            {"wild", 200, Readings::regular, 0, cubic},
            {"rocket", 100},
            {"calm", 200, Readings::dropped, 0.5},
            {"wild", 200, Readings::dropped, 0.2, cubic},
            {"calm", 200, Readings::bunched, 0, cubic},
            {"calm", 200, Readings::one, 0, held}};
  }
  std::vector<Scene> list;
  for (const ImuScheme scheme : {averaged, held, cubic}) {
    for (const char* motion : {"calm", "wild", "rocket"}) {
      for (const double hertz : {100., 200., 1000.}) list.push_back({motion, hertz, Readings::regular, 0, scheme});
    }
    for (const char* motion : {"calm", "wild"}) {
      for (const double part : {0.05, 0.2, 0.5}) list.push_back({motion, 200, Readings::dropped, part, scheme});
      for (const Readings kind : {Readings::jitter, Readings::bunched, Readings::one}) {
        list.push_back({motion, 200, kind, 0, scheme});
      }
    }
  }
  return list;
}

/// Rate and force as sums of a constant and a sine along each axis: calm, up to 0.5 rad/s and 1.5 m/s² below 1 Hz;
/// wild, 10 rad/s and 12 g at 2 to 3 Hz; rocket, a spin of 6 rad/s under 12 g.
class SceneMotion {
 public:
  SceneMotion(const std::string& name, CounterRng& rng) {
    const double turn = 2 * EIGEN_PI;
    for (Wave* wave : {&rate_, &force_}) {
      for (int i = 0; i < 3; ++i) wave->phase[i] = turn * rng.uniform();
    }
    force_.constant[2] = 9.81;
    if (name == "calm") {
      rate_.amplitude.setConstant(0.4), rate_.speed = turn * Eigen::Array3d(0.5, 0.7, 0.9);
      force_.amplitude.setConstant(1.5), force_.speed = turn * Eigen::Array3d(0.9, 0.6, 0.8);
    } else if (name == "wild") {
      rate_.amplitude << 8, 7, 6, rate_.speed = turn * Eigen::Array3d(2, 2.5, 3);
      force_.amplitude << 90, 80, 70, force_.speed = turn * Eigen::Array3d(2.6, 2.2, 3);
    } else {
      rate_.constant[2] = 6, force_.constant[2] = 118;
      rate_.amplitude << 0.4, 0.4, 1, rate_.speed = turn * Eigen::Array3d(0.5, 0.7, 1);
      force_.amplitude << 4, 4, 25, force_.speed = turn * Eigen::Array3d(1, 1.3, 2);
    }
  }
  ImuSample<double> at(double t) const { return {t, rate_.at(t), force_.at(t)}; }
  /// The mean from t to u.
  ImuSample<double> mean(double t, double u) const { return {t, rate_.mean(t, u), force_.mean(t, u)}; }
  /// The true increment: without noise, the cubic scheme at 2 kHz is exact to some 1e-9.
  SE23d increment(double end) const {
    constexpr double fine = 2000;
    std::vector<ImuSample<double>> list;
    for (int i = -2; i <= end * fine + 2.5; ++i) list.push_back(at(i / fine));
    return preintegrate<double>(list, 0., end, {.scheme = ImuScheme::cubic}).motion.increment();
  }

 private:
  struct Wave {
    Eigen::Array3d constant = Eigen::Array3d::Zero(), amplitude, speed, phase;
    Eigen::Vector3d at(double t) const { return (constant + amplitude * (speed * t + phase).sin()).matrix(); }
    Eigen::Vector3d mean(double t, double u) const {
      return (constant + amplitude / speed * ((speed * t + phase).cos() - (speed * u + phase).cos()) / (u - t))
          .matrix();
    }
  };
  Wave rate_, force_;
};

TrialOutcome trial(const Scene& scene, CounterRng& rng) {
  const SceneMotion motion(scene.motion, rng);
  const double period = 1 / scene.rate, end = scene.readings == Readings::one ? period : 1;
  const int around = 20;  // readings before and after the interval
  std::vector<double> times;
  for (int k = -around; k <= end * scene.rate + around; ++k) {
    const int place = ((k % 4) + 4) % 4;
    double t = k * period;
    if (scene.readings == Readings::bunched) t += place * (2e-5 - period);
    if (scene.readings == Readings::jitter) t += 5e-4 * std::clamp(rng.normalVector<3>()[0], -3., 3.);
    if (scene.readings != Readings::dropped || rng.uniform() >= scene.dropped) times.push_back(t);
  }
  const ImuNoise<double> noise{.gyroscope = adis16448.gyroscope, .accelerometer = adis16448.accelerometer};
  std::vector<ImuSample<double>> list;
  for (std::size_t k = 0; k < times.size(); ++k) {
    // A reading that is missing is not in the mean of the one before.
    const bool to_next = k + 1 < times.size() && scene.readings != Readings::dropped;
    const double t = times[k], next = to_next ? times[k + 1] : t + period;
    ImuSample<double>& s = list.emplace_back(scene.scheme == ImuScheme::held ? motion.mean(t, next) : motion.at(t));
    const double root = std::sqrt(scene.rate);
    s.angular_rate += noise.gyroscope * root * rng.normalVector<3>();
    s.specific_force += noise.accelerometer * root * rng.normalVector<3>();
  }
  // As preintegrateWindows() does, by the whole recording.
  const RecordingOptions<double> how{.preintegration = {.noise = noise, .rate = readingRate<double>(list)},
                                     .scheme = scene.scheme};
  const RecordingResult<double> result = preintegrate<double>(list, 0., end, how);
  TrialOutcome outcome;
  outcome.failed = !result.ok() || result.sampling != ImuSampling::adequate;
  if (outcome.failed) return outcome;
  const Eigen::Matrix<double, 9, 1> error = (result.motion.increment().inverse() * motion.increment(end)).log();
  outcome.mu2 = mahalanobisSquared<double, 9>(error, result.motion.gaussian().covariance);
  return outcome;
}

/// The mean squared distance, 9 ± 0.3 over an interval of many readings, and at most that where the covariance has more
/// than the noise: one reading has noise in six of nine directions, and errors of the scheme as they are.
void judge(PreintegrationRow& row, const Scene& scene, double false_alarm) {
  constexpr double low = 8.7, high = 9.3, lowest = 6;
  // Nothing is promised where preintegrate() says so itself; half of the trials are enough for a mean.
  if (2 * row.report.failures > row.report.trials) return;
  const double margin = std::sqrt(chiSquaredThreshold(false_alarm, 1)) * row.report.index_se;
  row.verdict = row.report.index > high + margin ? ValidationVerdict::index_too_large
                : row.report.index < (scene.readings == Readings::regular ? low : lowest) - margin
                    ? ValidationVerdict::index_too_small
                    : ValidationVerdict::passed;
  row.passed = row.verdict == ValidationVerdict::passed;
}

}  // namespace

int degreesOfFreedom(PreintegrationCheck check) { return check == PreintegrationCheck::motion_and_bias ? 15 : 9; }

std::vector<PreintegrationRow> validatePreintegration(const PreintegrationValidation& validation,
                                                      const RunProgress& progress) {
  std::vector<PreintegrationRow> cells, rows;
  std::vector<CellSize> sizes;
  std::vector<Scene> recordings;
  double judged = 0;
  for (const PreintegrationCheck check : validation.checks) {
    if (check == PreintegrationCheck::recording) {
      recordings = scenes(validation.all_recordings);
      for (const Scene& scene : recordings) {
        PreintegrationRow& row = cells.emplace_back();
        row.check = check, row.window = scene.readings == Readings::one ? 1 / scene.rate : 1, row.noise = 1;
        row.scene = scene.name();
        sizes.push_back({validation.run.trials, row.window});
      }
      judged += static_cast<double>(recordings.size());
      continue;
    }
    for (const double window : validation.windows) {
      for (const double noise : validation.noises) {
        PreintegrationRow& row = cells.emplace_back();
        row.check = check, row.window = window, row.noise = noise;
        judged += noise <= preintegration_promise ? 1 : 0;
        sizes.push_back({validation.run.trials, window});  // the work is that of the readings
      }
    }
  }
  CellRun run(validation.run, sizes, progress);
  std::size_t recording = 0;
  for (PreintegrationRow& row : cells) {
    const Scene scene =
        row.check == PreintegrationCheck::recording ? recordings[recording++] : Scene{.motion = "", .rate = rate};
    auto reports =
        run.reports(16, {ReferenceLaw::chiSquared(degreesOfFreedom(row.check))}, [&](CounterRng& rng, std::uint64_t) {
          TrialOutcome outcome;
          if (row.check == PreintegrationCheck::recording) {
            outcome = trial(scene, rng);
          } else {
            outcome.mu2 = trial(row.check, row.window, row.noise, rng);
          }
          return std::vector<TrialOutcome>{outcome};
        });
    if (run.ended()) continue;
    if (row.check == PreintegrationCheck::recording) {
      row.conclude(std::move(reports.front()), std::nullopt, 0);
      judge(row, scene, run_false_alarm / judged);
      rows.push_back(std::move(row));
      continue;
    }
    row.conclude(std::move(reports.front()),
                 row.noise <= preintegration_promise ? std::optional(ValidationTolerance{}) : std::nullopt,
                 run_false_alarm / judged);
    rows.push_back(std::move(row));
  }
  return rows;
}

Judgement judgementOf(const std::vector<PreintegrationRow>& rows) {
  Judgement judgement{.promises = {},
                      .where = fmt::format("in the promised domain (noise up to {:g})", preintegration_promise)};
  for (const PreintegrationRow& row : rows) {
    judgement.promises.push_back(promiseAbout(
        row, !row.scene.empty() ? "recording " + row.scene
                                : fmt::format("{} {} s, noise {}", name(row.check), row.window, row.noise)));
  }
  return judgement;
}

}  // namespace liestat::experiments
