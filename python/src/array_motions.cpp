// Operations of rigid motions as groups on arrays.
#include <python/src/manifold_operations.hpp>

#include <lie/se2.hpp>
#include <lie/se23.hpp>
#include <lie/se3.hpp>

namespace liestat::python {

ArrayType so2Operations() { return groupOperations<SO2d>("SO2"); }
ArrayType se2Operations() { return groupOperations<SE2d>("SE2"); }
ArrayType se3Operations() { return groupOperations<SE3d>("SE3"); }
ArrayType se23Operations() { return groupOperations<SE23d>("SE23"); }

}  // namespace liestat::python
