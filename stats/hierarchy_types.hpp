// What the search through a hierarchy of models takes and returns. The search is in stats/hierarchy.hpp.
#pragma once

#include <stats/model_choice.hpp>
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

/// Asked between the steps of an iteration: true ends it.
using StopRequest = std::function<bool()>;

/// A model estimated from several measurements.
template <class Parameter>
struct ModelEstimate {
  Status status = Status::not_converged;
  Parameter parameter{};
  /// Of the parameter in the model's own coordinates, which its documentation names; empty where there is none.
  Eigen::MatrixXd information = {}, covariance = {};
  double chi2 = std::numeric_limits<double>::quiet_NaN();            ///< D² = 2 L² over those
  double equation_error = std::numeric_limits<double>::quiet_NaN();  ///< E²: how well the equations are met
  int degrees_of_freedom = 0;
  std::size_t measurements = 0;  ///< that took part

  /// Whether there is a parameter to go on with: an iteration that was not given the time to end has one, too.
  bool usable() const {
    return (converged(status) || status == Status::not_converged) && chi2 < std::numeric_limits<double>::infinity();
  }
};

/// A model of a hierarchy: its measurement equations, what it leaves free, and the models that it contains. All
/// parameters of a hierarchy are of one type, of which each model may use a part.
template <class Measurement_, class Parameter_>
class HierarchyModel {
 public:
  using Measurement = Measurement_;
  using Parameter = Parameter_;

  virtual ~HierarchyModel() = default;
  virtual std::string name() const = 0;
  /// The names of the models whose solutions are solutions of this one, the next more specific ones. The null model alone
  /// has none.
  virtual std::vector<std::string> parents() const = 0;
  virtual int freeParameters() const = 0;  ///< k = n - p
  virtual int equations() const = 0;       ///< p_i, independent ones of a measurement, 1 to 32
  /// Those of this one, where measurements are of several kinds.
  virtual int equationsOf(const Measurement&) const { return equations(); }
  virtual int measurementDimension() const = 0;
  /// f, dimension of what this model leaves open where its measurements obey a more specific one: so many equations more
  /// it can meet whatever they are. At most the difference of the free parameters where both have as many equations.
  virtual int freedomBeyond(const HierarchyModel& specific) const {
    return std::max(0, freeParameters() - specific.freeParameters());
  }
  virtual std::size_t sampleSize() const = 0;  ///< at most 16; 0 only without free parameters

  /// Adds the parameters that a minimal sample allows to `solutions`: none for a degenerate one.
  virtual void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const = 0;
  /// The squared error of each measurement in units of its noise, of an inlier χ² with equationsOf() degrees of freedom.
  virtual void errors(const Parameter& parameter, std::span<const Measurement> measurements,
                      std::span<double> squared) const = 0;
  /// The estimate from inliers, started at a parameter; `stop` is asked between its steps, and what it ends has the status
  /// not_converged.
  virtual ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                            const StopRequest& stop) const = 0;
  /// The share of random measurements whose squared error under a right parameter is below a threshold.
  virtual double chance(double threshold) const = 0;
};

/// How hypotheses are compared, by the squared errors e of all measurements and a threshold t that inliers seldom exceed.
enum class HypothesisScore {
  relevance,      ///< (1/M) Σ_{e < 2t} (1 - e/t), (29) of the report
  inliers,        ///< the share of e < t
  truncated_cost  ///< (1/M) Σ_{e < t} (1 - e/t)
};

struct HierarchyOptions {
  std::uint64_t seed = 1;
  double outlier_share = 0.01;  ///< of the errors of inliers that lie beyond the threshold
  HypothesisScore score = HypothesisScore::relevance;
  /// Draws of a model end when a better sample has come with this probability, at the share of inliers found ...
  double confidence = 0.999;
  double min_share = 0.25;       ///< ... or at this share, if that is larger
  std::size_t max_draws = 2000;  ///< ... or here
  /// Of so many hypotheses of a model, the best ones, the estimate is made; that with the best score is taken.
  std::size_t refined_hypotheses = 5;
  /// Whether three draws of four keep the sample of an estimated parent and take what is missing from its outliers.
  bool guided = false;
  /// Whether every model is estimated, not only those that the walk reaches: what criteria that compare all of them need.
  bool all_models = false;
  SupportTest support = {};
  std::function<double(double r, double r_general)> phi = ExponentialPhi{};  ///< (36)
  /// The threshold on squared errors for the measurements of a model, from its errors and its number of equations. Empty:
  /// the quantile of χ² that `outlier_share` names, for noise that is known.
  std::function<double(std::span<const double> errors, int equations)> threshold = {};
};

/// Why one model is rejected in favour of one that contains it.
enum class Rejection {
  none,
  support,  ///< the other one explains measurements that this one is far from
  fit       ///< the other one fits the common inliers better by more than its freedom explains
};
constexpr const char* name(Rejection rejection) {
  return rejection == Rejection::support ? "support" : rejection == Rejection::fit ? "fit" : "none";
}

/// What is known of a model of the hierarchy.
template <class Parameter>
struct ModelState {
  enum class Progress {
    idle,       ///< not reached
    candidate,  ///< hypotheses are being drawn
    evaluated   ///< draws ended; the estimate is final for these measurements
  };
  Progress progress = Progress::idle;
  std::size_t draws = 0;  ///< that were looked at
  /// The best hypothesis, its score and the share of inliers under it.
  std::optional<Parameter> hypothesis = {};
  double score = -std::numeric_limits<double>::infinity();
  std::size_t hypothesis_inliers = 0;
  std::vector<std::uint64_t> sample = {};  ///< the measurements that it was made from
  /// Refined once; from an earlier state of the measurements while `outdated`.
  ModelEstimate<Parameter> estimate = {};
  bool outdated = false;
  double threshold = 0;             ///< on squared errors
  std::vector<double> errors = {};  ///< of all measurements, in the order of Hierarchy::ids()
  std::vector<std::uint64_t> inliers = {};
  double relevance = 0;     ///< (29) of the estimate
  ModelFit fit = {};        ///< over its own inliers
  bool unsupported = true;  ///< its inliers could be chance
  Rejection rejection = Rejection::none;
  std::optional<std::size_t> rejected_by = {};  ///< number of the model

  bool hasEstimate() const { return estimate.usable(); }
};

/// The report's states of the search.
enum class HierarchyState {
  initial,    ///< I: nothing was estimated
  available,  ///< A: there are estimates, and candidates left
  terminated  ///< T: there is no candidate left
};
constexpr const char* name(HierarchyState state) {
  return state == HierarchyState::initial ? "initial" : state == HierarchyState::available ? "available" : "terminated";
}

}  // namespace liestat
