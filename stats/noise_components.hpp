// The components of pose errors that carry noise. A planar robot has errors in x, y and yaw, and its file has fillers for
// the variances of the others (1e-9, 1e6, zero, 99999): sums of squares over all six have degrees of freedom that no noise
// belongs to. (Needs the standard library and Eigen alone.)
//
//   liestat::NoiseComponentScan scan;
//   for (…) scan.add(error, covariance);
//   const liestat::NoiseComponents components = scan.components();
//   if (components.omits()) …               // components.judged(): "x, y, rotation z"; components.omissions(): why
//
// A component is left out only if
//
//   its error is zero in every row,
//   or its variance is unknown (NaN) in every row,
//   or its variance is the same in every row, no cross term touches it, and
//     the variance is a sentinel of "unknown": zero or negative, a power of ten (or that less one) from 1000 on, above 1e15,
//     or the variances of other components vary.
//
// A matrix that is the same in every row, without sentinels, keeps all components that have errors. Fewer than ten rows
// leave nothing out, nor do errors that are all zero.
#pragma once

#include <stats/detail/tail_probabilities.hpp>
#include <stats/noise_fit.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

/// The judgement on one component of the errors.
enum class ComponentRole {
  judged,
  no_error,          ///< the error is zero in every row
  unknown_variance,  ///< the variance is NaN, or a sentinel
  filler             ///< the variance is one constant while others vary
};
constexpr auto words(ComponentRole) { return std::array{"judged", "no_error", "unknown_variance", "filler"}; }

/// The roles of the six components, translation (m) before rotation (rad), and what the judged ones are reduced to.
struct NoiseComponents {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  std::array<ComponentRole, 6> roles{};
  std::array<double, 6> variances{};  ///< the constant variance of components that are left out for it, or NaN
  bool in_world = false;              ///< along the axes of the estimate's world, not of its body

  bool keeps(int k) const { return roles[static_cast<std::size_t>(k)] == ComponentRole::judged; }
  /// The number of judged components from `first` on.
  int count(int first = 0, int n = 6) const {
    int kept = 0;
    for (int k = first; k < first + n; ++k) kept += keeps(k);
    return kept;
  }
  bool omits() const { return count() < 6; }
  /// Makes left-out rows harmless: zeros, with a one on the covariance's diagonal. The others have their marginal law.
  void reduce(Vector6& error, Matrix6& covariance) const {
    for (int k = 0; k < 6; ++k) {
      if (keeps(k)) continue;
      error[k] = 0;
      covariance.row(k).setZero(), covariance.col(k).setZero();
      covariance(k, k) = 1;
    }
  }

  static const char* name(int k) {
    return std::array{"x", "y", "z", "rotation x", "rotation y", "rotation z"}[static_cast<std::size_t>(k)];
  }
  /// "x, y, rotation z"
  std::string judged() const { return listOf(ComponentRole::judged); }
  /// A sentence for each reason for which components are left out.
  std::vector<std::string> omissions() const {
    std::vector<std::string> sentences;
    for (const ComponentRole role : {ComponentRole::no_error, ComponentRole::unknown_variance, ComponentRole::filler}) {
      const std::string list = listOf(role);
      if (list.empty()) continue;
      std::string why = "errors are zero in every row";
      if (role != ComponentRole::no_error) {
        const std::string values = valuesOf(role);
        why = std::string("the variance is ") + values + " in every row" +
              (role == ComponentRole::filler ? ", while others vary"
               : values == "unknown"         ? ""
                                             : ", which stands for unknown");
      }
      std::string sentence = "not judged: ";
      sentence.append(list).append(in_world ? " along the world's axes (" : " (").append(why).append(")");
      sentences.push_back(std::move(sentence));
    }
    return sentences;
  }

 private:
  std::string listOf(ComponentRole role) const {
    std::string list;
    for (int k = 0; k < 6; ++k) {
      if (roles[static_cast<std::size_t>(k)] == role) list += (list.empty() ? "" : ", ") + std::string(name(k));
    }
    return list;
  }
  std::string valuesOf(ComponentRole role) const {
    std::vector<std::string> values;
    for (std::size_t k = 0; k < 6; ++k) {
      const std::string value = std::isnan(variances[k]) ? "unknown" : significant(variances[k]);
      if (roles[k] == role && std::find(values.begin(), values.end(), value) == values.end()) values.push_back(value);
    }
    std::string list;
    for (const std::string& value : values) list += (list.empty() ? "" : " or ") + value;
    return list;
  }
};

/// Finds the roles of components in one pass over the rows.
class NoiseComponentScan {
 public:
  using Vector6 = NoiseComponents::Vector6;
  using Matrix6 = NoiseComponents::Matrix6;

  /// An error, its stated covariance, and the length of its coordinates (m), which rounding is relative to.
  void add(const Vector6& error, const Matrix6& covariance, double length = 0) {
    constexpr double tolerance = 1e-9;  // a rotation of axes rounds a constant by 1e-15, a file prints it all alike
    const Vector6 sigmas = covariance.diagonal().cwiseMax(0).cwiseSqrt();
    for (int k = 0; k < 6; ++k) {
      const auto i = static_cast<std::size_t>(k);
      largest_[k] = std::max(largest_[k], std::abs(error[k]));
      squares_[k] += error[k] * error[k];
      const double variance = covariance(k, k);
      if (std::isnan(variance)) {
        ++unknown_[i];
        continue;
      }
      low_[k] = std::min(low_[k], variance), high_[k] = std::max(high_[k], variance);
      if (variance > 0) nees_[k] += error[k] * error[k] / variance;
      for (int j = 0; j < 6; ++j) {
        if (j == k || std::isnan(covariance(j, j))) continue;
        // Written so that an unknown entry touches.
        if (!(std::abs(covariance(k, j)) <= tolerance * sigmas[k] * sigmas[j])) touched_[i] = true;
      }
    }
    length_ = std::max(length_, length);
    ++n_;
  }

  NoiseComponents components() const {
    constexpr std::size_t min_rows = 10;
    NoiseComponents c;
    if (n_ < min_rows) return c;
    for (int k = 0; k < 6; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (largest_[k] <= rounding(k)) {
        c.roles[i] = ComponentRole::no_error;
        continue;
      }
      const bool unknown = unknown_[i] == n_;
      c.variances[i] = unknown ? std::nan("") : high_[k];
      if (unknown) c.roles[i] = ComponentRole::unknown_variance;
      if (unknown || unknown_[i] > 0 || touched_[i] || varies(k)) continue;
      bool others_vary = false;
      for (int j = 0; j < 6; ++j) others_vary = others_vary || (j != k && varies(j));
      if (isSentinel(high_[k])) {
        c.roles[i] = ComponentRole::unknown_variance;
      } else if (others_vary) {
        c.roles[i] = ComponentRole::filler;
      }
    }
    return c.count() > 0 ? c : NoiseComponents{};
  }

  /// Components of which those are judged after all that are left out as fillers, but have errors that exceed the constant:
  /// it is overconfident. By χ² at the level of every verdict, for errors under the alignment that they are judged under.
  NoiseComponents withExceededFillers(NoiseComponents c) const {
    for (std::size_t k = 0; k < 6; ++k) {
      if (c.roles[k] != ComponentRole::filler) continue;
      if (detail::chiSquaredTail(nees_[static_cast<Eigen::Index>(k)], n_) < refutation_level) {
        c.roles[k] = ComponentRole::judged;
      }
    }
    return c;
  }

 private:
  /// The size below which an error is none: a millionth of the largest error of its kind, or the coordinates' rounding.
  double rounding(int k) const {
    const int kind = k / 3 * 3;
    const double largest = std::max({squares_[kind], squares_[kind + 1], squares_[kind + 2]});
    constexpr double relative = 1e-6, of_coordinates = 1e-14;
    return std::max(relative * std::sqrt(largest / static_cast<double>(n_)), of_coordinates * (1 + length_));
  }
  bool varies(int k) const { return high_[k] - low_[k] > 1e-9 * std::abs(high_[k]); }
  /// True for 0, -1, 999, 1000, 9999, 99999, 1e6, …, and for what is larger than any variance.
  static bool isSentinel(double variance) {
    if (!(variance > 0) || variance > 1e15) return true;
    const double power = std::pow(10, std::round(std::log10(variance)));
    const auto is = [variance](double value) { return std::abs(variance - value) <= 1e-9 * value; };
    return power >= 1e3 && (is(power) || is(power - 1));
  }

  std::size_t n_ = 0;
  double length_ = 0;
  Vector6 low_ = Vector6::Constant(std::numeric_limits<double>::infinity()), high_ = -low_;
  Vector6 largest_ = Vector6::Zero(), squares_ = Vector6::Zero(), nees_ = Vector6::Zero();
  std::array<std::size_t, 6> unknown_{};
  std::array<bool, 6> touched_{};
};

}  // namespace liestat
