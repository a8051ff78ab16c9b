// Updates of the implicit filter, ns each: the dense form with one measurement, the information form per measurement of
// many; plain, and iterated to the end. Derivatives are by hand, so that the filter is what costs.
#include "../inputs.hpp"
#include "interleaved.hpp"

#include <lie/essential.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <stats/implicit_ekf.hpp>

#include <cstddef>
#include <cstdio>
#include <functional>
#include <vector>

namespace liestat::bench {
namespace {

/// y = H x.
struct Observes {
  Eigen::Matrix<double, 2, 4> H;
  EquationDerivatives<2, 4, 2> linearize(const Eigen::Vector4d& x, const Eigen::Vector2d& y) const {
    return {y - H * x, -H, Eigen::Matrix2d::Identity()};
  }
};
/// b = R a of a pair (a, b).
struct Rotates {
  EquationDerivatives<3, 3, 6> linearize(const SO3d& R, const Eigen::Matrix<double, 6, 1>& m) const {
    const Eigen::Vector3d a = m.head<3>(), b = m.tail<3>();
    EquationDerivatives<3, 3, 6> J;
    J.value = b - R * a;
    J.by_parameter = R.matrix() * SO3d::hat(a);
    J.by_measurement << -R.matrix(), Eigen::Matrix3d::Identity();
    return J;
  }
};
/// A landmark at p in the world seen at y in the body.
struct SeesLandmark {
  Eigen::Vector3d p;
  EquationDerivatives<3, 6, 3> linearize(const SE3d& world_T_body, const Eigen::Vector3d& y) const {
    const Eigen::Matrix3d R = world_T_body.so3().matrix();
    EquationDerivatives<3, 6, 3> J;
    J.value = world_T_body * y - p;
    J.by_parameter << R, -R * SO3d::hat(y);
    J.by_measurement = R;
    return J;
  }
};
/// x_aᵀ E x_b = 0 of two calibrated image points.
struct Epipolar {
  EquationDerivatives<1, 5, 4> linearize(const Essentiald& E, const Eigen::Vector4d& m) const {
    const auto r = E.epipolarResidual(Eigen::Vector3d(m[0], m[1], 1), Eigen::Vector3d(m[2], m[3], 1));
    EquationDerivatives<1, 5, 4> J;
    J.value[0] = r.value;
    J.by_parameter = r.by_pose;
    J.by_measurement << r.by_a[0], r.by_a[1], r.by_b[0], r.by_b[1];
    return J;
  }
};

constexpr double sigma = 0.01;

/// Times of updates that begin at the same state, one measurement a call in dense form, all of them in the other.
template <Homogeneous X, class M, class EquationOf>
void rows(const char* name, const Gaussian<X>& start, const std::vector<M>& measured, const EquationOf& equation_of) {
  const IsotropicNoise<ManifoldTraits<M>::DoF> noise(sigma);
  ImplicitEkf<X> plain(start), iterated(start, {.max_iterations = 20});
  std::size_t next = 0;
  const auto dense = [&](ImplicitEkf<X>& filter) {
    filter.reset(start);
    const std::size_t i = next++ % measured.size();
    keep(filter.update(measured[i], noise, equation_of(i)).nis);
  };
  const auto sums = [&](ImplicitEkf<X>& filter) {
    filter.reset(start);
    const auto result = filter.updateAll([&](auto& sum) {
      for (std::size_t i = 0; i < measured.size(); ++i) sum.add(measured[i], noise, equation_of(i), 1e9);
    });
    keep(result.nis);
  };
  const std::vector<double> ns = interleavedMedians(
      {[&] { dense(plain); }, [&] { dense(iterated); }, [&] { sums(plain); }, [&] { sums(iterated); }}, 51, 2e-3);
  const auto n = static_cast<double>(measured.size());
  std::printf("| %-22s | %6.0f | %15.0f | %10.0f | %19.0f |\n", name, ns[0], ns[1], ns[2] / n, ns[3] / n);
}

int print() {
  Inputs random;
  std::printf("| state, measurement     |  dense | dense, iterated | sums, each | sums, iterated, each |\n");
  std::printf("|------------------------|-------:|----------------:|-----------:|--------------------:|\n");

  Eigen::Matrix<double, 2, 4> H;
  for (int j = 0; j < 4; ++j) H.col(j) = random.normal<2>();
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 50; ++i) points.push_back(random.normal<2>(0.1));
  rows("R4, R2, 2 equations", Gaussian<Eigen::Vector4d>{Eigen::Vector4d::Zero(), random.covariance<4>(0.1)}, points,
       [&](std::size_t) { return Observes{H}; });

  const SO3d R = random.feature<SO3d>();
  std::vector<Eigen::Matrix<double, 6, 1>> pairs(50);
  for (auto& pair : pairs) {
    const Eigen::Vector3d a = random.normal<3>();
    pair << a, R * a;
    pair += random.normal<6>(sigma);
  }
  rows("SO3, R6, 3 equations", Gaussian<SO3d>{exp(R, random.normal<3>(0.05)), 0.0025 * Eigen::Matrix3d::Identity()},
       pairs, [](std::size_t) { return Rotates{}; });

  const SE3d world_T_body = random.feature<SE3d>();
  std::vector<Eigen::Vector3d> seen, landmarks;
  for (int i = 0; i < 50; ++i) {
    landmarks.push_back(random.normal<3>(2));
    seen.push_back(world_T_body.inverse() * landmarks.back() + random.normal<3>(sigma));
  }
  rows("SE3, R3, 3 equations", Gaussian<SE3d>{exp(world_T_body, random.normal<6>(0.05)), random.covariance<6>(0.05)},
       seen, [&](std::size_t i) { return SeesLandmark{landmarks[i]}; });

  const SE3d a_T_b(SO3d::exp(random.normal<3>(0.1)), random.normal<3>().normalized());
  const Essentiald a_E_b(a_T_b);
  std::vector<Eigen::Vector4d> matches(50);
  for (auto& match : matches) {
    const Eigen::Vector3d in_b = random.normal<3>() + Eigen::Vector3d(0, 0, 6), in_a = a_T_b * in_b;
    match << in_a.head<2>() / in_a.z(), in_b.head<2>() / in_b.z();
    match += random.normal<4>(sigma);
  }
  rows("essential, R4, 1 eq.", Gaussian<Essentiald>{exp(a_E_b, random.normal<5>(0.02)), random.covariance<5>(0.02)},
       matches, [](std::size_t) { return Epipolar{}; });
  return 0;
}

}  // namespace
}  // namespace liestat::bench

int main() { return liestat::bench::print(); }
