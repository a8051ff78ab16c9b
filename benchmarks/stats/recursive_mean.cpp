// The tables of docs/recursive_mean.md: how far the mean of a stream is from that of the same features in one batch, and
// what a feature costs.
#include "../inputs.hpp"

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>
#include <stats/recursive_mean.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

namespace {

using namespace liestat;

constexpr int trials = 200;

template <class M>
RecursiveMean<M> streamOf(const std::vector<M>& features) {
  RecursiveMean<M> stream;
  for (const M& x : features) stream.add(x);
  return stream;
}

template <class M>
void distances(const char* name) {
  constexpr int k = ManifoldTraits<M>::DoF;
  for (const double sigma : {0.03, 0.1, 0.3}) {
    std::printf("| %-18s | %4.2f |", name, sigma);
    for (const std::size_t n : {10u, 100u, 1000u}) {
      double squared_distance = 0, squared_ratio = 0, covariance_error = 0;
      for (unsigned trial = 1; trial <= trials; ++trial) {
        const auto features = bench::Inputs(trial).cloud<M>(n, sigma);
        const auto stream = streamOf(features);
        M batch_mean;
        SquareOf<M> C;
        if constexpr (Metric<M>) {
          const auto batch = mean(features);
          batch_mean = batch.mean, C = covarianceFromResiduals(batch);
        } else {
          const auto batch = groupMean(features);
          batch_mean = batch.mean, C = batch.covarianceFromResiduals();
        }
        const TangentOf<M> d = log(batch_mean, stream.mean());
        squared_distance += d.squaredNorm() / trials;
        squared_ratio += d.dot(detail::Cholesky<double, k>(C).template solve<1>(d)) / (k * trials);
        const SquareOf<M> P = frameTransport(batch_mean, stream.mean());
        covariance_error += (stream.covarianceFromResiduals() - P * C * P.transpose()).norm() / C.norm() / trials;
      }
      std::printf(" %7.1e, %7.1e, %7.1e |", std::sqrt(squared_distance), std::sqrt(squared_ratio), covariance_error);
    }
    std::printf("\n");
  }
}

template <class M>
void cost(const char* name) {
  const auto features = bench::Inputs().cloud<M>(1000, 0.1);
  double best = 1e9, sum = 0;
  for (int round = 0; round < 50; ++round) {
    const auto start = std::chrono::steady_clock::now();
    sum += static_cast<double>(streamOf(features).sum_of_weights());
    const std::chrono::duration<double, std::nano> time = std::chrono::steady_clock::now() - start;
    best = std::min(best, time.count() / 1000);
  }
  if (sum > 0) std::printf("| %-18s | %4.0f | %4zu |\n", name, best, sizeof(RecursiveMean<M>));
}

}  // namespace

int main() {
  std::printf("| manifold | spread | n = 10 | n = 100 | n = 1000 |\n| --- | --- | --- | --- | --- |\n");
  distances<Eigen::Vector3d>("R^3");
  distances<SO3d>("SO3");
  distances<S2d>("S2");
  distances<Frame3d>("Frame3");
  distances<NonOrientedFrame3d>("NonOrientedFrame3");
  distances<SE3d>("SE3");
  std::printf("\n| manifold | ns per feature | bytes |\n| --- | --- | --- |\n");
  cost<Eigen::Vector3d>("R^3");
  cost<SO3d>("SO3");
  cost<S2d>("S2");
  cost<Frame3d>("Frame3");
  cost<NonOrientedFrame3d>("NonOrientedFrame3");
  cost<SE3d>("SE3");
}
