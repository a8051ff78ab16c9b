// The operations of the groups with a scale, and of extended poses.
#include "suite.hpp"

#include <lie/se23.hpp>
#include <lie/sim2.hpp>
#include <lie/sim3.hpp>

namespace liestat::bench {
namespace {

[[maybe_unused]] const bool registered = [] {
  groupSuite<RxSO2d>("RxSO2");
  groupSuite<RxSO3d>("RxSO3");
  groupSuite<Sim2d>("Sim2");
  groupSuite<Sim3d>("Sim3");
  groupSuite<SE23d>("SE23");
  return true;
}();

}  // namespace
}  // namespace liestat::bench
