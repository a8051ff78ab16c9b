// As many doubles as the target's registers hold. Written with the vectors of g++ and clang, which need no header and
// no flag; elsewhere one at a time.
#pragma once

#include <cstddef>
#include <cstring>

namespace liestat::detail {

#if defined(__GNUC__) && defined(__AVX512F__)
typedef double Pack __attribute__((vector_size(64)));
#elif defined(__GNUC__) && defined(__AVX__)
typedef double Pack __attribute__((vector_size(32)));
#elif defined(__GNUC__)
typedef double Pack __attribute__((vector_size(16)));
#else
using Pack = double;
#endif
inline constexpr std::size_t pack_size = sizeof(Pack) / sizeof(double);

inline Pack loadPack(const double* p) {
  Pack v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline void storePack(double* p, const Pack& v) { std::memcpy(p, &v, sizeof v); }
inline double sumOf(const Pack& v) {
  double lanes[pack_size], sum = 0;
  storePack(lanes, v);
  for (const double x : lanes) sum += x;
  return sum;
}
inline double largestOf(const Pack& v) {
  double lanes[pack_size];
  storePack(lanes, v);
  double largest = lanes[0];
  for (const double x : lanes) largest = x > largest ? x : largest;
  return largest;
}
inline Pack absolute(const Pack& v) { return v < 0.0 ? -v : v; }
inline Pack larger(const Pack& a, const Pack& b) { return a > b ? a : b; }

}  // namespace liestat::detail
