// One step of the constrained estimator, per measurement: a homography (nine numbers, one constraint) from matches of
// points (four noisy coordinates, two equations). Derivatives by hand and by automatic differentiation, noises of
// different form. A step linearises the equations, eliminates the measurements' own corrections, solves for the
// parameter and evaluates the merit function.
#include "../inputs.hpp"

#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>

#include <benchmark/benchmark.h>

#include <vector>

namespace liestat::bench {
namespace {

using Homography = Eigen::Matrix<double, 9, 1>;  // row by row
using Match = Eigen::Vector4d;

struct Transfers {
  template <class S>
  Eigen::Matrix<S, 2, 1> operator()(const Eigen::Matrix<S, 9, 1>& h, const Eigen::Matrix<S, 4, 1>& m) const {
    const S w = h[6] * m[0] + h[7] * m[1] + h[8];
    return Eigen::Matrix<S, 2, 1>(w * m[2] - h[0] * m[0] - h[1] * m[1] - h[2],
                                  w * m[3] - h[3] * m[0] - h[4] * m[1] - h[5]);
  }
};
struct TransfersByHand {
  Eigen::Vector2d operator()(const Homography& h, const Match& m) const { return Transfers{}(h, m); }
  EquationDerivatives<2, 9, 4> linearize(const Homography& h, const Match& m) const {
    EquationDerivatives<2, 9, 4> J;
    const double w = h[6] * m[0] + h[7] * m[1] + h[8];
    J.value = (*this)(h, m);
    J.by_parameter << -m[0], -m[1], -1, 0, 0, 0, m[2] * m[0], m[2] * m[1], m[2],  //
        0, 0, 0, -m[0], -m[1], -1, m[3] * m[0], m[3] * m[1], m[3];
    J.by_measurement << m[2] * h[6] - h[0], m[2] * h[7] - h[1], w, 0,  //
        m[3] * h[6] - h[3], m[3] * h[7] - h[4], 0, w;
    return J;
  }
};
struct Length {
  Eigen::Matrix<double, 1, 1> operator()(const Homography& h) const {
    return Eigen::Matrix<double, 1, 1>(h.squaredNorm() - 3);
  }
  ConstraintDerivatives<1, 9> linearize(const Homography& h) const { return {(*this)(h), 2 * h.transpose()}; }
};

constexpr double sigma = 1e-3;

template <class Equation, class Noise>
void step(benchmark::State& state, const Equation& equation, const Noise& noise) {
  Inputs random;
  Homography h;
  h << 1, 0.02, 0.1, -0.03, 1, 0.05, 0.01, 0.02, 1;
  h *= std::sqrt(3.) / h.norm();
  std::vector<Match> matches;
  for (int i = 0; i < state.range(0); ++i) {
    const Eigen::Vector2d p = 0.5 * random.normal<2>();
    const double w = h[6] * p[0] + h[7] * p[1] + h[8];
    const Match exact(p[0], p[1], (h[0] * p[0] + h[1] * p[1] + h[2]) / w, (h[3] * p[0] + h[4] * p[1] + h[5]) / w);
    matches.push_back(exact + sigma * random.normal<4>());
  }
  const auto channel = measurements(matches, noise, equation);
  while (state.KeepRunningBatch(state.range(0))) {
    state.PauseTiming();
    ConstrainedEstimator estimator(h, Length{}, ConstrainedOptions<Homography>{}, channel);
    state.ResumeTiming();
    estimator.iterate();
    benchmark::DoNotOptimize(estimator.result().parameter);
  }
}

template <class Equation, class Noise>
void add(const char* name, const Equation& equation, const Noise& noise) {
  benchmark::RegisterBenchmark(name, [=](benchmark::State& state) { step(state, equation, noise); })
      ->Arg(100)
      ->Arg(10000);
}

}  // namespace
}  // namespace liestat::bench

int main(int argc, char** argv) {
  using namespace liestat;
  using namespace liestat::bench;
  add("step/isotropic", TransfersByHand{}, IsotropicNoise<4>(sigma));
  add("step/diagonal", TransfersByHand{}, DiagonalNoise<4>(Eigen::Vector4d::Constant(sigma)));
  add("step/covariance", TransfersByHand{}, CovarianceNoise<4>(sigma * sigma * Eigen::Matrix4d::Identity()));
  add("step/information", TransfersByHand{}, InformationNoise<4>(Eigen::Matrix4d::Identity() / (sigma * sigma)));
  add("step/isotropic, automatic", autoDiff(Transfers{}), IsotropicNoise<4>(sigma));
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
