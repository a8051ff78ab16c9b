// The convention that a file of covariances is in, from its errors against a ground truth, or, for dead reckoning,
// without one. (Needs Boost.Math.)
//
//   std::vector<liestat::DiagnosedPose> poses;  // {estimate, matrix as the file has it, truth}, in order of time
//   const auto diagnosis = liestat::diagnoseConventions(poses);
//   if (diagnosis.verdict == liestat::DiagnosisVerdict::identified) use(diagnosis.accepted.front());
//   else std::puts(diagnosis.reason.c_str());
//
// 168 hypotheses (order × perturbation × unit × content) are compared by the likelihood of the errors. The margin
// ln(168/α) is a bound, not a fit: for independent errors the true hypothesis is rejected with probability α at most. Several
// hypotheses within the margin are "undecidable", which is an answer. Where neighbouring errors are correlated nothing is
// decided on absolute errors; the chain condition Σ_i - A Σ_{i-1} Aᵀ ⪰ 0 of dead reckoning takes their place.
// Derivations: docs/theory/trajectories.md, sections 6 to 8; measured power, and a ledger of bugs: docs/doctor.md.
#pragma once

#include <fusion/trajectories.hpp>
#include <stats/conventions.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// A pose with its matrix as a file has it (layout undone, NaN for unknown entries), and the true pose. For edges of a pose
/// graph: the measured and the true relative pose.
struct DiagnosedPose {
  SE3d estimate;
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Identity();
  SE3d truth = {};
};

/// The 168 hypotheses: two orders, seven perturbations (right, left, world axes, world-body axes, roll-pitch-yaw,
/// yaw-pitch-roll, transposed axes), four units of rotation, three contents.
std::vector<Convention> conventionHypotheses();

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
  std::array<bool, 6> zero_variance{};  ///< of each coordinate, in the file's order, in all matrices
  bool rank_one = false;                ///< every 2×2 minor vanishes
  std::vector<std::string> words() const;
};
MatrixStructure matrixStructure(std::span<const DiagnosedPose> poses);

/// A hypothesis and the errors' likelihood under it.
struct HypothesisFit {
  Convention convention;
  MatrixFault fault = MatrixFault::none;
  double log_likelihood = -detail::infinity;  ///< relative to the best one
  double nees_ratio = detail::not_a_number;   ///< NEES over its degrees of freedom
  std::size_t indefinite = 0;                 ///< poses whose covariance is not positive definite: excluded
};

/// Scales of the blocks under which the errors are most likely: the file's covariance is D Σ D, D = diag(√k_t I, √k_r I).
struct ScaleProfile {
  Convention convention;
  double translation = 1, rotation = 1;  ///< k_t, k_r: above one inflated, below overconfident
  double relative_sigma = 0;             ///< of each
  bool identified = false;               ///< no other order and perturbation fits as well, scales free
  std::vector<Convention> accepted;
  WhitenedResidualTests tests;  ///< with the scales removed
  /// Each scale by its name: "rotation sigmas are half as large as they should be, or half angles", …
  std::vector<std::string> words() const;
};

/// Dead reckoning, whose covariance only grows: the share of steps in which Σ_i - A Σ_{i-1} Aᵀ is not positive semidefinite.
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
/// Needs no truth. Says nothing of a common scale, and for `left` nothing of order and unit.
ChainDiagnosis diagnoseChain(std::span<const DiagnosedPose> poses, std::span<const Convention> hypotheses = {});

enum class DiagnosisVerdict {
  identified,    ///< one convention, and the errors are consistent with it
  undecidable,   ///< several explain the errors; the reason says what they share
  inconsistent,  ///< the convention is known, or a fault is named, but the errors do not follow the covariances
  none           ///< no convention explains the errors
};
/// The enumerator's name, for files.
const char* name(DiagnosisVerdict verdict);

struct DiagnosisOptions {
  double alpha = 1e-3;                              ///< probability of rejecting the truth
  AlignmentModel alignment = AlignmentModel::none;  ///< none, posyaw, se3 or sim3: the truth's world is another
  std::vector<Convention> hypotheses = {};          ///< empty: conventionHypotheses()
  std::size_t most_aligned = 2000;  ///< poses, evenly spaced, from which hypotheses are ranked with an alignment
  bool ordered = true;              ///< false: poses are of different runs, and neighbours mean nothing
};

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
  std::optional<ScaleProfile> scale;
  std::optional<ChainDiagnosis> chain;
  bool increments_as_absolute = false;   ///< the matrices are those of single steps
  double growth = detail::not_a_number;  ///< NEES of the second half over the first
};

/// Finds the conventions that explain the errors. Fewer than ten usable poses are "undecidable".
ConventionDiagnosis diagnoseConventions(std::span<const DiagnosedPose> poses, const DiagnosisOptions& options = {});

/// The hypotheses that a file can decide, from its poses and matrices alone: if `convention` is the truth, the nearest other hypothesis and
/// the number of poses that tell them apart with 95 %.
struct PlanRow {
  Convention convention, nearest;
  double divergence = 0;          ///< Kullback-Leibler, nats per pose, to the nearest that is not equal
  double poses = 0;               ///< 2 m / divergence
  std::vector<Convention> equal;  ///< hypotheses with the same covariances
};
/// Rows of the convention candidates `of` (empty: all) against all hypotheses. At most 40 poses, evenly spaced, are used.
std::vector<PlanRow> planDiagnosis(std::span<const DiagnosedPose> poses, std::span<const Convention> of = {},
                                   const DiagnosisOptions& options = {});

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/diagnose_conventions.hpp>
#endif
