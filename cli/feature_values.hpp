// Features between files and manifolds: the rows of a file as a type of feature, and a feature as people see it.
#pragma once

#include <cli/io/measures.hpp>
#include <lie/lie.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <type_traits>
#include <vector>

namespace liestat::cli {

/// A feature of any kind as files and people see it.
struct FeatureValue {
  std::optional<Eigen::Vector4d> quaternion_xyzw = {};  ///< w is not negative
  std::optional<Eigen::Vector3d> rotation_vector = {};  ///< rad
  std::optional<Eigen::Vector3d> translation = {};      ///< m
  std::optional<Eigen::Vector3d> point = {};            ///< m
  std::optional<Eigen::Vector3d> direction = {};
};

/// The rows of a file as features of type M.
template <class M>
std::vector<M> featuresOf(const FeatureFile& file) {
  std::vector<M> list;
  list.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      list.push_back(file.vectors[i]);
    } else if constexpr (std::is_same_v<M, S2d>) {
      list.push_back(M::fromParams(file.vectors[i]));
    } else if constexpr (std::is_same_v<M, SO3d>) {
      list.push_back(M::fromParams(file.rotations[i].coeffs()));
    } else {
      typename M::Params params;
      params << file.rotations[i].coeffs(), file.vectors[i];
      list.push_back(M::fromParams(params));
    }
  }
  return list;
}

/// The same with their covariances.
template <class M>
std::vector<Gaussian<M>> gaussiansOf(const FeatureFile& file) {
  const std::vector<M> features = featuresOf<M>(file);
  std::vector<Gaussian<M>> list;
  list.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) list.push_back({features[i], file.covariances[i]});
  return list;
}
template <class M>
std::vector<SquareOf<M>> covariancesOf(const FeatureFile& file) {
  return {file.covariances.begin(), file.covariances.end()};
}

template <class M>
FeatureValue describe(const M& x) {
  FeatureValue value;
  if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
    value.point = x;
  } else if constexpr (std::is_same_v<M, S2d>) {
    value.direction = x.unit_vector();
  } else {
    const Eigen::Vector4d q = x.params().template head<4>();
    value.quaternion_xyzw = q[3] < 0 ? Eigen::Vector4d(-q) : q;
    value.rotation_vector = SO3d::fromParams(q).log();
    if constexpr (!std::is_same_v<M, SO3d>) value.translation = x.params().template tail<3>();
  }
  return value;
}

}  // namespace liestat::cli
