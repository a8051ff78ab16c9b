// NonOrientedFrame3: a frame of R^3 whose three axes are known up to sign, such as the principal axes of a body:
// Frame3 modulo the four-group {1, Rx(pi), Ry(pi), Rz(pi)}.
//
// Storage, tangent, action, metric: as Frame3, at the stored representative. Injectivity radius pi/2; largest rotation
// distance 2 pi/3. Jacobians and covariances are promised away from the cut locus. Source: Pennec 1998, section 5.
#pragma once

#include <lie/detail/quotient_frame3.hpp>

LIESTAT_QUOTIENT_FRAME(NonOrientedFrame3, 0, 1, 2)
