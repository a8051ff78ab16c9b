// The sums of one pass of the Fréchet mean over the data.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/packing.hpp>

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

namespace liestat::detail {

/// The sums that one pass over the data returns at a candidate mean.
template <Homogeneous M>
struct MeanSums {
  ScalarOf<M> cost = 0;
  TangentOf<M> gradient = TangentOf<M>::Zero();  ///< Σ p_i W z_i, minus the gradient of C
  SquareOf<M> hessian = SquareOf<M>::Zero();
  double weight = 0;

  void operator+=(const MeanSums& other) {
    cost += other.cost;
    gradient += other.gradient;
    hessian += other.hessian;
    weight += other.weight;
  }
};

/// Further sums that the covariances need, at the mean.
template <Homogeneous M>
struct ScatterSums {
  SquareOf<M> scatter = SquareOf<M>::Zero(), squared = SquareOf<M>::Zero();
  ScalarOf<M> largest = 0, smallest_gap = std::numeric_limits<ScalarOf<M>>::infinity();
  ScalarOf<M> largest_angle = 0;  ///< largest angle of the compact part, if the traits name it
  double fourth = 0;              ///< Σ p θ⁴ of those angles

  void operator+=(const ScatterSums& other) {
    scatter += other.scatter;
    squared += other.squared;
    largest = std::max(largest, other.largest);
    smallest_gap = std::min(smallest_gap, other.smallest_gap);
    largest_angle = std::max(largest_angle, other.largest_angle);
    fourth += other.fourth;
  }
};

/// The sums of one pass over the data; the scatter only where it is asked for.
template <Homogeneous M>
struct MeanPass {
  MeanSums<M> sums;
  ScatterSums<M> scatter;
  bool has_scatter = false;

  void operator+=(const MeanPass& other) {
    sums += other.sums;
    scatter += other.scatter;
  }
  std::vector<double> pack() const {
    return packed(sums.cost, sums.gradient, sums.hessian, sums.weight, scatter.scatter, scatter.squared,
                  scatter.largest, scatter.smallest_gap, scatter.largest_angle, scatter.fourth);
  }
  static MeanPass unpack(std::span<const double> list) {
    MeanPass p;
    unpackInto(list, p.sums.cost, p.sums.gradient, p.sums.hessian, p.sums.weight, p.scatter.scatter, p.scatter.squared,
               p.scatter.largest, p.scatter.smallest_gap, p.scatter.largest_angle, p.scatter.fourth);
    return p;
  }
};

}  // namespace liestat::detail
