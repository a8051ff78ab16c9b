#include <cli/commands/measurement_options.hpp>

#include <cli/commands/reading_options.hpp>
#include <formats/npy.hpp>

#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {

void MeasurementInput::declare(const Command& app, bool file_required) {
  const Option path = app.option("FILE", file, "Features: CSV, .npy, TUM, EuRoC or KITTI poses ('-': standard input)");
  if (file_required) path.required();
  app.option("--format", reading.format, "The file's format (default auto: by its first lines)").oneOf(formatNames());
  declareReading(app, reading);
  std::vector<std::pair<std::string, Feature>> features;
  for (const FeatureInfo& row : feature_rows) features.emplace_back(row.name, row.kind);
  app.choice("--feature", options.feature, features, "What the rows are (default: as the file says; poses are frames)");
  app.choice<Criterion>("--criterion", options.criterion,
                        {{"lsq", Criterion::lsq}, {"wlsq", Criterion::wlsq}, {"maha", Criterion::maha}},
                        "lsq, wlsq or maha (default: maha with covariances, wlsq with weights, else lsq)");
  app.choice<CovarianceAt>(
      "--covariance-at", options.covariance_at,
      {{"measured", CovarianceAt::measured}, {"estimated", CovarianceAt::estimated}},
      "Where covariances of frames belong: measured (the frame of each measurement) or estimated (of the mean)");
  app.flag("--likelihood", options.likelihood, "Add the log-determinant of the volume to maha");
  const Option in_degrees = app.flag("--degrees", degrees, "Rotation vectors are in degrees");
  app.flag("--radians", radians, "Rotation vectors are in radians, those beyond a turn too").excludes(in_degrees);
}

ReadingOptions MeasurementInput::howToRead() const {
  ReadingOptions how = reading;
  how.angles = degrees ? AngleUnit::degrees : radians ? AngleUnit::radians : AngleUnit::unsaid;
  return how;
}

bool MeasurementInput::hasChunks() const { return hasFeatureChunks(file) && !NpyFile::isOne(file); }

void MeasurementInput::readInChunks(const std::string& command,
                                    const std::function<void(const Measurements&)>& take) const {
  if (!hasChunks()) return take(read(command));
  readFeatureChunks(file, howToRead(),
                    [&](const FeatureFile& rows) { take(chooseMeasurements(rows, options, command)); });
}

Measurements MeasurementInput::read(const std::string& command) const {
  const ReadingOptions how = howToRead();
  if (NpyFile::isOne(file)) {
    return chooseMeasurements(readNpyFeatures(NpyFile(file), options.feature, how.norm_tolerance), options, command);
  }
  return chooseMeasurements(readFeatureFile(file, how), options, command);
}

}  // namespace liestat::cli
