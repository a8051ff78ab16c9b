// Functions that kernels for other instruction sets call must become part of them, whatever the optimisation: a copy of
// their own would be compiled for the unit's instructions, and would take vectors another way.
#pragma once

#if defined(__GNUC__)
#define LIESTAT_ALWAYS_INLINE __attribute__((always_inline)) inline
// Nor copied for one caller: a copy belongs to its unit, and has the bits of the unit's flags.
#if defined(__clang__)
#define LIESTAT_NO_INLINE __attribute__((noinline))
#else
#define LIESTAT_NO_INLINE __attribute__((noinline, noclone))
#endif
#else
#define LIESTAT_ALWAYS_INLINE inline
#define LIESTAT_NO_INLINE
#endif

// Before a loop of a fixed few turns, whose arrays become registers; clang unrolls those by itself.
#if defined(__GNUC__) && !defined(__clang__)
#define LIESTAT_UNROLL _Pragma("GCC unroll 32")
#else
#define LIESTAT_UNROLL
#endif
