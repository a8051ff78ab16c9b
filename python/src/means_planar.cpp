// Means of rigid motions of the plane.
#include <python/src/split_of.hpp>

#include <lie/frame2.hpp>
#include <lie/se2.hpp>

namespace liestat::python {

const MeanType* planarMeans(std::string_view name) {
  static constexpr MeanType type = meanType<SE2d>("SE2", "se2");
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
