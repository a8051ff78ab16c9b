#include <cli/commands/measurements.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <lie/linear.hpp>
#include <formats/input_error.hpp>

namespace liestat::cli {

namespace {

/// det(Σ)^(-1/k), for covariances whose size is known at run time only.
double weightOf(const FeatureCovariance& covariance) {
  const Eigen::Index n = covariance.rows();
  Eigen::Matrix<double, 6, 6> whole = Eigen::Matrix<double, 6, 6>::Identity();
  whole.topLeftCorner(n, n) = covariance;
  return std::exp(-Cholesky<double, 6>(whole).logDeterminant() / static_cast<double>(n));
}

}  // namespace

Measurements chooseMeasurements(FeatureFile file, const MeasurementOptions& options, const std::string& command) {
  const auto refuse = [&](const std::string& why) { throw OptionError(command, why); };
  Measurements m;
  m.feature = options.feature.value_or(file.kind);
  const FeatureInfo& feature = info(m.feature);
  const FeatureInfo& rows = info(file.kind);
  if (!rows.parts.contains(feature.parts)) {
    refuse(fmt::format("--feature {} does not fit a file of {}", feature.name, rows.plural));
  }
  m.notes = file.notes;
  if (!file.covariances.empty() && !(rows.parts == feature.parts)) {
    m.notes.push_back(fmt::format("the file's covariances are those of whole {} and are not used", rows.plural));
    file.covariances.clear(), file.factors.clear(), file.unmeasured.clear();
  }
  if (file.n_beyond_half_turn > 0 && feature.parts.contains(FeaturePart::rotation)) {
    m.notes.push_back(
        fmt::format("{} rotation {} longer than a half-turn, {:.4g} rad at most, and taken modulo a turn (--degrees "
                    "reads degrees)",
                    file.n_beyond_half_turn, file.n_beyond_half_turn == 1 ? "vector is" : "vectors are",
                    file.largest_rotation_vector));
  }
  const bool has_covariances = !file.covariances.empty();
  const bool must_choose = has_covariances && feature.frameMatters() && !options.covariance_at;
  const std::string choice =
      "--covariance-at measured (they are given in the frame of each measurement, as a sensor knows them) or "
      "--covariance-at estimated (in the frame of the mean, as for parts of one object)";

  if (!feature.has_metric) {
    m.criterion = Criterion::barycentre;
    if (options.criterion == Criterion::maha) {
      m.criterion = Criterion::maha;
    } else if (options.criterion && isRobust(*options.criterion)) {
      m.criterion = *options.criterion;
    } else if (options.criterion) {
      refuse("--criterion " + name(*options.criterion) +
             " needs an invariant metric, which rigid motions have not: leave it out for the group's barycentre, or "
             "take --feature frame");
    }
  } else if (options.criterion) {
    m.criterion = *options.criterion;
  } else if (has_covariances) {
    if (must_choose) {
      refuse("the file has covariances of frames, and only you know where they belong: say " + choice +
             ", or --criterion lsq to leave them aside");
    }
    m.criterion = Criterion::maha;
  } else {
    m.criterion = file.weights.empty() ? Criterion::lsq : Criterion::wlsq;
  }

  const bool maha = m.criterion == Criterion::maha;
  if (maha && !has_covariances)
    refuse("--criterion maha needs the columns cov_00 ... of the measurements' covariances");
  if (maha && must_choose) refuse("--criterion maha on frames needs " + choice);
  if (options.likelihood && !maha) refuse("--likelihood is an option of --criterion maha");
  m.likelihood = options.likelihood;
  m.covariance_at = options.covariance_at.value_or(CovarianceAt::measured);
  if (feature.has_isotropy && m.covariance_at == CovarianceAt::estimated) {
    refuse(fmt::format("--covariance-at estimated is not there for {}: no frame is common to all points of a sphere",
                       feature.plural));
  }

  // LSQ's covariance from known noise wants the noise in the frame of the estimate. There is no difference on points
  // and rotations, and directions carry it along; for frames measured elsewhere the residuals speak instead.
  const bool least_squares = m.criterion == Criterion::lsq || m.criterion == Criterion::wlsq;
  m.known_noise = maha || (has_covariances && least_squares &&
                           (!feature.frameMatters() || options.covariance_at == CovarianceAt::estimated));
  const bool uses_covariances = m.known_noise || (m.criterion == Criterion::wlsq && file.weights.empty());
  if (uses_covariances && !file.unmeasured.empty()) {
    const std::size_t unmeasured = file.unmeasured.size(), all = file.size();
    if (unmeasured == all) {
      refuse(fmt::format("no row has a measured rotation: all variances of one are {:g} rad² or more, or -1",
                         unmeasured_variance));
    }
    file = withoutUnmeasured(std::move(file));
    m.notes.push_back(
        fmt::format("{} of {} rows {} a rotation with a variance of {:g} rad² or more, or -1: not "
                    "measured, and left out",
                    unmeasured, all, unmeasured == 1 ? "has" : "have", unmeasured_variance));
  }
  if (file.n_large_variances > 0 && uses_covariances) {
    m.notes.push_back(fmt::format(
        "{} {} a variance of {:g} m² or more: in messages that means not measured, "
        "here it is taken as it is",
        file.n_large_variances, file.n_large_variances == 1 ? "row has" : "rows have", unmeasured_variance));
  }

  m.weights.assign(file.size(), 1.0);
  const bool uses_weights =
      m.criterion == Criterion::wlsq || (m.criterion == Criterion::barycentre && !file.weights.empty());
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

  m.covariance_at_matters = m.known_noise && feature.frameMatters();
  if (has_covariances && !m.known_noise) {
    m.notes.emplace_back(least_squares && options.covariance_at == CovarianceAt::measured
                             ? "the file's covariances are not in the frame of the mean: the covariance of the mean "
                               "comes from the residuals"
                             : "the file's covariances are not used");
  }
  m.file = std::move(file);
  return m;
}

}  // namespace liestat::cli
