// Constrained estimation, compiled once.
#ifndef LIESTAT_COMPILED_ESTIMATION
#define LIESTAT_COMPILED_ESTIMATION
#endif

#include <stats/detail/constrained_iteration.hpp>
