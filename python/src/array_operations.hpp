// Operations of the manifolds on arrays: each takes rows of parameters, tangent vectors or matrices and writes one row for
// each. The kernels are plain loops over the library's operations for one element, and those of lie/arrays.hpp where a
// group has them (takeArrayKernels in manifold_operations.hpp). Needs Eigen and lie/, stats/; knows nothing of Python.
//
// Matrices are in row-major order, as NumPy's are. Covariances and Jacobians have the library's tangent order.
#pragma once

#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::python {

/// The rows of an operand: row i begins at data + i * step. A step of zero repeats one row.
struct Rows {
  const double* data = nullptr;
  std::ptrdiff_t step = 0;
};

inline constexpr std::size_t max_operands = 4;

/// Evaluates an operation on rows [0, n) and writes the results one after the other.
using Kernel = void (*)(const std::array<Rows, max_operands>& operands, double* out, std::size_t n);

/// An operation of a type: its operands with their names and columns, the columns of its result.
struct ArrayOperation {
  std::string_view name;
  std::size_t operands = 0;
  std::array<std::string_view, max_operands> names = {};
  std::array<std::size_t, max_operands> columns = {};
  std::size_t result = 0;
  Kernel kernel = nullptr;
};

/// A type and its operations.
struct ArrayType {
  std::string_view name;
  std::size_t parameters = 0, dof = 0;
  std::vector<ArrayOperation> operations;
};

/// The types with their operations, one function for each translation unit that holds some.
ArrayType rotationOperations();
ArrayType directionOperations();
ArrayType pointOperations();
ArrayType so2Operations();
ArrayType se2Operations();
ArrayType se3Operations();
ArrayType se23Operations();
ArrayType frameOperations();
ArrayType semiOrientedFrameOperations();
ArrayType nonOrientedFrameOperations();

/// A loop over rows: f(a, …, out) on pointers to each row's first number.
template <class F, std::size_t Result, std::size_t... I>
void rowsOf(const std::array<Rows, max_operands>& operands, double* out, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    F{}((operands[I].data + static_cast<std::ptrdiff_t>(i) * operands[I].step)..., out + i * Result);
  }
}

/// An operand's name and columns.
struct Operand {
  std::string_view name;
  std::size_t columns;
};

template <std::size_t Result, class F, std::size_t... I>
constexpr Kernel kernelOf(std::index_sequence<I...>) {
  return &rowsOf<F, Result, I...>;
}

/// An operation whose kernel is a loop over f, a lambda without captures: f(a, …, out) on pointers to numbers.
template <std::size_t Result, std::size_t N, class F>
ArrayOperation operation(std::string_view name, const Operand (&operands)[N], F) {
  static_assert(N <= max_operands && std::is_empty_v<F>);
  ArrayOperation result{.name = name, .operands = N, .result = Result};
  for (std::size_t i = 0; i < N; ++i) {
    result.names[i] = operands[i].name;
    result.columns[i] = operands[i].columns;
  }
  result.kernel = kernelOf<Result, F>(std::make_index_sequence<N>{});
  return result;
}

// --- Numbers in memory as values of the library ----------------------------------------------------------------------

template <int N>
using Vector = Eigen::Matrix<double, N, 1>;
template <int N>
using Square = Eigen::Matrix<double, N, N>;

template <int N>
Vector<N> vector(const double* p) {
  return Eigen::Map<const Vector<N>>(p);
}
template <int N>
Square<N> square(const double* p) {
  return Eigen::Map<const Eigen::Matrix<double, N, N, Eigen::RowMajor>>(p);
}
template <class Derived>
void store(const Eigen::MatrixBase<Derived>& value, double* out) {
  constexpr int rows = Derived::RowsAtCompileTime, columns = Derived::ColsAtCompileTime;
  if constexpr (columns == 1) {
    Eigen::Map<Vector<rows>>{out} = value;
  } else {
    Eigen::Map<Eigen::Matrix<double, rows, columns, Eigen::RowMajor>>{out} = value;
  }
}

/// The number of parameters of a point of M.
template <class M>
constexpr int parametersOf() {
  if constexpr (requires { M::num_parameters; }) {
    return M::num_parameters;
  } else {
    return M::RowsAtCompileTime;
  }
}
template <class M>
M point(const double* p) {
  if constexpr (requires { M::num_parameters; }) {
    return M::fromParams(vector<M::num_parameters>(p));
  } else {
    return vector<M::RowsAtCompileTime>(p);
  }
}
template <class M>
void storePoint(const M& x, double* out) {
  if constexpr (requires { M::num_parameters; }) {
    store(x.params(), out);
  } else {
    store(x, out);
  }
}

}  // namespace liestat::python
