// Optional models of two-view motion: their constraints, their place in the lattice, their covariances, and whether the
// hierarchy chooses them. `liestat validate two-view --full` has more trials.

#include <experiments/two_view_lattice.hpp>
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/detail/two_view_constraints.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/hierarchy.hpp>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using TwoViewHierarchy = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;
using Names = std::vector<std::string>;

const std::vector<TwoViewNode> all_nodes = {TwoViewNode::free_zoom,       TwoViewNode::similarity,
                                            TwoViewNode::affine,          TwoViewNode::rotation_zoom,
                                            TwoViewNode::affine_epipolar, TwoViewNode::shared_focal};

std::shared_ptr<const TwoViewModel> named(const TwoViewModels& models, const std::string& name) {
  for (const auto& model : models) {
    if (model->name() == name) return model;
  }
  return nullptr;
}
Eigen::Matrix3d truthOf(const TwoViewScene& scene) { return isEpipolar(scene.options.motion) ? scene.F : scene.H; }

/// How many directions of R⁹ rows of length one leave free.
int freeDirections(Eigen::MatrixXd scaled) {
  for (Eigen::Index i = 0; i < scaled.rows(); ++i) {
    if (scaled.row(i).norm() > 0) scaled.row(i).normalize();
  }
  const Eigen::MatrixXd square = scaled.transpose() * scaled;
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(square).eigenvalues();
  return static_cast<int>((values.array() <= 1e-13 * values.maxCoeff()).count());
}

/// At the true entries: met, derivatives as differences say, and as much is free as the model says.
template <class Constraint>
void checkConstraint(const Constraint& constraint, TwoViewMotion motion) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const TwoViewScene scene({.motion = motion, .matches = 20, .outliers = 0}, seed);
    const detail::Entries q = detail::entriesFrom(truthOf(scene));
    const auto at = constraint.linearize(q);
    EXPECT_LE(at.value.norm(), 1e-14) << nameOf(motion);
    EXPECT_EQ((at.value - constraint(q)).norm(), 0) << nameOf(motion);
    // Central differences with h = 1e-5: their error is h² for the cubic det F, rounding 1e-11.
    for (int k = 0; k < 9; ++k) {
      const detail::Entries step = 1e-5 * detail::Entries::Unit(k);
      const auto above = constraint(q + step), below = constraint(q - step);
      const Eigen::VectorXd difference = (above - below) / 2e-5;
      EXPECT_LE((difference - at.by_parameter.col(k)).norm(), 5e-10) << nameOf(motion) << k;
    }
    const auto model = named(experiments::modelsFor(scene), nameOf(motion));
    ASSERT_TRUE(model) << nameOf(motion);
    EXPECT_EQ(freeDirections(at.by_parameter), model->freeParameters()) << nameOf(motion);
  }
}

TEST(TwoViewOptionalModels, ConstraintsLeaveFreeWhatTheModelsSay) {
  using M = TwoViewMotion;
  using H = detail::HomographyFamily;
  using F = detail::EpipolarFamily;
  for (const auto& [family, motion] : {std::pair{H::retinal_translation, M::retinal_translation},
                                       {H::zoom, M::zoom},
                                       {H::free_zoom, M::free_zoom},
                                       {H::retinal_displacement, M::retinal_displacement},
                                       {H::similarity, M::similarity},
                                       {H::affine, M::affine},
                                       {H::rotation, M::rotation},
                                       {H::rotation_zoom, M::rotation_zoom},
                                       {H::homography, M::homography}}) {
    checkConstraint(detail::HomographyConstraint{family}, motion);
  }
  for (const auto& [family, motion] :
       {std::pair{F::translation, M::translation}, {F::affine, M::affine_epipolar}, {F::fundamental, M::fundamental}}) {
    checkConstraint(detail::EpipolarConstraint{family}, motion);
  }
}

// With every choice of optional models the names fit together, and what contains what does not depend on which are there.
TEST(TwoViewOptionalModels, EveryPartOfTheLatticeIsOne) {
  const TwoViewImages images{{1e-3, 1e-3}, Eigen::Vector2d(1, 0.8)};
  for (const auto calibration : {TwoViewCalibration::calibrated, TwoViewCalibration::uncalibrated}) {
    const TwoViewHierarchy whole(twoViewModels(images, {.calibration = calibration, .nodes = all_nodes}));
    ASSERT_TRUE(whole.valid()) << whole.fault();
    EXPECT_EQ(whole.models().size(), calibration == TwoViewCalibration::calibrated ? 15U : 12U);
    for (unsigned subset = 0; subset < 1U << all_nodes.size(); ++subset) {
      TwoViewModelOptions options{.calibration = calibration};
      for (std::size_t i = 0; i < all_nodes.size(); ++i) {
        if ((subset >> i & 1U) != 0) options.nodes.push_back(all_nodes[i]);
      }
      const TwoViewHierarchy part(twoViewModels(images, options));
      ASSERT_TRUE(part.valid()) << part.fault();
      for (std::size_t a = 0; a < part.models().size(); ++a) {
        for (std::size_t b = 0; b < part.models().size(); ++b) {
          const auto in_whole = [&](std::size_t m) { return whole.find(part.models()[m]->name()); };
          EXPECT_EQ(part.contains(a, b), whole.contains(in_whole(a), in_whole(b)))
              << part.models()[a]->name() << " and " << part.models()[b]->name();
        }
      }
    }
  }
  const auto parents = [&](const TwoViewModelOptions& options, const char* name) {
    Names names = named(twoViewModels(images, options), name)->parents();
    std::sort(names.begin(), names.end());
    return names;
  };
  const auto uncalibrated = TwoViewCalibration::uncalibrated;
  EXPECT_EQ(parents({}, "homography"), (Names{"retinal displacement", "rotation", "zoom"}));
  EXPECT_EQ(parents({}, "translation"), (Names{"retinal translation", "zoom"}));
  EXPECT_EQ(parents({}, "essential"), (Names{"retinal displacement", "rotation", "translation"}));
  EXPECT_EQ(parents({}, "fundamental"), (Names{"essential", "homography", "translation", "zoom"}));
  EXPECT_EQ(parents({.calibration = uncalibrated}, "homography"), (Names{"retinal displacement", "zoom"}));
  EXPECT_EQ(parents({.calibration = uncalibrated}, "fundamental"), (Names{"homography", "translation", "zoom"}));
  EXPECT_EQ(parents({.nodes = all_nodes}, "homography"), (Names{"affine", "rotation and zoom"}));
  EXPECT_EQ(parents({.nodes = {TwoViewNode::shared_focal}}, "fundamental"),
            (Names{"homography", "shared focal length", "translation", "zoom"}));
  EXPECT_EQ(parents({.calibration = uncalibrated, .nodes = {TwoViewNode::shared_focal}}, "shared focal length"),
            (Names{"retinal displacement", "translation"}));
  // Verticals that agree are what a translation keeps.
  const Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  EXPECT_EQ(parents({.verticals = TwoViewVerticals{up, 2 * up}}, "upright"), Names{"translation"});
  EXPECT_EQ(parents({.verticals = TwoViewVerticals{up, Eigen::Vector3d(0.1, 1, 0)}}, "upright"), Names{"none"});
  EXPECT_EQ(parents({.verticals = TwoViewVerticals{}}, "essential"),
            (Names{"retinal displacement", "rotation", "translation", "upright"}));
  EXPECT_FALSE(named(twoViewModels(images, {.calibration = uncalibrated, .verticals = TwoViewVerticals{}}), "upright"));
  EXPECT_EQ(parents({.nodes = {TwoViewNode::affine}}, "affine"), (Names{"retinal displacement", "zoom"}));
}

double largestError(const Eigen::Matrix3d& F, const std::vector<Eigen::Vector4d>& matches) {
  double largest = 0;
  for (const Eigen::Vector4d& m : matches) {
    largest =
        std::max(largest, std::abs(Eigen::Vector3d(m[2], m[3], 1).dot(F * Eigen::Vector3d(m[0], m[1], 1)) / F.norm()));
  }
  return largest;
}
Eigen::Matrix3d cross(const Eigen::Vector3d& t) {
  return (Eigen::Matrix3d() << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0).finished();
}

// The epipolar geometries that contain a motion of the image, as models.hpp says; and how many of them there are: what the
// constraints and the equations of exact matches leave free.
TEST(TwoViewOptionalModels, EpipolarModelsContainMotionsOfTheImage) {
  using M = TwoViewMotion;
  const auto open = [](const auto& constraint, const Eigen::Matrix3d& F, const std::vector<Eigen::Vector4d>& matches) {
    const auto rows = constraint.linearize(detail::entriesFrom(F)).by_parameter;
    Eigen::MatrixXd all(rows.rows() + static_cast<Eigen::Index>(matches.size()), 9);
    all.topRows(rows.rows()) = rows;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector4d& m = matches[i];
      const Eigen::Vector3d v(m[2], m[3], 1);
      all.row(rows.rows() + static_cast<Eigen::Index>(i)) << m[0] * v.transpose(), m[1] * v.transpose(), v.transpose();
    }
    return freeDirections(all);
  };
  const detail::EpipolarConstraint translation{detail::EpipolarFamily::translation},
      affine{detail::EpipolarFamily::affine}, fundamental{detail::EpipolarFamily::fundamental};
  const TwoViewModels models = twoViewModels({}, {.nodes = all_nodes});
  for (const M motion : {M::retinal_translation, M::zoom, M::free_zoom, M::retinal_displacement, M::similarity,
                         M::affine, M::rotation_zoom, M::homography}) {
    const TwoViewScene scene({.motion = motion, .matches = 40, .outliers = 0}, 3);
    const Eigen::Matrix3d& H = scene.H;
    const auto beyond = [&](const char* general) {
      return named(models, general)->freedomBeyond(*named(models, nameOf(motion)));
    };
    Eigen::Matrix3d F = cross(Eigen::Vector3d(0.3, -0.5, 0.8)) * H;
    F *= std::sqrt(2 / F.squaredNorm());
    EXPECT_LE(largestError(F, scene.exact), 1e-14) << nameOf(motion);
    EXPECT_EQ(open(fundamental, F, scene.exact), beyond("fundamental")) << nameOf(motion);
    if (H.row(2).head<2>().norm() > 0) continue;
    // b·(u' - A u - τ) = 0 for any b.
    const Eigen::Vector2d b(0.6, -0.8);
    F.setZero();
    F.block<1, 2>(2, 0) = -b.transpose() * H.topLeftCorner<2, 2>();
    F.block<2, 1>(0, 2) = b;
    F(2, 2) = -b.dot(H.topRightCorner<2, 1>());
    F *= std::sqrt(2 / F.squaredNorm());
    EXPECT_LE(largestError(F, scene.exact), 1e-14) << nameOf(motion);
    EXPECT_LE(affine(detail::entriesFrom(F)).norm(), 1e-15);
    EXPECT_EQ(open(affine, F, scene.exact), 1) << nameOf(motion);
    EXPECT_EQ(beyond("affine epipolar"), 1) << nameOf(motion);
    if (motion == M::affine) continue;
    // A plane at distance one that stays parallel to the image: H ~ Q + t (0, 0, 1).
    const double s = std::sqrt(H.topLeftCorner<2, 2>().determinant());
    const Eigen::Vector3d t(H(0, 2) / s, H(1, 2) / s, 1 / s - 1);
    Eigen::Matrix3d Q = Eigen::Matrix3d::Identity();
    Q.topLeftCorner<2, 2>() = H.topLeftCorner<2, 2>() / s;
    EXPECT_LE(largestError(cross(t) * Q, scene.exact), 1e-14) << "essential, " << nameOf(motion);
    if (motion == M::retinal_displacement || motion == M::similarity) continue;
    F = cross(t) * std::sqrt(2 / cross(t).squaredNorm());
    EXPECT_LE(largestError(F, scene.exact), 1e-14) << "translation, " << nameOf(motion);
    // The test of support allows for more where the motion has a sample of one match.
    EXPECT_LE(open(translation, F, scene.exact), beyond("translation")) << nameOf(motion);
    if (motion == M::free_zoom) {
      EXPECT_EQ(beyond("translation"), 0);
    }
  }
}

TEST(TwoViewOptionalModels, EstimatesHaveTheCovarianceThatTheySay) {
  constexpr int trials = 60;
  for (const TwoViewMotion motion : experiments::optional_two_view_motions) {
    double distance = 0, chi2 = 0, freedom = 0;
    int rank = 0, capped = 0, refused = 0;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const TwoViewScene scene({.motion = motion, .matches = 60, .outliers = 0}, 1000 + seed);
      const auto model = named(experiments::modelsFor(scene), nameOf(motion));
      ASSERT_TRUE(model);
      rank = model->freeParameters();
      TwoViewMotionModel start;
      start.matrix = truthOf(scene);
      start.focal_length = scene.focal_scale;
      const auto found = model->estimate(start, scene.matches, {});
      if (!found.usable()) {
        ++refused;
        continue;
      }
      capped += found.status != Status::ok;
      EXPECT_GE(found.measurements, 54u);
      EXPECT_EQ(found.degrees_of_freedom, model->equations() * static_cast<int>(found.measurements) - rank);
      chi2 += found.chi2, freedom += found.degrees_of_freedom;
      distance += experiments::distanceOfTruth(scene, found, rank);
    }
    EXPECT_LE(capped, 2) << nameOf(motion);
    // Axes may nearly meet.
    EXPECT_LE(refused, motion == TwoViewMotion::shared_focal ? 3 : 0) << nameOf(motion);
    const int used = trials - refused;
    // The bounds of the default lattice's test.
    EXPECT_NEAR(chi2 / freedom, 1, 4 * std::sqrt(2 / freedom) + 0.01) << nameOf(motion);
    EXPECT_NEAR(distance / used, rank, 4 * std::sqrt(2. * rank / used) + 0.05 * rank) << nameOf(motion);
  }
}

TEST(TwoViewOptionalModels, TheHierarchyFindsTheMotion) {
  // Beside the default lattice, and with all of them in it.
  for (const bool alone : {true, false}) {
    const std::uint64_t trials = alone ? 2 : 1;
    std::size_t right = 0;
    for (const TwoViewMotion motion : experiments::optional_two_view_motions) {
      for (std::uint64_t seed = 0; seed < trials; ++seed) {
        const TwoViewScene scene({.motion = motion}, seed);
        const TwoViewImages images = experiments::imagesOf(scene.options);
        TwoViewModelOptions all{.nodes = all_nodes};
        if (motion == TwoViewMotion::upright)
          all.verticals = TwoViewVerticals{scene.vertical, scene.R * scene.vertical};
        TwoViewHierarchy search(alone ? experiments::modelsFor(scene) : twoViewModels(images, all));
        search.add(scene.matches);
        while (search.iterate()) {
        }
        if (search.models()[search.best()]->name() != nameOf(motion)) continue;
        ++right;
        // One in a hundred of 80 inliers lies beyond the threshold.
        EXPECT_GE(search.state(search.best()).inliers.size(), 72u) << nameOf(motion) << " " << seed;
      }
    }
    EXPECT_GE(right + 1, experiments::optional_two_view_motions.size() * trials) << (alone ? "alone" : "together");
  }
}

TEST(TwoViewOptionalModels, SimplerMotionsStayWhatTheyAre) {
  for (const TwoViewMotion motion : experiments::default_two_view_motions) {
    const TwoViewScene scene({.motion = motion}, 11);
    TwoViewHierarchy search(twoViewModels(experiments::imagesOf(scene.options), {.nodes = all_nodes}));
    search.add(scene.matches);
    while (search.iterate()) {
    }
    EXPECT_EQ(search.models()[search.best()]->name(), nameOf(motion));
  }
}

TEST(TwoViewOptionalModels, BadMatchesAreSaid) {
  const TwoViewImages images{{1e-3, 1e-3}, Eigen::Vector2d(1, 0.8)};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector4d> line;
  for (int i = 0; i < 40; ++i) line.emplace_back(0.01 * i, 0.02 * i, 0.01 * i + 0.3, 0.02 * i - 0.1);
  const std::vector<std::pair<std::string, std::vector<Eigen::Vector4d>>> sets = {
      {"none", {}},
      {"none", {Eigen::Vector4d(0.1, 0.2, 0.3, 0.4)}},
      {"none", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d::Constant(nan))},
      {"none", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d(0.1, 0.2, 0.1, 0.2))},
      {"retinal translation", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d(0.1, 0.2, 0.3, 0.4))},
      {"retinal translation", line}};
  for (const auto& [name, matches] : sets) {
    for (const auto calibration : {TwoViewCalibration::calibrated, TwoViewCalibration::uncalibrated}) {
      TwoViewHierarchy search(twoViewModels(images, {.calibration = calibration, .nodes = all_nodes}));
      ASSERT_TRUE(search.valid()) << search.fault();
      search.add(matches);
      while (search.iterate()) {
      }
      EXPECT_EQ(search.models()[search.best()]->name(), name) << matches.size();
    }
  }
}

}  // namespace
