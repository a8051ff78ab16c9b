// Additions of the generated tests to a manifold's contract: views of its parameters, and casts.
#pragma once

#include <lie/manifold.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <type_traits>
#include <vector>

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

/// Numbers in double, exactly: comparisons of these are compiled once, those of Eigen's vectors once per size.
using Numbers = std::vector<double>;
template <class Vector>
Numbers numbers(const Vector& v) {
  Numbers list;
  for (Eigen::Index i = 0; i < v.size(); ++i) list.push_back(static_cast<double>(v[i]));
  return list;
}
template <class M>
Numbers parameters(const M& x) {
  if constexpr (requires { x.params(); }) {
    return numbers(x.params());
  } else {
    return numbers(x);
  }
}
/// Rounded to float.
inline Numbers narrowed(const Numbers& list) {
  Numbers rounded;
  for (const double x : list) rounded.push_back(static_cast<double>(static_cast<float>(x)));
  return rounded;
}
inline void expectEqual(const Numbers& a, const Numbers& b, const char* what) { EXPECT_EQ(a, b) << what; }
inline void expectDifferent(const Numbers& a, const Numbers& b) { ASSERT_NE(a, b); }
inline void expectSame(const void* a, const void* b, bool same, const char* what) { EXPECT_EQ(a == b, same) << what; }

/// Reads and writes through Eigen::Map in the middle of a buffer, whose other entries must stay as they are.
template <class M>
void checkViews() {
  if constexpr (HasParams<M>) {
    using S = typename M::Scalar;
    constexpr int n = M::num_parameters;
    const M x = anyPoint<M>(1), y = anyPoint<M>(-0.7);
    const Numbers of_x = parameters(x), of_y = parameters(y);
    expectDifferent(of_x, of_y);
    S buffer[n + 2];
    std::fill(buffer, buffer + n + 2, S(7));
    Eigen::Map<M> view(buffer + 1);
    view = x;
    Numbers framed = of_x;
    framed.insert(framed.begin(), 7);
    framed.push_back(7);
    expectEqual(Numbers(buffer, buffer + n + 2), framed, "a view writes its parameters, in their order, and no more");
    expectSame(view.data(), buffer + 1, true, "a view's data()");
    expectEqual(parameters(M(view)), of_x, "a value made from a view");

    const Eigen::Map<const M> constant(buffer + 1);
    static_assert(std::is_same_v<decltype(constant.data()), const S*>);
    static_assert(std::is_same_v<decltype(Eigen::Map<const M>(buffer).data()), const S*>);
    expectEqual(parameters(M(constant)), of_x, "a value made from a view of const memory");
    expectSame(constant.data(), buffer + 1, true, "data() of a view of const memory");

    // Assignment of a view copies the value, not the pointer.
    S other[n];
    Eigen::Map<M> target(other);
    target = constant;
    expectEqual(parameters(target), of_x, "a view assigned from a view of const memory");
    Eigen::Map<M> second(buffer + 1);
    second = y;
    expectEqual(parameters(constant), of_y, "two views of the same memory");
    target = second;
    expectEqual(parameters(target), of_y, "a view assigned from a view");
    expectSame(target.data(), second.data(), false, "assignment keeps the memory of a view");
    M owner = target;
    owner = x;
    expectEqual(parameters(target), of_y, "an owning value must not write into the view it was made from");
    expectEqual(parameters(owner), of_x, "assignment to an owning value");

    if constexpr (liestat::LieGroup<M>) {
      const M product = x * y;
      expectEqual(parameters(Eigen::Map<const M>(x.data()) * second), parameters(product), "a product of views");
      target = x;
      target *= second;
      expectEqual(parameters(target), parameters(product), "a product in place");
      expectEqual(parameters(constant.inverse()), parameters(y.inverse()), "inverse() of a view");
      expectEqual(numbers(constant.log()), numbers(y.log()), "log() of a view");
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
    expectEqual(parameters(narrow), narrowed(parameters(x)), "cast to float");
    expectEqual(parameters(back), parameters(narrow), "cast back to double");
    return true;
  }
  return false;
}

}  // namespace liestat_test
