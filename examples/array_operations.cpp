// Operations on arrays: a column of poses inside a table, moved into another frame and logged, without a copy.
#include <lie/arrays.hpp>

#include <cstdio>
#include <vector>

using namespace liestat;

struct Row {
  double time;
  SE3d world_T_body;
  Eigen::Vector3d landmark;  // in the body's frame
};

int main() {
  std::vector<Row> log;
  for (int i = 0; i < 1000; ++i) {
    SE3d::Tangent v;
    v << 0.01 * i, 0, 0.5, 0, 0, 0.002 * i;
    log.push_back({0.1 * i, SE3d::exp(v), Eigen::Vector3d(1, 2, 3)});
  }
  const auto poses = memberOf(log, &Row::world_T_body);

  // Landmarks to the world, in an array of their own.
  std::vector<Eigen::Vector3d> world(log.size());
  arrays::act<SE3d>(poses, memberOf(log, &Row::landmark), world);

  // One pose for all: the log relative to its first pose, in place.
  const SE3d first_T_world = log.front().world_T_body.inverse();
  arrays::product<SE3d>(first_T_world, poses, poses);

  Eigen::Matrix<double, 6, Eigen::Dynamic> tangents(6, 1000);
  arrays::log<SE3d>(poses, tangents);

  std::printf("instructions: %s\n", name(instructionSet()));
  std::printf("the last landmark in the world: %.3f %.3f %.3f m\n", world.back()[0], world.back()[1], world.back()[2]);
  std::printf("the last pose turned by %.3f rad\n", tangents.col(999).tail<3>().norm());
  return tangents.allFinite() && tangents.col(0).norm() < 1e-12 ? 0 : 1;
}
