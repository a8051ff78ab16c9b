// Orthogonal factorisations of a few columns (singular values, triangular factors), which do not square the matrix and
// so decide ranks at 1e-12. One of the headers of small matrices, which lie/detail/small_matrix.hpp lists.
//
// Sizes are run-time numbers of at most `Most`, 13 for SmallMatrix, and everything is plain loops in double: the
// fixed-size expressions of half a dozen sizes took a compiler forty seconds, and these cost it nothing. `Most` may be
// Eigen::Dynamic, which allocates.
#pragma once

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// At most `Size` numbers, zero at first; allocated where that is Eigen::Dynamic.
template <int Size>
struct SmallList : std::array<double, static_cast<std::size_t>(Size)> {
  explicit SmallList(int) : std::array<double, static_cast<std::size_t>(Size)>{} {}
};
template <>
struct SmallList<Eigen::Dynamic> : std::vector<double> {
  explicit SmallList(int n) : std::vector<double>(static_cast<std::size_t>(n)) {}
};

/// A matrix of at most Most×Most in row-major order, zero at first. No allocation.
template <int Most>
struct BasicSmallMatrix {
  static constexpr int most = Most;
  int rows = 0, cols = 0;
  SmallList<Most == Eigen::Dynamic ? Most : Most * Most> value;

  BasicSmallMatrix(int r, int c) : rows(r), cols(c), value(r * c) {}
  static BasicSmallMatrix identity(int n) {
    BasicSmallMatrix m(n, n);
    for (int i = 0; i < n; ++i) m(i, i) = 1;
    return m;
  }
  template <int R, int C>
  static BasicSmallMatrix of(const Eigen::Matrix<double, R, C>& other) {
    BasicSmallMatrix m(R, C);
    for (int i = 0; i < R; ++i) {
      for (int j = 0; j < C; ++j) m(i, j) = other(i, j);
    }
    return m;
  }

  double* row(int i) { return value.data() + i * stride(); }
  const double* row(int i) const { return value.data() + i * stride(); }
  int stride() const { return most == Eigen::Dynamic ? cols : most; }
  double& operator()(int i, int j) { return row(i)[j]; }
  const double& operator()(int i, int j) const { return row(i)[j]; }

  /// The r×c block at (i, j).
  BasicSmallMatrix block(int i, int j, int r, int c) const {
    BasicSmallMatrix m(r, c);
    for (int a = 0; a < r; ++a) {
      for (int b = 0; b < c; ++b) m(a, b) = (*this)(i + a, j + b);
    }
    return m;
  }
  /// Three entries of a column, from row i on.
  Eigen::Vector3d vector3(int i, int column) const {
    return Eigen::Vector3d((*this)(i, column), (*this)(i + 1, column), (*this)(i + 2, column));
  }
  /// The 3×3 block at (i, j).
  Eigen::Matrix3d matrix3(int i, int j) const {
    Eigen::Matrix3d m;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) m(a, b) = (*this)(i + a, j + b);
    }
    return m;
  }
  double norm() const {
    double square = 0;
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < cols; ++j) square += (*this)(i, j) * (*this)(i, j);
    }
    return std::sqrt(square);
  }
  friend BasicSmallMatrix operator*(const BasicSmallMatrix& a, const BasicSmallMatrix& b) {
    BasicSmallMatrix m(a.rows, b.cols);
    for (int i = 0; i < a.rows; ++i) {
      for (int k = 0; k < a.cols; ++k) {
        for (int j = 0; j < b.cols; ++j) m(i, j) += a(i, k) * b(k, j);
      }
    }
    return m;
  }
};

using SmallMatrix = BasicSmallMatrix<13>;

template <int Most>
BasicSmallMatrix<Most> transposed(const BasicSmallMatrix<Most>& a) {
  BasicSmallMatrix<Most> m(a.cols, a.rows);
  for (int i = 0; i < a.rows; ++i) {
    for (int j = 0; j < a.cols; ++j) m(j, i) = a(i, j);
  }
  return m;
}

/// Singular values, descending, of a small square matrix A = U diag(values) Vᵀ by Hestenes' one-sided Jacobi rotations:
/// each value to its own relative accuracy where the columns allow it. u and v hold their vectors in rows. Columns that
/// rotations have reduced to their own rounding errors are not turned any more: of a singular matrix these never become
/// orthogonal, and all sweeps would be spent on them.
template <int Most>
struct SmallSvd {
  int n;
  BasicSmallMatrix<Most> u, v;
  SmallList<Most> values;
  int sweeps = 0;

  explicit SmallSvd(const BasicSmallMatrix<Most>& a)
      : n(a.cols), u(n, n), v(BasicSmallMatrix<Most>::identity(n)), values(n), rounding_(n) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) u(i, j) = a(j, i);
    }
    bool turned = true;
    for (; turned && sweeps < 60; ++sweeps) {
      turned = false;
      for (int p = 0; p < n; ++p) {
        for (int q = p + 1; q < n; ++q) turned = rotate(p, q) || turned;
      }
    }
    sort();
    normalise();
  }
  double value(int k) const { return values[static_cast<std::size_t>(k)]; }

 private:
  double dot(int p, int q) const {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += u(p, i) * u(q, i);
    return sum;
  }
  bool rotate(int p, int q) {
    // Three sums at once, which do not wait for each other.
    const double *x = u.row(p), *y = u.row(q);
    double a = 0, b = 0, c = 0;
    for (int i = 0; i < n; ++i) a += x[i] * x[i], b += y[i] * y[i], c += x[i] * y[i];
    // Written so that NaN ends the sweeps.
    if (!(std::abs(c) > 2 * std::numeric_limits<double>::epsilon() * std::sqrt(a) * std::sqrt(b))) return false;
    double &left = rounding_[static_cast<std::size_t>(p)], &right = rounding_[static_cast<std::size_t>(q)];
    if (a <= left || b <= right) return false;
    const double zeta = (b - a) / (2 * c);
    const double t = std::copysign(1 / (std::abs(zeta) + std::sqrt(1 + zeta * zeta)), zeta),
                 k = 1 / std::sqrt(1 + t * t);
    const double unit = std::pow(8 * std::numeric_limits<double>::epsilon(), 2);
    const double of_p = k * k * (left + unit * a), of_q = k * k * (right + unit * b);
    left = of_p + t * t * of_q, right = t * t * of_p + of_q;
    for (BasicSmallMatrix<Most>* m : {&u, &v}) {
      double *first = m->row(p), *second = m->row(q);
      for (int i = 0; i < n; ++i) {
        const double before = first[i], after = second[i];
        first[i] = k * (before - t * after);
        second[i] = k * (t * before + after);
      }
    }
    return true;
  }
  void sort() {
    for (int i = 0; i < n; ++i) {
      int best = i;
      for (int k = i + 1; k < n; ++k) {
        if (dot(k, k) > dot(best, best)) best = k;
      }
      if (best == i) continue;
      std::swap(rounding_[static_cast<std::size_t>(i)], rounding_[static_cast<std::size_t>(best)]);
      for (int j = 0; j < n; ++j) {
        std::swap(u(i, j), u(best, j));
        std::swap(v(i, j), v(best, j));
      }
    }
  }
  void normalise() {
    for (int i = 0; i < n; ++i) {
      const double length = std::sqrt(dot(i, i));
      values[static_cast<std::size_t>(i)] = length;
      for (int j = 0; j < n && length > 0; ++j) u(i, j) /= length;
      if (length * length <= rounding_[static_cast<std::size_t>(i)]) complete(i);
    }
  }
  /// The image of a null vector says nothing: the unit vector that is furthest from the rows before, made orthogonal.
  void complete(int i) {
    int furthest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (int unit = 0; unit < n; ++unit) {
      double within = 0;
      for (int k = 0; k < i; ++k) within += u(k, unit) * u(k, unit);
      if (within < least) least = within, furthest = unit;
    }
    for (int j = 0; j < n; ++j) u(i, j) = j == furthest;
    for (int pass = 0; pass < 2; ++pass) {
      for (int k = 0; k < i; ++k) {
        const double along = dot(i, k);
        for (int j = 0; j < n; ++j) u(i, j) -= along * u(k, j);
      }
    }
    const double length = std::sqrt(dot(i, i));
    for (int j = 0; j < n; ++j) u(i, j) /= length;
  }

  SmallList<Most> rounding_;  // squares: what the rotations left in each column
};

/// The pseudo-inverse of a symmetric positive semi-definite 3×3 matrix; eigenvalues below 1e-12 of the trace are zero.
inline Eigen::Matrix3d pseudoInverse(const Eigen::Matrix3d& H, int& rank) {
  const SmallSvd svd(SmallMatrix::of<3, 3>(H));
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  rank = 0;
  for (int k = 0; k < 3; ++k) {
    if (!(svd.value(k) > 1e-12 * H.trace())) continue;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) inverse(i, j) += svd.v(k, i) * svd.v(k, j) / svd.value(k);
    }
    ++rank;
  }
  return inverse;
}

/// The triangular factor R of rows that come in a few at a time, by Householder reflections: RᵀR is the sum of the
/// rows' squares, R loses none of their digits.
struct Triangle {
  SmallMatrix r;

  explicit Triangle(int n) : r(n, n) {}
  int size() const { return r.cols; }

  /// Adds rows, which are used up; the first `from` columns of them are zero.
  void add(SmallMatrix& rows, int from = 0) {
    const int n = size(), count = rows.rows;
    for (int c = from; c < n; ++c) {
      double below = 0;
      for (int b = 0; b < count; ++b) below += rows(b, c) * rows(b, c);
      if (below == 0) continue;
      const double old = r(c, c), norm = std::copysign(std::sqrt(old * old + below), old), head = old + norm;
      const double scale = 1 / (norm * head);
      r(c, c) = -norm;
      // Row by row, so that the inner loops run along memory.
      std::array<double, SmallMatrix::most> product;
      double* top = r.row(c);
      for (int d = c + 1; d < n; ++d) product[static_cast<std::size_t>(d)] = head * top[d];
      for (int b = 0; b < count; ++b) {
        const double* row = rows.row(b);
        const double factor = row[c];
        for (int d = c + 1; d < n; ++d) product[static_cast<std::size_t>(d)] += factor * row[d];
      }
      for (int d = c + 1; d < n; ++d) {
        product[static_cast<std::size_t>(d)] *= scale;
        top[d] -= head * product[static_cast<std::size_t>(d)];
      }
      for (int b = 0; b < count; ++b) {
        double* row = rows.row(b);
        const double factor = row[c];
        for (int d = c + 1; d < n; ++d) row[d] -= factor * product[static_cast<std::size_t>(d)];
      }
    }
  }
  /// Adds the rows of another.
  void add(const Triangle& other) {
    SmallMatrix copy = other.r;
    add(copy);
  }
  /// The inverse of the leading n×n block; unknowns without a pivot are zero.
  SmallMatrix inverse(int n) const {
    SmallMatrix x(n, n);
    for (int c = 0; c < n; ++c) {
      for (int i = c; i >= 0; --i) {
        double sum = i == c ? 1 : 0;
        for (int k = i + 1; k <= c; ++k) sum -= r(i, k) * x(k, c);
        x(i, c) = r(i, i) != 0 ? sum / r(i, i) : 0;
      }
    }
    return x;
  }
  /// Cholesky's factor of a symmetric positive semi-definite matrix, with a row of zeros where nothing but rounding is
  /// left.
  static Triangle cholesky(SmallMatrix A) {
    const int n = A.cols;
    Triangle root(n);
    std::array<double, SmallMatrix::most> before;
    for (int k = 0; k < n; ++k) before[static_cast<std::size_t>(k)] = A(k, k);
    for (int k = 0; k < n; ++k) {
      if (!(A(k, k) > 1e-13 * before[static_cast<std::size_t>(k)])) continue;
      const double pivot = std::sqrt(A(k, k));
      for (int j = k; j < n; ++j) root.r(k, j) = A(k, j) / pivot;
      for (int i = k + 1; i < n; ++i) {
        for (int j = i; j < n; ++j) A(i, j) -= root.r(k, i) * root.r(k, j);
      }
    }
    return root;
  }
};

/// The first unknowns a of |R (a, b)|² taken out: a = -gain b at the minimum (of least norm, where R leaves directions
/// of a free), rest the factor of what remains for b.
struct LeadingElimination {
  SmallMatrix gain;
  Triangle rest;
  int rank = 0;

  /// A direction of the first `n` unknowns is free where its singular value is at most `tolerance` (absolute).
  LeadingElimination(const Triangle& factor, int n, double tolerance)
      : gain(n, factor.size() - n), rest(factor.size() - n) {
    const int m = factor.size() - n;
    const SmallSvd svd(factor.r.block(0, 0, n, n));
    rest.r = factor.r.block(n, n, m, m);
    for (int k = 0; k < n; ++k) {
      SmallMatrix right(1, m);
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < m; ++j) right(0, j) += svd.u(k, i) * factor.r(i, n + j);
      }
      if (svd.value(k) > tolerance) {
        ++rank;
        for (int i = 0; i < n; ++i) {
          for (int j = 0; j < m; ++j) gain(i, j) += svd.v(k, i) * right(0, j) / svd.value(k);
        }
      } else {
        rest.add(right);
      }
    }
  }
};

}  // namespace liestat::detail
