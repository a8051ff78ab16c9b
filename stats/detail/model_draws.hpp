// The draws of one model of a hierarchy. What a draw is depends on the measurements alone, not on the order in which they
// came; draws that a change of the measurements leaves as they are are kept.
#pragma once

#include <stats/detail/keyed_measurements.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/hierarchy_types.hpp>
#include <stats/robust.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

inline constexpr int max_equations = 32;

/// The squared errors that a measurement with 0 to 32 equations exceeds with the given probability.
inline std::vector<double> errorThresholds(double probability) {
  std::vector<double> thresholds(1, 0.0);
  for (std::size_t p = 1; p <= max_equations; ++p) {
    double low = 0, high = 1e4;
    for (int k = 0; k < 100; ++k) {
      const double middle = 0.5 * (low + high);
      (chiSquaredTail(middle, p) < probability ? high : low) = middle;
    }
    thresholds.push_back(high);
  }
  return thresholds;
}

/// A measurement's contribution to a score, as an integer, so that sums do not depend on their order.
inline std::int64_t scoreOf(HypothesisScore score, double squared_error, double threshold) {
  const double part = score == HypothesisScore::relevance ? Relevance{2 * threshold}.contribution(squared_error)
                      : score == HypothesisScore::inliers ? InlierCount{threshold}.contribution(squared_error)
                                                          : TruncatedCost{threshold}.contribution(squared_error);
  return static_cast<std::int64_t>(std::lround(part * 0x1p32));
}

template <class Measurement, class Parameter>
class ModelDraws {
 public:
  using Model = HierarchyModel<Measurement, Parameter>;
  using Measurements = KeyedMeasurements<Measurement>;

  struct Hypothesis {
    Parameter parameter;
    std::int64_t score = 0;
    std::size_t inliers = 0;
  };
  /// Which measurements a draw takes: those that are kept, and the others by their keys from those that are admitted.
  struct Guide {
    std::vector<std::size_t> kept;
    std::vector<char> excluded;  // empty: all are admitted
  };

  ModelDraws(const Model& model, std::uint64_t seed, HypothesisScore score, std::vector<double> thresholds)
      : model_(&model), seed_(seed), score_(score), thresholds_(std::move(thresholds)) {
    for (const char c : model.name()) seed_ = mixBits(seed_, static_cast<unsigned char>(c));
  }

  void forget() { draws_.clear(), restart(); }
  /// Back to before the first draw.
  void restart() { looked_ = 0, best_draw_ = best_solution_ = none, last_gain_ = 0; }

  std::size_t looked() const { return looked_; }
  std::size_t lastGain() const { return last_gain_; }
  bool hasBest() const { return best_draw_ != none; }
  const Hypothesis& best() const { return draws_[best_draw_].hypotheses[best_solution_]; }
  /// Where a hypothesis is.
  struct Place {
    std::size_t draw, solution;
  };
  const Hypothesis& at(const Place& place) const { return draws_[place.draw].hypotheses[place.solution]; }
  /// The best so many of the draws that were looked at, the best first.
  std::vector<Place> ranked(std::size_t count) const {
    std::vector<Place> places;
    for (std::size_t t = 0; t < looked_; ++t) {
      for (std::size_t k = 0; k < draws_[t].hypotheses.size(); ++k) places.push_back({t, k});
    }
    const auto better = [&](const Place& a, const Place& b) {
      if (at(a).score != at(b).score) return at(a).score > at(b).score;
      return a.draw != b.draw ? a.draw < b.draw : a.solution < b.solution;
    };
    count = std::min(count, places.size());
    std::partial_sort(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(count), places.end(), better);
    places.resize(count);
    return places;
  }
  std::size_t bestDraw() const { return best_draw_; }
  /// True if the next draw is known already.
  bool known() const { return looked_ < draws_.size() && draws_[looked_].valid; }
  std::uint64_t drawKey(std::size_t draw) const { return mixBits(seed_, draw); }

  /// Makes the next draw.
  void make(const Measurements& measurements, const Guide& guide) {
    if (looked_ == draws_.size()) draws_.emplace_back();
    Draw& draw = draws_[looked_];
    draw.hypotheses.clear();
    draw.valid = guide.kept.empty() && guide.excluded.empty();
    std::vector<std::size_t>& sample = sample_;
    draw.largest = sampleOf(looked_, measurements, guide, sample);
    if (sample.size() < model_->sampleSize()) return;
    sampled_.clear(), solutions_.clear();
    for (const std::size_t i : sample) sampled_.push_back(measurements[i]);
    model_->solve(sampled_, solutions_);
    errors_.resize(measurements.size());
    for (const Parameter& solution : solutions_) {
      model_->errors(solution, measurements.all(), errors_);
      Hypothesis hypothesis{solution};
      for (std::size_t i = 0; i < errors_.size(); ++i) count(hypothesis, measurements[i], errors_[i], 1);
      draw.hypotheses.push_back(std::move(hypothesis));
    }
  }
  /// Takes the draw that is next into account; whether it improves the best.
  bool look() {
    bool gained = false;
    const Draw& draw = draws_[looked_];
    for (std::size_t k = 0; k < draw.hypotheses.size(); ++k) {
      if (hasBest() && draw.hypotheses[k].score <= best().score) continue;
      best_draw_ = looked_, best_solution_ = k, gained = true;
    }
    ++looked_;
    if (gained) last_gain_ = looked_;
    return gained;
  }
  /// The measurements of a draw.
  std::uint64_t sampleOf(std::size_t draw, const Measurements& measurements, const Guide& guide,
                         std::vector<std::size_t>& sample) const {
    const std::size_t more = model_->sampleSize() - std::min(model_->sampleSize(), guide.kept.size());
    const std::uint64_t largest = keyedSample(measurements, drawKey(draw), more, sample, [&](std::size_t i) {
      return guide.excluded.empty() || !guide.excluded[i];
    });
    sample.insert(sample.begin(), guide.kept.begin(), guide.kept.end());
    return largest;
  }

  /// The measurement at `at` has been added, or is about to be removed.
  void changed(const Measurements& measurements, std::size_t at, bool added) {
    const std::uint64_t key = measurements.key(at);
    const std::span<const Measurement> one(&measurements[at], 1);
    for (std::size_t t = 0; t < draws_.size(); ++t) {
      Draw& draw = draws_[t];
      const std::uint64_t mixed = mixBits(key ^ drawKey(t));
      draw.valid = draw.valid && (model_->sampleSize() == 0 || mixed > draw.largest);
      if (!draw.valid) continue;
      for (Hypothesis& hypothesis : draw.hypotheses) {
        double error = 0;
        model_->errors(hypothesis.parameter, one, std::span<double>(&error, 1));
        count(hypothesis, one[0], error, added ? 1 : -1);
      }
    }
  }

 private:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  struct Draw {
    bool valid = false;
    std::uint64_t largest = 0;
    std::vector<Hypothesis> hypotheses;
  };
  void count(Hypothesis& hypothesis, const Measurement& measurement, double error, int sign) const {
    const int equations = std::clamp(model_->equationsOf(measurement), 0, max_equations);
    const double threshold = thresholds_[static_cast<std::size_t>(equations)];
    hypothesis.score += sign * scoreOf(score_, error, threshold);
    if (error < threshold) hypothesis.inliers += static_cast<std::size_t>(sign);
  }

  const Model* model_;
  std::uint64_t seed_;
  HypothesisScore score_;
  std::vector<double> thresholds_;  // by the number of equations
  std::vector<Draw> draws_;
  std::size_t looked_ = 0, best_draw_ = none, best_solution_ = none, last_gain_ = 0;
  // Kept for their memory.
  std::vector<std::size_t> sample_;
  std::vector<Measurement> sampled_;
  std::vector<Parameter> solutions_;
  std::vector<double> errors_;
};

}  // namespace liestat::detail
