// SemiOrientedFrame3: a frame of R^3 whose third axis is oriented while the first two are known up to a common sign,
// such as the normal and the principal directions of a surface: Frame3 modulo {1, Rz(pi)}.
//
// Storage, tangent, action, metric: as Frame3, at the stored representative. Injectivity radius pi/2; largest rotation
// distance pi. Jacobians and covariances are promised away from the cut locus. Source: Pennec 1998, section 5.
#pragma once

#include <lie/detail/quotient_frame3.hpp>

LIESTAT_QUOTIENT_FRAME(SemiOrientedFrame3, 2)
