// Names for the directions that the motions of a hand-eye calibration leave open.
#pragma once

#include <fusion/hand_eye/detail/hand_eye_problem.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat::detail {

/// How the gripper moved, in its own frame.
struct GripperMotion {
  Eigen::Vector3d rotation_axis = Eigen::Vector3d::Zero();     ///< unit, zero without a common one
  Eigen::Vector3d translation_axis = Eigen::Vector3d::Zero();  ///< unit, zero without a common one
  double length = 0;                                           ///< rms of translations, m

  /// Relative to the first pose, or the motions themselves.
  template <class Indices>
  GripperMotion(const PosePairList& pairs, const Indices& indices, bool world) {
    Eigen::Matrix3d turns = Eigen::Matrix3d::Zero(), moves = Eigen::Matrix3d::Zero();
    double n = 0, noise = 0, length_noise = 0;
    for (const std::size_t i : indices) {
      const SE3d& A = pairs.a.mean(i);
      const SE3d motion = world ? pairs.a.mean(indices.front()).inverse() * A : A;
      const Matrix6 V = pairs.a.covariance(i);
      const Eigen::Vector3d t = motion.translation(), turn = motion.so3().log();
      turns += turn * turn.transpose();
      moves += t * t.transpose();
      noise += 9 * V.diagonal().tail<3>().sum();
      length_noise += 9 * V.diagonal().head<3>().sum();
      length += t.squaredNorm() + pairs.b.mean(i).translation().squaredNorm();
      ++n;
    }
    length = std::sqrt(length / n);
    rotation_axis = common(turns, noise);
    if (rotation_axis.isZero()) translation_axis = common(moves, length_noise);
  }

 private:
  /// The axis of a scatter that has one: the rest is noise, or a hundredth.
  static Eigen::Vector3d common(const Eigen::Matrix3d& scatter, double noise) {
    const SmallSvd svd(BasicSmallMatrix<3>::of<3, 3>(scatter));
    if (!(svd.value(0) > 4 * noise && svd.value(1) < std::max(1e-2 * svd.value(0), noise))) {
      return Eigen::Vector3d::Zero();
    }
    return Eigen::Vector3d(svd.v(0, 0), svd.v(0, 1), svd.v(0, 2));
  }
};

/// The first n directions of an excitation as twists of the gripper, those that turn X first and apart from those that
/// only move it: any basis of an open space is as good as another, but people think in these.
inline void appendOpenDirections(std::vector<OpenDirection>& list, const HandEyeExcitation& excitation, int n,
                                 const HandEyeValue& at, const GripperMotion& motion, bool world) {
  const double length = motion.length > 0 ? motion.length : 1;
  const Matrix6 of_Y = world ? at.Y.Adj() : Matrix6(Matrix6::Zero());
  const Matrix6 of_X = product(at.X.Adj(), excitation.x_from_y);
  // Columns: twists of the gripper in units of the length, and what they are made of.
  Matrix6 twists = Matrix6::Zero(), made_of = Matrix6::Zero();
  for (int k = 0; k < n; ++k) {
    Vector6 t = product(of_X, Vector6(excitation.vectors.col(k)));
    t.head<3>() /= length;
    Vector6 c = Vector6::Unit(k);
    for (int repeat = 0; repeat < 2; ++repeat) {
      for (int j = 0; j < k; ++j) {
        const double along = twists.col(j).dot(t);
        t -= along * twists.col(j), c -= along * made_of.col(j);
      }
    }
    twists.col(k) = t / t.norm(), made_of.col(k) = c / t.norm();
  }
  BasicSmallMatrix<6> turns(6, 6);
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < 3; ++i) turns(i, k) = twists(i + 3, k);
  }
  const SmallSvd svd(turns);
  for (int k = 0; k < 6; ++k) {
    Vector6 w = Vector6::Zero();
    for (int j = 0; j < n; ++j) w[j] = svd.v(k, j);
    if (w.squaredNorm() < 0.5) continue;
    Vector6 twist = product(twists, w);
    const Vector6 c = product(made_of, w);
    OpenDirection direction;
    double weighted = 0;
    Vector6 y = Vector6::Zero();
    for (int j = 0; j < n; ++j) {
      weighted += c[j] * c[j] * excitation.values[j];
      y += c[j] * excitation.vectors.col(j);
    }
    direction.excitation = weighted / c.squaredNorm();
    twist.head<3>() *= length;
    direction.rotates = svd.value(k) > 0.1;
    const Eigen::Vector3d axis = (direction.rotates ? twist.tail<3>() : twist.head<3>()).eval();
    // The sign with which the largest coordinate is positive.
    int largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    const double scale = (axis[largest] < 0 ? -1 : 1) / axis.norm();
    direction.twist = scale * twist;
    direction.has_Y = world;
    direction.twist_of_Y = scale * product(of_Y, y);
    direction.along_rotation_axis = std::abs(motion.rotation_axis.dot(axis)) > 0.99 * axis.norm();
    direction.along_translation = std::abs(motion.translation_axis.dot(axis)) > 0.99 * axis.norm();
    list.push_back(direction);
  }
}

}  // namespace liestat::detail
