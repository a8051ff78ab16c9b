// The implicit filter, compiled once.
#ifndef LIESTAT_COMPILED_ESTIMATION
#define LIESTAT_COMPILED_ESTIMATION
#endif

#include <stats/detail/filter_dense.hpp>
#include <stats/detail/filter_sums.hpp>
