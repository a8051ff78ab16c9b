// Score tests of covariances against alternatives that no list of conventions holds: C_i → (I + ε E_i) C_i (I + ε E_i)ᵀ
// with a constant E, with one that is linear in the pose, and with some of one degree of freedom. A hypothesis that is
// merely the nearest of a list is refuted by them, while the seven tests of whitened residuals see sums over all poses
// alone.
#pragma once

#include <fusion/convention_diagnosis_types.hpp>
#include <fusion/trajectories/detail/repaired_matrices.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/trig.hpp>
#include <stats/laws.hpp>
#include <stats/whitened_residuals.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat::detail {

/// An independent error with its covariance, and the true pose, of which alternatives are functions: those of an
/// estimate would go with its error.
struct PosedResidual {
  PoseResidual residual;
  SE3d pose;
};

/// Directions E of one group: scores q_k = zᵀ S_k z - tr S_k with z = L⁻¹x, S_k the symmetric part of L⁻¹ E_k L. They
/// have mean zero and covariance 2 Σ tr(S_k S_l) if the errors are normal with the covariances C = L Lᵀ.
class ScoreGroup {
 public:
  static constexpr int max_size = 27, entries = 21;
  using Directions = Eigen::Matrix<double, Eigen::Dynamic, entries, 0, max_size, entries>;  // rows: S_k, packed
  using Scores = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_size, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_size, max_size>;

  explicit ScoreGroup(int size) : sum_(Scores::Zero(size)), information_(Square::Zero(size, size)) {}

  void add(const Directions& S, const Scores& q) {
    sum_ += q;
    information_.selfadjointView<Eigen::Lower>().rankUpdate(S, 2);
    rows_.push_back(S);
  }
  /// The p-value of sᵀ I⁺ s, whose variance is χ²'s and a sum of fourth cumulants: Σ 48 tr (Σ_k S_k²)² at most, for
  /// whitened directions. A scaled χ² has both moments. Directions that depend on those before them are left out.
  double p() const {
    const Eigen::Index size = sum_.size();
    Square L = Square::Zero(size, size);
    std::vector<Eigen::Index> kept;
    for (Eigen::Index i = 0; i < size; ++i) {
      double pivot = information_(i, i);
      for (const Eigen::Index k : kept) {
        double dot = information_(i, k);
        for (const Eigen::Index j : kept) {
          if (j == k) break;
          dot -= L(i, j) * L(k, j);
        }
        L(i, k) = dot / L(k, k), pivot -= L(i, k) * L(i, k);
      }
      if (!(pivot > 1e-9 * information_(i, i))) continue;
      L(i, i) = std::sqrt(pivot);
      kept.push_back(i);
    }
    if (kept.empty()) return 1;
    const auto whiten = [&](auto& rows) {
      for (const Eigen::Index i : kept) {
        for (const Eigen::Index k : kept) {
          if (k == i) break;
          rows.row(i) -= L(i, k) * rows.row(k);
        }
        rows.row(i) /= L(i, i);
      }
    };
    Scores score = sum_;
    whiten(score);
    double statistic = 0;
    for (const Eigen::Index i : kept) statistic += score[i] * score[i];
    const auto mean = static_cast<double>(kept.size());
    double variance = 2 * mean;
    for (Directions S : rows_) {
      whiten(S);
      Matrix6d squares = Matrix6d::Zero();
      for (const Eigen::Index i : kept) {
        const Matrix6d M = unpacked(S.row(i));
        squares += product(M, M);
      }
      variance += 48 * squares.squaredNorm();
    }
    return chiSquaredSurvival(statistic * 2 * mean / variance, 2 * mean * mean / variance);
  }

  static Eigen::Matrix<double, 1, entries> packed(const Matrix6d& S) {
    Eigen::Matrix<double, 1, entries> v;
    int k = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) v[k++] = i == j ? S(i, i) : std::sqrt(0.5) * (S(i, j) + S(j, i));
    }
    return v;
  }

 private:
  static Matrix6d unpacked(const Eigen::Matrix<double, 1, entries>& v) {
    Matrix6d S;
    int k = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j, ++k) S(i, j) = S(j, i) = i == j ? v[k] : std::sqrt(0.5) * v[k];
    }
    return S;
  }

  Scores sum_;
  Square information_;
  std::vector<Directions> rows_;
};

/// The smallest p-value of all groups, times their number: the probability that covariances which are right look so
/// wrong. At most 2000 poses, evenly spaced, are used. Left-out components are in no direction; without a cross block
/// none joins the two halves. NaN if a covariance is not positive definite.
inline double genericMisfit(std::span<const PosedResidual> residuals, const NoiseComponents& components,
                            bool blocks_only) {
  using Scores = ScoreGroup::Scores;
  constexpr std::size_t most = 2000;
  const std::size_t used = std::min(residuals.size(), most);
  if (used == 0) return not_a_number;
  // Constant E by blocks, E linear in the rotation vector r or in the position p, one degree of freedom each.
  constexpr int constant[] = {9, 9, 18}, linear = 27, n_single = 21;
  std::vector<ScoreGroup> groups;
  for (const int size : constant) groups.emplace_back(size);
  for (int k = 0; k < 3; ++k) groups.emplace_back(linear);
  for (int k = 0; k < n_single; ++k) groups.emplace_back(1);
  const auto joins = [](std::size_t group) {
    return group == 2 || (group >= 5 && group < 10) || group == 13 || group == 14;
  };
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const PosedResidual& r : residuals) centre += r.pose.translation() / static_cast<double>(residuals.size());
  double log_sizes = 0;
  std::vector<double> sizes;
  for (const PosedResidual& r : residuals) {
    double size = 0;
    for (int k = 0; k < 6; ++k) size += components.keeps(k) ? std::log(r.residual.covariance(k, k)) : 0;
    sizes.push_back(size), log_sizes += size / static_cast<double>(residuals.size());
  }
  for (std::size_t n = 0; n < used; ++n) {
    const std::size_t i = n * residuals.size() / used;
    const Matrix6d& C = residuals[i].residual.covariance;
    const Cholesky<double, 6> root(C);
    if (!root.ok()) return not_a_number;
    const Matrix6d L_inverse = root.halfSolve<6>(Matrix6d::Identity()), Lt = root.halfSolve<6>(C);
    const Vector6d z = root.halfSolve<1>(residuals[i].residual.error);
    const Eigen::Vector3d r = residuals[i].pose.so3().log(), p = residuals[i].pose.translation() - centre;
    Eigen::Matrix<double, 36, ScoreGroup::entries> S;
    Eigen::Matrix<double, 36, 1> q;
    for (int a = 0; a < 6; ++a) {
      for (int b = 0; b < 6; ++b) {
        const bool kept = components.keeps(a) && components.keeps(b);
        const Matrix6d E = L_inverse.col(a) * Lt.col(b).transpose();
        S.row(6 * a + b) = kept ? ScoreGroup::packed(E) : Eigen::Matrix<double, 1, ScoreGroup::entries>::Zero();
        q[6 * a + b] = kept ? z.dot(L_inverse.col(a)) * Lt.col(b).dot(z) - Lt.col(b).dot(L_inverse.col(a)) : 0;
      }
    }
    ScoreGroup::Directions D;
    Scores s;
    const auto add = [&](std::size_t group, std::initializer_list<std::array<int, 2>> corners, const double* by) {
      const auto size = static_cast<Eigen::Index>(corners.size()) * (by ? 27 : 9);
      D.resize(size, ScoreGroup::entries), s.resize(size);
      Eigen::Index k = 0;
      for (const auto& [row, column] : corners) {
        for (int a = row; a < row + 3; ++a) {
          for (int b = column; b < column + 3; ++b) {
            for (int j = 0; j < (by ? 3 : 1); ++j, ++k) {
              D.row(k) = (by ? by[j] : 1) * S.row(6 * a + b), s[k] = (by ? by[j] : 1) * q[6 * a + b];
            }
          }
        }
      }
      groups[group].add(D, s);
    };
    add(0, {{0, 0}}, nullptr), add(1, {{3, 3}}, nullptr), add(2, {{0, 3}, {3, 0}}, nullptr);
    add(3, {{3, 3}}, r.data()), add(4, {{0, 0}}, r.data()), add(5, {{0, 3}}, p.data());
    const auto single = [&](std::size_t group, const Matrix6d& E) {
      D.setZero(1, ScoreGroup::entries), s.setZero(1);
      for (int a = 0; a < 6; ++a) {
        for (int b = 0; b < 6; ++b) D.row(0) += E(a, b) * S.row(6 * a + b), s[0] += E(a, b) * q[6 * a + b];
      }
      groups[group].add(D, s);
    };
    // A symmetric change of C itself, δC = X: E = X C⁻¹ / 2.
    const auto change = [&](std::size_t group, const Matrix6d& X) {
      const Matrix6d W = product(product(L_inverse, X), Matrix6d(L_inverse.transpose()));
      D.resize(1, ScoreGroup::entries), s.resize(1);
      D.row(0) = 0.5 * ScoreGroup::packed(W), s[0] = 0.5 * (z.dot(W * z) - W.trace());
      groups[group].add(D, s);
    };
    Matrix6d off = C, cross = C - withoutCross(C), E = Matrix6d::Zero();
    off.diagonal().setZero();
    const Eigen::Matrix3d turn = skew(r), lever = skew(p);
    E.bottomRightCorner<3, 3>() = turn;
    single(10, E);
    E.topLeftCorner<3, 3>() = turn;
    single(6, E);  // both halves together, which a lost cross block spoils
    E.bottomRightCorner<3, 3>().setZero();
    single(11, E);
    E.setZero(), E.topRightCorner<3, 3>() = lever;
    single(7, E);
    E.topRightCorner<3, 3>() = skew(Eigen::Vector3d(residuals[i].pose.so3().inverse() * p));
    single(8, E);
    change(9, cross);
    change(12, blocks_only ? Matrix6d(off - cross) : off);
    // The scales of each block's off-diagonals, which a common one hides.
    Matrix6d half = Matrix6d::Zero();
    half.topLeftCorner<3, 3>() = off.topLeftCorner<3, 3>();
    change(25, half);
    half.setZero(), half.bottomRightCorner<3, 3>() = off.bottomRightCorner<3, 3>();
    change(26, half);
    // Rows: a scale that goes with time, and with what the matrices say.
    change(13, (static_cast<double>(n) / static_cast<double>(used) - 0.5) * C);
    change(14, (sizes[i] - log_sizes) * C);
    // A heading in place of the whole rotation, and angles whose scale goes with the angle.
    const Eigen::Matrix3d heading = skew(Eigen::Vector3d(0, 0, r[2]));
    E.setZero(), E.topLeftCorner<3, 3>() = heading;
    single(21, E);
    E.setZero(), E.bottomRightCorner<3, 3>() = heading;
    single(22, E);
    E.bottomRightCorner<3, 3>() = r.squaredNorm() * Eigen::Matrix3d::Identity();
    single(23, E);
    E.bottomRightCorner<3, 3>() = r * r.transpose();
    single(24, E);
    for (int k = 0; k < 6; ++k) single(15 + static_cast<std::size_t>(k), Matrix6d(Vector6d::Unit(k).asDiagonal()));
  }
  double least = 1;
  std::size_t tests = 0;
  for (std::size_t k = 0; k < groups.size(); ++k) {
    if (blocks_only && joins(k)) continue;
    ++tests;
    least = std::min(least, groups[k].p());
  }
  return std::min(1., least * static_cast<double>(tests));
}

}  // namespace liestat::detail
