// Two groups of rotations with different dispersions: is there one mean? And the same for pairs, where a common error
// cancels.
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/compare_groups.hpp>
#include <stats/random.hpp>

#include <iostream>
#include <vector>

using namespace liestat;

int main() {
  CounterRng rng(1);
  const auto turned = [&](double degrees, double sd) {
    return SO3d::exp(Eigen::Vector3d(0, 0, degrees * units::degree)) * SO3d::exp(sd * rng.normalVector<3>());
  };
  std::vector<SO3d> control, treated;
  for (int i = 0; i < 20; ++i) control.push_back(turned(0, 0.1));
  for (int i = 0; i < 40; ++i) treated.push_back(turned(10, 0.05));
  const GroupComparison found = compareGroups(std::vector{control, treated});
  std::cout << found.verdict().text << "\ndifference " << found.pairs[0].difference.transpose() / units::degree
            << " degrees, sd " << found.pairs[0].covariance.diagonal().cwiseSqrt().transpose() / units::degree << '\n';

  // The same objects before and after a turn by two degrees: far less than they differ from each other.
  std::vector<SO3d> before, after;
  for (int i = 0; i < 20; ++i) {
    before.push_back(turned(0, 0.2));
    after.push_back(before.back() * SO3d::exp(Eigen::Vector3d(0.035, 0, 0) + 0.01 * rng.normalVector<3>()));
  }
  const GroupComparison paired = comparePairs(before, after), apart = compareGroups(std::vector{before, after});
  std::cout << "as pairs: " << paired.verdict().text << "\nas groups: " << apart.verdict().text << '\n';
  return found.verdict().isNo() && paired.verdict().isNo() && apart.verdict().isYes() ? 0 : 1;
}
