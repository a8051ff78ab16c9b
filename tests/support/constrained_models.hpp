// Models for the tests of constrained estimation: a conic through points, a rotation between pairs of points.
#pragma once

#include <lie/so3.hpp>
#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace liestat_test {

using namespace liestat;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

/// q₀ x² + q₁ xy + q₂ y² + q₃ x + q₄ y + q₅ = 0.
struct OnConic {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 6, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    const S x = m[0], y = m[1];
    return Eigen::Matrix<S, 1, 1>(q[0] * x * x + q[1] * x * y + q[2] * y * y + q[3] * x + q[4] * y + q[5]);
  }
};
/// ‖q‖² = 1.
struct UnitLength {
  template <class S, int N>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, N, 1>& q) const {
    S sum(-1);
    for (int i = 0; i < N; ++i) sum += q[i] * q[i];
    return Eigen::Matrix<S, 1, 1>(sum);
  }
};

/// An ellipse with semi-axes 1 and 0.5 and points on it, with noise.
struct Ellipse {
  Vector6d truth;
  std::vector<Eigen::Vector2d> points;

  Ellipse(int n, double sigma, std::uint64_t seed) {
    truth << 1, 0, 4, 0, 0, -1;
    truth.normalize();
    CounterRng rng(seed);
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * 3.14159265358979323846 * i / n;
      points.push_back(Eigen::Vector2d(std::cos(angle), 0.5 * std::sin(angle)) + sigma * rng.normalVector<2>());
    }
  }
};

/// b = R a for a pair m = (a, b), R in rows of three (column by column) or as a rotation.
struct Rotates {
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const Eigen::Matrix<S, 9, 1>& q, const Eigen::Matrix<S, 6, 1>& m) const {
    Eigen::Matrix<S, 3, 1> difference;
    for (int i = 0; i < 3; ++i) difference[i] = m[3 + i] - (q[i] * m[0] + q[3 + i] * m[1] + q[6 + i] * m[2]);
    return difference;
  }
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const SO3<S>& R, const Eigen::Matrix<S, 6, 1>& m) const {
    const Eigen::Matrix<S, 3, 1> a = m.template head<3>(), b = m.template tail<3>();
    return b - R * a;
  }
};
/// R Rᵀ = I, six equations.
struct Orthogonal {
  template <class S>
  Eigen::Matrix<S, 6, 1> operator()(const Eigen::Matrix<S, 9, 1>& q) const {
    Eigen::Matrix<S, 6, 1> values;
    int k = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        values[k++] = q[3 * i] * q[3 * j] + q[3 * i + 1] * q[3 * j + 1] + q[3 * i + 2] * q[3 * j + 2] - S(i == j);
      }
    }
    return values;
  }
};

/// A rotation and noisy pairs, 0.01 before it and 0.02 after it.
struct RotatedPairs {
  SO3d truth;
  std::vector<Vector6d> pairs;
  Vector6d sigmas;

  RotatedPairs(int n, std::uint64_t seed) {
    CounterRng rng(seed);
    truth = SO3d::exp(rng.normalVector<3>());
    sigmas << 0.01, 0.01, 0.01, 0.02, 0.02, 0.02;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d a = rng.normalVector<3>();
      Vector6d pair;
      pair << a, truth * a;
      pairs.push_back(pair + sigmas.cwiseProduct(rng.normalVector<6>()));
    }
  }
};

inline Vector9d elements(const SO3d& R) {
  const Eigen::Matrix3d M = R.matrix();
  return Eigen::Map<const Vector9d>(M.data());
}
inline SO3d rotationOf(const Vector9d& q) { return SO3d::fitToSO3(Eigen::Map<const Eigen::Matrix3d>(q.data())); }

}  // namespace liestat_test
