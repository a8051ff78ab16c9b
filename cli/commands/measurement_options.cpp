#include <cli/commands/measurement_options.hpp>

#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {

void MeasurementInput::declare(const Command& app, bool file_required) {
  const Option path = app.option("FILE", file, "Features: CSV, TUM, EuRoC or KITTI poses ('-': standard input)");
  if (file_required) path.required();
  app.option("--format", format, "The file's format (default auto: by its first lines)").oneOf(formatNames());
  app.option("--columns", columns, "Names of CSV columns that are not ours: r00=R00,tx=cx (ours=the file's)").list();
  app.flag("--ignore-unknown", ignore_unknown, "Pass over CSV columns without a meaning");
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
  app.option("--norm-tolerance", norm_tolerance,
             "Quaternions, directions and matrices that are off by less are normalised (default 0.001)")
      .range(0.0, 0.5);
}

Measurements MeasurementInput::read(const std::string& command) const {
  ReadingOptions how;
  if (!format.empty()) how.format = format;
  how.norm_tolerance = norm_tolerance;
  how.angles = degrees ? AngleUnit::degrees : radians ? AngleUnit::radians : AngleUnit::unsaid;
  how.ignore_unknown = ignore_unknown;
  how.columns = columns;
  return chooseMeasurements(readFeatureFile(file, how), options, command);
}

}  // namespace liestat::cli
