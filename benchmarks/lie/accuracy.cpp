// Worst and mean error of every operation of every group against 50 digits, and where the worst was: over all decades
// of the angle to pi, and of the scale where there is one. The Frobenius norm of the error, for a tangent whose
// translation has norm one, relative where the result is larger than one.

#include <support/high_precision.hpp>

using namespace liestat_test;

namespace {

template <class S>
void printAll() {
  const char* scalar = is_float<S> ? "float" : "double";
  const auto row = [&](const char* name, const Table& table) { print(name, scalar, table); };
  const auto rigid = [&](const char* name, auto group, int translation) {
    Table table;
    sweepGroup<decltype(group)>(table, sweptAngles<S>(), translation);
    row(name, table);
  };
  rigid("SO2", liestat::SO2<S>(), 0);
  rigid("SO3", liestat::SO3<S>(), 0);
  rigid("SE2", liestat::SE2<S>(), 2);
  rigid("SE3", liestat::SE3<S>(), 3);
  rigid("SE23", liestat::SE23<S>(), 3);
  row("RxSO2", sweepScaledGroup<liestat::RxSO2<S>>(0));
  row("RxSO3", sweepScaledGroup<liestat::RxSO3<S>>(0));
  row("Sim2", sweepScaledGroup<liestat::Sim2<S>>(2));
  row("Sim3", sweepScaledGroup<liestat::Sim3<S>>(3));
}

}  // namespace

int main() {
  printAll<double>();
  printAll<float>();
}
