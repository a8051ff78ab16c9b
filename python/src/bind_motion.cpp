// The recursive motion filter for Python: all frames of some tracks in one call.
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/track_pairs.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/executor.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

/// Observations in rows x, y with their tracks, those of frame i in [offsets[i], offsets[i+1]). Rotations of a gyroscope
/// by frame with their covariances, or empty.
py::dict motion(const py::array_t<std::int64_t, py::array::c_style>& offsets,
                const py::array_t<std::int64_t, py::array::c_style>& tracks, const DoubleArray& xy, double sigma,
                std::size_t span, bool outliers, bool essential, const DoubleArray& gyroscope,
                const DoubleArray& gyroscope_covariance, double process_noise) {
  const auto frames = static_cast<std::size_t>(offsets.size() - 1);
  const auto n = static_cast<py::ssize_t>(frames);
  MotionFilterOptions options;
  options.outliers = outliers;
  options.process_noise = process_noise;
  const bool has_gyroscope = gyroscope.size() > 0;
  if (has_gyroscope) options.flow = Flow::discrete;
  DoubleArray direction({n, py::ssize_t{3}}), rotation({n, py::ssize_t{4}});
  DoubleArray direction_covariance({n, py::ssize_t{2}, py::ssize_t{2}});
  DoubleArray rotation_covariance({n, py::ssize_t{3}, py::ssize_t{3}});
  DoubleArray inverse_depth(n), innovation(n);
  py::array_t<bool> ok(n), standstill(n), degenerate(n), ambiguous(n), undecided_sign(n), lost(n);
  py::array_t<std::int64_t> inliers(n);
  struct Out {
    double *direction, *direction_covariance, *rotation, *rotation_covariance, *inverse_depth, *innovation;
    bool *ok, *standstill, *degenerate, *ambiguous, *undecided_sign, *lost;
    std::int64_t* inliers;
  };
  const Out out{direction.mutable_data(),
                direction_covariance.mutable_data(),
                rotation.mutable_data(),
                rotation_covariance.mutable_data(),
                inverse_depth.mutable_data(),
                innovation.mutable_data(),
                ok.mutable_data(),
                standstill.mutable_data(),
                degenerate.mutable_data(),
                ambiguous.mutable_data(),
                undecided_sign.mutable_data(),
                lost.mutable_data(),
                inliers.mutable_data()};
  const std::int64_t* const begin = offsets.data();
  const std::int64_t* const ids = tracks.data();
  const double* const points = xy.data();
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    MotionFilter filter(options, {.essential = essential});
    TrackPairs pairs({.frames = span});
    std::vector<TrackObservation> seen;
    for (std::size_t i = 0; i < frames; ++i) {
      signals.look();
      seen.clear();
      for (std::int64_t j = begin[i]; j < begin[i + 1]; ++j) {
        seen.push_back({static_cast<std::uint64_t>(ids[j]), vector<2>(points + 2 * j), sigma});
      }
      const auto list = pairs.add(seen);
      const MotionEstimate& estimate = has_gyroscope
                                           ? filter.update(list, {vector<3>(gyroscope.data() + 3 * i),
                                                                  square<3>(gyroscope_covariance.data() + 9 * i)})
                                           : filter.update(list);
      storePoint(estimate.direction.mean, out.direction + 3 * i);
      store(estimate.direction.covariance, out.direction_covariance + 4 * i);
      storePoint(estimate.rotation.mean, out.rotation + 4 * i);
      store(estimate.rotation.covariance, out.rotation_covariance + 9 * i);
      out.inverse_depth[i] = estimate.mean_inverse_depth;
      out.innovation[i] = estimate.innovation;
      out.ok[i] = estimate.ok();
      out.standstill[i] = estimate.flags.standstill;
      out.degenerate[i] = estimate.flags.degenerate;
      out.ambiguous[i] = estimate.flags.ambiguous;
      out.undecided_sign[i] = estimate.flags.undecided_sign;
      out.lost[i] = estimate.flags.lost;
      out.inliers[i] = static_cast<std::int64_t>(estimate.inliers);
    }
  }
  py::dict d;
  d["direction"] = direction;
  d["direction_covariance"] = direction_covariance;
  d["rotation"] = rotation;
  d["rotation_covariance"] = rotation_covariance;
  d["mean_inverse_depth"] = inverse_depth;
  d["innovation"] = innovation;
  d["ok"] = ok;
  d["standstill"] = standstill;
  d["degenerate"] = degenerate;
  d["ambiguous"] = ambiguous;
  d["undecided_sign"] = undecided_sign;
  d["lost"] = lost;
  d["inliers"] = inliers;
  return d;
}

}  // namespace

void bindMotion(py::module_& module) { module.def("motion", &motion); }

}  // namespace liestat::python
