// Means as a careful user writes them with Eigen alone: the baselines of the benchmarks of the means. Fixed-size types,
// nothing recomputed that could be kept, logarithms through atan2 so that all angles come out right; the report's fixed
// point (eq. 4) from the first measurement until the step is below the tolerance, then the covariance of the residuals.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::bench {

struct HandWritten {
  static constexpr double tolerance = 1e-12;
  static constexpr int max_iterations = 100;
};

/// A mean with the scatter matrix of its residuals.
template <class Mean, int N>
struct HandWrittenMean {
  Mean mean;
  Eigen::Matrix<double, N, N> covariance = Eigen::Matrix<double, N, N>::Zero();
  int iterations = 0;
};

/// A pose with Eigen's types.
struct HandWrittenFrame {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

/// Rotation vector of a unit quaternion, angle in [0, pi].
inline Eigen::Vector3d handWrittenLog(const Eigen::Quaterniond& q) {
  const double s = q.vec().norm();
  if (s < 1e-12) return (q.w() < 0 ? -2 : 2) * q.vec();
  const double half = q.w() < 0 ? -std::atan2(s, -q.w()) : std::atan2(s, q.w());
  return (2 * half / s) * q.vec();
}

inline Eigen::Quaterniond handWrittenExp(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  if (angle < 1e-12) return Eigen::Quaterniond(1, v[0] / 2, v[1] / 2, v[2] / 2).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, v / angle));
}

/// Arithmetic mean and covariance of points.
inline HandWrittenMean<Eigen::Vector3d, 3> handWrittenMean(const std::vector<Eigen::Vector3d>& points) {
  HandWrittenMean<Eigen::Vector3d, 3> result;
  result.mean.setZero();
  for (const Eigen::Vector3d& x : points) result.mean += x;
  result.mean /= static_cast<double>(points.size());
  for (const Eigen::Vector3d& x : points) {
    const Eigen::Vector3d z = x - result.mean;
    result.covariance += z * z.transpose();
  }
  result.iterations = 1;
  return result;
}

inline HandWrittenMean<Eigen::Quaterniond, 3> handWrittenMean(const std::vector<Eigen::Quaterniond>& rotations) {
  HandWrittenMean<Eigen::Quaterniond, 3> result;
  result.mean = rotations.front();
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    const Eigen::Quaterniond to_mean = result.mean.conjugate();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Quaterniond& q : rotations) sum += handWrittenLog(to_mean * q);
    sum /= static_cast<double>(rotations.size());
    result.mean = (result.mean * handWrittenExp(sum)).normalized();
    step = sum.norm();
    ++result.iterations;
  }
  const Eigen::Quaterniond to_mean = result.mean.conjugate();
  for (const Eigen::Quaterniond& q : rotations) {
    const Eigen::Vector3d z = handWrittenLog(to_mean * q);
    result.covariance += z * z.transpose();
  }
  return result;
}

/// The representative of q (modulo the half-turns about the given axes) that turns least.
template <std::size_t N>
Eigen::Quaterniond handWrittenNearest(const Eigen::Quaterniond& q, const Eigen::Quaterniond (&half_turns)[N]) {
  Eigen::Quaterniond best = q;
  for (const Eigen::Quaterniond& h : half_turns) {
    const Eigen::Quaterniond candidate = q * h;
    if (std::abs(candidate.w()) > std::abs(best.w())) best = candidate;
  }
  return best;
}

/// Frames, or with half-turns frames modulo these.
template <class... HalfTurns>
HandWrittenMean<HandWrittenFrame, 6> handWrittenMean(const std::vector<HandWrittenFrame>& frames,
                                                     const HalfTurns&... half_turns) {
  const auto residual = [&](const Eigen::Quaterniond& to_mean, const Eigen::Vector3d& centre,
                            const HandWrittenFrame& x) {
    Eigen::Quaterniond q = to_mean * x.rotation;
    ((q = handWrittenNearest(q, half_turns)), ...);
    Eigen::Matrix<double, 6, 1> z;
    z << to_mean * (x.translation - centre), handWrittenLog(q);
    return z;
  };
  HandWrittenMean<HandWrittenFrame, 6> result;
  result.mean = frames.front();
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    const Eigen::Quaterniond to_mean = result.mean.rotation.conjugate();
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
    for (const HandWrittenFrame& x : frames) sum += residual(to_mean, result.mean.translation, x);
    sum /= static_cast<double>(frames.size());
    result.mean.translation += result.mean.rotation * sum.head<3>();
    result.mean.rotation = (result.mean.rotation * handWrittenExp(sum.tail<3>())).normalized();
    step = sum.norm();
    ++result.iterations;
  }
  const Eigen::Quaterniond to_mean = result.mean.rotation.conjugate();
  for (const HandWrittenFrame& x : frames) {
    const Eigen::Matrix<double, 6, 1> z = residual(to_mean, result.mean.translation, x);
    result.covariance += z * z.transpose();
  }
  return result;
}

/// Inverse of the left Jacobian of SO(3) by the textbook's formula.
inline Eigen::Matrix3d handWrittenLeftJacobianInverse(const Eigen::Vector3d& v) {
  const double t = v.norm();
  Eigen::Matrix3d K;
  K << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  const double c = t < 1e-4 ? 1.0 / 12 : 1 / (t * t) - (1 + std::cos(t)) / (2 * t * std::sin(t));
  return Eigen::Matrix3d::Identity() - 0.5 * K + c * K * K;
}

/// The exponential barycentre of rigid motions, by the fixed point m ← m Exp(Σ Log(m⁻¹x)/n), and the scatter of the
/// logarithms.
inline HandWrittenMean<HandWrittenFrame, 6> handWrittenBarycentre(const std::vector<HandWrittenFrame>& poses) {
  const auto residual = [](const HandWrittenFrame& m, const HandWrittenFrame& x) {
    const Eigen::Quaterniond back = m.rotation.conjugate();
    const Eigen::Vector3d phi = handWrittenLog(back * x.rotation);
    Eigen::Matrix<double, 6, 1> z;
    z << handWrittenLeftJacobianInverse(phi) * (back * (x.translation - m.translation)), phi;
    return z;
  };
  HandWrittenMean<HandWrittenFrame, 6> result;
  result.mean = poses.front();
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
    for (const HandWrittenFrame& x : poses) sum += residual(result.mean, x);
    sum /= static_cast<double>(poses.size());
    // The left Jacobian is the inverse of its inverse, once a step.
    const Eigen::Vector3d phi = sum.tail<3>(), t = handWrittenLeftJacobianInverse(phi).inverse() * sum.head<3>();
    result.mean.translation += result.mean.rotation * t;
    result.mean.rotation = (result.mean.rotation * handWrittenExp(phi)).normalized();
    step = sum.norm();
    ++result.iterations;
  }
  for (const HandWrittenFrame& x : poses) {
    const Eigen::Matrix<double, 6, 1> z = residual(result.mean, x);
    result.covariance += z * z.transpose();
  }
  return result;
}

/// A motion of the plane: (cos, sin) as a complex number, and a translation.
struct HandWrittenMotion {
  Eigen::Vector2d rotation = Eigen::Vector2d(1, 0), translation = Eigen::Vector2d::Zero();
};

/// The same barycentre of motions of the plane.
inline HandWrittenMean<HandWrittenMotion, 3> handWrittenBarycentre(const std::vector<HandWrittenMotion>& motions) {
  const auto turned = [](const Eigen::Vector2d& z, const Eigen::Vector2d& v) {
    return Eigen::Vector2d(z[0] * v[0] - z[1] * v[1], z[1] * v[0] + z[0] * v[1]);
  };
  // θ/2 cot θ/2, by the angle's series near zero.
  const auto cotangent = [](double angle) {
    const double half = 0.5 * angle;
    return std::abs(half) < 1e-4 ? 1 - half * half / 3 : half / std::tan(half);
  };
  const auto residual = [&](const HandWrittenMotion& m, const HandWrittenMotion& x) {
    const Eigen::Vector2d back(m.rotation[0], -m.rotation[1]), z = turned(back, x.rotation);
    const double angle = std::atan2(z[1], z[0]);
    const Eigen::Vector2d rho =
        turned(Eigen::Vector2d(cotangent(angle), -0.5 * angle), turned(back, x.translation - m.translation));
    return Eigen::Vector3d(rho[0], rho[1], angle);
  };
  HandWrittenMean<HandWrittenMotion, 3> result;
  result.mean = motions.front();
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const HandWrittenMotion& x : motions) sum += residual(result.mean, x);
    sum /= static_cast<double>(motions.size());
    const double c = cotangent(sum[2]), s = -0.5 * sum[2], scale = 1 / (c * c + s * s);
    const Eigen::Vector2d t = turned(Eigen::Vector2d(scale * c, -scale * s), sum.head<2>());
    result.mean.translation += turned(result.mean.rotation, t);
    result.mean.rotation =
        turned(result.mean.rotation, Eigen::Vector2d(std::cos(sum[2]), std::sin(sum[2]))).normalized();
    step = sum.norm();
    ++result.iterations;
  }
  for (const HandWrittenMotion& x : motions) {
    const Eigen::Vector3d z = residual(result.mean, x);
    result.covariance += z * z.transpose();
  }
  return result;
}

/// Unit vectors; the residuals are those in space, tangent to the sphere at the mean.
inline HandWrittenMean<Eigen::Vector3d, 3> handWrittenMeanDirection(const std::vector<Eigen::Vector3d>& directions) {
  const auto residual = [](const Eigen::Vector3d& y, const Eigen::Vector3d& x) -> Eigen::Vector3d {
    const double c = x.dot(y);
    const Eigen::Vector3d across = x - c * y;
    const double s = across.norm();
    return s < 1e-12 ? across : Eigen::Vector3d(std::atan2(s, c) / s * across);
  };
  HandWrittenMean<Eigen::Vector3d, 3> result;
  result.mean = directions.front();
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : directions) sum += residual(result.mean, x);
    sum /= static_cast<double>(directions.size());
    step = sum.norm();
    if (step > 0) result.mean = (std::cos(step) * result.mean + std::sin(step) / step * sum).normalized();
    ++result.iterations;
  }
  for (const Eigen::Vector3d& x : directions) {
    const Eigen::Vector3d z = residual(result.mean, x);
    result.covariance += z * z.transpose();
  }
  return result;
}

/// Inverse of the right Jacobian of SO(3) by the textbook's formula.
inline Eigen::Matrix3d handWrittenJacobianInverse(const Eigen::Vector3d& v) {
  const double t = v.norm();
  Eigen::Matrix3d K;
  K << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  const double c = t < 1e-4 ? 1.0 / 12 : 1 / (t * t) - (1 + std::cos(t)) / (2 * t * std::sin(t));
  return Eigen::Matrix3d::Identity() + 0.5 * K + c * K * K;
}

/// Mahalanobis mean of rotations by Gauss-Newton; the covariances belong to the measurements.
inline HandWrittenMean<Eigen::Quaterniond, 3> handWrittenMaha(const std::vector<Eigen::Quaterniond>& rotations,
                                                              const std::vector<Eigen::Matrix3d>& covariances) {
  HandWrittenMean<Eigen::Quaterniond, 3> result;
  std::vector<Eigen::Matrix3d> information;
  information.reserve(covariances.size());
  for (const Eigen::Matrix3d& c : covariances) information.push_back(c.llt().solve(Eigen::Matrix3d::Identity()));
  result.mean = rotations.front();
  Eigen::Matrix3d H;
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    H.setZero();
    for (std::size_t i = 0; i < rotations.size(); ++i) {
      const Eigen::Vector3d z = handWrittenLog(rotations[i].conjugate() * result.mean);
      const Eigen::Matrix3d J = handWrittenJacobianInverse(z);
      const Eigen::Matrix3d JtB = J.transpose() * information[i];
      g += JtB * z;
      H += JtB * J;
    }
    const Eigen::Vector3d delta = -H.llt().solve(g);
    result.mean = (result.mean * handWrittenExp(delta)).normalized();
    step = delta.norm();
    ++result.iterations;
  }
  result.covariance = H.inverse();
  return result;
}

/// The same of points.
inline HandWrittenMean<Eigen::Vector3d, 3> handWrittenMaha(const std::vector<Eigen::Vector3d>& points,
                                                           const std::vector<Eigen::Matrix3d>& covariances) {
  HandWrittenMean<Eigen::Vector3d, 3> result;
  std::vector<Eigen::Matrix3d> information;
  information.reserve(covariances.size());
  for (const Eigen::Matrix3d& c : covariances) information.push_back(c.llt().solve(Eigen::Matrix3d::Identity()));
  result.mean = points.front();
  Eigen::Matrix3d H;
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    H.setZero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      g += information[i] * (result.mean - points[i]);
      H += information[i];
    }
    const Eigen::Vector3d delta = -H.llt().solve(g);
    result.mean += delta;
    step = delta.norm();
    ++result.iterations;
  }
  result.covariance = H.inverse();
  return result;
}

/// The same of frames.
inline HandWrittenMean<HandWrittenFrame, 6> handWrittenMaha(
    const std::vector<HandWrittenFrame>& frames, const std::vector<Eigen::Matrix<double, 6, 6>>& covariances) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  HandWrittenMean<HandWrittenFrame, 6> result;
  std::vector<Matrix6> information;
  information.reserve(covariances.size());
  for (const Matrix6& c : covariances) information.push_back(c.llt().solve(Matrix6::Identity()));
  result.mean = frames.front();
  Matrix6 H;
  for (double step = 1; step > HandWritten::tolerance && result.iterations < HandWritten::max_iterations;) {
    Vector6 g = Vector6::Zero();
    H.setZero();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const Eigen::Quaterniond to_measurement = frames[i].rotation.conjugate();
      const Eigen::Quaterniond q = to_measurement * result.mean.rotation;
      Vector6 z;
      z << to_measurement * (result.mean.translation - frames[i].translation), handWrittenLog(q);
      Matrix6 J = Matrix6::Zero();
      J.topLeftCorner<3, 3>() = q.toRotationMatrix();
      J.bottomRightCorner<3, 3>() = handWrittenJacobianInverse(z.tail<3>());
      const Matrix6 JtB = J.transpose() * information[i];
      g += JtB * z;
      H += JtB * J;
    }
    const Vector6 delta = -H.llt().solve(g);
    result.mean.translation += result.mean.rotation * delta.head<3>();
    result.mean.rotation = (result.mean.rotation * handWrittenExp(delta.tail<3>())).normalized();
    step = delta.norm();
    ++result.iterations;
  }
  result.covariance = H.llt().solve(Matrix6::Identity());
  return result;
}

}  // namespace liestat::bench
