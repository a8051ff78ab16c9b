// The same data in two charts, for plots and comparisons: the principal one about the origin, in which Pennec 1998
// draws, and the one about their mean. Needs Eigen alone.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/mean.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <ranges>
#include <type_traits>

namespace liestat {

/// Features in two charts. Columns are features, rows coordinates in the tangent's order.
struct ChartScatter {
  Eigen::MatrixXd principal, centred;
  Eigen::VectorXd mean;                            ///< in the principal chart
  Eigen::MatrixXd mean_covariance, dispersion;     ///< carried to the principal chart; empty where none was given
  Eigen::VectorXd barycentre, barycentre_centred;  ///< the plain mean of the coordinates of the principal chart
  /// Covariance of that plain mean from its residuals, in both charts; empty with no more features than dimensions.
  Eigen::MatrixXd barycentre_covariance, barycentre_covariance_centred;
};

namespace detail {

template <Homogeneous M, class R, class W>
ChartScatter findChartScatter(const R& features, const W& p, const M& y, const std::optional<SquareOf<M>>& dispersion,
                              const std::optional<SquareOf<M>>& covariance) {
  using T = ManifoldTraits<M>;
  constexpr int k = T::DoF;
  eigen_assert(haveOneSize(features, p));
  const auto n = static_cast<Eigen::Index>(std::ranges::size(features));
  ChartScatter s;
  s.principal.resize(k, n);
  s.centred.resize(k, n);
  TangentOf<M> sum = TangentOf<M>::Zero();
  double weight = 0;
  const auto weightOf = [&](Eigen::Index i) { return static_cast<double>(p[static_cast<std::size_t>(i)]); };
  for (Eigen::Index i = 0; i < n; ++i) {
    const M x = features[i];
    const TangentOf<M> r = T::logOrigin(x);
    s.principal.col(i) = r.template cast<double>();
    s.centred.col(i) = log(y, x).template cast<double>();
    sum += ScalarOf<M>(weightOf(i)) * r;
    weight += weightOf(i);
  }
  s.mean = T::logOrigin(y).template cast<double>();
  const SquareOf<M> J = principalChartJacobian(y);
  const auto carried = [](const SquareOf<M>& by, const SquareOf<M>& sigma) {
    return SquareOf<M>(by * sigma * by.transpose()).template cast<double>().eval();
  };
  if (dispersion) s.dispersion = carried(J, *dispersion);
  if (covariance) s.mean_covariance = carried(J, *covariance);

  const TangentOf<M> b = sum / ScalarOf<M>(weight);
  s.barycentre = b.template cast<double>();
  const M at_b = T::expOrigin(b);
  s.barycentre_centred = log(y, at_b).template cast<double>();
  if (n > k) {
    Eigen::Matrix<double, k, k> scatter = Eigen::Matrix<double, k, k>::Zero();
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Matrix<double, k, 1> d = s.principal.col(i) - s.barycentre;
      scatter += weightOf(i) * d * d.transpose();
    }
    scatter /= weight * static_cast<double>(n - 1);
    const SquareOf<M> C = errorVector(y, at_b).by_feature * T::dexpOrigin(b);
    s.barycentre_covariance = scatter;
    s.barycentre_covariance_centred = carried(C, scatter.template cast<ScalarOf<M>>());
  }
  return s;
}

}  // namespace detail

/// A range of features with their weights in both charts, y their mean, with the dispersion and the covariance of the
/// mean in the local frame at y. Covariances move with the charts' derivatives.
template <detail::AnyRange R, detail::AnyRange W, class M = detail::SampleInSignature<R>>
ChartScatter chartScatter(R&& samples, W&& weights, const std::type_identity_t<M>& y,
                          const std::optional<SquareOf<M>>& dispersion = {},
                          const std::optional<SquareOf<M>>& covariance = {}) {
  if constexpr (detail::RequireSamples<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::findChartScatter<M>(detail::asSamples(samples), detail::asWeights(weights), y, dispersion,
                                       covariance);
  } else {
    return {};
  }
}

}  // namespace liestat
