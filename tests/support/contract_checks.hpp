// What the generated tests of the contract ask of a manifold besides its contract: views of its parameters, and casts.
#pragma once

#include <lie/testing.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <type_traits>

namespace liestat_test {

/// Types with parameters in memory; Eigen vectors have Eigen's views, products give theirs by value.
template <class M>
concept HasParams = requires(const M& x) {
  x.params();
  x.data();
  M::fromParams(x.params());
};

template <class M>
M anyPoint(double scale) {
  using T = liestat::ManifoldTraits<M>;
  typename T::Tangent v;
  for (int i = 0; i < T::DoF; ++i) v[i] = static_cast<typename T::Scalar>(scale * (0.3 + 0.1 * i));
  return T::expOrigin(v);
}

/// Reads and writes through Eigen::Map in the middle of a buffer, whose other entries must stay as they are.
template <class M>
void checkViews() {
  if constexpr (HasParams<M>) {
    using S = typename M::Scalar;
    constexpr int n = M::num_parameters;
    const M x = anyPoint<M>(1), y = anyPoint<M>(-0.7);
    ASSERT_NE(x.params(), y.params());
    S buffer[n + 2];
    std::fill(buffer, buffer + n + 2, S(7));
    Eigen::Map<M> view(buffer + 1);
    view = x;
    EXPECT_EQ(buffer[0], S(7));
    EXPECT_EQ(buffer[n + 1], S(7));
    for (int i = 0; i < n; ++i) EXPECT_EQ(buffer[i + 1], x.data()[i]) << "parameter " << i;
    EXPECT_EQ(view.data(), buffer + 1);
    EXPECT_EQ(M(view).params(), x.params());

    const Eigen::Map<const M> constant(buffer + 1);
    static_assert(std::is_same_v<decltype(constant.data()), const S*>);
    static_assert(std::is_same_v<decltype(Eigen::Map<const M>(buffer).data()), const S*>);
    EXPECT_EQ(M(constant).params(), x.params());
    EXPECT_EQ(constant.data(), buffer + 1);

    // Assignment of a view copies the value, not the pointer.
    S other[n];
    Eigen::Map<M> target(other);
    target = constant;
    EXPECT_EQ(target.params(), x.params());
    Eigen::Map<M> second(buffer + 1);
    second = y;
    EXPECT_EQ(constant.params(), y.params());
    target = second;
    EXPECT_EQ(target.params(), y.params());
    EXPECT_NE(target.data(), second.data());
    M owner = target;
    owner = x;
    EXPECT_EQ(target.params(), y.params()) << "an owning value must not write into the view it was made from";
    EXPECT_EQ(owner.params(), x.params());

    if constexpr (liestat::LieGroup<M>) {
      const M product = x * y;
      EXPECT_EQ((Eigen::Map<const M>(x.data()) * second).params(), product.params());
      target = x;
      target *= second;
      EXPECT_EQ(target.params(), product.params());
      EXPECT_EQ(constant.inverse().params(), y.inverse().params());
      EXPECT_EQ(constant.log(), y.log());
    }
  }
}

/// A cast takes each parameter to the nearest number of the other scalar, and back as it is.
template <template <class> class Type>
bool checkCast() {
  const Type<double> x = anyPoint<Type<double>>(1);
  if constexpr (requires { x.template cast<float>(); }) {
    const Type<float> narrow = x.template cast<float>();
    const Type<double> back = narrow.template cast<double>();
    const auto parameters = [](const auto& y) {
      if constexpr (requires { y.params(); }) {
        return y.params().eval();
      } else {
        return y;
      }
    };
    EXPECT_EQ(parameters(narrow), parameters(x).template cast<float>());
    EXPECT_EQ(parameters(back), parameters(narrow).template cast<double>());
    return true;
  }
  return false;
}

}  // namespace liestat_test
