// Exponentials and logarithms of many elements at a time, stored: the batches of lie/compat/batch.hpp, the library's scalars
// and a loop over Eigen's angle-axis, on the same thousand elements, which stay in the first cache.
#include "../inputs.hpp"

#include <lie/compat/batch.hpp>
#include <lie/frame3.hpp>
#include <lie/sim3.hpp>

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

namespace liestat::bench {
namespace {

constexpr std::size_t n = 1024;

/// f() does the work for all n elements; the time is that of one.
template <class F>
void perElement(const std::string& name, F f) {
  benchmark::RegisterBenchmark(name.c_str(), [f](benchmark::State& state) mutable {
    while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(n))) {
      f();
      benchmark::ClobberMemory();
    }
  });
}

template <class M>
void suite(const std::string& name) {
  using T = ManifoldTraits<M>;
  using Tangent = typename T::Tangent;
  Inputs random;
  std::vector<Tangent> tangents;
  std::vector<M> elements;
  for (std::size_t i = 0; i < n; ++i) {
    tangents.push_back(random.template tangent<T::DoF>().template cast<typename M::Scalar>());
    elements.push_back(T::expOrigin(tangents.back()));
  }
  perElement("expAll/" + name, [tangents, out = elements]() mutable { expAll<M>(tangents, std::span<M>(out)); });
  perElement("logAll/" + name, [elements, out = tangents]() mutable {
    logAll<M>(std::span<const M>(elements), std::span<Tangent>(out));
  });
  perElement("exp one by one/" + name, [tangents, out = elements]() mutable {
    for (std::size_t i = 0; i < n; ++i) out[i] = T::expOrigin(tangents[i]);
  });
  perElement("log one by one/" + name, [elements, out = tangents]() mutable {
    for (std::size_t i = 0; i < n; ++i) out[i] = T::logOrigin(elements[i]);
  });
}

[[maybe_unused]] const bool registered = [] {
  suite<SO3d>("SO3");
  suite<SO3f>("SO3 float");
  suite<SE3d>("SE3");
  suite<Frame3d>("Frame3");
  suite<Sim3d>("Sim3");
  Inputs random;
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<Eigen::Vector3d> vectors;
  for (std::size_t i = 0; i < n; ++i) {
    vectors.push_back(random.tangent<3>());
    rotations.push_back(Eigen::Quaterniond(SO3d::exp(vectors.back()).unit_quaternion()));
  }
  perElement("Eigen exp/SO3", [vectors, out = rotations]() mutable {
    for (std::size_t i = 0; i < n; ++i) {
      const double angle = vectors[i].norm();
      out[i] =
          angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, vectors[i] / angle)) : Eigen::Quaterniond::Identity();
    }
  });
  perElement("Eigen log/SO3", [rotations, out = vectors]() mutable {
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::AngleAxisd a(rotations[i]);
      out[i] = a.angle() * a.axis();
    }
  });
  return true;
}();

}  // namespace
}  // namespace liestat::bench
