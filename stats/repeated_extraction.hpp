// Several structures in the same measurements, one after the other: a hierarchy (stats/hierarchy.hpp) finds the model
// that explains most of them, its inliers are taken out, and it runs again over the rest.
//
//   RepeatedExtraction<Eigen::Vector4d, TwoViewMotionModel> search(twoViewModels(images), matches);
//   while (search.iterate()) {}                           // or until there is no time left
//   for (const auto& structure : search.structures()) …   // which model, its estimate, its inliers
//
// It ends with a chosen model that chance explains, or at a limit. Each measurement belongs to the structure that explains
// it best, so later ones may claim what the first ones took; docs/hierarchy.md says what that gains.
#pragma once

#include <stats/hierarchy.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

struct RepeatedExtractionOptions {
  HierarchyOptions hierarchy = {};
  std::size_t max_structures = 20;
  /// After a structure has been found measurements go to the one that explains them best and all are estimated again
  /// from what they have then, so many times; 0: a measurement stays with the first structure that explains it.
  int rounds = 5;
};

/// A structure that was found: a model and its inliers.
template <class Parameter>
struct ExtractedStructure {
  std::size_t model = 0;  ///< its number in the list of models
  std::string name;
  /// When it was found, over the measurements that were left then: errors and inliers are those of that search.
  ModelState<Parameter> state;
  /// Of that search: the models that its measurements did not tell from this one (Hierarchy::contested).
  std::vector<std::pair<std::size_t, ModelState<Parameter>>> rivals = {};
  ModelEstimate<Parameter> estimate;  ///< from its own inliers
  std::vector<std::size_t> inliers;   ///< places in the caller's order, ascending
};

/// The search for structures.
template <class Measurement, class Parameter>
class RepeatedExtraction {
 public:
  using Search = Hierarchy<Measurement, Parameter>;
  using Models = typename Search::Models;
  using Structure = ExtractedStructure<Parameter>;

  /// Models that are no lattice (Hierarchy::fault) find nothing.
  RepeatedExtraction(Models models, std::vector<Measurement> measurements, RepeatedExtractionOptions options = {})
      : options_(std::move(options)),
        models_(std::move(models)),
        thresholds_(detail::errorThresholds(options_.hierarchy.outlier_share)),
        measurements_(std::move(measurements)),
        owners_(measurements_.size(), none) {
    begin();
    ended_ = !search_->valid() || options_.max_structures == 0;
  }

  /// One step of the search for the next structure; true while there is more to do. `stop` is for the hierarchy's
  /// estimates; what it ends is begun again by the next call.
  bool iterate(const StopRequest& stop = {}) {
    if (ended_) return false;
    if (search_->iterate(stop)) return true;
    ended_ = !extract() || structures_.size() >= options_.max_structures;
    if (!ended_) begin();
    return !ended_;
  }
  bool terminated() const { return ended_; }

  /// The structures found so far, in order of their discovery.
  const std::vector<Structure>& structures() const { return structures_; }
  /// The measurements that no structure has, by their places in the caller's order.
  std::vector<std::size_t> rest() const { return placesOf(none); }
  /// The search over what is left.
  const Search& search() const { return *search_; }

 private:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

  void begin() {
    search_.emplace(models_, options_.hierarchy);
    std::vector<Measurement> left;
    for (const std::size_t i : rest()) left.push_back(measurements_[i]);
    search_->add(left);
  }
  /// Takes the chosen model as a structure; false where chance explains it.
  bool extract() {
    const std::size_t m = search_->best();
    const auto& state = search_->state(m);
    if (!state.hasEstimate() || state.unsupported) return false;
    const std::size_t before = structures_.size();
    structures_.push_back({m, models_[m]->name(), state, {}, state.estimate, {}});
    for (const std::size_t rival : search_->contested()) {
      if (rival != m) structures_.back().rivals.emplace_back(rival, search_->state(rival));
    }
    assign(options_.rounds == 0);
    for (int round = 0; round < options_.rounds; ++round) {
      estimateAgain();
      const std::vector<std::size_t> owners = owners_;
      assign(false);
      if (owners == owners_) break;
    }
    dropUnsupported();
    return structures_.size() > before;
  }
  /// Gives each measurement to the structure under which it is most likely, if it is an inlier there; or, where those
  /// that have one keep it, only the others. A structure that takes a small share of random measurements makes one that
  /// it takes more likely.
  void assign(bool keep) {
    std::vector<double> scores(owners_.size(), -std::numeric_limits<double>::infinity()), errors(owners_.size());
    const std::vector<std::size_t> before = owners_;
    owners_.assign(owners_.size(), none);
    for (std::size_t k = 0; k < structures_.size(); ++k) {
      const Structure& structure = structures_[k];
      const auto& model = *models_[structure.model];
      const double share = std::log(model.chance(structure.state.threshold));
      model.errors(structure.estimate.parameter, measurements_, errors);
      for (std::size_t i = 0; i < errors.size(); ++i) {
        const double score = -0.5 * errors[i] - share;
        if (!(errors[i] < limitOf(structure, i)) || !(score > scores[i])) continue;
        if (keep && before[i] != none && before[i] != k) continue;
        owners_[i] = k, scores[i] = score;
      }
    }
    for (std::size_t k = 0; k < structures_.size(); ++k) structures_[k].inliers = placesOf(k);
  }
  void estimateAgain() {
    for (Structure& structure : structures_) {
      std::vector<Measurement> own;
      for (const std::size_t i : structure.inliers) own.push_back(measurements_[i]);
      auto found = models_[structure.model]->estimate(structure.estimate.parameter, own, {});
      if (found.usable()) structure.estimate = std::move(found);
    }
  }
  /// Structures that others have taken so much from that chance explains what is left are none.
  void dropUnsupported() {
    for (std::size_t k = structures_.size(); k-- > 0;) {
      const Structure& structure = structures_[k];
      const auto& model = *models_[structure.model];
      const std::size_t chance =
          binomialQuantile(options_.hierarchy.choice.support.probability, structure.inliers.size() + rest().size(),
                           model.chance(structure.state.threshold));
      const double own = static_cast<double>(model.freeParameters()) / model.equations();
      if (static_cast<double>(structure.inliers.size()) > static_cast<double>(model.sampleSize() + chance) + own)
        continue;
      structures_.erase(structures_.begin() + static_cast<std::ptrdiff_t>(k));
      assign(options_.rounds == 0);
    }
  }
  double limitOf(const Structure& structure, std::size_t i) const {
    const auto& model = *models_[structure.model];
    const int usual = model.equations(), here = model.equationsOf(measurements_[i]);
    const auto known = [&](int equations) {
      return thresholds_[static_cast<std::size_t>(std::clamp(equations, 0, detail::max_equations))];
    };
    return here == usual ? structure.state.threshold : structure.state.threshold * known(here) / known(usual);
  }
  std::vector<std::size_t> placesOf(std::size_t owner) const {
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < owners_.size(); ++i) {
      if (owners_[i] == owner) places.push_back(i);
    }
    return places;
  }

  RepeatedExtractionOptions options_;
  Models models_;
  std::vector<double> thresholds_;  // for known noise, by the number of equations
  std::vector<Measurement> measurements_;
  std::vector<std::size_t> owners_;  // the structure of each
  std::vector<Structure> structures_;
  std::optional<Search> search_;
  bool ended_ = false;
};

}  // namespace liestat
