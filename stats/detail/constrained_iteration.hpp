// The iteration of a constrained estimate (docs/theory/constrained.md, section 5): steps, their curvature, the line search
// on an exact penalty function, the result. Definitions of stats/detail/constrained_core.hpp.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <stats/detail/constrained_curvature.hpp>
#include <stats/detail/constrained_steps.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/detail/tangent_system.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

LIESTAT_ESTIMATION_INLINE ConstrainedCore::ConstrainedCore(const ParameterFunctions& parameter,
                                                           std::vector<ChannelRecord> channels,
                                                           ConstrainedSettings settings, bool valid)
    : parameter_(parameter),
      settings_(std::move(settings)),
      N(parameter.dimension),
      P(parameter.constraints),
      A_(N, N),
      curved_A_(N, N),
      C_(P, N),
      prior_J_(N, N),
      b_(number(N)),
      curved_b_(b_),
      prior_slope_(b_),
      delta_(b_),
      gradient_(b_),
      error_(b_),
      further_(b_),
      basis_(N, P),
      system_(N),
      curved_system_(N),
      constraint_values_(number(P)),
      trial_values_(constraint_values_),
      constraint_multipliers_(constraint_values_) {
  result_.information = result_.unobservable_basis = Rows(N, N);
  result_.covariance = Rows(N, N);
  std::fill_n(result_.covariance.data(), N * N, std::numeric_limits<double>::quiet_NaN());
  result_.determined_covariance = result_.covariance;
  if (!valid) result_.end = ConstrainedEnd::bad_input;
  channels_.reserve(channels.size());
  for (ChannelRecord& channel : channels) {
    measurements_ += channel.size;
    channels_.emplace_back(std::move(channel), N);
  }
}

LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::iterate(void* problem) {
  if (result_.end != ConstrainedEnd::running) return false;
  if (result_.iterations >= settings_.max_iterations) return finish(problem, ConstrainedEnd::capped);
  const bool curved = slow_steps_ >= 3 && settings_.curvature && result_.iterations > 0;
  linearize(problem);
  if (!finite_ || !allFinite(A_) || !allFinite(b_) || !allFinite(constraint_values_)) {
    return finish(problem, result_.iterations == 0 ? ConstrainedEnd::bad_input : ConstrainedEnd::stalled);
  }
  ++result_.iterations;
  result_.used_curvature = result_.used_curvature || curved;
  if (curved) linearizeCurved(problem);
  return step(problem, curved);
}
LIESTAT_ESTIMATION_INLINE void ConstrainedCore::stop(void* problem) {
  if (result_.end == ConstrainedEnd::running) finish(problem, ConstrainedEnd::stopped);
}

/// eᵀ Q e of the prior.
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::weighed(const Numbers& e) const {
  double sum = 0;
  for (int i = 0; i < N && hasPrior(); ++i) {
    sum += e[number(i)] * dot(settings_.prior_information.data() + i * N, e.data(), N);
  }
  return sum;
}

LIESTAT_ESTIMATION_INLINE void ConstrainedCore::linearize(void* problem) {
  A_.setZero();
  std::fill(b_.begin(), b_.end(), 0.);
  prior_cost_ = 0;
  if (hasPrior()) {
    parameter_.priorError(problem, ParameterPoint::current, error_.data(), prior_J_.data());
    Numbers row(number(N));
    for (int i = 0; i < N; ++i) {
      const double* Q = settings_.prior_information.data() + i * N;
      std::fill(row.begin(), row.end(), 0.);
      for (int k = 0; k < N; ++k) addScaled(row.data(), Q[k], prior_J_[k], N);
      for (int j = 0; j < N; ++j) addScaled(A_[j], prior_J_[i][j], row.data(), N);
      addScaled(b_.data(), -dot(Q, error_.data(), N), prior_J_[i], N);
    }
    prior_cost_ = weighed(error_);
  }
  for (int i = 0; i < N; ++i) prior_slope_[number(i)] = -b_[number(i)];
  finite_ = true;
  const void* q = point(problem, ParameterPoint::current);
  for (ConstrainedChannel& channel : channels_) finite_ = channel.linearize(q, A_, b_) && finite_;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) A_[i][j] = A_[j][i];
  }
  if (P > 0) {
    parameter_.linearizeConstraint(problem, ParameterPoint::current, constraint_values_.data(), C_.data());
    // The derivative of linear constraints is what it was.
    if (!parameter_.linear || !have_basis_) {
      if (!allFinite(C_)) {
        std::fill(constraint_values_.begin(), constraint_values_.end(), std::numeric_limits<double>::quiet_NaN());
        C_.setZero();
      }
      basis_.compute(C_);
      have_basis_ = true;
    }
  }
  system_.compute(A_, basis_.freeBasis(), N - basis_.rank());
}

LIESTAT_ESTIMATION_INLINE ConstrainedCore::Merit ConstrainedCore::meritOf(const ChannelMerit& sum, double prior_cost,
                                                                          const Numbers& constraints) const {
  return {sum.cost + prior_cost, sum.violation, sum.squared_violation, basis_.shortestLength(constraints)};
}
/// The same with the prior and the constraints at a point.
LIESTAT_ESTIMATION_INLINE ConstrainedCore::Merit ConstrainedCore::meritAt(const void* problem, ParameterPoint which,
                                                                          const ChannelMerit& sum) {
  if (hasPrior()) parameter_.priorError(problem, which, error_.data(), nullptr);
  if (P > 0) parameter_.constraint(problem, which, trial_values_.data());
  return meritOf(sum, weighed(error_), trial_values_);
}
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::phi(const Merit& merit) const {
  return 0.5 * merit.cost + penalty_ * merit.violation + constraint_penalty_ * merit.constraint;
}

LIESTAT_ESTIMATION_INLINE double ConstrainedCore::parameterSize(const void* problem) const {
  if (!parameter_.is_vector) return 1;
  Numbers q(number(N));
  parameter_.coordinates(problem, q.data());
  return 1 + norm(q);
}
/// The length of one rounding error in each coordinate, in units of the noise.
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::rounding(const void* problem) const {
  double squared = 0;
  for (const ConstrainedChannel& channel : channels_) squared += channel.roundingSquared();
  Numbers q(number(N), 1.), weighted(number(N));
  if (parameter_.is_vector) parameter_.coordinates(problem, q.data());
  multiply(A_, q, weighted);
  const double of_parameter = std::abs(dot(q, weighted));
  return std::sqrt(squared + of_parameter * std::pow(std::numeric_limits<double>::epsilon(), 2));
}

LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::step(void* problem, bool curved) {
  Numbers wanted(number(N));
  basis_.shortest(constraint_values_, -1, wanted);
  delta_ = wanted;
  curved ? curved_system_.solve(curved_b_, delta_) : system_.solve(b_, delta_);
  Merit here;
  double slope = 0, length = 0;
  for (bool with_curvature = curved;; with_curvature = false) {
    double largest = 0, squared = 0, free = 0, along = 0;
    ChannelMerit sum;
    for (ConstrainedChannel& channel : channels_) {
      largest = std::max(largest, channel.step(delta_, with_curvature));
      channel.stepLengths(squared, along);
      free = std::max(free, channel.freeStep());
      channel.addMerit(sum);
    }
    multiply(A_, delta_, gradient_);
    const double quadratic = dot(delta_, gradient_);
    for (int i = 0; i < N; ++i) gradient_[number(i)] -= b_[number(i)];
    penalty_ = std::max(penalty_, 2 * largest);
    if (basis_.rank() > 0) {
      // At least a millionth of what an error of one standard deviation would ask for: where the measurements are met as
      // they stand, constraints that are not must have a price, or any step is as good as another.
      double trace = 0;
      for (int i = 0; i < N; ++i) trace += A_[i][i];
      const double least = 1e-6 * std::sqrt(trace / N);
      constraint_penalty_ = std::max({constraint_penalty_, 2 * basis_.fixedLength(gradient_), least});
      basis_.multipliers(gradient_, constraint_multipliers_);
    }
    here = meritOf(sum, prior_cost_, constraint_values_);
    slope = along + dot(prior_slope_, delta_) - penalty_ * here.violation - constraint_penalty_ * here.constraint;
    length = std::sqrt(std::max(0.0, squared + quadratic));
    free_step_ = free;
    if (!with_curvature || slope < 0 || length <= settings_.tolerance) break;
    // Not a direction of descent: the step without curvature is one.
    delta_ = wanted;
    system_.solve(b_, delta_);
  }
  if (!std::isfinite(length) || !std::isfinite(slope)) return finish(problem, ConstrainedEnd::stalled);

  const double size = parameterSize(problem), parameter_step = norm(delta_) / size;
  const bool met = here.constraint <= 1e-9 * size;
  // As small as asked, or as rounding lets it be.
  const double tolerance = std::max(settings_.tolerance, 4 * rounding(problem));
  if (length <= tolerance && std::sqrt(here.squared_violation) <= 10 * tolerance && free_step_ <= 1e-9 && met &&
      parameter_step <= 1e-6) {
    parameter_.move(problem, ParameterPoint::current, ParameterPoint::current, delta_.data());
    for (ConstrainedChannel& channel : channels_) channel.acceptFull();
    return settle(problem);
  }
  const double ratio = last_length_ > 0 ? length / last_length_ : 0;
  // Linear convergence: the curvature joins, and stays.
  slow_steps_ = ratio > 0.4 || cut_ ? slow_steps_ + 1 : slow_steps_ >= 3 ? slow_steps_ : 0;
  last_length_ = length;
  return search(problem, here, slope, length, parameter_step, met);
}

LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::search(void* problem, const Merit& here, double slope, double length,
                                                       double parameter_step, bool met) {
  // Rounding of the sum, and of equations that are met as well as rounding lets them be.
  const double value = phi(here);
  const double slack =
      1e-13 * (1 + std::abs(value)) + 4 * penalty_ * std::sqrt(static_cast<double>(measurements_)) * rounding(problem);
  const void* q = point(problem, ParameterPoint::trial);
  Numbers part(number(N));
  double alpha = 1;
  for (int halving = 0; halving < 30; ++halving, alpha *= 0.5) {
    for (int i = 0; i < N; ++i) part[number(i)] = alpha * delta_[number(i)];
    parameter_.move(problem, ParameterPoint::current, ParameterPoint::trial, part.data());
    ChannelMerit sum;
    for (ConstrainedChannel& channel : channels_) channel.tryStep(q, alpha, sum);
    const double bound = value + 1e-4 * alpha * slope + slack;
    const double there = phi(meritAt(problem, ParameterPoint::trial, sum));
    cut_ = halving > 0;
    if (there <= bound) return accept(problem);
    if (halving > 6) continue;
    // Second-order correction: the equations at the trial point, linearised as here. Repeated, because one leaves what
    // is of third order, and that is much of a long step.
    double violation = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 4; ++k) {
      std::fill(part.begin(), part.end(), 0.);
      for (const ConstrainedChannel& channel : channels_) channel.addCorrectionSums(part);
      basis_.shortest(trial_values_, -1, further_);
      system_.solve(part, further_);
      parameter_.move(problem, ParameterPoint::trial, ParameterPoint::trial, further_.data());
      ChannelMerit after;
      for (ConstrainedChannel& channel : channels_) channel.tryCorrected(q, further_, after);
      const Merit merit = meritAt(problem, ParameterPoint::trial, after);
      if (phi(merit) <= bound) return accept(problem);
      const double left = phi(merit) - 0.5 * merit.cost;
      if (!(left < 0.5 * violation)) break;
      violation = left;
    }
  }
  const bool close = length <= 1e-6 && parameter_step <= 1e-7 && met;
  if (!met && restore(problem, here)) return true;
  return close ? settle(problem) : finish(problem, ConstrainedEnd::stalled);
}
/// Where nothing along the direction improves anything and constraints do not hold: a step to the constraints alone.
/// The linearised constraint c - λ² = 0 near λ = 0 has its multiplier at zero, and at that price the iteration would
/// stay off it; it is raised to what c costs without λ.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::restore(void* problem, const Merit& here) {
  constexpr int most = 8;
  if (restorations_++ >= most) return false;
  basis_.shortest(constraint_values_, -1, delta_);
  multiply(A_, delta_, gradient_);
  for (int i = 0; i < N; ++i) gradient_[number(i)] -= b_[number(i)];
  constraint_penalty_ = std::max(constraint_penalty_, 2 * basis_.fixedLength(gradient_));
  parameter_.move(problem, ParameterPoint::current, ParameterPoint::trial, delta_.data());
  ChannelMerit sum;
  for (ConstrainedChannel& channel : channels_) {
    channel.step(delta_, false);
    channel.tryStep(point(problem, ParameterPoint::trial), 1, sum);
  }
  if (!(meritAt(problem, ParameterPoint::trial, sum).constraint < 0.5 * here.constraint)) return false;
  last_length_ = 0;
  return accept(problem);
}
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::accept(void* problem) {
  parameter_.move(problem, ParameterPoint::trial, ParameterPoint::current, nullptr);
  for (ConstrainedChannel& channel : channels_) channel.accept();
  return true;
}

/// The end at a stationary point, if it is a minimum: the Hessian of the Lagrangian on the tangent space, in units of
/// one standard deviation along the directions that A determines. Along a direction of negative curvature the iteration
/// goes on. Where A leaves directions open, second derivatives may determine them, as that of c - λ² does at λ = 0.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::settle(void* problem) {
  // Curvature that differences of first derivatives can tell from none, in units of A or of all curvature.
  constexpr double certain = 1e-4, resolved = 1e-4, rounding = 1e-13;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;
  if (!settings_.curvature || !settings_.second_order) return finish(problem, ConstrainedEnd::converged);
  linearize(problem);
  if (!finite_ || !allFinite(A_)) return finish(problem, ConstrainedEnd::converged);
  CurvatureSums sums = curvatureSums(problem);
  if (!linearizeCurved(problem, &sums)) return finish(problem, ConstrainedEnd::converged);
  std::size_t misplaced = 0;
  for (const ConstrainedChannel& channel : channels_) misplaced += channel.misplaced();
  if (misplaced > 0) return finish(problem, ConstrainedEnd::saddle);

  const Rows determined = system_.determinedBasis(), null = system_.nullBasis();
  const int k = determined.rows(), m = null.rows();
  const auto product = [&](const double* a, const double* b) {
    double sum = 0;
    for (int i = 0; i < N; ++i) sum += a[i] * dot(curved_A_[i], b, N);
    return sum;
  };
  Matrix H(k, k), cross(m, k), rest(m, m);
  for (int i = 0; i < k; ++i) {
    for (int j = 0; j < k; ++j) H(i, j) = product(determined[i], determined[j]);
    for (int j = 0; j < m; ++j) cross(j, i) = product(null[j], determined[i]);
  }
  const SymmetricEigen<Matrix> eigen(H);
  Numbers direction(number(N));
  const auto combine = [&](const Rows& basis, const double* factors) {
    std::fill(direction.begin(), direction.end(), 0.);
    for (int i = 0; i < basis.rows(); ++i) addScaled(direction.data(), factors[i], basis[i], N);
    return direction;
  };
  if (k > 0 && eigen.values[0] < -certain) {
    return leaveSaddle(problem, combine(determined, eigen.vectors.data()), eigen.values[0], ConstrainedEnd::saddle);
  }
  double least = 0;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) {
      least = std::max({least, resolved * std::abs(curved_A_[i][j] - A_[i][j]), rounding * std::abs(A_[i][j])});
    }
  }
  for (int a = 0; a < m; ++a) {
    for (int b = 0; b < m; ++b) {
      rest(a, b) = product(null[a], null[b]);
      for (int l = 0; l < k; ++l) {
        double left = 0, right = 0;
        for (int i = 0; i < k; ++i)
          left += cross(a, i) * eigen.vectors(i, l), right += cross(b, i) * eigen.vectors(i, l);
        rest(a, b) -= left * right / std::max(eigen.values[l], certain);
      }
    }
  }
  const SymmetricEigen<Matrix> along_null(rest);
  if (m > 0 && along_null.values[0] < -least) {
    // Where the way leads nowhere it was the rounding of derivatives: the direction is open.
    return leaveSaddle(problem, combine(null, along_null.vectors.data()), along_null.values[0],
                       ConstrainedEnd::converged);
  }
  int bounds = 0;
  for (int a = 0; a < m; ++a) bounds += along_null.values[a] > least;
  bound_ = Rows(bounds, N), open_ = Rows(m - bounds, N);
  for (int a = 0, b = 0, o = 0; a < m; ++a) {
    const Numbers& v = combine(null, along_null.vectors.col(a).data());
    std::copy(v.begin(), v.end(), along_null.values[a] > least ? bound_[b++] : open_[o++]);
  }
  settled_ = true;
  result_.minimum_checked = sums.known;
  setCurvature(sums);
  // Along v_i and v_j the parameter moves by -C₀⁺ (v_iᵀ ∇²c v_j) to second order, to one side.
  if (bounds > 0 && P > 0) {
    const std::vector<Rows> curvatures = constraintCurvatures(problem, differenceStep(problem));
    off_bounds_ = Rows(bounds * (bounds + 1) / 2, N);
    Numbers values(number(P)), half(number(N));
    for (int a = 0, row = 0; a < bounds; ++a) {
      for (int b = 0; b <= a; ++b, ++row) {
        for (int p = 0; p < P; ++p) {
          std::copy_n(bound_[b], N, half.data());
          double sum = 0;
          for (int i = 0; i < N; ++i) sum += bound_[a][i] * dot(curvatures[number(p)][i], half.data(), N);
          values[number(p)] = sum;
        }
        basis_.shortest(values, -1, direction);
        std::copy(direction.begin(), direction.end(), off_bounds_[row]);
      }
    }
  }
  return finish(problem, ConstrainedEnd::converged);
}
/// A step from a stationary point along a direction of negative curvature; not again and again. `otherwise`: the end
/// where there is no way down.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::leaveSaddle(void* problem, const Numbers& direction, double curvature,
                                                            ConstrainedEnd otherwise) {
  constexpr int most = 8;
  if (left_saddles_++ >= most) return finish(problem, otherwise);
  // A third of the parameter's size at first, which the search halves.
  const double length = parameterSize(problem) / (3 * norm(direction));
  for (int i = 0; i < N; ++i) delta_[number(i)] = length * direction[number(i)];
  ChannelMerit sum;
  for (ConstrainedChannel& channel : channels_) {
    channel.step(delta_, true);
    channel.addMerit(sum);
  }
  last_length_ = 0, slow_steps_ = 0;
  const Merit here = meritOf(sum, prior_cost_, constraint_values_);
  const bool found = search(problem, here, 0.5 * curvature * length * length, length, 1, true);
  return found || finish(problem, otherwise);
}

/// The covariance of what is determined. Active bounds do not count as equations: an estimate that a convex set cuts
/// off is no farther from a true parameter in that set, in units of A, than one that is not cut off.
LIESTAT_ESTIMATION_INLINE void ConstrainedCore::setCovariance() {
  Rows C = system_.covariance();
  if (open_.rows() + bound_.rows() > 0) {
    Rows basis(N, N);
    int rows = 0;
    const auto add = [&](const double* v) {
      double* next = basis[rows];
      std::copy_n(v, N, next);
      const double before = norm(next, N);
      for (int pass = 0; pass < 2; ++pass) {
        for (const Rows* list : {&open_, &bound_, &basis}) {
          const int count = list == &basis ? rows : list->rows();
          for (int i = 0; i < count; ++i) addScaled(next, -dot((*list)[i], next, N), (*list)[i], N);
        }
      }
      const double after = norm(next, N);
      if (!(after > 1e-8 * before) || rows == N) return;
      for (int i = 0; i < N; ++i) next[i] /= after;
      ++rows;
    };
    const Rows& free = basis_.freeBasis();
    for (int i = 0; i < N - basis_.rank() && rows < N; ++i) add(free[i]);
    for (int i = 0; i < off_bounds_.rows() && rows < N; ++i) add(off_bounds_[i]);
    TangentSystem system(N);
    system.compute(A_, basis, rows);
    C = system.covariance();
  }
  result_.widening = result_.relative_curvature.at(std::sqrt(noiseScale())).widening();
  const double factor = noiseScale() * result_.widening;
  for (int i = 0; i < N * N && factor != 1; ++i) C.data()[i] *= factor;
  result_.determined_covariance = result_.covariance = C;
  for (int i = 0; i < N; ++i) {
    double open = 0;
    for (int k = 0; k < open_.rows(); ++k) open = std::max(open, std::abs(open_[k][i]));
    if (!(open > 1e-7)) continue;
    for (int j = 0; j < N; ++j)
      result_.covariance[i][j] = result_.covariance[j][i] = std::numeric_limits<double>::quiet_NaN();
  }
}

/// Fills in the result; always false.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::finish(void* problem, ConstrainedEnd end) {
  result_.end = end;
  if (end == ConstrainedEnd::bad_input) return false;
  linearize(problem);
  ChannelMerit sum;
  int unmet = 0;
  result_.equations = result_.dropped_equations = 0;
  result_.uninformative = 0;
  for (ConstrainedChannel& channel : channels_) {
    channel.addMerit(sum);
    result_.equations += channel.keptEquations();
    result_.dropped_equations += channel.droppedEquations();
    unmet += channel.unmetEquations(point(problem, ParameterPoint::current));
    result_.uninformative += channel.uninformative();
  }
  result_.constraints = basis_.rank();
  result_.dropped_constraints = P - result_.constraints;
  result_.free_parameters = N - result_.constraints;
  result_.information = A_;
  if (!settled_) open_ = system_.nullBasis();
  result_.unobservable = open_.rows();
  result_.active_bounds = bound_.rows();
  for (int k = 0; k < open_.rows(); ++k) {
    for (int i = 0; i < N; ++i) result_.unobservable_basis[i][k] = open_[k][i];
  }
  result_.chi2 = sum.cost + prior_cost_;
  result_.equation_error = equationError(problem);
  result_.degrees_of_freedom =
      result_.constraints + result_.equations + settings_.prior_rank - N + system_.nullDimension();
  setCovariance();
  if (end != ConstrainedEnd::converged && end != ConstrainedEnd::stalled) return false;
  if (basis_.largest(constraint_values_) > 1e-7 * parameterSize(problem) ||
      (end == ConstrainedEnd::converged && unmet > 0)) {
    result_.end = ConstrainedEnd::contradictory;
  } else if (end == ConstrainedEnd::converged && result_.equations == 0 && !hasPrior() && result_.unobservable > 0) {
    result_.end = ConstrainedEnd::too_few;
  } else if (end == ConstrainedEnd::converged && isRefuted()) {
    result_.end = ConstrainedEnd::inconsistent;
  } else if (end == ConstrainedEnd::converged && result_.unobservable > 0) {
    result_.end = ConstrainedEnd::unobservable;
  } else if (end == ConstrainedEnd::converged && result_.relative_curvature.at(std::sqrt(noiseScale())).large()) {
    result_.end = ConstrainedEnd::curved;
  }
  if (result_.end == ConstrainedEnd::inconsistent || result_.end == ConstrainedEnd::curved) {
    std::fill_n(result_.covariance.data(), N * N, std::numeric_limits<double>::quiet_NaN());
    result_.determined_covariance = result_.covariance;
  }
  return false;
}
/// Birge's factor where it is asked for.
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::noiseScale() const {
  if (settings_.noise != StatedNoise::scaled || result_.degrees_of_freedom <= 0) return 1;
  return std::max(1.0, result_.chi2 / result_.degrees_of_freedom);
}
/// True if χ² refutes the stated noise; fit_p is set.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::isRefuted() {
  if (result_.degrees_of_freedom <= 0) return false;
  result_.fit_p = chiSquaredTail(result_.chi2, number(result_.degrees_of_freedom));
  return settings_.noise == StatedNoise::tested && result_.fit_p < refutation_level;
}
/// E²: the squared length of the second-order correction at the end.
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::equationError(void* problem) {
  ChannelMerit sum;
  Numbers b(number(N)), step(number(N));
  for (ConstrainedChannel& channel : channels_) {
    channel.tryStep(point(problem, ParameterPoint::current), 0, sum);
    channel.addCorrectionSums(b);
  }
  basis_.shortest(constraint_values_, -1, step);
  system_.solve(b, step);
  double squared = weighed(step);
  for (const ConstrainedChannel& channel : channels_) squared += channel.correctionSquared(step);
  return squared;
}

}  // namespace liestat::detail
