// The estimators of fusion/two_view/robust.hpp.
#pragma once

#include <fusion/two_view/detail/robust_matches.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/robust.hpp>
#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>
#include <stats/robust_search.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace liestat::detail {

/// A matrix and what the matches tell of its entries, in the coordinates of the matches.
struct RobustMatrix {
  Eigen::Matrix3d matrix;
  EntrySums information;
};

/// The search, and the estimate from all matches, each weighed by the probability that it is right.
template <class Kind>
std::optional<RobustMatrix> robustMatrix(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                         const TwoViewRobustOptions& options, TwoViewRobustResult& result) {
  const std::size_t n = matches.size();
  const double threshold = options.threshold > 0 ? options.threshold : (Kind::equations == 2 ? 9.2103 : 6.6349);
  const RobustTwoViewModel<Kind> model(matches, noise);
  const Background background = backgroundOf<Kind>(matches, noise, threshold);
  const double by_chance = static_cast<double>(n) * background.score;
  RobustSearchOptions search_options;
  search_options.inlier_threshold = threshold;
  search_options.seed = options.seed;
  search_options.rejection_risk = 1e-3;
  // A wrong hypothesis fits its own sample, and others by chance.
  search_options.min_score = static_cast<double>(Kind::sample_size) + by_chance + 3 * std::sqrt(by_chance);
  RobustSearch search(model, TruncatedCost{threshold}, search_options);
  // Right matches are those within χ²_{0.999}, less those that are by chance.
  std::vector<double> errors(n);
  const double wide = Kind::equations == 2 ? 13.8155 : 10.8276;
  const double wide_band = backgroundOf<Kind>(matches, noise, wide).band;
  double right_matches = 0;
  std::size_t needed = std::numeric_limits<std::size_t>::max();
  while (search.draws() < std::min(options.max_draws, needed)) {
    if (!search.iterate()) continue;
    model.errors(*search.best().parameter, errors);
    const auto fitting =
        static_cast<double>(std::count_if(errors.begin(), errors.end(), [&](double e) { return e < wide; }));
    right_matches = std::round(fitting - (static_cast<double>(n) - fitting) * wide_band / (1 - wide_band));
    right_matches = std::max(right_matches, static_cast<double>(search.best().inliers.size()));
    needed = sampleCount(static_cast<std::size_t>(right_matches), n, Kind::sample_size, options.confidence);
  }
  result.draws = search.draws();
  if (!search.best().parameter) return std::nullopt;

  RobustMatrix found{*search.best().parameter, {}};
  result.status = Status::not_converged;
  std::vector<double> weights(n, 0.0);
  for (const std::size_t i : search.best().inliers) weights[i] = 1;
  RightMatches<Kind> right(model, background, threshold);
  // Shares and leverages settle first, then the estimate: to a hundredth of its standard deviation.
  constexpr int updates = Kind::equations == 1 ? 4 : 2, most = 40;
  for (int pass = 0; pass < most; ++pass) {
    const EntrySums sums = model.sums(found.matrix, weights);
    double squared_length = 0;
    if (!entryStep<Kind>(sums, found.matrix, squared_length)) break;
    model.errors(found.matrix, errors);
    if (pass < updates) right.update(found.matrix, sums, errors, weights);
    right.weigh(errors, weights);
    if (pass < updates || !(squared_length < 1e-4)) continue;
    result.status = Status::ok;
    break;
  }
  right.curvatures(errors, weights);
  found.information = model.sums(found.matrix, weights);
  result.chi2 = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!(errors[i] < threshold) || right.isBehind(i)) continue;
    result.inliers.push_back(i);
    result.chi2 += errors[i];
  }
  result.score = static_cast<double>(result.inliers.size()) - result.chi2 / threshold;
  if (!isBeyondChance(result.inliers.size(), n, Kind::sample_size, background.band, result.draws)) {
    result.status = Status::ill_defined;
  }
  double p = 1;
  for (std::size_t k = 0; k < Kind::sample_size; ++k) {
    p *= std::max(right_matches - static_cast<double>(k), 0.) / static_cast<double>(n - k);
  }
  result.confidence = p < 1 ? -std::expm1(static_cast<double>(result.draws) * std::log1p(-p)) : 1;
  return found;
}

/// True if there is something to estimate; else the status says why not.
inline bool isUsable(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                     const TwoViewRobustOptions& options, std::size_t sample_size, Status& status) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  status = Status::not_applicable;
  if (!positive(noise.first) || !positive(noise.second) || !(options.confidence > 0 && options.confidence < 1) ||
      !(options.threshold >= 0 && std::isfinite(options.threshold)) || options.max_draws == 0 ||
      !std::all_of(matches.begin(), matches.end(), [](const Eigen::Vector4d& m) { return m.allFinite(); })) {
    return false;
  }
  status = matches.size() > sample_size ? Status::ill_defined : Status::too_few;
  return status != Status::too_few;
}

/// Translations and scales that centre both images.
struct CentredImages {
  Eigen::Matrix3d first, second, second_inverse;
  MatchNoise noise;
  std::vector<Eigen::Vector4d> matches;
  bool spread = false;

  CentredImages(std::span<const Eigen::Vector4d> given, const MatchNoise& given_noise) {
    const CentredMatches sums(given);
    spread = sums.spread;
    if (!spread) return;
    const double s = sums.scaleOf(sums.first, given.size()), r = sums.scaleOf(sums.second, given.size());
    const Eigen::Vector2d &a = sums.mean, &b = sums.mean_second;
    first << s, 0, -s * a.x(), 0, s, -s * a.y(), 0, 0, 1;
    second << r, 0, -r * b.x(), 0, r, -r * b.y(), 0, 0, 1;
    second_inverse << 1 / r, 0, b.x(), 0, 1 / r, b.y(), 0, 0, 1;
    noise = {s * given_noise.first, r * given_noise.second};
    matches.reserve(given.size());
    for (const Eigen::Vector4d& m : given) {
      matches.emplace_back(s * (m[0] - a.x()), s * (m[1] - a.y()), r * (m[2] - b.x()), r * (m[3] - b.y()));
    }
  }
};

/// left M right of squared norm `norm`, and the covariance of its entries.
inline bool carryBack(const Eigen::Matrix3d& left, const Eigen::Matrix3d& right, double norm, Eigen::Matrix3d& M,
                      Matrix9& covariance) {
  Matrix9 J;
  for (int j = 0; j < 3; ++j) {
    for (int l = 0; l < 3; ++l) J.block<3, 3>(3 * j, 3 * l) = right(l, j) * left;
  }
  M = product(left, product(M, right));
  const double scale = std::sqrt(norm / M.squaredNorm());
  M *= scale;
  const Vector9 m = entriesOf(M) / std::sqrt(norm);
  J = (scale * (J - m * product(m.transpose(), J))).eval();
  covariance = congruence(J, covariance);
  return M.allFinite() && covariance.allFinite();
}

/// The estimate in centred images, carried back to `norm`.
template <class Kind>
void robustMatrixAndCovariance(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                               const TwoViewRobustOptions& options, TwoViewRobustResult& result, Eigen::Matrix3d& M,
                               Matrix9& covariance) {
  if (!isUsable(matches, noise, options, Kind::sample_size, result.status)) return;
  const CentredImages images(matches, noise);
  if (!images.spread) return;
  const auto found = robustMatrix<Kind>(images.matches, images.noise, options, result);
  if (!found) return;
  constexpr bool homography = Kind::equations == 2;
  M = found->matrix;
  const auto of_entries = result.ok() ? entryCovariance<Kind>(found->information, M) : std::nullopt;
  Matrix9 carried = of_entries.value_or(covariance);
  const Eigen::Matrix3d left = homography ? images.second_inverse : Eigen::Matrix3d(images.second.transpose());
  const bool finite = carryBack(left, images.first, homography ? 3 : 2, M, carried);
  if (!result.ok()) return;
  if (finite) {
    covariance = carried;
  } else {
    result.status = Status::not_converged;
  }
}

/// True if matches show a translation: the mean square of their parallax, in units of its noise, is twice the two that
/// noise alone makes. None counts for more than five standard deviations, as a few that are wrong would.
inline bool showTranslation(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                            const Eigen::Matrix3d& R) {
  double sum = 0;
  for (const Eigen::Vector4d& m : matches) {
    const Eigen::Vector3d y = R * Eigen::Vector3d(m[0], m[1], 1), v(m[2], m[3], 1);
    const double variance = noise.first * noise.first * v.squaredNorm() + noise.second * noise.second * y.squaredNorm();
    sum += std::min(25., y.cross(v).squaredNorm() / variance);
  }
  return sum > 4 * static_cast<double>(matches.size());
}

}  // namespace liestat::detail

namespace liestat {

LIESTAT_FUSION_INLINE RobustHomography robustHomography(std::span<const Eigen::Vector4d> matches,
                                                        const MatchNoise& noise, const TwoViewRobustOptions& options) {
  RobustHomography result;
  detail::robustMatrixAndCovariance<detail::HomographyKind>(matches, noise, options, result, result.H,
                                                            result.covariance);
  return result;
}

LIESTAT_FUSION_INLINE RobustFundamental robustFundamental(std::span<const Eigen::Vector4d> matches,
                                                          const MatchNoise& noise,
                                                          const TwoViewRobustOptions& options) {
  RobustFundamental result;
  detail::robustMatrixAndCovariance<detail::FundamentalKind>(matches, noise, options, result, result.F,
                                                             result.covariance);
  return result;
}

LIESTAT_FUSION_INLINE RobustEssential robustEssential(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                                      const TwoViewRobustOptions& options) {
  RobustEssential result;
  if (!detail::isUsable(matches, noise, options, detail::EssentialKind::sample_size, result.status)) return result;
  const auto found = detail::robustMatrix<detail::EssentialKind>(matches, noise, options, result);
  if (!found) return result;
  std::vector<Eigen::Vector4d> inliers;
  for (const std::size_t i : result.inliers) inliers.push_back(matches[i]);
  result.pose.mean = toEssential(poseByCheirality(found->matrix, inliers).pose);
  result.E = result.pose.mean.essentialMatrix();
  if (!result.ok() && result.status != Status::not_converged) return result;
  if (!detail::showTranslation(inliers, noise, result.pose.mean.so3().matrix())) result.status = Status::ill_defined;
  if (!result.ok()) return result;
  const Eigen::Matrix<double, 9, 5> J = result.pose.mean.essentialMatrixJacobian();
  const detail::Cholesky<double, 5> factor(
      detail::product(J.transpose(), detail::product(found->information.matrix(), J)));
  result.pose.covariance = factor.inverse();
  if (!factor.ok()) result.status = Status::not_converged;
  return result;
}

}  // namespace liestat
