// A manifold's side of the search of stats/detail/uniqueness_search.hpp: features to points of the space that is
// searched, and from those back to means of the features themselves.
#pragma once

#include <stats/detail/uniqueness_search.hpp>
#include <stats/executor.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness_types.hpp>

#include <algorithm>
#include <limits>
#include <vector>

namespace liestat::detail {

/// The features of one call of uniqueness(), with the best mean so far and its rivals.
template <Metric M, class Space, Executor E, class R, class W>
class SearchedManifold final : public SearchedMean<Space> {
 public:
  using typename SearchedMean<Space>::Point;
  using typename SearchedMean<Space>::Found;

  SearchedManifold(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean)
      : executor_(executor), samples_(samples), weights_(weights), space_(searchSpace(mean.mean)), base_(mean) {}

  UniquenessResult<M> certify(const UniquenessOptions& options) {
    if (!converged(base_.status)) {
      // An iteration that ran out of steps: go on from where it stands.
      last_ = meanFrom(base_.mean);
      if (converged(last_.status) && last_.cost <= base_.cost) takeAsBase();
    }
    const double eps = static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon());
    const SearchVerdict verdict = UniquenessSearch<Space, E>(executor_, *this,
                                                             {.tie = std::max(options.tie_tolerance, 64 * eps),
                                                              .a_priori_radius = aPrioriRadius(base_.mean),
                                                              .base_converged = converged(base_.status),
                                                              .branch_and_bound = options.branch_and_bound,
                                                              .budget = options.budget,
                                                              .max_rivals = options.max_rivals,
                                                              .progress = options.progress,
                                                              .stop = options.stop})
                                      .run();
    return {verdict.unique, base_.mean,    improved_,     base_.cost,         rivals_,
            verdict.r_star, verdict.cells, verdict.proof, verdict.more_rivals};
  }

  PackedData<Space> data() const override { return pack(space_, samples_, weights_, base_.mean); }
  Found iterate(const Point& start) override {
    last_ = meanFrom(featureAt(space_, base_.mean, start));
    return {converged(last_.status), last_.cost < base_.cost,
            relativePoint<Space>(ManifoldTraits<M>::placement(base_.mean).inverse(), last_.mean),
            (static_cast<std::size_t>(last_.iterations) + 1) * last_.n};
  }
  void takeAsBase() override {
    base_ = last_;
    improved_ = true;
    rivals_.clear();
  }
  void keepAsRival() override { rivals_.push_back(last_.mean); }
  void addRival(const Point& point) override { rivals_.push_back(featureAt(space_, base_.mean, point)); }

 private:
  MeanResult<M> meanFrom(const M& start) const {
    MeanOptions<M> options;
    options.start = start;
    return frechetMean<M>(executor_, samples_, weights_, options);
  }

  const E& executor_;
  const R& samples_;
  const W& weights_;
  Space space_;
  MeanResult<M> base_, last_;
  bool improved_ = false;
  std::vector<M> rivals_;
};

}  // namespace liestat::detail
