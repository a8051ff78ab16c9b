// {fmt} formatting of every type with parameters: fmt::format("{:.3f}", pose) (needs {fmt}).
//
// The parameters in their order, separated by spaces, as operator<< prints them; a format applies to each number.
#pragma once

#include <lie/detail/shell.hpp>

#include <fmt/format.h>

#include <concepts>

// Doxygen knows no templates of other namespaces.
/// @cond
/// Owned values and views alike.
template <class T>
  requires std::derived_from<T, liestat::detail::Shell<T>>
struct fmt::formatter<T, char> : fmt::formatter<typename liestat::detail::ShellTraits<T>::Scalar, char> {
  template <class Context>
  auto format(const T& x, Context& context) const {
    using Number = fmt::formatter<typename liestat::detail::ShellTraits<T>::Scalar, char>;
    const auto& p = x.params();
    auto out = context.out();
    for (Eigen::Index i = 0; i < p.size(); ++i) {
      if (i > 0) *out++ = ' ';
      context.advance_to(out);
      out = Number::format(p[i], context);
    }
    return out;
  }
};
/// @endcond
