// Definitions of fusion/convention_diagnosis.hpp; docs/theory/trajectories.md, sections 6 to 8.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <fusion/nearest_in_time.hpp>
#include <fusion/trajectories/detail/ranked_conventions.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

LIESTAT_FUSION_INLINE MatrixStructure matrixStructure(std::span<const DiagnosedPose> poses) {
  using detail::Matrix6d;
  MatrixStructure s;
  s.n = poses.size();
  if (poses.empty()) return s;
  s.constant = poses.size() > 1, s.diagonal = s.no_cross = s.isotropic_blocks = s.rank_one = true;
  s.zero_variance.fill(true);
  const Matrix6d first = poses[0].matrix;
  for (const DiagnosedPose& p : poses) {
    if (!detail::blocksFinite(p.matrix)) {
      ++s.unknown;
      continue;
    }
    const bool no_cross_given = detail::crossUnknown(p.matrix);
    s.blocks_only = s.blocks_only || no_cross_given;
    const Matrix6d M = no_cross_given ? detail::withoutCross(p.matrix) : p.matrix;
    const auto unit = [&](int i, int j) { return std::sqrt(std::abs(M(i, i) * M(j, j))); };
    s.indefinite += !detail::Cholesky<double, 6>(M).ok();
    bool symmetric = true;
    for (int i = 0; i < 6; ++i) {
      s.zero_variance[static_cast<std::size_t>(i)] = s.zero_variance[static_cast<std::size_t>(i)] && M(i, i) == 0;
      for (int j = 0; j < i; ++j) {
        symmetric = symmetric && !(std::abs(M(i, j) - M(j, i)) > 1e-6 * unit(i, j));
        const bool zero = std::abs(M(i, j)) <= 1e-9 * unit(i, j);
        s.diagonal = s.diagonal && zero;
        s.no_cross = s.no_cross && (i / 3 == j / 3 || zero);
        s.isotropic_blocks =
            s.isotropic_blocks && zero && (i / 3 != j / 3 || std::abs(M(i, i) - M(j, j)) <= 1e-3 * unit(i, j));
        s.rank_one =
            s.rank_one && std::abs(M(i, j) * M(j, i) - M(i, i) * M(j, j)) <= 1e-9 * std::abs(M(i, i) * M(j, j));
      }
    }
    s.asymmetric += !symmetric;
    s.constant = s.constant && (no_cross_given || p.matrix == first);
  }
  return s;
}

LIESTAT_FUSION_INLINE ChainDiagnosis diagnoseChain(std::span<const DiagnosedPose> poses,
                                                   std::span<const Convention> hypotheses) {
  using namespace detail;
  ChainDiagnosis d;
  const DiagnosisData data(poses, false);
  const std::vector<Convention> all =
      hypotheses.empty() ? conventionHypotheses() : std::vector<Convention>(hypotheses.begin(), hypotheses.end());
  if (data.size() < 10) {
    d.reason = "fewer than ten poses";
    return d;
  }
  if (data.blocks_only) {
    d.reason = "the cross block is unknown, and the chain condition needs it";
    return d;
  }
  d.steps = data.size() - 1;
  std::vector<Matrix6d> A(data.size());
  for (std::size_t i = 1; i < data.size(); ++i) {
    A[i] = (data.poses[i].estimate.inverse() * data.poses[i - 1].estimate).Adj();
  }
  for (const Convention& c : all) {
    std::size_t indefinite = 0;
    Matrix6d before = covarianceUnder(data, 0, {.convention = c});
    for (std::size_t i = 1; i < data.size(); ++i) {
      const Matrix6d now = covarianceUnder(data, i, {.convention = c});
      const Matrix6d carried = congruence(A[i], before);
      // Six printed digits lose 2e-5 of the largest entry of each block, in units of that block.
      Vector6d tolerance;
      const double t = std::max(now.topLeftCorner<3, 3>().diagonal().maxCoeff(),
                                carried.topLeftCorner<3, 3>().diagonal().maxCoeff());
      const double r = std::max(now.bottomRightCorner<3, 3>().diagonal().maxCoeff(),
                                carried.bottomRightCorner<3, 3>().diagonal().maxCoeff());
      tolerance << Eigen::Vector3d::Constant(2e-5 * t), Eigen::Vector3d::Constant(2e-5 * r);
      indefinite += !now.allFinite() || !semidefinite(now - carried, tolerance);
      before = now;
    }
    d.fits.push_back({c, static_cast<double>(indefinite) / static_cast<double>(d.steps)});
  }
  std::stable_sort(d.fits.begin(), d.fits.end(),
                   [](const ChainFit& a, const ChainFit& b) { return a.indefinite < b.indefinite; });
  const double best = d.fits.front().indefinite;
  d.is_chain = best < 0.5;
  if (!d.is_chain) {
    d.reason = "under no convention does the covariance grow as in dead reckoning (" + significant(100 * best, 2) +
               " % of the steps shrink it at best): smoothed, or corrected often";
    return d;
  }
  const double bound = 2 * best + 0.02 + 2 / static_cast<double>(d.steps);
  for (const ChainFit& f : d.fits) {
    if (f.indefinite <= bound) d.accepted.push_back(f.convention);
  }
  d.reason = d.accepted.size() == 1 ? "one convention makes it dead reckoning"
                                    : std::to_string(d.accepted.size()) + " conventions make it dead reckoning";
  return d;
}

namespace detail {

/// Independent increments of a chain: η_i = ξ_i - A ξ_{i-1} with Q_i, ranked among the accepted conventions.
inline void rankIncrements(const DiagnosisData& data, ChainDiagnosis& chain, double alpha) {
  const std::size_t n = data.size(), h = chain.accepted.size();
  std::vector<double> likelihood(h, 0), nees(h, 0);
  std::size_t used = 0;
  for (std::size_t i = 1; i < n; ++i) {
    const SE3d motion = data.poses[i - 1].estimate.inverse() * data.poses[i].estimate;
    const SE3d truth = data.poses[i - 1].truth.inverse() * data.poses[i].truth;
    const Vector6d eta = (motion.inverse() * truth).log();
    const Matrix6d A = motion.inverse().Adj();
    std::vector<double> d2(h), log_det(h);
    bool all = true;
    for (std::size_t k = 0; k < h && all; ++k) {
      const HypothesisFit f{.convention = chain.accepted[k]};
      const Matrix6d Q = covarianceUnder(data, i, f) - congruence(A, covarianceUnder(data, i - 1, f));
      const Cholesky<double, 6> root(Q);
      all = root.ok();
      d2[k] = root.halfSolve<1>(eta).squaredNorm(), log_det[k] = root.logDeterminant();
    }
    if (!all) continue;
    ++used;
    for (std::size_t k = 0; k < h; ++k) nees[k] += d2[k], likelihood[k] += -0.5 * d2[k] - 0.5 * log_det[k];
  }
  if (used < 10) return;
  const auto best =
      static_cast<std::size_t>(std::max_element(likelihood.begin(), likelihood.end()) - likelihood.begin());
  const double margin = std::log(static_cast<double>(conventionHypotheses().size()) / alpha);
  std::vector<Convention> kept{chain.accepted[best]};
  for (std::size_t k = 0; k < h; ++k) {
    if (k != best && likelihood[k] > likelihood[best] - margin) kept.push_back(chain.accepted[k]);
  }
  chain.accepted = kept;
  chain.increments = neesTest(nees[best], 6 * static_cast<double>(used));
}

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

LIESTAT_FUSION_INLINE std::vector<PlanRow> planDiagnosis(std::span<const DiagnosedPose> poses,
                                                         std::span<const Convention> of,
                                                         const DiagnosisOptions& options) {
  using namespace detail;
  std::vector<DiagnosedPose> thin;
  const std::size_t used = std::min<std::size_t>(poses.size(), 40);
  for (std::size_t k = 0; k < used; ++k) thin.push_back(poses[k * poses.size() / used]);
  for (DiagnosedPose& p : thin) p.truth = p.estimate;
  const DiagnosisData data(thin, false);
  const std::vector<Convention> all = options.hypotheses.empty() ? conventionHypotheses() : options.hypotheses;
  struct Prepared {
    Convention convention;
    std::vector<Matrix6d> half;  ///< L⁻¹
    std::vector<Matrix6d> covariance;
    double log_det = 0;
    bool ok = true;
  };
  const auto prepare = [&](const Convention& c) {
    Prepared p;
    p.convention = c;
    p.ok = data.decidable(c) && data.size() > 0;
    for (std::size_t i = 0; i < data.size() && p.ok; ++i) {
      const Matrix6d S = covarianceUnder(data, i, {.convention = c});
      const Cholesky<double, 6> root(S);
      p.ok = root.ok();
      p.covariance.push_back(S);
      p.half.push_back(root.halfSolve<6>(Matrix6d::Identity()));
      p.log_det += root.logDeterminant();
    }
    return p;
  };
  std::vector<Prepared> prepared;
  prepared.reserve(all.size());
  for (const Convention& c : all) prepared.push_back(prepare(c));
  const double margin = std::log(static_cast<double>(all.size()) / options.alpha) * (data.blocks_only ? 2 : 1);
  std::vector<PlanRow> rows;
  const std::vector<Convention> wanted = of.empty() ? all : std::vector<Convention>(of.begin(), of.end());
  for (const Convention& c : wanted) {
    const Prepared h = prepare(c);
    if (!h.ok) continue;
    PlanRow row;
    row.convention = row.nearest = c;
    row.divergence = infinity;
    for (const Prepared& g : prepared) {
      if (!g.ok || g.convention == c) continue;
      double sum = g.log_det - h.log_det - 6 * static_cast<double>(data.size());
      for (std::size_t i = 0; i < data.size(); ++i) {
        sum += product(product(g.half[i], h.covariance[i]), Matrix6d(g.half[i].transpose())).trace();
      }
      const double divergence = 0.5 * sum / static_cast<double>(data.size());
      if (divergence < 1e-9) {
        row.equal.push_back(g.convention);
      } else if (divergence < row.divergence) {
        row.divergence = divergence, row.nearest = g.convention;
      }
    }
    row.poses = std::isinf(row.divergence) ? 0 : std::ceil(2 * margin / row.divergence);
    rows.push_back(row);
  }
  return rows;
}

LIESTAT_FUSION_INLINE RunAgainstTruth runAgainstTruth(const PoseTrajectory& truth, const PoseTrajectory& estimate,
                                                      const AssociationOptions& options) {
  RunAgainstTruth r;
  const std::string truth_name = truth.name.empty() ? "the truth" : truth.name;
  const std::string estimate_name = estimate.name.empty() ? "the estimate" : estimate.name;
  std::vector<double> times = truth.times;
  std::vector<Gaussian<SE3d>> poses = truth.poses;
  if (options.start || options.end) {
    const std::vector<std::size_t> rows = rowsBetween(truth.times, options.start, options.end);
    if (rows.empty()) {
      r.status = truth.times.empty() ? EvaluationStatus::times_missing : EvaluationStatus::empty_interval;
      r.reason = truth.times.empty() ? truth_name + " has no times, and a part of it is asked for"
                                     : "no pose of " + truth_name + " is between the given times";
      return r;
    }
    times.clear(), poses.clear();
    for (const std::size_t i : rows) times.push_back(truth.times[i]), poses.push_back(truth.poses[i]);
  }
  const Associated associated =
      associate({times, poses.size(), truth_name}, {estimate.times, estimate.poses.size(), estimate_name}, options);
  r.status = associated.status, r.reason = associated.reason;
  if (!r.ok()) return r;
  const std::vector<MatchedPose> matched =
      matchedPoses(associated.matches, poses, estimate.poses, options.interpolation);
  for (std::size_t k = 0; k < matched.size(); ++k) {
    r.run.poses.push_back({matched[k].estimate.mean, matched[k].estimate.covariance, matched[k].reference.mean});
    if (!estimate.times.empty()) r.run.times.push_back(estimate.times[associated.matches[k].estimate]);
  }
  const std::string suspicion = suspectQuaternionOrder(matched, truth_name, estimate_name);
  if (!suspicion.empty()) r.run.notes.push_back(suspicion);
  if (matched.size() < estimate.poses.size()) {
    r.run.notes.push_back(std::to_string(matched.size()) + " of " + std::to_string(estimate.poses.size()) +
                          " poses of " + estimate_name + " have a partner in " + truth_name);
  }
  return r;
}

LIESTAT_FUSION_INLINE CovarianceDiagnosis diagnoseCovariances(std::span<const DiagnosedRun> runs,
                                                              const CovarianceDiagnosisOptions& options) {
  CovarianceDiagnosis d;
  d.mode = options.mode, d.alignment = options.edges || runs.size() > 1 ? AlignmentModel::none : options.alignment;
  d.assumed.order = options.order.value_or(d.assumed.order);
  d.assumed.content = options.content.value_or(d.assumed.content);
  if (options.edges) d.what = "edges";
  for (const DiagnosedRun& run : runs) d.file_notes.insert(d.file_notes.end(), run.notes.begin(), run.notes.end());
  if (runs.size() == 1) {
    d.poses = runs[0].poses, d.times = runs[0].times;
  } else if (!runs.empty()) {
    const auto timesOf = [](const DiagnosedRun& run) {
      std::vector<double> times = run.times;
      for (std::size_t i = times.size(); i < run.poses.size(); ++i) times.push_back(static_cast<double>(i));
      return times;
    };
    double last = detail::infinity;
    for (const DiagnosedRun& run : runs) {
      if (!run.poses.empty()) last = std::min(last, timesOf(run).back());
    }
    const double at = options.at.value_or(last);
    for (const DiagnosedRun& run : runs) {
      if (!run.poses.empty()) d.poses.push_back(run.poses[nearestInTime(timesOf(run), at)]);
    }
    d.what = "runs at " + significant(at, 10) + " s";
  }
  d.structure = matrixStructure(d.poses);
  DiagnosisOptions fit{.alpha = options.alpha, .alignment = d.alignment, .ordered = runs.size() == 1};
  // A content that format or file fixes leaves fewer hypotheses.
  fit.hypotheses = conventionHypotheses();
  std::erase_if(fit.hypotheses, [&](const Convention& c) {
    return (options.order && c.order != *options.order) || (options.content && c.content != *options.content);
  });
  if (d.mode == DiagnosisMode::diagnosis) {
    d.diagnosis = diagnoseConventions(d.poses, fit);
  } else if (d.mode == DiagnosisMode::chain) {
    d.chain = diagnoseChain(d.poses, fit.hypotheses);
  } else {
    // Those that differ in axes, order and unit; contents are told apart at once.
    std::vector<Convention> of = fit.hypotheses;
    std::erase_if(of, [&](const Convention& c) {
      return c.content != fit.hypotheses.front().content || (!options.all_units && c.unit != RotationUnit::radian);
    });
    d.plan = planDiagnosis(d.poses, of, fit);
  }
  return d;
}

LIESTAT_FUSION_INLINE ConventionReading readInConvention(std::span<const DiagnosedPose> poses,
                                                         const Convention& convention,
                                                         std::optional<AlignmentModel> alignment) {
  ConventionReading reading{convention, {}, {}};
  std::vector<MatchedPose> matched;
  for (const DiagnosedPose& p : poses) {
    detail::Matrix6d matrix = p.matrix;
    for (int i = 0; i < 3; ++i) {
      for (int j = 3; j < 6; ++j) {
        if (std::isnan(matrix(i, j))) matrix(i, j) = matrix(j, i) = 0;
      }
    }
    reading.poses.push_back(fromConvention(convention, p.estimate, matrix));
    matched.push_back({{p.truth, detail::Matrix6d::Zero()}, reading.poses.back()});
  }
  if (alignment) reading.consistency = evaluateConsistency(matched, alignWeighted(matched, *alignment));
  return reading;
}

}  // namespace liestat
