// Calls the library with doubles from standard input and writes the results' doubles to standard output:
//   reference OPERATION ROWS
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
    for (std::size_t i = 0; i < n; ++i) write(SO3d::exp(read<3>()).params());
  } else if (operation == "se3_exp") {
    for (std::size_t i = 0; i < n; ++i) write(SE3d::exp(read<6>()).params());
  } else if (operation == "se3_log") {
    for (const SE3d& x : readPoints<SE3d>(n)) write(x.log());
  } else if (operation == "se3_left_jacobian") {
    for (std::size_t i = 0; i < n; ++i) write(SE3d::leftJacobian(read<6>()));
  } else if (operation == "se3_square") {
    for (const SE3d& x : readPoints<SE3d>(n)) write((x * x).params());
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
