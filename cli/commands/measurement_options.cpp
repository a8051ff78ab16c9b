#include <cli/commands/measurement_options.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace liestat::cli {

void MeasurementInput::declare(CLI::App& app, bool file_required) {
  CLI::Option* path = app.add_option("FILE", file, "Features: CSV, TUM, EuRoC or KITTI poses ('-': standard input)");
  if (file_required) path->required();
  app.add_option("--format", format, "The file's format (default auto: by its first lines)")
      ->check(CLI::IsMember(formatNames()));
  app.add_option("--feature", options.feature, "What the rows are (default: as the file says; poses are frames)")
      ->check(CLI::IsMember(experiments::featureNames()));
  app.add_option("--criterion", options.criterion,
                 "lsq, wlsq or maha (default: maha with covariances, wlsq with weights, else lsq)")
      ->check(CLI::IsMember({"lsq", "wlsq", "maha"}));
  app.add_option(
         "--covariance-at", options.covariance_at,
         "Where covariances of frames belong: measured (the frame of each measurement) or estimated (of the mean)")
      ->check(CLI::IsMember({"measured", "estimated"}));
  app.add_flag("--likelihood", options.likelihood, "Add the log-determinant of the volume to maha");
  app.add_option("--norm-tolerance", norm_tolerance,
                 "Quaternions, directions and matrices that are off by less are normalised (default 0.001)")
      ->check(CLI::Range(0.0, 0.5));
}

Measurements MeasurementInput::read(const std::string& command) const {
  ReadingOptions how;
  if (!format.empty()) how.format = format;
  how.norm_tolerance = norm_tolerance;
  return chooseMeasurements(readFeatureFile(file, how), options, command);
}

}  // namespace liestat::cli
