// One step of the constrained estimator, per measurement: a homography (nine numbers, one constraint) from matches of
// points (four noisy coordinates, two equations). Derivatives by hand and by automatic differentiation, noises of
// different form. A step linearises the equations, eliminates the measurements' own corrections, solves for the
// parameter and evaluates the merit function.
//
// fit/: the whole estimate of the same homography from a linear start, with its covariance, beside a Gauss-Helmert loop
// written in Eigen for these very sizes and beside Ceres, whose parameters are H and the true first point of each
// match. The time is that of one match; counters: iterations, and how far the estimate is from this library's, in
// standard deviations. The library's does more: it tests chi2, the minimum and the curvature; "first order" leaves out
// the last two.
#include "../inputs.hpp"

#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include <Eigen/Dense>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
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

Homography trueHomography() {
  Homography h;
  h << 1, 0.02, 0.1, -0.03, 1, 0.05, 0.01, 0.02, 1;
  return h * (std::sqrt(3.) / h.norm());
}
std::vector<Match> matchesOf(const Homography& h, std::int64_t n) {
  Inputs random;
  std::vector<Match> matches;
  for (std::int64_t i = 0; i < n; ++i) {
    const Eigen::Vector2d p = 0.5 * random.normal<2>();
    const double w = h[6] * p[0] + h[7] * p[1] + h[8];
    const Match exact(p[0], p[1], (h[0] * p[0] + h[1] * p[1] + h[2]) / w, (h[3] * p[0] + h[4] * p[1] + h[5]) / w);
    matches.push_back(exact + sigma * random.normal<4>());
  }
  return matches;
}

template <class Equation, class Noise>
void step(benchmark::State& state, const Equation& equation, const Noise& noise) {
  const Homography h = trueHomography();
  const std::vector<Match> matches = matchesOf(h, state.range(0));
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

/// An estimate, whoever made it.
struct Answer {
  Homography h = Homography::Zero();
  Eigen::Matrix<double, 9, 9> covariance = Eigen::Matrix<double, 9, 9>::Zero();
  int iterations = 0;
};

Answer byLibrary(const std::vector<Match>& matches, const Homography& start, bool second_order) {
  ConstrainedOptions<Homography> options;
  options.second_order = second_order;
  const auto found =
      constrainedEstimate(start, measurements(matches, IsotropicNoise<4>(sigma), TransfersByHand{}), Length{}, options);
  return {found.parameter, found.covariance, found.iterations};
}

/// The Gauss-Helmert loop of a textbook: equations linearised at the corrected measurements, normal equations bordered
/// by the constraint, corrections from the multipliers.
Answer byGaussHelmert(const std::vector<Match>& matches, const Homography& start) {
  Answer answer{.h = start};
  std::vector<Match> corrected = matches;
  std::vector<EquationDerivatives<2, 9, 4>> rows(matches.size());
  std::vector<Eigen::Matrix2d> weights(matches.size());
  Eigen::Matrix<double, 10, 10> normal;
  for (; answer.iterations < 50; ++answer.iterations) {
    normal.setZero();
    Eigen::Matrix<double, 10, 1> right = Eigen::Matrix<double, 10, 1>::Zero();
    for (std::size_t i = 0; i < matches.size(); ++i) {
      EquationDerivatives<2, 9, 4>& row = rows[i];
      row = TransfersByHand{}.linearize(answer.h, corrected[i]);
      row.value += row.by_measurement * (matches[i] - corrected[i]);
      weights[i] = (sigma * sigma * row.by_measurement * row.by_measurement.transpose()).inverse();
      const Eigen::Matrix<double, 9, 2> AW = row.by_parameter.transpose() * weights[i];
      normal.topLeftCorner<9, 9>().noalias() += AW * row.by_parameter;
      right.head<9>().noalias() -= AW * row.value;
    }
    normal.topRightCorner<9, 1>() = 2 * answer.h, normal.bottomLeftCorner<1, 9>() = 2 * answer.h.transpose();
    right[9] = 3 - answer.h.squaredNorm();
    const Homography step = normal.partialPivLu().solve(right).head<9>();
    answer.h += step;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      corrected[i] = matches[i] - sigma * sigma * rows[i].by_measurement.transpose() *
                                      (weights[i] * (rows[i].by_parameter * step + rows[i].value));
    }
    if (step.dot(normal.topLeftCorner<9, 9>() * step) < 1e-18) break;
  }
  answer.covariance = normal.inverse().topLeftCorner<9, 9>();
  return answer;
}

/// A match as Ceres sees it: H and the true first point are parameters.
struct MatchCost {
  Match m;
  template <class S>
  bool operator()(const S* h, const S* p, S* residuals) const {
    const S w = h[6] * p[0] + h[7] * p[1] + h[8];
    residuals[0] = (p[0] - m[0]) / sigma;
    residuals[1] = (p[1] - m[1]) / sigma;
    residuals[2] = ((h[0] * p[0] + h[1] * p[1] + h[2]) / w - m[2]) / sigma;
    residuals[3] = ((h[3] * p[0] + h[4] * p[1] + h[5]) / w - m[3]) / sigma;
    return true;
  }
};
Answer byCeres(const std::vector<Match>& matches, const Homography& start) {
  Answer answer{.h = start};
  std::vector<Eigen::Vector2d> points;
  for (const Match& m : matches) points.emplace_back(m.head<2>());
  ceres::Problem problem;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<MatchCost, 4, 9, 2>(new MatchCost{matches[i]}), nullptr,
                             answer.h.data(), points[i].data());
  }
  problem.SetManifold(answer.h.data(), new ceres::SphereManifold<9>);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.function_tolerance = 1e-14, options.parameter_tolerance = 1e-12, options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  answer.iterations = static_cast<int>(summary.iterations.size());
  ceres::Covariance covariance({});
  const std::vector<std::pair<const double*, const double*>> blocks{{answer.h.data(), answer.h.data()}};
  covariance.Compute(blocks, &problem);
  covariance.GetCovarianceBlock(answer.h.data(), answer.h.data(), answer.covariance.data());
  return answer;
}

template <class Estimate>
void fit(benchmark::State& state, const Estimate& estimate) {
  const Homography truth = trueHomography();
  const std::vector<Match> matches = matchesOf(truth, state.range(0));
  Homography start = truth;
  for (int k = 0; k < 9; ++k) start[k] += 0.01 * (k % 3 - 1);
  start *= std::sqrt(3.) / start.norm();
  Answer answer;
  while (state.KeepRunningBatch(state.range(0))) {
    answer = estimate(matches, start);
    benchmark::DoNotOptimize(answer);
  }
  const Answer own = byLibrary(matches, start, true);
  const Homography difference = (answer.h.dot(own.h) < 0 ? -answer.h : answer.h) - own.h;
  state.counters["iterations"] = answer.iterations;
  state.counters["sds_apart"] = std::sqrt(difference.cwiseAbs2().cwiseQuotient(own.covariance.diagonal()).maxCoeff());
  state.counters["sd_ratio"] = std::sqrt(answer.covariance.trace() / own.covariance.trace());
}
template <class Estimate>
void addFit(const std::string& name, const Estimate& estimate) {
  benchmark::RegisterBenchmark(("fit/homography/" + name).c_str(),
                               [=](benchmark::State& state) { fit(state, estimate); })
      ->Arg(20)
      ->Arg(100)
      ->Arg(1000);
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
  addFit("liestat", [](const auto& matches, const auto& start) { return byLibrary(matches, start, true); });
  addFit("liestat, first order",
         [](const auto& matches, const auto& start) { return byLibrary(matches, start, false); });
  addFit("Gauss-Helmert by hand", byGaussHelmert);
  addFit("Ceres", byCeres);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
