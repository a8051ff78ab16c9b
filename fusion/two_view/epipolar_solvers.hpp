// Closed-form solvers for motions between two images that are told by an epipolar geometry, ũ'ᵀ F ũ = 0, ũ = (u, 1).
//
// Translation, affine and general epipolar geometry; essential matrices are in five_point.hpp and upright.hpp. ‖F‖² = 2,
// as of [t]× R with |t| = 1. Which samples have no solution: fusion/two_view/solvers.hpp.
#pragma once

#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/detail/null_vectors.hpp>
#include <fusion/two_view/detail/real_roots.hpp>
#include <fusion/two_view/solutions.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

namespace liestat {
namespace detail {

/// The direction t that Σ (t·m)² leaves, m = ũ × ũ' the normals of the epipolar planes of a translation.
inline bool translationDirection(std::span<const Eigen::Vector4d> matches, Eigen::Vector3d& t) {
  const auto normal = [](const Eigen::Vector4d& m) {
    // Differences first: motions may be small.
    const double dx = m[2] - m[0], dy = m[3] - m[1];
    return Eigen::Vector3d(-dy, dx, m[0] * dy - m[1] * dx);
  };
  const auto moves = [&](const Eigen::Vector4d& m) {
    const double sizes = (m.head<2>().squaredNorm() + 1) * (m.tail<2>().squaredNorm() + 1);
    return normal(m).squaredNorm() > 1e-24 * sizes;
  };
  if (matches.size() == 2) {
    const Eigen::Vector3d a = normal(matches[0]), b = normal(matches[1]);
    t = a.cross(b);
    const double square = t.squaredNorm();
    if (!moves(matches[0]) || !moves(matches[1]) || !(square > 1e-18 * a.squaredNorm() * b.squaredNorm())) return false;
    t /= std::sqrt(square);
    return t.allFinite();
  }
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  bool any = false;
  for (const Eigen::Vector4d& m : matches) {
    const Eigen::Vector3d a = normal(m);
    A += a * a.transpose();
    any = any || moves(m);
  }
  return any && leastVector<3>(A, t);
}

/// The right null vector of a matrix of rank 2, not normalised: the longest row of its cofactors.
inline Eigen::Vector3d rightNullVector(const Eigen::Matrix3d& F) {
  const Eigen::Vector3d a = F.row(0), b = F.row(1), c = F.row(2);
  const Eigen::Vector3d candidates[] = {b.cross(c), c.cross(a), a.cross(b)};
  int best = 0;
  double longest = candidates[0].squaredNorm();
  for (int i = 1; i < 3; ++i) {
    const double square = candidates[i].squaredNorm();
    if (square > longest) {
      longest = square;
      best = i;
    }
  }
  return candidates[best];
}

/// Hartley's normalisation of both images of a sample: û = s (u - mean).
struct EpipolarNormalisation {
  CentredMatches sums;
  double s = 1, r = 1;
  explicit EpipolarNormalisation(std::span<const Eigen::Vector4d> matches) : sums(matches) {
    s = sums.scaleOf(sums.first, matches.size());
    r = sums.scaleOf(sums.second, matches.size());
  }
  Eigen::Vector4d apply(const Eigen::Vector4d& m) const {
    return Eigen::Vector4d(s * (m[0] - sums.mean.x()), s * (m[1] - sums.mean.y()), r * (m[2] - sums.mean_second.x()),
                           r * (m[3] - sums.mean_second.y()));
  }
  /// F of the matches from that of the normalised ones, ‖F‖² = 2.
  Eigen::Matrix3d undo(Eigen::Matrix3d F) const {
    F.leftCols<2>() *= s;
    F.col(2) -= sums.mean.x() * F.col(0) + sums.mean.y() * F.col(1);
    F.topRows<2>() *= r;
    F.row(2) -= sums.mean_second.x() * F.row(0) + sums.mean_second.y() * F.row(1);
    return F * std::sqrt(2 / F.squaredNorm());
  }
};

/// The coefficients of ũ'ᵀ F ũ by the entries of F, row after row, and a zero.
inline NineColumns<1> epipolarEquation(const Eigen::Vector4d& m) {
  const double x = m[0], y = m[1], x2 = m[2], y2 = m[3];
  NineColumns<1> equation;
  equation << x2 * x, x2 * y, x2, y2 * x, y2 * y, y2, x, y, 1, 0;
  return equation;
}
/// The matrix with the given entries, row after row.
inline Eigen::Matrix3d matrixOf(const NineColumns<1>& f) {
  Eigen::Matrix3d F;
  F << f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8];
  return F;
}

}  // namespace detail

/// Translation of the camera without rotation, by the epipolar planes' normals.
inline MatrixSolutions<1> solveTranslation(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  Eigen::Vector3d t;
  if (matches.size() < 2 || !detail::translationDirection(matches, t)) return result;
  // Depths in λ' ũ' = λ ũ + t: both have the sign of (t × ũ)·(ũ' × ũ) and (t × ũ')·(ũ' × ũ).
  int front = 0;
  for (const Eigen::Vector4d& m : matches) {
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1), n = v.cross(u);
    const double a = t.cross(u).dot(n), b = t.cross(v).dot(n);
    front += (a > 0 && b > 0 ? 1 : 0) - (a < 0 && b < 0 ? 1 : 0);
  }
  result.add(front < 0 ? detail::skew(-t) : detail::skew(t));
  return result;
}

/// Epipolar geometry of two affine cameras: the hyperplane through the matches, as points of R⁴, by total least
/// squares.
inline MatrixSolutions<1> solveAffineEpipolar(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  if (matches.size() < 4) return result;
  Eigen::Vector4d mean = Eigen::Vector4d::Zero(), a;
  for (const Eigen::Vector4d& m : matches) mean += m;
  mean /= static_cast<double>(matches.size());
  if (matches.size() == 4) {
    // The vector across three differences: the minors of three rows.
    const Eigen::Vector4d p = matches[1] - matches[0], q = matches[2] - matches[0], r = matches[3] - matches[0];
    const auto minor = [&](int i, int j, int k) {
      return p[i] * (q[j] * r[k] - q[k] * r[j]) + p[j] * (q[k] * r[i] - q[i] * r[k]) +
             p[k] * (q[i] * r[j] - q[j] * r[i]);
    };
    a = Eigen::Vector4d(minor(1, 2, 3), -minor(0, 2, 3), minor(0, 1, 3), -minor(0, 1, 2));
    const double size = a.norm(), extent = std::sqrt(p.squaredNorm() + q.squaredNorm() + r.squaredNorm());
    if (!(size > 1e-9 * extent * extent * extent) || !(extent > 1e-14 * mean.norm())) return result;
    a /= size;
  } else {
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    for (const Eigen::Vector4d& m : matches) A += (m - mean) * (m - mean).transpose();
    // Points whose spread is rounding determine nothing.
    if (!(A.trace() > 1e-28 * static_cast<double>(matches.size()) * mean.squaredNorm())) return result;
    if (!detail::leastVector<4>(A, a)) return result;
  }
  Eigen::Matrix3d F;
  F << 0, 0, a[2], 0, 0, a[3], a[0], a[1], -a.dot(mean);
  F *= std::sqrt(2 / F.squaredNorm());
  // Without a part in each image the epipole is no point of the image at infinity.
  const double first = a.head<2>().squaredNorm(), second = a.tail<2>().squaredNorm();
  if (F.allFinite() && first > 1e-18 * second && second > 1e-18 * first) result.add(F);
  return result;
}

/// Fundamental matrix of seven matches, up to three, or of eight or more by linear least squares; both after Hartley's
/// normalisation, where least squares also make the rank two (R. Hartley, "In defense of the eight-point algorithm",
/// PAMI 19, 1997).
inline MatrixSolutions<3> solveFundamental(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<3> result;
  if (matches.size() < 7) return result;
  const detail::EpipolarNormalisation normalised(matches);
  if (!normalised.sums.spread) return result;
  const auto keep = [&](const Eigen::Matrix3d& F) {
    const Eigen::Matrix3d of_matches = normalised.undo(F);
    if (of_matches.allFinite()) result.add(of_matches);
  };
  if (matches.size() == 7) {
    detail::NineColumns<7> equations;
    detail::NineColumns<2> basis;
    for (int i = 0; i < 7; ++i)
      equations.col(i) = detail::epipolarEquation(normalised.apply(matches[static_cast<std::size_t>(i)]));
    if (!detail::nullBasis<7>(equations, basis)) return result;
    const Eigen::Matrix3d A = detail::matrixOf(basis.col(0)), B = detail::matrixOf(basis.col(1));
    // det(z A + w B), by z's powers.
    const Eigen::Matrix3d a = detail::cofactors(A), b = detail::cofactors(B);
    const detail::RealRoots<3> roots(
        {B.col(0).dot(b.col(0)), A.cwiseProduct(b).sum(), B.cwiseProduct(a).sum(), A.col(0).dot(a.col(0))});
    for (int i = 0; i < roots.size(); ++i) keep(roots[i].z * A + roots[i].w * B);
    return result;
  }
  Eigen::Matrix<double, 9, 1> f;
  if (matches.size() == 8) {
    // Eight equations as they are: their squares would lose half the digits.
    detail::NineColumns<8> equations;
    detail::NineColumns<1> basis;
    for (int i = 0; i < 8; ++i)
      equations.col(i) = detail::epipolarEquation(normalised.apply(matches[static_cast<std::size_t>(i)]));
    if (!detail::nullBasis<8>(equations, basis)) return result;
    f = basis.head<9>();
  } else {
    Eigen::Matrix<double, 9, 9> N = Eigen::Matrix<double, 9, 9>::Zero();
    for (const Eigen::Vector4d& m : matches) {
      const Eigen::Vector4d q = normalised.apply(m);
      const Eigen::Vector3d u(q[0], q[1], 1), v(q[2], q[3], 1);
      const Eigen::Matrix3d square = u * u.transpose();
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) N.block<3, 3>(3 * i, 3 * j) += v[i] * v[j] * square;
      }
    }
    if (!detail::leastVector<9>(N, f)) return result;
  }
  Eigen::Matrix3d F;
  F << f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8];
  // The nearest matrix of rank 2 lacks what F makes of its last right singular vector.
  Eigen::Vector3d last;
  if (!detail::leastVector<3>(F.transpose() * F, last)) return result;
  keep(F - (F * last) * last.transpose());
  return result;
}

/// True if an epipolar geometry can show all matches in front of both views: (e' × ũ')·(F ũ) has one sign (O. Chum, T.
/// Werner, J. Matas, "Epipolar geometry estimation via RANSAC benefits from the oriented epipolar constraint", ICPR
/// 2004). F has rank 2; its sign does not matter. Matches at an epipole tell nothing.
inline bool isOriented(const Eigen::Matrix3d& F, std::span<const Eigen::Vector4d> matches) {
  const Eigen::Vector3d epipole = detail::rightNullVector(F.transpose());
  double sign = 0;
  for (const Eigen::Vector4d& m : matches) {
    const double side = epipole.cross(Eigen::Vector3d(m[2], m[3], 1)).dot(F * Eigen::Vector3d(m[0], m[1], 1));
    if (side * sign < 0) return false;
    if (side != 0) sign = side;
  }
  return sign != 0;
}

}  // namespace liestat
