// The iterations and tests of robust means, compiled once.
#ifndef LIESTAT_COMPILED_MEANS
#define LIESTAT_COMPILED_MEANS
#endif
#include <stats/detail/robust_core_definitions.hpp>
