// Any text, in any format: features that keep their promises, or an InputError of one line. Anything else is a finding.
//
//   build/sanitize/fuzz/read_fuzz -max_total_time=120 new_corpus fuzz/corpus/read

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include <fuzz/checks.hpp>
#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/features.hpp>

namespace liestat {
namespace {

template <class List>
bool isAbsentOrFull(const List& list, std::size_t n) {
  return list.empty() || list.size() == n;
}

void check(const FeatureFile& file) {
  using Part = FeaturePart;
  const std::size_t n = file.size();
  const auto& parts = info(file.kind).parts;
  require(n > 0);
  require(file.rotations.size() == (parts.contains(Part::rotation) ? n : 0));
  require(file.positions.size() == (parts.contains(Part::position) ? n : 0));
  require(file.directions.size() == (parts.contains(Part::direction) ? n : 0));
  require(isAbsentOrFull(file.weights, n) && isAbsentOrFull(file.times, n) && isAbsentOrFull(file.covariances, n));
  require(file.n_normalised <= n);
  for (const auto& rotation : file.rotations) require(std::abs(rotation.norm() - 1) < 1e-14);
  for (const auto& position : file.positions) require(position.allFinite());
  for (const auto& direction : file.directions) require(std::abs(direction.norm() - 1) < 1e-14);
  // A weight of zero leaves a row out; some row stays.
  for (const double weight : file.weights) require(weight >= 0 && std::isfinite(weight));
  require(file.weights.empty() || *std::max_element(file.weights.begin(), file.weights.end()) > 0);
  for (const double time : file.times) require(std::isfinite(time));
  require(isAbsentOrFull(file.factors, n) && file.unmeasured.size() <= n);
  // Rows whose rotation was not measured have no covariance.
  for (std::size_t i = 0, next = 0; i < file.covariances.size(); ++i) {
    const bool measured = next == file.unmeasured.size() || file.unmeasured[next] != i;
    next += measured ? 0 : 1;
    require(measured ? file.covariances[i].allFinite() && file.covariances[i](0, 0) > 0 : file.covariances[i].hasNaN());
  }
  const FeatureFile measured = withoutUnmeasured(file);
  require(measured.size() == n - file.unmeasured.size() && measured.lines.size() == measured.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const std::string& format : formatNames()) {
    try {
      check(readFeatures(text, "fuzz", {.format = format}));
    } catch (const InputError& error) {
      require(std::string_view(error.what()).find('\n') == std::string_view::npos);
    }
  }
  try {
    const ImuFile imu = parseImu(text, "fuzz");
    require(imu.samples.size() > 1 && imu.samples.size() == imu.lines.size() && imu.duration() > 0);
  } catch (const InputError& error) {
    require(std::string_view(error.what()).find('\n') == std::string_view::npos);
  }
  try {
    (void)parseTable(text, "fuzz", {"x"}, {"y"});
  } catch (const InputError& error) {
    require(std::string_view(error.what()).find('\n') == std::string_view::npos);
  }
  return 0;
}

}  // namespace liestat
