// Macros for the compilation of the estimators of fusion/. Headers declare the estimators; their definitions are in the
// folder detail/ of each subject. There are three ways to compile the definitions:
//
// - the CMake targets liestat::fusion and liestat::trajectories contain them;
// - a project compiles fusion/compiled/*.cpp itself and defines LIESTAT_COMPILED_FUSION and
//   LIESTAT_COMPILED_TRAJECTORIES in all of its units, as the targets do;
// - LIESTAT_HEADER_ONLY is defined in all units: the headers include the definitions, and nothing is linked.
//
// A unit that does none of these may include the headers and use the types. A call of an estimator is then an error at
// compile time that names the target and the macro, not an undefined symbol at link time. Two views and hand-eye
// calibration use constrained estimation, liestat::estimation (stats/detail/compiled.hpp).
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
