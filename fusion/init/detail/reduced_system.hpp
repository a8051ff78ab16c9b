// Nonlinear least squares over a few shared unknowns and many features, each of which is eliminated by itself: the
// reduced normal equations.
//
// Unknowns come in blocks of three. Sizes are run-time numbers; buffers are made once. All but the outer products is
// plain loops, which a compiler reads in no time.
#pragma once

#include <fusion/init/detail/closed_form_blocks.hpp>
#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/init/detail/outer_products.hpp>

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
  static constexpr int most = 9, max_blocks = 13;
  int rows = 0, terms = 0;
  std::array<int, max_blocks> block;
  std::array<std::array<double, 3 * max_blocks>, most> by;  ///< [residual][3 · term + k]
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
      : n_(3 * size(blocks)),
        stride_((n_ + pack_size - 1) / pack_size * pack_size),
        H_(n_ * stride_),
        reduced_(n_ * stride_),
        g_(n_),
        step_(n_),
        cross_(3 * features * stride_),
        gain_(3 * features * stride_),
        features_(features),
        order_(features) {}

  void clear() {
    std::fill(H_.begin(), H_.end(), 0.);
    std::fill(g_.begin(), g_.end(), 0.);
    std::fill(cross_.begin(), cross_.end(), 0.);
    std::fill(gain_.begin(), gain_.end(), 0.);
    for (Feature& f : features_) f = Feature();
  }
  void add(const ResidualRows& rows) {
    // Bearings, motions, and the rest.
    if (rows.rows == 2) return addRows<2>(rows);
    if (rows.rows == ResidualRows::most) return addRows<ResidualRows::most>(rows);
    addRows<0>(rows);
  }
  /// Residuals that depend on a feature's position too, by which they have the derivatives by_position.
  template <class Matrix>
  void add(const ResidualRows& rows, std::size_t feature, const Matrix& by_position) {
    add(rows);
    Feature& f = features_[feature];
    for (int r = 0; r < Matrix::RowsAtCompileTime; ++r) {
      const Eigen::Vector3d J = by_position.row(r).transpose();
      f.H += J * J.transpose();
      f.g += rows.value[size(r)] * J;
    }
    for (int a = 0; a < rows.terms; ++a) {
      const std::size_t column = 3 * size(rows.block[size(a)]);
      f.begin = std::min(f.begin, column);
      f.end = std::max(f.end, column + 3);
      for (int k = 0; k < 3; ++k) {
        double* to = crossRow(feature, k) + column;
        for (int r = 0; r < Matrix::RowsAtCompileTime; ++r) {
          for (std::size_t l = 0; l < 3; ++l) to[l] += by_position(r, k) * rows.by[size(r)][3 * size(a) + l];
        }
      }
    }
  }

  /// Eliminates the features and factors what is left, diagonals enlarged by the factor 1 + damping; false where that
  /// is not positive definite.
  bool factor(double damping) {
    reduced_ = H_;
    step_ = g_;
    for (std::size_t i = 0; i < n_; ++i) reduced_[at(i, i)] *= 1 + damping;
    for (std::size_t i = 0; i < features_.size(); ++i) {
      order_[i] = i;
      Feature& f = features_[i];
      Eigen::Matrix3d H = f.H;
      H.diagonal() *= 1 + damping;
      int rank = 0;
      f.inverse = featureCovariance(H, rank);
      const Eigen::Vector3d p = f.inverse * f.g;
      const double *x = crossRow(i, 0), *y = crossRow(i, 1), *z = crossRow(i, 2);
      for (int k = 0; k < 3; ++k) {
        double* gain = gainRow(i, k);
        const double a = f.inverse(k, 0), b = f.inverse(k, 1), c = f.inverse(k, 2);
        for (std::size_t j = f.begin; j < f.end; ++j) gain[j] = a * x[j] + b * y[j] + c * z[j];
      }
      for (std::size_t j = f.begin; j < f.end; ++j) step_[j] -= x[j] * p[0] + y[j] * p[1] + z[j] * p[2];
    }
    eliminate();
    return cholesky();
  }

  /// The step that goes with the factor; −1 times the solution of the normal equations' gradient.
  const std::vector<double>& solve() {
    solve(step_);
    for (double& x : step_) x = -x;
    return step_;
  }
  Eigen::Vector3d shared(int block) const {
    const std::size_t i = 3 * size(block);
    return Eigen::Vector3d(step_[i], step_[i + 1], step_[i + 2]);
  }
  Eigen::Vector3d feature(std::size_t i) const {
    const Feature& f = features_[i];
    Eigen::Vector3d p = -(f.inverse * f.g);
    for (int k = 0; k < 3; ++k) {
      const double* gain = gainRow(i, k);
      for (std::size_t j = f.begin; j < f.end; ++j) p[k] -= gain[j] * step_[j];
    }
    return p;
  }
  /// The block of the inverse for the given blocks of unknowns, row by row.
  std::vector<double> inverse(const std::vector<int>& blocks) const {
    // (Uᵀ U)⁻¹ = Yᵀ Y with Uᵀ Y = E, the unknowns' unit vectors.
    const std::size_t m = 3 * blocks.size();
    std::vector<double> result(m * m);
    std::vector<std::vector<double>> Y(m);
    for (std::size_t c = 0; c < m; ++c) {
      Y[c].assign(n_, 0.);
      Y[c][3 * size(blocks[c / 3]) + c % 3] = 1;
      solveTransposed(Y[c]);
      for (std::size_t r = 0; r <= c; ++r) {
        double sum = 0;
        for (std::size_t i = 0; i < n_; ++i) sum += Y[r][i] * Y[c][i];
        result[r * m + c] = result[c * m + r] = sum;
      }
    }
    return result;
  }

  /// The variance of a linear function of the shared unknowns, by its gradient: after factor(0).
  double variance(const std::vector<double>& gradient) const {
    std::vector<double> x = gradient;
    solveTransposed(x);
    double sum = 0;
    for (const double entry : x) sum += entry * entry;
    return sum;
  }

 private:
  /// Its rows by its position and the shared unknowns are three rows of cross_, zero outside [begin, end).
  struct Feature {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero(), inverse = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    std::size_t begin = std::numeric_limits<std::size_t>::max(), end = 0;
  };
  static constexpr std::size_t pack_size = Pack<InstructionSet::avx512>::size;

  static std::size_t size(int i) { return static_cast<std::size_t>(i); }
  std::size_t at(std::size_t i, std::size_t j) const { return i * stride_ + j; }
  double* crossRow(std::size_t feature, int k) { return &cross_[(3 * feature + size(k)) * stride_]; }
  double* gainRow(std::size_t feature, int k) { return &gain_[(3 * feature + size(k)) * stride_]; }
  const double* gainRow(std::size_t feature, int k) const { return &gain_[(3 * feature + size(k)) * stride_]; }
  OuterProducts products() {
    OuterProducts result;
    result.matrix = reduced_.data();
    result.stride = stride_;
    return result;
  }

  template <int fixed>
  void addRows(const ResidualRows& rows) {
    const int count = fixed > 0 ? fixed : rows.rows;
    for (int a = 0; a < rows.terms; ++a) {
      const std::size_t i = 3 * size(rows.block[size(a)]);
      for (std::size_t k = 0; k < 3; ++k) {
        for (int r = 0; r < count; ++r) g_[i + k] += rows.by[size(r)][3 * size(a) + k] * rows.value[size(r)];
      }
      for (int b = 0; b < rows.terms; ++b) {
        const std::size_t j = 3 * size(rows.block[size(b)]);
        if (j < i) continue;
        std::array<double, 9> sum{};
        for (int r = 0; r < count; ++r) {
          const double *left = &rows.by[size(r)][size(3 * a)], *right = &rows.by[size(r)][size(3 * b)];
          for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t l = 0; l < 3; ++l) sum[3 * k + l] += left[k] * right[l];
          }
        }
        for (std::size_t k = 0; k < 3; ++k) {
          double* to = &H_[at(i + k, j)];
          for (std::size_t l = 0; l < 3; ++l) to[l] += sum[3 * k + l];
        }
      }
    }
  }

  /// Takes the features off the matrix, as many at a time as the kernel takes if they are seen in about the same images.
  void eliminate() {
    std::sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
      const Feature &f = features_[a], &g = features_[b];
      return std::array{f.begin, f.end, a} < std::array{g.begin, g.end, b};
    });
    for (std::size_t from = 0; from < order_.size();) {
      OuterProducts group = products();
      group.begin = features_[order_[from]].begin;
      std::size_t to = from, narrowest = n_;
      for (; to < order_.size() && group.count + 3 <= OuterProducts::most; ++to) {
        const Feature& f = features_[order_[to]];
        if (f.end == 0) break;
        const std::size_t end = std::max(group.columns_end, f.end);
        narrowest = std::min(narrowest, f.end - f.begin);
        if (2 * (end - group.begin) > 3 * narrowest) break;
        group.columns_end = group.rows_end = end;
        for (int k = 0; k < 3; ++k) group.add(crossRow(order_[to], k), gainRow(order_[to], k));
      }
      if (group.count == 0) break;  // those that nothing ties to the shared unknowns come last
      subtract(group);
      from = to;
    }
  }

  /// reduced = Uᵀ U in place of its upper triangle: panels of some rows, whose products are taken off what is left at once.
  bool cholesky() {
    for (std::size_t k = 0; k < n_; k += OuterProducts::most) {
      const std::size_t end = std::min(k + OuterProducts::most, n_);
      OuterProducts panel = products();
      for (std::size_t i = k; i < end; i += 3) {
        if (!factorRows(i)) return false;
        OuterProducts rows = products();
        rows.begin = i + 3, rows.rows_end = end, rows.columns_end = n_;
        for (std::size_t r = i; r < i + 3; ++r) {
          rows.add(&reduced_[at(r, 0)], &reduced_[at(r, 0)]);
          panel.add(&reduced_[at(r, 0)], &reduced_[at(r, 0)]);
        }
        subtract(rows);
      }
      panel.begin = end, panel.rows_end = panel.columns_end = n_;
      subtract(panel);
    }
    return true;
  }
  /// Three rows of the factor.
  bool factorRows(std::size_t k) {
    double *first = &reduced_[at(k, 0)], *second = first + stride_, *third = second + stride_;
    if (!normalise(first, k)) return false;
    for (std::size_t j = k + 1; j < n_; ++j) second[j] -= first[k + 1] * first[j];
    if (!normalise(second, k + 1)) return false;
    for (std::size_t j = k + 2; j < n_; ++j) third[j] -= first[k + 2] * first[j] + second[k + 2] * second[j];
    return normalise(third, k + 2);
  }
  /// Divides a row by the root of its pivot, unless that is not positive.
  bool normalise(double* row, std::size_t k) const {
    if (!(row[k] > 0) || !std::isfinite(row[k])) return false;
    const double scale = 1 / std::sqrt(row[k]);
    for (std::size_t j = k; j < n_; ++j) row[j] *= scale;
    return true;
  }
  /// x ← U⁻ᵀ x.
  void solveTransposed(std::vector<double>& x) const {
    for (std::size_t k = 0; k < n_; ++k) {
      const double* row = &reduced_[at(k, 0)];
      const double value = x[k] /= row[k];
      if (value == 0) continue;
      for (std::size_t j = k + 1; j < n_; ++j) x[j] -= row[j] * value;
    }
  }
  void solve(std::vector<double>& x) const {
    solveTransposed(x);
    for (std::size_t k = n_; k-- > 0;) {
      const double* row = &reduced_[at(k, 0)];
      double sum = x[k];
      for (std::size_t j = k + 1; j < n_; ++j) sum -= row[j] * x[j];
      x[k] = sum / row[k];
    }
  }

  std::size_t n_, stride_;  ///< shared unknowns; numbers from row to row, whole packs
  std::vector<double> H_, reduced_, g_, step_, cross_, gain_;
  std::vector<Feature> features_;
  std::vector<std::size_t> order_;
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
