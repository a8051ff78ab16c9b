// The edge of a lane from two detectors, while a vehicle drives: points on it, and edgels, which have a slope too. The
// module (docs/estimation_module.md) runs in a thread of its own; measurements come and go, the camera's offset is a
// constant that a calibration changes, and the best answer can be read at any time.
#include <stats/channels.hpp>
#include <stats/constrained.hpp>
#include <stats/estimation_module.hpp>
#include <stats/measurement_error.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>
#include <Eigen/LU>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

namespace {

using namespace liestat;
using Lane = Eigen::Vector3d;                                        // y = q₀ + q₁ x + q₂ x², in metres
using Measurement = std::variant<Eigen::Vector2d, Eigen::Vector3d>;  // channel 0: (x, y), channel 1: (x, y, slope)

/// The state: constants of the measurement equations.
struct Camera {
  double offset = 0;  // the camera's y on the vehicle
};
const IsotropicNoise<2> point_noise(0.03);
const DiagonalNoise<3> edgel_noise(Eigen::Vector3d(0.03, 0.03, 0.02));

struct PointOnLane {
  Camera camera;
  Eigen::Matrix<double, 1, 1> operator()(const Lane& q, const Eigen::Vector2d& m) const {
    return Eigen::Matrix<double, 1, 1>(q[0] + m.x() * (q[1] + m.x() * q[2]) - camera.offset - m.y());
  }
  EquationDerivatives<1, 3, 2> linearize(const Lane& q, const Eigen::Vector2d& m) const {
    const double x = m.x();
    return {(*this)(q, m), Eigen::RowVector3d(1, x, x * x), Eigen::RowVector2d(q[1] + 2 * x * q[2], -1)};
  }
};
struct EdgelOnLane {
  Camera camera;
  Eigen::Vector2d operator()(const Lane& q, const Eigen::Vector3d& m) const {
    return {PointOnLane{camera}(q, m.head<2>())[0], q[1] + 2 * m.x() * q[2] - m.z()};
  }
  EquationDerivatives<2, 3, 3> linearize(const Lane& q, const Eigen::Vector3d& m) const {
    const double x = m.x();
    EquationDerivatives<2, 3, 3> d;
    d.value = (*this)(q, m);
    d.by_parameter << 1, x, x * x, 0, 1, 2 * x;
    d.by_measurement << q[1] + 2 * x * q[2], -1, 0, 2 * q[2], 0, -1;
    return d;
  }
};

/// Lanes with so many free coefficients; the others are zero, which is a linear constraint.
class LaneModel : public HierarchyModel<Measurement, Lane> {
 public:
  LaneModel(std::string name, int coefficients, std::vector<std::string> parents, const Camera& camera)
      : name_(std::move(name)), k_(coefficients), parents_(std::move(parents)), camera_(camera) {
    for (int i = k_; i < 3; ++i) zero_.G(i, i) = 1;
  }
  std::string name() const override { return name_; }
  std::vector<std::string> parents() const override { return parents_; }
  int freeParameters() const override { return k_; }
  int equations() const override { return 1; }
  int equationsOf(const Measurement& m) const override { return m.index() == 0 ? 1 : 2; }
  int measurementDimension() const override { return 2; }
  std::size_t sampleSize() const override { return static_cast<std::size_t>(k_); }
  double chance(double threshold) const override { return 2 * std::sqrt(threshold) * 0.03 / 8; }  // y over 8 m

  void solve(std::span<const Measurement> sample, std::vector<Lane>& solutions) const override {
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
    Lane y = Lane::Zero();
    for (int i = 0; i < k_; ++i) {
      const Measurement& m = sample[static_cast<std::size_t>(i)];
      const Eigen::Vector2d p = m.index() == 0 ? std::get<0>(m) : Eigen::Vector2d(std::get<1>(m).head<2>());
      A.row(i) = Eigen::RowVector3d(1, k_ > 1 ? p.x() : 0, k_ > 2 ? p.x() * p.x() : 0);
      y[i] = p.y() + camera_.offset;
    }
    if (std::abs(A.determinant()) > 1e-6) solutions.emplace_back(A.inverse() * y);
  }
  void errors(const Lane& q, std::span<const Measurement> all, std::span<double> squared) const override {
    for (std::size_t i = 0; i < all.size(); ++i) {
      squared[i] = all[i].index() == 0
                       ? measurementError(q, std::get<0>(all[i]), point_noise, PointOnLane{camera_}).squared
                       : measurementError(q, std::get<1>(all[i]), edgel_noise, EdgelOnLane{camera_}).squared;
    }
  }
  ModelEstimate<Lane> estimate(const Lane& start, std::span<const Measurement> inliers,
                               const StopRequest& stop) const override {
    const auto [points, edgels] = byChannel(inliers);
    const auto on_points = measurements(points, point_noise, PointOnLane{camera_});
    const auto on_edgels = measurements(edgels, edgel_noise, EdgelOnLane{camera_});
    // The hierarchy compares models by their χ²: one that does not fit is an answer, too.
    ConstrainedEstimator estimator(start, zero_, ConstrainedOptions<Lane>{.noise = StatedNoise::trusted}, on_points,
                                   on_edgels);
    while (estimator.iterate()) {
      if (stop && stop()) estimator.stop();
    }
    const auto& found = estimator.result();
    return {found.status(), found.parameter,      found.information,        found.covariance,
            found.chi2,     found.equation_error, found.degrees_of_freedom, found.measurements};
  }

 private:
  std::string name_;
  int k_;
  std::vector<std::string> parents_;
  Camera camera_;
  LinearConstraint<3, 3> zero_{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
};

using Module = EstimationModule<Measurement, Lane, Camera>;

Module::Search::Models laneModels(const Camera& camera) {
  using Names = std::vector<std::string>;
  return {std::make_shared<LaneModel>("on it", 0, Names{}, camera),
          std::make_shared<LaneModel>("parallel", 1, Names{"on it"}, camera),
          std::make_shared<LaneModel>("straight", 2, Names{"parallel"}, camera),
          std::make_shared<LaneModel>("bend", 3, Names{"straight"}, camera)};
}

void print(const char* when, const Module::Output& now) {
  std::printf("%s: %s, %zu points and %zu edgels of %zu", when, now.model.c_str(), now.inliers[0].size(),
              now.inliers[1].size(), now.measurements);
  if (!now.estimate || now.unsupported) {
    std::printf("\n");
    return;
  }
  std::printf(", criterion %.2f, D2 %.1f, E2 %.1e\n", now.criterion, now.estimate->chi2, now.estimate->equation_error);
  for (int k = 0; k < 3; ++k) {
    std::printf("  %8.4f ± %.4f", now.estimate->parameter[k], std::sqrt(now.estimate->covariance(k, k)));
  }
  std::printf("\n");
}

}  // namespace

int main() {
  Module::Options options;
  options.model_found = [](const Module::Output& now) { print("  found", now); };
  options.terminated = [](const Module::Output&) { std::printf("  nothing left to do\n"); };
  options.cost_threshold = 1.5;
  options.cost_below = [](const Module::Output& now) { std::printf("  good enough: %.2f\n", now.criterion); };
  Module module(laneModels, Camera{0.5}, options);

  const Lane lane(1.5, 0.1, -0.02);
  CounterRng random(1);
  for (std::uint64_t name = 0; name < 80; ++name) {
    const bool good = name % 5 != 0;
    const double x = random.uniform(2, 15), anywhere = random.uniform(-4, 4), turned = random.uniform(-1, 1);
    const double y = (good ? lane[0] + x * (lane[1] + x * lane[2]) - 0.5 + 0.03 * random.normal() : anywhere);
    const double slope = good ? lane[1] + 2 * x * lane[2] + 0.02 * random.normal() : turned;
    if (name % 2 == 0) {
      module.set<0>(name, Eigen::Vector2d(x, y));
    } else {
      module.set<1>(name, Eigen::Vector3d(x, y, slope));
    }
  }

  module.start();
  std::thread worker([&] { module.run(); });
  module.suspend();  // the processor is needed elsewhere, and is free again
  module.resume();
  worker.join();
  print("first", *module.output());

  // The older half of the measurements goes, the camera turns out to sit 10 cm further to the side. All that in one step,
  // and steps as long as there is time.
  for (std::uint64_t name = 0; name < 40; ++name) module.unset(name % 2, name);
  module.setState(Camera{0.6});
  while (module.step()) {
  }
  const auto last = module.output();
  print("then", *last);

  if (last->model != "bend") return 1;
  const Lane off = last->estimate->parameter - (lane + Lane(0.1, 0, 0));
  return off.dot(last->estimate->covariance.inverse() * off) < 25 ? 0 : 1;
}
