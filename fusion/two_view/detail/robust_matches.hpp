// Which matches are right: wrong ones lie anywhere, and the probability of each match weighs it.
#pragma once

#include <fusion/two_view/detail/robust_kinds.hpp>
#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/robust.hpp>
#include <stats/robust_search.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

namespace liestat::detail {

/// The errors of matches that lie anywhere, in units of the noise.
struct Background {
  double density = 0;  ///< at any error, over that of the normal law at zero
  double band = 0;     ///< probability of an error below the threshold
  double score = 0;    ///< mean of the truncated cost as a score
};
template <class Kind>
Background backgroundOf(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise, double threshold) {
  Eigen::Vector4d low = matches.front(), high = low;
  for (const Eigen::Vector4d& m : matches) low = low.cwiseMin(m), high = high.cwiseMax(m);
  // As TwoViewModel::chance: a disc, or the band about a line, in the second image; errors of both images.
  const double width = (high[2] - low[2]) / noise.second, height = (high[3] - low[3]) / noise.second;
  const double ratio = noise.first / noise.second, variance = 1 + ratio * ratio;
  constexpr double pi = std::numbers::pi;
  Background b;
  if constexpr (Kind::equations == 2) {
    b.density = std::min(0.5, 2 * pi * variance / (width * height));
    b.band = std::min(0.5, 0.5 * threshold * b.density);
    b.score = b.band / 2;
  } else {
    b.density = std::min(0.5, std::sqrt(2 * pi * variance) * 1.3 / std::min(width, height));
    b.band = std::min(0.5, std::sqrt(2 / pi * threshold) * b.density);
    b.score = b.band * 2 / 3;
  }
  return b;
}

/// The probabilities that matches are right: normal errors for a share of them, the others anywhere.
///
/// Wrong matches that lie on their epipolar line by chance have often a parallax, and so a leverage, that few right ones
/// have, and would move the estimate by many of its standard deviations. So the share is that among matches of about the
/// same leverage: how many of them fit, less those that would by chance and three standard deviations of these.
template <class Kind>
class RightMatches {
 public:
  RightMatches(const RobustTwoViewModel<Kind>& model, const Background& background, double threshold)
      : model_(model),
        background_(background),
        threshold_(threshold),
        bins_(model.size(), 0),
        behind_(model.size(), 0),
        leverage_(Kind::equations == 1 ? model.size() : 0) {}

  /// Classes of leverage under what the sums tell of the matrix, and the shares in them. The weights are those of the
  /// sums: leverages are without the match itself.
  void update(const Eigen::Matrix3d& M, const EntrySums& sums, std::span<const double> errors,
              std::span<const double> weights) {
    Kind::markBehind(M, model_.matches(), model_.noise(), errors, threshold_, behind_);
    if constexpr (Kind::equations == 1) {
      if (const std::optional<Matrix9> covariance = entryCovariance<Kind>(sums, M)) {
        model_.leverages(M, *covariance, leverage_);
        for (std::size_t i = 0; i < bins_.size(); ++i) {
          bins_[i] = classOf(leverage_[i] / std::max(1 - weights[i] * leverage_[i], 1e-12));
        }
      }
    }
    std::array<double, classes> all{}, fitting{};
    std::size_t highest = classes;
    double lone = 0;  // how many are taken from each class
    if constexpr (Kind::equations == 1) {
      const auto right = std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.5; });
      const double most = std::clamp(3. * free_parameters / static_cast<double>(right), 0.5, 0.9);
      highest = classOf(most / (1 - most)), lone = 1;
    }
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      all[bins_[i]] += 1;
      if (errors[i] < threshold_ && behind_[i] == 0) fitting[bins_[i]] += 1;
    }
    // One that is alone in its class may be there by chance, unless few are at all.
    double by_chance = 0;
    for (std::size_t b = 0; b < classes; ++b) by_chance += (all[b] - fitting[b]) * background_.band;
    lone *= std::min(1., 5 * by_chance);
    for (std::size_t b = 0; b < classes; ++b) {
      const double chance = (all[b] - fitting[b]) * background_.band;
      const double share =
          b > highest ? 0 : std::min((fitting[b] - chance - 3 * std::sqrt(chance) - lone) / all[b], 0.99);
      odds_[b] = share > 0 ? background_.density * (1 - share) / share : std::numeric_limits<double>::infinity();
    }
  }
  /// Probabilities by the shares of the last update.
  void weigh(std::span<const double> errors, std::span<double> weights) const {
    // Beyond that, a probability of 1e-6 and less.
    constexpr double far = 28;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      weights[i] = errors[i] < far && behind_[i] == 0 ? 1 / (1 + odds_[bins_[i]] * std::exp(0.5 * errors[i])) : 0;
    }
  }
  /// From the probabilities the second derivatives of the mixture's logarithm, in units of the information of a match
  /// that is certain.
  static void curvatures(std::span<const double> errors, std::span<double> weights) {
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (weights[i] > 0) weights[i] *= 1 - (1 - weights[i]) * errors[i] / Kind::equations;
    }
  }
  bool isBehind(std::size_t i) const { return behind_[i] != 0; }

 private:
  static constexpr std::size_t classes = 64;
  static constexpr int free_parameters = Kind::coordinates == 5 ? 5 : Kind::coordinates - 1;
  /// Two for each power of two.
  static unsigned char classOf(double leverage) {
    int exponent = 0;
    const double mantissa = std::frexp(leverage, &exponent);
    if (!(mantissa > 0 && mantissa < 1)) return 0;
    return static_cast<unsigned char>(std::clamp(2 * exponent + (mantissa > 0.70710678 ? 1 : 0) + 48, 0, 63));
  }

  const RobustTwoViewModel<Kind>& model_;
  Background background_;
  double threshold_;
  std::vector<unsigned char> bins_, behind_;
  std::vector<double> leverage_;
  std::array<double, classes> odds_{};
};

/// True if in so many draws, of three hypotheses each, wrong matches alone would agree as well with no more than a
/// probability of one in a thousand: Chernoff's bound on how many fit a hypothesis by chance, beside its sample.
inline bool isBeyondChance(std::size_t inliers, std::size_t matches, std::size_t sample_size, double chance,
                           std::size_t draws) {
  if (inliers <= sample_size) return false;
  const double others = static_cast<double>(matches - sample_size);
  const double share = static_cast<double>(inliers - sample_size) / others;
  if (!(share > chance)) return false;
  const double divergence =
      share * std::log(share / chance) + (share < 1 ? (1 - share) * std::log((1 - share) / (1 - chance)) : 0);
  return others * divergence > std::log(3e3 * static_cast<double>(draws));
}

}  // namespace liestat::detail
