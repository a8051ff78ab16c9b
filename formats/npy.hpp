// Arrays of numbers in NumPy's files (.npy), mapped into memory: rows of any number of gigabytes, which are not copied.
#pragma once

#include <formats/features.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// A two-dimensional array of doubles or floats, little-endian and in C order.
class NpyFile {
 public:
  /// Throws InputError where the file is none, ends too early, or is of another type or order: a sentence says how
  /// NumPy makes it one.
  explicit NpyFile(const std::string& path);

  /// True if a file begins as .npy files do.
  static bool isOne(const std::string& path);

  const std::string& name() const { return name_; }
  std::size_t rows() const { return rows_; }
  std::size_t columns() const { return columns_; }
  std::size_t bytes() const { return size_; }  ///< of the file
  /// The rows where they lie, if they are aligned doubles; else null.
  const double* doubles() const;
  /// Copies rows begin … begin + count - 1.
  void read(std::size_t begin, std::size_t count, double* numbers) const;

 private:
  std::string name_;
  std::shared_ptr<const char> map_;
  std::size_t size_ = 0, offset_ = 0, rows_ = 0, columns_ = 0;
  bool single_ = false;
};

/// The feature of an array's rows: four columns are quaternions x y z w, seven are TUM's without the time (tx ty tz qx
/// qy qz qw); three are points or directions, as `wish` says. Throws InputError for others.
Feature featureOfRows(const NpyFile& file, const std::optional<Feature>& wish);

/// All rows as features, whose lines are the rows from 1. Norms are checked as in other files; throws InputError.
FeatureFile readNpyFeatures(const NpyFile& file, const std::optional<Feature>& wish, double norm_tolerance = 1e-3);

}  // namespace liestat
