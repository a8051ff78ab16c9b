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
  for (int k = 1; k <= static_cast<int>(MatrixFault::blocks_alone); ++k) list.push_back(static_cast<MatrixFault>(k));
  return list;
}

/// The level at which an explanation has to hold to be named: few poses refute little, so that more is asked of them.
/// Whatever does not hold is wrong for an unknown reason, which costs nothing but the name.
inline constexpr double naming_level = 0.01;
inline double namingLevel(std::size_t n) {
  constexpr double poses = 300, most = 0.25;
  return std::clamp(naming_level * std::pow(poses / static_cast<double>(n), 2), naming_level, most);
}
/// The same for a convention that explains the errors without more ado.
inline double identifyingLevel(std::size_t n) {
  constexpr double poses = 300, most = 0.05;
  return std::clamp(naming_level * poses / static_cast<double>(n), naming_level, most);
}
/// Poses in a half, and nats by which scales have to lead over faults that can be undone.
inline constexpr std::size_t min_half = 20;
inline constexpr double least_lead = 5, few_poses = 150;
/// In variance, by which scales have to differ from one.
inline constexpr double least_factor = 1.6;

/// The poses of a run from the first one of a half on, which did not choose what is tested on them, or did.
inline DiagnosisData halfOf(const DiagnosisData& data, bool second) {
  const std::size_t middle = data.size() / 2;
  const std::span<const DiagnosedPose> all(data.poses);
  return DiagnosisData(second ? all.subspan(middle) : all.first(middle), true);
}

inline std::vector<HypothesisFit> faultyHypotheses(const std::vector<Convention>& hypotheses) {
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
  return faulty;
}

/// No convention alone explains the errors: a fault that can be undone, or scales, if one of them does it better than
/// the other, on the half of the poses that did not choose it, and against alternatives that are in no list. Else the
/// cause is unknown, and the likeliest is said as such.
inline void nameCause(const DiagnosisData& data, const std::vector<Convention>& hypotheses,
                      const DiagnosisOptions& options, ConventionDiagnosis& d) {
  const bool usable = !d.fits.empty() && !std::isinf(d.fits.front().log_likelihood);
  std::string like = usable ? describe(d.fits.front().convention) : "";
  if (options.alignment == AlignmentModel::none) {
    // Likelihoods relative to that of the scales: absolute ones are those of the profile.
    const bool may_hold = data.size() >= 2 * min_half;
    const double level = namingLevel(data.size());
    d.scale = profileScale(data, conventionHypotheses(), options.alpha);
    std::vector<HypothesisFit> faulty;
    if (!data.blocks_only) faulty = faultyHypotheses(hypotheses);
    rank(data, faulty, options);
    const bool repairable = !faulty.empty() && !std::isinf(faulty.front().log_likelihood);
    const double of_fault = repairable ? likelihoodOf(data, faulty.front()) : -infinity;
    const double lead = of_fault - d.scale->log_likelihood;
    // Few poses hardly see a wrong shape, so that the lead has to be the larger.
    const double margin = std::log(static_cast<double>(faulty.size() + hypotheses.size()) / options.alpha) *
                          (1 + few_poses / static_cast<double>(data.size()));
    if (repairable && lead > margin) {
      const HypothesisFit& best = faulty.front();
      std::vector<HypothesisFit> near;
      bool alone = true;
      for (const HypothesisFit& f : faulty) {
        if (f.log_likelihood > -margin) near.push_back(f), alone = alone && f.fault == best.fault;
      }
      like = std::string(describe(best.fault)) + " (" + describe(best.convention) + ")";
      const Agreement agreement = agreementUnder(data, best);
      bool holds = may_hold && alone && agreement.p() > level && best.fault < MatrixFault::diagonal_alone;
      if (holds) {
        const DiagnosisData first = halfOf(data, false), second = halfOf(data, true);
        std::vector<HypothesisFit> chosen = faultyHypotheses(hypotheses);
        rank(first, chosen, options);
        holds = chosen.front().fault == best.fault && agreementUnder(second, chosen.front()).p() > naming_level;
      }
      if (holds) {
        d.fault = best.fault, d.fits = near, d.tests = agreement.tests, d.generic_p = agreement.generic_p;
        d.scale.reset();
        for (const HypothesisFit& f : near) d.accepted.push_back(f.convention);
        d.reason = like;
        return;
      }
    } else if (!d.scale->accepted.empty()) {
      const Agreement agreement{d.scale->tests, d.scale->generic_p};
      const std::vector<std::string> words = d.scale->words();
      std::string scales;
      for (std::size_t k = 0; k < words.size(); ++k) scales += (k > 0 ? "; " : "") + words[k];
      if (!scales.empty()) {
        const std::size_t others = d.scale->accepted.size() - 1;
        like = describe(d.scale->convention) +
               (others > 0 ? " (or " + std::to_string(others) + " others that fit alike)" : "") + ", but " + scales;
      }
      // Wrong shapes look like scales near one, and other contents with scales like powers of the matrices.
      const auto near_one = [](double k) { return std::abs(std::log(k)) < std::log(least_factor); };
      const bool large = !near_one(d.scale->translation) || !near_one(d.scale->rotation);
      const bool of_content = d.scale->convention.content == hypotheses.front().content;
      const double unscaled = usable ? likelihoodOf(data, d.fits.front()) : -infinity;
      bool holds = may_hold && d.scale->log_likelihood > unscaled + margin && large && of_content && !scales.empty() &&
                   agreement.p() > level && lead < -least_lead;
      if (holds) {
        const ScaleProfile first = profileScale(halfOf(data, false), conventionHypotheses(), options.alpha);
        const Convention chosen = first.convention;
        const ScaleProfile second = profileScale(halfOf(data, true), std::span(&chosen, 1), options.alpha);
        holds = (!d.scale->identified || chosen == d.scale->convention) &&
                Agreement{second.tests, second.generic_p}.p() > naming_level;
      }
      if (holds) {
        d.accepted = d.scale->accepted, d.reason = like;
        return;
      }
    }
    const WhitenedResidualTests& t = d.scale->tests;
    noteFired(t.joint.applies() ? t : d.tests, d.notes);
    for (const std::string& w : d.scale->words()) d.notes.push_back(w);
    const Matrix6d S = t.whitened_second_moment;
    if (!S.allFinite()) {
      d.verdict = DiagnosisVerdict::none;
    } else {
      const SymmetricEigen eigen(S);
      if (eigen.values[0] < 1. / 3 || eigen.values[5] > 3) d.verdict = DiagnosisVerdict::none;
    }
  } else {
    noteFired(d.tests, d.notes);
    if (!(d.tests.joint.ratio() < 3 && d.tests.joint.ratio() > 1. / 3)) d.verdict = DiagnosisVerdict::none;
  }
  if (!usable) d.verdict = DiagnosisVerdict::none;
  d.reason = !usable                               ? "under no convention are all matrices positive definite"
             : d.verdict == DiagnosisVerdict::none ? "no convention explains the errors, scales left free"
                                                   : "the errors do not follow the covariances under any convention";
  d.reason += like.empty() ? "; the cause is unknown" : "; the cause is unknown, most like: " + like;
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
  std::vector<Convention> hypotheses = options.hypotheses.empty() ? conventionHypotheses() : options.hypotheses;
  if (d.structure.no_cross || data.blocks_only) {
    // Without a cross block a reversed rotation is the same matrix.
    std::erase_if(hypotheses, [](const Convention& c) { return c.perturbation == Perturbation::world_axes_reversed; });
  }
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
  const Agreement agreement = usable ? agreementUnder(data, fits.front(), options) : Agreement();
  d.tests = agreement.tests;
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
      const Agreement increments = rankIncrements(data, *d.chain, options.alpha);
      d.accepted = d.chain->accepted;
      const bool consistent = !(increments.p() < residual_test_level);
      d.generic_p = increments.generic_p;
      if (d.accepted.size() == 1) {
        d.verdict = consistent ? DiagnosisVerdict::identified : DiagnosisVerdict::inconsistent;
        d.reason = "dead reckoning (errors are correlated, the covariance grows): " + describe(d.accepted.front());
      } else {
        d.verdict = DiagnosisVerdict::undecidable;
        d.reason = "dead reckoning: " + std::to_string(d.accepted.size()) + " conventions let the covariance grow";
      }
      if (!consistent && std::all_of(d.accepted.begin(), d.accepted.end(),
                                     [](const Convention& c) { return c.perturbation == Perturbation::left; })) {
        // The differences of the matrices, as they stand, have to be the covariances of the increments.
        std::vector<PosedResidual> plain = incrementsOf(data, [&](std::size_t i, const Matrix6d&) {
          return Matrix6d(data.content(i, {}) - data.content(i - 1, {}));
        });
        std::erase_if(plain, [](const PosedResidual& r) { return !Cholesky<double, 6>(r.residual.covariance).ok(); });
        const bool is_sum =
            2 * plain.size() > data.size() && agreementOf(plain, {}, false).p() > namingLevel(plain.size());
        d.verdict = DiagnosisVerdict::inconsistent;
        d.reason = is_sum ? "the matrices only grow, but not as those of poses do: increments were added without the "
                            "adjoint"
                          : "wrong, cause unknown: the matrices only grow, but not as those of poses do";
        d.accepted.clear();
      } else if (!consistent) {
        d.verdict = DiagnosisVerdict::inconsistent;
        d.notes.push_back("the increments do not follow the growth of the covariance (NEES ratio " +
                          significant(d.chain->increments.ratio(), 3) + ")");
        noteFired(increments.tests, d.notes);
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
      const Agreement of_steps = agreementUnder(step_data, step_fits.front(), plain);
      if (of_steps.p() > namingLevel(step_data.size()) && (aligned ? fits.front().nees_ratio > 3 : d.growth > 2)) {
        d.increments_as_absolute = true;
        d.tests = of_steps.tests, d.generic_p = of_steps.generic_p;
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

  d.fits = fits, d.generic_p = agreement.generic_p;
  if (agreement.holds()) {
    for (const HypothesisFit& f : fits) {
      if (f.log_likelihood > -d.margin) d.accepted.push_back(f.convention);
    }
    if (d.accepted.size() == 1 && !(d.generic_p < identifyingLevel(d.n))) {
      d.verdict = DiagnosisVerdict::identified;
      d.reason = describe(d.accepted.front());
      if (d.accepted.front().unit == RotationUnit::half_angle) {
        d.notes.push_back("half angles and rotation sigmas twice too small are the same matrix");
      }
      return d;
    }
    d.verdict = DiagnosisVerdict::undecidable;
    if (d.accepted.size() == 1) {
      d.reason = "one convention is the likeliest, but others that are in no list may fit better (p " +
                 significant(d.generic_p, 2) + "): " + describe(d.accepted.front());
      return d;
    }
    const std::vector<PlanRow> plan = planDiagnosis(poses, d.accepted, options);
    d.reason = std::to_string(d.accepted.size()) +
               " conventions explain the errors: " + ambiguity(data, d.structure, d.accepted, plan);
    return d;
  }
  d.verdict = DiagnosisVerdict::inconsistent;
  nameCause(data, hypotheses, options, d);
  return d;
}

}  // namespace liestat
