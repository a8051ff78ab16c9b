// The memory of states (stats/liestat_state.h): where each number stands, for the kernels and for what finishes them.
#pragma once

#include <stats/liestat_state.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace liestat::detail {

__extension__ using Int128 = __int128;

/// Words of 8 bytes. 0: "liestat" and the version; 1: manifold, kind, whether weights differ from one, 0, and as 16
/// bits each the weights' exponent and the pass; 2: n; 3: rows left out; sums: 4 to 7 the reference, 8 the largest θ².
/// Then sums of 16 bytes, in units of 2^-60 (moments) and 2^-85.
struct StateLayout {
  static constexpr char magic[] = "liestat";
  static constexpr std::uint8_t version = 1;
  static constexpr std::uint64_t max_rows = std::uint64_t{1} << 33;

  int manifold, kind;

  constexpr bool exists() const { return manifold >= 1 && manifold <= 3 && (kind == 1 || kind == 2); }
  constexpr int numbers() const { return manifold + 1; }
  constexpr int dof() const { return manifold; }
  constexpr int triangle() const { return dof() * (dof() + 1) / 2; }
  /// Sums of the row itself, for headings and directions; then of products of its numbers, a lower triangle row by row.
  constexpr int linear() const { return kind == LIESTAT_MOMENTS && manifold != LIESTAT_ROTATION ? numbers() : 0; }
  constexpr int products() const { return kind == LIESTAT_MOMENTS ? numbers() * (numbers() + 1) / 2 : 0; }
  /// Σ p z, Σ p g u uᵀ (the Hessian is Σ p (I - g (|u|² I - u uᵀ)); none of headings), Σ p θ⁴.
  constexpr int gradient() const { return 0; }
  constexpr int hessian() const { return dof(); }
  constexpr int fourth() const { return hessian() + (dof() > 1 ? triangle() : 0); }
  /// Σ p, and behind it Σ p².
  constexpr int weight() const { return kind == LIESTAT_MOMENTS ? linear() + products() : fourth() + 1; }
  /// Σ p z zᵀ and Σ p² z zᵀ, which small angles make small.
  constexpr int scatter() const { return weight() + 2; }
  constexpr int squared() const { return scatter() + triangle(); }
  constexpr int sums() const { return kind == LIESTAT_MOMENTS ? weight() + 2 : squared() + triangle(); }
  constexpr int first() const { return kind == LIESTAT_MOMENTS ? 4 : 9; }
  constexpr std::size_t words() const {
    return static_cast<std::size_t>(first()) + 2 * static_cast<std::size_t>(sums());
  }
  constexpr int unit() const { return kind == LIESTAT_MOMENTS ? 60 : 85; }
};

/// A view of a state.
class StateView {
 public:
  explicit StateView(void* state) : bytes_(static_cast<unsigned char*>(state)) {}

  StateLayout layout() const { return {bytes_[8], bytes_[9]}; }
  bool weighted() const { return bytes_[10] != 0; }
  void setWeighted() { bytes_[10] = 1; }
  int exponent() const { return get<std::int16_t>(12); }
  int pass() const { return get<std::uint16_t>(14); }
  std::uint64_t n() const { return get<std::uint64_t>(16); }
  std::uint64_t leftOut() const { return get<std::uint64_t>(24); }
  double reference(int i) const { return get<double>(32 + 8 * i); }
  double largest() const { return get<double>(64); }
  Int128 sum(int i) const { return get<Int128>(8 * layout().first() + 16 * i); }
  void setCounts(std::uint64_t n, std::uint64_t left_out) { set(16, n), set(24, left_out); }
  void setLargest(double square) { set(64, square); }
  void add(int i, Int128 units) { add(layout(), i, units); }
  /// The same where the layout is known, which spares looking.
  void add(const StateLayout& known, int i, Int128 units) {
    const int at = 8 * known.first() + 16 * i;
    set(at, static_cast<Int128>(get<Int128>(at) + units));
  }
  /// The sum as a number, correctly rounded but for subnormal ones.
  double value(int i) const;

  template <class T>
  T get(int at) const {
    T x;
    std::memcpy(&x, bytes_ + at, sizeof x);
    return x;
  }
  template <class T>
  void set(int at, const T& x) {
    std::memcpy(bytes_ + at, &x, sizeof x);
  }

 private:
  unsigned char* bytes_;
};

inline double StateView::value(int i) const { return std::ldexp(static_cast<double>(sum(i)), -layout().unit()); }

}  // namespace liestat::detail
