#include <cli/show/mean.hpp>

#include <fmt/format.h>

#include <cmath>
#include <span>

#include <cli/show/table.hpp>
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

std::vector<double> deviations(const TangentBlock& part, const Eigen::MatrixXd& covariance) {
  std::vector<double> list;
  for (int i = part.begin; i < part.begin + part.size; ++i) {
    list.push_back(unitOf(part).scale * std::sqrt(std::max(0.0, covariance(i, i))));
  }
  return list;
}

std::vector<std::string> triple(const std::string& what, const Eigen::Vector3d& v, const std::string& unit) {
  return {what, number(v[0], 9), number(v[1], 9), number(v[2], 9), unit};
}

}  // namespace

std::vector<std::vector<std::string>> deviationRows(const Measurements& measurements, const MeanAnalysis& analysis) {
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const std::string& what, const TangentBlock& part, const Eigen::MatrixXd& covariance) {
    std::vector<std::string> row{fmt::format("{}, {}", what, name(part.part))};
    for (const double sd : deviations(part, covariance)) row.push_back(number(sd));
    row.resize(4);
    row.push_back(unitOf(part).name);
    rows.push_back(row);
  };
  const std::span<const TangentBlock> parts = experiments::info(measurements.feature).tangent;
  if (analysis.covariance.size() > 0) {
    for (const TangentBlock& part : parts) add("sd of the mean", part, analysis.covariance);
  }
  for (const TangentBlock& part : parts) add("dispersion", part, analysis.dispersion);
  return rows;
}

std::string oneLine(const FeatureValue& value) {
  std::string text;
  const auto add = [&](const char* what, const auto& v, double scale, const char* unit) {
    if (!v) return;
    if (!text.empty()) text += ", ";
    text += fmt::format("{} ({:.6g}, {:.6g}, {:.6g}){}", what, scale * (*v)[0], scale * (*v)[1], scale * (*v)[2], unit);
  };
  add("rotation vector", value.rotation_vector, degrees, " deg");
  add("translation", value.translation, 1, " m");
  add("point", value.point, 1, " m");
  add("direction", value.direction, 1, "");
  return text;
}

std::vector<std::vector<std::string>> valueRows(const FeatureValue& value) {
  std::vector<std::vector<std::string>> rows;
  if (value.rotation_vector) rows.push_back(triple("rotation vector", degrees * *value.rotation_vector, "deg"));
  if (value.translation) rows.push_back(triple("translation", *value.translation, "m"));
  if (value.point) rows.push_back(triple("point", *value.point, "m"));
  if (value.direction) rows.push_back(triple("direction", *value.direction, ""));
  return rows;
}

std::string uniquenessInWords(const MeanAnalysis& analysis) {
  const bool certified = analysis.unique != Uniqueness::not_certified;
  std::string text = std::string(certified ? name(analysis.unique) : "not certified") + ": ";
  if (!analysis.proof.empty()) {
    text += analysis.proof;
  } else if (analysis.cells > 0) {
    text += "branch and bound did not finish";
  } else {
    text += "no certificate holds";
  }
  return analysis.cells > 0 ? text + fmt::format(", {} cells", analysis.cells) : text;
}

std::string covarianceInWords(const Measurements& measurements, const MeanAnalysis& analysis) {
  if (analysis.covariance.size() == 0) {
    return analysis.status == Status::not_applicable ? "none: " + analysis.reason : "withdrawn";
  }
  const int k = degreesOfFreedom(measurements.feature);
  const std::string law = analysis.covariance_from == "residuals"
                              ? fmt::format("Hotelling's law with k = {}, n = {}", k, measurements.size())
                              : fmt::format("chi-square with {} degrees of freedom", k);
  return fmt::format("from {}, in the local frame of the mean; squared distances follow {}",
                     analysis.covariance_from == "residuals" ? "the residuals" : "the measurements' own covariances",
                     law);
}

std::string measurementsInWords(const std::string& source, const Measurements& measurements) {
  const experiments::FeatureInfo& feature = experiments::info(measurements.feature);
  std::string text = fmt::format("{}: {} {} ({})", source, measurements.size(),
                                 measurements.size() == 1 ? feature.name : feature.plural, measurements.file.format);
  if (measurements.file.n_normalised > 0) {
    text += fmt::format(", {} normalised (largest error {:.2g})", measurements.file.n_normalised,
                        measurements.file.largest_norm_error);
  }
  return text;
}

std::string formatMean(const std::string& source, const Measurements& measurements, const MeanAnalysis& analysis) {
  std::string text = measurementsInWords(source, measurements) + "\n";
  text += fmt::format("mean by {}: {} after {} {}\n\n", criterionInWords(measurements),
                      analysis.converged ? "converged" : "not converged", analysis.iterations,
                      analysis.iterations == 1 ? "step" : "steps");
  Table table({"", "x", "y", "z", "unit"});
  for (auto& row : valueRows(analysis.mean)) table.row(row);
  for (auto& row : deviationRows(measurements, analysis)) table.row(row);
  text += table.str() + "\n";
  if (analysis.mean.quaternion_xyzw) {
    const Eigen::Vector4d& q = *analysis.mean.quaternion_xyzw;
    text += fmt::format("quaternion x y z w  {:.9f} {:.9f} {:.9f} {:.9f}\n", q[0], q[1], q[2], q[3]);
  }
  text += "uniqueness   " + uniquenessInWords(analysis) + "\n";
  for (const FeatureValue& rival : analysis.rivals) text += "  rival      " + oneLine(rival) + "\n";
  for (const NearRival& rival : analysis.near_ties) {
    text += fmt::format("  near tie   {}: worse by {:.2g} standard deviations\n", oneLine(rival.feature), rival.z);
  }
  text += "covariance   " + covarianceInWords(measurements, analysis) + "\n";
  const std::span<const TangentBlock> parts = experiments::info(measurements.feature).tangent;
  for (std::size_t p = 0; measurements.size() > 1 && p < parts.size() && p < analysis.largest.size(); ++p) {
    text +=
        fmt::format("farthest     {} {} in {}, line {}\n", number(unitOf(parts[p]).scale * analysis.largest[p].value),
                    unitOf(parts[p]).name, name(parts[p].part), analysis.largest[p].line);
  }
  for (const std::string& note : measurements.notes) text += "note         " + note + "\n";
  for (const std::string& note : analysis.notes) text += "note         " + note + "\n";
  if (analysis.status != Status::ok && analysis.status != Status::not_applicable) {
    text += fmt::format("\nNot to be trusted ({}): {}.\n", name(analysis.status), analysis.reason);
  }
  return text;
}

JsonObject toJson(const FeatureValue& value) {
  JsonObject object;
  if (value.quaternion_xyzw) object.set("quaternion_xyzw", *value.quaternion_xyzw);
  if (value.rotation_vector) object.set("rotation_vector", *value.rotation_vector);
  if (value.translation) object.set("translation", *value.translation);
  if (value.point) object.set("point", *value.point);
  if (value.direction) object.set("direction", *value.direction);
  return object;
}

void setCovarianceWords(JsonObject& object, Feature feature) {
  switch (feature) {
    case Feature::point:
      object.set("covariance_order", "x y z (m)");
      object.set("covariance_side", "none: the error is added to the point");
      object.set("covariance_frame", "the coordinates of the file");
      return;
    case Feature::direction:
      object.set("covariance_order", "two tangent coordinates (rad)");
      object.set("covariance_side", "right: the error is a tangent vector at the mean, followed along a great circle");
      object.set("covariance_frame",
                 "the tangent plane at the mean, its axes the columns of tangent_basis (the x and y axes turned by the "
                 "smallest rotation that takes z to the mean)");
      return;
    case Feature::rotation:
      object.set("covariance_order", "rotation x y z (rad)");
      break;
    default:
      object.set("covariance_order", "translation x y z (m), rotation x y z (rad)");
  }
  object.set("covariance_side", feature == Feature::rotation ? "right: mean * Exp(error)"
                                : feature == Feature::se3    ? "right: mean * Exp(error), Exp of SE(3)"
                                                             : "right: translation + R * error_t, R * Exp(error_r)");
  object.set("covariance_frame", "the axes of the mean (body frame)");
}

JsonObject standardDeviations(Feature feature, const Eigen::MatrixXd& covariance) {
  JsonObject object;
  for (const TangentBlock& part : experiments::info(feature).tangent) {
    object.set(std::string(name(part.part)) + "_" + unitOf(part).name, deviations(part, covariance));
  }
  return object;
}

void setMeanFields(JsonObject& object, const std::string& source, const Measurements& measurements,
                   const MeanAnalysis& analysis) {
  object.set("file", source).set("format", measurements.file.format).set("feature", name(measurements.feature));
  object.set("criterion", name(measurements.criterion));
  if (measurements.covariance_at_matters) {
    object.set("covariance_at", measurements.covariance_at == CovarianceAt::measured ? "measured" : "estimated");
  } else {
    object.set("covariance_at", nullptr);
  }
  object.set("likelihood", measurements.likelihood).set("weighted", measurements.weighted);
  object.set("n", measurements.size()).set("n_normalised", measurements.file.n_normalised);
  object.set("largest_norm_error", measurements.file.largest_norm_error);
  object.set("status", name(analysis.status));
  if (analysis.status == Status::ok) {
    object.set("reason", nullptr);
  } else {
    object.set("reason", analysis.reason);
  }
  object.set("converged", analysis.converged).set("iterations", analysis.iterations);
  object.set("residual", analysis.residual).set("tolerance", analysis.tolerance);
  object.set("mean", toJson(analysis.mean));

  const bool has_covariance = analysis.covariance.size() > 0;
  if (has_covariance) {
    object.set("covariance", analysis.covariance);
  } else {
    object.set("covariance", nullptr);
  }
  object.set("covariance_status", name(analysis.covariance_status));
  setCovarianceWords(object, measurements.feature);
  if (analysis.tangent_basis) object.set("tangent_basis", *analysis.tangent_basis);
  if (has_covariance) {
    object.set("covariance_from", analysis.covariance_from)
        .set("covariance_law", analysis.covariance_from == "residuals" ? "hotelling" : "chi2");
    object.set("standard_deviations", standardDeviations(measurements.feature, analysis.covariance));
  } else {
    object.set("covariance_from", nullptr).set("covariance_law", nullptr).set("standard_deviations", nullptr);
  }
  object.set("dispersion", analysis.dispersion);
  object.set("dispersion_standard_deviations", standardDeviations(measurements.feature, analysis.dispersion));
  std::vector<JsonObject> farthest;
  const std::span<const TangentBlock> parts = experiments::info(measurements.feature).tangent;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    JsonObject entry;
    entry.set("part", name(parts[p].part)).set("distance", unitOf(parts[p]).scale * analysis.largest[p].value);
    entry.set("unit", unitOf(parts[p]).name).set("line", analysis.largest[p].line);
    farthest.push_back(entry);
  }
  object.set("farthest", farthest);

  object.set("unique", name(analysis.unique)).set("proof", uniquenessInWords(analysis));
  std::vector<JsonObject> rivals;
  for (const FeatureValue& rival : analysis.rivals) rivals.push_back(toJson(rival));
  object.set("rivals", rivals).set("r_star", analysis.r_star).set("cells", analysis.cells);
  std::vector<JsonObject> near_ties;
  for (const NearRival& rival : analysis.near_ties) {
    near_ties.push_back(toJson(rival.feature));
    near_ties.back().set("z", rival.z);
  }
  object.set("near_ties", near_ties);
  object.set("cut_locus_mass", analysis.cut_locus_mass).set("hessian_change", analysis.hessian_change);
  if (analysis.fit_dof > 0) {
    object.set("fit", analysis.fit).set("fit_dof", analysis.fit_dof);
    object.set("fit_p", analysis.fit_p);
  } else {
    object.set("fit", nullptr).set("fit_dof", nullptr).set("fit_p", nullptr);
  }
  std::vector<std::string> notes = measurements.notes;
  notes.insert(notes.end(), analysis.notes.begin(), analysis.notes.end());
  object.set("notes", notes);
}

}  // namespace liestat::cli
