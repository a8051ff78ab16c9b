#pragma once

#include <fusion/two_view/two_view_types.hpp>

#include <cmath>

namespace liestat {
namespace detail {

inline Verdict verdictOfSearch(bool ok, Status status, const std::string& reason) {
  if (ok) return Verdict::yes("ok");
  if (status != Status::ok) return Verdict::no(std::string("NOT TO BE TRUSTED (") + name(status) + "): " + reason);
  return Verdict::no("NOT TO BE TRUSTED: no model is supported, inliers could be chance");
}

}  // namespace detail

LIESTAT_FUSION_INLINE double PhysicalParameters::deviation(std::size_t i) const {
  return std::sqrt(covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
}

LIESTAT_FUSION_INLINE Verdict TwoViewMotionEstimate::verdict() const {
  return detail::verdictOfSearch(ok(), status, reason);
}

LIESTAT_FUSION_INLINE Verdict TwoViewMotions::verdict() const { return detail::verdictOfSearch(ok(), status, reason); }

}  // namespace liestat
