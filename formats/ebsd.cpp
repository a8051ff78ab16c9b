#include <formats/ebsd.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>
#include <utility>

#include <formats/input_error.hpp>
#include <formats/text.hpp>
#include <lie/units.hpp>

namespace liestat {
namespace {

constexpr double pi = static_cast<double>(EIGEN_PI);

/// Lines as they are, comments included.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}

  bool next() {
    if (rest_.empty()) return false;
    const std::size_t end = rest_.find('\n');
    line = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    ++number;
    return true;
  }

  std::string_view line;
  std::size_t number = 0;

 private:
  std::string_view rest_;
};

/// The rest of a line after a keyword and the blanks or the colon behind it; nothing for other lines.
std::optional<std::string_view> after(std::string_view line, std::string_view keyword) {
  if (line.substr(0, keyword.size()) != keyword) return std::nullopt;
  line.remove_prefix(keyword.size());
  if (!line.empty() && line.front() != ' ' && line.front() != '\t' && line.front() != ':') return std::nullopt;
  if (!line.empty() && line.front() == ':') line.remove_prefix(1);
  return trimmed(line);
}

int wholeNumber(std::string_view field, std::string_view what, const std::string& file, std::size_t line) {
  const double value = numberField(field, what, file, line);
  if (value != std::floor(value) || value < 0 || value > 1e6) {
    throw InputError(file, line, fmt::format("{} is {}", what, value), "a whole number of 0 or more");
  }
  return static_cast<int>(value);
}

void setSymmetry(EbsdPhase& phase, std::string_view laue, HexagonalAxes axes) {
  phase.symmetry = laue;
  phase.group = PointGroup::fromName(laue, axes);
}

/// The Laue class of an EDAX code; the code itself where it is not one of theirs, or leaves the axis of a monoclinic
/// crystal to other conventions.
std::string_view laueOfEdax(std::string_view code) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 11> table{{{"1", "-1"},
                                                                                 {"2", "2/m"},
                                                                                 {"22", "mmm"},
                                                                                 {"3", "-3"},
                                                                                 {"32", "-3m"},
                                                                                 {"4", "4/m"},
                                                                                 {"42", "4/mmm"},
                                                                                 {"6", "6/m"},
                                                                                 {"62", "6/mmm"},
                                                                                 {"23", "m-3"},
                                                                                 {"43", "m-3m"}}};
  for (const auto& [number, laue] : table) {
    if (number == code) return laue;
  }
  return {};
}

/// The Laue classes by their numbers in .ctf files, from 1.
constexpr std::array<std::string_view, 11> laue_of_ctf{"-1",  "2/m", "mmm",   "4/m", "4/mmm", "-3",
                                                       "-3m", "6/m", "6/mmm", "m-3", "m-3m"};

void addPoint(EbsdFile& map, const Eigen::Vector3d& bunge, int phase, std::size_t line) {
  map.rotations.push_back(CrystalOrientation::fromBunge(bunge[0], bunge[1], bunge[2], {}).rotation());
  map.phase.push_back(phase);
  map.lines.push_back(line);
}

EbsdFile readAng(const TextFile& file) {
  EbsdFile map{.format = "ang", .phases = {}, .rotations = {}, .phase = {}, .lines = {}};
  Lines lines(file.text);
  std::vector<std::string_view> fields;
  while (lines.next()) {
    std::string_view line = trimmed(lines.line);
    if (line.empty()) continue;
    if (line.front() == '#') {
      line = trimmed(line.substr(1));
      if (const auto number = after(line, "Phase"); number && !number->empty()) {
        double value = 0;
        // "# Phase 1" begins a phase; the names of columns may begin with the same word.
        if (parseNumber(*number, value) != NumberKind::finite) continue;
        EbsdPhase phase;
        phase.number = wholeNumber(*number, "the number of a phase", file.name, lines.number);
        map.phases.push_back(phase);
      } else if (const auto name = after(line, "MaterialName"); name && !map.phases.empty()) {
        map.phases.back().name = printable(*name);
      } else if (const auto code = after(line, "Symmetry"); code && !map.phases.empty()) {
        const std::string_view laue = laueOfEdax(*code);
        setSymmetry(map.phases.back(), laue, map.axes());
        if (laue.empty()) map.phases.back().symmetry = "code " + printable(*code);
      }
      continue;
    }
    splitFields(line, Separator::blanks, fields);
    if (fields.size() < 8) {
      throw InputError(file.name, lines.number, fmt::format("{} columns", fields.size()),
                       "phi1 Phi phi2 x y quality confidence phase ...");
    }
    constexpr std::array<const char*, 3> names{"phi1", "Phi", "phi2"};
    Eigen::Vector3d angles;
    for (std::size_t i = 0; i < 3; ++i) {
      angles[static_cast<Eigen::Index>(i)] = numberField(fields[i], names[i], file.name, lines.number);
    }
    const double confidence = numberField(fields[6], "confidence", file.name, lines.number);
    if (confidence < 0 || std::abs(angles.maxCoeff() - 4 * pi) < 0.01) {
      ++map.n_unindexed;
      continue;
    }
    if (angles.cwiseAbs().maxCoeff() > 2 * pi + 0.01) {
      throw InputError(file.name, lines.number, fmt::format("an angle of {:g}", angles.cwiseAbs().maxCoeff()),
                       "rad, at most 2 pi");
    }
    int phase = wholeNumber(fields[7], "phase", file.name, lines.number);
    // A map of one phase may have 0 in all rows.
    if (phase == 0 && map.phases.size() == 1) phase = map.phases.front().number;
    addPoint(map, angles, phase, lines.number);
  }
  return map;
}

EbsdFile readCtf(const TextFile& file) {
  EbsdFile map{.format = "ctf", .phases = {}, .rotations = {}, .phase = {}, .lines = {}};
  Lines lines(file.text);
  std::vector<std::string_view> fields;
  int left = 0;  // phases of the header that are still to come
  std::array<std::size_t, 4> columns{};
  bool rows = false;
  std::string with_point;
  while (lines.next()) {
    const std::string_view line = trimmed(lines.line);
    if (line.empty()) continue;
    if (left > 0) {
      // Lengths, angles, name, Laue class, space group, parted by tabs; names have blanks.
      fields.clear();
      for (std::string_view rest = line;;) {
        const std::size_t tab = rest.find('\t');
        fields.push_back(trimmed(rest.substr(0, tab)));
        if (tab == std::string_view::npos) break;
        rest = rest.substr(tab + 1);
      }
      if (fields.size() < 4) {
        throw InputError(file.name, lines.number, fmt::format("{} fields of a phase", fields.size()),
                         "lengths, angles, name, Laue class, parted by tabs");
      }
      EbsdPhase phase;
      phase.number = static_cast<int>(map.phases.size()) + 1;
      phase.name = printable(fields[2]);
      const int laue = wholeNumber(fields[3], "the Laue class", file.name, lines.number);
      phase.symmetry = fmt::format("code {}", laue);
      if (laue >= 1 && laue <= 11) {
        setSymmetry(phase, laue_of_ctf[static_cast<std::size_t>(laue - 1)], map.axes());
      }
      map.phases.push_back(phase);
      --left;
      continue;
    }
    if (!rows) {
      if (const auto count = after(line, "Phases")) {
        left = wholeNumber(*count, "the number of phases", file.name, lines.number);
        continue;
      }
      splitFields(line, Separator::blanks, fields);
      constexpr std::array<std::string_view, 4> names{"Phase", "Euler1", "Euler2", "Euler3"};
      if (fields.empty() || fields[0] != "Phase") continue;
      for (std::size_t i = 0; i < names.size(); ++i) {
        const auto found = std::find(fields.begin(), fields.end(), names[i]);
        if (found == fields.end()) {
          throw InputError(file.name, lines.number, fmt::format("no column {}", names[i]),
                           "Phase X Y Bands Error Euler1 Euler2 Euler3 ...");
        }
        columns[i] = static_cast<std::size_t>(found - fields.begin());
      }
      rows = true;
      continue;
    }
    splitFields(line, Separator::blanks, fields);
    if (fields.size() <= *std::max_element(columns.begin(), columns.end())) {
      throw InputError(file.name, lines.number, fmt::format("{} columns", fields.size()), "those of the header");
    }
    const int phase = wholeNumber(fields[columns[0]], "Phase", file.name, lines.number);
    if (phase == 0) {
      ++map.n_unindexed;
      continue;
    }
    Eigen::Vector3d angles;
    for (std::size_t i = 0; i < 3; ++i) {
      // Some languages have a comma in place of the point.
      with_point = fields[columns[i + 1]];
      std::replace(with_point.begin(), with_point.end(), ',', '.');
      angles[static_cast<Eigen::Index>(i)] =
          units::degree * numberField(with_point, fmt::format("Euler{}", i + 1), file.name, lines.number);
    }
    addPoint(map, angles, phase, lines.number);
  }
  if (!rows)
    throw InputError(file.name, 0, "no header of the columns", "Phase X Y Bands Error Euler1 Euler2 Euler3 ...");
  return map;
}

}  // namespace

bool isEbsdName(const std::string& path) {
  if (path.size() < 4) return false;
  std::string end = path.substr(path.size() - 4);
  std::transform(end.begin(), end.end(), end.begin(), [](unsigned char c) { return std::tolower(c); });
  return end == ".ang" || end == ".ctf";
}

EbsdFile readEbsdFile(const std::string& path, std::optional<double> largest_file) {
  if (!isEbsdName(path)) throw InputError(sourceName(path), 0, "no map by its name", "a file *.ang or *.ctf");
  const TextFile file = loadText(path, largest_file);
  const char kind = static_cast<char>(std::tolower(static_cast<unsigned char>(path[path.size() - 3])));
  EbsdFile map = kind == 'a' ? readAng(file) : readCtf(file);
  if (map.rotations.empty()) {
    throw InputError(file.name, 0, fmt::format("no point was indexed, {} were not", map.n_unindexed), "orientations");
  }
  for (std::size_t i = 0; i < map.rotations.size(); ++i) {
    const auto found = std::find_if(map.phases.begin(), map.phases.end(),
                                    [&](const EbsdPhase& phase) { return phase.number == map.phase[i]; });
    if (found == map.phases.end()) {
      throw InputError(file.name, map.lines[i], fmt::format("phase {}", map.phase[i]), "one that the header has");
    }
    ++found->n;
  }
  return map;
}

}  // namespace liestat
