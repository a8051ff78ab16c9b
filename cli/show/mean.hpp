#pragma once

#include <cli/show/json.hpp>
#include <cli/commands/mean_analysis.hpp>

#include <string>

namespace liestat::cli {

/// The result for the terminal.
std::string formatMean(const std::string& source, const Measurements& measurements, const MeanAnalysis& analysis);

/// The fields of the JSON file, added to an envelope.
void setMeanFields(JsonObject& object, const std::string& source, const Measurements& measurements,
                   const MeanAnalysis& analysis);

/// `quaternion_xyzw`, `rotation_vector` (rad), `translation` (m), `point` (m), `direction`: what the feature has.
JsonObject toJson(const FeatureValue& value);

/// `covariance_order`, `covariance_side`, `covariance_frame`: how a covariance of a feature is to be read, in words.
void setCovarianceWords(JsonObject& object, Feature feature);

/// Square roots of a covariance's diagonal in degrees and metres: a list for each part of the tangent vector, named
/// rotation_deg, translation_m and so on.
JsonObject standardDeviations(Feature feature, const Eigen::MatrixXd& covariance);

/// A feature on one line, for lists of rivals and of halves.
std::string oneLine(const FeatureValue& value);

/// Rows of a table with the columns name, x, y, z, unit: the feature itself; standard deviations and dispersion.
std::vector<std::vector<std::string>> valueRows(const FeatureValue& value);
std::vector<std::vector<std::string>> deviationRows(const Measurements& measurements, const MeanAnalysis& analysis);

/// "is unique: the data …" and so on.
std::string uniquenessInWords(const MeanAnalysis& analysis);

/// The origin of the covariance and how it is to be read, or the reason why there is none.
std::string covarianceInWords(const Measurements& measurements, const MeanAnalysis& analysis);

/// The data and what the reader changed in them: "50 rotations …".
std::string measurementsInWords(const std::string& source, const Measurements& measurements);

/// The page: tables, both charts of the rotations or directions (Pennec 1998, fig. 2), the points or translations.
void writeMeanReport(const std::string& directory, const std::string& command_line, const std::string& source,
                     const Measurements& measurements, const MeanAnalysis& analysis);

}  // namespace liestat::cli
