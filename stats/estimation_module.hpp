// An estimation module for a reactive program: measurements on several channels and constants of the models go in at any
// time, the chosen model with its parameter can be read at any time, and the work is started, suspended and stopped from
// outside (T. Viéville, D. Lingrand, F. Gaspard, "Implementing a variant of the Kanatani's estimation method", INRIA
// RR-4050, 2000, section 6; docs/estimation_module.md).
//
//   using Measurement = std::variant<Point, Tangent>;   // a channel for each
//   EstimationModule<Measurement, Parameter, Camera> module(models_of_camera, camera);
//   module.set<0>(17, point);                           // replaces what was set on channel 0 as 17
//   module.start();
//   module.run();                                       // or while (module.step()) {}
//   const auto found = module.output();                 // model, parameter, covariance, inliers
//
// Any thread may call anything, but step(), run() and search() belong to one thread at a time. The models are those of
// stats/hierarchy.hpp, which does the work. Models that are generated at run time and canonical forms of their equations
// (the report's last paragraph of section 6) are left out: the lattice that the factory returns is fixed.
#pragma once

#include <stats/channels.hpp>
#include <stats/estimation_module_types.hpp>
#include <stats/hierarchy.hpp>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

namespace liestat {

/// `State` holds the constants of the models and measurement equations, from which the factory makes the models.
template <class Measurement_, class Parameter_, class State_ = std::monostate>
class EstimationModule {
 public:
  using Measurement = Measurement_;
  using Parameter = Parameter_;
  using State = State_;
  using Search = Hierarchy<Measurement, Parameter>;
  using Factory = std::function<typename Search::Models(const State&)>;
  using Output = ModuleOutput<Parameter>;
  using Options = ModuleOptions<Parameter>;
  using Name = std::uint64_t;
  static constexpr std::size_t channels = detail::ChannelsOf<Measurement>::count;
  template <std::size_t Channel>
  using MeasurementOn = typename detail::ChannelsOf<Measurement>::template Type<Channel>;

  explicit EstimationModule(Factory factory, State state = {}, Options options = {})
      : factory_(std::move(factory)),
        options_(std::move(options)),
        state_(std::move(state)),
        search_(factory_(state_), options_.search) {
    publish();
  }

  /// Sets the measurement of this name on a channel, instead of the one that was there. What is set counts from the next
  /// step on (ModuleOptions::steps_between_inputs may delay it); numbers that are not finite are outliers of all models.
  template <std::size_t Channel>
  void set(Name name, const MeasurementOn<Channel>& value) {
    set(name, detail::ChannelsOf<Measurement>::template make<Channel>(value));
  }
  /// The same on the channel of the alternative; false for a variant without a value.
  bool set(Name name, const Measurement& measurement) {
    const Key key(detail::ChannelsOf<Measurement>::of(measurement), name);
    if (key.first >= channels) return false;
    const std::lock_guard lock(mutex_);
    inputs_.insert_or_assign(key, measurement);
    changed_.insert(key);
    return true;
  }
  /// Takes a measurement back; false if there is none of that name on that channel, or no such channel.
  bool unset(std::size_t channel, Name name) {
    const std::lock_guard lock(mutex_);
    if (inputs_.erase({channel, name}) == 0) return false;
    changed_.insert({channel, name});
    return true;
  }
  /// New constants: the next step makes new models and begins again with the null model, over the same measurements.
  void setState(State state) {
    const std::lock_guard lock(mutex_);
    state_ = std::move(state);
    new_state_ = true;
  }
  State state() const {
    const std::lock_guard lock(mutex_);
    return state_;
  }
  /// How many measurements are set.
  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return inputs_.size();
  }

  /// Each returns whether that was the state to leave: start from stopped, suspend from running, resume from suspended, stop
  /// from both. All take effect within a step; an estimate that they end is begun again by the next step, nothing else is
  /// lost.
  bool start() { return change(ModuleControl::stopped, ModuleControl::running); }
  bool suspend() { return change(ModuleControl::running, ModuleControl::suspended); }
  bool resume() { return change(ModuleControl::suspended, ModuleControl::running); }
  bool stop() {
    const bool changed = control_.exchange(ModuleControl::stopped) != ModuleControl::stopped;
    control_.notify_all();
    return changed;
  }
  ModuleControl control() const { return control_.load(); }

  /// The answer after the last step, which stays as it is for as long as it is held.
  std::shared_ptr<const Output> output() const {
    const std::lock_guard lock(mutex_);
    return output_;
  }

  /// Takes the inputs in, then one hypothesis or the estimates that end a model: a bounded amount of work for given
  /// measurements. `also` is asked between the steps of an estimate, and ends it as suspend() does. True while the module is
  /// running and there is more to do.
  bool step(const StopRequest& also = {}) {
    if (control() != ModuleControl::running) return false;
    takeInputs();
    search_.iterate([&] { return control() != ModuleControl::running || (also && also()); });
    publish();
    sendSignals();
    return control() == ModuleControl::running && !finished();
  }
  /// Steps until nothing is left to do (true), or the module is stopped or `also` is true (false). While it is suspended it
  /// waits: who has but one thread takes step().
  bool run(const StopRequest& also = {}) {
    while (true) {
      control_.wait(ModuleControl::suspended);
      if (control() == ModuleControl::stopped) return finished();
      step(also);
      if (finished()) return true;
      if (also && also()) return false;
    }
  }
  /// All models, estimated or not, and why they are rejected. For the thread that runs the module.
  const Search& search() const { return search_; }

 private:
  using Key = std::pair<std::size_t, Name>;  // channel, name
  using Id = typename Search::Id;

  bool change(ModuleControl from, ModuleControl to) {
    const bool changed = control_.compare_exchange_strong(from, to);
    control_.notify_all();
    return changed;
  }
  bool finished() const {
    if (search_.progress() != HierarchyState::terminated) return false;
    const std::lock_guard lock(mutex_);
    return changed_.empty() && !new_state_;
  }
  void takeInputs() {
    std::optional<State> state;
    std::set<Key> changed;
    std::vector<Key> keys;
    std::vector<Measurement> values;
    {
      const std::lock_guard lock(mutex_);
      if (!new_state_ && wait_ > 0 && search_.progress() != HierarchyState::terminated) {
        --wait_;
        return;
      }
      if (std::exchange(new_state_, false)) {
        state = state_;
        for (const auto& [key, value] : inputs_) changed_.insert(key);
      }
      changed.swap(changed_);
      for (const Key& key : changed) {
        const auto input = inputs_.find(key);
        if (input != inputs_.end()) keys.push_back(key), values.push_back(input->second);
      }
    }
    if (state) {
      search_ = Search(factory_(*state), options_.search);
      ids_.clear(), keys_.clear();
      found_.reset(), was_below_ = false;
    }
    for (const Key& key : changed) {
      const auto known = ids_.find(key);
      if (known == ids_.end()) continue;
      search_.remove(known->second);
      keys_.erase(known->second), ids_.erase(known);
    }
    const std::vector<Id> ids = search_.add(values);
    for (std::size_t i = 0; i < ids.size(); ++i) ids_[keys[i]] = ids[i], keys_[ids[i]] = keys[i];
    if (!state && changed.empty()) return;
    wait_ = options_.steps_between_inputs;
    was_terminated_ = false;
    published_.reset();
    publish();
  }
  void publish() {
    if (published_ == search_.revision()) return;
    published_ = search_.revision();
    auto next = std::make_shared<Output>();
    next->progress = search_.progress();
    next->fault = search_.fault();
    next->measurements = search_.size();
    next->inliers.resize(channels);
    if (search_.valid()) {
      next->model = search_.models()[search_.best()]->name();
      const auto& state = search_.state(search_.best());
      if (state.hasEstimate()) next->estimate = state.estimate;
      next->outdated = state.outdated;
      next->unsupported = state.unsupported;
      if (state.hasEstimate()) next->criterion = state.fit.normalised();
      for (const Id id : state.inliers) {
        const Key& key = keys_.at(id);
        next->inliers[key.first].push_back(key.second);
      }
      for (auto& names : next->inliers) std::sort(names.begin(), names.end());
    }
    const std::lock_guard lock(mutex_);
    output_ = std::move(next);
  }
  void sendSignals() {
    const std::shared_ptr<const Output> now = output();
    const auto send = [&](const typename Options::Signal& signal) {
      if (signal) signal(*now);
    };
    std::optional<std::string> found;
    if (!now->unsupported) found = now->model;
    if (found != found_) {
      found_ = found;
      if (found) send(options_.model_found);
    }
    const bool below = !now->unsupported && now->criterion < options_.cost_threshold;
    if (below != was_below_) {
      was_below_ = below;
      if (below) send(options_.cost_below);
    }
    if (now->progress == HierarchyState::terminated && !std::exchange(was_terminated_, true)) send(options_.terminated);
  }

  // Used by the thread that runs the module alone.
  Factory factory_;
  Options options_;
  mutable std::mutex mutex_;
  State state_;  // this and what follows up to output_ is guarded by the mutex
  bool new_state_ = false;
  std::map<Key, Measurement> inputs_;
  std::set<Key> changed_;  // since the last step
  std::shared_ptr<const Output> output_;
  std::atomic<ModuleControl> control_ = ModuleControl::stopped;
  // Used by the thread that runs the module alone, again.
  Search search_;
  std::map<Key, Id> ids_;
  std::unordered_map<Id, Key> keys_;
  std::size_t wait_ = 0;                    // steps before inputs are taken in again
  std::optional<std::uint64_t> published_;  // the revision of output_
  // State of the signals.
  std::optional<std::string> found_;
  bool was_below_ = false, was_terminated_ = false;
};

}  // namespace liestat
