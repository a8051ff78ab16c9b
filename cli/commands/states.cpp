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
    const double angle = std::atan2(mean.mean[1], mean.mean[0]) / units::degree;
    return angle < 0 ? angle + 360 : angle;
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

/// Hands the rows of an array to add(numbers, how many), some at a time.
template <class Add>
void forRows(const NpyFile& file, const Add& add) {
  constexpr std::size_t most = 1 << 16;
  const double* const all = file.doubles();
  std::vector<double> some(all == nullptr ? most * file.columns() : 0);
  for (std::size_t i = 0; i < file.rows(); i += most) {
    const std::size_t n = std::min(most, file.rows() - i);
    if (all == nullptr) file.read(i, n, some.data());
    add(all == nullptr ? some.data() : all + i * file.columns(), n);
  }
}

int manifoldOf(Feature feature, const std::string& file) {
  if (feature == Feature::rotation) return LIESTAT_ROTATION;
  if (feature == Feature::direction) return LIESTAT_DIRECTION;
  throw InputError(file, 0, fmt::format("{} have no states", info(feature).plural), "rotations or directions");
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

template <class M>
int stream(const NpyFile& file, Feature feature, const std::string& json, const Invocation& invocation) {
  MomentState<M> moments;
  const auto feed = [&](auto& state) {
    forRows(file, [&](const double* rows, std::size_t n) {
      const StateError error = state.add(rows, n);
      if (error != StateError::none) throw InputError(file.name(), 0, message(error));
    });
  };
  feed(moments);
  SumState<M> sums(moments.finish().mean);
  feed(sums);
  for (CertifiedMean<M> mean = sums.finish(); sums.needsPass(mean); mean = sums.finish()) {
    sums = SumState<M>(mean.mean.mean, sums.pass() + 1);
    feed(sums);
  }
  MeanAnalysis analysis{summarizedState(sums)};
  analysis.feature = name(feature);
  Measurements measurements;
  measurements.feature = feature;
  measurements.file.format = "npy";
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
    const NpyFile file(input.file);
    state = begin(manifoldOf(featureOfRows(file, input.options.feature), file.name()), options);
    forRows(file, [&](const double* rows, std::size_t n) {
      require(file.name(), liestat_state_add(state.words.data(), rows, n, file.columns(), nullptr));
    });
  } else {
    const Measurements measurements = input.read("liestat mean");
    if (measurements.known_noise) {
      throw OptionError("liestat mean", "--state with the measurements' covariances", "--criterion lsq or wlsq");
    }
    state = begin(manifoldOf(measurements.feature, input.file), options);
    const double* const weights = measurements.usesWeights() ? measurements.weights.data() : nullptr;
    const auto add = [&](const double* rows, std::size_t n, std::size_t stride) {
      require(input.file, liestat_state_add(state.words.data(), rows, n, stride, weights));
    };
    if (measurements.feature == Feature::rotation) {
      static_assert(sizeof(Eigen::Quaterniond) == 4 * sizeof(double));
      add(measurements.file.rotations.front().coeffs().data(), measurements.size(), 4);
    } else {
      static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
      add(measurements.file.directions.front().data(), measurements.size(), 3);
    }
  }
  save(options.state, state);
  return show(state, json, invocation);
}

int streamMean(const NpyFile& file, const MeasurementInput& input, const std::string& json,
               const Invocation& invocation) {
  const Feature feature = featureOfRows(file, input.options.feature);
  if (manifoldOf(feature, file.name()) == LIESTAT_ROTATION) return stream<SO3d>(file, feature, json, invocation);
  return stream<S2d>(file, feature, json, invocation);
}

void addMergeCommand(const CommandList& program) {
  struct Options {
    std::vector<std::string> files;
    std::string out, json;
  };
  auto options = std::make_shared<Options>();
  const Command command = program.add("merge", "The mean of states that liestat mean --state, SQLite or Python wrote");
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
