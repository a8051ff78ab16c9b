// 3×3 matrices as columns of four numbers, the fourth of no meaning: a column is one vector register where there are
// registers of four, so that a product is nine multiply-adds, and every number is read as it was written. Eigen's own
// 3×3 products are scalar, and its copies in pairs wait for numbers that were stored one by one. One of the headers of
// small matrices, which lie/detail/small_matrix.hpp lists.
#pragma once

#include <Eigen/Core>

namespace liestat::detail {

template <class S>
struct Columns {
  using Column = Eigen::Array<S, 4, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  Column c0, c1, c2;

  static Columns zero() { return {Column::Zero(), Column::Zero(), Column::Zero()}; }
  /// Unit columns. What is a multiple of them is made in registers; four numbers that are stored one by one and read as
  /// a column cost a wait each time.
  static EIGEN_ALWAYS_INLINE Column e0() { return Column(S(1), S(0), S(0), S(0)); }
  static EIGEN_ALWAYS_INLINE Column e1() { return Column(S(0), S(1), S(0), S(0)); }
  static EIGEN_ALWAYS_INLINE Column e2() { return Column(S(0), S(0), S(1), S(0)); }
  static EIGEN_ALWAYS_INLINE Column column(const S& x, const S& y, const S& z) {
    return e0() * x + e1() * y + e2() * z;
  }
  static EIGEN_ALWAYS_INLINE Column column(const Vector3& v) { return column(v[0], v[1], v[2]); }
  static EIGEN_ALWAYS_INLINE Columns of(const Matrix3& m) {
    return {column(m(0, 0), m(1, 0), m(2, 0)), column(m(0, 1), m(1, 1), m(2, 1)), column(m(0, 2), m(1, 2), m(2, 2))};
  }
  /// [u]: the matrix of u × ·.
  static EIGEN_ALWAYS_INLINE Columns skew(const Vector3& u) {
    return {e1() * u[2] - e2() * u[1], e2() * u[0] - e0() * u[2], e0() * u[1] - e1() * u[0]};
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
  EIGEN_ALWAYS_INLINE void operator-=(const Columns& b) {
    c0 -= b.c0;
    c1 -= b.c1;
    c2 -= b.c2;
  }
  /// += A B, and += A Bᵀ.
  EIGEN_ALWAYS_INLINE void addProduct(const Columns& a, const Columns& b) {
    c0 += a.times(b.c0);
    c1 += a.times(b.c1);
    c2 += a.times(b.c2);
  }
  EIGEN_ALWAYS_INLINE void addProductTransposed(const Columns& a, const Columns& b) {
    c0 += a.c0 * b.c0[0] + a.c1 * b.c1[0] + a.c2 * b.c2[0];
    c1 += a.c0 * b.c0[1] + a.c1 * b.c1[1] + a.c2 * b.c2[1];
    c2 += a.c0 * b.c0[2] + a.c1 * b.c1[2] + a.c2 * b.c2[2];
  }
  /// A Bᵀ.
  EIGEN_ALWAYS_INLINE Columns timesTransposed(const Columns& b) const {
    return {c0 * b.c0[0] + c1 * b.c1[0] + c2 * b.c2[0], c0 * b.c0[1] + c1 * b.c1[1] + c2 * b.c2[1],
            c0 * b.c0[2] + c1 * b.c1[2] + c2 * b.c2[2]};
  }
  EIGEN_ALWAYS_INLINE void addDiagonal(const S& s) {
    c0 += e0() * s;
    c1 += e1() * s;
    c2 += e2() * s;
  }
};

/// a bᵀ.
template <class S>
EIGEN_ALWAYS_INLINE Columns<S> outer(const typename Columns<S>::Column& a, const Eigen::Matrix<S, 3, 1>& b) {
  return {a * b[0], a * b[1], a * b[2]};
}

}  // namespace liestat::detail
