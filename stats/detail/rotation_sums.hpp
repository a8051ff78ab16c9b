// The sums of a mean over rotations, frames and their quotients in double, several features at a time.
//
// With w = |<y, q>| of unit quaternions and u the vector part of y⁻¹q, log(y, q) = ±f(w) u with
// f(w) = 2 acos(w)/√(1-w²), and the Hessian of ½ d² is I + g(w) (u uᵀ - |u|² I) with g(w) = (1 - w f/2)/(1-w²), which
// is -f'(w)/2. Both are analytic on [0, 1], their nearest singularity lies at -1: one polynomial each, without
// atan2, square root, division or branch.
#pragma once

#include <lie/detail/arccosine.hpp>
#include <lie/so3.hpp>
#include <stats/detail/pack.hpp>

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>

namespace liestat::detail {

/// f and g on w >= 1 - 2 range: log and exact_hessian reach the rounding of double; newton_hessian, good to eight
/// digits, is for steps whose Hessian nobody sees.
template <std::size_t Log, std::size_t Exact, std::size_t Newton>
struct RotationPolynomials {
  double range;
  std::array<double, Log> log = arccosinePolynomial<Log>(false, 2, range);
  std::array<double, Exact> exact_hessian = arccosinePolynomial<Exact>(true, 1, range);
  std::array<double, Newton> newton_hessian = arccosinePolynomial<Newton>(true, 1, range);
};
/// For all rotations.
inline constexpr RotationPolynomials<21, 22, 11> any_rotation{0.5};
/// For angles up to a right angle, cos(π/4) = 0.7071…
inline constexpr RotationPolynomials<13, 13, 7> small_rotation{0.1465};
inline constexpr double small_rotation_cosine = 0.7072;

/// Manifolds whose sums are made here: SO3, Frame3, the quotients of Frame3 and whatever else shows its parameters, in
/// double.
template <class M>
concept HasRotationSums = HasRotationParameters<M> && std::same_as < typename ManifoldTraits<M>::Scalar,
double > ;

/// Σ over some features about a reference y, in the frame of y. The Hessian is exact where the scatter is asked for,
/// else good to eight digits, as Newton's method needs it.
template <HasRotationSums M>
class RotationSums {
  using T = ManifoldTraits<M>;
  static constexpr int k = T::DoF;
  static constexpr bool frame = k == 6;
  /// Columns of a block: x y z w of the quaternion, the weight, the translation less that of y.
  static constexpr std::size_t columns = frame ? 8 : 5, block = 64;
  static constexpr std::size_t entries = static_cast<std::size_t>(k * (k + 1) / 2);
  static_assert(block % pack_size == 0);

 public:
  using Tangent = typename T::Tangent;
  using Square = typename T::Square;

  double cost = 0, weight = 0;
  Tangent gradient = Tangent::Zero();
  Square hessian = Square::Zero(), scatter = Square::Zero(), squared = Square::Zero();
  double largest = 0, smallest_gap = std::numeric_limits<double>::infinity();

  /// Sums over the features begin … end-1; Weighted false takes all weights as one. False, and nothing of value in the
  /// sums, if a quaternion is not a unit one to 1e-5 or something is not finite: then the general formulas say what
  /// comes out.
  template <bool Weighted, bool Scatter, class R, class W>
  bool add(const R& samples, const W& weights, std::size_t begin, std::size_t end, const M& y) {
    alignas(64) double data[columns][block];
    const Reference reference(y);
    Accumulators sums;
    double gap_cosine = -1;
    for (std::size_t i = begin; i < end; i += block) {
      const std::size_t count = end - i < block ? end - i : block;
      for (std::size_t j = 0; j < count; ++j) {
        const M& x = samples[i + j];
        const double* const p = T::parameters(x);
        for (std::size_t c = 0; c < 4; ++c) data[c][j] = p[c];
        if constexpr (Weighted) weight += data[4][j] = static_cast<double>(weights[i + j]);
        if constexpr (frame) {
          for (std::size_t c = 0; c < 3; ++c) data[5 + c][j] = p[4 + c] - reference.translation[c];
        }
      }
      // What is missing in the last block is filled with y itself, which adds nothing.
      for (std::size_t j = count; j < block; ++j) {
        for (std::size_t c = 0; c < 4; ++c) data[c][j] = reference.q[c];
        for (std::size_t c = 4; c < columns; ++c) data[c][j] = 0;
      }
      alignas(64) double best[block], second[block];
      Pack cosine = Pack{} + 1.0;
      for (std::size_t j = 0; j < count; j += pack_size) turn(data, j, reference, best + j, second + j, cosine);
      if (-largestOf(-cosine) > small_rotation_cosine) {
        for (std::size_t j = 0; j < count; j += pack_size)
          sums.template add<Weighted, Scatter>(data, j, small_rotation);
      } else {
        for (std::size_t j = 0; j < count; j += pack_size) sums.template add<Weighted, Scatter>(data, j, any_rotation);
      }
      if constexpr (Scatter && Quotient<M>) {
        // The cosine of half the gap, roughly: the angle itself is worked out for few.
        for (std::size_t j = 0; j < count; ++j) {
          const double b = best[j], s = second[j];
          if (b * s + std::sqrt(std::abs((1 - b * b) * (1 - s * s))) < gap_cosine) continue;
          const M at_y = T::act(reference.to_y, M(samples[i + j]));
          const double gap = T::nearestRepresentative(at_y).gap();
          smallest_gap = gap < smallest_gap ? gap : smallest_gap;
          gap_cosine = std::cos(0.5 * smallest_gap) - 1e-4;
        }
      }
    }
    if constexpr (!Weighted) weight += static_cast<double>(end - begin);
    finish<Weighted, Scatter>(sums, reference);
    return largestOf(sums.defect) < 1e-5 && std::isfinite(cost) && gradient.allFinite() && hessian.allFinite();
  }

 private:
  struct Reference {
    explicit Reference(const M& y) : to_y(T::placement(y).inverse()) {
      std::memcpy(q, T::parameters(y), sizeof q);
      if constexpr (frame) std::memcpy(translation, T::parameters(y) + 4, sizeof translation);
    }
    typename T::Group to_y;
    double q[4], translation[3] = {};
  };

  /// Replaces quaternions q by y⁻¹q, of quotients the nearest representative with the two largest components that
  /// compete; cosine becomes the least |w|.
  static void turn(double (&data)[columns][block], std::size_t j, const Reference& r, double* best, double* second,
                   Pack& cosine) {
    const Pack x = loadPack(data[0] + j), y = loadPack(data[1] + j), z = loadPack(data[2] + j),
               s = loadPack(data[3] + j);
    const double a = r.q[0], b = r.q[1], c = r.q[2], d = r.q[3];
    Pack q[4] = {d * x - a * s + (c * y - b * z), d * y - b * s + (a * z - c * x), d * z - c * s + (b * x - a * y),
                 a * x + b * y + (c * z + d * s)};
    if constexpr (Quotient<M>) nearest(q, best, second);
    const Pack w = absolute(q[3]);
    cosine = w < cosine ? w : cosine;
    for (std::size_t i = 0; i < 4; ++i) storePack(data[i] + j, q[i]);
  }
  /// The half-turn that brings the largest component to w.
  static void nearest(Pack (&q)[4], double* best_component, double* second_component) {
    const Pack x = q[0], y = q[1], z = q[2], w = q[3];
    Pack best = absolute(w), second = Pack{} - 1.0;
    for (const int representative : T::representatives) {
      if (representative == 0) continue;
      const Pack c = absolute(representative == 1 ? x : representative == 2 ? y : z);
      const auto better = c > best;
      second = larger(better ? best : c, second);
      best = better ? c : best;
      if (representative == 1) take(better, q, w, z, -y, -x);
      if (representative == 2) take(better, q, -z, w, x, -y);
      if (representative == 3) take(better, q, y, -x, w, -z);
    }
    storePack(best_component, best);
    storePack(second_component, second);
  }
  template <class Mask>
  static void take(const Mask& mask, Pack (&q)[4], const Pack& x, const Pack& y, const Pack& z, const Pack& w) {
    q[0] = mask ? x : q[0];
    q[1] = mask ? y : q[1];
    q[2] = mask ? z : q[2];
    q[3] = mask ? w : q[3];
  }

  struct Accumulators {
    Pack cost{}, largest{}, defect{}, gradient[static_cast<std::size_t>(k)]{}, hessian[6]{}, scatter[entries]{},
        squared[entries]{};

    template <bool Weighted, bool Scatter, class Polynomials>
    void add(const double (&data)[columns][block], std::size_t j, const Polynomials& polynomials) {
      const Pack q[4] = {loadPack(data[0] + j), loadPack(data[1] + j), loadPack(data[2] + j), loadPack(data[3] + j)};
      const Pack xx = q[0] * q[0], yy = q[1] * q[1], zz = q[2] * q[2], u2 = xx + yy + zz;
      // 1/|q| to second order.
      const Pack excess = u2 + q[3] * q[3] - 1.0;
      const Pack scale = 1.0 - excess * (0.5 - 0.375 * excess);
      defect = larger(absolute(excess), defect);
      const Pack variable = (1.0 - scale * absolute(q[3])) * (1 / polynomials.range) - 1.0;
      const Pack f = scale * evaluatePolynomial(polynomials.log, variable);
      const Pack sign_f = q[3] < 0.0 ? -f : f;
      const Pack p = Weighted ? loadPack(data[4] + j) : Pack{} + 1.0;
      Pack g = scale * scale;
      if constexpr (Scatter) {
        g *= evaluatePolynomial(polynomials.exact_hessian, variable);
      } else {
        g *= evaluatePolynomial(polynomials.newton_hessian, variable);
      }
      if constexpr (Weighted) g *= p;
      const Pack gx = g * q[0], gy = g * q[1];
      hessian[0] += g * xx, hessian[1] += gx * q[1], hessian[2] += gx * q[2];
      hessian[3] += g * yy, hessian[4] += gy * q[2], hessian[5] += g * zz;

      constexpr std::size_t r0 = frame ? 3 : 0;
      Pack v[static_cast<std::size_t>(k)], weighted[static_cast<std::size_t>(k)];
      Pack length2 = f * f * u2;
      for (std::size_t i = 0; i < 3; ++i) v[r0 + i] = sign_f * q[i];
      if constexpr (frame) {
        for (std::size_t i = 0; i < 3; ++i) {
          v[i] = loadPack(data[5 + i] + j);
          length2 += v[i] * v[i];
        }
      }
      for (std::size_t i = 0; i < static_cast<std::size_t>(k); ++i) {
        weighted[i] = Weighted ? p * v[i] : v[i];
        gradient[i] += weighted[i];
      }
      cost += Weighted ? p * length2 : length2;
      if constexpr (Scatter) {
        largest = larger(length2, largest);
        addOuter(scatter, v, weighted, std::make_index_sequence<entries>());
        if constexpr (Weighted) {
          for (Pack& e : v) e *= p;
          addOuter(squared, v, weighted, std::make_index_sequence<entries>());
        }
      }
    }

    /// Row and column of an entry of the lower triangle, row by row.
    static constexpr std::size_t row(std::size_t entry) {
      std::size_t i = 0;
      while ((i + 1) * (i + 2) / 2 <= entry) ++i;
      return i;
    }
    static constexpr std::size_t column(std::size_t entry) { return entry - row(entry) * (row(entry) + 1) / 2; }
    template <std::size_t N, std::size_t... Entry>
    static void addOuter(Pack (&sums)[N], const Pack (&a)[static_cast<std::size_t>(k)],
                         const Pack (&b)[static_cast<std::size_t>(k)], std::index_sequence<Entry...>) {
      ((sums[Entry] += a[row(Entry)] * b[column(Entry)]), ...);
    }
    static Square symmetric(const Pack (&sums)[entries]) {
      Square m;
      for (std::size_t e = 0; e < entries; ++e) {
        const auto i = static_cast<Eigen::Index>(row(e)), j = static_cast<Eigen::Index>(column(e));
        m(i, j) = m(j, i) = sumOf(sums[e]);
      }
      return m;
    }
  };

  /// From the lanes' sums, translations still in the axes of the world, to those in the frame of y.
  template <bool Weighted, bool Scatter>
  void finish(const Accumulators& sums, const Reference& reference) {
    using Matrix3 = Eigen::Matrix3d;
    cost = 0.5 * sumOf(sums.cost);
    for (int i = 0; i < k; ++i) gradient[i] = sumOf(sums.gradient[i]);
    const Pack(&h)[6] = sums.hessian;
    const double xx = sumOf(h[0]), xy = sumOf(h[1]), xz = sumOf(h[2]), yy = sumOf(h[3]), yz = sumOf(h[4]),
                 zz = sumOf(h[5]);
    Matrix3 rotation;
    rotation << weight - yy - zz, xy, xz, xy, weight - xx - zz, yz, xz, yz, weight - xx - yy;
    hessian.template bottomRightCorner<3, 3>() = rotation;
    if constexpr (Scatter) {
      scatter = Accumulators::symmetric(sums.scatter);
      squared = Weighted ? Accumulators::symmetric(sums.squared) : scatter;
      largest = std::sqrt(largestOf(sums.largest));
    }
    if constexpr (frame) {
      hessian.template topLeftCorner<3, 3>() = weight * Matrix3::Identity();
      const double(&q)[4] = reference.q;
      const Matrix3 to_y = So3Math<double>::matrix(Eigen::Vector4d(-q[0], -q[1], -q[2], q[3]));
      gradient.template head<3>() = (to_y * gradient.template head<3>()).eval();
      if constexpr (Scatter) {
        for (Square* m : {&scatter, &squared}) {
          m->template topRows<3>() = (to_y * m->template topRows<3>()).eval();
          m->template leftCols<3>() = (m->template leftCols<3>() * to_y.transpose()).eval();
        }
      }
    }
  }
};

}  // namespace liestat::detail
