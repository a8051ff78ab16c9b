// The tables of operations that every manifold and every group shares (array_operations.hpp).
#pragma once

#include <lie/arrays.hpp>
#include <lie/concepts.hpp>
#include <lie/linear.hpp>
#include <lie/manifold.hpp>
#include <python/src/array_operations.hpp>
#include <stats/conventions.hpp>
#include <stats/gaussian.hpp>
#include <stats/propagation.hpp>

#include <array>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

namespace liestat::python {

/// The Gaussian of parameters and a covariance in memory.
template <class M>
Gaussian<M> gaussian(const double* x, const double* covariance) {
  return {point<M>(x), square<ManifoldTraits<M>::DoF>(covariance)};
}

/// exp, log, interpolation and covariances of any manifold.
template <class M>
void addManifoldOperations(std::vector<ArrayOperation>& list) {
  using T = ManifoldTraits<M>;
  using G = typename T::Group;
  constexpr std::size_t p = parametersOf<M>(), k = T::DoF, kk = k * k, g = parametersOf<G>();
  constexpr int K = T::DoF;
  list.push_back(operation<p>("retract", {{"self", p}, {"v", k}}, [](const double* x, const double* v, double* out) {
    storePoint(exp(point<M>(x), vector<K>(v)), out);
  }));
  list.push_back(operation<k>("local", {{"self", p}, {"other", p}}, [](const double* x, const double* y, double* out) {
    store(log(point<M>(x), point<M>(y)), out);
  }));
  list.push_back(operation<p>("interpolate", {{"self", p}, {"other", p}, {"s", 1}},
                              [](const double* x, const double* y, const double* s, double* out) {
                                storePoint(interpolate(point<M>(x), point<M>(y), *s), out);
                              }));
  list.push_back(operation<p>("moved", {{"self", p}, {"by", g}}, [](const double* x, const double* f, double* out) {
    storePoint(act(point<G>(f), point<M>(x)), out);
  }));
  list.push_back(
      operation<kk>("local_by_other", {{"self", p}, {"other", p}}, [](const double* y, const double* x, double* out) {
        store(errorVector(point<M>(y), point<M>(x)).by_feature, out);
      }));
  list.push_back(
      operation<kk>("local_by_self", {{"self", p}, {"other", p}}, [](const double* y, const double* x, double* out) {
        store(errorVector(point<M>(y), point<M>(x)).by_base, out);
      }));
  if constexpr (Metric<M>) {
    list.push_back(
        operation<1>("distance", {{"self", p}, {"other", p}},
                     [](const double* x, const double* y, double* out) { *out = distance(point<M>(x), point<M>(y)); }));
  }
  list.push_back(operation<1>("mahalanobis_squared", {{"mean", p}, {"covariance", kk}, {"x", p}},
                              [](const double* mean, const double* covariance, const double* x, double* out) {
                                *out = mahalanobisSquared(gaussian<M>(mean, covariance), point<M>(x));
                              }));
  list.push_back(operation<1>(
      "mahalanobis_squared_both", {{"mean", p}, {"covariance", kk}, {"x", p}, {"x_covariance", kk}},
      [](const double* a, const double* a_covariance, const double* b, const double* b_covariance, double* out) {
        *out = mahalanobisSquared(gaussian<M>(a, a_covariance), gaussian<M>(b, b_covariance));
      }));
  list.push_back(operation<kk>("transported_covariance", {{"self", p}, {"covariance", kk}, {"to", p}},
                               [](const double* x, const double* covariance, const double* y, double* out) {
                                 store(transport(gaussian<M>(x, covariance), point<M>(y)).covariance, out);
                               }));
  list.push_back(operation<kk>("to_chart", {{"self", p}, {"covariance", kk}},
                               [](const double* x, const double* covariance, double* out) {
                                 store(principalChartCovariance(gaussian<M>(x, covariance)), out);
                               }));
  list.push_back(operation<kk>("from_chart", {{"self", p}, {"covariance", kk}},
                               [](const double* x, const double* covariance, double* out) {
                                 store(covarianceFromPrincipalChart(point<M>(x), square<K>(covariance)), out);
                               }));
  list.push_back(operation<kk>("moved_covariance", {{"self", p}, {"covariance", kk}, {"by", g}},
                               [](const double* x, const double* covariance, const double* f, double* out) {
                                 store(act(point<G>(f), gaussian<M>(x, covariance)).covariance, out);
                               }));
  list.push_back(operation<p>("sampled", {{"mean", p}, {"covariance", kk}, {"normals", k}},
                              [](const double* x, const double* covariance, const double* normals, double* out) {
                                const SemidefiniteRoot<double, K> root(square<K>(covariance));
                                storePoint(exp(point<M>(x), TangentOf<M>(root * vector<K>(normals))), out);
                              }));
  if constexpr (HasTangentParts<M> && T::Group::DoF == T::DoF) {
    list.push_back(operation<kk>("to_world_axes", {{"self", p}, {"covariance", kk}},
                                 [](const double* x, const double* covariance, double* out) {
                                   store(worldAxesCovariance(gaussian<M>(x, covariance)), out);
                                 }));
    list.push_back(operation<kk>("from_world_axes", {{"self", p}, {"covariance", kk}},
                                 [](const double* x, const double* covariance, double* out) {
                                   store(fromWorldAxesCovariance(point<M>(x), square<K>(covariance)).covariance, out);
                                 }));
  }
  if constexpr (HasTangentParts<M>) {
    list.push_back(operation<kk>("to_rotation_first", {{"covariance", kk}}, [](const double* covariance, double* out) {
      store(covarianceInOrder<M>(square<K>(covariance), rotation_first), out);
    }));
    list.push_back(
        operation<kk>("from_rotation_first", {{"covariance", kk}}, [](const double* covariance, double* out) {
          store(covarianceFromOrder<M>(square<K>(covariance), rotation_first), out);
        }));
  }
}

/// An operand of the kernels of lie/arrays.hpp: rows of `columns` numbers, or one for all.
template <std::size_t columns>
ArrayView<const double> viewOf(const Rows& rows, std::size_t n) {
  return {rows.data, rows.step == 0 ? std::size_t{1} : n, rows.step, 1, columns};
}
/// One of these kernels as an entry of a table; Result numbers come of operands of A and B numbers, B zero where there
/// is one operand. Matrices by rows.
template <auto function, std::size_t Result, std::size_t A, std::size_t B = 0>
void arrayKernel(const std::array<Rows, max_operands>& operands, double* out, std::size_t n) {
  const ArrayView<double> result = ArrayView<double>(out, n, Result, 1, Result).byRows();
  if constexpr (B == 0) {
    function(viewOf<A>(operands[0], n), result);
  } else {
    function(viewOf<A>(operands[0], n), viewOf<B>(operands[1], n), result);
  }
}
/// The kernels in place of loops, for the groups that have them.
template <arrays::ArrayGroup G>
void takeArrayKernels(std::vector<ArrayOperation>& list) {
  constexpr std::size_t p = G::num_parameters, k = G::DoF, kk = k * k, d = G::Dim;
  const std::pair<std::string_view, Kernel> kernels[] = {
      {"exp", &arrayKernel<arrays::exp<G>, p, k>},
      {"log", &arrayKernel<arrays::log<G>, k, p>},
      {"product", &arrayKernel<arrays::product<G>, p, p, p>},
      {"inverse", &arrayKernel<arrays::inverse<G>, p, p>},
      {"act", &arrayKernel<arrays::act<G>, d, p, d>},
      {"Adj", &arrayKernel<arrays::Adj<G>, kk, p>},
      {"left_jacobian", &arrayKernel<arrays::leftJacobian<G>, kk, k>},
      {"right_jacobian", &arrayKernel<arrays::rightJacobian<G>, kk, k>},
      {"left_jacobian_inverse", &arrayKernel<arrays::leftJacobianInverse<G>, kk, k>},
      {"right_jacobian_inverse", &arrayKernel<arrays::rightJacobianInverse<G>, kk, k>},
  };
  for (ArrayOperation& entry : list) {
    for (const auto& [name, kernel] : kernels) {
      if (entry.name == name) entry.kernel = kernel;
    }
  }
}

/// Product, inverse, action, exponential, matrices and Jacobians of a group.
template <class G>
void addGroupOperations(std::vector<ArrayOperation>& list) {
  constexpr std::size_t p = G::num_parameters, k = G::DoF, kk = k * k, d = G::Dim, nn = G::N * G::N;
  constexpr int K = G::DoF, D = G::Dim;
  list.push_back(
      operation<p>("exp", {{"v", k}}, [](const double* v, double* out) { storePoint(G::exp(vector<K>(v)), out); }));
  list.push_back(
      operation<k>("log", {{"self", p}}, [](const double* x, double* out) { store(point<G>(x).log(), out); }));
  list.push_back(
      operation<p>("product", {{"self", p}, {"other", p}},
                   [](const double* a, const double* b, double* out) { storePoint(point<G>(a) * point<G>(b), out); }));
  list.push_back(operation<p>("inverse", {{"self", p}},
                              [](const double* x, double* out) { storePoint(point<G>(x).inverse(), out); }));
  list.push_back(operation<d>("act", {{"self", p}, {"points", d}}, [](const double* x, const double* y, double* out) {
    store(point<G>(x) * vector<D>(y), out);
  }));
  list.push_back(
      operation<nn>("matrix", {{"self", p}}, [](const double* x, double* out) { store(point<G>(x).matrix(), out); }));
  list.push_back(operation<p>("normalized", {{"params", p}}, [](const double* x, double* out) {
    G y = point<G>(x);
    y.normalize();
    storePoint(y, out);
  }));
  list.push_back(
      operation<kk>("Adj", {{"self", p}}, [](const double* x, double* out) { store(point<G>(x).Adj(), out); }));
  list.push_back(
      operation<kk>("ad", {{"v", k}}, [](const double* v, double* out) { store(G::ad(vector<K>(v)), out); }));
  list.push_back(operation<kk>("left_jacobian", {{"v", k}},
                               [](const double* v, double* out) { store(G::leftJacobian(vector<K>(v)), out); }));
  list.push_back(operation<kk>("right_jacobian", {{"v", k}},
                               [](const double* v, double* out) { store(G::rightJacobian(vector<K>(v)), out); }));
  list.push_back(operation<kk>("left_jacobian_inverse", {{"v", k}},
                               [](const double* v, double* out) { store(G::leftJacobianInverse(vector<K>(v)), out); }));
  list.push_back(operation<kk>("right_jacobian_inverse", {{"v", k}}, [](const double* v, double* out) {
    store(G::rightJacobianInverse(vector<K>(v)), out);
  }));
  list.push_back(operation<kk>("to_left", {{"self", p}, {"covariance", kk}},
                               [](const double* x, const double* covariance, double* out) {
                                 store(leftCovariance(gaussian<G>(x, covariance)), out);
                               }));
  list.push_back(operation<kk>("from_left", {{"self", p}, {"covariance", kk}},
                               [](const double* x, const double* covariance, double* out) {
                                 store(fromLeftCovariance(point<G>(x), square<K>(covariance)).covariance, out);
                               }));
  list.push_back(operation<kk>("inverse_covariance", {{"self", p}, {"covariance", kk}},
                               [](const double* x, const double* covariance, double* out) {
                                 store(inverse(gaussian<G>(x, covariance)).covariance, out);
                               }));
  list.push_back(operation<kk>(
      "product_covariance", {{"self", p}, {"covariance", kk}, {"other", p}, {"other_covariance", kk}},
      [](const double* a, const double* a_covariance, const double* b, const double* b_covariance, double* out) {
        store(compose(gaussian<G>(a, a_covariance), gaussian<G>(b, b_covariance)).covariance, out);
      }));
  list.push_back(operation<kk>(
      "product_covariance_fourth_order", {{"self", p}, {"covariance", kk}, {"other", p}, {"other_covariance", kk}},
      [](const double* a, const double* a_covariance, const double* b, const double* b_covariance, double* out) {
        store(composeFourthOrder(gaussian<G>(a, a_covariance), gaussian<G>(b, b_covariance)).covariance, out);
      }));
  list.push_back(operation<kk>(
      "between_covariance", {{"self", p}, {"covariance", kk}, {"other", p}, {"other_covariance", kk}},
      [](const double* a, const double* a_covariance, const double* b, const double* b_covariance, double* out) {
        store(between(gaussian<G>(a, a_covariance), gaussian<G>(b, b_covariance)).covariance, out);
      }));
}

/// The table of a manifold that is no group.
template <class M>
ArrayType manifoldOperations(std::string_view name) {
  ArrayType type{name, static_cast<std::size_t>(parametersOf<M>()), ManifoldTraits<M>::DoF, {}};
  addManifoldOperations<M>(type.operations);
  return type;
}

/// The table of a group.
template <class G>
ArrayType groupOperations(std::string_view name) {
  ArrayType type = manifoldOperations<G>(name);
  addGroupOperations<G>(type.operations);
  if constexpr (arrays::ArrayGroup<G>) takeArrayKernels<G>(type.operations);
  return type;
}

}  // namespace liestat::python
