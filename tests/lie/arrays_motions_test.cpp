// Arrays of rigid motions of space.
#include "support/array_checks.hpp"

namespace liestat::test {

using Motions = testing::Types<SE3d, SE3f>;
INSTANTIATE_TYPED_TEST_SUITE_P(Motions, ArrayChecks, Motions);

}  // namespace liestat::test
