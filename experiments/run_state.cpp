#include <experiments/run_state.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>
#include <type_traits>

namespace liestat::experiments {
namespace {

static_assert(std::endian::native == std::endian::little, "a file is little-endian");

constexpr std::string_view magic = "liestat run, version 1\n";

/// FNV-1a: files that are cut short or damaged are told from others.
std::uint64_t checksum(std::string_view text) {
  std::uint64_t hash = 14695981039346656037U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
  return hash;
}

void put(std::string& out, std::uint64_t number) { out.append(reinterpret_cast<const char*>(&number), sizeof number); }

/// The next bytes of a text; false at its end.
bool take(std::string_view& in, std::size_t size, std::string_view& bytes) {
  if (size > in.size()) return false;
  bytes = in.substr(0, size);
  in.remove_prefix(size);
  return true;
}
bool take(std::string_view& in, std::uint64_t& number) {
  std::string_view bytes;
  if (!take(in, sizeof number, bytes)) return false;
  std::memcpy(&number, bytes.data(), sizeof number);
  return true;
}

}  // namespace

RunState::File RunState::read(const std::string& path) const {
  std::ifstream stream(path, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  const std::string name = sourceName(path);
  if (!stream) throw InputError(name, 0, "cannot be read");
  std::string_view in = text, found;
  if (!take(in, magic.size(), found) || found.substr(0, magic.size() - 2) != magic.substr(0, magic.size() - 2)) {
    throw InputError(name, 0, "this is no state of a run", "a file of --state or --checkpoint");
  }
  if (found != magic) throw InputError(name, 0, "this is the state of another version of the program");
  const auto refuse = [&] { throw InputError(name, 0, "the state is damaged or not complete"); };
  if (in.size() < 8) refuse();
  std::string_view sum = in.substr(in.size() - 8);
  in.remove_suffix(8);
  std::uint64_t expected = 0;
  take(sum, expected);
  if (checksum(std::string_view(text).substr(0, text.size() - 8)) != expected) refuse();

  File file;
  std::uint64_t size = 0, number = 0, count = 0, complete = 0, experiments = 0;
  if (!take(in, size) || !take(in, size, found)) refuse();
  if (found != run_) throw InputError(name, 0, "of another run: " + printable(found, 400), printable(run_, 400));
  if (!take(in, number) || !take(in, count) || !take(in, complete) || !take(in, experiments)) refuse();
  file.part = {number, count};
  file.complete = complete != 0;
  for (std::uint64_t e = 0; e < experiments; ++e) {
    std::uint64_t tasks = 0, results = 0;
    if (!take(in, tasks) || !take(in, results)) refuse();
    Experiment& experiment = file.experiments.emplace_back();
    experiment.tasks = tasks;
    for (std::uint64_t r = 0; r < results; ++r) {
      std::uint64_t task = 0;
      if (!take(in, task) || !take(in, size) || !take(in, size, found) || task >= tasks) refuse();
      const auto* bytes = reinterpret_cast<const std::byte*>(found.data());
      experiment.results.emplace(task, Bytes(bytes, bytes + found.size()));
    }
  }
  return file;
}

void RunState::write(bool complete) {
  std::string out(magic);
  put(out, run_.size());
  out += run_;
  for (const std::uint64_t number : {part_.number, part_.count, std::size_t{complete}, experiments_.size()}) {
    put(out, number);
  }
  for (const Experiment& experiment : experiments_) {
    put(out, experiment.tasks);
    put(out, experiment.results.size());
    for (const auto& [task, bytes] : experiment.results) {
      put(out, task);
      put(out, bytes.size());
      out.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
  }
  put(out, checksum(out));
  const auto begin = std::chrono::steady_clock::now();
  writeDurably(file_, out);
  written_ = std::chrono::steady_clock::now();
  // A large file is written less often, but so often that a kill costs seconds.
  pause_ = std::clamp(20 * std::chrono::duration<double>(written_ - begin), std::chrono::duration<double>(1),
                      std::chrono::duration<double>(5));
}

void RunState::merge(const std::string& run, const std::vector<std::string>& files) {
  run_ = run;
  std::vector<bool> there;
  std::string incomplete;
  for (const std::string& path : files) {
    File file = read(path);
    if (there.empty()) there.resize(file.part.count);
    if (there.size() != file.part.count) {
      throw InputError(sourceName(path), 0, fmt::format("a part of {}", file.part.count),
                       fmt::format("one of {} as the first file", there.size()));
    }
    if (!file.complete) {
      throw InputError(sourceName(path), 0,
                       fmt::format("part {}/{} is not finished: start it once more", file.part.number, there.size()));
    }
    there[file.part.number - 1] = true;
    experiments_.resize(std::max(experiments_.size(), file.experiments.size()));
    for (std::size_t e = 0; e < file.experiments.size(); ++e) {
      experiments_[e].tasks = file.experiments[e].tasks;
      experiments_[e].results.merge(file.experiments[e].results);
    }
  }
  for (std::size_t k = 0; k < there.size(); ++k) {
    if (!there[k]) throw InputError("--merge", 0, fmt::format("part {}/{} is in no file", k + 1, there.size()));
  }
}

void RunState::keep(const std::string& run, const std::string& path, const RunPart& part) {
  run_ = run;
  part_ = part;
  if (std::ifstream(path).good()) {
    File file = read(path);
    if (file.part.number != part.number || file.part.count != part.count) {
      throw InputError(sourceName(path), 0, fmt::format("this is part {}/{}", file.part.number, file.part.count),
                       fmt::format("part {}/{}, or another file", part.number, part.count));
    }
    experiments_ = std::move(file.experiments);
    for (const Experiment& experiment : experiments_) taken_over_ += experiment.results.size();
  }
  file_ = path;
  if (taken_over_ == 0) write(false);
  written_ = std::chrono::steady_clock::now();
}

std::pair<std::size_t, std::vector<std::size_t>> RunState::begin(std::size_t tasks) {
  const std::lock_guard lock(mutex_);
  const std::size_t number = begun_++;
  if (experiments_.size() < begun_) experiments_.resize(begun_);
  Experiment& experiment = experiments_[number];
  if (experiment.tasks != tasks && experiment.tasks != 0) {
    throw InputError(file_.empty() ? "--merge" : sourceName(file_), 0, "the state is of a run with other experiments");
  }
  experiment.tasks = tasks;
  std::vector<std::size_t> mine;
  for (std::size_t task = 0; task < tasks; ++task) {
    if ((tasks_ + task) % part_.count == part_.number - 1) mine.push_back(task);
  }
  tasks_ += tasks;
  return {number, mine};
}

RunState::Bytes RunState::result(std::size_t experiment, std::size_t task, const std::function<Bytes()>& evaluate) {
  {
    const std::lock_guard lock(mutex_);
    const auto& results = experiments_[experiment].results;
    const auto found = results.find(task);
    if (found != results.end()) {
      ++done_;
      return found->second;
    }
  }
  if (file_.empty()) throw InputError("--merge", 0, "the states do not have all results of this run");
  Bytes bytes = evaluate();
  // Once an interrupt has come a task may be empty.
  if (runStopped()) return bytes;
  const std::lock_guard lock(mutex_);
  experiments_[experiment].results.emplace(task, bytes);
  ++done_;
  if (std::chrono::steady_clock::now() - written_ >= pause_) write(false);
  return bytes;
}

void RunState::finish() {
  if (!file_.empty()) write(!runStopped());
}

}  // namespace liestat::experiments
