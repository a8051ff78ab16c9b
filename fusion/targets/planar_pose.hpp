// The pose of a plane from points on it that an image shows: both minima of the reprojection error.
//
// Points P_i = (x_i, y_i, 0) of the target are seen at u_i with errors of covariance Σ (px², for all points jointly or for
// each alone). The pose camera_T_target = T minimises χ²(T) = |Σ^-½ (u − π(T P))|², π the camera with its distortion. The
// criterion has two minima, which are images of each other in a plane that faces the camera but for perspective: starts
// are both poses of the homography at the target's centre (T. Collins and A. Bartoli, "Infinitesimal plane-based pose
// estimation", IJCV 2014) and the mirror image of each minimum, so that both are found. The rival's likelihood ratio is
// exp((χ²(rival) − χ²(T))/2); below 10⁴ nothing tells the two apart that may be relied upon.
//
// χ² has 2n − 6 degrees of freedom and tests Σ, the camera and the plane. Where the model is curved on the scale of the
// noise (small targets that face the camera) the covariance of first order does not hold, and is withheld; so it is where
// the plane may face the camera and the model is curved there.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/status.hpp>
#include <lie/se3.hpp>
#include <stats/gaussian.hpp>
#include <stats/noise_fit.hpp>
#include <stats/relative_curvature.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// A rival whose likelihood ratio is below this is not excluded.
inline constexpr double min_likelihood_ratio = 1e4;

/// Relative curvature (stats/relative_curvature.hpp) above which a covariance of first order is withheld. Below, normalised
/// squared errors have the mean of their law; wider regions than its own would not (docs/tag_pose.md).
inline constexpr double max_pose_curvature = 0.3;

/// Points of a plane and where an image shows them.
struct PlanarView {
  std::vector<Eigen::Vector2d> points;  ///< m, on the plane z = 0 of the target
  std::vector<Eigen::Vector2d> pixels;
  /// px²: of the pixels, u before v, one after the other (2n × 2n); or 2n × 2, those of the points below each other, where
  /// errors of different points are independent.
  Eigen::MatrixXd covariance;
};

/// The pose of a plane. Statuses:
///   ok             the pose with its covariance; the rival, if there is one, is excluded
///   ambiguous      the rival is not excluded; both have covariances
///   inconsistent   the residuals are larger than the pixels' covariance explains: no covariance
///   undetermined   the points lie on a line, or the model is too curved on the scale of the noise: no covariance
///   not_converged
///   bad_input      see `fault`
struct PlanarPoseResult {
  using Covariance = Eigen::Matrix<double, 6, 6>;

  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  /// camera_T_target, and the covariance of e in T·Exp(e), translation (m) before rotation (rad); NaN: none.
  Gaussian<SE3d> pose = {SE3d(), Covariance::Constant(std::numeric_limits<double>::quiet_NaN())};
  std::optional<Gaussian<SE3d>> rival;                                ///< the other minimum
  double likelihood_ratio = std::numeric_limits<double>::infinity();  ///< of the pose against the rival
  NoiseFit fit;                                                       ///< χ² of the pose's residuals
  RelativeCurvature curvature = {};
  /// Angle between the plane's normal and the direction to its centre, rad.
  double tilt = std::numeric_limits<double>::quiet_NaN();

  bool ok() const { return status == FusionStatus::ok; }
  std::string inWords() const;
  Verdict verdict() const;
};

/// The pose from four points or more. Bad input: fewer, numbers that are not finite, a covariance that is none.
LIESTAT_FUSION_API PlanarPoseResult estimatePlanarPose(const PlanarView& view, const Camera& camera);

/// The homography that takes points to others, least squares on the cross products in normalised coordinates; none where
/// all but one of the points lie on a line.
LIESTAT_FUSION_API std::optional<Eigen::Matrix3d> fitHomography(const std::vector<Eigen::Vector2d>& from,
                                                                const std::vector<Eigen::Vector2d>& to);

template <class V>
void describe(V& v, const PlanarPoseResult& r) {
  using Covariance = PlanarPoseResult::Covariance;
  const auto pose = [](const SE3d& x) {
    Eigen::Matrix<double, 7, 1> p;
    p << x.translation(), x.so3().params();
    if (p[6] < 0) p.tail<4>() *= -1;
    return p;
  };
  const auto known = [](const Covariance& c) { return c.allFinite() ? std::optional<Covariance>(c) : std::nullopt; };
  const bool any = r.fit.tested() || r.pose.covariance.allFinite() || r.rival.has_value();
  v("status", name(r.status), "ok, ambiguous, inconsistent, undetermined, not_converged or bad_input");
  v("ok", r.ok(), "the pose is to be trusted")("in_words", r.inWords(), "the status");
  v("camera_T_target", any ? std::optional(pose(r.pose.mean)) : std::nullopt,
    "translation (m) and quaternion x, y, z, w; the target's z axis points away from the camera");
  v("covariance", known(r.pose.covariance), "of e in T Exp(e), translation before rotation, m and rad; null: none");
  v("tilt", r.tilt, "between the plane's normal and the line of sight", "rad");
  v("chi2", r.fit.chi2, "of the residuals")("degrees_of_freedom", r.fit.degrees_of_freedom, "of chi2");
  v("p", r.fit.p, "probability of a larger chi2");
  v("curvature", r.curvature.parameter + r.curvature.intrinsic,
    "of the model on the scale of the noise; above 0.3 there is no covariance");
  v("rival", r.rival ? std::optional(pose(r.rival->mean)) : std::nullopt, "the pose of the other minimum; null: none");
  v("rival_covariance", r.rival ? known(r.rival->covariance) : std::nullopt, "likewise");
  v("likelihood_ratio", r.rival ? std::optional(r.likelihood_ratio) : std::nullopt,
    "of the pose against the rival; below 10000 it is not excluded");
}

}  // namespace liestat
