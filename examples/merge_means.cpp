// One mean from parts: three machines add what they have, and send 456 bytes each (docs/states.md).
#include <stats/state.hpp>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <type_traits>
#include <vector>

using namespace liestat;

int main() {
  // Wind directions of three stations, degrees, clockwise from north.
  const std::vector<std::vector<double>> stations = {
      {350, 2, 11, 356, 7, 3, 358}, {4, 349, 12, 1, 355}, {9, 359, 352, 6, 14, 347, 0, 5}};

  // A pass: each station makes a state, whose bytes travel, and all are merged into one that is empty before.
  const auto pass = [&](auto& total) {
    using State = std::remove_reference_t<decltype(total)>;
    const State empty = total;
    for (const std::vector<double>& degrees : stations) {
      State state = empty;
      for (const double angle : degrees) {
        double row[2];
        liestat_heading(angle, row);
        state.add(row, 1);
      }
      StateError error = StateError::none;
      const std::optional<State> received = State::fromBytes(state.bytes(), &error);
      if (received) error = total.merge(*received);
      if (error != StateError::none) std::printf("%s\n", message(error));
    }
  };

  MomentState<SO2d> moments;
  pass(moments);
  const ChordalMean<SO2d> chordal = moments.finish();
  const double degree = std::acos(-1.0) / 180;
  std::printf("chordal mean %.3f deg, resultant %.4f, sd of the mean %.2f deg\n", chordal.mean.angle() / degree,
              chordal.resultant, std::sqrt(chordal.estimate->covariance(0, 0)) / degree);

  int passes = 0;
  const CertifiedMean<SO2d> mean = meanByPasses<SO2d>(pass, 1, {}, &passes);
  if (mean.status != Status::ok) return std::printf("%s: %s\n", name(mean.status), mean.reason), 1;
  std::printf("Fréchet mean %.3f deg of %zu, sd of the mean %.2f deg, %d passes\n", mean.mean.mean.angle() / degree,
              mean.mean.n, std::sqrt(mean.estimate->covariance(0, 0)) / degree, passes);
  return 0;
}
