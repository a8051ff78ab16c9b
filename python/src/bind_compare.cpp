// Comparisons of groups for Python.
#include <formats/feature.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <stats/compare_groups.hpp>

#include <pybind11/stl.h>

#include <cstdint>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

template <class M>
std::vector<M> featuresIn(const DoubleArray& params) {
  std::vector<M> list;
  const auto width = params.shape(1);
  for (py::ssize_t i = 0; i < params.shape(0); ++i) {
    const double* const row = params.data() + i * width;
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      list.push_back(Eigen::Map<const M>(row));
    } else {
      list.push_back(M::fromParams(Eigen::Map<const typename M::Params>(row)));
    }
  }
  return list;
}

py::dict compareArrays(const std::string& feature, const std::vector<DoubleArray>& arrays,
                       const std::vector<std::string>& names, bool paired, double level, std::uint64_t seed) {
  ComparisonOptions options;
  options.level = level, options.seed = seed;
  GroupComparison found = withFeature(*featureFromName(feature), [&]<class M>() {
    std::vector<std::vector<M>> groups;
    for (const DoubleArray& array : arrays) groups.push_back(featuresIn<M>(array));
    const py::gil_scoped_release released;
    return paired ? comparePairs(groups[0], groups[1], options) : compareGroups(groups, options);
  });
  for (std::size_t i = 0; i < found.groups.size(); ++i) found.groups[i].name = names[i];
  return dictOf(found);
}

}  // namespace

void bindComparisons(py::module_& module) { module.def("compare", &compareArrays); }

}  // namespace liestat::python
