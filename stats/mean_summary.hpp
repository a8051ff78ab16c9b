// A mean of features of any type with all that is known about it: what `liestat mean` and Python's liestat.mean show.
// summarizedMean() of stats/summarized_mean.hpp makes it. Needs Eigen alone.
#pragma once

#include <lie/concepts.hpp>
#include <lie/units.hpp>
#include <stats/feature_value.hpp>
#include <stats/maha_types.hpp>
#include <stats/mean_region.hpp>
#include <stats/noise_fit.hpp>
#include <stats/residual_noise.hpp>
#include <stats/repeated_rows.hpp>
#include <stats/row_order.hpp>
#include <stats/shown.hpp>
#include <stats/skewness.hpp>
#include <stats/status.hpp>
#include <stats/time_dependence_types.hpp>
#include <stats/uniqueness_types.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

/// The criterion of a mean: least squares, weighted least squares, least Mahalanobis distances; the barycentre is a Lie
/// group's; robust ones are Huber's mean and the geodesic median.
enum class Criterion { lsq, wlsq, maha, barycentre, huber, median };

/// True for the robust ones.
constexpr bool isRobust(Criterion criterion) { return criterion == Criterion::huber || criterion == Criterion::median; }

/// The name in options and fields.
inline std::string name(Criterion criterion) {
  switch (criterion) {
    case Criterion::lsq:
      return "lsq";
    case Criterion::wlsq:
      return "wlsq";
    case Criterion::maha:
      return "maha";
    case Criterion::barycentre:
      return "barycentre";
    case Criterion::huber:
      return "huber";
    case Criterion::median:
      return "median";
  }
  return "unknown";
}

/// The name in options and fields.
constexpr const char* name(CovarianceAt at) { return at == CovarianceAt::measured ? "measured" : "estimated"; }

/// Another feature that the measurements do not exclude, and by how many standard deviations it is the worse.
struct NearRival {
  FeatureValue feature;
  double z = 0;
};

template <class V>
void describe(V& v, const NearRival& x) {
  describe(v, x.feature);
  v("z", x.z, "excess of its criterion in standard deviations");
}

/// The measurement farthest from the mean in one part of the tangent vector.
struct FarthestMeasurement {
  TangentPart part = TangentPart::point;
  double distance = 0;                   ///< rad, m or m/s
  std::size_t index = 0;                 ///< among the measurements
  std::optional<std::size_t> line = {};  ///< line of the file that they come from
  /// In the unit that people read.
  double shown() const { return unitOf(part).scale * distance; }
};

template <class V>
void describe(V& v, const FarthestMeasurement& x) {
  v("part", name(x.part), "of the tangent vector")("distance", x.shown(), "from the mean")("unit", unitOf(x.part).name);
  if (shown(v, x.line.has_value())) v("line", x.line.value_or(0), "of the file");
  if (shown(v, !x.line)) v("index", x.index, "among the measurements, if they are from no file");
}

/// A measurement that normal noise of the others' scatter does not explain, of a robust mean.
struct NamedOutlier : FarthestMeasurement {
  double p = 1;  ///< the probability of such a one among all measurements
};

template <class V>
void describe(V& v, const NamedOutlier& x) {
  describe(v, static_cast<const FarthestMeasurement&>(x));
  v("p", x.p, "probability of such a one among all measurements of normal noise");
}

/// The scale of a robust mean's measurements in one part of the tangent vector.
struct PartScale {
  TangentPart part = TangentPart::point;
  double scale = 0;  ///< along an axis, rad, m or m/s
};

template <class V>
void describe(V& v, const PartScale& x) {
  v("part", name(x.part), "of the tangent vector")("scale", unitOf(x.part).scale * x.scale, "along an axis");
  v("unit", unitOf(x.part).name);
}

/// A mean with its certificates and its covariance, whatever the type. Matrices are empty where there are none.
struct MeanSummary {
  std::string feature = {};  ///< the type's name
  /// Orientations of crystals: the point group of rotations, on the crystal's side; else empty.
  std::string symmetry = {};
  std::span<const TangentBlock> parts = {};
  bool group = false;  ///< the type has no invariant metric (SE3)
  Criterion criterion = Criterion::lsq;
  /// The frame of the measurements' covariances; nothing where it does not matter, or none are used.
  std::optional<CovarianceAt> covariance_at = {};
  bool likelihood = false, weighted = false;
  ResidualNoise weights_are = ResidualNoise::precision;
  bool known_noise = false;  ///< the covariance follows from that of the measurements (χ²), not from residuals

  FeatureValue mean;
  std::size_t n = 0;  ///< measurements that count: those of weight zero do not
  /// The status of the mean with its covariance: not_applicable if there is a mean but no covariance can be computed.
  Status status = Status::ok;
  std::string reason = {};  ///< in words, where status is not ok
  bool converged = false;
  int iterations = 0;
  double residual = 0;  ///< norm of the last step
  double tolerance = 0, cost = 0;

  MeanRegion region = MeanRegion::law;  ///< of the covariance
  double skew_factor = 1;               ///< by which MeanRegion::bootstrap widened it, of lengths
  Eigen::MatrixXd covariance;           ///< in the local frame at the mean, rad and m; empty if there is none
  double law_n =
      0;  ///< number of measurements for Hotelling's law: n, fewer in effect for weights that are no precisions
  /// F with F Fᵀ that covariance, where factors were given: its small variances have more digits. NaN where it is
  /// withheld, empty where no factors were given.
  Eigen::MatrixXd covariance_factor = {};
  Status covariance_status = Status::ok;
  Eigen::MatrixXd dispersion;                                     ///< the measurements' covariance about the mean
  std::vector<FarthestMeasurement> farthest = {};                 ///< one for each part of the tangent vector
  std::optional<Eigen::Matrix<double, 3, 2>> tangent_basis = {};  ///< directions: the axes of the coordinates

  Uniqueness unique = Uniqueness::not_certified;
  std::string proof = {};  ///< in words
  std::vector<FeatureValue> rivals = {};
  bool more_rivals = false;  ///< these are not all
  double r_star = 0;
  std::size_t cells = 0;
  std::vector<NearRival> near_ties = {};
  double cut_locus_mass = 0;  ///< fraction of the measurements near the cut locus of the mean
  /// By how much the Hessian averaged over the confidence region is lower than at the mean, relative.
  double hessian_change = 0;
  /// By which factor the region was widened until no feature beyond it explains the measurements as well; 1: not at
  /// all.
  double region_factor = 1;
  /// The farthest feature found on the ring or in the valley for which it was widened.
  std::optional<NearRival> valley = {};
  double valley_angle = 0;  ///< from the mean, rad

  std::vector<NamedOutlier> outliers = {};  ///< of a robust mean, the surest first
  std::vector<PartScale> scales = {};       ///< of a robust mean
  double shift_p = 1;  ///< robust: the probability of outliers so much on one side if errors are symmetric

  NoiseFit fit = {};          ///< of the measurements to the noise that is stated for them
  bool noise_scaled = false;  ///< the covariance is multiplied by fit.factor()

  RepeatedRows repeated = {};           ///< equal measurements, of up to 200 000
  RowOrder order = {};                  ///< correlation of successive measurements
  Skewness skewness = {};               ///< of the measurements' errors
  TimeDependence dependence = {};       ///< of the errors, where the measurements have times
  bool inflated = false;                ///< the covariance is widened by it
  std::vector<std::string> notes = {};  ///< remarks, in sentences
  /// The remark that says why the covariance does not hold, `no`, or may not, `none`; `yes` and empty: none says so.
  Verdict doubt = Verdict::yes({});

  bool hasCovariance() const { return covariance.size() > 0; }
  /// A covariance from the residuals.
  bool fromResiduals() const { return hasCovariance() && !known_noise; }
  /// There is a mean that may be used, with or without a covariance. Weights that are none leave no mean.
  bool trusted() const { return status == Status::ok || (status == Status::not_applicable && converged); }

  /// "unique: branch and bound, 232 cells" and so on.
  std::string uniquenessInWords() const {
    std::string text = std::string(unique == Uniqueness::not_certified ? "not certified" : name(unique)) + ": ";
    text += !proof.empty() ? proof : cells > 0 ? "branch and bound did not finish" : "no certificate holds";
    return cells > 0 ? text + ", " + std::to_string(cells) + " cells" : text;
  }
  /// "a feature 31 degrees from the mean is worse by 0.8 standard deviations only", of the farthest one in the valley.
  std::string valleyInWords() const {
    if (!valley) return "";
    return "a feature " + significant(valley_angle / units::degree, 3) + " degrees from the mean is worse by " +
           significant(std::max(0.0, valley->z), 2) + " standard deviations only";
  }
  /// Verdict on the mean with its covariance: may they be used? The worst of what was found.
  Verdict verdict() const {
    const std::string mean_is = "The mean is " + uniquenessInWords();
    if (trusted() && doubt.isYes()) return Verdict::yes(mean_is + ".");
    if (trusted()) {
      return {doubt.answer,
              mean_is + (doubt.isNo() ? ", but its covariance does not hold: " : ", but its covariance is in doubt: ") +
                  doubt.text + ".",
              {}};
    }
    return Verdict::no(std::string("Not to be trusted (") + name(status) + "): " + reason + ".");
  }
};

/// All that is known about a mean. Status `not_applicable` and no covariance: there is a mean, but no covariance of it
/// can be computed.
template <class V>
void describe(V& v, const MeanSummary& m) {
  const auto where = [](bool there, auto value) { return there ? std::optional(std::move(value)) : std::nullopt; };
  const bool has = m.hasCovariance(), fits = m.fit.tested();
  v("feature", m.feature, "the type of the measurements");
  if (shown(v, !m.symmetry.empty())) {
    v("symmetry", m.symmetry,
      "orientations of crystals: the proper point group that they are modulo; R and R k are equal");
  }
  v("criterion", name(m.criterion), "lsq, wlsq, maha, barycentre, huber or median");
  v("covariance_at", where(m.covariance_at.has_value(), std::string(name(m.covariance_at.value_or(CovarianceAt{})))),
    "frame of the measurements' covariances; null where it does not matter");
  v("likelihood", m.likelihood, "whether the volume element is in the criterion");
  v("weights_are", where(m.weighted, std::string(name(m.weights_are))),
    "precision, importance or frequency: what the weights mean to a covariance from residuals");
  v("weighted", m.weighted, "whether weights were used")("n", m.n, "measurements that count: those with a weight");
  v("status", name(m.status),
    "ok, not_converged, ambiguous, ill_defined, inconsistent or too_few; not_applicable: a mean, but no covariance can "
    "be "
    "computed");
  v("reason", where(m.status != Status::ok, m.reason), "in words, where status is not ok");
  v("verdict", m.verdict().text, "a sentence: the mean with its certificate, or why it is not to be trusted");
  v("trusted", m.trusted(), "the verdict: whether the mean may be used; unique says no more than its certificate");
  v("converged", m.converged)("iterations", m.iterations)("residual", m.residual, "norm of the last step");
  v("tolerance", m.tolerance, "of the norm of the last step")("mean", m.mean, "the parts that the feature has");
  v("covariance", where(has, m.covariance), "of the mean, in its own axes; null where it is withheld");
  if (shown(v, m.covariance_factor.size() > 0)) {
    v("covariance_factor", m.covariance_factor, "F with F Fᵀ the covariance, where factors or deviations were given");
  }
  v("covariance_status", name(m.covariance_status), "why there is no covariance; otherwise ok");
  describe(v, covarianceWords(m.parts, m.group));
  if (shown(v, m.tangent_basis.has_value())) {
    v("tangent_basis", m.tangent_basis, "directions: the axes of the two tangent coordinates, in columns");
  }
  v("covariance_from", where(has, std::string(m.known_noise ? "noise" : "residuals")), "noise or residuals");
  v("covariance_law", where(has, std::string(m.known_noise ? "chi2" : "hotelling")),
    "of squared distances from the truth: chi2 or hotelling");
  v("covariance_law_n", where(m.fromResiduals(), m.law_n),
    "measurements for Hotelling's law: n, fewer in effect where weights are no precisions");
  v("region", where(m.fromResiduals(), std::string(name(m.region))),
    "law or bootstrap: what the covariance with the 95 % quantile of covariance_law is a region by");
  v("skew_factor", where(m.fromResiduals(), m.skew_factor),
    "by which a bootstrap widened the standard deviations for the noise's skewness; 1: not at all");
  v("standard_deviations", partDeviations(m.parts, m.covariance),
    "along the axes of the mean: rotation_deg, translation_m, point_m, direction_deg");
  v("standard_deviations_world", worldDeviations(m.parts, m.mean, m.covariance),
    "translation_m of frames along the axes of the world");
  v("dispersion", where(m.dispersion.size() > 0, m.dispersion), "the measurements' covariance about the mean");
  v("dispersion_standard_deviations_world", worldDeviations(m.parts, m.mean, m.dispersion),
    "as standard_deviations_world");
  v("dispersion_standard_deviations", partDeviations(m.parts, m.dispersion), "as standard_deviations");
  v("farthest", m.farthest, "the farthest measurement in each part of the tangent vector");
  v("unique", name(m.unique), "unique, ambiguous or not_certified");
  v("proof", m.uniquenessInWords(), "of uniqueness, in words")("rivals", m.rivals, "other minimisers of equal cost");
  v("rivals_complete", !m.more_rivals, "false: there are more, such as a circle, or the search ended early");
  v("r_star", m.r_star, "radius in which the criterion is convex and has no other minimum", "rad");
  v("cells", m.cells, "of the global search; 0: it was not needed");
  v("near_ties", m.near_ties, "other minima that the noise does not exclude, which make the status ambiguous");
  v("cut_locus_mass", m.cut_locus_mass, "fraction of the measurements near the cut locus of the mean");
  v("hessian_change", m.hessian_change, "relative decrease of the Hessian averaged over the confidence region");
  v("region_factor", m.region_factor,
    "by which the confidence region was widened to the features that explain the data as well; 1: not at all");
  v("valley", m.valley, "the farthest of these that was found, on a ring or in a valley; null without");
  v("valley_angle", where(m.valley.has_value(), m.valley_angle), "its angle from the mean", "rad");
  if (shown(v, isRobust(m.criterion))) {
    v("scales", m.scales, "of a robust mean: the median distance from the geodesic median over that of a normal law");
    v("outliers", m.outliers, "of a robust mean: measurements with a family-wise p below 0.05, the surest first");
    v("shift_p", m.shift_p, "of a robust mean: probability of outliers so much on one side if errors are symmetric");
  }
  v("fit", where(fits, m.fit.chi2), "χ² of the measurements under the noise that is stated for them; null: not tested");
  v("fit_dof", where(fits, m.fit.degrees_of_freedom), "its degrees of freedom");
  v("fit_p", where(fits, m.fit.p), "probability of so large a χ²; below 0.001 the stated noise is refuted");
  v("fit_factor", where(fits, m.fit.factor()), "Birge's factor max(1, χ²/ν) of the stated covariances");
  v("noise_scaled", m.noise_scaled, "whether the covariance is multiplied by it");
  v("lag_correlation", where(m.order.tested(), m.order.correlation), "of successive measurements' errors");
  v("weight_z", where(m.order.weightsTested(), m.order.weight_z),
    "correlation of log weights with p·r², in standard deviations; beyond 3.3 the weights are no inverse variances");
  v("lag_z", where(m.order.tested(), m.order.z), "the same in standard deviations; above 2.45 a note says so");
  v("skewness", where(m.skewness.tested(), m.skewness.b), "Mardia's, of the errors; zero but for chance if symmetric");
  v("skewness_p", where(m.skewness.tested(), m.skewness.p), "probability of so large a one of normal errors");
  describe(v, m.dependence);
  v("inflated", m.inflated, "whether the covariance is widened by the dependence on time");
  v("notes", m.notes, "what is remarkable, in sentences");
}

}  // namespace liestat
