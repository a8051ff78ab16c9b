// Philox against its published answers, and the laws drawn from it. Statistical bounds are 5 standard errors (two-sided
// normal: a false alarm once in 1.7 million), at fixed seeds.

#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

namespace {

using liestat::CounterRng;

static_assert(std::uniform_random_bit_generator<CounterRng>);
static_assert(std::is_same_v<CounterRng::result_type, std::uint64_t>);

/// The generator addressed by a raw Philox key and counter (whose first word, the block, is always 0 at the start).
CounterRng generatorAt(const std::array<std::uint32_t, 2>& key, const std::array<std::uint32_t, 4>& counter) {
  const auto join = [](std::uint32_t lo, std::uint32_t hi) { return lo | (static_cast<std::uint64_t>(hi) << 32); };
  return CounterRng(join(key[0], key[1]), join(counter[2], counter[3]), counter[1]);
}

// The lines "philox4x32 10" of kat_vectors, the known answers that Random123 publishes: counter, key, result.
struct KnownAnswer {
  std::array<std::uint32_t, 4> counter;
  std::array<std::uint32_t, 2> key;
  std::array<std::uint32_t, 4> result;
};
const KnownAnswer known_answers[] = {
    {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
    {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
     {0xffffffff, 0xffffffff},
     {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
    {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
     {0xa4093822, 0x299f31d0},
     {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
};

TEST(Philox, givesThePublishedAnswers) {
  for (const KnownAnswer& known : known_answers) {
    const r123::Philox4x32_R<10>::ctr_type counter{
        {known.counter[0], known.counter[1], known.counter[2], known.counter[3]}};
    const r123::Philox4x32_R<10>::key_type key{{known.key[0], known.key[1]}};
    const auto result = r123::Philox4x32_R<10>()(counter, key);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(result.v[i], known.result[i]);
  }
}

TEST(CounterRng, firstBlockIsThePublishedAnswerAtZero) {
  CounterRng rng(0, 0, 0);
  EXPECT_EQ(rng(), 0xe169c58d6627e8d5u);
  EXPECT_EQ(rng(), 0x9b00dbd8bc57ac4cu);
}

TEST(CounterRng, keyAndCounterAreWhereTheDocumentationSays) {
  for (const KnownAnswer& known : known_answers) {
    CounterRng rng = generatorAt(known.key, known.counter);
    for (std::uint32_t block = 0; block < 3; ++block) {
      const r123::Philox4x32_R<10>::ctr_type counter{{block, known.counter[1], known.counter[2], known.counter[3]}};
      const r123::Philox4x32_R<10>::key_type key{{known.key[0], known.key[1]}};
      const auto expected = r123::Philox4x32_R<10>()(counter, key);
      EXPECT_EQ(rng(), expected.v[0] | (std::uint64_t{expected.v[1]} << 32));
      EXPECT_EQ(rng(), expected.v[2] | (std::uint64_t{expected.v[3]} << 32));
    }
  }
}

TEST(CounterRng, aTrialDependsOnNothingButItsNumber) {
  const auto drawTrial = [](std::uint64_t trial) {
    CounterRng rng(7, trial);
    std::vector<double> draws;
    for (int i = 0; i < 9; ++i) draws.push_back(i % 3 == 2 ? rng.uniform() : rng.normal());
    return draws;
  };
  std::map<std::uint64_t, std::vector<double>> forward, backward;
  const std::uint64_t far = std::uint64_t{1} << 40;  // the counter's upper word counts too
  for (std::uint64_t i = 0; i < 50; ++i) forward[far * (i % 2) + i] = drawTrial(far * (i % 2) + i);
  for (std::uint64_t i = 50; i-- > 0;) backward[far * (i % 2) + i] = drawTrial(far * (i % 2) + i);
  EXPECT_EQ(forward, backward);
  std::set<std::vector<double>> different;
  for (const auto& [trial, draws] : forward) different.insert(draws);
  EXPECT_EQ(different.size(), forward.size());
}

TEST(CounterRng, seedTrialAndStreamSeparateSequences) {
  std::set<std::uint64_t> first_words;
  int sequences = 0;
  for (std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1} << 32}) {
    for (std::uint64_t trial : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1} << 32}) {
      for (std::uint32_t stream : {0u, 1u, 0xffffffffu}) {
        first_words.insert(CounterRng(seed, trial, stream)());
        ++sequences;
      }
    }
  }
  EXPECT_EQ(first_words.size(), static_cast<std::size_t>(sequences));
}

TEST(CounterRng, worksWithTheStandardLibrary) {
  CounterRng rng(3, 1);
  std::uniform_int_distribution<int> die(1, 6);
  for (int i = 0; i < 100; ++i) {
    const int face = die(rng);
    EXPECT_GE(face, 1);
    EXPECT_LE(face, 6);
  }
}

/// Mean of f over n draws, with its standard error.
template <class F>
std::pair<double, double> meanAndError(int n, F f) {
  double sum = 0, sum2 = 0;
  for (int i = 0; i < n; ++i) {
    const double x = f();
    sum += x;
    sum2 += x * x;
  }
  const double mean = sum / n;
  return {mean, std::sqrt((sum2 / n - mean * mean) / n)};
}

#define EXPECT_MEAN(n, expected, ...)                                            \
  do {                                                                           \
    const auto [mean_, error_] = meanAndError(n, [&] { return (__VA_ARGS__); }); \
    EXPECT_NEAR(mean_, expected, 5 * error_) << #__VA_ARGS__;                    \
  } while (false)

TEST(CounterRng, uniformHasTheMomentsOfTheUniformLaw) {
  CounterRng rng(11, 0);
  const int n = 200000;
  EXPECT_MEAN(n, 1. / 2, rng.uniform());
  EXPECT_MEAN(n, 1. / 3, std::pow(rng.uniform(), 2));
  EXPECT_MEAN(n, 1. / 10, std::pow(rng.uniform(), 9));
  EXPECT_MEAN(n, 1. / 4, rng.uniform() * rng.uniform());
  EXPECT_MEAN(n, 1., -std::log(rng.uniform()));
}

TEST(CounterRng, uniformIsInsideTheOpenInterval) {
  CounterRng rng(12, 0);
  for (int i = 0; i < 100000; ++i) {
    const double u = rng.uniform();
    ASSERT_GT(u, 0);
    ASSERT_LT(u, 1);
  }
}

TEST(CounterRng, normalHasTheMomentsOfTheNormalLaw) {
  CounterRng rng(13, 0);
  const int n = 200000;
  EXPECT_MEAN(n, 0, rng.normal());
  EXPECT_MEAN(n, 1, std::pow(rng.normal(), 2));
  EXPECT_MEAN(n, 0, std::pow(rng.normal(), 3));
  EXPECT_MEAN(n, 3, std::pow(rng.normal(), 4));
  EXPECT_MEAN(n, 0, rng.normal() * rng.normal());
  EXPECT_MEAN(n, std::erfc(3 / std::sqrt(2.)), std::abs(rng.normal()) > 3 ? 1. : 0.);
}

TEST(CounterRng, firstDrawsOfSuccessiveTrialsAreIndependent) {
  const int n = 100000;
  std::uint64_t trial = 0;
  EXPECT_MEAN(n, 0, CounterRng(14, trial++).normal());
  trial = 0;
  EXPECT_MEAN(n, 1, std::pow(CounterRng(14, trial++).normal(), 2));
  trial = 0;
  EXPECT_MEAN(n, 0, (++trial, CounterRng(14, trial).normal() * CounterRng(14, trial + 1).normal()));
  trial = 0;
  EXPECT_MEAN(n, 0, (++trial, CounterRng(14, trial, 0).normal() * CounterRng(14, trial, 1).normal()));
}

TEST(CounterRng, normalVectorIsTheSameSequence) {
  CounterRng a(15, 2), b(15, 2);
  const Eigen::Matrix<double, 3, 1> first = a.normalVector<3>();
  const Eigen::Matrix<double, 6, 1> second = a.normalVector<6>();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(first[i], b.normal());
  for (int i = 0; i < 6; ++i) EXPECT_EQ(second[i], b.normal());
}

TEST(CounterRng, uniformBetweenIsTheSameSequence) {
  CounterRng a(17, 0), b(17, 0);
  for (int i = 0; i < 1000; ++i) {
    const double x = a.uniform(-2, 5);
    EXPECT_EQ(x, -2 + 7 * b.uniform());
    EXPECT_TRUE(x > -2 && x < 5);
  }
}

TEST(CounterRng, unitVectorIsUniformOnTheSphere) {
  CounterRng rng(18, 0);
  const int n = 100000;
  for (int i = 0; i < 1000; ++i) EXPECT_NEAR(rng.unitVector<3>().norm(), 1, 4e-16);
  // On S^2 a coordinate is uniform on [-1, 1] (Archimedes); on the circle E x^2 = 1/2, E x^4 = 3/8.
  for (int i = 0; i < 3; ++i) {
    EXPECT_MEAN(n, 0, rng.unitVector<3>()[i]);
    EXPECT_MEAN(n, 1. / 3, std::pow(rng.unitVector<3>()[i], 2));
    EXPECT_MEAN(n, 1. / 5, std::pow(rng.unitVector<3>()[i], 4));
  }
  EXPECT_MEAN(n, 1. / 2, std::pow(rng.unitVector<2>()[1], 2));
  EXPECT_MEAN(n, 3. / 8, std::pow(rng.unitVector<2>()[0], 4));
}

TEST(CounterRng, unitQuaternionIsHaarUniform) {
  CounterRng rng(16, 0);
  const int n = 100000;
  for (int i = 0; i < 1000; ++i) EXPECT_NEAR(rng.unitQuaternion().norm(), 1, 4e-16);
  // On the sphere S^3: E q_i = 0, E q_i^2 = 1/4, E q_i^4 = 1/8. The angle of the rotation has density
  // (1 - cos t)/pi, so E t = pi/2 + 2/pi and E t^2 = pi^2/3 + 2.
  const double pi = 3.14159265358979323846;
  const auto angle = [](const Eigen::Quaterniond& q) { return 2 * std::atan2(q.vec().norm(), std::abs(q.w())); };
  for (int i = 0; i < 4; ++i) {
    EXPECT_MEAN(n, 0, rng.unitQuaternion().coeffs()[i]);
    EXPECT_MEAN(n, 0.25, std::pow(rng.unitQuaternion().coeffs()[i], 2));
    EXPECT_MEAN(n, 0.125, std::pow(rng.unitQuaternion().coeffs()[i], 4));
  }
  EXPECT_MEAN(n, pi / 2 + 2 / pi, angle(rng.unitQuaternion()));
  EXPECT_MEAN(n, pi * pi / 3 + 2, std::pow(angle(rng.unitQuaternion()), 2));
}

}  // namespace
