// Operations on arrays beside the same by a loop of liestat's scalar operations, by a loop with the mathematical
// library's sin, cos and atan2 (rotations), and beside reading the operands and writing the result, in turns. Prints
// Markdown, ns per element, for arrays in cache and in memory, and each set of instructions that the processor has.
#include "../inputs.hpp"
#include "../stats/interleaved.hpp"

#include <lie/arrays.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <vector>

namespace liestat::bench {
namespace {

using Vector3d = Eigen::Vector3d;

/// Reads `in` numbers of each element and writes `out`: all numbers of the operands once, as fast as the loop can.
void move(const std::vector<double>& from, std::vector<double>& to) {
  const std::size_t n = std::min(from.size(), to.size());
  for (std::size_t j = 0; j < n; ++j) to[j] = from[j];
  double sums[8] = {};
  for (std::size_t j = n; j + 8 <= from.size(); j += 8) {
    for (std::size_t l = 0; l < 8; ++l) sums[l] += from[j + l];
  }
  for (std::size_t j = n; j < to.size(); ++j) to[j] = 1;
  keep(sums);
}

void row(const char* name, std::size_t n, std::size_t in, std::size_t out, const std::function<void()>& arrays,
         const std::function<void()>& scalar, const std::function<void()>& libm) {
  std::vector<double> from(n * in, 1.0), to(n * out);
  const auto floor = [&] {
    move(from, to);
    keep(to);
  };
  std::vector<std::function<void()>> candidates{arrays, scalar, floor};
  if (libm) candidates.push_back(libm);
  const std::vector<double> ns = interleavedMedians(candidates, n > 100000 ? 9 : 101, 2e-4);
  const double size = static_cast<double>(n);
  std::printf("| %-8s | %-12s | %7zu | %7.2f | %7.2f | ", liestat::name(instructionSet()), name, n, ns[0] / size,
              ns[1] / size);
  if (libm) {
    std::printf("%7.2f | ", ns[3] / size);
  } else {
    std::printf("%7s | ", "");
  }
  std::printf("%7.2f |\n", ns[2] / size);
}

void rows(std::size_t n) {
  Inputs inputs;
  std::vector<Vector3d> v(n), w(n), p(n), q(n);
  std::vector<Eigen::Matrix<double, 6, 1>> s(n), t(n);
  std::vector<SO3d> x(n), y(n), z(n);
  std::vector<SE3d> a(n), b(n), c(n);
  std::vector<Eigen::Vector2d> p2(n), q2(n);
  std::vector<SE2d> a2(n), b2(n), c2(n);
  for (std::size_t i = 0; i < n; ++i) {
    v[i] = inputs.tangent<3>();
    p[i] = inputs.normal<3>();
    s[i] << p[i], v[i];
    x[i] = y[i] = SO3d::exp(v[i]);
    a[i] = b[i] = SE3d::exp(s[i]);
    p2[i] = p[i].head<2>();
    a2[i] = b2[i] = SE2d::exp(v[i]);
  }
  const auto loop = [n](auto& result, const auto& f) {
    return [&result, f, n] {
      for (std::size_t i = 0; i < n; ++i) result[i] = f(i);
      keep(result);
    };
  };
  const auto libm_exp = [&](std::size_t i) {
    const double angle = v[i].norm(), sine = std::sin(0.5 * angle) / angle;
    return SO3d::fromParams({sine * v[i][0], sine * v[i][1], sine * v[i][2], std::cos(0.5 * angle)});
  };
  const auto libm_log = [&](std::size_t i) {
    const Vector3d u = x[i].params().head<3>();
    const double sine = u.norm(), w4 = x[i].params()[3];
    return Vector3d(2 * std::atan2(w4 < 0 ? -sine : sine, std::abs(w4)) / sine * u);
  };
  row(
      "SO3 exp", n, 3, 4, [&] { arrays::exp<SO3d>(v, z), keep(z); },
      loop(z, [&](std::size_t i) { return SO3d::exp(v[i]); }), loop(z, libm_exp));
  row(
      "SO3 log", n, 4, 3, [&] { arrays::log<SO3d>(x, w), keep(w); }, loop(w, [&](std::size_t i) { return x[i].log(); }),
      loop(w, libm_log));
  row("SO3 product", n, 8, 4, [&] { arrays::product<SO3d>(x, y, z), keep(z); },
      loop(z, [&](std::size_t i) { return x[i] * y[i]; }), {});
  row("SO3 inverse", n, 4, 4, [&] { arrays::inverse<SO3d>(x, z), keep(z); },
      loop(z, [&](std::size_t i) { return x[i].inverse(); }), {});
  row("SO3 act", n, 7, 3, [&] { arrays::act<SO3d>(x, p, q), keep(q); },
      loop(q, [&](std::size_t i) { return Vector3d(x[i] * p[i]); }), {});
  row("SE3 exp", n, 6, 7, [&] { arrays::exp<SE3d>(s, c), keep(c); },
      loop(c, [&](std::size_t i) { return SE3d::exp(s[i]); }), {});
  row("SE3 log", n, 7, 6, [&] { arrays::log<SE3d>(a, t), keep(t); }, loop(t, [&](std::size_t i) { return a[i].log(); }),
      {});
  row("SE3 product", n, 14, 7, [&] { arrays::product<SE3d>(a, b, c), keep(c); },
      loop(c, [&](std::size_t i) { return a[i] * b[i]; }), {});
  row("SE3 act", n, 10, 3, [&] { arrays::act<SE3d>(a, p, q), keep(q); },
      loop(q, [&](std::size_t i) { return Vector3d(a[i] * p[i]); }), {});
  row("SE2 exp", n, 3, 4, [&] { arrays::exp<SE2d>(v, c2), keep(c2); },
      loop(c2, [&](std::size_t i) { return SE2d::exp(v[i]); }), {});
  row("SE2 log", n, 4, 3, [&] { arrays::log<SE2d>(a2, w), keep(w); },
      loop(w, [&](std::size_t i) { return a2[i].log(); }), {});
  row("SE2 product", n, 8, 4, [&] { arrays::product<SE2d>(a2, b2, c2), keep(c2); },
      loop(c2, [&](std::size_t i) { return a2[i] * b2[i]; }), {});
  row("SE2 act", n, 6, 2, [&] { arrays::act<SE2d>(a2, p2, q2), keep(q2); },
      loop(q2, [&](std::size_t i) { return Eigen::Vector2d(a2[i] * p2[i]); }), {});
}

int print() {
  std::printf("Operations on arrays of elements in double, ns per element; angles below 3 rad.\n\n");
  std::printf("| set      | operation    |       n |  arrays |  scalar |    libm |  memory |\n");
  std::printf("|----------|--------------|--------:|--------:|--------:|--------:|--------:|\n");
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (set > supportedInstructionSet()) continue;
    useInstructionSet(set);
    for (const std::size_t n : {std::size_t{1000}, std::size_t{1000000}}) rows(n);
  }
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
