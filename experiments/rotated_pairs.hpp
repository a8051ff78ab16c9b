// Pairs of points a, b = R a with noise in both: the rotation as nine numbers under R Rᵀ = I, and as a point of SO(3).
#pragma once

#include <lie/linear.hpp>
#include <lie/so3.hpp>
#include <stats/constrained.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <span>
#include <vector>

namespace liestat::experiments {

using PointPair = Eigen::Matrix<double, 6, 1>;
/// The entries of a rotation matrix, column after column.
using RotationNumbers = Eigen::Matrix<double, 9, 1>;

inline RotationNumbers rotationNumbers(const Eigen::Matrix3d& R) { return Eigen::Map<const RotationNumbers>(R.data()); }
inline Eigen::Matrix3d rotationMatrix(const RotationNumbers& q) { return Eigen::Map<const Eigen::Matrix3d>(q.data()); }

/// b - R a = 0 for nine numbers.
struct RotatesByNumbers {
  Eigen::Vector3d operator()(const RotationNumbers& q, const PointPair& m) const {
    return m.tail<3>() - rotationMatrix(q) * m.head<3>();
  }
  EquationDerivatives<3, 9, 6> linearize(const RotationNumbers& q, const PointPair& m) const {
    EquationDerivatives<3, 9, 6> result;
    result.value = (*this)(q, m);
    for (int k = 0; k < 3; ++k) result.by_parameter.middleCols<3>(3 * k) = -m[k] * Eigen::Matrix3d::Identity();
    result.by_measurement << -rotationMatrix(q), Eigen::Matrix3d::Identity();
    return result;
  }
};
/// The same for a rotation, derivatives in its local frame: R exp(w) a = R a - R [a]× w.
struct Rotates {
  Eigen::Vector3d operator()(const SO3d& R, const PointPair& m) const {
    return m.tail<3>() - R * Eigen::Vector3d(m.head<3>());
  }
  EquationDerivatives<3, 3, 6> linearize(const SO3d& R, const PointPair& m) const {
    EquationDerivatives<3, 3, 6> result;
    const Eigen::Matrix3d M = R.matrix();
    result.value = (*this)(R, m);
    result.by_parameter = M * skew(Eigen::Vector3d(m.head<3>()));
    result.by_measurement << -M, Eigen::Matrix3d::Identity();
    return result;
  }
};
/// R Rᵀ = I by its upper triangle.
struct Orthogonal {
  Eigen::Matrix<double, 6, 1> operator()(const RotationNumbers& q) const { return linearize(q).value; }
  ConstraintDerivatives<6, 9> linearize(const RotationNumbers& q) const {
    ConstraintDerivatives<6, 9> result;
    result.by_parameter.setZero();
    const Eigen::Matrix3d R = rotationMatrix(q);
    int row = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++row) {
        result.value[row] = R.row(i).dot(R.row(j)) - (i == j ? 1 : 0);
        for (int k = 0; k < 3; ++k) {
          result.by_parameter(row, 3 * k + i) += R(j, k);
          result.by_parameter(row, 3 * k + j) += R(i, k);
        }
      }
    }
    return result;
  }
};

/// Standard deviations of the coordinates before and after the rotation.
inline constexpr double pair_sigma_before = 0.01, pair_sigma_after = 0.02;

/// A rotation and pairs with noise; points are normal with the standard deviation one.
struct RotatedPairs {
  SO3d truth;
  std::vector<PointPair> pairs;

  RotatedPairs(std::size_t n, double noise_factor, CounterRng& rng) : truth(SO3d::exp(rng.normalVector<3>())) {
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector3d a = rng.normalVector<3>();
      PointPair pair = noise_factor * sigmas().cwiseProduct(rng.normalVector<6>());
      pair.head<3>() += a;
      pair.tail<3>() += truth * a;
      pairs.push_back(pair);
    }
  }
  static PointPair sigmas() {
    PointPair list;
    list << Eigen::Vector3d::Constant(pair_sigma_before), Eigen::Vector3d::Constant(pair_sigma_after);
    return list;
  }
  /// The rotation with the least Σ ‖b - R a‖² over the first three pairs. Over all of them it would be the estimate: the
  /// errors of a pair have one standard deviation before and one after.
  SO3d start() const {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const PointPair& m : std::span(pairs).first(3)) sum += m.tail<3>() * m.head<3>().transpose();
    return SO3d::fitToSO3(sum);
  }
};

}  // namespace liestat::experiments
