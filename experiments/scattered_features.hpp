#pragma once

// Features drawn from laws that are as scattered as one likes, for the promises about means of scattered data.

#include <lie/lie.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// The angle of a rotation of the matrix Fisher law with F = κ/2 · I, whose density is as exp(κ cos θ) against Haar's
/// measure, or of von Mises' law: by inversion of a table.
class AngleTable {
 public:
  /// Density on (from, π) up to a factor.
  template <class Density>
  AngleTable(double from, const Density& density) : from_(from), cumulated_(size + 1) {
    double sum = 0;
    for (int i = 0; i < size; ++i) {
      cumulated_[static_cast<std::size_t>(i) + 1] = sum += density(from + (i + 0.5) * step());
    }
    for (double& c : cumulated_) c /= sum;
  }
  double draw(CounterRng& rng) const {
    const double u = rng.uniform();
    const auto above = std::upper_bound(cumulated_.begin() + 1, cumulated_.end() - 1, u);
    const double low = *(above - 1);
    const double at = static_cast<double>(above - 1 - cumulated_.begin()) + (u - low) / (*above - low);
    return from_ + at * step();
  }

 private:
  static constexpr int size = 4000;
  double step() const { return (static_cast<double>(EIGEN_PI) - from_) / size; }
  double from_;
  std::vector<double> cumulated_;
};

/// Von Mises' law on the circle, von Mises and Fisher's on the sphere, the matrix Fisher law on rotations, folded on
/// quotient frames, about the origin with concentration κ; positions N(0, 1); products by factors.
template <class M>
class FisherLaw {
 public:
  explicit FisherLaw(double kappa)
      : kappa_(kappa),
        rotation_(0, [&](double t) { return (1 - std::cos(t)) * std::exp(kappa * (std::cos(t) - 1)); }),
        circle_(-static_cast<double>(EIGEN_PI), [&](double t) { return std::exp(kappa * (std::cos(t) - 1)); }) {}

  M draw(CounterRng& rng) const { return drawOf<M>(rng); }

 private:
  template <class F>
  F drawOf(CounterRng& rng) const {
    if constexpr (Factored<F>) {
      using Factors = std::decay_t<decltype(ManifoldTraits<F>::factors(std::declval<const F&>()))>;
      return [&]<std::size_t... I>(std::index_sequence<I...>) {
        // Braces: drawn in order.
        return F(ManifoldTraits<F>::fromFactors(Factors{drawOf<std::tuple_element_t<I, Factors>>(rng)...}));
      }
      (std::make_index_sequence<std::tuple_size_v<Factors>>{});
    } else if constexpr (std::is_same_v<F, S2d>) {
      const double u = rng.uniform(), turn = rng.uniform(0, 2 * static_cast<double>(EIGEN_PI));
      const double c = kappa_ < 1e-9 ? 2 * u - 1 : 1 + std::log(u + (1 - u) * std::exp(-2 * kappa_)) / kappa_;
      const double s = std::sqrt(std::max(0.0, 1 - c * c));
      return S2d(s * std::cos(turn), s * std::sin(turn), c);
    } else if constexpr (std::is_same_v<F, SO2d>) {
      return SO2d(circle_.draw(rng));
    } else if constexpr (std::is_same_v<F, Frame2d>) {
      const Eigen::Vector2d translation = rng.normalVector<2>();
      return Frame2d(SO2d(circle_.draw(rng)), translation);
    } else if constexpr (std::is_same_v<F, SO3d>) {
      return drawRotation(rng);
    } else if constexpr (std::is_same_v<F, Eigen::Vector3d>) {
      return rng.normalVector<3>();
    } else {
      const Eigen::Vector3d translation = rng.normalVector<3>();
      return F(drawRotation(rng), translation);
    }
  }
  /// One draw in an expression: in which order the operands of a product are evaluated is the compiler's choice.
  SO3d drawRotation(CounterRng& rng) const {
    const Eigen::Vector3d axis = rng.unitVector<3>();
    return SO3d::exp(rotation_.draw(rng) * axis);
  }

  double kappa_;
  AngleTable rotation_, circle_;
};

}  // namespace liestat::experiments
