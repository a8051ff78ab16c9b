#include <formats/npy.hpp>

#include <fmt/format.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include <formats/input_error.hpp>

namespace liestat {
namespace {

constexpr std::string_view npy_magic = "\x93NUMPY";

/// The value of a key of the header, a Python dictionary, up to the comma or brace behind it.
std::string_view headerValue(std::string_view header, std::string_view key) {
  const std::size_t found = header.find(fmt::format("'{}'", key));
  if (found == std::string_view::npos) return {};
  const std::size_t colon = header.find(':', found);
  if (colon == std::string_view::npos) return {};
  const std::size_t begin = header.find_first_not_of(' ', colon + 1);
  if (begin == std::string_view::npos) return {};
  const char close = header[begin] == '(' ? ')' : header[begin] == '[' ? ']' : ',';
  const std::size_t end = std::min(header.find(close, begin), header.size());
  return header.substr(begin, end - begin + (close == ',' ? 0 : 1));
}

}  // namespace

bool NpyFile::isOne(const std::string& path) {
  // A pipe is read once, and not here.
  if (!detail::MappedFile::isPossible(path)) return false;
  return detail::MappedFile(path).bytes().substr(0, npy_magic.size()) == npy_magic;
}

NpyFile::NpyFile(const std::string& path) : name_(sourceName(path)), file_(path) {
  const auto refuse = [&](const std::string& found, const std::string& expected) {
    throw InputError(name_, 0, found, expected);
  };
  const std::string_view all = file_.bytes();
  const std::size_t size = all.size();
  const int version = size > 12 && all.substr(0, 6) == npy_magic ? static_cast<unsigned char>(all[6]) : 0;
  if (version < 1 || version > 3) refuse("this is no .npy file of a version that is known", "version 1, 2 or 3");
  std::size_t length = 0;
  for (int i = version == 1 ? 1 : 3; i >= 0; --i) {
    length = 256 * length + static_cast<unsigned char>(all[8 + static_cast<std::size_t>(i)]);
  }
  offset_ = (version == 1 ? 10 : 12) + length;
  if (offset_ > size) refuse("the file ends within its header", "the whole file");
  const std::string_view header = all.substr(offset_ - length, length);

  const std::string type(headerValue(header, "descr"));
  if (type.find('O') != std::string::npos) refuse("an array of Python objects", "numbers: array.astype('<f8')");
  if (type.find('>') != std::string::npos) {
    refuse(fmt::format("big-endian numbers ({})", printable(type)), "little-endian ones: array.astype('<f8')");
  }
  if (type != "'<f8'" && type != "'<f4'") {
    refuse(fmt::format("numbers of the type {}", printable(type)), "doubles or floats: array.astype('<f8')");
  }
  single_ = type == "'<f4'";
  if (headerValue(header, "fortran_order") != "False") {
    refuse("an array in Fortran's order", "rows one behind the other: numpy.ascontiguousarray(array)");
  }
  std::string_view shape = headerValue(header, "shape");
  std::vector<std::uint64_t> sizes;
  while (!shape.empty()) {
    std::uint64_t n = 0;
    const std::size_t digit = std::min(shape.find_first_of("0123456789"), shape.size());
    const auto [end, error] = std::from_chars(shape.data() + digit, shape.data() + shape.size(), n);
    if (digit == shape.size() || error != std::errc()) break;
    sizes.push_back(n);
    shape.remove_prefix(static_cast<std::size_t>(end - shape.data()));
  }
  if (sizes.size() != 2 || sizes[1] == 0 || sizes[1] > most_columns) {
    refuse(fmt::format("an array of the shape {}", printable(headerValue(header, "shape"))),
           "rows of 3, 4 or 7 numbers: shape (n, 4) for quaternions x y z w");
  }
  rows_ = sizes[0], columns_ = sizes[1];
  const std::size_t row = columns_ * (single_ ? sizeof(float) : sizeof(double)), there = size - offset_;
  if (rows_ > there / row || rows_ * row != there) {
    refuse(fmt::format("{} bytes of numbers behind the header", there),
           fmt::format("{} rows of {} bytes: the file is truncated, or not finished", rows_, row));
  }
  if (rows_ == 0) refuse("the array has no rows", "at least one");
}

NpyFile::NpyFile(const std::string& path, std::string name, std::size_t columns)
    : name_(std::move(name)), file_(path), rows_(bytes() / (columns * sizeof(double))), columns_(columns) {}

RowsOnDisk::RowsOnDisk(std::size_t columns) : columns_(columns) {
  const char* const directory = std::getenv("TMPDIR");
  path_ = std::string(directory != nullptr && *directory != 0 ? directory : "/tmp") + "/liestat.XXXXXX";
  file_ = ::mkostemp(path_.data(), O_CLOEXEC);
  if (file_ < 0) throw InputError(path_, 0, std::string("cannot be written: ") + std::strerror(errno));
  // Whatever ends the process, the file is gone with it.
  ::unlink(path_.c_str());
}
RowsOnDisk::~RowsOnDisk() { ::close(file_); }

void RowsOnDisk::add(const double* numbers, std::size_t rows) {
  const auto* bytes = reinterpret_cast<const char*>(numbers);
  for (std::size_t left = rows * columns_ * sizeof(double); left > 0;) {
    const ssize_t count = ::write(file_, bytes, left);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      throw InputError(path_, 0, std::string("rows of a large file cannot be written: ") + std::strerror(errno),
                       "room there, or another directory in TMPDIR");
    }
    bytes += count, left -= static_cast<std::size_t>(count);
  }
  rows_ += rows;
}

NpyFile RowsOnDisk::array(const std::string& name) const {
  return {fmt::format("/proc/self/fd/{}", file_), name, columns_};
}

const double* NpyFile::doubles() const {
  const char* const first = file_.bytes().data() + offset_;
  return single_ || reinterpret_cast<std::uintptr_t>(first) % alignof(double) != 0
             ? nullptr
             : reinterpret_cast<const double*>(first);
}

void NpyFile::read(std::size_t begin, std::size_t count, double* numbers) const {
  const std::size_t n = count * columns_;
  const char* const from =
      file_.bytes().data() + offset_ + begin * columns_ * (single_ ? sizeof(float) : sizeof(double));
  if (!single_) {
    std::memcpy(numbers, from, n * sizeof(double));
    return;
  }
  for (std::size_t i = 0; i < n; ++i) {
    float x;
    std::memcpy(&x, from + i * sizeof x, sizeof x);
    numbers[i] = static_cast<double>(x);
  }
}

void NpyFile::forget(std::size_t end) const {
  file_.forget(offset_ + end * columns_ * (single_ ? sizeof(float) : sizeof(double)));
}

Feature featureOfRows(const NpyFile& file, const std::optional<Feature>& wish) {
  if (file.columns() == 4) return Feature::rotation;
  if (file.columns() == 7) return Feature::frame;
  if (file.columns() == 3 && (wish == Feature::point || wish == Feature::direction)) return *wish;
  throw InputError(file.name(), 0, fmt::format("rows of {} numbers", file.columns()),
                   file.columns() == 3 ? "--feature point or --feature direction, which says what they are"
                                       : "4 (x y z w), 7 (tx ty tz qx qy qz qw), or 3 with --feature");
}

FeatureFile readNpyFeatures(const NpyFile& file, const std::optional<Feature>& wish, double norm_tolerance) {
  FeatureFile result;
  result.kind = featureOfRows(file, wish);
  result.format = "npy";
  const FeatureParts& parts = info(result.kind).parts;
  std::vector<double> row(file.columns());
  for (std::size_t i = 0; i < file.rows(); ++i) {
    file.read(i, 1, row.data());
    const auto unit = [&](auto v, const char* what) {
      const double norm = v.norm(), error = std::abs(norm - 1);
      if (!(error <= norm_tolerance)) {
        throw InputError(file.name(), i + 1, fmt::format("the norm of the {} is {:.6g}", what, norm),
                         fmt::format("1 within {:g} (row {} of the array)", norm_tolerance, i + 1));
      }
      if (error > 1e-12) {
        ++result.n_normalised;
        result.largest_norm_error = std::max(result.largest_norm_error, error);
      }
      return decltype(v)(v / norm);
    };
    const double* const last = row.data() + file.columns();
    if (parts.contains(FeaturePart::rotation)) {
      result.rotations.emplace_back(unit(Eigen::Vector4d(last - 4), "quaternion"));
    }
    if (parts.contains(FeaturePart::direction)) {
      result.directions.push_back(unit(Eigen::Vector3d(row.data()), "direction"));
    }
    if (parts.contains(FeaturePart::position)) {
      const Eigen::Vector3d position(row.data());
      if (!position.allFinite()) {
        throw InputError(file.name(), i + 1, fmt::format("row {} of the array is not finite", i + 1), "finite numbers");
      }
      result.positions.push_back(position);
    }
    result.lines.push_back(i + 1);
  }
  return result;
}

}  // namespace liestat
