// The definitions of stats/detail/robust_core.hpp.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/robust_core.hpp>
#include <stats/detail/tail_probabilities.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <type_traits>
#include <vector>

#ifdef LIESTAT_COMPILED_MEANS
#define LIESTAT_MEANS_INLINE
#else
#define LIESTAT_MEANS_INLINE inline
#endif

namespace liestat::detail {

/// Calls f with the size of a part as a constant.
template <class F>
auto withPartSize(int size, const F& f) {
  switch (size) {
    case 1:
      return f(std::integral_constant<int, 1>{});
    case 2:
      return f(std::integral_constant<int, 2>{});
    default:
      eigen_assert(size == 3);
      return f(std::integral_constant<int, 3>{});
  }
}

/// The radius within which a standard normal vector of k dimensions stays with probability p.
inline double normalRadius(int k, double p) {
  return std::sqrt(whereTail(1 - p, [&](double x) { return chiSquaredTail(x, static_cast<std::size_t>(k)); }));
}

inline double medianOf(std::vector<double> x) {
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return x.size() % 2 == 1 ? *middle : 0.5 * (*middle + *std::max_element(x.begin(), middle));
}

/// The loss of one part of the tangent vector.
struct PartLoss {
  RobustLoss kind = RobustLoss::median;
  double limit = 0;  ///< Huber's, rad or m

  double slope(double d) const { return kind == RobustLoss::median ? 1 : std::min(d, limit); }
  double value(double d) const {
    return kind == RobustLoss::median ? d : d < limit ? 0.5 * d * d : limit * (d - 0.5 * limit);
  }
  /// By which a residual of length d is multiplied in the gradient.
  double weight(double d) const { return d > 0 ? slope(d) / d : kind == RobustLoss::median ? 0 : 1; }
};

template <int K>
using PartRows = Eigen::Matrix<double, K, Eigen::Dynamic>;
template <int K>
using PartVector = Eigen::Matrix<double, K, 1>;
template <int K>
using PartMatrix = Eigen::Matrix<double, K, K>;

/// Distances of one part's residuals.
inline std::vector<double> partDistances(const Eigen::MatrixXd& z, const TangentBlock& part) {
  std::vector<double> d(static_cast<std::size_t>(z.cols()));
  for (std::size_t i = 0; i < d.size(); ++i) {
    d[i] = z.col(static_cast<Eigen::Index>(i)).segment(part.begin, part.size).norm();
  }
  return d;
}

/// Residuals that are shorter belong to a datum at the centre.
inline constexpr double at_datum = 1e-14;

/// The iteration's step of one part. Of the median that of Vardi and Zhang; on a line to the median of the residuals.
template <int K>
PartVector<K> robustStep(const PartRows<K>& z, const PartLoss& loss, double precision) {
  const Eigen::Index n = z.cols();
  if constexpr (K == 1) {
    if (loss.kind == RobustLoss::median) {
      return PartVector<K>::Constant(medianOf(std::vector<double>(z.data(), z.data() + n)));
    }
  }
  PartVector<K> pull = PartVector<K>::Zero();
  double sum = 0, here = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double d = z.col(i).norm();
    if (loss.kind == RobustLoss::median && d <= std::max(at_datum, precision)) {
      ++here;
      continue;
    }
    const double w = loss.weight(d);
    pull += w * z.col(i), sum += w;
  }
  if (!(sum > 0)) return PartVector<K>::Zero();
  // Data at the centre hold it with a force of one each.
  const double force = pull.norm(), left = here > 0 ? std::max(0.0, 1 - here / std::max(force, 1e-300)) : 1;
  return left * pull / sum;
}

/// One step of all parts, and the parts of it that are steps to a datum which is the minimum.
inline Eigen::VectorXd robustStep(const RobustData& data, const Eigen::MatrixXd& z, const std::vector<PartLoss>& loss) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(data.dimension);
  for (std::size_t b = 0; b < data.parts.size(); ++b) {
    const TangentBlock& part = data.parts[b];
    withPartSize(part.size, [&](auto size) {
      const PartRows<size> rows = z.middleRows(part.begin, part.size);
      step.segment(part.begin, part.size) = robustStep<size>(rows, loss[b], data.precision);
    });
    if (loss[b].kind != RobustLoss::median || part.size == 1) continue;
    // Weiszfeld's steps towards a datum become ever shorter: once one is near, whether it is the minimum is asked
    // there.
    const std::vector<double> d = partDistances(z, part);
    const auto nearest = static_cast<Eigen::Index>(std::min_element(d.begin(), d.end()) - d.begin());
    const double least = d[static_cast<std::size_t>(nearest)];
    if (least <= std::max(at_datum, data.precision) || !(least < 20 * step.segment(part.begin, part.size).norm())) {
      continue;
    }
    Eigen::VectorXd there = Eigen::VectorXd::Zero(data.dimension);
    there.segment(part.begin, part.size) = z.col(nearest).segment(part.begin, part.size);
    Eigen::MatrixXd about;
    data.residuals(there, 1, about);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(part.size);
    double here = 0;
    for (Eigen::Index i = 0; i < about.cols(); ++i) {
      const auto r = about.col(i).segment(part.begin, part.size);
      const double length = r.norm();
      if (length <= std::max(at_datum, data.precision)) {
        ++here;
      } else {
        pull += r / length;
      }
    }
    if (pull.norm() <= here) step.segment(part.begin, part.size) = there.segment(part.begin, part.size);
  }
  return step;
}

/// Iterates to the minimum; false if it is not reached.
inline bool robustIterate(RobustData& data, const std::vector<PartLoss>& loss, int most, RobustCentre& result) {
  Eigen::MatrixXd z;
  for (int i = 0; i < most; ++i) {
    data.residuals(Eigen::VectorXd::Zero(data.dimension), 1, z);
    const Eigen::VectorXd step = robustStep(data, z, loss);
    result.residual = step.norm();
    if (!std::isfinite(result.residual)) return false;
    data.move(step);
    ++result.iterations;
    if (result.residual <= result.tolerance) return true;
  }
  return false;
}

/// So many of the data at most, evenly, as starts.
inline std::vector<Eigen::Index> someOf(std::size_t n, std::size_t most) {
  std::vector<Eigen::Index> some;
  const std::size_t m = std::min(n, most);
  for (std::size_t j = 0; j < m; ++j) some.push_back(static_cast<Eigen::Index>(j * n / m));
  return some;
}

/// Moves each part to the datum about which the sum of distances is least, if one is better than the start.
inline void bestStart(RobustData& data) {
  const std::size_t stride = 1 + data.n / 1000;
  Eigen::MatrixXd z, about;
  data.residuals(Eigen::VectorXd::Zero(data.dimension), 1, z);
  const auto cost = [&](const Eigen::MatrixXd& residuals, const TangentBlock& part) {
    double sum = 0;
    for (Eigen::Index i = 0; i < residuals.cols(); ++i) {
      sum += residuals.col(i).segment(part.begin, part.size).norm();
    }
    return sum;
  };
  Eigen::VectorXd best = Eigen::VectorXd::Zero(data.dimension);
  data.residuals(best, stride, about);
  std::vector<double> least;
  for (const TangentBlock& part : data.parts) least.push_back(cost(about, part));
  for (const Eigen::Index j : someOf(data.n, 24)) {
    data.residuals(z.col(j), stride, about);
    for (std::size_t b = 0; b < data.parts.size(); ++b) {
      const TangentBlock& part = data.parts[b];
      if (const double c = cost(about, part); c < least[b]) {
        least[b] = c, best.segment(part.begin, part.size) = z.col(j).segment(part.begin, part.size);
      }
    }
  }
  data.move(best);
}

/// The slope of a part's gradient averaged over displacements N(0, L Lᵀ): data at kinks and near cut loci count by
/// their effect on the gradient (stats/averaged_hessian.hpp).
template <int K>
PartMatrix<K> averagedSlope(const RobustData& data, const TangentBlock& part, const PartLoss& loss,
                            const PartMatrix<K>& L) {
  const std::size_t stride = (data.n + max_averaged - 1) / max_averaged;
  Eigen::MatrixXd z;
  Eigen::VectorXd v = Eigen::VectorXd::Zero(data.dimension);
  const PartMatrix<K> slope = averagedDerivative<K, K>(L, [&](const PartVector<K>& step) -> PartVector<K> {
    v.segment<K>(part.begin) = step;
    data.residuals(v, stride, z);
    PartVector<K> gradient = PartVector<K>::Zero();
    for (Eigen::Index i = 0; i < z.cols(); ++i) {
      const auto r = z.col(i).template segment<K>(part.begin);
      gradient -= loss.weight(r.norm()) * r;
    }
    return gradient;
  });
  const auto used = (data.n + stride - 1) / stride;
  const double all = static_cast<double>(data.n) / static_cast<double>(used);
  return 0.5 * all * (slope + slope.transpose());
}

/// Tukey's estimate of the bulk of a part's residuals, by Mahalanobis distances of the shape of those 60 % that are
/// nearest by them (Rousseeuw's concentration steps): no cluster of 30 % stretches it.
template <int K>
struct BulkOf {
  PartVector<K> centre = PartVector<K>::Zero();
  PartMatrix<K> shape = PartMatrix<K>::Identity();  ///< the covariance of the bulk
  bool ok = false;
  double limit = 0;  ///< Mahalanobis distances beyond have no weight
  double slope = 0;  ///< of the sum of scores, a number times the identity

  explicit BulkOf(const PartRows<K>& z) {
    // 95 % of the mean's efficiency for normal noise.
    limit = K == 1 ? 4.685 : K == 2 ? 5.123 : 5.490;
    const auto n = static_cast<std::size_t>(z.cols());
    const std::size_t near = (3 * n + 4) / 5;
    std::vector<double> r = distancesOf(z), w(n);
    for (int i = 0; i < 30; ++i) {
      std::vector<double> sorted = r;
      std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(near - 1), sorted.end());
      const double last = sorted[near - 1];
      for (std::size_t j = 0; j < n; ++j) w[j] = r[j] <= last ? 1 : 0;
      const PartVector<K> before = centre;
      takeMoments(z, w);
      r = distancesOf(z);
      if (!std::isfinite(r.front())) return;
      if (!((centre - before).norm() > 1e-9 * std::sqrt(shape.trace()))) break;
    }
    for (int round = 0; round < 2; ++round) {
      const double s = medianOf(r) / normalRadius(K, 0.5);
      if (!(s > 0)) return;
      shape *= s * s;
      if (round == 0) {
        // The shape of all that belong to it, with more efficiency.
        const double most = normalRadius(K, 0.975);
        for (std::size_t j = 0; j < n; ++j) w[j] = r[j] < most * s ? 1 : 0;
        takeMoments(z, w);
        r = distancesOf(z);
        if (!std::isfinite(r.front())) return;
      }
    }
    for (int i = 0; i < 100; ++i) {
      PartVector<K> sum = PartVector<K>::Zero();
      double weight = 0;
      slope = 0;
      for (std::size_t j = 0; j < n; ++j) {
        const PartVector<K> x = z.col(static_cast<Eigen::Index>(j)) - centre;
        const double u = whitened(x).norm() / limit, left = std::max(0.0, 1 - u * u);
        sum += left * left * x, weight += left * left;
        slope += left * left - 4 * u * u * left / K;
      }
      if (!(weight > 0)) return;
      const PartVector<K> step = sum / weight;
      centre += step;
      if (!(whitened(step).norm() > 1e-9)) break;
    }
    ok = slope > 0;
  }
  PartVector<K> whitened(const PartVector<K>& x) const { return Cholesky<double, K>(shape).template halfSolve<1>(x); }
  std::vector<double> distancesOf(const PartRows<K>& z) const {
    const Cholesky<double, K> factor(shape);
    std::vector<double> r(static_cast<std::size_t>(z.cols()));
    for (std::size_t j = 0; j < r.size(); ++j) {
      r[j] = factor.template halfSolve<1>(PartVector<K>(z.col(static_cast<Eigen::Index>(j)) - centre)).norm();
    }
    return r;
  }
  /// Centre and shape of the residuals with a weight.
  void takeMoments(const PartRows<K>& z, const std::vector<double>& w) {
    PartVector<K> sum = PartVector<K>::Zero();
    PartMatrix<K> squares = PartMatrix<K>::Zero();
    double weight = 0;
    for (std::size_t j = 0; j < w.size(); ++j) sum += w[j] * z.col(static_cast<Eigen::Index>(j)), weight += w[j];
    centre = sum / weight;
    for (std::size_t j = 0; j < w.size(); ++j) {
      const PartVector<K> x = z.col(static_cast<Eigen::Index>(j)) - centre;
      squares += w[j] * (x * x.transpose());
    }
    shape = squares / weight;
  }
  double mahalanobis(const PartVector<K>& x) const { return whitened(PartVector<K>(x - centre)).norm(); }
  /// The influence of a residual on the centre.
  PartVector<K> influence(const PartVector<K>& x) const {
    const double u = mahalanobis(x) / limit, left = std::max(0.0, 1 - u * u);
    return left * left / slope * (x - centre);
  }
};

/// The probability of as dense a clump of residuals off the centre as the densest, if the density of the noise falls
/// from there on ellipsoids: it is then nowhere higher than on average nearer to the centre.
template <int K>
double clumpProbability(const PartRows<K>& z, const BulkOf<K>& bulk) {
  constexpr std::size_t most_places = 400;
  const auto n = static_cast<std::size_t>(z.cols());
  const std::size_t stride = 1 + n / max_averaged;
  const Cholesky<double, K> white(bulk.shape);
  std::vector<PartVector<K>> x;
  std::vector<double> r;
  for (std::size_t i = 0; i < n; i += stride) {
    x.push_back(white.template halfSolve<1>(PartVector<K>(z.col(static_cast<Eigen::Index>(i)) - bulk.centre)));
    r.push_back(x.back().norm());
  }
  std::vector<double> sorted = r;
  std::sort(sorted.begin(), sorted.end());
  double least = 1, places = 0;
  constexpr double radii[] = {0.15, 0.3, 0.6};
  for (const Eigen::Index place : someOf(x.size(), most_places)) {
    const auto i = static_cast<std::size_t>(place);
    if (r[i] < 0.5) continue;
    ++places;
    for (const double radius : radii) {
      double here = 0;
      for (const PartVector<K>& y : x) here += (y - x[i]).squaredNorm() < radius * radius ? 1 : 0;
      // The datum itself has chosen the place.
      --here;
      const double outer = r[i] + radius;
      const auto within = static_cast<double>(std::lower_bound(sorted.begin(), sorted.end(), outer) - sorted.begin());
      const double share = std::pow(radius / outer, K);
      if (here > 0 && within > here) least = std::min(least, incompleteBeta(here, within - here, share));
    }
  }
  return std::min(1.0, least * places * static_cast<double>(std::size(radii)));
}

/// The probability of as few distances below three quarters of their median as there are, if the density of the noise
/// falls from the centre on: two halves with nothing between them have no centre.
template <int K>
double holeProbability(const PartRows<K>& z) {
  std::vector<double> d(static_cast<std::size_t>(z.cols()));
  for (std::size_t i = 0; i < d.size(); ++i) d[i] = z.col(static_cast<Eigen::Index>(i)).norm();
  const double middle = medianOf(d);
  const auto below = [&](double limit) {
    return static_cast<double>(std::count_if(d.begin(), d.end(), [&](double x) { return x < limit; }));
  };
  const double inner = below(0.75 * middle), within = below(middle);
  return within > inner ? incompleteBeta(within - inner, inner + 1, 1 - std::pow(0.75, K)) : 1;
}

/// The part's influence on the mean, its bulk, the shift from one to the other, and the outliers.
template <int K>
bool judgePart(const RobustData& data, const TangentBlock& part, const PartLoss& loss, double scale,
               const Eigen::MatrixXd& z, const RobustOptions& options, Eigen::MatrixXd& influence,
               RobustCentre& result) {
  const PartRows<K> rows = z.middleRows(part.begin, K);
  const auto n = static_cast<double>(rows.cols());
  PartRows<K> score(K, rows.cols());
  PartMatrix<K> slope = PartMatrix<K>::Zero();
  for (Eigen::Index i = 0; i < rows.cols(); ++i) {
    const double d = rows.col(i).norm(), w = loss.weight(d);
    score.col(i) = w * rows.col(i);
    const PartMatrix<K> along =
        d > 0 ? PartMatrix<K>(rows.col(i) * rows.col(i).transpose() / (d * d)) : PartMatrix<K>(PartMatrix<K>::Zero());
    slope += w * (PartMatrix<K>::Identity() - along);
    if (loss.kind == RobustLoss::huber && d < loss.limit) slope += along;
  }
  const PartMatrix<K> scatter = score * score.transpose();
  PartMatrix<K> L = scale * 0.9 * std::pow(n, -0.2) * PartMatrix<K>::Identity();
  if (loss.kind == RobustLoss::huber) {
    const Cholesky<double, K> first(slope);
    if (!first.ok()) return false;
    const PartMatrix<K> half = first.template solve<K>(scatter);
    L = Cholesky<double, K>(PartMatrix<K>(first.template solve<K>(PartMatrix<K>(half.transpose())))).lower();
  }
  if (!L.allFinite()) return false;
  const Cholesky<double, K> averaged(averagedSlope<K>(data, part, loss, L));
  if (!averaged.ok()) return false;
  for (Eigen::Index i = 0; i < rows.cols(); ++i) {
    influence.col(i).segment(part.begin, part.size) = averaged.template solve<1>(PartVector<K>(score.col(i)));
  }

  const BulkOf<K> bulk(rows);
  if (!bulk.ok) return false;
  result.shift.segment(part.begin, part.size) = bulk.centre;
  // Directions of errors about the mean are independent of their sizes, so that each difference of influences adds a
  // Kth of its square to every axis; their own scatter would grow with a cluster of outliers.
  const Cholesky<double, K> white(bulk.shape);
  double squares = 0;
  for (Eigen::Index i = 0; i < rows.cols(); ++i) {
    const PartVector<K> x = rows.col(i);
    const PartVector<K> difference = bulk.influence(x) - PartVector<K>(influence.col(i).segment(part.begin, part.size));
    squares += white.template halfSolve<1>(difference).squaredNorm();
  }
  const double t2 = K * white.template halfSolve<1>(bulk.centre).squaredNorm() / squares;
  result.shift_p =
      std::min({result.shift_p, chiSquaredTail(t2, K), clumpProbability<K>(rows, bulk), holeProbability<K>(rows)});

  const double family = n * static_cast<double>(data.parts.size());
  for (Eigen::Index i = 0; i < rows.cols(); ++i) {
    const double r = bulk.mahalanobis(rows.col(i));
    const double p = family * hotellingTail(r * r * n / (n + 1), K, 0.5 * n);
    if (p < options.outlier_level) {
      result.outliers.push_back({static_cast<std::size_t>(i), part.part, rows.col(i).norm(), p});
    }
  }
  return true;
}

/// Looks for another minimum of the criterion that the data do not exclude.
inline void findRival(const RobustData& data, const Eigen::MatrixXd& z, const std::vector<PartLoss>& loss,
                      RobustCentre& result) {
  for (std::size_t b = 0; b < data.parts.size(); ++b) {
    const TangentBlock& part = data.parts[b];
    if (!isAngular(part.part)) continue;
    const std::vector<double> here = partDistances(z, part);
    for (const Eigen::Index j : someOf(data.n, 16)) {
      if (here[static_cast<std::size_t>(j)] < 4 * result.scales[b]) continue;
      Eigen::VectorXd v = Eigen::VectorXd::Zero(data.dimension);
      v.segment(part.begin, part.size) = z.col(j).segment(part.begin, part.size);
      const auto other = data.at(v);
      RobustCentre found;
      found.tolerance = 1e-4 * result.scales[b];
      if (!robustIterate(*other, loss, 100, found)) continue;
      const Eigen::VectorXd error = data.to(*other);
      if (error.segment(part.begin, part.size).norm() < result.scales[b]) continue;
      Eigen::MatrixXd about;
      other->residuals(Eigen::VectorXd::Zero(data.dimension), 1, about);
      const std::vector<double> there = partDistances(about, part);
      double sum = 0, squares = 0;
      for (std::size_t i = 0; i < data.n; ++i) {
        const double e = loss[b].value(there[i]) - loss[b].value(here[i]);
        sum += e, squares += e * e;
      }
      const auto n = static_cast<double>(data.n);
      const double sd = std::sqrt(std::max(0.0, squares - sum * sum / n) / (n - 1));
      const double worse = sum / (std::sqrt(n) * sd);
      if (!(studentTail(worse, n - 1) < 0.00135)) {
        result.rival = error, result.rival_z = worse;
        return;
      }
    }
  }
}

LIESTAT_MEANS_INLINE RobustCentre robustCentre(RobustData& data, RobustLoss loss, const RobustOptions& options) {
  RobustCentre result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status, result.reason = reason;
    return result;
  };
  constexpr const char* no_end = "the iteration for the mean did not converge";
  Eigen::MatrixXd z;
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(data.dimension);
  data.residuals(zero, 1, z);
  if (!z.allFinite()) return without(Status::not_converged, "features are not finite");
  bestStart(data);
  result.tolerance = std::max(1e-12, data.precision);
  std::vector<PartLoss> losses(data.parts.size());
  if (!robustIterate(data, losses, options.max_iterations, result)) return without(Status::not_converged, no_end);
  data.residuals(zero, 1, z);
  bool spread = true;
  for (std::size_t b = 0; b < data.parts.size(); ++b) {
    result.scales.push_back(medianOf(partDistances(z, data.parts[b])) / normalRadius(data.parts[b].size, 0.5));
    spread = spread && result.scales[b] > 10 * data.precision;
    losses[b] = {loss, normalRadius(data.parts[b].size, options.quadratic) * result.scales[b]};
  }
  const bool few = data.n < std::max(least_robust_count, 2 * static_cast<std::size_t>(data.dimension) + 1);
  if (!spread) {
    return few ? without(Status::too_few, "a robust covariance needs more features")
               : without(Status::ill_defined, "half of the features are equal: they show no noise");
  }
  if (loss == RobustLoss::huber) {
    if (!robustIterate(data, losses, options.max_iterations, result)) return without(Status::not_converged, no_end);
    data.residuals(zero, 1, z);
  }
  bool in_ball = true;
  for (std::size_t b = 0; b < data.parts.size(); ++b) {
    const TangentBlock& part = data.parts[b];
    const std::vector<double> d = partDistances(z, part);
    double sum = 0;
    for (const double x : d) sum += losses[b].value(x);
    result.cost += loss == RobustLoss::median ? sum : sum / (result.scales[b] * result.scales[b]);
    in_ball = in_ball && *std::max_element(d.begin(), d.end()) < 0.25 * data.injectivityRadius(part.part) &&
              !(loss == RobustLoss::median && part.size == 1 && data.n % 2 == 0);
  }
  if (few) return without(Status::too_few, "fewer than 20 features do not tell outliers on one side from noise");

  result.shift = zero;
  Eigen::MatrixXd influence(data.dimension, static_cast<Eigen::Index>(data.n));
  for (std::size_t b = 0; b < data.parts.size(); ++b) {
    const bool smooth = withPartSize(data.parts[b].size, [&](auto size) {
      return judgePart<size>(data, data.parts[b], losses[b], result.scales[b], z, options, influence, result);
    });
    if (!smooth) {
      return without(Status::ill_defined, "the criterion is flat within the confidence region of the mean");
    }
  }
  std::sort(result.outliers.begin(), result.outliers.end(),
            [](const RobustOutlier& a, const RobustOutlier& b) { return a.p < b.p; });
  if (in_ball) result.proof = "the features lie in a ball in which the criterion is convex";
  findRival(data, z, losses, result);
  if (result.rival.size() > 0) return without(Status::ambiguous, "another feature explains the data as well");
  const auto n = static_cast<double>(data.n);
  result.shift_p = std::min(1.0, result.shift_p * static_cast<double>(data.parts.size()));
  result.covariance = n / (n - 1) * influence * influence.transpose() + result.shift * result.shift.transpose();
  if (result.shift_p < options.shift_level) {
    return without(Status::inconsistent,
                   "the outliers lie on one side of the mean, as of a second population, and bias it");
  }
  if (!result.covariance.allFinite()) return without(Status::ill_defined, "the features are not spread");
  return without(Status::ok, "");
}

}  // namespace liestat::detail
