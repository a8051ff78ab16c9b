// How did the camera move? Matches between two images, a quarter of them wrong: the hierarchy of models says which motion
// explains them, and how well it is known.

#include <fusion/two_view/models.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/hierarchy.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <vector>

int main() {
  using namespace liestat;
  // A camera with a focal length of 600 px turns by four degrees and moves half a metre to the side; x' = R x + t.
  const double f = 600, sigma = 0.5 / f;
  const SO3d R = SO3d::exp(Eigen::Vector3d(0.01, 0.07, -0.02));
  const Eigen::Vector3d t(0.5, 0.05, 0.1);
  CounterRng random(1);
  std::vector<Eigen::Vector4d> matches;
  while (matches.size() < 150) {
    const Eigen::Vector3d ray(random.uniform(-0.5, 0.5), random.uniform(-0.4, 0.4), 1);
    const Eigen::Vector3d x = R * (random.uniform(3, 9) * ray) + t;
    matches.emplace_back(ray.x(), ray.y(), x.x() / x.z(), x.y() / x.z());
    matches.back() += sigma * random.normalVector<4>();
  }
  for (int i = 0; i < 50; ++i) {
    matches.emplace_back(random.uniform(-0.5, 0.5), random.uniform(-0.4, 0.4), random.uniform(-0.5, 0.5),
                         random.uniform(-0.4, 0.4));
  }

  // Normalised coordinates: noise and image size are divided by the focal length.
  const TwoViewImages images{{sigma, sigma}, Eigen::Vector2d(640, 480) / f};
  Hierarchy<Eigen::Vector4d, TwoViewMotionModel> search(twoViewModels(images));
  search.add(matches);
  while (search.iterate()) {  // one hypothesis at a time: there is an answer whenever this ends
  }

  for (std::size_t m = 0; m < search.models().size(); ++m) {
    const auto& state = search.state(m);
    if (!state.hasEstimate() || state.inliers.empty()) continue;
    std::printf("%-21s %4zu inliers, %7.2f a degree of freedom", search.models()[m]->name().c_str(),
                state.inliers.size(), state.fit.normalised());
    if (state.rejected_by) {
      std::printf("   rejected by %s: %s", search.models()[*state.rejected_by]->name().c_str(), name(state.rejection));
    }
    std::printf("\n");
  }
  const auto& found = search.state(search.best());
  std::printf("\nchosen: %s\n", search.models()[search.best()]->name().c_str());
  const auto& pose = found.estimate.parameter.pose;
  const auto& covariance = found.estimate.covariance;
  using units::degree;
  std::printf("direction off by %.2f degrees, standard deviations %.2f and %.2f\n",
              std::acos(std::min(1.0, pose.direction().unit_vector().dot(t.normalized()))) / degree,
              std::sqrt(covariance(0, 0)) / degree, std::sqrt(covariance(1, 1)) / degree);
  std::printf("rotation off by %.3f degrees, standard deviations %.3f, %.3f, %.3f\n",
              (pose.so3().inverse() * R).log().norm() / degree, std::sqrt(covariance(2, 2)) / degree,
              std::sqrt(covariance(3, 3)) / degree, std::sqrt(covariance(4, 4)) / degree);
  return search.models()[search.best()]->name() == "essential" ? 0 : 1;
}
