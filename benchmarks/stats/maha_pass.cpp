// One pass of the Mahalanobis mean over the measurements by kernels, beside the same sums by the manifold's own
// operations, in turns. Prints Markdown, ns a measurement.
#include "../inputs.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/maha.hpp>

#include <Eigen/Cholesky>
#include <cstdio>
#include <vector>

namespace liestat::bench {
namespace {

template <Homogeneous M>
void row(const char* name, std::size_t n) {
  using S = ScalarOf<M>;
  constexpr int k = ManifoldTraits<M>::DoF;
  Inputs random;
  const M centre = ManifoldTraits<M>::expOrigin(TangentOf<M>(random.normal<k>().template cast<S>()));
  std::vector<Gaussian<M>> data;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Matrix<double, k, k> covariance = random.covariance<k>(0.2);
    const Eigen::Matrix<double, k, 1> noise = covariance.llt().matrixL() * random.normal<k>();
    data.push_back({exp(centre, TangentOf<M>(noise.template cast<S>())), covariance.template cast<S>()});
  }
  using Problem = detail::MahaProblem<M, std::vector<Gaussian<M>>>;
  Problem kernels{data, CovarianceAt::measured, false}, own{data, CovarianceAt::measured, false};
  own.by_kernels = false;
  for (const Gaussian<M>& g : data) {
    const detail::Cholesky<S, k> factor(g.covariance);
    kernels.append(g.mean, factor), own.append(g.mean, factor);
  }
  const std::vector<double> ns = interleavedMedians({[&] { keep(kernels.evaluate(SerialExecutor{}, centre)); },
                                                     [&] { keep(own.evaluate(SerialExecutor{}, centre)); }},
                                                    51, 1e-3);
  const double size = static_cast<double>(n);
  std::printf("| %-18s | %7zu | %8.2f | %14.1f | %6.1f |\n", name, n, ns[0] / size, ns[1] / size, ns[1] / ns[0]);
  std::fflush(stdout);
}

int print() {
  std::printf("Kernels use %s.\n\n", name(instructionSet()));
  std::printf("| measurements       |       n | liestat  | own operations | faster |\n");
  std::printf("|--------------------|--------:|---------:|---------------:|-------:|\n");
  const std::size_t n = 10000;
  row<Eigen::Vector3d>("points", n);
  row<SO2d>("plane rotations", n);
  row<Frame2d>("plane frames", n);
  row<S2d>("directions", n);
  row<SO3d>("rotations", n);
  row<Frame3d>("frames", n);
  row<SemiOrientedFrame3d>("semi-oriented", n);
  row<NonOrientedFrame3d>("non-oriented", n);
  row<Eigen::Vector3f>("points, float", n);
  row<SO2f>("plane rot., float", n);
  row<Frame2f>("plane fr., float", n);
  row<S2f>("directions, float", n);
  row<SO3f>("rotations, float", n);
  row<Frame3f>("frames, float", n);
  row<SemiOrientedFrame3f>("semi-or., float", n);
  row<NonOrientedFrame3f>("non-or., float", n);
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
