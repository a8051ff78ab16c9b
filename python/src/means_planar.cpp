// Means of rotations and rigid motions of the plane.
#include <python/src/split_of.hpp>

#include <lie/frame2.hpp>
#include <lie/se2.hpp>
#include <lie/so2.hpp>

namespace liestat::python {

const MeanType* planarMeans(std::string_view name) {
  static constexpr MeanType types[] = {meanType<SO2d>("SO2", "heading"), meanType<SE2d>("SE2", "se2")};
  for (const MeanType& type : types) {
    if (name == type.name) return &type;
  }
  return nullptr;
}

}  // namespace liestat::python
