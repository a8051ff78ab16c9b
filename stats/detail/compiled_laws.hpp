// The declarations of liestat::laws: an error that names the target where it is not linked.
#pragma once

#include <stats/detail/compiled.hpp>

#if defined(LIESTAT_COMPILED_LAWS)
#define LIESTAT_LAWS_API
#else
#define LIESTAT_LAWS_API LIESTAT_NOT_LINKED("liestat::laws")
#endif
