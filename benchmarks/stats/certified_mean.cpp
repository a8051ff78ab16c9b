// The cost of a mean's certificates: the time of certifiedMean over that of mean with its covariance, in turns.
// Prints Markdown, µs a call. Spread 0.2 rad (m) in each coordinate.
#include "../inputs.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/certified_mean.hpp>

#include <cstddef>
#include <cstdio>
#include <functional>
#include <vector>

namespace liestat::bench {
namespace {

template <Metric M>
void row(const char* name, std::size_t n) {
  const std::vector<M> data = Inputs().cloud<M>(n, 0.2);
  const std::vector<double> weights(n, 1.0);
  const std::vector<double> ns = interleavedMedians(
      {[&] { keep(covarianceFromResiduals(mean(data))); }, [&] { keep(certifiedMean(data)); },
       [&] { keep(covarianceFromResiduals(mean(data, weights))); }, [&] { keep(certifiedMean(data, weights)); }},
      n > 100000 ? 5 : 31, 1e-3);
  std::printf("| %-13s | %7zu | %10.2f | %12.2f | %5.2f | %14.2f | %5s |\n", name, n, ns[0] / 1e3, ns[1] / 1e3,
              ns[1] / ns[0], ns[3] / ns[2], liestat::name(certifiedMean(data).status));
  std::fflush(stdout);
}

int print() {
  std::printf("Spread 0.2 rad (m) a coordinate. Kernels use %s.\n\n", name(instructionSet()));
  std::printf("| features      |       n |    mean µs | certified µs | ratio | ratio, weights | status |\n");
  std::printf("|---------------|--------:|-----------:|-------------:|------:|---------------:|--------|\n");
  for (const std::size_t n : {std::size_t{10}, std::size_t{100}, std::size_t{10000}, std::size_t{1000000}}) {
    row<Eigen::Vector3d>("points", n);
    row<SO2d>("angles", n);
    row<S2d>("directions", n);
    row<SO3d>("rotations", n);
    row<Frame3d>("frames", n);
    row<SemiOrientedFrame3d>("semi-oriented", n);
    row<NonOrientedFrame3d>("non-oriented", n);
  }
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
