// The estimators of fusion/two_view/robust.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/match_columns.hpp>
#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/detail/seven_points.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/robust.hpp>
#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>
#include <lie/essential.hpp>
#include <stats/robust.hpp>
#include <stats/robust_search.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat::detail {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

inline Vector9 entriesOf(const Eigen::Matrix3d& M) { return Eigen::Map<const Vector9>(M.data()); }

/// Coordinates of a matrix: the derivatives of its entries by them, and the direction in which only its norm changes.
template <int K>
struct EntryTangent {
  Eigen::Matrix<double, 9, K> entries;
  Eigen::Matrix<double, K, 1> norm = Eigen::Matrix<double, K, 1>::Zero();
  Eigen::Matrix3d left, right;  ///< the frames in which they are taken

  /// Zᵀ A Z, and something for the norm, of which the matches say nothing.
  Cholesky<double, K> factor(const EntrySums& sums) const {
    Eigen::Matrix<double, K, K> A = product(entries.transpose(), product(sums.matrix(), entries));
    A += A.trace() * norm * norm.transpose();
    return Cholesky<double, K>(A);
  }
};

/// A unit vector times a length, as the last of an orthonormal basis.
inline Eigen::Matrix3d basisBefore(const Eigen::Vector3d& last) {
  const Eigen::Vector3d n = last.normalized();
  const Eigen::Vector3d p =
      (std::abs(n.x()) < 0.6 ? Eigen::Vector3d(0, n.z(), -n.y()) : Eigen::Vector3d(-n.z(), 0, n.x())).normalized();
  Eigen::Matrix3d U;
  U << p, n.cross(p), n;
  return U;
}

/// Homographies: their nine entries, ‖H‖² = 3.
struct HomographyKind {
  using Equation = HomographyColumns;
  static constexpr std::size_t sample_size = 4;
  static constexpr int equations = 2, coordinates = 9;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    for (const Eigen::Matrix3d& H : solveHomography(sample)) solutions.push_back(H);
  }
  static EntryTangent<9> tangent(const Eigen::Matrix3d& H) {
    return {Matrix9::Identity(), entriesOf(H) / H.norm(), {}, {}};
  }
  /// Those behind have infinite errors.
  static void markBehind(const Eigen::Matrix3d&, std::span<const Eigen::Vector4d>, const MatchNoise&,
                         std::span<const double>, double, std::span<unsigned char>) {}
  static void move(Eigen::Matrix3d& H, const EntryTangent<9>&, const Vector9& delta) {
    H += Eigen::Map<const Eigen::Matrix3d>(delta.data());
    H *= std::sqrt(3 / H.squaredNorm());
  }
};

/// Fundamental matrices: F = U [B a; bᵀ bᵀB⁻¹a] Vᵀ; U and V end with the null vectors, where a = b = 0.
struct FundamentalKind {
  using Equation = EpipolarColumns;
  static constexpr std::size_t sample_size = 7;
  static constexpr int equations = 1, coordinates = 8;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    solveSevenPoints(sample, [&](const Eigen::Matrix3d& F) {
      if (isOriented(F, sample)) solutions.push_back(F);
    });
  }
  static EntryTangent<8> tangent(const Eigen::Matrix3d& F) {
    EntryTangent<8> t;
    t.left = basisBefore(rightNullVector(F.transpose())), t.right = basisBefore(rightNullVector(F));
    for (int k = 0; k < 8; ++k) {
      for (int j = 0; j < 3; ++j) t.entries.block<3, 1>(3 * j, k) = t.right(j, k / 3) * t.left.col(k % 3);
    }
    t.norm = product(t.entries.transpose(), entriesOf(F)) / F.norm();
    return t;
  }
  /// Matches that lie behind one of the views: (e' × ũ')·(F ũ) has not the sign of most.
  static void markBehind(const Eigen::Matrix3d& F, std::span<const Eigen::Vector4d> matches, const MatchNoise&,
                         std::span<const double> errors, double threshold, std::span<unsigned char> behind) {
    const Eigen::Vector3d epipole = rightNullVector(F.transpose());
    std::ptrdiff_t balance = 0;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector4d& m = matches[i];
      const double side = epipole.cross(Eigen::Vector3d(m[2], m[3], 1)).dot(F * Eigen::Vector3d(m[0], m[1], 1));
      behind[i] = side < 0 ? 1 : 0;
      if (errors[i] < threshold) balance += side < 0 ? 1 : -1;
    }
    if (balance <= 0) return;
    for (unsigned char& flag : behind) flag = 1 - flag;
  }
  static void move(Eigen::Matrix3d& F, const EntryTangent<8>& t, const Eigen::Matrix<double, 8, 1>& delta) {
    const Eigen::Matrix<double, 8, 1> f = t.norm * F.norm() + delta;
    const double det = f[0] * f[4] - f[1] * f[3];
    Eigen::Matrix3d G;
    G << f[0], f[3], f[6], f[1], f[4], f[7], f[2], f[5],
        (f[2] * (f[4] * f[6] - f[3] * f[7]) + f[5] * (f[0] * f[7] - f[1] * f[6])) / det;
    F = product(t.left, productTransposed(G, t.right));
    F *= std::sqrt(2 / F.squaredNorm());
  }
};

/// Essential matrices [t]× R.
struct EssentialKind {
  using Equation = EpipolarColumns;
  static constexpr std::size_t sample_size = 5;
  static constexpr int equations = 1, coordinates = 5;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    for (const Eigen::Matrix3d& E : solveEssential(sample)) {
      if (isOriented(E, sample)) solutions.push_back(E);
    }
  }
  /// t moves by the two axes across it, R is turned from the left.
  static EntryTangent<5> tangent(const Eigen::Matrix3d& E) {
    const EssentialParts<double> parts = essentialParts(E);
    EntryTangent<5> tangent;
    tangent.left = basisBefore(parts.direction), tangent.right = parts.rotation;
    const Eigen::Vector3d t = tangent.left.col(2);
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d r = tangent.right.col(j);
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector3d axis = tangent.left.col(k);
        tangent.entries.block<3, 1>(3 * j, k) = axis.cross(r);
      }
      // t × (e × r) = e (t·r) - r (t·e).
      tangent.entries.block<3, 3>(3 * j, 2) = t.dot(r) * Eigen::Matrix3d::Identity() - r * t.transpose();
    }
    return tangent;
  }
  /// Matches whose point lies behind a view, for the pose that has most in front, by a parallax of more than the noise.
  static void markBehind(const Eigen::Matrix3d& E, std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                         std::span<const double> errors, double threshold, std::span<unsigned char> behind) {
    const double least = 3 * std::sqrt(noise.first * noise.first + noise.second * noise.second);
    const Solutions<TwoViewPose, 4> poses = posesOfEssential(E);
    if (poses.empty()) return;
    std::ptrdiff_t balance[2] = {0, 0};
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!(errors[i] < threshold)) continue;
      for (std::size_t k = 0; k < 2; ++k) balance[k] += sideOf(poses[k], matches[i], least);
    }
    const std::size_t twist = std::abs(balance[1]) > std::abs(balance[0]) ? 1 : 0;
    const int front = balance[twist] < 0 ? -1 : 1;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector4d& m = matches[i];
      if (!(errors[i] < threshold) || sideOf(poses[twist], m, least) == front) {
        behind[i] = 0;
        continue;
      }
      const Eigen::Vector3d v(m[2], m[3], 1), y = poses[twist].R * Eigen::Vector3d(m[0], m[1], 1);
      behind[i] = y.cross(v).squaredNorm() > least * least * y.squaredNorm() * v.squaredNorm() ? 1 : 0;
    }
  }
  static void move(Eigen::Matrix3d& E, const EntryTangent<5>& tangent, const Eigen::Matrix<double, 5, 1>& delta) {
    const Eigen::Matrix3d& axes = tangent.left;
    const Eigen::Vector3d t = (axes.col(2) + delta[0] * axes.col(0) + delta[1] * axes.col(1)).normalized();
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond(1, 0.5 * delta[2], 0.5 * delta[3], 0.5 * delta[4]).normalized().toRotationMatrix();
    E = skewTimes<double>(t, product(turn, tangent.right));
    E *= std::sqrt(2 / E.squaredNorm());
  }
};

/// A Gauss–Newton step and its squared length in standard deviations. False where the sums leave a direction open.
template <class Kind>
bool entryStep(const EntrySums& sums, Eigen::Matrix3d& M, double& squared_length) {
  const auto tangent = Kind::tangent(M);
  const auto factor = tangent.factor(sums);
  if (!factor.ok()) return false;
  const Eigen::Matrix<double, Kind::coordinates, 1> g = product(tangent.entries.transpose(), sums.vector()),
                                                    delta = -factor.template solve<1>(g);
  squared_length = -delta.dot(g);
  Kind::move(M, tangent, delta);
  return M.allFinite() && squared_length >= 0;
}

/// The inverse of what the sums say of the entries, on the directions that are free.
template <class Kind>
std::optional<Matrix9> entryCovariance(const EntrySums& sums, const Eigen::Matrix3d& M) {
  const auto tangent = Kind::tangent(M);
  const auto factor = tangent.factor(sums);
  if (!factor.ok()) return std::nullopt;
  return congruence(tangent.entries, factor.inverse());
}

/// One model and its matches, for RobustSearch.
template <class Kind>
class RobustTwoViewModel {
 public:
  using Parameter = Eigen::Matrix3d;
  static constexpr std::size_t sample_size = Kind::sample_size;

  RobustTwoViewModel(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise)
      : matches_(matches), noise_(noise), columns_(matches), some_(matches.size()) {}

  std::size_t size() const { return matches_.size(); }
  std::span<const Eigen::Vector4d> matches() const { return matches_; }
  const MatchNoise& noise() const { return noise_; }

  void solve(std::span<const std::size_t> sample, std::vector<Parameter>& solutions) const {
    std::array<Eigen::Vector4d, sample_size> chosen;
    for (std::size_t k = 0; k < sample_size; ++k) chosen[k] = matches_[sample[k]];
    Kind::solve(chosen, solutions);
  }
  void errors(const Parameter& q, std::span<double> squared) const {
    columnErrors(typename Kind::Equation(q, noise_), columns_, squared);
  }
  void errors(const Parameter& q, std::span<const std::size_t> measurements, std::span<double> squared) const {
    someErrors(typename Kind::Equation(q, noise_), matches_, measurements, squared);
  }
  std::optional<Parameter> refine(const Parameter& q, std::span<const std::size_t> inliers) const {
    return polish(q, inliers);
  }
  /// A Gauss–Newton step.
  std::optional<Parameter> polish(Parameter q, std::span<const std::size_t> inliers) const {
    some_.clear();
    for (const std::size_t i : inliers) some_.add(matches_[i], 1);
    double squared_length = 0;
    if (!entryStep<Kind>(sumsOfSome(q), q, squared_length)) return std::nullopt;
    return q;
  }
  /// The normal equations of matches with weights; those without any are left out.
  EntrySums sums(const Parameter& q, std::span<const double> weights) const {
    some_.clear();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i] != 0) some_.add(matches_[i], weights[i]);
    }
    return sumsOfSome(q);
  }
  /// Leverages of all matches: what a covariance of the entries leaves open of their equations, in units of the noise.
  void leverages(const Parameter& q, const Matrix9& covariance, std::span<double> leverage) const {
    columnLeverages(typename Kind::Equation(q, noise_), covariance, columns_, leverage);
  }

 private:
  EntrySums sumsOfSome(const Parameter& q) const {
    if (some_.size() == 0) return {};
    some_.pad();
    return entrySums(typename Kind::Equation(q, noise_), some_);
  }

  std::span<const Eigen::Vector4d> matches_;
  MatchNoise noise_;
  MatchColumns columns_;
  mutable MatchColumns some_;
};

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
