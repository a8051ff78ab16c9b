// Definitions of fusion/convention_diagnosis.hpp; docs/theory/trajectories.md, sections 6 to 8.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <fusion/trajectories/detail/diagnose_chain.hpp>
#include <fusion/trajectories/detail/ranked_conventions.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

namespace detail {

/// The fields that several accepted hypotheses share.
inline std::string ambiguity(const DiagnosisData& data, const MatrixStructure& structure,
                             const std::vector<Convention>& accepted, const std::vector<PlanRow>& plan) {
  double tilt = 0, turn = 0;
  for (const DiagnosedPose& p : data.poses) {
    const Eigen::Matrix3d R = p.estimate.rotationMatrix();
    tilt = std::max(tilt, std::acos(std::clamp(R(2, 2), -1., 1.)));
    turn = std::max(turn, p.estimate.so3().log().norm());
  }
  const auto only = [&](std::initializer_list<Perturbation> set) {
    return std::all_of(accepted.begin(), accepted.end(), [&](const Convention& c) {
      return std::find(set.begin(), set.end(), c.perturbation) != set.end();
    });
  };
  if (structure.isotropic_blocks) {
    return "blocks s^2 I look alike along any axes: right, fixed axes and body orientation are one matrix";
  }
  if (tilt < 1e-3 && only({Perturbation::world_axes, Perturbation::world_body_axes, Perturbation::roll_pitch_yaw})) {
    return "in planar motion with roll and pitch decoupled, fixed axes, body orientation and roll-pitch-yaw are equal";
  }
  double needed = 0;
  for (const PlanRow& row : plan) needed = std::max(needed, row.poses);
  const std::string more =
      needed > 0 && std::isfinite(needed) ? "; some " + significant(needed, 2) + " poses would decide" : "";
  if (turn < 0.15) return "rotations below 0.15 rad hardly move the axes" + more;
  return "the poses are too few for hypotheses this alike" + more;
}

inline void noteFired(const WhitenedResidualTests& tests, std::vector<std::string>& notes) {
  const auto all = tests.all();
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!all[k].fires()) continue;
    const auto kind = static_cast<ResidualTestKind>(k);
    const bool nees = k < 3;
    notes.push_back(
        std::string(cause(kind, kind == ResidualTestKind::lag ? all[k].statistic > 0 : all[k].ratio() > 1)) + " (" +
        name(kind) + (nees ? " " + significant(all[k].ratio(), 3) : std::string()) +
        ", p = " + significant(all[k].p, 2) + ")");
  }
}

inline std::vector<MatrixFault> faults() {
  std::vector<MatrixFault> list;
  for (int k = 1; k <= static_cast<int>(MatrixFault::next_row); ++k) list.push_back(static_cast<MatrixFault>(k));
  return list;
}

/// The poses of a run as their steps: each step's motion with the matrix of its end, and the true motion.
inline std::vector<DiagnosedPose> steps(const DiagnosisData& data) {
  std::vector<DiagnosedPose> list;
  for (std::size_t i = 1; i < data.size(); ++i) {
    const DiagnosedPose &a = data.poses[i - 1], &b = data.poses[i];
    list.push_back({a.estimate.inverse() * b.estimate, b.matrix, a.truth.inverse() * b.truth});
  }
  return list;
}

}  // namespace detail

LIESTAT_FUSION_INLINE ConventionDiagnosis diagnoseConventions(std::span<const DiagnosedPose> poses,
                                                              const DiagnosisOptions& options) {
  using namespace detail;
  ConventionDiagnosis d;
  const DiagnosisData data(poses, options.alignment == AlignmentModel::none);
  d.n = data.size(), d.skipped = data.skipped;
  d.structure = matrixStructure(poses);
  d.notes = d.structure.words();
  d.exact_coordinates = data.charts;
  const std::vector<Convention> hypotheses = options.hypotheses.empty() ? conventionHypotheses() : options.hypotheses;
  d.margin = std::log(static_cast<double>(hypotheses.size()) / options.alpha) * (data.blocks_only ? 2 : 1);
  if (d.n < 10) {
    d.verdict = DiagnosisVerdict::undecidable;
    d.reason = std::to_string(d.n) + " poses with a matrix are too few, at least ten are needed";
    return d;
  }
  std::vector<HypothesisFit> fits;
  fits.reserve(hypotheses.size());
  for (const Convention& c : hypotheses) fits.push_back({.convention = c});
  rank(data, fits, options);
  const bool usable = !fits.empty() && !std::isinf(fits.front().log_likelihood);
  if (usable) d.tests = testsUnder(data, fits.front(), options);
  for (std::string& omission : d.tests.components.omissions()) d.notes.push_back(std::move(omission));

  // Correlated errors: absolute errors decide nothing.
  if (usable && options.ordered && d.tests.lag.fires() && d.tests.lag.statistic > 0) {
    d.correlated = true;
    const auto half_nees = [&](std::size_t begin, std::size_t end) {
      double sum = 0;
      for (std::size_t i = begin; i < end; ++i) {
        sum += mahalanobisSquared<double, 6>(data.errors[i], covarianceUnder(data, i, fits.front()));
      }
      return sum / static_cast<double>(end - begin);
    };
    const bool aligned = options.alignment != AlignmentModel::none;
    if (!aligned) d.growth = half_nees(data.size() / 2, data.size()) / half_nees(0, data.size() / 2);
    d.chain = diagnoseChain(poses, hypotheses);
    if (d.chain->is_chain) {
      rankIncrements(data, *d.chain, options.alpha);
      d.accepted = d.chain->accepted;
      const bool consistent = !d.chain->increments.fires();
      if (d.accepted.size() == 1) {
        d.verdict = consistent ? DiagnosisVerdict::identified : DiagnosisVerdict::inconsistent;
        d.reason = "dead reckoning (errors are correlated, the covariance grows): " + describe(d.accepted.front());
      } else {
        d.verdict = DiagnosisVerdict::undecidable;
        d.reason = "dead reckoning: " + std::to_string(d.accepted.size()) + " conventions let the covariance grow";
      }
      if (!consistent && std::all_of(d.accepted.begin(), d.accepted.end(),
                                     [](const Convention& c) { return c.perturbation == Perturbation::left; })) {
        d.verdict = DiagnosisVerdict::inconsistent;
        d.reason = "the matrices only grow, but not as those of poses do: increments were added without the adjoint";
      }
      if (!consistent) {
        d.notes.push_back("the increments do not follow the growth of the covariance (NEES ratio " +
                          significant(d.chain->increments.ratio(), 3) + ")");
      }
      if (d.chain->increments.applies() || d.accepted.size() > 1) return d;
    }
    // Steps' covariances on absolute poses: the increments fit them, the absolute errors outgrow them.
    const std::vector<DiagnosedPose> step_poses = steps(data);
    const DiagnosisData step_data(step_poses, true);
    std::vector<HypothesisFit> step_fits;
    step_fits.reserve(hypotheses.size());
    for (const Convention& c : hypotheses) step_fits.push_back({.convention = c});
    DiagnosisOptions plain = options;
    plain.alignment = AlignmentModel::none;
    rank(step_data, step_fits, plain);
    if (!step_fits.empty() && !std::isinf(step_fits.front().log_likelihood)) {
      const WhitenedResidualTests tests = testsUnder(step_data, step_fits.front(), plain);
      if (tests.joint.p >= residual_test_level && !tests.lag.fires() &&
          (aligned ? fits.front().nees_ratio > 3 : d.growth > 2)) {
        d.increments_as_absolute = true;
        d.tests = tests;
        d.verdict = DiagnosisVerdict::inconsistent;
        for (const HypothesisFit& f : step_fits) {
          if (f.log_likelihood > -d.margin) d.accepted.push_back(f.convention);
        }
        d.fits = step_fits;
        d.reason = "increments fused as absolute: each pose carries the covariance of its last step";
        if (d.accepted.size() == 1) d.reason += " (" + describe(d.accepted.front()) + ")";
        return d;
      }
    }
    if (d.chain->is_chain) return d;
    d.verdict = DiagnosisVerdict::undecidable;
    d.reason =
        "neighbouring errors are correlated, and it is no dead reckoning: one residual per run at one time, of "
        "several runs, would decide";
    d.notes.push_back(d.chain->reason);
    return d;
  }

  d.fits = fits;
  for (const HypothesisFit& f : fits) {
    if (usable && f.log_likelihood > -d.margin) d.accepted.push_back(f.convention);
  }
  if (d.tests.consistent()) {
    if (d.accepted.size() == 1) {
      d.verdict = DiagnosisVerdict::identified;
      d.reason = describe(d.accepted.front());
      if (d.accepted.front().unit == RotationUnit::half_angle) {
        d.notes.push_back("half angles and rotation sigmas twice too small are the same matrix");
      }
    } else {
      d.verdict = DiagnosisVerdict::undecidable;
      const std::vector<PlanRow> plan = planDiagnosis(poses, d.accepted, options);
      d.reason = std::to_string(d.accepted.size()) +
                 " conventions explain the errors: " + ambiguity(data, d.structure, d.accepted, plan);
    }
    return d;
  }

  // No convention alone: a fault that can be undone, or scales.
  d.verdict = DiagnosisVerdict::inconsistent;
  if (!data.blocks_only && options.alignment == AlignmentModel::none) {
    std::vector<HypothesisFit> faulty;
    for (const MatrixFault fault : faults()) {
      const bool is_frame = fault >= MatrixFault::lever_arm_sign && fault <= MatrixFault::adjoint_transposed;
      for (const Convention& c : hypotheses) {
        if (c.unit != RotationUnit::radian || c.content != CovarianceContent::covariance) continue;
        if (is_frame && c.perturbation != Perturbation::right) continue;
        if (c.perturbation == Perturbation::transposed_axes || c.perturbation == Perturbation::yaw_pitch_roll) continue;
        faulty.push_back({.convention = c, .fault = fault});
      }
    }
    rank(data, faulty, options);
    const double margin = std::log(static_cast<double>(faulty.size() + hypotheses.size()) / options.alpha);
    std::vector<HypothesisFit> near;
    for (const HypothesisFit& f : faulty) {
      if (f.log_likelihood > -margin) near.push_back(f);
    }
    if (!near.empty() && testsUnder(data, near.front(), options).consistent()) {
      d.fault = near.front().fault;
      d.accepted.clear();
      std::string others;
      for (const HypothesisFit& f : near) {
        d.accepted.push_back(f.convention);
        if (f.fault != d.fault) others = std::string("; or: ") + describe(f.fault);
      }
      d.fits = near;
      d.reason = std::string(describe(d.fault)) + others + " (" + describe(d.accepted.front()) + ")";
      return d;
    }
  }
  if (!usable) {
    d.verdict = DiagnosisVerdict::none;
    d.reason = "under no convention are all matrices positive definite";
    return d;
  }
  if (options.alignment == AlignmentModel::none) {
    d.scale = profileScale(data, options);
    const WhitenedResidualTests& t = d.scale->tests;
    d.accepted = d.scale->accepted;
    if (!d.accepted.empty() && t.consistent()) {
      d.reason = describe(d.scale->convention) + ", but ";
      const std::vector<std::string> words = d.scale->words();
      for (std::size_t k = 0; k < words.size(); ++k) d.reason += (k > 0 ? "; " : "") + words[k];
      return d;
    }
    noteFired(t.joint.applies() ? t : d.tests, d.notes);
    for (const std::string& w : d.scale->words()) d.notes.push_back(w);
    const Matrix6d S = t.whitened_second_moment;
    if (!S.allFinite()) {
      d.verdict = DiagnosisVerdict::none;
    } else {
      const detail::SymmetricEigen eigen(S);
      if (eigen.values[0] < 1. / 3 || eigen.values[5] > 3) d.verdict = DiagnosisVerdict::none;
    }
  } else {
    noteFired(d.tests, d.notes);
    if (!(d.tests.joint.ratio() < 3 && d.tests.joint.ratio() > 1. / 3)) d.verdict = DiagnosisVerdict::none;
  }
  d.reason = d.verdict == DiagnosisVerdict::none
                 ? "no convention explains the errors, scales left free"
                 : "the errors do not follow the covariances under the nearest convention, " +
                       describe(d.accepted.empty() ? d.fits.front().convention : d.accepted.front());
  return d;
}

}  // namespace liestat
