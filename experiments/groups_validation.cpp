#include <experiments/groups_validation.hpp>

#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/compare_groups.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>

namespace liestat::experiments {
namespace {

struct GroupTrial {
  bool compared = false, means = false, means_if_alike = false, dispersions = false;
};

/// Standard deviations of the groups along each axis, and sizes in multiples of max(10, 4 d).
struct GroupCell {
  const char* name;
  std::vector<double> deviations;
  std::vector<std::size_t> sizes;
  std::size_t least;
  GroupTrial (*trial)(const GroupCell&, std::uint64_t seed, CounterRng&);
  double away = 0;  ///< of the last group's mean, standard deviations of the first one's mean
};

template <class M>
GroupTrial comparedOnce(const GroupCell& cell, std::uint64_t seed, CounterRng& rng) {
  std::vector<std::vector<M>> groups(cell.deviations.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const double shift = g + 1 == groups.size() ? cell.away : 0;
    const M centre = exp(
        ManifoldTraits<M>::origin(),
        TangentOf<M>(shift * cell.deviations[0] / std::sqrt(static_cast<double>(cell.least)) * TangentOf<M>::Unit(0)));
    for (std::size_t i = 0; i < cell.sizes[g] * cell.least; ++i) {
      groups[g].push_back(exp(centre, TangentOf<M>(cell.deviations[g] * rng.normalVector<ManifoldTraits<M>::DoF>())));
    }
  }
  // One seed's 199 draws would have one error in all trials.
  const GroupComparison found = compareGroups(groups, {.resamples = 199, .seed = seed});
  return {found.ok(), found.means.p <= 0.05, found.means_if_alike.p < 0.05, found.dispersions.p <= 0.05};
}

template <class M>
GroupCell cellOf(const char* name, std::vector<double> deviations, std::vector<std::size_t> sizes, double away = 0) {
  constexpr int d = ManifoldTraits<M>::DoF;
  return {name, std::move(deviations), std::move(sizes), static_cast<std::size_t>(std::max(10, 4 * d)), comparedOnce<M>,
          away};
}

std::vector<GroupCell> groupCells() {
  using Point = Eigen::Vector3d;
  return {cellOf<Point>("points, two groups", {1, 1}, {1, 1}),
          cellOf<SO2d>("headings, 0.5 rad", {0.5, 0.5}, {1, 1}),
          cellOf<S2d>("directions, 0.3 rad", {0.3, 0.3}, {1, 1}),
          cellOf<S2d>("directions, 0.3 and 0.1 rad", {0.3, 0.1}, {1, 1}),
          cellOf<S2d>("directions, 0.3 and 0.1 rad, the second thrice as many", {0.3, 0.1}, {1, 3}),
          cellOf<SO3d>("rotations, 0.3 rad", {0.3, 0.3}, {1, 1}),
          cellOf<SO3d>("rotations, 0.6 rad", {0.6, 0.6}, {1, 1}),
          cellOf<SO3d>("rotations, 0.3 and 0.1 rad, the second thrice as many", {0.3, 0.1}, {1, 3}),
          cellOf<Frame3d>("frames, 0.2 rad and m", {0.2, 0.2}, {1, 1}),
          cellOf<Frame3d>("frames, 0.3 and 0.1 rad and m", {0.3, 0.1}, {1, 1}),
          cellOf<S2d>("directions, three groups", {0.3, 0.3, 0.3}, {1, 1, 1}),
          cellOf<SO3d>("rotations, three groups", {0.3, 0.3, 0.3}, {1, 1, 1}),
          cellOf<SO3d>("rotations, three groups, 0.3, 0.1 and 0.1 rad", {0.3, 0.1, 0.1}, {1, 1, 1}),
          cellOf<SO3d>("rotations, five groups", {0.3, 0.3, 0.3, 0.3, 0.3}, {1, 1, 1, 1, 1}),
          cellOf<Point>("points, means 4 standard errors apart", {1, 1}, {1, 1}, 4)};
}

}  // namespace

std::vector<GroupRow> validateGroups(const GroupsValidation& validation, const RunProgress& progress) {
  const std::vector<GroupCell> cells = groupCells();
  std::vector<CellSize> sizes;
  for (const GroupCell& cell : cells) {
    double features = 0;
    for (const std::size_t size : cell.sizes) features += static_cast<double>(size * cell.least);
    sizes.push_back({validation.run.trials, features});
  }
  CellRun run(validation.run, sizes, progress);
  std::vector<GroupRow> rows;
  for (const GroupCell& cell : cells) {
    const auto stream = static_cast<std::uint32_t>(&cell - cells.data()) + 1;
    const std::vector<GroupTrial> trials = run.outcomes([&](std::uint64_t number) {
      CounterRng rng(validation.run.seed, number, stream);
      return cell.trial(cell, number + 1, rng);
    });
    if (run.ended()) continue;
    const bool alike = std::count(cell.deviations.begin(), cell.deviations.end(), cell.deviations[0]) ==
                       static_cast<std::ptrdiff_t>(cell.deviations.size());
    const auto levelOf = [](const char* name, bool promised) {
      return promised ? Rate{name, 0, 0, 0.04, 0.06} : Rate{name};
    };
    Rate compared{"compared", 0, 0, 0.99, 1}, means = levelOf("means", cell.away == 0);
    Rate if_alike = levelOf("means if alike", alike && cell.away == 0), dispersions = levelOf("dispersions", alike);
    for (const GroupTrial& trial : trials) {
      compared.add(trial.compared);
      if (trial.compared) {
        means.add(trial.means), if_alike.add(trial.means_if_alike), dispersions.add(trial.dispersions);
      }
    }
    rows.push_back({cell.name, cell.least, trials.size(), {compared, means, if_alike, dispersions}});
  }
  judgeRates(rows);
  return rows;
}

}  // namespace liestat::experiments
