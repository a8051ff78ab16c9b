// A feature of any type as people see it, and standard deviations by the parts of its tangent vector in the units that
// people read, degrees and metres. Results that are the same for all types (stats/mean_summary.hpp) consist of these.
// Needs Eigen alone.
#pragma once

#include <lie/concepts.hpp>
#include <lie/manifold.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/shown.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// The unit in which a part of a tangent vector is shown, and how many of it make the one that is computed in.
struct PartUnit {
  const char* name = "";    ///< deg, m, m/s; empty for a logarithm
  const char* suffix = "";  ///< the same in names of fields
  double scale = 1;
};

/// Degrees for angles, else what is computed in.
constexpr PartUnit unitOf(TangentPart part) {
  if (isAngular(part)) return {"deg", "_deg", 1 / units::degree};
  if (part == TangentPart::velocity) return {"m/s", "_m_per_s", 1};
  if (part == TangentPart::log_scale) return {"", "", 1};
  return {"m", "_m", 1};
}
constexpr PartUnit unitOf(const TangentBlock& block) { return unitOf(block.part); }

/// A feature of any type as files and people see it. Types that consist of other parts have `parameters` alone.
struct FeatureValue {
  Eigen::VectorXd parameters = {};                      ///< the type's own numbers, to the bit
  std::optional<Eigen::Vector4d> quaternion_xyzw = {};  ///< w is not negative
  std::optional<Eigen::Vector3d> rotation_vector = {};  ///< rad
  std::optional<Eigen::Vector3d> translation = {};      ///< m
  std::optional<Eigen::Vector3d> velocity = {};         ///< m/s
  std::optional<Eigen::Vector3d> point = {};            ///< m
  std::optional<Eigen::Vector3d> direction = {};
  std::optional<double> heading_deg = {};  ///< from 0 to 360
};

/// The parts that a feature has.
template <class V>
void describe(V& v, const FeatureValue& x) {
  const auto part = [&](const char* name, const auto& value, const char* meaning, const char* unit) {
    using Value = std::remove_cvref_t<decltype(*value)>;
    if (shown(v, value.has_value())) v(name, value ? *value : Value(), meaning, unit);
  };
  part("quaternion_xyzw", x.quaternion_xyzw, "w >= 0", "");
  part("rotation_vector", x.rotation_vector, "", "rad");
  part("translation", x.translation, "", "m");
  part("velocity", x.velocity, "", "m/s");
  part("point", x.point, "", "m");
  part("direction", x.direction, "unit vector", "");
  part("heading_deg", x.heading_deg, "from 0 to 360", "deg");
  if (shown(v, !x.quaternion_xyzw && !x.point && !x.direction && !x.heading_deg)) {
    v("parameters", x.parameters, "of features that have none of these");
  }
}

/// The parts of a feature of these parameters (a quaternion x y z w first, if there is a rotation in space).
inline FeatureValue featureValue(Eigen::VectorXd parameters, std::span<const TangentBlock> parts) {
  FeatureValue value;
  const Eigen::Index size = parameters.size();
  const auto is = [&](TangentPart part, int dimension) {
    return parts.size() == 1 && parts[0].part == part && parts[0].size == dimension && size == 3;
  };
  if (is(TangentPart::point, 3)) value.point = parameters;
  if (is(TangentPart::direction, 2)) value.direction = parameters;
  if (parts.size() == 1 && parts[0].part == TangentPart::rotation && parts[0].size == 1 && size == 2) {
    const double angle = std::atan2(parameters[1], parameters[0]) / units::degree;
    const double turned = angle < 0 ? angle + 360 : angle;
    value.heading_deg = turned < 360 ? turned : 0;  // of an angle that is nearly zero
  }
  Eigen::Index expected = 4;
  bool rotates = false, known = true;
  for (const TangentBlock& block : parts) {
    const bool rotation = block.part == TangentPart::rotation;
    rotates = rotates || rotation;
    known = known && block.size == 3 &&
            (rotation || block.part == TangentPart::translation || block.part == TangentPart::velocity);
    if (!rotation) expected += 3;
  }
  if (rotates && known && size == expected) {
    const Eigen::Vector4d q = parameters.head<4>();
    value.quaternion_xyzw = q[3] < 0 ? Eigen::Vector4d(-q) : q;
    value.rotation_vector = SO3<double>::fromParams(q).log();
    Eigen::Index next = 4;
    for (const TangentBlock& block : parts) {
      if (block.part == TangentPart::rotation) continue;
      (block.part == TangentPart::velocity ? value.velocity : value.translation) = parameters.segment<3>(next);
      next += 3;
    }
  }
  value.parameters = std::move(parameters);
  return value;
}

/// The parts of the type's tangent vectors; none if it says none.
template <Homogeneous M>
std::span<const TangentBlock> tangentPartsOf() {
  if constexpr (HasTangentParts<M>) {
    return ManifoldTraits<M>::tangent_parts;
  } else {
    return {};
  }
}

/// A feature as people see it.
template <Homogeneous M>
FeatureValue featureValue(const M& x) {
  Eigen::VectorXd parameters;
  if constexpr (requires { x.params(); }) {
    parameters = x.params().template cast<double>();
  } else {
    parameters = x.template cast<double>();
  }
  return featureValue(std::move(parameters), tangentPartsOf<M>());
}

/// The feature of these parameters, to the bit.
template <Homogeneous M>
M featureOf(const FeatureValue& value) {
  if constexpr (requires { typename M::Params; }) {
    return M::fromParams(typename M::Params(value.parameters.template cast<ScalarOf<M>>()));
  } else {
    return value.parameters.template cast<ScalarOf<M>>();
  }
}

/// Square roots of the diagonal of one part of a covariance, in the part's unit, along the axes of the feature.
inline std::vector<double> deviations(const TangentBlock& part, const Eigen::MatrixXd& covariance) {
  std::vector<double> list;
  for (int i = part.begin; i < part.begin + part.size; ++i) {
    list.push_back(unitOf(part).scale * std::sqrt(std::max(0.0, covariance(i, i))));
  }
  return list;
}

/// The same along the axes of the world, in which a translation is given; nothing for parts that are no vectors of a
/// feature with a rotation.
inline std::optional<std::vector<double>> worldDeviations(const TangentBlock& part, const FeatureValue& mean,
                                                          const Eigen::MatrixXd& covariance) {
  if (isAngular(part.part) || !mean.quaternion_xyzw || part.size != 3) return std::nullopt;
  const Eigen::Matrix3d R = SO3<double>::fromParams(*mean.quaternion_xyzw).matrix();
  const Eigen::Matrix3d world = R * covariance.block<3, 3>(part.begin, part.begin) * R.transpose();
  return deviations(TangentBlock{part.part, 0, 3}, world);
}

/// Standard deviations by part of the tangent vector, named rotation_deg, translation_m and so on.
struct PartDeviations {
  std::vector<std::pair<std::string, std::vector<double>>> list = {};
};

template <class V>
void describe(V& v, const PartDeviations& x) {
  for (const auto& [name, values] : x.list) v(name.c_str(), values);
}

/// Those of a covariance in the axes of the feature; nothing for an empty matrix.
inline std::optional<PartDeviations> partDeviations(std::span<const TangentBlock> parts,
                                                    const Eigen::MatrixXd& covariance) {
  if (covariance.size() == 0) return std::nullopt;
  PartDeviations result;
  for (const TangentBlock& part : parts) {
    result.list.emplace_back(std::string(name(part.part)) + unitOf(part).suffix, deviations(part, covariance));
  }
  return result;
}

/// Those of the translation along the axes of the world; nothing for an empty matrix or features without a rotation.
inline std::optional<PartDeviations> worldDeviations(std::span<const TangentBlock> parts, const FeatureValue& mean,
                                                     const Eigen::MatrixXd& covariance) {
  PartDeviations result;
  for (const TangentBlock& part : parts) {
    if (covariance.size() == 0) break;
    const auto list = worldDeviations(part, mean, covariance);
    if (list) result.list.emplace_back(std::string(name(part.part)) + unitOf(part).suffix, *list);
  }
  if (result.list.empty()) return std::nullopt;
  return result;
}

/// How a covariance of a feature is to be read: order and units of the coordinates, side of the error, its axes.
struct CovarianceWords {
  std::string order, side, frame;
};

template <class V>
void describe(V& v, const CovarianceWords& x) {
  v("covariance_order", x.order, "coordinates of the covariance, with units");
  v("covariance_side", x.side, "on which its errors are applied")("covariance_frame", x.frame, "its axes");
}

/// `group`: the type's exponential is that of a Lie group without an invariant metric (SE3), else each part's own.
inline CovarianceWords covarianceWords(std::span<const TangentBlock> parts, bool group) {
  CovarianceWords words;
  if (parts.size() == 1 && parts[0].part == TangentPart::point) {
    words.order = parts[0].size == 3 ? "x y z (m)" : "the coordinates of the point (m)";
    return {words.order, "none: the error is added to the point", "the coordinates of the file"};
  }
  if (parts.size() == 1 && parts[0].part == TangentPart::direction) {
    return {"two tangent coordinates (rad)",
            "right: the error is a tangent vector at the mean, followed along a great circle",
            "the tangent plane at the mean, its axes the columns of tangent_basis (the x and y axes turned by the "
            "smallest rotation that takes z to the mean)"};
  }
  for (const TangentBlock& part : parts) {
    if (!words.order.empty()) words.order += ", ";
    words.order += name(part.part);
    words.order += part.size == 3 ? " x y z" : part.size == 2 ? " x y" : "";
    words.order += part.part == TangentPart::log_scale  ? ""
                   : isAngular(part.part)               ? " (rad)"
                   : part.part == TangentPart::velocity ? " (m/s)"
                                                        : " (m)";
  }
  words.side = parts.size() == 1 ? "right: mean * Exp(error)"
               : !group          ? "right: translation + R * error_t, R * Exp(error_r)"
                                 : "right: mean * Exp(error), Exp of ";
  if (parts.size() > 1 && group) words.side += parts.size() > 2 ? "SE_2(3)" : parts[0].size == 2 ? "SE(2)" : "SE(3)";
  words.frame = "the axes of the mean (body frame)";
  return words;
}

}  // namespace liestat
