#pragma once

#include <cli/io/reading.hpp>
#include <stats/maha.hpp>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::cli {

/// What a file's rows are taken for.
enum class MeanFeature { point, rotation, frame, semi_oriented_frame, non_oriented_frame, se3, direction };

/// How a mean is taken; the barycentre is the group's, of rigid motions.
enum class MeanCriterion { lsq, wlsq, maha, barycentre };

/// The names of the options and the JSON fields.
std::string name(MeanFeature feature);
std::string name(MeanCriterion criterion);
std::vector<std::string> meanFeatureNames();

/// Number of degrees of freedom.
int degreesOfFreedom(MeanFeature feature);

/// A part of a feature's tangent vector.
struct TangentPart {
  std::string name;  ///< rotation, translation, point or direction
  int begin = 0;
  int size = 3;
  bool angular = false;  ///< rad inside, degrees for people; else m

  double scale() const;  ///< from the inner unit to people's
  std::string unit() const { return angular ? "deg" : "m"; }
};
std::vector<TangentPart> tangentParts(MeanFeature feature);

/// What the commands that read features are told about them; names as on the command line, empty: decide by the file.
struct MeasuresOptions {
  std::string feature = {};
  std::string criterion = {};
  std::string covariance_at = {};
  bool likelihood = false;
};

/// The measures of a file and how they are to be averaged.
struct Measures {
  FeatureFile file;
  MeanFeature feature = MeanFeature::point;
  MeanCriterion criterion = MeanCriterion::lsq;
  CovarianceAt covariance_at = CovarianceAt::measured;
  bool covariance_at_matters = false;  ///< both models differ for this feature, and covariances are used
  bool likelihood = false;
  std::vector<double> weights;          ///< one for each measure, all one where none are used
  bool weighted = false;                ///< some are not one
  bool known_noise = false;             ///< the file's covariances are used
  std::vector<std::string> notes = {};  ///< what the user should know about these choices

  std::size_t size() const { return file.size(); }
};

/// Decides what is averaged and how. `command` begins the messages. Throws InputError where the wish does not fit the
/// file.
Measures chooseMeasures(FeatureFile file, const MeasuresOptions& options, const std::string& command);

}  // namespace liestat::cli
