// Mistakes of a user, one for each value of MISTAKE: run.sh shows that each is answered by one sentence.
#include <lie/lie.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/auto_diff.hpp>
#include <stats/charts.hpp>
#include <stats/constrained.hpp>
#include <stats/cut_locus.hpp>
#include <stats/dispersion.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness.hpp>

#include <ranges>
#include <sstream>
#include <string>
#include <vector>

using namespace liestat;

/// A line through points of the plane, as it is meant, and of doubles alone.
struct OnLine {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 2, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    return Eigen::Matrix<S, 1, 1>(q[0] * m[0] + q[1] - m[1]);
  }
};
struct OnLineOfDoubles {
  Eigen::Matrix<double, 1, 1> operator()(const Eigen::Vector2d& q, const Eigen::Vector2d& m) const {
    return Eigen::Matrix<double, 1, 1>(q[0] * m[0] + q[1] - m[1]);
  }
};

int main() {
  const std::vector<Eigen::Vector2d> points(3, Eigen::Vector2d(1, 2));
  const Eigen::Vector2d line(0, 0);
  const IsotropicNoise<2> noise(0.1);
  const std::vector<SO3d> rotations(3);
  const std::vector<SE3d> poses(3);
  const std::vector<Gaussian<Frame3d>> frames(3);
  std::istringstream text("1 2 3");
#if MISTAKE == 0
  return static_cast<int>(mean(rotations).n + groupMean(poses).n + maha(frames, CovarianceAt::measured).n +
                          certifiedMean(rotations).mean.n + uniqueness(rotations, mean(rotations)).cells) +
         constrainedEstimate(line, measurements(points, noise, autoDiff(OnLine{}))).iterations +
         constrainedEstimate(line, std::tuple(measurements(points, noise, autoDiff(OnLine{})))).iterations;
#elif MISTAKE == 1
  return mean(std::vector<int>(3)).iterations;
#elif MISTAKE == 2
  return mean(rotations, std::vector<std::string>(3)).iterations;
#elif MISTAKE == 3
  return mean(std::ranges::istream_view<int>(text)).iterations;
#elif MISTAKE == 4
  return mean(poses).iterations;
#elif MISTAKE == 5
  return maha(frames).iterations;
#elif MISTAKE == 6
  return maha(rotations).iterations;
#elif MISTAKE == 7
  return groupMean(std::vector<Frame3d>(3)).iterations;
#elif MISTAKE == 8
  return certifiedMean(poses).mean.iterations;
#elif MISTAKE == 9
  return certifiedMean(rotations, std::vector<std::string>(3)).mean.iterations;
#elif MISTAKE == 10
  return certifiedMaha(rotations, CovarianceAt::measured).maha.iterations;
#elif MISTAKE == 11
  return certifiedGroupMean(std::vector<Frame3d>(3)).mean.iterations;
#elif MISTAKE == 12
  return uniqueness(std::vector<int>(3), mean(rotations)).improved;
#elif MISTAKE == 13
  return localRadius(poses, SO3d()) > 0;
#elif MISTAKE == 14
  return cutLocusMass(std::vector<int>(3), mean(rotations), 0.2).mass > 0;
#elif MISTAKE == 15
  return cutLocusNearby(rotations, std::vector<std::string>(3), mean(rotations), SO3d::Adjoint::Identity()).mass > 0;
#elif MISTAKE == 16
  return static_cast<int>(dispersionAbout(std::vector<int>(3), SO3d()).farthest.size());
#elif MISTAKE == 17
  return static_cast<int>(chartScatter(rotations, std::vector<std::string>(3), SO3d()).mean.size());
#elif MISTAKE == 18
  return constrainedEstimate(line, measurements(points, noise, OnLine{})).iterations;
#elif MISTAKE == 19
  return constrainedEstimate(line, measurements(points, noise, autoDiff(OnLineOfDoubles{}))).iterations;
#elif MISTAKE == 20
  return constrainedEstimate(Eigen::VectorXd(line), measurements(points, noise, autoDiff(OnLine{}))).iterations;
#elif MISTAKE == 21
  return constrainedEstimate(line, measurements(points, IsotropicNoise<3>(0.1), autoDiff(OnLine{}))).iterations;
#elif MISTAKE == 22
  return constrainedEstimate(line, measurements(points, noise, autoDiff(OnLine{})), OnLine{}).iterations;
#endif
}
