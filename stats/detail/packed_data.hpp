// Data of a search, each a point of its space with a weight, as a list or grouped into a tree of bins. What the bins are
// for is said in stats/detail/branch_and_bound.hpp.
#pragma once

#include <stats/detail/search_space.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ranges>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Data in the frame of the base: a list, or the tree of groupedData.
template <class Space>
struct PackedData {
  struct Item {
    typename Space::Point point;
    double weight = 0;
    double radius = 0;                 ///< bins: largest distance of the data from `point`
    double scatter = 0;                ///< bins: Σ p d²(point, x)
    double offset = 0;                 ///< bins: |Σ p log(point, x)|, next to nothing since `point` is the mean
    std::uint32_t begin = 0, end = 0;  ///< bins: the items that the bin consists of
  };
  Space space;
  std::vector<Item> items;
  std::size_t roots = 0;  ///< the first items, which stand for all the data

  void add(const typename Space::Point& point, double weight) {
    items.push_back({point, weight, 0, 0, 0, 0, 0});
    roots = items.size();
  }
};

/// The compact parts of features of positive weight in the frame of y.
template <class Space, Metric M, class R, class W>
PackedData<Space> pack(const Space& space, const R& samples, const W& weights, const M& y) {
  PackedData<Space> data{space, {}, 0};
  const std::size_t n = std::ranges::size(samples);
  data.items.reserve(n);
  const auto to_y = ManifoldTraits<M>::placement(y).inverse();
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (p > 0) {
      data.add(relativePoint<Space>(to_y, M(samples[i])), p);
    }
  }
  return data;
}

/// The data as a tree of bins: cubes of the chart with sides from 0.4 rad, halved until a few data are left.
template <class Space>
PackedData<Space> groupedData(const PackedData<Space>& data) {
  using Item = typename PackedData<Space>::Item;
  constexpr int N = Space::dimension, coarsest = 4, finest = 10;
  constexpr std::uint32_t few = 8;
  // Position along a space-filling curve: the bins of each level are runs of it.
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
  order.reserve(data.items.size());
  for (std::size_t i = 0; i < data.items.size(); ++i) {
    const typename Space::Chart v = data.space.toChart(data.items[i].point);
    std::uint64_t key = 0;
    std::array<std::uint32_t, static_cast<std::size_t>(N)> cell;
    for (int k = 0; k < N; ++k) {
      const double x = std::ldexp((v[k] + pi) / (2 * pi), finest);
      cell[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(std::clamp(x, 0.0, std::ldexp(1.0, finest) - 1));
    }
    for (int bit = finest - 1; bit >= 0; --bit) {
      for (const std::uint32_t c : cell) key = key << 1 | (c >> bit & 1);
    }
    order.emplace_back(key, static_cast<std::uint32_t>(i));
  }
  std::sort(order.begin(), order.end());

  struct Run {
    std::uint32_t begin, end;
    int level;
  };
  std::vector<Run> runs;
  const auto split = [&](std::uint32_t begin, std::uint32_t end, int level) {
    const int shift = N * (finest - level);
    for (std::uint32_t first = begin; first < end;) {
      std::uint32_t last = first + 1;
      while (last < end && order[last].first >> shift == order[first].first >> shift) ++last;
      runs.push_back({first, last, level});
      first = last;
    }
  };
  PackedData<Space> tree{data.space, {}, 0};
  split(0, static_cast<std::uint32_t>(order.size()), coarsest);
  tree.roots = runs.size();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> parts;  // each bin's; first == second: its data themselves
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Run run = runs[i];
    const auto first = static_cast<std::uint32_t>(runs.size());
    if (run.end - run.begin > few && run.level < finest) split(run.begin, run.end, run.level + 1);
    parts.emplace_back(first, static_cast<std::uint32_t>(runs.size()));
  }
  const auto bins = static_cast<std::uint32_t>(runs.size());
  tree.items.reserve(bins + order.size());
  for (std::uint32_t i = 0; i < bins; ++i) {
    const Run run = runs[i];
    Item bin;
    bin.begin = parts[i].first, bin.end = parts[i].second;
    if (bin.begin == bin.end) bin.begin = bins + run.begin, bin.end = bins + run.end;
    typename Space::Chart start = Space::Chart::Zero();
    for (std::uint32_t k = run.begin; k < run.end; ++k) {
      const Item& x = data.items[order[k].second];
      start += x.weight * data.space.toChart(x.point);
      bin.weight += x.weight;
    }
    bin.point = Space::fromChart(start / bin.weight);
    // One step of eq. (4), which contracts by radius²/18, then the sums about the mean.
    for (const bool last : {false, true}) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::uint32_t k = run.begin; k < run.end; ++k) {
        const Item& x = data.items[order[k].second];
        const Sighting s = data.space.see(bin.point, x.point);
        sum += x.weight * s.z;
        if (last) {
          bin.radius = std::max(bin.radius, s.angle);
          bin.scatter += x.weight * s.angle * s.angle;
        }
      }
      if (last) bin.offset = sum.norm();
      if (!last) bin.point = Space::exp(bin.point, sum / bin.weight);
    }
    tree.items.push_back(bin);
  }
  for (const auto& [key, i] : order) tree.items.push_back(data.items[i]);
  return tree;
}

}  // namespace liestat::detail
