// The Mahalanobis mean with its covariance, beside hand-written Gauss-Newton in Eigen alone. The time that is printed
// is that of one feature; the counter gives the iterations. Standard deviations around 0.2 rad (m), each measurement
// with a covariance of its own, tolerance 1e-12.
#include "../inputs.hpp"
#include "hand_written.hpp"

#include <lie/lie.hpp>
#include <stats/maha.hpp>

#include <Eigen/Cholesky>
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

namespace liestat::bench {
namespace {

/// A million frames with their covariances are half a gigabyte: the data of one benchmark live at a time.
template <Homogeneous M>
std::vector<Gaussian<M>> measurements(std::size_t n) {
  Inputs random;
  const M centre = random.feature<M>();
  std::vector<Gaussian<M>> data;
  data.reserve(n);
  constexpr int k = ManifoldTraits<M>::DoF;
  for (std::size_t i = 0; i < n; ++i) {
    SquareOf<M> covariance = random.covariance<k>(0.2);
    // Directions have no frame in which other covariances could be compared.
    if constexpr (ManifoldTraits<M>::Group::DoF != k) covariance = 0.04 * SquareOf<M>::Identity();
    const SquareOf<M> root = covariance.llt().matrixL();
    data.push_back({exp(centre, TangentOf<M>(root * random.normal<k>())), covariance});
  }
  return data;
}

void sizes(benchmark::internal::Benchmark* b) { b->Arg(100)->Arg(10000)->Arg(1000000); }

template <Homogeneous M, CovarianceAt at>
void maha(benchmark::State& state) {
  const auto data = measurements<M>(static_cast<std::size_t>(state.range(0)));
  int iterations = 0;
  while (state.KeepRunningBatch(state.range(0))) {
    const MahaResult<M> result = liestat::maha(data, at);
    iterations = result.iterations;
    benchmark::DoNotOptimize(result.covariance);
  }
  state.counters["iterations"] = iterations;
}

template <Homogeneous M, class Convert>
void handWritten(benchmark::State& state, Convert convert) {
  std::vector<decltype(convert(std::declval<M>()))> features;
  std::vector<SquareOf<M>> covariances;
  for (const Gaussian<M>& g : measurements<M>(static_cast<std::size_t>(state.range(0)))) {
    features.push_back(convert(g.mean));
    covariances.push_back(g.covariance);
  }
  int iterations = 0;
  while (state.KeepRunningBatch(state.range(0))) {
    const auto result = handWrittenMaha(features, covariances);
    iterations = result.iterations;
    benchmark::DoNotOptimize(result.covariance);
  }
  state.counters["iterations"] = iterations;
}

void handWrittenPoint(benchmark::State& state) {
  handWritten<Eigen::Vector3d>(state, [](const Eigen::Vector3d& x) { return x; });
}
void handWrittenRotation(benchmark::State& state) {
  handWritten<SO3d>(state, [](const SO3d& x) { return Eigen::Quaterniond(x.unit_quaternion()); });
}
void handWrittenFrame(benchmark::State& state) {
  handWritten<Frame3d>(state, [](const Frame3d& x) {
    return HandWrittenFrame{Eigen::Quaterniond(x.unit_quaternion()), Eigen::Vector3d(x.translation())};
  });
}

constexpr CovarianceAt measured = CovarianceAt::measured, estimated = CovarianceAt::estimated;
BENCHMARK(maha<Eigen::Vector3d, measured>)->Name("MAHA/point")->Apply(sizes);
BENCHMARK(handWrittenPoint)->Name("hand_written/point")->Apply(sizes);
BENCHMARK(maha<SO3d, measured>)->Name("MAHA/rotation")->Apply(sizes);
BENCHMARK(handWrittenRotation)->Name("hand_written/rotation")->Apply(sizes);
BENCHMARK(maha<Frame3d, measured>)->Name("MAHA/frame/measured")->Apply(sizes);
BENCHMARK(handWrittenFrame)->Name("hand_written/frame/measured")->Apply(sizes);
BENCHMARK(maha<Frame3d, estimated>)->Name("MAHA/frame/estimated")->Apply(sizes);
BENCHMARK(maha<SemiOrientedFrame3d, estimated>)->Name("MAHA/semi_oriented_frame/estimated")->Apply(sizes);
BENCHMARK(maha<NonOrientedFrame3d, estimated>)->Name("MAHA/non_oriented_frame/estimated")->Apply(sizes);
BENCHMARK(maha<S2d, measured>)->Name("MAHA/direction")->Apply(sizes);

}  // namespace
}  // namespace liestat::bench
