// Mistakes of a user, one for each value of MISTAKE: run.sh shows that each is answered by one sentence.
#include <lie/lie.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>

#include <ranges>
#include <sstream>
#include <string>
#include <vector>

using namespace liestat;

int main() {
  const std::vector<SO3d> rotations(3);
  const std::vector<SE3d> poses(3);
  const std::vector<Gaussian<Frame3d>> frames(3);
  std::istringstream text("1 2 3");
#if MISTAKE == 0
  return static_cast<int>(mean(rotations).n + groupMean(poses).n + maha(frames, CovarianceAt::measured).n);
#elif MISTAKE == 1
  return mean(std::vector<int>(3)).iterations;
#elif MISTAKE == 2
  return mean(rotations, std::vector<std::string>(3)).iterations;
#elif MISTAKE == 3
  return mean(std::ranges::istream_view<int>(text)).iterations;
#elif MISTAKE == 4
  return mean(poses).iterations;
#elif MISTAKE == 5
  return maha(frames).iterations;
#elif MISTAKE == 6
  return maha(rotations).iterations;
#elif MISTAKE == 7
  return groupMean(std::vector<Frame3d>(3)).iterations;
#endif
}
