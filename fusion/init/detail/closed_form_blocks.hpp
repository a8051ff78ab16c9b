// The linear system of the closed form, feature by feature: blocks that eliminate a feature and add up over features.
//
// For an observation along u with weight w, at τ = dt/T with s = S + C p_c, all in t0:
//   w N'(P - τ V' - τ² G' - (2/T²) J b' - s) = 0,   V' = V T, G' = G T²/2, b' = b T²/2, J = ∂S/∂b, N' N = I, N'u = 0.
// Unknowns of the motion are ordered (V', [b'], G', 1): gravity last, because it remains when the others are taken out.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat::detail {

/// An image of one camera as the system sees it.
struct ScaledImage {
  double tau = 0;
  Eigen::Vector3d s;
  Eigen::Matrix3d bias;  ///< (2/T²) J
};

/// An observation: where to, from which image, 1/(standard deviation of the row), in 1/m, and 1/(the bearing's own
/// relative sigma).
struct Ray {
  Eigen::Vector3d u;
  std::size_t image = 0;
  double weight = 1;
  double precision = 1;
};

/// The observations of all features that are used, one after the other.
struct RayTable {
  double window = 0;
  std::vector<ScaledImage> images;  ///< all of the first camera, then all of the next
  std::size_t cameras = 1;
  std::vector<Ray> rays;
  std::vector<std::size_t> begin{0};  ///< first ray of each feature, and the end of the last
  std::vector<std::size_t> feature;   ///< its number in the window

  std::size_t features() const { return feature.size(); }
  /// Times at which images were taken, and the one of a ray.
  std::size_t times() const { return images.size() / cameras; }
  std::size_t timeOf(const Ray& ray) const { return ray.image % times(); }
  /// The images of the first camera.
  std::span<const ScaledImage> firstCamera() const { return {images.data(), times()}; }
  std::span<const Ray> of(std::size_t i) const { return {rays.data() + begin[i], begin[i + 1] - begin[i]}; }
};

/// A motion (V', [b'], G', 1) in its scaled unknowns: 7 numbers, or 10 with the accelerometer's bias.
struct Motion {
  int size = 7;
  std::array<double, 10> value{};

  explicit Motion(bool bias = false) : size(bias ? 10 : 7) { value[static_cast<std::size_t>(size - 1)] = 1; }
  bool hasBias() const { return size == 10; }
  double& operator[](int i) { return value[static_cast<std::size_t>(i)]; }
  double operator[](int i) const { return value[static_cast<std::size_t>(i)]; }
  Eigen::Vector3d at(int i) const { return Eigen::Vector3d((*this)[i], (*this)[i + 1], (*this)[i + 2]); }
  void set(int i, const Eigen::Vector3d& x) {
    for (int k = 0; k < 3; ++k) (*this)[i + k] = x[k];
  }
  Eigen::Vector3d velocity() const { return at(0); }
  Eigen::Vector3d bias() const { return hasBias() ? at(3) : Eigen::Vector3d(Eigen::Vector3d::Zero()); }
  Eigen::Vector3d gravity() const { return at(size - 4); }
};

/// A y for a matrix of three rows.
inline Eigen::Vector3d apply(const SmallMatrix& A, const Motion& y) {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < A.cols; ++j) x[i] += A(i, j) * y[j];
  }
  return x;
}

/// Where a feature is from an image, in the axes of t0.
inline Eigen::Vector3d relativePosition(const ScaledImage& image, const Eigen::Vector3d& P, const Motion& y) {
  Eigen::Vector3d d;
  for (int i = 0; i < 3; ++i) d[i] = P[i] - image.s[i] - image.tau * (y[i] + image.tau * y[y.size - 4 + i]);
  if (y.hasBias()) d -= image.bias * y.bias();
  return d;
}

/// Q_i: the squared residual of a feature, yᵀ Q y, when its position is the best for a motion y. Blocks add up over
/// features: the sum over a set of them is the whole problem for their motion. The upper triangle is kept.
struct MotionBlock {
  SmallMatrix Q;

  explicit MotionBlock(bool bias) : Q(bias ? 10 : 7, bias ? 10 : 7) {}
  MotionBlock& operator+=(const MotionBlock& other) { return add(other, 1); }
  MotionBlock& operator-=(const MotionBlock& other) { return add(other, -1); }
  double cost(const Motion& y) const {
    double sum = 0;
    for (int i = 0; i < Q.rows; ++i) {
      for (int j = i; j < Q.cols; ++j) sum += (i == j ? 1 : 2) * y[i] * Q(i, j) * y[j];
    }
    return sum;
  }

 private:
  MotionBlock& add(const MotionBlock& other, double sign) {
    for (int i = 0; i < Q.rows; ++i) {
      for (int j = i; j < Q.cols; ++j) Q(i, j) += sign * other.Q(i, j);
    }
    return *this;
  }
};

/// A feature taken out: P = by_motion y.
struct EliminatedFeature {
  MotionBlock block;
  SmallMatrix by_motion;
  Eigen::Matrix3d covariance;  ///< pseudo-inverse of the normal matrix of P, for a known motion
  int rank = 3;
};

/// The covariance of a feature's position, the inverse of its normal matrix: by cofactors where these are accurate,
/// else the pseudo-inverse.
inline Eigen::Matrix3d featureCovariance(const Eigen::Matrix3d& H, int& rank) {
  const Eigen::Matrix3d adjugate = cofactors(H);
  const double determinant = H.col(0).dot(adjugate.col(0)), trace = H.trace();
  // Two eigenvalues are about half the trace: this bounds the smallest one.
  if (!(determinant > 1e-7 * trace * trace * trace)) return pseudoInverse(H, rank);
  rank = 3;
  return adjugate / determinant;
}

/// Takes a feature out by normal equations: moments of I - u uᵀ, because E consists of multiples of I.
///
/// Bearings with a noise of σ in each of two directions make E[I - u uᵀ] larger than the true one by 2 σ² u uᵀ: a
/// feature at depth z seems to leave a residual of √2 σ z, and least squares shrink the scene to make it smaller. With
/// `noise` = σ (of a bearing of relative sigma one) that is taken off, which makes the minimum consistent: the
/// matrix may then be indefinite.
inline EliminatedFeature eliminateFeature(std::span<const Ray> rays, std::span<const ScaledImage> images, bool bias,
                                          double noise = 0) {
  using Matrix3 = Eigen::Matrix3d;
  using Vector3 = Eigen::Vector3d;
  Matrix3 moment[5], by_bias[3], bias_bias = Matrix3::Zero();
  Vector3 force[3], bias_force = Vector3::Zero();
  for (Matrix3& m : moment) m.setZero();
  for (Matrix3& m : by_bias) m.setZero();
  for (Vector3& f : force) f.setZero();
  double square = 0;
  for (const Ray& ray : rays) {
    const ScaledImage& image = images[ray.image];
    const double w = ray.weight * ray.weight, t = image.tau;
    const Vector3 wu = w * ray.u;
    const double own = noise / ray.precision, with_noise = 1 + 2 * own * own;
    Matrix3 power = -with_noise * wu * ray.u.transpose();
    for (int i = 0; i < 3; ++i) power(i, i) += w;
    Vector3 f = w * image.s - with_noise * ray.u.dot(image.s) * wu;
    square += image.s.dot(f);
    if (bias) {
      Matrix3 b = power * image.bias;
      bias_bias += image.bias.transpose() * b;
      bias_force += image.bias.transpose() * f;
      for (Matrix3& sum : by_bias) {
        sum += b;
        b *= t;
      }
    }
    for (Vector3& sum : force) {
      sum += f;
      f *= t;
    }
    for (Matrix3& sum : moment) {
      sum += power;
      power *= t;
    }
  }
  const int m = bias ? 9 : 6, g = m - 3;
  EliminatedFeature result{MotionBlock(bias), SmallMatrix(3, m + 1), Matrix3::Zero()};
  result.covariance = featureCovariance(moment[0], result.rank);
  SmallMatrix cross(3, m + 1), &Q = result.block.Q;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      cross(i, j) = moment[1](i, j);
      cross(i, g + j) = moment[2](i, j);
      Q(i, j) = moment[2](i, j);
      Q(i, g + j) = moment[3](i, j);
      Q(g + i, g + j) = moment[4](i, j);
      if (!bias) continue;
      cross(i, 3 + j) = by_bias[0](i, j);
      Q(i, 3 + j) = by_bias[1](i, j);
      Q(3 + i, 3 + j) = bias_bias(i, j);
      Q(3 + i, g + j) = by_bias[2](j, i);
    }
    cross(i, m) = force[0][i];
    Q(i, m) = force[1][i];
    Q(g + i, m) = force[2][i];
    if (bias) Q(3 + i, m) = bias_force[i];
  }
  Q(m, m) = square;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j <= m; ++j) result.by_motion(i, j) += result.covariance(i, k) * cross(k, j);
    }
  }
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i <= m; ++i) {
      for (int j = i; j <= m; ++j) Q(i, j) -= cross(k, i) * result.by_motion(k, j);
    }
  }
  return result;
}

/// Two unit vectors that complete u to an orthonormal basis, as rows.
inline Eigen::Matrix<double, 2, 3> tangentRows(const Eigen::Vector3d& u) {
  // Duff et al., "Building an orthonormal basis, revisited", JCGT 6, 2017.
  const double sign = std::copysign(1.0, u.z()), a = -1 / (sign + u.z()), b = u.x() * u.y() * a;
  Eigen::Matrix<double, 2, 3> rows;
  rows << 1 + sign * u.x() * u.x() * a, sign * b, -sign * u.x(), b, sign + u.y() * u.y() * a, -u.y();
  return rows;
}

/// A feature taken out by reflections: nothing is squared, so that ranks are seen to rounding. Without weights.
inline LeadingElimination eliminateOrthogonally(std::span<const Ray> rays, std::span<const ScaledImage> images,
                                                bool bias, double tolerance) {
  const int m = bias ? 9 : 6, n = m + 4;
  Triangle triangle(n);
  // Four observations at a time, to share the square roots.
  for (std::size_t first = 0; first < rays.size(); first += 4) {
    const std::size_t count = std::min<std::size_t>(4, rays.size() - first);
    SmallMatrix rows(2 * static_cast<int>(count), n);
    for (std::size_t k = 0; k < count; ++k) {
      const ScaledImage& image = images[rays[first + k].image];
      const Eigen::Matrix<double, 2, 3> N = tangentRows(rays[first + k].u);
      for (int i = 0; i < 2; ++i) {
        double* row = rows.row(2 * static_cast<int>(k) + i);
        for (int j = 0; j < 3; ++j) {
          row[j] = N(i, j);
          row[3 + j] = -image.tau * N(i, j);
          row[m + j] = -image.tau * image.tau * N(i, j);
          row[m + 3] -= N(i, j) * image.s[j];
          for (int c = 0; bias && c < 3; ++c) row[6 + c] -= N(i, j) * image.bias(j, c);
        }
      }
    }
    triangle.add(rows);
  }
  return LeadingElimination(triangle, 3, tolerance * std::sqrt(static_cast<double>(rays.size())));
}

}  // namespace liestat::detail
