// Run under mpirun with any number of ranks: a report has the same bits on every rank as without MPI.

#include <stats/compat/mpi.hpp>
#include <stats/validation.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "mpi_test_main.hpp"

namespace {

using namespace liestat;

struct Outcome : TrialOutcome {
  double even = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::array statistics = {&Outcome::even};
};

Outcome trial(CounterRng& rng, std::uint64_t number) {
  Outcome outcome;
  outcome.mu2 = rng.normalVector<3>().squaredNorm();
  outcome.iterations = static_cast<int>(number % 5);
  if (number % 2 == 0) outcome.even = rng.normal();
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
  const TrialStatistic ours = mpi.of(&Outcome::even), theirs = serial.of(&Outcome::even);
  EXPECT_GT(ours.count, 400u);
  EXPECT_EQ(ours.count, theirs.count);
  EXPECT_EQ(ours.mean, theirs.mean);
  EXPECT_EQ(ours.standard_deviation, theirs.standard_deviation);
}

TEST(ValidationUnderMpi, fewerTrialsThanRanksAreFine) {
  for (std::size_t trials : {0u, 1u, 2u}) {
    EXPECT_EQ(validate(MpiExecutor{}, {.trials = trials}, ReferenceLaw::chiSquared(3), trial).trials, trials);
  }
}

}  // namespace
