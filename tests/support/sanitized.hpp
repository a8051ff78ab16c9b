// A flag by which sanitized tests leave trials out: sanitizers look for faults of the code, which a tenth of the trials
// shows as well; statistics are judged without them.
#pragma once

namespace liestat_test {

#ifdef LIESTAT_SANITIZED
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

/// The number of trials, a tenth of it under sanitizers.
constexpr int trialsOf(int trials) { return sanitized ? trials / 10 : trials; }

}  // namespace liestat_test
