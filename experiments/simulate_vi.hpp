#pragma once

#include <experiments/recording.hpp>
#include <experiments/spline_trajectory.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/se3.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// Thrown where a request cannot be simulated: says what there is, and what would be needed.
class ImpossibleMotion : public std::invalid_argument {
 public:
  ImpossibleMotion(std::string found, std::string expected)
      : std::invalid_argument(found + ", expected " + expected),
        found_(std::move(found)),
        expected_(std::move(expected)) {}

  const std::string& found() const { return found_; }
  const std::string& expected() const { return expected_; }

 private:
  std::string found_, expected_;
};

/// When there are images, and what they see of a world of points on the faces of a box.
struct ViSceneOptions {
  double image_rate = 10;             ///< Hz
  double pixel_noise = 1;             ///< standard deviation of u and of v, pixels
  std::size_t landmarks = 2000;       ///< points, uniform over the faces
  std::size_t features = 40;          ///< at most so many tracks an image
  std::size_t shortest_track = 4;     ///< images; no landmark is taken up that will be lost before
  double min_depth = 0.3;             ///< m along the optical axis
  std::optional<Eigen::Vector3d> box; /**< lengths of its edges, m, its middle that of the motion; by default 10 x 10 x
                                         4, or where the motion needs it, its extent and 2 m */
  double outliers = 0;                ///< fraction of the tracks that drift away from their landmark
  double drift = 8;                   ///< standard deviation of their random walk, pixels an image
  std::uint64_t seed = 1;
};

/// A sensor's readings of a smooth motion.
struct SyntheticImuOptions {
  double rate = 200;                     ///< Hz
  ImuNoise<double> noise = {};           ///< zero: exact readings
  ImuBias<double> bias = {};             ///< at the beginning; from there it walks
  Eigen::Vector3d gravity{0, 0, -9.81};  ///< in the world, m/s²
};

/// These densities, all times a factor.
ImuNoise<double> scaled(const ImuNoise<double>& noise, double factor);

/// Biases that remain after a calibration, drawn with standard deviations of 0.01 rad/s and 0.05 m/s² in each axis.
ImuBias<double> calibratedBias(std::uint64_t seed);

/// The point that a track of the simulated images shows.
struct SimulatedTrack {
  Eigen::Vector3d landmark;  ///< in the world, m
  bool outlier = false;      ///< it drifts
  std::size_t images = 0;    ///< in which it is
};

/// A recording and the truth of it. Times are in seconds since start_ns on the clock of the inertial sensor, whole
/// nanoseconds.
struct SimulatedRecording {
  std::int64_t start_ns = 0;
  std::vector<ImuSample<double>> imu;
  std::vector<GroundTruth> truth;  ///< at every image, and at least as often as the sensor reads
  std::vector<double> image_times;
  std::vector<PixelObservation> observations;  ///< by images, then by tracks
  std::vector<SimulatedTrack> tracks;
  CameraCalibration camera;
  std::optional<ImuNoise<double>> noise;  ///< the densities that the calibration is to have
  Eigen::Vector3d box_centre, box;        ///< centre and size of the landmarks' box, m
};

/// A motion to try things with: sines of 0.2 to 1 Hz in every direction, some 1.5 m/s² and 0.5 rad/s RMS an axis.
SplineTrajectory builtInTrajectory(double duration, std::uint64_t seed);

/// The smooth motion along a ground truth, whose poses every `spacing` seconds are its control points. Throws
/// ImpossibleMotion where the truth is too short or has a gap of more than 0.1 s.
SplineTrajectory trajectoryAlong(const std::vector<GroundTruth>& truth, double spacing);

/// Readings and images of a smooth motion from `begin` to `end`, s; its own states are the truth, exactly. The first
/// image is one reading after the beginning. A camera without a size is taken to be twice as large as its principal
/// point is far from the corner. Throws ImpossibleMotion where begin and end are not within the motion, where that does
/// not fit into the box, and where there are fewer than two images.
SimulatedRecording simulateMotion(const SplineTrajectory& motion, double begin, double end,
                                  const CameraCalibration& camera, const SyntheticImuOptions& imu,
                                  const ViSceneOptions& scene);

/// Images along a real recording whose readings are kept as they are: the ground truth's rows from `begin` to `end`,
/// and images at those of them that are nearest to the rate asked for. Throws ImpossibleMotion as simulateMotion does,
/// and where readings and truth have no time in common.
SimulatedRecording simulateImages(const std::vector<ImuSample<double>>& imu, const std::vector<GroundTruth>& truth,
                                  double begin, double end, const CameraCalibration& camera,
                                  const ViSceneOptions& scene);

}  // namespace liestat::experiments
