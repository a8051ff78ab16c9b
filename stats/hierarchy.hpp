// Robust estimation with a hierarchy of models: which model explains the measurements, with which parameter, and which
// measurements are outliers (T. Viéville, D. Lingrand, F. Gaspard, "Implementing a variant of the Kanatani's estimation
// method", INRIA RR-4050, 2000, section 5; docs/hierarchy.md has the rules, and where they differ from the report).
//
//   Hierarchy<Eigen::Vector4d, Eigen::Matrix3d> search(models);   // shared_ptr to HierarchyModel, one without parents
//   search.add(matches);
//   while (search.iterate()) {}                                   // or until there is no time left
//   const auto& found = search.state(search.best());
//
// The search can be interrupted after each hypothesis, and has an answer at any time. Measurements may be added and
// removed at any time. When it has terminated the answer depends on the measurements alone, not on the order in which
// they came: draws belong to what a measurement is, not to its place.
#pragma once

#include <stats/detail/keyed_measurements.hpp>
#include <stats/detail/model_draws.hpp>
#include <stats/hierarchy_types.hpp>
#include <stats/model_choice.hpp>
#include <stats/robust.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

template <class Measurement, class Parameter>
class Hierarchy {
 public:
  using Model = HierarchyModel<Measurement, Parameter>;
  using Models = std::vector<std::shared_ptr<const Model>>;
  using State = ModelState<Parameter>;
  using Id = std::uint64_t;

  explicit Hierarchy(Models models, HierarchyOptions options = {})
      : models_(std::move(models)), options_(std::move(options)) {
    link();
    checkLimits();
    if (!valid()) return;
    thresholds_ = detail::errorThresholds(options_.outlier_share);
    for (const auto& model : models_) {
      draws_.emplace_back(*model, options_.seed, options_.score, thresholds_);
    }
    refined_.resize(models_.size());
    restart();
  }

  /// True if the models form a lattice (names differ, parents exist, no circle, one model without parents), and numbers
  /// are within their limits. Otherwise nothing is ever estimated, and fault() says why.
  bool valid() const { return fault_.empty(); }
  const std::string& fault() const { return fault_; }

  const Models& models() const { return models_; }
  std::size_t size() const { return measurements_.size(); }
  /// The names of the measurements, in the order of ModelState::errors.
  std::vector<Id> ids() const {
    std::vector<Id> all(size());
    for (std::size_t i = 0; i < size(); ++i) all[i] = measurements_.id(i);
    return all;
  }

  /// Adds a measurement; the name by which it is removed. Those that are not numbers count as outliers of all models.
  Id add(const Measurement& measurement) {
    const auto [at, id] = measurements_.add(measurement);
    if (!valid()) return id;
    for (auto& draws : draws_) draws.changed(measurements_, at, true);
    for (std::size_t m = 0; m < models_.size(); ++m) {
      State& state = states_[m];
      if (!state.hasEstimate()) continue;
      double error = 0;
      models_[m]->errors(state.estimate.parameter, std::span<const Measurement>(&measurement, 1),
                         std::span<double>(&error, 1));
      state.errors.insert(state.errors.begin() + static_cast<std::ptrdiff_t>(at), error);
      state.outdated = true;
      classify(m);
    }
    restart();
    return id;
  }
  /// Adds several.
  std::vector<Id> add(std::span<const Measurement> several) {
    if (several.size() < 8 || 4 * several.size() < size()) {
      std::vector<Id> ids;
      for (const Measurement& one : several) ids.push_back(add(one));
      return ids;
    }
    std::vector<Id> ids = measurements_.add(several);
    if (!valid()) return ids;
    for (auto& draws : draws_) draws.forget();
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (!states_[m].hasEstimate()) continue;
      states_[m].errors = errorsOf(m, states_[m].estimate.parameter);
      states_[m].outdated = true;
      classify(m);
    }
    restart();
    return ids;
  }
  std::vector<Id> add(const std::vector<Measurement>& several) { return add(std::span<const Measurement>(several)); }

  /// Removes a measurement; false if there is none of that name.
  bool remove(Id id) {
    const std::size_t at = measurements_.place(id);
    if (at == size()) return false;
    if (valid()) {
      for (auto& draws : draws_) draws.changed(measurements_, at, false);
      for (State& state : states_) {
        if (!state.hasEstimate()) continue;
        state.errors.erase(state.errors.begin() + static_cast<std::ptrdiff_t>(at));
        state.outdated = true;
      }
    }
    measurements_.erase(at);
    if (!valid()) return true;
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (states_[m].hasEstimate()) classify(m);
    }
    restart();
    return true;
  }

  /// One hypothesis or one local optimum; true while there is more to do. What `stop` ends is taken up by the next
  /// call, estimates that are made already are kept.
  bool iterate(const StopRequest& stop = {}) {
    const std::size_t m = next();
    if (m == none) return false;
    if (ending_) return end(stop);
    Draws& draws = draws_[m];
    State& state = states_[m];
    bool gained = false, made = false;
    while (draws.looked() < drawsNeeded(m)) {
      if (!draws.known()) {
        if (made) return true;
        draws.make(measurements_, guideOf(m, draws.looked()));
        made = true;
      }
      gained = draws.look() || gained;
      if (made) break;
    }
    state.draws = draws.looked();
    if (gained) takeHypothesis(m);
    if (draws.looked() < drawsNeeded(m)) {
      // An early look at what has been found, ever more seldom.
      const bool due = state.draws >= 4 && std::has_single_bit(state.draws) && draws.lastGain() > state.draws / 2;
      if (!due || !draws.hasBest()) return true;
      std::optional<Candidate> early = refine(m, draws.ranked(1).front(), refined_[m], {}, wide_passes + 1, stop);
      if (early) take(m, std::move(*early));
      return true;
    }
    if (!draws.hasBest()) return finish(m);
    ending_.emplace(m, draws.ranked(std::max<std::size_t>(options_.refined_hypotheses, 1)));
    return end(stop);
  }

  HierarchyState progress() const {
    if (!valid() || next() == none) return HierarchyState::terminated;
    const bool any = std::any_of(states_.begin(), states_.end(), [](const State& s) { return s.hasEstimate(); });
    return any ? HierarchyState::available : HierarchyState::initial;
  }
  /// Grows with every change of estimates, inliers or verdicts.
  std::uint64_t revision() const { return revision_; }
  /// State of a model, by its number in models().
  const State& state(std::size_t model) const { return states_[model]; }
  const std::vector<State>& states() const { return states_; }
  std::size_t nullModel() const { return null_; }
  /// The number of the model of this name; models().size() if there is none.
  std::size_t find(const std::string& name) const {
    std::size_t m = 0;
    while (m < models_.size() && models_[m]->name() != name) ++m;
    return m;
  }
  /// True if `general` contains `specific`, through any number of models.
  bool contains(std::size_t general, std::size_t specific) const { return contains_[general][specific]; }

  /// The chosen model: the most specific one that no estimated generalisation rejects. Of several, the one with more
  /// inliers; of those within 10 %, the one with more equations of a measurement, then with fewer parameters. The null
  /// model while there is no estimate.
  std::size_t best() const {
    const std::size_t winner = bestOf([&](std::size_t m) { return survives(m); }, !options_.choice.support.guard);
    return options_.choice.support.guard || winner == none ? orNull(winner) : bestWithin(winner);
  }
  /// The same by other tests than those of the options.
  template <class Phi>
  std::size_t best(const SupportTest& support, const Phi& phi) const {
    std::vector<char> survivors(models_.size(), 0);
    for (std::size_t m = 0; m < models_.size(); ++m) {
      survivors[m] = states_[m].hasEstimate();
      for (std::size_t g = 0; g < models_.size() && survivors[m]; ++g) {
        if (!contains_[g][m] || !states_[g].hasEstimate()) continue;
        survivors[m] = compare(m, g, support, phi) == Rejection::none;
      }
    }
    return orNull(bestOf([&](std::size_t m) { return survivors[m] != 0; }, !support.guard));
  }
  /// The models that the measurements do not tell apart: the chosen one first, then those that cast doubt on it, the
  /// most specific ones of them. One alone: the choice is clear.
  std::vector<std::size_t> contested() const {
    const std::size_t chosen = best();
    std::vector<std::size_t> all = {chosen}, doubtful;
    if (!states_[chosen].hasEstimate()) return all;
    for (std::size_t g = 0; g < models_.size(); ++g) {
      if (survives(g) && doubts(g, chosen)) doubtful.push_back(g);
    }
    for (const std::size_t g : doubtful) {
      if (std::none_of(doubtful.begin(), doubtful.end(), [&](std::size_t m) { return contains_[g][m]; }))
        all.push_back(g);
    }
    return all;
  }

  /// Why `specific` is rejected in favour of `general`, if it is; both are estimated.
  Rejection compare(std::size_t specific, std::size_t general) const {
    return compare(specific, general, options_.choice.support, options_.choice.phi);
  }
  /// The same by other tests than those of the options.
  template <class Phi>
  Rejection compare(std::size_t specific, std::size_t general, const SupportTest& support, const Phi& phi) const {
    return compared(specific, general, support, phi, options_.choice.cost, true);
  }

 private:
  template <class Phi>
  Rejection compared(std::size_t specific, std::size_t general, const SupportTest& support, const Phi& phi, double cost,
                     bool noise_excuses) const {
    const State &s = states_[specific], &g = states_[general];
    const Model &model_s = *models_[specific], &model_g = *models_[general];
    const double guard = support.guard.value_or(guardOf(general));
    std::size_t far = 0, common = 0, only_general = 0;
    std::vector<double> far_errors;
    std::size_t explained = 0;
    ModelFit fit_s{0, 0, model_s.freeParameters()}, fit_g{0, 0, model_g.freeParameters()};
    for (std::size_t i = 0; i < size(); ++i) {
      const double limit = limitOf(specific, s.threshold, i);
      const bool in_s = s.errors[i] < limit, in_g = g.errors[i] < limitOf(general, g.threshold, i);
      if (!(s.errors[i] <= guard * limit)) {
        ++far;
        explained += in_g;
      }
      if (in_g) ++(in_s ? common : only_general);
      if (!in_s || !in_g) continue;
      add(fit_s, specific, i, s.errors[i]), add(fit_g, general, i, g.errors[i]);
    }
    const double chance = model_g.chance(g.threshold);
    const int freedom = model_g.freedomBeyond(model_s);
    const auto by_chance = [&](std::size_t of) { return support.explained(of, freedom, model_g.equations(), chance); };
    if (explained > by_chance(far)) {
      // Noise of any size that is equal in all directions brings measurements close to a model of fewer equations.
      const bool may_be_noise = !support.guard && noise_excuses && model_s.equations() > model_g.equations();
      if (!may_be_noise || explained > explainedByNoise(specific, general, guard, support)) return Rejection::support;
    }
    // Near or far: what leaves most of the other's inliers is not the model of them.
    if (only_general > common + by_chance(size() - common)) return Rejection::support;
    if (fitRejects(fit_s, fit_g, phi)) return Rejection::fit;
    if (support.guard) return Rejection::none;
    return costExcess(specific, general, freedom) > cost ? Rejection::cost : Rejection::none;
  }
  /// The multiple of a threshold beyond which measurements are far, by the excess noise of the general model.
  double guardOf(std::size_t general) const {
    const State& g = states_[general];
    const double threshold = g.threshold > 0 ? knownThreshold(models_[general]->equations()) / g.threshold : 1;
    return std::clamp(g.excess_noise * threshold, 1.0, max_excess_noise);
  }
  /// The number of measurements far from the specific model that chance, noise and its freedom bring to the general
  /// one.
  std::size_t explainedByNoise(std::size_t specific, std::size_t general, double guard,
                               const SupportTest& support) const {
    const State &s = states_[specific], &g = states_[general];
    const Model& model = *models_[general];
    const double chance = model.chance(g.threshold);
    std::vector<double> chances;
    for (std::size_t i = 0; i < size(); ++i) {
      if (s.errors[i] <= guard * limitOf(specific, s.threshold, i)) continue;
      const int p = models_[specific]->equationsOf(measurements_[i]), q = model.equationsOf(measurements_[i]);
      const double limit = limitOf(general, g.threshold, i);
      chances.push_back(p > q ? std::max(chance, chanceOfIsotropicNoise(s.errors[i], limit, q, p)) : chance);
    }
    return support.explained(chances, model.freedomBeyond(*models_[specific]), model.equations());
  }
  /// True if a model can reject or doubt another one: it contains it, or has fewer equations and is not contained.
  bool mayExcel(std::size_t general, std::size_t specific) const {
    const bool fewer = models_[general]->equations() < models_[specific]->equations();
    return contains_[general][specific] || (fewer && !contains_[specific][general]);
  }
  bool rejects(std::size_t general, std::size_t specific) const {
    return mayExcel(general, specific) && compare(specific, general) != Rejection::none;
  }
  /// True if a model casts doubt on another one. A general model of as many equations that has not as many residual
  /// degrees of freedom as parameters fits whatever there is: not tested is not passed.
  bool doubts(std::size_t general, std::size_t specific) const {
    if (!mayExcel(general, specific)) return false;
    const bool same = models_[general]->equations() == models_[specific]->equations();
    const ModelFit& fit = states_[general].fit;
    if (same && fit.degreesOfFreedom() < fit.free_parameters) return true;
    SupportTest support = options_.doubt.support;
    support.guard = options_.choice.support.guard;
    return compared(specific, general, support, options_.doubt.phi, options_.doubt.cost, false) != Rejection::none;
  }
  /// Standard deviations by which the inliers of a model of fewer equations cost more under the other one than its
  /// further equations and the freedom explain; -∞ where it has no fewer.
  double costExcess(std::size_t specific, std::size_t general, int freedom) const {
    const State &s = states_[specific], &g = states_[general];
    const int d = models_[specific]->equations() - models_[general]->equations();
    if (d <= 0) return -std::numeric_limits<double>::infinity();
    const double v = CostTest::scale(guardOf(general)), most = CostTest::most(d);
    double sum = 0;
    std::size_t n = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const auto& one = measurements_[i];
      if (!(g.errors[i] < limitOf(general, g.threshold, i))) continue;
      if (models_[specific]->equationsOf(one) - models_[general]->equationsOf(one) != d) continue;
      // Errors that are not numbers are far.
      const double cost = (s.errors[i] - g.errors[i]) / v;
      sum += cost < most ? std::max(cost, 0.0) : most;
      ++n;
    }
    return n > 0 ? CostTest::excess(sum, n, d, freedom, v) : -std::numeric_limits<double>::infinity();
  }

  std::size_t orNull(std::size_t m) const { return m == none ? null_ : m; }
  /// Only the winner and what it contains reject: a model within it that these do not even cast doubt on takes its
  /// place.
  std::size_t bestWithin(std::size_t winner) const {
    const auto doubted = [&](std::size_t m) {
      for (std::size_t g = 0; g < models_.size(); ++g) {
        const bool counts = contains_[g][m] && states_[g].hasEstimate() && (g == winner || contains_[winner][g]);
        if (counts && doubts(g, m)) return true;
      }
      return false;
    };
    const auto may_replace = [&](std::size_t m) {
      return contains_[winner][m] && states_[m].hasEstimate() && !doubted(m);
    };
    const std::size_t next = bestOf(may_replace, true);
    return next == none ? winner : bestWithin(next);
  }
  /// The best of the most specific models that are not rejected; none: there is none. `adaptive`: the noise is not
  /// known.
  template <class Survives>
  std::size_t bestOf(const Survives& survives, bool adaptive) const {
    std::vector<std::size_t> chosen;
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (!survives(m)) continue;
      bool most_specific = true;
      for (std::size_t other = 0; other < models_.size(); ++other) {
        if (contains_[m][other] && survives(other)) most_specific = false;
      }
      if (most_specific) chosen.push_back(m);
    }
    if (chosen.empty()) return none;
    // Neither of two models may contain the other; the one with more equations may cost too much all the same.
    if (adaptive) {
      const std::vector<std::size_t> all = chosen;
      std::erase_if(chosen, [&](std::size_t m) {
        return std::any_of(all.begin(), all.end(), [&](std::size_t g) { return g != m && rejects(g, m); });
      });
    }
    // Counts at the noise that the data show.
    double noise = adaptive ? max_excess_noise : 1;
    for (const std::size_t m : chosen) noise = std::min(noise, guardOf(m));
    std::vector<std::size_t> counts;
    for (const std::size_t m : chosen) {
      std::size_t count = 0;
      for (std::size_t i = 0; i < size(); ++i) {
        count += states_[m].errors[i] < noise * limitOf(m, states_[m].threshold, i);
      }
      counts.push_back(count);
    }
    const std::size_t most = *std::max_element(counts.begin(), counts.end());
    std::size_t best = none;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      if (1.1 * static_cast<double>(counts[k]) < static_cast<double>(most)) continue;
      if (best == none || isSimpler(chosen[k], best)) best = chosen[k];
    }
    return best;
  }

  /// A local optimum that so many starts reach ends the search for others.
  static constexpr std::size_t agreeing_starts = 3;
  /// The samples of a local optimum's own inliers that may confirm it.
  static constexpr std::size_t own_samples = 5;
  /// Passes from a hypothesis to a local optimum, with few steps of the estimate each, because the inliers still
  /// change: the first ones within a multiple of the threshold, whose optima are few.
  static constexpr int max_passes = 6, wide_passes = 2, rough_steps = 5;
  static constexpr double wide_threshold = 9;
  /// Scores of the same optimum differ by this for each measurement at most, and those of equal ones by less than half
  /// a measurement: a choice between these is one between accidents.
  static constexpr std::int64_t same_optimum = std::int64_t{1} << 20, equal_scores = std::int64_t{1} << 31;
  /// The share of right measurements among those off a dominant model that its completion reckons with.
  static constexpr double min_completing_share = 0.15;
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  using Draws = detail::ModelDraws<Measurement, Parameter>;
  /// An estimate of a model, by what it was made from.
  struct Refined {
    std::uint64_t key = 0;
    ModelEstimate<Parameter> estimate;
    bool is_rough = false;  ///< it ended before it converged
  };

  /// Looks parents up, and what contains what.
  void link() {
    const std::size_t n = models_.size();
    parents_.resize(n), children_.resize(n), rank_.assign(n, 0);
    contains_.assign(n, std::vector<char>(n, 0));
    for (std::size_t m = 0; m < n && fault_.empty(); ++m) {
      if (find(models_[m]->name()) != m) fault_ = "two models are called " + models_[m]->name();
      const std::vector<std::string> names = models_[m]->parents();
      if (names.empty() && null_ != none) fault_ = "two models have no parents";
      if (names.empty()) null_ = m;
      for (const std::string& parent : names) {
        const std::size_t p = find(parent);
        if (p == n) {
          fault_ = models_[m]->name() + " has the parent " + parent + ", which is no model";
          return;
        }
        parents_[m].push_back(p), children_[p].push_back(m);
        contains_[m][p] = 1;
      }
    }
    if (null_ == none && fault_.empty()) fault_ = "no model is without parents";
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t a = 0; a < n; ++a) {
        for (std::size_t b = 0; b < n; ++b) contains_[a][b] = contains_[a][b] || (contains_[a][k] && contains_[k][b]);
      }
    }
    for (std::size_t m = 0; m < n && fault_.empty(); ++m) {
      if (contains_[m][m]) fault_ = models_[m]->name() + " contains itself";
      rank_[m] = static_cast<std::size_t>(std::count(contains_[m].begin(), contains_[m].end(), 1));
    }
  }

  void checkLimits() {
    for (const auto& model : models_) {
      if (!fault_.empty()) return;
      if (model->sampleSize() > detail::max_sampled) {
        fault_ = model->name() + " has minimal samples of " + std::to_string(model->sampleSize()) + ", " +
                 std::to_string(detail::max_sampled) + " at most are drawn";
      } else if (model->equations() < 1 || model->equations() > detail::max_equations) {
        fault_ = model->name() + " has " + std::to_string(model->equations()) + " equations, they are 1 to " +
                 std::to_string(detail::max_equations);
      }
    }
    const bool is_share = options_.outlier_share > 0 && options_.outlier_share < 1;
    if (fault_.empty() && !is_share) fault_ = "the share of outliers is not between 0 and 1";
  }

  double knownThreshold(int equations) const {
    return thresholds_[static_cast<std::size_t>(std::clamp(equations, 0, detail::max_equations))];
  }
  /// The threshold for one measurement, from that of measurements with the usual number of equations.
  double limitOf(std::size_t m, double threshold, std::size_t i) const {
    const int usual = models_[m]->equations(), here = models_[m]->equationsOf(measurements_[i]);
    return here == usual ? threshold : threshold * knownThreshold(here) / knownThreshold(usual);
  }
  void add(ModelFit& fit, std::size_t m, std::size_t i, double error) const {
    fit.chi2 += error;
    fit.equations += static_cast<std::size_t>(models_[m]->equationsOf(measurements_[i]));
  }
  double thresholdOf(std::size_t m, std::span<const double> errors) const {
    return options_.threshold ? options_.threshold(errors, models_[m]->equations())
                              : knownThreshold(models_[m]->equations());
  }
  std::vector<double> errorsOf(std::size_t m, const Parameter& parameter) const {
    std::vector<double> errors(size());
    models_[m]->errors(parameter, measurements_.all(), errors);
    return errors;
  }

  /// Begins again with the null model; estimates stay until there are others.
  void restart() {
    if (states_.empty()) states_.resize(models_.size());
    ending_.reset();
    unconfirmed_.assign(models_.size(), std::nullopt);
    for (std::size_t m = 0; m < models_.size(); ++m) {
      draws_[m].restart();
      states_[m].progress = State::Progress::idle;
      states_[m].draws = 0;
      if (!states_[m].hasEstimate()) states_[m] = State{};
    }
    states_[null_].progress = State::Progress::candidate;
    decide();
  }
  /// The candidate that is next: of the most specific ones the one with the fewest draws, because the n-th draw
  /// improves the best of those before it with probability 1/n. More general models wait, so that what guides them is
  /// final.
  std::size_t next() const {
    std::size_t best = none;
    if (!valid()) return best;
    if (ending_) return ending_->model;
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (states_[m].progress != State::Progress::candidate) continue;
      if (best == none || rank_[m] < rank_[best] ||
          (rank_[m] == rank_[best] && states_[m].draws < states_[best].draws)) {
        best = m;
      }
    }
    return best;
  }
  /// How many draws the model needs at what has been found.
  std::size_t drawsNeeded(std::size_t m) const {
    const std::size_t s = models_[m]->sampleSize();
    if (size() < s || size() == 0) return 0;
    if (s == 0) return 1;
    const double found =
        draws_[m].hasBest() ? static_cast<double>(draws_[m].best().inliers) / static_cast<double>(size()) : 0;
    return std::min(options_.max_draws, sampleCount(std::max(found, options_.min_share), s, options_.confidence));
  }
  typename Draws::Guide guideOf(std::size_t m, std::size_t draw) const {
    typename Draws::Guide guide;
    if (!options_.guided || draw % 4 == 0) return guide;
    std::vector<std::size_t> parents;
    for (const std::size_t p : parents_[m]) {
      const State& state = states_[p];
      const bool final = state.progress == State::Progress::evaluated && state.hasEstimate() && !state.unsupported;
      if (final && models_[p]->sampleSize() < models_[m]->sampleSize()) parents.push_back(p);
    }
    if (parents.empty()) return guide;
    const std::size_t p = parents[(draw / 4 * 3 + draw % 4 - 1) % parents.size()];
    const State& parent = states_[p];
    const std::size_t missing = models_[m]->sampleSize() - models_[p]->sampleSize();
    if (size() - parent.inliers.size() < missing) return guide;
    guide.kept = sampleOf(p, draws_[p].bestDraw());
    guide.excluded.assign(size(), 0);
    for (std::size_t i = 0; i < size(); ++i) guide.excluded[i] = parent.errors[i] < limitOf(p, parent.threshold, i);
    for (const std::size_t i : guide.kept) guide.excluded[i] = 1;
    return guide;
  }

  void takeHypothesis(std::size_t m) {
    State& state = states_[m];
    const auto& best = draws_[m].best();
    state.hypothesis = best.parameter;
    state.score = static_cast<double>(best.score) / 0x1p32 / static_cast<double>(size());
    state.hypothesis_inliers = best.inliers;
    state.sample.clear();
    for (const std::size_t i : sampleOf(m, draws_[m].bestDraw())) state.sample.push_back(measurements_.id(i));
  }

  /// An estimate with what follows from it.
  struct Candidate {
    ModelEstimate<Parameter> estimate;
    std::vector<double> errors;
    double threshold = 0;
    std::int64_t score = 0;
    bool is_rough = false;
    std::uint64_t set = 0;    ///< the key of its inliers
    std::size_t reached = 1;  ///< by so many starts
    bool set_aside = false;   ///< no other start confirms it

    bool isBetterThan(const Candidate& other) const {
      if (set_aside != other.set_aside) return other.set_aside;
      const bool usable = estimate.usable();
      return usable != other.estimate.usable() ? usable : score > other.score;
    }
  };
  /// The local optimum that a hypothesis leads to: the estimate from the measurements within a wide threshold, and then
  /// from the inliers until these repeat, or are those of an optimum that is known already. None if `stop` ended it.
  std::optional<Candidate> refine(std::size_t m, const typename Draws::Place& place, std::vector<Refined>& made,
                                  std::span<const Candidate> known_optima, int passes, const StopRequest& stop) const {
    std::uint64_t key = detail::mixBits(draws_[m].drawKey(place.draw), place.solution);
    for (const std::size_t i : sampleOf(m, place.draw)) key = detail::mixBits(key, measurements_.key(i));
    return refine(m, draws_[m].at(place).parameter, key, made, known_optima, passes, stop);
  }
  std::optional<Candidate> refine(std::size_t m, Parameter parameter, std::uint64_t key, std::vector<Refined>& made,
                                  std::span<const Candidate> known_optima, int passes, const StopRequest& stop) const {
    Candidate candidate;
    candidate.errors = errorsOf(m, parameter);
    candidate.threshold = thresholdOf(m, candidate.errors);
    std::uint64_t last = 0;
    int steps = 0;
    const StopRequest few_steps = [&] { return ++steps >= rough_steps || (stop && stop()); };
    for (int pass = 0; pass < passes; ++pass) {
      const bool is_wide = pass < wide_passes;
      std::vector<Measurement> inliers;
      const std::uint64_t set = inliersOf(m, candidate, is_wide ? wide_threshold : 1, is_wide, inliers);
      if (set == last && is_wide) continue;
      if (set == last && !candidate.is_rough) break;
      if (!is_wide) {
        const auto same = std::find_if(known_optima.begin(), known_optima.end(), [&](const Candidate& optimum) {
          return optimum.set == set && optimum.estimate.usable();
        });
        if (same != known_optima.end()) return *same;
        candidate.set = set;
      }
      last = set, key = detail::mixBits(key, set);
      const auto known = std::find_if(made.begin(), made.end(), [&](const Refined& r) { return r.key == key; });
      Refined found{key, {}, false};
      if (known != made.end()) {
        found = *known;
      } else {
        steps = 0;
        found.estimate = models_[m]->estimate(parameter, inliers, few_steps);
        if (stop && stop()) return std::nullopt;
        found.is_rough = steps >= rough_steps;
        // A model need not have a usable estimate before its end.
        if (found.is_rough && !found.estimate.usable() && !is_wide) {
          found = {key, models_[m]->estimate(parameter, inliers, stop), false};
          if (stop && stop()) return std::nullopt;
        }
        made.push_back(found);
      }
      if (!found.estimate.usable() && is_wide) continue;
      if (!found.estimate.usable()) break;
      candidate.estimate = std::move(found.estimate), candidate.is_rough = found.is_rough;
      parameter = candidate.estimate.parameter;
      candidate.errors = errorsOf(m, parameter);
      candidate.threshold = thresholdOf(m, candidate.errors);
    }
    candidate.score = scoreOf(m, candidate.errors, candidate.threshold);
    return candidate;
  }
  /// Hypotheses of a model from the estimate of another one that dominates its inliers, and measurements off that.
  struct Completions {
    std::vector<std::size_t> off;  ///< places of the measurements off the other model
    std::size_t draws = 0;         ///< samples of these
    std::vector<Parameter> best = {};
  };
  /// The best so many of the hypotheses that samples off another model determine. The samples depend on what is off it
  /// alone, not on the seed.
  Completions completionsBy(std::size_t other, std::size_t m, std::size_t count) const {
    const Model& model = *models_[m];
    Completions found;
    const std::size_t s = model.completionSize(*models_[other]);
    const bool dominates = s > 0 && isFinal(other) && !states_[other].unsupported && draws_[m].hasBest() &&
                           2 * states_[other].inliers.size() > draws_[m].best().inliers;
    if (!dominates) return found;
    detail::KeyedMeasurements<Measurement> off;
    for (std::size_t i = 0; i < size(); ++i) {
      if (!(states_[other].errors[i] >= limitOf(other, states_[other].threshold, i))) continue;
      off.add(measurements_[i]), found.off.push_back(i);
    }
    if (off.size() < s) return found;
    found.draws = sampleCount(min_completing_share, s, options_.confidence);
    std::vector<std::pair<std::int64_t, Parameter>> scored;
    std::vector<double> errors(size());
    std::vector<std::size_t> sample;
    std::vector<Measurement> sampled;
    std::vector<Parameter> solutions;
    for (std::size_t draw = 0; draw < found.draws; ++draw) {
      detail::keyedSample(off, draw, s, sample, [](std::size_t) { return true; });
      sampled.clear(), solutions.clear();
      for (const std::size_t i : sample) sampled.push_back(off[i]);
      model.complete(*models_[other], states_[other].estimate.parameter, sampled, solutions);
      for (const Parameter& solution : solutions) {
        model.errors(solution, measurements_.all(), errors);
        scored.emplace_back(scoreOf(m, errors, knownThreshold(model.equations())), solution);
      }
    }
    std::stable_sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    scored.resize(std::min(count, scored.size()));
    for (auto& [score, parameter] : scored) found.best.push_back(std::move(parameter));
    return found;
  }
  /// True if a completed model has more of the measurements off the other one than its freedom and chance explain in
  /// the best of so many samples. Chance is at least what the measurements just beyond the threshold show: errors that
  /// are not noise, as those of another structure, are spread evenly about the model.
  bool isBeyondChance(std::size_t m, std::size_t other, const Completions& completions,
                      const Candidate& candidate) const {
    const Model& model = *models_[m];
    std::size_t explained = 0, beyond = 0;
    for (const std::size_t i : completions.off) {
      const double limit = limitOf(m, candidate.threshold, i);
      explained += candidate.errors[i] < limit;
      beyond += candidate.errors[i] >= limit && candidate.errors[i] < max_excess_noise * limit;
    }
    // The volume between these bounds over that within the threshold.
    const double ratio = std::pow(max_excess_noise, 0.5 * model.equations()) - 1;
    const double shown = static_cast<double>(beyond) / ratio / static_cast<double>(completions.off.size());
    SupportTest support = options_.choice.support;
    support.probability = 1 - (1 - support.probability) / static_cast<double>(completions.draws);
    return explained > support.explained(completions.off.size(), model.freedomBeyond(*models_[other]),
                                         model.equations(), std::max(shown, model.chance(candidate.threshold)));
  }

  /// The measurements within a multiple of the candidate's threshold, and their key.
  std::uint64_t inliersOf(std::size_t m, const Candidate& candidate, double wide, std::uint64_t key,
                          std::vector<Measurement>& inliers) const {
    for (std::size_t i = 0; i < size(); ++i) {
      if (!(candidate.errors[i] < wide * limitOf(m, candidate.threshold, i))) continue;
      inliers.push_back(measurements_[i]);
      key = detail::mixBits(key, measurements_.key(i));
    }
    return key;
  }
  std::int64_t scoreOf(std::size_t m, std::span<const double> errors, double threshold) const {
    std::int64_t score = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      score += detail::scoreOf(options_.score, errors[i], limitOf(m, threshold, i));
    }
    return score;
  }
  /// The end of a model: the local optima that its best hypotheses and its completions lead to. One that a single start
  /// reaches may be an accident of the draws: it stands if samples of its own inliers, which do not depend on the seed,
  /// lead to it again. This is tried when all models have ended, of those that are
  /// not rejected.
  struct Ending {
    std::size_t model;
    std::vector<typename Draws::Place> places;  ///< of the hypotheses
    std::size_t place = 0;                      ///< the next one
    std::size_t other = 0, completion = 0;      ///< the next completion
    std::optional<Completions> completions = {};
    std::size_t own_sample = 0;
    std::vector<Candidate> optima = {};
    std::optional<std::size_t> taken = {};  ///< the optimum that is the model's estimate
    std::vector<Refined> made = {};         ///< from completions and own samples

    Ending(std::size_t m, std::vector<typename Draws::Place> from) : model(m), places(std::move(from)) {}
    void visit(Candidate found, std::int64_t same) {
      for (Candidate& known : optima) {
        if (std::abs(known.score - found.score) > same) continue;
        if (known.estimate.usable() == found.estimate.usable()) return void(++known.reached);
      }
      optima.push_back(std::move(found));
    }
    /// The optimum that most starts reach, among those with the best score or one as good.
    std::size_t best() const {
      std::size_t first = 0;
      for (std::size_t k = 1; k < optima.size(); ++k) first = optima[k].isBetterThan(optima[first]) ? k : first;
      std::size_t most = first;
      for (std::size_t k = 0; k < optima.size(); ++k) {
        const bool equal = !optima[k].set_aside && optima[k].estimate.usable() == optima[first].estimate.usable() &&
                           optima[first].score - optima[k].score < equal_scores;
        if (equal && optima[k].reached > optima[most].reached) most = k;
      }
      return most;
    }
  };
  /// The local optimum that the best solution of a sample of an optimum's own inliers leads to.
  std::optional<Candidate> refineOwnSample(Ending& ending, std::size_t optimum, const StopRequest& stop) const {
    const std::size_t m = ending.model;
    const Candidate& of = ending.optima[optimum];
    const Model& model = *models_[m];
    std::vector<std::size_t> sample;
    detail::keyedSample(measurements_, detail::mixBits(ending.own_sample), model.sampleSize(), sample,
                        [&](std::size_t i) { return of.errors[i] < limitOf(m, of.threshold, i); });
    std::vector<Measurement> sampled;
    sampled.reserve(sample.size());
    for (const std::size_t i : sample) sampled.push_back(measurements_[i]);
    std::vector<Parameter> solutions;
    if (sample.size() == model.sampleSize()) model.solve(sampled, solutions);
    std::optional<Candidate> best;
    for (const Parameter& solution : solutions) {
      Candidate one;
      one.errors = errorsOf(m, solution);
      one.score = scoreOf(m, one.errors, knownThreshold(model.equations()));
      if (best && best->score >= one.score) continue;
      best = std::move(one), best->estimate.parameter = solution;
    }
    if (!best) return Candidate{};
    const std::uint64_t key = detail::mixBits(static_cast<std::uint64_t>(of.score), ending.own_sample);
    return refine(m, best->estimate.parameter, key, ending.made, ending.optima, max_passes, stop);
  }
  /// One start of the model that ends; true while there is more to do.
  bool end(const StopRequest& stop) {
    Ending& ending = *ending_;
    const std::size_t m = ending.model;
    const std::int64_t same = same_optimum * static_cast<std::int64_t>(std::max<std::size_t>(size(), 64));
    const auto agree = [&] {
      return !ending.optima.empty() && ending.optima[ending.best()].reached >= agreeing_starts;
    };
    if (ending.place < ending.places.size() && !agree()) {
      std::optional<Candidate> found =
          refine(m, ending.places[ending.place], refined_[m], ending.optima, max_passes, stop);
      if (!found) return true;
      ++ending.place;
      ending.visit(std::move(*found), same);
      if (!states_[m].hasEstimate()) take(m, ending.optima[ending.best()]);
      return true;
    }
    ending.place = ending.places.size();
    for (; ending.other < models_.size(); ++ending.other, ending.completion = 0, ending.completions.reset()) {
      if (!ending.completions) {
        ending.completions = completionsBy(ending.other, m, std::max<std::size_t>(options_.refined_hypotheses, 1));
      }
      if (ending.completion == ending.completions->best.size()) continue;
      std::optional<Candidate> found =
          refine(m, ending.completions->best[ending.completion], detail::mixBits(ending.other, ending.completion),
                 ending.made, ending.optima, max_passes, stop);
      if (!found) return true;
      ++ending.completion;
      if (isBeyondChance(m, ending.other, *ending.completions, *found)) ending.visit(std::move(*found), same);
      return true;
    }
    const std::size_t best = ending.best();
    const auto is_open = [&](const Candidate& one) {
      return models_[m]->sampleSize() > 0 && !one.set_aside && one.reached == 1;
    };
    if (ending.taken && ending.own_sample < own_samples && is_open(ending.optima[best])) {
      std::optional<Candidate> found = refineOwnSample(ending, best, stop);
      if (!found) return true;
      if (!found->errors.empty()) ending.visit(std::move(*found), same);
      const bool is_last = ++ending.own_sample == own_samples;
      if (is_last && ending.best() == best) ending.optima[best].set_aside = is_open(ending.optima[best]);
      return true;
    }
    if (ending.taken != best) {
      if (!settle(m, ending.optima[best], stop)) return true;
      take(m, ending.optima[best]);
      const bool is_first = !ending.taken;
      ending.taken = best;
      if (is_first && is_open(ending.optima[best])) unconfirmed_[m] = std::move(ending);
    }
    ending_.reset();
    return finish(m);
  }
  /// Whole estimates of an optimum until its inliers repeat; false if `stop` ended them.
  bool settle(std::size_t m, Candidate& optimum, const StopRequest& stop) const {
    for (int pass = 0; pass < max_passes; ++pass) {
      std::vector<Measurement> inliers;
      const std::uint64_t set = inliersOf(m, optimum, 1, 0, inliers);
      if (set == optimum.set && !optimum.is_rough) return true;
      ModelEstimate<Parameter> whole = models_[m]->estimate(optimum.estimate.parameter, inliers, stop);
      if (stop && stop()) return false;
      optimum.set = set, optimum.is_rough = false;
      if (!whole.usable()) return true;
      optimum.estimate = std::move(whole);
      optimum.errors = errorsOf(m, optimum.estimate.parameter);
      optimum.threshold = thresholdOf(m, optimum.errors);
      optimum.score = scoreOf(m, optimum.errors, optimum.threshold);
    }
    return true;
  }
  /// Takes up a model that is not rejected and whose optimum is not confirmed: it may be chosen, reject or cast doubt.
  bool confirm() {
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (!unconfirmed_[m] || !survives(m)) continue;
      ending_ = std::move(unconfirmed_[m]);
      unconfirmed_[m].reset();
      return true;
    }
    return false;
  }
  void take(std::size_t m, Candidate found) {
    State& state = states_[m];
    state.estimate = std::move(found.estimate);
    state.threshold = found.threshold;
    state.errors = std::move(found.errors);
    state.outdated = false;
    classify(m);
    decide();
  }
  std::vector<std::size_t> sampleOf(std::size_t m, std::size_t draw) const {
    std::vector<std::size_t> sample;
    draws_[m].sampleOf(draw, measurements_, guideOf(m, draw), sample);
    return sample;
  }
  /// Inliers, and what follows from them, by the errors and the threshold.
  void classify(std::size_t m) {
    State& state = states_[m];
    const Model& model = *models_[m];
    state.inliers.clear();
    state.fit = {0, 0, model.freeParameters()};
    double relevance = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const double limit = limitOf(m, state.threshold, i);
      relevance += Relevance{2 * limit}.contribution(state.errors[i]);
      if (!(state.errors[i] < limit)) continue;
      state.inliers.push_back(measurements_.id(i));
      add(state.fit, m, i, state.errors[i]);
    }
    state.relevance = size() > 0 ? relevance / static_cast<double>(size()) : 0;
    const std::size_t chance =
        binomialQuantile(options_.choice.support.probability, size(), model.chance(state.threshold));
    const auto own = static_cast<double>(model.freeParameters()) / model.equations();
    state.unsupported =
        static_cast<double>(state.inliers.size()) <= static_cast<double>(model.sampleSize() + chance) + own;
    std::vector<SquaredError> errors(size());
    for (std::size_t i = 0; i < size(); ++i) {
      errors[i] = {state.errors[i], limitOf(m, state.threshold, i), model.equationsOf(measurements_[i])};
    }
    state.excess_noise = excessNoise(errors, model.freeParameters(), model.chance(max_excess_noise * state.threshold));
  }
  /// The model has ended: what comes next; true if there is something.
  bool finish(std::size_t m) {
    State& state = states_[m];
    if (!draws_[m].hasBest()) state = State{};
    state.progress = State::Progress::evaluated;
    state.draws = draws_[m].looked();
    // Those that may be asked for again.
    const std::size_t most = max_passes * std::max<std::size_t>(options_.refined_hypotheses, 1);
    auto& made = refined_[m];
    if (made.size() > most) made.erase(made.begin(), made.end() - static_cast<std::ptrdiff_t>(most));
    decide();
    bool all = options_.all_models || m == null_ || !state.hasEstimate() || state.unsupported;
    for (const std::size_t p : parents_[m]) {
      if (all || !isFinal(p)) continue;
      all = compare(p, m) != Rejection::none;
    }
    for (const std::size_t child : children_[m]) {
      if (states_[child].progress != State::Progress::idle) continue;
      if (all || mayReject(child, m)) states_[child].progress = State::Progress::candidate;
    }
    if (next() != none || confirm()) return true;
    terminate();
    return false;
  }
  /// True if a general model, which was not estimated, could reject a specific one by its support or cost: there are
  /// enough measurements that the specific one is far from, or it has more equations.
  bool mayReject(std::size_t general, std::size_t specific) const {
    const State& state = states_[specific];
    const Model &g = *models_[general], &s = *models_[specific];
    if (!options_.choice.support.guard && s.equations() > g.equations()) return true;
    std::size_t far = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      far += !(state.errors[i] <= options_.choice.support.guard.value_or(1) * limitOf(specific, state.threshold, i));
    }
    return far > options_.choice.support.explained(far, g.freedomBeyond(s), g.equations(),
                                                   g.chance(knownThreshold(g.equations())));
  }
  bool isFinal(std::size_t m) const {
    return states_[m].progress == State::Progress::evaluated && states_[m].hasEstimate();
  }
  /// Nothing is left of models that these measurements do not reach.
  void terminate() {
    for (State& state : states_) {
      if (state.progress == State::Progress::idle) state = State{};
    }
    decide();
  }
  /// Who is rejected by whom.
  void decide() {
    ++revision_;
    for (std::size_t m = 0; m < models_.size(); ++m) {
      states_[m].rejection = Rejection::none, states_[m].rejected_by.reset();
      if (!states_[m].hasEstimate()) continue;
      for (std::size_t g = 0; g < models_.size() && states_[m].rejection == Rejection::none; ++g) {
        if (!contains_[g][m] || !states_[g].hasEstimate()) continue;
        states_[m].rejection = compare(m, g);
        if (states_[m].rejection != Rejection::none) states_[m].rejected_by = g;
      }
    }
  }
  bool survives(std::size_t m) const { return states_[m].hasEstimate() && states_[m].rejection == Rejection::none; }
  bool isSimpler(std::size_t a, std::size_t b) const {
    const Model &x = *models_[a], &y = *models_[b];
    if (x.equations() != y.equations()) return x.equations() > y.equations();
    if (x.freeParameters() != y.freeParameters()) return x.freeParameters() < y.freeParameters();
    return states_[a].relevance > states_[b].relevance;
  }

  Models models_;
  HierarchyOptions options_;
  std::string fault_;
  std::size_t null_ = none;
  std::uint64_t revision_ = 0;
  std::vector<std::vector<std::size_t>> parents_, children_;
  std::vector<std::vector<char>> contains_;
  std::vector<std::size_t> rank_;
  detail::KeyedMeasurements<Measurement> measurements_;
  std::vector<Draws> draws_;
  std::vector<State> states_;
  std::vector<std::vector<Refined>> refined_;
  std::optional<Ending> ending_;
  std::vector<std::optional<Ending>> unconfirmed_;
  std::vector<double> thresholds_;  // for known noise, by the number of equations
};

}  // namespace liestat
