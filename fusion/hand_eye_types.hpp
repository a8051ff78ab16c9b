// The measurements, options and results of hand-eye calibration (fusion/hand_eye.hpp, fusion/hand_eye_hints.hpp), for
// units that only look at them.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/noisy_poses.hpp>
#include <fusion/pose_stream.hpp>
#include <fusion/status.hpp>
#include <lie/se3.hpp>
#include <lie/units.hpp>
#include <stats/noise_fit.hpp>
#include <stats/score_tests_types.hpp>
#include <stats/gaussian.hpp>
#include <stats/shown.hpp>
#include <stats/time_dependence_types.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

/// Poses (or motions) of both sensors at one time. Covariances may be singular, and one of them zero (an exact pose),
/// if both together have rank six.
struct PosePair {
  Gaussian<SE3d> a, b;
};

/// Pairs of poses in little memory.
struct PosePairList {
  PackedPoses a, b;

  PosePairList() = default;
  explicit PosePairList(std::span<const PosePair> pairs) {
    reserve(pairs.size());
    for (const PosePair& pair : pairs) push_back(pair);
  }
  std::size_t size() const { return a.size(); }
  void reserve(std::size_t n) { a.reserve(n), b.reserve(n); }
  void push_back(const PosePair& pair) { a.push_back(pair.a), b.push_back(pair.b); }
  PosePair operator[](std::size_t i) const { return {a[i], b[i]}; }
};

/// Quantities that the equations take for known.
enum class HandEyeSuspect {
  delay,  ///< a pair's B belongs to A at a time that is later by it, s; positive: the stamps of B are early
  scale,  ///< B's translations are too short by it: the board is larger than stated, or the robot's lengths too long
  focal_length,  ///< the camera's is too small by it: distances to the target's origin are too short
  principal_x,   ///< the principal point, in focal lengths: the target's origin is off by it times its distance
  principal_y
};
inline constexpr std::size_t hand_eye_suspects = 5;
constexpr auto words(HandEyeSuspect) {
  return std::array{"delay", "scale", "focal_length", "principal_x", "principal_y"};
}

struct HandEyeOptions {
  /// `false`: the covariances are known up to one common factor, which is estimated from the residuals.
  bool known_noise = true;
  /// Searches for outliers if a pair is beyond the gate in the estimate from all pairs.
  bool find_outliers = true;
  /// Squared error of a pair, in units of its noise, beyond which it is an outlier; χ²₆ at 0.999 by default.
  double gate = 22.457744484825327;
  /// Number of minimal samples in the search for outliers: with 45 % outliers, 80 miss an all-inlier sample once in a
  /// million times.
  int samples = 80;
  /// The excitation from which on a direction is estimated, and that below which noise alone explains it.
  double trusted_excitation = 10, min_excitation = 3;
  /// The fit is `inconsistent` if the probability of exceeding its χ² is smaller.
  double min_p = refutation_level;
  std::uint64_t seed = 1;  ///< seed of the fixed starts and samples
  /// Times of the pairs, s, in their order; empty if they have none. With times the covariance is widened by the
  /// dependence of successive errors that the residuals show (stats/time_dependence.hpp).
  std::vector<double> times = {};
  /// The stream that the poses of A are from, for the delay: at `times` it has the poses of the pairs, but for noise.
  std::vector<TimedPose> stream_of_a = {};
  /// A of each pair is the stream's pose at the pair's time, that of B, in place of a row nearby; the error of
  /// interpolation enters its covariance. Needs `times` and `stream_of_a`; a pair in a gap of the stream keeps its A.
  bool interpolate = false;
  /// Standard deviations of what is known about the suspects, which are then estimated with X: 0 takes a suspect for
  /// known and tests it, infinity is no prior.
  std::array<double, hand_eye_suspects> suspect_sigmas = {};
  double delay_start = 0;  ///< s, from which the delay is sought
  /// Where positive, the delay is sought from where the angular speeds of `stream_of_a` and of B at `times` agree best
  /// within so many seconds of `delay_start`.
  double largest_delay = 0;
};

/// The interpolation of A at the times of B.
struct HandEyeInterpolation {
  std::size_t in_gaps = 0;  ///< pairs that keep their A
  /// The rms error of a pose, local, from every second pose of the stream left out.
  double translation = 0, rotation = 0;  // m, rad
};

/// A direction of X (and Y) that the motions do not determine: the excitation is below the trusted one.
struct OpenDirection {
  /// Ratio of the information to that which the noise of the poses alone would produce; 1 is noise.
  double excitation = 0;
  /// Above `min_excitation`: fixed like the others, but the motions contain some information on it.
  bool weak = false;
  /// The twist (translation, rotation) in the gripper's frame along which X is open: Exp(s·twist) X. Its rotation has
  /// unit length if there is one, otherwise its translation.
  Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
  /// The same for Y, in the base's frame; zero for motions.
  Eigen::Matrix<double, 6, 1> twist_of_Y = Eigen::Matrix<double, 6, 1>::Zero();
  bool has_Y = false;  ///< AX = YB
  /// The direction rotates X; otherwise it is a pure translation.
  bool rotates = false;
  /// Its axis is the rotation axis of the gripper.
  bool along_rotation_axis = false;
  /// Its axis is the direction of the gripper's translation, without rotation.
  bool along_translation = false;
};

/// "translation along the rotation axis (0.1, 0.0, 1.0) of the gripper".
std::string describe(const OpenDirection& direction, const std::string& frame = "gripper");

/// The fit of one pair.
struct PairFit {
  /// e = Log(X⁻¹ A⁻¹ Y B): translation (m) and rotation (rad) in the camera's frame.
  Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
  double chi2 = std::numeric_limits<double>::quiet_NaN();  ///< squared length in units of its noise; χ²₆ at the truth
  bool inlier = false;
};

/// A suspect of a calibration.
struct HandEyeSuspectTest : SuspectTest {
  double prior_sigma = 0;  ///< as in HandEyeOptions::suspect_sigmas
  double value = 0;        ///< that the calibration has taken, in the unit of the suspect; 0 if it is taken for known
  double value_sigma = 0;
  /// The local movement of X per unit by which the suspect is off.
  Eigen::Matrix<double, 6, 1> shift_of_X =
      Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
};

template <class V>
void describe(V& v, const HandEyeSuspectTest& x) {
  describe(v, static_cast<const SuspectTest&>(x));
  v("prior_standard_deviation", x.prior_sigma, "0: taken for known; null: an unknown without a prior");
  v("value", x.value, "that the calibration has taken")("value_standard_deviation", x.value_sigma);
  v("shift_of_X", x.shift_of_X, "local movement of X per unit of it", "m, rad");
}

/// A calibration. Statuses:
///   ok             X, and Y, with their covariance
///   undetermined   the motions leave `directions` open; X and Y are one of the solutions that fit
///   ambiguous      a second solution, `rival`, explains the pairs as well
///   inconsistent   the residuals are larger than the covariances predict, or fewer than half of the pairs agree, or
///                  they speak for a suspect
///   not_converged
///   bad_input      see `fault`
struct HandEyeResult {
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  bool world = false;       ///< AX = YB
  bool known_noise = true;  ///< false: the covariances are known up to a factor, and there is no p
  /// Y is X for AX = XB. Their covariances are blocks of the joint one.
  Gaussian<SE3d> X = {SE3d(), Eigen::Matrix<double, 6, 6>::Constant(std::numeric_limits<double>::quiet_NaN())}, Y = X;
  /// Joint covariance of the local errors of X and Y, X first (for AX = XB only the block of X is used). Open
  /// directions are treated as known: it is singular if there are `directions`, and NaN if one of them rotates X,
  /// because an arbitrary rotation is not a small error.
  Eigen::Matrix<double, 12, 12> covariance =
      Eigen::Matrix<double, 12, 12>::Constant(std::numeric_limits<double>::quiet_NaN());
  /// Squared distance of the inliers from their corrected poses, under the given covariances. It follows χ².
  double chi2 = std::numeric_limits<double>::quiet_NaN();
  int degrees_of_freedom = 0;
  double p = std::numeric_limits<double>::quiet_NaN();  ///< probability of a larger χ²; NaN if the noise is not known
  /// The factor by which the given covariances of the poses were multiplied: 1 if the noise is known, else χ²/dof.
  double variance_factor = 1;
  /// Dependence of the errors on time, by which the covariance is widened; untested without times, with few pairs, and
  /// where directions are open.
  TimeDependence dependence = {};
  std::optional<HandEyeInterpolation> interpolation;  ///< where A was interpolated
  /// Excitations of the six directions, ascending.
  Eigen::Matrix<double, 6, 1> excitations = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<OpenDirection> directions;  ///< those below the trusted excitation, ascending
  std::vector<PairFit> pairs;             ///< in the order of the input
  std::vector<std::size_t> outliers;      ///< indices of the outliers, ascending
  /// Tests of what the equations take for known, in the order of HandEyeSuspect; empty where directions are open and
  /// with few pairs.
  std::vector<HandEyeSuspectTest> suspects;
  /// X as the mixture over the suspects that cannot be told apart, where one is significant.
  std::optional<Gaussian<SE3d>> X_over_suspects;
  std::optional<SE3d> rival;  ///< X of a second solution that fits as well
  int starts = 0;             ///< number of starts that were compared

  bool ok() const { return status == FusionStatus::ok; }
  /// True if a suspect is significant.
  bool isSuspicious() const {
    for (const HandEyeSuspectTest& x : suspects) {
      if (x.significant) return true;
    }
    return false;
  }
  /// The suspects that the residuals speak for, and which of them to estimate; empty where there are none.
  std::string suspectsInWords() const;
  /// How it ended, in words.
  std::string inWords() const;
  /// Verdict on the calibration: to be trusted if the status is ok, else not.
  Verdict verdict() const;
  /// True if an open direction rotates X, so that there is no covariance.
  bool rotationIsOpen() const {
    for (const OpenDirection& d : directions) {
      if (d.rotates) return true;
    }
    return false;
  }
};

/// One of the two unknown poses, parent_T_child, with the standard deviations of its coordinates.
struct CalibratedPose {
  const char *symbol = "X", *parent = "gripper", *child = "camera";
  Gaussian<SE3d> pose;
  bool has_covariance = false;
  bool rotation_is_open = false;
  /// Standard deviations of the translation (m, in the parent's axes) and of the rotation vector (rad). NaN without a
  /// covariance, and along axes in which an open direction has a component.
  Eigen::Matrix<double, 6, 1> sigmas = Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix<double, 6, 1> local_sigmas = sigmas;  ///< those of the local error T·Exp(e), likewise
  /// Covariance of translation and rotation vector as above; open directions count as known.
  Eigen::Matrix<double, 6, 6> covariance_of_coordinates = Eigen::Matrix<double, 6, 6>::Zero();

  std::string name() const { return std::string(parent) + "_T_" + child; }
};
/// X, and Y where there is one.
std::vector<CalibratedPose> calibratedPoses(const HandEyeResult& result);

/// The error that a covariance beside a pose T may belong to. Left perturbations of T are, but for their sign, right
/// ones of T⁻¹: a covariance of the inverse pose is one of `left`.
enum class CovarianceReading {
  right,                      ///< T·Exp(e), translation before rotation: the library's own
  left,                       ///< Exp(e)·T, or T⁻¹·Exp(e)
  rotation_then_translation,  ///< T·Exp(e) with the rotation's block first
  world_axes                  ///< rotation and translation each along the axes of the world
};
inline constexpr std::array all_covariance_readings = {CovarianceReading::right, CovarianceReading::left,
                                                       CovarianceReading::rotation_then_translation,
                                                       CovarianceReading::world_axes};

/// How a file's poses and covariances are to be read.
struct PoseReading {
  CovarianceReading covariance = CovarianceReading::right;
  bool inverted = false;  ///< the wanted pose is the inverse of the given one; the covariance goes with it
  friend bool operator==(const PoseReading&, const PoseReading&) = default;
};
struct HandEyeReading {
  PoseReading a, b;
  friend bool operator==(const HandEyeReading&, const HandEyeReading&) = default;
};

/// Another reading that fits.
struct HandEyeHint {
  HandEyeReading reading;
  double chi2_per_degree = 0;  ///< with covariances as given
  double p = 0;                ///< probability of a larger χ²; NaN where the noise is not known
  std::size_t outliers = 0;
  bool agrees = false;  ///< within the noise; otherwise it is only much better than what was found
};

/// A pose as translation, quaternion with w ≥ 0, and rotation vector.
struct PoseCoordinates {
  SE3d pose;
};
template <class V>
void describe(V& v, const PoseCoordinates& x) {
  Eigen::Vector4d q = x.pose.so3().params();
  if (q[3] < 0) q = -q;
  v("translation", Eigen::Vector3d(x.pose.translation()), "", "m")("quaternion_xyzw", q, "w >= 0");
  v("rotation_vector", Eigen::Vector3d(x.pose.so3().log()), "", "rad");
}

/// Standard deviations (m, rad) of a translation and a rotation vector, shown in m and degrees.
struct PoseSigmas {
  Eigen::Matrix<double, 6, 1> sigmas = Eigen::Matrix<double, 6, 1>::Zero();
};
/// Those of a local error.
struct LocalPoseSigmas : PoseSigmas {};

template <class V>
void describe(V& v, const PoseSigmas& x) {
  v("translation_m", Eigen::Vector3d(x.sigmas.head<3>()), "", "m");
  v("rotation_vector_deg", Eigen::Vector3d(x.sigmas.tail<3>() / units::degree), "", "deg");
}
template <class V>
void describe(V& v, const LocalPoseSigmas& x) {
  v("translation_m", Eigen::Vector3d(x.sigmas.head<3>()), "", "m");
  v("rotation_deg", Eigen::Vector3d(x.sigmas.tail<3>() / units::degree), "", "deg");
}

template <class V>
void describe(V& v, const CalibratedPose& x) {
  describe(v, PoseCoordinates{x.pose.mean});
  v("covariance", x.has_covariance ? std::optional(x.pose.covariance) : std::nullopt, "of local errors, m and rad");
  v("covariance_frame", std::string("the ") + x.child + "'s axes at its origin: " + x.name() + " Exp(e)", "in words");
  v("standard_deviations", PoseSigmas{x.sigmas},
    "along the parent's axes; null along axes in which an open direction has a component");
  v("standard_deviations_local", LocalPoseSigmas{{x.local_sigmas}}, "of the local errors, likewise");
}

/// An open direction with the frames in which it is given.
template <class V>
void describe(V& v, const OpenDirection& d) {
  v("excitation", d.excitation, "as in excitations")("weak", d.weak, "excited, but not enough to be trusted");
  v("twist", d.twist, "of X", "m, rad")("frame", "gripper", "of the twist");
  if (shown(v, d.has_Y)) {
    v("twist_of_Y", d.twist_of_Y, "AX = YB", "m, rad")("frame_of_Y", "base", "of the twist of Y");
  }
  v("description", describe(d, std::string("gripper")), "in words")("rotates", d.rotates, "it rotates X");
}

template <class V>
void describe(V& v, const HandEyeInterpolation& x) {
  v("in_gaps", x.in_gaps, "pairs that keep the row nearby");
  v("rms_translation", x.translation, "of the error", "m")("rms_rotation", x.rotation, "", "rad");
}

template <class V>
void describe(V& v, const PairFit& fit) {
  v("error_translation", Eigen::Vector3d(fit.error.head<3>()), "in the camera's frame", "m");
  v("error_rotation", Eigen::Vector3d(fit.error.tail<3>()), "", "rad");
  v("chi2", fit.chi2, "squared length in units of its noise, 6 expected")("inlier", fit.inlier);
}

template <class V>
void describe(V& v, const HandEyeResult& r) {
  v("status", name(r.status), "ok, undetermined, ambiguous, inconsistent, not_converged or bad_input");
  v("ok", r.ok(), "the calibration is to be trusted")("in_words", r.inWords(), "the status");
  v("problem", r.world ? "AX = YB" : "AX = XB", "AX = YB or AX = XB");
  const std::vector<CalibratedPose> poses = calibratedPoses(r);
  v("X", poses.front(), "gripper_T_camera");
  v("Y", r.world ? std::optional(poses.back()) : std::nullopt, "base_T_target");
  v("covariance_order", "translation rotation", "of the covariances")("covariance_side", "right", "of the errors");
  v("covariance_frame",
    "of X the camera's, of Y the target's: X Exp(e), Y Exp(e), m and rad; open directions count as known", "in words");
  v("joint_covariance", r.world && poses.front().has_covariance ? std::optional(r.covariance) : std::nullopt,
    "of X and Y");
  v("joint_covariance_order",
    r.world ? std::optional<std::string>("X translation, X rotation, Y translation, Y rotation") : std::nullopt,
    "in words");
  v("chi2", r.chi2, "squared distance of the inliers from their corrected poses, in units of their noise");
  v("degrees_of_freedom", r.degrees_of_freedom, "of chi2");
  v("p", r.p, "probability of a larger chi2; null: the noise is not known");
  v("variance_factor", r.variance_factor, "by which the given covariances were multiplied");
  v("noise", r.known_noise ? "given" : "scaled", "given or scaled");
  describe(v, r.dependence);
  v("interpolation", r.interpolation, "of A at the times of B; null: rows nearby");
  v("excitations", r.excitations, "of the six directions, ascending");
  v("open_directions", r.directions, "that the motions leave open");
  v("suspects", r.suspects, "what the equations take for known");
  v("suspects_in_words", r.suspectsInWords(), "those that the residuals speak for; empty: none");
  v("X_over_suspects", r.X_over_suspects ? std::optional(PoseCoordinates{r.X_over_suspects->mean}) : std::nullopt,
    "X as the mixture over the suspects that cannot be told apart");
  v("X_over_suspects_covariance", r.X_over_suspects ? std::optional(r.X_over_suspects->covariance) : std::nullopt,
    "of local errors, m and rad");
  v("rival", r.rival ? std::optional(PoseCoordinates{*r.rival}) : std::nullopt, "X of a second solution");
  v("starts", r.starts, "that were compared")("outliers", r.outliers, "numbers of the wrong pairs, from 0");
}

/// The pairs: errors (n×6, translation and rotation, m and rad) and squared lengths in units of their noise.
template <class V>
void describeSeries(V& v, const HandEyeResult& r) {
  Eigen::Matrix<double, Eigen::Dynamic, 6> errors(static_cast<Eigen::Index>(r.pairs.size()), 6);
  std::vector<double> squared;
  for (std::size_t i = 0; i < r.pairs.size(); ++i) {
    errors.row(static_cast<Eigen::Index>(i)) = r.pairs[i].error.transpose();
    squared.push_back(r.pairs[i].chi2);
  }
  v("errors", errors, "of the pairs", "m, rad")("pair_chi2", squared, "6 expected");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/hand_eye/detail/hand_eye_results.hpp>
#endif
