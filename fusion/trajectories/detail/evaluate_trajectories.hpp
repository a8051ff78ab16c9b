// Definitions of fusion/trajectories.hpp.
#pragma once

#include <lie/detail/small_orthogonal.hpp>
#include <fusion/nearest_in_time.hpp>
#include <fusion/trajectories/detail/pose_alignment.hpp>
#include <fusion/trajectories.hpp>
#include <lie/units.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

LIESTAT_FUSION_INLINE std::vector<TimeMatch> associateByInterpolation(std::span<const double> reference_times,
                                                                      std::span<const double> estimate_times,
                                                                      double max_gap, double offset) {
  std::vector<TimeMatch> matches;
  matches.reserve(estimate_times.size());
  std::size_t k = 0;  // the last stamp of the reference that is not later
  for (std::size_t i = 0; i < estimate_times.size(); ++i) {
    const double t = estimate_times[i] + offset;
    while (k + 1 < reference_times.size() && reference_times[k + 1] <= t) ++k;
    if (reference_times.empty() || !(reference_times[k] <= t)) continue;
    if (reference_times[k] == t) {
      matches.push_back({i, k, 0, 0});
    } else if (k + 1 < reference_times.size()) {
      const double gap = reference_times[k + 1] - reference_times[k];
      if (gap <= max_gap) matches.push_back({i, k, (t - reference_times[k]) / gap, gap});
    }
  }
  return matches;
}

LIESTAT_FUSION_INLINE std::vector<TimeMatch> associateNearest(std::span<const double> reference_times,
                                                              std::span<const double> estimate_times,
                                                              double max_difference, double offset) {
  std::vector<TimeMatch> matches;
  const bool by_reference = estimate_times.size() > reference_times.size();
  const std::span<const double> shorter = by_reference ? reference_times : estimate_times;
  const std::span<const double> longer = by_reference ? estimate_times : reference_times;
  const double shift = by_reference ? offset : -offset;  // added to the times of the longer list
  for (std::size_t i = 0; i < shorter.size() && !longer.empty(); ++i) {
    const std::size_t k = nearestInTime(longer, shorter[i], shift);
    const double difference = std::abs(longer[k] + shift - shorter[i]);
    if (!(difference <= max_difference)) continue;
    matches.push_back({by_reference ? k : i, by_reference ? i : k, 0, difference});
  }
  return matches;
}

namespace detail {

/// A reference as PoseCurve takes it. Without times its poses are a second apart.
struct ReferenceSource {
  const NoisyPoses* poses;
  std::span<const double> times;

  std::size_t size() const { return poses->size(); }
  double time(std::size_t i) const { return times.empty() ? static_cast<double>(i) : times[i]; }
  const SE3d& pose(std::size_t i) const { return poses->mean(i); }
  double timeOf(const TimeMatch& m) const {
    return time(m.reference) + m.fraction * (time(m.reference + 1) - time(m.reference));
  }
};

/// The error of interpolation between any two stamps, as a second moment. Stamps that are left out show it, scaled by
/// the polynomial of the nodes: the four about the gap its size, all of the reference its shape (four vectors have
/// none) and a fifth of its size, without which a gap between four good stamps would be too good.
class InterpolationErrors {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  InterpolationErrors(const ReferenceSource& source, PoseInterpolation rule) : source_(source), curve_(source, rule) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < source.size(); ++i) steps.push_back(source.time(i) - source.time(i - 1));
    const auto half = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    if (!steps.empty()) std::nth_element(steps.begin(), half, steps.end()), step_ = *half;
    for (const std::size_t count : {std::size_t{2}, std::size_t{4}}) {
      Order& order = orders_[count / 4];
      double n = 0;
      const std::size_t every = source.size() / 1000 + 1;
      for (std::size_t i = 0; i < source.size(); i += every) {
        if (!curve_.leftOut(i, count, 1)) continue;
        const Vector6& derivative = derivativeAt(i, count, 1);
        order.moment += derivative * derivative.transpose(), ++n;
      }
      if (n > 0) order.moment /= n;
      for (const int from : {0, 3}) {
        const double gain = curve_.lostGain(count, from);
        order.gain[from / 3] = gain * gain;
      }
    }
  }

  /// False where there are too few stamps to leave some out.
  bool known() const { return curve_.leftOut(source_.size() / 2, 4, 1).has_value(); }
  Matrix6 at(const TimeMatch& m) {
    const double time = source_.timeOf(m), gap = source_.time(m.reference + 1) - source_.time(m.reference);
    const auto nodes = curve_.nodes(m.reference);
    const Order& order = orders_[nodes.count / 4];
    constexpr double max_stride = 50;
    const auto stride = static_cast<std::size_t>(std::clamp(std::round(gap / step_), 1., max_stride));
    const std::size_t reach = (nodes.count - 1) * stride;
    const bool near = source_.size() >= 2 * reach + 1;
    const double product = std::pow(curve_.polynomial(nodes, time), 2);
    Matrix6 result = Matrix6::Zero();
    for (const int from : {0, 3}) {
      const Eigen::Matrix3d shape = order.moment.block<3, 3>(from, from);
      double size = shape.trace();
      if (!(size > 0)) continue;
      for (std::size_t k = 0; k < 4 && near; ++k) {
        const std::size_t i = std::clamp(m.reference + k, reach + 1, source_.size() - reach) - 1;
        size += derivativeAt(i, nodes.count, stride).segment<3>(from).squaredNorm();
      }
      result.block<3, 3>(from, from) =
          shape * (order.gain[from / 3] * product * size / (shape.trace() * (near ? 5 : 1)));
    }
    return result;
  }

 private:
  struct Kept {
    std::size_t i = 0, count = 0, stride = 0;
    Vector6 derivative = Vector6::Zero();
  };
  struct Order {
    Matrix6 moment = Matrix6::Zero();
    std::array<double, 2> gain{};
  };

  const Vector6& derivativeAt(std::size_t i, std::size_t count, std::size_t stride) {
    Kept& kept = kept_[i % kept_.size()];
    if (kept.i != i || kept.count != count || kept.stride != stride) {
      const auto nodes = *curve_.leftOut(i, count, stride);
      kept = {i, count, stride, curve_.error(i, nodes) / curve_.polynomial(nodes, source_.time(i))};
    }
    return kept.derivative;
  }

  ReferenceSource source_;
  PoseCurve<ReferenceSource> curve_;
  double step_ = 0;
  std::array<Order, 2> orders_{};
  std::array<Kept, 8> kept_{};
};

}  // namespace detail

LIESTAT_FUSION_INLINE MatchedPoses matchedPoses(std::span<const TimeMatch> matches, const NoisyPoses& reference,
                                                const NoisyPoses& estimate, PoseInterpolation interpolation,
                                                std::span<const double> reference_times) {
  MatchedPoses poses;
  poses.reference.reserve(matches.size()), poses.estimate.reserve(matches.size());
  const detail::ReferenceSource source{&reference, reference_times};
  const detail::PoseCurve<detail::ReferenceSource> curve(source, interpolation);
  for (const TimeMatch& m : matches) {
    Gaussian<SE3d> at = reference[m.reference];
    if (m.fraction != 0) {
      at.mean = curve.at(m.reference, source.timeOf(m));
      if (reference.keepsEach()) {
        at.covariance = (1 - m.fraction) * at.covariance + m.fraction * reference.covariance(m.reference + 1);
      }
    }
    poses.push_back({at, estimate[m.estimate]});
  }
  return poses;
}

LIESTAT_FUSION_INLINE InterpolationError addInterpolationError(std::span<const TimeMatch> matches,
                                                               const NoisyPoses& reference,
                                                               std::span<const double> reference_times,
                                                               PoseInterpolation interpolation, MatchedPoses& poses,
                                                               double factor) {
  InterpolationError result;
  const auto between = [](const TimeMatch& m) { return m.fraction != 0; };
  if (std::none_of(matches.begin(), matches.end(), between)) return result;
  detail::InterpolationErrors errors({&reference, reference_times}, interpolation);
  result.known = errors.known();
  if (!result.known) return result;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    if (!between(matches[k])) continue;
    const Eigen::Matrix<double, 6, 6> moment = errors.at(matches[k]);
    if (factor != 0) poses.reference.addCovariance(k, factor * moment);
    result.position += moment.topLeftCorner<3, 3>().trace(),
        result.rotation += moment.bottomRightCorner<3, 3>().trace();
  }
  result.position = std::sqrt(result.position / static_cast<double>(matches.size()));
  result.rotation = std::sqrt(result.rotation / static_cast<double>(matches.size()));
  return result;
}

LIESTAT_FUSION_INLINE NoisyPoses exactPoses(std::vector<SE3d> poses) { return NoisyPoses::exact(std::move(poses)); }

LIESTAT_FUSION_INLINE Alignment alignUmeyama(MatchedRange poses, AlignmentModel model, std::size_t n_to_align) {
  Alignment a;
  a.model = model;
  a.poses = model == AlignmentModel::none     ? 0
            : model == AlignmentModel::origin ? 1
            : n_to_align == 0                 ? poses.size()
                                              : std::min(n_to_align, poses.size());
  if (model == AlignmentModel::none) {
    a.ok = true;
    return a;
  }
  if (poses.empty()) {
    a.fault = "no poses";
    return a;
  }
  if (model == AlignmentModel::origin) {
    a.transform = poses.reference(0) * poses.estimate(0).inverse();
    a.parameters = 6;
    a.ok = true;
    return a;
  }
  const auto n = static_cast<double>(a.poses);
  Eigen::Vector3d x_mean = Eigen::Vector3d::Zero(), y_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < a.poses; ++i) {
    x_mean += poses.estimate(i).translation(), y_mean += poses.reference(i).translation();
  }
  x_mean /= n, y_mean /= n;
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  double variance = 0;
  for (std::size_t i = 0; i < a.poses; ++i) {
    const Eigen::Vector3d x = poses.estimate(i).translation() - x_mean, y = poses.reference(i).translation() - y_mean;
    moment += y * x.transpose();
    variance += x.squaredNorm();
  }
  moment /= n, variance /= n;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  if (model == AlignmentModel::posyaw) {
    const double c = moment(0, 0) + moment(1, 1), s = moment(1, 0) - moment(0, 1);
    if (!(std::hypot(c, s) > 1e-12 * variance)) {
      a.fault = "the positions do not determine the yaw";
      return a;
    }
    R = SO3d::rotZ(std::atan2(s, c)).matrix();
  } else {
    const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(moment));
    if (!(svd.value(1) > 1e-12 * svd.value(0))) {
      a.fault = "the positions are collinear: they do not determine the rotation";
      return a;
    }
    const Eigen::Matrix3d Ut = svd.u.matrix3(0, 0), Vt = svd.v.matrix3(0, 0);
    Eigen::Vector3d signs = Eigen::Vector3d::Ones();
    if (Ut.determinant() * Vt.determinant() < 0) signs[2] = -1;
    R = Ut.transpose() * signs.asDiagonal() * Vt;
    if (model == AlignmentModel::sim3 || model == AlignmentModel::scale) {
      a.scale = (svd.value(0) + svd.value(1) + signs[2] * svd.value(2)) / variance;
    }
  }
  if (model == AlignmentModel::scale) {
    a.parameters = 1;
    a.covariance.setConstant(detail::not_a_number);
    a.ok = true;
    return a;
  }
  a.transform = SE3d(R, Eigen::Vector3d(y_mean - a.scale * (R * x_mean)));
  a.parameters = model == AlignmentModel::posyaw ? 4 : model == AlignmentModel::se3 ? 6 : 7;
  a.ok = true;
  a.covariance = detail::umeyamaCovariance(poses.first(a.poses), a);
  return a;
}

LIESTAT_FUSION_INLINE Alignment alignWeighted(MatchedRange poses, AlignmentModel model, std::size_t n_to_align) {
  return detail::weightedAlignment(poses, model, n_to_align);
}

LIESTAT_FUSION_INLINE Consistency evaluateConsistency(MatchedRange poses, const Alignment& alignment) {
  return detail::consistencyOf(poses, alignment);
}

LIESTAT_FUSION_INLINE ErrorStatistics errorStatistics(std::span<const double> errors) {
  ErrorStatistics s;
  if (errors.empty()) return s;
  const auto n = static_cast<double>(errors.size());
  std::vector<double> sorted(errors.begin(), errors.end());
  std::sort(sorted.begin(), sorted.end());
  double sum = 0;
  s.sse = 0;
  for (const double e : errors) sum += e, s.sse += e * e;
  s.mean = sum / n;
  s.rmse = std::sqrt(s.sse / n);
  double squares = 0;
  for (const double e : errors) squares += (e - s.mean) * (e - s.mean);
  s.std = std::sqrt(squares / n);
  const std::size_t half = sorted.size() / 2;
  s.median = sorted.size() % 2 == 1 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
  s.min = sorted.front(), s.max = sorted.back();
  return s;
}

namespace detail {

inline double errorNumber(const SE3d& E, PoseRelation relation) {
  switch (relation) {
    case PoseRelation::full:
      return std::sqrt((E.rotationMatrix() - Eigen::Matrix3d::Identity()).squaredNorm() +
                       E.translation().squaredNorm());
    case PoseRelation::rot_part:
      return (E.rotationMatrix() - Eigen::Matrix3d::Identity()).norm();
    case PoseRelation::angle_deg:
      return E.so3().log().norm() / units::degree;
    case PoseRelation::angle_rad:
      return E.so3().log().norm();
    default:
      return E.translation().norm();
  }
}

}  // namespace detail

LIESTAT_FUSION_INLINE std::vector<double> absoluteErrors(MatchedRange poses, const Alignment& alignment,
                                                         PoseRelation relation) {
  std::vector<double> errors;
  errors.reserve(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const SE3d estimate = alignment(poses.estimate(i));
    switch (relation) {
      case PoseRelation::trans_part:
      case PoseRelation::point_distance:
      case PoseRelation::point_distance_error_ratio:
        errors.push_back((estimate.translation() - poses.reference(i).translation()).norm());
        break;
      default:
        errors.push_back(detail::errorNumber(estimate.inverse() * poses.reference(i), relation));
    }
  }
  return errors;
}

LIESTAT_FUSION_INLINE std::vector<std::pair<std::size_t, std::size_t>> posePairs(MatchedRange poses,
                                                                                 const Alignment& alignment,
                                                                                 const RelativeOptions& options) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  const std::size_t n = poses.size();
  const auto pose = [&](std::size_t i) {
    return options.pairs_from_reference ? poses.reference(i) : alignment(poses.estimate(i));
  };
  const double tolerance = options.relative_tolerance * options.delta;
  if (!(options.delta > 0) || n < 2) return pairs;
  if (options.unit == DeltaUnit::frames) {
    const auto delta = static_cast<std::size_t>(options.delta);
    if (delta == 0) return pairs;
    pairs.reserve(options.all_pairs ? n : n / delta + 1);
    for (std::size_t i = 0; i + delta < n; i += options.all_pairs ? 1 : delta) pairs.emplace_back(i, i + delta);
    return pairs;
  }
  std::vector<SE3d> poses_of_pairs;
  poses_of_pairs.reserve(n);
  for (std::size_t i = 0; i < n; ++i) poses_of_pairs.push_back(pose(i));
  if (options.unit == DeltaUnit::meters) {
    std::vector<double> along(n, 0);
    for (std::size_t i = 1; i < n; ++i) {
      along[i] = along[i - 1] + (poses_of_pairs[i].translation() - poses_of_pairs[i - 1].translation()).norm();
    }
    if (options.all_pairs) {
      for (std::size_t i = 0; i + 1 < n; ++i) {
        const auto from = along.begin() + static_cast<std::ptrdiff_t>(i) + 1;
        auto at = std::lower_bound(from, along.end(), options.delta,
                                   [&](double x, double delta) { return x - along[i] < delta; });
        const auto off = [&](auto it) { return std::abs(*it - along[i] - options.delta); };
        if (at == along.end() || (at != from && off(at - 1) <= off(at))) --at;
        while (at != from && *(at - 1) == *at) --at;
        if (off(at) <= tolerance) pairs.emplace_back(i, static_cast<std::size_t>(at - along.begin()));
      }
      return pairs;
    }
    // evo counts the first pose's own zero path, and starts at the first pose that reaches delta.
    std::vector<std::size_t> ends;
    double path = 0;
    for (std::size_t i = 1; i < n; ++i) {
      path += (poses_of_pairs[i].translation() - poses_of_pairs[i - 1].translation()).norm();
      if (path >= options.delta) ends.push_back(i), path = 0;
    }
    for (std::size_t k = 1; k < ends.size(); ++k) pairs.emplace_back(ends[k - 1], ends[k]);
    return pairs;
  }
  const double unit = options.unit == DeltaUnit::degrees ? units::degree : 1;
  const double delta = options.delta * unit, slack = tolerance * unit;
  const auto angle = [&](std::size_t i, std::size_t j) {
    return (poses_of_pairs[i].so3().inverse() * poses_of_pairs[j].so3()).log().norm();
  };
  if (options.all_pairs) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = i + 1; j < n; ++j) {
        const double a = angle(i, j);
        if (delta - slack <= a && a <= delta + slack) pairs.emplace_back(i, j);
      }
    }
    return pairs;
  }
  std::size_t start = 0;
  double turned = 0;
  for (std::size_t i = 1; i < n; ++i) {
    turned += angle(i - 1, i);
    if (turned >= delta) pairs.emplace_back(start, i), start = i, turned = 0;
  }
  return pairs;
}

LIESTAT_FUSION_INLINE std::vector<double> relativeErrors(MatchedRange poses, const Alignment& alignment,
                                                         std::vector<std::pair<std::size_t, std::size_t>>& pairs,
                                                         PoseRelation relation) {
  std::vector<double> errors;
  std::vector<std::pair<std::size_t, std::size_t>> kept;
  errors.reserve(pairs.size());
  const bool lengths = relation == PoseRelation::point_distance || relation == PoseRelation::point_distance_error_ratio;
  for (const auto& [i, j] : pairs) {
    const SE3d &from = poses.reference(i), &to = poses.reference(j);
    const SE3d est_from = alignment(poses.estimate(i)), est_to = alignment(poses.estimate(j));
    if (lengths) {
      const double length = (from.translation() - to.translation()).norm();
      const double error = std::abs(length - (est_from.translation() - est_to.translation()).norm());
      if (relation == PoseRelation::point_distance) {
        errors.push_back(error);
      } else if (length != 0) {
        errors.push_back(100 * error / length);
      } else {
        continue;
      }
      kept.emplace_back(i, j);
    } else {
      const SE3d E = (from.inverse() * to).inverse() * (est_from.inverse() * est_to);
      errors.push_back(detail::errorNumber(E, relation));
    }
  }
  if (lengths) pairs = std::move(kept);
  return errors;
}

LIESTAT_FUSION_INLINE RelativeConsistency
relativeConsistency(MatchedRange poses, std::span<const std::pair<std::size_t, std::size_t>> pairs, PairsModel model,
                    double scale, const NoiseComponents& components) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  RelativeConsistency result;
  double sum = 0;
  const auto axes = [&](const SE3d& pose, const Matrix6& covariance, bool back) {
    if (!components.in_world) return covariance;
    const Matrix6 B = detail::AlignedError::inWorld(pose.so3());
    return detail::congruence(back ? Matrix6(B.transpose()) : B, covariance);
  };
  const auto scaled = [&](const Gaussian<SE3d>& g) {
    Gaussian<SE3d> s{SE3d(g.mean.so3(), Eigen::Vector3d(scale * g.mean.translation())), g.covariance};
    if (components.omits()) {
      s.covariance = axes(g.mean, s.covariance, false);
      for (int k = 0; k < 6; ++k) {
        if (!components.keeps(k)) s.covariance.row(k).setZero(), s.covariance.col(k).setZero();
      }
      s.covariance = axes(g.mean, s.covariance, true);
    }
    s.covariance.topRows<3>() *= scale, s.covariance.leftCols<3>() *= scale;
    return s;
  };
  for (const auto& [i, j] : pairs) {
    const Gaussian<SE3d> from = scaled(poses[i].estimate), to = scaled(poses[j].estimate);
    const SE3d relative = from.mean.inverse() * to.mean;
    const SE3d reference = poses.reference(i).inverse() * poses.reference(j);
    Eigen::Matrix<double, 6, 1> eta = (relative.inverse() * reference).log();
    const Matrix6 A = relative.inverse().Adj();
    const Matrix6 carried = detail::congruence(A, from.covariance);
    Matrix6 covariance =
        model == PairsModel::independent ? Matrix6(to.covariance + carried) : Matrix6(to.covariance - carried);
    covariance += poses[j].reference.covariance + detail::congruence(A, poses[i].reference.covariance);
    if (components.in_world) eta = detail::AlignedError::inWorld(to.mean.so3()) * eta;
    covariance = axes(to.mean, covariance, false);
    components.reduce(eta, covariance);
    const double squared = mahalanobisSquared<double, 6>(eta, covariance);
    if (squared == squared) {
      sum += squared, ++result.n;
    } else {
      ++result.indefinite;
    }
  }
  if (result.n > 0) result.joint = detail::neesTest(sum, components.count() * static_cast<double>(result.n));
  return result;
}

}  // namespace liestat
