// eᵀ C⁻¹ e for matrices whose size is known at run time.
#pragma once

#include <lie/detail/small_orthogonal.hpp>

#include <vector>

namespace liestat_test {

inline double mahalanobisSquared(const liestat::detail::SmallMatrix& covariance, const std::vector<double>& error) {
  const liestat::detail::Triangle root = liestat::detail::Triangle::cholesky(covariance);
  double sum = 0;
  std::vector<double> x;
  for (int i = 0; i < static_cast<int>(error.size()); ++i) {
    double value = error[static_cast<std::size_t>(i)];
    for (int k = 0; k < i; ++k) value -= root.r(k, i) * x[static_cast<std::size_t>(k)];
    x.push_back(value / root.r(i, i));
    sum += x.back() * x.back();
  }
  return sum;
}

}  // namespace liestat_test
