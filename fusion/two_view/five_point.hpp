// Essential matrices of five matches: all real ones, up to ten.
//
// The matrices that obey the five equations ũ'ᵀ E ũ = 0 are x X + y Y + z Z + W; 2 E Eᵀ E = tr(E Eᵀ) E and det E = 0 are
// ten cubic equations for x, y, z. Elimination leaves three equations linear in (x, y, 1) with polynomials in z, whose
// determinant has degree ten (D. Nistér, "An efficient solution to the five-point relative pose problem", PAMI 26,
// 2004). Each real root is then polished as a pose: Newton's method on the five equations, by rotation and direction,
// so that the equations hold to rounding and the matrix is [t]× R exactly.
#pragma once

#include <fusion/two_view/detail/five_point_equations.hpp>
#include <fusion/two_view/detail/null_vectors.hpp>
#include <fusion/two_view/detail/real_roots.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/solutions.hpp>
#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <cstddef>
#include <span>

namespace liestat {
namespace detail {

/// Another orthogonal basis of the same space: the product with a quaternion of no special direction.
inline NineColumns<4> turnedBasis(const NineColumns<4>& b) {
  constexpr double w = 0.31, x = 0.56, y = -0.42, z = 0.6436;  // |(w, x, y, z)| = 1 to 1e-3
  NineColumns<4> turned;
  turned.col(0) = w * b.col(0) - x * b.col(1) - y * b.col(2) - z * b.col(3);
  turned.col(1) = x * b.col(0) + w * b.col(1) - z * b.col(2) + y * b.col(3);
  turned.col(2) = y * b.col(0) + z * b.col(1) + w * b.col(2) - x * b.col(3);
  turned.col(3) = z * b.col(0) - y * b.col(1) + x * b.col(2) + w * b.col(3);
  return turned;
}

}  // namespace detail

/// Essential matrices E = [t]× R, |t| = 1, of exactly five matches in normalised coordinates; x' = R x + t. Points of a
/// plane are no exception. None where the five equations depend on each other to 1e-12 of their size, where the views
/// differ by a rotation alone or not at all (every t solves), or if not finite.
inline MatrixSolutions<10> solveEssential(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<10> result;
  if (matches.size() != 5) return result;
  detail::NineColumns<5> rows;
  detail::NineColumns<4> basis;
  std::array<Eigen::Vector3d, 5> first, second;
  for (std::size_t i = 0; i < 5; ++i) {
    const Eigen::Vector4d& m = matches[i];
    rows.col(static_cast<Eigen::Index>(i)) = detail::epipolarEquation(m);
    first[i] = Eigen::Vector3d(m[0], m[1], 1);
    second[i] = Eigen::Vector3d(m[2], m[3], 1);
  }
  if (!detail::nullBasis<5>(rows, basis)) return result;
  // In a basis with zeros, as of points on a grid, two solutions may have one z: turned, it has none. Where a pivot is
  // small, roots lose as many digits: a further turn does better nearly always.
  detail::FivePointEquations equations;
  basis = detail::turnedBasis(basis);
  double pivot = equations.eliminate(basis);
  for (int attempt = 0; attempt < 2 && pivot < 1e-3; ++attempt) {
    const detail::NineColumns<4> turned = detail::turnedBasis(basis);
    detail::FivePointEquations others;
    const double other = others.eliminate(turned);
    if (!(other > pivot)) break;
    pivot = other;
    equations = others;
    basis = turned;
  }
  if (!(pivot > 1e-13)) return result;
  const detail::RealRoots<10> roots(equations.determinant(), 1e-9);
  for (int i = 0; i < roots.size(); ++i) {
    const Eigen::Vector4d c = equations.coefficients(roots[i].z, roots[i].w);
    Eigen::Matrix3d E =
        detail::matrixOf(c[0] * basis.col(0) + c[1] * basis.col(1) + c[2] * basis.col(2) + c[3] * basis.col(3));
    if (!detail::polishEssential(first, second, E)) continue;
    bool known = false;
    for (const Eigen::Matrix3d& other : result) {
      const double same = other.cwiseProduct(E).sum();
      known = known || same * same > 4 * (1 - 1e-13);
    }
    if (!known) result.add(E);
  }
  return result;
}

}  // namespace liestat
