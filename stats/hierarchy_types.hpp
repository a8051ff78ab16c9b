// Models, options and results of the search through a hierarchy of models. The search is in stats/hierarchy.hpp.
#pragma once

#include <stats/model_choice.hpp>
#include <stats/relative_curvature.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// A callback that an iteration calls between its steps; if it returns true, the iteration ends.
using StopRequest = std::function<bool()>;

/// The parameter of a model estimated from measurements.
template <class Parameter>
struct ModelEstimate {
  Status status = Status::not_converged;
  Parameter parameter{};
  /// Information and covariance in the model's coordinates, which its documentation names; empty if not estimated.
  Eigen::MatrixXd information = {}, covariance = {};
  double chi2 = std::numeric_limits<double>::quiet_NaN();            ///< D² = 2 L² over the measurements
  double equation_error = std::numeric_limits<double>::quiet_NaN();  ///< E², the squared error of the equations
  int degrees_of_freedom = 0;
  std::size_t measurements = 0;  ///< number of measurements used
  /// Known of a final estimate only; where it is untested the covariance is of first order.
  RelativeCurvature relative_curvature = {};

  /// True if the parameter may be used; an iteration that was stopped early has a usable one, too.
  bool usable() const {
    return (converged(status) || status == Status::not_converged) && chi2 < std::numeric_limits<double>::infinity();
  }
};

/// A model of a hierarchy: its measurement equations, its free parameters and the models that it contains. All models
/// of a hierarchy share one parameter type, of which each may use a part. The functions are virtual because a hierarchy
/// is a list of models of different types that is made at run time.
template <class Measurement_, class Parameter_>
class HierarchyModel {
 public:
  using Measurement = Measurement_;
  using Parameter = Parameter_;

  virtual ~HierarchyModel() = default;
  virtual std::string name() const = 0;  ///< unique in the hierarchy
  /// The next more specific models, by name: their solutions are solutions of this one. Only the null model has none.
  virtual std::vector<std::string> parents() const = 0;
  virtual int freeParameters() const = 0;  ///< k = n - p, parameters less their constraints
  virtual int equations() const = 0;       ///< p_i, independent equations of a measurement, 1 to 32
  /// The equations of one measurement, where measurements are of several kinds.
  virtual int equationsOf(const Measurement&) const { return equations(); }
  virtual int measurementDimension() const = 0;  ///< coordinates of a measurement
  /// f, the number of equations that this model can satisfy in addition, whatever they are, on measurements that obey a
  /// more specific model. At most the difference of the free parameters if both have as many equations.
  virtual int freedomBeyond(const HierarchyModel& specific) const {
    return std::max(0, freeParameters() - specific.freeParameters());
  }
  virtual std::size_t sampleSize() const = 0;  ///< a minimal sample's size, at most 16; 0 only without free parameters

  /// Appends the parameters that a minimal sample determines to `solutions`; a degenerate sample adds none.
  virtual void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const = 0;
  /// The number of measurements off the estimate of another model that determine this one together with it; 0: no such
  /// way is known. Minimal samples of a scene that the other model dominates lie within it, and say nothing of the
  /// rest.
  virtual std::size_t completionSize(const HierarchyModel&) const { return 0; }
  /// Appends the parameters that these determine.
  virtual void complete(const HierarchyModel&, const Parameter&, std::span<const Measurement>,
                        std::vector<Parameter>&) const {}
  /// The squared error of each measurement in units of its noise; χ² with equationsOf() degrees of freedom for inliers.
  virtual void errors(const Parameter& parameter, std::span<const Measurement> measurements,
                      std::span<double> squared) const = 0;
  /// The estimate from inliers, started at a parameter. `stop` is called between steps; a stopped estimate has the
  /// status not_converged.
  virtual ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                            const StopRequest& stop) const = 0;
  /// The same with what is too dear for each estimate of a search: its relative curvature, which widens the covariance,
  /// or makes the status ill_defined, without one.
  virtual ModelEstimate<Parameter> finalEstimate(const Parameter& start, std::span<const Measurement> inliers,
                                                 const StopRequest& stop) const {
    return estimate(start, inliers, stop);
  }
  /// The fraction of random measurements whose squared error under a true parameter is below a threshold.
  virtual double chance(double threshold) const = 0;
};

/// The score of a hypothesis by the squared errors e of M measurements and a threshold t that inliers rarely exceed.
enum class HypothesisScore {
  relevance,      ///< (1/M) Σ_{e < 2t} (1 - e/t), (29) of the report
  inliers,        ///< (1/M) Σ_{e < t} 1
  truncated_cost  ///< (1/M) Σ_{e < t} (1 - e/t)
};

/// The tests by which a general model rejects one that it contains, or one of more equations.
struct ChoiceTests {
  SupportTest support = {};
  std::function<double(double r, double r_general)> phi = ExponentialPhi{};  ///< Φ of (36)
  /// Standard deviations of CostTest::excess() beyond which the cost rejects.
  double cost = 4;
};

struct HierarchyOptions {
  std::uint64_t seed = 1;
  double outlier_share = 0.01;  ///< fraction of inliers whose error exceeds the threshold
  HypothesisScore score = HypothesisScore::relevance;
  /// Drawing ends when a sample of inliers was drawn with this probability, given the fraction of inliers found ...
  double confidence = 0.999;
  double min_share = 0.25;       ///< ... or this one, if it is larger,
  std::size_t max_draws = 2000;  ///< and at this number of draws at the latest
  /// Number of best hypotheses of a model that are refined to estimates; the estimate with the best score is kept.
  std::size_t refined_hypotheses = 5;
  /// Three of four draws keep the sample of an estimated parent and complete it with outliers of the parent.
  bool guided = false;
  /// Estimates every model, not only those that the search reaches, for criteria that compare all of them.
  bool all_models = false;
  ChoiceTests choice = {};
  /// The same tests at a level that a right model fails in a few of a hundred cases: a chosen model that fails them is
  /// contested. Here no measurement counts as chance because noise could explain it.
  ChoiceTests doubt = {{.guard = {}, .probability = 0.999}, ExponentialPhi{5.5}, 1.6};
  /// Returns a model's threshold on squared errors from its errors and number of equations. Empty: the quantile of χ²
  /// at 1 - `outlier_share`, for known noise.
  std::function<double(std::span<const double> errors, int equations)> threshold = {};
};

/// The reason for which a model is rejected in favour of one that contains it.
enum class Rejection {
  none,
  support,  ///< the other model explains measurements that are far from this one
  fit,      ///< the other model fits the common inliers better than its freedom explains
  cost      ///< the inliers of the other model, of fewer equations, cost more than their further equations explain
};
constexpr const char* name(Rejection rejection) {
  constexpr const char* names[] = {"none", "support", "fit", "cost"};
  return names[static_cast<std::size_t>(rejection)];
}

/// The state of one model during the search.
template <class Parameter>
struct ModelState {
  enum class Progress {
    idle,       ///< not reached
    candidate,  ///< hypotheses are being drawn
    evaluated   ///< drawing has ended; the estimate is final for these measurements
  };
  Progress progress = Progress::idle;
  std::size_t draws = 0;  ///< number of samples tried
  /// The best hypothesis, its score and its number of inliers.
  std::optional<Parameter> hypothesis = {};
  double score = -std::numeric_limits<double>::infinity();
  std::size_t hypothesis_inliers = 0;
  std::vector<std::uint64_t> sample = {};  ///< measurements that determine the hypothesis
  /// The refined estimate; from an earlier state of the measurements while `outdated`.
  ModelEstimate<Parameter> estimate = {};
  bool outdated = false;
  double threshold = 0;             ///< on squared errors
  std::vector<double> errors = {};  ///< squared error of each measurement, in the order of Hierarchy::ids()
  std::vector<std::uint64_t> inliers = {};
  double relevance = 0;     ///< score (29) of the estimate
  ModelFit fit = {};        ///< fit to the estimate's own inliers
  bool unsupported = true;  ///< the inliers could be chance
  /// s², the variance of the noise that the estimate shows over the one that was stated (excessNoise()).
  double excess_noise = 1;
  Rejection rejection = Rejection::none;
  std::optional<std::size_t> rejected_by = {};  ///< number of the model that rejects it

  bool hasEstimate() const { return estimate.usable(); }
};

/// The states of the search, as named by the report.
enum class HierarchyState {
  initial,    ///< I: nothing was estimated
  available,  ///< A: there are estimates, and candidates left
  terminated  ///< T: there is no candidate left
};
constexpr const char* name(HierarchyState state) {
  return state == HierarchyState::initial ? "initial" : state == HierarchyState::available ? "available" : "terminated";
}

}  // namespace liestat
