// Pixels and bearings: each the other's inverse wherever either is defined, and how the one's noise becomes the
// other's.

#include <fusion/camera.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

namespace liestat {
namespace {

Camera euroc() {
  return {.fu = 458.654,
          .fv = 457.296,
          .cu = 367.215,
          .cv = 248.375,
          .distortion = Distortion::radtan,
          .coefficients = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
          .width = 752,
          .height = 480};
}

/// TUM-VI's lens: the corners of the image are more than 90 degrees off the axis.
Camera fisheye() {
  return {
      .fu = 190.97847715128717,
      .fv = 190.9733070521226,
      .cu = 254.93170605935475,
      .cv = 256.8974428996504,
      .distortion = Distortion::equidistant,
      .coefficients = {0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182},
      .width = 512,
      .height = 512};
}

Camera pinhole() { return {.fu = 450, .fv = 440, .cu = 376, .cv = 240, .width = 752, .height = 480}; }

/// Fisheye lenses with the numbers of calibrations of TUM-VI's camera, and a mirror.
Camera doubleSphere() {
  return {.fu = 158.28,
          .fv = 158.27,
          .cu = 254.96,
          .cv = 256.86,
          .distortion = Distortion::double_sphere,
          .coefficients = {-0.172, 0.593, 0, 0},
          .width = 512,
          .height = 512};
}
Camera extended() {
  return {.fu = 191.1,
          .fv = 191.1,
          .cu = 254.9,
          .cv = 256.9,
          .distortion = Distortion::eucm,
          .coefficients = {0.63, 1.04, 0, 0},
          .width = 512,
          .height = 512};
}
Camera mirror() {
  return {.fu = 800,
          .fv = 800,
          .cu = 376,
          .cv = 240,
          .distortion = Distortion::omni,
          .coefficients = {-0.1, 0.02, 1e-4, -2e-4},
          .width = 752,
          .height = 480,
          .mirror = 1.4};
}

std::vector<Camera> cameras() { return {pinhole(), euroc(), fisheye(), doubleSphere(), extended(), mirror()}; }

// In double only: bearings enter the estimators of fusion/init, which work in double.
static_assert(std::is_aggregate_v<Camera> && std::is_trivially_destructible_v<Camera>);

TEST(Cameras, EveryPixelOfTheImageHasItsBearing) {
  for (const Camera& camera : cameras()) {
    for (int v = 0; v < camera.height; v += 13) {
      for (int u = 0; u < camera.width; u += 13) {
        const auto ray = camera.bearing({u, v});
        ASSERT_TRUE(ray) << u << " " << v;
        EXPECT_NEAR(ray->norm(), 1, 1e-15);
        const auto pixel = camera.project(2.5 * *ray);
        ASSERT_TRUE(pixel) << u << " " << v;
        EXPECT_LT((*pixel - Eigen::Vector2d(u, v)).norm(), 1e-10) << u << " " << v;
      }
    }
    const auto centre = camera.bearing({camera.cu, camera.cv});
    ASSERT_TRUE(centre);
    EXPECT_EQ(*centre, Eigen::Vector3d::UnitZ());
  }
}

TEST(Cameras, EveryDirectionThatIsSeenComesBack) {
  for (const Camera& camera : cameras()) {
    for (double angle = 0; angle < 0.8; angle += 0.05) {
      for (double around = 0; around < 6.2; around += 0.3) {
        const Eigen::Vector3d ray(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                                  std::cos(angle));
        const auto pixel = camera.project(7 * ray);
        ASSERT_TRUE(pixel) << angle << " " << around;
        const auto back = camera.bearing(*pixel);
        ASSERT_TRUE(back);
        EXPECT_LT((*back - ray).norm(), 1e-13) << angle << " " << around;
      }
    }
  }
}

// A value of Kalibr's formulas worked out by hand, apart from the code: x = 0.5, y = -0.25, r² = 0.3125.
TEST(Cameras, DistortsAsKalibrDoes) {
  Camera camera{.fu = 100, .fv = 200, .cu = 10, .cv = 20, .distortion = Distortion::radtan};
  camera.coefficients = {-0.2, 0.1, 0.01, -0.02};
  // factor = 1 - 0.0625 + 0.009765625; 2 p1 x y + p2 (r² + 2 x²); 2 p2 x y + p1 (r² + 2 y²)
  const double factor = 0.947265625;
  const double x = 0.5 * factor + 2 * 0.01 * -0.125 - 0.02 * 0.8125;
  const double y = -0.25 * factor + 2 * -0.02 * -0.125 + 0.01 * 0.4375;
  const auto pixel = camera.project({1, -0.5, 2});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 10 + 100 * x, 1e-12);
  EXPECT_NEAR(pixel->y(), 20 + 200 * y, 1e-12);

  camera.distortion = Distortion::equidistant;
  camera.coefficients = {0.1, -0.2, 0.3, -0.4};
  const double t = static_cast<double>(EIGEN_PI) / 4;
  const double bent = t + 0.1 * std::pow(t, 3) - 0.2 * std::pow(t, 5) + 0.3 * std::pow(t, 7) - 0.4 * std::pow(t, 9);
  const auto seen = camera.project({0.6, 0.8, 1});
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->x(), 10 + 100 * 0.6 * bent, 1e-12);
  EXPECT_NEAR(seen->y(), 20 + 200 * 0.8 * bent, 1e-12);
}

TEST(Cameras, NothingIsSeenBehindOrBeyondTheFold) {
  for (const Camera& camera : cameras()) {
    EXPECT_FALSE(camera.project({0, 0, -1}));
    EXPECT_FALSE(camera.project({0, 0, 0}));
    EXPECT_FALSE(camera.project({std::numeric_limits<double>::quiet_NaN(), 0, 1}));
    EXPECT_FALSE(camera.bearing({std::numeric_limits<double>::infinity(), 0}));
  }
  EXPECT_FALSE(pinhole().project({1, 1, -1e-9}));
  EXPECT_TRUE(fisheye().project({1, 1, -0.1})) << "this lens sees more than half of all directions";

  // r (1 - r²/3) folds at r = 1, where it is 2/3.
  Camera folds{.fu = 300, .fv = 300, .cu = 0, .cv = 0, .distortion = Distortion::radtan};
  folds.coefficients = {-1. / 3, 0, 0, 0};
  EXPECT_TRUE(folds.project({0.999, 0, 1}));
  EXPECT_FALSE(folds.project({1.001, 0, 1}));
  EXPECT_FALSE(folds.project({1.9, 0, 1}));
  EXPECT_TRUE(folds.bearing({199.9, 0}));
  EXPECT_FALSE(folds.bearing({200.1, 0}));
  EXPECT_FALSE(folds.bearingWithSigma({200.1, 0}));
  // One that ascends again far out stays folded: 1 - 3 r²/2 + r⁴ of slope 1 - 9 r²/2 + 5 r⁴, negative from √0.4 to
  // √0.5.
  folds.coefficients = {-1.5, 1, 0, 0};
  EXPECT_TRUE(folds.project({0.632, 0, 1}));
  EXPECT_FALSE(folds.project({0.633, 0, 1}));
  EXPECT_FALSE(folds.project({2, 0, 1}));
  EXPECT_FALSE(folds.bearing({300, 0}));
}

/// The pixels by two directions across the bearing, by central differences.
double sigmaByDifferences(const Camera& camera, double u, double v) {
  const Eigen::Vector3d ray = *camera.bearing({u, v});
  const Eigen::Vector3d a = ray.unitOrthogonal(), b = ray.cross(a);
  const double h = 1e-5;
  Eigen::Matrix2d J;
  J.col(0) = (*camera.project(ray + h * a) - *camera.project(ray - h * a)) / (2 * h);
  J.col(1) = (*camera.project(ray + h * b) - *camera.project(ray - h * b)) / (2 * h);
  return 1 / std::sqrt(std::abs(J.determinant()));
}

TEST(Cameras, NoiseOfABearingIsThatOfAPixelThroughTheDerivative) {
  for (const Camera& camera : cameras()) {
    for (int v = 0; v < camera.height; v += 40) {
      for (int u = 0; u < camera.width; u += 40) {
        const double expected = sigmaByDifferences(camera, u, v);
        // Central differences leave h² ~ 1e-10 and the rounding of a pixel over h.
        const auto seen = camera.bearingWithSigma({u, v});
        ASSERT_TRUE(seen) << u << " " << v;
        EXPECT_EQ(seen->direction, *camera.bearing({u, v}));
        EXPECT_NEAR(seen->sigma, expected, 1e-7 * expected) << u << " " << v;
        EXPECT_NEAR(camera.bearingWithSigma({u, v}, 0.3)->sigma, 0.3 * seen->sigma, 1e-16);
      }
    }
    // On the axis a mirror and the first sphere shrink the image by 1 + ξ.
    const double shrinks =
        camera.distortion == Distortion::double_sphere ? 1 + camera.coefficients[0] : 1 + camera.mirror;
    EXPECT_NEAR(camera.bearingWithSigma({camera.cu, camera.cv})->sigma, shrinks / std::sqrt(camera.fu * camera.fv),
                1e-15);
  }
}

// A pinhole of square pixels shows a cone of angle θ stretched by 1/cos θ around the axis and by 1/cos² θ outward.
TEST(Cameras, NoiseOfAPinholeShrinksOffTheAxis) {
  const Camera camera{.fu = 400, .fv = 400};
  for (const double angle : {0.0, 0.3, 0.9, 1.4}) {
    const auto seen = camera.bearingWithSigma({400 * std::tan(angle), 0});
    ASSERT_TRUE(seen);
    EXPECT_NEAR(seen->sigma, std::pow(std::cos(angle), 1.5) / 400, 1e-15);
  }
}

// An equidistant lens without coefficients has the same scale along each meridian; around the axis it is θ/sin θ.
TEST(Cameras, AnEquidistantLensSeesBehind) {
  const Camera camera{.fu = 100, .fv = 100, .distortion = Distortion::equidistant};
  for (const double angle : {0.1, 1.0, 2.0, 3.0, 3.14}) {
    const auto seen = camera.bearingWithSigma({0, -100 * angle});
    ASSERT_TRUE(seen) << angle;
    EXPECT_LT((seen->direction - Eigen::Vector3d(0, -std::sin(angle), std::cos(angle))).norm(), 1e-14) << angle;
    EXPECT_NEAR(seen->sigma, std::sqrt(std::sin(angle) / angle) / 100, 1e-13) << angle;
  }
  EXPECT_FALSE(camera.bearing({0, -100 * 3.15})) << "no direction is more than π off the axis";

  // θ (1 - θ²/3) folds at θ = 1, where it is 2/3.
  Camera folds = camera;
  folds.coefficients = {-1. / 3, 0, 0, 0};
  EXPECT_TRUE(folds.project({std::sin(0.999), 0, std::cos(0.999)}));
  EXPECT_FALSE(folds.project({std::sin(1.001), 0, std::cos(1.001)}));
  EXPECT_TRUE(folds.bearing({66.6, 0}));
  EXPECT_FALSE(folds.bearing({66.7, 0}));
}

// The formulas of the papers, with numbers by hand: a point one metre to the right and one ahead.
TEST(Cameras, SphereModelsProjectAsTheirPapersSay) {
  const double root = std::sqrt(2.);
  const auto u = [](Camera camera, const Eigen::Vector3d& p) {
    camera.fu = camera.fv = 1, camera.cu = camera.cv = 0;
    const auto pixel = camera.project(p);
    return pixel ? pixel->x() : std::numeric_limits<double>::quiet_NaN();
  };
  Camera spheres = doubleSphere();
  spheres.coefficients = {0.5, 0.25, 0, 0};
  // d1 = √2, ξ d1 + z = 1.7071, d2 = √(1 + 1.7071²).
  const double k = 0.5 * root + 1;
  EXPECT_NEAR(u(spheres, {1, 0, 1}), 1 / (0.25 * std::sqrt(1 + k * k) + 0.75 * k), 1e-14);
  Camera eucm = extended();
  eucm.coefficients = {0.25, 2, 0, 0};
  EXPECT_NEAR(u(eucm, {1, 0, 1}), 1 / (0.25 * std::sqrt(3.) + 0.75), 1e-14);
  Camera omni = mirror();
  omni.coefficients.setZero();
  EXPECT_NEAR(u(omni, {1, 0, 1}), 1 / (1 + 1.4 * root), 1e-14);
  // A mirror of 0, spheres of (0, 0) and an α of 0 are a pinhole.
  omni.mirror = 0, spheres.coefficients.setZero(), eucm.coefficients = {0, 1, 0, 0};
  for (const Camera& camera : {omni, spheres, eucm}) EXPECT_NEAR(u(camera, {1, 0, 2}), 0.5, 1e-15);
  // Where the images fold: z = -d1/ξ of a mirror; for the double sphere where the second sphere's image is largest, at
  // the cosine -w, w = (1 - α)/α: (ξ + z)² = w² (1 + 2 ξ z + ξ²) for d1 = 1.
  omni.mirror = 1.4, spheres.coefficients = {-0.172, 0.593, 0, 0};
  const double w = (1 - 0.593) / 0.593, xi = -0.172, rest = 1 - w * w;
  const double fold = -xi * rest - w * std::sqrt(1 - xi * xi * rest);
  for (const auto& [camera, z] : {std::pair(omni, -1 / 1.4), std::pair(spheres, fold)}) {
    const auto at = [](double cosine) { return Eigen::Vector3d(std::sqrt(1 - cosine * cosine), 0, cosine); };
    EXPECT_TRUE(std::isfinite(u(camera, at(z + 1e-3)))) << z;
    EXPECT_FALSE(std::isfinite(u(camera, at(z - 1e-3)))) << z;
  }
}

TEST(Cameras, WithoutFocalLengthsNothingIsSeen) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double focal : {0.0, -300.0, nan}) {
    for (const Distortion distortion : {Distortion::none, Distortion::radtan, Distortion::equidistant, Distortion::omni,
                                        Distortion::double_sphere, Distortion::eucm}) {
      const Camera camera{.fu = 300, .fv = focal, .distortion = distortion};
      EXPECT_FALSE(camera.project({0.1, 0.2, 1}));
      EXPECT_FALSE(camera.bearing({10, 20}));
      EXPECT_FALSE(camera.bearingWithSigma({10, 20}));
    }
  }
}

TEST(Cameras, ACoefficientThatIsNoNumberGivesNothing) {
  for (Camera camera : {euroc(), fisheye(), doubleSphere(), extended(), mirror()}) {
    camera.coefficients[1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(camera.project({0.1, 0.2, 1}));
    EXPECT_FALSE(camera.bearing({10, 20}));
  }
}

TEST(Cameras, SeesItsImage) {
  const Camera camera = pinhole();
  EXPECT_TRUE(camera.sees({0, 0}));
  EXPECT_TRUE(camera.sees({751, 479}));
  EXPECT_FALSE(camera.sees({751.5, 0}));
  EXPECT_FALSE(camera.sees({0, -0.5}));
  EXPECT_FALSE(camera.sees({std::numeric_limits<double>::quiet_NaN(), 0}));
  EXPECT_TRUE(Camera{.fu = 1}.sees({1e9, 0})) << "the size is not known";
}

}  // namespace
}  // namespace liestat
