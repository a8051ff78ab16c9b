// The answer of the closed-form solvers of two-view motion: a few 3×3 matrices, without allocation.
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>

namespace liestat {

/// Up to Most models; none where the sample is degenerate, has too few matches, or is not finite.
template <class Model, std::size_t Most>
class Solutions {
 public:
  using value_type = Model;
  static constexpr std::size_t capacity() { return Most; }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const Model& operator[](std::size_t i) const {
    eigen_assert(i < size_);
    return models_[i];
  }
  const Model* begin() const { return models_.data(); }
  const Model* end() const { return models_.data() + size_; }

  /// Keeps a further model; beyond the capacity it is dropped.
  void add(const Model& model) {
    if (size_ < Most) models_[size_++] = model;
  }

 private:
  // Not initialised: only those that were added are read.
  std::array<Model, Most> models_;
  std::size_t size_ = 0;
};

/// Solutions that are matrices, H or F.
template <std::size_t Most>
using MatrixSolutions = Solutions<Eigen::Matrix3d, Most>;

}  // namespace liestat
