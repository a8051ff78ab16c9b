// The operations of groups and of manifolds as benchmarks. The time that is printed is that of one operation: each runs
// over 1024 inputs, so that nothing is hoisted out of the loop, and every result is stored.
#pragma once

#include "../inputs.hpp"

#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace liestat::bench {

inline constexpr std::size_t suite_inputs = 1024;

/// make() as many times as the suite has inputs.
template <class Make>
auto draw(Make make) {
  auto inputs = std::make_shared<std::vector<decltype(make())>>();
  inputs->reserve(suite_inputs);
  for (std::size_t i = 0; i < suite_inputs; ++i) inputs->push_back(make());
  return inputs;
}

/// Registers f, which is timed on each of the inputs.
template <class In, class F>
void operation(const std::string& name, const std::shared_ptr<std::vector<In>>& inputs, F f) {
  benchmark::RegisterBenchmark(name.c_str(), [inputs, f](benchmark::State& state) {
    while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(suite_inputs))) {
      for (const In& input : *inputs) {
        const auto result = f(input);
        benchmark::DoNotOptimize(result);
      }
    }
  });
}

/// The operations that every Lie group offers.
template <LieGroup G>
void groupSuite(const std::string& name) {
  using Tangent = typename G::Tangent;
  using Point = Eigen::Matrix<double, G::Dim, 1>;
  Inputs random;
  const auto tangents = draw([&] { return random.tangent<G::DoF>(); });
  const auto elements = draw([&] { return G::exp(random.tangent<G::DoF>()); });
  const auto pairs =
      draw([&] { return std::pair(G::exp(random.tangent<G::DoF>()), G::exp(random.tangent<G::DoF>())); });
  const auto points = draw([&] { return std::pair(G::exp(random.tangent<G::DoF>()), Point(random.normal<G::Dim>())); });

  operation(name + "/exp", tangents, [](const Tangent& v) { return G::exp(v); });
  operation(name + "/log", elements, [](const G& x) { return x.log(); });
  operation(name + "/product", pairs, [](const auto& p) { return p.first * p.second; });
  operation(name + "/inverse", elements, [](const G& x) { return x.inverse(); });
  operation(name + "/act", points, [](const auto& p) { return p.first * p.second; });
  using Points = Eigen::Matrix<double, G::Dim, 100>;
  const auto clouds = draw([&] {
    std::pair<G, Points> cloud(G::exp(random.tangent<G::DoF>()), Points());
    for (int j = 0; j < Points::ColsAtCompileTime; ++j) cloud.second.col(j) = random.normal<G::Dim>();
    return cloud;
  });
  operation(name + "/act_on_100", clouds, [](const auto& p) { return p.first * p.second; });
  operation(name + "/matrix", elements, [](const G& x) { return x.matrix(); });
  operation(name + "/Adj", elements, [](const G& x) { return x.Adj(); });
  operation(name + "/leftJacobian", tangents, [](const Tangent& v) { return G::leftJacobian(v); });
  operation(name + "/leftJacobianInverse", tangents, [](const Tangent& v) { return G::leftJacobianInverse(v); });
  operation(name + "/rightJacobian", tangents, [](const Tangent& v) { return G::rightJacobian(v); });
  operation(name + "/rightJacobianInverse", tangents, [](const Tangent& v) { return G::rightJacobianInverse(v); });
}

/// The operations that every manifold offers, with those that lie/manifold.hpp derives from them at any point.
template <Homogeneous M>
void manifoldSuite(const std::string& name) {
  using T = ManifoldTraits<M>;
  using Tangent = typename T::Tangent;
  using Group = typename T::Group;
  Inputs random;
  const auto tangents = draw([&] { return random.tangent<T::DoF>(); });
  const auto features = draw([&] { return random.feature<M>(); });
  const auto pairs = draw([&] { return std::pair(random.feature<M>(), random.feature<M>()); });
  const auto steps = draw([&] { return std::pair(random.feature<M>(), random.tangent<T::DoF>()); });
  const auto moves = draw([&] { return std::pair(Group::exp(random.tangent<Group::DoF>()), random.feature<M>()); });

  operation(name + "/expOrigin", tangents, [](const Tangent& v) { return T::expOrigin(v); });
  operation(name + "/logOrigin", features, [](const M& x) { return T::logOrigin(x); });
  operation(name + "/dexpOrigin", tangents, [](const Tangent& v) { return T::dexpOrigin(v); });
  operation(name + "/dlogOrigin", features, [](const M& x) { return T::dlogOrigin(x); });
  operation(name + "/placement", features, [](const M& x) { return T::placement(x); });
  operation(name + "/placementJacobian", features, [](const M& x) { return T::placementJacobian(x); });
  operation(name + "/act", moves, [](const auto& m) { return T::act(m.first, m.second); });
  operation(name + "/isotropy", moves, [](const auto& m) { return T::isotropy(m.first, m.second); });
  operation(name + "/actionTransformationJacobian", moves,
            [](const auto& m) { return actionTransformationJacobian<M>(m.first, m.second); });
  operation(name + "/exp(x,v)", steps, [](const auto& s) { return exp<M>(s.first, s.second); });
  operation(name + "/log(x,y)", pairs, [](const auto& p) { return log<M>(p.first, p.second); });
  operation(name + "/errorVector", pairs, [](const auto& p) { return errorVector<M>(p.first, p.second); });
  if constexpr (Metric<M>) {
    operation(name + "/distance", pairs, [](const auto& p) { return distance<M>(p.first, p.second); });
    operation(name + "/hessianHalfSquaredDistance", tangents,
              [](const Tangent& v) { return T::hessianHalfSquaredDistance(v); });
  }
}

}  // namespace liestat::bench
