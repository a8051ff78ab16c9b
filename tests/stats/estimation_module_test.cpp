// The estimation module: a curve y = q₀ + q₁ (x - x₀) + q₂ (x - x₀)² from points on it (channel 0, one equation) and from
// edgels, points with the direction of the curve there (channel 1, two equations). The state holds x₀ and the noise.

#include <stats/estimation_module.hpp>
#include <stats/random.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace {

using namespace liestat;

struct Edgel {
  Eigen::Vector2d at;
  double angle;
  friend std::uint64_t contentKey(const Edgel& e) { return liestat::contentKey(std::tie(e.at, e.angle)); }
};
using Measurement = std::variant<Eigen::Vector2d, Edgel>;

struct Constants {
  double origin = 0, sigma = 0.05, angle_sigma = 0.03;
};
constexpr double height = 10, pi = 3.14159265358979323846;

/// Counters and a callback for the steps of the models.
struct Watch {
  std::function<void()> step;
  std::atomic<int> steps{0}, draws{0};
};

using CurveModel = HierarchyModel<Measurement, Eigen::Vector3d>;

/// The curves with so many coefficients.
class Curve : public CurveModel {
 public:
  Curve(std::string name, int coefficients, std::vector<std::string> parents, const Constants& constants,
        std::shared_ptr<Watch> watch)
      : name_(std::move(name)),
        parents_(std::move(parents)),
        k_(coefficients),
        c_(constants),
        watch_(std::move(watch)) {}
  std::string name() const override { return name_; }
  std::vector<std::string> parents() const override { return parents_; }
  int freeParameters() const override { return k_; }
  int equations() const override { return 1; }
  int equationsOf(const Measurement& m) const override { return m.index() == 0 ? 1 : 2; }
  int measurementDimension() const override { return 1; }
  std::size_t sampleSize() const override { return static_cast<std::size_t>(k_); }
  double chance(double threshold) const override { return std::sqrt(threshold) * c_.sigma / height; }

  void solve(std::span<const Measurement> sample, std::vector<Eigen::Vector3d>& solutions) const override {
    ++watch_->draws;
    // From the positions: those of both kinds.
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
    Eigen::Vector3d y = Eigen::Vector3d::Zero();
    for (int i = 0; i < k_; ++i) {
      const Eigen::Vector2d p = position(sample[static_cast<std::size_t>(i)]);
      const double t = p.x() - c_.origin;
      A.row(i) = Eigen::RowVector3d(1, k_ > 1 ? t : 0, k_ > 2 ? t * t : 0);
      y[i] = p.y();
    }
    if (!(std::abs(A.determinant()) > 1e-9)) return;
    const Eigen::Vector3d q = A.inverse() * y;
    if (q.allFinite()) solutions.push_back(q);
  }
  void errors(const Eigen::Vector3d& q, std::span<const Measurement> all, std::span<double> squared) const override {
    for (std::size_t i = 0; i < all.size(); ++i) squared[i] = residuals(q, all[i]).squaredNorm();
  }
  ModelEstimate<Eigen::Vector3d> estimate(const Eigen::Vector3d& start, std::span<const Measurement> inliers,
                                          const StopRequest& stop) const override {
    ModelEstimate<Eigen::Vector3d> result;
    result.parameter = start;
    for (int step = 0; step < 10; ++step) {
      ++watch_->steps;
      if (watch_->step) watch_->step();
      if (stop && stop()) return result;
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      int equations = 0;
      const auto [points, edgels] = byChannel(inliers);
      const auto add = [&](const auto& measurement) {
        const Eigen::Vector2d r = residuals(result.parameter, measurement);
        const Eigen::Matrix<double, 2, 3> J = jacobian(result.parameter, measurement);
        A += J.transpose() * J, b -= J.transpose() * r;
        equations += equationsOf(measurement);
      };
      for (const auto& p : points) add(Measurement(p));
      for (const auto& e : edgels) add(Measurement(e));
      result.information = A.topLeftCorner(k_, k_);
      const Eigen::LLT<Eigen::MatrixXd> root(result.information);
      if (inliers.empty() || root.info() != Eigen::Success) {
        result.status = Status::too_few;
        return result;
      }
      const Eigen::VectorXd move = root.solve(b.head(k_));
      result.parameter.head(k_) += move;
      result.covariance = root.solve(Eigen::MatrixXd::Identity(k_, k_));
      result.degrees_of_freedom = equations - k_;
      if (!(move.norm() > 1e-12)) break;
    }
    result.chi2 = 0;
    for (const Measurement& m : inliers) result.chi2 += residuals(result.parameter, m).squaredNorm();
    result.equation_error = 0;  // explicit equations are met exactly
    result.measurements = inliers.size();
    result.status = Status::ok;
    return result;
  }

 private:
  static Eigen::Vector2d position(const Measurement& m) { return m.index() == 0 ? std::get<0>(m) : std::get<1>(m).at; }
  Eigen::Vector2d residuals(const Eigen::Vector3d& q, const Measurement& m) const {
    const Eigen::Vector2d p = position(m);
    const double t = p.x() - c_.origin;
    Eigen::Vector2d r((q[0] + t * (q[1] + t * q[2]) - p.y()) / c_.sigma, 0);
    if (m.index() == 1) r[1] = std::sin(std::atan(q[1] + 2 * t * q[2]) - std::get<1>(m).angle) / c_.angle_sigma;
    return r;
  }
  Eigen::Matrix<double, 2, 3> jacobian(const Eigen::Vector3d& q, const Measurement& m) const {
    const double t = position(m).x() - c_.origin, slope = q[1] + 2 * t * q[2];
    Eigen::Matrix<double, 2, 3> J = Eigen::Matrix<double, 2, 3>::Zero();
    J.row(0) = Eigen::RowVector3d(1, t, t * t) / c_.sigma;
    if (m.index() == 1) {
      const double turn = std::cos(std::atan(slope) - std::get<1>(m).angle) / (1 + slope * slope) / c_.angle_sigma;
      J.row(1) = turn * Eigen::RowVector3d(0, 1, 2 * t);
    }
    return J;
  }

  std::string name_;
  std::vector<std::string> parents_;
  int k_;
  Constants c_;
  std::shared_ptr<Watch> watch_;
};

using Module = EstimationModule<Measurement, Eigen::Vector3d, Constants>;
using Name = Module::Name;

Module::Factory curves(std::shared_ptr<Watch> watch = std::make_shared<Watch>()) {
  return [watch](const Constants& c) -> Module::Search::Models {
    using Names = std::vector<std::string>;
    return {std::make_shared<Curve>("zero", 0, Names{}, c, watch),
            std::make_shared<Curve>("constant", 1, Names{"zero"}, c, watch),
            std::make_shared<Curve>("line", 2, Names{"constant"}, c, watch),
            std::make_shared<Curve>("parabola", 3, Names{"line"}, c, watch)};
  };
}

/// Points have names from 0 on, edgels too; the first `inliers` of each are good.
struct Scene {
  std::vector<Eigen::Vector2d> points;
  std::vector<Edgel> edgels;

  Scene(const Eigen::Vector3d& q, int inliers, int outliers, std::uint64_t seed) {
    CounterRng rng(seed, 7);
    const Constants c;
    for (int i = 0; i < 2 * (inliers + outliers); ++i) {
      const double x = rng.uniform(-3, 3), angle = rng.uniform(-pi / 2, pi / 2), y = rng.uniform(-height, height);
      const double noise = c.sigma * rng.normal(), angle_noise = c.angle_sigma * rng.normal();
      const bool good = i / 2 < inliers;
      const Eigen::Vector2d at(x, good ? q[0] + x * (q[1] + x * q[2]) + noise : y);
      if (i % 2 == 0) {
        points.push_back(at);
      } else {
        edgels.push_back({at, good ? std::atan(q[1] + 2 * x * q[2]) + angle_noise : angle});
      }
    }
  }
  void setAll(Module& module) const {
    for (std::size_t i = 0; i < points.size(); ++i) module.set<0>(i, points[i]);
    for (std::size_t i = 0; i < edgels.size(); ++i) module.set<1>(i, edgels[i]);
  }
};

std::shared_ptr<const Module::Output> finish(Module& module) {
  module.start();
  EXPECT_TRUE(module.run());
  return module.output();
}
void expectEqual(const Module::Output& a, const Module::Output& b) {
  EXPECT_EQ(a.progress, b.progress);
  EXPECT_EQ(a.model, b.model);
  EXPECT_EQ(a.measurements, b.measurements);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.outdated, b.outdated);
  ASSERT_EQ(a.estimate.has_value(), b.estimate.has_value());
  if (!a.estimate) return;
  EXPECT_LE((a.estimate->parameter - b.estimate->parameter).norm(), 1e-9);
  EXPECT_NEAR(a.criterion, b.criterion, 1e-9);
}
const std::vector<std::pair<std::string, Eigen::Vector3d>> truths = {
    {"zero", {0, 0, 0}}, {"constant", {2, 0, 0}}, {"line", {-1, 2, 0}}, {"parabola", {1, 0.5, -0.6}}};

/// Its constructor throws, which leaves a variant without a value.
struct Fragile {
  explicit Fragile(int value) { throw value; }
  std::vector<double> values;
  friend std::uint64_t contentKey(const Fragile&) { return 0; }
};

TEST(ContentKey, IsOfTheValueAndItsChannel) {
  using Twins = std::variant<Eigen::Vector2d, Eigen::Vector2d>;
  const Eigen::Vector2d p(1, 2), other(1, std::nextafter(2, 3));
  const auto key = [](const auto& m) { return contentKey(m); };
  EXPECT_EQ(key(Twins(std::in_place_index<0>, p)), key(Twins(std::in_place_index<0>, p)));
  EXPECT_NE(key(Twins(std::in_place_index<0>, p)), key(Twins(std::in_place_index<1>, p)));
  EXPECT_NE(key(Twins(std::in_place_index<0>, p)), key(Twins(std::in_place_index<0>, other)));
  EXPECT_NE(key(Twins(std::in_place_index<1>, p)), key(Twins(std::in_place_index<1>, other)));
  EXPECT_EQ(key(Eigen::Vector2d(0.0, 1)), key(Eigen::Vector2d(-0.0, 1)));
  EXPECT_NE(key(Edgel{p, 1}), key(Edgel{p, 2}));
  EXPECT_NE(key(Measurement(Edgel{p, 1})), key(Measurement(p)));
  EXPECT_NE(key(std::pair(1.0, 2.0)), key(std::pair(2.0, 1.0)));
  EXPECT_NE(key(Eigen::MatrixXd::Zero(1, 4)), key(Eigen::MatrixXd::Zero(2, 2)));
  EXPECT_EQ(key(0.5f), key(0.5));

  std::variant<double, Fragile> valueless = 1.0;
  try {
    valueless.emplace<1>(7);
  } catch (int) {
  }
  ASSERT_TRUE(valueless.valueless_by_exception());
  EXPECT_NE(key(valueless), key(std::variant<double, Fragile>(1.0)));
}

struct Padded {
  char kind;
  double value;
  friend std::uint64_t contentKey(const Padded& p) { return liestat::contentKey(std::tie(p.kind, p.value)); }
};

TEST(ContentKey, DoesNotSeePadding) {
  static_assert(std::is_trivially_copyable_v<Padded>);
  // In place: a copy need not keep padding.
  Padded a, b;
  const auto write = [](Padded& p, int byte) {
    std::memset(static_cast<void*>(&p), byte, sizeof p);
    p.kind = 'a', p.value = 1.5;
  };
  write(a, 0), write(b, 0xff);
  EXPECT_NE(std::memcmp(&a, &b, sizeof a), 0) << "there is padding";
  EXPECT_EQ(contentKey(a), contentKey(b));
  // The rest of a larger alternative held before is padding, too.
  using Mixed = std::variant<double, Padded>;
  Mixed c(a), d(Padded{'b', 7});
  c = 2.5, d = 2.5;
  EXPECT_EQ(contentKey(c), contentKey(d));
}

TEST(EstimationModule, ChoosesAModelFromBothChannels) {
  // The hierarchy's level of a right choice is more than 99 in 100: of 24 trials more than three are wrong with a
  // probability of 1e-4.
  int right = 0;
  for (const auto& [name, q] : truths) {
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      Module module(curves());
      Scene(q, 20, 8, seed).setAll(module);
      EXPECT_EQ(module.size(), 56u);
      const auto found = finish(module);
      EXPECT_EQ(found->progress, HierarchyState::terminated);
      if (found->model != name) continue;
      ++right;
      ASSERT_TRUE(found->estimate);
      EXPECT_EQ(found->measurements, 56u);
      ASSERT_EQ(found->inliers.size(), 2u);
      // One inlier in a hundred is beyond the threshold: of twenty more than five with probability 4e-8.
      for (const auto& names : found->inliers) {
        EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
        EXPECT_GE(std::count_if(names.begin(), names.end(), [](Name n) { return n < 20; }), 15);
        EXPECT_LE(names.size(), 22u);
      }
      // D² is χ² with about sixty degrees of freedom, its standard deviation eleven; the squared Mahalanobis distance
      // of the parameter is χ² with at most three, above 30 with probability 1e-6.
      EXPECT_NEAR(found->estimate->chi2, found->estimate->degrees_of_freedom, 4 * std::sqrt(2 * 60.0));
      EXPECT_NEAR(found->criterion, 1, 4 * std::sqrt(2 / 55.0));
      EXPECT_EQ(found->estimate->equation_error, 0);
      const Eigen::Index k = found->estimate->covariance.rows();
      const Eigen::VectorXd off = (found->estimate->parameter - q).head(k);
      EXPECT_LE(off.dot(found->estimate->information * off), 30) << name << " " << seed;
      if (k > 0) {
        const Eigen::MatrixXd one = found->estimate->information * found->estimate->covariance;
        EXPECT_TRUE(one.isIdentity(1e-9));
      }
    }
  }
  EXPECT_GE(right, 21);
}

TEST(EstimationModule, OfAnyOrderOfSettingAndUnsettingIsAFreshRun) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const Scene scene(truths[seed % 4].second, 15, 6, seed), other(truths[(seed + 1) % 4].second, 15, 6, seed + 20);
    Module fresh(curves()), module(curves());
    scene.setAll(fresh);
    finish(fresh);

    CounterRng rng(seed, 8);
    module.start();
    const std::size_t n = scene.points.size();
    std::vector<std::size_t> order(2 * n);
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    for (std::size_t i = order.size() - 1; i > 0; --i) {
      std::swap(order[i], order[static_cast<std::size_t>(rng.uniform() * static_cast<double>(i + 1))]);
    }
    // First something else under half of the names, and under names that go again.
    for (const std::size_t i : order) {
      const std::size_t at = i % n;
      if (i % 3 == 0) module.set<0>(at, other.points[at]);
      if (i % 3 == 1) module.set<1>(at, other.edgels[at]);
      if (i % 3 == 2) module.set<0>(1000 + i, other.points[at]);
      for (int k = 0; k < 3; ++k) module.step();
    }
    std::reverse(order.begin(), order.end());
    std::size_t changes = 0;
    for (const std::size_t i : order) {
      if (i % 3 == 2) {
        EXPECT_TRUE(module.unset(0, 1000 + i));
      }
      if (i < n) {
        module.set<0>(i, scene.points[i]);
      } else {
        EXPECT_TRUE(module.set(i - n, Measurement(scene.edgels[i - n])));
      }
      if (++changes % 4 == 0) module.step();
      if (changes % 23 == 0) module.run();
    }
    EXPECT_EQ(module.size(), 2 * n);
    expectEqual(*finish(module), *fresh.output());
  }
}

TEST(EstimationModule, AValueReplacesTheOneOfItsName) {
  Module module(curves());
  const Scene scene({-1, 2, 0}, 20, 0, 1);
  scene.setAll(module);
  module.set<0>(3, Eigen::Vector2d(1, 9));
  const auto with = finish(module);
  EXPECT_EQ(with->measurements, 40u);
  EXPECT_FALSE(std::binary_search(with->inliers[0].begin(), with->inliers[0].end(), 3u));
  module.set<0>(3, Eigen::Vector2d(1, 1));
  const auto then = finish(module);
  EXPECT_EQ(then->measurements, 40u);
  EXPECT_TRUE(std::binary_search(then->inliers[0].begin(), then->inliers[0].end(), 3u));
  // The name on the other channel is another measurement.
  EXPECT_TRUE(module.unset(1, 3));
  const auto last = finish(module);
  EXPECT_TRUE(std::binary_search(last->inliers[0].begin(), last->inliers[0].end(), 3u));
  EXPECT_FALSE(std::binary_search(last->inliers[1].begin(), last->inliers[1].end(), 3u));
  // An output read before has not changed.
  EXPECT_EQ(with->measurements, 40u);
  EXPECT_EQ(last->measurements, 39u);
  // Among equal values the named one goes.
  for (const Name twin : {50u, 51u, 52u}) module.set<0>(twin, Eigen::Vector2d(0, -1));
  EXPECT_TRUE(module.unset(0, 51));
  const auto twins = finish(module);
  const std::vector<Name> high(std::lower_bound(twins->inliers[0].begin(), twins->inliers[0].end(), 50u),
                               twins->inliers[0].end());
  EXPECT_EQ(high, (std::vector<Name>{50, 52}));
}

TEST(EstimationModule, ANewStateBeginsWithTheNullModel) {
  const Eigen::Vector3d q(1, 0.5, -0.6);
  const Scene scene(q, 30, 10, 2);
  Module module(curves());
  scene.setAll(module);
  const auto before = finish(module);
  ASSERT_EQ(before->model, "parabola");

  const Constants moved{1.5, 0.05, 0.03};
  module.setState(moved);
  EXPECT_EQ(module.state().origin, 1.5);
  EXPECT_EQ(module.output()->model, "parabola") << "until the next step";
  EXPECT_TRUE(module.step());
  EXPECT_EQ(module.output()->model, "zero");
  EXPECT_NE(module.output()->progress, HierarchyState::terminated);
  const auto after = finish(module);
  EXPECT_EQ(after->model, "parabola");
  Module fresh(curves(), moved);
  scene.setAll(fresh);
  expectEqual(*after, *finish(fresh));
  // The same curve in other coordinates.
  const Eigen::Vector3d p = before->estimate->parameter;
  const Eigen::Vector3d expected(p[0] + 1.5 * (p[1] + 1.5 * p[2]), p[1] + 3 * p[2], p[2]);
  EXPECT_LE((after->estimate->parameter - expected).norm(), 1e-9);
}

TEST(EstimationModule, SuspendedByAnotherThreadItWaits) {
  const auto watch = std::make_shared<Watch>();
  const Scene scene({1, 0.5, -0.6}, 30, 10, 3);
  Module module(curves(watch)), fresh(curves());
  scene.setAll(module);
  // The worker is held in the tenth step of its estimates.
  std::atomic<bool> inside = false, go = false;
  int calls = 0;
  watch->step = [&] {
    if (++calls != 10) return;
    inside = true, inside.notify_all();
    go.wait(false);
  };
  module.start();
  bool finished = false;
  std::thread worker([&] { finished = module.run(); });
  inside.wait(false);
  EXPECT_TRUE(module.suspend());
  EXPECT_FALSE(module.suspend());
  const int draws = watch->draws, steps = watch->steps;
  go = true, go.notify_all();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(watch->draws, draws) << "no hypothesis while it is suspended";
  EXPECT_EQ(watch->steps, steps) << "the estimate ends where it is";
  EXPECT_EQ(module.control(), ModuleControl::suspended);
  EXPECT_NE(module.output()->progress, HierarchyState::terminated);
  // Inputs that come meanwhile count.
  module.set<0>(500, Eigen::Vector2d(0, 1)), fresh.set<0>(500, Eigen::Vector2d(0, 1));
  EXPECT_TRUE(module.resume());
  worker.join();
  EXPECT_TRUE(finished);
  scene.setAll(fresh);
  expectEqual(*module.output(), *finish(fresh));
}

TEST(EstimationModule, StopEndsAWait) {
  Module module(curves());
  Scene({-1, 2, 0}, 10, 0, 3).setAll(module);
  module.start();
  module.suspend();
  bool finished = true;
  std::thread worker([&] { finished = module.run(); });
  EXPECT_TRUE(module.stop());
  worker.join();
  EXPECT_FALSE(finished);
  EXPECT_FALSE(module.output()->estimate);
}

TEST(EstimationModule, IsControlledAndFedByOtherThreads) {
  const Scene scene({1, 0.5, -0.6}, 25, 8, 4), other({-1, 2, 0}, 25, 8, 5);
  Module module(curves()), fresh(curves());
  module.start();
  std::atomic<bool> quit = false;
  std::thread worker([&] {
    while (!quit) module.run(), std::this_thread::yield();
  });
  std::thread pauses([&] {
    for (int i = 0; i < 300; ++i) module.suspend(), std::this_thread::yield(), module.resume();
  });
  const std::size_t n = scene.points.size();
  for (std::size_t i = 0; i < 4 * n; ++i) {
    const std::size_t at = i % n;
    i / n % 2 == 0 ? module.set<0>(at, other.points[at]) : module.set<1>(at, other.edgels[at]);
    if (i == 2 * n) module.setState({1, 0.05, 0.03});
    if (i % 5 == 0) module.unset(1, at);
    const auto now = module.output();
    EXPECT_LE(now->measurements, 2 * n);
    EXPECT_EQ(now->inliers.size(), 2u);
    EXPECT_LE(now->inliers[0].size() + now->inliers[1].size(), now->measurements);
  }
  module.setState({});
  scene.setAll(module);
  pauses.join();
  quit = true;
  module.stop();
  worker.join();
  scene.setAll(fresh);
  expectEqual(*finish(module), *finish(fresh));
}

TEST(EstimationModule, StopEndsAnEstimate) {
  const auto watch = std::make_shared<Watch>();
  const Scene scene({1, 0.5, -0.6}, 30, 10, 6);
  Module whole(curves());
  scene.setAll(whole);
  finish(whole);
  // Stopped in the i-th step of the estimates.
  for (const int i : {1, 2, 5, 13, 40}) {
    Module module(curves(watch));
    scene.setAll(module);
    watch->steps = 0;
    watch->step = [&] {
      if (watch->steps == i) {
        EXPECT_TRUE(module.stop());
      }
    };
    module.start();
    EXPECT_FALSE(module.run()) << i;
    EXPECT_EQ(module.control(), ModuleControl::stopped);
    EXPECT_EQ(watch->steps, i) << "no step after it";
    EXPECT_FALSE(module.step());
    EXPECT_FALSE(module.run());
    const auto best = module.output();
    EXPECT_FALSE(best->model.empty());
    watch->step = {};
    expectEqual(*finish(module), *whole.output());
  }
  // By a budget of the caller instead, which ends every other step.
  Module module(curves(watch));
  scene.setAll(module);
  module.start();
  EXPECT_FALSE(module.run([] { return true; }));
  EXPECT_EQ(module.control(), ModuleControl::running);
  int steps = 0;
  for (bool more = true; more && steps < 100000; ++steps) {
    more = module.step([&] { return steps % 2 == 0; });
  }
  expectEqual(*module.output(), *whole.output());
}

TEST(EstimationModule, EachSignalComesOnce) {
  std::vector<std::string> signals;
  Module::Options options;
  Module* running = nullptr;
  options.model_found = [&](const Module::Output& now) {
    signals.push_back(now.model);
    EXPECT_TRUE(now.estimate);
    EXPECT_EQ(running->output()->model, now.model);
  };
  options.cost_below = [&](const Module::Output& now) {
    signals.push_back("cost");
    EXPECT_LT(now.criterion, 0.5);
  };
  options.terminated = [&](const Module::Output& now) {
    signals.push_back("end");
    EXPECT_EQ(now.progress, HierarchyState::terminated);
  };
  options.cost_threshold = 0.5;
  const auto sent = [&] { return std::exchange(signals, {}); };
  using Signals = std::vector<std::string>;

  Module module(curves(), Constants{}, options);
  running = &module;
  const Scene scene({-1, 2, 0}, 30, 5, 1);
  scene.setAll(module);
  EXPECT_EQ(sent(), Signals{});
  finish(module);
  EXPECT_EQ(sent(), (Signals{"line", "end"})) << "the criterion is about one";
  module.step(), module.run();
  EXPECT_EQ(sent(), Signals{});
  // Another outlier: the model is the same, the end comes again.
  module.set<0>(900, Eigen::Vector2d(1, -9));
  finish(module);
  EXPECT_EQ(sent(), Signals{"end"});
  // Twice the noise is a quarter of the cost.
  module.setState({0, 0.1, 0.06});
  finish(module);
  EXPECT_EQ(sent(), (Signals{"line", "cost", "end"}));
  module.setState({});
  finish(module);
  EXPECT_EQ(sent(), (Signals{"line", "end"}));
  // Nothing is found where there is nothing.
  for (std::size_t i = 0; i < scene.points.size(); ++i) module.unset(0, i), module.unset(1, i);
  module.unset(0, 900);
  finish(module);
  EXPECT_EQ(sent(), Signals{"end"});
  scene.setAll(module);
  finish(module);
  EXPECT_EQ(sent(), (Signals{"line", "end"}));

  // A null model that is right is found, too, and after a new state again.
  options.cost_threshold = 5;
  options.cost_below = [&](const Module::Output&) { signals.push_back("cost"); };
  Module still(curves(), Constants{}, options);
  running = &still;
  Scene({0, 0, 0}, 30, 5, 1).setAll(still);
  finish(still);
  EXPECT_EQ(sent(), (Signals{"zero", "cost", "end"}));
  still.setState({});
  finish(still);
  EXPECT_EQ(sent(), (Signals{"zero", "cost", "end"}));
}

TEST(EstimationModule, SignalsMayCallTheModule) {
  Module::Options options;
  Module* running = nullptr;
  int ends = 0;
  options.terminated = [&](const Module::Output&) {
    if (++ends == 1) running->setState({1, 0.05, 0.03});
    if (ends == 2) running->unset(0, 0), running->set<0>(700, Eigen::Vector2d(0, -1));
    if (ends == 3) running->stop();
  };
  Module module(curves(), Constants{}, options);
  running = &module;
  Scene({-1, 2, 0}, 30, 5, 1).setAll(module);
  const auto found = finish(module);
  EXPECT_EQ(ends, 3);
  EXPECT_EQ(module.control(), ModuleControl::stopped);
  EXPECT_EQ(found->model, "line");
  EXPECT_NEAR(found->estimate->parameter[0], 1, 0.1) << "at x = 1";
  EXPECT_TRUE(std::binary_search(found->inliers[0].begin(), found->inliers[0].end(), 700u));
}

TEST(EstimationModule, HasAnAnswerAtAnyTime) {
  const Scene scene({1, 0.5, -0.6}, 30, 10, 9);
  const auto watch = std::make_shared<Watch>();
  Module module(curves(watch));
  EXPECT_EQ(module.output()->model, "zero");
  EXPECT_FALSE(module.output()->estimate);
  EXPECT_TRUE(std::isnan(module.output()->criterion));
  scene.setAll(module);
  module.start();
  bool had = false;
  std::vector<std::string> models;
  for (bool more = true; more;) {
    const int draws = watch->draws, steps = watch->steps;
    more = module.step();
    // One hypothesis; five of them, refined twice, in ten steps each.
    EXPECT_LE(watch->draws - draws, 1);
    EXPECT_LE(watch->steps - steps, 100);
    const auto now = module.output();
    EXPECT_EQ(now->measurements, 80u);
    EXPECT_FALSE(had && !now->estimate);
    had = now->estimate.has_value();
    EXPECT_EQ(had, now->progress != HierarchyState::initial);
    EXPECT_EQ(more, now->progress != HierarchyState::terminated);
    if (models.empty() || models.back() != now->model) models.push_back(now->model);
    for (const auto& names : now->inliers) {
      EXPECT_TRUE(std::all_of(names.begin(), names.end(), [](Name n) { return n < 40; }));
    }
    // One more while it works: at once an estimate of earlier measurements.
    if (!more && module.size() == 80) {
      module.set<0>(39, Eigen::Vector2d(0, 1));
      module.set<1>(39, Edgel{{0, 1}, std::atan(0.5)});
      module.start();
      EXPECT_TRUE(module.step());
      EXPECT_EQ(module.output()->model, "parabola");
      break;
    }
  }
  EXPECT_EQ(models.front(), "zero");
  EXPECT_EQ(models.back(), "parabola");
  const auto last = finish(module);
  EXPECT_FALSE(last->outdated);
  EXPECT_TRUE(std::binary_search(last->inliers[1].begin(), last->inliers[1].end(), 39u));
}

TEST(EstimationModule, AStreamOfInputsMayWait) {
  const Scene scene({1, 0.5, -0.6}, 100, 30, 3);
  // A new point with every second step, 100 in all: how often the answer is the parabola.
  const auto run = [&](std::size_t wait) {
    Module::Options options;
    options.steps_between_inputs = wait;
    Module module(curves(), Constants{}, options);
    for (std::size_t i = 0; i < 30; ++i) module.set<0>(i, scene.points[i]);
    module.start();
    int found = 0;
    for (std::size_t i = 30; i < scene.points.size(); ++i) {
      module.set<0>(i, scene.points[i]);
      module.step(), module.step();
      found += module.output()->model == "parabola";
    }
    // A new state does not wait.
    module.step();
    module.setState({});
    module.step();
    EXPECT_EQ(module.output()->measurements, scene.points.size());
    EXPECT_EQ(module.output()->model, "zero");
    finish(module);
    Module fresh(curves());
    for (std::size_t i = 0; i < scene.points.size(); ++i) fresh.set<0>(i, scene.points[i]);
    expectEqual(*module.output(), *finish(fresh));
    return found;
  };
  EXPECT_EQ(run(0), 0);
  EXPECT_GE(run(1000), 30) << "once terminated, the next come in together";
}

TEST(EstimationModule, BadInputIsSaid) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Module module(curves());
  // Control out of turn.
  EXPECT_FALSE(module.stop());
  EXPECT_FALSE(module.suspend());
  EXPECT_FALSE(module.resume());
  EXPECT_FALSE(module.step());
  EXPECT_FALSE(module.run());
  EXPECT_TRUE(module.start());
  EXPECT_FALSE(module.start());
  EXPECT_TRUE(module.suspend());
  EXPECT_FALSE(module.start());
  module.set<0>(5, Eigen::Vector2d(1, 1));
  EXPECT_FALSE(module.step());
  EXPECT_EQ(module.output()->measurements, 0u) << "nothing is done while it is suspended";
  EXPECT_TRUE(module.unset(0, 5));
  EXPECT_TRUE(module.stop());
  // Nothing at all.
  EXPECT_EQ(finish(module)->model, "zero");
  EXPECT_TRUE(module.output()->unsupported);
  // Unknown names and channels.
  module.set<0>(1, Eigen::Vector2d(1, 1));
  EXPECT_FALSE(module.unset(0, 2));
  EXPECT_FALSE(module.unset(1, 1));
  EXPECT_FALSE(module.unset(2, 1));
  EXPECT_EQ(module.size(), 1u);
  EXPECT_TRUE(module.unset(0, 1));
  EXPECT_FALSE(module.unset(0, 1));
  EXPECT_EQ(finish(module)->measurements, 0u);
  // Numbers that are none are outliers.
  const Scene scene({-1, 2, 0}, 30, 5, 1);
  scene.setAll(module);
  const auto without = finish(module);
  module.set<0>(900, Eigen::Vector2d(nan, 1));
  module.set<0>(901, Eigen::Vector2d(1, std::numeric_limits<double>::infinity()));
  module.set<1>(900, Edgel{{1, 1}, nan});
  const auto with = finish(module);
  EXPECT_EQ(with->measurements, without->measurements + 3);
  EXPECT_EQ(with->model, "line");
  EXPECT_EQ(with->inliers, without->inliers);
  // A state that is none: no measurement fits anything.
  module.setState({0, nan, nan});
  const auto none = finish(module);
  EXPECT_EQ(none->progress, HierarchyState::terminated);
  EXPECT_TRUE(none->unsupported);
  EXPECT_TRUE(none->inliers[0].empty() && none->inliers[1].empty());
  module.setState({});
  EXPECT_EQ(finish(module)->model, "line");
}

TEST(EstimationModule, SaysWhatIsWrongWithTheModels) {
  // No models for a negative noise.
  const auto some = [](const Constants& c) { return c.sigma > 0 ? curves()(c) : Module::Search::Models{}; };
  Module module(some, {0, -1, -1});
  Scene({-1, 2, 0}, 30, 5, 1).setAll(module);
  EXPECT_EQ(module.output()->fault, "no model is without parents");
  finish(module);
  EXPECT_EQ(module.output()->measurements, 70u);
  EXPECT_FALSE(module.output()->estimate);
  module.setState({});
  EXPECT_EQ(finish(module)->model, "line");
  EXPECT_EQ(module.output()->fault, "");
}

TEST(EstimationModule, OneKindOfMeasurementsIsOneChannel) {
  struct Mean : HierarchyModel<double, double> {
    bool free;
    explicit Mean(bool is_free) : free(is_free) {}
    std::string name() const override { return free ? "mean" : "zero"; }
    std::vector<std::string> parents() const override {
      return free ? std::vector<std::string>{"zero"} : std::vector<std::string>{};
    }
    int freeParameters() const override { return free; }
    int equations() const override { return 1; }
    int measurementDimension() const override { return 1; }
    std::size_t sampleSize() const override { return free; }
    void solve(std::span<const double> sample, std::vector<double>& solutions) const override {
      solutions.push_back(free ? sample[0] : 0);
    }
    void errors(const double& q, std::span<const double> all, std::span<double> squared) const override {
      for (std::size_t i = 0; i < all.size(); ++i) squared[i] = (all[i] - q) * (all[i] - q);
    }
    ModelEstimate<double> estimate(const double&, std::span<const double> inliers, const StopRequest&) const override {
      ModelEstimate<double> result;
      for (const double x : inliers) result.parameter += free ? x / static_cast<double>(inliers.size()) : 0;
      result.chi2 = 0, result.status = Status::ok;
      return result;
    }
    double chance(double threshold) const override { return std::sqrt(threshold) / 50; }
  };
  EstimationModule<double, double> module([](std::monostate) -> Hierarchy<double, double>::Models {
    return {std::make_shared<Mean>(false), std::make_shared<Mean>(true)};
  });
  CounterRng rng(1);
  for (std::uint64_t i = 0; i < 30; ++i) module.set(i, 20 + rng.normal());
  module.set<0>(30, -40.0);
  module.start();
  EXPECT_TRUE(module.run());
  EXPECT_EQ(module.output()->model, "mean");
  // Thirty numbers, of which one in a hundred is beyond the threshold.
  EXPECT_NEAR(module.output()->estimate->parameter, 20, 4 / std::sqrt(30));
  EXPECT_GE(module.output()->inliers[0].size(), 26u);
  EXPECT_LE(module.output()->inliers[0].back(), 29u);
}

}  // namespace
