// The fits of stats/fits.hpp: starts by linear least squares, then the constrained estimate.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/jet.hpp>
#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>
#include <stats/fit_models.hpp>
#include <stats/fits.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {
namespace detail {

template <int N>
using FitVector = Eigen::Matrix<double, N, 1>;

/// Coordinates about the centroid in units of the spread: in them equations are as well conditioned as points allow.
template <int D>
struct PointFrame {
  FitVector<D> centre = FitVector<D>::Zero();
  double scale = 1;  ///< of the new coordinates over the old ones

  template <class Points>
  explicit PointFrame(const Points& points) {
    for (const auto& m : points) centre += m;
    if (!points.empty()) centre /= static_cast<double>(points.size());
    double squares = 0;
    for (const auto& m : points) squares += (m - centre).squaredNorm();
    const double spread = std::sqrt(squares / static_cast<double>(points.size()));
    if (spread > 0 && std::isfinite(spread)) scale = 1 / spread;
  }
  FitVector<D> operator()(const FitVector<D>& m) const { return scale * (m - centre); }
};

/// The vector of least ‖A q‖ of unit length; rows(i) is a row of A, `count` of them.
template <int N, class Rows>
FitVector<N> leastSingularVector(std::size_t count, const Rows& rows) {
  Eigen::Matrix<double, N, N> sum = Eigen::Matrix<double, N, N>::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const FitVector<N> row = rows(i);
    sum += row * row.transpose();
  }
  return SymmetricEigen(sum).vectors.col(0);
}

/// The estimate from `start`, with the sigma of the residuals where none is stated: the first estimate's, for the
/// second.
template <int N, int D, class Equation, class Constraint>
Fit<N> fitted(const std::vector<FitVector<D>>& points, double scale, const std::optional<double>& sigma,
              const FitVector<N>& start, const Equation& equation, const Constraint& constraint,
              const FitOptions& options) {
  Fit<N> fit;
  double used = sigma ? *sigma * scale : 1e-3;
  for (const bool last : {sigma.has_value(), true}) {
    ConstrainedOptions<FitVector<N>> how;
    how.max_iterations = options.max_iterations;
    how.noise = sigma ? options.noise : StatedNoise::trusted;
    const auto channel = measurements(points, IsotropicNoise<D>(used), equation);
    ConstrainedEstimator estimator(start, constraint, how, channel);
    while (estimator.iterate()) {
    }
    const ConstrainedResult<FitVector<N>>& found = estimator.result();
    fit.distances.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      fit.distances.push_back(estimator.correction(i).norm() / scale);
    }
    fit.relative_curvature = found.relative_curvature, fit.widening = found.widening;
    fit.end = found.end;
    fit.parameter = found.parameter;
    fit.covariance = found.covariance;
    fit.sigma = used / scale;
    fit.chi2 = found.chi2;
    fit.degrees_of_freedom = found.degrees_of_freedom;
    if (sigma) fit.fit_p = found.fit_p;
    fit.iterations = found.iterations;
    if (last) break;
    if (!(found.degrees_of_freedom > 0)) {
      // As many points as unknowns: no residual says how large the noise is.
      if (fit.end == ConstrainedEnd::converged) fit.end = ConstrainedEnd::too_few;
      break;
    }
    const double factor = std::sqrt(found.varianceFactor());
    if (!(factor > 0) || !std::isfinite(factor)) break;
    used *= factor;
  }
  if (fit.end != ConstrainedEnd::converged) fit.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  return fit;
}

/// The same parameter in other coordinates, f(q), with its covariance.
template <int M, int N, class F>
Fit<M> mapped(const Fit<N>& fit, const F& f) {
  using J = Jet<double, N>;
  Eigen::Matrix<J, N, 1> q;
  for (int i = 0; i < N; ++i) q[i] = J(fit.parameter[i], i);
  const Eigen::Matrix<J, M, 1> y = f(q);
  Eigen::Matrix<double, M, N> D;
  Fit<M> result;
  for (int i = 0; i < M; ++i) result.parameter[i] = y[i].a, D.row(i) = y[i].v.transpose();
  result.covariance = congruence(D, fit.covariance);
  result.end = fit.end, result.sigma = fit.sigma, result.chi2 = fit.chi2, result.fit_p = fit.fit_p;
  result.degrees_of_freedom = fit.degrees_of_freedom, result.iterations = fit.iterations;
  result.relative_curvature = fit.relative_curvature, result.widening = fit.widening;
  result.distances = fit.distances;
  return result;
}

/// Unit length, and the sign that makes `positive` of it positive.
template <class Vector, class Positive>
Vector normalised(Vector q, const Positive& positive) {
  using std::sqrt;
  auto squares = q[0] * q[0];
  for (int i = 1; i < q.size(); ++i) squares += q[i] * q[i];
  auto factor = sqrt(squares);
  if (positive(q) < 0.0) factor = -factor;
  for (int i = 0; i < q.size(); ++i) q[i] = q[i] / factor;
  return q;
}
template <class Vector>
auto largestEntry(const Vector& q) {
  int k = 0;
  for (int i = 1; i < q.size(); ++i) {
    if (std::abs(q[i].a) > std::abs(q[k].a)) k = i;
  }
  return q[k];
}

template <int D, class Points>
std::vector<FitVector<D>> inFrame(const Points& points, const PointFrame<D>& frame) {
  std::vector<FitVector<D>> list;
  for (const auto& m : points) list.push_back(frame(m));
  return list;
}

template <int D, class Points>
Fit<D + 1> sphereFit(const Points& points, const std::optional<double>& sigma, const FitOptions& options) {
  const PointFrame<D> frame(points);
  const auto list = inFrame(points, frame);
  // w ‖m‖² + b·m + e = 0; about the centroid a flat arc has w near zero.
  const FitVector<D + 2> linear = leastSingularVector<D + 2>(list.size(), [&](std::size_t i) {
    FitVector<D + 2> row;
    row << list[i].squaredNorm(), list[i], 1;
    return row;
  });
  const double w = std::abs(linear[0]) > 1e-9 ? linear[0] : std::copysign(1e-9, linear[0]);
  FitVector<D + 1> start;
  start.template head<D>() = linear.template segment<D>(1) / (-2 * w);
  start[D] = std::sqrt(std::max(1e-12, start.template head<D>().squaredNorm() - linear[D + 1] / w));
  const auto fit =
      fitted<D + 1, D>(list, frame.scale, sigma, start, autoDiff(SphereEquation<D>{}), NoConstraint{}, options);
  return mapped<D + 1>(fit, [&](auto q) {
    for (int i = 0; i <= D; ++i) q[i] = q[i] / frame.scale + (i < D ? frame.centre[i] : 0.0);
    if (q[D] < 0.0) q[D] = -q[D];
    return q;
  });
}

template <int D, class Points>
Fit<D + 1> hyperplaneFit(const Points& points, const std::optional<double>& sigma, const FitOptions& options) {
  const PointFrame<D> frame(points);
  const auto list = inFrame(points, frame);
  FitVector<D + 1> start = FitVector<D + 1>::Zero();
  start.template head<D>() = leastSingularVector<D>(list.size(), [&](std::size_t i) { return list[i]; });
  const auto fit = fitted<D + 1, D>(list, frame.scale, sigma, start, autoDiff(HyperplaneEquation<D>{}),
                                    autoDiff(UnitNormal<D>{}), options);
  return mapped<D + 1>(fit, [&](auto q) {
    q[D] = q[D] / frame.scale;
    for (int i = 0; i < D; ++i) q[D] -= q[i] * frame.centre[i];
    return q;
  });
}

inline Fit<6> conicFit(Points2 points, const std::optional<double>& sigma, const FitOptions& options,
                       const PointFrame<2>& frame) {
  const auto list = inFrame(points, frame);
  const FitVector<6> start = leastSingularVector<6>(list.size(), [&](std::size_t i) {
    const double x = list[i].x(), y = list[i].y();
    FitVector<6> row;
    row << x * x, x * y, y * y, x, y, 1;
    return row;
  });
  return fitted<6, 2>(list, frame.scale, sigma, start, autoDiff(ConicEquation{}), autoDiff(UnitLength<6>{}), options);
}

/// a = c and b = 0, by χ² of the two together.
inline bool refutesCircle(const Fit<6>& conic) {
  const FitVector<6>& q = conic.parameter;
  const Eigen::Matrix<double, 6, 6>& C = conic.covariance;
  const double u = q[0] - q[2], v = q[1];
  const double uu = C(0, 0) - 2 * C(0, 2) + C(2, 2), uv = C(0, 1) - C(2, 1), vv = C(1, 1);
  // NaN, of 0/0, refutes nothing.
  const double squared = (vv * u * u - 2 * uv * u * v + uu * v * v) / (uu * vv - uv * uv);
  return chiSquaredTail(squared, 2) < circle_level;
}

/// Both images in one scale, so that the noise stays isotropic.
struct MatchFrames {
  PointFrame<2> first, second;
  std::vector<FitVector<4>> list;

  explicit MatchFrames(PointMatches matches) : first(half(matches, 0)), second(half(matches, 2)) {
    first.scale = second.scale = std::sqrt(first.scale * second.scale);
    for (const Eigen::Vector4d& m : matches) {
      FitVector<4> moved;
      moved << first(m.head<2>()), second(m.tail<2>());
      list.push_back(moved);
    }
  }

  static std::vector<FitVector<2>> half(PointMatches matches, int from) {
    std::vector<FitVector<2>> points;
    for (const Eigen::Vector4d& m : matches) points.push_back(m.segment<2>(from));
    return points;
  }
};

/// A B C of 3×3 matrices, the second row by row.
template <class Q>
Q sandwiched(const Eigen::Matrix3d& A, const Q& B, const Eigen::Matrix3d& C) {
  Q result;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      auto sum = B[0] * (A(i, 0) * C(0, j));
      for (int k = 1; k < 9; ++k) sum += B[k] * (A(i, k / 3) * C(k % 3, j));
      result[3 * i + j] = sum;
    }
  }
  return result;
}
inline Eigen::Matrix3d matrixOf(const PointFrame<2>& frame) {
  Eigen::Matrix3d T;
  T << frame.scale, 0, -frame.scale * frame.centre.x(), 0, frame.scale, -frame.scale * frame.centre.y(), 0, 0, 1;
  return T;
}
inline Eigen::Matrix3d inverseOf(const PointFrame<2>& frame) {
  Eigen::Matrix3d T;
  T << 1 / frame.scale, 0, frame.centre.x(), 0, 1 / frame.scale, frame.centre.y(), 0, 0, 1;
  return T;
}

}  // namespace detail

LIESTAT_ESTIMATION_INLINE Fit<3> fitCircle(Points2 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 3) return {};
  return detail::sphereFit<2>(points, sigma, options);
}
LIESTAT_ESTIMATION_INLINE Fit<4> fitSphere(Points3 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 4) return {};
  return detail::sphereFit<3>(points, sigma, options);
}
LIESTAT_ESTIMATION_INLINE Fit<3> fitLine(Points2 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 2) return {};
  return detail::hyperplaneFit<2>(points, sigma, options);
}
LIESTAT_ESTIMATION_INLINE Fit<4> fitPlane(Points3 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 3) return {};
  return detail::hyperplaneFit<3>(points, sigma, options);
}

LIESTAT_ESTIMATION_INLINE Fit<6> fitLine3(Points3 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 2) return {};
  const detail::PointFrame<3> frame(points);
  const auto list = detail::inFrame(points, frame);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& m : list) scatter += m * m.transpose();
  detail::FitVector<6> start = detail::FitVector<6>::Zero();
  start.tail<3>() = detail::SymmetricEigen(scatter).vectors.col(2);
  const auto fit = detail::fitted<6, 3>(list, frame.scale, sigma, start, autoDiff(Line3Equation{}),
                                        autoDiff(Line3Constraint{}), options);
  return detail::mapped<6>(fit, [&](auto q) {
    for (int i = 0; i < 3; ++i) q[i] = q[i] / frame.scale + frame.centre[i];
    const auto along = q[0] * q[3] + q[1] * q[4] + q[2] * q[5];
    for (int i = 0; i < 3; ++i) q[i] -= along * q[3 + i];
    return q;
  });
}

LIESTAT_ESTIMATION_INLINE Fit<6> fitConic(Points2 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 5) return {};
  const detail::PointFrame<2> frame(points);
  const double s = frame.scale, x = frame.centre.x(), y = frame.centre.y();
  return detail::mapped<6>(detail::conicFit(points, sigma, options, frame), [&](const auto& q) {
    // The equation in x' = s (x - x₀), y' = s (y - y₀), written out.
    auto c = q;
    c[0] = q[0] * (s * s), c[1] = q[1] * (s * s), c[2] = q[2] * (s * s);
    c[3] = q[3] * s - c[0] * (2 * x) - c[1] * y;
    c[4] = q[4] * s - c[2] * (2 * y) - c[1] * x;
    c[5] = q[5] - q[3] * (s * x) - q[4] * (s * y) + c[0] * (x * x) + c[1] * (x * y) + c[2] * (y * y);
    return detail::normalised(c, [](const auto& v) { return v[0] + v[2]; });
  });
}

LIESTAT_ESTIMATION_INLINE Fit<5> fitEllipse(Points2 points, std::optional<double> sigma, const FitOptions& options) {
  if (points.size() < 5) return {};
  const detail::PointFrame<2> frame(points);
  const Fit<6> conic = detail::conicFit(points, sigma, options, frame);
  const detail::FitVector<6>& c = conic.parameter;
  const double discriminant = 4 * c[0] * c[2] - c[1] * c[1];
  Fit<5> fit = detail::mapped<5>(conic, [&](const auto& q) {
    using J = std::remove_cvref_t<decltype(q[0])>;
    const J det = q[0] * q[2] * 4.0 - q[1] * q[1];
    const J x = (q[1] * q[4] - q[2] * q[3] * 2.0) / det, y = (q[1] * q[3] - q[0] * q[4] * 2.0) / det;
    // About the centre a x² + b xy + c y² = -g; the eigenvalues of the form are the inverse squares of the semi-axes.
    const J g = q[5] + (q[3] * x + q[4] * y) * 0.5;
    const J mean = (q[0] + q[2]) * 0.5, half = hypot(J((q[0] - q[2]) * 0.5), J(q[1] * 0.5));
    const J sign = mean < 0.0 ? J(-1.0) : J(1.0);
    const J smaller = sign * mean - half, larger = sign * mean + half;
    Eigen::Matrix<J, 5, 1> e;
    e[0] = x / frame.scale + frame.centre.x();
    e[1] = y / frame.scale + frame.centre.y();
    e[2] = sqrt(-sign * g / smaller) / frame.scale;
    e[3] = sqrt(-sign * g / larger) / frame.scale;
    // The longer axis is the eigenvector of the smaller eigenvalue.
    e[4] = atan2(J(-sign * q[1]), J(sign * (q[2] - q[0]))) * 0.5;
    return e;
  });
  if (!fit.ok()) return fit;
  if (!(discriminant > 0) || !fit.parameter.allFinite()) fit.end = ConstrainedEnd::contradictory;
  if (fit.ok() && !detail::refutesCircle(conic)) fit.end = ConstrainedEnd::curved;
  if (!fit.ok()) fit.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  return fit;
}

LIESTAT_ESTIMATION_INLINE Fit<9> fitHomography(PointMatches matches, std::optional<double> sigma,
                                               const FitOptions& options) {
  if (matches.size() < 4) return {};
  const detail::MatchFrames frames(matches);
  const auto& list = frames.list;
  const detail::FitVector<9> start = detail::leastSingularVector<9>(2 * list.size(), [&](std::size_t i) {
    const Eigen::Vector4d& m = list[i / 2];
    const double to = m[2 + static_cast<int>(i % 2)];
    detail::FitVector<9> row = detail::FitVector<9>::Zero();
    const int from = i % 2 == 0 ? 0 : 3;
    row[from] = m[0], row[from + 1] = m[1], row[from + 2] = 1;
    row[6] = -to * m[0], row[7] = -to * m[1], row[8] = -to;
    return row;
  });
  const auto fit = detail::fitted<9, 4>(list, frames.first.scale, sigma, start, autoDiff(HomographyEquation{}),
                                        autoDiff(UnitLength<9>{}), options);
  const Eigen::Matrix3d back = detail::inverseOf(frames.second), there = detail::matrixOf(frames.first);
  return detail::mapped<9>(fit, [&](const auto& h) {
    return detail::normalised(detail::sandwiched(back, h, there),
                              [](const auto& v) { return detail::largestEntry(v); });
  });
}

LIESTAT_ESTIMATION_INLINE Fit<9> fitFundamental(PointMatches matches, std::optional<double> sigma,
                                                const FitOptions& options) {
  if (matches.size() < 8) return {};
  const detail::MatchFrames frames(matches);
  const auto& list = frames.list;
  detail::FitVector<9> start = detail::leastSingularVector<9>(list.size(), [&](std::size_t i) {
    const Eigen::Vector4d& m = list[i];
    detail::FitVector<9> row;
    row << m[2] * m[0], m[2] * m[1], m[2], m[3] * m[0], m[3] * m[1], m[3], m[0], m[1], 1;
    return row;
  });
  // Rank two: without its part along the least right singular vector.
  Eigen::Matrix3d F = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(start.data());
  const Eigen::Vector3d null = detail::SymmetricEigen(Eigen::Matrix3d(F.transpose() * F)).vectors.col(0);
  F -= (F * null) * null.transpose();
  for (int k = 0; k < 9; ++k) start[k] = F(k / 3, k % 3) / F.norm();
  const auto fit = detail::fitted<9, 4>(list, frames.first.scale, sigma, start, autoDiff(EpipolarEquation{}),
                                        autoDiff(FundamentalConstraint{}), options);
  const Eigen::Matrix3d to_second = detail::matrixOf(frames.second).transpose();
  const Eigen::Matrix3d to_first = detail::matrixOf(frames.first);
  return detail::mapped<9>(fit, [&](const auto& f) {
    return detail::normalised(detail::sandwiched(to_second, f, to_first),
                              [](const auto& v) { return detail::largestEntry(v); });
  });
}

}  // namespace liestat
