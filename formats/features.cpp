#include <formats/features.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unordered_map>
#include <utility>

#include <formats/bag.hpp>
#include <formats/detail/feature_columns.hpp>
#include <formats/detail/feature_formats.hpp>
#include <formats/detail/gzip.hpp>
#include <formats/detail/mapped_file.hpp>
#include <formats/detail/rows.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/detail/rotation_matrix.hpp>
#include <lie/linear.hpp>
#include <lie/units.hpp>

namespace liestat {
namespace {

constexpr double rounding = 1e-12;

/// Reads the rows of one text, whose format says how they are laid out.
class FeatureReader {
 public:
  /// `take`: nothing, or where the rows go instead of into the file.
  FeatureReader(std::string_view text, std::string file, const ReadingOptions& options, const detail::TakeFeature& take)
      : text_(text), reader_(text), name_(std::move(file)), options_(options), take_(take) {}

  /// Rows go to take(rows, characters that were read) some thousand at a time.
  void inChunks(std::function<void(const FeatureFile&, std::size_t)> take) { take_chunk_ = std::move(take); }

  FeatureFile read() {
    // A zero byte far behind is no number either.
    requireText(take_chunk_ ? text_.substr(0, 1 << 20) : text_, name_);
    if (!reader_.next()) throw InputError(name_, 0, "the file has no data, only blank lines and comments");
    const detail::FeatureFormat& format = detail::featureFormat(options_, reader_, name_);
    file_.format = std::string(format.name);
    if (!options_.columns.empty() && !format.names_columns) {
      throw InputError(name_, reader_.number(), fmt::format("--columns for a file of the format {}", format.name),
                       "a CSV file, whose header names the columns");
    }
    layout_ = format.reads(reader_, name_, options_);
    if (options_.without_covariances) passOverCovariances();
    const std::size_t first_line = reader_.number();
    places_ = detail::findFeature(layout_.columns, name_, first_line);
    if (layout_.has_header && !reader_.next()) {
      throw InputError(name_, first_line, "there is a header but no data", "at least one row after it");
    }
    if (options_.angles == AngleUnit::degrees && places_.rotation_vector[0] == detail::absent &&
        places_.euler[0] == detail::absent) {
      throw InputError(name_, first_line, "--degrees, but there are no angles",
                       "the columns rx,ry,rz or roll,pitch,yaw");
    }
    readRows();
    return std::move(file_);
  }

 private:
  void passOverCovariances() {
    std::unordered_map<std::string, std::size_t> places;
    for (std::size_t k = 0; k < layout_.columns.size(); ++k) {
      std::string& column = layout_.columns[k];
      if (!detail::isCovarianceColumn(column)) continue;
      if (column.rfind("cov_", 0) != 0) {
        throw InputError(name_, reader_.number(), fmt::format("the column {}", column), "cov_00 ... cov_55 of poses");
      }
      places.emplace(std::exchange(column, {}), k);
    }
    for (int i = 0; i < 6 && !places.empty(); ++i) {
      for (int j = i; j < 6; ++j) {
        const auto place = places.find(fmt::format("cov_{}{}", i, j));
        if (place == places.end()) {
          throw InputError(name_, reader_.number(), fmt::format("there is no column 'cov_{}{}'", i, j),
                           "the upper triangle cov_00 ... cov_55");
        }
        layout_.covariance.push_back(place->second);
      }
    }
  }

  /// Forgets the row that has been taken.
  void forget() {
    file_.lines.clear(), file_.rotations.clear(), file_.positions.clear(), file_.directions.clear(),
        file_.headings.clear();
    file_.weights.clear(), file_.times.clear(), file_.covariances.clear(), file_.factors.clear();
    file_.unmeasured.clear();
  }

  void readRows() {
    constexpr std::size_t most = 1 << 15;
    const std::size_t rows = take_ ? 1 : take_chunk_ ? most : detail::mostRows(text_, layout_.columns.size());
    const FeatureParts& parts = info(places_.kind).parts;
    file_.kind = places_.kind;
    file_.lines.reserve(rows);
    if (parts.contains(FeaturePart::rotation)) file_.rotations.reserve(rows);
    if (parts.contains(FeaturePart::position)) file_.positions.reserve(rows);
    if (parts.contains(FeaturePart::direction)) file_.directions.reserve(rows);
    if (parts.contains(FeaturePart::heading)) file_.headings.reserve(rows);
    if (places_.weight != detail::absent) file_.weights.reserve(rows);
    if (places_.time != detail::absent) file_.times.reserve(rows);
    values_.resize(layout_.columns.size());
    do {
      line_ = reader_.number();
      splitFields(reader_.line(), layout_.separator, fields_);
      if (fields_.size() != layout_.columns.size())
        throwWrongWidth(fields_.size(), layout_.columns.size(), layout_.description, name_, line_);
      for (std::size_t i = 0; i < layout_.columns.size(); ++i) {
        if (!layout_.columns[i].empty()) values_[i] = numberField(fields_[i], layout_.columns[i], name_, line_);
      }
      addRow();
      if (take_chunk_ && file_.size() == most) {
        take_chunk_(file_, static_cast<std::size_t>(reader_.line().data() - text_.data()));
        forget();
      }
      if (!take_) continue;
      take_(file_, layout_, fields_);
      forget();
    } while (reader_.next());
    if (take_chunk_) return take_chunk_(file_, text_.size());
    if (take_) return;
    if (places_.weight != detail::absent && *std::max_element(file_.weights.begin(), file_.weights.end()) == 0) {
      throw InputError(name_, file_.lines.front(), "every weight is 0", "one above 0");
    }
    // A text may have far more characters than its shortest rows would need.
    file_.lines.shrink_to_fit();
    file_.rotations.shrink_to_fit();
    file_.positions.shrink_to_fit();
    file_.directions.shrink_to_fit();
    file_.headings.shrink_to_fit();
    file_.weights.shrink_to_fit();
    file_.times.shrink_to_fit();
  }

  double value(int place) const { return values_[static_cast<std::size_t>(place)]; }

  void addRow() {
    const FeatureParts& parts = info(places_.kind).parts;
    if (parts.contains(FeaturePart::rotation)) file_.rotations.push_back(readRotation());
    if (parts.contains(FeaturePart::position)) file_.positions.push_back(readVector(places_.position));
    if (parts.contains(FeaturePart::direction)) file_.directions.push_back(readDirection());
    if (parts.contains(FeaturePart::heading)) file_.headings.push_back(value(places_.heading));
    if (places_.weight != detail::absent) {
      const double weight = value(places_.weight);
      if (!(weight >= 0)) throw InputError(name_, line_, fmt::format("weight is {}", weight), "0 or more");
      file_.weights.push_back(weight);
    }
    if (places_.time != detail::absent) file_.times.push_back(value(places_.time) * layout_.time_unit);
    if (places_.dimension > 0) addCovariance();
    file_.lines.push_back(line_);
  }

  Eigen::Vector3d readVector(const std::array<int, 3>& places) const {
    return {value(places[0]), value(places[1]), value(places[2])};
  }

  /// Rows as the file rounds them pass silently; what was changed beyond that is counted.
  void countNormalised(double error) {
    if (error <= rounding) return;
    ++file_.n_normalised;
    file_.largest_norm_error = std::max(file_.largest_norm_error, error);
  }

  /// The norm, if it is one within the tolerance.
  template <class Vector>
  double checkedNorm(const Vector& vector, std::string_view what) {
    const double squared = vector.squaredNorm();
    // Squares of very large and very small numbers are lost, the message shall show the norm all the same.
    const bool regular = squared > 1e-200 && squared < 1e200;
    const double norm = regular ? std::sqrt(squared) : vector.stableNorm();
    const double error = std::abs(norm - 1);
    if (norm == 0) throw InputError(name_, line_, fmt::format("the {} is zero", what), "a unit vector");
    if (!(error <= options_.norm_tolerance) || !regular) {
      throw InputError(name_, line_, fmt::format("the norm of the {} is {:.6g}", what, norm),
                       fmt::format("1 within {:g}{}", options_.norm_tolerance, detail::norm_remedy));
    }
    countNormalised(error);
    return norm;
  }

  Eigen::Vector3d readDirection() {
    const Eigen::Vector3d direction = readVector(places_.direction);
    return direction / checkedNorm(direction, "direction");
  }

  Eigen::Quaterniond readRotation() {
    if (places_.quaternion[0] != detail::absent) {
      const Eigen::Vector4d q(value(places_.quaternion[0]), value(places_.quaternion[1]), value(places_.quaternion[2]),
                              value(places_.quaternion[3]));
      const double norm = checkedNorm(q, "quaternion");
      return Eigen::Quaterniond(Eigen::Vector4d(q / norm));
    }
    if (places_.rotation_vector[0] != detail::absent) {
      const Eigen::Vector3d r =
          (options_.angles == AngleUnit::degrees ? units::degree : 1.0) * readVector(places_.rotation_vector);
      const double angle = r.stableNorm();
      // Beyond this the angle modulo a turn is rounding, not data.
      if (!(angle < 1e6))
        throw InputError(name_, line_, fmt::format("the rotation vector has length {:.6g}", angle),
                         "an angle in radians");
      if (angle > std::numbers::pi * (1 + 1e-6)) ++file_.n_beyond_half_turn;
      if (options_.angles == AngleUnit::unsaid && angle > 2 * std::numbers::pi * (1 + 1e-6)) {
        throw InputError(name_, line_,
                         fmt::format("the rotation vector has length {:.6g}, more than a turn: in degrees?", angle),
                         "radians, or --degrees; --radians takes them as they are");
      }
      file_.largest_rotation_vector = std::max(file_.largest_rotation_vector, angle);
      const double scale = angle > 1e-150 ? std::sin(angle / 2) / angle : 0.5;
      Eigen::Quaterniond q;
      q.w() = std::cos(angle / 2);
      q.vec() = scale * r;
      return q;
    }
    if (places_.euler[0] != detail::absent) {
      const Eigen::Vector3d angles = readVector(places_.euler);
      const double largest = angles.cwiseAbs().maxCoeff();
      if (options_.angles == AngleUnit::unsaid && largest > 2 * std::numbers::pi * (1 + 1e-6)) {
        throw InputError(name_, line_,
                         fmt::format("an angle of roll, pitch, yaw is {:.6g}, more than a turn: in degrees?", largest),
                         "radians, or --degrees; --radians takes them as they are");
      }
      if (!(largest < 1e6)) throw InputError(name_, line_, fmt::format("an angle is {:.6g}", largest), "radians");
      const Eigen::Vector3d rad = (options_.angles == AngleUnit::degrees ? units::degree : 1.0) * angles;
      return Eigen::Quaterniond(Eigen::AngleAxisd(rad[2], Eigen::Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(rad[1], Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(rad[0], Eigen::Vector3d::UnitX()));
    }
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = value(places_.matrix[static_cast<std::size_t>(i)]);
    const detail::NearestRotation nearest =
        detail::nearestRotation(matrix, options_.norm_tolerance, name_, line_, detail::norm_remedy);
    countNormalised(nearest.error);
    return Eigen::Quaterniond(nearest.rotation.params());
  }

  /// The factor of a row, and its covariance.
  void addCovariance() {
    const int n = places_.dimension;
    if (!places_.covariance.empty()) {
      FeatureCovariance covariance(n, n);
      std::size_t next = 0;
      for (int i = 0; i < n; ++i) {
        for (int j = i; j < n; ++j) covariance(i, j) = covariance(j, i) = value(places_.covariance[next++]);
      }
      if (!isUnmeasured(covariance)) checkCovariance(covariance);
      file_.covariances.push_back(std::move(covariance));
      return;
    }
    FeatureCovariance factor = FeatureCovariance::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n && !places_.factor.empty(); ++j) {
        factor(i, j) = value(
            places_.factor[static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + static_cast<std::size_t>(j)]);
      }
      if (places_.deviations.empty()) continue;
      const double deviation = value(places_.deviations[static_cast<std::size_t>(i)]);
      if (!(deviation > 0)) {
        throw InputError(name_, line_, fmt::format("sd_{} is {}", i, deviation), "a standard deviation above 0");
      }
      factor(i, i) = deviation;
    }
    Eigen::Matrix<double, 6, 6> whole = Eigen::Matrix<double, 6, 6>::Identity();
    whole.topLeftCorner(n, n) = factor;
    const Eigen::Matrix<double, 6, 6> square = squareOfFactor<double, 6>(whole);
    FeatureCovariance covariance = square.topLeftCorner(n, n);
    if (!isUnmeasured(covariance)) checkCovariance(covariance);
    file_.covariances.push_back(std::move(covariance));
    file_.factors.push_back(std::move(factor));
  }

  /// True, and the row is listed, if a sentinel says that the rotation was not measured; the covariance is NaN then.
  bool isUnmeasured(FeatureCovariance& covariance) {
    const int n = places_.dimension;
    const FeatureParts& parts = info(places_.kind).parts;
    const bool rotates = parts.contains(FeaturePart::rotation);
    const int first_angle = rotates                                  ? n - 3
                            : parts.contains(FeaturePart::direction) ? n - 2
                            : parts.contains(FeaturePart::heading)   ? 0
                                                                     : n;
    bool found = first_angle < n && covariance(0, 0) == -1, large = false;
    for (int i = 0; i < n; ++i) {
      const double v = covariance(i, i);
      if (i >= first_angle) found = found || v >= unmeasured_variance || v == -1;
      if (i < first_angle) large = large || v >= unmeasured_variance;
    }
    if (large && !found) ++file_.n_large_variances;
    if (!found) return false;
    covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    file_.unmeasured.push_back(file_.lines.size());
    return true;
  }

  void checkCovariance(const FeatureCovariance& covariance) const {
    const int n = places_.dimension;
    // The share of each variance that the components before it leave: the test does not depend on units.
    Eigen::Matrix<double, 6, 6> whole = Eigen::Matrix<double, 6, 6>::Identity();
    whole.topLeftCorner(n, n) = covariance;
    const Cholesky<double, 6> factor(whole);
    bool positive = factor.ok();
    for (int i = 0; positive && i < n && places_.factor.empty(); ++i) {
      positive = factor.pivot(i) > n * std::numeric_limits<double>::epsilon() * covariance(i, i);
    }
    if (positive) return;
    const SymmetricEigen eigen(covariance);
    throw InputError(name_, line_,
                     fmt::format("the covariance is not positive definite (smallest eigenvalue {:.3g}, largest {:.3g})",
                                 eigen.values[0], eigen.values[n - 1]),
                     "positive eigenvalues");
  }

  std::string_view text_;
  LineReader reader_;
  std::string name_;
  ReadingOptions options_;
  detail::TakeFeature take_;
  std::function<void(const FeatureFile&, std::size_t)> take_chunk_;
  detail::RowLayout layout_;
  detail::FeatureColumns places_;
  FeatureFile file_;
  std::size_t line_ = 0;
  std::vector<std::string_view> fields_;
  std::vector<double> values_;
};

/// The poses of a topic.
FeatureFile featuresOfBag(const std::string& path, const ReadingOptions& options) {
  TrajectoryOptions how;
  how.reading = options;
  const Trajectory t = detail::readBagTrajectory(path, how);
  FeatureFile file;
  file.kind = Feature::frame, file.format = t.format, file.times = t.times, file.lines = t.lines;
  for (const SE3d& pose : t.poses) {
    file.rotations.push_back(pose.unit_quaternion()), file.positions.push_back(pose.translation());
  }
  file.n_normalised = t.n_normalised, file.largest_norm_error = t.largest_norm_error, file.notes = t.notes;
  if (t.hasCovariances()) {
    file.notes.emplace_back(
        "the messages' covariances are not used; `liestat convert BAG:TOPIC OUT.csv --cov-from "
        "ros-fixed` writes a file whose covariances are");
  }
  return file;
}

}  // namespace

FeatureFile readFeatureFile(const std::string& path, const ReadingOptions& options) {
  if (isBag(path)) return featuresOfBag(path, options);
  const TextFile file = loadText(path, options.largest_file);
  return readFeatures(file.text, file.name, options);
}

FeatureFile withoutUnmeasured(FeatureFile file) {
  const auto keep = [&](auto& list) {
    if (list.empty()) return;
    std::size_t kept = 0, next = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (next < file.unmeasured.size() && file.unmeasured[next] == i) {
        ++next;
        continue;
      }
      if (kept != i) list[kept] = std::move(list[i]);
      ++kept;
    }
    list.resize(kept);
  };
  keep(file.rotations), keep(file.positions), keep(file.directions), keep(file.headings), keep(file.weights),
      keep(file.times);
  keep(file.covariances), keep(file.factors), keep(file.lines);
  file.unmeasured.clear();
  return file;
}

FeatureFile readFeatures(std::string_view text, std::string file, const ReadingOptions& options) {
  return FeatureReader(text, std::move(file), options, {}).read();
}

bool hasFeatureChunks(const std::string& path) {
  return detail::MappedFile::isPossible(path) && !detail::isGzip(detail::MappedFile(path).bytes());
}

void readFeatureChunks(const std::string& path, const ReadingOptions& options,
                       const std::function<void(const FeatureFile&)>& take) {
  const detail::MappedFile file(path);
  FeatureReader reader(file.bytes(), sourceName(path), options, {});
  reader.inChunks([&](const FeatureFile& rows, std::size_t end) {
    if (rows.size() > 0) take(rows);
    file.forget(end);
  });
  reader.read();
}

FeatureFile detail::readFeatureRows(std::string_view text, std::string name, const ReadingOptions& options,
                                    const TakeFeature& take) {
  return FeatureReader(text, std::move(name), options, take).read();
}

std::vector<std::string> formatNames() {
  std::vector<std::string> names = {"auto"};
  for (const detail::FeatureFormat& format : detail::featureFormats()) names.emplace_back(format.name);
  return names;
}

}  // namespace liestat
