// The interface that a library of the project's compiler and a test of another one must share: names, sizes, alignment.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace two_compilers {

template <class T>
concept Number = requires(T x) {
  x + x;
};
template <class F>
concept Function = requires(F f) {
  f(1.0);
};

struct Result {
  Eigen::Vector4d vector;
  std::optional<Eigen::Matrix3f> matrix;
  std::string text;
  std::vector<Eigen::Vector4d> list;
};

// As the means are: constrained, and compiled in the library.
template <Number T, Function F>
Result result(const F& function, T value) {
  return {Eigen::Vector4d::Constant(function(value)), Eigen::Matrix3f::Identity(), "longer than its own place",
          std::vector<Eigen::Vector4d>(3, Eigen::Vector4d::Constant(function(value)))};
}
extern template Result result<double>(const std::function<double(double)>&, double);

Result doubled(const Result& result, std::size_t alignment);

}  // namespace two_compilers
