// The columns of files of features: which parts of which feature stand where in a row.
#pragma once

#include <formats/feature.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::detail {

/// The index of a column that is not there.
inline constexpr int absent = -1;

/// The columns of features, in words.
inline constexpr std::string_view feature_columns_text =
    "qx,qy,qz,qw or rx,ry,rz or roll,pitch,yaw or r00 ... r22 (with tx,ty,tz for frames), or x,y,z, or dx,dy,dz, or "
    "heading_deg";

/// The columns that a CSV file of features may have.
const std::vector<std::string>& knownColumns();

/// The columns of the parts of a feature. At most one of the four forms of a rotation is there.
struct FeatureColumns {
  Feature kind = Feature::point;
  std::array<int, 4> quaternion{absent, absent, absent, absent};  ///< x y z w
  std::array<int, 3> rotation_vector{absent, absent, absent};
  std::array<int, 3> euler{absent, absent, absent};  ///< roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll)
  std::array<int, 9> matrix{absent, absent, absent, absent, absent, absent, absent, absent, absent};
  std::array<int, 3> position{absent, absent, absent};
  std::array<int, 3> direction{absent, absent, absent};
  int heading = absent;
  int weight = absent;
  int time = absent;
  int dimension = 0;                 ///< the covariance's; 0: there is none
  std::vector<int> covariance = {};  ///< upper triangle, row by row; or one of the next two
  std::vector<int> factor = {};      ///< of the covariance, row by row
  std::vector<int> deviations = {};  ///< standard deviations: a diagonal factor
};

/// True for the columns of covariances, in any of their three forms.
bool isCovarianceColumn(std::string_view column);

/// Finds the parts of a feature among the columns of a file; `line` is where they are named. Throws InputError where
/// they make no feature or several.
FeatureColumns findFeature(const std::vector<std::string>& columns, const std::string& file, std::size_t line);

}  // namespace liestat::detail
