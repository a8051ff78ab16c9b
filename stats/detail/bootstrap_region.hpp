// The factor by which a region of Hotelling's law is widened for skewed noise, by a bootstrap-t. Needs Eigen alone.
//
// Residuals z_i are drawn with replacement; a draw gives t*, the error of its mean in units of its own scatter. If the
// noise is skewed, a sample that errs to the short side of it also has too small a scatter, and |t*| has a long tail on
// one side. The region of a covariance is symmetric, so its quantile is that of the longer side: t* are divided by the
// plane across their average, and the 0.95 quantile of |t*|² is taken on each side. Drawing with replacement makes it
// larger than Hotelling's for normal noise already. It is therefore compared with that of normal samples of the same
// size and weights (docs/theory/means.md, section 7.8). The criterion's Hessian cancels in t*, nothing is averaged
// again.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/part_growth.hpp>
#include <stats/detail/split_mix.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/mean_region.hpp>
#include <stats/quantile.hpp>
#include <stats/residual_noise.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat::detail {

/// More measurements are drawn as groups of successive ones: the skewness of t* is that of all of them, γ/√n.
inline constexpr std::size_t max_drawn = 10'000;
/// Normal samples for comparison: their number times their size, and their number at most.
inline constexpr std::size_t rows_of_normal_samples = 800, max_normal_samples = 8;
/// A bootstrap whose quantile for normal noise is so many times Hotelling's has resampled too few measurements.
inline constexpr double largest_normal_ratio = 4;
/// The level of the region.
inline constexpr double region_tail = 0.05;
/// So large a quantile has been made by draws without scatter.
inline constexpr double unbounded_quantile = 1e6;

inline constexpr const char* unbounded_region_reason =
    "there are too few measurements for a bootstrap: too many of its draws have no scatter in some direction";

/// The residuals of a mean, with their weights, for a bootstrap.
template <int K>
class Bootstrap {
 public:
  using Vector = Eigen::Matrix<double, K, 1>;
  using Matrix = Eigen::Matrix<double, K, K>;

  /// About so many measurements, counts added up.
  Bootstrap(double n, ResidualNoise noise)
      : any_(noise == ResidualNoise::any), group_(std::max(1.0, std::ceil(n / static_cast<double>(max_drawn)))) {}

  /// Adds a residual of weight p that was measured `count` times.
  void add(const Vector& z, double p, double count = 1) {
    // A part of one that is left over is a row.
    while (count > 1e-9) {
      const double part = std::min(count, group_ - filled_);
      open_.z += part * p * z, open_.p += part * p;
      filled_ += part, count -= part;
      if (filled_ >= group_ * (1 - 1e-9)) close();
    }
  }

  /// The square of the factor for Hotelling's law of n; 1 without scatter, infinity where the draws have no bounds.
  double widening(double n, const BootstrapOptions& options) {
    if (filled_ > 0.5 * group_) close();
    constexpr double unbounded = std::numeric_limits<double>::infinity();
    if (rows_.size() < 2 || options.draws < 100) return unbounded;
    if (!whiten(rows_)) return 1;
    SplitMix random{options.seed};
    const double quantile = longerQuantile(rows_, options.draws, random);
    if (!(quantile < unbounded_quantile)) return unbounded;
    const std::size_t samples = std::clamp(rows_of_normal_samples / rows_.size(), std::size_t{1}, max_normal_samples);
    double logs = 0;
    std::vector<Row> normal = rows_;
    for (std::size_t i = 0; i < samples; ++i) {
      for (Row& row : normal) {
        for (int k = 0; k < K; ++k) row.z[k] = random.normal() / (any_ ? 1 : std::sqrt(row.p));
      }
      whiten(normal);
      logs += std::log(longerQuantile(normal, options.draws, random));
    }
    const double usual = std::exp(logs / static_cast<double>(samples));
    const double law = whereTail(region_tail, [&](double t2) { return hotellingTail(t2, K, n); });
    if (!(usual < largest_normal_ratio * law)) return unbounded;
    return std::max(1.0, quantile / usual);
  }

 private:
  struct Row {
    Vector z = Vector::Zero();
    double p = 0;
  };

  void close() {
    open_.z /= open_.p;
    rows_.push_back(open_);
    open_ = {}, filled_ = 0;
  }

  struct Sums {
    Vector weighted = Vector::Zero(), other = Vector::Zero();  ///< Σ p z, Σ q z
    Matrix squares = Matrix::Zero();                           ///< Σ q z zᵀ, its lower triangle
    double p = 0, q = 0;
    Vector mean() const { return weighted / p; }
  };
  void addTo(Sums& sums, const Row& row) const {
    const double q = any_ ? row.p * row.p : row.p;
    sums.weighted += row.p * row.z, sums.p += row.p;
    sums.other += q * row.z, sums.q += q;
    for (int j = 0; j < K; ++j) {
      const double qz = q * row.z[j];
      for (int i = j; i < K; ++i) sums.squares(i, j) += qz * row.z[i];
    }
  }
  /// Σ q (z - m)(z - m)ᵀ, the lower triangle.
  static Matrix scatterOf(const Sums& sums) {
    const Vector m = sums.mean();
    Matrix scatter = sums.squares;
    for (int j = 0; j < K; ++j) {
      for (int i = j; i < K; ++i) scatter(i, j) += sums.q * m[i] * m[j] - m[i] * sums.other[j] - sums.other[i] * m[j];
    }
    return scatter;
  }

  /// Residuals about their own mean in units of their scatter; false where there is none.
  bool whiten(std::vector<Row>& rows) const {
    // Metres and radians differ by more than singular_part.
    Vector size = Vector::Zero();
    for (const Row& row : rows) size += row.z.cwiseAbs();
    for (Row& row : rows) {
      for (int k = 0; k < K; ++k) row.z[k] /= size[k] > 0 ? size[k] : 1;
    }
    Sums sums;
    for (const Row& row : rows) addTo(sums, row);
    Matrix scatter = scatterOf(sums);
    scatter.diagonal().array() += singular_part * scatter.trace();
    const Cholesky<double, K> factor(scatter);
    if (!factor.ok()) return false;
    const Vector mean = sums.mean();
    for (Row& row : rows) row.z = factor.template halfSolve<1>(Vector(row.z - mean));
    return true;
  }

  /// The quantile of |t*|² on that side of the plane across the average of t* where it is larger.
  double longerQuantile(const std::vector<Row>& rows, std::size_t draws, SplitMix& random) const {
    std::vector<Vector> errors(draws);
    std::vector<double> squares(draws);
    for (std::size_t draw = 0; draw < draws; ++draw) {
      Sums sums;
      for (std::size_t i = 0; i < rows.size(); ++i) addTo(sums, rows[random.below(rows.size())]);
      Matrix scatter = scatterOf(sums);
      scatter.diagonal().array() += singular_part;
      const Cholesky<double, K> factor(scatter);
      const double size = sums.p * (any_ ? sums.p : static_cast<double>(rows.size()));
      errors[draw] = factor.ok() ? Vector(std::sqrt(size) * factor.template halfSolve<1>(sums.mean()))
                                 : Vector::Constant(unbounded_quantile);
      squares[draw] = errors[draw].squaredNorm();
    }
    const double middle = quantile(squares, 1 - region_tail);
    Vector average = Vector::Zero();
    for (std::size_t i = 0; i < draws; ++i) {
      average += errors[i] * (squares[i] > middle ? std::sqrt(middle / squares[i]) : 1);
    }
    std::array<std::vector<double>, 2> sides;
    for (std::size_t i = 0; i < draws; ++i) sides[errors[i].dot(average) > 0].push_back(squares[i]);
    double largest = 0;
    for (std::vector<double>& side : sides) {
      // A side of a few draws has no quantile.
      if (side.size() >= draws / 20) largest = std::max(largest, quantile(std::move(side), 1 - region_tail));
    }
    return largest;
  }

  bool any_;
  double group_, filled_ = 0;
  Row open_;
  std::vector<Row> rows_;
};

/// The square of the factor for the covariance of a mean from residuals, `sums` its last pass, that has Hotelling's law
/// of n.
template <Homogeneous M, class R, class W, class Sums>
double bootstrapWidening(const R& samples, const W& weights, const Sums& sums, ResidualNoise noise, double n,
                         const BootstrapOptions& options) {
  using T = ManifoldTraits<M>;
  const bool counts = noise == ResidualNoise::frequency;
  Bootstrap<T::DoF> bootstrap(counts ? sums.sum_of_weights : static_cast<double>(sums.n), noise);
  const typename T::Group to_mean = T::placement(sums.mean).inverse();
  for (std::size_t i = 0; i < sums.n; ++i) {
    const double p = static_cast<double>(weights[i]);
    const TangentOf<M> z = T::logOrigin(T::act(to_mean, M(samples[i])));
    bootstrap.add(z.template cast<double>(), counts ? 1 : p, counts ? p : 1);
  }
  return bootstrap.widening(n, options);
}

}  // namespace liestat::detail
