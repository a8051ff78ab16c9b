// Calls the library with doubles from standard input and writes the results' doubles to standard output:
//   reference OPERATION ROWS
#include <lie/arrays.hpp>
#include <lie/frame3.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>

#include <cstddef>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using Vector6 = Eigen::Matrix<double, 6, 1>;

template <int N>
Eigen::Matrix<double, N, 1> read() {
  Eigen::Matrix<double, N, 1> v;
  std::cin.read(reinterpret_cast<char*>(v.data()), N * sizeof(double));
  return v;
}
template <class Derived>
void write(const Eigen::MatrixBase<Derived>& value) {
  const Eigen::MatrixXd transposed = value.transpose();  // row by row
  std::cout.write(reinterpret_cast<const char*>(transposed.data()),
                  static_cast<std::streamsize>(sizeof(double)) * transposed.size());
}
template <class M>
std::vector<M> readPoints(std::size_t n) {
  std::vector<M> list;
  for (std::size_t i = 0; i < n; ++i) list.push_back(M::fromParams(read<M::num_parameters>()));
  return list;
}
template <int N>
std::vector<Eigen::Matrix<double, N, 1>> readVectors(std::size_t n) {
  std::vector<Eigen::Matrix<double, N, 1>> list;
  for (std::size_t i = 0; i < n; ++i) list.push_back(read<N>());
  return list;
}
template <class T>
void writePoints(const std::vector<T>& list) {
  for (const T& x : list) write(x.params());
}
template <class Result>
int writeEstimate(const Result& result) {
  if (!result.estimate) return 1;
  write(result.estimate->mean.params());
  write(result.estimate->covariance);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::string operation = argv[1];
  const std::size_t n = std::strtoull(argv[2], nullptr, 10);
  if (operation == "so3_exp") {
    std::vector<SO3d> x(n);
    const auto v = readVectors<3>(n);
    arrays::exp<SO3d>(v, x);
    writePoints(x);
  } else if (operation == "se3_exp") {
    std::vector<SE3d> x(n);
    const auto v = readVectors<6>(n);
    arrays::exp<SE3d>(v, x);
    writePoints(x);
  } else if (operation == "se3_log") {
    const std::vector<SE3d> x = readPoints<SE3d>(n);
    std::vector<Vector6> v(n);
    arrays::log<SE3d>(x, v);
    for (const Vector6& z : v) write(z);
  } else if (operation == "se3_left_jacobian") {
    std::vector<Eigen::Matrix<double, 6, 6>> J(n);
    const auto v = readVectors<6>(n);
    arrays::leftJacobian<SE3d>(v, J);
    for (const auto& m : J) write(m);
  } else if (operation == "se3_square") {
    const std::vector<SE3d> x = readPoints<SE3d>(n);
    std::vector<SE3d> squares(n);
    arrays::product<SE3d>(x, x, squares);
    writePoints(squares);
  } else if (operation == "so3_mean") {
    return writeEstimate(certifiedMean(readPoints<SO3d>(n)));
  } else if (operation == "frame3_mean") {
    return writeEstimate(certifiedMean(readPoints<Frame3d>(n)));
  } else if (operation == "frame3_maha") {
    const std::vector<Frame3d> x = readPoints<Frame3d>(n);
    std::vector<Gaussian<Frame3d>> list;
    for (std::size_t i = 0; i < n; ++i) {
      list.push_back({x[i], Eigen::Matrix<double, 6, 6>::Identity() * (0.01 * static_cast<double>(i + 1))});
    }
    return writeEstimate(certifiedMaha(list, CovarianceAt::estimated));
  } else {
    return 2;
  }
  return 0;
}
