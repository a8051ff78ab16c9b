// How measurements are dealt out to two halves, for stats/split_validation.hpp.
#pragma once

#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Rows dealt out to two halves.
struct Halves {
  std::vector<std::size_t> first, second;
};

/// Deals `units` groups out to two halves at random, as many to each as to the other; true: the first half.
inline std::vector<char> dealInHalves(std::size_t units, CounterRng& rng) {
  std::vector<std::size_t> order(units);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t i = units; i > 1; --i) {
    const auto j = static_cast<std::size_t>(rng.uniform() * static_cast<double>(i));
    std::swap(order[i - 1], order[std::min(j, i - 1)]);
  }
  std::vector<char> is_first(units, 0);
  for (std::size_t i = 0; i < units / 2; ++i) is_first[order[i]] = 1;
  return is_first;
}

/// Rows in the order of time, each with the block that it belongs to.
class Timeline {
 public:
  /// Without times the rows are in order already.
  Timeline(std::size_t n, std::size_t blocks, const std::vector<double>& times) : rows_(n), blocks_(blocks) {
    std::iota(rows_.begin(), rows_.end(), std::size_t{0});
    if (times.empty()) return;
    std::stable_sort(rows_.begin(), rows_.end(), [&](std::size_t a, std::size_t b) { return times[a] < times[b]; });
  }
  std::size_t row(std::size_t position) const { return rows_[position]; }
  std::size_t blockOf(std::size_t position) const { return position * blocks_ / rows_.size(); }
  Halves halves(const std::vector<char>& is_first, bool by_blocks) const {
    Halves halves;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const bool first = is_first[by_blocks ? blockOf(i) : i] != 0;
      (first ? halves.first : halves.second).push_back(rows_[i]);
    }
    return halves;
  }

 private:
  std::vector<std::size_t> rows_;
  std::size_t blocks_;
};

/// Degrees of freedom of the mean over the splits of the squared distance, per dimension, by Satterthwaite:
/// 1/tr((M D)²) for the mean form M = Σ a aᵀ/(c S), where a deals the units' errors of variances D = diag(1/w) out to
/// the halves and c = aᵀ D a.
inline double dealtDegreesOfFreedom(const std::vector<double>& w, const std::vector<std::vector<char>>& deals) {
  const auto n = static_cast<Eigen::Index>(w.size());
  const Eigen::VectorXd weight = Eigen::Map<const Eigen::VectorXd>(w.data(), n);
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(n, n);
  for (const std::vector<char>& is_first : deals) {
    Eigen::VectorXd sign(n);
    for (Eigen::Index i = 0; i < n; ++i) sign[i] = is_first[static_cast<std::size_t>(i)] != 0 ? 1 : 0;
    const double first = weight.dot(sign), second = weight.sum() - first;
    const Eigen::VectorXd a = (sign * (1 / first + 1 / second)).array() - 1 / second;
    const Eigen::VectorXd scaled = weight.cwiseSqrt().cwiseProduct(a);  // D^(1/2) times the errors' weights
    form += scaled * scaled.transpose() / ((1 / first + 1 / second) * static_cast<double>(deals.size()));
  }
  return 1 / form.squaredNorm();
}

}  // namespace liestat::detail
