// Means of extended poses: rotation, position and velocity.
#include <python/src/split_of.hpp>

#include <lie/se23.hpp>

namespace liestat::python {

const MeanType* extendedPoseMeans(std::string_view name) {
  static constexpr MeanType type = meanType<SE23d>("SE23", "se23");
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
