// The curvature of equations and constraints in a constrained estimate (docs/theory/constrained.md, section 5): second
// derivatives under the multipliers, by differences of the first. Definitions of
// stats/detail/constrained_core.hpp.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <stats/detail/constrained_channel.hpp>
#include <stats/detail/tail_probabilities.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Step of the differences by which curvatures are found, for coordinates of size one.
inline constexpr double curvature_step = 6e-6;

/// The largest coordinate's size, or one where all are zero.
inline double differenceScale(const double* x, int n) {
  double size = 0;
  for (int k = 0; k < n; ++k) size = std::max(size, std::abs(x[k]));
  return size > 0 ? size : 1;
}

/// The multipliers of the equations as they were given; with the sign of ½ ‖ε‖² + λᵀ c.
inline void ConstrainedChannel::lagrange(std::size_t i, double* lambda) const {
  double *y = scratch_.data(), *x = y + P;
  const double* given = block(multipliers_, i, P);
  for (int k = 0; k < P; ++k) y[k] = -given[k];
  halfSolveTransposed(block(root_, i, P * P), order_.data() + i * number(P), ranks_[i], P, y, 1, x);
  if (freeOf(i) == 0) {
    std::copy(x, x + P, lambda);
    return;
  }
  const double* selection = block(selection_, i, P * P);
  std::fill(lambda, lambda + P, 0.);
  for (int k = 0; k < P; ++k) addScaled(lambda, x[k], selection + k * P, P);
}

inline void ConstrainedChannel::linearizeCurved(const ParameterFunctions& parameter, void* problem,
                                                double parameter_step, Rows& A, Numbers& b, CurvatureSums* sums) {
  const int size = N + K, square = size * size;
  base_.resize(n_ * number(K)), slope_.resize(n_ * number(K * N)), curved_.assign(n_, 0);
  misplaced_ = 0;
  // Those where the parameter stays. Those of the last step are in an order of equations that may be another one now:
  // of equal pivots rounding takes the first.
  multipliers_ = r_;
  // Second derivatives of each equation with respect to parameter and measurement, by central differences of the first.
  Numbers second(channel_batch * number(P * square)), H(number(square)), lambda(number(P)), shift(number(N)),
      at(channel_batch * number(K)), steps(channel_batch, curvature_step);
  Rows transport(N, N);
  for (std::size_t first = 0; first < n_; first += channel_batch) {
    const std::size_t count = std::min(channel_batch, n_ - first);
    for (std::size_t i = 0; i < count && record_.functions->is_vector; ++i) {
      steps[i] = curvature_step * differenceScale(block(record_.coordinates, first + i, K), K);
    }
    std::fill(second.begin(), second.end(), 0.);
    for (int column = 0; column < size; ++column) {
      for (const double sign : {1., -1.}) {
        std::copy_n(block(at_, first, K), count * number(K), at.data());
        std::fill(shift.begin(), shift.end(), 0.);
        if (column < N) {
          shift[number(column)] = sign * parameter_step;
        } else {
          for (std::size_t i = 0; i < count; ++i) at[i * number(K) + number(column - N)] += sign * steps[i];
        }
        parameter.move(problem, ParameterPoint::current, ParameterPoint::shifted, shift.data());
        if (!parameter.is_vector) parameter.transport(problem, transport.data());
        record_.functions->linearize(record_.channel, parameter.point(problem, ParameterPoint::shifted), first, count,
                                     at.data(), raw_values_.data(), raw_C_.data(), raw_D_.data());
        for (std::size_t i = 0; i < count; ++i) {
          const double factor = sign / (2 * (column < N ? parameter_step : steps[i]));
          for (int p = 0; p < P; ++p) {
            const double *C = block(raw_C_, i, P * N) + p * N, *D = block(raw_D_, i, P * K) + p * K;
            double* h = block(second, i, P * square) + p * square + column * size;
            if (parameter.is_vector) addScaled(h, factor, C, N);
            for (int k = 0; k < N && !parameter.is_vector; ++k) addScaled(h, factor * C[k], transport[k], N);
            addScaled(h + N, factor, D, K);
          }
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      double* T = block(second, i, P * square);
      lagrange(first + i, lambda.data());
      std::fill(H.begin(), H.end(), 0.);
      for (int p = 0; p < P; ++p) {
        double* h = T + p * square;
        for (int k = 0; k < size; ++k) {
          for (int l = 0; l < k; ++l) h[k * size + l] = h[l * size + k] = 0.5 * (h[k * size + l] + h[l * size + k]);
        }
        addScaled(H.data(), lambda[number(p)], h, square);
      }
      addCurved(first + i, H.data(), A, b);
      if (sums) addCurvature(first + i, T, *sums);
    }
  }
}

/// Along u_a = (d_a, -G Ĉ d_a) the equations stay met to first order. What is of second order, in units of the noise,
/// is a_ab = L⁻¹ c''(u_a, u_b) + Ĉ w_ab; with the part V - G Gᵀ of the noise along the model it is the noise of Ĉ d_a.
inline void ConstrainedChannel::addCurvature(std::size_t i, const double* second, CurvatureSums& sums) const {
  if (freeOf(i) > 0) {
    sums.known = false;
    return;
  }
  const int size = N + K, square = size * size, k = sums.directions.rows(), rank = ranks_[i];
  const double *C = block(C_, i, P * N), *G = block(G_, i, P * K);
  Numbers whitened(number(P * square)), v(number(P * k)), u(number(k * size)), along(number(k * size)),
      V(number(K * K)), noise(number(K)), a(number(k * k));
  halfSolve(i, second, square, whitened.data());
  record_.noise.matrix(record_.noise.covariance, i, V.data());
  for (int p = 0; p < rank; ++p) {
    for (int l = 0; l < K; ++l) addScaled(V.data() + l * K, -G[p * K + l], G + p * K, K);
  }
  for (int j = 0; j < k; ++j) {
    double* direction = u.data() + j * size;
    std::copy_n(sums.directions[j], N, direction);
    for (int p = 0; p < rank; ++p) {
      v[number(p * k + j)] = dot(C + p * N, sums.directions[j], N);
      addScaled(direction + N, -v[number(p * k + j)], G + p * K, K);
    }
  }
  for (int p = 0; p < rank; ++p) {
    const double *T = whitened.data() + p * square, *velocity = v.data() + p * k;
    multiply(u.data(), T, k, size, size, along.data());
    double trace = 0, squares = 0, noise_trace = 0;
    for (int j = 0, bend = 0; j < k; ++j) {
      for (int l = 0; l <= j; ++l, ++bend) {
        const double value =
            dot(along.data() + j * size, u.data() + l * size, size) + dot(C + p * N, sums.bends[bend], N);
        a[number(j * k + l)] = a[number(l * k + j)] = value;
        squares += (j == l ? 1 : 2) * value * value;
        if (j == l) trace += value;
      }
      multiply(along.data() + j * size + N, V.data(), 1, K, K, noise.data());
      for (int l = 0; l < k; ++l) sums.spread[j][l] += dot(noise.data(), along.data() + l * size + N, K);
    }
    for (int l = 0; l < K; ++l) noise_trace += dot(T + (N + l) * size + N, V.data() + l * K, K);
    sums.total += 2 * squares + trace * trace;
    for (int j = 0; j < k * k; ++j) addScaled(sums.tangent[j], a[number(j)], velocity, k);
    addScaled(sums.bias.data(), -0.5 * (trace + noise_trace), velocity, k);
  }
}

/// With W = Q + Σ λ_k ∂²c_k/∂m², H_qm = Σ λ_k ∂²c_k/∂q∂m, the criterion gains ½ δᵀ A δ − bᵀ δ. H is made symmetric.
inline void ConstrainedChannel::addCurved(std::size_t i, double* H, Rows& A, Numbers& b) {
  const int size = N + K, cols = N + 1;
  for (int k = 0; k < size; ++k) {
    for (int l = 0; l < k; ++l) H[k * size + l] = H[l * size + k] = 0.5 * (H[k * size + l] + H[l * size + k]);
  }
  const double *C = block(C_, i, P * N), *D = block(D_, i, P * K), *r = block(r_, i, P), *value = block(value_, i, P);
  const auto addPlain = [&] {
    for (int k = 0; k < ranks_[i]; ++k) {
      addScaled(b.data(), r[k], C + k * N, N);
      for (int j = 0; j < N; ++j) addScaled(A[j], C[k * N + j], C + k * N, N);
    }
  };
  if (freeOf(i) > 0) return addPlain();
  const double* at = block(at_, i, K);
  double *Q = scratch_.data(), *W = Q + K * K, *first = W + K * K, *response = first + K * cols, *S = response + K * P,
         *lambda = S + P * P, *moving = lambda + P * cols, *work = moving + K * K;
  record_.noise.matrix(record_.noise.information, i, Q);
  const bool partly_exact = record_.noise.movingDirections(i, Q, moving, work);
  double largest = 0, smallest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < K; ++k) {
    if (Q[k * K + k] > 0) smallest = std::min(smallest, Q[k * K + k]);
    for (int l = 0; l < K; ++l) largest = std::max(largest, std::abs(H[(N + k) * size + N + l]));
  }
  // A multiple of D̂ᵀ D̂ changes nothing where the equations hold, and leaves W its curvature along them alone.
  double along_equations = 0;
  const auto factorised = [&] {
    for (int k = 0; k < K; ++k) {
      for (int l = 0; l < K; ++l) W[k * K + l] = Q[k * K + l] + H[(N + k) * size + N + l];
    }
    for (int p = 0; p < ranks_[i]; ++p) {
      for (int k = 0; k < K; ++k) addScaled(W + k * K, along_equations * D[p * K + k], D + p * K, K);
    }
    if (partly_exact) {
      multiply(moving, W, K, K, K, work);
      multiply(work, moving, K, K, K, W);
      for (int k = 0; k < K; ++k) {
        addScaled(W + k * K, -1, moving + k * K, K);
        W[k * K + k] += 1;
      }
    }
    return choleskyFactor(W, K);
  };
  if (!factorised()) {
    along_equations = 100 * (1 + largest / smallest);
    if (!factorised()) {
      ++misplaced_;
      return addPlain();
    }
  }
  // Δε = W⁻¹ (first - D̂ᵀ λ), D̂ Δε = second; columns: δ, and 1.
  for (int k = 0; k < K; ++k) {
    for (int j = 0; j < N; ++j) first[k * cols + j] = -H[(N + k) * size + j];
    first[k * cols + N] = -dot(Q + k * K, at, K);
    for (int p = 0; p < P; ++p) response[k * P + p] = D[p * K + k];
  }
  if (partly_exact) {
    std::copy_n(first, K * cols, work);
    multiply(moving, work, K, K, cols, first);
    std::copy_n(response, K * P, work);
    multiply(moving, work, K, K, P, response);
  }
  choleskySolve(W, K, first, cols);
  choleskySolve(W, K, response, P);
  multiply(D, response, P, K, P, S);
  for (int k = ranks_[i]; k < P; ++k) S[k * P + k] = 1;  // equations that were left out
  if (!choleskyFactor(S, P)) return addPlain();
  multiply(D, first, P, K, cols, lambda);
  for (int p = 0; p < P; ++p) {
    addScaled(lambda + p * cols, 1, C + p * N, N);
    lambda[p * cols + N] += value[p];
  }
  choleskySolve(S, P, lambda, cols);
  for (int k = 0; k < K; ++k) {
    for (int p = 0; p < P; ++p) addScaled(first + k * cols, -response[k * P + p], lambda + p * cols, cols);
  }
  for (int p = 0; p < P; ++p) {
    addScaled(lambda + p * cols, -along_equations, C + p * N, N);
    lambda[p * cols + N] -= along_equations * value[p];
  }
  // H_qq δ + H_qm Δε + Ĉᵀ λ = A δ - b.
  for (int j = 0; j < N; ++j) {
    const auto add = [&](double factor, const double* row) {
      addScaled(A[j], factor, row, N);
      b[number(j)] -= factor * row[N];
    };
    addScaled(A[j], 1, H + j * size, N);
    for (int k = 0; k < K; ++k) add(H[j * size + N + k], first + k * cols);
    for (int p = 0; p < P; ++p) add(C[p * N + j], lambda + p * cols);
  }
  double *slope = block(slope_, i, K * N), *base = block(base_, i, K);
  for (int k = 0; k < K; ++k) {
    std::copy_n(first + k * cols, N, slope + k * N);
    base[k] = at[k] + first[k * cols + N];
  }
  curved_[i] = 1;
}

/// linearize() with the curvature of all equations and constraints under their multipliers.
/// False if something is not finite.
LIESTAT_ESTIMATION_INLINE bool ConstrainedCore::linearizeCurved(void* problem, CurvatureSums* sums) {
  Rows A(N, N);
  Numbers b(number(N));
  if (hasPrior()) {
    Numbers row(number(N));
    for (int i = 0; i < N; ++i) {
      const double* Q = settings_.prior_information.data() + i * N;
      std::fill(row.begin(), row.end(), 0.);
      for (int k = 0; k < N; ++k) addScaled(row.data(), Q[k], prior_J_[k], N);
      for (int j = 0; j < N; ++j) addScaled(A[j], prior_J_[i][j], row.data(), N);
      b[number(i)] = -prior_slope_[number(i)];
    }
  }
  const double h = differenceStep(problem);
  for (ConstrainedChannel& channel : channels_) channel.linearizeCurved(parameter_, problem, h, A, b, sums);
  if (P > 0) {
    const std::vector<Rows> curvatures = constraintCurvatures(problem, h);
    for (int p = 0; p < P; ++p) {
      for (int i = 0; i < N; ++i) addScaled(A[i], constraint_multipliers_[number(p)], curvatures[number(p)][i], N);
    }
  }
  if (!allFinite(A) || !allFinite(b)) return false;
  curved_A_ = A, curved_b_ = b;
  curved_system_.compute(A, basis_.freeBasis(), N - basis_.rank(), true);
  return true;
}
LIESTAT_ESTIMATION_INLINE double ConstrainedCore::differenceStep(const void* problem) const {
  if (!parameter_.is_vector) return curvature_step;
  Numbers q(number(N));
  parameter_.coordinates(problem, q.data());
  return curvature_step * differenceScale(q.data(), N);
}
/// The second derivatives of each constraint, in coordinates at the current parameter.
LIESTAT_ESTIMATION_INLINE std::vector<Rows> ConstrainedCore::constraintCurvatures(void* problem, double h) {
  std::vector<Rows> H(number(P), Rows(N, N));
  Rows C(P, N), transport(N, N);
  Numbers shift(number(N)), values(number(P));
  for (int k = 0; k < N; ++k) {
    for (const double sign : {1., -1.}) {
      std::fill(shift.begin(), shift.end(), 0.);
      shift[number(k)] = sign * h;
      parameter_.move(problem, ParameterPoint::current, ParameterPoint::shifted, shift.data());
      parameter_.linearizeConstraint(problem, ParameterPoint::shifted, values.data(), C.data());
      if (!parameter_.is_vector) parameter_.transport(problem, transport.data());
      for (int p = 0; p < P; ++p) {
        const double factor = sign / (2 * h);
        if (parameter_.is_vector) addScaled(H[number(p)][k], factor, C[p], N);
        for (int j = 0; j < N && !parameter_.is_vector; ++j) {
          addScaled(H[number(p)][k], factor * C[p][j], transport[j], N);
        }
      }
    }
  }
  for (Rows& one : H) {
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < i; ++j) one[i][j] = one[j][i] = 0.5 * (one[i][j] + one[j][i]);
    }
  }
  return H;
}

/// The directions that A determines, and how the constraints bend them. Coordinates that no measurement has, such as
/// slack variables, take up what they can.
LIESTAT_ESTIMATION_INLINE CurvatureSums ConstrainedCore::curvatureSums(void* problem) {
  Rows directions = system_.determinedBasis();
  const int k = directions.rows();
  Rows bends(k * (k + 1) / 2, N);
  if (P == 0) return {std::move(directions), std::move(bends)};
  const std::vector<Rows> curvatures = constraintCurvatures(problem, differenceStep(problem));
  Rows unmeasured = C_;
  for (int p = 0; p < P; ++p) {
    for (int i = 0; i < N; ++i) unmeasured[p][i] *= A_[i][i] == 0;
  }
  ConstraintBasis slack(N, P);
  slack.compute(unmeasured);
  Numbers values(number(P)), step(number(N));
  for (int a = 0, row = 0; a < k; ++a) {
    for (int b = 0; b <= a; ++b, ++row) {
      for (int p = 0; p < P; ++p) {
        values[number(p)] = 0;
        for (int i = 0; i < N; ++i) {
          values[number(p)] += directions[a][i] * dot(curvatures[number(p)][i], directions[b], N);
        }
      }
      slack.shortest(values, -1, step);
      addScaled(bends[row], 1, step.data(), N);
      for (int p = 0; p < P; ++p) values[number(p)] += dot(C_[p], step.data(), N);
      basis_.shortest(values, -1, step);
      addScaled(bends[row], 1, step.data(), N);
    }
  }
  return {std::move(directions), std::move(bends)};
}

/// Root mean squares over all directions, times the radius of the 95 % region (Bates and Watts 1980).
LIESTAT_ESTIMATION_INLINE void ConstrainedCore::setCurvature(const CurvatureSums& sums) {
  const int k = sums.directions.rows();
  if (!sums.known || k == 0) return;
  double tangent = 0;
  for (int c = 0; c < k; ++c) {
    double trace = 0;
    for (int j = 0; j < k * k; ++j) tangent += 2 * sums.tangent[j][c] * sums.tangent[j][c];
    for (int j = 0; j < k; ++j) trace += sums.tangent[j * (k + 1)][c];
    tangent += trace * trace;
  }
  double low = 0, high = 10. * k + 10;
  for (int step = 0; step < 60; ++step) {
    const double middle = (low + high) / 2;
    (chiSquaredTail(middle, number(k)) > 0.05 ? low : high) = middle;
  }
  const double scale = low / (k * (k + 2));
  RelativeCurvature& found = result_.relative_curvature;
  found.parameter = std::sqrt(scale * tangent);
  found.intrinsic = std::sqrt(scale * std::max(0., sums.total - tangent));
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> spread(k, k);
  for (int i = 0; i < k; ++i) {
    for (int j = 0; j < k; ++j) spread(i, j) = sums.spread[i][j];
  }
  found.noise_share = SymmetricEigen<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>>(spread).values[k - 1];
  found.bias = norm(sums.bias);
}

}  // namespace liestat::detail
