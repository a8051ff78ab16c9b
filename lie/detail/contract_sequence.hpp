// Inputs of the contract's checks: vectors that fill a tangent space evenly while their angle goes through the decades.
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat::detail {

/// Points of a cube that fill it evenly, by Richtmyer's additive recurrence: coordinate k of point n is the fraction of
/// n·sqrt(p_k), p_k the k-th prime. The checks need inputs in general position, the same on every machine, and no
/// randomness: so there is no generator here, and lie/ needs no package for one.
class ContractSequence {
 public:
  /// Points of different seeds are different parts of one sequence.
  explicit ContractSequence(std::uint64_t seed) : point_(seed * 0x10001) {}
  /// Goes to the next point, and back to its first coordinate.
  void next() {
    ++point_;
    coordinate_ = 0;
  }
  /// The next coordinate of this point, within ±1.
  double coordinate() {
    if (coordinate_ == steps_.size()) addStep();
    // Fractions as 64-bit integers, whose products wrap around just as fractions do.
    const std::uint64_t fraction = point_ * steps_[coordinate_++];
    return (static_cast<double>(fraction >> 12) + 0.5) * 0x1p-51 - 1;
  }
  double uniform(double low, double high) { return low + (high - low) * (1 + coordinate()) / 2; }

 private:
  void addStep() {
    const auto is_prime = [](int p) {
      for (int d = 2; d * d <= p; ++d) {
        if (p % d == 0) return false;
      }
      return true;
    };
    do {
      ++prime_;
    } while (!is_prime(prime_));
    const double root = std::sqrt(prime_);
    steps_.push_back(static_cast<std::uint64_t>((root - std::floor(root)) * 0x1p52) << 12);
  }

  std::uint64_t point_;
  std::size_t coordinate_ = 0;
  int prime_ = 1;
  std::vector<std::uint64_t> steps_;  ///< one for each coordinate, in units of 2^-64
};

/// Meaning of the coordinates of a tangent space, and the range of the angle.
struct ContractCoordinates {
  std::vector<bool> angular;      ///< a whole turn along it comes back
  std::vector<bool> logarithmic;  ///< matrices grow exponentially along it
  bool hasAngle() const { return std::find(angular.begin(), angular.end(), true) != angular.end(); }

  /// A vector whose angular coordinates have the norm `angle` and whose others have the norm `length`; without angular
  /// coordinates its norm is their product (or the one that is not zero). Logarithms are brought within ±1.
  Eigen::VectorXd draw(ContractSequence& sequence, double angle, double length) const {
    const Eigen::Index n = static_cast<Eigen::Index>(angular.size());
    Eigen::VectorXd v(n);
    double angular_sum = 0, other_sum = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      v[i] = sequence.coordinate();
      (angular[static_cast<std::size_t>(i)] ? angular_sum : other_sum) += v[i] * v[i];
    }
    if (angular_sum == 0) length = length > 0 ? length * angle : angle;
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      v[i] *= angular[k] ? angle / std::sqrt(angular_sum) : length / std::sqrt(other_sum);
      if (logarithmic[k]) v[i] /= 1 + std::abs(v[i]);
    }
    return v;
  }
  /// The norm of the angular coordinates; of them all if there are none.
  double angularNorm(const Eigen::VectorXd& v) const {
    if (!hasAngle()) return v.norm();
    double sum = 0;
    for (std::size_t i = 0; i < angular.size(); ++i) {
      const double x = v[static_cast<Eigen::Index>(i)];
      if (angular[i]) sum += x * x;
    }
    return std::sqrt(sum);
  }
};

/// Angles by decades from 1e-12 up, some in between, and by decades down to the limit (1e-12 below it, 1e-5 if eps is
/// that of a float).
inline std::vector<double> sweptAngles(double limit, double eps) {
  std::vector<double> angles;
  for (int k = 12; k > 0; --k) angles.push_back(std::pow(10, -k));
  if (!(limit < 1e9)) {
    angles.insert(angles.end(), {0.5, 1, 3, 10});
    return angles;
  }
  for (const double s : {0.25, 0.5, 0.75, 0.9}) angles.push_back(s * limit);
  for (int k = 1; k <= (eps > 1e-10 ? 5 : 12); ++k) angles.push_back(limit - std::pow(10, -k));
  return angles;
}

}  // namespace liestat::detail
