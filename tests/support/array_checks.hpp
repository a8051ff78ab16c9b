// Operations on arrays beside the operations on one element in double, for every group that has them.
#pragma once

#include <lie/arrays.hpp>
#include <support/instruction_sets.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace liestat::test {

/// Fixes the instruction set for its lifetime.
class InstructionSetGuard {
 public:
  explicit InstructionSetGuard(InstructionSet set) { useInstructionSet(set); }
  ~InstructionSetGuard() { useInstructionSet(before_); }
  InstructionSetGuard(const InstructionSetGuard&) = delete;
  InstructionSetGuard& operator=(const InstructionSetGuard&) = delete;

 private:
  InstructionSet before_ = instructionSet();
};

template <class S>
using Numbers = std::vector<S>;

/// How the elements of an array of `n` elements of `components` numbers lie in memory, with numbers between them that
/// nobody may touch.
struct MemoryOrder {
  const char* name;
  std::ptrdiff_t element, component, size, begin;
};
inline std::vector<MemoryOrder> memoryOrders(std::size_t n_elements, std::size_t numbers) {
  const auto n = static_cast<std::ptrdiff_t>(n_elements), k = static_cast<std::ptrdiff_t>(numbers);
  return {{"elements", k, 1, n * k + 1, 0},
          {"members of structs", k + 5, 1, n * (k + 5) + 3, 3},
          {"structure of arrays", 1, n + 3, k * (n + 3) + 1, 1},
          {"rows and gaps", 2 * k, 2, 2 * n * k + 1, 1},
          {"backwards", -k, 1, n * k + 1, n == 0 ? 0 : (n - 1) * k}};
}

template <class G>
class ArrayChecks : public testing::Test {
 public:
  using S = typename G::Scalar;
  using Exact = decltype(G().template cast<double>());
  using Tangent = Eigen::Matrix<double, G::DoF, 1>;
  using In = ArrayView<const S>;
  using Out = ArrayView<S>;
  static constexpr double eps = std::numeric_limits<S>::epsilon();
  static constexpr std::size_t dof = G::DoF, parameters = G::num_parameters, dim = G::Dim;
  /// The rotation's part of a tangent vector.
  static constexpr int r = G::DoF == 1 ? 1 : G::DoF == 3 && G::Dim == 2 ? 1 : 3;

  enum class Operand { none, element, tangent, point };
  struct Operation {
    const char* name;
    Operand a, b;
    std::size_t out;
    std::function<void(In, In, Out)> run;
    std::function<Eigen::VectorXd(const double*, const double*)> exact;  ///< on one element, in double
    bool pole = false;                                                   ///< at the angle 2π
  };

  static std::vector<Operation> operations() {
    using O = Operand;
    const auto x = [](const double* p) { return Exact::fromParams(Eigen::Map<const typename Exact::Params>(p)); };
    const auto v = [](const double* p) { return Tangent(Eigen::Map<const Tangent>(p)); };
    const auto flat = [](const auto& m) {
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(m.data(), static_cast<Eigen::Index>(m.size())));
    };
    using P = Eigen::Matrix<double, G::Dim, 1>;
    return {
        {"exp", O::tangent, O::none, parameters, [](In a, In, Out y) { arrays::exp<G>(a, y); },
         [=](const double* a, const double*) { return flat(Exact::exp(v(a)).params()); }},
        {"log", O::element, O::none, dof, [](In a, In, Out y) { arrays::log<G>(a, y); },
         [=](const double* a, const double*) { return flat(x(a).log()); }},
        {"product", O::element, O::element, parameters, [](In a, In b, Out y) { arrays::product<G>(a, b, y); },
         [=](const double* a, const double* b) { return flat((x(a) * x(b)).params()); }},
        {"inverse", O::element, O::none, parameters, [](In a, In, Out y) { arrays::inverse<G>(a, y); },
         [=](const double* a, const double*) { return flat(x(a).inverse().params()); }},
        {"act", O::element, O::point, dim, [](In a, In b, Out y) { arrays::act<G>(a, b, y); },
         [=](const double* a, const double* b) { return flat((x(a) * P(Eigen::Map<const P>(b))).eval()); }},
        {"Adj", O::element, O::none, dof * dof, [](In a, In, Out y) { arrays::Adj<G>(a, y); },
         [=](const double* a, const double*) { return flat(x(a).Adj()); }},
        {"leftJacobian", O::tangent, O::none, dof * dof, [](In a, In, Out y) { arrays::leftJacobian<G>(a, y); },
         [=](const double* a, const double*) { return flat(Exact::leftJacobian(v(a))); }},
        {"rightJacobian", O::tangent, O::none, dof * dof, [](In a, In, Out y) { arrays::rightJacobian<G>(a, y); },
         [=](const double* a, const double*) { return flat(Exact::rightJacobian(v(a))); }},
        {"leftJacobianInverse", O::tangent, O::none, dof * dof,
         [](In a, In, Out y) { arrays::leftJacobianInverse<G>(a, y); },
         [=](const double* a, const double*) { return flat(Exact::leftJacobianInverse(v(a))); }, true},
        {"rightJacobianInverse", O::tangent, O::none, dof * dof,
         [](In a, In, Out y) { arrays::rightJacobianInverse<G>(a, y); },
         [=](const double* a, const double*) { return flat(Exact::rightJacobianInverse(v(a))); }, true},
    };
  }
  static std::size_t numbersOf(Operand operand) {
    return operand == Operand::element ? parameters : operand == Operand::tangent ? dof : dim;
  }

  /// n elements, tangent vectors or points, one behind the other: rotations by the angle, quaternions of either sign.
  Numbers<S> operand(Operand kind, std::size_t n, double angle) {
    Numbers<S> numbers;
    for (std::size_t i = 0; kind != Operand::none && i < n; ++i) {
      Tangent v = Tangent::NullaryExpr([&] { return gauss_(engine_); });
      v.template tail<r>() *= angle / v.template tail<r>().norm();
      if (kind == Operand::point) {
        for (std::size_t c = 0; c < dim; ++c) numbers.push_back(static_cast<S>(gauss_(engine_)));
      } else if (kind == Operand::tangent) {
        for (const double c : v) numbers.push_back(static_cast<S>(c));
      } else {
        auto p = Exact::exp(v).params();
        if (r == 3 && i % 2 == 1) p.template head<4>() *= -1;
        for (const double c : p) numbers.push_back(static_cast<S>(c));
      }
    }
    return numbers;
  }
  static Eigen::VectorXd inDouble(const Numbers<S>& numbers, std::size_t i, std::size_t k) {
    return Eigen::Map<const Eigen::Matrix<S, -1, 1>>(numbers.data() + i * k, static_cast<Eigen::Index>(k))
        .template cast<double>();
  }
  /// An array of elements, and its result as one.
  static Numbers<S> run(const Operation& op, const Numbers<S>& a, const Numbers<S>& b, std::size_t n) {
    Numbers<S> y(n * op.out);
    op.run(view(a, numbersOf(op.a)), op.b == Operand::none ? In() : view(b, numbersOf(op.b)),
           Out(y.data(), n, static_cast<std::ptrdiff_t>(op.out), 1, op.out));
    return y;
  }
  static In view(const Numbers<S>& a, std::size_t k) {
    return In(a.data(), a.size() / k, static_cast<std::ptrdiff_t>(k), 1, k);
  }
  /// Equal, or not-a-number both.
  static bool sameBits(const Numbers<S>& a, const Numbers<S>& b) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i])))) return false;
    }
    return true;
  }
  static double largestDifference(const Operation& op, const Numbers<S>& a, const Numbers<S>& b, const Numbers<S>& y) {
    double largest = 0;
    const std::size_t ka = numbersOf(op.a), kb = numbersOf(op.b);
    for (std::size_t i = 0; i < y.size() / op.out; ++i) {
      const Eigen::VectorXd exact =
          op.exact(inDouble(a, i, ka).data(), op.b == Operand::none ? nullptr : inDouble(b, i, kb).data());
      const double difference = (inDouble(y, i, op.out) - exact).norm() / (1 + exact.norm());
      largest = std::max(largest, std::isfinite(difference) ? difference : 1);
    }
    return largest;
  }

  /// Decades of the angle up to π, and the least distances from it that the scalar has.
  static std::vector<double> angles() {
    std::vector<double> list{0};
    for (double a = 1e-12; a < 3; a *= 10) list.push_back(a), list.push_back(3 * a);
    for (double d = 1; d > (sizeof(S) == 8 ? 1e-13 : 1e-5); d /= 10) list.push_back(std::numbers::pi - d);
    return list;
  }

  std::mt19937_64 engine_{17};
  std::normal_distribution<double> gauss_;
};

TYPED_TEST_SUITE_P(ArrayChecks);

TYPED_TEST_P(ArrayChecks, agree_with_one_element_in_double) {
  for (const auto& op : this->operations()) {
    for (const double angle : this->angles()) {
      const std::size_t n = 40;
      const auto a = this->operand(op.a, n, angle), b = this->operand(op.b, n, 1);
      for (const InstructionSet set : instructionSets()) {
        const InstructionSetGuard guard(set);
        EXPECT_LE(this->largestDifference(op, a, b, this->run(op, a, b, n)), 8 * this->eps)
            << op.name << ' ' << angle << ' ' << name(set);
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, agree_at_angles_beyond_pi) {
  for (const auto& op : this->operations()) {
    for (const double angle : {3.2, 3.24, 3.3, 4.0, 5.0, 6.0, 6.5, 10.0, 31.5, 100.0, 333.0, 1000.0, 1e5}) {
      if (op.pole && angle > 5) continue;
      const std::size_t n = 40;
      const auto a = this->operand(op.a, n, angle), b = this->operand(op.b, n, 1);
      for (const InstructionSet set : instructionSets()) {
        const InstructionSetGuard guard(set);
        // The rounding of the vector itself is that of its length.
        EXPECT_LE(this->largestDifference(op, a, b, this->run(op, a, b, n)), 8 * this->eps * (1 + angle))
            << op.name << ' ' << angle << ' ' << name(set);
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, do_not_depend_on_layout_size_place_or_neighbours) {
  using Number = typename TypeParam::Scalar;
  using View = ArrayView<Number>;
  for (const auto& op : this->operations()) {
    for (const std::size_t n : {0, 1, 7, 64, 65, 1000}) {
      // Angles in turns from all ranges, so that each register holds some of each.
      const std::size_t ka = this->numbersOf(op.a), kb = this->numbersOf(op.b);
      std::vector<Number> a, b = this->operand(op.b, n, 1);
      for (std::size_t i = 0; i < n; ++i) {
        const auto one = this->operand(op.a, 1, i % 5 == 3 ? 20.0 : i % 3 == 0 ? 1e-7 : 2.0);
        a.insert(a.end(), one.begin(), one.end());
      }
      if (n > 5 && op.a == TestFixture::Operand::element) a[5 * ka] = std::numeric_limits<Number>::quiet_NaN();
      if (n > 8 && op.a == TestFixture::Operand::element) {
        for (std::size_t c = 0; c < ka; ++c) a[8 * ka + c] *= Number(1.5);
      }
      for (const InstructionSet set : instructionSets()) {
        const InstructionSetGuard guard(set);
        SCOPED_TRACE(std::string(op.name) + " " + name(set) + " " + std::to_string(n));
        const std::vector<Number> y = this->run(op, a, b, n);
        for (std::size_t i = 0; i < std::min<std::size_t>(n, 65); ++i) {
          const auto part = [i](const std::vector<Number>& x, std::size_t k) {
            const auto begin = x.begin() + static_cast<std::ptrdiff_t>(i * k);
            return std::vector<Number>(begin, begin + static_cast<std::ptrdiff_t>(k));
          };
          ASSERT_TRUE(this->sameBits(
              this->run(op, part(a, ka), part(b, op.b == TestFixture::Operand::none ? 0 : kb), 1), part(y, op.out)))
              << i;
        }
        for (std::size_t order = 0; order < memoryOrders(n, 1).size(); ++order) {
          const auto place = [order, n](const std::vector<Number>& numbers, std::size_t k,
                                        std::vector<Number>& memory) {
            const MemoryOrder o = memoryOrders(n, k)[order];
            memory.assign(static_cast<std::size_t>(o.size), Number(-77));
            const View view(memory.data() + o.begin, n, o.element, o.component, k);
            for (std::size_t i = 0; i < numbers.size(); ++i) view(i / k, i % k) = numbers[i];
            return view;
          };
          std::vector<Number> memory_a, memory_b, memory_y, memory_expected;
          const View view_a = place(a, ka, memory_a), view_b = place(b, kb, memory_b);
          const View view_y = place({}, op.out, memory_y);
          place(y, op.out, memory_expected);
          op.run(view_a, view_b, view_y);
          ASSERT_TRUE(this->sameBits(memory_y, memory_expected)) << memoryOrders(n, 1)[order].name;
        }
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, in_place) {
  using Number = typename TypeParam::Scalar;
  for (const auto& op : this->operations()) {
    for (const std::size_t n : {1, 16, 100}) {
      for (const std::ptrdiff_t component : {std::ptrdiff_t{1}, static_cast<std::ptrdiff_t>(n)}) {
        const auto a = this->operand(op.a, n, 1.3), b = this->operand(op.b, n, 1);
        const std::ptrdiff_t element = component == 1 ? 40 : 1;
        for (const InstructionSet set : instructionSets()) {
          const InstructionSetGuard guard(set);
          const auto y = this->run(op, a, b, n);
          for (const bool second : {false, true}) {
            if (second && op.b == TestFixture::Operand::none) continue;
            std::vector<Number> memory(40 * n);
            const std::size_t k = this->numbersOf(second ? op.b : op.a);
            const ArrayView<Number> view(memory.data(), n, element, component),
                in(memory.data(), n, element, component, k);
            for (std::size_t i = 0; i < n * k; ++i) view(i / k, i % k) = (second ? b : a)[i];
            const auto other = second ? this->view(a, this->numbersOf(op.a)) : this->view(b, this->numbersOf(op.b));
            op.run(second ? other : in, second ? in : other, view);
            std::vector<Number> result;
            for (std::size_t i = 0; i < n * op.out; ++i) result.push_back(view(i / op.out, i % op.out));
            EXPECT_TRUE(this->sameBits(result, y)) << op.name << ' ' << name(set) << ' ' << second << ' ' << component;
          }
        }
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, one_element_for_all) {
  using Number = typename TypeParam::Scalar;
  const std::size_t n = 101;
  for (const auto& op : this->operations()) {
    if (op.b == TestFixture::Operand::none) continue;
    for (const bool first : {false, true}) {
      const auto a = this->operand(op.a, first ? 1 : n, 1.3), b = this->operand(op.b, first ? n : 1, 1);
      std::vector<Number> all;
      for (std::size_t i = 0; i < n; ++i) all.insert(all.end(), (first ? a : b).begin(), (first ? a : b).end());
      for (const InstructionSet set : instructionSets()) {
        const InstructionSetGuard guard(set);
        EXPECT_TRUE(this->sameBits(this->run(op, a, b, n), first ? this->run(op, all, b, n) : this->run(op, a, all, n)))
            << op.name << ' ' << name(set) << ' ' << first;
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, not_a_number_in_not_a_number_out) {
  using Number = typename TypeParam::Scalar;
  const std::size_t n = 19;
  for (const auto& op : this->operations()) {
    const auto a = this->operand(op.a, n, 1.3), b = this->operand(op.b, n, 1);
    for (std::size_t bad = 0; bad < a.size(); ++bad) {
      for (const InstructionSet set : instructionSets()) {
        const InstructionSetGuard guard(set);
        auto with_bad = a;
        with_bad[bad] = std::numeric_limits<Number>::quiet_NaN();
        const auto y = this->run(op, with_bad, b, n);
        const std::size_t k = this->numbersOf(op.a), i = bad / k;
        // The scalar operation says which numbers of the result it reaches.
        const Eigen::VectorXd exact =
            op.exact(this->inDouble(with_bad, i, k).data(),
                     op.b == TestFixture::Operand::none ? nullptr : this->inDouble(b, i, this->numbersOf(op.b)).data());
        for (std::size_t c = 0; c < y.size(); ++c) {
          const bool reached = c / op.out == i && std::isnan(exact[static_cast<Eigen::Index>(c % op.out)]);
          ASSERT_EQ(std::isnan(y[c]), reached) << op.name << ' ' << name(set) << ' ' << bad % k << ' ' << c % op.out;
        }
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, matrices_by_rows) {
  using Number = typename TypeParam::Scalar;
  const std::size_t n = 21, k = this->dof;
  for (const auto& op : this->operations()) {
    if (op.out != k * k || k == 1) continue;
    const auto a = this->operand(op.a, n, 1.3);
    for (const InstructionSet set : instructionSets()) {
      const InstructionSetGuard guard(set);
      const auto y = this->run(op, a, {}, n);
      std::vector<Number> rows(y.size());
      op.run(this->view(a, this->numbersOf(op.a)), {},
             ArrayView<Number>(rows.data(), n, static_cast<std::ptrdiff_t>(k * k)).byRows());
      for (std::size_t i = 0; i < y.size(); ++i) {
        const std::size_t c = i % (k * k);
        ASSERT_EQ(rows[i - c + c % k * k + c / k], y[i]) << op.name << ' ' << name(set);
      }
    }
  }
}

TYPED_TEST_P(ArrayChecks, endless_angles_are_not_a_number_and_huge_ones_rotations) {
  using Number = typename TypeParam::Scalar;
  const std::size_t k = this->dof;
  for (const InstructionSet set : instructionSets()) {
    const InstructionSetGuard guard(set);
    for (const double angle : {1e7, 1e12, 1e15, 1e17}) {
      const auto v = this->operand(TestFixture::Operand::tangent, 33, angle);
      std::vector<TypeParam> x(33);
      arrays::exp<TypeParam>(this->view(v, k), x);
      for (const TypeParam& y : x) {
        // The unit quaternion, or complex number.
        const double norm = y.params().template head < TestFixture::r == 3 ? 4 : 2 > ().norm();
        EXPECT_NEAR(norm, 1, 8 * this->eps) << angle << ' ' << name(set);
      }
    }
    auto v = this->operand(TestFixture::Operand::tangent, 33, 1);
    v[7 * k + k - 1] = std::numeric_limits<Number>::infinity();
    std::vector<TypeParam> x(33);
    arrays::exp<TypeParam>(this->view(v, k), x);
    for (std::size_t i = 0; i < 33; ++i) EXPECT_EQ(x[i].params().hasNaN(), i == 7) << name(set);
  }
}

REGISTER_TYPED_TEST_SUITE_P(ArrayChecks, agree_with_one_element_in_double, agree_at_angles_beyond_pi,
                            do_not_depend_on_layout_size_place_or_neighbours, in_place, one_element_for_all,
                            not_a_number_in_not_a_number_out, matrices_by_rows,
                            endless_angles_are_not_a_number_and_huge_ones_rotations);

}  // namespace liestat::test
