// Physical parameters of estimated two-view motions, by the derivatives of the matrix: where a matrix is a function of
// parameters, its error is J times theirs, and J's pseudo-inverse takes the covariance back.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/focal_lengths.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/two_view.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/trig.hpp>
#include <lie/essential.hpp>
#include <lie/s2.hpp>
#include <lie/so3.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat {

namespace detail {

/// Parameters that are named one after the other.
class PhysicalList {
 public:
  void add(const std::string& name, const std::string& unit, double value) {
    list_.names.push_back(name), list_.units.push_back(unit);
    list_.values.conservativeResize(list_.values.size() + 1);
    list_.values[list_.values.size() - 1] = value;
  }
  template <class Derived>
  void add(const std::string& name, const std::string& unit, const Eigen::MatrixBase<Derived>& values) {
    constexpr std::array<const char*, 3> axes = {" x", " y", " z"};
    for (Eigen::Index i = 0; i < values.size(); ++i) add(name + axes[static_cast<std::size_t>(i)], unit, values[i]);
  }
  PhysicalParameters with(const Eigen::MatrixXd& covariance) const {
    PhysicalParameters result = list_;
    result.covariance = covariance;
    return result;
  }

 private:
  PhysicalParameters list_;
};

/// Two axes across a direction, the tangent's of S2.
inline Eigen::Matrix<double, 3, 2> axesAcross(const Eigen::Vector3d& direction) {
  return ManifoldTraits<S2d>::placement(S2d(direction)).matrix().leftCols<2>();
}

/// The covariance of p of which the entries of a matrix are a function with derivative J, or NaN where J does not tell p.
inline Eigen::MatrixXd coordinateCovariance(const Eigen::MatrixXd& J, const Eigen::MatrixXd& covariance) {
  // Rows are nine, columns no more: filled up to a square.
  const int n = static_cast<int>(J.cols()), rows = static_cast<int>(J.rows());
  BasicSmallMatrix<9> square(rows, rows);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < n; ++j) square(i, j) = J(i, j);
  }
  const SmallSvd svd(square);
  const bool is_told = svd.value(n - 1) > 10 * rows * std::numeric_limits<double>::epsilon() * svd.value(0);
  Eigen::MatrixXd inverse(n, rows);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < rows; ++j) {
      inverse(i, j) = is_told ? 0 : std::numeric_limits<double>::quiet_NaN();
      for (int k = 0; k < n; ++k) inverse(i, j) += svd.v(k, i) * svd.u(k, j) / svd.value(k);
    }
  }
  return covarianceThrough(inverse, covariance);
}

/// Derivative of the entries of A R B by the error of R·Exp(e).
inline Eigen::Matrix<double, 9, 3> byRotation(const Eigen::Matrix3d& A, const Eigen::Matrix3d& R,
                                              const Eigen::Matrix3d& B) {
  Eigen::Matrix<double, 9, 3> J;
  for (int k = 0; k < 3; ++k) {
    J.col(k) = entriesFrom(A * R * detail::skew(Eigen::Vector3d(Eigen::Vector3d::Unit(k))) * B);
  }
  return J;
}

/// H ~ R + t nᵀ: rotation, t in units of the plane's distance, and the plane's normal.
inline PhysicalParameters planeParameters(const PlanePose& plane, const Eigen::Matrix3d& H,
                                          const Eigen::MatrixXd& covariance) {
  const Eigen::Matrix3d& R = plane.pose.R;
  const Eigen::Vector3d &t = plane.pose.t, &n = plane.n;
  const Eigen::Matrix3d M = R + t * n.transpose();
  const double scale = H.cwiseProduct(M).sum() / M.squaredNorm();
  const Eigen::Matrix<double, 3, 2> across = axesAcross(n);
  Eigen::MatrixXd J(9, 9);
  J.leftCols<3>() = scale * byRotation(Eigen::Matrix3d::Identity(), R, Eigen::Matrix3d::Identity());
  for (int k = 0; k < 3; ++k) {
    J.col(3 + k) = entriesFrom(scale * Eigen::Vector3d::Unit(k) * n.transpose());
  }
  for (int k = 0; k < 2; ++k) J.col(6 + k) = entriesFrom(scale * t * across.col(k).transpose());
  J.col(8) = entriesFrom(M);
  Eigen::MatrixXd shown = Eigen::MatrixXd::Zero(9, 9);
  shown.topLeftCorner<6, 6>().setIdentity();
  shown.block<3, 2>(6, 6) = across;
  PhysicalList list;
  list.add("rotation", "rad", SO3d::fitToSO3(R).log());
  list.add("translation/distance", "", t);
  list.add("normal", "", n);
  return list.with(covarianceThrough(shown, coordinateCovariance(J, covariance)));
}

/// F ~ K'⁻¹ [t]× R K⁻¹: focal lengths, rotation and direction of the translation.
inline PhysicalParameters uncalibratedParameters(const PhysicalMotion& motion, const Eigen::Matrix3d& F,
                                                 const Eigen::MatrixXd& covariance, const FocalLengths& unit) {
  const Eigen::Matrix3d& R = motion.pose.R;
  const Eigen::Vector3d& t = motion.pose.t;
  const Eigen::Matrix3d K = Eigen::Vector3d(1 / motion.focal.first, 1 / motion.focal.first, 1).asDiagonal();
  const Eigen::Matrix3d K2 = Eigen::Vector3d(1 / motion.focal.second, 1 / motion.focal.second, 1).asDiagonal();
  const Eigen::Matrix3d flat = Eigen::Vector3d(1, 1, 0).asDiagonal();
  const Eigen::Matrix3d T = detail::skew(t), M = K2 * T * R * K;
  const double scale = F.cwiseProduct(M).sum() / M.squaredNorm();
  const Eigen::Matrix<double, 3, 2> across = axesAcross(t);
  // Logarithms of the focal lengths, rotation, direction, scale.
  Eigen::MatrixXd J(9, 8);
  J.col(0) = entriesFrom(-scale * M * flat);
  J.col(1) = entriesFrom(-scale * flat * M);
  J.middleCols<3>(2) = scale * byRotation(K2 * T, R, K);
  for (int k = 0; k < 2; ++k) {
    J.col(5 + k) = entriesFrom(scale * K2 * detail::skew(Eigen::Vector3d(across.col(k))) * R * K);
  }
  J.col(7) = entriesFrom(M);
  Eigen::MatrixXd shown = Eigen::MatrixXd::Zero(8, 8);
  const FocalLengths focal{motion.focal.first * unit.first, motion.focal.second * unit.second};
  shown(0, 0) = focal.first, shown(1, 1) = focal.second;
  shown.block<3, 3>(2, 2).setIdentity();
  shown.block<3, 2>(5, 5) = across;
  PhysicalList list;
  list.add("focal length", "px", focal.first);
  list.add("second focal length", "px", focal.second);
  list.add("rotation", "rad", SO3d::fitToSO3(R).log());
  list.add("direction", "", t);
  return list.with(covarianceThrough(shown, coordinateCovariance(J, covariance)));
}

}  // namespace detail

LIESTAT_FUSION_INLINE std::vector<PhysicalParameters> physicalParameters(
    const std::string& model, const ModelEstimate<TwoViewMotionModel>& estimate,
    std::span<const Eigen::Vector4d> matches, TwoViewCalibration calibration, const FocalLengths& unit) {
  using detail::entry;
  const Eigen::Matrix3d& M = estimate.parameter.matrix;
  const Eigen::MatrixXd& covariance = estimate.covariance;
  detail::PhysicalList list;
  if (covariance.rows() == 5 || covariance.rows() == 6) {
    // A pose, and with six log f.
    const Eigen::Index focal = covariance.rows() - 5;
    const Essentiald& pose = estimate.parameter.pose;
    const Eigen::Matrix3d A = ManifoldTraits<S2d>::placement(pose.direction()).matrix();
    Eigen::MatrixXd shown = Eigen::MatrixXd::Zero(focal + 6, covariance.rows());
    if (focal == 1) {
      const double f = unit.second * estimate.parameter.focal_length;
      list.add("focal length", "px", f);
      shown(0, 5) = f;
    }
    list.add("rotation", "rad", pose.so3().log());
    list.add("direction", "", pose.direction().unit_vector());
    shown.block<3, 3>(focal, 2) = pose.so3().matrix().transpose() * A;
    shown.block<3, 2>(focal + 3, 0) = A.leftCols<2>();
    return {list.with(detail::covarianceThrough(shown, covariance))};
  }
  if (covariance.rows() != 9) return {};
  // Parameters that are linear in the entries.
  const auto linear = [&](const Eigen::MatrixXd& by_entries) {
    return list.with(detail::covarianceThrough(by_entries, covariance));
  };
  if (model == "zoom") {
    list.add("zoom", "", M(0, 0));
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(1, 9);
    J(0, entry(0, 0)) = 1;
    return {linear(J)};
  }
  if (model == "affine") {
    const char* const names[2][2] = {{"A11", "A12"}, {"A21", "A22"}};
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, 9);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        list.add(names[i][j], "", M(i, j));
        J(2 * i + j, entry(i, j)) = 1;
      }
    }
    list.add("shift", "px", unit.second * M.col(2).head<2>());
    for (int k = 0; k < 2; ++k) J(4 + k, entry(k, 2)) = unit.second;
    return {linear(J)};
  }
  const bool turns = model == "retinal displacement" || model == "similarity";
  const bool zooms = model == "free zoom" || model == "similarity";
  if (turns || zooms || model == "retinal translation") {
    // The first column is s (cos, sin).
    const Eigen::Index shift = (turns ? 1 : 0) + (zooms ? 1 : 0);
    const double c = M(0, 0), s = M(1, 0), squared = c * c + s * s, zoom = std::sqrt(squared);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(shift + 2, 9);
    if (zooms) {
      list.add("zoom", "", zoom);
      J(0, entry(0, 0)) = c / zoom, J(0, entry(1, 0)) = s / zoom;
    }
    if (turns) {
      list.add("turn", "rad", std::atan2(s, c));
      J(shift - 1, entry(0, 0)) = -s / squared, J(shift - 1, entry(1, 0)) = c / squared;
    }
    list.add("shift", "px", unit.second * M.col(2).head<2>());
    for (int k = 0; k < 2; ++k) J(shift + k, entry(k, 2)) = unit.second;
    return {linear(J)};
  }
  if (model == "rotation and zoom") {
    // H = diag(r, r, 1) R up to scale: the third row's length is that scale.
    const double scale = M.row(2).norm(), r = std::sqrt(0.5 * M.topRows<2>().squaredNorm()) / scale;
    const Eigen::Matrix3d Z = Eigen::Vector3d(r, r, 1).asDiagonal();
    const Eigen::Matrix3d R = Z.inverse() * M / scale;
    list.add("zoom", "", r);
    list.add("rotation", "rad", SO3d::fitToSO3(R).log());
    Eigen::MatrixXd J(9, 5);
    const Eigen::Matrix3d flat = Eigen::Vector3d(1, 1, 0).asDiagonal();
    J.col(0) = detail::entriesFrom(scale * flat * R);
    J.middleCols<3>(1) = scale * detail::byRotation(Z, R, Eigen::Matrix3d::Identity());
    J.col(4) = detail::entriesFrom(Z * R);
    const Eigen::MatrixXd all = detail::coordinateCovariance(J, covariance);
    return {list.with(all.topLeftCorner<4, 4>())};
  }
  if (model == "rotation") {
    list.add("rotation", "rad", SO3d::fitToSO3(M).log());
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    return {list.with(detail::coordinateCovariance(detail::byRotation(I, M, I), covariance))};
  }
  if (model == "translation") {
    // F = [t]×, and |t| = 1 as ‖F‖² = 2.
    list.add("direction", "", Eigen::Vector3d(M(2, 1), M(0, 2), M(1, 0)));
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, 9);
    for (int k = 0; k < 3; ++k) {
      J(k, entry((k + 2) % 3, (k + 1) % 3)) = 0.5, J(k, entry((k + 1) % 3, (k + 2) % 3)) = -0.5;
    }
    return {linear(J)};
  }
  if (model == "homography" && calibration == TwoViewCalibration::calibrated) {
    std::vector<PhysicalParameters> result;
    for (const PlanePose& plane : posesOfHomography(M, matches)) {
      result.push_back(detail::planeParameters(plane, M, covariance));
    }
    return result;
  }
  if (model == "fundamental") {
    const std::optional<PhysicalMotion> motion = motionFromFundamental(M, matches);
    if (motion) return {detail::uncalibratedParameters(*motion, M, covariance, unit)};
  }
  return {};
}

}  // namespace liestat
