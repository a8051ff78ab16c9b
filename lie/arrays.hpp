// Operations on arrays of group elements with stored results: SO2, SO3, SE2, SE3, double and float, a register of
// elements at a time, with the instructions that the processor has (lie/instruction_set.hpp), whatever the unit is compiled for.
//
//   std::vector<SE3d> poses(n), inverses(n);
//   arrays::inverse<SE3d>(poses, inverses);
//   arrays::act<SE3d>(world_T_body, points, points);        one pose, many points, in place
//   arrays::log<SE3d>(memberOf(log, &Row::pose), tangents);
//
// Arguments        ArrayView (lie/array_view.hpp), which arrays of elements and matrices of Eigen become by themselves;
//                  an element's numbers are those of params(), of a tangent vector in the group's
//                  order, of a matrix by columns (ArrayView::byRows: by rows)
// Sizes            those of the result, or one: then it holds for all elements; anything else fails an assertion
// In place         the result may be an operand if their elements begin in the same places; they must not overlap else
// Accuracy         as of the operation on one element, to some eps; exp takes angles of any size
// Bits             follow from the element and the instruction set alone, not from its place or the compiler's flags
// Bad input        not-a-number in, not-a-number out; a zero quaternion or complex number has the logarithm
//                  not-a-number
#pragma once

#include <lie/array_view.hpp>
#include <lie/detail/array_motions.hpp>
#include <lie/detail/array_planar.hpp>
#include <lie/detail/array_rotations.hpp>
#include <lie/se2.hpp>
#include <lie/se3.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>

#include <concepts>
#include <cstddef>

namespace liestat {
namespace detail {

/// The operations of a group on arrays.
template <class G>
struct ArrayOperations;
template <class S, int Options>
struct ArrayOperations<SO2<S, Options>> : PlaneRotationArrays {};
template <class S, int Options>
struct ArrayOperations<SE2<S, Options>> : PlaneMotionArrays {};
template <class S, int Options>
struct ArrayOperations<SO3<S, Options>> : RotationArrays {};
template <class S, int Options>
struct ArrayOperations<SE3<S, Options>> : MotionArrays {};

template <class S>
bool isOneOrAll(const ArrayView<const S>& operand, std::size_t n, std::size_t components) {
  return (operand.size() == n || operand.size() == 1) &&
         (operand.components() == 0 || operand.components() == components);
}
template <class S>
Layout<const S> operandLayout(const ArrayView<const S>& operand) {
  Layout<const S> layout = operand.layout();
  if (operand.size() == 1) layout.element = 0;
  if (layout.element > 0) layout.ahead = readAhead<S>(operand.size() * static_cast<std::size_t>(layout.element));
  return layout;
}

template <class Operation, class S>
void runOnArrays(const ArrayView<const S>& a, const ArrayView<const S>& b, const ArrayView<S>& out) {
  using Kernel = ArrayKernel<Operation, S>;
  eigen_assert(isOneOrAll(a, out.size(), Operation::a));
  eigen_assert(Operation::b == 0 || isOneOrAll(b, out.size(), Operation::b));
  eigen_assert(out.components() == 0 || out.components() == Operation::out);
  typename Kernel::Arguments arguments{operandLayout(a), operandLayout(b), out.layout(), out.size(), out.hasRows()};
  if (out.size() != 0) runKernel<Kernel>(instructionSet(), arguments);
}

}  // namespace detail

/// Operations on arrays; see the header comment.
namespace arrays {

/// Groups whose arrays have operations: SO2, SO3, SE2, SE3, of double or float.
template <class G>
concept ArrayGroup = requires {
  detail::ArrayOperations<G>::DoF;
}
&&(std::same_as<typename G::Scalar, double> || std::same_as<typename G::Scalar, float>);

template <ArrayGroup G>
using ConstView = ArrayView<const typename G::Scalar>;
template <ArrayGroup G>
using View = ArrayView<typename G::Scalar>;

/// x_i = Exp(v_i)
template <ArrayGroup G>
void exp(ConstView<G> v, View<G> x) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Exp>(v, ConstView<G>(), x);
}
/// v_i = Log(x_i); quaternions of any norm and sign, complex numbers of any norm.
template <ArrayGroup G>
void log(ConstView<G> x, View<G> v) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Log>(x, ConstView<G>(), v);
}
/// x_i = a_i b_i, as operator*: renormalised to first order in float, not at all in double.
template <ArrayGroup G>
void product(ConstView<G> a, ConstView<G> b, View<G> x) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Product>(a, b, x);
}
/// y_i = x_i⁻¹
template <ArrayGroup G>
void inverse(ConstView<G> x, View<G> y) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Inverse>(x, ConstView<G>(), y);
}
/// q_i = x_i p_i on points.
template <ArrayGroup G>
void act(ConstView<G> x, ConstView<G> p, View<G> q) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Act>(x, p, q);
}
/// A_i = Adj(x_i), DoF × DoF.
template <ArrayGroup G>
void Adj(ConstView<G> x, View<G> A) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::Adjoint>(x, ConstView<G>(), A);
}
/// J_i = G::leftJacobian(v_i), DoF × DoF.
template <ArrayGroup G>
void leftJacobian(ConstView<G> v, View<G> J) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::template Jacobian<1>>(v, ConstView<G>(), J);
}
/// J_i = G::rightJacobian(v_i)
template <ArrayGroup G>
void rightJacobian(ConstView<G> v, View<G> J) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::template Jacobian<-1>>(v, ConstView<G>(), J);
}
/// J_i = G::leftJacobianInverse(v_i), regular at rotation angle π, singular at 2π.
template <ArrayGroup G>
void leftJacobianInverse(ConstView<G> v, View<G> J) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::template JacobianInverse<1>>(v, ConstView<G>(), J);
}
/// J_i = G::rightJacobianInverse(v_i)
template <ArrayGroup G>
void rightJacobianInverse(ConstView<G> v, View<G> J) {
  detail::runOnArrays<typename detail::ArrayOperations<G>::template JacobianInverse<-1>>(v, ConstView<G>(), J);
}

}  // namespace arrays
}  // namespace liestat
