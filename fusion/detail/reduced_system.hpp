// Nonlinear least squares over a few shared unknowns and many features, each of which is eliminated by itself: the
// reduced normal equations.
//
// Unknowns come in blocks of three. Sizes are run-time numbers and everything is plain loops, which a compiler reads in
// no time; buffers are made once.
#pragma once

#include <fusion/detail/closed_form_blocks.hpp>
#include <fusion/detail/levenberg_marquardt.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat::detail {

/// Up to nine residuals, in sigmas, with their derivatives by up to thirteen blocks of three shared unknowns.
struct ResidualRows {
  static constexpr int most = 9, most_blocks = 13;
  int rows = 0, terms = 0;
  std::array<int, most_blocks> block;
  std::array<std::array<double, 3 * most_blocks>, most> by;  ///< [residual][3 · term + k]
  std::array<double, most> value;

  explicit ResidualRows(int count) : rows(count) {}
  /// A derivative J (rows × 3).
  template <class Matrix>
  void add(int of_block, const Matrix& J) {
    for (int i = 0; i < rows; ++i) {
      for (int k = 0; k < 3; ++k) {
        const int column = 3 * terms + k;
        by[static_cast<std::size_t>(i)][static_cast<std::size_t>(column)] = J(i, k);
      }
    }
    block[static_cast<std::size_t>(terms++)] = of_block;
  }
  double squared() const {
    double sum = 0;
    for (int i = 0; i < rows; ++i) sum += value[static_cast<std::size_t>(i)] * value[static_cast<std::size_t>(i)];
    return sum;
  }
};

/// The normal equations, with features apart.
class ReducedSystem {
 public:
  ReducedSystem(int blocks, std::size_t features)
      : n_(3 * blocks), H_(square(n_)), reduced_(square(n_)), g_(size(n_)), step_(size(n_)), features_(features) {
    for (Feature& f : features_) {
      f.cross.assign(3 * size(n_), 0);
      f.has.assign(size(blocks), false);
    }
  }

  void clear() {
    std::fill(H_.begin(), H_.end(), 0.);
    std::fill(g_.begin(), g_.end(), 0.);
    for (Feature& f : features_) {
      f.H.setZero();
      f.g.setZero();
      std::fill(f.cross.begin(), f.cross.end(), 0.);
      std::fill(f.has.begin(), f.has.end(), false);
      f.blocks.clear();
    }
  }
  void add(const ResidualRows& rows) {
    for (int a = 0; a < rows.terms; ++a) {
      const int i = 3 * rows.block[size(a)];
      for (int k = 0; k < 3; ++k) {
        for (int r = 0; r < rows.rows; ++r) g_[size(i + k)] += rows.by[size(r)][size(3 * a + k)] * rows.value[size(r)];
      }
      for (int b = 0; b < rows.terms; ++b) {
        const int j = 3 * rows.block[size(b)];
        if (j < i) continue;
        for (int r = 0; r < rows.rows; ++r) {
          const double *left = &rows.by[size(r)][size(3 * a)], *right = &rows.by[size(r)][size(3 * b)];
          for (int k = 0; k < 3; ++k) {
            double* to = &H_[at(i + k, j)];
            for (int l = 0; l < 3; ++l) to[l] += left[k] * right[l];
          }
        }
      }
    }
  }
  /// Residuals that depend on a feature's position too.
  template <class Matrix>
  void add(const ResidualRows& rows, std::size_t feature, const Matrix& by_position) {
    add(rows);
    Feature& f = features_[feature];
    for (int r = 0; r < rows.rows; ++r) {
      const Eigen::Vector3d J = by_position.row(r).transpose();
      f.H += J * J.transpose();
      f.g += rows.value[size(r)] * J;
    }
    for (int a = 0; a < rows.terms; ++a) {
      const int block = rows.block[size(a)];
      if (!f.has[size(block)]) {
        f.has[size(block)] = true;
        f.blocks.push_back(block);
      }
      double* to = &f.cross[9 * size(block)];
      for (int r = 0; r < rows.rows; ++r) {
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 3; ++l) to[3 * k + l] += by_position(r, k) * rows.by[size(r)][size(3 * a + l)];
        }
      }
    }
  }

  /// Eliminates the features and factors what is left, diagonals enlarged by the factor 1 + damping; false where that
  /// is not positive definite.
  bool factor(double damping) {
    reduced_ = H_;
    step_ = g_;
    for (int i = 0; i < n_; ++i) reduced_[at(i, i)] *= 1 + damping;
    for (Feature& f : features_) {
      Eigen::Matrix3d H = f.H;
      H.diagonal() *= 1 + damping;
      int rank = 0;
      f.inverse = featureCovariance(H, rank);
      f.gain.resize(9 * f.blocks.size());
      std::sort(f.blocks.begin(), f.blocks.end());
      const Eigen::Vector3d p = f.inverse * f.g;
      for (std::size_t b = 0; b < f.blocks.size(); ++b) {
        const double* cross = &f.cross[9 * size(f.blocks[b])];
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 3; ++l) {
            f.gain[9 * b + size(3 * k + l)] =
                f.inverse(k, 0) * cross[l] + f.inverse(k, 1) * cross[3 + l] + f.inverse(k, 2) * cross[6 + l];
          }
        }
        const int i = 3 * f.blocks[b];
        for (int l = 0; l < 3; ++l) step_[size(i + l)] -= cross[l] * p[0] + cross[3 + l] * p[1] + cross[6 + l] * p[2];
      }
      for (std::size_t a = 0; a < f.blocks.size(); ++a) {
        const double* left = &f.cross[9 * size(f.blocks[a])];
        for (std::size_t b = a; b < f.blocks.size(); ++b) {
          const double* gain = &f.gain[9 * b];
          for (int k = 0; k < 3; ++k) {
            double* to = &reduced_[at(3 * f.blocks[a] + k, 3 * f.blocks[b])];
            for (int l = 0; l < 3; ++l) {
              to[l] -= left[k] * gain[l] + left[3 + k] * gain[3 + l] + left[6 + k] * gain[6 + l];
            }
          }
        }
      }
    }
    return cholesky();
  }

  /// The step that goes with the factor; −1 times the solution of the normal equations' gradient.
  const std::vector<double>& solve() {
    solve(step_);
    for (double& x : step_) x = -x;
    return step_;
  }
  Eigen::Vector3d shared(int block) const {
    return Eigen::Vector3d(step_[size(3 * block)], step_[size(3 * block + 1)], step_[size(3 * block + 2)]);
  }
  Eigen::Vector3d feature(std::size_t i) const {
    const Feature& f = features_[i];
    Eigen::Vector3d p = -(f.inverse * f.g);
    for (std::size_t b = 0; b < f.blocks.size(); ++b) {
      const double* gain = &f.gain[9 * b];
      const Eigen::Vector3d x = shared(f.blocks[b]);
      for (int k = 0; k < 3; ++k) p[k] -= gain[3 * k] * x[0] + gain[3 * k + 1] * x[1] + gain[3 * k + 2] * x[2];
    }
    return p;
  }
  /// The block of the inverse for the given blocks of unknowns, row by row.
  std::vector<double> inverse(const std::vector<int>& blocks) const {
    const std::size_t m = 3 * blocks.size();
    std::vector<double> result(m * m), column(size(n_));
    for (std::size_t c = 0; c < m; ++c) {
      std::fill(column.begin(), column.end(), 0.);
      column[3 * size(blocks[c / 3]) + c % 3] = 1;
      solve(column);
      for (std::size_t r = 0; r < m; ++r) result[r * m + c] = column[3 * size(blocks[r / 3]) + r % 3];
    }
    return result;
  }

  /// The variance of a linear function of the shared unknowns, by its gradient: after factor(0).
  double variance(const std::vector<double>& gradient) const {
    std::vector<double> x = gradient;
    solve(x);
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * gradient[i];
    return sum;
  }

 private:
  struct Feature {
    Eigen::Matrix3d H, inverse;
    Eigen::Vector3d g;
    std::vector<double> cross, gain;  ///< 3×3 by block; of all blocks, of those that it has
    std::vector<int> blocks;
    std::vector<bool> has;
  };

  static std::size_t size(int i) { return static_cast<std::size_t>(i); }
  static std::size_t square(int i) { return size(i) * size(i); }
  std::size_t at(int i, int j) const { return size(i) * size(n_) + size(j); }

  /// reduced = Uᵀ U in place of its upper triangle, three rows at a time: what is left is read a third as often.
  bool cholesky() {
    for (int k = 0; k < n_; k += 3) {
      double *first = &reduced_[at(k, 0)], *second = first + n_, *third = second + n_;
      if (!normalise(first, k)) return false;
      for (int j = k + 1; j < n_; ++j) second[j] -= first[k + 1] * first[j];
      if (!normalise(second, k + 1)) return false;
      for (int j = k + 2; j < n_; ++j) third[j] -= first[k + 2] * first[j] + second[k + 2] * second[j];
      if (!normalise(third, k + 2)) return false;
      for (int i = k + 3; i < n_; ++i) {
        const double a = first[i], b = second[i], c = third[i];
        if (a == 0 && b == 0 && c == 0) continue;
        double* row = &reduced_[at(i, 0)];
        for (int j = i; j < n_; ++j) row[j] -= a * first[j] + b * second[j] + c * third[j];
      }
    }
    return true;
  }
  /// Divides a row by the root of its pivot, unless that is not positive.
  bool normalise(double* row, int k) const {
    if (!(row[k] > 0) || !std::isfinite(row[k])) return false;
    const double scale = 1 / std::sqrt(row[k]);
    for (int j = k; j < n_; ++j) row[j] *= scale;
    return true;
  }
  void solve(std::vector<double>& x) const {
    for (int k = 0; k < n_; ++k) {
      const double* row = &reduced_[at(k, 0)];
      const double value = x[size(k)] /= row[k];
      if (value == 0) continue;
      for (int j = k + 1; j < n_; ++j) x[size(j)] -= row[j] * value;
    }
    for (int k = n_ - 1; k >= 0; --k) {
      const double* row = &reduced_[at(k, 0)];
      double sum = x[size(k)];
      for (int j = k + 1; j < n_; ++j) sum -= row[j] * x[size(j)];
      x[size(k)] = sum / row[k];
    }
  }

  int n_;
  std::vector<double> H_, reduced_, g_, step_;
  std::vector<Feature> features_;
};

/// A problem over a reduced system for minimiseDamped(): `problem` has linearise(system), which fills it and returns
/// the cost, costAfter(system), which takes its step, and accept().
template <class Problem>
struct OnReducedSystem {
  Problem& problem;
  ReducedSystem& system;

  double linearise() { return problem.linearise(system); }
  bool solve(double damping) {
    if (!system.factor(damping)) return false;
    system.solve();
    return true;
  }
  double costAfterStep() { return problem.costAfter(system); }
  void accept() { problem.accept(); }
  void reject() {}
};
template <class Problem>
DampedSummary minimiseDamped(Problem& problem, ReducedSystem& system, const DampedOptions& options) {
  OnReducedSystem<Problem> both{problem, system};
  return minimiseDamped(both, options);
}

}  // namespace liestat::detail
