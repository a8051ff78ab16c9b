// The manifolds' operations, and what is derived from them: groups acting on themselves, directions, frames and their
// quotients.
#include "suite.hpp"

#include <lie/lie.hpp>

namespace liestat::bench {
namespace {

[[maybe_unused]] const bool registered = [] {
  manifoldSuite<SO2d>("SO2");
  manifoldSuite<SO3d>("SO3");
  manifoldSuite<SE2d>("SE2");
  manifoldSuite<SE3d>("SE3");
  manifoldSuite<S2d>("S2");
  manifoldSuite<Frame2d>("Frame2");
  manifoldSuite<Frame3d>("Frame3");
  manifoldSuite<SemiOrientedFrame3d>("SemiOrientedFrame3");
  manifoldSuite<NonOrientedFrame3d>("NonOrientedFrame3");
  return true;
}();

}  // namespace
}  // namespace liestat::bench
