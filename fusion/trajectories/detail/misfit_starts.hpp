// Readings of the poses with rough fits, from which the search for misfit starts.
#pragma once

#include <fusion/trajectories/detail/misfit_finder.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Readings with rough fits, all of scale, body and world free; the likeliest simple one first, and last the poses as
/// they are. Rotations are fitted by means from the 24 proper permutations, positions then by linear least squares.
inline std::vector<std::pair<MisfitReading, MisfitFit>> MisfitFinder::starts(const MisfitNodes& nodes) const {
  constexpr std::size_t kept = 12, rows = 100, rounds = 6;
  static const std::vector<Eigen::Matrix3d> permutations = signedPermutations();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const auto nearest = [&](const Eigen::Matrix3d& R) -> const Eigen::Matrix3d* {
    for (std::size_t k = 0; k < permutations.size() / 2; ++k) {
      if (R.cwiseProduct(permutations[k]).sum() > 1 + 2 * std::cos(0.35)) return &permutations[k];
    }
    return nullptr;
  };
  struct Turned {
    MisfitReading reading;
    Eigen::Matrix3d X, Y;  // rotations of body and world beside those of the reading
    double r, r0;          // mean square angle per axis; without X, and without Y unless the alignment frees it
  };
  std::vector<Turned> turned;
  double least = infinity;
  const std::size_t every = 1 + size() / rows;
  for (int variant = 0; variant < 6; ++variant) {
    MisfitReading reading;
    reading.w_first = variant / 2 == 1, reading.reference_w_first = variant / 2 == 2;
    reading.rotation_inverse = variant % 2 == 1;
    std::vector<Eigen::Matrix3d> R, T;
    for (std::size_t i = 0; i < size(); i += every) {
      R.push_back(reading(estimate_[i]).rotationMatrix());
      T.push_back(nodes.poses[i].rotationMatrix());
    }
    const auto n = static_cast<double>(R.size());
    Turned general{reading, I, I, infinity, infinity};
    for (std::size_t k = 0; k < permutations.size() / 2; ++k) {
      Eigen::Matrix3d x = permutations[k], y = I;
      double score = -infinity, first_score = 0;
      Eigen::Matrix3d first;
      for (std::size_t round = 0; round < rounds; ++round) {
        Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
        for (std::size_t i = 0; i < R.size(); ++i) M += T[i] * (R[i] * x).transpose();
        y = SO3d::fitToSO3(M).matrix();
        const double now = y.cwiseProduct(M).sum() / n;
        if (round == 0) first = M, first_score = now;
        if (now < score + 1e-3 * (3 - now)) break;
        score = now;
        if (round + 1 == rounds) break;
        M.setZero();
        for (std::size_t i = 0; i < R.size(); ++i) M += (y * R[i]).transpose() * T[i];
        x = SO3d::fitToSO3(M).matrix();
      }
      const double r = std::max(0., (3 - score) / 3) + floor_r_;
      least = std::min(least, r);
      // The first of those as good: the identity.
      if (r < 0.9 * general.r) general.X = x, general.Y = y, general.r = r;
      const Eigen::Matrix3d *B = nearest(x), *A = world_is_free_ ? &permutations[0] : nearest(y);
      if (!A || !B) continue;
      const double alone = *B == permutations[k] ? world_is_free_ ? first_score : A->cwiseProduct(first).sum() / n : 0;
      Turned sparse{reading, B->transpose() * x, y * A->transpose(), r, std::max(0., (3 - alone) / 3) + floor_r_};
      sparse.reading.A = *A, sparse.reading.B = *B;
      turned.push_back(sparse);
      if (!world_is_free_ || *B == I) continue;
      sparse.reading.A = B->transpose(), sparse.Y = y * *B;
      turned.push_back(sparse);
    }
    if (variant < 2) turned.push_back(general);
  }
  std::vector<std::pair<double, std::pair<MisfitReading, MisfitFit>>> list;
  std::pair<MisfitReading, MisfitFit> as_is;
  for (const Turned& x : turned) {
    const bool first = x.reading.faults().empty();
    // Twice the least: errors in time, which are fitted later, spoil good and bad ones alike.
    if (x.r > 2 * least + 1e-4 && !first) continue;
    for (const bool inverse : {false, true}) {
      MisfitReading reading = x.reading;
      reading.position_inverse = inverse;
      std::vector<Eigen::Vector3d> p, t;
      std::vector<Eigen::Matrix3d> R;
      MisfitReading plain = reading;
      plain.C = I;
      for (std::size_t i = 0; i < size(); i += every) {
        const SE3d read = plain(estimate_[i]);
        p.push_back(read.translation()), R.push_back(x.Y * read.rotationMatrix());
        t.push_back(nodes.poses[i].translation() - centre_);
      }
      const auto n = static_cast<double>(p.size());
      for (const Eigen::Matrix3d& C : permutations) {
        // t = s Y C p + c + Y R l for scale s, world c and body l.
        Eigen::Matrix<double, 7, 7> H = 1e-9 * Eigen::Matrix<double, 7, 7>::Identity();
        Eigen::Matrix<double, 7, 1> g = Eigen::Matrix<double, 7, 1>::Zero();
        double squares = 0;
        for (std::size_t i = 0; i < p.size(); ++i) {
          Eigen::Matrix<double, 7, 3> K;
          K.row(0) = x.Y * (C * p[i]);
          K.middleRows<3>(1) = I, K.bottomRows<3>() = R[i].transpose();
          H += productTransposed(K, K), g += K * t[i], squares += t[i].squaredNorm();
        }
        const Eigen::Matrix<double, 7, 1> y = Cholesky<double, 7>(H).solve<1>(g);
        if (!y.allFinite() || !(y[0] > 0)) continue;
        reading.C = C;
        MisfitFit fit;
        fit.scale = y[0];
        fit.body = SE3d(SO3d::fitToSO3(x.X), Eigen::Vector3d(y.tail<3>()));
        fit.world = SE3d(SO3d::fitToSO3(x.Y), Eigen::Vector3d(y.segment<3>(1) + centre_));
        const double left = std::max(0., squares - g.dot(y)) / (3 * n) + floor_t_;
        // Where the motion is no larger than the noise, least squares make the scale too small.
        Eigen::Vector3d c = Eigen::Vector3d::Zero();
        double unscaled = 0;
        const auto off = [&](std::size_t i) { return Eigen::Vector3d(t[i] - x.Y * (C * p[i]) - R[i] * y.tail<3>()); };
        for (std::size_t i = 0; i < p.size(); ++i) c += off(i) / n;
        for (std::size_t i = 0; i < p.size(); ++i) unscaled += (off(i) - c).squaredNorm() / (3 * n);
        if (unscaled < 4 * left) fit.scale = 1, fit.world = SE3d(SO3d(fit.world.so3()), Eigen::Vector3d(c + centre_));
        fit.cost = 3 * n * (std::log(left) + std::log(x.r));
        // Without body, scale and, unless the alignment frees it, world.
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        double alone = 0;
        const Eigen::Matrix3d& Y = world_is_free_ ? x.Y : I;
        for (std::size_t i = 0; i < p.size() && base_[8]; ++i) mean += (t[i] + centre_ - Y * (C * p[i])) / n;
        for (std::size_t i = 0; i < p.size(); ++i) {
          alone += (t[i] + centre_ - Y * (C * p[i]) - mean).squaredNorm() / (3 * n);
        }
        const double cost0 = 3 * n * (std::log(alone + floor_t_) + std::log(x.r0));
        constexpr double of_parameters = 70;
        const auto faults = reading.faults().size();
        if (faults == 0 && !(as_is.second.cost <= fit.cost)) as_is.second = fit;
        if (faults > 0 && faults <= 3) {
          list.push_back(
              {std::min(fit.cost + of_parameters, cost0) + 20 * static_cast<double>(faults), {reading, fit}});
        }
      }
    }
  }
  std::stable_sort(list.begin(), list.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::pair<MisfitReading, MisfitFit>> best;
  // Readings may be others in disguise: w first and its inverse beside the right permutations.
  const std::array<SE3d, 2> probes{SE3d(SO3d::exp(Eigen::Vector3d(.3, -.5, .7)), Eigen::Vector3d(1, 2, 3)),
                                   SE3d(SO3d::exp(Eigen::Vector3d(-.6, .2, .4)), Eigen::Vector3d(-2, 3, 1))};
  const auto same = [&](const MisfitReading& a, const MisfitReading& b) {
    return std::all_of(probes.begin(), probes.end(),
                       [&](const SE3d& T) { return (a(T).inverse() * b(T)).log().norm() < 1e-6; });
  };
  for (const auto& [score, x] : list) {
    if (best.size() == kept) break;
    const auto& reading = x.first;
    if (same(reading, {}) ||
        std::any_of(best.begin(), best.end(), [&](const auto& y) { return same(reading, y.first); })) {
      continue;
    }
    best.push_back(x);
  }
  best.push_back(as_is);
  return best;
}

}  // namespace liestat::detail
