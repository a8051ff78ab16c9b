// schema                 : the fields of all results, as their describe() lists them, as JSON
// schema --write ROOT    : writes the tables of fields between the markers of ROOT/docs/*.md, and the classes between those
//                          of ROOT/python/liestat/__init__.pyi
// schema --check ROOT    : prints which of these files are not what would be written; the exit code is then 1
//
// A marker in a page is <!-- fields: TYPE --> … <!-- end of fields -->.
#include <report/json.hpp>

#include <fusion/convention_diagnosis_types.hpp>
#include <fusion/evaluate_types.hpp>
#include <fusion/hand_eye_types.hpp>
#include <fusion/imu/recording_windows_types.hpp>
#include <fusion/motion/results.hpp>
#include <fusion/noise_calibration.hpp>
#include <fusion/trajectory_conversion.hpp>
#include <fusion/two_view/two_view_types.hpp>
#include <fusion/visual_inertial_truth_types.hpp>
#include <stats/compare_groups_types.hpp>
#include <stats/directional_laws.hpp>
#include <stats/fit_summary_types.hpp>
#include <stats/mean_summary.hpp>
#include <stats/split_validation_types.hpp>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat {
namespace {

using Fields = std::vector<FieldDescription>;
using Kind = FieldDescription::Kind;

/// A result of the program and of the module for Python. Python's has the series too.
struct ResultType {
  std::string name;
  Fields fields, series;
};

template <class T>
ResultType typeOf() {
  FieldList list, series;
  if constexpr (requires { describeSetting(list, T()); }) describeSetting(list, T());
  describe(list, T());
  if constexpr (requires { describeSeries(series, T()); }) describeSeries(series, T());
  return {nameOfType<T>(), list.fields(), series.fields()};
}

std::vector<ResultType> allResults() {
  return {typeOf<MeanSummary>(),
          typeOf<SplitSummary>(),
          typeOf<TrajectoryEvaluation>(),
          typeOf<TrajectoryConversion>(),
          typeOf<CovarianceDiagnosis>(),
          typeOf<RecordingWindows>(),
          typeOf<ComparedWindow>(),
          typeOf<ComparedStretch>(),
          typeOf<ComparedRecording>(),
          typeOf<NoiseCalibration>(),
          typeOf<HandEyeResult>(),
          typeOf<TwoViewMotionEstimate>(),
          typeOf<TwoViewMotions>(),
          typeOf<MotionFrame>(),
          typeOf<MotionResult>(),
          typeOf<FitSummary>(),
          typeOf<LawFit>(),
          typeOf<GroupComparison>()};
}

std::string typeInWords(const FieldDescription& f) {
  std::string text;
  switch (f.kind) {
    case Kind::number:
      text = "number";
      break;
    case Kind::integer:
      text = "integer";
      break;
    case Kind::boolean:
      text = "bool";
      break;
    case Kind::text:
      text = "text";
      break;
    case Kind::result:
      text = f.fields.empty() ? "by name" : "object";
      break;
    case Kind::array: {
      const auto size = [](int n) { return n > 0 ? std::to_string(n) : std::string("n"); };
      text = size(f.rows) + (f.columns == 1 ? " numbers" : "×" + size(f.columns));
    }
  }
  if (f.list)
    text = "list of " + text + (f.kind == Kind::text || f.kind == Kind::boolean || text == "by name" ? "" : "s");
  if (f.kind == Kind::array && f.list) text = "list of " + text.substr(8, text.size() - 9);
  return f.optional ? text + " or null" : text;
}

// JSON -------------------------------------------------------------------------------------------------------------------

std::vector<JsonObject> jsonOf(const Fields& fields) {
  std::vector<JsonObject> list;
  for (const FieldDescription& f : fields) {
    JsonObject o;
    o.set("name", f.name).set("type", typeInWords(f)).set("unit", f.unit).set("meaning", f.meaning);
    if (f.kind == Kind::result) o.set("result", f.result).set("fields", jsonOf(f.fields));
    list.push_back(o);
  }
  return list;
}

// Pages ------------------------------------------------------------------------------------------------------------------

/// A row of a table: neighbours of one type and meaning share it.
struct FieldRow {
  std::string names, type, meaning;
};

/// Rows of a table. Fields of results stand below them, once for each type of result.
void addRows(std::vector<FieldRow>& rows, const Fields& fields, const std::string& prefix,
             std::map<std::string, std::string>& known) {
  for (const FieldDescription& f : fields) {
    const std::string path = prefix + f.name;
    FieldRow row{"`" + path + "`", typeInWords(f) + (f.unit.empty() ? "" : ", " + f.unit), f.meaning};
    const auto seen = known.find(f.result);
    const bool again = f.kind == Kind::result && seen != known.end() && !f.fields.empty();
    if (again) row.meaning += (f.meaning.empty() ? "fields as of `" : "; fields as of `") + seen->second + "`";
    for (std::size_t i = 0; (i = row.meaning.find('|', i)) != std::string::npos; i += 2) row.meaning.insert(i, "\\");
    if (!rows.empty() && rows.back().type == row.type && rows.back().meaning == row.meaning) {
      rows.back().names += ", " + row.names;
    } else {
      rows.push_back(row);
    }
    if (f.kind != Kind::result || again) continue;
    if (!f.fields.empty()) known[f.result] = path;
    addRows(rows, f.fields, path + (f.list ? "[]." : "."), known);
  }
}

std::string tableOf(const ResultType& type) {
  std::string text = "| field | type | meaning |\n| --- | --- | --- |\n";
  std::map<std::string, std::string> known;
  std::vector<FieldRow> rows;
  addRows(rows, type.fields, "", known);
  for (const FieldRow& row : rows) text += "| " + row.names + " | " + row.type + " | " + row.meaning + " |\n";
  return text;
}

// Python -----------------------------------------------------------------------------------------------------------------

/// Classes of the module that have the fields of a result and more.
const std::map<std::string, std::string> python_classes{{"CalibratedPose", "CalibratedPose"},
                                                        {"PoseCoordinates", "CalibratedPose"},
                                                        {"ComparedStretch", "_FusedWindows"},
                                                        {"ComparedWindow", "InitialisedWindow"}};

std::string pythonType(const FieldDescription& f, bool series) {
  std::string type;
  switch (f.kind) {
    case Kind::number:
      type = "float";
      break;
    case Kind::integer:
      type = "int";
      break;
    case Kind::boolean:
      type = "bool";
      break;
    case Kind::text:
      type = "str";
      break;
    case Kind::array:
      type = "_Array";
      break;
    case Kind::result: {
      const auto known = python_classes.find(f.result);
      type = known != python_classes.end() ? known->second : f.fields.empty() ? "Result" : "_" + f.result;
    }
  }
  const bool stacked = f.kind == Kind::number || f.kind == Kind::integer || f.kind == Kind::boolean || series;
  if (f.list) type = stacked && f.kind != Kind::result ? "_Array" : "list[" + type + "]";
  return f.optional ? type + " | None" : type;
}

/// The attributes of a mean are those of one mean, with dictionaries inside, or an array of the axes that are left. Features
/// have the type of the argument, which the class does not know.
std::string pythonTypeOfMean(const FieldDescription& f) {
  if (f.name == "mean" || f.name == "rivals" || f.name == "near_ties") return "Any";
  if (f.name == "unique") return "Uniqueness | _Several";
  FieldDescription single = f;
  single.optional = single.list = false;
  std::string type = f.kind == Kind::result ? "dict[str, Any]" : pythonType(single, false);
  if (f.list) type = "list[" + type + "]";
  if (f.kind != Kind::array) type += " | _Several";
  return f.optional ? type + " | None" : type;
}

/// Classes of the results inside before that of the result.
void addClasses(std::string& text, const std::string& name, const Fields& fields, const Fields& series,
                std::map<std::string, bool>& known) {
  if (std::exchange(known[name], true)) return;
  const bool mean = name == "MeanSummary";
  for (const Fields& list : {fields, series}) {
    for (const FieldDescription& f : list) {
      if (!mean && f.kind == Kind::result && !f.fields.empty()) addClasses(text, f.result, f.fields, {}, known);
    }
  }
  text += "class _" + name + (mean ? ":\n" : "(Result):\n");
  std::map<std::string, bool> written;
  for (const Fields* list : {&fields, &series}) {
    for (const FieldDescription& f : *list) {
      if (std::exchange(written[f.name], true)) continue;
      const std::string type = pythonType(f, list == &series);
      std::string comment = mean ? typeInWords(f) : "";
      for (const std::string& part : {f.meaning, f.unit}) {
        if (!part.empty()) comment += (comment.empty() ? "" : "; ") + part;
      }
      std::string line = "    " + f.name + ": " + (mean ? pythonTypeOfMean(f) : type);
      const bool beside = line.size() + comment.size() < 116;
      if (!comment.empty()) line = beside ? line + "  # " + comment : "    # " + comment + "\n" + line;
      text += line + "\n";
    }
  }
  text += "\n";
}

std::string classesOf(const std::vector<ResultType>& results) {
  std::string text;
  std::map<std::string, bool> known;
  for (const ResultType& type : results) addClasses(text, type.name, type.fields, type.series, known);
  return text;
}

// Files ------------------------------------------------------------------------------------------------------------------

std::string contents(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path.string());
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// The text with what stands between lines that begin with `begin` and end with `end`, written anew from what the first of
/// them says behind `begin`.
std::string renewed(const std::string& text, const std::string& begin, const std::string& end,
                    const std::function<std::string(const std::string& named)>& written) {
  std::string result;
  std::istringstream lines(text);
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    if (inside && line != end) continue;
    inside = line.starts_with(begin);
    result += line + "\n";
    if (inside) result += written(line.substr(begin.size()));
  }
  if (inside) throw std::runtime_error("no line '" + end + "'");
  return result;
}

int run(const std::vector<std::string>& arguments) {
  const std::vector<ResultType> results = allResults();
  if (arguments.empty()) {
    JsonObject object;
    for (const ResultType& type : results) {
      object.set(type.name, JsonObject().set("fields", jsonOf(type.fields)).set("series", jsonOf(type.series)));
    }
    std::cout << object.str();
    return 0;
  }
  if (arguments.size() != 2 || (arguments[0] != "--write" && arguments[0] != "--check")) {
    std::cerr << "usage: schema [--write ROOT | --check ROOT]\n";
    return 2;
  }
  const std::filesystem::path root = arguments[1];
  std::map<std::filesystem::path, std::string> files;
  const auto table = [&](const std::string& named) {
    const std::string name = named.substr(0, named.find(' '));
    for (const ResultType& type : results) {
      if (type.name == name) return "\n" + tableOf(type) + "\n";
    }
    throw std::runtime_error("a marker of fields names " + name + ", which is no result");
  };
  for (const auto& entry : std::filesystem::directory_iterator(root / "docs")) {
    if (entry.path().extension() != ".md") continue;
    files[entry.path()] = renewed(contents(entry.path()), "<!-- fields: ", "<!-- end of fields -->", table);
  }
  const std::filesystem::path stub = root / "python/liestat/__init__.pyi";
  files[stub] = renewed(contents(stub), "# fields of results", "# end of fields",
                        [&](const std::string&) { return classesOf(results); });
  int stale = 0;
  for (const auto& [path, text] : files) {
    if (contents(path) == text) continue;
    if (arguments[0] == "--write") {
      std::ofstream(path) << text;
      std::cout << "written: " << path.string() << '\n';
    } else {
      std::cout << path.string()
                << " has fields that the results do not have, or lacks some: ./run generate writes them\n";
      stale = 1;
    }
  }
  return stale;
}

}  // namespace
}  // namespace liestat

int main(int argc, char** argv) {
  try {
    return liestat::run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::cerr << "schema: " << error.what() << '\n';
    return 2;
  }
}
