// Hand-eye calibration for Python.
#include <fusion/hand_eye.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <python/src/interruptible.hpp>

#include <pybind11/stl.h>

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat::python {
namespace {

py::dict calibrate(const DoubleArray& a, const DoubleArray& a_covariance, const DoubleArray& b,
                   const DoubleArray& b_covariance, bool world, bool known_noise, bool find_outliers, double gate,
                   int samples, std::uint64_t seed, const DoubleArray& times,
                   const std::array<double, hand_eye_suspects>& suspect_sigmas, const DoubleArray& stream_times,
                   const DoubleArray& stream_poses, bool interpolate, double largest_delay) {
  const auto n = static_cast<std::size_t>(a.shape(0));
  std::vector<PosePair> pairs(n);
  for (std::size_t i = 0; i < n; ++i) {
    pairs[i].a = {point<SE3d>(a.data() + 7 * i), square<6>(a_covariance.data() + 36 * i)};
    pairs[i].b = {point<SE3d>(b.data() + 7 * i), square<6>(b_covariance.data() + 36 * i)};
  }
  HandEyeOptions options;
  options.known_noise = known_noise;
  options.find_outliers = find_outliers;
  options.gate = gate;
  options.samples = samples;
  options.seed = seed;
  options.times.assign(times.data(), times.data() + times.size());
  options.suspect_sigmas = suspect_sigmas;
  options.interpolate = interpolate;
  options.largest_delay = largest_delay;
  for (std::size_t i = 0; i < static_cast<std::size_t>(stream_times.size()); ++i) {
    options.stream_of_a.push_back({stream_times.data()[i], point<SE3d>(stream_poses.data() + 7 * i)});
  }
  HandEyeResult result;
  {
    const py::gil_scoped_release released;
    result = interruptible([pairs = std::move(pairs), options, world](const std::atomic<bool>&) {
      return world ? estimateRobotWorld(pairs, options) : estimateHandEye(pairs, options);
    });
  }
  return dictWithSeries(result);
}

}  // namespace

void bindHandEye(py::module_& module) { module.def("hand_eye", &calibrate); }

}  // namespace liestat::python
