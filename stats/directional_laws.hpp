// Laws of directions, axes, headings and rotations: maximum likelihood with covariances, confidence cones, goodness of
// fit, tests of uniformity and of rotational symmetry, and sampling. Compiled once, in liestat::laws (Random123).
//
//   const LawFit fit = fitLaw(LawModel::vmf, directions);       // a range of S2d
//   if (fit.ok()) print(fit.law.kappa[0], fit.kappaDeviation(0), fit.alpha95());
//
// The density with respect to the uniform law, at the coordinates x of a feature in the law's axes, is proportional to
//
//   vmf             exp(κ cos θ)              on S2; θ is the angle from the mean direction
//   von_mises       exp(κ cos θ)              on SO2
//   bingham         exp(-κ_1 x_1² - κ_2 x_2²) on S2 where x and -x are the same axis; x_3 is along the mode
//   matrix_fisher   exp(tr FᵀR)               on SO3; F = M U diag(s) Uᵀ, M the mode, and κ_i = s_j + s_k
//   wrapped_normal  that of M exp(v), v normal with the variances 1/κ_i along the axes, on SO3
//
// κ_i of rotations tends to one over the variance of the angle about axis i. κ are in descending order. The first four
// laws are Bingham's of half angles: one contour integral normalises them all. Docs: docs/laws.md.
#pragma once

#include <stats/detail/compiled_laws.hpp>
#include <stats/status.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <ranges>
#include <string>
#include <vector>

namespace liestat {

class CounterRng;  // stats/random.hpp

enum class LawModel { vmf, bingham, von_mises, matrix_fisher, wrapped_normal };
constexpr auto words(LawModel) { return std::array{"vmf", "bingham", "von-mises", "matrix-fisher", "wrapped-normal"}; }
/// The number of parameters of a feature: 2 (cos sin), 3 (x y z) or 4 (quaternion x y z w).
constexpr int parametersOf(LawModel model) {
  return model == LawModel::von_mises ? 2 : model == LawModel::vmf || model == LawModel::bingham ? 3 : 4;
}
/// The dimension of the manifold.
constexpr int dofOf(LawModel model) { return parametersOf(model) - 1; }

/// A law with its parameters.
struct DirectionalLaw {
  LawModel model = LawModel::vmf;
  Eigen::VectorXd location = {};  ///< mean direction, mode or, of a girdle of axes, its pole, as parametersOf() says
  /// Orthonormal columns that κ belongs to: of bingham 3×3, the mode last; of rotations 3×3 in the body's frame; of vmf
  /// and von_mises the identity of their dimension.
  Eigen::MatrixXd axes = {};
  Eigen::VectorXd kappa = {};

  /// A random feature.
  LIESTAT_LAWS_API Eigen::VectorXd sample(CounterRng& rng) const;
};

/// The likelihood ratio of a law and of a special case, or another statistic with a law of χ². NaN where there is none.
struct LawTest {
  double statistic = std::numeric_limits<double>::quiet_NaN();
  int degrees_of_freedom = 0;
  double p = std::numeric_limits<double>::quiet_NaN();
};
template <class V>
void describe(V& v, const LawTest& x) {
  v("statistic", x.statistic)("degrees_of_freedom", x.degrees_of_freedom, "of chi-squared")("p", x.p);
}

/// Options of fitLaw().
struct LawFitOptions {
  /// Fewer features than this get the p of the goodness of fit by a parametric bootstrap, more by χ².
  std::size_t bootstrap_below = 2000;
  std::uint64_t seed = 1;  ///< of that bootstrap and of the reference sample
};

/// A law that was fitted, with tests. There are covariances unless the status is too_few or not_applicable, or a κ is
/// not finite; only those of an `ok` fit may be used.
struct LawFit {
  std::size_t n = 0;
  Status status = Status::too_few;
  std::string reason = {};  ///< of another status than ok
  DirectionalLaw law = {};
  std::vector<std::string> names = {};  ///< of κ
  Eigen::MatrixXd kappa_covariance = {};
  /// In the local frame at the location, rad²; Bingham's in that of S2, with the axis as a direction.
  Eigen::MatrixXd location_covariance = {};
  bool girdle = false;  ///< of bingham: the axes lie along a great circle, whose pole is the location
  /// The half axes, rad, of the region that holds the true location with 95 %, the longest first; of vmf a cone.
  std::vector<double> confidence_angles = {};
  double mean_resultant = std::numeric_limits<double>::quiet_NaN();  ///< of vmf and von_mises: R/n
  double log_likelihood = 0;                                         ///< relative to the uniform law
  LawTest uniformity = {};  ///< against the uniform law; of wrapped_normal that of matrix_fisher
  LawTest kind = {};      ///< of bingham: a girdle against a symmetric cluster, or a cluster against a symmetric girdle
  LawTest symmetry = {};  ///< against equal κ: symmetry about the location; not of von_mises
  /// Moments of third and fourth order against those of the law: the omnibus χ². Its p is Bonferroni's of that and of
  /// single moments along the axes, of which one may tell what the omnibus does not.
  LawTest goodness = {};
  std::size_t replicates = 0;  ///< of the bootstrap behind the p of that; 0: by χ²

  bool ok() const { return status == Status::ok; }
  /// Yes: the law explains the features, and its location is determined. None: too few features.
  Verdict verdict() const;
  /// The standard deviation of κ_i; NaN where there is none.
  double kappaDeviation(Eigen::Index i) const {
    return i < kappa_covariance.rows() ? std::sqrt(kappa_covariance(i, i)) : std::numeric_limits<double>::quiet_NaN();
  }
  /// The half angle, rad, of a cone about the location that holds the true one with at least 95 %; NaN for none.
  double alpha95() const {
    return confidence_angles.empty() ? std::numeric_limits<double>::quiet_NaN() : confidence_angles.front();
  }
};

template <class V>
void describe(V& v, const LawFit& fit) {
  v("law", name(fit.law.model))("n", fit.n)("status", name(fit.status), "the status")("reason", fit.reason);
  describe(v, fit.verdict());
  v("location", fit.law.location, "mean direction, mode, or pole of a girdle: cos sin, x y z, or x y z w");
  v("location_covariance", fit.location_covariance, "in the local frame", "rad²");
  v("confidence_angles", fit.confidence_angles, "half axes of the 95 % region, the longest first", "rad");
  v("names", fit.names, "of kappa")("kappa", fit.law.kappa, "concentrations")("kappa_covariance", fit.kappa_covariance);
  v("axes", fit.law.axes, "columns that kappa belongs to");
  v("girdle", fit.girdle, "of bingham: the location is the pole of a great circle");
  v("mean_resultant", fit.mean_resultant, "length of the mean vector; of vmf and von-mises");
  v("log_likelihood", fit.log_likelihood, "relative to the uniform law");
  v("uniformity", fit.uniformity, "likelihood ratio against the uniform law");
  v("kind", fit.kind, "of bingham: a girdle against a symmetric cluster, or a cluster against a symmetric girdle");
  v("symmetry", fit.symmetry, "against rotational symmetry about the location");
  v("goodness", fit.goodness, "moments against those of the law");
  v("replicates", fit.replicates, "of the bootstrap behind goodness.p; 0: by chi-squared");
}

/// Moments of Bingham's law exp(-Σ μ_i x_i²) on the sphere of p = μ.size() = 2, 3 or 4 coordinates, μ_i > -1.
struct BinghamMoments {
  double log_constant = 0;  ///< log E exp(-Σ μ_i x_i²) under the uniform law
  Eigen::VectorXd second;   ///< E x_i²
  Eigen::MatrixXd fourth;   ///< E x_i² x_j²
};
/// Relative errors are below 1e-13, for μ up to 1e14 and beyond.
LIESTAT_LAWS_API BinghamMoments binghamMoments(const Eigen::VectorXd& mu);

/// Fits a law to the features in the rows of a matrix with parametersOf(model) columns, whose norms are one to rounding.
///
/// `inconsistent`: the goodness of fit refutes the law (p below refutation_level). `ill_defined`: uniform features would
/// look like that in one case of a hundred, axes do not tell a girdle from a cluster, the location is open by more than
/// 0.7 rad, or the features are equal to rounding, so that κ has no bound. `too_few`: fewer than ten features, of rotations 18. `not_applicable`: other columns,
/// or numbers that are not finite. `not_converged`: the iteration of a wrapped normal law.
LIESTAT_LAWS_API LawFit fitLaw(LawModel model, const Eigen::Ref<const Eigen::MatrixXd>& features,
                               const LawFitOptions& options = {});

/// The same of a range of SO2d, S2d or SO3d; of another type than the law's, not_applicable.
template <std::ranges::sized_range R>
  requires requires(const R& r) { std::ranges::begin(r)->params(); }
LIESTAT_LAWS_API LawFit fitLaw(LawModel model, const R& features, const LawFitOptions& options = {}) {
  using M = std::ranges::range_value_t<R>;
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(std::ranges::size(features)), M::num_parameters);
  Eigen::Index i = 0;
  for (const M& x : features) rows.row(i++) = x.params().transpose();
  return fitLaw(model, Eigen::Ref<const Eigen::MatrixXd>(rows), options);
}

}  // namespace liestat
