// LIESTAT_FUSION_INLINE, the linkage of the estimators of fusion/. By default their headers include the definitions, as
// inline functions: nothing has to be linked. With LIESTAT_COMPILED_FUSION the headers only declare, which compiles in
// a fraction of the time, and the program links the definitions of fusion/compiled/.
#pragma once

#ifdef LIESTAT_COMPILED_FUSION
#define LIESTAT_FUSION_INLINE
#else
#define LIESTAT_FUSION_INLINE inline
#endif
