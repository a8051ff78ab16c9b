// Definitions of fusion/convention_diagnosis.hpp: a diagnosis of runs against their truths, its plan before data are
// there, and a reading of the poses in a convention; docs/theory/trajectories.md, sections 6 to 8.
#pragma once

#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <fusion/nearest_in_time.hpp>
#include <fusion/trajectories/detail/diagnose_conventions.hpp>
#include <fusion/trajectories/detail/run_misfit.hpp>
#include <fusion/trajectories/detail/ranked_conventions.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

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
  NoisyPoses poses = truth.poses;
  if (options.start || options.end) {
    const std::vector<std::size_t> rows = rowsBetween(truth.times, options.start, options.end);
    if (rows.empty()) {
      r.status = truth.times.empty() ? EvaluationStatus::times_missing : EvaluationStatus::empty_interval;
      r.reason = truth.times.empty() ? truth_name + " has no times, and a part of it is asked for"
                                     : "no pose of " + truth_name + " is between the given times";
      return r;
    }
    times.clear(), poses = truth.poses.rows(rows);
    for (const std::size_t i : rows) times.push_back(truth.times[i]);
  }
  const Associated associated =
      associate({times, poses.size(), truth_name}, {estimate.times, estimate.poses.size(), estimate_name}, options);
  r.status = associated.status, r.reason = associated.reason;
  if (!r.ok()) {
    if (detail::lacksPartners(r.status)) {
      r.reason = detail::reasonWithTimes(r.reason, estimate.times, estimate.poses, times, poses, options.offset);
    }
    return r;
  }
  const MatchedPoses matched = matchedPoses(associated.matches, poses, estimate.poses, options.interpolation, times);
  for (std::size_t k = 0; k < matched.size(); ++k) {
    r.run.poses.push_back({matched.estimate.mean(k), matched.estimate.covariance(k), matched.reference.mean(k)});
    if (!estimate.times.empty()) r.run.times.push_back(estimate.times[associated.matches[k].estimate]);
  }
  if (associated.by_time) r.run.truth = detail::streamOf(times, poses), r.run.offset = options.offset;
  if (associated.by_time && detail::fewPartners(matched.size(), estimate.poses.size())) {
    const MisfitSearch of_times =
        findTimeScale(detail::streamOf(estimate.times, estimate.poses), r.run.truth, options.offset);
    if (of_times.found()) r.run.notes.push_back(of_times.sentence());
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
    if (options.misfit && runs.size() == 1 && !options.edges) {
      MatchedPoses matched;
      for (const DiagnosedPose& p : d.poses) {
        matched.push_back({{p.truth, detail::Matrix6d::Zero()}, {p.estimate, detail::Matrix6d::Zero()}});
      }
      d.misfit = detail::misfitOf(matched, d.times, runs[0].truth, d.alignment, runs[0].offset);
    }
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
