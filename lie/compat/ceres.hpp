// Every manifold of the library as a ceres::Manifold (needs Ceres 2.1; nothing else in lie/ does).
//
//   ceres::Problem problem;
//   problem.AddParameterBlock(world_T_body.data(), 7, new liestat::CeresManifold<liestat::SE3d>);
//
// Parameters are those of params(), in Sophus' layout; increments are tangent vectors of the library: right
// perturbations x·Exp(d), in the frame that the placement carries, translation first.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/manifold.hpp>

#include <ceres/jet.h>
#include <ceres/manifold.h>

#include <type_traits>
#include <utility>

namespace liestat {
namespace detail {

/// The number of parameters of a manifold, and the way to and from them; Eigen vectors are their own.
template <class M>
struct ParameterBlock {
  static constexpr int size = M::num_parameters;
  template <class S>
  using Vector = Eigen::Matrix<S, size, 1>;
  static M read(const double* data) { return M::fromParams(Eigen::Map<const Vector<double>>(data)); }
  template <class AnyM>
  static auto params(const AnyM& x) {
    return x.params();
  }
};
template <int N, int O>
struct ParameterBlock<Eigen::Matrix<double, N, 1, O, N, 1>> {
  using M = Eigen::Matrix<double, N, 1, O, N, 1>;
  static constexpr int size = N;
  template <class S>
  using Vector = Eigen::Matrix<S, N, 1>;
  static M read(const double* data) { return Eigen::Map<const M>(data); }
  template <class AnyM>
  static auto params(const AnyM& x) {
    return x;
  }
};

/// The manifold over Jets that stands for M over doubles.
template <class M, class Jet>
struct OverJets {
  using type = std::remove_cvref_t<decltype(std::declval<const M&>().template cast<Jet>())>;
};
template <int N, int O, class Jet>
struct OverJets<Eigen::Matrix<double, N, 1, O, N, 1>, Jet> {
  using type = Eigen::Matrix<Jet, N, 1, O, N, 1>;
};

/// ∂params(exp(x, d))/∂d at zero, num_parameters × DoF.
template <class M>
auto parameterJacobian(const M& x) {
  using T = ManifoldTraits<M>;
  using Block = ParameterBlock<M>;
  if constexpr (requires { x.Dx_this_mul_exp_x_at_0(); }) {
    return x.Dx_this_mul_exp_x_at_0();
  } else {
    using Jet = ceres::Jet<double, T::DoF>;
    using JetManifold = typename OverJets<M, Jet>::type;
    Eigen::Matrix<Jet, T::DoF, 1> d;
    for (int i = 0; i < T::DoF; ++i) d[i] = Jet(0, i);
    const auto moved = ParameterBlock<M>::params(exp(JetManifold(x.template cast<Jet>()), d));
    Eigen::Matrix<double, Block::size, T::DoF> J;
    for (int i = 0; i < Block::size; ++i) J.row(i) = moved[i].v.transpose();
    return J;
  }
}

}  // namespace detail

/// A manifold of the library, or a user's own with num_parameters, params(), fromParams() and cast(), for Ceres.
/// Plus(x, d) = exp(x, d) and Minus(y, x) = log(x, y); Jacobians are exact. Plus and Minus return false, which ends a
/// step of the solver, where the result is not finite.
template <Homogeneous M>
  requires std::is_same_v < ScalarOf<M>,
double > class CeresManifold final : public ceres::Manifold {
  using T = ManifoldTraits<M>;
  using Block = detail::ParameterBlock<M>;
  static constexpr int ambient = Block::size;
  using Vector = Eigen::Matrix<double, ambient, 1>;
  using Tangent = typename T::Tangent;
  template <int Rows, int Cols>
  using RowMajor = Eigen::Matrix<double, Rows, Cols, Cols == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

 public:
  int AmbientSize() const override { return ambient; }
  int TangentSize() const override { return T::DoF; }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const M moved = exp(Block::read(x), Tangent(Eigen::Map<const Tangent>(delta)));
    Eigen::Map<Vector> result(x_plus_delta);
    result = Block::params(moved);
    return result.allFinite();
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<RowMajor<ambient, T::DoF>> result(jacobian);
    result = detail::parameterJacobian(Block::read(x));
    return result.allFinite();
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<Tangent> result(y_minus_x);
    result = log(Block::read(x), Block::read(y));
    return result.allFinite();
  }
  /// The pseudo-inverse of the Jacobian of Plus: parameters that leave the manifold at right angles do not count.
  bool MinusJacobian(const double* x, double* jacobian) const override {
    const M at = Block::read(x);
    Eigen::Map<RowMajor<T::DoF, ambient>> result(jacobian);
    if constexpr (requires { at.Dx_log_this_inv_by_x_at_this(); }) {
      result = at.Dx_log_this_inv_by_x_at_this();
    } else {
      const auto J = detail::parameterJacobian(at);
      const Eigen::Matrix<double, T::DoF, ambient> transposed = J.transpose();
      const detail::Cholesky<double, T::DoF> normal(detail::product(transposed, J));
      result = normal.template solve<ambient>(transposed);
    }
    return result.allFinite();
  }
};

}  // namespace liestat
