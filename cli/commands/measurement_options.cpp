#include <cli/commands/measurement_options.hpp>

namespace liestat::cli {

void MeasurementInput::declare(const Command& app, bool file_required) {
  const Option path = app.option("FILE", file, "Features: CSV, TUM, EuRoC or KITTI poses ('-': standard input)");
  if (file_required) path.required();
  app.option("--format", format, "The file's format (default auto: by its first lines)").oneOf(formatNames());
  app.option("--feature", options.feature, "What the rows are (default: as the file says; poses are frames)")
      .oneOf(experiments::featureNames());
  app.option("--criterion", options.criterion,
             "lsq, wlsq or maha (default: maha with covariances, wlsq with weights, else lsq)")
      .oneOf({"lsq", "wlsq", "maha"});
  app.option("--covariance-at", options.covariance_at,
             "Where covariances of frames belong: measured (the frame of each measurement) or estimated (of the mean)")
      .oneOf({"measured", "estimated"});
  app.flag("--likelihood", options.likelihood, "Add the log-determinant of the volume to maha");
  app.option("--norm-tolerance", norm_tolerance,
             "Quaternions, directions and matrices that are off by less are normalised (default 0.001)")
      .range(0.0, 0.5);
}

Measurements MeasurementInput::read(const std::string& command) const {
  ReadingOptions how;
  if (!format.empty()) how.format = format;
  how.norm_tolerance = norm_tolerance;
  return chooseMeasurements(readFeatureFile(file, how), options, command);
}

}  // namespace liestat::cli
