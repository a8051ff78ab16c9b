// Helpers shared by the contract's checks: differences of functions, how large an error rounding explains, and a bench
// that runs a check over the decades of the angle.
#pragma once

#include <lie/detail/contract_record.hpp>
#include <lie/detail/contract_report.hpp>
#include <lie/detail/contract_sequence.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <limits>

namespace liestat::detail {

using ContractFunction = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

/// Derivative of f at zero by central differences of fourth order.
inline Eigen::MatrixXd centralDifferences(const ContractFunction& f, Eigen::Index inputs, double h) {
  Eigen::MatrixXd J;
  for (Eigen::Index j = 0; j < inputs; ++j) {
    const Eigen::VectorXd e = h * Eigen::VectorXd::Unit(inputs, j);
    const Eigen::VectorXd column = (8 * (f(e) - f(-e)) - (f(2 * e) - f(-2 * e))) / (12 * h);
    if (j == 0) J.resize(column.size(), inputs);
    J.col(j) = column;
  }
  return J;
}

/// Second derivative along a line of a function of its parameter, at zero, by central differences of fourth order.
inline double secondDifference(const std::function<double(double)>& f, double h) {
  return (16 * (f(h) + f(-h)) - (f(2 * h) + f(-2 * h)) - 30 * f(0)) / (12 * h * h);
}

/// A·B, coefficient by coefficient, without Eigen's kernels for large matrices.
inline Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(A.rows(), B.cols());
  for (Eigen::Index j = 0; j < B.cols(); ++j) {
    for (Eigen::Index k = 0; k < B.rows(); ++k) {
      for (Eigen::Index i = 0; i < A.rows(); ++i) C(i, j) += A(i, k) * B(k, j);
    }
  }
  return C;
}
inline Eigen::MatrixXd transposed(const Eigen::MatrixXd& A) {
  Eigen::MatrixXd B(A.cols(), A.rows());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index j = 0; j < A.cols(); ++j) B(j, i) = A(i, j);
  }
  return B;
}

/// Exponential of a square matrix by its power series.
inline Eigen::MatrixXd exponentialSeries(const Eigen::MatrixXd& A) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(A.rows(), A.cols()), term = sum;
  for (int k = 1; k < 80; ++k) {
    term = product(A, term) / k;
    sum += term;
  }
  return sum;
}

/// Largest norm that scales a rounding error: 1 + the sizes of the inputs.
inline double contractScale(std::initializer_list<ContractInput> inputs) {
  double scale = 1;
  for (const ContractInput& i : inputs) scale += i.value.norm();
  return scale;
}

/// Records checks for one scalar: translates "rounding" and "differences" to tolerances.
class ContractRecorder {
 public:
  ContractRecorder(ContractReport& report, double epsilon)
      : eps(epsilon), step(std::pow(epsilon, 0.2)), report_(report) {}

  const double eps, step;

  /// An identity that holds but for some rounding errors of the size of the inputs, times the condition of the problem.
  void exact(const char* invariant, double error, std::initializer_list<ContractInput> inputs, double condition = 1) {
    report_.record(invariant, error, 16 * eps * contractScale(inputs) * condition, inputs);
  }
  void equal(const char* invariant, const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
             std::initializer_list<ContractInput> inputs, double condition = 1) {
    exact(invariant, sameSize(a, b) ? (a - b).norm() : infinity, inputs, condition);
  }
  /// J against the differences of f; `room` is how far f is smooth around zero, singular beyond.
  void derivative(const char* invariant, const Eigen::MatrixXd& J, const ContractFunction& f,
                  std::initializer_list<ContractInput> inputs, double room = 1) {
    const double h = std::min(step, room / 30);
    // Rounding of the function over the step, and truncation of a function whose scale of variation is the room.
    const double relative = 20 * eps / h + 10 * std::pow(h / std::min(room, 1.0), 4);
    const Eigen::MatrixXd numeric = centralDifferences(f, J.cols(), h);
    report_.record(invariant, sameSize(J, numeric) ? (J - numeric).norm() : infinity,
                   relative * contractScale(inputs) * std::max(1.0, J.norm()), inputs);
  }
  /// A quadratic form's value against the second differences of f.
  void secondDerivative(const char* invariant, double value, const std::function<double(double)>& f,
                        std::initializer_list<ContractInput> inputs, double room) {
    // eps^(1/6) balances rounding, eps/h², and truncation, h^4.
    const double h = std::min(std::pow(eps, 1.0 / 6), room / 30);
    const double scale = contractScale(inputs);
    const double tolerance = 8 * eps * (1 + std::abs(f(0))) * scale / (h * h) +
                             10 * std::pow(h / std::min(room, 1.0), 4) * scale * std::max(1.0, std::abs(value));
    report_.record(invariant, std::abs(value - secondDifference(f, h)), tolerance, inputs);
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static bool sameSize(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.rows() == b.rows() && a.cols() == b.cols();
  }
  ContractReport& report_;
};

/// Points nearer than this to a cut locus are left to the checks that need no differences; a little less than the decade
/// of 0.01, which is swept.
inline constexpr double min_room = 0.0099;

/// Inputs for the checks of a manifold and of its group, and short names for what the checks do with them.
class ContractBench : public ContractRecorder {
 public:
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  using Body = std::function<void(const Vector&)>;

  ContractBench(const ManifoldOperations& operations, ContractReport& report, const ContractOptions& options)
      : ContractRecorder(report, operations.epsilon),
        m(operations),
        group(operations.group),
        options_(options),
        sequence_(options.seed) {
    const double turn = 2 * pi;
    for (int i = 0; i < m.dimension; ++i) {
      const Vector e = Vector::Unit(m.dimension, i);
      coordinates_.angular.push_back(m.logOrigin(point(turn * e)).norm() < 1e-3);
      coordinates_.logarithmic.push_back(growsExponentially(m.placement(point(10 * e))));
    }
    for (int i = 0; i < group.dimension; ++i) {
      const Vector e = Vector::Unit(group.dimension, i);
      group_coordinates_.angular.push_back(group.log(element(turn * e)).norm() < 1e-3);
      group_coordinates_.logarithmic.push_back(growsExponentially(element(10 * e)));
    }
    cut_ = m.injectivityRadius       ? m.injectivityRadius()
           : coordinates_.hasAngle() ? pi
                                     : std::numeric_limits<double>::infinity();
  }

  const ManifoldOperations& m;
  const ManifoldOperations::Group& group;

  // Runs a check over all decades of the angle below a limit; inputs are numbers of the scalar.
  /// Inside the domain where logOrigin inverts expOrigin.
  void overDomain(const Body& body) { sweep(coordinates_, cut_, body); }
  /// Over all angles to pi, with pi itself.
  void overAll(const Body& body) {
    sweep(coordinates_, coordinates_.hasAngle() ? pi : cut_, body);
    if (!coordinates_.hasAngle()) return;
    sequence_.next();
    body(draw(coordinates_, pi, options_.length));
  }
  /// Over the tangent vectors of the group.
  void overGroup(const Body& body) {
    sweep(group_coordinates_, group_coordinates_.hasAngle() ? pi : std::numeric_limits<double>::infinity(), body);
  }
  /// A further tangent vector for the body of a check, well inside the domain of every placement.
  Vector generic() { return draw(coordinates_, sequence_.uniform(0.1, 2.8), options_.length); }
  Vector genericGroup() { return draw(group_coordinates_, sequence_.uniform(0.1, 3.0), options_.length); }
  Vector zero() const { return Vector::Zero(m.dimension); }
  Matrix identity() const { return Matrix::Identity(m.dimension, m.dimension); }

  Point point(const Vector& v) const { return m.expOrigin(v); }
  Element element(const Vector& v) const { return group.exp(v); }
  Element product(const Element& f, const Element& g) const { return group.product(f, g); }
  /// y in the frame of x.
  Point between(const Point& x, const Point& y) const { return m.act(group.inverse(m.placement(x)), y); }
  Vector groupGap(const Element& f, const Element& g) const { return group.log(product(group.inverse(f), g)); }
  /// placement(f x)⁻¹ f placement(x), an element of the isotropy group.
  Element isotropyElement(const Element& f, const Point& x) const {
    return product(product(group.inverse(m.placement(m.act(f, x))), f), m.placement(x));
  }
  /// How far from its cut locus the point p is, seen from the origin.
  double room(const Point& p) const {
    return m.representativeGap ? m.representativeGap(p) / 2 : cut_ - coordinates_.angularNorm(m.logOrigin(p));
  }
  /// Condition of the logarithm at p: near a cut locus like the sphere's a rounding error of the point turns it by
  /// 1/(distance from the cut locus).
  double condition(const Point& p) const { return std::max(1.0, m.dlogOrigin(p).norm()); }

 private:
  /// True if a transformation that is ten units from the identity along a coordinate is e^10 in size, and not ten.
  bool growsExponentially(const Element& f) const {
    return (group.matrix ? group.matrix(f) : group.Adj(f)).norm() > 1e3;
  }
  Vector draw(const ContractCoordinates& coordinates, double angle, double length) {
    return m.rounded(coordinates.draw(sequence_, angle, length));
  }
  void sweep(const ContractCoordinates& coordinates, double limit, const Body& body) {
    sequence_.next();
    body(Vector::Zero(static_cast<Eigen::Index>(coordinates.angular.size())));
    const double lengths[] = {1, 0, 10, 1e-3};
    for (const double angle : sweptAngles(limit, eps)) {
      for (int i = 0; i < options_.samples; ++i) {
        // Each input of a check has coordinates of its own in one point of the sequence.
        sequence_.next();
        body(draw(coordinates, angle, options_.length * lengths[i % 4]));
      }
    }
  }

  static constexpr double pi = static_cast<double>(EIGEN_PI);

  ContractOptions options_;
  ContractSequence sequence_;
  ContractCoordinates coordinates_, group_coordinates_;
  double cut_ = 0;
};

}  // namespace liestat::detail
