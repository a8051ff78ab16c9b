#pragma once

#include <experiments/feature.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::cli {

/// File formats of features. `automatic` looks at the first lines.
///   csv    a header names the columns; see knownColumns()
///   tum    t tx ty tz qx qy qz qw, separated by blanks
///   euroc  #timestamp [ns], p x y z, q w x y z, and more columns that are passed over
///   kitti  the upper 3x4 of a pose matrix, row by row: 12 numbers
enum class Format { automatic, csv, tum, euroc, kitti };

/// Names as the command line and the messages spell them.
std::string_view name(Format format);
/// The inverse of name(Format); empty for an unknown name.
std::optional<Format> formatFromName(std::string_view name);

/// The columns that a CSV file of features may have.
const std::vector<std::string>& knownColumns();

/// A covariance of the size that the feature has: 3x3, for frames 6x6, for directions 2x2. Its storage needs no heap.
using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;

/// The features of a file, one entry a row in each list that is not empty.
struct FeatureFile {
  /// What each row is: the first feature of the table with exactly the file's parts.
  experiments::Feature kind = experiments::Feature::point;
  std::vector<Eigen::Quaterniond> rotations;  ///< of rotations and frames, of unit norm
  std::vector<Eigen::Vector3d> vectors;       ///< points, directions (of unit norm) or translations of frames
  std::vector<double> weights;                ///< positive; empty if the file has none
  std::vector<double> times;                  ///< in seconds where the format says so; empty if the file has none
  std::vector<Covariance> covariances;  ///< positive definite, translation before rotation; empty if the file has none
  std::vector<std::size_t> lines;       ///< the line that each row stands in
  std::size_t n_normalised = 0;         ///< rows whose rotation or direction was off its norm by more than rounding
  double largest_norm_error = 0;        ///< the largest such error
  std::string format;                   ///< the format that was read, as name(Format) spells it

  std::size_t size() const { return lines.size(); }
};

/// How to read.
struct ReadingOptions {
  Format format = Format::automatic;
  /// A quaternion or direction whose norm is off by less is normalised, one off by more is an error. For rotation
  /// matrices the error is half the Frobenius norm of RᵀR − I.
  double norm_tolerance = 1e-3;
};

/// Reads features from a file, `-` is standard input. Throws InputError.
FeatureFile readFeatureFile(const std::string& path, const ReadingOptions& options = {});

/// Reads features from memory; `name` stands for the file in messages. Throws InputError.
FeatureFile readFeatures(std::string_view text, std::string name, const ReadingOptions& options = {});

/// Columns of numbers by name, from a CSV file with a header.
class NumericTable {
 public:
  NumericTable(std::string file, std::vector<std::string> columns);

  const std::string& file() const { return file_; }
  /// The columns that were read: the required ones, then those of the optional ones that the file has.
  const std::vector<std::string>& columns() const { return columns_; }
  bool has(std::string_view column) const;
  /// Where a column that `has` stands.
  std::size_t column(std::string_view column) const;

  std::size_t rows() const { return lines_.size(); }
  double operator()(std::size_t row, std::size_t column) const { return values_[row * columns_.size() + column]; }
  std::size_t line(std::size_t row) const { return lines_[row]; }
  /// A value that has to be a whole number of zero or more; throws InputError otherwise.
  std::size_t index(std::size_t row, std::size_t column) const;

  /// Adds a row of as many values as there are columns.
  void append(const double* values, std::size_t line);

 private:
  std::string file_;
  std::vector<std::string> columns_;
  std::vector<double> values_;
  std::vector<std::size_t> lines_;
};

/// Reads the required columns, and those of the optional ones that are there, in whatever order the file has them; it
/// may have others. At least one row. Throws InputError.
NumericTable readTable(const std::string& path, const std::vector<std::string>& required,
                       const std::vector<std::string>& optional = {});
/// The same from memory.
NumericTable parseTable(std::string_view text, std::string name, const std::vector<std::string>& required,
                        const std::vector<std::string>& optional = {});

/// The rotation nearest to a matrix, and how far the matrix is from it.
struct NearestRotation {
  Eigen::Matrix3d rotation;
  double error;  ///< half the Frobenius norm of RᵀR − I of the matrix that was given
};

/// Projects to the nearest rotation; throws InputError where the matrix is a reflection or off by more than the
/// tolerance.
NearestRotation nearestRotation(const Eigen::Matrix3d& matrix, double tolerance, const std::string& file,
                                std::size_t line);

}  // namespace liestat::cli
