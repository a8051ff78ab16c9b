// Table 1 of Pennec 1998: what a mean of 100 features costs, by criterion and type of feature, as ratios to points and
// to LSQ beside the report's own. All criteria start at the first measurement, as there. Prints Markdown.
#include "../inputs.hpp"
#include "hand_written.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace liestat::bench {
namespace {

constexpr std::size_t n = 100;
constexpr double spread = 0.1;    // standard deviation in each coordinate, rad or m
constexpr std::size_t sets = 16;  // data sets, taken in turn: one alone would be learnt by heart

/// A feature's three rows: criteria in the order LSQ, WLSQ, MAHA.
struct Feature {
  std::string name;
  std::array<double, 3> paper_ms;
  std::array<std::function<void()>, 3> run;
  std::array<long, 3> iterations{}, calls{};
};

template <Metric M>
struct Data {
  std::vector<M> features;
  std::vector<double> weights;
  std::vector<Gaussian<M>> measurements;
};

/// Measurements whose noise is known and differs from one to the next (the report's IDD), in the frame of the estimate.
template <Metric M>
std::vector<Data<M>> draw() {
  constexpr int k = ManifoldTraits<M>::DoF;
  Inputs random;
  std::vector<Data<M>> result(sets);
  for (Data<M>& data : result) {
    const M centre = random.feature<M>();
    for (std::size_t i = 0; i < n; ++i) {
      const SquareOf<M> covariance = random.covariance<k>(spread);
      const SquareOf<M> root = covariance.llt().matrixL();
      data.measurements.push_back({exp(centre, TangentOf<M>(root * random.normal<k>())), covariance});
      data.features.push_back(data.measurements.back().mean);
      data.weights.push_back(scalarWeight(covariance));
    }
  }
  return result;
}

template <Metric M>
void add(std::vector<Feature>& features, const std::string& name, const std::array<double, 3>& paper_ms) {
  features.push_back({name, paper_ms, {}});
  // Filled by the runs; the vector has room for all features, so this stays where it is.
  Feature* const feature = &features.back();
  const auto data = std::make_shared<const std::vector<Data<M>>>(draw<M>());
  const auto record = [feature](std::size_t criterion, const auto& result, const SquareOf<M>& covariance) {
    keep(result.mean);
    keep(covariance);
    feature->iterations[criterion] += result.iterations;
    ++feature->calls[criterion];
  };
  const auto next = [feature, data](std::size_t criterion) -> const Data<M>& {
    return (*data)[static_cast<std::size_t>(feature->calls[criterion]) % sets];
  };
  feature->run = {[=] {
                    const Data<M>& d = next(0);
                    const auto result = mean(d.features, {.start = d.features[0]});
                    record(0, result, covarianceFromResiduals(result));
                  },
                  [=] {
                    const Data<M>& d = next(1);
                    const auto result = mean(d.features, d.weights, {.start = d.features[0]});
                    record(1, result, covarianceFromResiduals(result));
                  },
                  [=] {
                    const Data<M>& d = next(2);
                    const auto result =
                        maha(d.measurements, CovarianceAt::estimated, MahaOptions<M>{.start = d.features[0]});
                    record(2, result, result.covariance);
                  }};
}

int print() {
  std::vector<Feature> features;
  features.reserve(5);
  add<Frame3d>(features, "frames", {28.6, 29.7, 266.6});
  add<SemiOrientedFrame3d>(features, "semi-oriented", {30.3, 31.0, 272.4});
  add<NonOrientedFrame3d>(features, "non-oriented", {33.0, 32.4, 277.4});
  add<SO3d>(features, "rotations", {16.8, 17.8, 65.1});
  add<Eigen::Vector3d>(features, "points", {6.0, 6.2, 15.4});
  const std::size_t points = features.size() - 1;

  std::vector<std::function<void()>> candidates;
  for (const Feature& f : features) candidates.insert(candidates.end(), f.run.begin(), f.run.end());
  const std::vector<Eigen::Vector3d> cloud = Inputs().cloud<Eigen::Vector3d>(n, spread);
  candidates.push_back([&] { keep(handWrittenMean(cloud)); });
  const std::vector<double> ns = interleavedMedians(candidates, 101, 1e-3);
  const auto time = [&](std::size_t feature, std::size_t criterion) { return ns[3 * feature + criterion]; };

  std::printf("Table 1 of Pennec 1998 as ratios: mean and covariance of %zu features, all\n", n);
  std::printf("started at the first measurement, to a step of 1e-12. Noise of each measurement its\n");
  std::printf("own, %.1f rad (m) in the mean. Medians over 101 interleaved rounds.\n\n", spread);
  std::printf("| criterion | features      |     us | to points | paper | to LSQ | paper | steps |\n");
  std::printf("|-----------|---------------|-------:|----------:|------:|-------:|------:|------:|\n");
  const char* const criteria[] = {"LSQ", "WLSQ", "MAHA"};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t f = 0; f < features.size(); ++f) {
      const Feature& feature = features[f];
      std::printf("| %-9s | %-13s | %6.1f | %9.1f | %5.1f | %6.1f | %5.1f | %5.1f |\n", criteria[c],
                  feature.name.c_str(), time(f, c) / 1000, time(f, c) / time(points, c),
                  feature.paper_ms[c] / features[points].paper_ms[c], time(f, c) / time(f, 0),
                  feature.paper_ms[c] / feature.paper_ms[0],
                  static_cast<double>(feature.iterations[c]) / static_cast<double>(feature.calls[c]));
    }
  }
  std::printf("| direct    | barycentre    | %6.1f | %9.2f |     * |        |       |       |\n", ns.back() / 1000,
              ns.back() / time(points, 0));
  std::printf("\n* 0.08 to 0.17 (the report's footnote 4: 0.5 to 1 ms).\n");
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
