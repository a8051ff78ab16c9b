// Products: parts, blocks of tangents and covariances, parameters, and that every operation is that of the parts.

#include <lie/lie.hpp>

#include <support/products.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <type_traits>

namespace {

using namespace liestat;
using liestat_test::TurnedS2;
using State = Product<Frame3d, S2d, Eigen::Vector2d>;
using T = ManifoldTraits<State>;

template <class M>
concept shows_parameters = requires(const M& x) {
  x.params();
};
template <class M>
concept casts = requires(const M& x) {
  x.template cast<float>();
};

State::Tangent tangent(double scale) {
  State::Tangent v;
  for (int i = 0; i < State::DoF; ++i) v[i] = scale * (0.5 - 0.3 * i + 0.04 * i * i);
  return v;
}

TEST(Product, PartsAndTheirBlocks) {
  static_assert(State::DoF == 10 && State::num_parameters == 12 && State::num_parts == 3);
  static_assert(State::tangent_offset<0> == 0 && State::tangent_offset<1> == 6 && State::tangent_offset<2> == 8);
  static_assert(std::is_same_v<State::Part<1>, S2d>);
  State x;
  EXPECT_EQ(x.get<0>().params(), Frame3d().params());
  EXPECT_EQ(x.get<2>(), Eigen::Vector2d(0, 0)) << "the origin, where Eigen leaves what was there";
  x.get<2>() << 3, 4;
  auto [frame, direction, vector] = x;
  EXPECT_EQ(vector, Eigen::Vector2d(3, 4));
  vector.setZero();
  EXPECT_EQ(x.get<2>(), Eigen::Vector2d(3, 4)) << "auto makes a copy";
  auto& [f, d, v] = x;
  v.setZero();
  EXPECT_EQ(x.get<2>(), Eigen::Vector2d(0, 0)) << "auto& does not";
  EXPECT_EQ(f.params(), frame.params());
  EXPECT_EQ(d.params(), direction.params());

  State::Tangent w = tangent(1);
  EXPECT_EQ(Eigen::Vector2d(State::tangentBlock<1>(w)), Eigen::Vector2d(w[6], w[7]));
  State::tangentBlock<2>(w) << 8, 9;
  EXPECT_EQ(w[9], 9);
  State::Square S = State::Square::Zero();
  State::covarianceBlock<0, 2>(S).setConstant(7);
  EXPECT_EQ(S(5, 9), 7);
  EXPECT_EQ(S(9, 5), 0);
  EXPECT_EQ(S.sum(), 7 * 12);
  const State::Square& constant = S;
  EXPECT_EQ((State::covarianceBlock<0, 2>(constant).sum()), 7 * 12);
}

TEST(Product, ParametersAreThoseOfTheParts) {
  const State x(Frame3d(SO3d::rotX(0.3), Eigen::Vector3d(1, 2, 3)), S2d(1, 2, 2), Eigen::Vector2d(4, 5));
  State::Params p;
  p << x.get<0>().params(), x.get<1>().params(), x.get<2>();
  EXPECT_EQ(x.params(), p);
  EXPECT_EQ(State::fromParams(p).params(), p);
  const Product<Frame3f, S2f, Eigen::Vector2f> narrow = x.cast<float>();
  EXPECT_EQ(narrow.params(), p.cast<float>());
  // A part that shows no parameters leaves the product without.
  using WithUsers = Product<TurnedS2<double>, SO3d>;
  static_assert(shows_parameters<State> && !shows_parameters<WithUsers>);
  static_assert(casts<State> && !casts<WithUsers>);
}

// To the bit: nothing is computed but by the parts.
TEST(Product, OperationsAreThoseOfTheParts) {
  const State::Tangent v = tangent(1), w = tangent(-0.4);
  const State y = T::expOrigin(w), x = exp(y, v);
  const State::Tangent z = log(y, x);
  EXPECT_EQ(Eigen::Vector2d(State::tangentBlock<1>(z)), log(y.get<1>(), x.get<1>()));
  const auto z_frame = log(y.get<0>(), x.get<0>());
  EXPECT_EQ((z.head<6>()), z_frame);
  EXPECT_EQ((z.tail<2>()), (x.get<2>() - y.get<2>()));
  const double squared = std::pow(distance(y.get<0>(), x.get<0>()), 2) + std::pow(distance(y.get<1>(), x.get<1>()), 2) +
                         (x.get<2>() - y.get<2>()).squaredNorm();
  EXPECT_NEAR(std::pow(distance(y, x), 2), squared, 1e-13);
  EXPECT_EQ((T::dlogOrigin(x).block<2, 2>(6, 6)), ManifoldTraits<S2d>::dlogOrigin(x.get<1>()));
  EXPECT_EQ((T::hessianHalfSquaredDistance(z).topLeftCorner<6, 6>()),
            ManifoldTraits<Frame3d>::hessianHalfSquaredDistance(z_frame));
  EXPECT_EQ(T::injectivityRadius(), static_cast<double>(EIGEN_PI));
  EXPECT_EQ(T::maxSectionalCurvature(), 1);
  EXPECT_EQ((ManifoldTraits<Product<SO3d, SemiOrientedFrame3d>>::injectivityRadius()),
            static_cast<double>(EIGEN_PI / 2));
  EXPECT_EQ((ManifoldTraits<Product<SO3d, SO2d>>::maxSectionalCurvature()), 0.25);
}

TEST(Product, VolumeIsTheProductOfTheParts) {
  using M = Product<SO3d, S2d>;
  const Eigen::Vector3d r(0.3, -1, 0.8);
  const Eigen::Vector2d d(0.9, 0.4);
  M::Tangent z;
  z << r, d;
  const auto volume = ManifoldTraits<M>::logVolume(z);
  const auto rotation = ManifoldTraits<SO3d>::logVolume(r);
  const auto direction = ManifoldTraits<S2d>::logVolume(d);
  EXPECT_EQ(volume.value, rotation.value + direction.value);
  EXPECT_EQ((volume.gradient.tail<2>()), direction.gradient);
  EXPECT_EQ((volume.hessian.topLeftCorner<3, 3>()), rotation.hessian);
}

/// log det J_l of a group with its derivatives: second order in h, and rounding over h.
template <class G>
void isTheVolumeOfTheExponential(const char* name) {
  constexpr int k = G::DoF;
  using V = ManifoldTraits<G>;
  typename G::Tangent z;
  for (int i = 0; i < k; ++i) z[i] = 0.7 - 0.3 * i + 0.05 * i * i;
  const auto volume = V::logVolume(z);
  EXPECT_NEAR(volume.value, std::log(G::leftJacobian(z).determinant()), 1e-13) << name;
  constexpr double h = 1e-5;
  for (int i = 0; i < k; ++i) {
    const typename G::Tangent step = h * G::Tangent::Unit(i), ahead = z + step, behind = z - step;
    EXPECT_NEAR(volume.gradient[i], (V::logVolume(ahead).value - V::logVolume(behind).value) / (2 * h), 1e-9) << name;
    const typename G::Tangent by = (V::logVolume(ahead).gradient - V::logVolume(behind).gradient) / (2 * h);
    EXPECT_LT((volume.hessian.col(i) - by).norm(), 1e-9) << name;
  }
}
TEST(Volume, IsTheDeterminantOfTheJacobian) {
  isTheVolumeOfTheExponential<SO2d>("SO2");
  isTheVolumeOfTheExponential<SO3d>("SO3");
  isTheVolumeOfTheExponential<SE2d>("SE2");
  isTheVolumeOfTheExponential<SE3d>("SE3");
  isTheVolumeOfTheExponential<SE23d>("SE23");
  isTheVolumeOfTheExponential<RxSO3d>("RxSO3");
}

// Each quotient takes its own nearest representative; an index names one of each.
TEST(Product, RepresentativesOfTheParts) {
  using M = liestat_test::Quotients<double>;
  using Q = ManifoldTraits<M>;
  static_assert(Q::num_representatives == 8);
  const M x(SemiOrientedFrame3d(SO3d::rotZ(3), Eigen::Vector3d(1, 2, 3)), Eigen::Vector2d(4, 5),
            NonOrientedFrame3d(SO3d::rotY(2.5), Eigen::Vector3d(6, 7, 8)));
  const auto choice = Q::nearestRepresentative(x);
  const M near = Q::representative(x, choice.index);
  EXPECT_NEAR(near.get<0>().so3().log().norm(), EIGEN_PI - 3, 1e-14);
  EXPECT_NEAR(near.get<2>().so3().log().norm(), EIGEN_PI - 2.5, 1e-14);
  EXPECT_EQ(near.get<1>(), x.get<1>());
  const auto first = ManifoldTraits<SemiOrientedFrame3d>::nearestRepresentative(x.get<0>());
  const auto last = ManifoldTraits<NonOrientedFrame3d>::nearestRepresentative(x.get<2>());
  EXPECT_EQ(choice.gap(), std::min(first.gap(), last.gap()));
  EXPECT_EQ(Q::nearestRepresentative(near).index, 0);
}

TEST(ProductGroup, OperationsAreThoseOfTheParts) {
  using G = ProductGroup<SO3d, SE3d>;
  G::Tangent v;
  for (int i = 0; i < G::DoF; ++i) v[i] = 0.5 - 0.3 * i + 0.03 * i * i;
  G x = G::exp(v);
  EXPECT_EQ(x.get<1>().params(), SE3d::exp(v.tail<6>()).params());
  EXPECT_EQ((x * x).get<0>().params(), (x.get<0>() * x.get<0>()).params());
  EXPECT_EQ((x.Adj().bottomRightCorner<6, 6>()), x.get<1>().Adj());
  EXPECT_EQ(x.Adj().topRightCorner(3, 6).norm(), 0);
  EXPECT_EQ((G::leftJacobianInverse(v).topLeftCorner<3, 3>()), SO3d::leftJacobianInverse(v.head<3>()));
  x.get<0>() = SO3d::fromParams(1.01 * x.get<0>().params());
  x.normalize();
  EXPECT_NEAR(x.get<0>().params().norm(), 1, 1e-15);
  const auto [rotation, motion] = x;
  EXPECT_EQ(motion.params(), x.get<1>().params());
  EXPECT_EQ(rotation.params(), x.get<0>().params());
}

}  // namespace
