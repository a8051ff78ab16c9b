// The mean with its covariance, LSQ and WLSQ, beside hand-written loops in Eigen alone. The time that is printed is
// that of one feature; the counter gives the iterations. Spread 0.2 rad (m) in each coordinate, tolerance 1e-12.
#include "../inputs.hpp"
#include "hand_written.hpp"

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/mean.hpp>

#include <benchmark/benchmark.h>

#include <string>
#include <utility>
#include <vector>

namespace liestat::bench {
namespace {

constexpr double spread = 0.2;

/// Registers run(data), data = make(n), for the sizes of the tables. Data live as long as the benchmark runs.
template <class Make, class Run>
void sizes(const std::string& name, Make make, Run run) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [make, run](benchmark::State& state) {
                                 const auto data = make(static_cast<std::size_t>(state.range(0)));
                                 int iterations = 0;
                                 while (state.KeepRunningBatch(state.range(0))) {
                                   const auto result = run(data);
                                   iterations = result.first;
                                   benchmark::DoNotOptimize(result.second);
                                 }
                                 state.counters["iterations"] = iterations;
                               })
      ->Arg(100)
      ->Arg(10000)
      ->Arg(1000000);
}

template <Metric M>
void suite(const std::string& feature) {
  sizes(
      "LSQ/" + feature, [](std::size_t n) { return Inputs().cloud<M>(n, spread); },
      [](const std::vector<M>& data) {
        const MeanResult<M> result = mean(data);
        return std::pair(result.iterations, covarianceFromResiduals(result));
      });
  sizes(
      "WLSQ/" + feature,
      [](std::size_t n) {
        std::pair data(Inputs().cloud<M>(n, spread), std::vector<double>(n));
        Inputs random(2);
        for (double& p : data.second) p = 0.1 + random.normal<1>().squaredNorm();
        return data;
      },
      [](const auto& data) {
        const MeanResult<M> result = mean(data.first, data.second);
        return std::pair(result.iterations, covarianceFromResiduals(result));
      });
}

/// A hand-written loop over what convert(feature) gives.
template <Metric M, class Convert, class Run>
void handWritten(const std::string& feature, Convert convert, Run run) {
  sizes(
      "hand_written/" + feature,
      [convert](std::size_t n) {
        std::vector<decltype(convert(std::declval<M>()))> data;
        data.reserve(n);
        for (const M& x : Inputs().cloud<M>(n, spread)) data.push_back(convert(x));
        return data;
      },
      [run](const auto& data) {
        const auto result = run(data);
        return std::pair(result.iterations, result.covariance);
      });
}

HandWrittenFrame toHandWritten(const Eigen::Matrix<double, 7, 1>& p) {
  return {Eigen::Quaterniond(p.head<4>()), p.tail<3>()};
}

[[maybe_unused]] const bool registered = [] {
  using Eigen::Quaterniond, Eigen::Vector3d;
  const auto frame = [](const auto& x) { return toHandWritten(x.params()); };
  const Quaterniond about_z[] = {Quaterniond(0, 0, 0, 1)};
  const Quaterniond about_all[] = {Quaterniond(0, 1, 0, 0), Quaterniond(0, 0, 1, 0), Quaterniond(0, 0, 0, 1)};

  suite<Vector3d>("point");
  handWritten<Vector3d>(
      "point", [](const Vector3d& x) { return x; }, [](const auto& data) { return handWrittenMean(data); });
  suite<SO3d>("rotation");
  handWritten<SO3d>(
      "rotation", [](const SO3d& x) { return Quaterniond(x.unit_quaternion()); },
      [](const auto& data) { return handWrittenMean(data); });
  suite<Frame3d>("frame");
  handWritten<Frame3d>("frame", frame, [](const auto& data) { return handWrittenMean(data); });
  suite<SemiOrientedFrame3d>("semi_oriented_frame");
  handWritten<SemiOrientedFrame3d>("semi_oriented_frame", frame,
                                   [=](const auto& data) { return handWrittenMean(data, about_z); });
  suite<NonOrientedFrame3d>("non_oriented_frame");
  handWritten<NonOrientedFrame3d>("non_oriented_frame", frame,
                                  [=](const auto& data) { return handWrittenMean(data, about_all); });
  suite<S2d>("direction");
  handWritten<S2d>(
      "direction", [](const S2d& x) { return Vector3d(x.unit_vector()); },
      [](const auto& data) { return handWrittenMeanDirection(data); });
  suite<Product<SO3d, Vector3d>>("rotation_with_point");
  suite<Product<SO3d, SO3d>>("two_rotations");
  suite<Product<Frame3d, S2d>>("frame_with_direction");
  return true;
}();

}  // namespace
}  // namespace liestat::bench
