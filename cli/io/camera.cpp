#include <cli/io/camera.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <cli/io/input_error.hpp>

namespace liestat::cli {
namespace {

/// The radial part of a distortion: r ↦ r (1 + c₁ r² + c₂ r⁴ + ...), of the distance on the plane at depth one or of
/// the angle off the axis.
class RadialPolynomial {
 public:
  explicit RadialPolynomial(const Camera& camera) {
    if (camera.distortion == Distortion::none) return;
    degree_ = camera.distortion == Distortion::radtan ? 2 : 4;
    for (int i = 0; i < degree_; ++i) c_[static_cast<std::size_t>(i) + 1] = camera.coefficients[i];
  }

  double factor(double r) const {
    double sum = 0;
    for (int i = degree_; i >= 0; --i) sum = sum * r * r + c_[static_cast<std::size_t>(i)];
    return sum;
  }
  double value(double r) const { return r * factor(r); }
  double slope(double r) const {
    double sum = 0;
    for (int i = degree_; i >= 0; --i) sum = sum * r * r + (2 * i + 1) * c_[static_cast<std::size_t>(i)];
    return sum;
  }

  /// Is the slope positive from 0 to r? Decided by the coefficients of Bernstein's form, halving where these disagree:
  /// no dip between samples is missed.
  bool ascendsTo(double r) const {
    std::array<double, 5> b{};
    // The slope as a polynomial of x = (distance/r)² on [0, 1].
    double power = 1;
    for (int i = 0; i <= degree_; ++i) {
      b[static_cast<std::size_t>(i)] = (2 * i + 1) * c_[static_cast<std::size_t>(i)] * power;
      power *= r * r;
    }
    if (!std::isfinite(b[static_cast<std::size_t>(degree_)])) return false;
    std::array<double, 5> form{};
    for (int k = 0; k <= degree_; ++k) {
      for (int i = 0; i <= k; ++i) {
        form[static_cast<std::size_t>(k)] += binomial(k, i) / binomial(degree_, i) * b[static_cast<std::size_t>(i)];
      }
    }
    return positive(form, 0);
  }

  /// The r of an ascending stretch from zero on whose value is this one; none if the stretch, or `limit`, ends before.
  std::optional<double> inverse(double value_wanted, double limit) const {
    if (value_wanted == 0) return 0.0;
    double high = std::min(value_wanted, limit);
    while (high < limit && ascendsTo(high) && value(high) < value_wanted) high = std::min(2 * high, limit);
    if (!ascendsTo(high)) {
      double ascends = 0;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (ascends + high);
        (ascendsTo(middle) ? ascends : high) = middle;
      }
      high = ascends;
    }
    if (!(value(high) >= value_wanted)) return std::nullopt;
    // Newton's iteration within a bracket.
    double low = 0, r = std::min(value_wanted, high);
    for (int i = 0; i < 100; ++i) {
      const double excess = value(r) - value_wanted;
      (excess > 0 ? high : low) = r;
      double next = r - excess / slope(r);
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      const double step = std::abs(next - r);
      r = next;
      if (step <= 4 * std::numeric_limits<double>::epsilon() * r) break;
    }
    return r;
  }

 private:
  static double binomial(int n, int k) {
    double value = 1;
    for (int i = 0; i < k; ++i) value = value * (n - i) / (i + 1);
    return value;
  }
  bool positive(const std::array<double, 5>& form, int depth) const {
    const auto end = form.begin() + degree_ + 1;
    if (std::all_of(form.begin(), end, [](double x) { return x > 0; })) return true;
    // A slope of zero within so small an interval: it folds there.
    if (!(form[0] > 0) || !(form[static_cast<std::size_t>(degree_)] > 0) || depth == 40) return false;
    std::array<double, 5> left{}, right = form;
    for (int i = 0; i <= degree_; ++i) {
      left[static_cast<std::size_t>(i)] = right[0];
      for (int k = 0; k < degree_ - i; ++k) {
        right[static_cast<std::size_t>(k)] =
            0.5 * (right[static_cast<std::size_t>(k)] + right[static_cast<std::size_t>(k) + 1]);
      }
    }
    return positive(left, depth + 1) && positive(right, depth + 1);
  }

  int degree_ = 0;
  std::array<double, 5> c_{1, 0, 0, 0, 0};
};

/// Where a ray that is not distorted meets the plane at depth one comes to lie, and the derivative by it.
struct Bent {
  Eigen::Vector2d point;
  Eigen::Matrix2d derivative;

  double determinant() const { return derivative(0, 0) * derivative(1, 1) - derivative(0, 1) * derivative(1, 0); }
};

Bent bendRadtan(const Eigen::Vector4d& c, const Eigen::Vector2d& m) {
  const double x = m.x(), y = m.y(), r2 = x * x + y * y;
  const double factor = 1 + r2 * (c[0] + r2 * c[1]);
  const double by_r2 = c[0] + 2 * c[1] * r2;
  Bent bent;
  bent.point = {x * factor + 2 * c[2] * x * y + c[3] * (r2 + 2 * x * x),
                y * factor + 2 * c[3] * x * y + c[2] * (r2 + 2 * y * y)};
  const double across = 2 * x * y * by_r2 + 2 * c[2] * x + 2 * c[3] * y;
  bent.derivative << factor + 2 * x * x * by_r2 + 2 * c[2] * y + 6 * c[3] * x, across,  //
      across, factor + 2 * y * y * by_r2 + 2 * c[3] * x + 6 * c[2] * y;
  return bent;
}

/// Beyond this distance on the plane at depth one (89.99 degrees) a pinhole has no pixels worth the name.
constexpr double farthest_on_plane = 5730;

/// The inverse of bendRadtan on the sheet around the axis.
std::optional<Eigen::Vector2d> unbendRadtan(const Camera& camera, const Eigen::Vector2d& target) {
  const RadialPolynomial radial(camera);
  const double distance = target.norm();
  Eigen::Vector2d m = target;
  // The tangential part is small: the radial one alone is a start within the sheet, where there is one.
  if (const auto r = radial.inverse(distance, farthest_on_plane); r && distance > 0) m *= *r / distance;
  for (int i = 0; i < 50; ++i) {
    const Bent bent = bendRadtan(camera.coefficients, m);
    const double determinant = bent.determinant();
    if (!(determinant > 0)) return std::nullopt;
    const Eigen::Vector2d excess = bent.point - target;
    const Eigen::Matrix2d& J = bent.derivative;
    const Eigen::Vector2d step(J(1, 1) * excess.x() - J(0, 1) * excess.y(),
                               J(0, 0) * excess.y() - J(1, 0) * excess.x());
    m -= step / determinant;
    if (step.norm() <= 1e-15 * determinant * (1 + m.norm())) break;
  }
  return m;
}

}  // namespace

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& p) const {
  if (!p.allFinite()) return std::nullopt;
  Eigen::Vector2d m;
  if (distortion == Distortion::equidistant) {
    const double across = std::hypot(p.x(), p.y());
    const double angle = std::atan2(across, p.z());
    const RadialPolynomial radial(*this);
    if (!(angle < EIGEN_PI) || (across == 0 && !(p.z() > 0)) || !radial.ascendsTo(angle)) return std::nullopt;
    m = across > 0 ? Eigen::Vector2d(radial.value(angle) / across * p.head<2>()) : Eigen::Vector2d(0, 0);
  } else {
    if (!(p.z() > 0)) return std::nullopt;
    m = p.head<2>() / p.z();
    if (!(m.norm() <= farthest_on_plane)) return std::nullopt;
    if (distortion == Distortion::radtan) {
      const Bent bent = bendRadtan(coefficients, m);
      if (!(bent.determinant() > 0) || !RadialPolynomial(*this).ascendsTo(m.norm())) return std::nullopt;
      m = bent.point;
    }
  }
  return Eigen::Vector2d(fu * m.x() + cu, fv * m.y() + cv);
}

std::optional<Eigen::Vector3d> Camera::bearing(double u, double v) const {
  const Eigen::Vector2d m((u - cu) / fu, (v - cv) / fv);
  if (!m.allFinite()) return std::nullopt;
  Eigen::Vector3d ray(m.x(), m.y(), 1);
  if (distortion == Distortion::equidistant) {
    const double distance = m.norm();
    const auto angle = RadialPolynomial(*this).inverse(distance, EIGEN_PI);
    if (!angle) return std::nullopt;
    const double scale = distance > 0 ? std::sin(*angle) / distance : 0;
    ray = {scale * m.x(), scale * m.y(), std::cos(*angle)};
  } else if (distortion == Distortion::radtan) {
    const auto plane = unbendRadtan(*this, m);
    if (!plane) return std::nullopt;
    ray.head<2>() = *plane;
  }
  ray.normalize();
  // Whatever the iterations did: only what is seen at this very pixel is its bearing.
  const auto back = project(ray);
  const double rounding = 1e-9 * (1 + std::abs(u) + std::abs(v));
  if (!back || !((*back - Eigen::Vector2d(u, v)).norm() < rounding)) return std::nullopt;
  return ray;
}

double Camera::bearingDeviation(double u, double v) const {
  const auto ray = bearing(u, v);
  if (!ray) return std::numeric_limits<double>::quiet_NaN();
  // The pixels that a small solid angle covers; the root of its inverse is the geometric mean wanted.
  double area = fu * fv;
  if (distortion == Distortion::equidistant) {
    const double angle = std::atan2(ray->head<2>().norm(), ray->z());
    const RadialPolynomial radial(*this);
    if (angle > 1e-8) area *= radial.value(angle) * radial.slope(angle) / std::sin(angle);
  } else {
    const double z = ray->z();
    area /= z * z * z;
    if (distortion == Distortion::radtan) area *= bendRadtan(coefficients, ray->head<2>() / z).determinant();
  }
  return 1 / std::sqrt(area);
}

bool Camera::sees(const Eigen::Vector2d& pixel) const {
  if (width <= 0 || height <= 0) return true;
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= width - 1 && pixel.y() <= height - 1;
}

Camera cameraFromIntrinsics(const std::vector<double>& intrinsics) {
  const bool finite = std::all_of(intrinsics.begin(), intrinsics.end(), [](double x) { return std::isfinite(x); });
  if (intrinsics.size() != 4 || !finite || !(intrinsics[0] > 0) || !(intrinsics[1] > 0)) {
    throw InputError("--intrinsics", 0, fmt::format("{}", fmt::join(intrinsics, ",")),
                     "fu,fv,cu,cv in pixels, the focal lengths positive");
  }
  Camera camera;
  camera.fu = intrinsics[0], camera.fv = intrinsics[1], camera.cu = intrinsics[2], camera.cv = intrinsics[3];
  return camera;
}

}  // namespace liestat::cli
