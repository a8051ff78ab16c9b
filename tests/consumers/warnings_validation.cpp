// As warnings_stats.cpp, for the headers that need Boost.Math and Random123.
#include <lie/lie.hpp>
#include <stats/inference.hpp>
#include <stats/kolmogorov.hpp>
#include <stats/laws.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <stats/validation.hpp>

#include <array>
#include <iostream>

using namespace liestat;

namespace {

struct Outcome : TrialOutcome {
  double error = 0;
  static constexpr std::array statistics = {&Outcome::error};
};

}  // namespace

int main() {
  const auto report =
      validate(SerialExecutor{}, {.trials = 10}, ReferenceLaw::hotelling(3, 9), [](CounterRng& rng, std::uint64_t) {
        const Gaussian<SE3d> g{sampleInCube<SE3d>(rng), SquareOf<SE3d>::Identity()};
        Outcome outcome;
        outcome.mu2 = mahalanobisSquared(g, sample(g, rng));
        return outcome;
      });
  const auto ellipse = confidenceEllipsoid(Eigen::Matrix2d::Identity().eval(), 0.95);
  std::cout << report << report.of(&Outcome::error).mean << ellipse.threshold
            << ksTest(report.mu2, [](double x) { return x; }).p_value;
  return report.passed() ? 0 : 1;
}
