#include <cli/show/mean.hpp>

#include <span>

#include <cli/show/units.hpp>

namespace liestat::cli {

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

namespace {

/// The standard deviations of the translation along the axes of the file's world, for features with a rotation.
void setWorldDeviations(JsonObject& object, const char* field, Feature feature, const MeanAnalysis& analysis,
                        const Eigen::MatrixXd& covariance) {
  object.set(field, nullptr);
  if (covariance.size() == 0) return;
  for (const TangentBlock& part : experiments::info(feature).tangent) {
    const auto list = worldDeviations(part, analysis.mean, covariance);
    if (!list) continue;
    JsonObject world;
    world.set(std::string(name(part.part)) + "_" + unitOf(part).name, *list);
    object.set(field, world);
  }
}

void setTimeBlocks(JsonObject& object, const std::optional<TimeBlocks>& found) {
  if (!found) {
    object.set("time_blocks", nullptr);
    return;
  }
  JsonObject o;
  o.set("blocks", found->blocks).set("splits", found->splits).set("factor", found->factor);
  o.set("factor_low", found->low).set("factor_high", found->high).set("p", found->p).set("applied", found->applied);
  object.set("time_blocks", o);
}

}  // namespace

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
  object.set("n", analysis.n).set("n_normalised", measurements.file.n_normalised);
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
  setWorldDeviations(object, "standard_deviations_world", measurements.feature, analysis, analysis.covariance);
  object.set("dispersion", analysis.dispersion);
  setWorldDeviations(object, "dispersion_standard_deviations_world", measurements.feature, analysis,
                     analysis.dispersion);
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
  object.set("rivals", rivals)
      .set("rivals_complete", !analysis.more_rivals)
      .set("r_star", analysis.r_star)
      .set("cells", analysis.cells);
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
  setTimeBlocks(object, analysis.time_blocks);
  std::vector<std::string> notes = measurements.notes;
  notes.insert(notes.end(), analysis.notes.begin(), analysis.notes.end());
  object.set("notes", notes);
}

}  // namespace liestat::cli
