// The directed test for rest: do tracks show that the camera moved, however little?
//
// Directions that a camera at rest has seen are those of a common rotation (the gyroscope's bias) and noise. One that
// moves slowly adds ρᵢ Nᵢ p(t) to feature i: p a smooth path, ρᵢ > 0 an inverse depth, Nᵢ across its direction. Each track
// is two coefficients of a line and two of a parabola in time, and what is left of it is its own noise: the test asks
// how much a path of four times three numbers and one inverse depth per feature explain of the coefficients. So it sees
// an eighth of what a χ² of all angles has to have, and it needs no stated noise. The law of what is explained at rest
// is found by drawing noise for the same directions and times.
#pragma once

#include <fusion/init/detail/closed_form_blocks.hpp>
#include <fusion/detail/median.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/split_mix.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The outcome of the test.
struct RestParallax {
  bool tested = false;   ///< false: too few tracks with four images, or times
  double sigma = 0;      ///< a bearing's standard deviation at relative sigma one (rad), from the tracks' own scatter
  double explained = 0;  ///< χ² that a path explains, in units of sigma²
  double limit = 0;      ///< 0.995 quantile of `explained` under noise alone
  double unseen_speed = 0;  ///< m/s for each metre of depth: less in the least visible direction may go unseen
  std::size_t tracks = 0;   ///< tracks used; others scatter too much, or have too few images

  bool atRest() const { return tested && explained <= limit; }
};

/// The test on the tracks of a table, directions in the axes of the first image.
class RestParallaxTest {
 public:
  explicit RestParallaxTest(const RayTable& table) {
    for (std::size_t i = 0; i < table.features(); ++i) addTrack(table, i);
    dropRough();
  }

  RestParallax run() {
    RestParallax result;
    result.tracks = tracks_.size();
    if (tracks_.size() < 3) return result;
    result.tested = true;
    result.sigma = sigma_;
    for (Track& track : tracks_) {
      for (double& x : track.s) x /= sigma_;
    }
    result.explained = explained();
    const std::vector<Track> seen = tracks_;
    double sum = 0, squares = 0;
    SplitMix random;  // always the same numbers
    for (int draw = 0; draw < draws; ++draw) {
      for (Track& track : tracks_) {
        for (double& x : track.s) x = random.normal();
      }
      // The scatter that it is counted in is estimated too.
      const double x = explained() / std::max(0.1, 1 + std::sqrt(2 / degrees_) * random.normal());
      sum += x;
      squares += x * x;
    }
    tracks_ = seen;
    const double mean = sum / draws, variance = squares / draws - mean * mean;
    // Wilson and Hilferty's quantile of the Γ law with this mean and variance.
    const double ninth = variance / (9 * mean * mean);
    result.limit = mean * std::pow(1 - ninth + normal_quantile * std::sqrt(ninth), 3);
    // The parameter of non-centrality λ for which no more than 0.005 stay below: mean + λ - z √(variance + 4 λ) = limit.
    const double z = normal_quantile, gap = result.limit - mean;
    const double lambda = gap + 2 * z * z + z * std::sqrt(4 * gap + 4 * z * z + variance);
    result.unseen_speed = std::sqrt(lambda / leastInformation()) * sigma_;
    return result;
  }

 private:
  static constexpr int draws = 100;
  static constexpr double normal_quantile = 2.5758293035489;  ///< the 0.995 quantile

  struct Track {
    std::array<double, 4> s{};                   ///< components across the direction: line (2), parabola (2)
    std::array<double, 3> by_power{};            ///< component of t along the line; of t² along line and parabola
    Eigen::Matrix<double, 2, 3> across, turned;  ///< derivatives by a path and by a rotation
    double rough = 0, degrees = 0;               ///< squared residual of line and parabola, and its degrees of freedom
  };

  void addTrack(const RayTable& table, std::size_t i) {
    const std::span<const Ray> rays = table.of(i);
    if (rays.size() < 4) return;
    // An orthonormal basis of 1, t, t² at the track's times, weighted.
    std::vector<std::array<double, 3>> basis;
    double middle = 0, weights = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Ray& ray : rays) {
      const double w = ray.precision * ray.precision;
      middle += w * table.images[ray.image].tau;
      mean += w * ray.u;
      weights += w;
    }
    middle /= weights;
    mean.normalize();
    double powers[4] = {};  // sums of (τ - middle)², to the fourth power, from [1]
    for (const Ray& ray : rays) {
      const double w = ray.precision * ray.precision, t = table.images[ray.image].tau - middle;
      powers[1] += w * t * t;
      powers[2] += w * t * t * t;
      powers[3] += w * t * t * t * t;
    }
    const double line = powers[1], skew_part = powers[2] / line;
    const double square_mean = powers[1] / weights;
    double parabola = 0;
    const auto bend = [&](double t) { return t * t - skew_part * t - square_mean; };
    for (const Ray& ray : rays) {
      const double w = ray.precision * ray.precision, b = bend(table.images[ray.image].tau - middle);
      parabola += w * b * b;
    }
    if (!(line > 1e-12 * weights) || !(parabola > 1e-12 * weights)) return;
    Track track;
    track.across = tangentRows(mean);
    track.turned = -track.across * skew(mean);
    const double to_line = 1 / std::sqrt(line), to_parabola = 1 / std::sqrt(parabola);
    double squares = 0;
    Eigen::Vector2d level = Eigen::Vector2d::Zero();
    for (const Ray& ray : rays) {
      const double w = ray.precision * ray.precision, t = table.images[ray.image].tau - middle;
      const Eigen::Vector2d y = track.across * ray.u;
      level += w * y;
      squares += w * y.squaredNorm();
      for (std::size_t k = 0; k < 2; ++k) {
        track.s[k] += w * to_line * t * y[static_cast<int>(k)];
        track.s[2 + k] += w * to_parabola * bend(t) * y[static_cast<int>(k)];
      }
    }
    squares -= level.squaredNorm() / weights;
    for (const double x : track.s) squares -= x * x;
    track.rough = std::max(0., squares);
    track.degrees = 2. * static_cast<double>(rays.size()) - 6;
    // τ and τ² in that basis, in seconds of the window: a path is p(t) = v t + a t².
    const double T = table.window;
    track.by_power = {T * std::sqrt(line), T * T * (skew_part + 2 * middle) * std::sqrt(line),
                      T * T * std::sqrt(parabola)};
    tracks_.push_back(track);
  }

  /// The scatter of the median track; tracks of twice that are not of features.
  void dropRough() {
    if (tracks_.empty()) return;
    std::vector<double> ratio;
    for (const Track& track : tracks_) {
      // The median of χ²ₙ/n.
      const double ninth = 2 / (9 * track.degrees);
      ratio.push_back(track.rough / track.degrees / std::pow(1 - ninth, 3));
    }
    const double typical = median(std::move(ratio));
    const auto isRough = [typical](const Track& track) { return track.rough > typical * noiseLimit(track.degrees); };
    tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), isRough), tracks_.end());
    double squares = 0, degrees = 0;
    for (const Track& track : tracks_) {
      squares += track.rough;
      degrees += track.degrees;
    }
    degrees_ = std::max(1., degrees);
    sigma_ = std::sqrt(squares / degrees_);
    if (!(sigma_ > 0)) sigma_ = std::numeric_limits<double>::min();
  }

  using Vector12 = Eigen::Matrix<double, 12, 1>;

  /// Coefficients of a track under a rotation and a path: θ₁ t + θ₂ t² and v t + a t², at an inverse depth of one.
  static std::array<double, 4> predicted(const Track& track, const Vector12& x, bool path) {
    const int from = path ? 6 : 0;
    const Eigen::Matrix<double, 2, 3>& J = path ? track.across : track.turned;
    const Eigen::Vector2d first = J * x.segment<3>(from), second = J * x.segment<3>(from + 3);
    const auto& h = track.by_power;
    return {h[0] * first[0] + h[1] * second[0], h[0] * first[1] + h[1] * second[1], h[2] * second[0], h[2] * second[1]};
  }

  /// Least squares for rotation and path, given inverse depths and weights; rotation alone without depths.
  bool solve(const std::vector<double>& depth, const std::vector<double>& weight, Vector12& x) const {
    Eigen::Matrix<double, 12, 12> H = Eigen::Matrix<double, 12, 12>::Zero();
    Vector12 g = Vector12::Zero();
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      const Track& track = tracks_[i];
      const auto& h = track.by_power;
      double J[4][12] = {};
      for (int r = 0; r < 2; ++r) {
        for (int c = 0; c < 3; ++c) {
          const double turn = track.turned(r, c), move = depth.empty() ? 0 : depth[i] * track.across(r, c);
          J[r][c] = h[0] * turn, J[r][3 + c] = h[1] * turn, J[2 + r][3 + c] = h[2] * turn;
          J[r][6 + c] = h[0] * move, J[r][9 + c] = h[1] * move, J[2 + r][9 + c] = h[2] * move;
        }
      }
      for (int r = 0; r < 4; ++r) {
        for (int a = 0; a < 12; ++a) {
          const double left = weight[i] * J[r][a];
          g[a] += left * track.s[static_cast<std::size_t>(r)];
          for (int b = 0; b <= a; ++b) H(a, b) += left * J[r][b];
        }
      }
    }
    // Rotation and path can't always be told apart: a millionth keeps them so.
    for (int a = 0; a < 12; ++a) {
      for (int b = 0; b < a; ++b) H(b, a) = H(a, b);
      H(a, a) = H(a, a) * (1 + 1e-6) + 1e-12 * H(0, 0);
      if (!(H(a, a) > 0)) H(a, a) = 1;
    }
    const Cholesky<double, 12> factor(H);
    if (!factor.ok()) return false;
    x = factor.template solve<1>(g);
    return true;
  }

  static double squaredNorm(const std::array<double, 4>& x) {
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3];
  }

  /// χ² that the best path explains beyond a rotation, without the tenth of the tracks that gain most.
  double explained() const {
    const std::size_t n = tracks_.size();
    std::vector<double> weight(n, 1), depth(n), gain(n), before(n);
    Vector12 rotation = Vector12::Zero();
    const auto leftOver = [&](std::size_t i, const Vector12& x) {
      std::array<double, 4> rest = predicted(tracks_[i], x, false);
      for (std::size_t k = 0; k < 4; ++k) rest[k] = tracks_[i].s[k] - rest[k];
      return rest;
    };
    for (int pass = 0; pass < 4; ++pass) {
      if (!solve({}, weight, rotation)) return 0;
      for (std::size_t i = 0; i < n; ++i) {
        before[i] = squaredNorm(leftOver(i, rotation));
        weight[i] = 1 / (1 + before[i] / 25);
      }
    }
    double most = 0;
    for (int start = 0; start < 6; ++start) {
      Vector12 x = rotation;
      x.tail<6>().setZero();
      x[6 + start % 3] = start < 3 ? 1 : -1;
      double sum = 0;
      for (int pass = 0; pass < 6; ++pass) {
        for (std::size_t i = 0; i < n; ++i) {
          const std::array<double, 4> rest = leftOver(i, x), path = predicted(tracks_[i], x, true);
          double along = 0;
          for (std::size_t k = 0; k < 4; ++k) along += rest[k] * path[k];
          const double length = squaredNorm(path);
          depth[i] = length > 0 ? std::max(0., along / length) : 0;
          std::array<double, 4> after = rest;
          for (std::size_t k = 0; k < 4; ++k) after[k] -= depth[i] * path[k];
          gain[i] = before[i] - squaredNorm(after);
          weight[i] = 1 / (1 + squaredNorm(after) / 25);
        }
        std::vector<double> sorted = gain;
        const std::size_t trimmed = n / 10;
        std::nth_element(sorted.begin(), sorted.end() - 1 - static_cast<std::ptrdiff_t>(trimmed), sorted.end());
        sum = 0;
        for (std::size_t i = 0; i + trimmed < n; ++i) sum += sorted[i];
        most = std::max(most, sum);
        if (pass == 5 || !solve(depth, weight, x)) break;
      }
    }
    return most;
  }

  /// That of a uniform motion of 1 m/s among features at 1 m, in the direction in which it looks most like a rotation.
  double leastInformation() const {
    Eigen::Matrix3d of_path = Eigen::Matrix3d::Zero(), cross = of_path, of_turn = of_path;
    for (const Track& track : tracks_) {
      const double h = track.by_power[0] * track.by_power[0];
      of_path += h * track.across.transpose() * track.across;
      of_turn += h * track.turned.transpose() * track.turned;
      cross += h * track.turned.transpose() * track.across;
    }
    const Cholesky<double, 3> factor(of_turn);
    if (!factor.ok()) return 0;
    const Eigen::Matrix3d half = factor.template halfSolve<3>(cross);
    return std::max(0., SmallSvd(SmallMatrix::of<3, 3>(Eigen::Matrix3d(of_path - half.transpose() * half))).value(2));
  }

  std::vector<Track> tracks_;
  double sigma_ = 0, degrees_ = 1;
};

}  // namespace liestat::detail
