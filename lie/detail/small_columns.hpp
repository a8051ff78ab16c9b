// 3×3 matrices as columns of four numbers, the fourth of no meaning: a column is one vector register where there are
// registers of four, so that a product is nine multiply-adds, and every number is read as it was written. Eigen's own
// 3×3 products are scalar, and its copies in pairs wait for numbers that were stored one by one. One of the headers of
// small matrices, which lie/detail/small_matrix.hpp lists.
#pragma once

#include <lie/detail/lanes.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <type_traits>

namespace liestat::detail {

#if defined(__GNUC__)
/// Four numbers in one vector register, or in two. In memory they are the same with all flags.
template <class S>
struct ColumnLanes {
#if defined(__AVX__)
  static constexpr int lanes = 4;
#else
  static constexpr int lanes = std::is_same_v<S, float> ? 4 : 2;
#endif
  static constexpr std::size_t vectors = 4 / lanes;
  typedef S Vector __attribute__((vector_size(lanes * sizeof(S)), aligned(16)));

  Vector v[vectors];

  ColumnLanes() = default;
  EIGEN_ALWAYS_INLINE ColumnLanes(const S& x, const S& y, const S& z, const S& rest) {
    if constexpr (lanes == 4) {
      v[0] = Vector{x, y, z, rest};
    } else {
      v[0] = Vector{x, y}, v[vectors - 1] = Vector{z, rest};
    }
  }
  EIGEN_ALWAYS_INLINE S operator[](int i) const { return v[i / lanes][i % lanes]; }
  EIGEN_ALWAYS_INLINE ColumnLanes& operator+=(const ColumnLanes& other) {
    v[0] += other.v[0];
    if constexpr (vectors == 2) v[vectors - 1] += other.v[vectors - 1];
    return *this;
  }
  EIGEN_ALWAYS_INLINE ColumnLanes& operator-=(const ColumnLanes& other) {
    v[0] -= other.v[0];
    if constexpr (vectors == 2) v[vectors - 1] -= other.v[vectors - 1];
    return *this;
  }
  EIGEN_ALWAYS_INLINE ColumnLanes& operator*=(const S& s) {
    v[0] *= s;
    if constexpr (vectors == 2) v[vectors - 1] *= s;
    return *this;
  }
  friend EIGEN_ALWAYS_INLINE ColumnLanes operator+(ColumnLanes a, const ColumnLanes& b) { return a += b; }
  friend EIGEN_ALWAYS_INLINE ColumnLanes operator-(ColumnLanes a, const ColumnLanes& b) { return a -= b; }
  friend EIGEN_ALWAYS_INLINE ColumnLanes operator*(ColumnLanes a, const S& s) { return a *= s; }
};

/// The first three of the rows of three columns.
template <class S>
EIGEN_ALWAYS_INLINE void transposeLanes(const ColumnLanes<S>& a, const ColumnLanes<S>& b, const ColumnLanes<S>& c,
                                        ColumnLanes<S>& x, ColumnLanes<S>& y, ColumnLanes<S>& z) {
  if constexpr (ColumnLanes<S>::lanes == 4) {
    const auto even = __builtin_shufflevector(a.v[0], b.v[0], 0, 4, 2, 6);
    const auto odd = __builtin_shufflevector(a.v[0], b.v[0], 1, 5, 3, 7);
    x.v[0] = __builtin_shufflevector(even, c.v[0], 0, 1, 4, 5);
    y.v[0] = __builtin_shufflevector(odd, c.v[0], 0, 1, 5, 4);
    z.v[0] = __builtin_shufflevector(even, c.v[0], 2, 3, 6, 7);
  } else {
    x.v[0] = __builtin_shufflevector(a.v[0], b.v[0], 0, 2), x.v[1] = c.v[0];
    y.v[0] = __builtin_shufflevector(a.v[0], b.v[0], 1, 3), y.v[1] = __builtin_shufflevector(c.v[0], c.v[0], 1, 0);
    z.v[0] = __builtin_shufflevector(a.v[1], b.v[1], 0, 2), z.v[1] = c.v[1];
  }
}

template <class S>
using ColumnOf = std::conditional_t<has_lanes<S>, ColumnLanes<S>, Eigen::Array<S, 4, 1>>;
#else
template <class S>
using ColumnOf = Eigen::Array<S, 4, 1>;
#endif

template <class S>
struct Columns {
  using Column = ColumnOf<S>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  Column c0, c1, c2;

  static Columns zero() { return {column(S(0), S(0), S(0)), column(S(0), S(0), S(0)), column(S(0), S(0), S(0))}; }
  static EIGEN_ALWAYS_INLINE Column column(const S& x, const S& y, const S& z) { return Column(x, y, z, S(0)); }
  static EIGEN_ALWAYS_INLINE Column column(const Vector3& v) { return column(v[0], v[1], v[2]); }
  static EIGEN_ALWAYS_INLINE Columns of(const Matrix3& m) {
    return {column(m(0, 0), m(1, 0), m(2, 0)), column(m(0, 1), m(1, 1), m(2, 1)), column(m(0, 2), m(1, 2), m(2, 2))};
  }
  /// [u]: the matrix of u × ·.
  static EIGEN_ALWAYS_INLINE Columns skew(const Vector3& u) {
    return {column(S(0), u[2], -u[1]), column(-u[2], S(0), u[0]), column(u[1], -u[0], S(0))};
  }

  EIGEN_ALWAYS_INLINE Columns transposed() const {
    if constexpr (has_lanes<S>) {
      Columns r;
      transposeLanes(c0, c1, c2, r.c0, r.c1, r.c2);
      return r;
    } else {
      return {column(c0[0], c1[0], c2[0]), column(c0[1], c1[1], c2[1]), column(c0[2], c1[2], c2[2])};
    }
  }

  Matrix3 matrix() const {
    Matrix3 m;
    m << c0[0], c1[0], c2[0], c0[1], c1[1], c2[1], c0[2], c1[2], c2[2];
    return m;
  }
  EIGEN_ALWAYS_INLINE Vector3 operator*(const Vector3& v) const {
    const Column r = c0 * v[0] + c1 * v[1] + c2 * v[2];
    return Vector3(r[0], r[1], r[2]);
  }
  EIGEN_ALWAYS_INLINE Column times(const Column& v) const { return c0 * v[0] + c1 * v[1] + c2 * v[2]; }
  EIGEN_ALWAYS_INLINE Columns operator*(const Columns& b) const { return {times(b.c0), times(b.c1), times(b.c2)}; }
  EIGEN_ALWAYS_INLINE Columns operator*(const S& s) const { return {c0 * s, c1 * s, c2 * s}; }
  EIGEN_ALWAYS_INLINE Columns operator+(const Columns& b) const { return {c0 + b.c0, c1 + b.c1, c2 + b.c2}; }
  EIGEN_ALWAYS_INLINE void operator+=(const Columns& b) {
    c0 += b.c0;
    c1 += b.c1;
    c2 += b.c2;
  }
  // Sums of products are added one by one, so that each is one instruction where multiplications and additions fuse.
  /// += A B.
  EIGEN_ALWAYS_INLINE void addProduct(const Columns& a, const Columns& b) {
    addTo(c0, a, b.c0[0], b.c0[1], b.c0[2]);
    addTo(c1, a, b.c1[0], b.c1[1], b.c1[2]);
    addTo(c2, a, b.c2[0], b.c2[1], b.c2[2]);
  }
  /// A Bᵀ.
  EIGEN_ALWAYS_INLINE Columns timesTransposed(const Columns& b) const {
    return {c0 * b.c0[0] + c1 * b.c1[0] + c2 * b.c2[0], c0 * b.c0[1] + c1 * b.c1[1] + c2 * b.c2[1],
            c0 * b.c0[2] + c1 * b.c1[2] + c2 * b.c2[2]};
  }
  /// A [u]: a product with a skew matrix takes six multiplications of columns in place of nine, by three numbers in place
  /// of nine.
  EIGEN_ALWAYS_INLINE Columns timesSkew(const Vector3& u) const {
    return {c1 * u[2] - c2 * u[1], c2 * u[0] - c0 * u[2], c0 * u[1] - c1 * u[0]};
  }
  /// += A [u].
  EIGEN_ALWAYS_INLINE void addTimesSkew(const Columns& a, const Vector3& u) {
    c0 += a.c1 * u[2];
    c1 += a.c2 * u[0];
    c2 += a.c0 * u[1];
    c0 -= a.c2 * u[1];
    c1 -= a.c0 * u[2];
    c2 -= a.c1 * u[0];
  }
  /// += s A.
  EIGEN_ALWAYS_INLINE void addScaled(const Columns& a, const S& s) {
    c0 += a.c0 * s;
    c1 += a.c1 * s;
    c2 += a.c2 * s;
  }
  /// += a bᵀ.
  EIGEN_ALWAYS_INLINE void addOuter(const Column& a, const Vector3& b) {
    c0 += a * b[0];
    c1 += a * b[1];
    c2 += a * b[2];
  }
  EIGEN_ALWAYS_INLINE void addDiagonal(const S& s) {
    c0 += column(S(1), S(0), S(0)) * s;
    c1 += column(S(0), S(1), S(0)) * s;
    c2 += column(S(0), S(0), S(1)) * s;
  }

 private:
  static EIGEN_ALWAYS_INLINE void addTo(Column& to, const Columns& a, const S& x, const S& y, const S& z) {
    to += a.c0 * x;
    to += a.c1 * y;
    to += a.c2 * z;
  }
};

/// a bᵀ.
template <class S>
EIGEN_ALWAYS_INLINE Columns<S> outer(const typename Columns<S>::Column& a, const Eigen::Matrix<S, 3, 1>& b) {
  return {a * b[0], a * b[1], a * b[2]};
}

}  // namespace liestat::detail
