// Cost of the mean and its covariance beside the same by hand in Eigen alone, in turns: the README's table. Prints
// Markdown. State the spread, the tolerance and the iterations with any ratio.
#include "../inputs.hpp"
#include "hand_written.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>

#include <cstdio>
#include <functional>
#include <vector>

namespace liestat::bench {
namespace {

constexpr double spread = 0.2;  // standard deviation in each coordinate, rad or m

/// `ours` of the features M with its number of steps, `run` of the same converted.
template <class M, class Convert, class Ours, class Run>
void row(const char* name, std::size_t n, const Convert& convert, const Ours& mean_of, const Run& run) {
  const std::vector<M> data = Inputs().cloud<M>(n, spread);
  std::vector<decltype(convert(data[0]))> converted;
  converted.reserve(n);
  for (const M& x : data) converted.push_back(convert(x));
  int ours = 0, theirs = 0;
  const std::vector<double> ns = interleavedMedians(
      {[&] { ours = mean_of(data); },
       [&] {
         const auto result = run(converted);
         keep(result);
         theirs = result.iterations;
       },
       [&] { keep(readOnce(reinterpret_cast<const double*>(data.data()), n * sizeof(M) / sizeof(double))); }},
      n > 100000 ? 7 : 51, 1e-3);
  const double size = static_cast<double>(n);
  std::printf("| %-13s | %7zu | %10.1f | %5d | %10.1f | %5d | %6.1f | %5.1f |\n", name, n, ns[0] / size, ours,
              ns[1] / size, theirs, ns[1] / ns[0], ns[0] / ns[2]);
  std::fflush(stdout);
}
template <Metric M, class Convert, class Run>
void row(const char* name, std::size_t n, const Convert& convert, const Run& run) {
  row<M>(
      name, n, convert,
      [](const std::vector<M>& data) {
        const MeanResult<M> result = mean(data);
        keep(covarianceFromResiduals(result));
        return result.iterations;
      },
      run);
}

HandWrittenFrame toHandWritten(const Eigen::Matrix<double, 7, 1>& p) {
  return {Eigen::Quaterniond(p.head<4>()), p.tail<3>()};
}

int print() {
  using Eigen::Quaterniond, Eigen::Vector3d;
  const auto frame = [](const auto& x) { return toHandWritten(x.params()); };
  const auto loop = [](const auto& data) { return handWrittenMean(data); };
  const Quaterniond z[] = {Quaterniond(0, 0, 0, 1)};
  const Quaterniond all[] = {Quaterniond(0, 1, 0, 0), Quaterniond(0, 0, 1, 0), Quaterniond(0, 0, 0, 1)};

  std::printf("Mean and covariance, ns a feature, beside a careful fixed-point loop in Eigen\n");
  std::printf("alone. Spread %.1f rad (m) a coordinate, both to a step of 1e-12. Reads: the\n", spread);
  std::printf("time by that of reading the data once. Kernels use %s.\n\n", name(instructionSet()));
  std::printf("| features      |       n | liestat ns | steps | by hand ns | steps | faster | reads |\n");
  std::printf("|---------------|--------:|-----------:|------:|-----------:|------:|-------:|------:|\n");
  for (const std::size_t n : {std::size_t{100}, std::size_t{10000}, std::size_t{1000000}, std::size_t{4000000}}) {
    row<Vector3d>(
        "points", n, [](const Vector3d& x) { return x; }, loop);
    row<SO3d>(
        "rotations", n, [](const SO3d& x) { return Quaterniond(x.unit_quaternion()); }, loop);
    row<Frame3d>("frames", n, frame, loop);
    row<SemiOrientedFrame3d>("semi-oriented", n, frame, [&](const auto& d) { return handWrittenMean(d, z); });
    row<NonOrientedFrame3d>("non-oriented", n, frame, [&](const auto& d) { return handWrittenMean(d, all); });
    row<S2d>(
        "directions", n, [](const S2d& x) { return Vector3d(x.unit_vector()); },
        [](const auto& d) { return handWrittenMeanDirection(d); });
    row<SE3d>(
        "SE3, group", n, frame,
        [](const std::vector<SE3d>& data) {
          const GroupMeanResult<SE3d> result = groupMean(data);
          keep(result.covarianceFromResiduals());
          return result.iterations;
        },
        [](const auto& d) { return handWrittenBarycentre(d); });
    row<SE2d>(
        "SE2, group", n,
        [](const SE2d& x) {
          return HandWrittenMotion{x.unit_complex(), x.translation()};
        },
        [](const std::vector<SE2d>& data) {
          const GroupMeanResult<SE2d> result = groupMean(data);
          keep(result.covarianceFromResiduals());
          return result.iterations;
        },
        [](const auto& d) { return handWrittenBarycentre(d); });
  }
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
