// Features between files and manifolds: the rows of a file as a type of feature, and a feature as people see it.
#pragma once

#include <cli/io/measurements.hpp>
#include <experiments/feature.hpp>
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

/// The rows of a file as features of type M, whose parameters are its parts one after the other.
template <class M>
std::vector<M> featuresOf(const FeatureFile& file) {
  std::vector<M> list;
  list.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    Eigen::Matrix<double, 7, 1> params;
    Eigen::Index n = 0;
    for (const experiments::Part part : experiments::info<M>().parts) {
      switch (part) {
        case experiments::Part::rotation:
          params.segment<4>(n) = file.rotations[i].coeffs(), n += 4;
          break;
        case experiments::Part::position:
          params.segment<3>(n) = file.positions[i], n += 3;
          break;
        case experiments::Part::direction:
          params.segment<3>(n) = file.directions[i], n += 3;
          break;
      }
    }
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      list.push_back(params.head<3>());
    } else {
      list.push_back(M::fromParams(typename M::Params(params.head<M::num_parameters>())));
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

/// A feature as people see it.
template <class M>
FeatureValue describe(const M& x) {
  const experiments::Parts& parts = experiments::info<M>().parts;
  const Eigen::VectorXd params = [&] {
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      return x;
    } else {
      return x.params();
    }
  }();
  FeatureValue value;
  Eigen::Index n = 0;
  for (const experiments::Part part : parts) {
    switch (part) {
      case experiments::Part::rotation: {
        const Eigen::Vector4d q = params.segment<4>(n);
        n += 4;
        value.quaternion_xyzw = q[3] < 0 ? Eigen::Vector4d(-q) : q;
        value.rotation_vector = SO3d::fromParams(q).log();
        break;
      }
      case experiments::Part::position:
        (parts.contains(experiments::Part::rotation) ? value.translation : value.point) = params.segment<3>(n);
        n += 3;
        break;
      case experiments::Part::direction:
        value.direction = params.segment<3>(n);
        n += 3;
        break;
    }
  }
  return value;
}

}  // namespace liestat::cli
