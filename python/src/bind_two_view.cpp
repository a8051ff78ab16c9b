// Motion between two views for Python.
#include <fusion/two_view/robust.hpp>
#include <fusion/two_view/two_view.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/camera_arguments.hpp>
#include <python/src/described.hpp>
#include <python/src/interruptible.hpp>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

std::vector<Eigen::Vector4d> matchesOf(const DoubleArray& rows) {
  std::vector<Eigen::Vector4d> list(static_cast<std::size_t>(rows.shape(0)));
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = vector<4>(rows.data() + 4 * i);
  return list;
}

DoubleArray matrixOf(const Eigen::MatrixXd& m) {
  DoubleArray array({static_cast<py::ssize_t>(m.rows()), static_cast<py::ssize_t>(m.cols())});
  double* out = array.mutable_data();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) *out++ = m(i, j);
  }
  return array;
}
DoubleArray vectorOf(const Eigen::VectorXd& v) {
  DoubleArray array(static_cast<py::ssize_t>(v.size()));
  for (Eigen::Index i = 0; i < v.size(); ++i) array.mutable_data()[i] = v[i];
  return array;
}
py::dict poseOf(const Gaussian<Essentiald>& pose) {
  py::dict d;
  d["quaternion"] = vectorOf(pose.mean.so3().params());
  d["direction"] = vectorOf(pose.mean.direction().unit_vector());
  d["covariance"] = matrixOf(pose.covariance);
  return d;
}

py::dict twoView(const DoubleArray& matches, double sigma, const DoubleArray& first, const DoubleArray& second,
                 const DoubleArray& image_size, bool noise_is_known, double focal_sigma, double k1_sigma,
                 std::uint64_t seed) {
  TwoViewMotionOptions options;
  options.noise_is_known = noise_is_known;
  options.focal_length_sigma = focal_sigma, options.k1_sigma = k1_sigma;
  options.sigma = sigma;
  options.first = optionalCamera(first);
  options.second = optionalCamera(second);
  if (image_size.size() > 0) options.image_size = vector<2>(image_size.data());
  options.search.seed = seed;
  TwoViewMotionEstimate found;
  {
    std::vector<Eigen::Vector4d> list = matchesOf(matches);
    const py::gil_scoped_release released;
    found = interruptible([list = std::move(list), options](const std::atomic<bool>& stop) {
      TwoViewMotionOptions stoppable = options;
      stoppable.stop = [&stop] { return stop.load(); };
      return estimateTwoViewMotion(list, stoppable);
    });
  }
  return dictWithSeries(found);
}

struct RobustAnswer {
  TwoViewRobustResult base;
  Eigen::MatrixXd matrix, covariance;
  std::optional<Gaussian<Essentiald>> pose;
};

py::dict robust(const std::string& what, const DoubleArray& matches, double first_sigma, double second_sigma,
                double confidence, double threshold, std::size_t max_draws, std::uint64_t seed) {
  TwoViewRobustOptions options;
  options.confidence = confidence;
  options.threshold = threshold;
  options.max_draws = max_draws;
  options.seed = seed;
  RobustAnswer answer;
  {
    std::vector<Eigen::Vector4d> list = matchesOf(matches);
    const MatchNoise noise{first_sigma, second_sigma};
    const py::gil_scoped_release released;
    answer = interruptible([list = std::move(list), options, noise, what](const std::atomic<bool>&) -> RobustAnswer {
      if (what == "homography") {
        const RobustHomography r = robustHomography(list, noise, options);
        return {r, r.H, r.covariance, std::nullopt};
      }
      if (what == "fundamental") {
        const RobustFundamental r = robustFundamental(list, noise, options);
        return {r, r.F, r.covariance, std::nullopt};
      }
      const RobustEssential r = robustEssential(list, noise, options);
      return {r, r.E, Eigen::MatrixXd(), r.pose};
    });
  }
  py::dict d;
  d["status"] = text(name(answer.base.status));
  d["matrix"] = matrixOf(answer.matrix);
  d["matrix_covariance"] = matrixOf(answer.covariance);
  d["relative_pose"] = answer.pose ? py::object(poseOf(*answer.pose)) : py::object(py::none());
  py::list inliers;
  for (const std::size_t i : answer.base.inliers) inliers.append(i);
  d["inliers"] = inliers;
  d["score"] = answer.base.score;
  d["chi2"] = answer.base.chi2;
  d["confidence"] = answer.base.confidence;
  d["draws"] = answer.base.draws;
  return d;
}

/// Bearings of pixels and their standard deviations in rows; NaN where no direction is seen.
DoubleArray bearingsOfPixels(const DoubleArray& camera_numbers, const DoubleArray& pixels, double sigma) {
  const Camera camera = cameraOf(camera_numbers.data());
  const py::ssize_t n = pixels.shape(0);
  DoubleArray rows({n, py::ssize_t{4}});
  double* out = rows.mutable_data();
  const double* in = pixels.data();
  const py::gil_scoped_release released;
  for (py::ssize_t i = 0; i < n; ++i, out += 4) {
    const auto ray = camera.bearingWithSigma(vector<2>(in + 2 * i), sigma);
    if (ray) {
      store(ray->direction, out);
      out[3] = ray->sigma;
    } else {
      std::fill(out, out + 4, std::numeric_limits<double>::quiet_NaN());
    }
  }
  return rows;
}

}  // namespace

void bindTwoView(py::module_& module) {
  module.def("two_view", &twoView);
  module.def("robust_two_view", &robust);
  module.def("bearings", &bearingsOfPixels);
}

}  // namespace liestat::python
