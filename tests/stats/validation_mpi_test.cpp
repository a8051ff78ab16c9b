// Run under mpirun with any number of ranks: a report has the same bits on every rank as without MPI.

#include <stats/compat/mpi.hpp>
#include <stats/validation.hpp>

#include <gtest/gtest.h>

#include <cmath>

#include "mpi_test_main.hpp"

namespace {

using namespace liestat;

TrialOutcome trial(CounterRng& rng, std::uint64_t number) {
  TrialOutcome outcome{.mu2 = rng.normalVector<3>().squaredNorm(), .iterations = static_cast<int>(number % 5)};
  if (number % 2 == 0) outcome.extra[1] = rng.normal();
  outcome.failed = rng.uniform() < 0.05;
  return outcome;
}

TEST(ValidationUnderMpi, givesTheBitsOfTheSerialExecutor) {
  const ValidationOptions options{.trials = 1003, .seed = 12};
  const auto law = ReferenceLaw::chiSquared(3);
  const auto mpi = validate(MpiExecutor{}, options, law, trial);
  const auto serial = validate(SerialExecutor{}, options, law, trial);
  EXPECT_EQ(mpi.mu2, serial.mu2);
  EXPECT_EQ(mpi.index, serial.index);
  EXPECT_EQ(mpi.index_p_value, serial.index_p_value);
  EXPECT_EQ(mpi.ks_p_value, serial.ks_p_value);
  EXPECT_EQ(mpi.trials, serial.trials);
  EXPECT_EQ(mpi.failures, serial.failures);
  EXPECT_EQ(mpi.mean_iterations, serial.mean_iterations);
  EXPECT_EQ(mpi.extra[1].count, serial.extra[1].count);
  EXPECT_EQ(mpi.extra[1].mean, serial.extra[1].mean);
  EXPECT_EQ(mpi.extra[1].deviation, serial.extra[1].deviation);
}

TEST(ValidationUnderMpi, fewerTrialsThanRanksAreFine) {
  for (std::size_t trials : {0u, 1u, 2u}) {
    EXPECT_EQ(validate(MpiExecutor{}, {.trials = trials}, ReferenceLaw::chiSquared(3), trial).trials, trials);
  }
}

}  // namespace
