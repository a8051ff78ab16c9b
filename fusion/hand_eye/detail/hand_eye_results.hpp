#pragma once

#include <fusion/hand_eye_types.hpp>
#include <lie/so3.hpp>

#include <cmath>
#include <cstdio>

namespace liestat {

LIESTAT_FUSION_INLINE std::string describe(const OpenDirection& direction, const std::string& frame) {
  const Eigen::Vector3d rho = direction.twist.head<3>(), phi = direction.twist.tail<3>();
  const char* which = direction.along_rotation_axis ? "the rotation axis "
                      : direction.along_translation ? "the direction of motion "
                                                    : "";
  // Three decimals; no zero is negative.
  const auto written = [](const Eigen::Vector3d& v) {
    std::string text = "(";
    for (int i = 0; i < 3; ++i) {
      char number[32];
      std::snprintf(number, sizeof number, "%s%.3g", i > 0 ? ", " : "", std::round(1000 * v[i]) / 1000 + 0.0);
      text += number;
    }
    return text + ")";
  };
  if (!direction.rotates) return std::string("translation along ") + which + written(rho) + " of the " + frame;
  // The point of the screw's axis that is nearest to the origin.
  return std::string("rotation about ") + which + written(phi) + " through " + written(phi.cross(rho)) + " m of the " +
         frame;
}

LIESTAT_FUSION_INLINE std::string HandEyeResult::suspectsInWords() const {
  std::string group = liestat::suspectsInWords(suspects), options, refuted;
  for (const HandEyeSuspectTest& x : suspects) {
    if (x.in_group) {
      options += (options.empty() ? "estimate " : " or ") + x.name;
    } else if (x.significant && x.prior_sigma > 0) {
      refuted += (refuted.empty() ? "" : ", ") + x.inWords() + " against its prior";
    }
  }
  if (!group.empty()) group = "the residuals speak for " + group + " (" + options + " with X, or state a prior)";
  return group + (group.empty() || refuted.empty() ? "" : "; ") + refuted;
}

LIESTAT_FUSION_INLINE std::string HandEyeResult::inWords() const {
  if (fault) return describe(fault);
  switch (status) {
    case FusionStatus::ok:
      return world ? "X and Y are determined" : "X is determined";
    case FusionStatus::undetermined:
      return "the motions do not determine X";
    case FusionStatus::ambiguous:
      return "two solutions explain the pairs";
    case FusionStatus::inconsistent:
      return isSuspicious() && !(p < refutation_level)
                 ? suspectsInWords()
                 : "the residuals are larger than the covariances of the poses say" +
                       (isSuspicious() ? "; " + suspectsInWords() : std::string());
    case FusionStatus::not_converged:
      return "the iterations ended before the estimate stayed";
    default:
      return describe(status);
  }
}

LIESTAT_FUSION_INLINE Verdict HandEyeResult::verdict() const {
  if (ok()) return Verdict::yes("ok: " + inWords());
  return Verdict::no(std::string("NOT TO BE TRUSTED (") + name(status) + "): " + inWords());
}

LIESTAT_FUSION_INLINE std::vector<CalibratedPose> calibratedPoses(const HandEyeResult& r) {
  std::vector<CalibratedPose> list(1);
  list[0].pose = r.X;
  if (r.world) list.push_back({.symbol = "Y", .parent = "base", .child = "target", .pose = r.Y});
  for (CalibratedPose& x : list) {
    x.rotation_is_open = r.rotationIsOpen();
    x.has_covariance = !x.rotation_is_open && x.pose.covariance.allFinite();
    const Eigen::Matrix3d R = x.pose.mean.so3().matrix();
    Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Zero();
    J.topLeftCorner<3, 3>() = R;
    J.bottomRightCorner<3, 3>() = SO3d::rightJacobianInverse(x.pose.mean.so3().log());
    x.covariance_of_coordinates = J * x.pose.covariance * J.transpose();
    if (!x.has_covariance) continue;
    x.sigmas = x.covariance_of_coordinates.diagonal().cwiseSqrt();
    x.local_sigmas = x.pose.covariance.diagonal().cwiseSqrt();
    for (const OpenDirection& d : r.directions) {
      const Eigen::Vector3d open = &x == &list[0] ? d.twist.head<3>() : d.twist_of_Y.head<3>();
      const Eigen::Vector3d local = R.transpose() * open;
      constexpr double share = 1e-3;  // a smaller component is rounding
      for (int i = 0; i < 3; ++i) {
        if (std::abs(open[i]) > share * open.norm()) x.sigmas[i] = std::numeric_limits<double>::quiet_NaN();
        if (std::abs(local[i]) > share * local.norm()) x.local_sigmas[i] = std::numeric_limits<double>::quiet_NaN();
      }
    }
  }
  return list;
}

}  // namespace liestat
