// Exponentials and Jacobians of rotation vectors far beyond a half-turn, up to 10⁶ rad (float: 10³), for numbers and for
// vector registers. The bar: 32 eps times the angle, relative to the size of the result; the rounding of the angle
// itself costs a part of it, whatever the formula. Inverse Jacobians, which do not exist at multiples of a whole turn, by
// the Jacobian's condition number more.

#include <lie/compat/batch.hpp>
#include <support/high_precision.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat_test;

template <class S>
std::vector<double> angles() {
  // Both sides of eight, where similarities change their formula, and the decades.
  std::vector<double> list{3.2, 4.7, 6.3, 7.9, 8.1, 9.5, 31, 33};
  for (double decade = 10; decade <= (is_float<S> ? 1e3 : 1e6); decade *= 10) {
    list.push_back(decade);
    if (2 * decade <= (is_float<S> ? 1e3 : 1e6)) list.push_back(2 * decade);
  }
  return list;
}

/// Tangent vectors of an angle, for groups with a scale with several logarithms of it.
template <class G>
std::vector<typename G::Tangent> tangentsOf(double angle, int translation, bool scaled) {
  using S = typename G::Scalar;
  if constexpr (G::DoF > 1) {
    if (scaled) {
      std::vector<typename G::Tangent> list;
      for (const double sigma : {0., 1e-9, -1e-3, 0.4, -0.99, 2., -4., 9., -11.}) {
        for (const auto& v : tangents<S, G::DoF - 1>(angle, translation)) {
          typename G::Tangent w;
          w << v, static_cast<S>(sigma);
          list.push_back(w);
        }
      }
      return list;
    }
  }
  return tangents<S, G::DoF>(angle, translation);
}

template <class D>
double relativeError(const Eigen::MatrixBase<D>& value, const Matrix& reference) {
  Matrix d(value);
  for (std::size_t i = 0; i < d.a.size(); ++i) d.a[i] -= reference.a[i];
  return static_cast<double>(norm(d) / norm(reference));
}

double condition(const Matrix& A) { return static_cast<double>(norm(A) * norm(inverse(A))) / A.rows; }

/// Errors in units of eps times the angle.
template <class G>
void checkLargeAngles(const char* name, int translation, bool scaled) {
  using S = typename G::Scalar;
  Table worst;
  for (const double angle : angles<S>()) {
    const double unit = static_cast<double>(std::numeric_limits<S>::epsilon()) * angle;
    const auto see = [&](const char* operation, const auto& value, const Matrix& reference, double condition = 1) {
      worst[operation].see(relativeError(value, reference) / (unit * condition), angle);
    };
    for (const auto& v : tangentsOf<G>(angle, translation, scaled)) {
      see("exp", G::exp(v).matrix(), seriesOfLarge(Matrix(G::hat(v)), 0));
      const Matrix ad(G::ad(v));
      Matrix minus_ad = ad;
      for (auto& a : minus_ad.a) a = -a;
      const Matrix left = seriesOfLarge(ad, 1), right = seriesOfLarge(minus_ad, 1);
      see("Adj", G::exp(v).Adj(), seriesOfLarge(ad, 0));
      see("leftJacobian", G::leftJacobian(v), left);
      see("rightJacobian", G::rightJacobian(v), right);
      see("leftJacobianInverse", G::leftJacobianInverse(v), inverse(left), condition(left));
      see("rightJacobianInverse", G::rightJacobianInverse(v), inverse(right), condition(right));
    }
  }
  print(name, is_float<S> ? "float" : "double", worst);
  for (const auto& [operation, w] : worst) {
    EXPECT_LE(w.error, 32) << name << (is_float<S> ? " float " : " double ") << operation << " at angle " << w.angle;
  }
}

template <template <class, int> class G>
void checkLargeAngles(const char* name, int translation, bool scaled) {
  checkLargeAngles<G<double, 0>>(name, translation, scaled);
  checkLargeAngles<G<float, 0>>(name, translation, scaled);
}

TEST(LargeAngles, SO2) { checkLargeAngles<liestat::SO2>("SO2", 0, false); }
TEST(LargeAngles, SO3) { checkLargeAngles<liestat::SO3>("SO3", 0, false); }
TEST(LargeAngles, SE2) { checkLargeAngles<liestat::SE2>("SE2", 2, false); }
TEST(LargeAngles, SE3) { checkLargeAngles<liestat::SE3>("SE3", 3, false); }
TEST(LargeAngles, RxSO2) { checkLargeAngles<liestat::RxSO2>("RxSO2", 0, true); }
TEST(LargeAngles, RxSO3) { checkLargeAngles<liestat::RxSO3>("RxSO3", 0, true); }
TEST(LargeAngles, Sim2) { checkLargeAngles<liestat::Sim2>("Sim2", 2, true); }
TEST(LargeAngles, Sim3) { checkLargeAngles<liestat::Sim3>("Sim3", 3, true); }

// The rotation is in the middle of the tangent vector here; its angle is set there.
template <class S>
void checkExtendedPoses() {
  using G = liestat::SE23<S>;
  Table worst;
  std::mt19937 generator(5);
  for (const double angle : angles<S>()) {
    const double unit = static_cast<double>(std::numeric_limits<S>::epsilon()) * angle;
    for (int i = 0; i < 8; ++i) {
      typename G::Tangent v;
      for (int k = 0; k < 9; ++k) v[k] = static_cast<S>(static_cast<double>(generator()) * 0x1p-31 - 1);
      v.template segment<3>(3) *= static_cast<S>(angle) / v.template segment<3>(3).norm();
      worst["exp"].see(relativeError(G::exp(v).matrix(), seriesOfLarge(Matrix(G::hat(v)), 0)) / unit, angle);
      const Matrix left = seriesOfLarge(Matrix(G::ad(v)), 1);
      worst["leftJacobian"].see(relativeError(G::leftJacobian(v), left) / unit, angle);
      worst["leftJacobianInverse"].see(
          relativeError(G::leftJacobianInverse(v), inverse(left)) / (unit * condition(left)), angle);
    }
  }
  print("SE23", is_float<S> ? "float" : "double", worst);
  for (const auto& [operation, w] : worst) EXPECT_LE(w.error, 32) << "SE23 " << operation << " at angle " << w.angle;
}
TEST(LargeAngles, SE23) { checkExtendedPoses<double>(), checkExtendedPoses<float>(); }

/// Batches whose lanes have different angles, beside the numbers of each lane.
template <class G>
void checkBatches(int translation, bool scaled) {
  using S = typename G::Scalar;
  using B = liestat::BatchOf<G>;
  constexpr std::size_t lanes = liestat::batch_size<G>;
  std::vector<typename G::Tangent> list;
  std::vector<double> angle_of;
  std::vector<double> swept = angles<S>();
  swept.push_back(1e-9), swept.push_back(0.5), swept.push_back(2.5);
  // Neighbours in the list are of different angles.
  for (std::size_t i = 0; i < 5; ++i) {
    for (const double angle : swept) {
      const auto all = tangentsOf<G>(angle, translation, scaled);
      list.push_back(all[(7 * i + 3) % all.size()]);
      angle_of.push_back(angle);
    }
  }
  for (std::size_t i = 0; i + lanes <= list.size(); i += lanes) {
    typename B::Tangent v;
    liestat::detail::loadRows<S, G::DoF>(list[i].data(), v.data(), lanes);
    const auto params = B::exp(v).params();
    const auto left = B::leftJacobian(v);
    for (std::size_t k = 0; k < lanes; ++k) {
      const double unit = static_cast<double>(std::numeric_limits<S>::epsilon()) * std::max(1., angle_of[i + k]);
      const auto check = [&](const auto& batch, const auto& number, const char* operation) {
        double difference = 0, size = 0;
        for (Eigen::Index r = 0; r < number.rows(); ++r) {
          for (Eigen::Index c = 0; c < number.cols(); ++c) {
            difference = std::max(difference, std::abs(static_cast<double>(batch(r, c).get(k) - number(r, c))));
            size = std::max(size, std::abs(static_cast<double>(number(r, c))));
          }
        }
        EXPECT_LE(difference, 32 * unit * size) << operation << " at angle " << angle_of[i + k];
      };
      check(params, G::exp(list[i + k]).params(), "exp");
      check(left, G::leftJacobian(list[i + k]), "leftJacobian");
    }
  }
}
TEST(LargeAngles, Batches) {
  checkBatches<liestat::SO3d>(0, false), checkBatches<liestat::SE3d>(3, false), checkBatches<liestat::SE2d>(2, false);
  checkBatches<liestat::Sim2d>(2, true), checkBatches<liestat::Sim3d>(3, true), checkBatches<liestat::RxSO3d>(0, true);
  checkBatches<liestat::SO3f>(0, false), checkBatches<liestat::Sim3f>(3, true);
}

}  // namespace
