// Accuracy of exp, log and the Jacobians at every decade of the angle, against references in 50 digits which share no
// formula with the library: power series of matrices, and for the logarithm atan2 and a linear solve.
//
// The measure: Frobenius norm of the error, for a tangent whose translation has norm one, relative where the result is
// larger than one; the reference is evaluated at the rounded input. The bar: 4e-15, for inverse Jacobians 6e-15, and
// 2e-6 in float. The worst errors are printed.

#include <lie/lie.hpp>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace {

using Real = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<50>, boost::multiprecision::et_off>;

/// A small matrix of 50-digit numbers. Not Eigen's: its expressions over this scalar would cost minutes to compile.
struct Matrix {
  int rows, cols;
  std::vector<Real> a;
  Matrix(int r, int c) : rows(r), cols(c), a(static_cast<std::size_t>(r * c), Real(0)) {}
  template <class D>
  explicit Matrix(const Eigen::MatrixBase<D>& m) : Matrix(static_cast<int>(m.rows()), static_cast<int>(m.cols())) {
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < cols; ++j) at(i, j) = Real(static_cast<double>(m(i, j)));
    }
  }
  Real& at(int i, int j) { return a[static_cast<std::size_t>(i * cols + j)]; }
  const Real& at(int i, int j) const { return a[static_cast<std::size_t>(i * cols + j)]; }
};

Matrix identity(int n) {
  Matrix m(n, n);
  for (int i = 0; i < n; ++i) m.at(i, i) = 1;
  return m;
}

Matrix operator*(const Matrix& x, const Matrix& y) {
  Matrix z(x.rows, y.cols);
  for (int i = 0; i < x.rows; ++i) {
    for (int k = 0; k < x.cols; ++k) {
      if (x.at(i, k) == 0) continue;
      for (int j = 0; j < y.cols; ++j) z.at(i, j) += x.at(i, k) * y.at(k, j);
    }
  }
  return z;
}

Real norm(const Matrix& m) {
  Real sum = 0;
  for (const auto& x : m.a) sum += x * x;
  return sqrt(sum);
}

/// Σ A^k/(k + offset)!: the exponential with offset 0, the left Jacobian from ad with offset 1.
Matrix series(const Matrix& A, int offset) {
  Matrix term = identity(A.rows), sum = term;
  // Angles go to pi: terms decrease from the fifth on, and are below 1e-40 by the 60th.
  for (int k = 1; k < 90 && (k < 5 || norm(term) > 1e-40); ++k) {
    term = term * A;
    for (auto& x : term.a) x /= k + offset;
    for (std::size_t i = 0; i < sum.a.size(); ++i) sum.a[i] += term.a[i];
  }
  return sum;
}

/// A⁻¹ by Gauss and Jordan with pivots.
Matrix inverse(Matrix A) {
  const int n = A.rows;
  Matrix B = identity(n);
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i) {
      if (abs(A.at(i, k)) > abs(A.at(pivot, k))) pivot = i;
    }
    for (int j = 0; j < n; ++j) {
      std::swap(A.at(k, j), A.at(pivot, j));
      std::swap(B.at(k, j), B.at(pivot, j));
    }
    const Real p = A.at(k, k);
    for (int j = 0; j < n; ++j) A.at(k, j) /= p, B.at(k, j) /= p;
    for (int i = 0; i < n; ++i) {
      const Real f = A.at(i, k);
      if (i == k || f == 0) continue;
      for (int j = 0; j < n; ++j) A.at(i, j) -= f * A.at(k, j), B.at(i, j) -= f * B.at(k, j);
    }
  }
  return B;
}

/// Frobenius norm of the error, relative where the reference is larger than one.
template <class D>
double error(const Eigen::MatrixBase<D>& value, const Matrix& reference) {
  Matrix d(value);
  for (std::size_t i = 0; i < d.a.size(); ++i) d.a[i] -= reference.a[i];
  const Real size = norm(reference);
  return static_cast<double>(norm(d) / (size > 1 ? size : Real(1)));
}

Matrix column(const std::vector<Real>& v) {
  Matrix m(static_cast<int>(v.size()), 1);
  m.a = v;
  return m;
}

/// Rotation vector of a quaternion (x, y, z, w) of any norm and sign; angle in [0, pi].
std::vector<Real> quaternionLog(const Matrix& q) {
  const Real n = sqrt(q.a[0] * q.a[0] + q.a[1] * q.a[1] + q.a[2] * q.a[2]);
  if (n == 0) return {0, 0, 0};
  const Real sign = q.a[3] < 0 ? -1 : 1, f = sign * 2 * atan2(n, sign * q.a[3]) / n;
  return {f * q.a[0], f * q.a[1], f * q.a[2]};
}

Matrix crossMatrix(const std::vector<Real>& v) {
  Matrix m(3, 3);
  m.at(0, 1) = -v[2], m.at(0, 2) = v[1], m.at(1, 2) = -v[0];
  m.at(1, 0) = v[2], m.at(2, 0) = -v[1], m.at(2, 1) = v[0];
  return m;
}

Matrix rows(const Matrix& m, int first, int count) {
  Matrix r(count, 1);
  for (int i = 0; i < count; ++i) r.a[static_cast<std::size_t>(i)] = m.a[static_cast<std::size_t>(first + i)];
  return r;
}

/// Logarithms from the parameters.
template <class S>
Matrix referenceLog(const liestat::SO2<S>& x) {
  const Matrix p(x.params());
  return column({atan2(p.a[1], p.a[0])});
}
template <class S>
Matrix referenceLog(const liestat::SO3<S>& x) {
  return column(quaternionLog(Matrix(x.params())));
}
template <class S>
Matrix referenceLog(const liestat::SE2<S>& x) {
  const Matrix p(x.params());
  const Real theta = atan2(p.a[1], p.a[0]);
  Matrix hat(2, 2);
  hat.at(0, 1) = -theta, hat.at(1, 0) = theta;
  const Matrix u = inverse(series(hat, 1)) * rows(p, 2, 2);
  return column({u.a[0], u.a[1], theta});
}
template <class S>
Matrix referenceLog(const liestat::SE3<S>& x) {
  const Matrix p(x.params());
  const auto omega = quaternionLog(p);
  const Matrix u = inverse(series(crossMatrix(omega), 1)) * rows(p, 4, 3);
  return column({u.a[0], u.a[1], u.a[2], omega[0], omega[1], omega[2]});
}

/// Exponential and logarithm of the manifolds, as parameters and from parameters.
template <class S>
Matrix referenceExp(const liestat::S2<S>&, const Matrix& v) {
  // Column z of the rotation about (-v_y, v_x, 0).
  const Matrix R = series(crossMatrix({-v.a[1], v.a[0], 0}), 0);
  return column({R.at(0, 2), R.at(1, 2), R.at(2, 2)});
}
template <class S>
Matrix referenceLog(const liestat::S2<S>& x) {
  const Matrix p(x.params());
  const Real s = sqrt(p.a[0] * p.a[0] + p.a[1] * p.a[1]);
  // At the antipode every direction is right; the library's choice is x.
  if (s == 0) return column({p.a[2] < 0 ? 4 * atan(Real(1)) : Real(0), 0});
  const Real f = atan2(s, p.a[2]) / s;
  return column({f * p.a[0], f * p.a[1]});
}
Matrix quaternionExp(const Matrix& v, int first) {
  // Left multiplication by the quaternion (v/2, 0) as a matrix on (x, y, z, w); its exponential applied to 1.
  const std::size_t i = static_cast<std::size_t>(first);
  const Real x = v.a[i] / 2, y = v.a[i + 1] / 2, z = v.a[i + 2] / 2;
  Matrix L(4, 4);
  L.a = {0, -z, y, x, z, 0, -x, y, -y, x, 0, z, -x, -y, -z, 0};
  const Matrix q = series(L, 0);
  return column({q.at(0, 3), q.at(1, 3), q.at(2, 3), q.at(3, 3)});
}
template <class S>
Matrix referenceExp(const liestat::Frame3<S>&, const Matrix& v) {
  const Matrix q = quaternionExp(v, 3);
  return column({q.a[0], q.a[1], q.a[2], q.a[3], v.a[0], v.a[1], v.a[2]});
}
template <class S>
Matrix referenceLog(const liestat::Frame3<S>& x) {
  const Matrix p(x.params());
  const auto omega = quaternionLog(p);
  return column({p.a[4], p.a[5], p.a[6], omega[0], omega[1], omega[2]});
}
template <class S>
Matrix referenceExp(const liestat::Frame2<S>&, const Matrix& v) {
  return column({cos(v.a[2]), sin(v.a[2]), v.a[0], v.a[1]});
}
template <class S>
Matrix referenceLog(const liestat::Frame2<S>& x) {
  const Matrix p(x.params());
  return column({p.a[2], p.a[3], atan2(p.a[1], p.a[0])});
}

template <class S>
constexpr bool is_float = std::is_same_v<S, float>;

template <class S>
struct Bar {
  static constexpr double value = is_float<S> ? 2e-6 : 4e-15;
  static constexpr double inverse_jacobian = is_float<S> ? 2e-6 : 6e-15;
};

/// Every decade from 1e-12 to pi - 1e-12 (float: pi - 1e-5).
template <class S>
std::vector<double> sweptAngles() {
  std::vector<double> angles{0};
  for (int k = 12; k >= 1; --k) angles.push_back(std::pow(10, -k));
  // Both sides of where series end and closed forms begin, should they.
  for (const double a : {0.2, 0.22, 0.23, 0.3, 0.5, 0.7, 1.0, 1.4, 1.57, 1.6, 2.0, 2.5, 2.9, 3.0}) angles.push_back(a);
  for (int k = 1; k <= (is_float<S> ? 5 : 12); ++k) angles.push_back(EIGEN_PI - std::pow(10, -k));
  return angles;
}

/// Worst error of each operation, and where.
struct Worst {
  double error = 0, angle = 0;
  void see(double e, double at) {
    if (!(e <= error)) error = e, angle = at;
  }
};
using Table = std::map<std::string, Worst>;

void print(const char* name, const char* scalar, const Table& table) {
  for (const auto& [operation, worst] : table) {
    std::printf("%-8s %-7s %-22s %9.2e at %.12g\n", name, scalar, operation.c_str(), worst.error, worst.angle);
  }
}

/// Directions: the axes and random ones; a rotation part of a given angle and a translation of norm one.
template <class S, int N>
std::vector<Eigen::Matrix<S, N, 1>> tangents(double angle, int translation) {
  std::mt19937 generator(7);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  std::vector<Eigen::Matrix<S, N, 1>> result;
  for (int i = 0; i < 5; ++i) {
    Eigen::Matrix<double, N, 1> v;
    for (int k = 0; k < N; ++k) v[k] = draw();
    const int r = N - translation;
    if (i < r) v.tail(r) = Eigen::VectorXd::Unit(r, i);
    if (translation > 0) v.head(translation).normalize();
    v.tail(r) *= angle / v.tail(r).norm();
    result.push_back(v.template cast<S>());
  }
  return result;
}

template <class G>
void sweepGroup(Table& worst, const std::vector<double>& angles, int translation) {
  using S = typename G::Scalar;
  for (const double angle : angles) {
    for (const auto& v : tangents<S, G::DoF>(angle, translation)) {
      const G x = G::exp(v);
      worst["exp"].see(error(x.matrix(), series(Matrix(G::hat(v)), 0)), angle);
      worst["log"].see(error(x.log(), referenceLog(x)), angle);
      const Matrix ad(G::ad(v));
      Matrix minus_ad = ad;
      for (auto& a : minus_ad.a) a = -a;
      const Matrix left = series(ad, 1), right = series(minus_ad, 1);
      worst["leftJacobian"].see(error(G::leftJacobian(v), left), angle);
      worst["rightJacobian"].see(error(G::rightJacobian(v), right), angle);
      worst["leftJacobianInverse"].see(error(G::leftJacobianInverse(v), inverse(left)), angle);
      worst["rightJacobianInverse"].see(error(G::rightJacobianInverse(v), inverse(right)), angle);
    }
  }
}

template <class M>
void sweepManifold(Table& worst, const std::vector<double>& angles, int translation) {
  using T = liestat::ManifoldTraits<M>;
  using S = typename T::Scalar;
  for (const double angle : angles) {
    for (const auto& v : tangents<S, T::DoF>(angle, translation)) {
      const M x = T::expOrigin(v);
      worst["exp"].see(error(x.params(), referenceExp(x, Matrix(v))), angle);
      worst["log"].see(error(T::logOrigin(x), referenceLog(x)), angle);
    }
  }
}

template <class S>
void expectWithinBar(const char* name, const Table& worst) {
  print(name, is_float<S> ? "float" : "double", worst);
  for (const auto& [operation, w] : worst) {
    const bool is_inverse = operation.find("Inverse") != std::string::npos;
    EXPECT_LE(w.error, is_inverse ? Bar<S>::inverse_jacobian : Bar<S>::value)
        << name << (is_float<S> ? " float " : " double ") << operation << " at angle " << w.angle;
  }
}

template <class S>
void checkAll(const std::vector<double>& angles) {
  Table so2, so3, se2, se3, s2, frame2, frame3;
  sweepGroup<liestat::SO2<S>>(so2, angles, 0);
  sweepGroup<liestat::SO3<S>>(so3, angles, 0);
  sweepGroup<liestat::SE2<S>>(se2, angles, 2);
  sweepGroup<liestat::SE3<S>>(se3, angles, 3);
  sweepManifold<liestat::S2<S>>(s2, angles, 0);
  sweepManifold<liestat::Frame2<S>>(frame2, angles, 2);
  sweepManifold<liestat::Frame3<S>>(frame3, angles, 3);
  expectWithinBar<S>("SO2", so2);
  expectWithinBar<S>("SO3", so3);
  expectWithinBar<S>("SE2", se2);
  expectWithinBar<S>("SE3", se3);
  expectWithinBar<S>("S2", s2);
  expectWithinBar<S>("Frame2", frame2);
  expectWithinBar<S>("Frame3", frame3);
}

TEST(Accuracy, DoubleAtEveryDecade) { checkAll<double>(sweptAngles<double>()); }
TEST(Accuracy, DoubleAtPi) { checkAll<double>({EIGEN_PI}); }
TEST(Accuracy, FloatAtEveryDecade) { checkAll<float>(sweptAngles<float>()); }
// float's pi is larger than pi: the logarithm is that of the rotation beyond the half-turn.
TEST(Accuracy, FloatAtItsPi) { checkAll<float>({EIGEN_PI}); }

TEST(Accuracy, LogOfEitherSignOfTheQuaternion) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      const liestat::SO3d x = liestat::SO3d::exp(v), minus = liestat::SO3d::fromParams(-x.params());
      worst.see(error(minus.log(), referenceLog(x)), angle);
    }
  }
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

TEST(Accuracy, LogDoesNotDependOnTheNormOfTheQuaternion) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      for (const double scale : {1e-3, 0.7, 1 + 1e-7, 3.0, 1e3}) {
        const liestat::SO3d x = liestat::SO3d::fromParams(scale * liestat::SO3d::exp(v).params());
        worst.see(error(x.log(), referenceLog(x)), angle);
      }
    }
  }
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

// A rotation matrix near a half-turn says the axis in its symmetric part alone; the trace says nothing of the axis.
TEST(Accuracy, RotationMatricesToQuaternions) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      const Matrix R = series(crossMatrix({v[0], v[1], v[2]}), 0);
      Eigen::Matrix3d rounded;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) rounded(i, j) = static_cast<double>(R.at(i, j));
      }
      const liestat::SO3d x(rounded);
      const Matrix q = quaternionExp(Matrix(v), 0);
      Eigen::Vector4d params = x.params();
      // Either sign is the rotation; at a half-turn neither is preferred.
      Real dot = 0;
      for (int i = 0; i < 4; ++i) dot += q.a[static_cast<std::size_t>(i)] * params[i];
      if (dot < 0) params = -params;
      worst.see(error(params, q), angle);
    }
  }
  // The rounded matrix itself is off by up to 2e-16 in each of nine entries.
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

// Ten thousand products without normalisation. Each product turns by at most 4 eps and stretches by at most 4 eps.
TEST(Accuracy, LongChainsOfProducts) {
  const int n = 10000;
  const double eps = std::numeric_limits<double>::epsilon();
  std::mt19937 generator(11);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  liestat::SO3d x;
  liestat::SO3f x_float;
  Matrix q = column({0, 0, 0, 1});
  for (int i = 0; i < n; ++i) {
    const liestat::SO3d step = liestat::SO3d::exp(Eigen::Vector3d(draw(), draw(), draw()));
    x *= step;
    x_float *= step.cast<float>();
    const Matrix s(step.params());
    // Left multiplication by q.
    Matrix L(4, 4);
    const Real &a = q.a[0], &b = q.a[1], &c = q.a[2], &w = q.a[3];
    L.a = {w, -c, b, a, c, w, -a, b, -b, a, w, c, -a, -b, -c, w};
    q = L * s;
  }
  EXPECT_LE(std::abs(x.params().norm() - 1), 4 * eps * n);
  EXPECT_LE(error(x.log(), column(quaternionLog(q))), 4 * eps * n);
  // float renormalises to first order in every product.
  EXPECT_LE(std::abs(x_float.params().norm() - 1), 4 * std::numeric_limits<float>::epsilon());
  x.normalize();
  EXPECT_LE(std::abs(x.params().norm() - 1), eps);
}

// The choice among representatives: the angle of the nearest, and the gap, to the last digits also at small angles.
TEST(Accuracy, QuotientAnglesAtEveryDecade) {
  for (const double angle : sweptAngles<double>()) {
    if (angle > 0.7) continue;
    for (const auto& v : tangents<double, 6>(angle, 3)) {
      const liestat::NonOrientedFrame3d x = liestat::ManifoldTraits<liestat::NonOrientedFrame3d>::expOrigin(v);
      for (const int i : {0, 1, 2, 3}) {
        using T = liestat::ManifoldTraits<liestat::NonOrientedFrame3d>;
        const auto choice = T::nearestRepresentative(T::representative(x, i));
        const double exact = v.tail<3>().norm();
        EXPECT_LE(std::abs(choice.angle - exact), 8 * std::numeric_limits<double>::epsilon() * exact) << angle;
        EXPECT_EQ(choice.index, i) << "half-turns are their own inverses";
        // Second best: half-turn times a rotation by the angle about v, about the axis where |v| is largest.
        const double largest = v.tail<3>().cwiseAbs().maxCoeff() / (exact > 0 ? exact : 1);
        EXPECT_NEAR(choice.second_angle, 2 * std::acos(largest * std::sin(exact / 2)), 1e-14);
      }
    }
  }
}

}  // namespace
