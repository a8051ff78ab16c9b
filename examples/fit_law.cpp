// Directions scattered about one: the law of von Mises and Fisher with its concentration, the cone that holds the mean
// direction, and what refutes it where there are two clusters.
#include <lie/s2.hpp>
#include <lie/units.hpp>
#include <stats/directional_laws.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <iostream>
#include <vector>

using namespace liestat;

int main() {
  const DirectionalLaw truth{LawModel::vmf, Eigen::Vector3d(0.6, 0, 0.8), Eigen::Matrix2d::Identity(),
                             Eigen::VectorXd::Constant(1, 20)};
  CounterRng rng(1);
  std::vector<S2d> directions;
  for (int i = 0; i < 60; ++i) directions.emplace_back(Eigen::Vector3d(truth.sample(rng)));

  const LawFit fit = fitLaw(LawModel::vmf, directions);
  std::cout << fit.verdict().text << "\nkappa " << fit.law.kappa[0] << " +- " << fit.kappaDeviation(0)
            << ", mean direction " << fit.law.location.transpose() << " within " << fit.alpha95() / units::degree
            << " degrees (95 %)\n";

  // Half of the directions about another mean: no law with one.
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d x = truth.sample(rng);
    directions.emplace_back(Eigen::Vector3d(-x[0], x[1], x[2]));
  }
  const LawFit mixed = fitLaw(LawModel::vmf, directions);
  std::cout << "two clusters: " << mixed.verdict().text << '\n';
  const double off = std::acos(fit.law.location.dot(truth.location));
  return fit.ok() && std::abs(fit.law.kappa[0] - 20) < 3 * fit.kappaDeviation(0) && off < 1.5 * fit.alpha95() &&
                 mixed.status == Status::inconsistent
             ? 0
             : 1;
}
