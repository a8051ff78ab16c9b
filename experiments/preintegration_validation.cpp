#include <experiments/preintegration_validation.hpp>

#include <experiments/interruption.hpp>
#include <experiments/parallel.hpp>
#include <experiments/part_of_run.hpp>
#include <experiments/recording.hpp>
#include <fusion/imu/preintegration.hpp>
#include <stats/random.hpp>
#include <stats/validation.hpp>

#include <algorithm>
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

std::vector<PreintegrationRow> validatePreintegration(
    const PreintegrationValidation& validation, const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  std::vector<PreintegrationRow> rows;
  for (const PreintegrationCheck check : validation.checks) {
    for (const double window : validation.windows) {
      for (const double noise : validation.noises) {
        PreintegrationRow& row = rows.emplace_back();
        row.check = check;
        row.window = window;
        row.noise = noise;
        if (noise <= preintegration_promise) row.promise = ValidationTolerance{};
      }
    }
  }
  const auto judged = static_cast<double>(
      std::count_if(rows.begin(), rows.end(), [](const PreintegrationRow& row) { return row.promise.has_value(); }));
  // The amount of work is that of the readings.
  double all = 0, before = 0;
  for (const PreintegrationRow& row : rows) all += row.window;
  trials_of_run.planned += rows.size() * validation.trials;
  for (PreintegrationRow& row : rows) {
    const ValidationOptions options = trialsOf(validation, 16, {before, row.window, all}, progress);
    std::vector<ValidationReport> reports =
        validateAll(ProgramExecutor{validation.threads}, options,
                    std::vector<ReferenceLaw>{ReferenceLaw::chiSquared(degreesOfFreedom(row.check))},
                    [&](CounterRng& rng, std::uint64_t) {
                      TrialOutcome outcome;
                      outcome.mu2 = trial(row.check, row.window, row.noise, rng);
                      return std::vector<TrialOutcome>{outcome};
                    });
    if (!countTrials(reports.front().trials)) break;
    row.setReport(std::move(reports.front()));
    row.judge(run_false_alarm / judged);
    row.forgetDistances();
    before += row.window;
  }
  // Rows have their places beforehand; those that an interrupt left without a trial are no rows.
  std::erase_if(rows, [](const PreintegrationRow& row) { return row.report.trials == 0; });
  return rows;
}

}  // namespace liestat::experiments
