// robustMean: the geodesic median and Huber's mean of features, with a covariance that outliers do not break. Needs
// Eigen alone.
//
// The criterion is Σ_b Σ_i ρ(d_b(y, x_i)/s_b): each part b of the metric, translation, rotation or direction, has its
// own distance d_b and scale s_b, so that no length stands for a radian. ρ is the distance itself (median: Weiszfeld's
// iteration with the step of Vardi and Zhang 2000 at data) or Huber's. Docs: docs/robust_means.md.
#pragma once

#include <lie/manifold.hpp>
#include <stats/concentration.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/robust_core.hpp>
#include <stats/gaussian.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <cstddef>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <ranges>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// A robust mean with its covariance. Matrices are in the local frame at the mean.
template <Metric M>
struct RobustMean {
  M mean = ManifoldTraits<M>::origin();
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
  std::size_t n = 0;
  int iterations = 0;
  double residual = 0;   ///< intrinsic norm of the last step
  double tolerance = 0;  ///< the iteration stops below it
  double cost = 0;       ///< Σ ρ: of the median in rad and m, of Huber's mean in units of the scales squared
  /// The measurements' scale along an axis, rad or m, one for each part of the tangent vector: the median distance from
  /// the geodesic median divided by that of the standard normal law.
  std::vector<double> scales = {};
  /// All data lie in a ball in which the criterion has one minimum (Afsari 2011).
  bool unique = false;
  const char* proof = "";                    ///< of that, in words
  std::vector<RobustOutlier> outliers = {};  ///< those with a family-wise p below 0.05, the surest first
  /// The centre of the bulk by a redescending estimate (Tukey's), from the mean: where it differs by more than chance
  /// the outliers are not symmetric about the mean, which is biased then.
  TangentOf<M> shift = TangentOf<M>::Zero();
  double shift_p = 1;           ///< the probability of so large a shift if the errors are symmetric
  std::optional<M> rival = {};  ///< another minimum that the data do not exclude
  double rival_z = 0;           ///< by how many standard deviations it is the worse
  /// The mean with its covariance, Hotelling's law of n; none unless status is ok.
  std::optional<Gaussian<M>> estimate = {};
};

namespace detail {

/// The parts of the metric of M; one of all coordinates where the traits name none.
template <Metric M>
std::vector<TangentBlock> robustParts() {
  if constexpr (HasTangentParts<M>) {
    return {std::begin(ManifoldTraits<M>::tangent_parts), std::end(ManifoldTraits<M>::tangent_parts)};
  } else {
    return {{TangentPart::point, 0, ManifoldTraits<M>::DoF}};
  }
}

/// The data as residuals about a centre that moves.
template <Metric M, class R>
class RobustSamples final : public RobustData {
 public:
  RobustSamples(const R& samples, M start) : samples_(samples), centre_(std::move(start)) {
    parts = robustParts<M>();
    n = std::ranges::size(samples);
    dimension = ManifoldTraits<M>::DoF;
    const double size = static_cast<double>(ManifoldTraits<M>::logOrigin(centre_).norm());
    precision = 4 * static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon()) * (1 + size);
  }
  std::unique_ptr<RobustData> at(const Vector& v) const override {
    return std::make_unique<RobustSamples>(samples_, moved(v));
  }
  void move(const Vector& v) override { centre_ = moved(v); }
  Vector to(const RobustData& other) const override {
    return log(centre_, static_cast<const RobustSamples&>(other).centre_).template cast<double>();
  }
  void residuals(const Vector& v, std::size_t stride, Matrix& z) const override {
    using T = ManifoldTraits<M>;
    const M y = moved(v);
    const auto to_y = T::placement(y).inverse();
    const SquareOf<M> turn = frameTransport(centre_, y);
    z.resize(dimension, static_cast<Eigen::Index>((n + stride - 1) / stride));
    for (std::size_t i = 0, c = 0; i < n; i += stride, ++c) {
      const TangentOf<M> r = turn.transpose() * T::logOrigin(T::act(to_y, M(samples_[i])));
      z.col(static_cast<Eigen::Index>(c)) = r.template cast<double>();
    }
  }
  double injectivityRadius(TangentPart part) const override {
    return isAngular(part) ? static_cast<double>(injectivityRadiusAt(centre_)) : infinite_radius;
  }
  const M& centre() const { return centre_; }
  M moved(const Vector& v) const {
    return v.isZero(0) ? centre_ : M(exp(centre_, TangentOf<M>(v.template cast<ScalarOf<M>>())));
  }

 private:
  const R& samples_;
  M centre_;
};

}  // namespace detail

/// The geodesic median or Huber's mean of features. Without features too_few; with fewer than 20, too few to tell
/// outliers on one side from noise, or no more than twice the dimension, too_few with a mean but without a covariance.
/// Features that are not finite: not_converged. `inconsistent`: the outliers are not symmetric about the mean, such as
/// a second population. `ambiguous`: another minimum explains the data as well. `ill_defined`: more than half of the
/// features are equal, or they are as scattered as uniform ones.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
RobustMean<M> robustMean(R&& features, RobustLoss loss = RobustLoss::huber, const RobustOptions& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    const auto samples = detail::asSamples(features);
    RobustMean<M> result;
    result.n = samples.size();
    if (result.n == 0) return result.reason = "there are no features", result;
    detail::RobustSamples<M, std::remove_cvref_t<decltype(samples)>> data(
        samples, startOfMean<M>(SerialExecutor{}, samples, detail::UnitWeights{}));
    const detail::RobustCentre found = detail::robustCentre(data, loss, options);
    result.mean = data.centre();
    result.status = found.status, result.reason = found.reason;
    if (result.status == Status::ok &&
        !detail::findConcentration(samples, detail::UnitWeights{}, result.mean).concentrated) {
      result.status = Status::ill_defined;
      result.reason = "the features are as scattered as uniform ones: they have no mean, or too few of them show it";
    }
    result.iterations = found.iterations, result.residual = found.residual, result.tolerance = found.tolerance;
    result.cost = found.cost, result.scales = found.scales;
    result.unique = found.proof[0] != '\0', result.proof = found.proof;
    result.outliers = found.outliers;
    if (found.shift.size() > 0) result.shift = found.shift.template cast<ScalarOf<M>>();
    result.shift_p = found.shift_p;
    if (found.rival.size() > 0) result.rival = data.moved(found.rival), result.rival_z = found.rival_z;
    if (result.status == Status::ok) {
      result.estimate = Gaussian<M>{result.mean, SquareOf<M>(found.covariance.template cast<ScalarOf<M>>())};
    }
    return result;
  } else {
    return {};
  }
}

}  // namespace liestat
