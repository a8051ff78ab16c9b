// The library tells bad input by NaN and infinity, in its checks and in its results. A compiler that may assume that there
// are none removes the checks without a word.
#pragma once

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "liestat: -ffinite-math-only, a part of -ffast-math, removes every check for NaN; add -fno-finite-math-only"
#endif
