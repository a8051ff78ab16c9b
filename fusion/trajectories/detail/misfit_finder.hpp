// The fit of clock, scale, body and world to poses as a reading has them.
#pragma once

#include <fusion/pose_stream.hpp>
#include <fusion/trajectories/detail/misfit_noise.hpp>
#include <fusion/trajectories/detail/misfit_reading.hpp>
#include <fusion/trajectories_types.hpp>
#include <fusion/trajectory_misfit_types.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat::detail {

struct MisfitFit {
  double delay = 0, scale = 1;
  SE3d body = {}, world = {};
  double cost = std::numeric_limits<double>::infinity();
};

/// Poses of the reference at times moved by `at`, with their velocities.
struct MisfitNodes {
  double at = 0;
  std::vector<SE3d> poses;
  std::vector<MisfitVector6> velocities;
  std::vector<bool> there;
};

class MisfitFinder {
 public:
  MisfitFinder(std::span<const SE3d> estimate, std::span<const SE3d> reference, std::span<const double> times,
               const PoseStream& stream, AlignmentModel alignment)
      : stream_(stream) {
    constexpr std::size_t most = 300;
    has_clock_ = times.size() == estimate.size() && stream.poses().size() >= 8;
    if (has_clock_) {
      // Rows at the ends and in gaps have no velocity; most do, or there is no clock.
      std::size_t some = 0, probes = 0;
      for (std::size_t i = 0; i < estimate.size(); i += 1 + estimate.size() / 200, ++probes) {
        some += stream.velocity(times[i]).has_value();
      }
      has_clock_ = 2 * some > probes;
    }
    std::vector<std::size_t> usable;
    for (std::size_t i = 0; i < estimate.size(); ++i) {
      if (estimate[i].params().allFinite() && reference[i].params().allFinite()) usable.push_back(i);
    }
    for (std::size_t k = 0; k < std::min(most, usable.size()); ++k) {
      const std::size_t i = usable.size() <= most ? usable[k] : usable[k * usable.size() / most];
      estimate_.push_back(estimate[i]), reference_.push_back(reference[i]);
      times_.push_back(has_clock_ ? times[i] : static_cast<double>(i));
    }
    base_.fill(false);
    const auto model = alignment;
    const bool world = model == AlignmentModel::se3 || model == AlignmentModel::sim3 || model == AlignmentModel::origin;
    for (const int k : {8, 9, 10}) base_[k] = world || model == AlignmentModel::posyaw;
    base_[11] = base_[12] = world, base_[13] = base_[8];
    base_[1] = model == AlignmentModel::sim3 || model == AlignmentModel::scale;
    world_is_free_ = world;
  }

  MisfitSearch find();

 private:
  std::size_t size() const { return estimate_.size(); }
  MisfitNodes nodesAt(double delay, std::size_t every = 1) const {
    MisfitNodes nodes{.at = delay, .poses = reference_, .velocities = {}, .there = {}};
    nodes.velocities.assign(size(), MisfitVector6::Zero()), nodes.there.assign(size(), true);
    if (!has_clock_) return nodes;
    for (std::size_t i = 0; i < size(); i += every) {
      const auto pose = stream_.at(times_[i] + delay);
      const auto velocity = stream_.velocity(times_[i] + delay);
      nodes.there[i] = pose && velocity;
      if (nodes.there[i]) nodes.poses[i] = *pose, nodes.velocities[i] = *velocity;
    }
    return nodes;
  }
  void keepRows(const std::vector<bool>& kept) {
    const auto keep = [&](auto& list) {
      std::size_t n = 0;
      for (std::size_t i = 0; i < list.size(); ++i) {
        if (kept[i]) list[n++] = list[i];
      }
      list.resize(n);
    };
    keep(estimate_), keep(reference_), keep(times_);
  }

  MisfitMask maskOf(unsigned groups) const {
    MisfitMask mask = base_;
    if (groups & 1) mask[0] = true;
    if (groups & 2) mask[1] = true;
    for (int k = 2; k < misfit_parameters; ++k) {
      if (groups & (k < 8 ? 4u : 8u)) mask[static_cast<std::size_t>(k)] = true;
    }
    return mask;
  }
  /// Groups that are no part of the alignment.
  unsigned suspects() const { return (has_clock_ ? 1u : 0u) | (base_[1] ? 0u : 2u) | 4u | (world_is_free_ ? 0u : 8u); }

  static SE3d posed(const SE3d& read, const MisfitFit& fit) {
    return fit.world * SE3d(read.so3(), Eigen::Vector3d(fit.scale * read.translation())) * fit.body;
  }
  void linearise(const MisfitReading& reading, std::span<const SE3d> read, const MisfitFit& fit,
                 const MisfitNodes& nodes, std::span<const std::size_t> rows, std::vector<MisfitRow>& out,
                 const MisfitNoise* noise = nullptr) const {
    out.resize(rows.size());
    MisfitRow before;
    SE3d before_T, before_M;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const std::size_t i = rows[k];
      const SE3d M = posed(read[i], fit);
      const SE3d T = nodes.poses[i] * SE3d::exp(MisfitVector6(nodes.velocities[i] * (fit.delay - nodes.at)));
      const Eigen::Matrix3d Rt = M.so3().inverse().matrix();
      MisfitRow& row = out[k];
      row.setZero();
      row.col(0) = nodes.velocities[i];
      row.col(1).head<3>() = -(Rt * (fit.world.so3() * Eigen::Vector3d(fit.scale * read[i].translation())));
      row.middleCols<6>(2).diagonal().setConstant(-1);
      row.block<3, 3>(0, 8) = -Rt;
      row.block<3, 3>(0, 11) = Rt * skew(Eigen::Vector3d(M.translation() - centre_));
      row.block<3, 3>(3, 11) = -Rt;
      row.col(misfit_parameters) = (M.inverse() * T).log();
      if (noise && noise->relative) {
        const SE3d motion = k > 0 ? before_T.inverse() * T : T;
        MisfitRow absolute = row;
        const double unit = k > 0 ? noise->unitOf(k) : std::sqrt(static_cast<double>(rows.size()));
        if (k > 0) {
          row -= product(motion.inverse().Adj(), before);
          row.rightCols<7>().setZero();  // steps know of no world
          row.col(misfit_parameters) = ((before_M.inverse() * M).inverse() * motion).log();
        }
        row /= unit;
        before = absolute, before_T = T, before_M = M;
      }
      // In the estimate's units: noise would shrink with the scale otherwise, and pay for it.
      if (reading.local_noise) row = product(MisfitMatrix6(nodes.poses[i].Adj()), row);
      row.topRows<3>() /= fit.scale;
      row.col(1).head<3>() -= row.col(misfit_parameters).head<3>();
    }
  }
  /// The sum of squares under a noise; without one, -2 log likelihood with variances of the two blocks that are free.
  double costOf(std::vector<MisfitRow>& rows, const MisfitNoise* noise) const {
    if (noise) {
      noise->whiten(rows);
      double sum = 0;
      for (const MisfitRow& row : rows) sum += row.col(misfit_parameters).squaredNorm();
      return sum;
    }
    const auto [t, r] = meanSquares(rows);
    const double a = 1 / std::sqrt(t), b = 1 / std::sqrt(r);
    for (MisfitRow& row : rows) row.topRows<3>() *= a, row.bottomRows<3>() *= b;
    return 3 * static_cast<double>(rows.size()) * (std::log(t) + std::log(r));
  }
  std::pair<double, double> meanSquares(const std::vector<MisfitRow>& rows) const {
    double t = 0, r = 0;
    for (const MisfitRow& row : rows) {
      t += row.col(misfit_parameters).head<3>().squaredNorm(), r += row.col(misfit_parameters).tail<3>().squaredNorm();
    }
    const double n = 3 * static_cast<double>(rows.size());
    return {t / n + floor_t_, r / n + floor_r_};
  }

  /// Levenberg–Marquardt from a start, the clock about that of the nodes. Fills the information matrix where asked for.
  MisfitFit fitted(const MisfitReading& reading, std::span<const SE3d> read, MisfitFit fit, const MisfitMask& mask,
                   const MisfitNodes& nodes, std::span<const std::size_t> which, const MisfitNoise* noise,
                   int iterations,
                   Eigen::Matrix<double, misfit_parameters, misfit_parameters>* information = nullptr) const {
    using Normal = Eigen::Matrix<double, misfit_parameters, misfit_parameters>;
    using Step = Eigen::Matrix<double, misfit_parameters, 1>;
    std::vector<MisfitRow> rows, trial;
    linearise(reading, read, fit, nodes, which, rows, noise);
    fit.cost = costOf(rows, noise);
    double damping = 1e-8;
    for (int k = 0; k < iterations; ++k) {
      Normal H = Normal::Zero();
      Step g = Step::Zero();
      for (const MisfitRow& row : rows) {
        for (int i = 0; i < misfit_parameters; ++i) {
          if (!mask[static_cast<std::size_t>(i)]) continue;
          for (int j = 0; j <= i; ++j) {
            if (mask[static_cast<std::size_t>(j)]) H(i, j) += row.col(i).dot(row.col(j));
          }
          g[i] += row.col(i).dot(row.col(misfit_parameters));
        }
      }
      for (int i = 0; i < misfit_parameters; ++i) {
        for (int j = i + 1; j < misfit_parameters; ++j) H(i, j) = H(j, i);
        if (!(H(i, i) > 1e-20)) H.row(i).setZero(), H.col(i).setZero(), H(i, i) = 1, g[i] = 0;
      }
      if (information) *information = H;
      bool better = false;
      double gain = 0;
      for (int tries = 0; tries < 6 && !better; ++tries) {
        Normal damped = H;
        damped.diagonal() *= 1 + damping;
        const Step d = -Cholesky<double, misfit_parameters>(damped).solve<1>(g);
        if (!d.allFinite()) {
          damping = std::max(10 * damping, 1e-4);
          continue;
        }
        const MisfitFit next = moved(fit, d);
        linearise(reading, read, next, nodes, which, trial, noise);
        const double cost = costOf(trial, noise);
        if (cost < fit.cost) {
          gain = fit.cost - cost;
          fit = next, fit.cost = cost, better = true;
          std::swap(rows, trial);
          damping = std::max(0.1 * damping, 1e-10);
        } else {
          damping = std::max(10 * damping, 1e-4);
        }
      }
      if (!better || gain < 1e-3) break;
    }
    return fit;
  }
  /// The same with the clock free: nodes follow the delay until it stays.
  MisfitFit timedFit(const MisfitReading& reading, std::span<const SE3d> read, MisfitFit fit, const MisfitMask& mask,
                     std::span<const std::size_t> which, const MisfitNoise* noise, int iterations) const {
    constexpr double largest = 2;  // s
    for (int round = 0; round < 4; ++round) {
      const double before = fit.delay;
      fit = fitted(reading, read, fit, mask, nodesAt(before), which, noise, iterations);
      if (!(std::abs(fit.delay) < largest)) fit.delay = before;
      if (std::abs(fit.delay - before) < 1e-5) break;
    }
    return fit;
  }
  MisfitFit moved(MisfitFit fit, const Eigen::Matrix<double, misfit_parameters, 1>& d) const {
    fit.delay += d[0];
    fit.scale *= std::exp(std::clamp(d[1], -1., 1.));
    fit.body = fit.body * SE3d::exp(MisfitVector6(d.segment<6>(2)));
    const SE3d about = SE3d::trans(centre_);
    fit.world = about * SE3d::exp(MisfitVector6(d.segment<6>(8))) * about.inverse() * fit.world;
    return fit;
  }

  std::vector<SE3d> readAll(const MisfitReading& reading) const {
    std::vector<SE3d> read;
    for (const SE3d& T : estimate_) read.push_back(reading(T));
    return read;
  }
  std::vector<std::pair<MisfitReading, MisfitFit>> starts(const MisfitNodes& nodes) const;
  MisfitNoise gapsOf() const;
  std::pair<double, MisfitNoise> noiseOf(const std::vector<MisfitRow>& rows, const std::vector<MisfitRow>& steps) const;
  double scatter(MisfitNoise& noise, const std::vector<MisfitRow>& rows) const;

  const PoseStream& stream_;
  std::vector<SE3d> estimate_, reference_;
  std::vector<double> times_;
  MisfitMask base_;
  bool has_clock_ = false, world_is_free_ = false;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double floor_t_ = 0, floor_r_ = 0;
};

}  // namespace liestat::detail
