// How constrained estimation and the implicit filter are compiled. Their headers hold templates over parameter,
// measurements and equations; the cores behind them, which are none, are compiled once by the CMake target
// liestat::estimation, or by a project that compiles the sources of that target itself and defines
// LIESTAT_COMPILED_ESTIMATION for all of its units, as the target does. With LIESTAT_HEADER_ONLY defined for all units the
// headers include the cores and nothing is linked.
//
// A unit with neither may include the headers and use the types. A call of an estimator is an error at compile time that
// names the target and the macro, rather than an undefined symbol.
#pragma once

/// The linkage of definitions.
#ifdef LIESTAT_HEADER_ONLY
#define LIESTAT_ESTIMATION_INLINE inline
#else
#define LIESTAT_ESTIMATION_INLINE
#endif

/// They stand before the declarations of estimators. g++ diagnoses a call, clang any use outside of a function that is
/// marked itself: clang 14 overlooks calls that may throw with the attribute of g++.
#ifdef __clang__
#define LIESTAT_NOT_LINKED(target)                                                                               \
  __attribute__((unavailable("liestat: link the CMake target " target ", or define LIESTAT_HEADER_ONLY for all " \
                             "units")))
#else
#define LIESTAT_NOT_LINKED(target) \
  [[gnu::error("liestat: link the CMake target " target ", or define LIESTAT_HEADER_ONLY for all units")]]
#endif
#if defined(LIESTAT_HEADER_ONLY) || defined(LIESTAT_COMPILED_ESTIMATION)
#define LIESTAT_ESTIMATION_API
#else
#define LIESTAT_ESTIMATION_API LIESTAT_NOT_LINKED("liestat::estimation")
#endif
