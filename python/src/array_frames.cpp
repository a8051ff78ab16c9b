// Operations of frames and their quotients on arrays.
#include <python/src/manifold_operations.hpp>

#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/semi_oriented_frame3.hpp>

namespace liestat::python {
namespace {

template <class M>
ArrayType quotientOperations(std::string_view name) {
  ArrayType type = manifoldOperations<M>(name);
  type.operations.push_back(operation<7>(
      "canonical", {{"self", 7}}, [](const double* x, double* out) { storePoint(point<M>(x).canonical(), out); }));
  return type;
}

}  // namespace

ArrayType frameOperations() { return manifoldOperations<Frame3d>("Frame3"); }
ArrayType semiOrientedFrameOperations() { return quotientOperations<SemiOrientedFrame3d>("SemiOrientedFrame3"); }
ArrayType nonOrientedFrameOperations() { return quotientOperations<NonOrientedFrame3d>("NonOrientedFrame3"); }

}  // namespace liestat::python
