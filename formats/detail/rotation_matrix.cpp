#include <formats/detail/rotation_matrix.hpp>

#include <fmt/format.h>

#include <Eigen/LU>

#include <formats/input_error.hpp>

namespace liestat::detail {

NearestRotation nearestRotation(const Eigen::Matrix3d& matrix, double tolerance, const std::string& file,
                                std::size_t line, std::string_view remedy) {
  const double determinant = matrix.determinant();
  if (determinant < 0) {
    throw InputError(file, line,
                     fmt::format("the rotation matrix has determinant {:.6g}, it is a reflection", determinant),
                     "determinant 1");
  }
  const double error = 0.5 * (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).norm();
  if (!(error <= tolerance && determinant > 0)) {
    throw InputError(file, line, fmt::format("the rotation matrix is not orthogonal (error {:.6g})", error),
                     fmt::format("an error within {:g}{}", tolerance, remedy));
  }
  return {SO3d::fitToSO3(matrix), error};
}

}  // namespace liestat::detail
