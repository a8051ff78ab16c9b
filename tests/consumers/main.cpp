// A newcomer's first program, built in each way that the README offers.
#include <Eigen/Core>
#include <cstdio>
#include <lie/so3.hpp>

int main() {
  const Eigen::Vector3d v(0.1, -0.2, 0.3);
  const double error = (liestat::SO3d::exp(v).log() - v).norm();
  std::printf("log(exp(v)) - v: %g\n", error);
  return error < 1e-15 ? 0 : 1;
}
