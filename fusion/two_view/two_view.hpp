// How did the camera move between two images? Matches in pixels, the cameras as far as they are known, and the answer:
// the model of the motion, its physical parameters with their covariance, and the matches that agree with it.
//
//   const TwoViewMotionEstimate found = estimateTwoViewMotion(matches, {.sigma = 1, .first = camera});
//   if (found.ok()) … found.chosenModel().name, found.physical, found.inlier, found.relative_pose …
//
// A match is (x, y, x', y') in pixels. Poses take points of the first camera to the second, x' = R x + t. The models are
// those of fusion/two_view/models.hpp; stats/hierarchy.hpp is the search, for whoever wants to look in between.
// docs/two_view.md has the models, what is promised, and the limits.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/pose.hpp>
#include <lie/essential.hpp>
#include <stats/gaussian.hpp>
#include <stats/hierarchy_types.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// What is known before, and how the search goes.
struct TwoViewMotionOptions {
  double sigma = 1;  ///< standard deviation of each image coordinate, px
  /// The camera of the first image. Without it rotations and poses of calibrated views are no models, and the motion of a
  /// fundamental matrix has two unknown focal lengths.
  std::optional<Camera> first = {};
  /// The camera of the second image, if it is another one.
  std::optional<Camera> second = {};
  /// Width and height of both images, px. By default those of the cameras, else the bounding box of the matches, without
  /// coordinates that are far beyond all others. The centre of an image of unknown camera is the middle of this.
  std::optional<Eigen::Vector2d> image_size = {};
  std::vector<TwoViewNode> nodes = {};             ///< models beyond the default ones
  std::optional<TwoViewVerticals> verticals = {};  ///< in both cameras' frames; with them `upright` is a model
  bool planes_only = false;                        ///< the models of homographies alone: planes of a scene, one by one
  bool keep_contradictions = false;                ///< use matches that contradict each other, too (contradictions.hpp)
  HierarchyOptions search = {};
  StopRequest stop = {};  ///< true ends the search: the answer is what has been found so far
};

/// The physical parameters of an estimated motion, and their covariance (first order). Directions and normals are three
/// numbers of norm one, whose covariance has rank two; rotations are rotation vectors, whose standard deviations are those
/// of the rotation's error in the axes of the first camera, R·Exp(e).
struct PhysicalParameters {
  std::vector<std::string> names;
  std::vector<std::string> units;  ///< px, rad or none
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;  ///< not finite where the parameters are not determined

  std::size_t size() const { return names.size(); }
  double deviation(std::size_t i) const;
};

/// What is known of a model of the lattice.
struct TwoViewModelRow {
  std::string name;
  std::vector<std::string> parents;
  int free_parameters = 0, equations = 0;
  bool evaluated = false;           ///< its draws came to their end
  Status status = Status::too_few;  ///< of its estimate; too_few: there is none
  std::size_t draws = 0, inliers = 0;
  double relevance = 0;
  double chi2 = 0, degrees_of_freedom = 0;  ///< over its own inliers
  double rms = 0;                           ///< σ sqrt(χ²/r): what noise these inliers show, px
  bool unsupported = true;                  ///< its inliers could be chance
  Rejection rejection = Rejection::none;
  std::string rejected_by;
};

/// A motion as its model tells it.
struct TwoViewMotionResult {
  /// H or F in pixels without distortion, p̃' ~ H p̃ or p̃'ᵀ F p̃ = 0, of norm one.
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  Eigen::MatrixXd matrix_covariance;  ///< 9×9, of its entries column after column; empty of `none`
  /// One description of the motion; a plane seen by calibrated cameras has two, the one with more points in front of both
  /// first. None of `none`, of a homography without cameras, nor of a fundamental matrix that tells no focal lengths.
  std::vector<PhysicalParameters> physical;
  /// Of `essential`, and of `upright` with a covariance of rank three: second_T_first up to scale, and its covariance in
  /// the tangent (direction, rotation).
  std::optional<Gaussian<Essentiald>> relative_pose;
};

/// What is taken of the images, and of their matches.
struct TwoViewImageFrame {
  Eigen::Vector2d image_corner = Eigen::Vector2d::Zero();  ///< the upper left one, px: zero where the size is known
  Eigen::Vector2d image_size = Eigen::Vector2d::Zero();    ///< px
  bool calibrated = false, size_from_matches = false;
  std::size_t repeated = 0;      ///< matches that are equal to another one, which counts for them
  std::size_t contradicted = 0;  ///< different ones that take no part, because they contradict each other
};

/// The motion between two images.
struct TwoViewMotionEstimate : TwoViewMotionResult, TwoViewImageFrame {
  /// ok; too_few: no finite match; not_applicable: noise or size are not positive; not_converged: stopped, or the estimate
  /// of the chosen model did not end; ill_defined: the chosen model's inliers could be chance, or all matches are the
  /// same one.
  Status status = Status::too_few;
  std::string reason;  ///< in words, unless ok
  std::vector<TwoViewModelRow> lattice;
  std::size_t chosen = 0;      ///< number in the lattice
  std::vector<bool> inlier;    ///< of each match
  std::vector<double> errors;  ///< squared, in units of the noise; NaN of matches that are not finite
  std::size_t inliers = 0;
  double threshold = 0;  ///< of the chosen model, on squared errors

  bool ok() const { return status == Status::ok; }
  const TwoViewModelRow& chosenModel() const { return lattice[chosen]; }
};

/// One of several motions in the same images: of an object, or of a plane of the scene.
struct TwoViewStructure : TwoViewMotionResult {
  std::string model;
  int equations = 0;                 ///< of a match: 2, the matrix is H, or 1, it is F
  Status status = Status::ok;        ///< of the estimate from its own inliers
  std::vector<std::size_t> inliers;  ///< places of its matches, ascending
  double rms = 0;                    ///< σ sqrt(χ²/r) of these, px
};

/// Several motions, in the order in which they were found.
struct TwoViewMotions : TwoViewImageFrame {
  Status status = Status::too_few;  ///< as TwoViewMotionEstimate's; ok without a structure, too
  std::string reason;
  std::vector<TwoViewStructure> structures;
  std::vector<std::size_t> rest;  ///< matches that belong to none
};

/// The estimate from matches in pixels. Equal matches count once. Matches that contradict each other take no part in it,
/// but may be inliers of what is found. Those that are not finite, or that no direction of a camera belongs to, are outliers
/// of all models. Nothing is thrown: the status says what is wrong. The same matches in another order give the same answer.
TwoViewMotionEstimate estimateTwoViewMotion(std::span<const Eigen::Vector4d> matches,
                                            const TwoViewMotionOptions& options);

/// Several motions: the matches that agree with the first are taken out, and the search runs again over the rest, until
/// chance explains what is found or there are `most` (stats/repeated_extraction.hpp). Each match belongs to the motion that
/// explains it best.
TwoViewMotions estimateTwoViewMotions(std::span<const Eigen::Vector4d> matches, const TwoViewMotionOptions& options,
                                      std::size_t most = 20);

/// The physical parameters of a model of the lattice by its name and its estimate, in the units of the matches that it
/// was estimated from: `unit` says how many px are one unit in each image. `matches` tell on which side of the cameras
/// points lie. Nothing for a model that is not of the lattice, or without a covariance.
std::vector<PhysicalParameters> physicalParameters(const std::string& model,
                                                   const ModelEstimate<TwoViewMotionModel>& estimate,
                                                   std::span<const Eigen::Vector4d> matches,
                                                   TwoViewCalibration calibration, const FocalLengths& unit);

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/estimate_two_view_motion.hpp>
#include <fusion/detail/physical_parameters.hpp>
#endif
