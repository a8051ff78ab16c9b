#include <experiments/preintegration_validation.hpp>

#include <experiments/recording.hpp>
#include <fusion/imu/preintegration.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>

#include <cmath>
#include <utility>

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

}  // namespace

int degreesOfFreedom(PreintegrationCheck check) { return check == PreintegrationCheck::motion_and_bias ? 15 : 9; }

std::vector<PreintegrationRow> validatePreintegration(const PreintegrationValidation& validation,
                                                      const RunProgress& progress) {
  std::vector<PreintegrationRow> cells, rows;
  std::vector<CellSize> sizes;
  double judged = 0;
  for (const PreintegrationCheck check : validation.checks) {
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
  for (PreintegrationRow& row : cells) {
    auto reports =
        run.reports(16, {ReferenceLaw::chiSquared(degreesOfFreedom(row.check))}, [&](CounterRng& rng, std::uint64_t) {
          TrialOutcome outcome;
          outcome.mu2 = trial(row.check, row.window, row.noise, rng);
          return std::vector<TrialOutcome>{outcome};
        });
    if (run.ended()) break;
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
    judgement.promises.push_back(
        promiseAbout(row, fmt::format("{} {} s, noise {}", name(row.check), row.window, row.noise)));
  }
  return judgement;
}

}  // namespace liestat::experiments
