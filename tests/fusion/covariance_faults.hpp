// Faults of files of covariances, as programs make them: generators that know nothing of the diagnosis. Each writes the
// matrix that a faulty program would have written for an error of the right covariance.
#pragma once

#include <fusion/convention_diagnosis_types.hpp>
#include <lie/se3.hpp>
#include <stats/convention_presets.hpp>
#include <stats/conventions.hpp>
#include <stats/random.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::faults {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using M3 = Eigen::Matrix3d;
using Poses = std::vector<DiagnosedPose>;

/// `name` is what a right diagnosis says, as parts of its sentence between bars; empty: the fault has no name in it.
/// `convention`: the file is right, in this convention.
struct Fault {
  std::string what, name = {};
  std::function<void(Poses&, CounterRng&)> plant = {};
  std::string convention = {};
  bool foreign = false;  ///< in coordinates that no listed convention has
};

inline M3 rotX(double a) { return SO3d::rotX(a).matrix(); }
inline M3 rotZ(double a) { return SO3d::rotZ(a).matrix(); }
inline Matrix6 blocks(const M3& t, const M3& r) {
  Matrix6 B = Matrix6::Zero();
  B.topLeftCorner<3, 3>() = t, B.bottomRightCorner<3, 3>() = r;
  return B;
}
inline Matrix6 permutation(std::initializer_list<int> order) {
  Matrix6 P = Matrix6::Zero();
  int row = 0;
  for (const int k : order) P(row++, k) = 1;
  return P;
}
/// Derivative of six coordinates of a pose by ξ of T Exp(ξ).
template <class Chart>
Matrix6 derivative(const Chart& chart, const SE3d& T) {
  Matrix6 J;
  for (int k = 0; k < 6; ++k) {
    const Vector6 h = 1e-5 * Vector6::Unit(k);
    J.col(k) = (chart(T * SE3d::exp(h)) - chart(T * SE3d::exp(Vector6(-h)))) / 2e-5;
  }
  return J;
}
inline Vector6 joined(const Eigen::Vector3d& t, const Eigen::Vector3d& r) {
  Vector6 x;
  x << t, r;
  return x;
}

inline std::vector<Fault> all() {
  std::vector<Fault> list;
  const auto matrix = [&](std::string what, auto make, std::string name = {}) {
    list.push_back({std::move(what), std::move(name), [make](Poses& poses, CounterRng&) {
                      for (DiagnosedPose& p : poses) p.matrix = make(Matrix6(p.matrix), p.estimate);
                    }});
  };
  const auto jacobian = [&](std::string what, auto make, std::string name = {}) {
    matrix(
        std::move(what),
        [make](const Matrix6& M, const SE3d& T) {
          const Matrix6 J = make(T);
          return Matrix6(J * M * J.transpose());
        },
        std::move(name));
  };
  const auto chart = [&](std::string what, auto coordinates) {
    jacobian(std::move(what), [coordinates](const SE3d& T) { return derivative(coordinates, T); });
  };
  const auto scaled = [&](std::string what, std::initializer_list<double> sigmas, std::string name = {}) {
    Vector6 s;
    std::copy(sigmas.begin(), sigmas.end(), s.data());
    matrix(
        std::move(what), [s](const Matrix6& M, const SE3d&) { return Matrix6(s.asDiagonal() * M * s.asDiagonal()); },
        std::move(name));
  };
  const auto rows = [&](std::string what, auto make, std::string name = {}) {
    list.push_back({std::move(what), std::move(name), [make](Poses& poses, CounterRng& rng) {
                      std::vector<Matrix6> old;
                      for (const DiagnosedPose& p : poses) old.push_back(p.matrix);
                      for (std::size_t i = 0; i < poses.size(); ++i) poses[i].matrix = make(old, i, rng);
                    }});
  };
  const auto R = [](const SE3d& T) { return M3(T.so3().matrix()); };
  const M3 I = M3::Identity();

  // The file is right, its convention is another.
  for (const char* c : {"opencv-rvec", "opencv-rvec,order=tr", "ceres-posegraph", "mrpt-ypr", "ros-rpy,unit=deg",
                        "gtsam", "g2o-half", "left,order=rt,content=information", "ros-fixed,content=sigmas",
                        "openvins", "left,unit=deg", "ros-rpy,order=rt", "opencv-rvec,content=information",
                        "ceres-quat", "ros-fixed,unit=double", "right,content=sigmas"}) {
    list.push_back({c,
                    {},
                    [c](Poses& poses, CounterRng&) {
                      for (DiagnosedPose& p : poses)
                        p.matrix = toConvention(*parseConvention(c), {p.estimate, p.matrix});
                    },
                    c});
  }
  // Coordinates of other kinds.
  const auto euler = [](std::array<int, 3> axes) {
    return [axes](const SE3d& T) {
      const Eigen::Vector3d a = M3(T.so3().matrix()).eulerAngles(axes[0], axes[1], axes[2]);
      return joined(T.translation(), a);
    };
  };
  const auto angles = [&](std::string what, std::array<int, 3> axes) {
    // The branch of the angles of the pose itself.
    jacobian(std::move(what), [euler, axes](const SE3d& T) {
      const auto of = euler(axes);
      const Vector6 at = of(T);
      return derivative(
          [&](const SE3d& X) {
            Vector6 x = of(X);
            if ((x - at).tail<3>().norm() > 1) {
              x.tail<3>() = Eigen::Vector3d(x[3] + M_PI, axes[0] == axes[2] ? -x[4] : M_PI - x[4], x[5] + M_PI);
            }
            for (int k = 3; k < 6; ++k) x[k] = at[k] + std::remainder(x[k] - at[k], 2 * M_PI);
            return x;
          },
          T);
    });
  };
  angles("Euler angles x y z of the moving axes", {0, 1, 2});
  angles("Euler angles z x y (Unity)", {2, 0, 1});
  angles("Euler angles y x z", {1, 0, 2});
  chart("logarithm of the whole pose", [](const SE3d& T) { return Vector6(T.log()); });
  chart("Gibbs vector", [](const SE3d& T) {
    const Eigen::Vector3d r = T.so3().log();
    return joined(T.translation(), 2 * std::tan(r.norm() / 2) / std::max(r.norm(), 1e-9) * r);
  });
  chart("vector part of the quaternion, added", [](const SE3d& T) {
    const Eigen::Vector4d q = T.so3().params();
    return joined(T.translation(), (q[3] < 0 ? -2 : 2) * q.head<3>());
  });
  chart("rotation vector, position in the body",
        [](const SE3d& T) { return joined(T.so3().inverse() * T.translation(), T.so3().log()); });
  chart("position and rotation vector of the inverse",
        [](const SE3d& T) { return joined(T.inverse().translation(), T.inverse().so3().log()); });
  jacobian("position in the body, rotation in the world", [=](const SE3d& T) { return blocks(I, R(T)); });
  jacobian("inverse pose along its own world",
           [=](const SE3d& T) { return Matrix6(blocks(R(T.inverse()), R(T.inverse())) * T.Adj()); });
  jacobian("adjoint twice", [](const SE3d& T) { return Matrix6(T.Adj() * T.Adj()); });
  jacobian("left about the corner of the map",
           [](const SE3d& T) { return Matrix6((SE3d::trans(8, -5, 1) * T).Adj()); });
  jacobian("half of the rotation", [=](const SE3d& T) {
    const M3 H = SO3d::exp(Eigen::Vector3d(0.5 * T.so3().log())).matrix();
    return blocks(H, H);
  });
  const auto heading = [](const SE3d& T) {
    const M3 M = T.so3().matrix();
    return rotZ(std::atan2(M(1, 0), M(0, 0)));
  };
  jacobian("rotated by the heading alone", [=](const SE3d& T) { return blocks(heading(T), heading(T)); });
  jacobian("position by the heading, rotation in the body", [=](const SE3d& T) { return blocks(heading(T), I); });
  jacobian("rotated by the tilt alone", [=](const SE3d& T) {
    const M3 tilt = heading(T).transpose() * R(T);
    return blocks(tilt, tilt);
  });
  jacobian("position by the inverse, rotation in the world",
           [=](const SE3d& T) { return blocks(R(T).transpose(), R(T)); });
  // Other frames.
  const M3 ned = (M3() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished(),
           optical = (M3() << 0, -1, 0, 0, 0, -1, 1, 0, 0).finished();
  jacobian("north east down, position alone", [=](const SE3d& T) { return blocks(ned * R(T), I); });
  jacobian("optical axes, rotation alone", [=](const SE3d&) { return blocks(I, optical); });
  jacobian("a sensor turned by 30 degrees", [=](const SE3d&) { return blocks(rotZ(0.52), rotZ(0.52)); });
  jacobian("a sensor turned and tilted",
           [=](const SE3d&) { return blocks(rotX(0.7) * rotZ(0.9), rotX(0.7) * rotZ(0.9)); });
  jacobian("lever arm of a sensor half a metre off",
           [](const SE3d&) { return Matrix6(SE3d::trans(0.5, -2, 3).Adj()); });
  jacobian("world north-west-up", [=](const SE3d& T) { return blocks(rotZ(M_PI / 2) * R(T), rotZ(M_PI / 2) * R(T)); });
  jacobian("world turned by 35 degrees", [=](const SE3d& T) { return blocks(rotZ(0.61) * R(T), rotZ(0.61) * R(T)); });
  jacobian(
      "world with y up", [=](const SE3d& T) { return blocks(rotX(-M_PI / 2) * R(T), rotX(-M_PI / 2) * R(T)); }, "y-up");
  jacobian("a left-handed frame", [=](const SE3d&) {
    const M3 S = Eigen::Vector3d(1, -1, 1).asDiagonal();
    return blocks(S, -S);
  });
  for (std::size_t k = 16; k < list.size(); ++k) list[k].foreign = list[k].name.empty();
  // Rotations done by halves.
  const auto partly = [&](std::string what, auto change) {
    matrix(std::move(what), [=](Matrix6 M, const SE3d& T) {
      change(M, R(T));
      return Matrix6(0.5 * (M + M.transpose()));
    });
  };
  using Ref = Matrix6&;
  partly("position block rotated, nothing else",
         [](Ref M, const M3& Q) { M.topLeftCorner<3, 3>() = Q * M.topLeftCorner<3, 3>() * Q.transpose(); });
  partly("rotation block rotated, cross block not",
         [](Ref M, const M3& Q) { M.bottomRightCorner<3, 3>() = Q * M.bottomRightCorner<3, 3>() * Q.transpose(); });
  partly("both blocks rotated, cross block not", [](Ref M, const M3& Q) {
    const M3 X = M.topRightCorner<3, 3>();
    M = blocks(Q, Q) * M * blocks(Q, Q).transpose();
    M.topRightCorner<3, 3>() = X, M.bottomLeftCorner<3, 3>() = X.transpose();
  });
  partly("cross block rotated from one side", [](Ref M, const M3& Q) {
    const M3 X = Q * M.topRightCorner<3, 3>();
    M = blocks(Q, Q) * M * blocks(Q, Q).transpose();
    M.topRightCorner<3, 3>() = X, M.bottomLeftCorner<3, 3>() = X.transpose();
  });
  // Entries in other places.
  jacobian("x and y exchanged", [](const SE3d&) { return permutation({1, 0, 2, 3, 4, 5}); });
  jacobian("y and z exchanged in both", [](const SE3d&) { return permutation({0, 2, 1, 3, 5, 4}); });
  jacobian("yaw pitch roll in the body", [](const SE3d&) { return permutation({0, 1, 2, 5, 4, 3}); });
  jacobian("x roll y pitch z yaw", [](const SE3d&) { return permutation({0, 3, 1, 4, 2, 5}); });
  jacobian("rotation one place further", [](const SE3d&) { return permutation({0, 1, 2, 4, 5, 3}); });
  const auto packed = [&](std::string what, bool by_column) {
    matrix(std::move(what), [by_column](const Matrix6& M, const SE3d&) {
      std::vector<double> upper;
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) upper.push_back(M(i, j));
      }
      Matrix6 X;
      std::size_t k = 0;
      for (int i = 0; i < 6; ++i) {
        for (int j = by_column ? 0 : i; by_column ? j <= i : j < 6; ++j) X(i, j) = X(j, i) = upper[k++];
      }
      return X;
    });
  };
  packed("upper triangle read as a lower one", true);
  // Off-diagonal entries.
  const auto beside = [&](std::string what, auto change, std::string name = {}) {
    matrix(
        std::move(what),
        [change](const Matrix6& M, const SE3d&) {
          Matrix6 X = M;
          for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) {
              if (i != j) X(i, j) = change(i, j, M(i, j));
            }
          }
          return X;
        },
        std::move(name));
  };
  beside("all off-diagonals negated", [](int, int, double x) { return -x; });
  beside("off-diagonals times 0.7", [](int, int, double x) { return 0.7 * x; });
  beside("off-diagonals without sign", [](int, int, double x) { return std::abs(x); });
  beside("negative off-diagonals cut off", [](int, int, double x) { return std::max(x, 0.); });
  beside("cross block halved", [](int i, int j, double x) { return i / 3 == j / 3 ? x : x / 2; });
  beside("cross block times 0.3", [](int i, int j, double x) { return i / 3 == j / 3 ? x : 0.3 * x; });
  beside("off-diagonals of the rotation dropped", [](int i, int j, double x) { return std::min(i, j) > 2 ? 0 : x; });
  beside("off-diagonals of the position dropped", [](int i, int j, double x) { return std::max(i, j) < 3 ? 0 : x; });
  beside(
      "off-diagonals halved", [](int, int, double x) { return x / 2; }, "half as large");
  beside(
      "cross block negated", [](int i, int j, double x) { return i / 3 == j / 3 ? x : -x; }, "wrong sign");
  beside("all off-diagonals dropped", [](int, int, double) { return 0.; });
  beside("cross block dropped", [](int i, int j, double x) { return i / 3 == j / 3 ? x : 0; });
  // Rows.
  using Old = const std::vector<Matrix6>&;
  rows(
      "the row before", [](Old m, std::size_t i, CounterRng&) { return m[i > 0 ? i - 1 : 0]; }, "row before");
  rows(
      "the row after", [](Old m, std::size_t i, CounterRng&) { return m[std::min(i + 1, m.size() - 1)]; }, "row after");
  rows("five rows late", [](Old m, std::size_t i, CounterRng&) { return m[i < 5 ? 0 : i - 5]; });
  rows("rows in reverse", [](Old m, std::size_t i, CounterRng&) { return m[m.size() - 1 - i]; });
  rows("any other row", [](Old m, std::size_t, CounterRng& rng) {
    return m[static_cast<std::size_t>(rng.uniform() * static_cast<double>(m.size())) % m.size()];
  });
  rows("every second row repeated", [](Old m, std::size_t i, CounterRng&) { return m[i / 2 * 2]; });
  rows("mean of ten rows", [](Old m, std::size_t i, CounterRng&) {
    Matrix6 sum = Matrix6::Zero();
    const std::size_t from = i < 9 ? 0 : i - 9;
    for (std::size_t k = from; k <= i; ++k) sum += m[k] / static_cast<double>(i - from + 1);
    return sum;
  });
  rows("mean of two rows",
       [](Old m, std::size_t i, CounterRng&) { return Matrix6(0.5 * (m[i] + m[i > 0 ? i - 1 : 0])); });
  rows("the mean of all rows", [](Old m, std::size_t, CounterRng&) {
    Matrix6 sum = Matrix6::Zero();
    for (const Matrix6& x : m) sum += x / static_cast<double>(m.size());
    return sum;
  });
  rows("the first row", [](Old m, std::size_t, CounterRng&) { return m[0]; });
  rows("rotation block of the row before", [](Old m, std::size_t i, CounterRng&) {
    Matrix6 M = blocks(M3(m[i].topLeftCorner<3, 3>()), M3(m[i > 0 ? i - 1 : 0].bottomRightCorner<3, 3>()));
    return M;
  });
  rows("scale drifts from 0.4 to 2.5", [](Old m, std::size_t i, CounterRng&) {
    return Matrix6(m[i] * 0.4 * std::pow(2.5 / 0.4, static_cast<double>(i) / static_cast<double>(m.size())));
  });
  rows("scale of each row at random", [](Old m, std::size_t i, CounterRng& rng) {
    return Matrix6(m[i] * std::exp(0.8 * rng.normalVector<1>()[0] - 0.3));
  });
  // Scales of whole blocks have names, of single coordinates none.
  scaled("sigmas of the position times 1.4", {1.4, 1.4, 1.4, 1, 1, 1}, "translation block: inflated");
  scaled("sigmas of the rotation times 1.5", {1, 1, 1, 1.5, 1.5, 1.5}, "rotation block: inflated");
  scaled("three sigmas", {3, 3, 3, 3, 3, 3}, "both blocks: inflated");
  scaled("95 % bounds", {1.96, 1.96, 1.96, 1.96, 1.96, 1.96}, "both blocks: inflated");
  scaled("half sigmas", {.5, .5, .5, .5, .5, .5}, "both blocks: too small");
  scaled("feet", {3.28, 3.28, 3.28, 1, 1, 1}, "translation block: inflated");
  scaled("kilometres", {1e-3, 1e-3, 1e-3, 1, 1, 1}, "kilometres");
  scaled("millimetres", {1e3, 1e3, 1e3, 1, 1, 1}, "millimetres");
  scaled("gradians", {1, 1, 1, 63.66, 63.66, 63.66}, "rotation block: inflated");
  scaled("turns", {1, 1, 1, .159, .159, .159}, "rotation block: too small");
  scaled("times the time step", {.316, .316, .316, .316, .316, .316}, "both blocks: too small");
  scaled("x alone times 2.5", {2.5, 1, 1, 1, 1, 1});
  scaled("z alone a third", {1, 1, .33, 1, 1, 1});
  scaled("yaw alone twice", {1, 1, 1, 1, 1, 2});
  scaled("roll alone in degrees", {1, 1, 1, 57.3, 1, 1});
  scaled("horizontal halved, vertical doubled", {.5, .5, 2, 1, 1, 1});
  // Floors and digits.
  matrix("a floor is added", [](const Matrix6& M, const SE3d&) {
    return Matrix6(
        M + joined(Eigen::Vector3d::Constant(2e-3), Eigen::Vector3d::Constant(1e-4)).asDiagonal().toDenseMatrix());
  });
  matrix("variances below a floor are raised", [](Matrix6 M, const SE3d&) {
    for (int k = 0; k < 6; ++k) M(k, k) = std::max(M(k, k), k < 3 ? 4e-3 : 1.5e-4);
    return M;
  });
  matrix("six decimals", [](const Matrix6& M, const SE3d&) { return Matrix6((M * 1e4).array().round() / 1e4); });
  // Other contents.
  const auto sigmas = [](const Matrix6& M) { return Vector6(M.diagonal().cwiseSqrt()); };
  matrix("correlations beside variances", [=](const Matrix6& M, const SE3d&) {
    const Vector6 s = sigmas(M).cwiseInverse();
    Matrix6 X = 1e-5 * (s.asDiagonal() * M * s.asDiagonal()).eval();
    X.diagonal() = M.diagonal();
    return X;
  });
  matrix("inverse of each block", [](const Matrix6& M, const SE3d&) {
    return blocks(M.topLeftCorner<3, 3>().inverse(), M.bottomRightCorner<3, 3>().inverse());
  });
  matrix("inverse of the diagonal",
         [](const Matrix6& M, const SE3d&) { return Matrix6(M.diagonal().cwiseInverse().asDiagonal()); });
  matrix("square root of the matrix", [](const Matrix6& M, const SE3d&) {
    return Matrix6(Eigen::SelfAdjointEigenSolver<Matrix6>(M).operatorSqrt());
  });
  matrix(
      "matrix times matrix", [](const Matrix6& M, const SE3d&) { return Matrix6(M * M); }, "multiplied by itself");
  matrix(
      "Cholesky factor",
      [](const Matrix6& M, const SE3d&) {
        const Matrix6 L = M.llt().matrixL();
        return Matrix6(L.selfadjointView<Eigen::Lower>());
      },
      "Cholesky factor, not");
  matrix(
      "each block given the other",
      [](const Matrix6& M, const SE3d&) {
        const Matrix6 W = M.inverse();
        return blocks(W.topLeftCorner<3, 3>().inverse(), W.bottomRightCorner<3, 3>().inverse());
      },
      "both blocks: too small");
  matrix("eigenvalues on the diagonal", [](const Matrix6& M, const SE3d&) {
    return Matrix6(Eigen::SelfAdjointEigenSolver<Matrix6>(M).eigenvalues().reverse().asDiagonal());
  });
  matrix("mean variance of each block", [](const Matrix6& M, const SE3d&) {
    return blocks(M.topLeftCorner<3, 3>().trace() / 3 * M3::Identity(),
                  M.bottomRightCorner<3, 3>().trace() / 3 * M3::Identity());
  });
  matrix("largest variance of each block", [](const Matrix6& M, const SE3d&) {
    return blocks(M.topLeftCorner<3, 3>().diagonal().maxCoeff() * M3::Identity(),
                  M.bottomRightCorner<3, 3>().diagonal().maxCoeff() * M3::Identity());
  });
  return list;
}

}  // namespace liestat::faults
