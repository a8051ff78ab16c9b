#include <experiments/robust_validation.hpp>

#include <experiments/stewart.hpp>
#include <stats/model_choice_f_test.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

namespace liestat::experiments {
namespace {

constexpr std::size_t stewart_measurements = 1000, stewart_repetitions = 50;

/// The rows R, S_A and S_B as printed.
constexpr int printed_biases[3][10] = {
    {0, -1, -1, 1, 1, 1, 1, 1, 0, 1}, {0, 0, -1, 1, 2, 3, 1, 2, 0, 2}, {0, 1, 1, 1, 5, 6, 4, 3, 2, 2}};

std::vector<FigureCurve> densitiesOfErrors() {
  const Stewart law{0.2, 0.8, 10};
  std::vector<FigureCurve> curves;
  for (const int v : {0, 5, 10, 15, 25}) {
    FigureCurve& curve = curves.emplace_back(FigureCurve{.name = fmt::format("v = {}", v), .x = {}, .y = {}});
    for (double e = 0; e <= 60; e += 0.25) curve.x.push_back(e), curve.y.push_back(law.curve(v, e));
  }
  return curves;
}

void addBiases(std::vector<StewartRow>& rows, std::size_t column, std::uint64_t seed) {
  const Stewart& law = stewart_columns[column];
  std::array<double, 3> sum{}, squares{};
  for (std::size_t k = 0; k < stewart_repetitions; ++k) {
    CounterRng rng(seed, 10 * k + column);
    const StewartBiases found = stewartBiases(law, law.sample(stewart_measurements, rng));
    const int biases[] = {found.relevance, found.count, found.quantile};
    for (std::size_t i = 0; i < 3; ++i) sum[i] += biases[i], squares[i] += biases[i] * biases[i];
  }
  constexpr const char* names[] = {"R", "S_A", "S_B"};
  constexpr auto n = static_cast<double>(stewart_repetitions);
  for (std::size_t i = 0; i < 3; ++i) {
    const double mean = sum[i] / n;
    rows.push_back({.e0 = law.e0,
                    .e1 = law.e1,
                    .delta = law.delta,
                    .score = names[i],
                    .printed = printed_biases[i][column],
                    .mean = mean,
                    .deviation = std::sqrt(std::max(0.0, squares[i] / n - mean * mean))});
  }
}

/// Φ_P(d' + 1, d') of the exact test, or of the report's code, which takes the quantile of F with d' and 1 degrees of
/// freedom for that with 1 and d'.
FigureCurve profileOfPhi(double probability, bool printed) {
  FigureCurve curve{
      .name = fmt::format("P = {:g}, {}", probability, printed ? "the report's code" : "exact"), .x = {}, .y = {}};
  const FTestPhi phi{probability};
  for (int general = 1; general <= 32; ++general) {
    const double d = general;
    double value = phi(d + 1, d);
    if (printed) {
      const double quantile = ((d + 1) / phi(d + 1, 1) - 1) / d;
      value = d / (d + 1) / (1 + quantile / d);
    }
    curve.x.push_back(d), curve.y.push_back(value);
  }
  return curve;
}

}  // namespace

VievilleFigures vievilleFigures(std::uint64_t seed) {
  VievilleFigures figures;
  figures.densities = densitiesOfErrors();
  for (std::size_t column = 0; column < std::size(stewart_columns); ++column) addBiases(figures.biases, column, seed);
  figures.phi = {profileOfPhi(0.5, false), profileOfPhi(0.9, false), profileOfPhi(0.5, true), profileOfPhi(0.9, true)};
  return figures;
}

}  // namespace liestat::experiments
