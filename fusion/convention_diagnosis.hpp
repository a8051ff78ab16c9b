// The convention that a file of covariances is in, from its errors against a ground truth, or, for dead reckoning,
// without one. (Needs Boost.Math.)
//
//   std::vector<liestat::DiagnosedPose> poses;  // {estimate, matrix as the file has it, truth}, in order of time
//   const auto diagnosis = liestat::diagnoseConventions(poses);
//   if (diagnosis.verdict == liestat::DiagnosisVerdict::identified) use(diagnosis.accepted.front());
//   else std::puts(diagnosis.reason.c_str());
//
// diagnoseCovariances takes a whole file, with or without a truth, with its runs and what its format fixes. Its
// verdict() is that of `liestat doctor`.
//
// 216 hypotheses (order × perturbation × unit × content) are compared by the likelihood of the errors. The margin
// ln(216/α) is a bound, not a fit: for independent errors the true hypothesis is rejected with probability α at most.
// Several hypotheses within the margin are "undecidable", which is an answer. The list is closed: the best hypothesis,
// and any cause that is named, has to hold against alternatives that are in no list, else the cause is unknown. Where
// neighbouring errors are correlated nothing is decided on absolute errors; the chain condition Σ_i - A Σ_{i-1} Aᵀ ⪰ 0
// of dead reckoning takes their place. Derivations: docs/theory/trajectories.md, sections 6 to 8; measured power, and a
// ledger of bugs: docs/doctor.md.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/convention_diagnosis_types.hpp>
#include <fusion/evaluate_types.hpp>
#include <fusion/pose_stream.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// The 216 hypotheses: two orders, all perturbations but `body_axes`, which is `right` to first order, four units of
/// rotation, three contents.
LIESTAT_TRAJECTORIES_API std::vector<Convention> conventionHypotheses();

LIESTAT_TRAJECTORIES_API MatrixStructure matrixStructure(std::span<const DiagnosedPose> poses);

/// Needs no truth. Says nothing of a common scale, and for `left` nothing of order and unit.
LIESTAT_TRAJECTORIES_API ChainDiagnosis diagnoseChain(std::span<const DiagnosedPose> poses,
                                                      std::span<const Convention> hypotheses = {});

struct DiagnosisOptions {
  double alpha = 1e-3;                              ///< probability of rejecting the truth
  AlignmentModel alignment = AlignmentModel::none;  ///< none, posyaw, se3 or sim3: the truth's world is another
  std::vector<Convention> hypotheses = {};          ///< empty: conventionHypotheses()
  std::size_t max_aligned = 2000;  ///< poses, evenly spaced, from which hypotheses are ranked with an alignment
  bool ordered = true;             ///< false: poses are of different runs, and neighbours mean nothing
};

/// Finds the conventions that explain the errors. Fewer than ten usable poses are "undecidable".
LIESTAT_TRAJECTORIES_API ConventionDiagnosis diagnoseConventions(std::span<const DiagnosedPose> poses,
                                                                 const DiagnosisOptions& options = {});

/// Rows of the convention candidates `of` (empty: all) against all hypotheses. At most 40 poses, evenly spaced, are
/// used.
LIESTAT_TRAJECTORIES_API std::vector<PlanRow> planDiagnosis(std::span<const DiagnosedPose> poses,
                                                            std::span<const Convention> of = {},
                                                            const DiagnosisOptions& options = {});

/// A run of a file: poses in order of time.
struct DiagnosedRun {
  std::vector<DiagnosedPose> poses;
  std::vector<double> times = {};       ///< s; empty: the numbers of the rows
  std::vector<std::string> notes = {};  ///< remarks on its file, in sentences
  PoseStream truth = {};                ///< the truth by itself, where there are times: tells faults of the clock
  double offset = 0;                    ///< s, added to the times before they were compared with the truth's
};

/// A run and the truth at its times. If `status` is not ok, `reason` says why there is none.
struct RunAgainstTruth {
  EvaluationStatus status = EvaluationStatus::ok;
  std::string reason = {};
  DiagnosedRun run = {};

  bool ok() const { return status == EvaluationStatus::ok; }
};

/// The poses of an estimate that have a partner in the truth, by the rules of evaluateTrajectory(). The covariances of
/// the estimate are the matrices as the file has them. Notes: quaternions that look as if w came first, and how many
/// poses have no partner.
LIESTAT_TRAJECTORIES_API RunAgainstTruth runAgainstTruth(const PoseTrajectory& truth, const PoseTrajectory& estimate,
                                                         const AssociationOptions& options = {});

struct CovarianceDiagnosisOptions {
  DiagnosisMode mode = DiagnosisMode::diagnosis;
  double alpha = 1e-3;                              ///< probability of rejecting the true convention
  AlignmentModel alignment = AlignmentModel::none;  ///< alignment of one run of poses: none, posyaw, se3 or sim3
  std::optional<CovarianceOrder> order = {};        ///< that the format fixes
  std::optional<CovarianceContent> content = {};    ///< that the format fixes
  bool edges = false;                               ///< the poses are edges of a graph, independent of each other
  bool misfit = false;                              ///< of one run: looks for faults of the whole run (findMisfit)
  bool all_units = false;                           ///< a plan has half and double angles and degrees as well
  std::optional<double> at = {};  ///< s, of several runs: the time of their residuals; the last common one if unset
};

/// The diagnosis of a file. Several runs give one residual each, at one time: those are independent of each other,
/// while neighbouring errors of one run may not be; they are not aligned. A misfit stands before all else: what it
/// explains is no noise, so that no convention is judged by it. No run, or runs without poses: nothing is
/// decided.
LIESTAT_TRAJECTORIES_API CovarianceDiagnosis diagnoseCovariances(std::span<const DiagnosedRun> runs,
                                                                 const CovarianceDiagnosisOptions& options = {});

/// The poses in a convention and, with an alignment to the truth, the consistency of their errors. Unknown cross blocks
/// count as zero.
LIESTAT_TRAJECTORIES_API ConventionReading readInConvention(std::span<const DiagnosedPose> poses,
                                                            const Convention& convention,
                                                            std::optional<AlignmentModel> alignment);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/diagnose_runs.hpp>
#endif
