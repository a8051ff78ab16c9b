// The kinds of matrices that are estimated robustly (homography, fundamental, essential): solver, coordinates of the
// entries, the step by sums over matches, and the model that a search takes.
#pragma once

#include <fusion/two_view/detail/match_columns.hpp>
#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/detail/seven_points.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/robust.hpp>
#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/trig.hpp>
#include <lie/essential.hpp>
#include <stats/robust.hpp>
#include <stats/robust_search.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace liestat::detail {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

inline Vector9 entriesOf(const Eigen::Matrix3d& M) { return Eigen::Map<const Vector9>(M.data()); }

/// Coordinates of a matrix: the derivatives of its entries by them, and the direction in which only its norm changes.
template <int K>
struct EntryTangent {
  Eigen::Matrix<double, 9, K> entries;
  Eigen::Matrix<double, K, 1> norm = Eigen::Matrix<double, K, 1>::Zero();
  Eigen::Matrix3d left, right;  ///< the frames in which they are taken

  /// Zᵀ A Z, and something for the norm, of which the matches say nothing.
  Cholesky<double, K> factor(const EntrySums& sums) const {
    Eigen::Matrix<double, K, K> A = product(entries.transpose(), product(sums.matrix(), entries));
    A += A.trace() * norm * norm.transpose();
    return Cholesky<double, K>(A);
  }
};

/// A unit vector times a length, as the last of an orthonormal basis.
inline Eigen::Matrix3d basisBefore(const Eigen::Vector3d& last) {
  const Eigen::Vector3d n = last.normalized();
  const Eigen::Vector3d p =
      (std::abs(n.x()) < 0.6 ? Eigen::Vector3d(0, n.z(), -n.y()) : Eigen::Vector3d(-n.z(), 0, n.x())).normalized();
  Eigen::Matrix3d U;
  U << p, n.cross(p), n;
  return U;
}

/// Homographies: their nine entries, ‖H‖² = 3.
struct HomographyKind {
  using Equation = HomographyColumns;
  static constexpr std::size_t sample_size = 4;
  static constexpr int equations = 2, coordinates = 9;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    for (const Eigen::Matrix3d& H : solveHomography(sample)) solutions.push_back(H);
  }
  static EntryTangent<9> tangent(const Eigen::Matrix3d& H) {
    return {Matrix9::Identity(), entriesOf(H) / H.norm(), {}, {}};
  }
  /// Those behind have infinite errors.
  static void markBehind(const Eigen::Matrix3d&, std::span<const Eigen::Vector4d>, const MatchNoise&,
                         std::span<const double>, double, std::span<unsigned char>) {}
  static void move(Eigen::Matrix3d& H, const EntryTangent<9>&, const Vector9& delta) {
    H += Eigen::Map<const Eigen::Matrix3d>(delta.data());
    H *= std::sqrt(3 / H.squaredNorm());
  }
};

/// Fundamental matrices: F = U [B a; bᵀ bᵀB⁻¹a] Vᵀ; U and V end with the null vectors, where a = b = 0.
struct FundamentalKind {
  using Equation = EpipolarColumns;
  static constexpr std::size_t sample_size = 7;
  static constexpr int equations = 1, coordinates = 8;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    solveSevenPoints(sample, [&](const Eigen::Matrix3d& F) {
      if (isOriented(F, sample)) solutions.push_back(F);
    });
  }
  static EntryTangent<8> tangent(const Eigen::Matrix3d& F) {
    EntryTangent<8> t;
    t.left = basisBefore(rightNullVector(F.transpose())), t.right = basisBefore(rightNullVector(F));
    for (int k = 0; k < 8; ++k) {
      for (int j = 0; j < 3; ++j) t.entries.block<3, 1>(3 * j, k) = t.right(j, k / 3) * t.left.col(k % 3);
    }
    t.norm = product(t.entries.transpose(), entriesOf(F)) / F.norm();
    return t;
  }
  /// Matches that lie behind one of the views: (e' × ũ')·(F ũ) has not the sign of most.
  static void markBehind(const Eigen::Matrix3d& F, std::span<const Eigen::Vector4d> matches, const MatchNoise&,
                         std::span<const double> errors, double threshold, std::span<unsigned char> behind) {
    const Eigen::Vector3d epipole = rightNullVector(F.transpose());
    std::ptrdiff_t balance = 0;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector4d& m = matches[i];
      const double side = epipole.cross(Eigen::Vector3d(m[2], m[3], 1)).dot(F * Eigen::Vector3d(m[0], m[1], 1));
      behind[i] = side < 0 ? 1 : 0;
      if (errors[i] < threshold) balance += side < 0 ? 1 : -1;
    }
    if (balance <= 0) return;
    for (unsigned char& flag : behind) flag = 1 - flag;
  }
  static void move(Eigen::Matrix3d& F, const EntryTangent<8>& t, const Eigen::Matrix<double, 8, 1>& delta) {
    const Eigen::Matrix<double, 8, 1> f = t.norm * F.norm() + delta;
    const double det = f[0] * f[4] - f[1] * f[3];
    Eigen::Matrix3d G;
    G << f[0], f[3], f[6], f[1], f[4], f[7], f[2], f[5],
        (f[2] * (f[4] * f[6] - f[3] * f[7]) + f[5] * (f[0] * f[7] - f[1] * f[6])) / det;
    F = product(t.left, productTransposed(G, t.right));
    F *= std::sqrt(2 / F.squaredNorm());
  }
};

/// Essential matrices [t]× R.
struct EssentialKind {
  using Equation = EpipolarColumns;
  static constexpr std::size_t sample_size = 5;
  static constexpr int equations = 1, coordinates = 5;

  static void solve(std::span<const Eigen::Vector4d> sample, std::vector<Eigen::Matrix3d>& solutions) {
    for (const Eigen::Matrix3d& E : solveEssential(sample)) {
      if (isOriented(E, sample)) solutions.push_back(E);
    }
  }
  /// t moves by the two axes across it, R is turned from the left.
  static EntryTangent<5> tangent(const Eigen::Matrix3d& E) {
    const EssentialParts<double> parts = essentialParts(E);
    EntryTangent<5> tangent;
    tangent.left = basisBefore(parts.direction), tangent.right = parts.rotation;
    const Eigen::Vector3d t = tangent.left.col(2);
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d r = tangent.right.col(j);
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector3d axis = tangent.left.col(k);
        tangent.entries.block<3, 1>(3 * j, k) = axis.cross(r);
      }
      // t × (e × r) = e (t·r) - r (t·e).
      tangent.entries.block<3, 3>(3 * j, 2) = t.dot(r) * Eigen::Matrix3d::Identity() - r * t.transpose();
    }
    return tangent;
  }
  /// Matches whose point lies behind a view, for the pose that has most in front, by a parallax of more than the noise.
  static void markBehind(const Eigen::Matrix3d& E, std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                         std::span<const double> errors, double threshold, std::span<unsigned char> behind) {
    const double least = 3 * std::sqrt(noise.first * noise.first + noise.second * noise.second);
    const Solutions<TwoViewPose, 4> poses = posesOfEssential(E);
    if (poses.empty()) return;
    std::ptrdiff_t balance[2] = {0, 0};
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!(errors[i] < threshold)) continue;
      for (std::size_t k = 0; k < 2; ++k) balance[k] += sideOf(poses[k], matches[i], least);
    }
    const std::size_t twist = std::abs(balance[1]) > std::abs(balance[0]) ? 1 : 0;
    const int front = balance[twist] < 0 ? -1 : 1;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector4d& m = matches[i];
      if (!(errors[i] < threshold) || sideOf(poses[twist], m, least) == front) {
        behind[i] = 0;
        continue;
      }
      const Eigen::Vector3d v(m[2], m[3], 1), y = poses[twist].R * Eigen::Vector3d(m[0], m[1], 1);
      behind[i] = y.cross(v).squaredNorm() > least * least * y.squaredNorm() * v.squaredNorm() ? 1 : 0;
    }
  }
  static void move(Eigen::Matrix3d& E, const EntryTangent<5>& tangent, const Eigen::Matrix<double, 5, 1>& delta) {
    const Eigen::Matrix3d& axes = tangent.left;
    const Eigen::Vector3d t = (axes.col(2) + delta[0] * axes.col(0) + delta[1] * axes.col(1)).normalized();
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond(1, 0.5 * delta[2], 0.5 * delta[3], 0.5 * delta[4]).normalized().toRotationMatrix();
    E = skewTimes<double>(t, product(turn, tangent.right));
    E *= std::sqrt(2 / E.squaredNorm());
  }
};

/// A Gauss–Newton step and its squared length in standard deviations. False where the sums leave a direction open.
template <class Kind>
bool entryStep(const EntrySums& sums, Eigen::Matrix3d& M, double& squared_length) {
  const auto tangent = Kind::tangent(M);
  const auto factor = tangent.factor(sums);
  if (!factor.ok()) return false;
  const Eigen::Matrix<double, Kind::coordinates, 1> g = product(tangent.entries.transpose(), sums.vector()),
                                                    delta = -factor.template solve<1>(g);
  squared_length = -delta.dot(g);
  Kind::move(M, tangent, delta);
  return M.allFinite() && squared_length >= 0;
}

/// The inverse of what the sums say of the entries, on the directions that are free.
template <class Kind>
std::optional<Matrix9> entryCovariance(const EntrySums& sums, const Eigen::Matrix3d& M) {
  const auto tangent = Kind::tangent(M);
  const auto factor = tangent.factor(sums);
  if (!factor.ok()) return std::nullopt;
  return congruence(tangent.entries, factor.inverse());
}

/// One model and its matches, for RobustSearch.
template <class Kind>
class RobustTwoViewModel {
 public:
  using Parameter = Eigen::Matrix3d;
  static constexpr std::size_t sample_size = Kind::sample_size;

  RobustTwoViewModel(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise)
      : matches_(matches), noise_(noise), columns_(matches), some_(matches.size()) {}

  std::size_t size() const { return matches_.size(); }
  std::span<const Eigen::Vector4d> matches() const { return matches_; }
  const MatchNoise& noise() const { return noise_; }

  void solve(std::span<const std::size_t> sample, std::vector<Parameter>& solutions) const {
    std::array<Eigen::Vector4d, sample_size> chosen;
    for (std::size_t k = 0; k < sample_size; ++k) chosen[k] = matches_[sample[k]];
    Kind::solve(chosen, solutions);
  }
  void errors(const Parameter& q, std::span<double> squared) const {
    columnErrors(typename Kind::Equation(q, noise_), columns_, squared);
  }
  void errors(const Parameter& q, std::span<const std::size_t> measurements, std::span<double> squared) const {
    someErrors(typename Kind::Equation(q, noise_), matches_, measurements, squared);
  }
  std::optional<Parameter> refine(const Parameter& q, std::span<const std::size_t> inliers) const {
    return polish(q, inliers);
  }
  /// A Gauss–Newton step.
  std::optional<Parameter> polish(Parameter q, std::span<const std::size_t> inliers) const {
    some_.clear();
    for (const std::size_t i : inliers) some_.add(matches_[i], 1);
    double squared_length = 0;
    if (!entryStep<Kind>(sumsOfSome(q), q, squared_length)) return std::nullopt;
    return q;
  }
  /// The normal equations of matches with weights; those without any are left out.
  EntrySums sums(const Parameter& q, std::span<const double> weights) const {
    some_.clear();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i] != 0) some_.add(matches_[i], weights[i]);
    }
    return sumsOfSome(q);
  }
  /// Leverages of all matches: what a covariance of the entries leaves open of their equations, in units of the noise.
  void leverages(const Parameter& q, const Matrix9& covariance, std::span<double> leverage) const {
    columnLeverages(typename Kind::Equation(q, noise_), covariance, columns_, leverage);
  }

 private:
  EntrySums sumsOfSome(const Parameter& q) const {
    if (some_.size() == 0) return {};
    some_.pad();
    return entrySums(typename Kind::Equation(q, noise_), some_);
  }

  std::span<const Eigen::Vector4d> matches_;
  MatchNoise noise_;
  MatchColumns columns_;
  mutable MatchColumns some_;
};

}  // namespace liestat::detail
