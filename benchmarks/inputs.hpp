// Random inputs of the benchmarks, the same at every run. They come from <random> alone, so that the benchmarks need
// nothing but Eigen and Google Benchmark.
#pragma once

#include <lie/manifold.hpp>
#include <lie/rn.hpp>

#include <cstddef>
#include <random>
#include <vector>

namespace liestat::bench {

class Inputs {
 public:
  explicit Inputs(unsigned seed = 1) : engine_(seed) {}

  /// Independent normal coordinates.
  template <int N>
  Eigen::Matrix<double, N, 1> normal(double sigma = 1) {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v[i] = sigma * gauss_(engine_);
    return v;
  }
  /// A tangent vector of generic size, shorter than pi.
  template <int N>
  Eigen::Matrix<double, N, 1> tangent() {
    const Eigen::Matrix<double, N, 1> v = normal<N>(0.8);
    return v.norm() > 3 ? Eigen::Matrix<double, N, 1>(v * (3 / v.norm())) : v;
  }
  /// A symmetric positive definite matrix with standard deviations around sigma, its axes anywhere.
  template <int N>
  Eigen::Matrix<double, N, N> covariance(double sigma) {
    Eigen::Matrix<double, N, N> A;
    for (int k = 0; k < N; ++k) A.col(k) = normal<N>();
    return sigma * sigma * (0.25 * Eigen::Matrix<double, N, N>::Identity() + A * A.transpose() / N);
  }
  template <Homogeneous M>
  M feature() {
    return ManifoldTraits<M>::expOrigin(tangent<ManifoldTraits<M>::DoF>());
  }
  /// n features about a common one: exp(centre, e), e normal with standard deviation sigma in each coordinate.
  template <Homogeneous M>
  std::vector<M> cloud(std::size_t n, double sigma) {
    const M centre = feature<M>();
    std::vector<M> features;
    features.reserve(n);
    for (std::size_t i = 0; i < n; ++i) features.push_back(exp(centre, normal<ManifoldTraits<M>::DoF>(sigma)));
    return features;
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> gauss_;
};

}  // namespace liestat::bench
