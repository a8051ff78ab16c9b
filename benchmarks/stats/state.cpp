// Order-free sums of states: ns a row in cache, for each set of instructions, and µs to finish one. Prints Markdown.
#include "../inputs.hpp"
#include "interleaved.hpp"

#include <lie/lie.hpp>
#include <stats/state.hpp>

#include <cstddef>
#include <cstdio>
#include <vector>

namespace liestat::bench {
namespace {

template <class M>
void row(const char* name, InstructionSet set) {
  constexpr std::size_t n = 4096;
  const std::vector<M> data = Inputs().cloud<M>(n, 0.2);
  const std::vector<double> weights(n, 0.5);
  useInstructionSet(set);
  MomentState<M> moments;
  SumState<M> sums(data[0]);
  // As many rows as a state takes would be reached.
  const auto onto = [&](const auto& empty, const std::vector<double>& p) {
    auto state = empty;
    state.add(data, p);
    keep(state);
  };
  const std::vector<double> ns = interleavedMedians({[&] { onto(moments, {}); }, [&] { onto(moments, weights); },
                                                     [&] { onto(sums, {}); }, [&] { onto(sums, weights); },
                                                     [&] {
                                                       MomentState<M> state;
                                                       for (const M& x : data) state.add(x);
                                                       keep(state);
                                                     },
                                                     [&] {
                                                       SumState<M> state(data[0]);
                                                       for (const M& x : data) state.add(x);
                                                       keep(state);
                                                     }},
                                                    31, 1e-3);
  std::printf("| %-10s | %-8s | %7.1f | %17.1f | %4.1f | %14.1f | %10.0f, %4.0f |\n", name, liestat::name(set),
              ns[0] / n, ns[1] / n, ns[2] / n, ns[3] / n, ns[4] / n, ns[5] / n);
  std::fflush(stdout);
}

int print() {
  std::printf("| rows       | set      | moments | moments, weighted | sums | sums, weighted | one by one |\n");
  std::printf("|------------|----------|--------:|------------------:|-----:|---------------:|-----------:|\n");
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (set > supportedInstructionSet()) continue;
    row<SO2d>("headings", set);
    row<S2d>("directions", set);
    row<SO3d>("rotations", set);
  }
  const std::vector<SO3d> data = Inputs().cloud<SO3d>(4096, 0.2);
  MomentState<SO3d> moments;
  moments.add(data);
  SumState<SO3d> sums(moments.finish().mean);
  sums.add(data);
  const std::vector<double> ns =
      interleavedMedians({[&] { keep(moments.finish()); }, [&] { keep(SumState<SO3d>(sums.finish().mean.mean)); },
                          [&] { keep(SumState<SO3d>::fromBytes(sums.bytes())); }},
                         31, 1e-3);
  std::printf("\nTo finish rotations: moments %.2f µs, sums %.2f µs; to read the bytes of sums %.2f µs.\n", ns[0] / 1e3,
              ns[1] / 1e3, ns[2] / 1e3);
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
