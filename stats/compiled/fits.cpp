// The fits of common models, compiled once.
#ifndef LIESTAT_COMPILED_ESTIMATION
#define LIESTAT_COMPILED_ESTIMATION
#endif

#include <stats/detail/fit_summary.hpp>
