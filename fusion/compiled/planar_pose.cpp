// The pose of a plane, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/targets/planar_pose.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>

namespace liestat {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Design6 = Eigen::Matrix<double, Eigen::Dynamic, 6>;

constexpr int max_iterations = 60;
/// Minima that are nearer to each other, in standard deviations, are one.
constexpr double same_minimum = 0.05;
/// Step of differences of pixels by points, relative to their distance, and of second differences in standard deviations.
constexpr double pixel_step = 1e-5, curvature_step = 0.02;
/// A spread of points across a line, relative to that along it, below which they are on it.
constexpr double least_spread = 1e-6;

/// Takes columns x to Σ^-½ x.
class Whitening {
 public:
  /// False where the covariance is none.
  bool take(const Eigen::MatrixXd& covariance, Eigen::Index n) {
    if (!covariance.allFinite() || covariance.rows() != 2 * n) return false;
    if (covariance.cols() == 2) {
      for (Eigen::Index i = 0; i < n; ++i) {
        const Eigen::Matrix2d block = covariance.middleRows<2>(2 * i);
        const Eigen::LLT<Eigen::Matrix2d> factor(block);
        if (factor.info() != Eigen::Success || !(std::abs(block(0, 1) - block(1, 0)) <= 1e-9 * block.trace())) {
          return false;
        }
        blocks_.push_back(factor);
      }
      return true;
    }
    if (covariance.cols() != 2 * n) return false;
    if (!((covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * covariance.trace())) return false;
    whole_.compute(covariance);
    return whole_.info() == Eigen::Success;
  }
  template <class Columns>
  void apply(Columns& x) const {
    if (blocks_.empty()) {
      whole_.matrixL().solveInPlace(x);
      return;
    }
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      Eigen::Matrix<double, 2, Columns::ColsAtCompileTime> rows =
          x.template middleRows<2>(2 * static_cast<Eigen::Index>(i));
      blocks_[i].matrixL().solveInPlace(rows);
      x.template middleRows<2>(2 * static_cast<Eigen::Index>(i)) = rows;
    }
  }

 private:
  std::vector<Eigen::LLT<Eigen::Matrix2d>> blocks_;
  Eigen::LLT<Eigen::MatrixXd> whole_;
};

/// The criterion, as minimiseDamped wants it.
class Criterion {
 public:
  Criterion(const PlanarView& view, const Camera& camera, const Whitening& whitening)
      : view_(view), camera_(camera), whitening_(whitening) {}

  void start(const SE3d& pose) { pose_ = pose; }
  const SE3d& pose() const { return pose_; }
  const Design6& design() const { return design_; }
  const Matrix6& information() const { return information_; }

  /// Whitened residuals u − π(T P); false where a point is not seen.
  bool residuals(const SE3d& pose, Eigen::VectorXd& r) const {
    r.resize(2 * static_cast<Eigen::Index>(view_.points.size()));
    for (std::size_t i = 0; i < view_.points.size(); ++i) {
      const auto pixel = camera_.project(pose * Eigen::Vector3d(view_.points[i].x(), view_.points[i].y(), 0));
      if (!pixel) return false;
      r.segment<2>(2 * static_cast<Eigen::Index>(i)) = view_.pixels[i] - *pixel;
    }
    whitening_.apply(r);
    return true;
  }

  double linearise() {
    if (!residuals(pose_, residuals_)) return std::numeric_limits<double>::infinity();
    design_.resize(residuals_.size(), 6);
    const Eigen::Matrix3d rotation = pose_.so3().matrix();
    for (std::size_t i = 0; i < view_.points.size(); ++i) {
      const Eigen::Vector3d point(view_.points[i].x(), view_.points[i].y(), 0), at = pose_ * point;
      Eigen::Matrix<double, 2, 3> by_point;
      const double step = pixel_step * at.norm();
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d d = step * Eigen::Vector3d::Unit(k);
        const auto after = camera_.project(at + d), before = camera_.project(at - d);
        if (!after || !before) return std::numeric_limits<double>::infinity();
        by_point.col(k) = (*after - *before) / (2 * step);
      }
      Eigen::Matrix<double, 3, 6> by_pose;
      by_pose << rotation, -rotation * SO3d::hat(point);
      design_.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = by_point * by_pose;
    }
    whitening_.apply(design_);
    information_ = design_.transpose() * design_;
    score_ = design_.transpose() * residuals_;
    return residuals_.squaredNorm();
  }
  bool solve(double damping) {
    Matrix6 damped = information_;
    damped.diagonal() *= 1 + damping;
    const Eigen::LDLT<Matrix6> solver(damped);
    const Vector6 step = solver.solve(score_);
    if (solver.info() != Eigen::Success || !step.allFinite()) return false;
    next_ = pose_ * SE3d::exp(step);
    return true;
  }
  /// Least squares over the translation and the rotation in the target's plane, from a pose that it moves; χ² there.
  double settle(SE3d& pose) {
    for (int pass = 0; pass < 5; ++pass) {
      start(pose);
      if (!std::isfinite(linearise())) break;
      Eigen::Matrix<double, 6, 4> free = Eigen::Matrix<double, 6, 4>::Zero();
      free.topLeftCorner<3, 3>().setIdentity(), free(5, 3) = 1;
      const Eigen::Matrix4d information = free.transpose() * information_ * free;
      const Eigen::Vector4d score = free.transpose() * score_;
      const Vector6 step = free * information.llt().solve(score);
      if (!step.allFinite()) break;
      pose = pose * SE3d::exp(step);
    }
    start(pose);
    return linearise();
  }
  double costAfterStep() const {
    Eigen::VectorXd r;
    return residuals(next_, r) ? r.squaredNorm() : std::numeric_limits<double>::infinity();
  }
  void accept() { pose_ = next_; }
  void reject() {}

 private:
  const PlanarView& view_;
  const Camera& camera_;
  const Whitening& whitening_;
  SE3d pose_, next_;
  Eigen::VectorXd residuals_;
  Design6 design_;
  Matrix6 information_ = Matrix6::Zero();
  Vector6 score_ = Vector6::Zero();
};

struct Minimum {
  SE3d pose;
  double chi2 = std::numeric_limits<double>::infinity();
  Matrix6 information;
};

SE3d poseFrom(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond q(rotation);
  return SE3d::fromParams((SE3d::Params() << q.coeffs(), translation).finished());
}

/// The rotation that takes the optical axis to a direction.
Eigen::Matrix3d towards(const Eigen::Vector3d& direction) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction).toRotationMatrix();
}

/// The translation for a rotation: least squares on the directions in which points are seen.
Eigen::Vector3d translationFor(const Eigen::Matrix3d& rotation, const PlanarView& view,
                               const std::vector<Eigen::Vector3d>& bearings) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - bearings[i] * bearings[i].transpose();
    normal += across;
    right -= across * rotation.leftCols<2>() * view.points[i];
  }
  return normal.ldlt().solve(right);
}

/// Both poses at the target's centre, by the first derivatives of the homography there.
std::vector<SE3d> startsOf(const PlanarView& view, const std::vector<Eigen::Vector3d>& bearings) {
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero();
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < bearings.size(); ++i) ahead += bearings[i], centre += view.points[i];
  centre /= static_cast<double>(bearings.size());
  const Eigen::Matrix3d turn = towards(ahead);
  std::vector<Eigen::Vector2d> from, to;
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const Eigen::Vector3d seen = turn.transpose() * bearings[i];
    if (!(seen.z() > 1e-3)) return {};
    from.push_back(view.points[i] - centre);
    to.push_back(seen.hnormalized());
  }
  const auto h = fitHomography(from, to);
  if (!h || !(std::abs((*h)(2, 2)) > 0)) return {};
  const Eigen::Matrix3d H = *h / (*h)(2, 2);
  const Eigen::Vector2d at = H.block<2, 1>(0, 2);
  const Eigen::Matrix2d slope = H.topLeftCorner<2, 2>() - at * H.block<1, 2>(2, 0);
  const Eigen::Matrix3d to_centre = towards(at.homogeneous());
  Eigen::Matrix<double, 2, 3> across;
  across << Eigen::Matrix2d::Identity(), -at;
  const Eigen::Matrix2d a = (across * to_centre.leftCols<2>()).inverse() * slope;
  const double half_square = a.squaredNorm() / 2, area = a.determinant();
  const double scale = std::sqrt(half_square + std::sqrt(std::max(half_square * half_square - area * area, 0.)));
  if (!(scale > 0) || !std::isfinite(scale)) return {};
  const Eigen::Matrix2d r = a / scale;
  const Eigen::Matrix2d rest = Eigen::Matrix2d::Identity() - r.transpose() * r;
  Eigen::RowVector2d b(std::sqrt(std::max(rest(0, 0), 0.)), std::sqrt(std::max(rest(1, 1), 0.)));
  if (rest(0, 1) < 0) b[1] = -b[1];
  std::vector<SE3d> starts;
  for (const double sign : {1., -1.}) {
    Eigen::Matrix3d rotation;
    rotation.topLeftCorner<2, 2>() = r;
    rotation.block<1, 2>(2, 0) = sign * b;
    rotation.col(2) = rotation.col(0).cross(rotation.col(1));
    const Eigen::Matrix3d found = turn * to_centre * rotation;
    starts.push_back(poseFrom(found, translationFor(found, view, bearings)));
  }
  return starts;
}

/// The pose whose plane is mirrored across the line of sight to the target's centre: the rival without perspective.
SE3d mirrored(const SE3d& pose, const PlanarView& view, const std::vector<Eigen::Vector3d>& bearings) {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : view.points) centre += p / static_cast<double>(view.points.size());
  const Eigen::Vector3d sight = (pose * Eigen::Vector3d(centre.x(), centre.y(), 0)).normalized();
  Eigen::Matrix3d rotation = pose.so3().matrix();
  for (int k = 0; k < 2; ++k) rotation.col(k) -= 2 * sight * sight.dot(rotation.col(k));
  rotation.col(2) = rotation.col(0).cross(rotation.col(1));
  return poseFrom(rotation, translationFor(rotation, view, bearings));
}

/// The pose with the plane turned about the target's centre until it faces the camera.
SE3d turnedTo(const SE3d& pose, const Eigen::Vector3d& sight, const Eigen::Vector2d& centre) {
  const Eigen::Matrix3d R = pose.so3().matrix();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(R.col(2), sight);
  const Eigen::Matrix3d turned = turn.toRotationMatrix() * R;
  return poseFrom(turned, sight - turned * Eigen::Vector3d(centre.x(), centre.y(), 0));
}

/// Relative curvatures at a minimum (Bates and Watts, 1980), by second differences along whitened directions.
RelativeCurvature curvatureAt(const Criterion& criterion, const Minimum& minimum, const Design6& design) {
  const Eigen::LLT<Matrix6> factor(minimum.information);
  RelativeCurvature result;
  if (factor.info() != Eigen::Success) return result;
  Matrix6 directions = Matrix6::Identity();
  factor.matrixU().solveInPlace(directions);
  const Design6 along = design * directions;  // orthonormal columns
  Eigen::VectorXd middle, after, before;
  if (!criterion.residuals(minimum.pose, middle)) return result;
  const auto bend = [&](const Vector6& d, Eigen::VectorXd& out) {
    const Vector6 step = curvature_step * (directions * d);
    if (!criterion.residuals(minimum.pose * SE3d::exp(step), after)) return false;
    if (!criterion.residuals(minimum.pose * SE3d::exp(-step), before)) return false;
    out = (2 * middle - after - before) / (curvature_step * curvature_step);
    return true;
  };
  double across_sum = 0, along_sum = 0;
  Eigen::VectorXd trace = Eigen::VectorXd::Zero(middle.size()), bent;
  std::array<Eigen::VectorXd, 6> own;
  const auto add = [&](const Eigen::VectorXd& x, double times) {
    const double in = (along.transpose() * x).squaredNorm();
    along_sum += times * in;
    across_sum += times * std::max(x.squaredNorm() - in, 0.);
  };
  for (int i = 0; i < 6; ++i) {
    if (!bend(Vector6::Unit(i), own[static_cast<std::size_t>(i)])) return result;
    trace += own[static_cast<std::size_t>(i)];
    add(own[static_cast<std::size_t>(i)], 2);
  }
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) {
      if (!bend(Vector6::Unit(i) + Vector6::Unit(j), bent)) return result;
      bent = (bent - own[static_cast<std::size_t>(i)] - own[static_cast<std::size_t>(j)]) / 2;
      add(bent, 4);
    }
  }
  add(trace, 1);
  constexpr double radius = 3.5484787;  // √ of the 95 % quantile of χ²₆
  result.parameter = radius * std::sqrt(along_sum / 48);
  result.intrinsic = radius * std::sqrt(across_sum / 48);
  result.bias = (along.transpose() * trace).norm() / 2;
  result.noise_share = 0;
  return result;
}

}  // namespace

std::optional<Eigen::Matrix3d> fitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to) {
  const std::size_t n = std::min(from.size(), to.size());
  if (n < 4) return std::nullopt;
  const auto normalising = [n](const std::vector<Eigen::Vector2d>& points) {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < n; ++i) mean += points[i] / static_cast<double>(n);
    double spread = 0;
    for (std::size_t i = 0; i < n; ++i) spread += (points[i] - mean).norm() / static_cast<double>(n);
    Eigen::Matrix3d t = Eigen::Matrix3d::Identity();
    t.topLeftCorner<2, 2>() /= spread;
    t.block<2, 1>(0, 2) = -mean / spread;
    return t;
  };
  const Eigen::Matrix3d a = normalising(from), b = normalising(to);
  if (!a.allFinite() || !b.allFinite()) return std::nullopt;
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p = a * from[i].homogeneous(), q = b * to[i].homogeneous();
    Eigen::Matrix<double, 2, 9> rows;
    rows << p.transpose(), Eigen::RowVector3d::Zero(), -q.x() * p.transpose(),  //
        Eigen::RowVector3d::Zero(), p.transpose(), -q.y() * p.transpose();
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
  if (!(solver.eigenvalues()[1] > 1e-10 * solver.eigenvalues()[8])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << h.head<3>().transpose(), h.segment<3>(3).transpose(), h.tail<3>().transpose();
  return b.inverse() * H * a;
}

PlanarPoseResult estimatePlanarPose(const PlanarView& view, const Camera& camera) {
  PlanarPoseResult result;
  const std::size_t n = view.points.size();
  const auto refused = [&](FaultKind kind, std::size_t where) {
    result.fault = Fault(kind, where);
    return result;
  };
  if (n < 4 || view.pixels.size() != n) return refused(FaultKind::too_few_points, std::min(n, view.pixels.size()));
  std::vector<Eigen::Vector3d> bearings;
  for (std::size_t i = 0; i < n; ++i) {
    const auto bearing = camera.bearing(view.pixels[i]);
    if (!view.points[i].allFinite() || !bearing) return refused(FaultKind::bad_point, i);
    bearings.push_back(*bearing);
  }
  Whitening whitening;
  if (!whitening.take(view.covariance, static_cast<Eigen::Index>(n))) return refused(FaultKind::bad_pixel_noise, 0);

  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : view.points) centre += p / static_cast<double>(n);
  for (const Eigen::Vector2d& p : view.points) scatter += (p - centre) * (p - centre).transpose();
  const Eigen::Vector2d spread = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(scatter).eigenvalues();
  const std::vector<SE3d> starts = startsOf(view, bearings);
  result.status = FusionStatus::undetermined;
  if (!(spread[0] > least_spread * least_spread * spread[1]) || starts.empty()) return result;

  Criterion criterion(view, camera, whitening);
  std::vector<Minimum> minima;
  const auto refine = [&](const SE3d& start) {
    criterion.start(start);
    const detail::DampedSummary end =
        detail::minimiseDamped(criterion, {.max_iterations = max_iterations, .min_decrease = 1e-9});
    if (end.status != FusionStatus::ok) return;
    const Minimum found{criterion.pose(), end.cost, criterion.information()};
    for (Minimum& other : minima) {
      const Vector6 apart = (other.pose.inverse() * found.pose).log();
      if (!(apart.dot(other.information * apart) < same_minimum * same_minimum)) continue;
      if (found.chi2 < other.chi2) other = found;
      return;
    }
    minima.push_back(found);
  };
  for (const SE3d& start : starts) refine(start);
  for (std::size_t i = 0; i < minima.size() && i < 2; ++i) refine(mirrored(minima[i].pose, view, bearings));
  result.status = FusionStatus::not_converged;
  if (minima.empty()) return result;
  std::sort(minima.begin(), minima.end(), [](const Minimum& a, const Minimum& b) { return a.chi2 < b.chi2; });

  result.pose.mean = minima[0].pose;
  const Eigen::Vector3d sight = minima[0].pose * Eigen::Vector3d(centre.x(), centre.y(), 0);
  result.tilt = std::acos(std::clamp(sight.normalized().dot(minima[0].pose.so3().matrix().col(2)), -1., 1.));
  result.fit = NoiseFit::of(minima[0].chi2, 2 * static_cast<double>(n) - 6);
  const auto covarianceOf = [&](const Minimum& minimum, RelativeCurvature& curvature) {
    criterion.start(minimum.pose);
    criterion.linearise();
    curvature = curvatureAt(criterion, minimum, criterion.design());
    const Eigen::LLT<Matrix6> factor(minimum.information);
    Matrix6 covariance = factor.solve(Matrix6::Identity());
    covariance = (covariance + covariance.transpose()).eval() / 2;
    if (!(curvature.parameter + curvature.intrinsic <= max_pose_curvature) || !covariance.allFinite()) {
      covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    return covariance;
  };
  result.pose.covariance = covarianceOf(minima[0], result.curvature);
  // Between the two minima the plane faces the camera, and there the model is curved most. Where noise may have moved the
  // minimum away from there, that it is straight at the minimum is chosen by the error.
  if (result.pose.covariance.allFinite()) {
    Minimum facing{turnedTo(minima[0].pose, sight, centre), 0, {}};
    facing.chi2 = criterion.settle(facing.pose), facing.information = criterion.information();
    if (facing.chi2 - minima[0].chi2 < 2 * std::log(min_likelihood_ratio)) {
      const RelativeCurvature there = curvatureAt(criterion, facing, criterion.design());
      if (!(there.parameter + there.intrinsic <= max_pose_curvature)) {
        result.curvature = there;
        result.pose.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
    }
  }
  if (minima.size() > 1) {
    RelativeCurvature its_own;
    result.rival = Gaussian<SE3d>{minima[1].pose, covarianceOf(minima[1], its_own)};
    result.likelihood_ratio = std::exp((minima[1].chi2 - minima[0].chi2) / 2);
  }
  const bool rivalled = !(result.likelihood_ratio >= min_likelihood_ratio);
  if (result.fit.refuted()) {
    result.status = FusionStatus::inconsistent;
    result.pose.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    if (result.rival) result.rival->covariance = result.pose.covariance;
  } else if (rivalled) {
    result.status = FusionStatus::ambiguous;
  } else {
    result.status = result.pose.covariance.allFinite() ? FusionStatus::ok : FusionStatus::undetermined;
  }
  return result;
}

std::string PlanarPoseResult::inWords() const {
  if (fault) return describe(fault);
  switch (status) {
    case FusionStatus::ok:
      return rival ? "the pose is determined, its rival is excluded" : "the pose is determined";
    case FusionStatus::ambiguous:
      return "two poses explain the points: the rival's likelihood is not smaller by 10000";
    case FusionStatus::inconsistent:
      return "the points do not fit a plane before this camera: is it the right target, size of squares, calibration?";
    case FusionStatus::undetermined:
      return curvature.tested() ? "the target is too small in the image, or faces the camera too much, for a covariance"
                                : "the points lie on a line";
    default:
      return describe(status);
  }
}

Verdict PlanarPoseResult::verdict() const {
  if (ok()) return Verdict::yes("ok: " + inWords());
  return Verdict::no(std::string("NOT TO BE TRUSTED (") + name(status) + "): " + inWords());
}

}  // namespace liestat
