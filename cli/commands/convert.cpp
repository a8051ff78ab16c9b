#include <cli/commands/commands.hpp>
#include <cli/commands/reading_options.hpp>
#include <formats/bag.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/output_file.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>
#include <formats/trajectory.hpp>
#include <report/json.hpp>
#include <report/publish.hpp>
#include <fusion/trajectory_conversion.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* convert_name = "liestat convert";

struct ConvertOptions {
  std::string input, output, to, cov_from, cov_to, times, json;
  TrajectoryOptions reading;
  std::optional<DuplicateRule> duplicates;
  bool assume_uncorrelated = false, sampled = false, list = false;
  int samples = 2000;
  std::uint64_t seed = 1;
};

/// A conversion of a file, for people and JSON.
struct ConvertOutput {
  std::string from_format, to_format;
  std::size_t poses = 0;
  TrajectoryConversion conversion;
  std::vector<std::string> files;
};
template <class V>
void describe(V& v, const ConvertOutput& output) {
  v("from", output.from_format)("to", output.to_format)("poses", output.poses);
  describe(v, output.conversion);
  v("files", output.files);
}

/// Sentences of the library put the names of its options between backquotes; here they are options of the command line.
std::string withFlags(std::string text) {
  for (std::size_t begin = text.find('`'); begin != std::string::npos; begin = text.find('`', begin)) {
    const std::size_t end = text.find('`', begin + 1);
    std::string flag = text.substr(begin + 1, end - begin - 1);
    std::replace(flag.begin(), flag.end(), '_', '-');
    text.replace(begin, end + 1 - begin, "--" + flag);
  }
  return text;
}

/// The conversion of poses and their matrices; throws InputError for the first matrix that is not converted.
TrajectoryConversion converted(const ConvertOptions& options, const std::string& file, const std::vector<SE3d>& poses,
                               const std::vector<Matrix6d>& matrices, const std::vector<std::size_t>& lines,
                               const Convention& from, const Convention& to) {
  ConversionOptions conversion{options.assume_uncorrelated, options.sampled, options.samples, options.seed, lines};
  TrajectoryConversion result = convertTrajectory(poses, matrices, from, to, conversion);
  if (!result.faults.empty()) {
    const UnconvertedMatrix& fault = result.faults.front();
    const std::size_t line = lines[fault.row];
    throw InputError(file, line, (line == 0 ? fmt::format("pose {}: ", fault.row) : "") + fault.found,
                     withFlags(fault.expected));
  }
  for (std::string& note : result.notes) note = withFlags(note);
  return result;
}

std::string formatConvert(const ConvertOutput& output) {
  const TrajectoryConversion& c = output.conversion;
  std::string text = fmt::format("{} {} from {} to {}\n", output.poses, output.poses == 1 ? "pose" : "poses",
                                 output.from_format, output.to_format);
  if (c.from && c.to) {
    text += fmt::format("covariances from {} to {}\n", conventionName(*c.from, false), conventionName(*c.to, false));
  }
  for (const std::string& note : c.notes) text += "note: " + note + "\n";
  for (const std::string& file : output.files) text += "written: " + file + "\n";
  return text;
}

std::optional<Convention> conventionGiven(const std::string& text, const char* option) {
  if (text.empty()) return std::nullopt;
  return conventionNamed(text, option);
}

void writeConverted(const ConvertOptions& options, ConvertOutput& output, const std::string& text,
                    const std::string& side_file) {
  if (!side_file.empty()) {
    if (options.output == "-") {
      throw OptionError(convert_name, "the covariances go to a file beside the poses, which standard output has not",
                        "a file for the output, or a format that has them in its rows (csv)");
    }
    writeOutput(options.output + ".cov", side_file);
  }
  writeOutput(options.output, text);
  output.files.push_back(options.output);
  if (!side_file.empty()) output.files.push_back(options.output + ".cov");
}

/// One time for each pose, in seconds, in the first column of a file.
void readTimes(const std::string& path, double largest_file, Trajectory& trajectory) {
  const TextFile file = loadText(path, largest_file);
  requireText(file.text, file.name);
  Trajectory times;
  times.name = file.name;
  LineReader reader(file.text);
  std::vector<std::string_view> fields;
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    times.times.push_back(numberField(fields[0], "the time", file.name, reader.number()));
    times.time_texts.push_back(fields[0]);
  }
  if (times.times.size() != trajectory.size()) {
    throw InputError(file.name, 0, fmt::format("{} times", times.times.size()),
                     fmt::format("one for each of the {} poses of {}", trajectory.size(), trajectory.name));
  }
  trajectory.times = std::move(times.times), trajectory.time_texts = std::move(times.time_texts);
}

void convertPoses(const ConvertOptions& options, ConvertOutput& output, const TextFile& file) {
  Trajectory trajectory = readTrajectory(options.input, file, options.reading);
  if (!options.times.empty()) readTimes(options.times, options.reading.reading.largest_file, trajectory);
  if (options.duplicates) orderInTime(trajectory, options.duplicates);
  output.from_format = trajectory.format, output.to_format = options.to.empty() ? trajectory.format : options.to;
  output.poses = trajectory.size();
  Convention to;
  if (trajectory.hasCovariances()) {
    const Convention from = conventionOf(trajectory, conventionGiven(options.cov_from, "--cov-from"), "--cov-from");
    to = conventionToWrite(output.to_format, options.cov_to, convert_name, "--cov-to");
    output.conversion =
        converted(options, trajectory.name, trajectory.poses, trajectory.covariances, trajectory.lines, from, to);
    trajectory.covariances = output.conversion.matrices;
  } else if (!options.cov_from.empty() || !options.cov_to.empty()) {
    throw InputError(trajectory.name, 0, "the file has no covariances, and --cov-from or --cov-to is given",
                     "covariances in the file or in a side file (--cov)");
  }
  const TrajectoryText text = formatTrajectory(trajectory, output.to_format, to);
  std::vector<std::string>& notes = output.conversion.notes;
  const std::vector<std::string> read = notesOf(trajectory, options.reading),
                                 written = notesOf(text, output.to_format, to);
  notes.insert(notes.begin(), read.begin(), read.end());
  notes.insert(notes.end(), written.begin(), written.end());
  writeConverted(options, output, text.text, text.side_file);
}

void convertGraph(const ConvertOptions& options, ConvertOutput& output, const TextFile& file) {
  PoseGraph graph =
      parseGraph(file.text, file.name, options.reading.reading.ignore_unknown, options.reading.reading.norm_tolerance);
  output.from_format = name(graph.format), output.to_format = options.to.empty() ? output.from_format : options.to;
  output.poses = graph.edges.size();
  const std::optional<GraphFormat> format = named<GraphFormat>(output.to_format);
  if (!format) {
    throw InputError(graph.name, 0, fmt::format("a graph of edges to the format {}", output.to_format), "g2o or toro");
  }
  const Convention from = conventionOf(graph, conventionGiven(options.cov_from, "--cov-from"), "--cov-from");
  PoseGraph target = graph;
  target.format = *format, target.stated_convention = statedConvention(*format, graph.planar);
  const Convention to = conventionOf(target, conventionGiven(options.cov_to, "--cov-to"), "--cov-to");
  std::vector<SE3d> poses;
  std::vector<Matrix6d> matrices;
  std::vector<std::size_t> lines;
  for (const GraphEdge& e : graph.edges) {
    poses.push_back(e.measurement), matrices.push_back(e.matrix), lines.push_back(e.line);
  }
  output.conversion = converted(options, graph.name, poses, matrices, lines, from, to);
  for (std::size_t i = 0; i < graph.edges.size(); ++i) graph.edges[i].matrix = output.conversion.matrices[i];
  const std::string text = formatGraph(graph, *format, to);
  if (!graph.fixed.empty() && *format != GraphFormat::g2o)
    output.conversion.notes.emplace_back("FIX has no counterpart in TORO");
  writeConverted(options, output, text, {});
}

/// The topics of a bag as a table.
std::string formatTopics(const BagContents& bag) {
  std::size_t name = 5, type = 4;
  for (const BagTopic& t : bag.topics) name = std::max(name, t.name.size()), type = std::max(type, t.type.size());
  std::string text = fmt::format("{:{}}  {:{}}  {:8}  {:>9}  {:>20}  {:>10}\n", "topic", name, "type", type, "encoding",
                                 "messages", "first (s)", "span (s)");
  for (const BagTopic& t : bag.topics) {
    text += fmt::format("{:{}}  {:{}}  {:8}  {:>9}  {:>20.9f}  {:>10.3f}\n", t.name, name, t.type, type,
                        printable(t.encoding), t.messages, 1e-9 * static_cast<double>(t.first_ns),
                        1e-9 * static_cast<double>(t.last_ns - t.first_ns));
  }
  for (const std::string& note : bag.notes) text += "note: " + note + "\n";
  return text;
}

int runConvert(const ConvertOptions& options, const Invocation& invocation) {
  if (options.list) {
    const BagContents bag = listBag(options.input, options.reading.reading.largest_file);
    publishResult(options.json, formatTopics(bag), invocation.command_line, std::nullopt, bag);
    return exit_fine;
  }
  if (options.output.empty()) throw OptionError(convert_name, "OUT is missing", "IN OUT, or IN --list for a bag");
  ConvertOutput output;
  const TextFile file = loadTrajectoryText(options.input, options.reading.reading.largest_file);
  const bool is_graph = named<GraphFormat>(options.reading.format).has_value() ||
                        (options.reading.format == "auto" && looksLikeGraph(file.text));
  // A graph in the format of a trajectory is its vertices.
  if (is_graph && (options.to.empty() || named<GraphFormat>(options.to))) {
    convertGraph(options, output, file);
  } else {
    if (named<GraphFormat>(options.to)) {
      throw InputError(sourceName(options.input), 0, fmt::format("poses to the format {}, which has edges", options.to),
                       "a file of g2o or TORO");
    }
    convertPoses(options, output, file);
  }
  // The figures go where the result does not.
  const std::string summary = formatConvert(output);
  if (options.output == "-" || options.json == "-") {
    std::fputs(printableLines(summary).c_str(), stderr);
  } else {
    printLines(summary);
  }
  if (!options.json.empty()) {
    writeJson(options.json, jsonEnvelope(invocation.command_line, options.seed).fieldsOf(output));
  }
  return output.conversion.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addConvertCommand(const CommandList& program) {
  auto options = std::make_shared<ConvertOptions>();
  const Command command =
      program.add("convert", "Poses with covariances between the formats and conventions of other programs");
  command.option("IN", options->input, "Trajectory, graph of g2o or TORO, or BAG:TOPIC ('-': standard input)")
      .required();
  command.option("OUT", options->output, "The result ('-': standard output); covariances may go to OUT.cov");
  command.flag("--list", options->list, "List the topics of the bag IN: types, counts, spans; no OUT");
  command.option("--from", options->reading.format, "Format of IN (default auto: by its first lines)")
      .oneOf(trajectoryFormatNames());
  std::vector<std::string> written = trajectoryFormatNames(false);
  written.erase(written.begin());
  for (const char* graph : words(GraphFormat{})) written.emplace_back(graph);
  command.option("--to", options->to, "Format of OUT (default: that of IN)").oneOf(written);
  command.option("--cov-from", options->cov_from,
                 "Convention of IN's covariances: right, left, ros-fixed, ros-rpy, g2o-half ... and fields after it: "
                 "ros-fixed,unit=deg");
  command.option("--cov-to", options->cov_to,
                 "Convention of OUT's covariances, likewise (default right, if OUT can say so)");
  command.option("--cov", options->reading.covariance_file, "File of covariances beside IN (default IN.cov)");
  command.flag("--assume-uncorrelated", options->assume_uncorrelated,
               "Take unknown correlations between known components as 0");
  command.flag("--sampled", options->sampled, "Second moments by sampling, for rotations above 0.1 rad");
  command.option("--samples", options->samples, "Samples for each pose (default 2000)").range(2, 10000000);
  command.option("--seed", options->seed, "Seed of the samples (default 1)");
  command.option("--times", options->times, "File of one time in seconds for each pose, for formats without times");
  declareReading(command, options->reading, options->duplicates);
  command.option("--json", options->json, "Write figures of the conversion to a JSON file ('-': standard output)");
  command.run([options](const Invocation& invocation) { return runConvert(*options, invocation); });
}

}  // namespace liestat::cli
