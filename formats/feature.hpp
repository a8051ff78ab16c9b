// The features and the criteria of the program and of the experiments: one table row per feature, and a visitor.
//
// A new type of feature is one enumerator of Feature and one row of feature_table. Names, columns of files, numbers of
// degrees of freedom and the instantiations of everything that is called through withFeature() follow from the row.
#pragma once

#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/semi_oriented_frame3.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/mean_summary.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// The kind of a feature. `frame` is a rigid motion with the left-invariant metric (lie/frame3.hpp), `se3` the same
/// motion as an element of the Lie group, `heading` a direction in the plane.
enum class Feature { point, rotation, frame, semi_oriented_frame, non_oriented_frame, se3, direction, heading };

/// A part of a feature's parameters: a unit quaternion x y z w, a position (m), a unit vector, cosine and sine.
enum class FeaturePart { rotation, position, direction, heading };

/// One or two parts, in the order of the feature's parameters.
class FeatureParts {
 public:
  constexpr explicit FeatureParts(FeaturePart only) : parts_{only, only}, size_(1) {}
  constexpr FeatureParts(FeaturePart first, FeaturePart second) : parts_{first, second}, size_(2) {}

  constexpr std::size_t size() const { return size_; }
  constexpr const FeaturePart* begin() const { return parts_.data(); }
  constexpr const FeaturePart* end() const { return parts_.data() + size_; }
  constexpr bool contains(FeaturePart part) const { return parts_[0] == part || parts_[size_ - 1] == part; }
  constexpr bool contains(const FeatureParts& others) const {
    return contains(others.parts_[0]) && contains(others.parts_[others.size_ - 1]);
  }
  /// The same parts, in whatever order.
  friend constexpr bool operator==(const FeatureParts& a, const FeatureParts& b) {
    return a.contains(b) && b.contains(a);
  }

 private:
  std::array<FeaturePart, 2> parts_;
  std::size_t size_;
};

/// A row of feature_table. M's parameters are its parts one after the other.
template <Feature Kind, class M>
struct FeatureRow {
  using Type = M;
  static constexpr Feature kind = Kind;
  std::string_view name;    ///< in options and JSON fields
  std::string_view plural;  ///< in sentences
  FeatureParts parts;
};

/// All features, in the order of the enumerators. A file is taken for the first feature that has exactly its parts.
inline constexpr std::tuple feature_table{
    FeatureRow<Feature::point, Eigen::Vector3d>{"point", "points", FeatureParts(FeaturePart::position)},
    FeatureRow<Feature::rotation, SO3d>{"rotation", "rotations", FeatureParts(FeaturePart::rotation)},
    FeatureRow<Feature::frame, Frame3d>{"frame", "frames", {FeaturePart::rotation, FeaturePart::position}},
    FeatureRow<Feature::semi_oriented_frame, SemiOrientedFrame3d>{
        "semi_oriented_frame", "semi-oriented frames", {FeaturePart::rotation, FeaturePart::position}},
    FeatureRow<Feature::non_oriented_frame, NonOrientedFrame3d>{
        "non_oriented_frame", "non-oriented frames", {FeaturePart::rotation, FeaturePart::position}},
    FeatureRow<Feature::se3, SE3d>{"se3", "rigid motions (SE3)", {FeaturePart::rotation, FeaturePart::position}},
    FeatureRow<Feature::direction, S2d>{"direction", "directions", FeatureParts(FeaturePart::direction)},
    FeatureRow<Feature::heading, SO2d>{"heading", "headings", FeatureParts(FeaturePart::heading)},
};

/// A feature's row at run time.
struct FeatureInfo {
  Feature kind;
  std::string_view name, plural;
  FeatureParts parts;
  std::span<const TangentBlock> tangent;  ///< the parts of its tangent vectors
  int dof;
  bool has_metric;    ///< a Riemannian manifold, so that lsq and wlsq are there; else a group, with its barycentre
  bool has_isotropy;  ///< some motions leave a feature as it is: no frame is common to all of the manifold's points

  /// Covariances in the frames of the measurements and in the frame of the mean are different models.
  constexpr bool frameMatters() const { return has_metric && !has_isotropy && parts.size() > 1; }
};

/// The table's rows at run time.
inline constexpr auto feature_rows = std::apply(
    []<class... Row>(const Row&... row) {
      return std::array{
          FeatureInfo{Row::kind, row.name, row.plural, row.parts, ManifoldTraits<typename Row::Type>::tangent_parts,
                      ManifoldTraits<typename Row::Type>::DoF, Metric<typename Row::Type>,
                      ManifoldTraits<typename Row::Type>::Group::DoF != ManifoldTraits<typename Row::Type>::DoF}...};
    },
    feature_table);

/// The row of a feature.
constexpr const FeatureInfo& info(Feature feature) { return feature_rows[static_cast<std::size_t>(feature)]; }
/// The row of a feature by its type.
template <class M>
constexpr const FeatureInfo& info() {
  return std::apply(
      []<class... Row>(const Row&...) -> const FeatureInfo& {
        std::size_t i = 0;
        (void)((std::is_same_v<M, typename Row::Type> || (++i, false)) || ...);
        return feature_rows[i];
      },
      feature_table);
}

static_assert(
    [] {
      for (std::size_t i = 0; i < feature_rows.size(); ++i) {
        if (static_cast<std::size_t>(feature_rows[i].kind) != i) return false;
      }
      return true;
    }(),
    "the rows of feature_table are in the order of the enumerators");

/// The name in options and JSON fields.
inline std::string name(Feature feature) { return std::string(info(feature).name); }
/// The dimension of the feature's tangent space.
inline int degreesOfFreedom(Feature feature) { return info(feature).dof; }

/// All names, in the order of the enumerators.
inline std::vector<std::string> featureNames() {
  std::vector<std::string> names;
  for (const FeatureInfo& row : feature_rows) names.emplace_back(row.name);
  return names;
}

/// The feature of that name; empty for an unknown one.
inline std::optional<Feature> featureFromName(std::string_view text) {
  for (const FeatureInfo& row : feature_rows) {
    if (row.name == text) return row.kind;
  }
  return std::nullopt;
}

/// The search of withFeature(), from row I of the table on.
template <std::size_t I, class Result, class F>
Result visitFeature(Feature kind, F& f) {
  if constexpr (I < feature_rows.size()) {
    using Row = std::tuple_element_t<I, std::remove_const_t<decltype(feature_table)>>;
    if constexpr (requires { f.template operator()<typename Row::Type>(); }) {
      if (kind == Row::kind) return f.template operator()<typename Row::Type>();
    }
    return visitFeature<I + 1, Result>(kind, f);
  } else {
    throw std::invalid_argument("no such feature here");
  }
}

/// Calls a template with the type of a feature: `withFeature(kind, [&]<class M>() { return …; })`. The call compiles f for
/// every feature; f may restrict itself to some by a constraint, such as `[]<Metric M>() { … }`, and then throws
/// std::invalid_argument for the others. Points have to be among them.
template <class F>
auto withFeature(Feature kind, F&& f) {
  using Result = decltype(f.template operator()<Eigen::Vector3d>());
  return visitFeature<0, Result>(kind, f);
}

}  // namespace liestat
