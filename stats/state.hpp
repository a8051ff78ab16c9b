// Means that merge: states of fixed size to which rows are added in any order, on any machine, and which are merged.
//
//   MomentState<SO3d> moments;                    // one pass: the chordal mean, with a covariance of its own
//   moments.add(rotations);
//   SumState<SO3d> sums(moments.finish().mean);   // passes at a reference: the Fréchet mean, certified
//   sums.add(some), other.add(others), sums.merge(other);
//   const CertifiedMean<SO3d> mean = sums.finish();
//
// Headings (SO2d), directions (S2d) and rotations (SO3d). The sums are exact integers: a state's bytes are the same for
// any order and partition of the rows, any processor, compiler and engine (docs/states.md). A state is plain data of at
// most 456 bytes; its functions never throw. They are compiled: link liestat::means. In C: stats/liestat_state.h.
#pragma once

#include <lie/s2.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/certified_mean.hpp>
#include <stats/concentration.hpp>
#include <stats/detail/state_words.hpp>
#include <stats/gaussian.hpp>
#include <stats/liestat_state.h>
#include <stats/status.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

namespace liestat {

/// Why a state refused something; nothing has changed then.
enum class StateError {
  none = LIESTAT_STATE_OK,
  bad_argument = LIESTAT_STATE_BAD_ARGUMENT,  ///< a reference that is not of unit norm
  bad_weight = LIESTAT_STATE_BAD_WEIGHT,  ///< not finite, negative, or above the largest that the state was made for
  too_many = LIESTAT_STATE_TOO_MANY,      ///< more than 2^33 rows
  different = LIESTAT_STATE_DIFFERENT,    ///< states of other features, kinds, references, weight scales or passes
  foreign = LIESTAT_STATE_FOREIGN,        ///< not the bytes of a state, or of another kind
  newer_version = LIESTAT_STATE_NEWER_VERSION,
  forged = LIESTAT_STATE_FORGED  ///< numbers that no rows have
};
/// The same in a sentence.
inline const char* message(StateError error) { return liestat_state_error(static_cast<int>(error)); }

/// A mean in the space that the manifold is embedded in: the direction of the summed unit vectors, the rotation nearest
/// to the mean of the matrices.
template <Metric M>
struct ChordalMean {
  M mean = ManifoldTraits<M>::origin();
  /// Length of the mean unit vector; of rotations the root of the largest eigenvalue of Σ p q qᵀ/Σ p, at least ½.
  double resultant = 0;
  std::size_t n = 0;
  /// The mean with its covariance from residuals, rad², in the local frame; none unless status is ok. Of rotations an
  /// upper bound: second moments hold no Σ p cos²(θ/2) u uᵀ, for which Σ p u uᵀ stands (u = n sin(θ/2)).
  std::optional<Gaussian<M>> estimate = {};
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

/// Passes of sums after which a mean counts as not converged.
inline constexpr int max_state_passes = 12;

namespace detail {

inline constexpr const char* no_features_reason = "there are no features";
inline constexpr const char* sums_reason =
    "the sums do not prove that no other feature explains the measurements as well: only a search over them can tell "
    "(certifiedMean, or liestat mean on the file in memory)";
inline constexpr const char* wide_region_reason =
    "the region of the chordal mean is wider than 0.5 rad: no first-order covariance describes it";

template <class M>
inline constexpr int state_manifold = 0;
template <>
inline constexpr int state_manifold<SO2d> = LIESTAT_HEADING;
template <>
inline constexpr int state_manifold<S2d> = LIESTAT_DIRECTION;
template <>
inline constexpr int state_manifold<SO3d> = LIESTAT_ROTATION;

/// The operations of both kinds of states.
template <class M, int Kind>
class State {
 protected:
  static constexpr StateLayout layout{state_manifold<M>, Kind};
  static_assert(layout.exists(), "states are of SO2d, S2d or SO3d");

 public:
  using Feature = M;
  static constexpr std::size_t size = 8 * layout.words();  ///< of its bytes
  static constexpr std::size_t row = layout.numbers();     ///< numbers of a row, the feature's parameters

  /// A feature, with a weight of its precision. Features that are not finite or whose norm is off by more than 1e-3 are
  /// counted and left out; others are normalised. A weight of zero is no measurement. Weights are finite, not negative,
  /// and not above the largest that the state was made for; otherwise nothing is added.
  StateError add(const M& x, double weight = 1) { return add(x.data(), 1, row, weight == 1 ? nullptr : &weight); }
  /// Rows of numbers, `stride` of them from one row to the next, with as many weights unless that is null.
  StateError add(const double* rows, std::size_t n, std::size_t stride = row, const double* weights = nullptr) {
    return static_cast<StateError>(liestat_state_add(words_.data(), rows, n, stride, weights));
  }
  /// Features, with as many weights or none. Weights of another number are refused.
  StateError add(std::span<const M> features, std::span<const double> weights = {}) {
    static_assert(sizeof(M) == 8 * row);
    if (features.empty()) return StateError::none;
    if (!weights.empty() && weights.size() != features.size()) return StateError::bad_weight;
    return add(features.front().data(), features.size(), row, weights.empty() ? nullptr : weights.data());
  }
  /// Adds what another state of the same kind, reference, weight scale and pass has seen.
  StateError merge(const State& other) {
    return static_cast<StateError>(liestat_state_merge(words_.data(), other.words_.data()));
  }

  /// The state as it is stored and sent: little-endian, the same for the same rows.
  std::span<const std::byte, size> bytes() const { return std::as_bytes(std::span(words_)).template first<size>(); }

  std::size_t n() const { return view().n(); }               ///< rows that count
  std::size_t left_out() const { return view().leftOut(); }  ///< bad rows
  bool weighted() const { return view().weighted(); }        ///< some weight differs from one
  int weight_exponent() const { return view().exponent(); }  ///< weights are at most two to this power
  friend bool operator==(const State& a, const State& b) { return a.words_ == b.words_; }

 protected:
  State() : words_{} {}
  StateError start(const double* reference, double largest_weight, int pass) {
    int exponent = 0;
    if (!(largest_weight > 0) || !std::isfinite(largest_weight)) return StateError::bad_weight;
    if (std::frexp(largest_weight, &exponent) == 0.5) --exponent;
    return static_cast<StateError>(
        liestat_state_init(words_.data(), state_manifold<M>, Kind, reference, exponent, pass));
  }
  StateError read(std::span<const std::byte> bytes) {
    std::array<std::uint64_t, LIESTAT_STATE_LARGEST / 8> copy;
    const auto error = static_cast<StateError>(liestat_state_read(copy.data(), bytes.data(), bytes.size()));
    if (error != StateError::none) return error;
    const StateLayout found = StateView(copy.data()).layout();
    if (found.manifold != state_manifold<M> || found.kind != Kind) return StateError::foreign;
    std::copy_n(copy.begin(), words_.size(), words_.begin());
    return StateError::none;
  }
  /// Only read from.
  StateView view() const { return StateView(const_cast<std::uint64_t*>(words_.data())); }

  std::array<std::uint64_t, layout.words()> words_;
};

}  // namespace detail

/// Moments of features, whose result is the chordal mean: one pass.
template <Metric M>
class MomentState : public detail::State<M, LIESTAT_MOMENTS> {
 public:
  /// The largest weight is rounded up to a power of two; one that is not finite and positive leaves it at one.
  explicit MomentState(double largest_weight = 1) {
    if (this->start(nullptr, largest_weight, 0) != StateError::none) this->start(nullptr, 1, 0);
  }
  /// The state that these bytes are, in `error` why they are none.
  static std::optional<MomentState> fromBytes(std::span<const std::byte> bytes, StateError* error = nullptr) {
    MomentState state;
    const StateError found = state.read(bytes);
    if (error != nullptr) *error = found;
    return found == StateError::none ? std::optional(state) : std::nullopt;
  }

  /// The chordal mean with a covariance from the residuals. Without one: too_few (no more rows than dimensions),
  /// ill_defined (as scattered as uniform features by the test of Rayleigh and Bingham, or a region wider than 0.5
  /// rad).
  ChordalMean<M> finish() const;
};

/// Sums at a reference: cost, gradient and Hessian of the Fréchet mean, scatter, and what its certificates need. Its
/// result is Newton's step from the reference; with a step below the tolerance the mean has converged. From the chordal
/// mean that takes two passes for concentrated features and up to eight for wide ones.
template <Metric M>
class SumState : public detail::State<M, LIESTAT_SUMS> {
 public:
  /// At a reference of unit norm (other ones: the origin), as the pass of this number, which begins with 1.
  explicit SumState(const M& reference, int pass = 1, double largest_weight = 1) {
    if (this->start(reference.data(), largest_weight, pass) != StateError::none) {
      this->start(ManifoldTraits<M>::origin().data(), 1, 1);
    }
  }
  static std::optional<SumState> fromBytes(std::span<const std::byte> bytes, StateError* error = nullptr) {
    SumState state(ManifoldTraits<M>::origin());
    const StateError found = state.read(bytes);
    if (error != nullptr) *error = found;
    return found == StateError::none ? std::optional(state) : std::nullopt;
  }

  M reference() const {
    M x;
    for (int i = 0; i < static_cast<int>(SumState::row); ++i) x.data()[i] = this->view().reference(i);
    return x;
  }
  int pass() const { return this->view().pass(); }

  /// The mean with all that the sums prove, as certifiedMean has it: status ok only if they prove everything. Without a
  /// covariance: not_converged (the step, in mean.residual, is too long: another pass at the mean), too_few,
  /// ill_defined, or not_applicable where only a search over the rows could tell (uniqueness.unique is not_certified
  /// then, or the near ties are unknown). Of the options those of known noise, bootstrap and other meanings of weights
  /// are out of the question.
  CertifiedMean<M> finish(const CertifiedMeanOptions<M>& options = {}) const;
  /// True if sums at the mean of this result are the next step.
  bool needsPass(const CertifiedMean<M>& result) const {
    return result.mean.n > 0 && result.status == Status::not_converged && pass() < max_state_passes &&
           std::isfinite(result.mean.residual);
  }
};

/// The Fréchet mean of rows that feed(state) adds to each state that it is given, once for each pass: a MomentState
/// first, SumStates then. `passes`: how many there were.
template <Metric M, class Feed>
CertifiedMean<M> meanByPasses(const Feed& feed, double largest_weight = 1, const CertifiedMeanOptions<M>& options = {},
                              int* passes = nullptr) {
  MomentState<M> moments(largest_weight);
  feed(moments);
  M reference = moments.finish().mean;
  for (int pass = 1;; ++pass) {
    SumState<M> sums(reference, pass, largest_weight);
    feed(sums);
    CertifiedMean<M> result = sums.finish(options);
    if (passes != nullptr) *passes = pass + 1;
    if (!sums.needsPass(result)) return result;
    reference = result.mean.mean;
  }
}

extern template class MomentState<SO2d>;
extern template class MomentState<S2d>;
extern template class MomentState<SO3d>;
extern template class SumState<SO2d>;
extern template class SumState<S2d>;
extern template class SumState<SO3d>;

}  // namespace liestat
