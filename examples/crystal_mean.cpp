// Orientations of crystals, measured as any of their symmetric copies: the mean modulo the point group, its covariance,
// and the disorientation of one grain from another.
#include <lie/crystal_orientation.hpp>
#include <lie/units.hpp>
#include <stats/certified_mean.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <iostream>
#include <vector>

using namespace liestat;

int main() {
  const PointGroup cubic = *PointGroup::fromName("m-3m");
  std::cout << "m-3m has the rotations of " << cubic.name() << ", " << cubic.order() << " of them\n";

  // A grain in Bunge's angles, 200 measurements with 0.5 degrees of noise, each indexed as one of the copies.
  const auto grain = CrystalOrientation::fromBunge(35 * units::degree, 48 * units::degree, 12 * units::degree, cubic);
  CounterRng rng(1);
  std::vector<CrystalOrientation> measured;
  for (int i = 0; i < 200; ++i) {
    const CrystalOrientation x = exp(grain, Eigen::Vector3d(0.5 * units::degree * rng.normalVector<3>()));
    const auto copies = ManifoldTraits<CrystalOrientation>::representativesOf(x);
    const auto k = static_cast<std::size_t>(rng.uniform() * static_cast<double>(copies.size()));
    measured.push_back(ManifoldTraits<CrystalOrientation>::representative(x, copies[k]));
  }

  const CertifiedMean<CrystalOrientation> mean = certifiedMean(measured);
  std::cout << "mean: " << name(mean.status) << ", " << name(mean.uniqueness.unique) << ", "
            << distance(mean.mean.mean, grain) / units::degree << " degrees from the truth\n";
  if (!mean.estimate) return 1;
  const Eigen::Vector3d sd = mean.estimate->covariance.diagonal().cwiseSqrt() / units::degree;
  std::cout << "standard deviations along the crystal's axes: " << sd.transpose() << " degrees\n";

  // A twin of the cubic face-centred lattice: 60 degrees about <111>.
  const SO3d twinning = SO3d::exp(60 * units::degree * Eigen::Vector3d::Ones().normalized());
  const CrystalOrientation twin(grain.rotation() * twinning, cubic);
  std::cout << "disorientation of the twin: " << distance(mean.mean.mean, twin) / units::degree << " degrees\n";
  return mean.status == Status::ok && std::abs(distance(grain, twin) - 60 * units::degree) < 1e-9 &&
                 distance(mean.mean.mean, grain) < 0.2 * units::degree
             ? 0
             : 1;
}
