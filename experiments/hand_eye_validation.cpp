#include <experiments/hand_eye_validation.hpp>
#include <lie/units.hpp>

#include <fusion/hand_eye.hpp>
#include <stats/propagation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace liestat::experiments {
namespace {

using Experiment = HandEyeExperiment;
using Formulation = HandEyeFormulation;
using Vector6 = HandEyeScene::Vector6;
using Matrix6 = HandEyeScene::Matrix6;

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
using units::degree;

struct Outcome : TrialOutcome {
  double rotation2 = nothing, translation2 = nothing, chi2_per_dof = nothing, right = nothing, lost = nothing;
  static constexpr std::array statistics = {&Outcome::rotation2, &Outcome::translation2, &Outcome::chi2_per_dof,
                                            &Outcome::right, &Outcome::lost};
};

/// A row without its outcomes: the scene, and what is promised of the calibration and of the fit.
struct Plan {
  HandEyeRow row;
  std::optional<ValidationTolerance> calibration, fit;
  bool judges_right = false;
  /// Cost of a trial in units of one with twenty pairs.
  double cost() const { return static_cast<double>(row.pairs) / 20; }
};

/// RMS errors of X in degrees and millimetres at noise 1, of an independent prototype.
struct NoteCell {
  std::size_t pairs;
  HandEyeNoise noise;
  double degrees, millimetres;
};
constexpr NoteCell note_cells[] = {
    {8, HandEyeNoise::isotropic, .305, 2.67},    {20, HandEyeNoise::isotropic, .169, 1.39},
    {50, HandEyeNoise::isotropic, .101, .845},   {200, HandEyeNoise::isotropic, .050, .426},
    {8, HandEyeNoise::anisotropic, .614, 3.69},  {20, HandEyeNoise::anisotropic, .365, 1.90},
    {50, HandEyeNoise::anisotropic, .227, 1.12}, {200, HandEyeNoise::anisotropic, .114, .584},
    {8, HandEyeNoise::target, .139, 1.15},       {20, HandEyeNoise::target, .070, .58},
    {50, HandEyeNoise::target, .047, .356},      {200, HandEyeNoise::target, .021, .186}};

std::vector<Plan> plansOf(Experiment experiment, const HandEyeValidation& validation) {
  // First order: some percent of the index at eight pairs, and at five times the noise.
  const ValidationTolerance first_order{.index = 0.06, .ks = 0.03, .failure_fraction = 0.001};
  const ValidationTolerance criterion{.index = 0.02, .ks = 0.03, .failure_fraction = 0.001};
  std::vector<Plan> plans;
  const auto add = [&](Formulation formulation, HandEyeMotion motion, HandEyeNoise noise, std::size_t pairs) -> Plan& {
    Plan& plan = plans.emplace_back();
    plan.row.experiment = experiment, plan.row.formulation = formulation;
    plan.row.motion = motion, plan.row.noise = noise, plan.row.pairs = pairs;
    return plan;
  };
  switch (experiment) {
    case Experiment::accuracy:
      for (const NoteCell& cell : note_cells) {
        if (cell.pairs > 50 && !validation.many_pairs) continue;
        Plan& plan = add(Formulation::poses, HandEyeMotion::general, cell.noise, cell.pairs);
        plan.row.note_rotation = cell.degrees * degree, plan.row.note_translation = 1e-3 * cell.millimetres;
        plan.calibration = first_order, plan.fit = criterion;
      }
      for (const HandEyeNoise noise : all_hand_eye_noises) {
        Plan& plan = add(Formulation::poses, HandEyeMotion::general, noise, 20);
        plan.row.scale = 5;
        plan.calibration = first_order, plan.fit = criterion;
      }
      break;
    case Experiment::motions:
      for (const Formulation formulation : {Formulation::poses, Formulation::motions}) {
        for (const HandEyeMotion motion : all_hand_eye_motions) {
          Plan& plan = add(formulation, motion, HandEyeNoise::isotropic, 20);
          plan.judges_right = true;
          // A held coordinate is not where the truth is: that is of second order, too, and there is no covariance where a
          // rotation is open.
          if (openDimension(motion) != 2 && openDimension(motion) != 4) {
            plan.calibration = ValidationTolerance{.index = 0.12, .ks = 0.05, .failure_fraction = 0.001};
          }
        }
      }
      break;
    case Experiment::outliers:
      for (const HandEyeNoise noise : all_hand_eye_noises) {
        for (const HandEyeOutliers kind : all_hand_eye_outliers) {
          Plan& plan = add(Formulation::poses, HandEyeMotion::general, noise, 20);
          plan.row.outliers = kind;
          plan.judges_right = true;
          plan.calibration = ValidationTolerance{.index = 0.08, .ks = 0.03, .failure_fraction = 0.002};
        }
      }
      break;
    case Experiment::formulations:
      for (const std::size_t pairs : {8, 20}) {
        for (const Formulation formulation : {Formulation::poses, Formulation::consecutive, Formulation::to_first,
                                              Formulation::all_pairs, Formulation::all_pairs_scaled}) {
          add(formulation, HandEyeMotion::general, HandEyeNoise::isotropic, pairs);
        }
      }
      break;
  }
  return plans;
}

/// Relative motions of absolute poses, with the covariance that each has by itself.
std::vector<PosePair> relativeMotions(const std::vector<PosePair>& poses, Formulation formulation) {
  std::vector<PosePair> list;
  const auto add = [&](std::size_t i, std::size_t j) {
    list.push_back({between(poses[i].a, poses[j].a), between(poses[i].b, poses[j].b)});
  };
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
    if (formulation == Formulation::consecutive) add(i, i + 1);
    if (formulation == Formulation::to_first) add(0, i + 1);
    if (formulation == Formulation::all_pairs || formulation == Formulation::all_pairs_scaled) {
      for (std::size_t j = i + 1; j < poses.size(); ++j) add(i, j);
    }
  }
  return list;
}

/// The squared distance of an error of X under a covariance that says nothing of the open directions.
double squaredDistance(const Vector6& error, Matrix6 covariance, const HandEyeResult& result) {
  const Vector6 sigmas = covariance.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt();
  const Matrix6 to_camera = result.X.mean.inverse().Adj();
  for (const OpenDirection& direction : result.directions) {
    Vector6 along = to_camera * direction.twist;
    const double length = along.cwiseQuotient(sigmas).norm();
    // A thousand standard deviations: the part of the error along it weighs a millionth.
    along *= 1e3 / length;
    covariance += along * along.transpose();
  }
  return mahalanobisSquared<double, 6>(error, covariance);
}

std::vector<Outcome> runTrial(const Plan& plan, double noise_factor, std::uint64_t seed, std::uint64_t number) {
  const HandEyeRow& row = plan.row;
  const bool independent = row.formulation == Formulation::motions;
  HandEyeScene scene({.motion = row.motion,
                      .noise = row.noise,
                      .noise_factor = row.scale,
                      .pairs = row.pairs,
                      .relative = independent,
                      .outliers = row.outliers ? 0.3 : 0.0,
                      .outlier_kind = row.outliers.value_or(HandEyeOutliers::gross)},
                     seed, number);
  for (PosePair& pair : scene.pairs) {
    pair.a.covariance /= noise_factor * noise_factor, pair.b.covariance /= noise_factor * noise_factor;
  }
  // Where outliers are not the question, a right pair in a thousand would be taken for one.
  const HandEyeOptions options{.find_outliers = row.outliers.has_value()};
  HandEyeResult result;
  switch (row.formulation) {
    case Formulation::poses:
      result = estimateRobotWorld(scene.pairs, options);
      break;
    case Formulation::motions:
      result = estimateHandEye(scene.pairs, options);
      break;
    default:
      result = estimateHandEye(relativeMotions(scene.pairs, row.formulation), options);
  }
  Matrix6 covariance = result.X.covariance;
  if (row.formulation == Formulation::all_pairs_scaled) covariance *= 0.5 * static_cast<double>(row.pairs);

  const SE3d truth = scene.nearestTruth(result.X.mean);
  const Vector6 error = (result.X.mean.inverse() * truth).log();
  std::vector<Outcome> outcomes(2);
  Outcome& calibration = outcomes[0];
  Outcome& fit = outcomes[1];
  calibration.failed = fit.failed =
      result.status == FusionStatus::not_converged || result.status == FusionStatus::bad_input;
  const bool has_covariance = covariance.allFinite();
  calibration.mu2 = has_covariance ? squaredDistance(error, covariance, result) : 0;
  calibration.rotation2 = error.tail<3>().squaredNorm();
  calibration.translation2 = (truth.translation() - result.X.mean.translation()).squaredNorm();
  calibration.chi2_per_dof = result.chi2 / result.degrees_of_freedom;
  fit.mu2 = result.chi2;
  std::size_t missed = 0, lost = 0, inliers = 0;
  if (row.outliers && !result.pairs.empty()) {
    for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
      missed += !scene.inlier[i] && result.pairs[i].inlier;
      lost += scene.inlier[i] && !result.pairs[i].inlier;
      inliers += scene.inlier[i];
    }
    calibration.lost = static_cast<double>(lost) / static_cast<double>(inliers);
  }
  const int open = static_cast<int>(result.directions.size());
  calibration.right = (row.outliers ? missed == 0 : open == openDimension(row.motion)) ? 1 : 0;
  return outcomes;
}

}  // namespace

std::string name(HandEyeExperiment experiment) {
  constexpr const char* names[] = {"accuracy", "motions", "outliers", "formulations"};
  return names[static_cast<std::size_t>(experiment)];
}

std::string name(HandEyeFormulation formulation) {
  constexpr const char* names[] = {"poses", "motions", "consecutive", "to_first", "all_pairs", "all_pairs_scaled"};
  return names[static_cast<std::size_t>(formulation)];
}

std::string noiseName(const HandEyeRow& row) {
  return row.scale == 1 ? name(row.noise) : fmt::format("{} x{:g}", name(row.noise), row.scale);
}

std::string label(const HandEyeRow& row) {
  std::string text = fmt::format("{} {} n = {}", name(row.formulation), noiseName(row), row.pairs);
  if (row.motion != HandEyeMotion::general) text += std::string(" ") + name(row.motion);
  if (row.outliers) text += std::string(" ") + name(*row.outliers);
  return row.fit ? text + ", fit" : text;
}

Judgement judgementOf(const std::vector<HandEyeRow>& rows) {
  Judgement judgement{.promises = {}, .where = "where they are promised"};
  for (const HandEyeRow& row : rows) {
    const std::string text = name(row.experiment) + " " + label(row);
    judgement.promises.push_back({text, row.right_passed, fmt::format("{} of {} trials right", row.right, row.trials),
                                  static_cast<double>(row.right), static_cast<double>(row.trials)});
    judgement.promises.push_back(promiseAbout(row, text));
  }
  return judgement;
}

std::vector<HandEyeRow> validateHandEye(const HandEyeValidation& validation, const RunProgress& progress) {
  std::vector<Plan> plans;
  std::vector<CellSize> cells;
  double judged = 0;
  for (const Experiment experiment : validation.experiments) {
    for (Plan& plan : plansOf(experiment, validation)) {
      cells.push_back({validation.run.trials, plan.cost()});
      judged += (plan.calibration ? 1 : 0) + (plan.fit ? 1 : 0);
      plans.push_back(std::move(plan));
    }
  }
  CellRun run(validation.run, cells, progress);
  std::vector<HandEyeRow> rows;
  for (const Plan& plan : plans) {
    const bool independent = plan.row.formulation == Formulation::motions;
    const int n = static_cast<int>(plan.row.pairs), open = openDimension(plan.row.motion);
    auto reports = run.reports(
        4, {ReferenceLaw::chiSquared(6 - open), ReferenceLaw::chiSquared(6 * n - (independent ? 6 : 12) + open)},
        [&](CounterRng&, std::uint64_t number) {
          return runTrial(plan, validation.noise_factor, validation.run.seed, number);
        });
    if (run.ended()) continue;

    HandEyeRow row = plan.row;
    row.trials = reports[0].trials;
    const auto root = [&](double Outcome::*of, double& value, double& error) {
      const auto statistic = reports[0].of(of);
      value = std::sqrt(statistic.mean);
      error = 0.5 * statistic.standard_deviation / (value * std::sqrt(static_cast<double>(statistic.count)));
    };
    root(&Outcome::rotation2, row.rms_rotation, row.rms_rotation_error);
    root(&Outcome::translation2, row.rms_translation, row.rms_translation_error);
    row.chi2_per_dof = reports[0].of(&Outcome::chi2_per_dof).mean;
    row.lost = reports[0].of(&Outcome::lost).mean;
    row.right = static_cast<std::size_t>(
        std::lround(reports[0].of(&Outcome::right).mean * static_cast<double>(reports[0].of(&Outcome::right).count)));
    if (plan.judges_right) row.right_passed = row.right == row.trials;
    for (const bool fit : {false, true}) {
      if (fit && !plan.fit) continue;
      HandEyeRow judged_row = row;
      judged_row.fit = fit;
      if (fit) judged_row.right_passed.reset();
      judged_row.conclude(std::move(reports[fit ? 1 : 0]), fit ? plan.fit : plan.calibration, run_false_alarm / judged);
      rows.push_back(std::move(judged_row));
    }
  }
  return rows;
}

}  // namespace liestat::experiments
