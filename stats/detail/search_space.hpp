// The spaces that the certificates of stats/uniqueness.hpp search: SO(3), its quotients by half-turns and the sphere, as
// unit vectors in double, and how a manifold whose traits say its compact factor is mapped to them.
#pragma once

#include <lie/detail/arccosine.hpp>
#include <lie/manifold.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat::detail {

inline constexpr double pi = static_cast<double>(EIGEN_PI);

/// A datum as seen from a point: lengths of the shortest and of the second shortest geodesic (rad), the error vector.
struct Sighting {
  double angle = 0, second = 0;
  Eigen::Vector3d z = Eigen::Vector3d::Zero();
  double gap() const { return second - angle; }
};

/// SO(3), or its quotient by half-turns about some of the axes. Points are unit quaternions x y z w, chart and error
/// vectors are rotation vectors.
struct RotationSpace {
  static constexpr int dimension = 3;
  static constexpr bool convex_to_cut_locus = true;
  using Point = Eigen::Vector4d;
  using Chart = Eigen::Vector3d;

  std::array<bool, 3> half_turns{};  ///< the axes whose half-turns are divided out

  bool isQuotient() const { return half_turns[0] || half_turns[1] || half_turns[2]; }

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
    int best = 3;
    double c = std::abs(r[3]), c2 = -1;
    for (int axis = 0; axis < 3; ++axis) {
      if (!half_turns[static_cast<std::size_t>(axis)]) continue;
      const double candidate = std::abs(r[axis]);
      if (candidate > c) {
        c2 = c, c = candidate, best = axis;
      } else {
        c2 = std::max(c2, candidate);
      }
    }
    Sighting s;
    // The vector part of r times the unit quaternion of the axis.
    switch (best) {
      case 0:
        s.z = Eigen::Vector3d(r[3], r[2], -r[1]);
        break;
      case 1:
        s.z = Eigen::Vector3d(-r[2], r[3], r[0]);
        break;
      case 2:
        s.z = Eigen::Vector3d(r[1], -r[0], r[3]);
        break;
      default:
        s.z = r.head<3>();
    }
    // The scalar part of the representative is r[3], or minus the component that became it.
    const bool negative = best == 3 ? r[3] < 0 : r[best] > 0;
    const double ratio = arccosineRatio(c);
    s.angle = ratio * s.z.norm();
    s.second = c2 >= 0 ? 2 * std::acos(std::min(c2, 1.0)) : 2 * pi - s.angle;
    s.z *= negative ? -ratio : ratio;
    return s;
  }
  /// True if every point within ρ of p is nearer to the base by another representative.
  bool isOutsideDomain(const Point& p, double rho) const {
    double other = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (half_turns[static_cast<std::size_t>(axis)]) other = std::max(other, std::abs(p[axis]));
    }
    const double own = std::abs(p[3]);
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

/// The space that the compact factor of a manifold is searched in. The half-turns of a quotient of rotations are those
/// of its representatives of the origin.
template <Metric M>
auto searchSpace() {
  using T = ManifoldTraits<M>;
  if constexpr (compactFactor<M>() == CompactFactor::rotation) {
    RotationSpace space;
    if constexpr (Quotient<M>) {
      for (const int index : T::representatives) {
        const auto q = T::compactCoordinates(T::representative(T::origin(), index));
        for (int axis = 0; axis < 3; ++axis) {
          if (std::abs(static_cast<double>(q[axis])) > 0.5) space.half_turns[static_cast<std::size_t>(axis)] = true;
        }
      }
    }
    return space;
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
double aPrioriRadius() {
  using T = ManifoldTraits<M>;
  const double injectivity = static_cast<double>(T::injectivityRadius());
  const double curvature = static_cast<double>(T::maxSectionalCurvature());
  return 0.5 * (curvature > 0 ? std::min(injectivity, pi / std::sqrt(curvature)) : injectivity);
}

}  // namespace liestat::detail
