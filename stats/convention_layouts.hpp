// The numbers of a 6×6 covariance in the sequences of files and messages: CovarianceLayout of stats/conventions.hpp.
#pragma once

#include <stats/conventions.hpp>

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

namespace liestat {

/// The number of numbers in a layout.
constexpr std::size_t layoutSize(CovarianceLayout layout) {
  switch (layout) {
    case CovarianceLayout::full36:
      return 36;
    case CovarianceLayout::upper21:
    case CovarianceLayout::lower21:
      return 21;
    case CovarianceLayout::blocks12:
      return 12;
    default:
      return 6;
  }
}

/// The numbers of a matrix in a layout.
struct PackedCovariance {
  std::array<double, 36> storage{};
  std::size_t size = 0;
  std::span<const double> numbers() const& { return {storage.data(), size}; }
  std::span<const double> numbers() const&& = delete;  // a view into a temporary
};

/// Row and column in the matrix of each number of a layout, in their sequence.
struct LayoutEntries {
  struct Entry {
    int row, column;
  };
  std::array<Entry, 36> entries{};
  std::size_t size = 0;
  constexpr void add(int row, int column) { entries[size++] = {row, column}; }
  constexpr const Entry& operator[](std::size_t k) const { return entries[k]; }
};

/// The entries of the convention's layout; those of planar layouts depend on its order and perturbation too.
constexpr LayoutEntries layoutEntries(const Convention& convention) {
  LayoutEntries list;
  switch (convention.layout) {
    case CovarianceLayout::full36:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) list.add(i, j);
      }
      break;
    case CovarianceLayout::upper21:
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) list.add(i, j);
      }
      break;
    case CovarianceLayout::lower21:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j <= i; ++j) list.add(i, j);
      }
      break;
    case CovarianceLayout::blocks12:
      for (int begin = 0; begin < 6; begin += 3) {
        for (int i = begin; i < begin + 3; ++i) {
          for (int j = i; j < begin + 3; ++j) list.add(i, j);
        }
      }
      break;
    case CovarianceLayout::diag6:
      for (int i = 0; i < 6; ++i) list.add(i, i);
      break;
    case CovarianceLayout::planar6:
    case CovarianceLayout::toro6: {
      const int translation = convention.order == CovarianceOrder::translation_rotation ? 0 : 3;
      const int yaw = 3 - translation + (convention.perturbation == Perturbation::yaw_pitch_roll ? 0 : 2);
      const int at[] = {translation, translation + 1, yaw};
      constexpr int planar[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
      constexpr int toro[6][2] = {{0, 0}, {0, 1}, {1, 1}, {2, 2}, {0, 2}, {1, 2}};
      for (const auto& e : convention.layout == CovarianceLayout::planar6 ? planar : toro) list.add(at[e[0]], at[e[1]]);
      break;
    }
  }
  return list;
}

/// The numbers of the convention's layout, of a matrix in the convention (toConvention).
inline PackedCovariance packCovariance(const Convention& convention, const Eigen::Matrix<double, 6, 6>& matrix) {
  const LayoutEntries list = layoutEntries(convention);
  PackedCovariance packed;
  packed.size = list.size;
  for (std::size_t k = 0; k < list.size; ++k) packed.storage[k] = matrix(list[k].row, list[k].column);
  return packed;
}

/// The symmetric matrix of the numbers of a layout, NaN (unknown, not zero) for entries that the layout does not have.
/// Takes the mean of both triangles of full36; asymmetry(numbers) tells whether they agree. Nothing if the count of
/// numbers is not layoutSize.
inline std::optional<Eigen::Matrix<double, 6, 6>> unpackCovariance(const Convention& convention,
                                                                   std::span<const double> numbers) {
  const LayoutEntries list = layoutEntries(convention);
  if (numbers.size() != list.size) return std::nullopt;
  Eigen::Matrix<double, 6, 6> matrix;
  matrix.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < list.size; ++k) {
    const auto [i, j] = list[k];
    matrix(i, j) = numbers[k];
    if (convention.layout != CovarianceLayout::full36) matrix(j, i) = numbers[k];
  }
  if (convention.layout == CovarianceLayout::full36) matrix = (0.5 * (matrix + matrix.transpose())).eval();
  return matrix;
}

/// The largest |a_ij - a_ji| of the 36 numbers of a square matrix, relative to √(a_ii a_jj); zero for symmetric ones,
/// NaN entries passed over.
inline double asymmetry(std::span<const double, 36> numbers) {
  double largest = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double difference = std::abs(numbers[6 * i + j] - numbers[6 * j + i]);
      const double scale = std::sqrt(std::abs(numbers[7 * i] * numbers[7 * j]));
      if (difference > 0) largest = std::max(largest, difference / scale);
    }
  }
  return largest;
}

}  // namespace liestat
