// Arrays of numbers in NumPy's files (.npy), mapped into memory: rows of any number of gigabytes, which are not copied.
#pragma once

#include <formats/detail/mapped_file.hpp>
#include <formats/features.hpp>

#include <cstddef>
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
  /// An array in a file that has nothing else.
  NpyFile(const std::string& path, std::string name, std::size_t columns);

  const std::string& name() const { return name_; }
  std::size_t rows() const { return rows_; }
  std::size_t columns() const { return columns_; }
  std::size_t bytes() const { return file_.bytes().size(); }  ///< of the file
  /// The rows where they lie, if they are aligned doubles; else null.
  const double* doubles() const;
  /// Copies rows begin … begin + count - 1.
  void read(std::size_t begin, std::size_t count, double* numbers) const;
  /// The rows before this one take no memory until they are read again.
  void forget(std::size_t end) const;

 private:
  std::string name_;
  detail::MappedFile file_;
  std::size_t offset_ = 0, rows_ = 0, columns_ = 0;
  bool single_ = false;
};

/// Rows of doubles on their way into a file without a name, which is gone with the last NpyFile of it.
class RowsOnDisk {
 public:
  /// In the directory TMPDIR, else /tmp. Throws InputError where that is not possible.
  explicit RowsOnDisk(std::size_t columns);
  ~RowsOnDisk();
  RowsOnDisk(const RowsOnDisk&) = delete;
  RowsOnDisk& operator=(const RowsOnDisk&) = delete;

  /// Throws InputError where the disk is full.
  void add(const double* numbers, std::size_t rows);
  std::size_t rows() const { return rows_; }
  /// All rows, of which there is one at least, as an array that messages call by that name.
  NpyFile array(const std::string& name) const;

 private:
  std::string path_;
  int file_ = -1;
  std::size_t columns_, rows_ = 0;
};

/// The feature of an array's rows: four columns are quaternions x y z w, seven are TUM's without the time (tx ty tz qx
/// qy qz qw); three are points or directions, as `wish` says. Throws InputError for others.
Feature featureOfRows(const NpyFile& file, const std::optional<Feature>& wish);

/// All rows as features, whose lines are the rows from 1. Norms are checked as in other files; throws InputError.
FeatureFile readNpyFeatures(const NpyFile& file, const std::optional<Feature>& wish, double norm_tolerance = 1e-3);

}  // namespace liestat
