// Measurements ordered by what they are, so that neither draws nor sums depend on when they came.
#pragma once

#include <stats/content_key.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Measurements in the order of their keys. Equal ones are told apart by a number.
template <class Measurement>
class KeyedMeasurements {
  static_assert(
      requires(const Measurement& m) { contentKey(m); },
      "a type of measurements brings a function contentKey with it (stats/content_key.hpp)");

 public:
  using Id = std::uint64_t;

  std::size_t size() const { return measurements_.size(); }
  std::span<const Measurement> all() const { return measurements_; }
  const Measurement& operator[](std::size_t i) const { return measurements_[i]; }
  std::uint64_t key(std::size_t i) const { return entries_[i].key; }
  Id id(std::size_t i) const { return entries_[i].id; }

  /// Where it was put, and under which name.
  std::pair<std::size_t, Id> add(const Measurement& measurement) {
    const Entry entry = entryOf(measurement);
    const std::size_t at = lowerBound(entry.key);
    entries_.insert(entries_.begin() + static_cast<std::ptrdiff_t>(at), entry);
    measurements_.insert(measurements_.begin() + static_cast<std::ptrdiff_t>(at), measurement);
    return {at, entry.id};
  }
  /// Many at once; their names in their order.
  std::vector<Id> add(std::span<const Measurement> several) {
    std::vector<Id> ids;
    ids.reserve(several.size());
    std::vector<std::pair<Entry, Measurement>> all;
    all.reserve(size() + several.size());
    for (std::size_t i = 0; i < size(); ++i) all.emplace_back(entries_[i], measurements_[i]);
    for (const Measurement& m : several) {
      all.emplace_back(entryOf(m), m);
      ids.push_back(all.back().first.id);
    }
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first.key < b.first.key; });
    entries_.clear(), measurements_.clear();
    for (const auto& [entry, measurement] : all) {
      entries_.push_back(entry), measurements_.push_back(measurement);
    }
    return ids;
  }
  /// Where the measurement that may be removed for this name is, size() if there is none. Of equal measurements the last
  /// one goes, so that those that stay are as if it had never come.
  std::size_t place(Id id) {
    const auto found = keys_.find(id);
    if (found == keys_.end()) return size();
    const std::size_t at = lowerBound(found->second);
    const std::uint64_t content = entries_[at].content;
    const std::size_t last = lowerBound(mixBits(content, counts_[content] - 1));
    if (last != at) {
      std::swap(entries_[at].id, entries_[last].id);
      std::swap(keys_[entries_[at].id], keys_[entries_[last].id]);
    }
    return last;
  }
  void erase(std::size_t at) {
    const auto count = counts_.find(entries_[at].content);
    if (--count->second == 0) counts_.erase(count);
    keys_.erase(entries_[at].id);
    entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(at));
    measurements_.erase(measurements_.begin() + static_cast<std::ptrdiff_t>(at));
  }

 private:
  struct Entry {
    std::uint64_t key, content;
    Id id;
  };
  Entry entryOf(const Measurement& measurement) {
    const std::uint64_t content = contentKey(measurement);
    const std::uint64_t key = mixBits(content, counts_[content]++);
    keys_[next_] = key;
    return {key, content, next_++};
  }
  std::size_t lowerBound(std::uint64_t key) const {
    const auto at = std::lower_bound(entries_.begin(), entries_.end(), key,
                                     [](const Entry& e, std::uint64_t k) { return e.key < k; });
    return static_cast<std::size_t>(at - entries_.begin());
  }

  std::vector<Entry> entries_;
  std::vector<Measurement> measurements_;
  std::unordered_map<std::uint64_t, std::uint64_t> counts_;  // number of equal measurements, by content
  std::unordered_map<Id, std::uint64_t> keys_;
  Id next_ = 0;
};

inline constexpr std::size_t max_sampled = 16;

/// The `count` measurements, `max_sampled` at most, whose keys, mixed with that of the draw, are the smallest among those that `admitted` lets in:
/// each set with the same probability, and the same set whatever else comes or goes but for what enters it. The last one
/// has the largest mixed key, which is returned; fewer than `count`: all ones.
template <class Measurement, class Admitted>
std::uint64_t keyedSample(const KeyedMeasurements<Measurement>& from, std::uint64_t draw, std::size_t count,
                          std::vector<std::size_t>& sample, const Admitted& admitted) {
  std::uint64_t keys[max_sampled];
  std::size_t found = 0;
  sample.assign(count, 0);
  for (std::size_t i = 0; i < from.size(); ++i) {
    const std::uint64_t key = mixBits(from.key(i) ^ draw);
    if (found == count && (count == 0 || key >= keys[count - 1])) continue;
    if (!admitted(i)) continue;
    std::size_t k = found < count ? found++ : count - 1;
    for (; k > 0 && keys[k - 1] > key; --k) keys[k] = keys[k - 1], sample[k] = sample[k - 1];
    keys[k] = key, sample[k] = i;
  }
  sample.resize(found);
  return found == count && count > 0 ? keys[count - 1] : std::numeric_limits<std::uint64_t>::max();
}

}  // namespace liestat::detail
