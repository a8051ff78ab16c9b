// A ledger of covariance bugs, each planted into a clean run: what the diagnosis says of it (docs/doctor.md lists them), and
// false alarms on clean runs.

#include <experiments/trajectory_scene.hpp>
#include <fusion/convention_diagnosis.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

namespace liestat {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Poses = std::vector<DiagnosedPose>;
using P = Perturbation;
using U = RotationUnit;
using C = CovarianceContent;
using experiments::TrajectoryScene;

constexpr auto tr = CovarianceOrder::translation_rotation, rt = CovarianceOrder::rotation_translation;

Convention convention(P perturbation, U unit = U::radian, C content = C::covariance, CovarianceOrder order = tr) {
  Convention c;
  c.order = order, c.perturbation = perturbation, c.unit = unit, c.content = content;
  return c;
}

/// One bug: how it changes the file, and what has to be said.
struct Bug {
  std::string name;
  std::function<void(Poses&, CounterRng&)> plant;
  std::function<bool(const ConventionDiagnosis&)> named;
  bool dead_reckoning = false;
};

std::string textOf(const ConventionDiagnosis& d) {
  std::string text = d.reason;
  for (const std::string& n : d.notes) text += "\n" + n;
  return text;
}
auto says(std::vector<std::string> words) {
  return [words](const ConventionDiagnosis& d) {
    const std::string text = textOf(d);
    return d.verdict != DiagnosisVerdict::identified &&
           std::any_of(words.begin(), words.end(),
                       [&](const std::string& w) { return text.find(w) != std::string::npos; });
  };
}
auto repaired(MatrixFault fault) {
  return [fault](const ConventionDiagnosis& d) { return d.fault == fault; };
}
/// The file is in another convention than its reader believes.
Bug otherConvention(const std::string& name, const Convention& c) {
  return {name,
          [c](Poses& poses, CounterRng&) {
            for (DiagnosedPose& p : poses) p.matrix = toConvention(c, {p.estimate, p.matrix});
          },
          [c](const ConventionDiagnosis& d) {
            return d.verdict == DiagnosisVerdict::identified && d.accepted.size() == 1 && d.accepted.front() == c;
          }};
}
/// Each matrix by itself is spoiled.
template <class Spoil>
Bug spoiled(const std::string& name, Spoil spoil, std::function<bool(const ConventionDiagnosis&)> named) {
  return {name,
          [spoil](Poses& poses, CounterRng&) {
            for (DiagnosedPose& p : poses) p.matrix = spoil(p.matrix, p.estimate);
          },
          std::move(named)};
}
Matrix6 scaledBlocks(const Matrix6& M, double k_t, double k_r) {
  Vector6 d;
  d << Eigen::Vector3d::Constant(std::sqrt(k_t)), Eigen::Vector3d::Constant(std::sqrt(k_r));
  return d.asDiagonal() * M * d.asDiagonal();
}
Bug scaled(const std::string& name, double k_t, double k_r, std::vector<std::string> words) {
  return spoiled(
      name, [k_t, k_r](const Matrix6& M, const SE3d&) { return scaledBlocks(M, k_t, k_r); }, says(std::move(words)));
}
Matrix6 withAxes(const Matrix6& M, const Eigen::Matrix3d& S) {
  Matrix6 B = Matrix6::Zero();
  B.topLeftCorner<3, 3>() = B.bottomRightCorner<3, 3>() = S;
  return B * M * B.transpose();
}

/// Correlations that last, as those of filters do: losses of single entries leave no trace where they average out.
Bug withLastingCorrelations(Bug bug) {
  bug.plant = [plant = bug.plant](Poses& poses, CounterRng& rng) {
    const Matrix6 shape = poses[0].matrix;
    for (DiagnosedPose& p : poses) {
      p.matrix = std::exp(rng.uniform(-0.5, 0.5)) * shape;
      const Matrix6 L = p.matrix.llt().matrixL();
      p.truth = p.estimate * SE3d::exp(Vector6(L * rng.normalVector<6>()));
    }
    plant(poses, rng);
  };
  return bug;
}

std::vector<Bug> ledger() {
  std::vector<Bug> bugs{
      otherConvention("blocks in the order rotation, translation", convention(P::right, U::radian, C::covariance, rt)),
      otherConvention("left perturbation read as right", convention(P::left)),
      otherConvention("left, rotation first", convention(P::left, U::radian, C::covariance, rt)),
      otherConvention("twist along the world's axes (tf2)", convention(P::world_axes)),
      otherConvention("fixed axes, rotation first", convention(P::world_axes, U::radian, C::covariance, rt)),
      otherConvention("covariance of roll, pitch, yaw (ROS by its comment)", convention(P::roll_pitch_yaw)),
      otherConvention("covariance of yaw, pitch, roll (MRPT)", convention(P::yaw_pitch_roll)),
      otherConvention("position in the world, rotation in the body (OpenVINS)", convention(P::world_body_axes)),
      otherConvention("rotated by the transposed rotation", convention(P::transposed_axes)),
      otherConvention("half angles (vector part of the quaternion)", convention(P::right, U::half_angle)),
      otherConvention("double angles", convention(P::right, U::double_angle)),
      otherConvention("degrees", convention(P::right, U::degree)),
      otherConvention("roll, pitch, yaw in degrees", convention(P::roll_pitch_yaw, U::degree)),
      otherConvention("information read as covariance", convention(P::right, U::radian, C::information)),
      otherConvention("information of half angles (g2o)", convention(P::right, U::half_angle, C::information)),
      otherConvention("information, rotation first (GTSAM)", convention(P::right, U::radian, C::information, rt)),
      otherConvention("sigmas read as variances", convention(P::right, U::radian, C::sigmas)),
      otherConvention("sigmas in degrees", convention(P::right, U::degree, C::sigmas)),
      otherConvention("quaternion and position of Ceres (world axes, half angles)",
                      convention(P::world_axes, U::half_angle)),
  };
  bugs.push_back({"pose inverted, covariance not transported",
                  [](Poses& poses, CounterRng&) {
                    for (DiagnosedPose& p : poses) p.estimate = p.estimate.inverse(), p.truth = p.truth.inverse();
                  },
                  [](const ConventionDiagnosis& d) {
                    return d.verdict == DiagnosisVerdict::identified && d.accepted == std::vector{convention(P::left)};
                  }});
  const auto cross = [](auto change) {
    return [change](Matrix6 M, const SE3d&) {
      Eigen::Matrix3d X = M.topRightCorner<3, 3>();
      X = change(X);
      M.topRightCorner<3, 3>() = X, M.bottomLeftCorner<3, 3>() = X.transpose();
      return M;
    };
  };
  using M3 = Eigen::Matrix3d;
  bugs.push_back(spoiled("cross block with the wrong sign", cross([](const M3& X) { return M3(-X); }),
                         repaired(MatrixFault::cross_sign)));
  bugs.push_back(spoiled("blocks exchanged, cross block not transposed",
                         cross([](const M3& X) { return M3(X.transpose()); }),
                         repaired(MatrixFault::cross_transposed)));
  const auto off_diagonal = [](double factor) {
    return [factor](const Matrix6& M, const SE3d&) {
      Matrix6 X = factor * M;
      X.diagonal() = M.diagonal();
      return X;
    };
  };
  bugs.push_back(withLastingCorrelations(
      spoiled("a triangle symmetrised with its zeros", off_diagonal(0.5), repaired(MatrixFault::off_diagonal_half))));
  const auto factor = [](const Matrix6& M) { return Matrix6(M.llt().matrixL()); };
  bugs.push_back(spoiled(
      "Cholesky factor written as covariance",
      [factor](const Matrix6& M, const SE3d&) { return Matrix6(factor(M).selfadjointView<Eigen::Lower>()); },
      repaired(MatrixFault::factor)));
  bugs.push_back(spoiled(
      "Cholesky factor, both triangles averaged",
      [factor](const Matrix6& M, const SE3d&) { return Matrix6(0.5 * (factor(M) + factor(M).transpose())); },
      repaired(MatrixFault::factor_averaged)));
  bugs.push_back(spoiled(
      "factor transposed: L'L",
      [factor](const Matrix6& M, const SE3d&) { return Matrix6(factor(M).transpose() * factor(M)); },
      repaired(MatrixFault::factor_transposed)));
  bugs.push_back(spoiled(
      "square root of the information written as covariance",
      [](const Matrix6& M, const SE3d&) {
        const Matrix6 information = M.inverse();
        const Matrix6 R = information.llt().matrixU();
        return Matrix6(R.selfadjointView<Eigen::Upper>());
      },
      repaired(MatrixFault::information_factor)));
  bugs.push_back(spoiled(
      "variances taken for sigmas and squared",
      [](const Matrix6& M, const SE3d&) {
        Matrix6 X;
        for (int i = 0; i < 6; ++i) {
          for (int j = 0; j < 6; ++j) X(i, j) = M(i, j) * std::sqrt(M(i, i) * M(j, j));
        }
        return X;
      },
      repaired(MatrixFault::squared)));
  bugs.push_back(spoiled(
      "covariance times covariance (element-wise power meant)",
      [](const Matrix6& M, const SE3d&) { return Matrix6(M * M); }, repaired(MatrixFault::matrix_squared)));
  bugs.push_back(spoiled(
      "all six coordinates in reverse order", [](const Matrix6& M, const SE3d&) { return Matrix6(M.reverse()); },
      repaired(MatrixFault::reversed)));
  const auto axes = [](const M3& S) { return [S](const Matrix6& M, const SE3d&) { return withAxes(M, S); }; };
  bugs.push_back(spoiled("NED axes read as ENU", axes((M3() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished()),
                         repaired(MatrixFault::axes_ned_enu)));
  const M3 optical_of_body = (M3() << 0, -1, 0, 0, 0, -1, 1, 0, 0).finished();
  bugs.push_back(
      spoiled("camera's optical axes read as the body's", axes(optical_of_body), repaired(MatrixFault::axes_optical)));
  bugs.push_back(spoiled("body's axes read as the camera's", axes(M3(optical_of_body.transpose())),
                         repaired(MatrixFault::axes_from_optical)));
  bugs.push_back(spoiled("y-up axes read as z-up", axes((M3() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished()),
                         repaired(MatrixFault::axes_y_up)));
  const auto jacobian = [](auto make) {
    return [make](const Matrix6& M, const SE3d& T) {
      const Matrix6 J = make(T);
      return Matrix6(J * M * J.transpose());
    };
  };
  bugs.push_back(spoiled("adjoint with the wrong sign of its lever arm", jacobian([](const SE3d& T) {
                           Matrix6 J = T.Adj();
                           J.topRightCorner<3, 3>() *= -1;
                           return J;
                         }),
                         repaired(MatrixFault::lever_arm_sign)));
  bugs.push_back(spoiled("adjoint of the inverse pose",
                         jacobian([](const SE3d& T) { return Matrix6(T.inverse().Adj()); }),
                         repaired(MatrixFault::adjoint_inverse)));
  bugs.push_back(spoiled("transposed adjoint", jacobian([](const SE3d& T) { return Matrix6(T.Adj().transpose()); }),
                         repaired(MatrixFault::adjoint_transposed)));
  bugs.push_back({"matrix of the row before",
                  [](Poses& poses, CounterRng&) {
                    for (std::size_t i = poses.size() - 1; i > 0; --i) poses[i].matrix = poses[i - 1].matrix;
                  },
                  repaired(MatrixFault::previous_row)});
  bugs.push_back({"matrix of the row after",
                  [](Poses& poses, CounterRng&) {
                    for (std::size_t i = 0; i + 1 < poses.size(); ++i) poses[i].matrix = poses[i + 1].matrix;
                  },
                  repaired(MatrixFault::next_row)});
  // Scales.
  bugs.push_back(
      scaled("sigmas half as large as the errors", 0.25, 0.25, {"too small (overconfident) by a factor of"}));
  bugs.push_back(scaled("inflated by three", 3, 3, {"inflated (underconfident) by a factor of"}));
  bugs.push_back(
      scaled("divided by the number of poses", 1. / 300, 1. / 300, {"too small (overconfident) by a factor of"}));
  bugs.push_back(scaled("translation in millimetres", 1e6, 1, {"translation block: in millimetres"}));
  bugs.push_back(scaled("translation in centimetres", 1e4, 1, {"translation block: in centimetres"}));
  bugs.push_back(scaled("degrees converted twice", 1, 1 / 3282.806350011744, {"radians converted twice"}));
  bugs.push_back(scaled("rotation inflated alone", 1, 2.2, {"rotation block: inflated"}));
  // Losses.
  bugs.push_back(withLastingCorrelations(spoiled("cross block dropped", cross([](const M3&) { return M3(M3::Zero()); }),
                                                 says({"the cross block is zero"}))));
  bugs.push_back(withLastingCorrelations(spoiled(
      "all off-diagonals dropped", [](const Matrix6& M, const SE3d&) { return Matrix6(M.diagonal().asDiagonal()); },
      says({"all matrices are diagonal"}))));
  bugs.push_back(spoiled(
      "only one column filled",
      [](const Matrix6& M, const SE3d&) {
        Matrix6 X = Matrix6::Zero();
        X.col(0) = M.col(0);
        return X;
      },
      says({"one column or one triangle", "are zero in every row"})));
  bugs.push_back(spoiled(
      "diagonal read as a row of the matrix",
      [](const Matrix6& M, const SE3d&) {
        Matrix6 X = Matrix6::Zero();
        X.row(0) = M.diagonal().transpose();
        return X;
      },
      says({"one column or one triangle", "are zero in every row"})));
  bugs.push_back(spoiled(
      "variance at the wrong index",
      [](Matrix6 M, const SE3d&) {
        M(5, 4) = M(5, 5), M(5, 5) = 0;
        return M;
      },
      says({"variances of coordinates 6 are zero"})));
  bugs.push_back(spoiled(
      "a row dropped, its off-diagonals kept",
      [](Matrix6 M, const SE3d&) {
        M(2, 2) = 0;
        return M;
      },
      says({"variances of coordinates 3 are zero"})));
  bugs.push_back(withLastingCorrelations(spoiled(
      "only the upper triangle written",
      [](const Matrix6& M, const SE3d&) { return Matrix6(M.triangularView<Eigen::Upper>()); },
      says({"not symmetric"}))));
  bugs.push_back(spoiled(
      "product of the sigmas instead of a covariance",
      [](const Matrix6& M, const SE3d&) {
        const Vector6 s = M.diagonal().cwiseSqrt();
        return Matrix6(s * s.transpose());
      },
      says({"rank one", "not positive definite"})));
  bugs.push_back({"the first covariance for all poses",
                  [](Poses& poses, CounterRng&) {
                    for (DiagnosedPose& p : poses) p.matrix = poses[0].matrix;
                  },
                  says({"all matrices are the same"})});
  bugs.push_back({"left about a far origin, printed with six digits",
                  [](Poses& poses, CounterRng&) {
                    const SE3d far(SO3d(), Eigen::Vector3d(4.5e5, 5.4e6, 100));
                    for (DiagnosedPose& p : poses) {
                      p.estimate = far * p.estimate, p.truth = far * p.truth;
                      p.matrix = toConvention(convention(P::left), {p.estimate, p.matrix});
                      for (int i = 0; i < 36; ++i) {
                        char digits[32];
                        std::snprintf(digits, sizeof digits, "%.5e", p.matrix(i / 6, i % 6));
                        p.matrix(i / 6, i % 6) = std::stod(digits);
                      }
                    }
                  },
                  says({"too few digits"})});
  // Errors that no covariance of a pose describes.
  bugs.push_back({"a constant offset (extrinsic calibration)",
                  [](Poses& poses, CounterRng&) {
                    for (DiagnosedPose& p : poses) p.truth = p.truth * SE3d::trans(0.03, 0, 0);
                  },
                  says({"a bias"})});
  bugs.push_back({"three per cent of outliers",
                  [](Poses& poses, CounterRng& rng) {
                    for (DiagnosedPose& p : poses) {
                      if (rng.uniform() > 0.03) continue;
                      p.truth = p.estimate * SE3d::exp(Vector6(6 * (p.estimate.inverse() * p.truth).log()));
                    }
                  },
                  says({"outliers or heavy tails"})});
  bugs.push_back({"heavy tails (Student, five degrees of freedom)",
                  [](Poses& poses, CounterRng& rng) {
                    for (DiagnosedPose& p : poses) {
                      const double stretch = std::sqrt(3 / rng.normalVector<5>().squaredNorm());
                      p.truth = p.estimate * SE3d::exp(Vector6(stretch * (p.estimate.inverse() * p.truth).log()));
                    }
                  },
                  says({"outliers or heavy tails"})});
  bugs.push_back({"a filter's memory: errors correlated in time",
                  [](Poses& poses, CounterRng&) {
                    Vector6 z = Vector6::Zero();
                    for (DiagnosedPose& p : poses) {
                      const Matrix6 L = p.matrix.llt().matrixL();
                      const Vector6 fresh =
                          L.triangularView<Eigen::Lower>().solve((p.estimate.inverse() * p.truth).log());
                      z = 0.8 * z + 0.6 * fresh;
                      p.truth = p.estimate * SE3d::exp(Vector6(L * z));
                    }
                  },
                  says({"correlated"})});
  // Along a chain.
  Bug steps{"increments fused as absolute",
            [](Poses& poses, CounterRng&) {
              for (std::size_t i = poses.size() - 1; i > 0; --i) {
                const Matrix6 A = (poses[i].estimate.inverse() * poses[i - 1].estimate).Adj();
                poses[i].matrix -= A * poses[i - 1].matrix * A.transpose();
              }
            },
            [](const ConventionDiagnosis& d) { return d.increments_as_absolute; }};
  steps.dead_reckoning = true;
  bugs.push_back(steps);
  Bug added{"increments added without the adjoint",
            [](Poses& poses, CounterRng&) {
              std::vector<Matrix6> Q(poses.size());
              for (std::size_t i = poses.size() - 1; i > 0; --i) {
                const Matrix6 A = (poses[i].estimate.inverse() * poses[i - 1].estimate).Adj();
                Q[i] = poses[i].matrix - A * poses[i - 1].matrix * A.transpose();
              }
              for (std::size_t i = 1; i < poses.size(); ++i) poses[i].matrix = poses[i - 1].matrix + Q[i];
            },
            says({"without the adjoint"})};
  added.dead_reckoning = true;
  bugs.push_back(added);
  Bug half{"dead reckoning in half angles",
           [](Poses& poses, CounterRng&) {
             for (DiagnosedPose& p : poses)
               p.matrix = toConvention(convention(P::right, U::half_angle), {p.estimate, p.matrix});
           },
           [](const ConventionDiagnosis& d) {
             return d.verdict == DiagnosisVerdict::identified &&
                    d.accepted == std::vector{convention(P::right, U::half_angle)};
           }};
  half.dead_reckoning = true;
  bugs.push_back(half);
  return bugs;
}

Poses cleanRun(CounterRng& rng, bool dead_reckoning, std::size_t n) {
  experiments::TrajectorySceneOptions options{.n = n};
  if (dead_reckoning) options.sigma_translation = 0.01, options.sigma_rotation = 0.002;
  const TrajectoryScene scene =
      dead_reckoning ? experiments::deadReckoningScene(options, rng) : experiments::independentScene(options, rng);
  Poses poses;
  for (std::size_t i = 0; i < n; ++i)
    poses.push_back({scene.estimate[i].mean, scene.estimate[i].covariance, scene.truth[i]});
  return poses;
}

TEST(ConventionLedger, BugsAreNamed) {
  const std::vector<Bug> bugs = ledger();
  ASSERT_GE(bugs.size(), 40u);
  constexpr int trials = 2;
  int named = 0, all = 0;
  for (const Bug& bug : bugs) {
    int of_bug = 0;
    std::string said;
    for (int trial = 0; trial < trials; ++trial) {
      CounterRng rng(101, static_cast<std::uint64_t>(trial));
      Poses poses = cleanRun(rng, bug.dead_reckoning, 300);
      bug.plant(poses, rng);
      const ConventionDiagnosis d = diagnoseConventions(poses);
      of_bug += bug.named(d);
      if (trial == 0 || !bug.named(d)) said = std::string(name(d.verdict)) + ": " + textOf(d);
    }
    named += of_bug, all += trials;
    std::printf("%d/%d  %s\n      %s\n", of_bug, trials, bug.name.c_str(), said.substr(0, 200).c_str());
  }
  std::printf("%d of %d runs with %zu bugs named\n", named, all, bugs.size());
  EXPECT_GE(named, 0.95 * all);
}

TEST(ConventionLedger, CleanRunsAreNot) {
  int alarms = 0, wrong = 0;
  for (std::uint64_t trial = 0; trial < 1000; ++trial) {
    CounterRng rng(202, trial);
    const bool dead_reckoning = trial % 4 == 0;
    const ConventionDiagnosis d = diagnoseConventions(cleanRun(rng, dead_reckoning, 100));
    alarms += d.verdict == DiagnosisVerdict::inconsistent || d.verdict == DiagnosisVerdict::none ||
              (!dead_reckoning && d.correlated);
    wrong += d.verdict == DiagnosisVerdict::identified && d.accepted.front() != Convention{};
  }
  std::printf("%d false alarms, %d wrong conventions in 1000 clean runs\n", alarms, wrong);
  EXPECT_LE(alarms, 10);
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace liestat
