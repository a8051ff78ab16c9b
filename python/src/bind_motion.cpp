// The recursive motion filter for Python: all frames of some tracks in one call.
#include <fusion/motion/sequence.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <python/src/executor.hpp>

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace liestat::python {
namespace {

using Integers = py::array_t<std::int64_t, py::array::c_style>;

/// Observations in rows x, y with their tracks, those of frame i in [offsets[i], offsets[i+1]). Rotations of a
/// gyroscope since the frame before with their covariances, or empty; rotations (camera_R_world) and centres of the
/// true poses, or empty. The series have a row for each frame from 0 on.
py::dict motion(const Integers& offsets, const Integers& tracks, const DoubleArray& xy, double sigma, std::size_t flow,
                std::size_t filter, std::size_t frames_apart, std::size_t starts, bool outliers, bool bias,
                double bias_sigma, double process_noise, double rotation_noise, std::size_t passes,
                const DoubleArray& gyroscope, const DoubleArray& gyroscope_covariance, double seconds,
                const DoubleArray& true_rotations, const DoubleArray& true_centres, double min_motion) {
  MotionOptions options{static_cast<FlowChoice>(flow), static_cast<FilterChoice>(filter)};
  options.frames_apart = frames_apart, options.starts = starts, options.outliers = outliers, options.passes = passes;
  options.bias = bias, options.bias_sigma = bias_sigma;
  options.process_noise = process_noise, options.rotation_noise = rotation_noise;
  TrackFrames frames;
  for (py::ssize_t i = 0; i + 1 < offsets.size(); ++i) {
    for (std::int64_t j = offsets.data()[i]; j < offsets.data()[i + 1]; ++j) {
      frames[static_cast<std::size_t>(i)].push_back(
          {static_cast<std::uint64_t>(tracks.data()[j]), vector<2>(xy.data() + 2 * j), sigma});
    }
  }
  MotionGyroscope sensor;
  if (gyroscope.size() > 0) {
    std::vector<GyroscopeRotation> rotations;
    for (py::ssize_t i = 0; i < gyroscope.shape(0); ++i) {
      rotations.push_back({vector<3>(gyroscope.data() + 3 * i), square<3>(gyroscope_covariance.data() + 9 * i)});
    }
    sensor = gyroscopeOfRotations(std::move(rotations), seconds);
  }
  std::map<std::size_t, TrueCamera> truth;
  for (py::ssize_t i = 0; i < true_rotations.shape(0); ++i) {
    truth.emplace(i, TrueCamera{square<3>(true_rotations.data() + 9 * i), vector<3>(true_centres.data() + 3 * i)});
  }
  MotionResult result;
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    result = estimateMotion(frames, options, sensor, [&](const MotionFrame&, const MotionFilter&) { signals.look(); });
    if (!truth.empty()) compareWithTruth(result, truth, min_motion);
  }
  DictView view;
  describe(view, result);
  // Frames up to the first one with points have no motion.
  MotionFrame without;
  without.motion.flags.too_few = without.motion.flags.degenerate = without.motion.flags.undecided_sign = true;
  if (!frames.empty()) result.frames.insert(result.frames.begin(), result.first_frame + 1, without);
  for (std::size_t i = 0; i < result.frames.size(); ++i) result.frames[i].frame = i;
  describeSeries(view, result);
  view.dict["fault"] = inWords(result.fault);
  return view.dict;
}

py::tuple words(const auto& names) {
  py::list list;
  for (const auto& name : names) list.append(text(name));
  return py::tuple(list);
}

}  // namespace

void bindMotion(py::module_& module) {
  module.def("motion", &motion);
  const MotionOptions defaults;
  py::dict d;
  d["flow"] = text(flow_choices[static_cast<std::size_t>(defaults.flow)]);
  d["filter"] = text(filter_choices[static_cast<std::size_t>(defaults.filter)]);
  d["frames_apart"] = defaults.frames_apart, d["starts"] = defaults.starts, d["outliers"] = defaults.outliers;
  d["bias"] = defaults.bias, d["bias_sigma"] = defaults.bias_sigma, d["passes"] = defaults.passes;
  d["process_noise"] = defaults.process_noise, d["rotation_noise"] = defaults.rotation_noise;
  module.attr("motion_defaults") = d;
  module.attr("motion_flows") = words(flow_choices);
  module.attr("motion_filters") = words(filter_choices);
}

}  // namespace liestat::python
