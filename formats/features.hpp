// Points, rotations, directions, headings, frames and rigid motions from files: CSV, TUM, EuRoC, KITTI.
//
//   const liestat::FeatureFile file = liestat::readFeatureFile("rotations.csv");
//   const std::vector<liestat::SO3d> rotations = liestat::featuresOf<liestat::SO3d>(file);
#pragma once

#include <formats/feature.hpp>
#include <formats/text.hpp>
#include <stats/factored_gaussian.hpp>
#include <stats/liestat_state.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace liestat {

/// A variance from which on a ROS or MAVLink message means "not measured" (99999 and 1e6 are customary), m² or rad². Of
/// a rotation it means that in any file: no rotation scatters by 300 rad. So does a variance of -1.
inline constexpr double unmeasured_variance = 9e4;

/// A covariance of the size that the feature has: 3x3, for frames 6x6, for directions 2x2. Its storage needs no heap.
using FeatureCovariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;

/// The features of a file, one entry a row in each list that is not empty. Which parts there are is said by `kind`.
struct FeatureFile {
  /// The kind of each row: the first feature of the table with exactly the file's parts.
  Feature kind = Feature::point;
  std::vector<Eigen::Quaterniond> rotations;  ///< unit quaternions
  std::vector<Eigen::Vector3d> positions;     ///< points, or translations of frames
  std::vector<Eigen::Vector3d> directions;    ///< unit vectors
  std::vector<double> headings;               ///< degrees, as they stand
  std::vector<double> weights;                ///< 0 or more, one above; empty if the file has none
  std::vector<double> times;                  ///< in seconds where the format says so; empty if the file has none
  /// Positive definite, translation before rotation; NaN in rows that `unmeasured` lists. Empty if the file has none.
  std::vector<FeatureCovariance> covariances;
  /// Factors of these, which have more digits, where the file has factors or standard deviations.
  std::vector<FeatureCovariance> factors;
  std::vector<std::size_t> unmeasured;  ///< rows of which a sentinel says that a rotation was not measured
  std::size_t n_large_variances = 0;    ///< rows with a variance of a length that is a sentinel in messages
  std::vector<std::size_t> lines;       ///< the line that each row stands in
  std::size_t n_normalised = 0;         ///< rows whose rotation or direction was off its norm by more than rounding
  double largest_norm_error = 0;        ///< the largest such error
  std::size_t n_beyond_half_turn = 0;   ///< rotation vectors longer than a half-turn, which no logarithm is
  double largest_rotation_vector = 0;   ///< rad
  std::string format;                   ///< the name of the format that was read
  std::vector<std::string> notes;       ///< sentences on what reading has decided

  std::size_t size() const { return lines.size(); }
};
template <class V>
void describe(V& v, const FeatureFile& file) {
  v("format", file.format, "that was read")("n_normalised", file.n_normalised, "rows that were off their norm");
  v("largest_norm_error", file.largest_norm_error, "of these rows");
}

/// The unit of rotation vectors. Unsaid: radians, and one longer than a turn is an error, for degrees look like that.
enum class AngleUnit { unsaid, radians, degrees };

/// Options of readFeatureFile().
struct ReadingOptions {
  std::string format = "auto";  ///< one of formatNames(); `auto` looks at the first lines
  /// A quaternion or direction whose norm is off by less is normalised, one off by more is an error. For rotation
  /// matrices the error is half the Frobenius norm of RᵀR − I.
  double norm_tolerance = 1e-3;
  AngleUnit angles = AngleUnit::unsaid;
  bool ignore_unknown = false;       ///< CSV columns without a meaning are passed over
  bool without_covariances = false;  ///< the columns cov_00 … are passed over too
  /// Names of CSV columns that are not ours, each as "ours=theirs"; or, all of them, their numbers from 1, as "ours=1".
  std::vector<std::string> columns = {};
  double largest_file = largest_text;  ///< GB of text at most, see loadText
  /// `map:base_link`, for a bag without a topic, or with the topic /tf, takes the pose of base_link in map by the
  /// chain of transforms between the two.
  std::string frames = {};
};

/// The names of the formats that are known (formats/feature_formats.cpp), `auto` first.
std::vector<std::string> formatNames();

/// Reads features from a file, `-` is standard input, or poses from a topic of a bag (docs/bags.md), whose covariances
/// are left out, since nothing says what they mean. Throws InputError.
FeatureFile readFeatureFile(const std::string& path, const ReadingOptions& options = {});

/// True for regular files that are not empty or compressed, which readFeatureChunks() can read.
bool hasFeatureChunks(const std::string& path);
/// Reads features of a file that is mapped, not compressed, and of any size: some thousand rows at a time go to take(),
/// and are forgotten. Throws InputError.
void readFeatureChunks(const std::string& path, const ReadingOptions& options,
                       const std::function<void(const FeatureFile& rows)>& take);

/// Reads features from memory; `name` stands for the file in messages. Throws InputError.
FeatureFile readFeatures(std::string_view text, std::string name, const ReadingOptions& options = {});

/// The rows of a file as features of type M, whose parameters are its parts one after the other.
template <class M>
std::vector<M> featuresOf(const FeatureFile& file) {
  std::vector<M> list;
  list.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    Eigen::Matrix<double, 7, 1> params;
    Eigen::Index n = 0;
    for (const FeaturePart part : info<M>().parts) {
      switch (part) {
        case FeaturePart::rotation:
          params.segment<4>(n) = file.rotations[i].coeffs(), n += 4;
          break;
        case FeaturePart::position:
          params.segment<3>(n) = file.positions[i], n += 3;
          break;
        case FeaturePart::direction:
          params.segment<3>(n) = file.directions[i], n += 3;
          break;
        case FeaturePart::heading:
          if constexpr (std::is_same_v<M, SO2d>) liestat_heading(file.headings[i], params.data());
          break;
      }
    }
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      list.push_back(params.head<3>());
    } else {
      list.push_back(M::fromParams(typename M::Params(params.head<M::num_parameters>())));
    }
  }
  return list;
}

/// The file without the rows that `unmeasured` lists: sentinels are no variances, and must not be averaged.
FeatureFile withoutUnmeasured(FeatureFile file);

/// The same with their covariances.
template <class M>
std::vector<Gaussian<M>> gaussiansOf(const FeatureFile& file) {
  const std::vector<M> features = featuresOf<M>(file);
  std::vector<Gaussian<M>> list;
  list.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) list.push_back({features[i], file.covariances[i]});
  return list;
}

/// The same with the factors of these, for a file that has them.
template <class M>
std::vector<FactoredGaussian<M>> factoredGaussiansOf(const FeatureFile& file) {
  const std::vector<M> features = featuresOf<M>(file);
  std::vector<FactoredGaussian<M>> list;
  list.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) list.push_back({features[i], file.factors[i]});
  return list;
}

}  // namespace liestat
