// The splits behind means.hpp, for one type.
#pragma once

#include <python/src/mean_of.hpp>
#include <stats/summarized_mean_splits.hpp>

#include <vector>

namespace liestat::python {

template <class M>
SplitSummary splitOf(const MeanRequest& request, SignalWatch& signals, const SplitOptions& options) {
  const Features<M> features(request.features);
  return splitMean(PythonExecutor{request.threads, &signals}, inputOf(request, features.list()),
                   std::vector<double>(request.times.begin(), request.times.end()), options);
}

}  // namespace liestat::python
