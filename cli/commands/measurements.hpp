#pragma once

#include <formats/features.hpp>
#include <stats/maha.hpp>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The options of commands that read features; what is not given the file decides.
struct MeasurementOptions {
  std::optional<Feature> feature = {};
  std::optional<Criterion> criterion = {};  ///< none but lsq, wlsq, maha
  std::optional<CovarianceAt> covariance_at = {};
  bool likelihood = false;
};

/// The measurements of a file and how they are to be averaged.
struct Measurements {
  FeatureFile file;
  Feature feature = Feature::point;
  Criterion criterion = Criterion::lsq;
  CovarianceAt covariance_at = CovarianceAt::measured;
  bool covariance_at_matters = false;  ///< both models differ for this feature, and covariances are used
  bool likelihood = false;
  std::vector<double> weights;          ///< one for each measurement, all one where none are used
  bool weighted = false;                ///< some are not one
  bool known_noise = false;             ///< the file's covariances are used
  std::vector<std::string> notes = {};  ///< for the user, about these choices

  std::size_t streamed = 0;  ///< rows of a file that is not in memory

  std::size_t size() const { return streamed > 0 ? streamed : file.size(); }
  /// The criterion takes the weights.
  bool usesWeights() const {
    return criterion == Criterion::wlsq || (criterion == Criterion::barycentre && !file.weights.empty());
  }
};

/// Decides what is averaged and how. `command` begins the messages. Throws OptionError where the wish does not fit the
/// file.
Measurements chooseMeasurements(FeatureFile file, const MeasurementOptions& options, const std::string& command);

}  // namespace liestat::cli
