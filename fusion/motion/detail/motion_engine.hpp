// The loop that the filters of fusion/motion/ share: hypotheses of a direction, what each frame makes of them, which of
// them remain, and what is said about the best.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/motion/subspace_update.hpp>
#include <fusion/motion/types.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace liestat::detail {

/// The tangent of an angle from the optical axis beyond which no camera sees a point.
inline constexpr double max_coordinate = 1e6;

/// Cumulative sums of evidence against the sign above which it is undecided, and replaced.
inline constexpr double reversal_likely = 5.5, reversal_certain = 8;
/// Standard deviations of the evidence that replaces it.
inline constexpr double reversal_sigmas = 8;

/// Mean χ² over its degrees of freedom of a plane through the inverse depths below which the scene passes for a plane,
/// and the standard deviations by which a rival must then be worse.
inline constexpr double largest_plane_misfit = 1.35, plane_rival_sigmas = 6;

/// Share of the pairs that may lie behind the camera, each by four standard deviations of the noise that the frames show,
/// where the sign of the direction passes for decided.
inline constexpr double largest_share_behind = 0.15;

/// The state besides the direction.
enum class MotionState { direction, gyroscope_bias, rotation, rotation_and_bias };
constexpr bool keepsTheRotation(MotionState state) {
  return state == MotionState::rotation || state == MotionState::rotation_and_bias;
}
constexpr bool keepsTheBias(MotionState state) {
  return state == MotionState::gyroscope_bias || state == MotionState::rotation_and_bias;
}

/// One hypothesis. Covariances are in the local frame of the direction (first two coordinates); the bias is in the
/// camera's axes; the rotation's error δ is on the left, R ← Exp(δ) R, in the axes of the second frame.
struct DirectionCandidate {
  S2d direction;
  SO3d rotation;  ///< state, or that of the last frame
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  FilterCovariance<double, 2> narrow;  ///< MotionState::direction
  FilterCovariance<double, 5> wide;    ///< MotionState::gyroscope_bias, rotation; of rotation_and_bias a copy of the
                                       ///< direction and the rotation in `whole`
  FilterCovariance<double, 8> whole;   ///< MotionState::rotation_and_bias: direction, rotation, bias
  double score = 0;
  std::size_t start = 0;  ///< its number among the starts
  static constexpr std::size_t remembered = 24;
  std::array<double, remembered> costs{};  ///< costs of the last frames, a ring buffer
  double evidence = 0, evidence_variance = 0, evidence_weight = 0;
  double against = 0;                                      ///< cumulative sum of the evidence against the sign
  double later = 0, later_variance = 0, later_weight = 0;  ///< the evidence since that sum was zero

  // Values of the last frame that it was updated with.
  Eigen::Vector3d Omega = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation_covariance = Eigen::Matrix3d::Identity();
  double depth = 0, depth_variance = 0, cost = 0, innovation = 0;
  double plane_misfit = 0;     ///< χ² of a plane through the inverse depths over its degrees of freedom
  double direction_score = 0;  ///< gᵀ(S + C P C)⁻¹g: χ² of two degrees
  Eigen::Vector3d from_gyroscope = Eigen::Vector3d::Zero();         ///< rotation of the images minus the gyroscope's,
  Eigen::Matrix3d gyroscope_information = Eigen::Matrix3d::Zero();  ///< and its inverse covariance; 0: none
  std::size_t inliers = 0;
  double behind = 0;          ///< share of them that this direction puts behind the camera,
  double usually_behind = 0;  ///< and its mean over four frames or so

  void copyFromWhole() {
    wide.gain = whole.gain.topLeftCorner<5, 5>();
    wide.reported = whole.reported.topLeftCorner<5, 5>();
  }
  Eigen::Matrix3d biasCovariance(MotionState state) const {
    return state == MotionState::gyroscope_bias ? Eigen::Matrix3d(wide.gain.bottomRightCorner<3, 3>())
                                                : Eigen::Matrix3d(whole.gain.bottomRightCorner<3, 3>());
  }
};

class MotionEngine {
 public:
  MotionEngine(const MotionFilterOptions& options, MotionState state);

  const MotionEstimate& update(std::span<const PointPair> pairs, const GyroscopeRotation* gyroscope);
  const MotionEstimate& estimate() const { return estimate_; }
  const MotionFilterOptions& options() const { return options_; }
  std::span<const DirectionCandidate> candidates() const { return candidates_; }
  const DirectionCandidate* best() const { return candidates_.empty() ? nullptr : &candidates_[best_]; }

  void reset();
  /// One hypothesis in place of all others.
  void start(const DirectionCandidate& candidate);
  /// The depths of the last frame's pairs at the present estimate, in their order.
  std::span<const InverseDepth> inverseDepths();

 private:
  using Points = std::span<const FlowPoint<double>>;
  struct Frame {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< inverse covariance of the gyroscope's rotation
    Eigen::Vector3d gyroscope = Eigen::Vector3d::Zero();
    bool has_gyroscope = false;
  };
  /// Everything about a frame at one hypothesis.
  struct Evaluation {
    RotationPrior<double> prior;                         ///< prior of the increment Omega
    Eigen::Matrix3d marginal = Eigen::Matrix3d::Zero();  ///< its information, the bias being unknown
    Eigen::Vector3d Omega = Eigen::Vector3d::Zero();
    SO3d base;  ///< rotation by which the points were turned
    SubspaceSums<double> sums;
    Eigen::Matrix<double, 3, 2> basis;
    double capped_cost = 0;
    std::size_t inliers = 0;
  };

  void spreadBias(DirectionCandidate& candidate) const;
  RotationPrior<double> priorWithoutBias() const;
  void updateRotationOf(DirectionCandidate& candidate);
  bool readFrame(std::span<const PointPair> pairs, const GyroscopeRotation* gyroscope);
  void resize(std::size_t n);
  bool atStandstill();
  double fitRotationAlone(double& statistic);
  void updateRotationAlone();
  void startAnew();
  void spreadStarts();
  void startLinearly();
  void predict(DirectionCandidate& candidate) const;
  bool turnedPerCandidate() const;
  void flowsAfter(const SO3d& R);
  void prepareSharedFlows();
  bool evaluate(const DirectionCandidate& candidate, Evaluation& out);
  void weighForward(const Eigen::Vector3d& V, Evaluation& e);
  void rejectOutliers(const DirectionCandidate& candidate, Evaluation& e);
  void gateDepths(const DirectionCandidate& candidate, const Eigen::Vector3d& Omega);
  bool advance(DirectionCandidate& candidate);
  template <int D>
  bool step(DirectionCandidate& candidate, FilterCovariance<double, D>& P, const Evaluation& e,
            const FrameInformation<double, D>& frame);
  void weighSign(DirectionCandidate& candidate) const;
  void prune();
  double gapOfChance(const DirectionCandidate& candidate, const DirectionCandidate& best, double sigmas) const;
  double mixedDepths(const Evaluation& e) const;
  double planeMisfit(const Evaluation& e) const;
  double behindTheCamera(const Evaluation& e) const;
  void compareWithGyroscope(DirectionCandidate& candidate, const Evaluation& e) const;
  void followProcessNoise();
  void judgeFit();
  void judgeGyroscope();
  void advanceAll();
  void publish();
  std::size_t leastPairs() const;
  bool consistent() const;

  MotionFilterOptions options_;
  MotionState state_;
  MotionEstimate estimate_;
  std::vector<DirectionCandidate> candidates_;
  std::size_t best_ = 0, updates_ = 0;
  double standstill_quantile_ = 0;
  double usual_signal_ = 0;  ///< mean signal of the last ten or so frames that were not at standstill
  std::size_t moving_frames_ = 0;
  bool was_still_ = false;
  double outlier_share_ = 0;              ///< of the last fifty or so frames that were used
  double still_sum_ = 0, still_dof_ = 0;  ///< χ² and degrees of freedom of all frames before a clear motion
  SO3d rotation_alone_;
  Eigen::Matrix3d rotation_information_ = Eigen::Matrix3d::Identity();
  RotationPrior<double> rotation_prior_;  ///< the share of the gyroscope in them
  std::size_t rotation_inliers_ = 0;
  bool updated_ = false;       ///< by the last frame
  double plane_misfit_ = 0;    ///< of the best hypothesis, mean over ten frames or so
  double innovation_sum_ = 0;  ///< discounted over lost_frames
  std::size_t innovation_count_ = 0;

  // The fit of the last frames, through restarts.
  struct FrameFit {
    double chi_squared = 0, degrees = 0, direction_score = 0;
  };
  static constexpr std::size_t fit_frames = 10, score_frames = 4, gyroscope_frames = 20;
  std::array<FrameFit, fit_frames> fits_{};
  std::size_t fit_next_ = 0, fit_count_ = 0, fit_since_start_ = 0;
  double gyroscope_chi_ = 0;  ///< mean over gyroscope_frames or so
  std::size_t gyroscope_count_ = 0;
  Eigen::Vector3d gyroscope_pull_ = Eigen::Vector3d::Zero();    ///< weighted sum of the differences, discounted,
  Eigen::Matrix3d gyroscope_weight_ = Eigen::Matrix3d::Zero();  ///< and its covariance

  // The way of the best direction, for its process noise.
  struct Place {
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
    double noise = 0;  ///< process noise so far
  };
  static constexpr std::size_t way_frames = 23;
  std::array<Place, way_frames> way_{};
  std::size_t way_count_ = 0, way_start_ = 0, updates_way_ = 0;
  double process_noise_ = 0, noise_so_far_ = 0;

  Frame frame_;
  std::vector<PointPair> pairs_;
  std::vector<std::size_t> index_;  ///< place of each pair in the caller's list
  std::size_t given_ = 0;
  std::vector<FlowPoint<double>> points_;
  std::vector<FlowRow<double>> rows_;
  std::vector<double> weights_, squared_;
  std::vector<InverseDepth> depths_;

  // Frames of a linear start.
  std::vector<std::vector<PointPair>> kept_pairs_;
  std::vector<Frame> kept_frames_;
  std::size_t kept_ = 0;
  Eigen::Matrix3d linear_moments_ = Eigen::Matrix3d::Zero(), linear_noise_ = Eigen::Matrix3d::Zero();
};

}  // namespace liestat::detail

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/motion/detail/motion_engine_run.hpp>
#endif
