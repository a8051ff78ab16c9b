// The results of the estimate of a motion between two images (fusion/two_view/two_view.hpp), for units that only look
// at them.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <lie/essential.hpp>
#include <stats/gaussian.hpp>
#include <stats/hierarchy_types.hpp>
#include <stats/relative_curvature.hpp>
#include <stats/score_tests_types.hpp>
#include <stats/shown.hpp>
#include <stats/status.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// The physical parameters of an estimated motion, and their covariance (first order). Directions and normals are three
/// numbers of norm one, whose covariance has rank two; rotations are rotation vectors, whose standard deviations are
/// those of the rotation's error in the axes of the first camera, R·Exp(e).
struct PhysicalParameters {
  std::vector<std::string> names;
  std::vector<std::string> units;  ///< px, rad or none
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;  ///< not finite where the parameters are not determined

  std::size_t size() const { return names.size(); }
  double deviation(std::size_t i) const;
};

/// Results for one model of the lattice.
struct TwoViewModelRow {
  std::string name;
  std::vector<std::string> parents;
  int free_parameters = 0, equations = 0;
  bool evaluated = false;           ///< its draws came to their end
  Status status = Status::too_few;  ///< status of its estimate; too_few: there is none
  std::size_t draws = 0, inliers = 0;
  double relevance = 0;
  double chi2 = 0, degrees_of_freedom = 0;  ///< over its own inliers
  double rms = 0;                           ///< σ sqrt(χ²/r): what noise these inliers show, px
  /// s², the variance of the noise that the errors below nine thresholds show over σ² (excessNoise()).
  double excess_noise = 1;
  bool unsupported = true;  ///< its inliers could be chance
  Rejection rejection = Rejection::none;
  std::string rejected_by;

  bool hasEstimate() const { return status != Status::too_few; }
};

/// A motion as its model tells it.
struct TwoViewMotionResult {
  /// H or F in pixels without distortion, p̃' ~ H p̃ or p̃'ᵀ F p̃ = 0, of norm one.
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  /// 9×9, of its entries column after column; NaN, as all covariances of the motion, where it is withheld; empty of `none`.
  Eigen::MatrixXd matrix_covariance;
  int equations = 0;  ///< equations of a match: 2, the matrix is H, or 1, it is F
  /// One description of the motion; a plane seen by calibrated cameras has two, the one with more points in front of
  /// both first. None of `none`, of a homography without cameras, nor of a fundamental matrix that tells no focal
  /// lengths.
  std::vector<PhysicalParameters> physical;
  /// Pose of `essential`, and of `upright` with a covariance of rank three: second_T_first up to scale, with covariance
  /// in the tangent (direction, rotation).
  std::optional<Gaussian<Essentiald>> relative_pose;
  /// The curvature of the model at the noise that the matches show; covariances are widened by it, or withheld.
  RelativeCurvature relative_curvature = {};
};

/// A motion that explains the matches as well as the chosen one.
struct TwoViewRival : TwoViewMotionResult {
  std::string model;
  std::size_t inliers = 0;
};

/// Properties of the images and of their matches, as the estimation uses them.
struct TwoViewImageFrame {
  std::size_t matches = 0;                                 ///< all that were given
  double sigma = 0;                                        ///< standard deviation of each coordinate, px
  Eigen::Vector2d image_corner = Eigen::Vector2d::Zero();  ///< the upper left one, px: zero where the size is known
  Eigen::Vector2d image_size = Eigen::Vector2d::Zero();    ///< px
  bool calibrated = false, size_from_matches = false;
  std::size_t repeated = 0;      ///< matches that are equal to another one, which counts for them
  std::size_t contradicted = 0;  ///< different ones that take no part, because they contradict each other
};

/// A quantity of the cameras that a motion takes for known: the focal length, relative, or the radial distortion k1.
struct TwoViewSuspectTest : SuspectTest {
  /// The movement of the estimate per unit of the suspect, in its standard deviations (a Mahalanobis distance); NaN if
  /// the suspect is not tested.
  double shift = std::numeric_limits<double>::quiet_NaN();
  double prior_sigma = 0;  ///< as in the options: 0 where it is taken for known
};

/// Other motions and cameras that may be true instead.
struct TwoViewAlternatives {
  /// Where the status is contested: the other models of the set of which one is right, or the second motion.
  std::vector<TwoViewRival> rivals;
  /// The parameters that the chosen model shares with all rivals, at the chosen one's values. Their covariance is the
  /// mean over the set of the models' own covariances and the squares of their differences from these values, so that
  /// it covers each of them; what only one model has is listed with that model.
  std::optional<PhysicalParameters> shared;
  /// The focal length and the radial distortion k1 (of the lens model; where that has none, of u (1 + k1 |u|²)) that the
  /// model takes for known, each tested; a set for each camera where there are two. Focal lengths only where cameras
  /// are given.
  std::vector<TwoViewSuspectTest> suspects;
};

/// The motion between two images.
struct TwoViewMotionEstimate : TwoViewMotionResult, TwoViewImageFrame, TwoViewAlternatives {
  /// ok; too_few: no finite match; not_applicable: noise or size are not positive; not_converged: stopped, or the
  /// estimate of the chosen model did not end; ill_defined: the chosen model's inliers could be chance, or all matches
  /// are the same one, or its model is curved on the scale of the noise (no covariance); contested: the matches do not
  /// tell the chosen model from the rivals, or others follow a motion of their own beside the chosen one, which
  /// is the rival: `none` where they do not move; inconsistent: they speak for another focal length or distortion.
  Status status = Status::too_few;
  std::string reason;  ///< in words, unless ok
  std::vector<TwoViewModelRow> lattice;
  std::size_t chosen = 0;      ///< number in the lattice
  std::vector<bool> inlier;    ///< true for each match that is an inlier
  std::vector<double> errors;  ///< squared, in units of the noise; NaN of matches that are not finite
  std::size_t inliers = 0;
  double threshold = 0;  ///< threshold of the chosen model, on squared errors

  bool ok() const { return status == Status::ok; }
  const TwoViewModelRow& chosenModel() const { return lattice[chosen]; }
  /// The fundamental matrix is known, but not the focal lengths: the optical axes meet, or noise decides.
  bool focalLengthsOpen() const {
    return physical.empty() && matrix_covariance.rows() == 9 && !lattice.empty() && chosenModel().name == "fundamental";
  }
  /// Verdict on the estimate: to be trusted if the status is ok, else not.
  Verdict verdict() const;
};

/// One of several motions in the same images: of an object, or of a plane of the scene.
struct TwoViewStructure : TwoViewMotionResult, TwoViewAlternatives {
  std::string model;
  /// Of the estimate from its own inliers; contested and inconsistent as TwoViewMotionEstimate's.
  Status status = Status::ok;
  std::string reason;                ///< in words, unless ok
  std::vector<std::size_t> inliers;  ///< places of its matches, ascending
  double rms = 0;                    ///< σ sqrt(χ²/r) of these, px
};

/// Several motions, in the order in which they were found.
struct TwoViewMotions : TwoViewImageFrame {
  /// As TwoViewMotionEstimate's, and not ok if that of one structure is not; ok without a structure.
  Status status = Status::too_few;
  std::string reason;
  std::vector<TwoViewStructure> structures;
  std::vector<std::size_t> rest;  ///< matches that belong to none

  /// There is a motion that chance does not explain, the search came to its end, and all motions are ok.
  bool ok() const { return status == Status::ok && !structures.empty(); }
  /// Verdict on the motions: to be trusted if ok(), else not.
  Verdict verdict() const;
};

/// A relative pose up to scale.
struct RelativePose {
  Gaussian<Essentiald> pose;
};
template <class V>
void describe(V& v, const RelativePose& x) {
  v("quaternion_xyzw", Eigen::Vector4d(x.pose.mean.so3().params()));
  v("direction", Eigen::Vector3d(x.pose.mean.direction().unit_vector()), "of the translation, of length 1");
  v("covariance", x.pose.covariance, "of the tangent", "rad");
  v("covariance_order", "direction (2), rotation (3), rad, axes across and along the direction", "in words");
}

template <class V>
void describe(V& v, const PhysicalParameters& x) {
  std::vector<double> deviations;
  for (std::size_t i = 0; i < x.size(); ++i) deviations.push_back(x.deviation(i));
  v("names", x.names)("units", x.units, "rad or px")("values", x.values)("deviations", deviations,
                                                                         "standard deviations");
  v("covariance", x.covariance, "of the values");
}

template <class V>
void describe(V& v, const TwoViewModelRow& row) {
  v("model", row.name)("parents", row.parents, "more general models")("free_parameters", row.free_parameters);
  v("equations", row.equations, "of a match")("evaluated", row.evaluated, "its draws came to their end");
  v("draws", row.draws, "random samples");
  v("status", row.hasEstimate() ? std::optional<std::string>(name(row.status)) : std::nullopt,
    "of its estimate; null: there is none, and the fields below are missing");
  if (!shown(v, row.hasEstimate())) return;
  v("inliers", row.inliers, "their number")("relevance", row.relevance, "by which models are compared");
  v("chi2", row.chi2, "over its own inliers")("degrees_of_freedom", row.degrees_of_freedom, "of chi2");
  v("rms", row.rms, "noise that its inliers show", "px");
  v("excess_noise", row.excess_noise,
    "its variance over that of sigma; covariances are multiplied by it where it exceeds 1");
  v("unsupported", row.unsupported, "its inliers could be chance");
  v("rejection", name(row.rejection), "why the model was not chosen");
  v("rejected_by", row.rejected_by.empty() ? std::nullopt : std::optional(row.rejected_by), "the model that did it");
}

template <class V>
void describe(V& v, const TwoViewMotionResult& x) {
  v("matrix", x.matrix, "homography or fundamental matrix of undistorted pixels, of norm 1");
  v("matrix_acts_on", x.equations == 2 ? "second ~ matrix * first, pixels" : "second' * matrix * first = 0, pixels",
    "its equation, in words");
  v("matrix_covariance", x.matrix_covariance.rows() == 9 ? std::optional(x.matrix_covariance) : std::nullopt,
    "of its entries column after column");
  v("parameters", x.physical,
    "physical ones of the model; two sets for the two poses of a plane, otherwise one or none");
  v("second_T_first", x.relative_pose ? std::optional(RelativePose{*x.relative_pose}) : std::nullopt,
    "of the models with a pose");
  v("curvature", x.relative_curvature.word(),
    "of the model on the scale of the noise: untested, small, widened or large");
}

template <class V>
void describe(V& v, const TwoViewRival& x) {
  v("model", x.model)("inliers", x.inliers, "their number");
  describe(v, static_cast<const TwoViewMotionResult&>(x));
}

template <class V>
void describe(V& v, const TwoViewImageFrame& x) {
  v("matches", x.matches, "all that were given")("sigma", x.sigma, "of each coordinate", "px");
  v("calibrated", x.calibrated, "with the cameras' intrinsics");
  v("image_corner", x.image_corner, "the upper left one; zero where the size is known", "px");
  v("image_size", x.image_size, "", "px")("size_from_matches", x.size_from_matches, "it is that of the matches' box");
  v("repeated", x.repeated, "matches equal to another one, which counts for them");
  v("contradicted", x.contradicted, "matches that take no part, because they contradict each other");
}

template <class V>
void describe(V& v, const TwoViewSuspectTest& x) {
  describe(v, static_cast<const SuspectTest&>(x));
  v("shift", x.shift, "movement of the estimate per unit of the suspect, in standard deviations");
  v("prior_standard_deviation", x.prior_sigma, "0: taken for known");
}

template <class V>
void describe(V& v, const TwoViewAlternatives& x) {
  v("rivals", x.rivals, "where status is contested: the other models of which one may be right");
  v("shared_parameters", x.shared,
    "where status is contested: those of the chosen model that all rivals have, with a covariance that covers each");
  v("suspects", x.suspects, "what the model takes for known of the cameras");
}

template <class V>
void describe(V& v, const TwoViewMotionEstimate& x) {
  describe(v, static_cast<const TwoViewImageFrame&>(x));
  v("status", name(x.status), "ok, too_few, not_applicable, not_converged, ill_defined, contested or inconsistent");
  v("reason", x.reason.empty() ? std::nullopt : std::optional(x.reason), "in words, where status is not ok");
  v("model", x.lattice.empty() ? std::string() : x.chosenModel().name, "the chosen one");
  v("inliers", x.inliers, "their number");
  describe(v, static_cast<const TwoViewMotionResult&>(x));
  describe(v, static_cast<const TwoViewAlternatives&>(x));
  v("lattice", x.lattice, "all models")("inlier", x.inlier, "of each match");
  v("squared_errors", x.errors, "of each match, in units of the noise");
}

/// Adds the fields that the program does not print.
template <class V>
void describeSeries(V& v, const TwoViewMotionEstimate& x) {
  v("threshold", x.threshold, "of the chosen model, on squared errors");
}

template <class V>
void describe(V& v, const TwoViewStructure& x) {
  v("model", x.model)("status", name(x.status), "of the estimate from its own inliers");
  v("reason", x.reason.empty() ? std::nullopt : std::optional(x.reason), "in words, where status is not ok");
  v("inliers", x.inliers.size(), "their number")("rms", x.rms, "noise that its inliers show", "px");
  describe(v, static_cast<const TwoViewMotionResult&>(x));
  describe(v, static_cast<const TwoViewAlternatives&>(x));
}

template <class V>
void describe(V& v, const TwoViewMotions& x) {
  describe(v, static_cast<const TwoViewImageFrame&>(x));
  v("status", name(x.status), "as without --motions")("reason",
                                                      x.reason.empty() ? std::nullopt : std::optional(x.reason));
  v("motions", x.structures, "in the order in which they were found");
  std::vector<double> motion(x.matches, 0);
  for (std::size_t k = 0; k < x.structures.size(); ++k) {
    for (const std::size_t i : x.structures[k].inliers) motion[i] = static_cast<double>(k + 1);
  }
  v("motion", motion, "of each match: the number of its motion, 0 for none");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/two_view/detail/two_view_results.hpp>
#endif
