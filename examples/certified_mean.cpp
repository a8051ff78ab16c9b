// When is the mean of rotations the only one? Three answers: unique with a proof, ambiguous with the rivals, and a mean
// that exists but whose covariance would mislead.
#include <lie/semi_oriented_frame3.hpp>
#include <lie/so3.hpp>
#include <stats/sampling.hpp>
#include <stats/certified_mean.hpp>

#include <iostream>
#include <vector>

using namespace liestat;

template <class M>
Status say(const char* title, const std::vector<M>& features) {
  const CertifiedMean<M> result = certifiedMean(features);
  std::cout << title << "\n  " << name(result.status) << ", " << name(result.uniqueness.unique);
  if (*result.uniqueness.proof) std::cout << ": " << result.uniqueness.proof;
  std::cout << "\n  the only minimum within " << result.uniqueness.r_star << " rad of it; cells searched "
            << result.uniqueness.cells << "\n";
  for (const M& rival : result.uniqueness.rivals) {
    std::cout << "  rival at " << distance(result.mean.mean, rival) << " rad\n";
  }
  if (!result.estimate) std::cout << "  no covariance: " << result.reason << "\n";
  return result.status;
}

int main() {
  CounterRng rng(3);
  const auto scattered = [&](double spread) {
    const Eigen::Vector3d sd = spread * Eigen::Vector3d(0.3, 0.6, 0.9);
    std::vector<SO3d> rotations;
    for (int i = 0; i < 30; ++i) {
      rotations.push_back(sample(Gaussian<SO3d>{SO3d(), sd.cwiseAbs2().asDiagonal()}, rng));
    }
    return rotations;
  };
  bool as_expected = say("thirty rotations within some degrees", scattered(0.1)) == Status::ok;
  as_expected &= say("thirty rotations, some beyond a quarter turn from their mean", scattered(1)) == Status::ok;

  // Each of the three is as good a mean as the others.
  const double third = 2 * EIGEN_PI / 3;
  as_expected &= say<SO3d>("three rotations a third of a turn apart",
                           {SO3d(), SO3d::exp({0, 0, third}), SO3d::exp({0, 0, -third})}) == Status::ambiguous;

  // Frames up to a half-turn about their third axis, with errors up to that fold: the mean is found, but the squared
  // distance has kinks among the data, and no first-order covariance is right.
  const Eigen::Matrix<double, 6, 1> sd = (Eigen::Matrix<double, 6, 1>() << 1, 1, 1, 0.3, 0.6, 0.9).finished();
  std::vector<SemiOrientedFrame3d> folded;
  for (int i = 0; i < 30; ++i) {
    folded.push_back(sample(Gaussian<SemiOrientedFrame3d>{{}, sd.cwiseAbs2().asDiagonal()}, rng));
  }
  as_expected &= say("thirty semi-oriented frames, some near the fold", folded) == Status::ill_defined;
  return as_expected ? 0 : 1;
}
