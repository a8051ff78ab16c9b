// Batches agree with scalars, lane by lane, also where the lanes of one batch are on both sides of a branch.

#include <lie/compat/batch.hpp>
#include <lie/lie.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat;

/// The lanes of a matrix of batches.
template <class D>
auto lane(const Eigen::MatrixBase<D>& m, std::size_t i) {
  using S = typename D::Scalar::value_type;
  Eigen::Matrix<S, D::RowsAtCompileTime, D::ColsAtCompileTime> result;
  for (Eigen::Index r = 0; r < m.rows(); ++r) {
    for (Eigen::Index c = 0; c < m.cols(); ++c) result(r, c) = m(r, c).get(i);
  }
  return result;
}

/// 8 eps normwise, relative where the result is larger than one.
template <class A, class B>
void expectNear(const Eigen::MatrixBase<A>& batch, const Eigen::MatrixBase<B>& scalar, const char* what, double angle) {
  using S = typename B::Scalar;
  const double eps = static_cast<double>(std::numeric_limits<S>::epsilon());
  const double size = std::max(1.0, static_cast<double>(scalar.norm()));
  EXPECT_LE(static_cast<double>((batch - scalar).norm()), 8 * eps * size) << what << " at angle " << angle;
}

/// Tangent vectors with angles by decades to pi and beyond, shuffled, so that each batch has some of several ranges.
template <class G>
std::vector<typename G::Tangent> tangents() {
  using S = typename G::Scalar;
  std::vector<double> angles{0, 1e-9, 1e-6, 1e-3, 0.1, 0.22, 0.23, 0.7, 1.5, 2.2, 3.0, 3.1, 3.1415, 3.2, 3.3, 5.0};
  std::mt19937 generator(4);
  for (std::size_t i = angles.size(); i-- > 1;) std::swap(angles[i], angles[generator() % (i + 1)]);
  std::vector<typename G::Tangent> list;
  for (int round = 0; round < 4; ++round) {
    for (const double angle : angles) {
      typename G::Tangent v;
      for (int k = 0; k < G::DoF; ++k) v[k] = static_cast<S>(static_cast<double>(generator()) * 0x1p-31 - 1);
      list.push_back(v * static_cast<S>(angle / static_cast<double>(v.norm())));
    }
  }
  return list;
}

template <class G>
class BatchOfGroup : public testing::Test {};
using Groups = testing::Types<SO2d, SO3d, SO3f, SE2d, SE3d, RxSO2d, RxSO3d, Sim2d, Sim3d, Sim3f>;
TYPED_TEST_SUITE(BatchOfGroup, Groups);

TYPED_TEST(BatchOfGroup, EveryOperationAgreesWithTheScalars) {
  using G = TypeParam;
  using B = BatchOf<G>;
  using T = ManifoldTraits<B>;
  constexpr std::size_t lanes = batch_size<G>;
  const auto list = tangents<G>();
  for (std::size_t i = 0; i + 2 * lanes <= list.size(); i += lanes) {
    typename B::Tangent v, w;
    detail::loadRows<typename G::Scalar, G::DoF>(list[i].data(), v.data(), lanes);
    detail::loadRows<typename G::Scalar, G::DoF>(list[i + lanes].data(), w.data(), lanes);
    const B x = B::exp(v), y = B::exp(w);
    typename B::Point p;
    for (int k = 0; k < B::Dim; ++k) p[k] = typename B::Scalar(static_cast<typename G::Scalar>(1.5 - k));
    const B product = x * y;
    const auto log = x.log();
    const auto moved = (x * p).eval();
    const auto matrix = x.matrix();
    const auto adjoint = x.Adj();
    const auto left = B::leftJacobian(v), right_inverse = B::rightJacobianInverse(v);
    const auto dlog = T::dlogOrigin(x);
    for (std::size_t k = 0; k < lanes; ++k) {
      const typename G::Tangent a = list[i + k];
      const double angle = static_cast<double>(a.norm());
      const G s = G::exp(a), t = G::exp(list[i + lanes + k]);
      const G same = G::fromParams(lane(x.params(), k));
      expectNear(lane(x.params(), k), s.params(), "exp", angle);
      expectNear(lane(log, k), same.log(), "log", angle);
      expectNear(lane(product.params(), k), (s * t).params(), "product", angle);
      expectNear(lane(x.inverse().params(), k), same.inverse().params(), "inverse", angle);
      expectNear(lane(moved, k), (same * lane(p, k)).eval(), "action", angle);
      expectNear(lane(matrix, k), same.matrix(), "matrix", angle);
      expectNear(lane(adjoint, k), same.Adj(), "Adj", angle);
      expectNear(lane(left, k), G::leftJacobian(a), "leftJacobian", angle);
      expectNear(lane(right_inverse, k), G::rightJacobianInverse(a), "rightJacobianInverse", angle);
      expectNear(lane(dlog, k), ManifoldTraits<G>::dlogOrigin(same), "dlogOrigin", angle);
    }
  }
}

TYPED_TEST(BatchOfGroup, RangesOfAnyLength) {
  using G = TypeParam;
  const auto all = tangents<G>();
  for (std::size_t n = 0; n < 2 * batch_size<G> + 2; ++n) {
    const std::span<const typename G::Tangent> list(all.data(), n);
    std::vector<G> elements(n + 1);
    std::vector<typename G::Tangent> back(n + 1);
    back[n].setConstant(7);
    expAll<G>(list, std::span(elements.data(), n));
    logAll<G>(std::span<const G>(elements.data(), n), std::span(back.data(), n));
    for (std::size_t i = 0; i < n; ++i) {
      expectNear(elements[i].params(), G::exp(list[i]).params(), "expAll", 0);
      expectNear(back[i], elements[i].log(), "logAll", 0);
    }
    EXPECT_EQ(elements[n].params(), G().params()) << "nothing is written behind the end";
    EXPECT_EQ(back[n], G::Tangent::Constant(7));
  }
}

TEST(BatchOfManifolds, ElementsAreLoadedAndStored) {
  constexpr std::size_t lanes = batch_size<SE3d>;
  std::vector<SE3d> poses, inverses(lanes + 1);
  for (const auto& v : tangents<SE3d>()) poses.push_back(SE3d::exp(v));
  storeBatch(loadBatch(poses.data()).inverse(), inverses.data());
  for (std::size_t i = 0; i < lanes; ++i) expectNear(inverses[i].params(), poses[i].inverse().params(), "inverse", 0);
  EXPECT_EQ(inverses[lanes].params(), SE3d().params()) << "nothing is written behind the end";
  // Fewer than the lanes: the last one fills the rest, and only so many are written.
  const auto few = loadBatch(poses.data(), 1);
  for (std::size_t i = 0; i < lanes; ++i) EXPECT_EQ(lane(few.params(), i), poses[0].params());
  storeBatch(few, inverses.data(), 1);
  EXPECT_EQ(inverses[0].params(), poses[0].params());
  expectNear(inverses[1].params(), poses[1].inverse().params(), "the second is as it was", 0);
}

TEST(BatchOfManifolds, ExpAndLogAgreeWithTheScalars) {
  const auto check = [](auto sample) {
    using M = decltype(sample);
    using T = ManifoldTraits<M>;
    std::vector<typename T::Tangent> list;
    for (int i = 0; i < 13; ++i) {
      typename T::Tangent v;
      for (int k = 0; k < T::DoF; ++k) v[k] = std::sin(1.7 * i + k) * std::pow(10., -(i % 4));
      list.push_back(v);
    }
    std::vector<M> elements(list.size());
    std::vector<typename T::Tangent> back(list.size());
    expAll<M>(list, elements);
    logAll<M>(elements, back);
    for (std::size_t i = 0; i < list.size(); ++i) {
      expectNear(elements[i].params(), T::expOrigin(list[i]).params(), "expOrigin", list[i].norm());
      expectNear(back[i], T::logOrigin(elements[i]), "logOrigin", list[i].norm());
    }
  };
  check(S2d());
  check(Frame2d());
  check(Frame3d());
}

}  // namespace
