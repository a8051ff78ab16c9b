// PointGroup: the eleven proper crystallographic point groups, finite groups of rotations about a crystal's axes.
//
// Axes           an orthonormal trihedron of the crystal: z along c; x along a, but for hexagonal and trigonal crystals
//                as HexagonalAxes says. 2 is about b, which is y, in the usual setting of monoclinic crystals; 32 has
//                its half-turns about a (321) unless 312 is named
// Elements       unit quaternions x y z w, named by an index: 0 is the identity, 1 to 3 the half-turns about x, y and
//                z, as of the quotients of frames; 4 to 31 the others of 432 and 622, of which all groups are parts
// Bad input      fromName gives nothing for an unknown name
// Source         International Tables for Crystallography A, 10.1; the eleven Laue classes are those of the 32 point
//                groups that differ by an inversion only, which no orientation tells apart
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace liestat {

/// The axis that x is along in a hexagonal or trigonal crystal's trihedron: the direct axis a, so that y is b*; or the
/// reciprocal a*, so that y is b. Files and programs differ, and orientations of 32 and 3 then differ by 30 degrees.
enum class HexagonalAxes { x_along_a, x_along_a_star };

namespace detail {

/// The rotations of 432 and of 622, some of which are in both.
inline constexpr int num_crystal_rotations = 32;
inline constexpr double root_half = 0.70710678118654752440, root_three_quarters = 0.86602540378443864676;
inline constexpr std::array<std::array<double, 4>, num_crystal_rotations> crystal_rotations{{
    {0, 0, 0, 1},
    {1, 0, 0, 0},
    {0, 1, 0, 0},
    {0, 0, 1, 0},
    {root_half, 0, 0, root_half},
    {-root_half, 0, 0, root_half},
    {0, root_half, 0, root_half},
    {0, -root_half, 0, root_half},
    {0, 0, root_half, root_half},
    {0, 0, -root_half, root_half},
    {root_half, root_half, 0, 0},
    {-root_half, root_half, 0, 0},
    {root_half, 0, root_half, 0},
    {-root_half, 0, root_half, 0},
    {0, root_half, root_half, 0},
    {0, -root_half, root_half, 0},
    {0.5, 0.5, 0.5, 0.5},
    {-0.5, -0.5, -0.5, 0.5},
    {-0.5, 0.5, 0.5, 0.5},
    {0.5, -0.5, -0.5, 0.5},
    {0.5, -0.5, 0.5, 0.5},
    {-0.5, 0.5, -0.5, 0.5},
    {0.5, 0.5, -0.5, 0.5},
    {-0.5, -0.5, 0.5, 0.5},
    {0, 0, 0.5, root_three_quarters},
    {0, 0, -0.5, root_three_quarters},
    {0, 0, root_three_quarters, 0.5},
    {0, 0, -root_three_quarters, 0.5},
    {root_three_quarters, 0.5, 0, 0},
    {0.5, root_three_quarters, 0, 0},
    {-0.5, root_three_quarters, 0, 0},
    {-root_three_quarters, 0.5, 0, 0},
}};

/// A group of these rotations, its elements column by column, filled up to a multiple of four by zeros, of which none
/// is ever the nearest.
struct RotationGroup {
  int order = 0;
  std::array<int, 24> index{};
  alignas(32) std::array<double, 24> x{}, y{}, z{}, w{};
  double least_angle = 0;  ///< of its rotations but the identity, rad; 2 pi of the trivial group

  /// The group of the rotations whose bits are set, which must be one.
  static constexpr RotationGroup of(std::uint32_t elements) {
    RotationGroup group;
    double largest = -1;
    for (int i = 0; i < num_crystal_rotations; ++i) {
      if ((elements >> i & 1U) == 0) continue;
      const auto n = static_cast<std::size_t>(group.order++);
      const auto& q = crystal_rotations[static_cast<std::size_t>(i)];
      group.index[n] = i;
      group.x[n] = q[0], group.y[n] = q[1], group.z[n] = q[2], group.w[n] = q[3];
      if (i > 0 && q[3] > largest) largest = q[3];
    }
    constexpr double pi = 3.14159265358979323846;
    group.least_angle = largest < 0     ? 2 * pi
                        : largest == 0  ? pi
                        : largest > 0.8 ? pi / 3
                        : largest > 0.6 ? pi / 2
                                        : 2 * pi / 3;
    return group;
  }

  /// An element, and what it makes of a rotation.
  struct Nearest {
    std::size_t slot = 0;  ///< of the element k whose product q k has the least angle, the first of several
    double w = 1;          ///< the product's scalar part, of either sign
    double second = -1;    ///< the absolute one of the second nearest; -1 if there is none
  };
  Nearest nearest(double qx, double qy, double qz, double qw) const {
    // Four at a time, which the compiler takes together; then the largest two.
    std::array<double, 24> scalar;
    for (std::size_t n = 0; n < static_cast<std::size_t>(order); n += 4) {
      for (std::size_t j = n; j < n + 4; ++j) scalar[j] = qw * w[j] - qx * x[j] - qy * y[j] - qz * z[j];
    }
    Nearest result{0, scalar[0], -1};
    double best = std::abs(scalar[0]);
    for (std::size_t n = 1; n < static_cast<std::size_t>(order); ++n) {
      const double c = std::abs(scalar[n]);
      const bool better = c > best;
      const double lower = better ? best : c;
      result.second = lower > result.second ? lower : result.second;
      best = better ? c : best;
      result.slot = better ? n : result.slot;
    }
    result.w = scalar[result.slot];
    return result;
  }
};

struct NamedGroup {
  std::string_view name;
  std::uint32_t elements;
};
/// In the order of PointGroup's numbers. Of two settings of one group the one that its short name means comes first.
inline constexpr std::array<NamedGroup, 14> proper_point_groups{{
    {"1", 0x00000001},
    {"2", 0x00000005},
    {"112", 0x00000009},
    {"211", 0x00000003},
    {"222", 0x0000000f},
    {"3", 0x0c000001},
    {"32", 0x6c000003},
    {"312", 0x9c000005},
    {"4", 0x00000309},
    {"422", 0x00000f0f},
    {"6", 0x0f000009},
    {"622", 0xff00000f},
    {"23", 0x00ff000f},
    {"432", 0x00ffffff},
}};
inline constexpr std::array<RotationGroup, proper_point_groups.size()> rotation_groups = [] {
  std::array<RotationGroup, proper_point_groups.size()> groups{};
  for (std::size_t i = 0; i < groups.size(); ++i) groups[i] = RotationGroup::of(proper_point_groups[i].elements);
  return groups;
}();

/// Names by which a proper group is known: its own, its Laue class's, those of the other groups of that class.
struct GroupAlias {
  std::string_view name, proper;
};
inline constexpr std::array<GroupAlias, 41> point_group_aliases{{
    {"121", "2"},     {"321", "32"},    {"-1", "1"},     {"m", "2"},       {"2/m", "2"},     {"12/m1", "2"},
    {"112/m", "112"}, {"2/m11", "211"}, {"mm2", "222"},  {"mmm", "222"},   {"-4", "4"},      {"4/m", "4"},
    {"4mm", "422"},   {"-42m", "422"},  {"-4m2", "422"}, {"4/mmm", "422"}, {"-3", "3"},      {"3m", "32"},
    {"3m1", "32"},    {"-3m", "32"},    {"-3m1", "32"},  {"31m", "312"},   {"-31m", "312"},  {"-6", "6"},
    {"6/m", "6"},     {"6mm", "622"},   {"-62m", "622"}, {"-6m2", "622"},  {"6/mmm", "622"}, {"m-3", "23"},
    {"m3", "23"},     {"-43m", "432"},  {"m-3m", "432"}, {"m3m", "432"},   {"C1", "1"},      {"C2", "2"},
    {"D2", "222"},    {"D3", "32"},     {"D6", "622"},   {"T", "23"},      {"O", "432"},
}};

}  // namespace detail

/// One of the eleven proper point groups, in its setting; the trivial group by default.
class PointGroup {
 public:
  constexpr PointGroup() = default;

  /// The group of that name: 1, 2, 222, 3, 32, 4, 422, 6, 622, 23 or 432 (settings: 112, 121, 211, 321, 312), or any of
  /// the other 21 point groups and their Laue classes (m-3m, 6/mmm, -43m …), which stands for the rotations of its Laue
  /// class. Nothing for other names.
  static constexpr std::optional<PointGroup> fromName(std::string_view name,
                                                      HexagonalAxes axes = HexagonalAxes::x_along_a) {
    for (const detail::GroupAlias& alias : detail::point_group_aliases) {
      if (alias.name == name) return fromName(alias.proper, axes);
    }
    for (std::size_t i = 0; i < detail::proper_point_groups.size(); ++i) {
      if (detail::proper_point_groups[i].name != name) continue;
      // With x along a* the axes a are at 30 and 90 degrees from x: the other setting's half-turns.
      const bool turned = axes == HexagonalAxes::x_along_a_star;
      if (turned && name == "32") return fromName("312");
      if (turned && name == "312") return fromName("32");
      return PointGroup(static_cast<std::uint8_t>(i));
    }
    return std::nullopt;
  }

  /// The group of these rotations, bit by bit of their indices; nothing if they are none.
  static constexpr std::optional<PointGroup> ofElements(std::uint32_t elements) {
    for (std::size_t i = 0; i < detail::proper_point_groups.size(); ++i) {
      if (detail::proper_point_groups[i].elements == elements) return PointGroup(static_cast<std::uint8_t>(i));
    }
    return std::nullopt;
  }

  /// The name of the group of rotations about the axes of the trihedron: "312" for 32 with x along a*.
  constexpr std::string_view name() const { return detail::proper_point_groups[number_].name; }
  /// The number of its rotations.
  constexpr int order() const { return rotations().order; }
  /// The smallest angle of its rotations but the identity, rad; 2 pi of the trivial group.
  constexpr double leastAngle() const { return rotations().least_angle; }
  /// True if the group has a rotation of that index (see the header comment).
  constexpr bool contains(int index) const {
    return (detail::proper_point_groups[number_].elements >> index & 1U) != 0;
  }
  constexpr const detail::RotationGroup& rotations() const { return detail::rotation_groups[number_]; }
  /// The position among all settings, from 0 to 13.
  constexpr int number() const { return number_; }
  friend constexpr bool operator==(PointGroup a, PointGroup b) { return a.number_ == b.number_; }

 private:
  explicit constexpr PointGroup(std::uint8_t number) : number_(number) {}
  std::uint8_t number_ = 0;
};

}  // namespace liestat
