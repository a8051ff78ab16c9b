// Matches by columns, several at a time: their squared errors under a homography or an epipolar geometry, and the
// normal equations of a Gauss–Newton step on these errors.
#pragma once

#include <fusion/two_view/errors.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace liestat::detail {

/// Four columns x, y, x', y' and one of weights, each as long as a whole number of the largest packs.
class MatchColumns {
  static constexpr std::size_t pack_size = Pack<InstructionSet::avx512>::size;

 public:
  explicit MatchColumns(std::size_t capacity = 0)
      : stride_((capacity + pack_size - 1) / pack_size * pack_size), values_(5 * stride_) {}
  explicit MatchColumns(std::span<const Eigen::Vector4d> matches) : MatchColumns(matches.size()) {
    for (const Eigen::Vector4d& m : matches) add(m, 1);
    pad();
  }

  std::size_t size() const { return size_; }
  const double* column(std::size_t k) const { return values_.data() + k * stride_; }
  void clear() { size_ = 0; }
  /// Within the capacity.
  void add(const Eigen::Vector4d& m, double weight) {
    double* p = values_.data() + size_++;
    for (int k = 0; k < 4; ++k, p += stride_) *p = m[k];
    *p = weight;
  }
  /// Fills the last pack with matches of no weight.
  void pad() {
    for (std::size_t i = size_; i % pack_size != 0; ++i) {
      for (std::size_t k = 0; k < 4; ++k) values_[k * stride_ + i] = values_[k * stride_ + size_ - 1];
      values_[4 * stride_ + i] = 0;
    }
  }

 private:
  std::size_t stride_, size_ = 0;
  std::vector<double> values_;
};

/// Normal equations A δ = -g for the nine entries of a matrix, column after column. A is a sum of Kronecker products, so
/// 36 numbers make it: by a pair of columns and a pair of rows.
struct EntrySums {
  std::array<double, 36> products{};
  std::array<double, 9> gradient{};

  /// Where the pair i ≤ k of three is among six.
  static constexpr std::size_t pair(std::size_t i, std::size_t k) { return i <= k ? i * (5 - i) / 2 + k : pair(k, i); }
  Eigen::Matrix<double, 9, 9> matrix() const {
    Eigen::Matrix<double, 9, 9> A;
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t l = 0; l < 3; ++l) {
        for (std::size_t i = 0; i < 3; ++i) {
          for (std::size_t k = 0; k < 3; ++k) {
            A(static_cast<Eigen::Index>(3 * j + i), static_cast<Eigen::Index>(3 * l + k)) =
                products[6 * pair(i, k) + pair(j, l)];
          }
        }
      }
    }
    return A;
  }
  Eigen::Matrix<double, 9, 1> vector() const { return Eigen::Map<const Eigen::Matrix<double, 9, 1>>(gradient.data()); }
};

/// Contribution of a match to the normal equations: factors of its rows, and its corrected point in the first image.
template <class P>
struct MatchTerms {
  P rows[6];      ///< one for each pair of rows
  P gradient[3];  ///< one for each row
  P x, y;
};

/// A 3×3 matrix for kernels, row by row.
struct KernelMatrix3 {
  double m[3][3];
  explicit KernelMatrix3(const Eigen::Matrix3d& M) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m[i][j] = M(i, j);
    }
  }
};

/// fusion/two_view/errors.hpp, of a pack of matches.
class EpipolarColumns {
 public:
  EpipolarColumns(const Eigen::Matrix3d& F, const MatchNoise& noise)
      : F_(F), v1_(noise.first * noise.first), v2_(noise.second * noise.second) {}

  template <class P>
  LIESTAT_ALWAYS_INLINE P error(const P& x, const P& y, const P& u, const P& v) const {
    const Form<P> f(F_.m, x, y, u, v);
    return f.c * f.c / variance(f);
  }
  /// Variance of ũ'ᵀ F ũ.
  template <class P>
  LIESTAT_ALWAYS_INLINE P variance(const P& x, const P& y, const P& u, const P& v) const {
    return variance(Form<P>(F_.m, x, y, u, v));
  }
  /// The equation is linearised at the match corrected to meet it, so that the derivative of the error's variance counts.
  template <class P>
  LIESTAT_ALWAYS_INLINE void terms(const P& x, const P& y, const P& u, const P& v, const P& weight,
                                   MatchTerms<P>& t) const {
    const Form<P> f(F_.m, x, y, u, v);
    const P inverse = 1.0 / variance(f);
    const P lambda = f.c * inverse, one = lambda * v1_, two = lambda * v2_;
    t.x = x - one * f.d, t.y = y - one * f.e;
    const P p = u - two * f.a, q = v - two * f.b, k = weight * inverse, g = weight * lambda;
    t.rows[0] = k * p * p, t.rows[1] = k * p * q, t.rows[2] = k * p;
    t.rows[3] = k * q * q, t.rows[4] = k * q, t.rows[5] = k;
    t.gradient[0] = g * p, t.gradient[1] = g * q, t.gradient[2] = g;
  }

 private:
  template <class P>
  struct Form {
    P a, b, c, d, e;
    LIESTAT_ALWAYS_INLINE Form(const double (&F)[3][3], const P& x, const P& y, const P& u, const P& v) {
      a = F[0][0] * x + F[0][1] * y + F[0][2], b = F[1][0] * x + F[1][1] * y + F[1][2];
      c = u * a + v * b + (F[2][0] * x + F[2][1] * y + F[2][2]);
      d = F[0][0] * u + F[1][0] * v + F[2][0], e = F[0][1] * u + F[1][1] * v + F[2][1];
    }
  };
  template <class P>
  LIESTAT_ALWAYS_INLINE P variance(const Form<P>& f) const {
    return v1_ * (f.d * f.d + f.e * f.e) + v2_ * (f.a * f.a + f.b * f.b);
  }
  KernelMatrix3 F_;
  double v1_, v2_;
};

/// The same for homographies.
class HomographyColumns {
 public:
  HomographyColumns(const Eigen::Matrix3d& H, const MatchNoise& noise)
      : H_(H), v1_(noise.first * noise.first), v2_(noise.second * noise.second) {}

  template <class P>
  LIESTAT_ALWAYS_INLINE P error(const P& x, const P& y, const P& u, const P& v) const {
    const Form<P> f(H_.m, v1_, v2_, x, y, u, v);
    const P squared =
        (f.s11 * f.c0 * f.c0 - 2.0 * f.s01 * f.c0 * f.c1 + f.s00 * f.c1 * f.c1) / (f.s00 * f.s11 - f.s01 * f.s01);
    return select(f.w > 0.0, squared, squared * 0.0 + std::numeric_limits<double>::infinity());
  }
  template <class P>
  LIESTAT_ALWAYS_INLINE void terms(const P& x, const P& y, const P& u, const P& v, const P& weight,
                                   MatchTerms<P>& t) const {
    const Form<P> f(H_.m, v1_, v2_, x, y, u, v);
    const P inverse = 1.0 / (f.s00 * f.s11 - f.s01 * f.s01);
    const P p00 = f.s11 * inverse, p01 = -f.s01 * inverse, p11 = f.s00 * inverse;
    const P l0 = p00 * f.c0 + p01 * f.c1, l1 = p01 * f.c0 + p11 * f.c1, back = v2_ * f.w;
    t.x = x - v1_ * (f.d00 * l0 + f.d10 * l1), t.y = y - v1_ * (f.d01 * l0 + f.d11 * l1);
    const P p = u - back * l0, q = v - back * l1;
    t.rows[0] = weight * p00, t.rows[1] = weight * p01, t.rows[3] = weight * p11;
    t.rows[2] = -(t.rows[0] * p + t.rows[1] * q), t.rows[4] = -(t.rows[1] * p + t.rows[3] * q);
    t.rows[5] = -(t.rows[2] * p + t.rows[4] * q);
    t.gradient[0] = -weight * l0, t.gradient[1] = -weight * l1;
    t.gradient[2] = -(t.gradient[0] * p + t.gradient[1] * q);
  }

 private:
  template <class P>
  struct Form {
    P w, c0, c1, d00, d01, d10, d11, s00, s01, s11;
    LIESTAT_ALWAYS_INLINE Form(const double (&H)[3][3], double v1, double v2, const P& x, const P& y, const P& u,
                               const P& v) {
      w = H[2][0] * x + H[2][1] * y + H[2][2];
      c0 = w * u - (H[0][0] * x + H[0][1] * y + H[0][2]), c1 = w * v - (H[1][0] * x + H[1][1] * y + H[1][2]);
      d00 = u * H[2][0] - H[0][0], d01 = u * H[2][1] - H[0][1];
      d10 = v * H[2][0] - H[1][0], d11 = v * H[2][1] - H[1][1];
      const P second = v2 * w * w;
      s00 = v1 * (d00 * d00 + d01 * d01) + second, s11 = v1 * (d10 * d10 + d11 * d11) + second;
      s01 = v1 * (d00 * d10 + d01 * d11);
    }
  };
  KernelMatrix3 H_;
  double v1_, v2_;
};

/// Arguments of the kernels below; all columns hold a whole number of packs.
template <class Equation>
struct MatchArguments {
  const Equation& equation;
  std::size_t size;
  const double* columns[5];
  double* values = nullptr;  ///< one number for each match
  double form[6][6] = {};
  EntrySums sums = {};

  template <class P>
  LIESTAT_ALWAYS_INLINE P load(std::size_t column, std::size_t i) const {
    return P::load(columns[column] + i);
  }
  template <class P>
  LIESTAT_ALWAYS_INLINE void store(const P& value, std::size_t i) const {
    if (i + P::size <= size) {
      value.store(values + i);
    } else {
      double last[P::size];
      value.store(last);
      for (std::size_t k = 0; i + k < size; ++k) values[i + k] = last[k];
    }
  }
};

template <class Equation>
struct MatchErrorKernel {
  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(MatchArguments<Equation>& a) {
    using P = Pack<Set>;
    for (std::size_t i = 0; i < a.size; i += P::size) {
      a.store(a.equation.error(a.template load<P>(0, i), a.template load<P>(1, i), a.template load<P>(2, i),
                               a.template load<P>(3, i)),
              i);
    }
  }
};
/// Squared errors of all matches of the columns.
template <class Equation>
void columnErrors(const Equation& equation, const MatchColumns& m, std::span<double> squared) {
  MatchArguments<Equation> a{equation, m.size(), {m.column(0), m.column(1), m.column(2), m.column(3)}, squared.data()};
  runKernel<MatchErrorKernel<Equation>>(instructionSet(), a);
}

struct MatchLeverageKernel {
  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(MatchArguments<EpipolarColumns>& arguments) {
    using P = Pack<Set>;
    const double(&form)[6][6] = arguments.form;
    for (std::size_t i = 0; i < arguments.size; i += P::size) {
      const P a = arguments.load<P>(0, i), b = arguments.load<P>(1, i), p = arguments.load<P>(2, i),
              q = arguments.load<P>(3, i);
      const P rows[5] = {p * p, p * q, p, q * q, q};
      P sum[6];
      LIESTAT_UNROLL for (int k = 0; k < 6; ++k) {
        sum[k] = form[k][0] * rows[0] + form[k][1] * rows[1] + form[k][2] * rows[2] + form[k][3] * rows[3] +
                 form[k][4] * rows[4] + form[k][5];
      }
      const P value = sum[0] * a * a + sum[1] * a * b + sum[2] * a + sum[3] * b * b + sum[4] * b + sum[5];
      arguments.store(value / arguments.equation.variance(a, b, p, q), i);
    }
  }
};
/// Leverage of each match: variance of its equation under a covariance of F's entries, in units of its noise.
inline void columnLeverages(const EpipolarColumns& equation, const Eigen::Matrix<double, 9, 9>& covariance,
                            const MatchColumns& m, std::span<double> leverage) {
  MatchArguments<EpipolarColumns> a{
      equation, m.size(), {m.column(0), m.column(1), m.column(2), m.column(3)}, leverage.data()};
  // The quadratic form of the products of two points: by pairs of columns, each by pairs of rows.
  for (int j = 0; j < 3; ++j) {
    for (int l = j; l < 3; ++l) {
      for (int i = 0; i < 3; ++i) {
        for (int k = i; k < 3; ++k) {
          const double both = covariance(3 * j + i, 3 * l + k) + covariance(3 * j + k, 3 * l + i);
          a.form[EntrySums::pair(static_cast<std::size_t>(j), static_cast<std::size_t>(l))][EntrySums::pair(
              static_cast<std::size_t>(i), static_cast<std::size_t>(k))] = both * (i == k ? 0.5 : 1) * (j == l ? 1 : 2);
        }
      }
    }
  }
  runKernel<MatchLeverageKernel>(instructionSet(), a);
}

/// Squared errors of some of the matches.
template <class Equation>
void someErrors(const Equation& equation, std::span<const Eigen::Vector4d> matches,
                std::span<const std::size_t> measurements, std::span<double> squared) {
  constexpr std::size_t block = 64, largest_pack = Pack<InstructionSet::avx512>::size;
  double columns[4][block];
  for (std::size_t i = 0; i < measurements.size(); i += block) {
    const std::size_t count = measurements.size() - i < block ? measurements.size() - i : block;
    for (std::size_t k = 0; k < count || k % largest_pack != 0; ++k) {
      const Eigen::Vector4d& m = matches[measurements[i + (k < count ? k : 0)]];
      for (std::size_t c = 0; c < 4; ++c) columns[c][k] = m[static_cast<Eigen::Index>(c)];
    }
    MatchArguments<Equation> a{equation, count, {columns[0], columns[1], columns[2], columns[3]}, squared.data() + i};
    runKernel<MatchErrorKernel<Equation>>(instructionSet(), a);
  }
}

template <class Equation>
struct EntrySumsKernel {
  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(MatchArguments<Equation>& a) {
    using P = Pack<Set>;
    P products[36], gradient[9];
    for (P& p : products) p = P::zero();
    for (P& p : gradient) p = P::zero();
    for (std::size_t i = 0; i < a.size; i += P::size) {
      MatchTerms<P> t;
      a.equation.terms(a.template load<P>(0, i), a.template load<P>(1, i), a.template load<P>(2, i),
                       a.template load<P>(3, i), a.template load<P>(4, i), t);
      const P xx = t.x * t.x, xy = t.x * t.y, yy = t.y * t.y;
      LIESTAT_UNROLL for (std::size_t k = 0; k < 6; ++k) {
        P* p = products + 6 * k;
        p[0] += t.rows[k] * xx, p[1] += t.rows[k] * xy, p[2] += t.rows[k] * t.x;
        p[3] += t.rows[k] * yy, p[4] += t.rows[k] * t.y, p[5] += t.rows[k];
      }
      LIESTAT_UNROLL for (std::size_t k = 0; k < 3; ++k) {
        gradient[k] += t.gradient[k] * t.x, gradient[3 + k] += t.gradient[k] * t.y, gradient[6 + k] += t.gradient[k];
      }
    }
    for (std::size_t k = 0; k < 36; ++k) a.sums.products[k] = sumOf(products[k]);
    for (std::size_t k = 0; k < 9; ++k) a.sums.gradient[k] = sumOf(gradient[k]);
  }
};
/// The normal equations of the columns' matches with their weights.
template <class Equation>
EntrySums entrySums(const Equation& equation, const MatchColumns& m) {
  MatchArguments<Equation> a{
      equation, m.size(), {m.column(0), m.column(1), m.column(2), m.column(3), m.column(4)}, nullptr};
  runKernel<EntrySumsKernel<Equation>>(instructionSet(), a);
  return a.sums;
}

}  // namespace liestat::detail
