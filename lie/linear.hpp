// The linear algebra of small fixed sizes that users of the library's results need: factors of covariances and the
// cross-product matrix. Plain loops without Eigen's decompositions, which a compiler pays for with seconds each.
//
//   const liestat::Cholesky<double, 6> root(covariance);
//   if (root.ok()) const auto z = root.halfSolve<1>(error);  // whitened; z.squaredNorm() is the Mahalanobis distance
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_factors.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>

namespace liestat {

/// Cholesky's factor A = L Lᵀ of a symmetric positive definite matrix, Cholesky<S, N>: ok(), halfSolve (L⁻¹ B), inverse(), …;
/// where the matrix is not positive definite ok() is false and all results are NaN.
using detail::Cholesky;
/// A square root B of a symmetric matrix that may be singular, B Bᵀ = A, SemidefiniteRoot<S, N>.
using detail::SemidefiniteRoot;
/// The eigenvalues of a symmetric matrix, ascending, and its eigenvectors, SymmetricEigen(A): values, vectors.
using detail::SymmetricEigen;
/// The cross-product matrix [v] of a vector of three numbers: [v] w = v × w.
using detail::skew;
/// F Fᵀ of a factor, symmetric to the last bit, and with a Cholesky factor where F has full rank but for rounding.
using detail::squareOfFactor;
/// A B, without a type of expression for each pair of shapes.
using detail::product;

}  // namespace liestat
