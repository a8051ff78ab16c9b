#pragma once

#include <fusion/detail/lens_distortion.hpp>
#include <fusion/detail/sphere_lens.hpp>

#include <Eigen/Core>
#include <cmath>
#include <optional>

// Camera models: pixels to bearings with their standard deviations, and back.
//
// axes      x to the right, y down, z ahead along the optical axis; pixels (u, v) grow with x and y
// bearing   unit vector in the camera's axes; the inertial headers take bearings in the axes of the body, which are
//           R_body_camera · bearing
// pixel     u = fu m_x + cu, v = fv m_y + cv, with m the distorted point:
//
//   none         m = (x/z, y/z)
//   radtan       m = (x/z, y/z) bent by k1, k2 (radial) and p1, p2 (tangential): D. C. Brown, Decentering distortion of
//                lenses, 1966; the model of Kalibr's radtan, OpenCV's first four coefficients and EuRoC
//   equidistant  m = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) along (x, y), θ the angle off the axis: J. Kannala and
//                S. Brandt, 2006; Kalibr's equidistant, OpenCV's fisheye, TUM-VI
//   omni         m = (x, y) / (z + ξ |p|), bent as by radtan: C. Mei and P. Rives, ICRA 2007; Kalibr's omni
//   double_sphere, eucm   two spheres (ξ, α), V. Usenko et al., 3DV 2018; the extended unified model (α, β), B. Khomutenko
//                et al., RA-L 2016; without distortion: Kalibr's ds and eucm
//
// A distortion polynomial is fitted to the image. Outside, it may fold over and map two directions to one pixel. There
// these functions give none: whatever bearing() returns is the one direction on the sheet around the axis that
// project() takes to that pixel. NaN and infinity have neither pixel nor bearing. Nothing allocates, nothing throws.

namespace liestat {

/// The distortion of a lens; what the four coefficients of a Camera mean.
enum class Distortion {
  none,           ///< pinhole; the coefficients are ignored
  radtan,         ///< k1, k2, p1, p2
  equidistant,    ///< k1, k2, k3, k4
  omni,           ///< k1, k2, p1, p2 behind a mirror, Camera::mirror
  double_sphere,  ///< xi, alpha; the other two are ignored
  eucm            ///< alpha, beta; the other two are ignored
};

/// A bearing and how far noise in the pixel turns it.
struct BearingWithSigma {
  Eigen::Vector3d direction;  ///< unit vector in the camera's axes
  /// rad: the geometric mean of the standard deviations in the two principal directions across the bearing, whose ratio
  /// is the cosine of the angle off the axis for a pinhole of square pixels.
  double sigma = 0;
};

/// A central camera. With focal lengths that are not positive there are neither pixels nor bearings.
struct Camera {
  double fu = 0, fv = 0;  ///< focal lengths, pixels
  double cu = 0, cv = 0;  ///< principal point, pixels
  Distortion distortion = Distortion::none;
  Eigen::Vector4d coefficients = Eigen::Vector4d::Zero();  ///< see Distortion
  int width = 0, height = 0;                               ///< image size in pixels; 0: unknown
  double mirror = 0;                                       ///< ξ of omni
  double k3 = 0;                                           ///< third radial coefficient of radtan, OpenCV's fifth

  /// The pixel (u, v) that sees a point in the camera's axes (any unit of length), whether the image reaches that far
  /// or not. None for a point behind the camera (fisheye lenses see beyond 90 degrees, up to where their image folds
  /// over), none beyond the fold of the distortion, none for NaN.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_camera) const;

  /// The unit vector in the camera's axes that project() takes to this pixel, to 1e-9 of its coordinates; none where no
  /// direction does.
  std::optional<Eigen::Vector3d> bearing(const Eigen::Vector2d& pixel) const;

  /// The bearing of a pixel whose u and v have independent noise of standard deviation `pixel_sigma` (pixels) each. The
  /// default gives sigma in rad per pixel of noise. None where bearing() has none.
  std::optional<BearingWithSigma> bearingWithSigma(const Eigen::Vector2d& pixel, double pixel_sigma = 1) const;

  /// True if the pixel lies in the image, or if the size is not known.
  bool sees(const Eigen::Vector2d& pixel) const;

 private:
  detail::RadialPolynomial radial() const {
    if (isBentOnPlane() && k3 != 0) return {{coefficients[0], coefficients[1], k3, 0}, 3};
    return {coefficients, distortion == Distortion::none ? 0 : distortion == Distortion::equidistant ? 4 : 2};
  }
  bool hasSphere() const { return distortion > Distortion::equidistant; }
  detail::SphereLens sphere() const {
    using Lens = detail::SphereLens;
    return distortion == Distortion::omni ? Lens{Lens::unified, mirror}
                                          : Lens{distortion == Distortion::eucm ? Lens::extended : Lens::double_sphere,
                                                 coefficients[0], coefficients[1]};
  }
  bool isBentOnPlane() const { return distortion == Distortion::radtan || distortion == Distortion::omni; }
  /// |d(pixel)/d(direction)|: the area in the image, in pixels², of one steradian around a bearing.
  double pixelsPerSteradian(const Eigen::Vector3d& bearing) const;
};

inline std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& p) const {
  if (!p.allFinite() || !(fu > 0) || !(fv > 0)) return std::nullopt;
  Eigen::Vector2d m;
  if (distortion == Distortion::equidistant) {
    const double across = std::hypot(p.x(), p.y());
    const double angle = std::atan2(across, p.z());
    const detail::RadialPolynomial polynomial = radial();
    if (!(angle < EIGEN_PI) || (across == 0 && !(p.z() > 0)) || !polynomial.ascendsTo(angle)) return std::nullopt;
    m = across > 0 ? Eigen::Vector2d(polynomial.value(angle) / across * p.head<2>()) : Eigen::Vector2d(0, 0);
  } else {
    if (hasSphere()) {
      const Eigen::Vector3d e = p.normalized();
      const double s = std::hypot(e.x(), e.y());
      const detail::SphereLens lens = sphere();
      if (!lens.reaches(s, e.z())) return std::nullopt;
      m = e.head<2>() / lens.divisor(s, e.z()).value;
    } else {
      if (!(p.z() > 0)) return std::nullopt;
      m = p.head<2>() / p.z();
    }
    if (!(m.norm() <= detail::farthest_on_plane)) return std::nullopt;
    if (isBentOnPlane()) {
      const detail::DistortedPoint distorted = detail::distortRadtan(coefficients, m, k3);
      if (!(distorted.determinant() > 0) || !radial().ascendsTo(m.norm())) return std::nullopt;
      m = distorted.point;
    }
  }
  return Eigen::Vector2d(fu * m.x() + cu, fv * m.y() + cv);
}

inline std::optional<Eigen::Vector3d> Camera::bearing(const Eigen::Vector2d& pixel) const {
  const double u = pixel.x(), v = pixel.y();
  if (!(fu > 0) || !(fv > 0)) return std::nullopt;
  const Eigen::Vector2d m((u - cu) / fu, (v - cv) / fv);
  if (!m.allFinite()) return std::nullopt;
  Eigen::Vector3d ray(m.x(), m.y(), 1);
  if (distortion == Distortion::equidistant) {
    const double distance = m.norm();
    const auto angle = radial().inverse(distance, static_cast<double>(EIGEN_PI));
    if (!angle) return std::nullopt;
    const double scale = distance > 0 ? std::sin(*angle) / distance : 0;
    ray = {scale * m.x(), scale * m.y(), std::cos(*angle)};
  } else if (isBentOnPlane()) {
    const auto plane = detail::undistortRadtan(coefficients, m, k3);
    if (!plane) return std::nullopt;
    ray.head<2>() = *plane;
  }
  if (hasSphere()) {
    const auto direction = sphere().inverse(ray.head<2>());
    if (!direction) return std::nullopt;
    ray = *direction;
  }
  ray.normalize();
  // Whatever the iterations did: only a direction that is seen at this very pixel is its bearing.
  const auto back = project(ray);
  const double rounding = 1e-9 * (1 + std::abs(u) + std::abs(v));
  if (!back || !((*back - pixel).norm() < rounding)) return std::nullopt;
  return ray;
}

inline double Camera::pixelsPerSteradian(const Eigen::Vector3d& bearing) const {
  double area = fu * fv;
  if (distortion == Distortion::equidistant) {
    const double angle = std::atan2(bearing.head<2>().norm(), bearing.z());
    const detail::RadialPolynomial polynomial = radial();
    if (angle > 1e-8) area *= polynomial.value(angle) * polynomial.slope(angle) / std::sin(angle);
  } else {
    const double s = bearing.head<2>().norm(), z = bearing.z();
    // r = s / D turns a ring of solid angle s dθ into one of area r dr.
    const detail::SphereLens lens = sphere();
    const double divisor = hasSphere() ? lens.divisor(s, z).value : z;
    area *= (hasSphere() ? lens.growth(s, z) : 1) / (divisor * divisor * divisor);
    if (isBentOnPlane()) area *= detail::distortRadtan(coefficients, bearing.head<2>() / divisor, k3).determinant();
  }
  return area;
}

inline std::optional<BearingWithSigma> Camera::bearingWithSigma(const Eigen::Vector2d& pixel,
                                                                double pixel_sigma) const {
  const auto direction = bearing(pixel);
  if (!direction) return std::nullopt;
  return BearingWithSigma{*direction, pixel_sigma / std::sqrt(pixelsPerSteradian(*direction))};
}

inline bool Camera::sees(const Eigen::Vector2d& pixel) const {
  if (width <= 0 || height <= 0) return true;
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= width - 1 && pixel.y() <= height - 1;
}

}  // namespace liestat
