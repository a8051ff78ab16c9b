// Which model of two-view motion contains which, whatever part of the whole lattice there is.
#pragma once

#include <fusion/two_view/models.hpp>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The lattice of fusion/two_view/models.hpp with the optional models that were asked for. A model that is absent stands
/// for those that it contains.
class TwoViewLattice {
 public:
  using Names = std::vector<std::string>;

  explicit TwoViewLattice(const TwoViewModelOptions& options) {
    using Node = TwoViewNode;
    const bool calibrated = options.calibration == TwoViewCalibration::calibrated;
    add("none", {});
    add("retinal translation", {"none"});
    add("zoom", {"none"});
    add("free zoom", {"retinal translation", "zoom"}, options.has(Node::free_zoom));
    add("retinal displacement", {"retinal translation"});
    add("similarity", {"retinal displacement", "free zoom"}, options.has(Node::similarity));
    add("affine", {"similarity"}, options.has(Node::affine));
    add("rotation", {"none"}, calibrated);
    add("rotation and zoom", {"rotation", "zoom"}, calibrated && options.has(Node::rotation_zoom));
    add("homography", {"affine", "rotation and zoom"});
    add("translation", {"free zoom"});
    add("affine epipolar", {"affine"}, options.has(Node::affine_epipolar));
    // A translation keeps every vertical as it is.
    const bool upright = calibrated && options.verticals.has_value();
    add("upright", {upright && sameVertical(*options.verticals) ? "translation" : "none"}, upright);
    add("essential", {"translation", "rotation", "similarity", "upright"}, calibrated);
    add("shared focal length", {"essential"}, options.has(Node::shared_focal));
    // Zoom and translation lead here without a detour.
    add("fundamental", {"homography", "affine epipolar", "shared focal length", "zoom", "translation"});
  }

  bool has(const std::string& name) const { return entry(name).present; }
  /// The next more specific models of those that are present.
  Names parents(const std::string& name) const {
    Names result, further;
    for (const std::string& parent : entry(name).parents) {
      if (has(parent)) {
        result.push_back(parent);
      } else {
        for (const std::string& substitute : parents(parent)) further.push_back(substitute);
      }
    }
    for (std::size_t i = 0; i < further.size(); ++i) {
      const std::string& one = further[i];
      const auto covers = [&](const std::string& other) { return other == one || contains(other, one); };
      const auto excels = [&](const std::string& other) { return other != one && contains(other, one); };
      if (std::any_of(result.begin(), result.end(), covers)) continue;
      if (std::none_of(further.begin(), further.end(), excels)) result.push_back(one);
    }
    return result;
  }

 private:
  struct Entry {
    std::string name;
    Names parents;
    bool present;
  };
  void add(std::string name, Names parents, bool present = true) {
    entries_.push_back({std::move(name), std::move(parents), present});
  }
  static bool sameVertical(const TwoViewVerticals& verticals) {
    return (verticals.first.normalized() - verticals.second.normalized()).norm() < 1e-9;
  }
  const Entry& entry(const std::string& name) const {
    return *std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.name == name; });
  }
  bool contains(const std::string& general, const std::string& specific) const {
    const Names& direct = entry(general).parents;
    return std::any_of(direct.begin(), direct.end(),
                       [&](const std::string& p) { return p == specific || contains(p, specific); });
  }

  std::vector<Entry> entries_;
};

}  // namespace liestat::detail
