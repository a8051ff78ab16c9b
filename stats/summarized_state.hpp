// summarizedState: the mean of a state of sums as the result that the program shows of any mean
// (stats/mean_summary.hpp).
#pragma once

#include <stats/state.hpp>
#include <stats/summarized_mean.hpp>

#include <string>
#include <type_traits>

namespace liestat {

/// The mean, covariance, dispersion and certificates that the sums give; what only the rows could tell (farthest ones,
/// their order, skewness) is missing. `feature` is left to the caller.
template <Metric M>
MeanSummary summarizedState(const SumState<M>& state) {
  const CertifiedMean<M> found = state.finish();
  MeanSummary mean;
  mean.parts = tangentPartsOf<M>();
  mean.weighted = state.weighted();
  mean.criterion = mean.weighted ? Criterion::wlsq : Criterion::lsq;
  detail::setCertified(mean, found.mean, found);
  if (mean.n > 0) mean.dispersion = found.mean.dispersion();
  if constexpr (std::is_same_v<M, S2d>) {
    mean.tangent_basis = ManifoldTraits<M>::placement(found.mean.mean).matrix().template leftCols<2>();
  }
  mean.notes.emplace_back("from sums over " + std::to_string(state.pass() + 1) +
                          " passes: the rows' order, skewness and farthest ones are not looked at");
  if (state.left_out() > 0) {
    mean.notes.push_back(std::to_string(state.left_out()) + (state.left_out() == 1 ? " row is" : " rows are") +
                         " not finite or not of unit norm, and left out");
  }
  return mean;
}

}  // namespace liestat
