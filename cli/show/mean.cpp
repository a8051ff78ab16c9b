#include <cli/show/mean.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <formats/text.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

namespace liestat::cli {
namespace {

std::string criterionInWords(const Measurements& measurements) {
  switch (measurements.criterion) {
    case Criterion::lsq:
      return "least squares";
    case Criterion::wlsq:
      return "weighted least squares";
    case Criterion::maha:
      return std::string("least Mahalanobis distances") +
             (measurements.likelihood ? " with the likelihood's volume term" : "") +
             (!measurements.covariance_at_matters                    ? ""
              : measurements.covariance_at == CovarianceAt::measured ? ", covariances in the frames of the measurements"
                                                                     : ", covariances in the frame of the mean");
    case Criterion::barycentre:
      break;
  }
  return measurements.weighted ? "weighted exponential barycentre of the group" : "exponential barycentre of the group";
}

/// The digits of a value that its standard deviation leaves: two beyond the deviation's first, nine in all at least.
std::string withDigitsOf(double value, double sd) {
  if (!(sd > 0) || !std::isfinite(sd)) return number(value, 12);
  const int decimals = 2 - static_cast<int>(std::floor(std::log10(sd)));
  const int before = value == 0 ? 1 : 1 + static_cast<int>(std::floor(std::log10(std::abs(value))));
  if (before + decimals <= 9) return number(value, 9);
  // A double has no more digits than seventeen.
  return fmt::format("{:.{}f}", value, std::clamp(decimals, 0, std::clamp(17 - before, 0, 20)));
}

/// The value that belongs to a part of the tangent vector, as it is shown.
struct ShownPart {
  const char* name = "";
  Eigen::Vector3d value;
  std::string unit;
  double per_sd = 1;  ///< units of the value in one of the part's standard deviation
};

ShownPart shownPart(const TangentBlock& part, const FeatureValue& value) {
  if (isAngular(part.part)) {
    if (value.direction) return {"direction", *value.direction, "", 1 / degrees};
    return {"rotation vector", degrees * *value.rotation_vector, "deg"};
  }
  return value.translation ? ShownPart{"translation", *value.translation, "m"} : ShownPart{"point", *value.point, "m"};
}

}  // namespace

TableRows meanRows(const Measurements& measurements, const MeanAnalysis& analysis) {
  TableRows table{{"", "x", "y", "z", "unit"}};
  std::vector<std::vector<std::string>>& rows = table.rows;
  const auto add = [&](const std::string& what, const std::vector<double>& list, const TangentBlock& part) {
    std::vector<std::string> row{what};
    for (const double sd : list) row.push_back(number(sd));
    row.resize(4);
    row.push_back(unitOf(part).name);
    rows.push_back(row);
  };
  for (const TangentBlock& part : info(measurements.feature).tangent) {
    const ShownPart shown = shownPart(part, analysis.mean);
    const bool has_covariance = analysis.hasCovariance();
    double least = 0;
    if (has_covariance) {
      const auto world = worldDeviations(part, analysis.mean, analysis.covariance);
      const std::vector<double> list = world ? *world : deviations(part, analysis.covariance);
      least = shown.per_sd * *std::min_element(list.begin(), list.end());
    }
    std::vector<std::string> row{shown.name};
    for (int i = 0; i < 3; ++i) row.push_back(withDigitsOf(shown.value[i], least));
    row.push_back(shown.unit);
    rows.push_back(row);
    const std::string own_axes = analysis.mean.direction         ? ", tangent axes"
                                 : analysis.mean.quaternion_xyzw ? ", body axes"
                                                                 : "";
    const auto addBoth = [&](const std::string& what, const Eigen::MatrixXd& covariance) {
      if (const auto world = worldDeviations(part, analysis.mean, covariance)) add(what + ", world axes", *world, part);
      add(what + own_axes, deviations(part, covariance), part);
    };
    if (has_covariance) addBoth("  sd", analysis.covariance);
    addBoth("  dispersion", analysis.dispersion);
  }
  return table;
}

std::string oneLine(const FeatureValue& value) {
  std::string text;
  const auto add = [&](const char* what, const auto& v, double scale, const char* unit) {
    if (!v) return;
    if (!text.empty()) text += ", ";
    text += fmt::format("{} ({:.9g}, {:.9g}, {:.9g}){}", what, scale * (*v)[0], scale * (*v)[1], scale * (*v)[2], unit);
  };
  add("rotation vector", value.rotation_vector, degrees, " deg");
  add("translation", value.translation, 1, " m");
  add("point", value.point, 1, " m");
  add("direction", value.direction, 1, "");
  return text;
}

std::string covarianceInWords(const Measurements& measurements, const MeanAnalysis& analysis) {
  if (analysis.covariance.size() == 0) {
    return analysis.status == Status::not_applicable ? "none: " + analysis.reason : "withdrawn";
  }
  const int k = degreesOfFreedom(measurements.feature);
  const std::string law = analysis.fromResiduals() ? fmt::format("Hotelling's law with k = {}, n = {}", k, analysis.n)
                                                   : fmt::format("chi-square with {} degrees of freedom", k);
  return fmt::format("from {}, in the local frame of the mean; squared distances follow {}",
                     analysis.fromResiduals() ? "the residuals" : "the measurements' own covariances", law);
}

std::string measurementsInWords(const std::string& source, const Measurements& measurements) {
  const FeatureInfo& feature = info(measurements.feature);
  std::string text = fmt::format("{}: {} {} ({})", sourceName(source), measurements.size(),
                                 measurements.size() == 1 ? feature.name : feature.plural, measurements.file.format);
  if (measurements.file.n_normalised > 0) {
    text += fmt::format(", {} normalised (largest error {:.2g})", measurements.file.n_normalised,
                        measurements.file.largest_norm_error);
  }
  return text;
}

namespace {

/// As many decimals as the standard deviation of the rotation leaves, nine at least.
int quaternionDecimals(Feature feature, const MeanAnalysis& analysis) {
  if (analysis.covariance.size() == 0) return 9;
  for (const TangentBlock& part : info(feature).tangent) {
    if (!isAngular(part.part)) continue;
    const double least = analysis.covariance.diagonal().segment(part.begin, part.size).minCoeff();
    if (least > 0) return std::clamp(2 - static_cast<int>(std::floor(0.5 * std::log10(least))), 9, 16);
  }
  return 9;
}

std::string blocksInWords(const TimeBlocks& found) {
  return fmt::format("of time, {}: halves differ by {} times the expected squared distance (95 %: {} to {}){}",
                     found.blocks, number(found.factor, 3), number(found.low, 3), number(found.high, 3),
                     !found.applied        ? ""
                     : !(found.factor > 1) ? ", so the covariance is left as it is"
                                           : ", by which the covariance was multiplied");
}

}  // namespace

std::string formatMean(const std::string& source, const Measurements& measurements, const MeanAnalysis& analysis) {
  std::string text = measurementsInWords(source, measurements) + "\n";
  text += fmt::format("mean by {}: {} after {} {}\n\n", criterionInWords(measurements),
                      analysis.converged ? "converged" : "not converged", analysis.iterations,
                      analysis.iterations == 1 ? "step" : "steps");
  text += Table(meanRows(measurements, analysis)).str() + "\n";
  if (analysis.mean.quaternion_xyzw) {
    const Eigen::Vector4d& q = *analysis.mean.quaternion_xyzw;
    const int decimals = quaternionDecimals(measurements.feature, analysis);
    text +=
        fmt::format("quaternion x y z w  {0:.{4}f} {1:.{4}f} {2:.{4}f} {3:.{4}f}\n", q[0], q[1], q[2], q[3], decimals);
  }
  text += "uniqueness   " + analysis.uniquenessInWords() + "\n";
  for (const FeatureValue& rival : analysis.rivals) text += "  rival      " + oneLine(rival) + "\n";
  if (analysis.more_rivals) text += "  rival      and others: these are not all\n";
  for (const NearRival& rival : analysis.near_ties) {
    text += fmt::format("  near tie   {}: worse by {:.2g} standard deviations\n", oneLine(rival.feature), rival.z);
  }
  text += "covariance   " + covarianceInWords(measurements, analysis) + "\n";
  if (analysis.time_blocks) text += "blocks       " + blocksInWords(*analysis.time_blocks) + "\n";
  for (const FarthestMeasurement& f : analysis.farthest) {
    if (measurements.size() < 2) break;
    text += fmt::format("farthest     {} {} in {}, line {}\n", number(f.shown()), unitOf(f.part).name, name(f.part),
                        f.line.value_or(0));
  }
  for (const std::string& note : analysis.notes) text += "note         " + note + "\n";
  if (!analysis.trusted()) text += "\n" + analysis.verdict().text + "\n";
  return text;
}

}  // namespace liestat::cli
