#include <lie/instruction_set.hpp>
#include <stats/certified_mean.hpp>
#include <stats/gaussian.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <stats/state.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace liestat;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class M>
std::vector<M> cloud(std::uint64_t trial, std::size_t n, double spread) {
  CounterRng rng(37, trial);
  const M centre = sampleInCube<M>(rng);
  std::vector<M> samples;
  for (std::size_t i = 0; i < n; ++i) {
    TangentOf<M> e;
    for (int k = 0; k < ManifoldTraits<M>::DoF; ++k) e[k] = spread * rng.normal();
    samples.push_back(exp(centre, e));
  }
  return samples;
}

std::vector<double> weightsFor(std::uint64_t trial, std::size_t n) {
  CounterRng rng(38, trial);
  std::vector<double> weights;
  for (std::size_t i = 0; i < n; ++i) weights.push_back(0.2 + 0.8 * rng.uniform());
  return weights;
}

/// Rows without any function of a mathematical library: the same bits everywhere.
template <class M>
std::vector<M> plainRows(std::size_t n) {
  std::vector<M> rows(n);
  std::uint64_t random = 1;
  for (M& x : rows) {
    double square = 0;
    for (int c = 0; c < M::num_parameters; ++c) {
      random = random * 6364136223846793005U + 1442695040888963407U;
      x.data()[c] = static_cast<double>(random >> 33) / 4294967296.0 - 0.25 + (c == 0 ? 1.5 : 0);
      square += x.data()[c] * x.data()[c];
    }
    for (int c = 0; c < M::num_parameters; ++c) x.data()[c] /= std::sqrt(square);
  }
  return rows;
}

std::vector<std::byte> copyOf(std::span<const std::byte> bytes) { return {bytes.begin(), bytes.end()}; }

/// The bytes of the file of that name in tests/data/states. With LIESTAT_WRITE_STATES set the file is written first.
void expectGolden(std::span<const std::byte> bytes, const std::string& name) {
  const std::string path = std::string(LIESTAT_SOURCE_DIR) + "/tests/data/states/" + name;
  if (std::getenv("LIESTAT_WRITE_STATES") != nullptr) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  std::ifstream in(path, std::ios::binary);
  const std::string golden{std::istreambuf_iterator<char>(in), {}};
  ASSERT_EQ(golden.size(), bytes.size()) << path;
  EXPECT_EQ(std::memcmp(golden.data(), bytes.data(), bytes.size()), 0) << path;
}

template <class M>
class States : public testing::Test {
 protected:
  static constexpr const char* names[] = {"", "heading", "direction", "rotation"};
  static inline const std::string name = names[detail::state_manifold<M>];
};
using Features = testing::Types<SO2d, S2d, SO3d>;
TYPED_TEST_SUITE(States, Features);

/// The state of all rows in every order, partition and instruction set that we have.
template <class State, class M>
void expectOneState(const State& empty, const std::vector<M>& rows, const std::vector<double>& weights,
                    const std::string& golden) {
  State whole = empty;
  ASSERT_EQ(whole.add(rows, weights), StateError::none);
  expectGolden(whole.bytes(), golden);
  const InstructionSet before = instructionSet();
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (set > supportedInstructionSet()) continue;
    useInstructionSet(set);
    std::vector<std::size_t> order(rows.size());
    std::iota(order.begin(), order.end(), 0U);
    CounterRng rng(39, static_cast<std::uint64_t>(set));
    for (const std::size_t parts : {1, 7, 64, 1000}) {
      for (std::size_t i = order.size(); i > 1; --i) {
        std::swap(order[i - 1], order[static_cast<std::size_t>(rng.uniform() * static_cast<double>(i))]);
      }
      State merged = empty;
      for (std::size_t part = 0; part < parts; ++part) {
        const std::size_t begin = rows.size() * part / parts, end = rows.size() * (part + 1) / parts;
        // Rows with a gap between them, and, of the smallest parts, one at a time.
        std::vector<double> strided, some;
        for (std::size_t i = begin; i < end; ++i) {
          strided.insert(strided.end(), rows[order[i]].data(), rows[order[i]].data() + State::row);
          strided.push_back(nan);
          if (!weights.empty()) some.push_back(weights[order[i]]);
        }
        State state = empty;
        if (parts < 1000) {
          ASSERT_EQ(state.add(strided.data(), end - begin, State::row + 1, some.empty() ? nullptr : some.data()),
                    StateError::none);
        }
        for (std::size_t i = begin; parts == 1000 && i < end; ++i) {
          ASSERT_EQ(state.add(rows[order[i]], weights.empty() ? 1 : weights[order[i]]), StateError::none);
        }
        ASSERT_EQ(merged.merge(state), StateError::none);
      }
      EXPECT_TRUE(merged == whole) << golden << ", " << name(set) << ", " << parts << " parts";
    }
  }
  useInstructionSet(before);
}

TYPED_TEST(States, haveTheSameBytesInAnyOrderAndPartition) {
  using M = TypeParam;
  std::vector<M> rows = plainRows<M>(5000);
  for (std::size_t i = 0; i < rows.size(); i += 997) rows[i].data()[0] = i % 2 == 0 ? nan : 2;
  std::vector<double> weights;
  for (std::size_t i = 0; i < rows.size(); ++i) weights.push_back(static_cast<double>(i % 13) / 16);
  const M reference = plainRows<M>(1)[0];
  expectOneState(MomentState<M>(), rows, {}, this->name + "_moments.state");
  expectOneState(MomentState<M>(), rows, weights, this->name + "_moments_weighted.state");
  expectOneState(SumState<M>(reference), rows, {}, this->name + "_sums.state");
  expectOneState(SumState<M>(reference), rows, weights, this->name + "_sums_weighted.state");
  EXPECT_LE(MomentState<M>::size, 256U);
  EXPECT_LE(SumState<M>::size, 512U);
}

// From clouds of every width, to the cut locus: whatever the sums prove is what certifiedMean says.
TYPED_TEST(States, giveTheMeanAndCovarianceOfCertifiedMean) {
  using M = TypeParam;
  std::uint64_t trial = 0;
  int both = 0;
  for (const double spread : {1e-8, 1e-3, 0.05, 0.3, 0.7, 1.2}) {
    for (const std::size_t n : {1, 2, 4, 5, 20, 100, 1000}) {
      for (const bool weighted : {false, true}) {
        ++trial;
        SCOPED_TRACE("spread " + std::to_string(spread) + ", n " + std::to_string(n) + (weighted ? ", weighted" : ""));
        const std::vector<M> rows = cloud<M>(trial, n, spread);
        const std::vector<double> weights = weighted ? weightsFor(trial, n) : std::vector<double>();
        CertifiedMeanOptions<M> options;
        options.uniqueness.budget = 100'000;
        const CertifiedMean<M> known = weighted ? certifiedMean(rows, weights, options) : certifiedMean(rows, options);
        int passes = 0;
        const CertifiedMean<M> found = meanByPasses<M>(
            [&](auto& state) { ASSERT_EQ(state.add(rows, weights), StateError::none); }, 1, options, &passes);
        if (found.status == Status::ok) {
          ASSERT_EQ(known.status, Status::ok) << known.reason;
          ASSERT_TRUE(found.estimate);
          ++both;
          EXPECT_LE(log(known.mean.mean, found.mean.mean).norm(), 1e-12);
          // Rows are rounded to some 1e-16, which is a larger part of a smaller spread.
          EXPECT_LE((known.estimate->covariance - found.estimate->covariance).norm(),
                    (1e-9 + 1e-15 / spread) * known.estimate->covariance.norm());
          EXPECT_EQ(found.uniqueness.unique, Uniqueness::unique);
          EXPECT_LE(passes, spread < 0.5 ? 4 : 9);
        } else {
          EXPECT_FALSE(found.estimate);
          EXPECT_STRNE(found.reason, "");
          EXPECT_FALSE(known.status == Status::ok && spread < 0.5 && n >= 20) << found.reason;
          EXPECT_TRUE(n > static_cast<std::size_t>(ManifoldTraits<M>::DoF) || found.status == Status::too_few);
        }
      }
    }
  }
  // The sums leave open only samples of few rows, and wide ones.
  EXPECT_GE(both, 40);
}

TYPED_TEST(States, giveAChordalMeanWhoseCovarianceHolds) {
  using M = TypeParam;
  constexpr int k = ManifoldTraits<M>::DoF;
  constexpr std::size_t trials = 1500, n = 30;
  for (const double spread : {0.05, 0.4}) {
    double nees = 0;
    std::size_t count = 0;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      CounterRng rng(41, trial);
      MomentState<M> state;
      for (std::size_t i = 0; i < n; ++i) {
        TangentOf<M> e;
        for (int c = 0; c < k; ++c) e[c] = spread * rng.normal();
        ASSERT_EQ(state.add(exp(M(), e)), StateError::none);
      }
      const ChordalMean<M> mean = state.finish();
      ASSERT_EQ(mean.status, Status::ok) << mean.reason;
      nees += mahalanobisSquared(*mean.estimate, M()), ++count;
    }
    // Hotelling's T² has the mean k (n - 1)/(n - k - 2), and four standard errors of 1500 trials are 15 to 25 % of k.
    // The covariance of wide rotations is an upper bound.
    const double expected = k * (n - 1.0) / (n - k - 2.0), ratio = nees / static_cast<double>(count) / expected;
    const double upper = 1 + 4 * std::sqrt(2.6 / k / static_cast<double>(trials));
    EXPECT_LE(ratio, upper) << spread;
    EXPECT_GE(ratio, k == 3 && spread > 0.3 ? 0.75 : 2 - upper) << spread;
  }
}

TYPED_TEST(States, ofUniformFeaturesHaveNoMean) {
  using M = TypeParam;
  int refused = 0;
  for (std::uint64_t trial = 0; trial < 300; ++trial) {
    CounterRng rng(43, trial);
    MomentState<M> state;
    for (int i = 0; i < 40; ++i) {
      ASSERT_EQ(state.add(sampleInCube<M>(rng)), StateError::none);
    }
    refused += state.finish().status == Status::ill_defined;
  }
  EXPECT_GE(refused, 290);  // 297 are expected at least
}

TYPED_TEST(States, countBadRowsAndRefuseBadWeights) {
  using M = TypeParam;
  std::vector<M> rows = plainRows<M>(20);
  rows[3].data()[1] = nan;
  rows[5].data()[0] = std::numeric_limits<double>::infinity();
  for (int c = 0; c < M::num_parameters; ++c) rows[7].data()[c] = 0, rows[9].data()[c] *= 2;
  for (int c = 0; c < M::num_parameters; ++c) rows[11].data()[c] *= 1 + 5e-4;
  SumState<M> state(rows[0]);
  ASSERT_EQ(state.add(rows), StateError::none);
  EXPECT_EQ(state.n(), 16U);
  EXPECT_EQ(state.left_out(), 4U);
  const SumState<M> before = state;
  for (const double weight : {-1.0, nan, 1.5, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(state.add(rows[0], weight), StateError::bad_weight) << weight;
  }
  EXPECT_TRUE(state == before);
  EXPECT_EQ(state.add(rows[0], 0), StateError::none);
  EXPECT_EQ(state.n(), 16U);
  // Up to the largest weight that the state was made for, and the same mean.
  SumState<M> scaled(rows[0], 1, 48), plain(rows[0]);
  for (std::size_t i = 12; i < 20; ++i) {
    ASSERT_EQ(scaled.add(rows[i], 3.0 * static_cast<double>(i)), StateError::none);
    ASSERT_EQ(plain.add(rows[i], static_cast<double>(i) / 32), StateError::none);
  }
  EXPECT_EQ(scaled.add(rows[0], 65), StateError::bad_weight);
  EXPECT_LE(log(scaled.finish().mean.mean, plain.finish().mean.mean).norm(), 1e-14);
  EXPECT_EQ(scaled.finish().mean.sum_of_weights, 3.0 * (12 + 19) * 4);
  const CertifiedMean<M> empty = SumState<M>(rows[0]).finish();
  EXPECT_EQ(empty.status, Status::too_few);
  EXPECT_EQ(MomentState<M>().finish().status, Status::too_few);
}

TYPED_TEST(States, refuseForeignForgedAndNewerBytes) {
  using M = TypeParam;
  const std::vector<M> rows = plainRows<M>(100);
  SumState<M> state(rows[0]);
  ASSERT_EQ(state.add(rows), StateError::none);
  const std::vector<std::byte> good = copyOf(state.bytes());
  StateError error = StateError::none;
  const auto errorOf = [&](const std::vector<std::byte>& bytes) {
    const auto read = SumState<M>::fromBytes(bytes, &error);
    EXPECT_EQ(read.has_value(), error == StateError::none);
    return error;
  };
  EXPECT_EQ(errorOf(good), StateError::none);
  EXPECT_TRUE(*SumState<M>::fromBytes(good) == state);
  EXPECT_FALSE(MomentState<M>::fromBytes(good));
  EXPECT_EQ(errorOf({}), StateError::foreign);
  EXPECT_EQ(errorOf({good.begin(), good.end() - 1}), StateError::foreign);
  std::vector<std::byte> longer = good;
  longer.push_back(std::byte{0});
  EXPECT_EQ(errorOf(longer), StateError::foreign);
  const auto with = [&](std::size_t at, int value) {
    std::vector<std::byte> bytes = good;
    bytes[at] = static_cast<std::byte>(value);
    return errorOf(bytes);
  };
  EXPECT_EQ(with(0, 'L'), StateError::foreign);
  EXPECT_EQ(with(7, 2), StateError::newer_version);
  EXPECT_NE(with(8, detail::state_manifold<M> % 3 + 1), StateError::none);
  EXPECT_NE(with(9, LIESTAT_MOMENTS), StateError::none);
  EXPECT_EQ(with(11, 1), StateError::forged);
  EXPECT_EQ(with(16, 101), StateError::forged);   // n
  EXPECT_EQ(with(22, 1), StateError::forged);     // n beyond 2^33
  EXPECT_EQ(with(38, 0x7f), StateError::forged);  // the reference
  // A sum beyond what that many rows may have, in its highest byte.
  for (std::size_t at = 72 + 15; at < good.size(); at += 16) EXPECT_EQ(with(at, 0x70), StateError::forged) << at;
  SumState<M> other(rows[1]), next(rows[0], 2), scaled(rows[0], 1, 4);
  for (const auto* s : {&other, &next, &scaled}) EXPECT_EQ(state.merge(*s), StateError::different);
  EXPECT_EQ(errorOf(good), StateError::none);
}

TEST(StateOfHeadings, hasExactQuarterTurnsAndDirectionsThatCancel) {
  for (int degrees = -3600; degrees <= 3600; degrees += 7) {
    double row[2];
    liestat_heading(degrees + 0.3125, row);
    const long double angle =
        (static_cast<long double>(degrees) + 0.3125L) * 3.141592653589793238462643383279502884L / 180;
    EXPECT_NEAR(row[0], static_cast<double>(std::cos(angle)), 6e-16) << degrees;
    EXPECT_NEAR(row[1], static_cast<double>(std::sin(angle)), 6e-16) << degrees;
  }
  std::uint64_t state[LIESTAT_STATE_LARGEST / 8];
  ASSERT_EQ(liestat_state_init(state, LIESTAT_HEADING, LIESTAT_MOMENTS, nullptr, 0, 0), LIESTAT_STATE_OK);
  liestat_mean mean;
  ASSERT_EQ(liestat_state_finish(state, &mean), LIESTAT_STATE_OK);
  EXPECT_TRUE(std::isnan(mean.mean[0]) && mean.n == 0);
  for (const double degrees : {10.0, 100.0, 190.0, 280.0, 1e300, nan}) {
    double row[2];
    liestat_heading(degrees, row);
    ASSERT_EQ(liestat_state_add(state, row, 1, 2, nullptr), LIESTAT_STATE_OK);
  }
  double opposite[2];
  liestat_heading(std::remainder(1e300, 360.0) + 180, opposite);
  ASSERT_EQ(liestat_state_add(state, opposite, 1, 2, nullptr), LIESTAT_STATE_OK);
  ASSERT_EQ(liestat_state_finish(state, &mean), LIESTAT_STATE_OK);
  EXPECT_EQ(mean.n, 6U);
  EXPECT_EQ(mean.left_out, 1U);
  EXPECT_TRUE(std::isnan(mean.mean[0]) && std::isnan(mean.covariance[0]));
  EXPECT_STREQ(mean.status, "ill_defined");
}

// The rows of tests/engines/, whose engines must make the same bytes of them.
TEST(StateInC, hasTheBytesThatEnginesMake) {
  std::uint64_t headings[LIESTAT_STATE_LARGEST / 8], rotations[LIESTAT_STATE_LARGEST / 8];
  ASSERT_EQ(liestat_state_init(headings, LIESTAT_HEADING, LIESTAT_MOMENTS, nullptr, 0, 0), LIESTAT_STATE_OK);
  ASSERT_EQ(liestat_state_init(rotations, LIESTAT_ROTATION, LIESTAT_MOMENTS, nullptr, 0, 0), LIESTAT_STATE_OK);
  constexpr double quaternions[4][4] = {{0.6, 0, 0, 0.8}, {0.28, 0, 0, 0.96}, {0, 0, 0.28, 0.96}, {0.352, 0, 0, 0.936}};
  for (int n = 0; n < 2000; ++n) {
    double row[2];
    liestat_heading((n * 29 % 1440) / 16.0 - 20, row);
    ASSERT_EQ(liestat_state_add(headings, row, 1, 2, nullptr), LIESTAT_STATE_OK);
    ASSERT_EQ(liestat_state_add(rotations, quaternions[n % 4], 1, 4, nullptr), LIESTAT_STATE_OK);
  }
  const auto bytesOf = [](const std::uint64_t* state, int manifold) {
    return std::as_bytes(std::span(state, liestat_state_size(manifold, LIESTAT_MOMENTS) / 8));
  };
  expectGolden(bytesOf(headings, LIESTAT_HEADING), "engine_headings.state");
  expectGolden(bytesOf(rotations, LIESTAT_ROTATION), "engine_rotations.state");
}

TEST(StateInC, finishesAsInCpp) {
  const std::vector<SO3d> rows = cloud<SO3d>(5, 200, 0.2);
  SumState<SO3d> state(rows[0]);
  ASSERT_EQ(state.add(rows), StateError::none);
  liestat_mean mean;
  ASSERT_EQ(liestat_state_finish(state.bytes().data(), &mean), LIESTAT_STATE_OK);
  EXPECT_EQ(mean.another_pass, 1);
  EXPECT_STREQ(mean.status, "not_converged");
  const CertifiedMean<SO3d> known = state.finish();
  EXPECT_EQ(mean.mean[0], known.mean.mean.data()[0]);
  EXPECT_EQ(mean.step, known.mean.residual);
  EXPECT_EQ(liestat_state_size(4, 1), 0U);
  EXPECT_EQ(liestat_state_size(3, 3), 0U);
  EXPECT_EQ(liestat_state_size(LIESTAT_ROTATION, LIESTAT_SUMS), std::size_t{LIESTAT_STATE_LARGEST});
  const double bad[4] = {2, 0, 0, 0};
  std::uint64_t memory[LIESTAT_STATE_LARGEST / 8];
  EXPECT_EQ(liestat_state_init(memory, 3, LIESTAT_SUMS, bad, 0, 1), LIESTAT_STATE_BAD_ARGUMENT);
  EXPECT_EQ(liestat_state_init(memory, 3, LIESTAT_SUMS, nullptr, 0, 1), LIESTAT_STATE_BAD_ARGUMENT);
}

}  // namespace
