#include <cli/commands/commands.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/numeric_table.hpp>
#include <cli/io/output_file.hpp>
#include <cli/io/pose_graph_file.hpp>
#include <cli/io/text.hpp>
#include <cli/io/trajectory_rows.hpp>
#include <cli/io/trajectory_writer.hpp>
#include <cli/show/json.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>
#include <stats/convention_sampling.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
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
  std::string input, output, to, cov_from, cov_to, cov_layout, times, json;
  TrajectoryOptions reading;
  bool assume_uncorrelated = false, sampled = false;
  int samples = 2000;
  std::uint64_t seed = 1;
};

/// Figures of a conversion, for people and JSON.
struct ConvertOutput {
  std::string from_format, to_format;
  std::optional<Convention> from, to;  ///< of the covariances; nothing if there are none
  std::size_t poses = 0, covariances = 0, unknown = 0, partly_unknown = 0, assumed = 0;
  std::vector<std::size_t> indefinite;  ///< lines, or numbers from 0 where there are none
  double round_trip = 0, rotation_sigma = 0, sampling_error = 0;
  std::size_t beyond_first_order = 0, far_input = 0, zero_variances = 0;
  std::vector<std::string> notes;
  std::vector<std::string> files;
};

/// The error of a matrix: the pose at which it is, and where the row stands.
struct ConvertRow {
  const SE3d& pose;
  std::size_t line, index;
};

/// True if the part of a matrix that is known is positive semidefinite up to rounding.
bool isSemidefinite(const Matrix6& matrix) {
  Matrix6 C = matrix;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      if (std::isnan(C(i, j))) C(i, j) = i == j ? 1 : 0;
    }
  }
  // Free of units, and with room for the rounding of what is singular.
  Matrix6 R;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double scale = std::sqrt(C(i, i) * C(j, j));
      R(i, j) = scale > 0 ? C(i, j) / scale : (i == j ? 1 : (C(i, j) == 0 ? 0 : 2));
    }
    R(i, i) += 1e-9;
  }
  return detail::Cholesky<double, 6>(R).ok();
}

/// Converts matrices one by one and keeps account.
class Converter {
 public:
  Converter(const ConvertOptions& options, const Convention& from, const Convention& to, std::string file,
            ConvertOutput& output)
      : options_(options), from_(from), to_(to), file_(std::move(file)), output_(output) {}

  Matrix6 convert(Matrix6 matrix, const ConvertRow& row) {
    ++output_.covariances;
    if (options_.assume_uncorrelated && fillCross(matrix)) ++output_.assumed;
    if (matrix.array().isNaN().all()) {
      ++output_.unknown;
      return matrix;
    }
    if (matrix.array().isNaN().any()) ++output_.partly_unknown;
    for (int i = 0; i < 6; ++i) {
      if (matrix(i, i) == 0) {
        ++output_.zero_variances;
        break;
      }
    }
    if (!isSemidefinite(matrix)) {
      output_.indefinite.push_back(row.line > 0 ? row.line : row.index);
      if (from_.content != CovarianceContent::covariance || to_.content != CovarianceContent::covariance) {
        throw InputError(file_, row.line, "the matrix is indefinite", "a positive definite one, to change its content");
      }
    }
    Convention same = from_;
    same.layout = to_.layout;
    if (same == to_) return matrix;
    const Gaussian<SE3d> g = fromConvention(from_, row.pose, matrix);
    look(g, row);
    if (options_.sampled && family(from_.perturbation) != family(to_.perturbation) && g.covariance.allFinite()) {
      return sample(matrix, row);
    }
    const Matrix6 converted = convertConvention(from_, to_, row.pose, matrix);
    if (converted.array().isNaN().all()) throwUndetermined(matrix, row);
    return converted;
  }

 private:
  /// Covariances between known components that are not known become zero; true if there were any.
  static bool fillCross(Matrix6& matrix) {
    bool any = false;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        if (!std::isnan(matrix(i, j)) || std::isnan(matrix(i, i)) || std::isnan(matrix(j, j))) continue;
        matrix(i, j) = 0;
        any = true;
      }
    }
    return any;
  }

  /// The conversion's losses; throws InputError where the result would not be a covariance any more.
  void look(const Gaussian<SE3d>& g, const ConvertRow& row) {
    const ConversionLoss loss = conversionLoss(from_, to_, g);
    output_.round_trip = std::max(output_.round_trip, loss.round_trip);
    output_.rotation_sigma = std::max(output_.rotation_sigma, loss.rotation_sigma);
    if (loss.firstOrderFails()) ++output_.beyond_first_order;
    if (loss.problem == ConversionProblem::none) return;
    if (loss.problem == ConversionProblem::far_origin && to_.perturbation != Perturbation::left) {
      // Losses before this file are its writer's.
      ++output_.far_input;
      return;
    }
    const Eigen::Vector3d p = g.mean.translation();
    std::string found = message(loss.problem);
    if (loss.problem == ConversionProblem::far_origin) found = fmt::format("|p| is {:.6g} m: {}", p.norm(), found);
    if (row.line == 0) found = fmt::format("pose {}: {}", row.index, found);
    throw InputError(file_, row.line, found,
                     loss.problem == ConversionProblem::undefined_angles
                         ? std::string()
                         : fmt::format("a round trip within {:g} sigma, this one loses {:.2g}", largest_round_trip,
                                       loss.round_trip));
  }

  Matrix6 sample(const Matrix6& matrix, const ConvertRow& row) {
    const Matrix6 covariance = covarianceFromContent(from_.content, matrix);
    const SampledMoments moments =
        sampledConversion(from_, to_, row.pose, covariance, options_.samples, options_.seed, row.index);
    output_.sampling_error = std::max(output_.sampling_error, moments.relative_error);
    return covarianceAsContent(to_.content, moments.second_moment);
  }

  [[noreturn]] void throwUndetermined(const Matrix6& matrix, const ConvertRow& row) const {
    const bool cross = matrix.diagonal().allFinite();
    throw InputError(file_, row.line,
                     fmt::format("{}the matrix does not determine one of '{}'",
                                 row.line == 0 ? fmt::format("pose {}: ", row.index) : "", conventionName(to_, false)),
                     cross ? "all covariances between components, or --assume-uncorrelated" : "the whole matrix");
  }

  const ConvertOptions& options_;
  Convention from_, to_;
  std::string file_;
  ConvertOutput& output_;
};

void addConvertNotes(ConvertOutput& output, const ConvertOptions& options) {
  auto& notes = output.notes;
  const auto lines = [](const std::vector<std::size_t>& list) {
    std::string text;
    for (std::size_t k = 0; k < list.size() && k < 3; ++k) text += (k > 0 ? ", " : "") + std::to_string(list[k]);
    return text + (list.size() > 3 ? ", ..." : "");
  };
  if (output.unknown > 0)
    notes.push_back(fmt::format("{} covariances are unknown as a whole, and stay so", output.unknown));
  if (output.partly_unknown > 0) {
    notes.push_back(
        fmt::format("{} covariances have unknown entries; what depends on them is unknown", output.partly_unknown));
  }
  if (output.assumed > 0)
    notes.push_back(fmt::format("{} covariances: unknown correlations taken as 0", output.assumed));
  if (!output.indefinite.empty()) {
    notes.push_back(fmt::format("{} of {} matrices are indefinite (line {})", output.indefinite.size(),
                                output.covariances, lines(output.indefinite)));
  }
  if (output.zero_variances > 0) {
    notes.push_back(fmt::format("{} matrices have a variance of 0: rounded away by whoever wrote the file?",
                                output.zero_variances));
  }
  if (output.far_input > 0) {
    notes.push_back(
        fmt::format("{} matrices are about an origin so far away that digits have cancelled: bound {:.2g} "
                    "sigma",
                    output.far_input, output.round_trip));
  }
  if (output.beyond_first_order > 0 && !options.sampled) {
    notes.push_back(
        fmt::format("{} rotations have a sigma above {} rad (largest {:.3g}): first order fails, use "
                    "--sampled",
                    output.beyond_first_order, first_order_sigma, output.rotation_sigma));
  }
  if (options.sampled && output.sampling_error > 0) {
    notes.push_back(fmt::format("second moments by sampling, standard error {:.2g} of the variances at most",
                                output.sampling_error));
  }
}

std::string formatConvert(const ConvertOutput& output) {
  std::string text = fmt::format("{} {} from {} to {}\n", output.poses, output.poses == 1 ? "pose" : "poses",
                                 output.from_format, output.to_format);
  if (output.from && output.to) {
    text += fmt::format("covariances from {} to {}\n", conventionName(*output.from, false),
                        conventionName(*output.to, false));
  }
  for (const std::string& note : output.notes) text += "note: " + note + "\n";
  for (const std::string& file : output.files) text += "written: " + file + "\n";
  return text;
}

void setConvert(JsonObject& object, const ConvertOutput& output) {
  object.set("from", output.from_format).set("to", output.to_format).set("poses", output.poses);
  object.set("covariances", output.covariances);
  const auto convention = [&](const char* key, const std::optional<Convention>& c) {
    if (!c) {
      object.set(key, nullptr);
      return;
    }
    JsonObject fields;
    fields.set("name", conventionName(*c)).set("order", name(c->order)).set("perturbation", name(c->perturbation));
    fields.set("unit", name(c->unit)).set("content", name(c->content)).set("layout", name(c->layout));
    object.set(key, fields);
  };
  convention("covariance_from", output.from), convention("covariance_to", output.to);
  object.set("unknown", output.unknown).set("partly_unknown", output.partly_unknown);
  object.set("assumed_uncorrelated", output.assumed).set("indefinite", output.indefinite.size());
  object.set("zero_variances", output.zero_variances);
  object.set("round_trip_bound", output.round_trip).set("largest_rotation_sigma_rad", output.rotation_sigma);
  object.set("beyond_first_order", output.beyond_first_order).set("sampling_error", output.sampling_error);
  object.set("notes", output.notes).set("files", output.files);
}

std::optional<Convention> conventionGiven(const std::string& text, const char* option) {
  if (text.empty()) return std::nullopt;
  return conventionNamed(text, option);
}

void writeConverted(const ConvertOptions& options, ConvertOutput& output, const std::string& text,
                    const std::string& side_file) {
  if (!side_file.empty()) {
    if (options.output == "-") {
      throw InputError(convert_name, 0, "the covariances go to a file beside the poses, which standard output has not",
                       "a file for the output, or a format that has them in its rows (csv)");
    }
    writeOutput(options.output + ".cov", side_file);
  }
  writeOutput(options.output, text);
  output.files.push_back(options.output);
  if (!side_file.empty()) output.files.push_back(options.output + ".cov");
}

/// One time for each pose, in seconds, in the first column of a file.
void readTimes(const std::string& path, Trajectory& trajectory) {
  const TextFile file = loadText(path);
  requireText(file.text, file.name);
  Trajectory times;
  times.name = file.name;
  LineReader reader(file.text);
  std::vector<std::string_view> fields;
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    appendTime(times, fields[0], reader.number());
  }
  if (times.times.size() != trajectory.size()) {
    throw InputError(file.name, 0, fmt::format("{} times", times.times.size()),
                     fmt::format("one for each of the {} poses of {}", trajectory.size(), trajectory.name));
  }
  trajectory.times = std::move(times.times), trajectory.time_texts = std::move(times.time_texts);
}

/// The convention of the result: the one that was asked for, or liestat's where the file can say so.
Convention targetConvention(const ConvertOptions& options, const std::string& format) {
  const auto given = conventionGiven(options.cov_to, "--cov-to");
  if (given && (isSelfDescribing(format) && options.cov_to.find("layout=") == std::string::npos)) {
    Convention c = *given;
    c.layout = CovarianceLayout::upper21;
    return conventionFor(format, c);
  }
  if (given) {
    const Convention c = conventionFor(format, *given);
    if (c.layout != given->layout && options.cov_to.find("layout=") != std::string::npos) {
      throw InputError(convert_name, 0,
                       fmt::format("--cov-to {}, but the format {} has its own layout", options.cov_to, format),
                       std::string(name(c.layout)));
    }
    return c;
  }
  if (isSelfDescribing(format)) return conventionFor(format, {.layout = CovarianceLayout::upper21});
  if (format.rfind("mavlink", 0) == 0) return *conventionPreset("mavlink");
  throw InputError(convert_name, 0, fmt::format("the format {} cannot say what its covariances mean", format),
                   "--cov-to with a convention (docs/which_convention.md)");
}

void convertTrajectory(const ConvertOptions& options, ConvertOutput& output) {
  Trajectory trajectory = readTrajectory(options.input, options.reading);
  if (!options.times.empty()) readTimes(options.times, trajectory);
  output.from_format = trajectory.format, output.to_format = options.to.empty() ? trajectory.format : options.to;
  output.poses = trajectory.size();
  if (trajectory.n_normalised > 0) {
    output.notes.push_back(fmt::format("{} rotations were normalised, off by {:.2g} at most", trajectory.n_normalised,
                                       trajectory.largest_norm_error));
  }
  if (trajectory.n_unmeasured > 0) {
    output.notes.push_back(fmt::format("{} rows have components with a variance of {:g} or more: not measured",
                                       trajectory.n_unmeasured, options.reading.unmeasured));
  }
  Convention to;
  if (trajectory.hasCovariances()) {
    const Convention from = conventionOf(trajectory, conventionGiven(options.cov_from, "--cov-from"), "--cov-from");
    to = targetConvention(options, output.to_format);
    output.from = from, output.to = to;
    Converter converter(options, from, to, trajectory.name, output);
    for (std::size_t i = 0; i < trajectory.size(); ++i) {
      trajectory.covariances[i] =
          converter.convert(trajectory.covariances[i], {trajectory.poses[i], trajectory.lines[i], i});
    }
  } else if (!options.cov_from.empty() || !options.cov_to.empty()) {
    throw InputError(trajectory.name, 0, "the file has no covariances, and --cov-from or --cov-to is given",
                     "covariances in the file or in a side file (--cov)");
  }
  const TrajectoryText text = formatTrajectory(trajectory, output.to_format, to);
  addConvertNotes(output, options);
  if (text.n_rounded_times > 0) {
    output.notes.push_back(fmt::format("{} times have digits that the format {} has not; they were cut off",
                                       text.n_rounded_times, output.to_format));
  }
  if (text.n_lost_cross > 0) {
    output.notes.push_back(fmt::format("{} covariances have a cross block, for which the layout {} has no place",
                                       text.n_lost_cross, name(to.layout)));
  }
  if (text.n_marked > 0) {
    output.notes.push_back(fmt::format("{} unknown components are written as a variance of 1e6", text.n_marked));
  }
  writeConverted(options, output, text.text, text.side_file);
}

void convertGraph(const ConvertOptions& options, ConvertOutput& output, const TextFile& file) {
  PoseGraph graph =
      parseGraph(file.text, file.name, options.reading.reading.ignore_unknown, options.reading.reading.norm_tolerance);
  output.from_format = graph.format, output.to_format = options.to.empty() ? graph.format : options.to;
  output.poses = graph.edges.size();
  const auto formats = graphFormatNames();
  if (std::find(formats.begin(), formats.end(), output.to_format) == formats.end()) {
    throw InputError(graph.name, 0, fmt::format("a graph of edges to the format {}", output.to_format), "g2o or toro");
  }
  const Convention from = conventionOf(graph, conventionGiven(options.cov_from, "--cov-from"), "--cov-from");
  PoseGraph target = graph;
  target.format = output.to_format, target.stated_convention.reset();
  if (output.to_format == "toro" && !graph.planar) target.stated_convention = conventionPreset("toro");
  if (output.to_format == "g2o" && graph.planar) {
    target.stated_convention =
        Convention{.perturbation = Perturbation::body_axes, .content = CovarianceContent::information};
  }
  const Convention to = conventionOf(target, conventionGiven(options.cov_to, "--cov-to"), "--cov-to");
  output.from = from, output.to = to;
  Converter converter(options, from, to, graph.name, output);
  for (std::size_t i = 0; i < graph.edges.size(); ++i) {
    GraphEdge& edge = graph.edges[i];
    edge.matrix = converter.convert(edge.matrix, {edge.measurement, edge.line, i});
  }
  const std::string text = formatGraph(graph, output.to_format, to);
  addConvertNotes(output, options);
  if (!graph.fixed.empty() && output.to_format != "g2o") output.notes.emplace_back("FIX has no counterpart in TORO");
  writeConverted(options, output, text, {});
}

int runConvert(const ConvertOptions& given, const Invocation& invocation) {
  ConvertOptions options = given;
  if (!options.cov_layout.empty()) {
    Convention c;
    setConventionField(c, "layout", options.cov_layout);
    options.reading.layout = c.layout;
  }
  const auto graphs = graphFormatNames();
  const auto isGraph = [&](const std::string& format) {
    return std::find(graphs.begin(), graphs.end(), format) != graphs.end();
  };
  ConvertOutput output;
  bool graph = isGraph(options.reading.format);
  TextFile file;
  if (graph || (options.reading.format == "auto" && options.input != "-")) {
    file = loadText(options.input);
    graph = graph || looksLikeGraph(file.text);
  }
  if (graph) {
    convertGraph(options, output, file);
  } else {
    if (isGraph(options.to)) {
      throw InputError(sourceName(options.input), 0, fmt::format("poses to the format {}, which has edges", options.to),
                       "a file of g2o or TORO");
    }
    convertTrajectory(options, output);
  }
  // The figures go where the result does not.
  const std::string summary = formatConvert(output);
  if (options.output == "-" || options.json == "-") {
    std::fputs(printableLines(summary).c_str(), stderr);
  } else {
    printLines(summary);
  }
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, options.seed);
    setConvert(object, output);
    writeJson(options.json, object);
  }
  return output.indefinite.empty() ? exit_fine : exit_not_trusted;
}

}  // namespace

void addConvertCommand(const CommandList& program) {
  auto options = std::make_shared<ConvertOptions>();
  const Command command =
      program.add("convert", "Poses with covariances between the formats and conventions of other programs");
  command.option("IN", options->input, "Trajectory, or graph of g2o or TORO ('-': standard input)").required();
  command.option("OUT", options->output, "The result ('-': standard output); covariances may go to OUT.cov").required();
  std::vector<std::string> formats = trajectoryFormatNames();
  for (const std::string& graph : graphFormatNames()) formats.push_back(graph);
  command.option("--from", options->reading.format, "Format of IN (default auto: by its first lines)").oneOf(formats);
  formats.erase(formats.begin());
  command.option("--to", options->to, "Format of OUT (default: that of IN)").oneOf(formats);
  command.option("--cov-from", options->cov_from,
                 "Convention of IN's covariances: right, left, ros-fixed, ros-rpy, g2o-half ... and fields after it: "
                 "ros-fixed,unit=deg");
  command.option("--cov-to", options->cov_to,
                 "Convention of OUT's covariances, likewise (default right, if OUT can say so)");
  command.option("--cov", options->reading.covariance_file, "File of covariances beside IN (default IN.cov)");
  command.option("--cov-layout", options->cov_layout, "What follows the eight columns of a TUM file")
      .oneOf({"full36", "upper21", "lower21", "blocks12", "diag6"});
  command.flag("--assume-uncorrelated", options->assume_uncorrelated,
               "Take unknown correlations between known components as 0");
  command
      .option("--unmeasured-above", options->reading.unmeasured,
              "Variances in messages from which on a component is not measured (default 90000)")
      .positive();
  command.flag("--sampled", options->sampled, "Second moments by sampling, for rotations above 0.1 rad");
  command.option("--samples", options->samples, "Samples for each pose (default 2000)").range(2, 10000000);
  command.option("--seed", options->seed, "Seed of the samples (default 1)");
  command.option("--times", options->times, "File of one time in seconds for each pose, for formats without times");
  command
      .option("--columns", options->reading.reading.columns,
              "Names of CSV columns that are not ours: tx=px,ty=py (ours=the file's)")
      .list();
  command.flag("--ignore-unknown", options->reading.reading.ignore_unknown,
               "Pass over CSV columns and lines of graphs without a meaning");
  command
      .option("--norm-tolerance", options->reading.reading.norm_tolerance,
              "Quaternions and matrices that are off by less are normalised (default 0.001)")
      .range(0.0, 0.5);
  command.option("--json", options->json, "Write figures of the conversion to a JSON file ('-': standard output)");
  command.run([options](const Invocation& invocation) { return runConvert(*options, invocation); });
}

}  // namespace liestat::cli
