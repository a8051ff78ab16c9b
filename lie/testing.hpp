// Checkers of the manifold contract: the numbered invariants of lie/concepts.hpp as functions to run on any manifold,
// the library's or a user's own. They know no test framework: a report comes back.
//
//   const liestat::ContractReport report = liestat::checkContract<MyManifold>();
//   if (!report.ok()) std::cerr << report;
//
// Inputs are made of tangent vectors, whose angles are swept by decades from 1e-12 to the cut locus less 1e-12 (less
// 1e-5 in float), for it is at these ends that formulas fail. A coordinate counts as an angle when a whole turn along
// it comes back to the origin, as a logarithm (of a scale) when matrices grow exponentially along it, in which case it
// is swept to ±1; the others are lengths.
//
// Jacobians are compared with central differences of fourth order at the step h = eps^(1/5), where rounding, of some
// eps/h, and truncation, of some h^4, are of one size.
#pragma once

#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <limits>
#include <ostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// How much checkContract tries.
struct ContractOptions {
  std::uint64_t seed = 1;
  int samples = 4;  ///< directions tried for each angle
  double length =
      1;  ///< typical size of the coordinates that are no angles; 0, 1e-3 and 10 times as much are tried too
};

/// A named input of a check: a tangent vector, from which points and transformations were made.
struct ContractInput {
  const char* name;
  Eigen::VectorXd value;
};

/// One invariant: of all inputs tried, the one that came nearest to its tolerance or exceeded it most.
struct ContractCheck {
  std::string invariant;
  double error = 0;      ///< of the worst input; NaN where a result was not finite
  double tolerance = 0;  ///< for that input
  std::string input;     ///< that input
  int cases = 0;         ///< how many inputs were tried
  bool ok() const { return error <= tolerance; }
};

/// What the checkers found.
class ContractReport {
 public:
  const std::vector<ContractCheck>& checks() const { return checks_; }
  /// True if something was checked and every check holds.
  bool ok() const {
    return !checks_.empty() &&
           std::all_of(checks_.begin(), checks_.end(), [](const ContractCheck& c) { return c.ok(); });
  }
  /// Adds the outcome of one input to the check of that name.
  void record(const char* invariant, double error, double tolerance, std::initializer_list<ContractInput> inputs) {
    auto check =
        std::find_if(checks_.begin(), checks_.end(), [&](const ContractCheck& c) { return c.invariant == invariant; });
    const bool first = check == checks_.end();
    if (first) check = checks_.insert(check, ContractCheck{invariant, 0, 0, "", 0});
    ++check->cases;
    if (std::isnan(check->error)) return;
    // Written so that NaN is worse than everything.
    if (!first && error * check->tolerance <= check->error * tolerance) return;
    check->error = error;
    check->tolerance = tolerance;
    std::ostringstream text;
    text.precision(17);
    for (const ContractInput& i : inputs) {
      if (text.tellp() > 0) text << ", ";
      text << i.name << " = (";
      for (Eigen::Index k = 0; k < i.value.size(); ++k) text << (k > 0 ? " " : "") << i.value[k];
      text << ")";
    }
    check->input = text.str();
  }

 private:
  std::vector<ContractCheck> checks_;
};

/// One line an invariant; those that failed with their input.
inline std::ostream& operator<<(std::ostream& os, const ContractReport& report) {
  for (const ContractCheck& c : report.checks()) {
    os << (c.ok() ? "ok    " : "FAILS ") << c.invariant << ": error " << c.error << " of " << c.tolerance
       << " allowed, " << c.cases << " cases";
    if (!c.ok()) os << ", at " << c.input;
    os << "\n";
  }
  return os;
}

namespace detail {

/// SplitMix64 (Steele, Lea, Flood 2014): small, and the same everywhere, which std's distributions are not.
class ContractRng {
 public:
  explicit ContractRng(std::uint64_t seed) : state_(seed) {}
  double uniform() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return (static_cast<double>((z ^ (z >> 31)) >> 12) + 0.5) * 0x1p-52;
  }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Box and Muller.
  double normal() {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(2 * EIGEN_PI * uniform());
  }

 private:
  std::uint64_t state_;
};

/// A random vector whose angular coordinates have the norm `angle` and whose others have the norm `length`; without
/// angular coordinates its norm is their product (or the one that is not zero).
inline Eigen::VectorXd randomTangent(ContractRng& rng, const std::vector<bool>& angular, double angle, double length) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(angular.size()));
  double angular_norm = 0, other_norm = 0;
  for (std::size_t i = 0; i < angular.size(); ++i) {
    const double x = rng.normal();
    v[static_cast<Eigen::Index>(i)] = x;
    (angular[i] ? angular_norm : other_norm) += x * x;
  }
  if (angular_norm == 0) length = length > 0 ? length * angle : angle;
  for (std::size_t i = 0; i < angular.size(); ++i) {
    v[static_cast<Eigen::Index>(i)] *= angular[i] ? angle / std::sqrt(angular_norm) : length / std::sqrt(other_norm);
  }
  return v;
}

/// The norm of the angular coordinates; of them all if there are none.
inline double angularNorm(const Eigen::VectorXd& v, const std::vector<bool>& angular) {
  double sum = 0;
  bool any = false;
  for (std::size_t i = 0; i < angular.size(); ++i) {
    if (!angular[i]) continue;
    any = true;
    sum += v[static_cast<Eigen::Index>(i)] * v[static_cast<Eigen::Index>(i)];
  }
  return any ? std::sqrt(sum) : v.norm();
}

/// Angles by decades from 1e-12 up, some in between, and by decades down to the limit (1e-12 below it, 1e-5 if eps is
/// that of a float).
inline std::vector<double> sweptAngles(double limit, double eps) {
  std::vector<double> angles;
  for (int k = 12; k > 0; --k) angles.push_back(std::pow(10, -k));
  if (!(limit < 1e9)) {
    angles.insert(angles.end(), {0.5, 1, 3, 10});
    return angles;
  }
  for (const double s : {0.25, 0.5, 0.75, 0.9}) angles.push_back(s * limit);
  for (int k = 1; k <= (eps > 1e-10 ? 5 : 12); ++k) angles.push_back(limit - std::pow(10, -k));
  return angles;
}

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

/// A·B, coefficient by coefficient: compiled once, without Eigen's kernels for large matrices.
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
      : report_(report), eps(epsilon), step(std::pow(epsilon, 0.2)) {}

  /// An identity that holds but for some rounding errors of the size of the inputs, times the condition of the problem.
  void exact(const char* invariant, double error, std::initializer_list<ContractInput> inputs, double condition = 1) {
    report_.record(invariant, error, 16 * eps * contractScale(inputs) * condition, inputs);
  }
  void equal(const char* invariant, const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
             std::initializer_list<ContractInput> inputs, double condition = 1) {
    const bool same_size = a.rows() == b.rows() && a.cols() == b.cols();
    exact(invariant, same_size ? (a - b).norm() : std::numeric_limits<double>::infinity(), inputs, condition);
  }
  /// J against the differences of f; `room` is how far f is smooth around zero, singular beyond.
  void derivative(const char* invariant, const Eigen::MatrixXd& J, const ContractFunction& f,
                  std::initializer_list<ContractInput> inputs, double room = 1) {
    const double h = std::min(step, room / 30);
    // Rounding of the function over the step, and truncation of a function whose scale of variation is the room.
    const double relative = 20 * eps / h + 10 * std::pow(h / std::min(room, 1.0), 4);
    const Eigen::MatrixXd numeric = centralDifferences(f, J.cols(), h);
    const bool same_size = numeric.rows() == J.rows();
    const double scale = contractScale(inputs);
    report_.record(invariant, same_size ? (J - numeric).norm() : std::numeric_limits<double>::infinity(),
                   relative * scale * std::max(1.0, J.norm()), inputs);
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
  ContractReport& report_;

 public:
  const double eps, step;
};

/// Inputs for the checks of M and of its group.
template <Homogeneous M>
class ContractBench : public ContractRecorder {
 public:
  using T = ManifoldTraits<M>;
  using Scalar = typename T::Scalar;
  using Group = typename T::Group;
  using Tangent = typename T::Tangent;
  using Square = typename T::Square;
  using GroupTangent = typename Group::Tangent;
  using Vector = Eigen::VectorXd;

  ContractBench(ContractReport& report, const ContractOptions& options)
      : ContractRecorder(report, static_cast<double>(std::numeric_limits<Scalar>::epsilon())),
        options_(options),
        rng_(options.seed) {
    const Scalar turn = Scalar(2 * EIGEN_PI);
    for (int i = 0; i < T::DoF; ++i) {
      angular_.push_back(T::logOrigin(T::expOrigin(Tangent(turn * Tangent::Unit(i)))).norm() < Scalar(1e-3));
      logarithmic_.push_back(growsExponentially(T::placement(T::expOrigin(Tangent(Scalar(10) * Tangent::Unit(i))))));
    }
    for (int i = 0; i < Group::DoF; ++i) {
      group_angular_.push_back(Group::exp(GroupTangent(turn * GroupTangent::Unit(i))).log().norm() < Scalar(1e-3));
      group_logarithmic_.push_back(growsExponentially(Group::exp(GroupTangent(Scalar(10) * GroupTangent::Unit(i)))));
    }
    has_angle_ = std::find(angular_.begin(), angular_.end(), true) != angular_.end();
    cut_ = has_angle_ ? EIGEN_PI : std::numeric_limits<double>::infinity();
    if constexpr (Metric<M>) cut_ = static_cast<double>(T::injectivityRadius());
  }

  // Compiled once each, not inlined into every check: this halves what a manifold costs the compiler.
  static EIGEN_DONT_INLINE Tangent tangent(const Vector& v) { return v.cast<Scalar>(); }
  static EIGEN_DONT_INLINE GroupTangent groupTangent(const Vector& v) { return v.cast<Scalar>(); }
  template <class D>
  static EIGEN_DONT_INLINE Eigen::MatrixXd wide(const Eigen::MatrixBase<D>& m) {
    return m.template cast<double>();
  }
  static EIGEN_DONT_INLINE M point(const Vector& v) { return T::expOrigin(tangent(v)); }
  static EIGEN_DONT_INLINE Group transformation(const Vector& v) { return Group::exp(groupTangent(v)); }

  /// Tangent vectors over all decades of the angle below a limit; what is returned is representable in Scalar.
  std::vector<Vector> sweep(double limit) { return sweep(angular_, logarithmic_, limit); }
  /// The same inside the domain where logOrigin inverts expOrigin.
  std::vector<Vector> sweepDomain() { return sweep(cut_); }
  /// The same over all angles to pi, with pi itself.
  std::vector<Vector> sweepAll() {
    std::vector<Vector> all = sweep(has_angle_ ? EIGEN_PI : cut_);
    if (has_angle_) all.push_back(draw(angular_, logarithmic_, EIGEN_PI, options_.length));
    return all;
  }
  std::vector<Vector> sweepGroup() {
    return sweep(group_angular_, group_logarithmic_, groupHasAngle() ? EIGEN_PI : infinity());
  }
  /// A tangent vector well inside the domain of every placement.
  Vector generic() { return draw(angular_, logarithmic_, rng_.uniform(0.1, 2.8), options_.length); }
  Vector genericGroup() { return draw(group_angular_, group_logarithmic_, rng_.uniform(0.1, 3.0), options_.length); }

  /// How far from its cut locus the point p is, seen from the origin.
  double room(const M& p) const {
    if constexpr (Quotient<M>) {
      return static_cast<double>(T::nearestRepresentative(p).gap()) / 2;
    } else {
      return cut_ - angularNorm(wide(T::logOrigin(p)), angular_);
    }
  }
  static EIGEN_DONT_INLINE M move(const M& x, const Vector& v) { return exp(x, tangent(v)); }
  static EIGEN_DONT_INLINE M act(const Group& f, const M& x) { return T::act(f, x); }
  /// log(x, y) in double; zero if they are the same point.
  static EIGEN_DONT_INLINE Vector gap(const M& x, const M& y) { return wide(log(x, y)); }
  static EIGEN_DONT_INLINE Vector groupGap(const Group& f, const Group& g) { return wide((f.inverse() * g).log()); }

 private:
  static double infinity() { return std::numeric_limits<double>::infinity(); }
  bool groupHasAngle() const {
    return std::find(group_angular_.begin(), group_angular_.end(), true) != group_angular_.end();
  }
  /// Whether a transformation that is ten units from the identity along a coordinate is e^10 in size, and not ten.
  static bool growsExponentially(const Group& f) {
    if constexpr (requires { f.matrix(); }) {
      return f.matrix().norm() > Scalar(1e3);
    } else {
      return f.Adj().norm() > Scalar(1e3);
    }
  }
  Vector draw(const std::vector<bool>& angular, const std::vector<bool>& logarithmic, double angle, double length) {
    Vector v = randomTangent(rng_, angular, angle, length);
    for (std::size_t i = 0; i < logarithmic.size(); ++i) {
      double& x = v[static_cast<Eigen::Index>(i)];
      if (logarithmic[i]) x /= 1 + std::abs(x);
    }
    return v.cast<Scalar>().template cast<double>();
  }
  std::vector<Vector> sweep(const std::vector<bool>& angular, const std::vector<bool>& logarithmic, double limit) {
    std::vector<Vector> result{Vector::Zero(static_cast<Eigen::Index>(angular.size()))};
    const double lengths[] = {1, 0, 10, 1e-3};
    for (const double angle : sweptAngles(limit, eps)) {
      for (int i = 0; i < options_.samples; ++i) {
        result.push_back(draw(angular, logarithmic, angle, options_.length * lengths[i % 4]));
      }
    }
    return result;
  }

  ContractOptions options_;
  ContractRng rng_;
  std::vector<bool> angular_, group_angular_, logarithmic_, group_logarithmic_;
  bool has_angle_ = false;
  double cut_ = 0;
};

/// Points nearer than this to a cut locus are left to the checks that need no differences.
inline constexpr double least_room = 0.01;

}  // namespace detail

/// Invariant 1: the placement carries the origin to the point.
template <Homogeneous M>
void checkPlacement(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Group = typename T::Group;
  detail::ContractBench<M> bench(report, options);
  // Compared by logOrigin, not by log(x, ·), in which a wrong placement would cancel.
  for (const auto& v : bench.sweepDomain()) {
    const M x = bench.point(v);
    bench.equal("act(placement(x), origin()) == x", bench.wide(T::logOrigin(bench.act(T::placement(x), T::origin()))),
                bench.wide(T::logOrigin(x)), {{"x = expOrigin", v}},
                std::max(1.0, bench.wide(T::dlogOrigin(x)).norm()));
  }
  bench.exact("placement(origin()) is the identity", bench.groupGap(Group(), T::placement(T::origin())).norm(),
              {{"origin", Eigen::VectorXd::Zero(T::DoF)}});
}

/// Invariant 2: the action is one of the group.
template <Homogeneous M>
void checkAction(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Group = typename T::Group;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepAll()) {
    const auto a = bench.genericGroup(), b = bench.genericGroup();
    const M x = bench.point(v);
    const Group f = bench.transformation(a), g = bench.transformation(b);
    bench.exact("act(f, act(g, x)) == act(f * g, x)",
                bench.gap(bench.act(f * g, x), bench.act(f, bench.act(g, x))).norm(),
                {{"x = expOrigin", v}, {"f = Exp", a}, {"g = Exp", b}});
    bench.exact("act(identity, x) == x", bench.gap(x, bench.act(Group(), x)).norm(), {{"x = expOrigin", v}});
  }
}

/// Invariant 3: expOrigin and logOrigin are inverses, at the origin and everywhere.
template <Homogeneous M>
void checkExpLog(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const M x = bench.point(v);
    // Near a cut locus like the sphere's a rounding error of the point turns the logarithm by 1/(distance from it).
    const double condition = std::max(1.0, bench.wide(T::dlogOrigin(x)).norm());
    bench.equal("logOrigin(expOrigin(v)) == v", bench.wide(T::logOrigin(x)), v, {{"v", v}}, condition);
    const auto w = bench.generic();
    const M y = bench.point(w);
    bench.equal("log(y, exp(y, v)) == v", bench.gap(y, bench.move(y, v)), v, {{"v", v}, {"y = expOrigin", w}},
                condition);
  }
  for (const auto& v : bench.sweepAll()) {
    const auto w = bench.generic();
    const M x = bench.point(v), y = bench.point(w);
    bench.exact("expOrigin(logOrigin(x)) == x", bench.gap(x, T::expOrigin(T::logOrigin(x))).norm(),
                {{"x = expOrigin", v}});
    bench.exact("exp(y, log(y, x)) == x", bench.gap(x, exp(y, log(y, x))).norm(),
                {{"x = expOrigin", v}, {"y = expOrigin", w}});
  }
}

/// Invariant 4: isotropy(f, x) is what placement(f x)⁻¹ f placement(x) does to tangent vectors of the origin.
template <Homogeneous M>
void checkIsotropy(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Group = typename T::Group;
  using Tangent = typename T::Tangent;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const auto a = bench.genericGroup(), b = bench.generic();
    const Group f = bench.transformation(a);
    const M x = bench.point(b);
    const Group h = T::placement(bench.act(f, x)).inverse() * f * T::placement(x);
    const typename T::Square H = T::isotropy(f, x);
    bench.exact("placement(f x)⁻¹ f placement(x) leaves the origin",
                bench.gap(T::origin(), bench.act(h, T::origin())).norm(), {{"f = Exp", a}, {"x = expOrigin", b}});
    bench.derivative("isotropy(f, x) against differences", bench.wide(H),
                     [&](const auto& d) { return bench.wide(T::logOrigin(bench.act(h, bench.point(d)))); },
                     {{"f = Exp", a}, {"x = expOrigin", b}});
    if constexpr (Metric<M>) {
      const double condition = std::max(1.0, bench.wide(T::dlogOrigin(bench.point(v))).norm());
      bench.equal("logOrigin(h expOrigin(v)) == isotropy(f, x) v, h = placement(f x)⁻¹ f placement(x)",
                  bench.wide(T::logOrigin(bench.act(h, bench.point(v)))), bench.wide(Tangent(H * bench.tangent(v))),
                  {{"f = Exp", a}, {"x = expOrigin", b}, {"v", v}}, condition);
    }
  }
}

/// What follows from invariants 4 and 7: the Jacobians of the action by the feature and by the transformation.
template <Homogeneous M>
void checkActionJacobians(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Group = typename T::Group;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepGroup()) {
    const auto w = bench.generic();
    const Group f = bench.transformation(v);
    const M x = bench.point(w), fx = bench.act(f, x);
    bench.derivative("actionFeatureJacobian against differences", bench.wide(actionFeatureJacobian(f, x)),
                     [&](const auto& d) { return bench.gap(fx, bench.act(f, bench.move(x, d))); },
                     {{"f = Exp", v}, {"x = expOrigin", w}});
    bench.derivative("actionTransformationJacobian against differences", bench.wide(actionTransformationJacobian(f, x)),
                     [&](const auto& d) { return bench.gap(fx, bench.act(f * bench.transformation(d), x)); },
                     {{"f = Exp", v}, {"x = expOrigin", w}});
  }
  const auto origin = Eigen::VectorXd::Zero(T::DoF);
  bench.derivative(
      "originProjection against differences", bench.wide(T::originProjection()),
      [&](const auto& d) { return bench.wide(T::logOrigin(bench.act(bench.transformation(d), T::origin()))); },
      {{"origin", origin}});
}

/// Invariant 5: the derivative of the placement, where the placement is smooth.
template <Homogeneous M>
void checkPlacementJacobian(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepAll()) {
    const M x = bench.point(v);
    if (!T::isPlacementSmooth(x)) continue;
    const Eigen::MatrixXd J = bench.wide(T::placementJacobian(x));
    // A placement turns over the distance to the point where it is not smooth, which shows in its Jacobian's size.
    const double room = 3 / std::max(3.0, J.norm());
    if (room < detail::least_room) continue;
    const typename T::Group f = T::placement(x);
    bench.derivative(
        "placementJacobian against differences", J,
        [&](const auto& d) { return bench.groupGap(f, T::placement(bench.move(x, d))); }, {{"x = expOrigin", v}}, room);
  }
}

/// Invariant 6: the derivatives of expOrigin and logOrigin, and the principal chart.
template <Homogeneous M>
void checkExpLogJacobians(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const M x = bench.point(v);
    const Eigen::MatrixXd dexp = bench.wide(T::dexpOrigin(bench.tangent(v))), dlog = bench.wide(T::dlogOrigin(x));
    bench.derivative("dexpOrigin against differences", dexp,
                     [&](const auto& d) { return bench.gap(x, bench.point(v + d)); }, {{"v", v}});
    bench.equal("dlogOrigin(expOrigin(v)) dexpOrigin(v) == I", detail::product(dlog, dexp),
                Eigen::MatrixXd::Identity(T::DoF, T::DoF), {{"v", v}}, dlog.norm() * std::max(1.0, dlog.norm()));
  }
  for (const auto& v : bench.sweepAll()) {
    const M x = bench.point(v);
    const double room = bench.room(x);
    if (room < detail::least_room) continue;
    bench.derivative(
        "principalChartJacobian against differences", bench.wide(principalChartJacobian(x)),
        [&](const auto& d) { return bench.wide(T::logOrigin(bench.move(x, d))); }, {{"x = expOrigin", v}}, room);
  }
}

/// The error vector log(y, x) and its derivatives by both points, the base's in frames carried in parallel.
template <Homogeneous M>
void checkErrorVector(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const auto w = bench.generic();
    const M y = bench.point(w), x = bench.move(y, v);
    const ErrorVector<M> e = errorVector(y, x);
    const double condition = std::max(1.0, bench.wide(e.by_feature).norm());
    bench.equal("errorVector(y, x).z == log(y, x)", bench.wide(e.z), bench.gap(y, x), {{"z", v}, {"y = expOrigin", w}});

    // Rounding of a point turns its frame as much as the placement's Jacobian is steep there.
    const double steep = std::max(1.0, bench.wide(T::placementJacobian(x)).norm());
    bench.equal("frameTransport(x, y) frameTransport(y, x) == I",
                detail::product(bench.wide(frameTransport(x, y)), bench.wide(frameTransport(y, x))),
                Eigen::MatrixXd::Identity(T::DoF, T::DoF), {{"z", v}, {"y = expOrigin", w}}, condition * steep);
    const double room = bench.room(between(y, x));
    if (room < detail::least_room) continue;
    bench.derivative(
        "errorVector by the feature against differences", bench.wide(e.by_feature),
        [&](const auto& d) { return bench.gap(y, bench.move(x, d)); }, {{"z", v}, {"y = expOrigin", w}}, room);
    bench.derivative(
        "errorVector by the base against differences", bench.wide(e.by_base),
        [&](const auto& d) {
          const M moved = bench.move(y, d);
          // In the frame that was carried to the moved base: frameTransport undone, on the way back.
          const Eigen::MatrixXd back = bench.wide(frameTransport(moved, y));
          return Eigen::VectorXd(detail::product(back, bench.gap(moved, x)));
        },
        {{"z", v}, {"y = expOrigin", w}}, room);
  }
}

/// Invariant 8: an invariant distance, which geodesics measure.
template <Metric M>
void checkMetric(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  const auto d = [](const M& a, const M& b) { return static_cast<double>(distance(a, b)); };
  for (const auto& v : bench.sweepAll()) {
    const auto a = bench.genericGroup(), b = bench.generic(), c = bench.generic();
    const typename T::Group f = bench.transformation(a);
    const M y = bench.point(b), x = bench.move(y, v), w = bench.point(c);
    const double yx = d(y, x);
    bench.exact("distance(f x, f y) == distance(x, y)", std::abs(d(bench.act(f, y), bench.act(f, x)) - yx),
                {{"f = Exp", a}, {"y = expOrigin", b}, {"log(y, x)", v}});
    bench.exact("distance(x, y) == distance(y, x)", std::abs(d(x, y) - yx), {{"y = expOrigin", b}, {"log(y, x)", v}});
    bench.exact("distance(x, y) <= distance(x, w) + distance(w, y)", std::max(0.0, yx - d(y, w) - d(w, x)),
                {{"y = expOrigin", b}, {"log(y, x)", v}, {"w = expOrigin", c}});
  }
  for (const auto& v : bench.sweepDomain()) {
    const auto b = bench.generic();
    const M y = bench.point(b);
    const double length = std::sqrt((bench.wide(T::metricWeights()).array() * v.array() * v.array()).sum());
    bench.exact("distance(y, exp(y, v)) == |v|", std::abs(d(y, bench.move(y, v)) - length),
                {{"y = expOrigin", b}, {"v", v}});
  }
}

/// Invariant 9: the Hessian of half the squared distance, along geodesics.
template <Metric M>
void checkHessian(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const auto w = bench.generic();
    const M y = bench.point(w), x = bench.move(y, v);
    const double room = bench.room(between(y, x));
    if (room < detail::least_room) continue;
    const Eigen::MatrixXd A = bench.wide(T::hessianHalfSquaredDistance(log(y, x)));
    bench.equal("hessianHalfSquaredDistance is symmetric", A, detail::transposed(A), {{"z", v}},
                std::max(1.0, A.norm()));
    // By polarisation, the values of the quadratic form at e_i and e_i + e_j determine the matrix.
    for (int i = 0; i < T::DoF; ++i) {
      for (int j = i; j < T::DoF; ++j) {
        Eigen::VectorXd e = Eigen::VectorXd::Unit(T::DoF, i);
        if (j > i) e = (e + Eigen::VectorXd::Unit(T::DoF, j)) / std::sqrt(2.0);
        bench.secondDerivative(
            "hessianHalfSquaredDistance against second differences", e.dot(Eigen::VectorXd(detail::product(A, e))),
            [&](double s) {
              const double d = static_cast<double>(distance(bench.move(y, s * e), x));
              return d * d / 2;
            },
            {{"z", v}, {"y = expOrigin", w}, {"direction", e}}, room);
      }
    }
  }
}

/// Where M provides them: derivatives of D(z)ᵀa and L(z)ᵀa with respect to z (means.md, section 4.2), D and L the
/// derivatives of the error vector by the feature and by the base.
template <Homogeneous M>
void checkSecondDerivatives(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Tangent = typename T::Tangent;
  if constexpr (requires(const Tangent& z) {
                  T::dlogFeatureTransposed(z, z);
                  T::dlogBaseTransposed(z, z);
                }) {
    detail::ContractBench<M> bench(report, options);
    for (const auto& v : bench.sweepDomain()) {
      const auto a = bench.generic();
      const Tangent z = bench.tangent(v), at = bench.tangent(a);
      const double room = bench.room(bench.point(v));
      if (room < detail::least_room) continue;
      const auto dlog = [&](const Eigen::VectorXd& d) { return T::dlogOrigin(bench.point(v + d)); };
      bench.derivative(
          "dlogFeatureTransposed against differences", bench.wide(T::dlogFeatureTransposed(z, at)),
          [&](const auto& d) { return bench.wide(Tangent(dlog(d).transpose() * at)); }, {{"z", v}, {"a", a}}, room);
      bench.derivative(
          "dlogBaseTransposed against differences", bench.wide(T::dlogBaseTransposed(z, at)),
          [&](const auto& d) {
            return bench.wide(Tangent(logBaseJacobian<M>(bench.point(v + d), dlog(d)).transpose() * at));
          },
          {{"z", v}, {"a", a}}, room);
    }
  }
}

/// Where the isotropy is not trivial: results do not depend on the placement. f_x is replaced by f_x∘h, h an element of
/// the isotropy group that turns tangent vectors by H; tangent vectors become H⁻¹v, covariances H⁻¹ΣH⁻ᵀ.
template <Homogeneous M>
void checkPlacementIndependence(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  using Group = typename T::Group;
  using Square = typename T::Square;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepDomain()) {
    const auto a = bench.genericGroup(), b = bench.generic(), c = bench.generic();
    const Group f = bench.transformation(a);
    const M x = bench.point(b), w = bench.point(c), y = bench.move(x, v);
    const Group h = T::placement(bench.act(f, w)).inverse() * f * T::placement(w);
    const Group turned = T::placement(x) * h;
    const Eigen::MatrixXd H = bench.wide(Square(T::isotropy(h, T::origin())));
    const Eigen::MatrixXd H_inverse = bench.wide(Square(T::isotropy(h.inverse(), T::origin())));
    const M p = between(x, y), q = bench.act(turned.inverse(), y);
    const Square dlog_p = T::dlogOrigin(p), dlog_q = T::dlogOrigin(q);
    const double condition = std::max(1.0, bench.wide(dlog_p).norm());
    bench.exact("exp does not depend on the placement",
                bench.gap(bench.move(x, detail::product(H, v)), bench.act(turned, bench.point(v))).norm(),
                {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}, {"w = expOrigin", c}});
    bench.equal("log does not depend on the placement", detail::product(H, bench.wide(T::logOrigin(q))),
                bench.gap(x, y), {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}, {"w = expOrigin", c}}, condition);
    // An arbitrary covariance of y, carried to the covariance of log(x, y) in the frame of x by either placement.
    const auto covariance = [](const Eigen::MatrixXd& J) {
      Eigen::MatrixXd scaled = J;
      for (Eigen::Index k = 0; k < J.cols(); ++k) scaled.col(k) *= 1 + static_cast<double>(k);
      return detail::product(scaled, detail::transposed(J));
    };
    const Eigen::MatrixXd by_p = bench.wide(Square(dlog_p * T::isotropy(T::placement(x).inverse(), y)));
    const Eigen::MatrixXd by_q = detail::product(H, bench.wide(Square(dlog_q * T::isotropy(turned.inverse(), y))));
    if (by_p.norm() < 1e3) {
      bench.equal("the covariance of log(x, y) does not depend on the placement", covariance(by_p), covariance(by_q),
                  {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}}, std::pow(condition, 4));
      bench.equal("the derivative of log by the base does not depend on the placement",
                  bench.wide(logBaseJacobian<M>(p, dlog_p)),
                  detail::product(detail::product(H, bench.wide(logBaseJacobian<M>(q, dlog_q))), H_inverse),
                  {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}}, std::pow(condition, 2));
    }
  }
}

/// Invariant 10: no result depends on the representative that a quotient feature is stored as.
template <Quotient M>
void checkQuotient(ContractReport& report, const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepAll()) {
    const auto b = bench.generic(), c = bench.generic();
    const M y = bench.point(b), x = bench.move(y, v);
    const double room = bench.room(between(y, x));
    for (const int i : T::representatives) {
      const M x_i = T::representative(x, i), y_i = T::representative(y, i);
      const Eigen::MatrixXd K = bench.wide(T::representativeJacobian(i));
      const Eigen::VectorXd index = Eigen::VectorXd::Constant(1, i);
      if constexpr (Metric<M>) {
        const double d = static_cast<double>(distance(y, x));
        bench.exact(
            "distance does not depend on the representative",
            std::abs(static_cast<double>(distance(y, x_i)) - d) + std::abs(static_cast<double>(distance(y_i, x)) - d),
            {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      }
      bench.exact("exp(representative(x, i), representativeJacobian(i) v) == exp(x, v)",
                  bench.gap(bench.move(x, c), bench.move(x_i, detail::product(K, c))).norm(),
                  {{"log(y, x)", v}, {"y = expOrigin", b}, {"v", c}, {"index", index}});
      // The nearest representative is not defined on the cut locus.
      if (room < 1000 * bench.eps) continue;
      const ErrorVector<M> e = errorVector(y, x), by_x = errorVector(y, x_i), by_y = errorVector(y_i, x);
      bench.equal("the error vector does not depend on the feature's representative", bench.wide(by_x.z),
                  bench.wide(e.z), {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      bench.equal("a change of the base's representative turns the error vector by representativeJacobian",
                  bench.wide(by_y.z), detail::product(K, bench.wide(e.z)),
                  {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      bench.equal("errorVector by the feature turns with its representative",
                  detail::product(bench.wide(by_x.by_feature), K), bench.wide(e.by_feature),
                  {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}}, 4);
      bench.equal("errorVector by the base does not depend on the feature's representative", bench.wide(by_x.by_base),
                  bench.wide(e.by_base), {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}}, 4);
    }
  }
}

/// The group that acts on M: axioms, exponential map, adjoint representation, Jacobians, and hat, vee and matrix where
/// it has them. For a group G that acts on itself, checkGroup<G>.
template <Homogeneous M>
void checkGroup(ContractReport& report, const ContractOptions& options = {}) {
  using Group = typename ManifoldTraits<M>::Group;
  using GroupTangent = typename Group::Tangent;
  constexpr int n = Group::DoF;
  detail::ContractBench<M> bench(report, options);
  for (const auto& v : bench.sweepGroup()) {
    const auto a = bench.genericGroup(), b = bench.genericGroup();
    const GroupTangent tangent = bench.groupTangent(v);
    const Group f = Group::exp(tangent), g = bench.transformation(a), h = bench.transformation(b);
    const auto gap = [&](const Group& left, const Group& right) { return bench.groupGap(left, right).norm(); };
    bench.exact("(f g) h == f (g h)", gap((f * g) * h, f * (g * h)), {{"f = Exp", v}, {"g = Exp", a}, {"h = Exp", b}});
    bench.exact("f f⁻¹ == identity", gap(f * f.inverse(), Group()), {{"f = Exp", v}});
    bench.exact("f⁻¹ f == identity", gap(f.inverse() * f, Group()), {{"f = Exp", v}});
    bench.exact("identity f == f", gap(Group() * f, f), {{"f = Exp", v}});
    bench.equal("Log(Exp(v)) == v", bench.wide(f.log()), v, {{"v", v}});
    bench.exact("Exp(v)⁻¹ == Exp(-v)", gap(f.inverse(), Group::exp(GroupTangent(-tangent))), {{"v", v}});
    bench.exact("Exp(0.3 v) Exp(0.7 v) == Exp(v)",
                gap(bench.transformation(0.3 * v) * bench.transformation(0.7 * v), f), {{"v", v}});

    const Eigen::MatrixXd Adj_g = bench.wide(g.Adj());
    bench.exact("g Exp(v) g⁻¹ == Exp(g.Adj() v)",
                gap(g * f * g.inverse(), bench.transformation(detail::product(Adj_g, v))), {{"g = Exp", a}, {"v", v}},
                Adj_g.norm());
    bench.equal("(f g).Adj() == f.Adj() g.Adj()", bench.wide((f * g).Adj()),
                detail::product(bench.wide(f.Adj()), Adj_g), {{"f = Exp", v}, {"g = Exp", a}}, Adj_g.norm());
    bench.equal("Exp(v).Adj() == exp(ad(v)), by the power series", bench.wide(f.Adj()),
                detail::exponentialSeries(bench.wide(Group::ad(tangent))), {{"v", v}}, 4);

    const Eigen::MatrixXd left = bench.wide(Group::leftJacobian(tangent)),
                          right = bench.wide(Group::rightJacobian(tangent));
    const Eigen::MatrixXd left_inverse = bench.wide(Group::leftJacobianInverse(tangent));
    const Eigen::MatrixXd right_inverse = bench.wide(Group::rightJacobianInverse(tangent));
    bench.derivative("leftJacobian against differences", left,
                     [&](const auto& d) { return bench.wide((bench.transformation(v + d) * f.inverse()).log()); },
                     {{"v", v}});
    bench.derivative("rightJacobian against differences", right,
                     [&](const auto& d) { return bench.groupGap(f, bench.transformation(v + d)); }, {{"v", v}});
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(n, n);
    bench.equal("leftJacobianInverse leftJacobian == I", detail::product(left_inverse, left), identity, {{"v", v}},
                left.norm() * left_inverse.norm());
    bench.equal("rightJacobianInverse rightJacobian == I", detail::product(right_inverse, right), identity, {{"v", v}},
                right.norm() * right_inverse.norm());
    bench.equal("leftJacobian(v) == Exp(v).Adj() rightJacobian(v)", left, detail::product(bench.wide(f.Adj()), right),
                {{"v", v}}, std::max(1.0, right.norm()));

    if constexpr (requires {
                    f.matrix();
                    Group::hat(tangent);
                    Group::vee(f.matrix());
                  }) {
      const GroupTangent u = bench.groupTangent(a);
      const auto V = Group::hat(tangent), U = Group::hat(u);
      bench.equal("vee(hat(v)) == v", bench.wide(Group::vee(V)), v, {{"v", v}});
      bench.equal("ad(v) u == vee(hat(v) hat(u) - hat(u) hat(v))", bench.wide(GroupTangent(Group::ad(tangent) * u)),
                  bench.wide(Group::vee(V * U - U * V)), {{"v", v}, {"u", a}}, 1 + v.norm());
      bench.equal("Exp(v).matrix() == exp(hat(v)), by the power series", bench.wide(f.matrix()),
                  detail::exponentialSeries(bench.wide(V)), {{"v", v}});
      bench.equal("(f g).matrix() == f.matrix() g.matrix()", bench.wide((f * g).matrix()),
                  detail::product(bench.wide(f.matrix()), bench.wide(g.matrix())), {{"f = Exp", v}, {"g = Exp", a}});
    }
  }
}

/// Everything that M promises by the concepts which it satisfies.
template <Homogeneous M>
ContractReport checkContract(const ContractOptions& options = {}) {
  using T = ManifoldTraits<M>;
  ContractReport report;
  checkGroup<M>(report, options);
  checkPlacement<M>(report, options);
  checkAction<M>(report, options);
  checkExpLog<M>(report, options);
  checkIsotropy<M>(report, options);
  checkActionJacobians<M>(report, options);
  checkPlacementJacobian<M>(report, options);
  checkExpLogJacobians<M>(report, options);
  checkErrorVector<M>(report, options);
  checkSecondDerivatives<M>(report, options);
  if constexpr (Metric<M>) {
    checkMetric<M>(report, options);
    checkHessian<M>(report, options);
  }
  if constexpr (T::Group::DoF > T::DoF) checkPlacementIndependence<M>(report, options);
  if constexpr (Quotient<M>) checkQuotient<M>(report, options);
  return report;
}

}  // namespace liestat
