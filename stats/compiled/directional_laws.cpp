// Laws of directions, axes, headings and rotations, compiled once.
#ifndef LIESTAT_COMPILED_LAWS
#define LIESTAT_COMPILED_LAWS
#endif
#include <stats/directional_laws.hpp>

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_solve.hpp>
#include <lie/s2.hpp>
#include <lie/so3.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/noise_fit.hpp>
#include <stats/random.hpp>
#include <stats/repeated_rows.hpp>

#include <Eigen/Geometry>

#include <algorithm>
#include <complex>
#include <numbers>
#include <utility>

namespace liestat {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr double pi = std::numbers::pi;

/// A few numbers, without the heap.
using Few = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>;

bool isRotation(LawModel model) { return model == LawModel::matrix_fisher || model == LawModel::wrapped_normal; }

MatrixXd inverseOf(const MatrixXd& a) { return detail::solvedDefinite(a, MatrixXd::Identity(a.rows(), a.rows())); }

/// The inner product of twice the working precision (Ogita, Rump and Oishi 2005, Dot2): of a feature and an axis that it
/// is nearly orthogonal to every digit counts.
template <class A, class B>
double accurateDot(const A& a, const B& b) {
  double sum = 0, rest = 0;
  for (Index i = 0; i < a.size(); ++i) {
    const double p = a[i] * b[i], s = sum + p, t = s - sum;
    rest += std::fma(a[i], b[i], -p) + ((sum - (s - t)) + (p - t));
    sum = s;
  }
  return sum + rest;
}

/// Eigenvalues, ascending, and eigenvectors of XᵀX/n, and X V. Small values are as accurate as X: the sums are taken
/// again in the axes of the first solution, where they are graded, and Jacobi's rotations keep that.
struct Scatter {
  VectorXd values;
  MatrixXd axes, coordinates;

  explicit Scatter(const MatrixXd& x) {
    const double n = static_cast<double>(x.rows());
    const detail::SymmetricEigen<MatrixXd> rough(MatrixXd(x.transpose() * x / n));
    MatrixXd y(x.rows(), x.cols());
    for (Index i = 0; i < x.rows(); ++i) {
      for (Index k = 0; k < x.cols(); ++k) y(i, k) = accurateDot(x.row(i), rough.vectors.col(k));
    }
    const detail::SymmetricEigen<MatrixXd> fine(MatrixXd(y.transpose() * y / n));
    values = fine.values / fine.values.sum();
    axes = rough.vectors * fine.vectors, coordinates = y * fine.vectors;
  }
};

/// q p of quaternions x y z w.
Vector4d product(const Vector4d& q, const Vector4d& p) {
  Vector4d r;
  r.head<3>() = q[3] * p.head<3>() + p[3] * q.head<3>() + Vector3d(q.head<3>()).cross(Vector3d(p.head<3>()));
  r[3] = q[3] * p[3] - q.head<3>().dot(p.head<3>());
  return r;
}

/// Orthonormal columns in which the law is about the last one.
MatrixXd basisOf(const DirectionalLaw& law) {
  const VectorXd& m = law.location;
  switch (law.model) {
    case LawModel::von_mises:
      return (MatrixXd(2, 2) << -m[1], m[0], m[0], m[1]).finished();
    case LawModel::vmf:
      return ManifoldTraits<S2d>::placement(S2d(Vector3d(m))).matrix();
    case LawModel::bingham:
      return law.axes;
    default:
      MatrixXd basis(4, 4);
      for (Index i = 0; i < 3; ++i)
        basis.col(i) = product(m, Vector4d(law.axes(0, i), law.axes(1, i), law.axes(2, i), 0));
      basis.col(3) = m;
      return basis;
  }
}

/// Coordinates of a feature in a law's basis; of headings and directions those of the half angle, whose squares add up
/// to one and whose last one is not negative.
Few coordinates(LawModel model, const MatrixXd& basis, const Few& feature) {
  Few x(feature.size());
  for (Index k = 0; k < x.size(); ++k) x[k] = accurateDot(feature, basis.col(k));
  if (model != LawModel::von_mises && model != LawModel::vmf) return x;
  const Index d = x.size() - 1;
  const double c = x[d], across = x.head(d).norm();
  const double half = c >= 0 ? across / std::sqrt(2 * (1 + c)) : std::sqrt(0.5 * (1 - c));
  if (across > 0) x.head(d) *= half / across;
  if (across == 0) x[0] = half;
  x[d] = std::sqrt(std::max(0.0, 1 - half * half));
  return x;
}

/// A law as Bingham's: μ = design · ν, κ = factor · ν.
struct Design {
  MatrixXd design;
  double factor;
};
Design designOf(LawModel model, bool symmetric = false, bool girdle = false) {
  switch (model) {
    case LawModel::von_mises:
      return {(MatrixXd(2, 1) << 1, 0).finished(), 0.5};
    case LawModel::vmf:
      // Hopf's map takes rotations to where they carry an axis, and this law of rotations to that of directions.
      return {(MatrixXd(4, 1) << 1, 1, 0, 0).finished(), 0.5};
    case LawModel::bingham:
      if (symmetric) return {(MatrixXd(3, 1) << 1, girdle ? 0 : 1, 0).finished(), 1};
      return {MatrixXd::Identity(3, 2), 1};
    default:
      if (symmetric) return {(MatrixXd(4, 1) << 1, 1, 1, 0).finished(), 0.5};
      return {MatrixXd::Identity(4, 3), 0.5};
  }
}

/// The ν of the largest likelihood where the means of the design's sums of squares are t: Newton's iteration on 1/E,
/// which is nearly linear in ν from 0 to infinity. Relative steps end below rounding.
VectorXd solveConcentrations(const MatrixXd& design, const VectorXd& t) {
  const Index q = t.size();
  VectorXd nu = (0.5 / t.array() - 0.5 * static_cast<double>(design.rows())).max(1e-3);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const BinghamMoments m = binghamMoments(design * nu);
    const VectorXd e = design.transpose() * m.second;
    const MatrixXd covariance = design.transpose() * (m.fourth - m.second * m.second.transpose()) * design;
    const MatrixXd scaled = covariance.cwiseQuotient(MatrixXd(e * e.transpose()));
    const VectorXd excess = e.cwiseQuotient(t) - VectorXd::Ones(q);
    const VectorXd step = detail::solvedDefinite(scaled, excess).col(0).cwiseQuotient(e);
    double change = 0;
    for (Index k = 0; k < q; ++k) {
      const double next = nu[k] + step[k] > -0.5 ? nu[k] + step[k] : std::min(-0.25, 0.1 * nu[k]);
      change = std::max(change, std::abs(next - nu[k]) / (1e-3 + std::abs(next)));
      nu[k] = next;
    }
    if (change < 1e-14 || !std::isfinite(change)) break;
  }
  return nu.cwiseMax(0);
}

/// A law that was fitted, without tests.
struct Core {
  DirectionalLaw law;
  MatrixXd x;    ///< coordinates of the features in the law's basis
  VectorXd tau;  ///< means of their squares
  VectorXd nu;   ///< of a law that is one of Bingham's
  double log_likelihood = 0;
  bool girdle = false, bounded = true, settled = true;
};

double logLikelihood(const MatrixXd& design, const VectorXd& nu, const VectorXd& t, double n) {
  return n * (-nu.dot(t) - binghamMoments(design * nu).log_constant);
}

// The wrapped normal law -------------------------------------------------------------------------------------------------

/// A wrapped normal law at the log v of a feature: for each number of turns visit(weight, z, angle), z = S⁻¹ Vᵀ (v plus the
/// turns); the weights add up to one. Returns the log density relative to the uniform law.
template <class Visit>
double visitTurns(const MatrixXd& axes, const Vector3d& deviations, const Vector3d& v, const Visit& visit) {
  constexpr int most = 2;
  const double angle = v.norm();
  const Vector3d u = angle > 0 ? Vector3d(v / angle) : Vector3d::UnitX();
  const Vector3d unit = (axes.transpose() * u).cwiseQuotient(deviations);
  const double per_angle = unit.squaredNorm(), sine = 2 * std::sin(0.5 * angle) * std::sin(0.5 * angle);
  std::array<double, 2 * most + 1> exponents{};
  const auto placeOf = [](int turns) {
    const int place = turns + most;
    return static_cast<std::size_t>(place);
  };
  double largest = -std::numeric_limits<double>::infinity();
  for (int k = -most; k <= most; ++k) {
    const double a = angle + 2 * pi * k;
    const double square = k == 0 ? (angle < 1e-8 ? 2 : angle * angle / sine) : a * a / std::max(sine, 1e-300);
    const double e = -0.5 * per_angle * a * a + std::log(square);
    exponents[placeOf(k)] = e, largest = std::max(largest, e);
  }
  double sum = 0;
  for (const double e : exponents) sum += std::exp(e - largest);
  for (int k = -most; k <= most; ++k) {
    const double weight = std::exp(exponents[placeOf(k)] - largest) / sum;
    const double a = angle + 2 * pi * k;
    if (weight > 1e-18) visit(weight, Vector3d(a * unit), a, u);
  }
  // The density of v by the volume of rotations, 4π² of which are (1 - cos)/θ² in those of v.
  return largest + std::log(sum) + std::log(4 * pi * pi) - 1.5 * std::log(2 * pi) -
         std::log(deviations[0] * deviations[1] * deviations[2]);
}

/// log(m⁻¹ x) from coordinates in the basis of m, with V v in the last column's tangent space.
Vector3d logOf(const Few& x) {
  const double s = x.head<3>().norm(), w = x[3];
  if (s == 0) return Vector3d::Zero();
  return (w < 0 ? -2 : 2) * std::atan2(s, std::abs(w)) / s * x.head<3>();
}

/// The gradient of the log density at v in δ, where the mode moves to M exp(δ): of one number of turns.
Vector3d modeScore(const Vector3d& precision_v, const Vector3d& v, double angle, const Vector3d& u) {
  const double small = 1e-4;
  const double pull = std::abs(angle) < small ? angle / 6 : 2 / angle - std::sin(angle) / (1 - std::cos(angle));
  const Matrix3d left_inverse = SO3d::rightJacobianInverse(Vector3d(-v));
  return left_inverse.transpose() * precision_v - pull * u;
}

Core fitWrappedNormal(const MatrixXd& features, bool isotropic, double tolerance) {
  Core core;
  core.law.model = LawModel::wrapped_normal;
  const Scatter scatter(features);
  Vector4d mode = scatter.axes.col(3);
  const double n = static_cast<double>(features.rows());
  DirectionalLaw frame{LawModel::wrapped_normal, mode, MatrixXd::Identity(3, 3), {}};
  Matrix3d sigma = Matrix3d::Zero();
  MatrixXd axes = Matrix3d::Identity();
  Vector3d deviations = Vector3d::Zero();
  MatrixXd logs(features.rows(), 3);
  core.settled = false;
  for (int iteration = 0; iteration < 500 && !core.settled; ++iteration) {
    frame.location = mode;
    const MatrixXd basis = basisOf(frame);
    for (Index i = 0; i < features.rows(); ++i) {
      logs.row(i) = logOf(coordinates(frame.model, basis, features.row(i))).transpose();
    }
    if (iteration == 0) sigma = logs.transpose() * logs / n;
    if (!(sigma.trace() > 0) || !sigma.allFinite()) break;
    if (isotropic) sigma = Matrix3d(sigma.trace() / 3 * Matrix3d::Identity());
    const detail::SymmetricEigen<MatrixXd> eigen{MatrixXd(sigma)};
    if (!(eigen.values[0] > 0)) break;
    axes = eigen.vectors, deviations = eigen.values.cwiseSqrt();
    Matrix3d next = Matrix3d::Zero();
    Vector3d score = Vector3d::Zero();
    core.log_likelihood = 0;
    const MatrixXd back = axes * deviations.asDiagonal(), precision = axes * deviations.cwiseInverse().asDiagonal();
    for (Index i = 0; i < features.rows(); ++i) {
      const Vector3d v = logs.row(i).transpose();
      core.log_likelihood +=
          visitTurns(axes, deviations, v, [&](double weight, const Vector3d& z, double angle, const Vector3d& u) {
            const Vector3d turned = back * z;
            next += weight * turned * turned.transpose();
            score += weight * modeScore(precision * z, turned, angle, u);
          });
    }
    next /= n;
    if (isotropic) next = Matrix3d(next.trace() / 3 * Matrix3d::Identity());
    const Vector3d step = sigma * score / n;
    const double moved = (precision.transpose() * step).norm();
    const MatrixXd change = precision.transpose() * (next - sigma) * precision;
    // A mode is rounded to some 1e-16 rad, to which sums of squares about it are insensitive.
    const double rounding = 8 * std::numeric_limits<double>::epsilon() / deviations.minCoeff();
    core.settled = moved < tolerance + rounding && change.norm() < tolerance + 0.01 * rounding;
    if (core.settled) break;
    const double angle = step.norm();
    Vector4d turn(0, 0, 0, std::cos(0.5 * angle));
    if (angle > 0) turn.head<3>() = std::sin(0.5 * angle) / angle * step;
    mode = product(mode, turn).normalized();
    sigma = next;
  }
  core.bounded = deviations.minCoeff() > 64 * std::numeric_limits<double>::epsilon();
  core.law.location = mode, core.law.axes = axes;
  core.law.kappa = deviations.cwiseProduct(deviations).cwiseInverse();
  core.tau = deviations;
  core.x = logs;
  return core;
}

// All laws ---------------------------------------------------------------------------------------------------------------

Core fitCore(LawModel model, const MatrixXd& features, bool isotropic = false, double tolerance = 1e-13) {
  if (model == LawModel::wrapped_normal) return fitWrappedNormal(features, isotropic, tolerance);
  Core core;
  core.law.model = model;
  const double n = static_cast<double>(features.rows());
  const int d = dofOf(model);
  const Design design = designOf(model);
  VectorXd t;
  if (model == LawModel::von_mises || model == LawModel::vmf) {
    core.law.location = features.colwise().sum().transpose();
    const double length = core.law.location.norm();
    if (!(length > 0))
      core.law.location = VectorXd::Unit(d + 1, 0);
    else
      core.law.location /= length;
    core.law.axes = MatrixXd::Identity(d, d);
    const MatrixXd basis = basisOf(core.law);
    core.x.resize(features.rows(), d + 1);
    for (Index i = 0; i < features.rows(); ++i) core.x.row(i) = coordinates(model, basis, features.row(i)).transpose();
    // About the mean in the axes of the scatter, as the other laws.
    const MatrixXd across = core.x.leftCols(d);
    core.x.leftCols(d) = across * detail::SymmetricEigen<MatrixXd>(MatrixXd(across.transpose() * across)).vectors;
    t = VectorXd::Constant(1, across.squaredNorm() / n);
    core.tau = VectorXd::Constant(d + 1, t[0] / d);
    core.tau[d] = 1 - t[0];
  } else {
    const Scatter scatter(features);
    core.x = scatter.coordinates, core.tau = scatter.values, t = scatter.values.head(d);
    MatrixXd axes = scatter.axes;
    if (model == LawModel::bingham) {
      core.girdle = std::log(core.tau[2] / core.tau[1]) < std::log(core.tau[1] / core.tau[0]);
      for (Index k = 0; k < 3; ++k) {
        Index at = 0;
        axes.col(k).cwiseAbs().maxCoeff(&at);
        if (axes(at, k) < 0) axes.col(k) *= -1, core.x.col(k) *= -1;
      }
      core.law.axes = axes, core.law.location = axes.col(core.girdle ? 0 : 2);
    } else {
      if (axes(3, 3) < 0) axes.col(3) *= -1, core.x.col(3) *= -1;
      const Vector4d mode = axes.col(3).normalized(), inverse(-mode[0], -mode[1], -mode[2], mode[3]);
      core.law.location = mode, core.law.axes.resize(3, 3);
      for (Index k = 0; k < 3; ++k) core.law.axes.col(k) = product(inverse, axes.col(k)).head<3>();
    }
  }
  const double rounding = 64 * std::numeric_limits<double>::epsilon();
  core.bounded = t.minCoeff() > rounding * rounding;
  if (!core.bounded) return core;
  core.nu = solveConcentrations(design.design, t);
  core.law.kappa = design.factor * core.nu;
  core.log_likelihood = logLikelihood(design.design, core.nu, t, n);
  return core;
}

/// Draws features of a law.
class Sampler {
 public:
  explicit Sampler(const DirectionalLaw& law) : model_(law.model), basis_(basisOf(law)) {
    if (model_ == LawModel::wrapped_normal) {
      deviations_ = law.kappa.cwiseInverse().cwiseSqrt();
      return;
    }
    const Design design = designOf(model_);
    mu_ = design.design * law.kappa / design.factor;
    // The envelope of Kent, Ganeiban and Mardia 2013: angular central Gaussian with Ω = 1 + 2 μ/b, Σ 1/(b + 2 μ_i) = 1.
    const double p = static_cast<double>(mu_.size());
    double low = 0, high = p;
    for (int i = 0; i < 60; ++i) {
      b_ = 0.5 * (low + high);
      ((b_ + 2 * mu_.array()).inverse().sum() > 1 ? low : high) = b_;
    }
    omega_ = (1 + 2 * mu_.array() / b_).matrix();
    log_bound_ = 0.5 * (p - b_) - 0.5 * p * std::log(p / b_);
  }

  Few draw(CounterRng& rng) const {
    if (model_ == LawModel::wrapped_normal) {
      Vector3d v;
      for (Index k = 0; k < 3; ++k) v[k] = deviations_[k] * rng.normal();
      const double angle = v.norm(), sinc = angle > 0 ? std::sin(0.5 * angle) / angle : 0.5;
      return (basis_ * Vector4d(sinc * v[0], sinc * v[1], sinc * v[2], std::cos(0.5 * angle))).normalized();
    }
    const Few x = drawBingham(rng);
    if (model_ == LawModel::bingham || model_ == LawModel::matrix_fisher) return (basis_ * x).normalized();
    const Index d = basis_.cols() - 1;
    const double w = x.head(d).squaredNorm();
    Few y(d + 1);
    // Of headings x[1] may be negative, and the half angle goes once around.
    y.head(d) = 2 * (d == 1 ? x[1] : std::sqrt(std::max(0.0, 1 - w))) * x.head(d);
    y[d] = 1 - 2 * w;
    return (basis_ * y).normalized();
  }

 private:
  Few drawBingham(CounterRng& rng) const {
    const Index p = mu_.size();
    Few x(p);
    for (;;) {
      for (Index k = 0; k < p; ++k) x[k] = rng.normal() / std::sqrt(omega_[k]);
      x /= x.norm();
      const double log_ratio =
          -x.cwiseAbs2().dot(mu_) + 0.5 * static_cast<double>(p) * std::log(x.cwiseAbs2().dot(omega_)) + log_bound_;
      if (std::log(rng.uniform()) <= log_ratio) return x;
    }
  }

  LawModel model_;
  MatrixXd basis_;
  Few mu_, deviations_, omega_;
  double b_ = 1, log_bound_ = 0;
};

/// Third and fourth moments of standardised coordinates y about those of the law, contracted: y_i (r² - d - 2), and
/// y_i y_j (r² - d - 4) - δ_ij (r² - d - 2), which are orthogonal to the scores where the law is nearly normal; of vmf also
/// the second moments that are no score. The span of these does not depend on the choice of axes. Behind them stand
/// y_i³ - 3 y_i and y_i⁴ - 6 y_i² + 3 of each axis: a second population lies along one.
class Moments {
 public:
  explicit Moments(const Core& core) : core_(core), d_(dofOf(core.law.model)) {
    const LawModel model = core.law.model;
    expected_ = VectorXd::Zero(size());
    if (model == LawModel::wrapped_normal) return;
    const BinghamMoments m = binghamMoments(designOf(model).design * core.nu);
    Index at = d_;
    for (Index i = 0; i < d_; ++i) {
      for (Index j = i; j < d_; ++j, ++at) {
        if (i != j) continue;
        double sum = 0;
        for (Index k = 0; k < d_; ++k) sum += m.fourth(i, k) / (core.tau[i] * core.tau[k]);
        expected_[at] = sum - static_cast<double>(d_ + 2);
      }
      expected_[omnibus() + 2 * i + 1] = m.fourth(i, i) / (core.tau[i] * core.tau[i]) - 3;
    }
  }

  Index size() const { return omnibus() + 2 * d_; }
  Index omnibus() const { return d_ + d_ * (d_ + 1) / 2 + (core_.law.model == LawModel::vmf ? 2 : 0); }
  Index scores() const { return core_.law.model == LawModel::vmf ? d_ + 1 : d_ + d_ * (d_ + 1) / 2; }

  /// Adds the moments and scores of one feature, given by its coordinates or its log, less those of the law.
  void add(const Few& x, Eigen::Ref<VectorXd> moments, Eigen::Ref<VectorXd> scores) const {
    moments -= expected_;
    if (core_.law.model != LawModel::wrapped_normal) {
      return addAt(1, (x.head(d_).array() / core_.tau.head(d_).array().sqrt()).matrix(), x[d_], moments, scores);
    }
    const MatrixXd precision = core_.law.axes * core_.tau.cwiseInverse().asDiagonal();
    const MatrixXd back = core_.law.axes * core_.tau.asDiagonal();
    visitTurns(core_.law.axes, Vector3d(core_.tau), Vector3d(x),
               [&](double weight, const Vector3d& z, double angle, const Vector3d& u) {
                 Eigen::Matrix<double, 9, 1> none = Eigen::Matrix<double, 9, 1>::Zero();
                 addAt(weight, z, 1, moments, none);
                 none.head(3) = weight * back.transpose() * modeScore(precision * z, back * z, angle, u);
                 for (Index i = 0, at = 3; i < 3; ++i) {
                   for (Index j = i; j < 3; ++j, ++at)
                     none[at] = weight * (i == j ? 0.5 * (z[i] * z[i] - 1) : z[i] * z[j]);
                 }
                 scores += none;
               });
  }

  /// The mean of the moments over the features of the fit, whose scores add up to zero.
  VectorXd mean() const {
    VectorXd sum = VectorXd::Zero(size()), scores_sum = VectorXd::Zero(scores());
    for (Index i = 0; i < core_.x.rows(); ++i) add(core_.x.row(i).transpose(), sum, scores_sum);
    return sum / static_cast<double>(core_.x.rows());
  }

 private:
  void addAt(double weight, const Few& y, double last, Eigen::Ref<VectorXd> moments,
             Eigen::Ref<VectorXd> scores) const {
    const double r2 = y.squaredNorm(), k = static_cast<double>(d_);
    moments.head(d_) += weight * last * (r2 - k - 2) * y;
    scores.head(d_) += weight * last * y;
    Index at = d_;
    const bool vmf = core_.law.model == LawModel::vmf;
    for (Index i = 0; i < d_; ++i) {
      for (Index j = i; j < d_; ++j, ++at) {
        moments[at] += weight * (y[i] * y[j] * (r2 - k - 4) - (i == j ? r2 - k - 2 : 0));
        if (!vmf) scores[at] += weight * y[i] * y[j];
      }
    }
    if (vmf) {
      scores[d_] += weight * r2;
      moments[at] += weight * (y[0] * y[0] - y[1] * y[1]), moments[at + 1] += weight * 2 * y[0] * y[1];
    }
    for (Index i = 0; i < d_; ++i) {
      const double y2 = y[i] * y[i];
      moments[omnibus() + 2 * i] += weight * last * y[i] * (y2 - 3);
      moments[omnibus() + 2 * i + 1] += weight * (y2 * (y2 - 6) + 3);
    }
  }

  const Core& core_;
  Index d_;
  VectorXd expected_;
};

/// The sizes of the standardised coordinates along each axis, ascending; `x` holds coordinates, or logs, in rows.
std::vector<std::vector<double>> sortedSizes(const Core& core, const MatrixXd& x) {
  std::vector<std::vector<double>> sizes;
  for (Index i = 0; i < dofOf(core.law.model); ++i) {
    const bool wrapped = core.law.model == LawModel::wrapped_normal;
    const VectorXd y =
        wrapped ? VectorXd(x * core.law.axes.col(i) / core.tau[i]) : VectorXd(x.col(i) / std::sqrt(core.tau[i]));
    std::vector<double>& list = sizes.emplace_back();
    for (const double value : y) list.push_back(std::abs(value));
    std::sort(list.begin(), list.end());
  }
  return sizes;
}

/// Kolmogorov's and Smirnov's largest difference of the distributions of two ascending samples.
double largestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    (a[i] <= b[j] ? i : j) += 1;
    largest = std::max(largest, std::abs(static_cast<double>(i) / static_cast<double>(a.size()) -
                                         static_cast<double>(j) / static_cast<double>(b.size())));
  }
  return largest;
}

/// The covariances of moments, less what the fit takes of them, and of scores, by a sample of the law, and its sizes.
struct Reference {
  MatrixXd moments, information;
  std::vector<std::vector<double>> sizes;

  Reference(const Core& core, std::uint64_t seed) {
    const Index draws = core.law.model == LawModel::wrapped_normal ? 20000 : 5000;
    const Moments judge(core);
    const Sampler sampler(core.law);
    const MatrixXd basis = basisOf(core.law);
    MatrixXd h = MatrixXd::Zero(judge.size(), draws), s = MatrixXd::Zero(judge.scores(), draws);
    MatrixXd all(draws, core.x.cols());
    CounterRng rng(seed, 0);
    for (Index i = 0; i < draws; ++i) {
      Few x = coordinates(core.law.model, basis, sampler.draw(rng));
      if (core.law.model == LawModel::wrapped_normal) x = core.law.axes * logOf(x);
      judge.add(x, h.col(i), s.col(i));
      all.row(i) = x.transpose();
    }
    sizes = sortedSizes(core, all);
    s.colwise() -= VectorXd(s.rowwise().mean());
    h.colwise() -= VectorXd(h.rowwise().mean());
    information = s * s.transpose() / static_cast<double>(draws);
    h -= (h * s.transpose() / static_cast<double>(draws)) * detail::solvedDefinite(information, s);
    moments = h * h.transpose() / static_cast<double>(draws);
  }
};

double lawDistance(const VectorXd& mean, const MatrixXd& covariance, double n) {
  return n * mean.dot(detail::solvedDefinite(covariance, mean).col(0));
}

/// Statistics of misfit: χ² of all moments together, the largest of third and of fourth moments along an axis, the largest
/// difference of distributions of sizes along one, and of vmf second moments, which tell ovals. They are judged apart, for
/// the fourth moments' heavy tails in small samples would hide the others.
struct Misfit {
  VectorXd statistics, p;  ///< p as in large samples

  Misfit(const Core& core, const Reference& reference) {
    const Moments moments(core);
    const bool vmf = core.law.model == LawModel::vmf;
    const VectorXd mean = moments.mean();
    const double n = static_cast<double>(core.x.rows());
    const Index m = moments.omnibus(), d = dofOf(core.law.model);
    statistics = p = VectorXd::Zero(vmf ? 5 : 4);
    statistics[0] = lawDistance(mean.head(m), reference.moments.topLeftCorner(m, m), n);
    for (Index i = m; i < moments.size(); ++i) {
      double& largest = statistics[1 + (i - m) % 2];
      largest = std::max(largest, n * mean[i] * mean[i] / reference.moments(i, i));
    }
    const std::vector<std::vector<double>> sizes = sortedSizes(core, core.x);
    const double drawn = static_cast<double>(reference.sizes[0].size());
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const double difference = largestDifference(sizes[i], reference.sizes[i]);
      statistics[3] = std::max(statistics[3], n * drawn / (n + drawn) * difference * difference);
    }
    if (vmf) statistics[4] = lawDistance(mean.segment(m - 2, 2), reference.moments.block(m - 2, m - 2, 2, 2), n);
    const double axes = static_cast<double>(d);
    p[0] = detail::chiSquaredTail(statistics[0], static_cast<std::size_t>(m));
    p[1] = axes * detail::chiSquaredTail(statistics[1], 1), p[2] = axes * detail::chiSquaredTail(statistics[2], 1);
    // Smirnov's law is that of a law that was not fitted, which makes it larger.
    p[3] = axes * 2 * std::exp(-2 * statistics[3]);
    if (vmf) p[4] = detail::chiSquaredTail(statistics[4], 2);
  }
};

void testGoodness(const Core& core, const Reference& reference, const LawFitOptions& options, LawFit& fit) {
  const Misfit found(core, reference);
  fit.goodness.statistic = found.statistics[0];
  fit.goodness.degrees_of_freedom = static_cast<int>(Moments(core).omnibus());
  if (core.law.model == LawModel::vmf) fit.symmetry = {found.statistics[4], 2, found.p[4]};
  const Index kinds = found.statistics.size();
  VectorXd p = found.p, above = VectorXd::Zero(kinds);
  if (fit.n < options.bootstrap_below) {
    // Besag and Clifford 1991: the draws end once each p is known to a fifth of itself; or once a statistic is far beyond
    // all of many draws, whose p is then taken for that of the last draw.
    constexpr std::size_t most = 5999, many = 500;
    constexpr double enough = 25, far = 4;
    const Sampler sampler(core.law);
    MatrixXd features(static_cast<Index>(fit.n), parametersOf(core.law.model));
    VectorXd largest = VectorXd::Zero(kinds);
    bool sure = false;
    while (fit.replicates < most && above.minCoeff() < enough && !sure) {
      CounterRng rng(options.seed, ++fit.replicates);
      for (Index i = 0; i < features.rows(); ++i) features.row(i) = sampler.draw(rng).transpose();
      const Core again = fitCore(core.law.model, features, false, 1e-6);
      if (!again.bounded) {
        above.array() += 1;
        continue;
      }
      const Misfit drawn(again, reference);
      largest = largest.cwiseMax(drawn.statistics);
      for (Index k = 0; k < kinds; ++k) above[k] += drawn.statistics[k] < found.statistics[k] ? 0 : 1;
      sure = fit.replicates >= many && (found.statistics - far * largest).maxCoeff() > 0;
    }
    p = (above.array() + 1).matrix() / static_cast<double>(fit.replicates + 1);
    for (Index k = 0; k < kinds; ++k) {
      if (sure && found.statistics[k] > far * largest[k]) p[k] = 1 / static_cast<double>(most + 1);
    }
  }
  fit.goodness.p = std::min(1.0, static_cast<double>(kinds) * p.minCoeff());
}

LawTest likelihoodRatio(double more, double less, double factor, int dof) {
  LawTest test{std::max(0.0, 2 * factor * (more - less)), dof};
  test.p = detail::chiSquaredTail(test.statistic, static_cast<std::size_t>(dof));
  return test;
}

void testSpecialCases(const Core& core, const MatrixXd& features, LawFit& fit) {
  const LawModel model = core.law.model;
  const double n = static_cast<double>(fit.n);
  const int d = dofOf(model);
  if (model == LawModel::wrapped_normal) {
    const Core fisher = fitCore(LawModel::matrix_fisher, features);
    fit.uniformity = likelihoodRatio(fisher.log_likelihood, 0, 1, 9);
    const Core isotropic = fitCore(model, features, true);
    fit.symmetry = likelihoodRatio(core.log_likelihood, isotropic.log_likelihood, (n - 41.0 / 18) / n, 5);
    return;
  }
  const int parameters = d + static_cast<int>(core.nu.size()) +
                         (model == LawModel::bingham         ? 1
                          : model == LawModel::matrix_fisher ? 3
                                                             : 0);
  fit.uniformity = likelihoodRatio(core.log_likelihood, 0, 1, parameters);
  if (core.nu.size() < 2) return;
  const Design special = designOf(model, true, core.girdle);
  const VectorXd t = special.design.transpose() * core.tau;
  const double less = logLikelihood(special.design, solveConcentrations(special.design, t), t, n);
  // Box's factor of a test of sphericity, which this is where the law is nearly normal.
  const double k = d, factor = (n - 1 - (2 * k * k + k + 2) / (6 * k)) / n;
  fit.symmetry = likelihoodRatio(core.log_likelihood, less, core.girdle ? 1 : factor, d * (d + 1) / 2 - 1);
  if (model != LawModel::bingham) return;
  // A pole is that of axes that are no symmetric cluster, and a mode that of axes that are no symmetric girdle.
  const Design other = designOf(model, true, !core.girdle);
  const VectorXd s = other.design.transpose() * core.tau;
  const double least = logLikelihood(other.design, solveConcentrations(other.design, s), s, n);
  fit.kind = likelihoodRatio(core.log_likelihood, least, factor, 2);
}

/// Adds to the covariance of several κ the outer product of their bias: that of maximum likelihood, 3 κ/n, and that of
/// sorting. As eigenvalues of a matrix κ repel each other where they differ by less than a few standard deviations of the
/// element off the diagonal, whose variances v are given: the squared gap of two equal ones is 4 v χ²₂, of which three
/// quarters are below 12 v. The bias is that of a truth whose squared gap is less by this.
void widenByBias(const VectorXd& kappa, const MatrixXd& variances, double n, MatrixXd& covariance) {
  VectorXd bias = 3 / n * kappa;
  for (Index i = 0; i < kappa.size(); ++i) {
    for (Index j = i + 1; j < kappa.size(); ++j) {
      const double gap = kappa[i] - kappa[j];
      const double shift = 0.5 * (gap - std::sqrt(std::max(0.0, gap * gap - 12 * variances(i, j))));
      bias[i] += shift, bias[j] -= shift;
    }
  }
  covariance += bias * bias.transpose();
}

/// Covariances of κ and of the location, and the region of the location.
void setCovariances(const Core& core, const Reference& reference, LawFit& fit) {
  const LawModel model = core.law.model;
  const double n = static_cast<double>(fit.n), of_residuals = n / (n - (core.girdle ? 2 : 1));
  const int d = dofOf(model);
  const VectorXd& tau = core.tau;
  MatrixXd directions = MatrixXd::Identity(d, d);
  VectorXd variances(d);
  if (model == LawModel::wrapped_normal) {
    const MatrixXd inverse = inverseOf(reference.information) / n;
    const std::array<Index, 3> diagonal{3, 6, 8};
    fit.kappa_covariance.resize(3, 3);
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) {
        fit.kappa_covariance(i, j) =
            core.law.kappa[i] * core.law.kappa[j] *
            inverse(diagonal[static_cast<std::size_t>(i)], diagonal[static_cast<std::size_t>(j)]);
      }
    }
    MatrixXd across = MatrixXd::Zero(3, 3);
    across(0, 1) = inverse(4, 4), across(0, 2) = inverse(5, 5), across(1, 2) = inverse(7, 7);
    widenByBias(core.law.kappa, across.cwiseProduct(core.law.kappa * core.law.kappa.transpose()), n,
                fit.kappa_covariance);
    const MatrixXd back = core.law.axes * tau.asDiagonal();
    const detail::SymmetricEigen<MatrixXd> eigen(MatrixXd(back * inverse.topLeftCorner(3, 3) * back.transpose()));
    directions = eigen.vectors, variances = of_residuals * eigen.values;
  } else {
    const Design design = designOf(model);
    const VectorXd mu = design.design * core.nu;
    const BinghamMoments m = binghamMoments(mu);
    const MatrixXd squares = design.design.transpose() * (m.fourth - m.second * m.second.transpose()) * design.design;
    // Scaled, for variances of squares differ by twenty orders of magnitude.
    const VectorXd scale = squares.diagonal().cwiseSqrt().cwiseInverse();
    const MatrixXd correlation = scale.asDiagonal() * squares * scale.asDiagonal();
    fit.kappa_covariance =
        design.factor * design.factor / n * MatrixXd(scale.asDiagonal() * inverseOf(correlation) * scale.asDiagonal());
    if (core.nu.size() > 1) {
      const MatrixXd across = design.factor * design.factor / (4 * n) * m.fourth.cwiseInverse();
      widenByBias(core.law.kappa, across, n, fit.kappa_covariance);
    }
    if (model == LawModel::vmf || model == LawModel::von_mises) {
      fit.mean_resultant = 1 - 2 * core.x.leftCols(d).squaredNorm() / n;
      variances.setConstant(of_residuals / (n * core.law.kappa[0] * fit.mean_resultant));
    } else if (model == LawModel::matrix_fisher) {
      directions = core.law.axes;
      for (Index i = 0; i < 3; ++i) variances[i] = of_residuals * 2 / (n * mu[i] * (tau[3] - tau[i]));
    } else {
      const Index pole = core.girdle ? 0 : 2, one = core.girdle ? 1 : 0, other = core.girdle ? 2 : 1;
      const Eigen::Matrix<double, 3, 2> frame =
          ManifoldTraits<S2d>::placement(S2d(Vector3d(core.law.location))).matrix().leftCols<2>();
      directions.col(0) = frame.transpose() * core.law.axes.col(one);
      directions.col(1) = frame.transpose() * core.law.axes.col(other);
      const auto variance = [&](Index i) { return of_residuals / (2 * n * (mu[i] - mu[pole]) * (tau[pole] - tau[i])); };
      variances << variance(one), variance(other);
    }
  }
  // Fits of nearly uniform features that pass for a law are those whose features lie closer together than it has them.
  constexpr double chosen = 3.4;
  const double unselected = 1 - std::min(chosen / fit.uniformity.statistic, 0.5);
  variances /= unselected;
  fit.location_covariance = directions * variances.asDiagonal() * directions.transpose();
  if (model == LawModel::vmf) {
    // Given R the mean direction has Fisher's law with κ R; where that is large this is Fisher's α95.
    const double pull = unselected * core.law.kappa[0] * n * fit.mean_resultant;
    const double half_square = 0.5 * n * std::expm1(std::log(20) / (n - 1)) / pull;
    fit.confidence_angles = {half_square < 1 ? 2 * std::asin(std::sqrt(half_square)) : pi};
    return;
  }
  const double threshold = detail::whereTail(0.05, [&](double t2) { return detail::hotellingTail(t2, d, n); });
  for (const double variance : variances)
    fit.confidence_angles.push_back(std::min(pi, std::sqrt(threshold * variance)));
  std::sort(fit.confidence_angles.rbegin(), fit.confidence_angles.rend());
}

void judge(LawFit& fit) {
  constexpr double located = 0.7, uniform_level = 0.01;
  if (fit.goodness.p < refutation_level) {
    fit.status = Status::inconsistent;
    fit.reason = "the features refute the law: their moments are not its";
  } else if (!(fit.uniformity.p < uniform_level)) {
    fit.status = Status::ill_defined;
    fit.reason = "uniform features would look like these in one case of a hundred or more";
  } else if (fit.kind.p > uniform_level) {
    fit.status = Status::ill_defined;
    fit.reason = "the axes do not tell a girdle from a cluster: the location may be a pole or a mode";
  } else if (!(fit.alpha95() < located)) {
    fit.status = Status::ill_defined;
    fit.reason =
        "the features leave the location open: the law is nearly symmetric about another axis, or they are too few";
  } else {
    fit.status = Status::ok;
  }
}

}  // namespace

BinghamMoments binghamMoments(const VectorXd& mu) {
  // Γ(p/2)/(2πi) ∫ e^s Π (s + μ_i)^(-1/2) ds: Laplace's inversion takes Gaussian integrals to those over the sphere. Singular
  // points lie on the negative axis, whatever μ is; on a parabola about it the trapezoidal rule converges geometrically
  // (Weideman and Trefethen 2007), and no sum cancels.
  constexpr double vertex = 3, step = 0.15;
  constexpr int nodes = 26;
  const Index p = mu.size();
  BinghamMoments m{0, VectorXd::Zero(p), MatrixXd::Zero(p, p)};
  double sum = 0;
  std::array<std::complex<double>, 4> inverse;
  for (int k = 0; k < nodes; ++k) {
    const double u = (k + 0.5) * step;
    const std::complex<double> root(1, u), s = vertex * root * root;
    std::complex<double> f = std::exp(s) * root;
    for (Index i = 0; i < p; ++i) {
      inverse[static_cast<std::size_t>(i)] = 1.0 / (s + mu[i]);
      f /= std::sqrt(s + mu[i]);
    }
    sum += f.real();
    for (Index i = 0; i < p; ++i) {
      const std::complex<double> once = f * inverse[static_cast<std::size_t>(i)];
      m.second[i] += 0.5 * once.real();
      for (Index j = 0; j <= i; ++j)
        m.fourth(i, j) += (i == j ? 0.75 : 0.25) * (once * inverse[static_cast<std::size_t>(j)]).real();
    }
  }
  m.log_constant = std::log(2 * vertex * step / pi * sum) + std::lgamma(0.5 * static_cast<double>(p));
  m.second /= sum, m.fourth /= sum;
  m.fourth.triangularView<Eigen::StrictlyUpper>() = m.fourth.transpose();
  return m;
}

VectorXd DirectionalLaw::sample(CounterRng& rng) const { return Sampler(*this).draw(rng); }

LawFit fitLaw(LawModel model, const Eigen::Ref<const MatrixXd>& features, const LawFitOptions& options) {
  LawFit fit;
  fit.n = static_cast<std::size_t>(features.rows());
  fit.law.model = model;
  const std::size_t least = isRotation(model) ? 18 : 10;
  if (features.cols() != parametersOf(model) || !features.allFinite()) {
    fit.status = Status::not_applicable;
    fit.reason = "the law is one of other features, or a number is not finite";
    return fit;
  }
  if (fit.n < least) {
    fit.reason = "there are " + std::to_string(fit.n) + " features, and the law needs " + std::to_string(least);
    return fit;
  }
  MatrixXd rows = features;
  for (Index i = 0; i < rows.rows(); ++i) {
    const double norm = rows.row(i).norm();
    if (!(std::abs(norm - 1) < 1e-6)) {
      fit.status = Status::not_applicable;
      fit.reason = "row " + std::to_string(i + 1) + " is not of length one";
      return fit;
    }
  }
  const RepeatedRows repeated = repeatedRows(
      fit.n, dofOf(model), [&](std::size_t i) { return Few(features.row(static_cast<Index>(i)).transpose()); });
  const Core core = fitCore(model, rows);
  fit.law = core.law, fit.girdle = core.girdle, fit.log_likelihood = core.log_likelihood;
  fit.names =
      core.law.kappa.size() == 1 ? std::vector<std::string>{"kappa"} : std::vector<std::string>{"kappa_1", "kappa_2"};
  if (isRotation(model)) fit.names.emplace_back("kappa_3");
  if (!core.bounded || !core.settled) {
    fit.status = core.bounded ? Status::not_converged : Status::ill_defined;
    fit.reason = core.bounded ? "the iteration did not converge: the features are nearly uniform"
                              : "the features are equal, or on one circle, to rounding: a concentration has no bound";
    return fit;
  }
  const Reference reference(core, options.seed);
  testGoodness(core, reference, options, fit);
  testSpecialCases(core, rows, fit);
  setCovariances(core, reference, fit);
  judge(fit);
  if (repeated.matters)
    fit.status = Status::inconsistent, fit.reason = repeated.inWords() + ": they are not independent";
  return fit;
}

Verdict LawFit::verdict() const {
  const std::string what = name(law.model);
  const std::string tested = "goodness of fit p " + significant(goodness.p, 2);
  if (ok()) return Verdict::yes("the features follow the law " + what + ": " + tested);
  if (status == Status::too_few) return Verdict::none("no law " + what + " with a covariance: " + reason);
  return Verdict::no("no law " + what + " with a covariance: " + reason +
                     (status == Status::inconsistent ? " (" + tested + ")" : ""));
}

}  // namespace liestat
