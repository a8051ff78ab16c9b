// Constraints with inequalities, alternatives, conditions and qualitative variables, as equations for
// stats/constrained.hpp (Viéville, Lingrand and Gaspard 2000, appendix F). Needs Eigen alone; derivatives by autoDiff() of
// stats/auto_diff.hpp.
//
//   // x and y outside of a wall at x = 1, or on the line y = 0; q = (x, y, λ).
//   const auto outside = atLeastZero([](const auto& q) { return q[0] - 1.0; }, 2);
//   const auto on_line = [](const auto& q) { return q[1]; };
//   const auto result = constrainedEstimate(start, channel, autoDiff(disjunction(outside, on_line)));
//
// A term is a function object, generic in the scalar, of the parameter, or of the parameter and a measurement; it returns
// a number or a vector, and holds where all of it is zero. Blocks are terms again. A slack variable λ is a coordinate of
// the parameter, given by its place; it must start where slackFor… says.
//
// Properties to know before use:
//  - Gradients vanish at λ = 0, and where two factors of a product vanish at once. Such equations are dropped for that step
//    and counted (ConstrainedResult::dropped_constraints, dropped_equations).
//  - At λ = 0 second derivatives decide (ConstrainedOptions::second_order): the bound is active
//    (ConstrainedResult::active_bounds), or λ leaves zero. The covariance is that without the bound, which holds on
//    both sides of it.
//  - The estimate is a local one: it does not jump to another alternative or value.
//  - A state that is unknown (which branch of a hysteresis) makes two models of a hierarchy (stats/hierarchy.hpp), not one
//    product of equations.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <tuple>
#include <utility>

namespace liestat {

namespace detail {

/// A number as a vector of one.
template <class T>
auto termVector(const T& value) {
  if constexpr (requires { value.rows(); }) {
    return value.eval();
  } else {
    return Eigen::Matrix<T, 1, 1>(value);
  }
}
/// The numbers of one vector after those of another.
template <class A, class B>
auto stacked(const A& a, const B& b) {
  constexpr int m = A::RowsAtCompileTime, n = B::RowsAtCompileTime;
  Eigen::Matrix<typename A::Scalar, m + n, 1> all;
  for (int i = 0; i < m; ++i) all[i] = a[i];
  for (int j = 0; j < n; ++j) all[m + j] = b[j];
  return all;
}
/// The product of each number of one vector with each of another.
template <class A, class B>
auto products(const A& a, const B& b) {
  constexpr int m = A::RowsAtCompileTime, n = B::RowsAtCompileTime;
  Eigen::Matrix<typename A::Scalar, m * n, 1> all;
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < n; ++j) all[i * n + j] = a[i] * b[j];
  }
  return all;
}

/// A term f with a slack variable, the coordinate of the parameter at `slack`.
template <class F>
struct SlackTerm {
  F f;
  int slack;
};

}  // namespace detail

/// c >= 0 as c - λ² = 0.
template <class F>
struct AtLeastZero : detail::SlackTerm<F> {
  template <class Q, class... M>
  auto operator()(const Q& q, const M&... m) const {
    const auto& lambda = q[this->slack];
    return this->f(q, m...) - lambda * lambda;
  }
};
/// c > 0 as c λ² - 1 = 0.
template <class F>
struct AboveZero : detail::SlackTerm<F> {
  template <class Q, class... M>
  auto operator()(const Q& q, const M&... m) const {
    const auto& lambda = q[this->slack];
    return this->f(q, m...) * lambda * lambda - 1.0;
  }
};
/// c != 0 as c λ - 1 = 0.
template <class F>
struct NotZero : detail::SlackTerm<F> {
  template <class Q, class... M>
  auto operator()(const Q& q, const M&... m) const {
    return this->f(q, m...) * q[this->slack] - 1.0;
  }
};
template <class F>
AtLeastZero<F> atLeastZero(F f, int slack) {
  return {{std::move(f), slack}};
}
template <class F>
AboveZero<F> aboveZero(F f, int slack) {
  return {{std::move(f), slack}};
}
template <class F>
NotZero<F> notZero(F f, int slack) {
  return {{std::move(f), slack}};
}

// Where slacks start for a value c of the term: on the constraint where it holds, and never at zero, where the gradient
// vanishes and the equation would be dropped without a step.
inline double slackForAtLeastZero(double c, double least = 1e-3) { return std::sqrt(c > least ? c : least); }
inline double slackForAboveZero(double c, double least = 1e-3) { return 1 / std::sqrt(c > least ? c : least); }
inline double slackForNotZero(double c, double least = 1e-3) {
  return 1 / (std::abs(c) > least ? c : c < 0 ? -least : least);
}

/// -f.
template <class F>
struct Minus {
  F f;
  template <class... T>
  auto operator()(const T&... x) const {
    return -f(x...);
  }
};

/// Not c >= 0 is -c > 0, with the same slack variable, and so on. An equation's negation needs a slack variable.
template <class F>
AboveZero<Minus<F>> negation(const AtLeastZero<F>& term) {
  return {{{term.f}, term.slack}};
}
template <class F>
AtLeastZero<Minus<F>> negation(const AboveZero<F>& term) {
  return {{{term.f}, term.slack}};
}
template <class F>
F negation(const NotZero<F>& term) {
  return term.f;
}
template <class F>
NotZero<F> negation(F f, int slack) {
  return notZero(std::move(f), slack);
}

/// All of the terms: their equations one below the other.
template <class... F>
struct Conjunction {
  std::tuple<F...> terms;
  template <class... T>
  auto operator()(const T&... x) const {
    return std::apply(
        [&](const auto& first, const auto&... rest) {
          return fold(detail::termVector(first(x...)), detail::termVector(rest(x...))...);
        },
        terms);
  }

 private:
  template <class A>
  static A fold(const A& a) {
    return a;
  }
  template <class A, class B, class... C>
  static auto fold(const A& a, const B& b, const C&... c) {
    return fold(detail::stacked(a, b), c...);
  }
};
template <class... F>
Conjunction<F...> conjunction(F... terms) {
  return {{std::move(terms)...}};
}

/// One of the terms at least: the products of their equations, each with each, which is the conjunctive normal form of
/// alternatives that are conjunctions themselves.
template <class... F>
struct Disjunction {
  std::tuple<F...> terms;
  template <class... T>
  auto operator()(const T&... x) const {
    return std::apply(
        [&](const auto& first, const auto&... rest) {
          return fold(detail::termVector(first(x...)), detail::termVector(rest(x...))...);
        },
        terms);
  }

 private:
  template <class A>
  static A fold(const A& a) {
    return a;
  }
  template <class A, class B, class... C>
  static auto fold(const A& a, const B& b, const C&... c) {
    return fold(detail::products(a, b), c...);
  }
};
template <class... F>
Disjunction<F...> disjunction(F... terms) {
  return {{std::move(terms)...}};
}

/// If the condition holds, `then`, else `otherwise`: [condition and then] or [not condition and otherwise]. The condition
/// is an inequality, or an equation with a slack variable for its negation.
template <class Condition, class Then, class Else>
auto conditional(const Condition& condition, Then then, Else otherwise) {
  return disjunction(conjunction(condition, std::move(then)), conjunction(negation(condition), std::move(otherwise)));
}
template <class Condition, class Then, class Else>
auto conditional(const Condition& condition, int slack, Then then, Else otherwise) {
  return disjunction(conjunction(condition, std::move(then)),
                     conjunction(negation(condition, slack), std::move(otherwise)));
}

// Qualitative variables: N values as points of a space, whose place says how they are related. Each has the coordinates of
// its values, the equations that hold at them and nowhere else, the value that is nearest, and selectors, which are 1 at
// one value and 0 at the others.

/// N sorted values 0 to N - 1 on a line: Π (x - k) = 0.
template <int N>
struct SortedValues {
  static constexpr int dimension = 1, equations = 1;
  using Point = Eigen::Matrix<double, 1, 1>;

  static Point value(int k) { return Point(k); }
  template <class V>
  static auto constraint(const V& x) {
    using S = typename V::Scalar;
    S product(1);
    for (int k = 0; k < N; ++k) product = product * (x[0] - S(k));
    return Eigen::Matrix<S, 1, 1>(product);
  }
  template <class V>
  static auto selector(const V& x, int k) {
    using S = typename V::Scalar;
    S product(1);
    for (int j = 0; j < N; ++j) {
      if (j != k) product = product * (x[0] - S(j)) / S(k - j);
    }
    return product;
  }
  static int nearest(const Point& x) {
    return x[0] <= 0 ? 0 : x[0] >= N - 1 ? N - 1 : static_cast<int>(std::lround(x[0]));
  }
};

/// N values on a circle, the roots of unity: z^N = 1, of z = x + iy.
template <int N>
struct CyclicValues {
  static constexpr int dimension = 2, equations = 2;
  using Point = Eigen::Vector2d;

  static Point value(int k) {
    const double angle = 2 * std::numbers::pi * k / N;
    return {std::cos(angle), std::sin(angle)};
  }
  template <class V>
  static auto constraint(const V& x) {
    using S = typename V::Scalar;
    Eigen::Matrix<S, 2, 1> power(S(1), S(0));
    for (int k = 0; k < N; ++k) power = times(power, x);
    power[0] = power[0] - S(1);
    return power;
  }
  /// (1/N) Σ_j Re (z/w_k)^j.
  template <class V>
  static auto selector(const V& x, int k) {
    using S = typename V::Scalar;
    const Point w = value(k);
    const Eigen::Matrix<S, 2, 1> turned = times(Eigen::Matrix<S, 2, 1>(S(w.x()), S(-w.y())), x);
    Eigen::Matrix<S, 2, 1> power(S(1), S(0));
    S sum(0);
    for (int j = 0; j < N; ++j) {
      sum = sum + power[0];
      power = times(power, turned);
    }
    return sum / S(N);
  }
  static int nearest(const Point& x) {
    int best = 0;
    for (int k = 1; k < N; ++k) {
      if (x.dot(value(k)) > x.dot(value(best))) best = k;
    }
    return best;
  }

 private:
  template <class A, class B>
  static auto times(const A& a, const B& b) {
    using S = typename A::Scalar;
    return Eigen::Matrix<S, 2, 1>(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]);
  }
};

/// N values of which none is nearer to another: the vertices of a regular simplex about the origin, at distance 1. By the
/// barycentric coordinates b_k, which are the selectors: b_i b_j = 0 for i < j, of which N - 1 are independent at a vertex.
template <int N>
struct EquidistantValues {
  static_assert(N >= 2);
  static constexpr int dimension = N - 1, equations = N * (N - 1) / 2, rank = N - 1;
  using Point = Eigen::Matrix<double, N - 1, 1>;

  static Point value(int k) {
    // Coordinate i of vertex k: the first i + 1 vertices lie in a plane across it.
    Point x = Point::Zero();
    double left = 1;  // squared length that earlier coordinates left
    for (int i = 0; i < N - 1 && i <= k; ++i) {
      const double here = std::sqrt(left);
      const int below = N - 1 - i;
      if (k == i) {
        x[i] = here;
        break;
      }
      x[i] = -here / below;
      left -= x[i] * x[i];
    }
    return x;
  }
  template <class V>
  static auto selector(const V& x, int k) {
    using S = typename V::Scalar;
    const Point vertex = value(k);
    S dot(0);
    for (int i = 0; i < N - 1; ++i) dot = dot + S(vertex[i]) * x[i];
    return (S(N - 1) * dot + S(1)) / S(N);
  }
  template <class V>
  static auto constraint(const V& x) {
    using S = typename V::Scalar;
    Eigen::Matrix<S, equations, 1> all;
    int row = 0;
    for (int i = 0; i < N; ++i) {
      for (int j = i + 1; j < N; ++j) all[row++] = selector(x, i) * selector(x, j);
    }
    return all;
  }
  static int nearest(const Point& x) {
    int best = 0;
    for (int k = 1; k < N; ++k) {
      if (selector(x, k) > selector(x, best)) best = k;
    }
    return best;
  }
};

/// The qualitative variable at coordinates first, first + 1, … of the parameter takes one of its values.
template <class Values>
struct IsQualitative {
  int first;
  template <class Q, class... M>
  auto operator()(const Q& q, const M&...) const {
    return Values::constraint(coordinates(q));
  }
  template <class Q>
  auto coordinates(const Q& q) const {
    return Eigen::Matrix<typename Q::Scalar, Values::dimension, 1>(q.template segment<Values::dimension>(first));
  }
};

/// The equations of the value that a qualitative variable has: Σ_k selector_k(x) c_k = 0, all c_k with as many equations
/// (footnote 6 of the report). Between two values it mixes the equations of both: where nothing holds the variable at
/// its values, or its constraint is dropped (half way between two values its gradient vanishes), the estimate is one of no
/// model. Start at a value; try each, or make each a model of a hierarchy.
template <class Values, class... F>
struct Switched {
  int first;
  std::tuple<F...> equations;
  template <class Q, class... M>
  auto operator()(const Q& q, const M&... m) const {
    const auto x = IsQualitative<Values>{first}.coordinates(q);
    return [&]<std::size_t... k>(std::index_sequence<k...>) {
      return ((detail::termVector(std::get<k>(equations)(q, m...)) * Values::selector(x, static_cast<int>(k))).eval() +
              ...)
          .eval();
    }
    (std::index_sequence_for<F...>());
  }
};
template <class Values, class... F>
Switched<Values, F...> switched(int first, F... equations) {
  return {first, {std::move(equations)...}};
}

}  // namespace liestat
