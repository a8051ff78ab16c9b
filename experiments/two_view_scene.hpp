// A simulated pair of images: matches of points that move by one of the models of two-view motion, with noise in both
// images and outliers.
//
//   liestat::experiments::TwoViewScene scene({.motion = TwoViewMotion::essential, .outliers = 0.3}, 1);  // seed 1
//   … scene.matches[i] (normalised), scene.pixels[i], scene.inlier[i], scene.R, scene.t, scene.F …
//
// A match is (x, y, x', y'). Normalised coordinates are u = (p - c)/f in both images, c the centre of the image and f
// the focal length of the first: a change of zoom is part of the motion. Motions with a homography obey ũ' ~ H ũ, those
// with an epipolar geometry ũ'ᵀ F ũ = 0; poses take points of the first camera to the second, x' = R x + t (m).
//
// Motions, with the defaults of the options: translation in the image 8 to 40 px; zoom by 1.08 to 1.3, in or out; turns
// in the image by 3 to 15 degrees; rotations by 4 to 12 degrees about any axis (3 to 12 with a translation);
// translations of 0.3 to 0.7 m among points at 3 to 9 m; planes with a normal (a, b, 1), |a|, |b| < 0.6; focal lengths
// that change by 1.25 to 1.6, in or out, or are by so much not what they were taken for; with such a focal length of both
// views turns by 8 to 20 degrees and translations of 1 to 2 m. Points are uniform in the first image, and seen in both; outliers are uniform
// in both.
//
// Each scene is a function of its options and its seed alone, with any compiler (no two draws stand in one expression,
// whose order of evaluation is free): motion and points are drawn from stream 0, noise from stream 1, outliers and the
// order of the matches from stream 2.
#pragma once

#include <lie/linear.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>
#include <stats/shown.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace liestat::experiments {

/// How the image moves: nine models of two-view motion, and seven more between them.
enum class TwoViewMotion {
  none,
  retinal_translation,
  zoom,  ///< about the centre of the image
  retinal_displacement,
  rotation,
  homography,  ///< a plane, seen by a camera that turns and moves
  translation,
  essential,
  fundamental,  ///< essential, and the focal length changes
  free_zoom,    ///< zoom about a point of the image
  similarity,
  affine,           ///< a similarity after a stretch by up to 1.3 along an axis of any direction
  affine_epipolar,  ///< two affine views of points in space
  rotation_zoom,    ///< rotation, and the focal length changes
  upright,          ///< essential, of which the vertical is known in both views
  shared_focal      ///< essential, and both focal lengths are by the same factor not what they were taken for
};
/// The nine of the default lattice, in the order of the confusion matrix.
inline constexpr std::array<TwoViewMotion, 9> default_two_view_motions = {
    TwoViewMotion::none,        TwoViewMotion::retinal_translation,
    TwoViewMotion::zoom,        TwoViewMotion::retinal_displacement,
    TwoViewMotion::rotation,    TwoViewMotion::homography,
    TwoViewMotion::translation, TwoViewMotion::essential,
    TwoViewMotion::fundamental};

/// Motions of the optional models.
inline constexpr std::array<TwoViewMotion, 7> optional_two_view_motions = {
    TwoViewMotion::free_zoom,     TwoViewMotion::similarity, TwoViewMotion::affine,      TwoViewMotion::affine_epipolar,
    TwoViewMotion::rotation_zoom, TwoViewMotion::upright,    TwoViewMotion::shared_focal};
/// All of them, each at the number of its enumerator.
inline constexpr auto all_two_view_motions = [] {
  std::array<TwoViewMotion, default_two_view_motions.size() + optional_two_view_motions.size()> all{};
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<TwoViewMotion>(i);
  return all;
}();

/// Name of a motion, as in the tables.
inline const char* nameOf(TwoViewMotion motion) {
  constexpr const char* names[] = {"none",
                                   "retinal translation",
                                   "zoom",
                                   "retinal displacement",
                                   "rotation",
                                   "homography",
                                   "translation",
                                   "essential",
                                   "fundamental",
                                   "free zoom",
                                   "similarity",
                                   "affine",
                                   "affine epipolar",
                                   "rotation and zoom",
                                   "upright",
                                   "shared focal length"};
  return names[static_cast<std::size_t>(motion)];
}
/// The name of a motion in options and JSON fields.
inline std::string name(TwoViewMotion motion) {
  std::string text = nameOf(motion);
  for (char& c : text) c = c == ' ' ? '_' : c;
  return text;
}
/// True if a motion is described by a fundamental matrix, not by a homography.
inline bool isEpipolar(TwoViewMotion motion) {
  return motion == TwoViewMotion::translation || motion == TwoViewMotion::essential ||
         motion == TwoViewMotion::fundamental || motion == TwoViewMotion::affine_epipolar ||
         motion == TwoViewMotion::upright || motion == TwoViewMotion::shared_focal;
}

/// The parameters of the drawing.
struct TwoViewSceneOptions {
  TwoViewMotion motion = TwoViewMotion::essential;
  std::size_t matches = 100;
  double outliers = 0.2;  ///< share of the matches, rounded to a whole number of them
  double sigma = 0.5;     ///< standard deviation of each image coordinate, in both images (px)
  double width = 640, height = 480, focal_length = 600;  ///< px
  double min_depth = 3, max_depth = 9;            ///< depth of the points, or of the plane on the optical axis (m)
  double min_baseline = 0.3, max_baseline = 0.7;  ///< length of the translation (m), but of shared_focal
};

/// A motion and the matches that show it.
class TwoViewScene {
 public:
  TwoViewSceneOptions options;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();      ///< rotation of the camera, where the motion has one
  Eigen::Vector3d t = Eigen::Vector3d::Zero();          ///< its translation (m)
  double focal_ratio = 1;                               ///< f'/f
  double focal_scale = 1;                               ///< f of both views, in units of the coordinates
  Eigen::Vector3d vertical = Eigen::Vector3d::UnitY();  ///< in the first camera's frame; R·vertical in the second's
  /// The plane n·x = d in the first camera's frame, of `homography`.
  Eigen::Vector3d plane_normal = Eigen::Vector3d::UnitZ();
  double plane_distance = 1;                        ///< m
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  ///< for motions with a homography; det H > 0
  Eigen::Matrix3d F = Eigen::Matrix3d::Zero();      ///< for epipolar motions, ‖F‖² = 2
  std::vector<Eigen::Vector4d> matches;             ///< normalised, with noise
  std::vector<Eigen::Vector4d> pixels;              ///< the same in px, origin at a corner of the image
  std::vector<Eigen::Vector4d> exact;               ///< normalised, without noise; outliers as in matches
  std::vector<bool> inlier;
  /// false: hardly a motion of this kind keeps points in images of that size at that focal length, and there are no matches.
  bool possible = true;

  /// Draws the scene from CounterRng(seed).
  TwoViewScene(const TwoViewSceneOptions& scene_options, std::uint64_t seed) : options(scene_options) {
    CounterRng random(seed, 0, 0), noise(seed, 0, 1), order(seed, 0, 2);
    const std::size_t n = options.matches;
    const auto bad = static_cast<std::size_t>(std::lround(options.outliers * static_cast<double>(n)));
    inlier.assign(n, true);
    for (std::size_t i = 0; i < bad && i < n; ++i) inlier[i] = false;
    for (std::size_t i = n; i > 1; --i) {
      const auto j = static_cast<std::size_t>(order.uniform() * static_cast<double>(i));
      const bool moved = inlier[i - 1];
      inlier[i - 1] = inlier[j];
      inlier[j] = moved;
    }
    possible = false;
    for (int motions = 0; motions < 200 && !possible; ++motions) {
      drawMotion(random);
      possible = drawPoints(random);
    }
    if (!possible) {
      exact.clear(), inlier.clear();
      return;
    }
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector4d error = noise.normalVector<4>();
      if (inlier[i]) {
        matches.push_back(exact[i] + options.sigma / options.focal_length * error);
      } else {
        const Eigen::Vector2d first = uniformInImage(order), second = uniformInImage(order);
        matches.emplace_back(first.x(), first.y(), second.x(), second.y());
        exact[i] = matches[i];
      }
      const double cx = 0.5 * options.width, cy = 0.5 * options.height;
      pixels.push_back(options.focal_length * matches[i] + Eigen::Vector4d(cx, cy, cx, cy));
    }
  }

 private:
  Eigen::Matrix<double, 2, 3> affine_second_ = Eigen::Matrix<double, 2, 3>::Zero();  // second camera in affine_epipolar
  Eigen::Vector2d affine_shift_ = Eigen::Vector2d::Zero();

  /// Uniform between two numbers, with a sign.
  static double either(CounterRng& random, double low, double high) {
    const double x = random.uniform(low, high);
    return random.uniform() < 0.5 ? x : -x;
  }
  /// Uniform between two numbers, or the inverse of such a number.
  static double ratio(CounterRng& random, double low, double high) {
    const double x = random.uniform(low, high);
    return random.uniform() < 0.5 ? x : 1 / x;
  }
  static Eigen::Matrix2d turn(double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return (Eigen::Matrix2d() << c, -s, s, c).finished();
  }
  static Eigen::Matrix3d turnInSpace(CounterRng& random, double low, double high) {
    const Eigen::Vector3d axis = random.unitVector<3>();
    return SO3d::exp(Eigen::Vector3d(random.uniform(low, high) * units::degree * axis)).matrix();
  }
  /// A length between two numbers, in a uniform direction.
  template <int N>
  static Eigen::Vector<double, N> displacement(CounterRng& random, double low, double high) {
    const Eigen::Vector<double, N> direction = random.unitVector<N>();
    return random.uniform(low, high) * direction;
  }
  Eigen::Vector2d shift(CounterRng& random) const { return displacement<2>(random, 8, 40) / options.focal_length; }
  static Eigen::Matrix2d zoomedTurn(CounterRng& random) {
    const double angle = either(random, 3, 15) * units::degree;
    return ratio(random, 1.08, 1.3) * turn(angle);
  }
  Eigen::Vector2d uniformInImage(CounterRng& random) const {
    const double x = random.uniform(-0.5, 0.5), y = random.uniform(-0.5, 0.5);
    return Eigen::Vector2d(x * options.width, y * options.height) / options.focal_length;
  }
  bool inImage(const Eigen::Vector2d& u) const {
    return std::abs(u.x()) <= 0.5 * options.width / options.focal_length &&
           std::abs(u.y()) <= 0.5 * options.height / options.focal_length;
  }

  void drawMotion(CounterRng& random) {
    R.setIdentity();
    t.setZero();
    focal_ratio = focal_scale = 1;
    H.setIdentity();
    F.setZero();
    const auto move = [&] {
      R = turnInSpace(random, 3, 12);
      t = displacement<3>(random, options.min_baseline, options.max_baseline);
    };
    switch (options.motion) {
      case TwoViewMotion::none:
        break;
      case TwoViewMotion::retinal_translation:
        H.topRightCorner<2, 1>() = shift(random);
        break;
      case TwoViewMotion::zoom:
        focal_ratio = ratio(random, 1.08, 1.3);
        H.topLeftCorner<2, 2>() *= focal_ratio;
        break;
      case TwoViewMotion::retinal_displacement:
        H.topLeftCorner<2, 2>() = turn(either(random, 3, 15) * units::degree);
        H.topRightCorner<2, 1>() = shift(random);
        break;
      case TwoViewMotion::rotation:
        H = R = turnInSpace(random, 4, 12);
        break;
      case TwoViewMotion::homography: {
        move();
        const double b = random.uniform(-0.6, 0.6), a = random.uniform(-0.6, 0.6);
        plane_normal = Eigen::Vector3d(a, b, 1).normalized();
        plane_distance = random.uniform(options.min_depth, options.max_depth) * plane_normal.z();
        H = R + t * plane_normal.transpose() / plane_distance;
        H *= std::sqrt(3.) / H.norm();
        break;
      }
      case TwoViewMotion::translation:
        t = displacement<3>(random, options.min_baseline, options.max_baseline);
        break;
      case TwoViewMotion::essential:
        move();
        break;
      case TwoViewMotion::fundamental:
        move();
        focal_ratio = ratio(random, 1.25, 1.6);
        break;
      case TwoViewMotion::free_zoom: {
        focal_ratio = ratio(random, 1.08, 1.3);
        H.topLeftCorner<2, 2>() *= focal_ratio;
        H.topRightCorner<2, 1>() = (1 - focal_ratio) * uniformInImage(random);
        break;
      }
      case TwoViewMotion::similarity:
        H.topLeftCorner<2, 2>() = zoomedTurn(random);
        H.topRightCorner<2, 1>() = shift(random);
        break;
      case TwoViewMotion::affine: {
        const Eigen::Matrix2d axes = turn(random.uniform(0, 180) * units::degree);
        const Eigen::Vector2d stretch(ratio(random, 1.1, 1.3), 1);
        H.topLeftCorner<2, 2>() = zoomedTurn(random) * axes * stretch.asDiagonal() * axes.transpose();
        H.topRightCorner<2, 1>() = shift(random);
        break;
      }
      case TwoViewMotion::affine_epipolar: {
        // Scaled orthography: the first two rows of two rotations; depths as large as the image.
        const Eigen::Matrix3d turned = turnInSpace(random, 4, 12);
        affine_second_ = ratio(random, 1.08, 1.3) * turned.topRows<2>();
        affine_shift_ = shift(random);
        // u' = A u + a z + b: the equation is that part which lies across a.
        const Eigen::Vector2d across = Eigen::Vector2d(-affine_second_(1, 2), affine_second_(0, 2)).normalized();
        F.block<1, 2>(2, 0) = -across.transpose() * affine_second_.leftCols<2>();
        F.block<2, 1>(0, 2) = across;
        F(2, 2) = -across.dot(affine_shift_);
        break;
      }
      case TwoViewMotion::rotation_zoom:
        R = turnInSpace(random, 4, 12);
        focal_ratio = ratio(random, 1.25, 1.6);
        H = Eigen::Vector3d(focal_ratio, focal_ratio, 1).asDiagonal() * R;
        break;
      case TwoViewMotion::upright:
        move();
        vertical = turnInSpace(random, 0, 20) * Eigen::Vector3d::UnitY();
        break;
      case TwoViewMotion::shared_focal: {
        R = turnInSpace(random, 8, 20);
        const double length = random.uniform(1, 2);
        t = length * random.unitVector<3>();
        focal_scale = ratio(random, 1.25, 1.6);
        break;
      }
    }
    if (isEpipolar(options.motion)) {
      if (options.motion != TwoViewMotion::affine_epipolar) {
        const Eigen::Vector3d first(1 / focal_scale, 1 / focal_scale, 1),
            second(1 / (focal_scale * focal_ratio), 1 / (focal_scale * focal_ratio), 1);
        F = second.asDiagonal() * skew(t) * R * first.asDiagonal();
      }
      F *= std::sqrt(2.) / F.norm();
    }
  }

  /// False where the two images have too little in common.
  bool drawPoints(CounterRng& random) {
    exact.clear();
    const double radius = 0.5 * options.width / options.focal_length;
    for (std::size_t tries = 0; exact.size() < options.matches; ++tries) {
      if (tries > 1000 + 20 * options.matches || (tries > 1000 && exact.empty())) return false;
      const Eigen::Vector2d u = uniformInImage(random);
      Eigen::Vector3d x;
      if (options.motion == TwoViewMotion::affine_epipolar) {
        const double z = random.uniform(-radius, radius);
        x.head<2>() = affine_second_ * Eigen::Vector3d(u.x(), u.y(), z) + affine_shift_;
        x.z() = 1;
      } else if (isEpipolar(options.motion)) {
        const Eigen::Vector3d ray(u.x() / focal_scale, u.y() / focal_scale, 1);
        x = R * (random.uniform(options.min_depth, options.max_depth) * ray) + t;
        x.head<2>() *= focal_scale * focal_ratio;
      } else {
        x = H * u.homogeneous();
      }
      if (!(x.z() > 0)) continue;
      const Eigen::Vector2d second = x.head<2>() / x.z();
      if (inImage(second)) exact.emplace_back(u.x(), u.y(), second.x(), second.y());
    }
    return true;
  }
};

/// The truth of a scene.
template <class V>
void describe(V& v, const TwoViewScene& scene) {
  const TwoViewSceneOptions& o = scene.options;
  v("motion", name(o.motion))("sigma", o.sigma, "", "px");
  v("intrinsics", std::vector<double>{o.focal_length, o.focal_length, 0.5 * o.width, 0.5 * o.height}, "", "px");
  v("focal_scale", scene.focal_scale)("focal_ratio", scene.focal_ratio);
  v("rotation_vector", Eigen::Vector3d(SO3d::fitToSO3(scene.R).log()), "", "rad")("translation", scene.t, "", "m");
  const bool epipolar = isEpipolar(o.motion), plane = o.motion == TwoViewMotion::homography;
  if (shown(v, epipolar)) v("fundamental_normalised", scene.F);
  if (shown(v, !epipolar)) v("homography_normalised", scene.H);
  if (shown(v, plane)) v("plane_normal", scene.plane_normal)("plane_distance", scene.plane_distance, "", "m");
}

}  // namespace liestat::experiments
