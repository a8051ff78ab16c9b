// How the estimators of fusion/ are compiled. Their headers declare them; the definitions, in the folder detail/ of each
// subject, are compiled once by the CMake targets liestat::fusion and liestat::trajectories, or by a project that compiles
// fusion/compiled/*.cpp itself and defines LIESTAT_COMPILED_FUSION and LIESTAT_COMPILED_TRAJECTORIES for all of its units,
// as the targets do. With LIESTAT_HEADER_ONLY defined for all units the headers include the definitions and nothing is
// linked. Two views and hand-eye calibration use constrained estimation, liestat::estimation (stats/detail/compiled.hpp).
//
// A unit with neither may include the headers and use the types. A call of an estimator is an error at compile time that
// names the target and the macro, rather than an undefined symbol.
#pragma once

#include <stats/detail/compiled.hpp>

/// The linkage of definitions.
#ifdef LIESTAT_HEADER_ONLY
#define LIESTAT_FUSION_INLINE inline
#else
#define LIESTAT_FUSION_INLINE
#endif

#if defined(LIESTAT_HEADER_ONLY) || defined(LIESTAT_COMPILED_FUSION)
#define LIESTAT_FUSION_API
#else
#define LIESTAT_FUSION_API LIESTAT_NOT_LINKED("liestat::fusion")
#endif
#if defined(LIESTAT_HEADER_ONLY) || defined(LIESTAT_COMPILED_TRAJECTORIES)
#define LIESTAT_TRAJECTORIES_API
#else
#define LIESTAT_TRAJECTORIES_API LIESTAT_NOT_LINKED("liestat::trajectories")
#endif
