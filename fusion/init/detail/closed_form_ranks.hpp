// Ranks and singular values of the closed form's system, which is not weighted here: what exact data determine.
#pragma once

#include <fusion/init/detail/closed_form_blocks.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// A singular value that is zero to rounding, relative to the largest.
constexpr double rankTolerance(bool bias) { return bias ? 1e-12 : 1e-10; }

/// The ranks of the system without weights, and its weakest motions.
struct RankDiagnosis {
  Triangle root;
  std::vector<SmallMatrix> by_motion;
  std::vector<int> feature_rank;
  int feature_null = 0, motion_null = 0;
  double largest = 0;
  std::vector<double> values;   ///< descending
  std::vector<Motion> vectors;  ///< motions of unit length with their features, their last entry 0; by values
};

/// The largest singular value of the whole system, by the power method on its arrow-shaped normal matrix: a lower bound
/// that is within a few per cent, which is all that a relative threshold needs.
inline double largestSingularValue(const RayTable& table, bool bias) {
  Motion y(bias);
  const int m = y.size - 1;
  y.value.fill(1);
  std::vector<Eigen::Vector3d> P(table.features(), Eigen::Vector3d::Ones());
  double length = 0;
  for (int pass = 0; pass < 20; ++pass) {
    y[m] = 0;
    double square = 0;
    for (int k = 0; k < m; ++k) square += y[k] * y[k];
    for (const Eigen::Vector3d& p : P) square += p.squaredNorm();
    length = std::sqrt(square);
    Motion unit = y;
    for (int k = 0; k < m; ++k) unit[k] /= length;
    y.value.fill(0);
    Eigen::Vector3d by_velocity = Eigen::Vector3d::Zero(), by_gravity = by_velocity, by_bias = by_velocity;
    for (std::size_t i = 0; i < P.size(); ++i) {
      const Eigen::Vector3d p = P[i] / length;
      P[i].setZero();
      for (const Ray& ray : table.of(i)) {
        const ScaledImage& image = table.images[ray.image];
        Eigen::Vector3d d = relativePosition(image, p, unit) + image.s;
        d -= ray.u.dot(d) * ray.u;
        P[i] += d;
        by_velocity -= image.tau * d;
        by_gravity -= image.tau * image.tau * d;
        if (bias) by_bias -= image.bias.transpose() * d;
      }
    }
    y.set(0, by_velocity);
    if (bias) y.set(3, by_bias);
    y.set(m - 3, by_gravity);
  }
  // The last vector was of unit length before the matrix was applied twice.
  double square = 0;
  for (int k = 0; k < m; ++k) square += y[k] * y[k];
  for (const Eigen::Vector3d& p : P) square += p.squaredNorm();
  return std::sqrt(std::sqrt(square));
}

/// Ranks and singular values, in time linear in the observations. With W = (P(y), y), the features that fit a motion
/// best, null vectors are W y with R y = 0, R the root of what remains when the features are taken out. The singular
/// values of R relative to |W y| are those of the whole system restricted to the range of W: an upper bound for as
/// many of its smallest, and zero exactly where the whole has zeros.
inline RankDiagnosis diagnoseRanks(const RayTable& table, bool bias) {
  const int m = bias ? 9 : 6;
  const double tolerance = rankTolerance(bias);
  RankDiagnosis d{Triangle(m + 1), {}, {}, 0, 0, largestSingularValue(table, bias), {}, {}};
  SmallMatrix lengths = SmallMatrix::identity(m);
  for (std::size_t i = 0; i < table.features(); ++i) {
    LeadingElimination e = eliminateOrthogonally(table.of(i), table.images, bias, tolerance);
    d.root.add(e.rest);
    for (int k = 0; k < 3; ++k) {
      for (int a = 0; a <= m; ++a) e.gain(k, a) = -e.gain(k, a);
      for (int a = 0; a < m; ++a) {
        for (int b = 0; b < m; ++b) lengths(a, b) += e.gain(k, a) * e.gain(k, b);
      }
    }
    d.by_motion.push_back(e.gain);
    d.feature_rank.push_back(e.rank);
    d.feature_null += 3 - e.rank;
  }
  // R relative to W: R C⁻¹ with WᵀW = CᵀC.
  const SmallMatrix inverse = Triangle::cholesky(lengths).inverse(m);
  const SmallSvd svd(d.root.r.block(0, 0, m, m) * inverse);
  for (int k = 0; k < m; ++k) {
    d.values.push_back(svd.value(k));
    d.motion_null += svd.value(k) <= tolerance * d.largest;
    Motion y(bias);
    for (int i = 0; i < m; ++i) {
      for (int j = i; j < m; ++j) y[i] += inverse(i, j) * svd.v(k, j);
    }
    y[m] = 0;
    d.vectors.push_back(y);
  }
  return d;
}

}  // namespace liestat::detail
