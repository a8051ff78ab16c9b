// How the estimators of fusion/ are compiled. Their headers declare them and, as long as nothing is said, include the
// definitions, so that nothing has to be linked. With LIESTAT_COMPILED_FUSION defined the headers declare only: a unit
// that calls an estimator compiles in a fraction of the time, and those of fusion/compiled/ hold them all.
#pragma once

#ifdef LIESTAT_COMPILED_FUSION
#define LIESTAT_FUSION_INLINE
#else
#define LIESTAT_FUSION_INLINE inline
#endif
