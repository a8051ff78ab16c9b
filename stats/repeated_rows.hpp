// Rows that stand in the data more often than once: a covariance counts each as a measurement of its own. (Needs Eigen
// alone.)
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

/// Exactly equal rows, looked for with a thousand rows spread over the data.
struct RepeatedRows {
  double copies = 0;     ///< the mean number of other rows that are equal to a row
  bool matters = false;  ///< true if there are more of them than a grid that values are rounded to explains

  std::string inWords() const {
    const double tenths = std::round(10 * copies);
    return "rows are repeated, on average each by " + std::to_string(static_cast<int>(tenths) / 10) + "." +
           std::to_string(static_cast<int>(tenths) % 10) + " others that are equal to the last digit";
  }
};

namespace detail {

/// The number of equal pairs that a grid explains, from different rows: these leave no pair nearer than its step, and are
/// about as many per volume at short distances. The larger one of that by distances and that by each column's step.
inline double pairsByGrid(Eigen::MatrixXd rows, int dof) {
  const Eigen::Index m = rows.rows();
  const double pairs = 0.5 * static_cast<double>(m) * static_cast<double>(m);
  double by_columns = pairs;
  for (Eigen::Index k = 0; k < rows.cols(); ++k) {
    Eigen::VectorXd column = rows.col(k);
    const double sd = std::sqrt((column.array() - column.mean()).square().mean());
    if (!(sd > 0)) continue;
    rows.col(k) /= sd, column /= sd;
    std::sort(column.begin(), column.end());
    double step = std::numeric_limits<double>::infinity();
    // Differences of rounding are none.
    for (Eigen::Index i = 1; i < m; ++i) {
      const double difference = column[i] - column[i - 1];
      if (difference > 1e-12) step = std::min(step, difference);
    }
    // Two normal numbers of variance one are within a cell with the probability step/(2√π); tails do not count.
    const double middle = (column[3 * m / 4] - column[m / 4]) / 1.349;
    by_columns *= std::min(1.0, step / (3.545 * (middle > 0 ? std::min(1.0, middle) : 1)));
  }
  std::vector<double> squares;
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double square = (rows.row(i) - rows.row(j)).squaredNorm();
      if (square > 1e-24) squares.push_back(square);
    }
  }
  if (squares.empty()) return std::numeric_limits<double>::infinity();
  const std::size_t rank = std::min(squares.size(), static_cast<std::size_t>(m)) - 1;
  std::nth_element(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(rank), squares.end());
  const double radius = (1 + 1e-9) * squares[rank];
  const double step = *std::min_element(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(rank) + 1);
  const auto within = std::count_if(squares.begin(), squares.end(), [&](double s) { return s <= radius; });
  // A cell's volume over that of the ball.
  const double d = dof, ball = std::pow(3.14159265358979, 0.5 * d) / std::tgamma(0.5 * d + 1);
  return std::max(by_columns, static_cast<double>(within) * std::pow(step / radius, 0.5 * d) / ball);
}

}  // namespace detail

/// Looks for repeated rows among n ones on a manifold of `dof` dimensions; row(i) is the i-th,
/// an Eigen vector. Of measurements without a grid each row once too often is found from twenty rows on; on a grid,
/// where chance repeats a tenth of the rows, three times as many pairs as chance has. n operations.
template <class RowAt>
RepeatedRows repeatedRows(std::size_t n, int dof, const RowAt& row) {
  constexpr std::size_t most = 1000, bits = 1U << 16U;
  constexpr std::uint64_t rest = std::uint64_t{1} << 48U;
  constexpr double min_copies = 0.1, min_pairs = 5;
  constexpr std::size_t min_different = 8;
  if (static_cast<double>(n) < 2 * min_pairs) return {};
  const std::size_t m = std::min(n, most);
  const auto keyOf = [&](std::size_t i) {
    const auto x = row(i);
    std::uint64_t key = 0, odd = 0x9e3779b97f4a7c15U;
    for (Eigen::Index k = 0; k < x.size(); ++k, odd *= 5) {
      const auto bits_of = std::bit_cast<std::uint64_t>(static_cast<double>(x[k]));
      key += (bits_of ^ bits_of >> 32U) * odd;  // the last bits of round numbers are all zero
    }
    return (key ^ key >> 29U) * 0xbf58476d1ce4e5b9U;
  };
  std::vector<std::pair<std::uint64_t, std::size_t>> probes(m);  // key, and number of rows
  std::vector<std::uint8_t> seen(n > most ? bits : 0, 0);
  for (std::size_t k = 0; k < m; ++k) {
    probes[k] = {keyOf(k * n / m), 0};
    if (n > most) seen[probes[k].first / rest] = 1;
  }
  std::vector<std::pair<std::uint64_t, std::size_t>> found = probes;
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint64_t key = keyOf(i);
    if (n > most && seen[key / rest] == 0) continue;
    const auto at = std::lower_bound(found.begin(), found.end(), std::pair{key, std::size_t{0}});
    if (at != found.end() && at->first == key) ++at->second;
  }
  RepeatedRows result;
  std::size_t common = 0;
  double pairs = 0;
  for (const auto& probe : probes) {
    const auto at = std::lower_bound(found.begin(), found.end(), probe);
    pairs += 0.5 * static_cast<double>(at->second - 1), common = std::gcd(common, at->second);
  }
  result.copies = 2 * pairs / static_cast<double>(m);
  if (!(result.copies > min_copies) || pairs < min_pairs) return result;
  // Chance makes all of many numbers of rows multiples of one number in one of 2^8 cases.
  result.matters = common > 1 && found.size() >= min_different;
  if (result.matters) return result;
  const std::size_t taken = std::min<std::size_t>(m, 200);
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(taken), row(0).size());
  for (std::size_t k = 0; k < taken; ++k) {
    rows.row(static_cast<Eigen::Index>(k)) = row(k * n / taken).template cast<double>().transpose();
  }
  const double factor = static_cast<double>(m) * static_cast<double>(n) / static_cast<double>(taken * taken);
  result.matters = pairs > 3 * factor * detail::pairsByGrid(std::move(rows), dof) + min_pairs;
  return result;
}

}  // namespace liestat
