// Hypotheses on the convention of a file, ranked by the likelihood of its errors; docs/theory/trajectories.md,
// sections 6 and 7.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <fusion/trajectories.hpp>  // first: its definitions include the next
#include <fusion/trajectories/detail/generic_alternatives.hpp>
#include <fusion/trajectories/detail/pose_alignment.hpp>
#include <fusion/trajectories/detail/repaired_matrices.hpp>
#include <stats/convention_charts.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <optional>
#include <tuple>

namespace liestat {

LIESTAT_FUSION_INLINE std::vector<Convention> conventionHypotheses() {
  std::vector<Convention> all;
  for (const auto order : {CovarianceOrder::translation_rotation, CovarianceOrder::rotation_translation}) {
    for (const auto perturbation :
         {Perturbation::right, Perturbation::left, Perturbation::world_axes, Perturbation::world_body_axes,
          Perturbation::roll_pitch_yaw, Perturbation::yaw_pitch_roll, Perturbation::rotation_vector,
          Perturbation::world_axes_reversed, Perturbation::transposed_axes}) {
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

namespace detail {

/// Poses with usable matrices, their errors, and the matrices as covariances of each order and content.
class DiagnosisData {
 public:
  DiagnosisData(std::span<const DiagnosedPose> given, bool may_use_charts) {
    for (const DiagnosedPose& p : given) {
      if (p.estimate.params().allFinite() && p.truth.params().allFinite()) poses.push_back(p);
    }
    for (const DiagnosedPose& p : poses) errors.push_back((p.estimate.inverse() * p.truth).log());
    chooseCharts(may_use_charts);
    findComponents(!may_use_charts);
    // Where components without errors are left out, a matrix may be unknown in whole coordinates.
    std::vector<DiagnosedPose> usable;
    for (const DiagnosedPose& p : poses) {
      if (blocksFinite(p.matrix) || (omits() && knownCoordinates(p.matrix))) usable.push_back(p);
    }
    skipped = given.size() - usable.size();
    if (usable.size() < poses.size()) {
      poses = std::move(usable), errors.clear();
      for (const DiagnosedPose& p : poses) errors.push_back((p.estimate.inverse() * p.truth).log());
      chooseCharts(may_use_charts);
    }
    for (const DiagnosedPose& p : poses) blocks_only = blocks_only || !knownCoordinates(p.matrix);
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
  /// The components of the errors that carry noise, in the coordinates of a hypothesis: of a robot in the plane three,
  /// for every hypothesis.
  const NoiseComponents& components(const Convention& c) const {
    return components_[static_cast<std::size_t>(c.perturbation)];
  }
  bool omits() const { return components_[0].omits(); }
  /// log |det J| of these components.
  double logDeterminant(std::size_t i, const Convention& c, Matrix6d J) const {
    if (!omits()) return conventionLogDeterminant(c, poses[i].estimate);
    for (int k = 0; k < 6; ++k) {
      if (!components_[0].keeps(k)) J.col(k).setZero();
    }
    Matrix6d squared = productTransposed(J, J);
    Vector6d none = Vector6d::Zero();
    components(c).reduce(none, squared);
    return 0.5 * Cholesky<double, 6>(squared).logDeterminant();
  }
  bool decidable(const Convention& c) const {
    return !blocks_only || (c.perturbation != Perturbation::left && c.content != CovarianceContent::information);
  }

  std::vector<DiagnosedPose> poses;
  std::vector<Vector6d> errors;
  std::size_t skipped = 0;
  bool blocks_only = false, charts = false;

 private:
  void chooseCharts(bool may_use_charts) {
    double sum = 0;
    for (const Vector6d& e : errors) sum += e.tail<3>().squaredNorm();
    // First-order coordinates are within 1 % of a sigma below 0.03 rad; one rule for all hypotheses, so that they stay
    // comparable.
    charts =
        may_use_charts && std::sqrt(sum / (3 * static_cast<double>(std::max<std::size_t>(1, errors.size())))) > 0.03;
  }
  /// NaN in whole rows and columns only.
  static bool knownCoordinates(const Matrix6d& M) {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        if (std::isnan(M(i, j)) && !std::isnan(M(i, i)) && !std::isnan(M(j, j))) return false;
      }
    }
    return true;
  }
  /// Components whose errors are zero in every row, if they are as many in the coordinates of all perturbations; errors
  /// in another world are seen from the first pose.
  void findComponents(bool in_another_world) {
    if (poses.empty()) return;
    const SE3d world = in_another_world ? poses[0].truth * poses[0].estimate.inverse() : SE3d();
    std::array<NoiseComponents, std::size(all_perturbations)> found;
    for (const Perturbation perturbation : all_perturbations) {
      Convention c;
      c.perturbation = perturbation;
      NoiseComponentScan scan;
      for (const DiagnosedPose& p : poses) {
        const SE3d at = world * p.estimate;
        const Vector6d x = charts ? conventionLog(c, at, p.truth)
                                  : Vector6d(conventionJacobian(c, at) * (at.inverse() * p.truth).log());
        scan.add(x, Matrix6d::Identity(), at.translation().norm());
      }
      found[static_cast<std::size_t>(perturbation)] = scan.components();
      if (!found[0].omits() || scan.components().count() != found[0].count()) return;
    }
    components_ = found;
  }

  std::array<NoiseComponents, std::size(all_perturbations)> components_;
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
    std::optional<Cholesky<double, 6>> root;
    for (std::size_t h = 0; h < fits.size(); ++h) {
      const Convention c = translationFirst(fits[h].convention);
      const Matrix6d J = conventionJacobian(c, data.poses[i].estimate);
      Vector6d x = data.coordinates(i, c, J);
      if (h == 0 || data.omits()) {
        Matrix6d judged = C;
        data.components(c).reduce(x, judged);
        root.emplace(judged.allFinite() ? judged : Matrix6d(Matrix6d::Zero()));
      }
      if (!root->ok()) {
        ++fits[h].indefinite;
        continue;
      }
      const double d2 = root->halfSolve<1>(x).squaredNorm();
      nees[h] += d2;
      likelihood[h] += -0.5 * d2 - 0.5 * root->logDeterminant() + data.logDeterminant(i, c, J);
    }
  }
  for (std::size_t h = 0; h < fits.size(); ++h) {
    fits[h].nees_ratio = nees[h] / (data.components(fits[h].convention).count() * static_cast<double>(n));
    fits[h].log_likelihood = fits[h].indefinite > 0 || std::isnan(likelihood[h]) ? -infinity : likelihood[h];
  }
}

inline double likelihoodOf(const DiagnosisData& data, HypothesisFit h) {
  rankPlain(data, std::span(&h, 1));
  return h.log_likelihood;
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
  const std::vector<MatchedPose> matched = matchedUnder(data, h, options.max_aligned);
  // All hypotheses are read along the body's axes, and judged by the same components of the errors.
  const NoiseComponents& components = data.components(Convention{});
  double log_det = 0;
  for (const MatchedPose& p : matched) {
    Matrix6d C = p.estimate.covariance;
    Vector6d none = Vector6d::Zero();
    components.reduce(none, C);
    const Cholesky<double, 6> root(C);
    if (!root.ok()) ++h.indefinite;
    log_det += root.ok() ? root.logDeterminant() : 0;
  }
  h.log_likelihood = -infinity;
  if (h.indefinite > 0) return;
  const Alignment a = weightedAlignment(matched, options.alignment, 0, &components);
  if (!a.ok) return;
  const std::array<bool, 7> is_free = freeParameters(a.model);
  const AlignmentSums sums = alignmentSums(matched, a, centroid(matched, a), is_free);
  const DeterminedInverse determined(sums.information, leastDetermined(components));
  h.nees_ratio = sums.cost / (components.count() * static_cast<double>(matched.size()) - a.parameters);
  h.log_likelihood = -0.5 * sums.cost - 0.5 * log_det - 0.5 * determined.log_determinant;
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

/// The components of residuals that carry noise; a filler that errors exceed is judged.
inline NoiseComponents judgedComponents(std::span<const PoseResidual> residuals) {
  NoiseComponentScan scan;
  for (const PoseResidual& r : residuals) scan.add(r.error, r.covariance);
  return scan.withExceededFillers(scan.components());
}

/// How errors agree with covariances: the seven tests, and those against alternatives outside of any list.
struct Agreement {
  WhitenedResidualTests tests;
  double generic_p = not_a_number;

  /// Neither is refuted at a level, each test by itself.
  bool holds(double level = residual_test_level) const { return tests.consistent(level) && !(generic_p < level); }
  /// The smallest p-value of all, times their number; NaN without covariances.
  double p() const {
    if (!tests.joint.applies()) return not_a_number;
    double least = std::isnan(generic_p) ? 1 : generic_p;
    for (const ResidualTest& t : tests.all()) least = t.applies() ? std::min(least, 7 * t.p) : least;
    return std::min(1., 2 * least);
  }
};

inline Agreement agreementOf(const std::vector<PosedResidual>& posed, const NoiseComponents& components,
                             bool blocks_only) {
  Agreement a;
  std::vector<PoseResidual> residuals;
  for (const PosedResidual& r : posed) residuals.push_back(r.residual);
  a.tests = testWhitenedResiduals(residuals, components);
  if (a.tests.joint.applies()) a.generic_p = genericMisfit(posed, components, blocks_only);
  return a;
}

/// The errors in the hypothesis' own coordinates, which are as normal as they can be, with blocks of the covariances
/// divided by scales.
inline Agreement agreementUnder(const DiagnosisData& data, const HypothesisFit& h, double translation = 1,
                                double rotation = 1) {
  std::vector<PosedResidual> posed;
  std::vector<PoseResidual> residuals;
  const Convention c = translationFirst(h.convention);
  const double a = 1 / std::sqrt(translation), b = 1 / std::sqrt(rotation);
  for (std::size_t i = 0; i < data.size(); ++i) {
    const SE3d& T = data.poses[i].estimate;
    Matrix6d C = data.content(i, h.convention, h.fault);
    C.topRows<3>() *= a, C.leftCols<3>() *= a, C.bottomRows<3>() *= b, C.rightCols<3>() *= b;
    posed.push_back({{data.coordinates(i, c, conventionJacobian(c, T)), C}, data.poses[i].truth});
    residuals.push_back(posed.back().residual);
  }
  const NoiseComponents components = judgedComponents(residuals);
  for (PosedResidual& r : posed) components.reduce(r.residual.error, r.residual.covariance);
  Agreement agreement = agreementOf(posed, components, data.blocks_only);
  return agreement;
}

/// The same, aligned where asked for: then along the body's axes.
inline Agreement agreementUnder(const DiagnosisData& data, const HypothesisFit& h, const DiagnosisOptions& options) {
  if (options.alignment == AlignmentModel::none) return agreementUnder(data, h);
  const std::vector<MatchedPose> matched = matchedUnder(data, h, data.size());
  const Consistency consistency = evaluateConsistency(matched, alignWeighted(matched, options.alignment));
  Agreement a;
  a.tests = consistency.tests;
  if (!consistency.ok || !a.tests.joint.applies()) return a;
  std::vector<PosedResidual> posed;
  for (std::size_t i = 0; i < consistency.errors.size(); ++i) {
    posed.push_back({{consistency.errors[i].error, consistency.errors[i].covariance}, data.poses[i].truth});
    a.tests.components.reduce(posed.back().residual.error, posed.back().residual.covariance);
  }
  a.generic_p = genericMisfit(posed, a.tests.components, data.blocks_only);
  return a;
}

inline double leastEigenvalue(const Matrix6d& M) { return SymmetricEigen(M).values[0]; }
/// True if M + tolerance I is positive definite.
inline bool semidefinite(Matrix6d M, const Vector6d& tolerance) {
  M.diagonal() += tolerance;
  return Cholesky<double, 6>(M).ok();
}

/// Scales of the blocks under each of some conventions in rad.
inline ScaleProfile profileScale(const DiagnosisData& data, std::span<const Convention> hypotheses, double alpha) {
  ScaleProfile profile;
  struct Row {
    Convention convention;
    double likelihood, k_t, k_r;
  };
  std::vector<Row> rows;
  for (const Convention& c : hypotheses) {
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
  // Scales near one are likelier: orders and contents with other scales may fit as well. A law with heavy tails lets
  // units be.
  const auto posterior = [](const Row& r) {
    return r.likelihood - std::log1p(std::pow(std::log(r.k_t), 2)) - std::log1p(std::pow(std::log(r.k_r), 2));
  };
  // The first in the list stands for all that are equally likely: the library's own convention, if it is among them.
  const auto likeliest = std::max_element(rows.begin(), rows.end(),
                                          [&](const Row& a, const Row& b) { return posterior(a) < posterior(b); });
  constexpr double alike = 2;
  const double most = posterior(*likeliest);
  std::stable_sort(rows.begin(), rows.end(), [&](const Row& a, const Row& b) {
    return std::min(posterior(a), most - alike) > std::min(posterior(b), most - alike);
  });
  const double margin = std::log(static_cast<double>(rows.size()) / alpha) * (data.blocks_only ? 2 : 1);
  for (const Row& r : rows) {
    if (posterior(r) > most - margin) profile.accepted.push_back(r.convention);
  }
  profile.convention = rows[0].convention, profile.log_likelihood = rows[0].likelihood;
  profile.translation = rows[0].k_t, profile.rotation = rows[0].k_r;
  profile.relative_sigma = std::sqrt(2 / (3 * static_cast<double>(data.size())));
  profile.identified = profile.accepted.size() == 1;
  const Agreement agreement =
      agreementUnder(data, {.convention = profile.convention}, profile.translation, profile.rotation);
  profile.tests = agreement.tests, profile.generic_p = agreement.generic_p;
  return profile;
}

}  // namespace detail

}  // namespace liestat
