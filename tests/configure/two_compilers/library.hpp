// A library of the project's compiler and a test of another: what they must agree on, to be linked and run.
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <functional>
#include <optional>
#include <string>
#include <vector>

template <class T>
concept Number = std::floating_point<T>;

struct Result {
  Eigen::Vector4d vector;
  std::optional<Eigen::Matrix3f> matrix;
  std::string text;
  std::vector<Eigen::Vector4d> list;
};

// The name of a constrained template is the compiler's own affair until it stands in another compiler's object.
template <Number T, class F>
  requires std::invocable<F, T>
Result result(T value, F&& function) {
  Result made;
  made.vector.setConstant(function(value));
  made.matrix = Eigen::Matrix3f::Identity();
  made.text = "a text that is too long for its own place";
  made.list.assign(3, made.vector);
  return made;
}

extern template Result result(double, const std::function<double(double)>&);
Result doubled(const Result& result, std::size_t alignment);
