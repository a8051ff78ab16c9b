// The noise that the best fit of misfit leaves: its dependence in time and its covariance.
#pragma once

#include <fusion/trajectories/detail/misfit_finder.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat::detail {

inline MisfitNoise MisfitFinder::gapsOf() const {
  MisfitNoise noise;
  noise.gaps.assign(size(), 0);
  for (std::size_t i = 1; i < size(); ++i) noise.gaps[i] = times_[i] - times_[i - 1];
  std::vector<double> sorted(noise.gaps.begin() + 1, noise.gaps.end());
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  noise.gap = sorted[sorted.size() / 2];
  return noise;
}

/// The dependence in time of what a fit of all parameters has left, by restricted likelihood: errors that last are
/// what the parameters explain best.
inline std::pair<double, MisfitNoise> MisfitFinder::noiseOf(const std::vector<MisfitRow>& rows,
                                                            const std::vector<MisfitRow>& steps) const {
  constexpr int p = misfit_parameters;
  using Normal = Eigen::Matrix<double, p, p>;
  const MisfitNoise white = gapsOf();
  const double gap = white.gap, n = static_cast<double>(size());
  const MisfitMask everything = maskOf(15);
  Eigen::Matrix<double, p, 1> ridge = Eigen::Matrix<double, p, 1>::Zero();
  const auto judge = [&](const MisfitNoise& noise) {
    std::vector<MisfitRow> u = noise.relative ? steps : rows;
    const auto log_det = noise.innovate(u);
    const double base = -1.5 * (log_det[0] + log_det[1]);
    double value = -infinity;
    Eigen::Matrix<double, p, 1> step = Eigen::Matrix<double, p, 1>::Zero();
    // The channels' variances are those of the fit before.
    for (int pass = 0; pass < 2; ++pass) {
      MisfitVector6 squares = MisfitVector6::Zero();
      for (const MisfitRow& x : u) {
        squares += MisfitVector6(x.col(p) + x.leftCols<p>() * step).cwiseAbs2() / n;
      }
      value = base;
      for (int c = 0; c < 6; ++c) {
        squares[c] += c < 3 ? floor_t_ : floor_r_;
        value -= 0.5 * n * std::log(squares[c]);
      }
      Normal H = Normal::Zero();
      Eigen::Matrix<double, p, 1> g = Eigen::Matrix<double, p, 1>::Zero();
      double sum = 0;
      for (const MisfitRow& row : u) {
        MisfitRow x = row;
        for (int c = 0; c < 6; ++c) x.row(c) /= std::sqrt(squares[c]);
        for (int i = 0; i < p; ++i) {
          for (int j = 0; j <= i; ++j) H(i, j) += x.col(i).dot(x.col(j));
          g[i] += x.col(i).dot(x.col(p));
        }
        sum += x.col(p).squaredNorm();
      }
      if (ridge.isZero(0)) ridge = 1e-6 * H.diagonal();
      double freedom = 6 * n;
      for (int i = 0; i < p; ++i) {
        const bool is_free = everything[static_cast<std::size_t>(i)] && ridge[i] > 0;
        freedom -= is_free;
        for (int j = 0; j < i; ++j) {
          if (!is_free || !everything[static_cast<std::size_t>(j)] || !(ridge[j] > 0)) H(i, j) = 0;
          H(j, i) = H(i, j);
        }
        H(i, i) = is_free ? H(i, i) + ridge[i] : 1;
        if (!is_free) g[i] = 0;
      }
      const Cholesky<double, p> root(H);
      if (!root.ok()) return -infinity;
      step = -root.solve<1>(g);
      const double left = sum + g.dot(step);
      value -= 0.5 * freedom * std::log(std::max(left, 1e-6) / freedom) + 0.5 * root.logDeterminant();
    }
    return value;
  };
  constexpr double worth = 3;  // what a dependence has to be worth
  double most = judge(white) + worth;
  MisfitNoise best = white;
  // A time constant is hardly known from a record that is not much longer, and what lasts longest is the careful choice:
  // of cells whose log likelihoods differ by less, the later one.
  constexpr double doubt = 2;
  constexpr std::array<double, 6> constants{1.5, 5, 20, 80, 400, 1e6};
  constexpr std::array<double, 4> shares{.5, .85, .97, 1};
  double of_here = -infinity;
  MisfitNoise here = white;
  // Both blocks alike first, then each by itself.
  for (const int block : {2, 0, 1}) {
    std::vector<std::pair<double, MisfitNoise>> cells;
    const auto judged = [&](double share, double time_constant) {
      MisfitNoise trial = here;
      for (std::size_t b = 0; b < 2; ++b) {
        if (block == 2 || static_cast<std::size_t>(block) == b) {
          trial.share[b] = share, trial.time_constant[b] = time_constant;
        }
      }
      cells.push_back({judge(trial), trial});
      of_here = std::max(of_here, cells.back().first);
    };
    if (block < 2) judged(0, gap);
    for (const double tau : constants) {
      for (const double f : shares) judged(f, tau * gap);
    }
    for (const auto& [value, noise] : cells) {
      if (value > of_here - doubt) here = noise;
    }
  }
  if (of_here > most) most = of_here, best = here;
  MisfitNoise walk = white;
  walk.relative = true;
  double steps_of = 0;
  for (std::size_t i = 1; i < size(); ++i) steps_of -= 6 * std::log(walk.unitOf(i));
  constexpr double careful = 10;  // dead reckoning is the more careful choice
  if (const double value = judge(walk) + steps_of; value > most - careful) best = walk, most = value;
  return {most, best};
}

/// The covariance of the innovations that a fit has left, outliers down-weighted, for the noise; -2 log likelihood.
inline double MisfitFinder::scatter(MisfitNoise& noise, const std::vector<MisfitRow>& rows) const {
  std::vector<Eigen::Matrix<double, 6, 1>> e;
  e.reserve(rows.size());
  for (const MisfitRow& row : rows) e.push_back(row.col(misfit_parameters));
  noise.innovate(e);
  noise.weights.assign(e.size(), 1);
  double value = 0;
  for (int pass = 0; pass < 3; ++pass) {
    MisfitMatrix6 S = MisfitMatrix6::Zero();
    for (std::size_t i = 0; i < e.size(); ++i) S += noise.weights[i] * noise.weights[i] * e[i] * e[i].transpose();
    S /= static_cast<double>(e.size());
    // A matrix of 21 numbers needs more rows than one of six.
    if (size() < 60) S = MisfitMatrix6(S.diagonal().asDiagonal());
    for (int c = 0; c < 6; ++c) S(c, c) += 1e-9 * S(c, c) + (c < 3 ? floor_t_ : floor_r_);
    const Cholesky<double, 6> root(S);
    if (!root.ok()) break;
    noise.half = root.halfSolve<6>(MisfitMatrix6::Identity());
    value = static_cast<double>(e.size()) * root.logDeterminant();
    for (std::size_t i = 0; i < e.size(); ++i) {
      // The 0.998 quantile of χ²₆ and beyond: an outlier.
      constexpr double limit = 4.5;
      noise.weights[i] = std::min(1., limit / std::max(limit, MisfitVector6(noise.half * e[i]).norm()));
    }
  }
  return value;
}

}  // namespace liestat::detail
