// The spaces that the certificates of stats/uniqueness.hpp search: SO(3), its quotients by finite groups and the
// sphere, as unit vectors in double, and how a manifold whose traits say its compact factor is mapped to them.
#pragma once

#include <lie/detail/arccosine.hpp>
#include <lie/manifold.hpp>
#include <lie/point_group.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace liestat::detail {

inline constexpr double pi = static_cast<double>(EIGEN_PI);

/// A datum as seen from a point: lengths of the shortest and of the second shortest geodesic (rad), the error vector.
struct Sighting {
  double angle = 0, second = 0;
  Eigen::Vector3d z = Eigen::Vector3d::Zero();
  double gap() const { return second - angle; }
};

/// SO(3), or its quotient by a finite group. Points are unit quaternions x y z w, chart and error
/// vectors are rotation vectors.
struct RotationSpace {
  static constexpr int dimension = 3;
  static constexpr bool convex_to_cut_locus = true;
  using Point = Eigen::Vector4d;
  using Chart = Eigen::Vector3d;

  PointGroup group{};  ///< divided out, from the right

  bool isQuotient() const { return group.order() > 1; }

  static Point exp(const Eigen::Vector3d& v) {
    const double t = v.norm();
    const double s = t > 1e-9 ? std::sin(0.5 * t) / t : 0.5;
    return Point(s * v[0], s * v[1], s * v[2], std::cos(0.5 * t));
  }
  static Point exp(const Point& a, const Eigen::Vector3d& v) {
    const Point b = exp(v);
    return Point(a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
                 a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
                 a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
                 a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2])
        .normalized();
  }
  static Point fromChart(const Chart& v) { return exp(v); }
  /// Rotation vector from the base to the nearest representative of a point.
  Chart toChart(const Point& p) const { return see(Point(0, 0, 0, 1), p).z; }

  /// a⁻¹b: components x y z w.
  static Point relative(const Point& a, const Point& b) {
    return Point(a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1],
                 a[3] * b[1] - a[1] * b[3] - a[2] * b[0] + a[0] * b[2],
                 a[3] * b[2] - a[2] * b[3] - a[0] * b[1] + a[1] * b[0], a.dot(b));
  }
  Sighting see(const Point& from, const Point& datum) const {
    const Point r = relative(from, datum);
    const RotationGroup& elements = group.rotations();
    const RotationGroup::Nearest nearest = elements.nearest(r[0], r[1], r[2], r[3]);
    const std::size_t k = nearest.slot;
    const double x = elements.x[k], y = elements.y[k], z = elements.z[k], w = elements.w[k];
    Sighting s;
    // The vector part of r times the element.
    s.z = Eigen::Vector3d(r[3] * x + r[0] * w + r[1] * z - r[2] * y, r[3] * y + r[1] * w + r[2] * x - r[0] * z,
                          r[3] * z + r[2] * w + r[0] * y - r[1] * x);
    const double ratio = arccosineRatio(std::abs(nearest.w));
    s.angle = ratio * s.z.norm();
    s.second = nearest.second >= 0 ? 2 * std::acos(std::min(nearest.second, 1.0)) : 2 * pi - s.angle;
    s.z *= nearest.w < 0 ? -ratio : ratio;
    return s;
  }
  /// True if every point within ρ of p is nearer to the base by another representative.
  bool isOutsideDomain(const Point& p, double rho) const {
    const double own = std::abs(p[3]);
    const double other = std::abs(group.rotations().nearest(p[0], p[1], p[2], p[3]).w);
    return other > own && 2 * (std::acos(std::min(own, 1.0)) - std::acos(std::min(other, 1.0))) > 2 * rho;
  }
  /// (θ/2)cot(θ/2)
  static double transverse(double t) { return t < 1e-4 ? 1 - t * t / 12 : 0.5 * t / std::tan(0.5 * t); }
};

/// The unit sphere of R^3. Points are unit vectors, the base is (0, 0, 1), error vectors are tangent vectors in R^3.
struct SphereSpace {
  static constexpr int dimension = 2;
  static constexpr bool convex_to_cut_locus = false;
  using Point = Eigen::Vector3d;
  using Chart = Eigen::Vector2d;

  static bool isQuotient() { return false; }
  static Point exp(const Point& a, const Eigen::Vector3d& v) {
    const double t = v.norm();
    return (std::cos(t) * a + (t > 1e-9 ? std::sin(t) / t : 1.0) * v).normalized();
  }
  static Point fromChart(const Chart& v) { return exp(Point(0, 0, 1), Eigen::Vector3d(v[0], v[1], 0)); }
  static Chart toChart(const Point& p) { return see(Point(0, 0, 1), p).z.head<2>(); }
  static Sighting see(const Point& from, const Point& datum) {
    Sighting s;
    const double c = from.dot(datum);
    s.z = datum - c * from;
    const double sine = s.z.norm();
    s.angle = std::atan2(sine, c);
    s.second = 2 * pi - s.angle;
    if (sine > 1e-12) {
      s.z *= s.angle / sine;
    } else if (c < 0) {  // the antipode: any direction
      s.z = pi * from.unitOrthogonal();
    }
    return s;
  }
  static bool isOutsideDomain(const Point&, double) { return false; }
  /// θ cot θ
  static double transverse(double t) { return t < 1e-4 ? 1 - t * t / 3 : t / std::tan(t); }
};

/// The transverse eigenvalue from a table, rounded down.
template <class Space>
class TransverseTable {
 public:
  TransverseTable() {
    for (int i = 0; i <= size; ++i) values_[static_cast<std::size_t>(i)] = Space::transverse(i * pi / size);
    if constexpr (Space::convex_to_cut_locus) {
      values_[size] = 0;
    } else {
      values_[size] = -std::numeric_limits<double>::infinity();
    }
  }
  /// At most g(t): the value at the next node, since g decreases.
  double operator()(double t) const {
    const double i = t * (size / pi);
    return i < size ? values_[static_cast<std::size_t>(i) + 1] : values_[size];
  }

 private:
  static constexpr int size = 2048;
  std::array<double, size + 1> values_;
};

/// The group that a quotient of rotations is by: that of the feature, or for all features of a type the rotations that
/// its representatives of the origin are, which is trivial unless they are one of the point groups.
template <Metric M>
PointGroup rotationGroup(const M& x) {
  using T = ManifoldTraits<M>;
  if constexpr (requires { x.group(); }) {
    return x.group();
  } else if constexpr (Quotient<M>) {
    static const PointGroup group = [] {
      std::uint32_t elements = 0;
      for (const int index : T::representatives) {
        const Eigen::Vector4d q = T::compactCoordinates(T::representative(T::origin(), index)).template cast<double>();
        for (std::size_t k = 0; k < crystal_rotations.size(); ++k) {
          if (std::abs(q.dot(Eigen::Map<const Eigen::Vector4d>(crystal_rotations[k].data()))) > 1 - 1e-5) {
            elements |= std::uint32_t{1} << k;
          }
        }
      }
      return PointGroup::ofElements(elements).value_or(PointGroup());
    }();
    return group;
  } else {
    return {};
  }
}

/// The space that the compact factor of a manifold is searched in, with the group of the features.
template <Metric M>
auto searchSpace(const M& mean) {
  if constexpr (compactFactor<M>() == CompactFactor::rotation) {
    return RotationSpace{rotationGroup(mean)};
  } else {
    return SphereSpace{};
  }
}

/// A feature's compact part in the frame of y, to_y the inverse of y's placement.
template <class Space, Metric M>
typename Space::Point relativePoint(const typename ManifoldTraits<M>::Group& to_y, const M& x) {
  using T = ManifoldTraits<M>;
  using Point = typename Space::Point;
  return Point(T::compactCoordinates(T::act(to_y, x)).template cast<double>()).normalized();
}

/// The feature whose compact part is a point of the search, seen from y; the rest as y.
template <class Space, Metric M>
M featureAt(const Space& space, const M& y, const typename Space::Point& point) {
  TangentOf<M> v = TangentOf<M>::Zero();
  v.template segment<Space::dimension>(ManifoldTraits<M>::compact_begin) =
      space.toChart(point).template cast<ScalarOf<M>>();
  return exp(y, v);
}

/// The angle of a feature of a manifold with a circle in the frame of y, rad.
template <Metric M>
double relativeAngle(const typename ManifoldTraits<M>::Group& to_y, const M& x) {
  using T = ManifoldTraits<M>;
  const auto z = T::compactCoordinates(T::act(to_y, x));
  return std::atan2(static_cast<double>(z[1]), static_cast<double>(z[0]));
}

/// ½ min(injectivity radius, π/√Δ)
template <Metric M>
double aPrioriRadius(const M& mean) {
  const double injectivity = static_cast<double>(injectivityRadiusAt(mean));
  const double curvature = static_cast<double>(ManifoldTraits<M>::maxSectionalCurvature());
  return 0.5 * (curvature > 0 ? std::min(injectivity, pi / std::sqrt(curvature)) : injectivity);
}

}  // namespace liestat::detail
