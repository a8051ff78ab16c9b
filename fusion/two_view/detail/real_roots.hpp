// All real roots of a polynomial, those at and near infinity too.
//
// A quarter of the projective line at a time is mapped to [0, 1], the polynomial written in Bernstein's basis there and
// halved until its coefficients change sign at most once; that is stable, where Sturm's chain of a polynomial of degree
// ten loses its signs to rounding. Then Newton's method within the bracket. (J. Lane, R. Riesenfeld, "Bounds on a
// polynomial", BIT 21, 1981.)
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// Roots (z : w) of Σ a_k z^k w^(N-k), max(|z|, |w|) = 1. Two roots closer than about 1e-7 may be given as one, and so
/// may two that are complex and that close to the real line.
template <std::size_t N>
class RealRoots {
 public:
  struct Root {
    double z, w;
  };

  /// Roots to the given step of Newton's method. NaN and the zero polynomial have no roots.
  explicit RealRoots(const std::array<double, N + 1>& a, double tolerance = 1e-15) : tolerance_(tolerance) {
    double size = 0;
    for (const double x : a) size += std::abs(x);
    if (!(size > 0) || !std::isfinite(size)) return;
    for (int quarter = 0; quarter < 4; ++quarter) {
      negative_ = quarter % 2 == 1;
      reversed_ = quarter >= 2;
      for (int k = 0; k <= n; ++k) {
        const double x = a[index(reversed_ ? n - k : k)];
        polynomial_[index(k)] = negative_ && k % 2 == 1 ? -x : x;
      }
      search();
    }
  }

  int size() const { return size_; }
  const Root& operator[](int i) const { return roots_[index(i)]; }

 private:
  static constexpr int n = static_cast<int>(N), max_depth = 24;
  static constexpr std::size_t index(int k) { return static_cast<std::size_t>(k); }
  struct Piece {
    double b[N + 1];
    double low, width;
    int depth;
  };

  void keep(double x) {
    if (size_ == n) return;
    const double value = negative_ ? -x : x;
    roots_[index(size_++)] = reversed_ ? Root{negative_ ? -1. : 1., x} : Root{value, 1};
  }
  /// Changes of sign, zeros left out; two or more count as two.
  static int changes(const double* b) {
    unsigned negative = 0, known = 0;
    for (int k = 0; k <= n; ++k) {
      negative |= (b[k] < 0 ? 1U : 0U) << k;
      known |= (b[k] != 0 ? 1U : 0U) << k;
    }
    if (known != (2U << n) - 1) {
      // A zero takes the sign of the one before it, those at the front that of the first other one.
      unsigned last = known == 0 ? 0 : (negative / (known & (~known + 1))) & 1U;
      for (int k = 0; k <= n; ++k) {
        if ((known >> k & 1U) != 0) last = negative >> k & 1U;
        negative |= last << k;
      }
    }
    const unsigned changed = (negative ^ (negative >> 1)) & ((1U << n) - 1);
    return changed == 0 ? 0 : (changed & (changed - 1)) == 0 ? 1 : 2;
  }

  /// The roots in [0, 1) of a quarter that begins with 0 or infinity on the positive side, in (0, 1) of the negative
  /// ones; those near infinity include their ends ±1.
  void search() {
    Piece stack[max_depth + 2];
    Piece& all = stack[0];
    double binomial = 1;
    for (int k = 0; k <= n; ++k) {
      all.b[k] = polynomial_[index(k)] / binomial;
      binomial *= static_cast<double>(n - k) / (k + 1);
    }
    for (int row = 1; row <= n; ++row) {
      for (int k = n; k >= row; --k) all.b[k] += all.b[k - 1];
    }
    all.low = 0;
    all.width = 1;
    all.depth = 0;
    if (reversed_ && all.b[N] == 0) keep(1);
    for (int top = 0; top >= 0;) {
      Piece& piece = stack[top];
      if (piece.b[0] == 0 && (piece.low > 0 || !negative_)) keep(piece.low);
      const int count = changes(piece.b);
      if (count <= 1 || piece.depth == max_depth) {
        if (count == 1) refine(piece);
        if (count > 1) keep(piece.low + 0.5 * piece.width);
        --top;
        continue;
      }
      // The right half takes the place of the whole, the left half goes on top.
      Piece& left = stack[top + 1];
      left.b[0] = piece.b[0];
      for (int row = 1; row <= n; ++row) {
        for (int k = 0; k <= n - row; ++k) piece.b[k] = 0.5 * (piece.b[k] + piece.b[k + 1]);
        left.b[row] = piece.b[0];
      }
      left.low = piece.low;
      left.width = piece.width *= 0.5;
      piece.low += piece.width;
      left.depth = ++piece.depth;
      ++top;
    }
  }

  void refine(const Piece& piece) {
    double low = piece.low, high = low + piece.width, first = 0;
    for (int k = 0; first == 0; ++k) first = piece.b[k];
    const double p0 = piece.b[0], p1 = piece.b[N];
    double x = p0 * p1 < 0 ? low + piece.width * p0 / (p0 - p1) : 0.5 * (low + high);
    for (int i = 0; i < 60; ++i) {
      double p = polynomial_[N], slope = 0;
      for (int k = n - 1; k >= 0; --k) {
        slope = slope * x + p;
        p = p * x + polynomial_[index(k)];
      }
      if (p == 0) break;
      ((p > 0) == (first > 0) ? low : high) = x;
      const double step = p / slope;
      double next = x - step;
      if (std::abs(step) <= tolerance_ || high - low <= tolerance_) break;
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      x = next;
    }
    keep(x);
  }

  std::array<double, N + 1> polynomial_{};
  std::array<Root, N> roots_{};
  double tolerance_;
  int size_ = 0;
  bool negative_ = false, reversed_ = false;
};

}  // namespace liestat::detail
