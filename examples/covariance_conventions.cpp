// Whose covariance is it? One pose of a ROS message, read in three conventions that its author may have meant, given to
// g2o and GTSAM, and what a wrong reading costs.
#include <lie/linear.hpp>
#include <lie/units.hpp>
#include <stats/convention_charts.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>
#include <stats/propagation.hpp>

#include <cmath>
#include <cstdio>
#include <string_view>

using liestat::Convention, liestat::Gaussian, liestat::SE3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

int main() {
  // A vehicle that heads north-west on a slope; sd 30 cm along its way, 2 cm across, half a degree about its vertical
  // axis.
  const SE3d world_T_body(liestat::fromRollPitchYaw(0.05, -0.4, 2.3), Eigen::Vector3d(120, 45, 8));
  Matrix6 covariance = Matrix6::Zero();
  covariance.diagonal() << 0.09, 0.0004, 0.0004, 1e-6, 4e-6, 8e-5;
  covariance(1, 5) = covariance(5, 1) = 1e-4;  // a wrong heading is a position aside
  const Gaussian<SE3d> truth{world_T_body, covariance};

  // Its driver publishes along the axes of the world, 36 numbers row by row.
  const Convention published = *liestat::parseConvention("ros-fixed");
  const liestat::PackedCovariance numbers = packCovariance(published, toConvention(published, truth));

  // Readers: each gets a positive definite matrix, and no complaint. Its mean squared Mahalanobis distance, 6 if the
  // reading is right, is trace(Σ_read⁻¹ Σ).
  std::printf("a message in ros-fixed read as    sd along the way   across   heading     E[d2]\n");
  double right_reading = 0, worst = 0;
  for (const char* reading : {"ros-fixed", "ros-rpy", "ros-body-ori", "right", "left", "gtsam"}) {
    const Convention c = *liestat::parseConvention(reading);
    const auto matrix = unpackCovariance(c, numbers.numbers());
    const Gaussian<SE3d> read = fromConvention(c, world_T_body, *matrix);
    const Matrix6 information = covarianceAsContent(liestat::CovarianceContent::information, read.covariance);
    const double d2 = liestat::product(information, covariance).trace();
    const auto sd = [&](int i) { return std::sqrt(read.covariance(i, i)); };
    std::printf("%-32s %9.3f m %9.3f m %6.2f deg %10.1f\n", reading, sd(0), sd(1), sd(5) / liestat::units::degree, d2);
    if (std::string_view(reading) == "ros-fixed") right_reading = d2;
    if (d2 > worst) worst = d2;
  }

  // To g2o as the edge from the world's origin, and on to whoever reads the file as whole angles.
  const Convention half = *liestat::parseConvention("g2o-half"), full = *liestat::parseConvention("g2o-full");
  const Matrix6 in_g2o = toConvention(half, truth);
  const double misread = fromConvention(full, world_T_body, in_g2o).covariance(5, 5) / covariance(5, 5);
  std::printf("g2o's half angles read as whole ones: the variance of the heading is divided by %.0f\n", 1 / misread);

  // GTSAM's poses are inverted as a whole: the pose first, then the order.
  const Matrix6 for_gtsam = toConvention(*liestat::parseConvention("gtsam"), inverse(truth));
  std::printf("body_T_world for GTSAM: sd of the first component (a rotation) %.4f rad\n", std::sqrt(for_gtsam(0, 0)));

  // From far away a perturbation about the world's origin loses the digits of the position.
  Gaussian<SE3d> on_a_map = truth;
  on_a_map.mean = SE3d(world_T_body.so3(), Eigen::Vector3d(5.4e5, 4.8e6, 300));
  const liestat::ConversionLoss loss = conversionLoss(published, *liestat::parseConvention("left"), on_a_map);
  std::printf("to `left` at map coordinates: %s (a round trip loses %.1g sd)\n", liestat::message(loss.problem),
              loss.round_trip);

  const bool fine = std::abs(right_reading - 6) < 1e-6 && worst > 60 && std::abs(misread - 0.25) < 1e-9 &&
                    loss.problem == liestat::ConversionProblem::far_origin;
  return fine ? 0 : 1;
}
