#pragma once

#include <formats/feature.hpp>
#include <stats/maha.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

namespace liestat {
template <class Outcome>
struct ValidationReportOf;
}

namespace liestat::experiments {

/// The simulated experiments of Pennec 1998, section 5: a feature, a noise, a number of measurements; all criteria on
/// the same draws, so that their accuracies can be compared trial by trial.

/// The features of the experiment: those with a Riemannian metric, but for headings, which the report has not.
template <class M>
concept ExperimentFeature = Metric<M> && !std::is_same_v<M, SO2d>;
inline constexpr bool isOfExperiment(const FeatureInfo& row) { return row.has_metric && row.kind != Feature::heading; }
inline constexpr auto all_features = [] {
  constexpr auto count = [] {
    std::size_t n = 0;
    for (const FeatureInfo& row : feature_rows) n += isOfExperiment(row) ? 1 : 0;
    return n;
  };
  std::array<Feature, count()> list{};
  std::size_t n = 0;
  for (const FeatureInfo& row : feature_rows) {
    if (isOfExperiment(row)) list[n++] = row.kind;
  }
  return list;
}();

/// The pattern of the measurements' covariances: equal, Σ/i, each diagonal term times U(0,1), each times exp(-5 μ²),
/// μ ~ U(0,1).
enum class Noise { iid, isd, idd, exp };
inline constexpr std::array all_noises{Noise::iid, Noise::isd, Noise::idd, Noise::exp};
inline constexpr std::array noise_names{"iid", "isd", "idd", "exp"};  ///< in options and JSON fields
inline std::string name(Noise noise) { return noise_names[static_cast<std::size_t>(noise)]; }

inline constexpr std::array all_criteria{Criterion::lsq, Criterion::wlsq, Criterion::maha};

/// A way to estimate a mean and its covariance, of those that a trial compares.
struct Method {
  Criterion criterion;
  bool corrected;    ///< the library's formula, else the report's
  bool known_noise;  ///< covariance from the known noise, else from the residuals
};

inline constexpr std::array methods{Method{Criterion::lsq, true, true},   Method{Criterion::lsq, false, true},
                                    Method{Criterion::lsq, true, false},  Method{Criterion::lsq, false, false},
                                    Method{Criterion::wlsq, true, true},  Method{Criterion::wlsq, false, true},
                                    Method{Criterion::wlsq, true, false}, Method{Criterion::wlsq, false, false},
                                    Method{Criterion::maha, true, true},  Method{Criterion::maha, false, true}};

/// The index of a method in `methods`.
std::size_t methodIndex(const Method& method);

/// A flag for each of `methods`.
using MethodMask = std::array<bool, methods.size()>;

/// One experiment.
struct MeansExperiment {
  Feature feature = Feature::rotation;
  Noise noise = Noise::iid;
  std::size_t n = 20;
  /// Multiplies the standard deviations of the report: of points (1, 5, 10) m, of rotations (0.3, 0.6, 0.9) rad, of
  /// directions (0.3, 0.6) rad; of frames the rotation's only.
  double spread = 1;
  /// The frame in which the noise is Gaussian and in which MAHA takes its covariances.
  CovarianceAt covariance_at = CovarianceAt::estimated;
  std::size_t trials = 1000;
  std::uint64_t seed = 1;
  MethodMask wanted = [] {
    MethodMask all{};
    all.fill(true);
    return all;
  }();
  MahaMethod maha_method = MahaMethod::newton;
  bool maha_likelihood = false;
  /// Also branch and bound: the global minimum of LSQ and WLSQ is certified, not only the better of two starts.
  bool certify = false;
};

struct MeansOutcome;
using MeansReport = ValidationReportOf<MeansOutcome>;  // experiments/means_report.hpp

/// Runs the trials on the given number of threads (0: all); the same bits for any number of threads. One report for
/// each of `methods` that is wanted, in their order; its law is χ²_k for known noise and Hotelling's for residuals. The
/// ratios compare a method's error with MAHA's of the same trial (the corrected one; the report's for the report's LSQ
/// and WLSQ), and the report's MAHA with the corrected one; they are absent where that is not wanted.
std::vector<MeansReport> run(const MeansExperiment& experiment, int threads);

}  // namespace liestat::experiments
