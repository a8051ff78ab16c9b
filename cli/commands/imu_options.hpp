#pragma once

// The options that all commands that read an inertial sensor have.

#include <cli/commands/command_line.hpp>
#include <formats/calibration.hpp>
#include <fusion/imu/preintegrate.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

struct ImuOptions {
  std::string file;
  std::vector<double> noise, gyroscope_bias, accelerometer_bias;
  ImuScheme scheme = ImuScheme::averaged;
  double largest_gap = 0.1;  ///< s

  bool hasBias() const { return !gyroscope_bias.empty() || !accelerometer_bias.empty(); }
  /// The biases that were given, else zero.
  ImuBias<double> bias() const {
    const auto vector = [](const std::vector<double>& list) {
      return list.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(list[0], list[1], list[2]);
    };
    return {vector(gyroscope_bias), vector(accelerometer_bias)};
  }
  /// The densities of a calibration, with those that were given in their place.
  ImuNoise<double> noiseOver(ImuNoise<double> densities) const {
    std::size_t i = 0;
    for (double* density :
         {&densities.gyroscope, &densities.accelerometer, &densities.gyroscope_walk, &densities.accelerometer_walk}) {
      if (i < noise.size()) *density = noise[i];
      ++i;
    }
    return densities;
  }
};

/// Declares --imu, which it returns, --noise, both biases, --scheme and --max-gap. `bias` says what a bias is taken for
/// that is not given.
inline Option addImuOptions(const Command& command, ImuOptions& options, const std::string& bias) {
  Option file = command.option(
      "--imu", options.file,
      "EuRoC's imu0/data.csv, CSV with t,wx,wy,wz,ax,ay,az ('-': standard input), or BAG:TOPIC of Imu messages");
  command
      .option("--noise", options.noise,
              "Densities: gyroscope rad/s/rtHz, accelerometer m/s^2/rtHz, and their walks; go before the file's")
      .list(2, 4)
      .notNegative();
  command.option("--gyroscope-bias", options.gyroscope_bias, "rad/s, x,y,z" + bias).list(3, 3);
  command.option("--accelerometer-bias", options.accelerometer_bias, "m/s^2, x,y,z" + bias).list(3, 3);
  command.choice<ImuScheme>("--scheme", options.scheme,
                            {{"averaged", ImuScheme::averaged}, {"held", ImuScheme::held}, {"cubic", ImuScheme::cubic}},
                            "Integration scheme: averaged (default), held, cubic");
  command.option("--max-gap", options.largest_gap, "s between two readings (default 0.1)").positive();
  return file;
}

}  // namespace liestat::cli
