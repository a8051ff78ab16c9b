// Operations of rotations, directions and points on arrays.
#include <python/src/manifold_operations.hpp>

#include <lie/euler.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/so3.hpp>

namespace liestat::python {

ArrayType rotationOperations() {
  ArrayType type = groupOperations<SO3d>("SO3");
  auto& list = type.operations;
  list.push_back(operation<4>("from_matrix", {{"matrix", 9}},
                              [](const double* m, double* out) { storePoint(SO3d(square<3>(m)), out); }));
  list.push_back(operation<4>("fit_matrix", {{"matrix", 9}},
                              [](const double* m, double* out) { storePoint(SO3d::fitToSO3(square<3>(m)), out); }));
  // The axes are the number of the enumerator.
  list.push_back(operation<4>(
      "from_euler", {{"angles", 3}, {"axes", 1}}, [](const double* angles, const double* axes, double* out) {
        storePoint(fromEuler<double>(static_cast<EulerAxes>(static_cast<int>(*axes)), vector<3>(angles)), out);
      }));
  list.push_back(
      operation<3>("to_euler", {{"self", 4}, {"axes", 1}}, [](const double* x, const double* axes, double* out) {
        store(toEuler(static_cast<EulerAxes>(static_cast<int>(*axes)), point<SO3d>(x)), out);
      }));
  return type;
}

ArrayType directionOperations() {
  ArrayType type = manifoldOperations<S2d>("S2");
  type.operations.push_back(operation<3>("normalized", {{"vectors", 3}},
                                         [](const double* v, double* out) { storePoint(S2d(vector<3>(v)), out); }));
  type.operations.push_back(operation<6>("tangent_basis", {{"self", 3}}, [](const double* x, double* out) {
    store(Eigen::Matrix<double, 3, 2>(ManifoldTraits<S2d>::placement(point<S2d>(x)).matrix().leftCols<2>()), out);
  }));
  return type;
}

ArrayType pointOperations() { return manifoldOperations<Eigen::Vector3d>("R3"); }

}  // namespace liestat::python
