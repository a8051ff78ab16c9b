// The definition of fusion/init/consensus.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/motion_consensus.hpp>
#include <fusion/init/consensus.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

namespace detail {

/// The features of a solution whose squared angles are too large for noise, by χ²: what drifts slowly passes the limit
/// of a hypothesis. Where most are larger than noise the motion is to blame, such as a bias: their median is the
/// scale.
inline std::vector<std::size_t> misfits(const ClosedFormResult& result, const InitialisationOptions& options) {
  std::vector<std::size_t> used;
  std::vector<double> relative;
  const auto freedom = [&](std::size_t i) { return 2 * static_cast<double>(result.features[i].observations) - 3; };
  for (std::size_t i = 0; i < result.features.size() && !result.solutions.empty(); ++i) {
    const ClosedFormFeature& feature = result.features[i];
    if (!feature.used || !(freedom(i) > 0)) continue;
    const double angle = feature.residual / (feature.relative_sigma * options.bearing_noise);
    used.push_back(i);
    relative.push_back(angle * angle * static_cast<double>(feature.observations) / freedom(i));
  }
  const double scale = std::max(1., median(relative));
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < used.size(); ++k) {
    const double limit = 1 + options.consensus.misfit_sigmas * std::sqrt(2 / freedom(used[k]));
    if (relative[k] > scale * limit) found.push_back(used[k]);
  }
  return found;
}

}  // namespace detail

LIESTAT_FUSION_INLINE ConsensusResult solveClosedFormRobustly(const ClosedFormWindow& window,
                                                              const InitialisationOptions& options) {
  ConsensusResult robust;
  ClosedFormResult& result = robust.result;
  const ConsensusOptions& own = options.consensus;
  result.fault = detail::faultOf(window, options);
  if (!result.fault && (!(options.bearing_noise > 0) || !(own.max_residual > 0) || own.features_drawn == 0 ||
                        !(own.misfit_sigmas > 0) || !(own.confidence >= 0 && own.confidence < 1))) {
    result.fault = FaultKind::bad_option;
  }
  if (result.fault) return robust;
  detail::RayTable table = detail::rayTable(window, result);
  std::vector<bool> agreeing(table.features(), true);
  if (table.features() > 0) {
    detail::MotionConsensus consensus(table, result, options);
    if (consensus.possible()) {
      CounterRng random(own.seed);
      robust.hypotheses = consensus.search(random);
      agreeing.assign(table.features(), false);
      if (consensus.found()) agreeing = consensus.agreeing();
    }
  }
  ClosedFormWindow kept = window;
  const bool found = std::find(agreeing.begin(), agreeing.end(), true) != agreeing.end();
  for (std::size_t i = 0; i < table.features(); ++i) {
    const std::size_t feature = table.feature[i];
    (agreeing[i] ? robust.inliers : robust.outliers).push_back(feature);
    // A feature without observations keeps its place.
    if (found && !agreeing[i]) kept.features[feature].clear();
  }
  result = solveClosedForm(kept, options);
  if (robust.hypotheses == 0 || !found) return robust;
  for (std::size_t pass = 0; pass < own.local_passes; ++pass) {
    const std::vector<std::size_t> wrong = detail::misfits(result, options);
    if (wrong.empty() || robust.inliers.size() < wrong.size() + own.features_drawn) break;
    for (const std::size_t i : wrong) {
      kept.features[i].clear();
      robust.inliers.erase(std::find(robust.inliers.begin(), robust.inliers.end(), i));
      robust.outliers.push_back(i);
    }
    result = solveClosedForm(kept, options);
  }
  std::sort(robust.outliers.begin(), robust.outliers.end());
  for (const std::size_t i : robust.outliers) result.features[i].observations = window.features[i].size();
  return robust;
}

}  // namespace liestat
