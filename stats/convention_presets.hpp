// The conventions of programs and libraries by name: values of the five fields of `Convention`.
//
//   const Convention ros = *parseConvention("ros-fixed");
//   const Convention mine = *parseConvention("right,order=rt,unit=deg,layout=upper21");
//
// Sources and measured agreement: docs/theory/conventions.md, section 6; docs/which_convention.md.
#pragma once

#include <stats/conventions.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace liestat {

/// A convention with its name and the programs that use it.
struct NamedConvention {
  std::string_view name;
  Convention convention;
  std::string_view users;
};

/// The conventions of docs/theory/conventions.md, section 6, in its order.
inline constexpr NamedConvention convention_presets[] = {
    {"right", {}, "liestat, manif, Sophus with right increments; GTSAM with order=rt"},
    {"left", {.perturbation = Perturbation::left}, "Barfoot; pytransform3d with order=rt"},
    {"ros-fixed", {.perturbation = Perturbation::world_axes}, "ROS geometry_msgs by tf2, KDL"},
    {"ros-rpy", {.perturbation = Perturbation::roll_pitch_yaw}, "ROS geometry_msgs by its comment, robot_localization"},
    {"mrpt-ypr", {.perturbation = Perturbation::yaw_pitch_roll}, "MRPT's CPose3DPDFGaussian"},
    {"ros-body-ori", {.perturbation = Perturbation::world_body_axes}, "OpenVINS' topics"},
    {"g2o-half",
     {.perturbation = Perturbation::body_axes,
      .unit = RotationUnit::half_angle,
      .content = CovarianceContent::information,
      .layout = CovarianceLayout::upper21},
     "EDGE_SE3:QUAT as g2o computes it"},
    {"g2o-full",
     {.content = CovarianceContent::information, .layout = CovarianceLayout::upper21},
     "EDGE_SE3:QUAT as GTSAM and SE-Sync read it"},
    {"ceres-quat",
     {.perturbation = Perturbation::world_axes, .unit = RotationUnit::half_angle},
     "ceres::Covariance of position and quaternion"},
    {"ceres-posegraph", {.perturbation = Perturbation::world_axes_reversed}, "the residual of Ceres' pose_graph_3d"},
    {"opencv-rvec",
     {.order = CovarianceOrder::rotation_translation, .perturbation = Perturbation::rotation_vector},
     "OpenCV's rvec, tvec (pose cam_from_world)"},
};

/// Other names of presets, and presets with another order or layout.
inline constexpr NamedConvention convention_aliases[] = {
    {"liestat", {}, "right"},
    {"gtsam", {.order = CovarianceOrder::rotation_translation}, "right with order=rt"},
    {"barfoot", {.perturbation = Perturbation::left}, "left"},
    {"pytransform3d",
     {.order = CovarianceOrder::rotation_translation, .perturbation = Perturbation::left},
     "left with order=rt"},
    {"tf2", {.perturbation = Perturbation::world_axes}, "ros-fixed"},
    {"kdl", {.perturbation = Perturbation::world_axes}, "ros-fixed"},
    {"openvins", {.perturbation = Perturbation::world_body_axes}, "ros-body-ori"},
    {"openvins-text",
     {.order = CovarianceOrder::rotation_translation,
      .perturbation = Perturbation::world_body_axes,
      .layout = CovarianceLayout::blocks12},
     "ros-body-ori with order=rt,layout=blocks12"},
    {"mavlink",
     {.perturbation = Perturbation::roll_pitch_yaw, .layout = CovarianceLayout::upper21},
     "ros-rpy with layout=upper21"},
    {"toro",
     {.perturbation = Perturbation::roll_pitch_yaw,
      .content = CovarianceContent::information,
      .layout = CovarianceLayout::upper21},
     "ros-rpy with content=information,layout=upper21: EDGE3"},
    {"colmap",
     {.order = CovarianceOrder::rotation_translation,
      .perturbation = Perturbation::world_axes,
      .unit = RotationUnit::half_angle},
     "ceres-quat with order=rt"},
    {"se-sync", {.content = CovarianceContent::information, .layout = CovarianceLayout::upper21}, "g2o-full"},
};

namespace detail {

template <class Enum>
struct FieldName {
  Enum value;
  std::string_view name;
};
inline constexpr FieldName<CovarianceOrder> order_names[] = {{CovarianceOrder::translation_rotation, "tr"},
                                                             {CovarianceOrder::rotation_translation, "rt"}};
inline constexpr FieldName<Perturbation> perturbation_names[] = {
    {Perturbation::right, "right"},
    {Perturbation::left, "left"},
    {Perturbation::body_axes, "body-axes"},
    {Perturbation::world_axes, "world-axes"},
    {Perturbation::world_body_axes, "world-body-axes"},
    {Perturbation::roll_pitch_yaw, "rpy"},
    {Perturbation::yaw_pitch_roll, "ypr"},
    {Perturbation::rotation_vector, "rvec"},
    {Perturbation::world_axes_reversed, "world-axes-reversed"},
    {Perturbation::transposed_axes, "transposed-axes"}};
inline constexpr FieldName<RotationUnit> unit_names[] = {{RotationUnit::radian, "rad"},
                                                         {RotationUnit::half_angle, "half"},
                                                         {RotationUnit::double_angle, "double"},
                                                         {RotationUnit::degree, "deg"}};
inline constexpr FieldName<CovarianceContent> content_names[] = {{CovarianceContent::covariance, "covariance"},
                                                                 {CovarianceContent::information, "information"},
                                                                 {CovarianceContent::sigmas, "sigmas"}};
inline constexpr FieldName<CovarianceLayout> layout_names[] = {
    {CovarianceLayout::full36, "full36"},   {CovarianceLayout::upper21, "upper21"},
    {CovarianceLayout::lower21, "lower21"}, {CovarianceLayout::blocks12, "blocks12"},
    {CovarianceLayout::diag6, "diag6"},     {CovarianceLayout::planar6, "planar6"},
    {CovarianceLayout::toro6, "toro6"}};

template <class Enum, std::size_t N>
constexpr std::string_view nameIn(const FieldName<Enum> (&names)[N], Enum value) {
  for (const FieldName<Enum>& n : names) {
    if (n.value == value) return n.name;
  }
  return "unknown";
}
template <class Enum, std::size_t N>
constexpr bool valueIn(const FieldName<Enum> (&names)[N], std::string_view name, Enum& value) {
  for (const FieldName<Enum>& n : names) {
    if (n.name == name) {
      value = n.value;
      return true;
    }
  }
  return false;
}

}  // namespace detail

/// Names of the fields' values, as parseConvention reads them.
constexpr std::string_view name(CovarianceOrder value) { return detail::nameIn(detail::order_names, value); }
constexpr std::string_view name(Perturbation value) { return detail::nameIn(detail::perturbation_names, value); }
constexpr std::string_view name(RotationUnit value) { return detail::nameIn(detail::unit_names, value); }
constexpr std::string_view name(CovarianceContent value) { return detail::nameIn(detail::content_names, value); }
constexpr std::string_view name(CovarianceLayout value) { return detail::nameIn(detail::layout_names, value); }

/// The preset or alias of a name; nothing if there is none.
constexpr std::optional<Convention> conventionPreset(std::string_view preset) {
  for (const NamedConvention& c : convention_presets) {
    if (c.name == preset) return c.convention;
  }
  for (const NamedConvention& c : convention_aliases) {
    if (c.name == preset) return c.convention;
  }
  return std::nullopt;
}

/// Sets one field by its name (order, perturbation, unit, content, layout) and the name of the value; false if there is
/// no such field or value.
constexpr bool setConventionField(Convention& c, std::string_view field, std::string_view value) {
  if (field == "order") return detail::valueIn(detail::order_names, value, c.order);
  if (field == "perturbation") return detail::valueIn(detail::perturbation_names, value, c.perturbation);
  if (field == "unit") return detail::valueIn(detail::unit_names, value, c.unit);
  if (field == "content") return detail::valueIn(detail::content_names, value, c.content);
  if (field == "layout") return detail::valueIn(detail::layout_names, value, c.layout);
  return false;
}

/// The convention of a text PRESET[,FIELD=VALUE]…; nothing if a name is unknown.
constexpr std::optional<Convention> parseConvention(std::string_view text) {
  const std::size_t first = text.find(',');
  std::optional<Convention> c = conventionPreset(text.substr(0, first));
  while (c && text.find(',') != std::string_view::npos) {
    text.remove_prefix(text.find(',') + 1);
    const std::string_view field = text.substr(0, text.find(','));
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos ||
        !setConventionField(*c, field.substr(0, equals), field.substr(equals + 1))) {
      return std::nullopt;
    }
  }
  return c;
}

/// A text that parseConvention reads as c: the preset that shares most fields with it, then the fields in which it
/// differs. `with_layout = false` leaves the layout out, where a file format has its own.
inline std::string conventionName(const Convention& c, bool with_layout = true) {
  const NamedConvention* nearest = &convention_presets[0];
  int fewest = 10;
  for (const NamedConvention& p : convention_presets) {
    const Convention& d = p.convention;
    // The perturbation weighs most: it is what a preset is named after.
    const int differences = 4 * (c.perturbation != d.perturbation) + (c.order != d.order) + (c.unit != d.unit) +
                            (c.content != d.content) + (with_layout && c.layout != d.layout);
    if (differences < fewest) fewest = differences, nearest = &p;
  }
  const Convention& d = nearest->convention;
  std::string text(nearest->name);
  const auto append = [&text](std::string_view field, std::string_view value) {
    text.append(",").append(field).append("=").append(value);
  };
  if (c.order != d.order) append("order", name(c.order));
  if (c.perturbation != d.perturbation) append("perturbation", name(c.perturbation));
  if (c.unit != d.unit) append("unit", name(c.unit));
  if (c.content != d.content) append("content", name(c.content));
  if (with_layout && c.layout != d.layout) append("layout", name(c.layout));
  return text;
}

/// See report/describe.hpp.
template <class V>
void describe(V& v, const Convention& c) {
  v("name", conventionName(c), "as --cov-from takes it")("order", name(c.order), "of the coordinates");
  v("perturbation", name(c.perturbation), "the side and the frame of the errors")("unit", name(c.unit),
                                                                                  "of the rotation");
  v("content", name(c.content), "covariance or information")("layout", name(c.layout), "of the numbers in a row");
}

}  // namespace liestat
