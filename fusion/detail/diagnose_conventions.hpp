// Definitions of fusion/convention_diagnosis.hpp; docs/theory/trajectories.md, sections 6 to 8.
#pragma once

#include <fusion/convention_diagnosis.hpp>
#include <fusion/detail/pose_alignment.hpp>
#include <stats/convention_charts.hpp>
#include <stats/convention_presets.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <numeric>

namespace liestat {

LIESTAT_FUSION_INLINE std::vector<Convention> conventionHypotheses() {
  std::vector<Convention> all;
  for (const auto order : {CovarianceOrder::translation_rotation, CovarianceOrder::rotation_translation}) {
    for (const auto perturbation :
         {Perturbation::right, Perturbation::left, Perturbation::world_axes, Perturbation::world_body_axes,
          Perturbation::roll_pitch_yaw, Perturbation::yaw_pitch_roll, Perturbation::transposed_axes}) {
      for (const auto unit :
           {RotationUnit::radian, RotationUnit::half_angle, RotationUnit::double_angle, RotationUnit::degree}) {
        for (const auto content :
             {CovarianceContent::covariance, CovarianceContent::information, CovarianceContent::sigmas}) {
          Convention c;
          c.order = order, c.perturbation = perturbation, c.unit = unit, c.content = content;
          all.push_back(c);
        }
      }
    }
  }
  return all;
}

LIESTAT_FUSION_INLINE std::string describe(const Convention& c) {
  static const std::map<Perturbation, const char*> frames{
      {Perturbation::right, "along the body's axes (right)"},
      {Perturbation::left, "about the world's origin (left)"},
      {Perturbation::body_axes, "along the body's axes"},
      {Perturbation::world_axes, "along the world's axes (ROS, fixed axes)"},
      {Perturbation::world_body_axes, "position along the world's axes, rotation along the body's"},
      {Perturbation::roll_pitch_yaw, "position along the world's axes, roll, pitch, yaw"},
      {Perturbation::yaw_pitch_roll, "position along the world's axes, yaw, pitch, roll"},
      {Perturbation::rotation_vector, "position along the world's axes, rotation vector"},
      {Perturbation::world_axes_reversed, "along the world's axes, rotation reversed"},
      {Perturbation::transposed_axes, "axes rotated by the transposed rotation"}};
  std::string text = c.order == CovarianceOrder::translation_rotation ? "translation first, " : "rotation first, ";
  text += frames.at(c.perturbation);
  text += c.unit == RotationUnit::radian         ? ", rad"
          : c.unit == RotationUnit::half_angle   ? ", half angles"
          : c.unit == RotationUnit::double_angle ? ", double angles"
                                                 : ", degrees";
  text += c.content == CovarianceContent::covariance    ? ", covariance"
          : c.content == CovarianceContent::information ? ", information"
                                                        : ", sigmas";
  return text;
}

LIESTAT_FUSION_INLINE const char* name(DiagnosisVerdict verdict) {
  switch (verdict) {
    case DiagnosisVerdict::identified:
      return "identified";
    case DiagnosisVerdict::undecidable:
      return "undecidable";
    case DiagnosisVerdict::inconsistent:
      return "inconsistent";
    case DiagnosisVerdict::none:
      return "none";
  }
  return "";
}

namespace detail {

struct FaultText {
  const char *name, *words;
};
inline const FaultText& faultText(MatrixFault fault) {
  static const std::array<FaultText, 22> texts{{
      {"none", "no fault"},
      {"cross_sign", "the cross block has the wrong sign"},
      {"cross_transposed", "the cross block is transposed: the blocks were exchanged without it"},
      {"off_diagonal_half", "the off-diagonal entries are half as large as they should be: a triangle was symmetrised"},
      {"off_diagonal_twice", "the off-diagonal entries are doubled: both triangles were added"},
      {"factor", "the numbers are those of the Cholesky factor, not of the covariance"},
      {"factor_averaged", "the numbers are those of a Cholesky factor, symmetrised"},
      {"factor_transposed", "the factor was transposed: L'L was written instead of L L'"},
      {"information_factor", "the numbers are the square root of the information matrix"},
      {"squared", "variances were taken for sigmas and squared once more"},
      {"matrix_squared", "the covariance was multiplied by itself"},
      {"inverse_diagonal", "only the diagonal was inverted"},
      {"reversed", "the six coordinates are in reverse order"},
      {"axes_ned_enu", "x and y are exchanged and z is reversed: NED axes were read as ENU"},
      {"axes_optical", "the axes are those of a camera (z forward), read as those of a body (x forward)"},
      {"axes_from_optical", "the axes are those of a body (x forward), read as those of a camera (z forward)"},
      {"axes_y_up", "y and z are exchanged: y-up axes were read as z-up"},
      {"lever_arm_sign", "the adjoint was applied with the wrong sign of its lever arm"},
      {"adjoint_inverse", "the adjoint of the inverse pose was applied"},
      {"adjoint_transposed", "the transposed adjoint was applied"},
      {"previous_row", "each pose has the matrix of the row before it"},
      {"next_row", "each pose has the matrix of the row after it"},
  }};
  return texts[static_cast<std::size_t>(fault)];
}

}  // namespace detail

LIESTAT_FUSION_INLINE const char* describe(MatrixFault fault) { return detail::faultText(fault).words; }
LIESTAT_FUSION_INLINE const char* name(MatrixFault fault) { return detail::faultText(fault).name; }

namespace detail {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A matrix with its halves of six coordinates exchanged.
inline Matrix6d halvesExchanged(const Matrix6d& M) {
  Matrix6d X;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) X(i, j) = M((i + 3) % 6, (j + 3) % 6);
  }
  return X;
}
inline bool crossUnknown(const Matrix6d& M) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 3; j < 6; ++j) {
      if (std::isnan(M(i, j))) return true;
    }
  }
  return false;
}
inline bool blocksFinite(const Matrix6d& M) {
  return M.topLeftCorner<3, 3>().allFinite() && M.bottomRightCorner<3, 3>().allFinite();
}
inline Matrix6d withoutCross(Matrix6d M) {
  M.topRightCorner<3, 3>().setZero();
  M.bottomLeftCorner<3, 3>().setZero();
  return M;
}

/// The intended matrix behind a faulty one; both in the order translation, rotation, perturbation of the pose T. NaN where
/// there is none. Faults of rows are the caller's.
inline Matrix6d repaired(MatrixFault fault, const Matrix6d& M, const SE3d& T) {
  const auto axes = [&](const Eigen::Matrix3d& S) {
    Matrix6d B = Matrix6d::Zero();
    B.topLeftCorner<3, 3>() = B.bottomRightCorner<3, 3>() = S;
    return congruence(B, M);
  };
  const auto ofJacobian = [&](const Matrix6d& J) { return congruence(inverse<double, 6>(J), M); };
  Matrix6d C = M;
  switch (fault) {
    case MatrixFault::cross_sign:
      C.topRightCorner<3, 3>() *= -1, C.bottomLeftCorner<3, 3>() *= -1;
      return C;
    case MatrixFault::cross_transposed:
      C.topRightCorner<3, 3>() = M.bottomLeftCorner<3, 3>(), C.bottomLeftCorner<3, 3>() = M.topRightCorner<3, 3>();
      return C;
    case MatrixFault::off_diagonal_half:
    case MatrixFault::off_diagonal_twice: {
      C *= fault == MatrixFault::off_diagonal_half ? 2 : 0.5;
      C.diagonal() = M.diagonal();
      return C;
    }
    case MatrixFault::factor:
    case MatrixFault::factor_averaged: {
      Matrix6d L = Matrix6d::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j <= i; ++j) L(i, j) = i == j || fault == MatrixFault::factor ? M(i, j) : 2 * M(i, j);
      }
      return productTransposed(L, L);
    }
    case MatrixFault::factor_transposed: {
      // M = LᵀL: the Cholesky factor of M with its coordinates reversed is L's transpose, reversed.
      Matrix6d reversed;
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) reversed(i, j) = M(5 - i, 5 - j);
      }
      const Cholesky<double, 6> root(reversed);
      if (!root.ok()) return Matrix6d::Constant(not_a_number);
      // root⁻¹ reversed gives the factor itself: F = root⁻¹ reversed is Fᵀ with reversed = F Fᵀ.
      const Matrix6d Ft = root.halfSolve<6>(reversed);  // = Fᵀ
      Matrix6d L;
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) L(i, j) = Ft(5 - i, 5 - j);
      }
      return productTransposed(L, L);
    }
    case MatrixFault::information_factor: {
      Matrix6d U = Matrix6d::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) U(i, j) = M(i, j);
      }
      const Matrix6d Ut = U.transpose();
      return Cholesky<double, 6>(productTransposed(Ut, Ut)).inverse();
    }
    case MatrixFault::squared:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) {
          C(i, j) = i == j ? std::sqrt(M(i, i)) : M(i, j) / std::sqrt(std::sqrt(M(i, i) * M(j, j)));
        }
      }
      return C;
    case MatrixFault::matrix_squared: {
      const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(M);
      return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
             eigen.eigenvectors().transpose();
    }
    case MatrixFault::inverse_diagonal:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) C(i, j) = i == j ? 1 / M(i, i) : M(i, j);
      }
      return C;
    case MatrixFault::reversed:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) C(i, j) = M(5 - i, 5 - j);
      }
      return C;
    case MatrixFault::axes_ned_enu:
      return axes((Eigen::Matrix3d() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished());
    case MatrixFault::axes_optical:
      return axes((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished());
    case MatrixFault::axes_from_optical:
      return axes((Eigen::Matrix3d() << 0, -1, 0, 0, 0, -1, 1, 0, 0).finished());
    case MatrixFault::axes_y_up:
      return axes((Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished());
    case MatrixFault::lever_arm_sign: {
      Matrix6d J = T.Adj();
      J.topRightCorner<3, 3>() *= -1;
      return ofJacobian(J);
    }
    case MatrixFault::adjoint_inverse:
      return ofJacobian(T.inverse().Adj());
    case MatrixFault::adjoint_transposed:
      return ofJacobian(T.Adj().transpose());
    default:
      return C;
  }
}

/// Poses with usable matrices, their errors, and the matrices as covariances of each order and content.
class DiagnosisData {
 public:
  DiagnosisData(std::span<const DiagnosedPose> given, bool may_use_charts) {
    for (const DiagnosedPose& p : given) {
      if (!blocksFinite(p.matrix) || !p.estimate.params().allFinite() || !p.truth.params().allFinite()) {
        ++skipped;
        continue;
      }
      poses.push_back(p);
      blocks_only = blocks_only || crossUnknown(p.matrix);
      errors.push_back((p.estimate.inverse() * p.truth).log());
    }
    double sum = 0;
    for (const Vector6d& e : errors) sum += e.tail<3>().squaredNorm();
    // First-order coordinates are within 1 % of a sigma below 0.03 rad; one rule for all hypotheses, so that they stay
    // comparable.
    charts =
        may_use_charts && std::sqrt(sum / (3 * static_cast<double>(std::max<std::size_t>(1, errors.size())))) > 0.03;
  }

  std::size_t size() const { return poses.size(); }
  /// The matrix of a pose as a covariance in the order translation, rotation of its own coordinates, of a hypothesis.
  Matrix6d content(std::size_t i, const Convention& c, MatrixFault fault = MatrixFault::none) const {
    const std::size_t row = fault == MatrixFault::previous_row ? std::min(i + 1, size() - 1)
                            : fault == MatrixFault::next_row   ? (i > 0 ? i - 1 : 0)
                                                               : i;
    Matrix6d M = blocks_only ? withoutCross(poses[row].matrix) : poses[row].matrix;
    if (c.order == CovarianceOrder::rotation_translation) M = halvesExchanged(M);
    M = covarianceFromContent(c.content, M);
    return fault == MatrixFault::none ? M : repaired(fault, M, poses[row].estimate);
  }
  /// The error in the coordinates of a hypothesis, order translation, rotation.
  Vector6d coordinates(std::size_t i, const Convention& c, const Matrix6d& J) const {
    return charts ? conventionLog(c, poses[i].estimate, poses[i].truth) : Vector6d(J * errors[i]);
  }
  bool decidable(const Convention& c) const {
    return !blocks_only || (c.perturbation != Perturbation::left && c.content != CovarianceContent::information);
  }

  std::vector<DiagnosedPose> poses;
  std::vector<Vector6d> errors;
  std::size_t skipped = 0;
  bool blocks_only = false, charts = false;
};

inline Convention translationFirst(Convention c) {
  c.order = CovarianceOrder::translation_rotation;
  return c;
}

/// Log-likelihood of the errors under hypotheses that share order and content, unaligned.
inline void rankPlain(const DiagnosisData& data, std::span<HypothesisFit> fits) {
  if (fits.empty()) return;
  const std::size_t n = data.size();
  std::vector<double> nees(fits.size(), 0), likelihood(fits.size(), 0);
  for (std::size_t i = 0; i < n; ++i) {
    const Matrix6d C = data.content(i, fits[0].convention, fits[0].fault);
    const Cholesky<double, 6> root(C);
    if (!root.ok() || !C.allFinite()) {
      for (HypothesisFit& f : fits) ++f.indefinite;
      continue;
    }
    const double log_det = root.logDeterminant();
    for (std::size_t h = 0; h < fits.size(); ++h) {
      const Convention c = translationFirst(fits[h].convention);
      const Matrix6d J = conventionJacobian(c, data.poses[i].estimate);
      const double d2 = root.halfSolve<1>(data.coordinates(i, c, J)).squaredNorm();
      nees[h] += d2;
      likelihood[h] += -0.5 * d2 - 0.5 * log_det + conventionLogDeterminant(c, data.poses[i].estimate);
    }
  }
  for (std::size_t h = 0; h < fits.size(); ++h) {
    fits[h].nees_ratio = nees[h] / (6 * static_cast<double>(n));
    fits[h].log_likelihood = fits[h].indefinite > 0 || std::isnan(likelihood[h]) ? -infinity : likelihood[h];
  }
}

/// Σ_h of each pose in the library's convention.
inline Matrix6d covarianceUnder(const DiagnosisData& data, std::size_t i, const HypothesisFit& h) {
  const Matrix6d J = conventionJacobianInverse(translationFirst(h.convention), data.poses[i].estimate);
  return congruence(J, data.content(i, h.convention, h.fault));
}

inline std::vector<MatchedPose> matchedUnder(const DiagnosisData& data, const HypothesisFit& h, std::size_t most) {
  std::vector<MatchedPose> matched;
  const std::size_t n = data.size(), used = std::min(n, most);
  matched.reserve(used);
  for (std::size_t k = 0; k < used; ++k) {
    const std::size_t i = used == n ? k : k * n / used;
    matched.push_back({{data.poses[i].truth, Matrix6d::Zero()}, {data.poses[i].estimate, covarianceUnder(data, i, h)}});
  }
  return matched;
}

/// The likelihood with the best alignment of a hypothesis, which its covariance allows for.
inline void rankAligned(const DiagnosisData& data, HypothesisFit& h, const DiagnosisOptions& options) {
  const std::vector<MatchedPose> matched = matchedUnder(data, h, options.most_aligned);
  double log_det = 0;
  for (const MatchedPose& p : matched) {
    const Cholesky<double, 6> root(p.estimate.covariance);
    if (!root.ok()) ++h.indefinite;
    log_det += root.ok() ? root.logDeterminant() : 0;
  }
  h.log_likelihood = -infinity;
  if (h.indefinite > 0) return;
  const Alignment a = alignWeighted(matched, options.alignment);
  if (!a.ok) return;
  const std::array<bool, 7> is_free = freeParameters(a.model);
  const AlignmentSums sums = alignmentSums(matched, a, centroid(matched, a), is_free);
  h.nees_ratio = sums.cost / (6 * static_cast<double>(matched.size()) - a.parameters);
  h.log_likelihood = -0.5 * sums.cost - 0.5 * log_det - 0.5 * Cholesky<double, 7>(sums.information).logDeterminant();
}

inline void rank(const DiagnosisData& data, std::vector<HypothesisFit>& fits, const DiagnosisOptions& options) {
  std::erase_if(fits, [&](const HypothesisFit& f) { return !data.decidable(f.convention); });
  if (options.alignment != AlignmentModel::none) {
    for (HypothesisFit& f : fits) rankAligned(data, f, options);
  } else {
    const auto key = [](const HypothesisFit& f) {
      return std::tuple(f.fault, f.convention.order, f.convention.content);
    };
    std::stable_sort(fits.begin(), fits.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
    for (std::size_t begin = 0; begin < fits.size();) {
      std::size_t end = begin;
      while (end < fits.size() && key(fits[end]) == key(fits[begin])) ++end;
      rankPlain(data, std::span(fits).subspan(begin, end - begin));
      begin = end;
    }
  }
  std::stable_sort(fits.begin(), fits.end(),
                   [](const auto& a, const auto& b) { return a.log_likelihood > b.log_likelihood; });
  const double best = fits.empty() ? 0 : fits.front().log_likelihood;
  for (HypothesisFit& f : fits) f.log_likelihood = std::isinf(f.log_likelihood) ? -infinity : f.log_likelihood - best;
}

/// The tests of the errors under a hypothesis, aligned where asked for.
inline WhitenedResidualTests testsUnder(const DiagnosisData& data, const HypothesisFit& h,
                                        const DiagnosisOptions& options) {
  if (options.alignment != AlignmentModel::none) {
    const std::vector<MatchedPose> matched = matchedUnder(data, h, data.size());
    return evaluateConsistency(matched, alignWeighted(matched, options.alignment)).tests;
  }
  std::vector<PoseResidual> residuals;
  residuals.reserve(data.size());
  const Convention c = translationFirst(h.convention);
  for (std::size_t i = 0; i < data.size(); ++i) {
    // In the hypothesis' own coordinates, which are as normal as they can be.
    const Matrix6d J = conventionJacobian(c, data.poses[i].estimate);
    residuals.push_back({data.coordinates(i, c, J), data.content(i, h.convention, h.fault)});
  }
  return testWhitenedResiduals(residuals);
}

inline double leastEigenvalue(const Matrix6d& M) {
  return Eigen::SelfAdjointEigenSolver<Matrix6d>(M, Eigen::EigenvaluesOnly).eigenvalues()[0];
}
/// True if M + tolerance I is positive definite.
inline bool semidefinite(Matrix6d M, const Vector6d& tolerance) {
  M.diagonal() += tolerance;
  return Cholesky<double, 6>(M).ok();
}

inline ScaleProfile profileScale(const DiagnosisData& data, const DiagnosisOptions& options) {
  ScaleProfile profile;
  struct Row {
    Convention convention;
    double likelihood, k_t, k_r;
  };
  std::vector<Row> rows;
  for (const Convention& c : conventionHypotheses()) {
    if (c.unit != RotationUnit::radian || !data.decidable(c)) continue;
    const Convention own = translationFirst(c);
    double q11 = 0, q12 = 0, q22 = 0, log_det = 0;
    bool ok = true;
    for (std::size_t i = 0; i < data.size() && ok; ++i) {
      const Matrix6d C = data.content(i, c);
      const Cholesky<double, 6> root(C);
      if (!(ok = root.ok())) break;
      const Vector6d x = data.coordinates(i, own, conventionJacobian(own, data.poses[i].estimate));
      Vector6d a = x, b = x;
      a.tail<3>().setZero(), b.head<3>().setZero();
      const Vector6d za = root.halfSolve<1>(a), zb = root.halfSolve<1>(b);
      q11 += za.squaredNorm(), q12 += za.dot(zb), q22 += zb.squaredNorm();
      log_det += root.logDeterminant() - 2 * conventionLogDeterminant(own, data.poses[i].estimate);
    }
    if (!ok || !(q11 > 0) || !(q22 > 0)) continue;
    const double n = static_cast<double>(data.size()), r = q12 / std::sqrt(q11 * q22), k = 3 * n / (1 + r);
    const double k_t = k / q11, k_r = k / q22;
    rows.push_back({c, 1.5 * n * (std::log(k_t) + std::log(k_r)) - 3 * n - 0.5 * log_det, k_t, k_r});
  }
  if (rows.empty()) return profile;
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.likelihood > b.likelihood; });
  const double margin = std::log(static_cast<double>(rows.size()) / options.alpha) * (data.blocks_only ? 2 : 1);
  for (const Row& r : rows) {
    if (r.likelihood > rows[0].likelihood - margin) profile.accepted.push_back(r.convention);
  }
  profile.convention = rows[0].convention;
  profile.translation = rows[0].k_t, profile.rotation = rows[0].k_r;
  profile.relative_sigma = std::sqrt(2 / (3 * static_cast<double>(data.size())));
  profile.identified = profile.accepted.size() == 1;
  const Convention own = translationFirst(profile.convention);
  std::vector<PoseResidual> residuals;
  for (std::size_t i = 0; i < data.size(); ++i) {
    Matrix6d C = data.content(i, profile.convention);
    const double a = 1 / std::sqrt(profile.translation), b = 1 / std::sqrt(profile.rotation);
    C.topRows<3>() *= a, C.leftCols<3>() *= a, C.bottomRows<3>() *= b, C.rightCols<3>() *= b;
    residuals.push_back({data.coordinates(i, own, conventionJacobian(own, data.poses[i].estimate)), C});
  }
  profile.tests = testWhitenedResiduals(residuals);
  return profile;
}

inline std::string scaleWord(const char* block, double k, double sigma, bool rotation) {
  const auto near = [&](double value) { return std::abs(std::log(k / value)) < 3 * sigma; };
  const std::string part(block);
  if (near(1)) return part + " block: scale right (" + significant(k, 3) + ")";
  if (rotation) {
    if (near(0.25)) return part + " block: a quarter of what it should be: half angles, or sigmas twice too small";
    if (near(4)) return part + " block: four times what it should be: double angles, or sigmas twice too large";
    if (near(3282.8063500117437)) return part + " block: in degrees";
    if (near(1 / 3282.8063500117437)) return part + " block: divided by (180/pi) squared: radians converted twice";
  } else {
    if (near(1e6)) return part + " block: in millimetres";
    if (near(1e4)) return part + " block: in centimetres";
    if (near(1e-6)) return part + " block: in kilometres";
  }
  return part + " block: " + (k > 1 ? "inflated (underconfident)" : "too small (overconfident)") + " by a factor of " +
         significant(k > 1 ? k : 1 / k, 3) + " in variance";
}

}  // namespace detail

LIESTAT_FUSION_INLINE std::vector<std::string> ScaleProfile::words() const {
  if (std::abs(std::log(translation / rotation)) < 3 * std::sqrt(2.) * relative_sigma &&
      std::abs(std::log(translation)) > 3 * relative_sigma) {
    const double k = std::sqrt(translation * rotation);
    return {std::string("both blocks: ") + (k > 1 ? "inflated (underconfident)" : "too small (overconfident)") +
            " by a factor of " + significant(k > 1 ? k : 1 / k, 3) + " in variance"};
  }
  return {detail::scaleWord("translation", translation, relative_sigma, false),
          detail::scaleWord("rotation", rotation, relative_sigma, true)};
}

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

LIESTAT_FUSION_INLINE std::vector<std::string> MatrixStructure::words() const {
  std::vector<std::string> lines;
  const auto count = [](std::size_t k) { return std::to_string(k) + (k == 1 ? " matrix is " : " matrices are "); };
  if (asymmetric > 0)
    lines.push_back(count(asymmetric) + "not symmetric: a factor, one column or one triangle was written");
  if (indefinite > 0) {
    lines.push_back(count(indefinite) +
                    "not positive definite: too few digits, a row dropped without its off-diagonals, "
                    "or entries at wrong indices");
  }
  std::string zeros;
  for (std::size_t i = 0; i < 6; ++i) {
    if (zero_variance[i]) zeros += (zeros.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  if (!zeros.empty())
    lines.push_back("the variances of coordinates " + zeros + " are zero in every row: wrong indices, or not filled");
  if (rank_one && zeros.empty()) lines.push_back("the matrices have rank one: a vector of sigmas was multiplied out");
  if (blocks_only) lines.push_back("the cross block is unknown: only the two blocks are tested");
  if (constant) lines.push_back("all matrices are the same: a constant, not the filter's covariance");
  if (isotropic_blocks) {
    lines.push_back("both blocks are multiples of the identity: they say nothing about axes");
  } else if (diagonal) {
    lines.push_back("all matrices are diagonal: correlations were dropped, or never known");
  } else if (no_cross && !blocks_only) {
    lines.push_back("the cross block is zero: correlations of position and rotation were dropped, or never known");
  }
  return lines;
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
      const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(S, Eigen::EigenvaluesOnly);
      if (eigen.eigenvalues()[0] < 1. / 3 || eigen.eigenvalues()[5] > 3) d.verdict = DiagnosisVerdict::none;
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

}  // namespace liestat
