#include <cli/io/measures.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <cli/io/input_error.hpp>

namespace liestat::cli {
namespace {

constexpr std::array all_mean_features{MeanFeature::point,
                                       MeanFeature::rotation,
                                       MeanFeature::frame,
                                       MeanFeature::semi_oriented_frame,
                                       MeanFeature::non_oriented_frame,
                                       MeanFeature::se3,
                                       MeanFeature::direction};

bool isFrame(MeanFeature feature) {
  return feature == MeanFeature::frame || feature == MeanFeature::semi_oriented_frame ||
         feature == MeanFeature::non_oriented_frame;
}

MeanFeature usualFeature(FeatureKind kind) {
  switch (kind) {
    case FeatureKind::point:
      return MeanFeature::point;
    case FeatureKind::rotation:
      return MeanFeature::rotation;
    case FeatureKind::direction:
      return MeanFeature::direction;
    case FeatureKind::frame:
      break;
  }
  return MeanFeature::frame;
}

/// Of frames, also the rotation or the translation alone can be averaged.
bool canBe(FeatureKind kind, MeanFeature feature) {
  if (kind == FeatureKind::frame) return feature != MeanFeature::direction;
  return feature == usualFeature(kind);
}

/// det(Σ)^(-1/k), for covariances whose size is known at run time only.
double weightOf(const Covariance& covariance) {
  const Eigen::LLT<Covariance> factor(covariance);
  double sum = 0;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) sum += std::log(factor.matrixLLT()(i, i));
  return std::exp(-2 * sum / static_cast<double>(covariance.rows()));
}

}  // namespace

std::string name(MeanFeature feature) {
  switch (feature) {
    case MeanFeature::point:
      return "point";
    case MeanFeature::rotation:
      return "rotation";
    case MeanFeature::frame:
      return "frame";
    case MeanFeature::semi_oriented_frame:
      return "semi_oriented_frame";
    case MeanFeature::non_oriented_frame:
      return "non_oriented_frame";
    case MeanFeature::se3:
      return "se3";
    case MeanFeature::direction:
      return "direction";
  }
  return "";
}

std::string name(MeanCriterion criterion) {
  switch (criterion) {
    case MeanCriterion::lsq:
      return "lsq";
    case MeanCriterion::wlsq:
      return "wlsq";
    case MeanCriterion::maha:
      return "maha";
    case MeanCriterion::barycentre:
      return "barycentre";
  }
  return "";
}

std::vector<std::string> meanFeatureNames() {
  std::vector<std::string> names;
  for (const MeanFeature feature : all_mean_features) names.push_back(name(feature));
  return names;
}

int degreesOfFreedom(MeanFeature feature) {
  int sum = 0;
  for (const TangentPart& part : tangentParts(feature)) sum += part.size;
  return sum;
}

double TangentPart::scale() const { return angular ? 180 / std::numbers::pi : 1; }

std::vector<TangentPart> tangentParts(MeanFeature feature) {
  switch (feature) {
    case MeanFeature::point:
      return {{.name = "point"}};
    case MeanFeature::rotation:
      return {{.name = "rotation", .angular = true}};
    case MeanFeature::direction:
      return {{.name = "direction", .size = 2, .angular = true}};
    default:
      return {{.name = "translation"}, {.name = "rotation", .begin = 3, .angular = true}};
  }
}

Measures chooseMeasures(FeatureFile file, const MeasuresOptions& options, const std::string& command) {
  const auto refuse = [&](const std::string& why) { throw InputError(command, 0, why); };
  Measures m;
  m.feature = usualFeature(file.kind);
  for (const MeanFeature feature : all_mean_features) {
    if (options.feature == name(feature)) m.feature = feature;
  }
  if (!canBe(file.kind, m.feature)) {
    refuse("--feature " + name(m.feature) + " does not fit a file of " + std::string(name(file.kind)) + "s");
  }
  if (!file.covariances.empty() && file.kind == FeatureKind::frame && !isFrame(m.feature) &&
      m.feature != MeanFeature::se3) {
    m.notes.emplace_back("the file's covariances are those of whole frames and are not used");
    file.covariances.clear();
  }
  const bool has_covariances = !file.covariances.empty();
  const bool must_choose = has_covariances && isFrame(m.feature) && options.covariance_at.empty();
  const std::string choice =
      "--covariance-at measured (they are given in the frame of each measure, as a sensor knows them) or "
      "--covariance-at estimated (in the frame of the mean, as for parts of one object)";

  if (m.feature == MeanFeature::se3) {
    m.criterion = MeanCriterion::barycentre;
    if (options.criterion == "maha") {
      m.criterion = MeanCriterion::maha;
    } else if (!options.criterion.empty()) {
      refuse("--criterion " + options.criterion +
             " needs an invariant metric, which rigid motions have not: leave it out for the group's barycentre, or "
             "take --feature frame");
    }
  } else if (options.criterion == "lsq") {
    m.criterion = MeanCriterion::lsq;
  } else if (options.criterion == "wlsq") {
    m.criterion = MeanCriterion::wlsq;
  } else if (options.criterion == "maha") {
    m.criterion = MeanCriterion::maha;
  } else if (has_covariances) {
    if (must_choose) {
      refuse("the file has covariances of frames, and only you know where they belong: say " + choice +
             ", or --criterion lsq to leave them aside");
    }
    m.criterion = MeanCriterion::maha;
  } else {
    m.criterion = file.weights.empty() ? MeanCriterion::lsq : MeanCriterion::wlsq;
  }

  const bool maha = m.criterion == MeanCriterion::maha;
  if (maha && !has_covariances) refuse("--criterion maha needs the columns cov_00 ... of the measures' covariances");
  if (maha && must_choose) refuse("--criterion maha on frames needs " + choice);
  if (options.likelihood && !maha) refuse("--likelihood is an option of --criterion maha");
  m.likelihood = options.likelihood;
  m.covariance_at = options.covariance_at == "estimated" ? CovarianceAt::estimated : CovarianceAt::measured;
  if (m.feature == MeanFeature::direction && m.covariance_at == CovarianceAt::estimated) {
    refuse("--covariance-at estimated is not there for directions: no frame is common to all points of a sphere");
  }

  m.weights.assign(file.size(), 1.0);
  const bool uses_weights =
      m.criterion == MeanCriterion::wlsq || (m.criterion == MeanCriterion::barycentre && !file.weights.empty());
  if (uses_weights) {
    if (!file.weights.empty()) {
      m.weights = file.weights;
    } else if (has_covariances) {
      std::transform(file.covariances.begin(), file.covariances.end(), m.weights.begin(), weightOf);
      m.notes.emplace_back("weights det(covariance)^(-1/k), as the file has none");
    } else {
      refuse("--criterion wlsq needs a column weight, or covariances to make weights of");
    }
    m.weighted = std::any_of(m.weights.begin(), m.weights.end(), [&](double w) { return w != m.weights.front(); });
  } else if (!file.weights.empty()) {
    m.notes.push_back("the file's weights are not used by " + name(m.criterion));
  }

  // LSQ's covariance from known noise wants the noise in the frame of the estimate. There is no difference on points
  // and rotations, and directions carry it along; for frames measured elsewhere the residuals speak instead.
  const bool least_squares = m.criterion == MeanCriterion::lsq || m.criterion == MeanCriterion::wlsq;
  m.known_noise =
      maha || (has_covariances && least_squares && (!isFrame(m.feature) || options.covariance_at == "estimated"));
  m.covariance_at_matters = m.known_noise && isFrame(m.feature);
  if (has_covariances && !m.known_noise) {
    m.notes.emplace_back(least_squares && options.covariance_at == "measured"
                             ? "the file's covariances are not in the frame of the mean: the covariance of the mean "
                               "comes from the residuals"
                             : "the file's covariances are not used");
  }
  m.file = std::move(file);
  return m;
}

}  // namespace liestat::cli
