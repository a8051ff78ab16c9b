// The time per feature of a mean with its covariance, from ten features to more than the caches hold, beside reading the
// data once and, for rotations, beside a hand-written loop in Eigen alone. Prints CSV, ns per feature, which
// benchmarks/plot_sizes.sh draws. Spread 0.2 rad (m) in each coordinate.
#include "../inputs.hpp"
#include "hand_written.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>

#include <cstddef>
#include <cstdio>
#include <functional>
#include <vector>

namespace liestat::bench {
namespace {

int print() {
  constexpr double spread = 0.2;
  std::printf("# kernels use %s\n", name(instructionSet()));
  std::printf("n,read_rotations,rotations,directions,frames,poses_group_mean,rotations_by_hand\n");
  for (const std::size_t n :
       {10U, 30U, 100U, 300U, 1000U, 3000U, 10000U, 30000U, 100000U, 300000U, 1000000U, 4000000U}) {
    const std::vector<SO3d> rotations = Inputs().cloud<SO3d>(n, spread);
    const std::vector<S2d> directions = Inputs().cloud<S2d>(n, spread);
    const std::vector<Frame3d> frames = Inputs().cloud<Frame3d>(n, spread);
    const std::vector<SE3d> poses = Inputs().cloud<SE3d>(n, spread);
    std::vector<Eigen::Quaterniond> quaternions;
    quaternions.reserve(n);
    for (const SO3d& x : rotations) quaternions.emplace_back(x.unit_quaternion());
    const std::vector<double> ns = interleavedMedians(
        {[&] { keep(readOnce(rotations[0].data(), 4 * n)); }, [&] { keep(covarianceFromResiduals(mean(rotations))); },
         [&] { keep(covarianceFromResiduals(mean(directions))); }, [&] { keep(covarianceFromResiduals(mean(frames))); },
         [&] { keep(groupMean(poses).covarianceFromResiduals()); }, [&] { keep(handWrittenMean(quaternions)); }},
        n > 100000 ? 5 : 31, 1e-3);
    std::printf("%zu", n);
    for (const double t : ns) std::printf(",%.2f", t / static_cast<double>(n));
    std::printf("\n");
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
