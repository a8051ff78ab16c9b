// Starts of hand-eye calibration in closed form: rotations from singular vectors, or from translations alone, then
// translations by linear least squares.
#pragma once

#include <fusion/hand_eye/detail/hand_eye_problem.hpp>
#include <lie/so3.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Sums from which closed forms start.
struct HandEyeMoments {
  double n = 0;
  Eigen::Matrix<double, 9, 9> rotations = Eigen::Matrix<double, 9, 9>::Zero();  ///< Σ R_B ⊗ R_A
  Eigen::Matrix3d translations = Eigen::Matrix3d::Zero();                       ///< Σ t_A t_Bᵀ, centred for AX = YB
  Eigen::Matrix3d mean_rotation = Eigen::Matrix3d::Zero();                      ///< mean of R_A, not a rotation
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  double rotation_variance = 0;  ///< mean variance of an axis, rad²: sum of both poses

  template <class Indices>
  HandEyeMoments(const PosePairList& pairs, const Indices& indices, bool world) {
    for (const std::size_t i : indices) {
      const PosePair pair = pairs[i];
      const Eigen::Matrix3d A = pair.a.mean.rotationMatrix(), B = pair.b.mean.rotationMatrix();
      for (int k = 0; k < 3; ++k) {
        for (int l = 0; l < 3; ++l) rotations.block<3, 3>(3 * k, 3 * l) += B(k, l) * A;
      }
      mean_rotation += A;
      mean_a += pair.a.mean.translation(), mean_b += pair.b.mean.translation();
      rotation_variance += (pair.a.covariance.diagonal().tail<3>() + pair.b.covariance.diagonal().tail<3>()).sum() / 3;
      ++n;
    }
    mean_rotation /= n, mean_a /= n, mean_b /= n, rotation_variance /= n;
    for (const std::size_t i : indices) {
      Eigen::Vector3d a = pairs.a.mean(i).translation(), b = pairs.b.mean(i).translation();
      if (world) a -= mean_a, b -= mean_b;
      translations += a * b.transpose();
    }
  }
};

/// The translations of X and Y, given their rotations, by linear least squares: (R_A - mean) t_X = R_Y t_B - t_A, less
/// its mean; of AX = XB with I for the mean. Directions in which the rotations differ by no more than their noise are
/// left at zero: an inverse would send them tens of metres away.
template <class Indices>
HandEyeValue withTranslations(const SO3d& X, const SO3d& Y, const HandEyeMoments& moments, const PosePairList& pairs,
                              const Indices& indices, bool world) {
  const Eigen::Matrix3d R = Y.matrix();
  const Eigen::Matrix3d base = world ? moments.mean_rotation : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  if (world) offset = product(R, moments.mean_b) - moments.mean_a;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const std::size_t i : indices) {
    const Eigen::Matrix3d D = pairs.a.mean(i).rotationMatrix() - base;
    const Eigen::Vector3d d =
        product(R, pairs.b.mean(i).translation()) - Eigen::Vector3d(pairs.a.mean(i).translation()) - offset;
    normal += product(D.transpose(), D);
    right += product(D.transpose(), d);
  }
  const SmallSvd svd(BasicSmallMatrix<3>::of<3, 3>(normal));
  // Rounding is a noise, too.
  const double least = moments.n * std::max(9 * moments.rotation_variance, 1e-24);
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    if (svd.value(k) <= least) continue;
    const Eigen::Vector3d v(svd.v(k, 0), svd.v(k, 1), svd.v(k, 2));
    t += (v.dot(right) / svd.value(k)) * v;
  }
  HandEyeValue value{SE3d(X, t), SE3d(Y, t)};
  if (world) value.Y = SE3d(Y, Eigen::Vector3d(product(moments.mean_rotation, t) - offset));
  return value;
}

/// Rotations from the singular vectors of K = Σ R_B ⊗ R_A, for which K vec(R_X) = n vec(R_Y).
class HandEyeRotations {
 public:
  HandEyeRotations(const HandEyeMoments& moments, bool world) : world_(world), svd_(matrix(moments, world)) {
    while (dimension_ < 9 && svd_.value(dimension_) > 0.95 * svd_.value(0)) ++dimension_;
  }

  /// How many singular vectors belong to the largest value, but for 5 %: one where the rotations determine X.
  int dimension() const { return dimension_; }

  /// The rotations nearest to Σ c_k u_k and Σ c_k v_k.
  std::pair<SO3d, SO3d> combine(const Eigen::Matrix<double, 9, 1>& c) const {
    Eigen::Matrix<double, 9, 1> x = Eigen::Matrix<double, 9, 1>::Zero(), y = x;
    for (int k = 0; k < dimension_; ++k) {
      for (int i = 0; i < 9; ++i) x[i] += c[k] * svd_.v(k, i), y[i] += c[k] * svd_.u(k, i);
    }
    Eigen::Matrix3d X = Eigen::Map<const Eigen::Matrix3d>(x.data());
    Eigen::Matrix3d Y = world_ ? Eigen::Map<const Eigen::Matrix3d>(y.data()) : X;
    // A singular vector has no sign, a rotation's determinant has.
    if (determinant(X) + determinant(Y) < 0) X = -X, Y = -Y;
    return {SO3d::fitToSO3(X), SO3d::fitToSO3(Y)};
  }

 private:
  static double determinant(const Eigen::Matrix3d& M) { return M.col(0).cross(M.col(1)).dot(M.col(2)); }
  /// For AX = XB, vec(R_X) is an eigenvector of the symmetric part, shifted so that no eigenvalue is negative.
  static BasicSmallMatrix<9> matrix(const HandEyeMoments& moments, bool world) {
    using Matrix9 = Eigen::Matrix<double, 9, 9>;
    const Matrix9& K = moments.rotations;
    return BasicSmallMatrix<9>::of<9, 9>(world ? K
                                               : Matrix9(0.5 * (K + K.transpose()) + moments.n * Matrix9::Identity()));
  }

  bool world_;
  SmallSvd<9> svd_;
  int dimension_ = 1;
};

/// The start where the rotations determine X.
template <class Indices>
HandEyeValue closedFormStart(const HandEyeMoments& moments, const PosePairList& pairs, const Indices& indices,
                             bool world) {
  const auto [X, Y] = HandEyeRotations(moments, world).combine(Eigen::Matrix<double, 9, 1>::Unit(0));
  return withTranslations(X, Y, moments, pairs, indices, world);
}

/// All starts: the closed form, fixed combinations of the singular vectors that belong to the largest value where there
/// are several, and the rotation that the translations alone say (for motions without rotation).
template <class Indices>
std::vector<HandEyeValue> handEyeStarts(const PosePairList& pairs, const Indices& indices, bool world,
                                        std::uint64_t seed) {
  const HandEyeMoments moments(pairs, indices, world);
  const HandEyeRotations rotations(moments, world);
  std::vector<HandEyeValue> starts;
  const auto add = [&](const SO3d& X, const SO3d& Y) {
    starts.push_back(withTranslations(X, Y, moments, pairs, indices, world));
  };
  const auto addPair = [&](const std::pair<SO3d, SO3d>& both) { add(both.first, both.second); };
  addPair(rotations.combine(Eigen::Matrix<double, 9, 1>::Unit(0)));
  if (rotations.dimension() > 1) {
    CounterRng rng(seed, 0, 1);
    for (int i = 0; i < 24; ++i) addPair(rotations.combine(rng.unitVector<9>()));
  }
  const SO3d by_translations = SO3d::fitToSO3(moments.translations);
  if (world) {
    // vec(R_X) ~ Kᵀ vec(R_Y).
    const Eigen::Matrix3d Y = by_translations.matrix();
    const Eigen::Matrix<double, 9, 1> x =
        product(moments.rotations.transpose(), Eigen::Map<const Eigen::Matrix<double, 9, 1>>(Y.data()));
    add(SO3d::fitToSO3(Eigen::Map<const Eigen::Matrix3d>(x.data())), by_translations);
  } else {
    add(by_translations, by_translations);
  }
  return starts;
}

}  // namespace liestat::detail
