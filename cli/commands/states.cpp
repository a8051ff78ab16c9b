#include <cli/commands/states.hpp>

#include <cli/show/mean.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <lie/units.hpp>
#include <report/publish.hpp>
#include <stats/summarized_state.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

constexpr std::array state_features{"", "heading", "direction", "rotation"};

/// A state of any kind in memory.
struct StateFile {
  std::array<std::uint64_t, LIESTAT_STATE_LARGEST / 8> words{};

  liestat_state_kind kind() const { return liestat_state_kind_of(words.data()); }
};

void require(const std::string& file, int code) {
  if (code != LIESTAT_STATE_OK) throw InputError(file, 0, liestat_state_error(code));
}

StateFile readState(const std::string& path) {
  const TextFile file = loadText(path);
  StateFile state;
  require(file.name, liestat_state_read(state.words.data(), file.text.data(), file.text.size()));
  return state;
}

void save(const std::string& path, const StateFile& state) {
  writeOutput(path, {reinterpret_cast<const char*>(state.words.data()), state.kind().size});
}

/// The mean of a state, as it is shown and written.
struct StateMean {
  std::string feature, kind;
  int pass = 0;
  liestat_mean mean{};
  bool has_covariance = false;
  int dof = 0;

  explicit StateMean(const StateFile& state) {
    const liestat_state_kind found = state.kind();
    dof = found.manifold, pass = found.pass + 1;
    feature = state_features[static_cast<std::size_t>(found.manifold)];
    kind = found.kind == LIESTAT_MOMENTS ? "moments" : "sums";
    require("state", liestat_state_finish(state.words.data(), &mean));
    has_covariance = std::isfinite(mean.covariance[0]);
  }
  bool hasMean() const { return std::isfinite(mean.mean[0]); }
  std::vector<double> row() const {
    return hasMean() ? std::vector(mean.mean, mean.mean + dof + 1) : std::vector<double>();
  }
  double degrees() const {
    return *featureValue(Eigen::Vector2d(mean.mean[0], mean.mean[1]), tangentPartsOf<SO2d>()).heading_deg;
  }
  std::vector<double> deviations() const {
    std::vector<double> list;
    for (int i = 0; i < dof && has_covariance; ++i)
      list.push_back(std::sqrt(mean.covariance[i * dof + i]) / units::degree);
    return list;
  }
  /// The work that is left.
  std::string next() const {
    if (mean.n == 0) return "";
    if (kind == "sums") {
      return mean.another_pass != 0 ? fmt::format(
                                          "pass {}: liestat mean FILE --state OUT --after THIS, for each file, "
                                          "and liestat merge",
                                          pass + 1)
                                    : "";
    }
    return "pass 2, for the Fréchet mean: liestat mean FILE --state OUT --after THIS, for each file, and liestat merge";
  }
  std::string text() const {
    std::string lines = fmt::format("{} of {} {}s, pass {}", kind, mean.n, feature, pass);
    lines += mean.left_out > 0 ? fmt::format(", {} bad rows left out\n", mean.left_out) : "\n";
    if (hasMean()) {
      const char* const what = kind == "moments" ? "chordal mean" : "Fréchet mean";
      lines += feature == "heading" ? fmt::format("{} {:.9g} deg\n", what, degrees())
                                    : fmt::format("{} {:.9f}\n", what, fmt::join(row(), " "));
    }
    if (has_covariance) lines += fmt::format("sd           {:.4g} deg\n", fmt::join(deviations(), " "));
    if (kind == "moments" && mean.n > 0) lines += fmt::format("resultant    {:.6f}\n", mean.resultant);
    if (*mean.reason != 0 && mean.another_pass == 0) lines += fmt::format("{}: {}\n", mean.status, mean.reason);
    if (!next().empty()) lines += "next         " + next() + "\n";
    return lines;
  }
};

template <class V>
void describe(V& v, const StateMean& m) {
  const auto where = [](bool there, auto value) { return there ? std::optional(std::move(value)) : std::nullopt; };
  v("kind", m.kind, "moments, of a chordal mean, or sums at the mean of the pass before");
  v("feature", m.feature, "heading, direction or rotation")("pass", m.pass)("n", m.mean.n, "rows that count");
  v("left_out", m.mean.left_out, "rows that are not finite or not of unit norm");
  v("status", std::string(m.mean.status))("reason", std::string(m.mean.reason));
  v("mean", where(m.hasMean(), m.row()), "cos sin, x y z, or a quaternion x y z w");
  const std::vector<double> covariance(m.mean.covariance, m.mean.covariance + m.dof * m.dof);
  v("covariance", where(m.has_covariance, covariance), "rad², row by row; null unless status is ok");
  v("resultant", m.mean.resultant)("step", m.mean.step, "from the reference of sums to the mean, rad");
  v("another_pass", m.mean.another_pass != 0, "whether sums at the mean are needed");
}

int show(const StateFile& state, const std::string& json, const Invocation& invocation) {
  const StateMean mean(state);
  publishResult(json, mean.text(), invocation.command_line, std::nullopt, mean);
  return std::string(mean.mean.status) == "ok" ? exit_fine : exit_not_trusted;
}

/// Hands the rows of an array, with weights or none, to add(numbers, how many, their weights or null), some at a time.
template <class Add>
void forRows(const NpyFile& file, const std::optional<NpyFile>& weights, const Add& add) {
  constexpr std::size_t most = 1 << 16;
  const double* const all = file.doubles();
  std::vector<double> some(all == nullptr ? most * file.columns() : 0);
  for (std::size_t i = 0; i < file.rows(); i += most) {
    const std::size_t n = std::min(most, file.rows() - i);
    if (all == nullptr) file.read(i, n, some.data());
    add(all == nullptr ? some.data() : all + i * file.columns(), n, weights ? weights->doubles() + i : nullptr);
    file.forget(i + n);
    if (weights) weights->forget(i + n);
  }
}

int manifoldOf(Feature feature, const std::string& file) {
  if (feature == Feature::rotation) return LIESTAT_ROTATION;
  if (feature == Feature::direction) return LIESTAT_DIRECTION;
  if (feature == Feature::heading) return LIESTAT_HEADING;
  throw InputError(file, 0, fmt::format("{} have no states", info(feature).plural),
                   "rotations, directions or headings; --memory with more GB takes others into memory");
}

/// An array, which has no weights.
NpyFile arrayOf(const MeasurementInput& input) {
  if (input.options.criterion == Criterion::wlsq) {
    throw OptionError("liestat mean", "--criterion wlsq needs weights, and an array of features has none");
  }
  return NpyFile(input.file);
}

/// Hands rows of a text to add(measurements, numbers, how many, their weights or null), some thousand at a time.
template <class Add>
void forRows(const MeasurementInput& input, const Add& add) {
  input.readInChunks("liestat mean", [&](const Measurements& rows) {
    if (rows.known_noise) {
      throw OptionError("liestat mean", "the measurements' covariances need the measurements in memory",
                        "--memory with more GB, or --criterion lsq or wlsq");
    }
    const double* const weights = rows.usesWeights() ? rows.weights.data() : nullptr;
    switch (manifoldOf(rows.feature, input.file)) {
      case LIESTAT_ROTATION:
        static_assert(sizeof(Eigen::Quaterniond) == 4 * sizeof(double));
        return add(rows, rows.file.rotations.front().coeffs().data(), rows.size(), weights);
      case LIESTAT_DIRECTION:
        static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
        return add(rows, rows.file.directions.front().data(), rows.size(), weights);
      default:
        std::vector<double> headings(2 * rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) liestat_heading(rows.file.headings[i], &headings[2 * i]);
        return add(rows, headings.data(), rows.size(), weights);
    }
  });
}

StateFile begin(int manifold, const StateOptions& options) {
  StateFile state;
  if (options.after.empty()) {
    int exponent = 0;
    if (std::frexp(options.largest_weight, &exponent) == 0.5) --exponent;
    require(options.state, liestat_state_init(state.words.data(), manifold, LIESTAT_MOMENTS, nullptr, exponent, 0));
    return state;
  }
  const StateFile before = readState(options.after);
  if (before.kind().manifold != manifold) {
    throw InputError(options.after, 0,
                     fmt::format("a state of {}s", state_features[static_cast<std::size_t>(before.kind().manifold)]),
                     fmt::format("one of {}s, as the file has", state_features[static_cast<std::size_t>(manifold)]));
  }
  const StateMean mean(before);
  if (!mean.hasMean()) throw InputError(options.after, 0, "a state without a mean to take sums at");
  require(options.after, liestat_state_init(state.words.data(), manifold, LIESTAT_SUMS, mean.mean.mean,
                                            before.kind().weight_exponent, mean.pass));
  return state;
}

/// Rows that stay on the disk.
struct Streamed {
  NpyFile rows;
  std::optional<NpyFile> weights;
  double largest_weight = 1;
  Measurements about = {};  ///< without rows
};

/// An array as it is, and the rows of a text, read once, in a file of their own.
Streamed streamed(const MeasurementInput& input) {
  if (NpyFile::isOne(input.file)) {
    Streamed result{arrayOf(input), std::nullopt};
    result.about.feature = featureOfRows(result.rows, input.options.feature);
    result.about.file.format = "npy";
    return result;
  }
  std::optional<RowsOnDisk> numbers, weights;
  double largest = 0;
  Measurements about;
  forRows(input, [&](const Measurements& rows, const double* row, std::size_t n, const double* weight) {
    if (!numbers) {
      numbers.emplace(rows.feature == Feature::rotation ? 4 : rows.feature == Feature::direction ? 3 : 2);
      about.feature = rows.feature, about.criterion = rows.criterion, about.notes = rows.notes;
      about.file.format = rows.file.format;
    }
    numbers->add(row, n);
    if (weight == nullptr) return;
    if (!weights) weights.emplace(1);
    weights->add(weight, n);
    largest = std::max(largest, *std::max_element(weight, weight + n));
  });
  const std::string name = sourceName(input.file);
  Streamed result{numbers->array(name), std::nullopt, 1, std::move(about)};
  if (weights) {
    if (largest == 0) throw InputError(name, 0, "every weight is 0", "one above 0");
    result.weights = weights->array(name), result.largest_weight = largest;
  }
  return result;
}

template <class M>
int stream(const Streamed& data, const std::string& json, const Invocation& invocation) {
  const NpyFile& file = data.rows;
  MomentState<M> moments(data.largest_weight);
  const auto feed = [&](auto& state) {
    forRows(file, data.weights, [&](const double* rows, std::size_t n, const double* weights) {
      const StateError error = state.add(rows, n, MomentState<M>::row, weights);
      if (error != StateError::none) throw InputError(file.name(), 0, message(error));
    });
  };
  feed(moments);
  SumState<M> sums(moments.finish().mean, 1, data.largest_weight);
  feed(sums);
  for (CertifiedMean<M> mean = sums.finish(); sums.needsPass(mean); mean = sums.finish()) {
    sums = SumState<M>(mean.mean.mean, sums.pass() + 1, data.largest_weight);
    feed(sums);
  }
  MeanAnalysis analysis{summarizedState(sums)};
  analysis.feature = name(data.about.feature);
  analysis.notes.insert(analysis.notes.begin(), data.about.notes.begin(), data.about.notes.end());
  Measurements measurements = data.about;
  measurements.streamed = file.rows();
  publishResult(json, formatMean(file.name(), measurements, analysis), invocation.command_line, std::nullopt,
                [&](JsonObject& object) {
                  object("file", file.name())("format", measurements.file.format).fieldsOf<MeanSummary>(analysis);
                });
  return analysis.trusted() ? exit_fine : exit_not_trusted;
}

}  // namespace

int writeState(const MeasurementInput& input, const StateOptions& options, const std::string& json,
               const Invocation& invocation) {
  StateFile state;
  if (NpyFile::isOne(input.file)) {
    const NpyFile file = arrayOf(input);
    state = begin(manifoldOf(featureOfRows(file, input.options.feature), file.name()), options);
    forRows(file, std::nullopt, [&](const double* rows, std::size_t n, const double*) {
      require(file.name(), liestat_state_add(state.words.data(), rows, n, file.columns(), nullptr));
    });
  } else {
    bool begun = false;
    forRows(input, [&](const Measurements& rows, const double* row, std::size_t n, const double* weights) {
      const int manifold = manifoldOf(rows.feature, input.file);
      if (!begun) state = begin(manifold, options);
      begun = true;
      require(input.file,
              liestat_state_add(state.words.data(), row, n, static_cast<std::size_t>(manifold) + 1, weights));
    });
  }
  save(options.state, state);
  return show(state, json, invocation);
}

int streamMean(const MeasurementInput& input, const std::string& json, const Invocation& invocation) {
  const Streamed data = streamed(input);
  switch (manifoldOf(data.about.feature, data.rows.name())) {
    case LIESTAT_ROTATION:
      return stream<SO3d>(data, json, invocation);
    case LIESTAT_DIRECTION:
      return stream<S2d>(data, json, invocation);
    default:
      return stream<SO2d>(data, json, invocation);
  }
}

void addMergeCommand(const CommandList& program) {
  struct Options {
    std::vector<std::string> files;
    std::string out, json;
  };
  auto options = std::make_shared<Options>();
  const Command command =
      program.add("merge", "The mean of states that liestat mean --state, an engine or Python wrote");
  command.option("STATES", options->files, "Files of states of one feature, kind and pass").required();
  command.option("--out", options->out, "Write the merged state to this file");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.run([options](const Invocation& invocation) {
    StateFile state = readState(options->files.front());
    for (const std::string& file : std::span(options->files).subspan(1)) {
      const StateFile other = readState(file);
      require(file, liestat_state_merge(state.words.data(), other.words.data()));
    }
    if (!options->out.empty()) save(options->out, state);
    return show(state, options->json, invocation);
  });
}

}  // namespace liestat::cli
