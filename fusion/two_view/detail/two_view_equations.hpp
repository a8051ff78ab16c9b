// The equations of a match under a homography and under an epipolar geometry, with their derivatives.
#pragma once

#include <fusion/two_view/detail/two_view_constraints.hpp>
#include <stats/constrained_types.hpp>

#include <Eigen/Core>

namespace liestat::detail {

/// (h₃·ũ) u' - (h₁·ũ, h₂·ũ) = 0.
struct HomographyEquation {
  Eigen::Vector2d operator()(const Entries& q, const Eigen::Vector4d& m) const {
    const Eigen::Matrix3d H = matrixFrom(q);
    const double w = H(2, 0) * m[0] + H(2, 1) * m[1] + H(2, 2);
    return {w * m[2] - (H(0, 0) * m[0] + H(0, 1) * m[1] + H(0, 2)),
            w * m[3] - (H(1, 0) * m[0] + H(1, 1) * m[1] + H(1, 2))};
  }
  EquationDerivatives<2, 9, 4> linearize(const Entries& q, const Eigen::Vector4d& m) const {
    const Eigen::Matrix3d H = matrixFrom(q);
    const double w = H(2, 0) * m[0] + H(2, 1) * m[1] + H(2, 2);
    EquationDerivatives<2, 9, 4> result;
    result.value = (*this)(q, m);
    auto& J = result.by_parameter;
    auto& D = result.by_measurement;
    J.setZero(), D.setZero();
    for (int k = 0; k < 2; ++k) {
      const double u = m[2 + k];
      J(k, entry(k, 0)) = -m[0], J(k, entry(k, 1)) = -m[1], J(k, entry(k, 2)) = -1;
      J(k, entry(2, 0)) = u * m[0], J(k, entry(2, 1)) = u * m[1], J(k, entry(2, 2)) = u;
      D(k, 0) = u * H(2, 0) - H(k, 0), D(k, 1) = u * H(2, 1) - H(k, 1), D(k, 2 + k) = w;
    }
    return result;
  }
};

/// ũ'ᵀ F ũ = 0 and its derivatives by F's entries and by the match.
struct EpipolarForm {
  double value;
  Eigen::Matrix<double, 1, 9> by_entries;
  Eigen::Matrix<double, 1, 4> by_match;

  EpipolarForm(const Eigen::Matrix3d& F, const Eigen::Vector4d& m) {
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1);
    const Eigen::Vector3d Fu = F.col(0) * u[0] + F.col(1) * u[1] + F.col(2);
    value = v.dot(Fu);
    for (int k = 0; k < 3; ++k) by_entries.segment<3>(3 * k) = (u[k] * v).transpose();
    for (int k = 0; k < 2; ++k) by_match[k] = v.dot(F.col(k)), by_match[2 + k] = Fu[k];
  }
};

}  // namespace liestat::detail
