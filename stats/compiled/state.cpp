// Order-free sums of states (stats/liestat_state.h). A number's nearest multiple of a unit is added as an integer, so
// that a sum does not depend on the order of its terms. The terms themselves have the same bits on every processor and
// compiler: only additions, products and divisions of IEEE doubles in one order, none of them contracted to a fused one
// (this file is compiled with -ffp-contract=off), and nothing of the mathematical library.
#include <lie/detail/always_inline.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/instruction_set.hpp>
#include <stats/detail/state_words.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#if defined(__FAST_MATH__)
#error "states need IEEE arithmetic: compile stats/compiled/state.cpp without -ffast-math"
#endif
static_assert(std::endian::native == std::endian::little, "states are little-endian");

namespace liestat::detail {
namespace {

constexpr double norm_tolerance = 1e-3;
/// A squared norm may be off by as much.
constexpr double largest_excess = 2 * norm_tolerance;
/// The transverse curvature of directions diverges at the antipode of the reference. Where it is cut off, within 0.026
/// rad of that, no mean is certified by its sums.
constexpr double largest_curvature = 120;
constexpr double pi_squared = 9.8696044010893586;

/// f(w) = 2 acos(w)/√(1-w²) and g = -f'/2 in 1 - 2w, 0 <= w <= 1, as lie/detail/rotation_polynomials.hpp makes them; in
/// numbers here, for these must not depend on a compiler's long double. Pairs of coefficients: even and odd powers.
constexpr double log_polynomial[22] = {0x1.358e1a79ed7e1p+1,  0x1.0ded320818ac6p-1,
                                       0x1.1da08d34f29e9p-3,  0x1.45030651ce851p-5,
                                       0x1.8025d0bfa2624p-7,  0x1.d0c337038d04p-9,
                                       0x1.1d9e53b7d441fp-10, 0x1.631197a03ab4p-12,
                                       0x1.bd36e73a9c4bp-14,  0x1.1900bd9970dp-15,
                                       0x1.64a2f45b4a8p-17,   0x1.c6b0dc5568p-19,
                                       0x1.22e4e2792ap-20,    0x1.7474ea778p-22,
                                       0x1.df42f6fap-24,      0x1.3ea3df1p-25,
                                       0x1.9c81176p-27,       0x1.9ca88p-29,
                                       0x1.092d1p-30,         0x1.8551p-31,
                                       0x1.fe73cp-33,         0};
constexpr double hessian_polynomial[22] = {
    0x1.0ded320818ad4p-1, 0x1.1da08d34f2a08p-2, 0x1.e784897aafc7p-4,   0x1.8025d0bf9bc8p-5,   0x1.227a02659ea5dp-6,
    0x1.ac6d7d99ed4f8p-8, 0x1.36af6330147a2p-9, 0x1.bd36e4c2ea5b8p-11, 0x1.3c212912e8aa6p-12, 0x1.bdcc353dfa788p-14,
    0x1.388f0b88e24p-15,  0x1.b4475d4fa9dp-17,  0x1.2f6ceb47804p-18,   0x1.a489174d56p-20,    0x1.210bdc04ap-21,
    0x1.8ea0db9b8p-23,    0x1.2154eee8p-24,     0x1.8cca4818p-26,      0x1.6c44b5p-28,        0x1.f6e4d2p-30,
    0x1.da698cp-30,       0x1.4249ap-31};

constexpr std::size_t lanesOf(InstructionSet set) {
  return set == InstructionSet::avx512 ? 8 : set == InstructionSet::avx2 ? 4 : 2;
}

/// L doubles, and as many integers of their size; one of them is no vector.
template <std::size_t L>
struct Lanes {
  typedef double D __attribute__((vector_size(8 * L)));
  typedef std::int64_t I __attribute__((vector_size(8 * L)));
  typedef std::uint64_t U __attribute__((vector_size(8 * L)));
  struct __attribute__((packed, may_alias)) Memory {
    D v;
  };
  LIESTAT_ALWAYS_INLINE static void addBits(const D& x, U& sum) { sum += reinterpret_cast<U>(x); }
  LIESTAT_ALWAYS_INLINE static void guessInverseRoot(const D& x, D& y) {
    const U bits = 0x5fe6eb50c7b537a9U - (reinterpret_cast<U>(x) >> 1);
    y = reinterpret_cast<D>(bits);
  }
  /// x with its sign turned where s is negative.
  LIESTAT_ALWAYS_INLINE static void turn(const D& s, D& x) {
    const U sign = reinterpret_cast<U>(s) & (std::uint64_t{1} << 63), turned = reinterpret_cast<U>(x) ^ sign;
    x = reinterpret_cast<D>(turned);
  }
  LIESTAT_ALWAYS_INLINE static void load(const double* p, D& x) { x = reinterpret_cast<const Memory*>(p)->v; }
  LIESTAT_ALWAYS_INLINE static void store(double* p, const D& x) { reinterpret_cast<Memory*>(p)->v = x; }
};
template <>
struct Lanes<1> {
  using D = double;
  using I = std::int64_t;
  using U = std::uint64_t;
  LIESTAT_ALWAYS_INLINE static void addBits(const D& x, U& sum) { sum += std::bit_cast<U>(x); }
  LIESTAT_ALWAYS_INLINE static void guessInverseRoot(const D& x, D& y) {
    y = std::bit_cast<D>(0x5fe6eb50c7b537a9U - (std::bit_cast<U>(x) >> 1));
  }
  LIESTAT_ALWAYS_INLINE static void turn(const D& s, D& x) { x = std::signbit(s) ? -x : x; }
  LIESTAT_ALWAYS_INLINE static void load(const double* p, D& x) { x = *p; }
  LIESTAT_ALWAYS_INLINE static void store(double* p, const D& x) { *p = x; }
};

/// Doubles in one binade, [magic, 2 magic/1.5), to which a number is added to have it rounded to a multiple of 2^-bits.
constexpr double magic(int bits) {
  double x = 1.5 * 4503599627370496.0;
  for (int i = 0; i < bits; ++i) x *= 0.5;
  return x;
}
constexpr double power(int exponent) {
  double x = 1;
  for (int i = 0; i < exponent; ++i) x *= 2;
  return x;
}

/// Sums of the numbers of rows, of each row `fine` ones and others. A number goes to multiples of 2^-first, of what
/// that leaves the nearest multiple of 2^-middle; fine numbers go on to 2^-last. A tie on the way may go up or down, as
/// the sum so far is odd or even, but the next level makes up for it exactly: the total is that of the numbers' nearest
/// multiples of the last unit, in any order. Moments have no fine numbers.
template <std::size_t L, int Coarse, int Fine>
struct Accumulator {
  using V = Lanes<L>;
  using D = typename V::D;
  using U = typename V::U;
  /// The rows whose sums stay in the binade of their magic number: terms are at most 1, or 2^7.
  static constexpr std::size_t most = std::size_t{1} << 19;
  static constexpr int first = Fine == 0 ? 30 : 23, middle = Fine == 0 ? 60 : 54, last = Fine == 0 ? 60 : 85;

  D high[Coarse + Fine], mid[Fine + 1];
  U low[Coarse + Fine];
  std::uint64_t rows;  ///< of each lane

  LIESTAT_ALWAYS_INLINE void clear() {
    rows = 0;
    for (int i = 0; i < Coarse + Fine; ++i) high[i] = D{} + magic(first), low[i] = U{};
    for (int i = 0; i < Fine; ++i) mid[i] = D{} + magic(middle);
  }
  LIESTAT_ALWAYS_INLINE void coarse(int i, const D& x) {
    const D sum = high[i] + x, rest = x - (sum - high[i]);
    high[i] = sum;
    V::addBits(rest + magic(middle), low[i]);
  }
  LIESTAT_ALWAYS_INLINE void fine(int i, const D& x) {
    const D sum = high[Coarse + i] + x, rest = x - (sum - high[Coarse + i]);
    high[Coarse + i] = sum;
    const D next = mid[i] + rest, remainder = rest - (next - mid[i]);
    mid[i] = next;
    V::addBits(remainder + magic(last), low[Coarse + i]);
  }
  LIESTAT_ALWAYS_INLINE void flush(Int128* totals) const {
    for (int i = 0; i < Coarse; ++i) {
      // The last level of these is the second one of fine numbers.
      totals[i] += levels<first>(high[i]) * (Int128{1} << (last - first)) +
                   lowest<middle>(low[i]) * (Int128{1} << (last - middle));
    }
    for (int i = 0; i < Fine; ++i) {
      totals[Coarse + i] += levels<first>(high[Coarse + i]) * (Int128{1} << (last - first)) +
                            levels<middle>(mid[i]) * (Int128{1} << (last - middle)) + lowest<last>(low[Coarse + i]);
    }
  }

 private:
  template <int bits>
  LIESTAT_ALWAYS_INLINE static std::int64_t levels(const D& sum) {
    constexpr double start = magic(bits), units = power(bits);
    double lanes[L];
    V::store(lanes, (sum - start) * units);
    std::int64_t total = 0;
    for (const double x : lanes) total += static_cast<std::int64_t>(x);
    return total;
  }
  template <int bits>
  LIESTAT_ALWAYS_INLINE std::int64_t lowest(const U& sum) const {
    constexpr std::uint64_t start = std::bit_cast<std::uint64_t>(magic(bits));
    std::uint64_t lanes[L], total = 0 - L * rows * start;
    std::memcpy(lanes, &sum, sizeof lanes);
    for (const std::uint64_t x : lanes) total += x;
    return static_cast<std::int64_t>(total);
  }
};

/// The same of one row at a time, in integers: a number's nearest multiple of the unit, ties to even as above.
template <int Coarse, int Fine>
struct SingleSums {
  Int128* totals;

  LIESTAT_ALWAYS_INLINE void coarse(int i, double x) const {
    constexpr double units = power(Fine == 0 ? 60 : 54);
    totals[i] += static_cast<Int128>(std::llrint(x * units)) * (Fine == 0 ? 1 : Int128{1} << 31);
  }
  LIESTAT_ALWAYS_INLINE void fine(int i, double x) const {
    constexpr double units = power(54), rest = 1 / units, last = power(85);
    const long long middle = std::llrint(x * units);
    // From a half on, numbers are multiples of 2^-54, and the middle ones are exact as doubles below.
    const long long low = std::llrint((x - static_cast<double>(middle) * rest) * last);
    totals[Coarse + i] += middle * (Int128{1} << 31) + low;
  }
};

/// The reference of sums, and the largest squared angle from it.
struct Reference {
  double row[4] = {};
  double axes[2][3] = {};  ///< of directions: the tangent axes of S2's placement
  double largest = 0;
};

/// Σ c_k x^k, even and odd powers for themselves so that the two chains overlap. g++ 12 makes a vector of D{} + a
/// constant in memory, of nothing else.
template <const double (&coefficients)[22], class D>
LIESTAT_ALWAYS_INLINE void evaluate(const D& x, D& result) {
  const D square = x * x;
  D even = D{} + coefficients[20], odd = D{} + coefficients[21];
  LIESTAT_UNROLL for (int k = 18; k >= 0; k -= 2) {
    even = even * square + (D{} + coefficients[k]);
    odd = odd * square + (D{} + coefficients[k + 1]);
  }
  result = even + x * odd;
}

/// 1/√x of normal numbers x > 0, to two units in the last place.
template <class D>
LIESTAT_ALWAYS_INLINE void inverseRoot(const D& x, D& y) {
  Lanes<sizeof(D) / 8>::guessInverseRoot(x, y);
  const D half = 0.5 * x;
  for (int i = 0; i < 4; ++i) y = y + y * (0.5 - (half * y) * y);
}

/// 1/√(1+e) of small e.
template <class D>
LIESTAT_ALWAYS_INLINE void unitScale(const D& e, D& scale) {
  scale = 1.0 + e * (-0.5 + e * (0.375 + e * (-0.3125 + e * (0.2734375 + e * (-0.24609375 + e * 0.2255859375)))));
}

/// The unit quaternion (u, w), w >= 0, of the rotation, or rotation of least angle, from the reference to a row, in the
/// reference's axes, with the polynomials there: f u is the logarithm, and g the curvature of ½ θ² across it.
template <class D, int Manifold>
struct Local {
  D u[Manifold], f, g;

  LIESTAT_ALWAYS_INLINE void set(const Reference& r, const D (&x)[Manifold + 1]) {
    if constexpr (Manifold == LIESTAT_ROTATION) {
      const double &a = r.row[0], &b = r.row[1], &c = r.row[2], &d = r.row[3];
      const D w = (a * x[0] + b * x[1]) + (c * x[2] + d * x[3]);
      const D v0 = (d * x[0] - a * x[3]) + (c * x[1] - b * x[2]), v1 = (d * x[1] - b * x[3]) + (a * x[2] - c * x[0]),
              v2 = (d * x[2] - c * x[3]) + (b * x[0] - a * x[1]);
      using V = Lanes<sizeof(D) / 8>;
      u[0] = v0, u[1] = v1, u[2] = v2;
      LIESTAT_UNROLL for (int i = 0; i < 3; ++i) V::turn(w, u[i]);
      D cosine = w;
      V::turn(w, cosine);
      polynomials(cosine);
    } else {
      D p[2], cosine;
      if constexpr (Manifold == LIESTAT_DIRECTION) {
        cosine = (r.row[0] * x[0] + r.row[1] * x[1]) + r.row[2] * x[2];
        for (int i = 0; i < 2; ++i) p[i] = (r.axes[i][0] * x[0] + r.axes[i][1] * x[1]) + r.axes[i][2] * x[2];
      } else {
        cosine = r.row[0] * x[0] + r.row[1] * x[1];
        p[0] = r.row[0] * x[1] - r.row[1] * x[0], p[1] = p[0] * 0.0;
      }
      // cos²(θ/2), below the equator without cancellation.
      const D one_plus = 1.0 + cosine, across = p[0] * p[0] + p[1] * p[1];
      const D square = 0.5 * (cosine < 0.0 ? across / (1.0 - cosine) : one_plus);
      D inverse;
      inverseRoot(square, inverse);
      const D w = square * inverse;
      const auto antipode = square < 1e-30;
      u[0] = antipode ? D{} + 1.0 : 0.5 * (p[0] * inverse);
      if constexpr (Manifold == LIESTAT_DIRECTION) u[1] = antipode ? D{} : 0.5 * (p[1] * inverse);
      polynomials(w);
      if constexpr (Manifold == LIESTAT_DIRECTION) {
        // 1 - θ cot θ = s² (1 + (2 w² - 1) g)/w² by the half angle, of which g has 1 - (θ/2) cot(θ/2) = s² g.
        const D k = (1.0 + (2.0 * square - 1.0) * g) * (inverse * inverse);
        g = k < largest_curvature ? k : D{} + largest_curvature;
      }
    }
  }

 private:
  LIESTAT_ALWAYS_INLINE void polynomials(const D& w) {
    const D x = 1.0 - 2.0 * w;
    evaluate<log_polynomial>(x, f);
    if constexpr (Manifold != LIESTAT_HEADING) evaluate<hessian_polynomial>(x, g);
  }
};

template <int Manifold, int Kind, bool Weighted>
struct StateKernel {
  static constexpr StateLayout layout{Manifold, Kind};
  static constexpr int numbers = layout.numbers(), k = layout.dof();
  static constexpr bool moments = Kind == LIESTAT_MOMENTS;
  /// Sums that are made of each row, as the accumulator counts them. The last diagonal product of moments is Σ p
  /// without the other ones; without weights Σ p and Σ p² are the number of rows, and the last scatter is the first.
  static constexpr int own = moments ? layout.weight() - 1 : layout.weight(), coarse = own + (Weighted ? 2 : 0),
                       fine = moments ? 0 : (Weighted ? 2 : 1) * layout.triangle();
  static constexpr std::size_t block = 256;

  struct Arguments {
    const double* rows;
    const double* weights;
    std::size_t stride, n;
    double scale;  ///< of the weights
    Reference reference;
    Int128 totals[coarse + fine] = {};
    std::size_t kept = 0, left_out = 0;
    bool weighted = false;
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& a) {
    runInLanes<lanesOf(Set)>(a);
  }

  /// A few rows, one after the other.
  static void addSingly(Arguments& a) {
    double row[numbers + 2][1];
    for (std::size_t i = 0; i < a.n; ++i) {
      double e = -1;
      for (int c = 0; c < numbers; ++c) row[c][0] = a.rows[i * a.stride + c], e = e + row[c][0] * row[c][0];
      row[numbers][0] = e;
      if constexpr (Weighted) {
        const double weight = row[numbers + 1][0] = a.weights[i] * a.scale;
        if (!(weight > 0)) continue;
        a.weighted = a.weighted || weight != 1;
      }
      if (!isGood(e)) {
        ++a.left_out;
        continue;
      }
      localise<1>(a.reference, row, 0);
      SingleSums<coarse, fine> sums{a.totals};
      addRows<1>(row, 0, sums, a.reference.largest);
      ++a.kept;
    }
  }

 private:
  template <std::size_t L>
  LIESTAT_ALWAYS_INLINE static void runInLanes(Arguments& a) {
    using V = Lanes<L>;
    Accumulator<L, coarse, fine> sums;
    Accumulator<1, coarse, fine> rest;
    sums.clear(), rest.clear();
    typename V::D largest{};
    double largest_rest = 0;
    alignas(64) double rows[numbers + 2][block];  // the numbers, the squared norm less one, the weight
    std::size_t since = 0;
    for (std::size_t begin = 0; begin < a.n; begin += block) {
      const std::size_t n = stage<L>(a, begin, std::min(block, a.n - begin), rows);
      std::size_t i = 0;
      // Two loops: one would wait for the polynomials, which do not fit into a processor's window with the sums.
      for (; i + L <= n; i += L) localise<L>(a.reference, rows, i);
      if constexpr (L > 1) {
        for (std::size_t j = i; j < n; ++j) localise<1>(a.reference, rows, j);
      }
      for (i = 0; i + L <= n; i += L) addRows<L>(rows, i, sums, largest);
      sums.rows += n / L;
      if constexpr (L > 1) {
        for (; i < n; ++i) addRows<1>(rows, i, rest, largest_rest);
        rest.rows += n % L;
      }
      a.kept += n, since += n;
      if (since + block > Accumulator<L, coarse, fine>::most) {
        sums.flush(a.totals), rest.flush(a.totals);
        sums.clear(), rest.clear();
        since = 0;
      }
    }
    sums.flush(a.totals);
    if constexpr (L > 1) rest.flush(a.totals);
    double lanes[L];
    V::store(lanes, largest);
    for (const double x : lanes) largest_rest = x > largest_rest ? x : largest_rest;
    a.reference.largest = largest_rest;
  }

  /// Good rows of a block, number by number; returns how many there are.
  template <std::size_t L, std::size_t Block>
  LIESTAT_ALWAYS_INLINE static std::size_t stage(Arguments& a, std::size_t begin, std::size_t n,
                                                 double (&rows)[numbers + 2][Block]) {
    using V = Lanes<L>;
    const double* p = a.rows + begin * a.stride;
    typename V::I bad{};
    std::size_t i = 0;
    for (; i + L <= n; i += L, p += L * a.stride) {
      typename V::D e = {};
      e = e - 1.0;
      LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) {
        typename V::D x;
        if constexpr (L == 1) {
          x = p[c];
        } else if constexpr (L == 2) {
          x = typename V::D{p[c], p[a.stride + c]};
        } else if constexpr (L == 4) {
          x = typename V::D{p[c], p[a.stride + c], p[2 * a.stride + c], p[3 * a.stride + c]};
        } else {
          x = typename V::D{p[c],
                            p[a.stride + c],
                            p[2 * a.stride + c],
                            p[3 * a.stride + c],
                            p[4 * a.stride + c],
                            p[5 * a.stride + c],
                            p[6 * a.stride + c],
                            p[7 * a.stride + c]};
        }
        V::store(&rows[c][i], x);
        e = e + x * x;
      }
      V::store(&rows[numbers][i], e);
      if constexpr (L == 1) {
        bad |= isGood(e) ? 0 : -1;
      } else {
        bad |= ~((e < largest_excess) & (e > -largest_excess));
      }
    }
    bool clean = true;
    if constexpr (L == 1) {
      clean = bad == 0;
    } else {
      std::int64_t lanes[L];
      std::memcpy(lanes, &bad, sizeof lanes);
      for (const std::int64_t lane : lanes) clean = clean && lane == 0;
    }
    for (; i < n; ++i, p += a.stride) {
      double e = -1;
      for (int c = 0; c < numbers; ++c) rows[c][i] = p[c], e = e + p[c] * p[c];
      rows[numbers][i] = e;
      clean = clean && isGood(e);
    }
    if constexpr (Weighted) {
      for (std::size_t j = 0; j < n; ++j) {
        const double weight = a.weights[begin + j] * a.scale;
        rows[numbers + 1][j] = weight;
        clean = clean && weight > 0;
        a.weighted = a.weighted || (weight != 1 && weight > 0);
      }
    }
    return clean ? n : compact(a, n, rows);
  }
  LIESTAT_ALWAYS_INLINE static bool isGood(double e) { return e < largest_excess && e > -largest_excess; }
  template <std::size_t Block>
  LIESTAT_NO_INLINE static std::size_t compact(Arguments& a, std::size_t n, double (&rows)[numbers + 2][Block]) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (Weighted && !(rows[numbers + 1][i] > 0)) continue;
      if (!isGood(rows[numbers][i])) {
        ++a.left_out;
        continue;
      }
      for (int c = 0; c <= numbers + (Weighted ? 1 : 0); ++c) rows[c][kept] = rows[c][i];
      ++kept;
    }
    return kept;
  }

  /// For sums, rows become u, f and g, those of headings u and f.
  template <std::size_t L, std::size_t Block>
  LIESTAT_ALWAYS_INLINE static void localise(const Reference& reference, double (&rows)[numbers + 2][Block],
                                             std::size_t i) {
    if constexpr (!moments) {
      using V = Lanes<L>;
      typename V::D x[numbers], e, scale;
      LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) V::load(&rows[c][i], x[c]);
      V::load(&rows[numbers][i], e);
      unitScale(e, scale);
      LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) x[c] = x[c] * scale;
      Local<typename V::D, Manifold> local;
      local.set(reference, x);
      LIESTAT_UNROLL for (int c = 0; c < k; ++c) V::store(&rows[c][i], local.u[c]);
      V::store(&rows[k][i], local.f);
      if constexpr (k > 1) V::store(&rows[k + 1][i], local.g);
    }
  }

  template <std::size_t L, class Sums, class D, std::size_t Block>
  LIESTAT_ALWAYS_INLINE static void addRows(const double (&rows)[numbers + 2][Block], std::size_t i, Sums& sums,
                                            [[maybe_unused]] D& largest) {
    using V = Lanes<L>;
    D x[numbers], e, p{};
    LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) V::load(&rows[c][i], x[c]);
    V::load(&rows[numbers][i], e);
    if constexpr (Weighted) {
      V::load(&rows[numbers + 1][i], p);
      sums.coarse(own, p);
      sums.coarse(own + 1, p * p);
    }
    if constexpr (moments) {
      const D inverse = 1.0 / (1.0 + e);
      if constexpr (layout.linear() > 0) {
        D scale;
        unitScale(e, scale);
        if constexpr (Weighted) scale = p * scale;
        LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) sums.coarse(c, x[c] * scale);
      }
      int product = layout.linear();
      LIESTAT_UNROLL for (int c = 0; c < numbers; ++c) {
        const D scaled = x[c] * (Weighted ? p * inverse : inverse);
        LIESTAT_UNROLL for (int b = 0; b <= c && product < own; ++b) sums.coarse(product++, scaled * x[b]);
      }
    } else {
      // As localise left them: numbers = k + 1, and e is g.
      D z[k], square{};
      LIESTAT_UNROLL for (int c = 0; c < k; ++c) z[c] = x[k] * x[c];
      square = z[0] * z[0];
      LIESTAT_UNROLL for (int c = 1; c < k; ++c) square = square + z[c] * z[c];
      largest = square > largest ? square : largest;
      sums.coarse(layout.fourth(), Weighted ? p * (square * square) : square * square);
      int entry = 0;
      LIESTAT_UNROLL for (int c = 0; c < k; ++c) {
        const D pz = Weighted ? p * z[c] : z[c];
        sums.coarse(layout.gradient() + c, pz);
        [[maybe_unused]] D gu{};
        if constexpr (k > 1) {
          gu = e * x[c];
          if constexpr (Weighted) gu = p * gu;
        }
        LIESTAT_UNROLL for (int b = 0; b <= c; ++b, ++entry) {
          if constexpr (k > 1) sums.coarse(layout.hessian() + entry, gu * x[b]);
          sums.fine(entry, pz * z[b]);
          if constexpr (Weighted) sums.fine(layout.triangle() + entry, p * (pz * z[b]));
        }
      }
    }
  }
};

template <int Manifold, int Kind, bool Weighted>
void addToState(StateView state, const double* rows, std::size_t n, std::size_t stride, const double* weights) {
  using Kernel = StateKernel<Manifold, Kind, Weighted>;
  constexpr StateLayout layout{Manifold, Kind};
  typename Kernel::Arguments a;
  a.rows = rows, a.weights = weights, a.stride = stride, a.n = n;
  a.scale = std::ldexp(1.0, -state.exponent());
  if constexpr (Kind == LIESTAT_SUMS) {
    for (int i = 0; i < layout.numbers(); ++i) a.reference.row[i] = state.reference(i);
    if constexpr (Manifold == LIESTAT_DIRECTION) {
      // The columns of the rotation of least angle from (0, 0, 1), as ManifoldTraits<S2>::placement has it.
      const double x = a.reference.row[0], y = a.reference.row[1], z = a.reference.row[2], across = x * x + y * y;
      const double one_plus = z < 0 ? across / (1 - z) : 1 + z;
      const bool antipode = !(across + one_plus * one_plus > 0);
      const double inverse = antipode ? 0 : 1 / one_plus;
      a.reference.axes[0][0] = 1 - x * x * inverse, a.reference.axes[0][1] = -x * y * inverse,
      a.reference.axes[0][2] = -x;
      a.reference.axes[1][0] = -x * y * inverse, a.reference.axes[1][1] = antipode ? -1 : 1 - y * y * inverse;
      a.reference.axes[1][2] = -y;
    }
  }
  if (n < 8) {
    Kernel::addSingly(a);
  } else {
    runKernel<Kernel>(instructionSet(), a);
  }
  const Int128 ones = static_cast<Int128>(a.kept) * (Int128{1} << layout.unit());
  for (int i = 0; i < Kernel::own; ++i) state.add(layout, i, a.totals[i]);
  for (int i = 0; i < 2; ++i) {
    state.add(layout, layout.weight() + i, Weighted ? a.totals[Kernel::coarse - 2 + i] : ones);
  }
  if constexpr (Kind == LIESTAT_MOMENTS) {
    Int128 last = Weighted ? a.totals[Kernel::own] : ones;
    for (int c = 0; c + 1 < layout.numbers(); ++c) last -= a.totals[layout.linear() + c * (c + 1) / 2 + c];
    state.add(layout, Kernel::own, last);
  } else {
    for (int e = 0; e < layout.triangle(); ++e) {
      state.add(layout, layout.scatter() + e, a.totals[Kernel::coarse + e]);
      state.add(layout, layout.squared() + e, a.totals[Kernel::coarse + (Weighted ? layout.triangle() : 0) + e]);
    }
  }
  if (a.weighted) state.setWeighted();
  state.setCounts(state.n() + a.kept, state.leftOut() + a.left_out);
  if constexpr (Kind == LIESTAT_SUMS) state.setLargest(std::max(state.largest(), a.reference.largest));
}

template <class F>
void withLayout(const StateLayout& layout, const F& f) {
  const auto withKind = [&]<int Manifold>() {
    if (layout.kind == LIESTAT_MOMENTS) {
      f.template operator()<Manifold, LIESTAT_MOMENTS>();
    } else {
      f.template operator()<Manifold, LIESTAT_SUMS>();
    }
  };
  if (layout.manifold == LIESTAT_HEADING) {
    withKind.template operator()<LIESTAT_HEADING>();
  } else if (layout.manifold == LIESTAT_DIRECTION) {
    withKind.template operator()<LIESTAT_DIRECTION>();
  } else {
    withKind.template operator()<LIESTAT_ROTATION>();
  }
}

/// True if rows may have these sums. Each term is rounded by half a unit, and by its own arithmetic before.
bool isPossible(const StateView& state) {
  const StateLayout layout = state.layout();
  const auto n = static_cast<Int128>(state.n());
  const Int128 unit = Int128{1} << layout.unit(), slack = n * (Int128{1} << (layout.unit() - 44));
  const auto within = [&](int i, double low, double high) {
    const Int128 sum = state.sum(i);
    return sum >= static_cast<Int128>(low * 1024) * (unit / 1024) * n - slack &&
           sum <= static_cast<Int128>(high * 1024) * (unit / 1024) * n + slack;
  };
  const Int128 weight = state.sum(layout.weight()), squares = state.sum(layout.weight() + 1);
  if (weight < 0 || weight > n * unit || squares < 0 || squares > weight + slack) return false;
  if (!state.weighted() && (weight != n * unit || squares != n * unit)) return false;
  if (layout.kind == LIESTAT_MOMENTS) {
    for (int i = 0; i < layout.weight(); ++i) {
      if (!within(i, -1, 1)) return false;
    }
    Int128 trace = 0;
    for (int c = 0; c < layout.numbers(); ++c) {
      const Int128 diagonal = state.sum(layout.linear() + c * (c + 1) / 2 + c);
      if (diagonal < -slack) return false;
      trace += diagonal;
    }
    return trace == weight;
  }
  const double largest = state.largest();
  if (!(largest >= 0 && largest <= pi_squared * (1 + 1e-12)) || (n == 0 && largest > 0)) return false;
  for (int i = 0; i < layout.sums(); ++i) {
    const bool fourth = i == layout.fourth(), curvature = i >= layout.hessian() && i < layout.fourth();
    const double bound = fourth ? 97.5 : curvature ? 128 : 9.875;
    if (!within(i, fourth ? 0 : -bound, bound)) return false;
  }
  Int128 trace = 0;
  for (int c = 0; c < layout.dof(); ++c) {
    const Int128 diagonal = state.sum(layout.scatter() + c * (c + 1) / 2 + c);
    if (diagonal < -slack) return false;
    trace += diagonal;
  }
  for (int e = 0; !state.weighted() && e < layout.triangle(); ++e) {
    if (state.sum(layout.squared() + e) != state.sum(layout.scatter() + e)) return false;
  }
  const double scale = std::ldexp(1.0, layout.unit()), allowed = static_cast<double>(slack) / scale;
  const double spread = static_cast<double>(trace) / scale;
  return spread <= largest * (static_cast<double>(weight) / scale) * (1 + 1e-12) + allowed &&
         state.value(layout.fourth()) <= largest * spread * (1 + 1e-12) + allowed;
}

double squaredNorm(const double* row, int numbers) {
  double sum = 0;
  for (int i = 0; i < numbers; ++i) sum += row[i] * row[i];
  return sum;
}

}  // namespace
}  // namespace liestat::detail

using namespace liestat::detail;

const char* liestat_state_error(int code) {
  switch (code) {
    case LIESTAT_STATE_OK:
      return "ok";
    case LIESTAT_STATE_BAD_ARGUMENT:
      return "no such state: headings, directions or rotations, moments or sums at a reference of unit norm";
    case LIESTAT_STATE_BAD_WEIGHT:
      return "a weight is not finite, negative, or above the largest that the state was made for";
    case LIESTAT_STATE_TOO_MANY:
      return "more than 2^33 rows";
    case LIESTAT_STATE_DIFFERENT:
      return "states of different features, kinds, references, weight scales or passes do not merge";
    case LIESTAT_STATE_FOREIGN:
      return "these are not the bytes of a state";
    case LIESTAT_STATE_NEWER_VERSION:
      return "the state is of a newer version of liestat";
    case LIESTAT_STATE_FORGED:
      return "no rows have the numbers of this state: it is damaged";
    default:
      return "unknown error";
  }
}

liestat_state_kind liestat_state_kind_of(const void* state) {
  double copy[2];
  std::memcpy(copy, state, sizeof copy);
  const StateView view(copy);
  const StateLayout layout = view.layout();
  return {layout.manifold, layout.kind, view.exponent(), view.pass(), liestat_state_size(layout.manifold, layout.kind)};
}

size_t liestat_state_size(int manifold, int kind) {
  const StateLayout layout{manifold, kind};
  return layout.exists() ? 8 * layout.words() : 0;
}

int liestat_state_init(void* state, int manifold, int kind, const double* reference, int weight_exponent, int pass) {
  const StateLayout layout{manifold, kind};
  const bool sums = kind == LIESTAT_SUMS;
  if (!layout.exists() || weight_exponent < -1000 || weight_exponent > 1000) return LIESTAT_STATE_BAD_ARGUMENT;
  if (sums && (reference == nullptr || pass < 1 || pass > 65535)) return LIESTAT_STATE_BAD_ARGUMENT;
  double row[4] = {};
  if (sums) {
    const double square = squaredNorm(reference, layout.numbers());
    if (!(std::abs(square - 1) < largest_excess)) return LIESTAT_STATE_BAD_ARGUMENT;
    // A reference that is of unit norm already stays as it is, so that a state's own makes the same state again.
    const double scale = std::abs(square - 1) < 2e-15 ? 1 : 1 / std::sqrt(square);
    for (int i = 0; i < layout.numbers(); ++i) row[i] = reference[i] * scale + 0.0;
  }
  std::memset(state, 0, 8 * layout.words());
  StateView view(state);
  std::memcpy(state, StateLayout::magic, 7);
  view.set(7, StateLayout::version);
  view.set(8, static_cast<std::uint8_t>(manifold)), view.set(9, static_cast<std::uint8_t>(kind));
  view.set(12, static_cast<std::int16_t>(weight_exponent)), view.set(14, static_cast<std::uint16_t>(sums ? pass : 0));
  if (sums) std::memcpy(static_cast<unsigned char*>(state) + 32, row, sizeof row);
  return LIESTAT_STATE_OK;
}

int liestat_state_add(void* state, const double* rows, size_t n, size_t stride, const double* weights) {
  const StateView view(state);
  if (n > StateLayout::max_rows || view.n() + n > StateLayout::max_rows) return LIESTAT_STATE_TOO_MANY;
  if (weights != nullptr) {
    const double largest = std::ldexp(1.0, view.exponent());
    for (std::size_t i = 0; i < n; ++i) {
      if (!(weights[i] >= 0 && weights[i] <= largest)) return LIESTAT_STATE_BAD_WEIGHT;
    }
  } else if (view.exponent() < 0 && n > 0) {
    return LIESTAT_STATE_BAD_WEIGHT;  // without weights they are one
  }
  withLayout(view.layout(), [&]<int Manifold, int Kind>() {
    if (weights != nullptr || view.exponent() != 0) {
      constexpr std::size_t block = 256;
      if (weights != nullptr) return addToState<Manifold, Kind, true>(view, rows, n, stride, weights);
      double ones[block];
      std::fill_n(ones, block, 1.0);
      for (std::size_t i = 0; i < n; i += block) {
        addToState<Manifold, Kind, true>(view, rows + i * stride, std::min(block, n - i), stride, ones);
      }
    } else {
      addToState<Manifold, Kind, false>(view, rows, n, stride, nullptr);
    }
  });
  return LIESTAT_STATE_OK;
}

int liestat_state_merge(void* state, const void* other) {
  StateView to(state);
  double copy[LIESTAT_STATE_LARGEST / 8];
  const StateLayout layout = to.layout();
  std::memcpy(copy, other, 16);
  if (StateView(copy).layout().manifold != layout.manifold || StateView(copy).layout().kind != layout.kind) {
    return LIESTAT_STATE_DIFFERENT;
  }
  std::memcpy(copy, other, 8 * layout.words());
  const StateView from(copy);
  if (to.exponent() != from.exponent() || to.pass() != from.pass()) return LIESTAT_STATE_DIFFERENT;
  for (int i = 0; layout.kind == LIESTAT_SUMS && i < 4; ++i) {
    if (to.get<std::uint64_t>(32 + 8 * i) != from.get<std::uint64_t>(32 + 8 * i)) return LIESTAT_STATE_DIFFERENT;
  }
  if (to.n() + from.n() > StateLayout::max_rows) return LIESTAT_STATE_TOO_MANY;
  for (int i = 0; i < layout.sums(); ++i) to.add(i, from.sum(i));
  to.setCounts(to.n() + from.n(), to.leftOut() + from.leftOut());
  if (from.weighted()) to.setWeighted();
  if (layout.kind == LIESTAT_SUMS) to.setLargest(std::max(to.largest(), from.largest()));
  return LIESTAT_STATE_OK;
}

int liestat_state_read(void* state, const void* bytes, size_t size) {
  if (size < 16 || std::memcmp(bytes, StateLayout::magic, 7) != 0) return LIESTAT_STATE_FOREIGN;
  double copy[LIESTAT_STATE_LARGEST / 8] = {};
  std::memcpy(copy, bytes, std::min<std::size_t>(size, LIESTAT_STATE_LARGEST));
  const StateView view(copy);
  const StateLayout layout = view.layout();
  if (view.get<std::uint8_t>(7) > StateLayout::version) return LIESTAT_STATE_NEWER_VERSION;
  if (view.get<std::uint8_t>(7) != StateLayout::version || !layout.exists() || size != 8 * layout.words()) {
    return LIESTAT_STATE_FOREIGN;
  }
  const bool sums = layout.kind == LIESTAT_SUMS;
  bool good = view.get<std::uint8_t>(10) <= 1 && view.get<std::uint8_t>(11) == 0 && view.n() <= StateLayout::max_rows &&
              view.exponent() >= -1000 && view.exponent() <= 1000 && sums == (view.pass() > 0);
  if (good && sums) {
    double row[4];
    for (int i = 0; i < 4; ++i) row[i] = view.reference(i);
    good = std::abs(squaredNorm(row, layout.numbers()) - 1) < 1e-14;
    for (int i = layout.numbers(); i < 4; ++i) good = good && view.get<std::uint64_t>(32 + 8 * i) == 0;
  }
  if (!good || !isPossible(view)) return LIESTAT_STATE_FORGED;
  std::memcpy(state, bytes, size);
  return LIESTAT_STATE_OK;
}

void liestat_heading(double degrees, double row[2]) {
  if (!std::isfinite(degrees)) {
    row[0] = row[1] = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  // Both remainders are exact. Turns have no last digit of π.
  const double turn = std::remainder(degrees, 360.0), rest = std::remainder(turn, 90.0);
  const int quarter = static_cast<int>((turn - rest) / 90.0) & 3;
  const double x = rest * 0x1.1df46a2529d39p-6, t = x * x;  // π/180
  double sine = 0, cosine = 0;
  for (int k = 10; k >= 1; --k) {
    sine = (1 - sine) * (t / ((2 * k) * (2 * k + 1)));
    cosine = (1 - cosine) * (t / ((2 * k - 1) * (2 * k)));
  }
  const double s = x - x * sine, c = 1 - cosine;
  row[0] = quarter == 0 ? c : quarter == 1 ? -s : quarter == 2 ? -c : s;
  row[1] = quarter == 0 ? s : quarter == 1 ? c : quarter == 2 ? -s : -c;
}
