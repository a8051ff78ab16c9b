// The bar of accuracy, as an expectation of GoogleTest.
#pragma once

#include <support/high_precision.hpp>

#include <gtest/gtest.h>

namespace liestat_test {

/// Prints the table and holds it against the bar.
template <class S>
void expectWithinBar(const char* name, const Table& worst) {
  print(name, is_float<S> ? "float" : "double", worst);
  for (const auto& [operation, w] : worst) {
    const bool is_inverse = operation.find("Inverse") != std::string::npos;
    EXPECT_LE(w.error, is_inverse ? Bar<S>::inverse_jacobian : Bar<S>::value)
        << name << (is_float<S> ? " float " : " double ") << operation << " at angle " << w.angle;
  }
}

}  // namespace liestat_test
