#include <cli/commands/commands.hpp>
#include <cli/commands/reading_options.hpp>
#include <cli/show/compare.hpp>
#include <formats/features.hpp>
#include <formats/input_error.hpp>
#include <report/publish.hpp>
#include <stats/compare_groups.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

struct Options {
  std::vector<std::string> files;
  ReadingOptions reading;
  std::string feature, by, json, report;
  bool paired = false;
  ComparisonOptions how;
};

/// The rows of one file, of several groups where a column names them.
struct Groups {
  std::vector<std::string> names;
  std::vector<std::vector<std::size_t>> rows;
};

/// The groups that a column of a CSV file names, in the order in which they come.
Groups groupsBy(const std::string& column, const TextFile& text, const FeatureFile& file) {
  LineReader lines(text.text);
  std::vector<std::string_view> fields;
  std::size_t at = 0, width = 0, row = 0;
  Groups groups;
  while (lines.next()) {
    splitFields(lines.line(), Separator::comma, fields);
    if (width == 0) {
      const auto found = std::find(fields.begin(), fields.end(), column);
      if (found == fields.end()) throw InputError(text.name, lines.number(), "no column " + column, "a header with it");
      at = static_cast<std::size_t>(found - fields.begin()), width = fields.size();
      continue;
    }
    if (row >= file.size() || file.lines[row] != lines.number()) continue;
    if (at >= fields.size()) throw InputError(text.name, lines.number(), "no field of the column " + column);
    if (fields[at].empty()) {
      throw InputError(text.name, lines.number(), "the column " + column + " is empty", "the name of the row's group");
    }
    const auto known = std::find(groups.names.begin(), groups.names.end(), fields[at]);
    const auto group = static_cast<std::size_t>(known - groups.names.begin());
    if (known == groups.names.end()) groups.names.emplace_back(fields[at]), groups.rows.emplace_back();
    groups.rows[group].push_back(row++);
  }
  return groups;
}

template <class M>
GroupComparison compare(const std::vector<FeatureFile>& files, const Groups& groups, const Options& options) {
  std::vector<std::vector<M>> lists;
  for (const FeatureFile& file : files) lists.push_back(featuresOf<M>(file));
  if (!groups.rows.empty()) {
    const std::vector<M> all = std::move(lists.front());
    lists.clear();
    for (const std::vector<std::size_t>& rows : groups.rows) {
      lists.emplace_back();
      for (const std::size_t row : rows) lists.back().push_back(all[row]);
    }
  }
  return options.paired ? comparePairs(lists[0], lists[1], options.how) : compareGroups(lists, options.how);
}

int runCommand(const Options& options, const Invocation& invocation) {
  const std::string command = "liestat compare";
  if (options.by.empty() ? options.files.size() < 2 : options.files.size() != 1) {
    throw OptionError(command, std::to_string(options.files.size()) + " files",
                      "a file for each of two or more groups, or one with --by COLUMN");
  }
  std::vector<FeatureFile> files;
  Groups groups;
  if (!options.by.empty()) {
    if (options.files[0] == "-") throw OptionError(command, "--by with standard input, which is read once", "a file");
    // That column is no feature's.
    ReadingOptions reading = options.reading;
    reading.ignore_unknown = true;
    files.push_back(readFeatureFile(options.files[0], reading));
    groups = groupsBy(options.by, loadText(options.files[0], options.reading.largest_file), files[0]);
  } else {
    for (const std::string& path : options.files) {
      files.push_back(readFeatureFile(path, options.reading));
      groups.names.push_back(path);
      if (files.back().kind == files.front().kind) continue;
      throw OptionError(command,
                        options.files[0] + " has " + std::string(info(files[0].kind).plural) + ", and " + path + " " +
                            std::string(info(files.back().kind).plural),
                        "files of one feature");
    }
  }
  if (options.paired && (groups.names.size() != 2 || !options.by.empty() || files[0].size() != files[1].size())) {
    throw OptionError(command, "--paired without two files of as many rows", "two files whose rows belong together");
  }
  if (groups.names.size() < 2) throw OptionError(command, "--by " + options.by + " names one group", "two or more");
  Feature feature = files.front().kind;
  if (!options.feature.empty()) {
    const std::optional<Feature> asked = featureFromName(options.feature);
    if (!info(feature).parts.contains(info(*asked).parts)) {
      throw OptionError(command,
                        "--feature " + options.feature + " with a file of " + std::string(info(feature).plural));
    }
    feature = *asked;
  }
  ComparisonOutput output{name(feature), options.files, {}};
  output.comparison = withFeature(feature, [&]<class M>() { return compare<M>(files, groups, options); });
  for (std::size_t i = 0; i < output.comparison.groups.size(); ++i) output.comparison.groups[i].name = groups.names[i];
  publishResult(options.json, formatComparison(output), invocation.command_line, options.how.seed, output);
  if (!options.report.empty()) writeComparisonReport(options.report, invocation.command_line, output);
  return output.comparison.ok() || output.comparison.status == Status::too_few ? exit_fine : exit_not_trusted;
}

}  // namespace

void addCompareCommand(const CommandList& program) {
  auto options = std::make_shared<Options>();
  const Command command = program.add("compare", "Do groups of features have one mean, and one dispersion?");
  command.option("files", options->files, "A file of features for each group, as of mean, or one with --by").required();
  command.option("--by", options->by,
                 "The column of a CSV file that names the group of each row; others are passed over");
  command.flag("--paired", options->paired, "Row i of both files belongs together");
  command.option("--feature", options->feature, "Take poses for another feature: rotation, frame, se3 ...")
      .oneOf(featureNames());
  command.option("--level", options->how.level, "Level of the verdict (default 0.05)").range(1e-6, 0.5);
  command.option("--seed", options->how.seed, "Seed of permutations and of the bootstrap (default 1)");
  declareReading(command, options->reading);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with the tests");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
