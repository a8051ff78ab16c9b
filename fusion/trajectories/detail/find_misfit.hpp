// Definitions of fusion/trajectory_misfit.hpp; docs/evaluate.md, "Misfit before statistics".
#pragma once

#include <fusion/trajectories/detail/misfit_words.hpp>
#include <fusion/trajectories/detail/quaternion_order.hpp>
#include <fusion/trajectory_misfit.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

namespace liestat {

namespace detail {

/// Parameters of a fit, in this order: clock, scale, body (6), world (6).
inline constexpr int misfit_parameters = 14;
using MisfitMask = std::array<bool, misfit_parameters>;
/// A residual Log(M⁻¹ T) behind its derivatives by the parameters.
using MisfitRow = Eigen::Matrix<double, 6, misfit_parameters + 1>;
using MisfitVector6 = Eigen::Matrix<double, 6, 1>;
using MisfitMatrix6 = Eigen::Matrix<double, 6, 6>;

/// The 48 signed permutations; the identity first, then the other proper ones.
inline std::vector<Eigen::Matrix3d> signedPermutations() {
  std::vector<Eigen::Matrix3d> all;
  for (const double proper : {1., -1.}) {
    std::array<int, 3> order{0, 1, 2};
    do {
      for (int signs = 0; signs < 8; ++signs) {
        Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
        for (int i = 0; i < 3; ++i) P(i, order[static_cast<std::size_t>(i)]) = signs >> i & 1 ? -1 : 1;
        if (determinantOf<double>(P) * proper > 0) all.push_back(P);
      }
    } while (std::next_permutation(order.begin(), order.end()));
  }
  return all;
}

/// Its inverse: the rotation that a reader of w first takes for another.
inline SO3d wLast(const SO3d& R) {
  const Eigen::Vector4d& q = R.params();
  return SO3d(Eigen::Quaterniond(q[2], q[3], q[0], q[1]));
}

/// How the numbers of a pose are read: the faults without continuous parameters. A reference whose quaternions have w
/// first is left as it is, and the estimate's are misread alike.
struct MisfitReading {
  bool w_first = false, reference_w_first = false, rotation_inverse = false, position_inverse = false;
  bool local_noise = false;  // of inverted poses: in the axes of the pose as it is written
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity(), B = A, C = A;  // rotations A R B, positions C p

  SE3d operator()(const SE3d& pose) const {
    SO3d R = w_first ? wFirst(pose.so3()) : reference_w_first ? wLast(pose.so3()) : SO3d(pose.so3());
    Eigen::Vector3d p = pose.translation();
    if (position_inverse) p = -(R.inverse() * p);
    if (rotation_inverse) R = R.inverse();
    if (!A.isIdentity(0) || !B.isIdentity(0)) R = SO3d::fitToSO3(A * R.matrix() * B);
    return SE3d(R, Eigen::Vector3d(C * p));
  }
  std::vector<Misfit> faults() const {
    std::vector<Misfit> list;
    if (w_first) list.push_back(Misfit::w_first);
    if (reference_w_first) list.push_back(Misfit::reference_w_first);
    if (rotation_inverse || position_inverse) {
      list.push_back(!position_inverse   ? Misfit::rotation_inverse
                     : !rotation_inverse ? Misfit::position_inverse
                                         : Misfit::inverse);
    }
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const bool conjugate = B == A.transpose(), proper = determinantOf<double>(C) > 0;
    const bool alike = C == (proper ? A : Eigen::Matrix3d(-A));  // positions follow the world's axes
    if (!proper) list.push_back(alike ? Misfit::mirrored : Misfit::mirrored_positions);
    if (alike && proper && A != I) list.push_back(conjugate ? Misfit::axes : Misfit::world_axes);
    if (!alike && proper && C != I) list.push_back(Misfit::position_axes);
    if (!alike && A != I) list.push_back(Misfit::rotation_axes);
    if (B != I && !conjugate) list.push_back(Misfit::body_axes);
    return list;
  }
};

struct MisfitFit {
  double delay = 0, scale = 1;
  SE3d body = {}, world = {};
  double cost = std::numeric_limits<double>::infinity();
};

/// The noise of rows: a Gauss–Markov process and white noise, translation and rotation with shares and time constants of
/// their own, whose innovations have one covariance. The errors of dead reckoning are those of its steps: `relative` rows
/// are of these, but for the first, which may be off by as much as all steps together.
struct MisfitNoise {
  std::vector<double> gaps = {};
  double gap = 1;  // the median
  bool relative = false;
  std::array<double, 2> share = {0, 0}, time_constant = {1, 1};
  MisfitMatrix6 half = MisfitMatrix6::Identity();  // whitens innovations
  std::vector<double> weights = {};                // of rows; empty: one

  /// Innovations in place of the rows, in units of the process; log det of their variances per channel of each block.
  double unitOf(std::size_t row) const { return std::sqrt(gaps[row] / gap); }
  template <int N>
  std::array<double, 2> innovate(std::vector<Eigen::Matrix<double, 6, N>>& rows) const {
    Eigen::Matrix<double, 6, N> state = Eigen::Matrix<double, 6, N>::Zero();
    std::array<double, 2> P = share, log_det = {0, 0};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (i > 0) {
        for (int b = 0; b < 2; ++b) {
          const auto k = static_cast<std::size_t>(b);
          const double phi = std::exp(-gaps[i] / time_constant[k]);
          state.template middleRows<3>(3 * b) *= phi;
          P[k] = phi * phi * P[k] + share[k] * (1 - phi * phi);
        }
      }
      for (int b = 0; b < 2; ++b) {
        const auto k = static_cast<std::size_t>(b);
        const double F = P[k] + 1 - share[k];
        const Eigen::Matrix<double, 3, N> innovation =
            rows[i].template middleRows<3>(3 * b) - state.template middleRows<3>(3 * b);
        state.template middleRows<3>(3 * b) += P[k] / F * innovation;
        rows[i].template middleRows<3>(3 * b) = innovation / std::sqrt(F);
        log_det[k] += std::log(F);
        P[k] *= 1 - P[k] / F;
      }
    }
    return log_det;
  }
  void whiten(std::vector<MisfitRow>& rows) const {
    innovate(rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i] = product(half, rows[i]);
      if (!weights.empty()) rows[i] *= weights[i];
    }
  }
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

inline MisfitSearch MisfitFinder::find() {
  MisfitSearch search;
  constexpr std::size_t least_poses = 20;
  if (has_clock_) keepRows(nodesAt(0).there);
  if (size() < least_poses) {
    search.reason = "fewer than 20 poses";
    return search;
  }
  Eigen::Vector3d low = reference_[0].translation(), high = low;
  for (const SE3d& T : reference_) {
    centre_ += T.translation() / static_cast<double>(size());
    low = low.cwiseMin(T.translation()), high = high.cwiseMax(T.translation());
  }
  const MisfitMatrix6 between = has_clock_ ? stream_.interpolationError() : MisfitMatrix6(MisfitMatrix6::Zero());
  const double extent = std::max((high - low).norm(), 1e-3 * high.norm());
  floor_t_ = std::max(1e-18 + 1e-18 * extent * extent, between.topLeftCorner<3, 3>().trace() / 3);
  floor_r_ = std::max(1e-18, between.bottomRightCorner<3, 3>().trace() / 3);

  // Readings, then the clock of each.
  struct Candidate {
    MisfitReading reading;
    std::vector<SE3d> read;
    MisfitFit fit;
    MisfitNoise noise = {};
    double cost = 0, least = 0;  // -2 log likelihood of the fit under its noise, and the squares that it leaves
  };
  std::vector<std::size_t> all(size()), some;
  std::iota(all.begin(), all.end(), std::size_t{0});
  const MisfitMask everything = maskOf(15), but_clock = maskOf(14);
  MisfitNodes still = nodesAt(0);
  std::vector<Candidate> candidates;
  const auto middle = [&](const std::vector<SE3d>& read, const MisfitNodes& nodes, MisfitFit fit, bool of_world) {
    // The pose in the middle agrees.
    const std::size_t i = size() / 2;
    const SE3d T = nodes.poses[i], M = posed(read[i], fit);
    if (of_world) {
      fit.world = T * M.inverse() * fit.world;
    } else {
      fit.body = fit.body * M.inverse() * T;
    }
    return fit;
  };
  for (auto& [reading, start] : starts(still)) {
    Candidate c{reading, readAll(reading), start};
    c.fit = fitted(reading, c.read, start, but_clock, still, all, nullptr, 10);
    if (reading.rotation_inverse && reading.position_inverse) {
      candidates.push_back(c);
      candidates.back().reading.local_noise = true;
    }
    candidates.push_back(std::move(c));
  }
  Candidate& as_read = candidates.back();
  for (const bool of_world : {false, true}) {
    const MisfitFit other = fitted(as_read.reading, as_read.read, middle(as_read.read, still, {}, of_world), but_clock,
                                   still, all, nullptr, 10);
    if (other.cost < as_read.fit.cost) as_read.fit = other;
  }
  const auto cheaper = [](const Candidate& a, const Candidate& b) { return a.fit.cost < b.fit.cost; };
  if (has_clock_) {
    const std::size_t every = 1 + size() / 80;
    for (std::size_t i = 0; i < size(); i += every) some.push_back(i);
    constexpr double range = 1, step = 0.04;  // s
    // The delay of the likeliest reading serves the others, which are as good only if they turn alike.
    std::vector<Candidate*> scanned{&*std::min_element(candidates.begin(), candidates.end(), cheaper)};
    if (scanned[0] != &as_read) scanned.push_back(&as_read);
    std::vector<double> least(scanned.size(), infinity);
    std::vector<MisfitFit> found(scanned.size());
    for (double delay = -range; delay < range + 0.5 * step; delay += step) {
      const MisfitNodes nodes = nodesAt(delay, every);
      std::vector<std::size_t> rows;
      for (const std::size_t i : some) {
        if (nodes.there[i]) rows.push_back(i);
      }
      if (2 * rows.size() < some.size()) continue;
      for (std::size_t k = 0; k < scanned.size(); ++k) {
        MisfitFit fit = scanned[k]->fit;
        fit.delay = delay;
        fit = fitted(scanned[k]->reading, scanned[k]->read, fit, but_clock, nodes, rows, nullptr, 3);
        if (const double mean = fit.cost / static_cast<double>(rows.size()); mean < least[k]) {
          least[k] = mean, found[k] = fit;
        }
      }
    }
    std::vector<bool> there = still.there;
    for (std::size_t k = 0; k < scanned.size(); ++k) {
      if (!std::isfinite(least[k])) continue;
      const MisfitNodes nodes = nodesAt(found[k].delay);
      for (std::size_t i = 0; i < size(); ++i) there[i] = there[i] && nodes.there[i];
      for (Candidate& c : candidates) {
        if (&c == scanned[k]) c.fit = found[k];
        if (k == 0 && &c != &as_read) c.fit.delay = found[0].delay;
      }
    }
    if (static_cast<std::size_t>(std::count(there.begin(), there.end(), true)) < least_poses) {
      search.reason = "fewer than 20 poses at the times of both clocks";
      return search;
    }
    keepRows(there);
    all.resize(size());
    still = nodesAt(0);
    for (Candidate& c : candidates) {
      c.read = readAll(c.reading);
      c.fit = timedFit(c.reading, c.read, c.fit, everything, all, nullptr, 8);
    }
  }
  const Candidate& best = *std::min_element(candidates.begin(), candidates.end(), cheaper);
  search.poses = size();
  std::vector<MisfitRow> rows;
  const auto rowsOf = [&](const Candidate& c, const MisfitNoise& noise) {
    linearise(c.reading, c.read, c.fit, nodesAt(c.fit.delay), all, rows, &noise);
    return rows;
  };
  MisfitNoise walk = gapsOf();
  walk.relative = true;
  // Drift may suit other readings better than the poses as they are; its noise does not.
  auto [likelihood, noise] = noiseOf(rowsOf(best, gapsOf()), rowsOf(best, walk));
  if (&best != &as_read) {
    const auto [other, noise_of] = noiseOf(rowsOf(as_read, gapsOf()), rowsOf(as_read, walk));
    if (other > likelihood) noise = noise_of;
  }
  std::erase_if(candidates, [&, most = best.fit.cost + 60](const Candidate& c) {
    return c.fit.cost > most && !c.reading.faults().empty();
  });
  for (Candidate& c : candidates) {
    c.noise = noise;
    c.cost = scatter(c.noise, rowsOf(c, c.noise));
    c.fit = timedFit(c.reading, c.read, c.fit, everything, all, &c.noise, 6);
    c.least = c.fit.cost;
  }

  // All subsets of faults under this noise.
  struct Explained {
    const Candidate* of;
    unsigned groups;
    MisfitFit fit;
    std::vector<Misfit> faults;
    double penalty, cost;
  };
  // Penalties are quantiles of χ² with as many degrees of freedom at 1e-4, and for a reading the number of readings.
  constexpr double of_reading = 14, of_one = 15.1, of_six = 27.9;
  const double freedom = 6 * static_cast<double>(size()) - misfit_parameters;
  const auto penaltyOf = [&](const Candidate& c, unsigned groups) {
    return of_reading * static_cast<double>(c.reading.faults().size()) + of_one * std::popcount(groups & 3u) +
           of_six * std::popcount(groups & 12u);
  };
  const auto ratio = [&](const Candidate& c, double squares) { return c.cost + freedom * std::log(squares / c.least); };
  std::vector<std::pair<const Candidate*, unsigned>> tries;
  for (const Candidate& c : candidates) {
    for (unsigned groups = 0; groups < 16; ++groups) {
      if ((groups & ~suspects()) == 0) tries.push_back({&c, groups});
    }
  }
  std::stable_sort(tries.begin(), tries.end(), [&](const auto& a, const auto& b) {
    return penaltyOf(*a.first, a.second) < penaltyOf(*b.first, b.second);
  });
  std::vector<Explained> explained;
  double lowest = infinity;
  for (const auto& [of, groups] : tries) {
    const Candidate& c = *of;
    // An explanation that costs more than the best one is not better, and not simpler.
    if (c.cost + penaltyOf(c, groups) > lowest + 1) continue;
    const MisfitMask mask = maskOf(groups);
    MisfitFit start;
    if (groups & 1) start.delay = c.fit.delay;
    if (mask[1]) start.scale = c.fit.scale;
    const MisfitNodes nodes = groups & 1 ? nodesAt(c.fit.delay) : still;
    std::vector<MisfitFit> from{start};
    const bool world = mask[8], body = (groups & 4) != 0;
    if (body && world) {
      start.body = c.fit.body, start.world = c.fit.world;
      from.push_back(start);
    }
    if (world && mask[11]) from.push_back(middle(c.read, nodes, from[0], true));
    if (body) from.push_back(middle(c.read, nodes, from[0], false));
    MisfitFit fit;
    for (const MisfitFit& x : from) {
      const MisfitFit now = groups & 1 ? timedFit(c.reading, c.read, x, mask, all, &c.noise, 6)
                                       : fitted(c.reading, c.read, x, mask, still, all, &c.noise, 8);
      if (now.cost < fit.cost) fit = now;
    }
    if (!std::isfinite(fit.cost)) continue;
    Explained e{&c, groups, fit, c.reading.faults(), penaltyOf(c, groups), ratio(c, fit.cost)};
    for (const auto& [bit, fault] : {std::pair(1u, Misfit::clock), std::pair(2u, Misfit::scale),
                                     std::pair(4u, Misfit::body), std::pair(8u, Misfit::world)}) {
      if (groups & bit) e.faults.push_back(fault);
    }
    lowest = std::min(lowest, e.cost + e.penalty);
    explained.push_back(std::move(e));
  }
  search.searched = true, search.reason.clear();
  std::stable_sort(explained.begin(), explained.end(),
                   [&](const Explained& a, const Explained& b) { return a.cost + a.penalty < b.cost + b.penalty; });
  // Errors as users see them: plain least squares.
  const auto plain = [&](const Explained& e) {
    const MisfitNodes nodes = nodesAt(e.fit.delay);
    const MisfitFit fit = fitted(e.of->reading, e.of->read, e.fit, maskOf(e.groups), nodes, all, nullptr, 8);
    std::vector<MisfitRow> left;
    linearise(e.of->reading, e.of->read, fit, nodes, all, left);
    const auto [t, r] = meanSquares(left);
    return std::pair(t - floor_t_, r - floor_r_);
  };
  const auto as_is = std::find_if(explained.begin(), explained.end(), [](const auto& e) { return e.faults.empty(); });
  if (as_is == explained.end()) return search;
  const auto [before_t, before_r] = plain(*as_is);
  search.position_rmse = std::sqrt(3 * before_t), search.rotation_rmse = std::sqrt(3 * before_r);
  if (explained.front().faults.empty()) return search;
  // Less than this share of the errors is no explanation of them. Of errors that drift another frame of body or world
  // always explains the most.
  constexpr double least_share = 0.1, least_share_of_drift = 0.98, indistinguishable = 9;
  const double record = times_.back() - times_.front();
  const bool drifts = noise.relative || std::any_of(noise.time_constant.begin(), noise.time_constant.end(),
                                                    [&](double tau) { return tau > 0.05 * record; });
  const double of_first = explained.front().cost;
  const auto parameters = [](const Explained& e) {
    return std::popcount(e.groups & 3u) + 6 * std::popcount(e.groups & 12u);
  };
  for (const Explained& e : explained) {
    const auto contains = [&](const MisfitExplanation& x) {
      return std::all_of(x.faults.begin(), x.faults.end(),
                         [&](Misfit f) { return std::find(e.faults.begin(), e.faults.end(), f) != e.faults.end(); });
    };
    // Some of the first one's parameters may only be there because the noise pays for them.
    const int fewer = parameters(explained.front()) - parameters(e);
    const double limit = indistinguishable + 2.5 * std::max(0, fewer);
    if (!search.explanations.empty() &&
        (e.cost - of_first > limit || e.faults.size() > explained.front().faults.size() ||
         std::any_of(search.explanations.begin(), search.explanations.end(), contains))) {
      continue;
    }
    const auto [t, r] = plain(e);
    MisfitExplanation x;
    x.faults = e.faults;
    x.explained = 1 - 2 / ((before_t + floor_t_) / (t + floor_t_) + (before_r + floor_r_) / (r + floor_r_));
    x.position_rmse = std::sqrt(3 * t), x.rotation_rmse = std::sqrt(3 * r);
    if (x.explained < (drifts && (e.groups & 12) != 0 ? least_share_of_drift : least_share)) {
      if (search.explanations.empty()) return search;
      continue;
    }
    Eigen::Matrix<double, misfit_parameters, misfit_parameters> information;
    const MisfitFit fit = fitted(e.of->reading, e.of->read, e.fit, maskOf(e.groups), nodesAt(e.fit.delay), all,
                                 &e.of->noise, 2, &information);
    const auto covariance = Cholesky<double, misfit_parameters>(information).inverse();
    x.delay = e.groups & 1 ? fit.delay : 0, x.scale = fit.scale, x.body = fit.body, x.world = fit.world;
    if (e.groups & 1) x.delay_sigma = std::sqrt(covariance(0, 0));
    if (maskOf(e.groups)[1]) x.scale_sigma = x.scale * std::sqrt(covariance(1, 1));
    x.rotation_axes_left = e.of->reading.A, x.rotation_axes_right = e.of->reading.B, x.position_axes = e.of->reading.C;
    search.explanations.push_back(std::move(x));
  }
  return search;
}

}  // namespace detail

LIESTAT_FUSION_INLINE MisfitSearch findMisfit(std::span<const SE3d> estimate, std::span<const SE3d> reference,
                                              std::span<const double> times, const PoseStream& stream,
                                              AlignmentModel alignment, double offset) {
  MisfitSearch none;
  none.reason = "not as many poses in both";
  if (estimate.size() != reference.size()) return none;
  MisfitSearch search = detail::MisfitFinder(estimate, reference, times, stream, alignment).find();
  for (MisfitExplanation& e : search.explanations) e.offset = offset + e.delay;
  return search;
}

}  // namespace liestat
