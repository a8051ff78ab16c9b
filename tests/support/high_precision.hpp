// References in 50 digits which share no formula with the library (power series of matrices, and for the logarithm
// atan2 and a linear solve), and the sweeps in which the library is compared with them.
#pragma once

#include <lie/lie.hpp>

#include <boost/multiprecision/cpp_bin_float.hpp>

#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat_test {

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

inline Matrix identity(int n) {
  Matrix m(n, n);
  for (int i = 0; i < n; ++i) m.at(i, i) = 1;
  return m;
}

inline Matrix operator*(const Matrix& x, const Matrix& y) {
  Matrix z(x.rows, y.cols);
  for (int i = 0; i < x.rows; ++i) {
    for (int k = 0; k < x.cols; ++k) {
      if (x.at(i, k) == 0) continue;
      for (int j = 0; j < y.cols; ++j) z.at(i, j) += x.at(i, k) * y.at(k, j);
    }
  }
  return z;
}

inline Real norm(const Matrix& m) {
  Real sum = 0;
  for (const auto& x : m.a) sum += x * x;
  return sqrt(sum);
}

/// Σ A^k/(k + offset)!: the exponential with offset 0, the left Jacobian from ad with offset 1.
inline Matrix series(const Matrix& A, int offset) {
  Matrix term = identity(A.rows), sum = term;
  // Terms decrease once k is beyond the norm of A, some 20 at most.
  for (int k = 1; k < 250 && (k < 30 || norm(term) > 1e-34); ++k) {
    term = term * A;
    for (auto& x : term.a) x /= k + offset;
    for (std::size_t i = 0; i < sum.a.size(); ++i) sum.a[i] += term.a[i];
  }
  return sum;
}

/// The same for large A, with offset 0 or 1: by the series of A/2^k, doubled k times, e^{2A} = (e^A)² and
/// φ(2A) = φ(A)(e^A + 1)/2. Each doubling costs a bit of 166, and no more than 24 of them are needed up to 10⁷.
inline Matrix seriesOfLarge(Matrix A, int offset) {
  int doublings = 0;
  for (Real size = norm(A); size > 1; size /= 2) ++doublings;
  for (auto& x : A.a) x = ldexp(x, -doublings);
  Matrix e = series(A, 0), phi = series(A, 1);
  for (int k = 0; k < doublings; ++k) {
    Matrix e_plus_one = e;
    for (int i = 0; i < A.rows; ++i) e_plus_one.at(i, i) += 1;
    phi = phi * e_plus_one;
    for (auto& x : phi.a) x /= 2;
    e = e * e;
  }
  return offset == 0 ? e : phi;
}

/// A⁻¹ by Gauss and Jordan with pivots.
inline Matrix inverse(Matrix A) {
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

inline Matrix column(const std::vector<Real>& v) {
  Matrix m(static_cast<int>(v.size()), 1);
  m.a = v;
  return m;
}

/// Rotation vector of a quaternion (x, y, z, w) of any norm and sign; angle in [0, pi].
inline std::vector<Real> quaternionLog(const Matrix& q) {
  const Real n = sqrt(q.a[0] * q.a[0] + q.a[1] * q.a[1] + q.a[2] * q.a[2]);
  if (n == 0) return {0, 0, 0};
  const Real sign = q.a[3] < 0 ? -1 : 1, f = sign * 2 * atan2(n, sign * q.a[3]) / n;
  return {f * q.a[0], f * q.a[1], f * q.a[2]};
}

inline Matrix crossMatrix(const std::vector<Real>& v) {
  Matrix m(3, 3);
  m.at(0, 1) = -v[2], m.at(0, 2) = v[1], m.at(1, 2) = -v[0];
  m.at(1, 0) = v[2], m.at(2, 0) = -v[1], m.at(2, 1) = v[0];
  return m;
}

inline Matrix rows(const Matrix& m, int first, int count) {
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
template <class S>
Matrix referenceLog(const liestat::SE23<S>& x) {
  const Matrix p(x.params());
  const auto omega = quaternionLog(p);
  const Matrix V = inverse(series(crossMatrix(omega), 1));
  const Matrix u = V * rows(p, 4, 3), w = V * rows(p, 7, 3);
  return column({u.a[0], u.a[1], u.a[2], omega[0], omega[1], omega[2], w.a[0], w.a[1], w.a[2]});
}

template <class S>
Matrix referenceLog(const liestat::RxSO2<S>& x) {
  const Matrix p(x.params());
  return column({atan2(p.a[1], p.a[0]), log(p.a[0] * p.a[0] + p.a[1] * p.a[1]) / 2});
}
template <class S>
Matrix referenceLog(const liestat::RxSO3<S>& x) {
  const Matrix p(x.params());
  auto v = quaternionLog(p);
  v.push_back(log(p.a[0] * p.a[0] + p.a[1] * p.a[1] + p.a[2] * p.a[2] + p.a[3] * p.a[3]));
  return column(v);
}
template <class S>
Matrix referenceLog(const liestat::Sim2<S>& x) {
  const Matrix p(x.params());
  const Matrix l = referenceLog(liestat::RxSO2<S>(x.rxso2()));
  Matrix hat(2, 2);
  hat.at(0, 0) = hat.at(1, 1) = l.a[1], hat.at(0, 1) = -l.a[0], hat.at(1, 0) = l.a[0];
  const Matrix u = inverse(series(hat, 1)) * rows(p, 2, 2);
  return column({u.a[0], u.a[1], l.a[0], l.a[1]});
}
template <class S>
Matrix referenceLog(const liestat::Sim3<S>& x) {
  const Matrix p(x.params());
  const Matrix l = referenceLog(liestat::RxSO3<S>(x.rxso3()));
  Matrix hat = crossMatrix({l.a[0], l.a[1], l.a[2]});
  for (int i = 0; i < 3; ++i) hat.at(i, i) = l.a[3];
  const Matrix u = inverse(series(hat, 1)) * rows(p, 4, 3);
  return column({u.a[0], u.a[1], u.a[2], l.a[0], l.a[1], l.a[2], l.a[3]});
}

/// matrix() from the parameters, whose rotation part is taken at unit norm where the group has no scale.
template <class G>
Matrix referenceMatrix(const G& x) {
  constexpr int d = G::Dim, lead = d == 2 ? 2 : 4;
  const Matrix p(x.params());
  Matrix R(d, d);
  Real square = 0;
  for (int i = 0; i < lead; ++i) square += p.a[static_cast<std::size_t>(i)] * p.a[static_cast<std::size_t>(i)];
  if constexpr (d == 2) {
    R.a = {p.a[0], -p.a[1], p.a[1], p.a[0]};
    square = sqrt(square);
  } else {
    const Real &a = p.a[0], &b = p.a[1], &c = p.a[2], &w = p.a[3];
    R.a = {w * w + a * a - b * b - c * c, 2 * (a * b - c * w),           2 * (a * c + b * w),
           2 * (a * b + c * w),           w * w - a * a + b * b - c * c, 2 * (b * c - a * w),
           2 * (a * c - b * w),           2 * (b * c + a * w),           w * w - a * a - b * b + c * c};
  }
  if constexpr (!requires { x.scale(); }) {
    for (auto& r : R.a) r /= square;
  }
  Matrix m = identity(G::N);
  for (int i = 0; i < d; ++i) {
    for (int j = 0; j < d; ++j) m.at(i, j) = R.at(i, j);
    for (int j = d; j < G::N; ++j) m.at(i, j) = p.a[static_cast<std::size_t>(lead + (j - d) * d + i)];
  }
  return m;
}

/// Adj() from the definition: the coordinates of X hat(e) X⁻¹ for each unit tangent e, by least squares in the hats.
template <class G>
Matrix referenceAdjoint(const Matrix& X) {
  Matrix hats(G::N * G::N, G::DoF), images = hats;
  const Matrix back = inverse(X);
  for (int j = 0; j < G::DoF; ++j) {
    const Matrix hat(G::hat(G::Tangent::Unit(j))), image = X * hat * back;
    for (int i = 0; i < hats.rows; ++i) {
      hats.at(i, j) = hat.a[static_cast<std::size_t>(i)];
      images.at(i, j) = image.a[static_cast<std::size_t>(i)];
    }
  }
  Matrix transposed(hats.cols, hats.rows);
  for (int i = 0; i < hats.rows; ++i) {
    for (int j = 0; j < hats.cols; ++j) transposed.at(j, i) = hats.at(i, j);
  }
  return inverse(transposed * hats) * (transposed * images);
}

/// The action on a point.
template <class G>
Matrix referenceAction(const Matrix& X, const Matrix& point) {
  Matrix moved(G::Dim, 1);
  for (int i = 0; i < G::Dim; ++i) {
    if (G::N > G::Dim) moved.at(i, 0) = X.at(i, G::Dim);
    for (int j = 0; j < G::Dim; ++j) moved.at(i, 0) += X.at(i, j) * point.at(j, 0);
  }
  return moved;
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

/// Worst error of an operation, where, and the mean of all.
struct Worst {
  double error = 0, angle = 0, sum = 0;
  int count = 0;
  void see(double e, double at) {
    sum += e;
    ++count;
    // NaN is the worst and stays it.
    if (!(e <= error) && !std::isnan(error)) error = e, angle = at;
  }
  double mean() const { return sum / count; }
};
using Table = std::map<std::string, Worst>;

inline void print(const char* name, const char* scalar, const Table& table) {
  for (const auto& [operation, worst] : table) {
    std::printf("%-6s %-6s %-20s  worst %8.2e at %-14.12g  mean %8.2e\n", name, scalar, operation.c_str(), worst.error,
                worst.angle, worst.mean());
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

/// The operations of a group at tangent vectors of an angle.
template <class G>
void sweepGroup(Table& worst, double angle, const std::vector<typename G::Tangent>& tangents) {
  for (const auto& v : tangents) {
    const G x = G::exp(v);
    worst["exp"].see(error(x.matrix(), series(Matrix(G::hat(v)), 0)), angle);
    worst["log"].see(error(x.log(), referenceLog(x)), angle);
    if constexpr (requires { x.scale(); }) {
      // Relative to one: of a scale of 1 + σ the last 2e-16 are σ's, too.
      if (std::abs(static_cast<double>(v[G::DoF - 1])) <= 1e-3) {
        worst["log near scale 1"].see(error(x.log(), referenceLog(x)), angle);
      }
    }
    const Matrix X = referenceMatrix(x);
    const typename G::Point point = G::Point::LinSpaced(typename G::Scalar(0.4), typename G::Scalar(-0.7));
    worst["matrix"].see(error(x.matrix(), X), angle);
    worst["Adj"].see(error(x.Adj(), referenceAdjoint<G>(X)), angle);
    worst["action"].see(error(x * point, referenceAction<G>(X, Matrix(point))), angle);
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
template <class G>
void sweepGroup(Table& worst, const std::vector<double>& angles, int translation) {
  for (const double angle : angles) {
    sweepGroup<G>(worst, angle, tangents<typename G::Scalar, G::DoF>(angle, translation));
  }
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
inline Matrix quaternionExp(const Matrix& v, int first) {
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
Matrix referenceExp(const liestat::OrientedPoint<S>&, const Matrix& v) {
  const Matrix d = referenceExp(liestat::S2<S>(), column({v.a[3], v.a[4]}));
  return column({v.a[0], v.a[1], v.a[2], d.a[0], d.a[1], d.a[2]});
}
template <class S>
Matrix referenceLog(const liestat::OrientedPoint<S>& x) {
  const Matrix p(x.params()), d = referenceLog(liestat::S2<S>(x.direction()));
  return column({p.a[0], p.a[1], p.a[2], d.a[0], d.a[1]});
}
template <class S>
Matrix referenceExp(const liestat::Essential<S>&, const Matrix& v) {
  const Matrix q = quaternionExp(v, 2), d = referenceExp(liestat::S2<S>(), column({v.a[0], v.a[1]}));
  return column({q.a[0], q.a[1], q.a[2], q.a[3], d.a[0], d.a[1], d.a[2]});
}
template <class S>
Matrix referenceLog(const liestat::Essential<S>& x) {
  const Matrix d = referenceLog(liestat::S2<S>(x.direction()));
  const auto omega = quaternionLog(Matrix(x.params()));
  return column({d.a[0], d.a[1], omega[0], omega[1], omega[2]});
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

/// Logarithms of the scale.
template <class S>
std::vector<double> sweptScales() {
  std::vector<double> sigma{0, 1e-12, -1e-9, 1e-6, -1e-3, 0.1, -0.4, 0.7, -0.99, 1.01, -2, 4};
  // float's scales saturate at 1e-5 and 1e5.
  const int last = is_float<S> ? 4 : 6;
  for (int decade = -last; decade <= last; ++decade) sigma.push_back(std::log(10.) * decade);
  return sigma;
}

/// The operations of a group with a scale, over the scales and the angles.
template <class G>
Table sweepScaledGroup(int translation) {
  using S = typename G::Scalar;
  Table worst;
  std::size_t turn = 0;
  for (const double angle : sweptAngles<S>()) {
    // Two directions are enough for each of the many scales, and every third scale at each angle in turn.
    auto list = tangents<S, G::DoF - 1>(angle, translation);
    list.erase(list.begin() + 1, list.begin() + 4);
    std::vector<typename G::Tangent> scaled;
    const std::vector<double> scales = sweptScales<S>();
    for (std::size_t i = turn++ % 3; i < scales.size(); i += 3) {
      const double sigma = scales[i];
      for (const auto& v : list) {
        typename G::Tangent w;
        w << v, static_cast<S>(sigma);
        scaled.push_back(w);
        if constexpr (G::N == G::Dim) {
          const Matrix reference = series(Matrix(G::hat(w)), 0);
          const Real size = norm(reference);
          Matrix d(G::exp(w).matrix());
          for (std::size_t k = 0; k < d.a.size(); ++k) d.a[k] -= reference.a[k];
          worst["exp, relative"].see(static_cast<double>(norm(d) / size), angle);
        }
      }
    }
    sweepGroup<G>(worst, angle, scaled);
  }
  return worst;
}

}  // namespace liestat_test
