// Poses with covariances in little memory, for lists of millions.
#pragma once

#include <lie/se3.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// A list that is read by the numbers of its elements, in a loop over them.
template <class List>
struct IndexIterator {
  const List* list;
  std::size_t at;

  auto operator*() const { return (*list)[at]; }
  IndexIterator& operator++() {
    ++at;
    return *this;
  }
  bool operator!=(const IndexIterator& other) const { return at != other.at; }
};

/// Covariances are kept as they are.
struct WholeMatrices {
  using Matrix = Eigen::Matrix<double, 6, 6>;
  using Kept = Matrix;
  static const Kept& keep(const Matrix& V) { return V; }
  static const Matrix& matrix(const Kept& V) { return V; }
};
/// The upper triangles of covariances are kept. A matrix that is not symmetric, by more than 1e-9 of its largest entry, is
/// no covariance: its first entry becomes NaN.
struct UpperTriangles {
  using Matrix = Eigen::Matrix<double, 6, 6>;
  using Kept = Eigen::Matrix<double, 21, 1>;
  static Kept keep(const Matrix& V) {
    Kept list;
    double* entry = list.data();
    for (int j = 0; j < 6; ++j) {
      for (int k = 0; k <= j; ++k) *entry++ = V(k, j);
    }
    const bool symmetric = (V - V.transpose()).isZero(1e-9 * V.cwiseAbs().maxCoeff());
    if (!symmetric) list[0] = std::numeric_limits<double>::quiet_NaN();
    return list;
  }
  static Matrix matrix(const Kept& list) {
    Matrix V;
    const double* entry = list.data();
    for (int j = 0; j < 6; ++j) {
      for (int k = 0; k <= j; ++k) V(k, j) = V(j, k) = *entry++;
    }
    return V;
  }
};

/// Poses with their covariances, of which a single one is kept while all are the same.
template <class Matrices>
class PosesWith {
 public:
  using Covariance = Eigen::Matrix<double, 6, 6>;

  PosesWith() = default;
  PosesWith(std::span<const Gaussian<SE3d>> poses) {
    reserve(poses.size());
    for (const Gaussian<SE3d>& pose : poses) push_back(pose);
  }
  PosesWith(const std::vector<Gaussian<SE3d>>& poses) : PosesWith(std::span<const Gaussian<SE3d>>(poses)) {}
  /// Poses without uncertainty.
  static PosesWith exact(std::vector<SE3d> means) {
    PosesWith poses;
    poses.means_.swap(means);
    poses.forgetCovariances();
    return poses;
  }

  std::size_t size() const { return means_.size(); }
  bool empty() const { return means_.empty(); }
  void reserve(std::size_t n) { means_.reserve(n); }
  void push_back(const Gaussian<SE3d>& pose) {
    if (means_.empty()) covariances_.clear();
    const typename Matrices::Kept V = Matrices::keep(pose.covariance);
    const bool same = !covariances_.empty() && covariances_.front() == V;
    if (!same && !means_.empty()) keepEach();
    if (!same || keepsEach()) covariances_.push_back(V);
    means_.push_back(pose.mean);
  }
  const SE3d& mean(std::size_t i) const { return means_[i]; }
  SE3d& mean(std::size_t i) { return means_[i]; }
  Covariance covariance(std::size_t i) const { return Matrices::matrix(covariances_[keepsEach() ? i : 0]); }
  Gaussian<SE3d> operator[](std::size_t i) const { return {mean(i), covariance(i)}; }
  IndexIterator<PosesWith> begin() const { return {this, 0}; }
  IndexIterator<PosesWith> end() const { return {this, size()}; }
  /// False where all poses have the same covariance, and it is kept once.
  bool keepsEach() const { return covariances_.size() > 1; }

  void setCovariance(std::size_t i, const Covariance& V) {
    keepEach();
    covariances_[i] = Matrices::keep(V);
  }
  /// All become zero.
  void forgetCovariances() { covariances_.assign(1, Matrices::keep(Covariance::Zero())); }
  void scaleCovariances(double factor) {
    for (auto& V : covariances_) V *= factor;
  }
  /// Adds to the covariance of pose i, or to all.
  void addCovariance(std::optional<std::size_t> i, const Covariance& more) {
    if (i) keepEach();
    const typename Matrices::Kept V = Matrices::keep(more);
    for (std::size_t j = i.value_or(0); j < (i ? *i + 1 : covariances_.size()); ++j) covariances_[j] += V;
  }
  /// The poses of some rows, in their order.
  PosesWith rows(std::span<const std::size_t> rows) const {
    PosesWith some;
    some.reserve(rows.size());
    if (keepsEach()) some.covariances_.reserve(rows.size());
    for (const std::size_t i : rows) {
      some.means_.push_back(means_[i]);
      if (keepsEach()) some.covariances_.push_back(covariances_[i]);
    }
    if (!keepsEach()) some.covariances_ = covariances_;
    return some;
  }

 private:
  void keepEach() {
    if (covariances_.size() == 1) covariances_.resize(means_.size(), typename Matrices::Kept(covariances_.front()));
  }

  std::vector<SE3d> means_;
  std::vector<typename Matrices::Kept> covariances_;  // one, or as many as poses
};

using NoisyPoses = PosesWith<WholeMatrices>;
/// In little more than half the memory.
using PackedPoses = PosesWith<UpperTriangles>;

}  // namespace liestat
