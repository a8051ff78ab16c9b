// The cubic equations of the five-point problem, their elimination, and the polishing of a root.
#pragma once

#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace liestat::detail {

/// Polynomials in (x, y, z, 1): linear ones by x, y, z, 1; quadratic ones by x² xy y² xz yz z² x y z 1; cubic ones by
/// x³ y³ x²y xy² x²z x² y²z y² xyz xy | xz² xz x yz² yz y z³ z² z 1.
struct Cubics {
  /// q += a b.
  static void addProduct(const double* a, const double* b, double* q) {
    q[0] += a[0] * b[0];
    q[1] += a[0] * b[1] + a[1] * b[0];
    q[2] += a[1] * b[1];
    q[3] += a[0] * b[2] + a[2] * b[0];
    q[4] += a[1] * b[2] + a[2] * b[1];
    q[5] += a[2] * b[2];
    q[6] += a[0] * b[3] + a[3] * b[0];
    q[7] += a[1] * b[3] + a[3] * b[1];
    q[8] += a[2] * b[3] + a[3] * b[2];
    q[9] += a[3] * b[3];
  }
  /// c += q l.
  static void addCubic(const double* q, const double* l, double* c) {
    const double x = l[0], y = l[1], z = l[2], w = l[3];
    c[0] += q[0] * x;
    c[1] += q[2] * y;
    c[2] += q[0] * y + q[1] * x;
    c[3] += q[1] * y + q[2] * x;
    c[4] += q[0] * z + q[3] * x;
    c[5] += q[0] * w + q[6] * x;
    c[6] += q[2] * z + q[4] * y;
    c[7] += q[2] * w + q[7] * y;
    c[8] += q[1] * z + q[3] * y + q[4] * x;
    c[9] += q[1] * w + q[6] * y + q[7] * x;
    c[10] += q[3] * z + q[5] * x;
    c[11] += q[3] * w + q[6] * z + q[8] * x;
    c[12] += q[6] * w + q[9] * x;
    c[13] += q[4] * z + q[5] * y;
    c[14] += q[4] * w + q[7] * z + q[8] * y;
    c[15] += q[7] * w + q[9] * y;
    c[16] += q[5] * z;
    c[17] += q[5] * w + q[8] * z;
    c[18] += q[8] * w + q[9] * z;
    c[19] += q[9] * w;
  }
};

/// Nistér's elimination.
class FivePointEquations {
 public:
  /// The smallest pivot, of coefficients of order one: zero where the ten equations do not determine the ten highest
  /// monomials; all digits but its own are left in the result.
  double eliminate(const Eigen::Matrix<double, 10, 4>& basis) {
    // An equation a column.
    Eigen::Matrix<double, 20, 10> a;
    double smallest = 1;
    fill(basis, a);
    // Those before the last six are needed only to clear what comes after.
    for (int j = 0; j < 10; ++j) {
      int pivot = j;
      for (int i = j + 1; i < 10; ++i) pivot = std::abs(a(j, i)) > std::abs(a(j, pivot)) ? i : pivot;
      smallest = std::min(smallest, std::abs(a(j, pivot)));
      if (!(smallest > 1e-14)) return 0;
      if (pivot != j) a.col(j).swap(a.col(pivot));
      a.col(j) *= 1 / a(j, j);
      for (int i = j + 1; i < 10; ++i) a.col(i) -= a(j, i) * a.col(j);
    }
    for (int j = 9; j > 4; --j) {
      for (int i = 4; i < j; ++i) a.col(i).tail<10>() -= a(j, i) * a.col(j).tail<10>();
    }
    // Equations 4 to 9 begin with x²z, x², y²z, y², xyz, xy: each pair gives an equation without these.
    for (int i = 0; i < 3; ++i) {
      const double *p = a.data() + 20 * (4 + 2 * i) + 10, *q = p + 20;
      for (int v = 0; v < 2; ++v) {
        // By z⁰ to z³ times x, or y.
        double* b = v == 0 ? x_[i] : y_[i];
        const double *s = p + 3 * v, *t = q + 3 * v;
        b[0] = s[2];
        b[1] = s[1] - t[2];
        b[2] = s[0] - t[1];
        b[3] = -t[0];
      }
      one_[i][0] = p[9];
      one_[i][1] = p[8] - q[9];
      one_[i][2] = p[7] - q[8];
      one_[i][3] = p[6] - q[7];
      one_[i][4] = -q[6];
    }
    return smallest;
  }

  /// The determinant of the three equations, by z⁰ to z¹⁰.
  std::array<double, 11> determinant() const {
    std::array<double, 11> d{};
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      double minor[7] = {};
      for (int r = 0; r < 4; ++r) {
        for (int s = 0; s < 4; ++s) minor[r + s] += x_[j][r] * y_[k][s] - x_[k][r] * y_[j][s];
      }
      for (std::size_t r = 0; r < 5; ++r) {
        for (std::size_t s = 0; s < 7; ++s) d[r + s] += one_[i][r] * minor[s];
      }
    }
    return d;
  }

  /// The unit multiple of (x, y, z, 1) at the root (z : w).
  Eigen::Vector4d coefficients(double z, double w) const {
    Eigen::Matrix3d B;
    for (int i = 0; i < 3; ++i) {
      double x = 0, y = 0, one = 0, power = 1;
      if (w == 1) {
        for (int k = 3; k >= 0; --k) {
          x = x * z + x_[i][k];
          y = y * z + y_[i][k];
        }
        for (int k = 4; k >= 0; --k) one = one * z + one_[i][k];
      } else {
        // All by z = ±1: powers of w, the lowest first; signs go with z.
        for (int k = 3; k >= 0; --k) {
          const double sign = z < 0 && k % 2 == 1 ? -power : power;
          x += sign * x_[i][k];
          y += sign * y_[i][k];
          power *= w;
        }
        power = 1;
        for (int k = 4; k >= 0; --k) {
          one += (z < 0 && k % 2 == 1 ? -power : power) * one_[i][k];
          power *= w;
        }
      }
      B.row(i) << x, y, one;
    }
    const Eigen::Vector3d a = B.row(0), b = B.row(1), c = B.row(2);
    const Eigen::Vector3d candidates[] = {b.cross(c), c.cross(a), a.cross(b)};
    Eigen::Vector3d n = candidates[0];
    for (int i = 1; i < 3; ++i) {
      if (candidates[i].squaredNorm() > n.squaredNorm()) n = candidates[i];
    }
    // (x, y, 1) ~ n; by powers of w the last column is smaller by one power than (x, y) of the others: n ~ (x w, y w,
    // 1) there, for both x w = x/z.
    const Eigen::Vector4d coefficients(n.x(), n.y(), n.z() * z, n.z() * w);
    return coefficients / coefficients.norm();
  }

 private:
  static void fill(const Eigen::Matrix<double, 10, 4>& basis, Eigen::Matrix<double, 20, 10>& a) {
    double e[9][4];
    for (int k = 0; k < 9; ++k) {
      for (int v = 0; v < 4; ++v) e[k][v] = basis(k, v);
    }
    a.setZero();
    // Λ = E Eᵀ - ½ tr(E Eᵀ).
    double lambda[3][3][10] = {};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j) {
        for (int k = 0; k < 3; ++k) Cubics::addProduct(e[3 * i + k], e[3 * j + k], lambda[i][j]);
      }
    }
    for (int m = 0; m < 10; ++m) {
      const double half = 0.5 * (lambda[0][0][m] + lambda[1][1][m] + lambda[2][2][m]);
      for (int i = 0; i < 3; ++i) {
        lambda[i][i][m] -= half;
        for (int j = 0; j < i; ++j) lambda[j][i][m] = lambda[i][j][m];
      }
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 3; ++k) Cubics::addCubic(lambda[i][k], e[3 * k + j], a.data() + 20 * (3 * i + j));
      }
    }
    for (int j = 0; j < 3; ++j) {
      const double *p = e[3 + (j + 1) % 3], *q = e[6 + (j + 2) % 3], *r = e[3 + (j + 2) % 3], *s = e[6 + (j + 1) % 3];
      double minor[10] = {}, negative[4];
      Cubics::addProduct(p, q, minor);
      for (int v = 0; v < 4; ++v) negative[v] = -r[v];
      Cubics::addProduct(negative, s, minor);
      Cubics::addCubic(minor, e[j], a.data() + 180);
    }
  }

  double x_[3][4], y_[3][4], one_[3][5];
};

/// Newton's method on ũ'ᵀ [t]× R ũ = 0 of five matches from a matrix E that is nearly a solution; E becomes [t]× R, |t|
/// = 1. False where it does not get there.
inline bool polishEssential(const std::array<Eigen::Vector3d, 5>& first, const std::array<Eigen::Vector3d, 5>& second,
                            Eigen::Matrix3d& E) {
  const EssentialParts<double> parts = essentialParts(E);
  Eigen::Vector3d t = parts.direction;
  // E is essential only nearly: the columns are made orthonormal.
  Eigen::Matrix3d R;
  R.col(0) = parts.rotation.col(0).normalized();
  R.col(2) = R.col(0).cross(parts.rotation.col(1)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  for (int iteration = 0; iteration < 8; ++iteration) {
    // Two axes across t.
    const Eigen::Vector3d p = (std::abs(t.x()) < 0.6 ? Eigen::Vector3d(0, t.z(), -t.y())
                                                     : Eigen::Vector3d(-t.z(), 0, t.x()))
                                  .normalized(),
                          q = t.cross(p);
    double a[5][6];
    for (std::size_t i = 0; i < 5; ++i) {
      const Eigen::Vector3d y = R * first[i], n = y.cross(second[i]), m = y.cross(second[i].cross(t));
      a[i][0] = m.x();
      a[i][1] = m.y();
      a[i][2] = m.z();
      a[i][3] = n.dot(p);
      a[i][4] = n.dot(q);
      a[i][5] = -n.dot(t);
    }
    for (int j = 0; j < 5; ++j) {
      int pivot = j;
      for (int i = j + 1; i < 5; ++i) {
        if (std::abs(a[i][j]) > std::abs(a[pivot][j])) pivot = i;
      }
      if (!(std::abs(a[pivot][j]) > 0)) return false;
      if (pivot != j) {
        for (int k = j; k < 6; ++k) std::swap(a[j][k], a[pivot][k]);
      }
      const double inverse = 1 / a[j][j];
      for (int k = j + 1; k < 6; ++k) a[j][k] *= inverse;
      for (int i = j + 1; i < 5; ++i) {
        for (int k = j + 1; k < 6; ++k) a[i][k] -= a[i][j] * a[j][k];
      }
    }
    double s[5];
    for (int i = 4; i >= 0; --i) {
      s[i] = a[i][5];
      for (int k = i + 1; k < 5; ++k) s[i] -= a[i][k] * s[k];
    }
    const double square = s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3] + s[4] * s[4];
    // A step as long as the pose itself does not come from near a solution.
    if (!(square < 1)) return false;
    t = (t + s[3] * p + s[4] * q).normalized();
    // Exp(ω) to second order, and a rotation: Cayley's form, as a quaternion.
    const Eigen::Quaterniond turn = Eigen::Quaterniond(1, 0.5 * s[0], 0.5 * s[1], 0.5 * s[2]).normalized();
    R = (turn.toRotationMatrix() * R).eval();
    // Newton's steps are the squares of those before.
    if (square < 1e-16) {
      E = skewTimes<double>(t, R);
      return true;
    }
  }
  return false;
}

}  // namespace liestat::detail
