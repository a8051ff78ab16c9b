#include <formats/two_view_pairs.hpp>

#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

namespace liestat {
namespace {

using ImageSizes = std::map<std::pair<std::string, std::string>, Eigen::Vector2d>;  // by folder and name

const char* labelColumn(PairFamily family) {
  return family == PairFamily::adelaide ? "structure" : family == PairFamily::evd ? "inlier" : "validation";
}

/// The size that a note tells, if it does.
std::optional<Eigen::Vector2d> sizeIn(std::string_view note, const std::string& file, std::size_t line) {
  constexpr std::string_view key = "imsize=";
  const std::size_t at = note.find(key);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view text = note.substr(at + key.size());
  int height = 0, width = 0;
  const char* const end = text.data() + text.size();
  auto [next, error] = std::from_chars(text.data(), end, height);
  if (error == std::errc() && next != end && *next == 'x') {
    next = std::from_chars(next + 1, end, width).ptr;
  }
  if (height <= 0 || width <= 0) {
    throw InputError(file, line, "the note is '" + printable(note) + "'", "imsize=HEIGHTxWIDTH in whole pixels");
  }
  return Eigen::Vector2d(width, height);
}

ImageSizes readImageSizes(const std::filesystem::path& path) {
  ImageSizes sizes;
  if (!std::filesystem::exists(path)) return sizes;
  const TextFile file = loadText(path.string());
  requireText(file.text, file.name);
  LineReader reader(file.text);
  std::vector<std::string_view> fields;
  if (!reader.next()) throw InputError(file.name, 0, "the file has no data", "the columns family,pair,note");
  splitFields(reader.line(), Separator::comma, fields);
  const std::vector<std::string> names = readHeader(fields, file.name, reader.number());
  const auto place = [&](const char* column) {
    const auto found = std::find(names.begin(), names.end(), column);
    if (found == names.end()) {
      throw InputError(file.name, reader.number(), fmt::format("there is no column '{}'", column),
                       "the columns family,pair,note");
    }
    return static_cast<std::size_t>(found - names.begin());
  };
  const std::size_t family = place("family"), pair = place("pair"), note = place("note");
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma, fields);
    if (fields.size() != names.size())
      throwWrongWidth(fields.size(), names.size(), "as in the header", file.name, reader.number());
    if (const auto size = sizeIn(fields[note], file.name, reader.number())) {
      sizes[{std::string(fields[family]), std::string(fields[pair])}] = *size;
    }
  }
  return sizes;
}

}  // namespace

TwoViewPair readTwoViewPair(const std::string& path, PairFamily family) {
  const std::string label = labelColumn(family);
  const NumericTable table = readTable(path, {"x1", "y1", "x2", "y2", label});
  TwoViewPair pair;
  pair.family = family;
  pair.name = std::filesystem::path(path).stem().string();
  Eigen::Vector2d high;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Eigen::Vector4d m(table(row, 0), table(row, 1), table(row, 2), table(row, 3));
    const std::size_t value = table.index(row, 4);
    if (family != PairFamily::adelaide && value > 1) {
      throw InputError(table.file(), table.line(row), fmt::format("{} is {}", label, value), "0 or 1");
    }
    if (label == "validation" && value == 1) {
      pair.validation.push_back(m);
    } else {
      pair.matches.push_back(m);
      if (label != "validation") pair.labels.push_back(value);
    }
    const Eigen::Vector2d low_here = m.head<2>().cwiseMin(m.tail<2>()), high_here = m.head<2>().cwiseMax(m.tail<2>());
    pair.corner = row == 0 ? low_here : pair.corner.cwiseMin(low_here).eval();
    high = row == 0 ? high_here : high.cwiseMax(high_here).eval();
  }
  pair.size = high - pair.corner;
  if (pair.matches.empty()) throw InputError(table.file(), 0, "all points validate", "tentative matches");
  if (label == "validation" && pair.validation.empty()) {
    throw InputError(table.file(), 0, "no point validates", "points with validation = 1");
  }
  if (!(pair.size.minCoeff() > 0)) throw InputError(table.file(), 0, "all points are on one line", "an image's points");
  return pair;
}

std::vector<TwoViewPair> readTwoViewPairs(const std::string& directory) {
  const std::filesystem::path root(directory);
  std::error_code error;
  if (!std::filesystem::is_directory(root, error)) throw InputError(sourceName(directory), 0, "this is no directory");
  const ImageSizes sizes = readImageSizes(root / "manifest.csv");
  std::vector<TwoViewPair> pairs;
  for (std::size_t k = 0; k < words(PairFamily{}).size(); ++k) {
    const auto family = static_cast<PairFamily>(k);
    const std::filesystem::path folder = root / name(family);
    if (!std::filesystem::is_directory(folder, error)) continue;
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::string stem = entry.path().stem().string();
      if (entry.path().extension() == ".csv" && !stem.ends_with("_model")) files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());
    for (const std::string& file : files) {
      pairs.push_back(readTwoViewPair(file, family));
      const auto size = sizes.find({name(family), pairs.back().name});
      if (size == sizes.end()) continue;
      pairs.back().corner.setZero();
      pairs.back().size = size->second;
    }
  }
  if (pairs.empty()) {
    throw InputError(sourceName(directory), 0, "there are no pairs in it",
                     "the folders homogr, kusvod2, adelaide-rmf or evd with files NAME.csv");
  }
  return pairs;
}

}  // namespace liestat
