// Results of the diagnosis of conventions (fusion/convention_diagnosis.hpp): the looks of a file's matrices, the
// conventions that explain its errors, and the verdict; for units that only show them. (Needs Boost.Math.)
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/trajectories_types.hpp>
#include <fusion/trajectory_misfit_types.hpp>
#include <stats/convention_presets.hpp>
#include <stats/conventions.hpp>
#include <stats/shown.hpp>
#include <stats/verdict.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// A pose with its matrix as a file has it (layout undone, NaN for unknown entries), and the true pose. For edges of a
/// pose graph: the measured and the true relative pose.
struct DiagnosedPose {
  SE3d estimate;
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Identity();
  SE3d truth = {};
};

/// The convention in words: "translation first, perturbation right, rotations in rad, covariance".
std::string describe(const Convention& convention);

/// Faults in how a matrix was written that are no convention, but can be undone.
enum class MatrixFault {
  none,
  cross_sign,          ///< the cross block has the wrong sign
  cross_transposed,    ///< the cross block is transposed: blocks were exchanged without it
  off_diagonal_half,   ///< off-diagonals are halved: a triangular matrix was symmetrised
  off_diagonal_twice,  ///< off-diagonals are doubled: both triangles were added
  factor,              ///< the lower triangle is that of the Cholesky factor L
  factor_averaged,     ///< the same, its two triangles averaged
  factor_transposed,   ///< LᵀL instead of L Lᵀ
  information_factor,  ///< the upper triangle is the square root R of the information RᵀR
  squared,             ///< variances as sigmas: each was squared once more
  matrix_squared,      ///< the matrix was multiplied by itself
  inverse_diagonal,    ///< the diagonal of the information, inverted entry by entry elsewhere
  reversed,            ///< the six coordinates are in reverse order
  axes_ned_enu,        ///< x and y exchanged, z reversed: NED read as ENU
  axes_optical,        ///< axes of a camera (z forward) read as those of a body (x forward)
  axes_from_optical,   ///< the other way round
  axes_y_up,           ///< y up read as z up
  lever_arm_sign,      ///< the adjoint with the wrong sign of its lever arm
  adjoint_inverse,     ///< the adjoint of the inverse pose
  adjoint_transposed,  ///< the transposed adjoint
  previous_row,        ///< each row has the matrix of the row before
  next_row,            ///< each row has the matrix of the row after
  diagonal_alone,      ///< generic, never named: off-diagonals have nothing to do with the errors
  blocks_alone,        ///< the same of the cross block
};
/// In words.
const char* describe(MatrixFault fault);
/// The enumerator's name, for files.
const char* name(MatrixFault fault);

/// The looks of a file's matrices, before any error is seen.
struct MatrixStructure {
  std::size_t n = 0;
  std::size_t unknown = 0;     ///< matrices with unknown entries outside of the cross block: not used
  std::size_t indefinite = 0;  ///< not positive definite
  std::size_t asymmetric = 0;  ///< by more than 1e-6 of the sigmas
  bool blocks_only = false;    ///< the cross block is unknown
  bool constant = false;       ///< all are the same
  bool diagonal = false, no_cross = false, isotropic_blocks = false;
  std::array<bool, 6> zero_variance{};  ///< coordinates, in the file's order, with zero variance in all matrices
  bool rank_one = false;                ///< every 2×2 minor vanishes
  std::vector<std::string> words() const;
};

/// A hypothesis and the errors' likelihood under it.
struct HypothesisFit {
  Convention convention;
  MatrixFault fault = MatrixFault::none;
  double log_likelihood = -detail::infinity;  ///< relative to the best one
  double nees_ratio = detail::not_a_number;   ///< NEES over its degrees of freedom
  std::size_t indefinite = 0;                 ///< poses whose covariance is not positive definite: excluded
};

/// Scales of the blocks under which the errors are most likely: the file's covariance is D Σ D, D = diag(√k_t I, √k_r
/// I).
struct ScaleProfile {
  Convention convention = {};
  double translation = 1, rotation = 1;  ///< k_t, k_r: above one inflated, below overconfident
  double relative_sigma = 0;             ///< relative standard deviation of each
  bool identified = false;               ///< no other order and perturbation fits as well, scales free
  std::vector<Convention> accepted = {};
  double log_likelihood = -detail::infinity;  ///< of the errors, absolute
  WhitenedResidualTests tests = {};           ///< with the scales removed
  double generic_p = detail::not_a_number;    ///< likewise; see ConventionDiagnosis
  /// Each scale that is not right by its name: "rotation block: in degrees", …
  std::vector<std::string> words() const;
};

/// Dead reckoning, whose covariance only grows: the share of steps in which Σ_i - A Σ_{i-1} Aᵀ is not positive
/// semidefinite.
struct ChainFit {
  Convention convention;
  double indefinite = 1;
};
struct ChainDiagnosis {
  std::size_t steps = 0;
  std::vector<ChainFit> fits;  ///< the smallest share first
  std::vector<Convention> accepted;
  bool is_chain = false;    ///< some convention makes it one
  ResidualTest increments;  ///< NEES of the increments under the accepted convention, where truth is known
  std::string reason;
};

enum class DiagnosisVerdict {
  identified,    ///< one convention, and the errors are consistent with it
  undecidable,   ///< several explain the errors; the reason says what they share
  inconsistent,  ///< the convention is known, or a fault is named, but the errors do not follow the covariances
  none           ///< no convention explains the errors
};
/// The enumerator's name, for files.
const char* name(DiagnosisVerdict verdict);

struct ConventionDiagnosis {
  DiagnosisVerdict verdict = DiagnosisVerdict::none;
  std::string reason;              ///< one sentence
  std::vector<std::string> notes;  ///< further findings: causes of tests that fired, structure, scales
  std::size_t n = 0, skipped = 0;  ///< poses used, and without a usable matrix
  double margin = 0;               ///< nats
  bool correlated = false;         ///< the lag test fired: nothing was decided on absolute errors
  bool exact_coordinates = false;  ///< errors are so large that each hypothesis had its own coordinates
  MatrixStructure structure;
  std::vector<HypothesisFit> fits;  ///< the best first; empty if correlated
  std::vector<Convention> accepted;
  MatrixFault fault = MatrixFault::none;
  WhitenedResidualTests tests;  ///< under the best hypothesis
  /// Probability that the best hypothesis looks so wrong against alternatives outside of the list (constant and
  /// pose-dependent congruences, other scales of off-diagonals, rows) if it is right; NaN: there is none, or errors are
  /// correlated.
  double generic_p = detail::not_a_number;
  std::optional<ScaleProfile> scale;
  std::optional<ChainDiagnosis> chain;
  bool increments_as_absolute = false;   ///< the matrices are those of single steps
  double growth = detail::not_a_number;  ///< NEES of the second half over the first
};

/// The hypotheses that a file can decide, from its poses and matrices alone: if `convention` is the truth, the nearest
/// other hypothesis and the number of poses that tell them apart with 95 %.
struct PlanRow {
  Convention convention, nearest;
  double divergence = 0;          ///< Kullback-Leibler, nats per pose, to the nearest that is not equal
  double poses = 0;               ///< 2 m / divergence
  std::vector<Convention> equal;  ///< hypotheses with the same covariances
};

/// The question that is put to a file of covariances.
enum class DiagnosisMode {
  diagnosis,  ///< which conventions explain the errors against a truth?
  chain,      ///< in which conventions does the covariance of dead reckoning grow? Needs no truth
  plan        ///< which conventions can the file tell apart, and with how many poses?
};
/// The enumerator's name, for files.
const char* name(DiagnosisMode mode);

/// The diagnosis of a file of covariances.
struct CovarianceDiagnosis {
  DiagnosisMode mode = DiagnosisMode::diagnosis;
  std::string what = "poses";           ///< poses, edges, or "runs at 5 s"
  std::vector<std::string> file_notes;  ///< notes of the runs
  std::vector<DiagnosedPose> poses;     ///< that were diagnosed: of several runs one each
  std::vector<double> times;            ///< times of these poses, s; empty if they have none, or are of several runs
  AlignmentModel alignment = AlignmentModel::none;
  Convention assumed;  ///< in which the file would be read without a diagnosis, as far as the format allows
  MatrixStructure structure;
  std::optional<ConventionDiagnosis> diagnosis;  ///< set in mode diagnosis
  std::optional<ChainDiagnosis> chain;           ///< set in mode chain
  std::vector<PlanRow> plan;                     ///< set in mode plan
  MisfitSearch misfit = {};                      ///< faults of the whole run, where they were asked for

  /// The conventions that are left; empty for a plan.
  std::vector<Convention> accepted() const;
  /// The convention that explains the errors, else the likeliest one; nothing if none does.
  std::optional<Convention> best() const;
  /// Yes: one convention is identified, and the errors are consistent with it (of a plan: always). No: the errors do
  /// not follow the covariances, or no convention explains them. None: several conventions do, or there are too few
  /// poses. A misfit of the run stands first in its text, and an identified convention is then undecided.
  Verdict verdict() const;
};

/// The poses of a file with the covariances of one convention. Without a truth there is no consistency.
struct ConventionReading {
  Convention convention;
  std::vector<Gaussian<SE3d>> poses;
  Consistency consistency;
};

// Descriptions (report/describe.hpp). Conventions are words that parseConvention reads.

namespace detail {

/// Names without the layout, which is the file's.
inline std::vector<std::string> conventionNames(const std::vector<Convention>& conventions) {
  std::vector<std::string> names;
  names.reserve(conventions.size());
  for (const Convention& c : conventions) names.push_back(conventionName(c, false));
  return names;
}

}  // namespace detail

template <class V>
void describe(V& v, const HypothesisFit& f) {
  v("convention", conventionName(f.convention, false), "as --cov-from takes it");
  v("fault", name(f.fault), "in how the matrices were written, which was undone first");
  v("log_likelihood", f.log_likelihood, "relative to the best one", "nats");
  v("nees_ratio", f.nees_ratio, "NEES over its degrees of freedom");
  v("indefinite", f.indefinite, "matrices that are not positive definite");
}

template <class V>
void describe(V& v, const ScaleProfile& s) {
  v("convention", conventionName(s.convention, false), "in which the scales are measured");
  v("translation", s.translation, "scale of the block, in variance");
  v("rotation", s.rotation, "scale of the block, in variance")("relative_sigma", s.relative_sigma, "of each");
  v("words", s.words(), "the scales by their names");
}

template <class V>
void describe(V& v, const ChainFit& f) {
  v("convention", conventionName(f.convention, false), "as --cov-from takes it");
  v("indefinite", f.indefinite, "share of the steps in which the covariance shrinks");
}

template <class V>
void describe(V& v, const ChainDiagnosis& c) {
  v("steps", c.steps, "from pose to pose")("is_chain", c.is_chain, "some convention makes it dead reckoning");
  v("accepted", detail::conventionNames(c.accepted), "conventions that do")("reason", c.reason, "in words");
  v("increments_nees", c.increments.ratio(), "of the steps, over its degrees of freedom");
  v("increments_p", c.increments.p, "probability of a NEES as extreme");
  v("fits", c.fits, "conventions, the smallest share first");
}

template <class V>
void describe(V& v, const ConventionDiagnosis& d) {
  v("verdict", name(d.verdict), "identified, undecidable, inconsistent or none")("reason", d.reason, "in words");
  v("notes", d.notes, "further findings")("accepted", detail::conventionNames(d.accepted), "that explain the errors");
  v("fault", name(d.fault), "in how the matrices were written")("skipped", d.skipped, "poses without a usable matrix");
  v("margin", d.margin, "within which hypotheses are accepted", "nats");
  v("correlated", d.correlated, "neighbouring errors are, so that absolute errors decide nothing");
  v("exact_coordinates", d.exact_coordinates, "of each hypothesis, as the errors are large");
  v("increments_as_absolute", d.increments_as_absolute, "the matrices are those of single steps");
  v("growth", d.growth, "NEES of the second half over the first");
  v("tests", d.tests, "under the best hypothesis");
  v("generic_p", d.generic_p, "of the best hypothesis against alternatives outside of the list");
  v("scale", d.scale, "scales of the blocks, where they are free");
  if (shown(v, d.chain.has_value())) v("chain", d.chain.value_or(ChainDiagnosis{}), "whether it is dead reckoning");
  v("hypotheses", d.fits, "the best first; empty if correlated");
}

template <class V>
void describe(V& v, const PlanRow& row) {
  v("convention", conventionName(row.convention, false), "the truth");
  v("nearest", conventionName(row.nearest, false), "the other convention that is hardest to exclude");
  v("divergence", row.divergence, "of the nearest", "nats per pose");
  v("poses", row.poses, "that tell them apart; 0: none");
  v("equal", detail::conventionNames(row.equal), "conventions that write the same matrices here");
}

/// `chain`, the fields of the diagnosis, or `plan`: by the mode.
template <class V>
void describe(V& v, const CovarianceDiagnosis& d) {
  const Verdict verdict = d.verdict();
  v("file_notes", d.file_notes, "what is remarkable in the files");
  v("sentence", verdict.text, "the verdict in a sentence");
  v("decided", verdict.decided(),
    "one convention, and the errors follow it; false: they do not; null: undecidable. True for a plan");
  v("mode", name(d.mode), "diagnosis, chain or plan")("what", d.what,
                                                      "the matrices belong to: poses, edges, or runs at a time");
  v("n", d.structure.n, "matrices")("structure", d.structure.words(), "the looks of the matrices");
  v("indefinite", d.structure.indefinite, "matrices that are not positive definite");
  if (shown(v, d.misfit.searched)) v("misfit", d.misfit, "faults of the whole run that are no noise");
  if (shown(v, d.chain.has_value())) v("chain", d.chain.value_or(ChainDiagnosis{}), "whether it is dead reckoning");
  if (shown(v, d.diagnosis.has_value())) describe(v, d.diagnosis.value_or(ConventionDiagnosis{}));
  if (shown(v, d.mode == DiagnosisMode::plan)) v("plan", d.plan, "with --plan: a row for each convention");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/diagnosis_words.hpp>
#endif
