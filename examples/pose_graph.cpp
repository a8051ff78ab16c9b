// A pose graph solved with Ceres: poses on a helix, odometry between neighbours and loop closures one turn apart. Ceres
// differentiates the residual, a logarithm in SE3, by Jets; liestat::CeresManifold tells it what a pose is.
//
// The noise is known, so the solution can be judged: the sum of the squared whitened residuals follows χ² with as many
// degrees of freedom as there are residuals beyond the parameters.
#include <lie/compat/ceres.hpp>
#include <lie/se3.hpp>
#include <stats/inference.hpp>
#include <stats/random.hpp>

#include <ceres/ceres.h>

#include <cmath>
#include <cstdio>
#include <vector>

using liestat::SE3, liestat::SE3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A measured motion from one pose to the next: a_T_b, with independent noise in its own frame, (m, rad).
struct Motion {
  std::size_t a, b;
  SE3d measured;
};

/// log(measured⁻¹ a⁻¹ b), in standard deviations.
struct MotionResidual {
  SE3d measured_inverse;
  Vector6 inverse_sd;

  template <class T>
  bool operator()(const T* world_T_a, const T* world_T_b, T* residual) const {
    const Eigen::Map<const SE3<T>> a(world_T_a), b(world_T_b);
    // A double times a Jet is a Jet.
    const Eigen::Matrix<T, 6, 1> error = (measured_inverse * (a.inverse() * b)).log();
    Eigen::Map<Eigen::Matrix<T, 6, 1>>(residual, 6) = inverse_sd.cast<T>().cwiseProduct(error);
    return true;
  }
};

int main() {
  constexpr std::size_t turn = 40, n = 5 * turn;
  const Vector6 sd = (Vector6() << 0.05, 0.05, 0.02, 0.005, 0.005, 0.01).finished();
  liestat::CounterRng rng(1, 0);

  std::vector<SE3d> truth;
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = 2 * EIGEN_PI * static_cast<double>(i) / turn;
    truth.push_back(SE3d::transZ(0.05 * static_cast<double>(i)) * SE3d::rotZ(angle) * SE3d::transX(10));
  }
  std::vector<Motion> motions;
  const auto measure = [&](std::size_t a, std::size_t b) {
    const Vector6 noise = sd.cwiseProduct(rng.normalVector<6>());
    motions.push_back({a, b, truth[a].inverse() * truth[b] * SE3d::exp(noise)});
  };
  for (std::size_t i = 1; i < n; ++i) measure(i - 1, i);
  for (std::size_t i = turn; i < n; ++i) measure(i - turn, i);

  // Start from the odometry, which drifts.
  std::vector<SE3d> poses{truth[0]};
  for (std::size_t i = 1; i < n; ++i) poses.push_back(poses.back() * motions[i - 1].measured);
  const auto rms = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += (poses[i].translation() - truth[i].translation()).squaredNorm();
    return std::sqrt(sum / static_cast<double>(n));
  };
  const double drift = rms();

  ceres::Problem problem;
  for (SE3d& pose : poses) {
    problem.AddParameterBlock(pose.data(), SE3d::num_parameters, new liestat::CeresManifold<SE3d>);
  }
  problem.SetParameterBlockConstant(poses[0].data());
  for (const Motion& m : motions) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<MotionResidual, 6, 7, 7>(
                                 new MotionResidual{m.measured.inverse(), sd.cwiseInverse()}),
                             nullptr, poses[m.a].data(), poses[m.b].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  const double chi2 = 2 * summary.final_cost, dof = 6. * static_cast<double>(motions.size() - (n - 1));
  const double p = liestat::chiSquaredSurvival(chi2, dof);
  std::printf("%zu poses, %zu measured motions: %s after %zu steps\n", n, motions.size(),
              ceres::TerminationTypeToString(summary.termination_type), summary.iterations.size() - 1);
  std::printf("RMS of the position: %.3f m by odometry, %.3f m solved\n", drift, rms());
  std::printf("squared residuals %.0f, %.0f expected; p of so large a sum %.2g\n", chi2, dof, p);
  const bool right = summary.termination_type == ceres::CONVERGENCE && rms() < drift && p > 1e-6 && p < 1 - 1e-6;
  return right ? 0 : 1;
}
