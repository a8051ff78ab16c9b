// The definitions of estimateTwoViewMotion() and estimateTwoViewMotions().
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/coordinate_units.hpp>
#include <fusion/two_view/detail/two_view_coordinates.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/detail/two_view_suspects.hpp>
#include <fusion/two_view/contradictions.hpp>
#include <fusion/two_view/two_view.hpp>
#include <stats/hierarchy.hpp>
#include <stats/repeated_extraction.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// The derivatives of the entries of M by a pose, and with six parameters by log f: M ~ D [t]× R D,
/// D = diag(1/f, 1/f, 1).
inline Eigen::MatrixXd entriesByPose(const ModelEstimate<TwoViewMotionModel>& estimate, Eigen::Matrix3d& M) {
  const bool with_focal_length = estimate.covariance.rows() == 6;
  const double f = with_focal_length ? estimate.parameter.focal_length : 1;
  const Eigen::Matrix3d D = Eigen::Vector3d(1 / f, 1 / f, 1).asDiagonal();
  const Eigen::Matrix3d flat = Eigen::Vector3d(1, 1, 0).asDiagonal();
  const Eigen::Matrix<double, 9, 5> by_pose = estimate.parameter.pose.essentialMatrixJacobian();
  M = D * estimate.parameter.pose.essentialMatrix() * D;
  Eigen::MatrixXd J(9, estimate.covariance.rows());
  for (int k = 0; k < 5; ++k) J.col(k) = entriesFrom(D * matrixFrom(Entries(by_pose.col(k))) * D);
  if (with_focal_length) J.col(5) = entriesFrom(-(flat * M + M * flat));
  return J;
}
inline bool isOfPose(const ModelEstimate<TwoViewMotionModel>& estimate) {
  return estimate.covariance.rows() == 5 || estimate.covariance.rows() == 6;
}

/// The covariance of A M B/‖A M B‖, entries column after column.
inline Eigen::MatrixXd covarianceInPixels(const ModelEstimate<TwoViewMotionModel>& estimate, const Eigen::Matrix3d& A,
                                          const Eigen::Matrix3d& B) {
  Eigen::MatrixXd covariance = estimate.covariance;
  Eigen::Matrix3d M = estimate.parameter.matrix;
  if (isOfPose(estimate)) covariance = covarianceThrough(entriesByPose(estimate, M), covariance);
  if (covariance.rows() != 9) return {};
  M = A * M * B;
  const Entries unit = entriesFrom(M / M.norm());
  Eigen::MatrixXd J(9, 9);
  for (int k = 0; k < 9; ++k) {
    const Entries moved = entriesFrom(A * matrixFrom(Entries(Entries::Unit(k))) * B) / M.norm();
    J.col(k) = moved - unit.dot(moved) * unit;
  }
  return covarianceThrough(J, covariance);
}

/// The covariance of an estimate with those shifts of its matrix, of norm one, in it.
inline Eigen::MatrixXd covarianceWithShifts(const ModelEstimate<TwoViewMotionModel>& estimate,
                                            std::span<const TwoViewCameraTests::Shift> shifts) {
  Eigen::MatrixXd covariance = estimate.covariance;
  if (shifts.empty()) return covariance;
  Eigen::Matrix3d M = estimate.parameter.matrix;
  Eigen::MatrixXd to_parameters;
  if (isOfPose(estimate)) {
    const Eigen::MatrixXd J = entriesByPose(estimate, M);
    // Along M itself nothing moves.
    const Entries unit = entriesFrom(M / M.norm());
    const Eigen::MatrixXd across = (J - unit * (unit.transpose() * J)) / M.norm();
    to_parameters = (across.transpose() * across).ldlt().solve(across.transpose());
  } else {
    to_parameters = M.norm() * Eigen::MatrixXd::Identity(9, 9);
  }
  for (const TwoViewCameraTests::Shift& shift : shifts) {
    const Eigen::VectorXd moved = to_parameters * shift.entries;
    covariance += moved * moved.transpose();
  }
  return covariance;
}

inline TwoViewModelRow rowOf(const Hierarchy<Eigen::Vector4d, TwoViewMotionModel>& search, std::size_t m,
                             double sigma) {
  const TwoViewModel& model = *search.models()[m];
  const ModelState<TwoViewMotionModel>& state = search.state(m);
  TwoViewModelRow row;
  row.name = model.name(), row.parents = model.parents();
  row.free_parameters = model.freeParameters(), row.equations = model.equations();
  row.evaluated = state.progress == ModelState<TwoViewMotionModel>::Progress::evaluated;
  row.draws = state.draws;
  if (!state.hasEstimate()) return row;
  row.status = state.estimate.status;
  row.inliers = state.inliers.size();
  row.relevance = state.relevance;
  row.chi2 = state.fit.chi2, row.degrees_of_freedom = state.fit.degreesOfFreedom();
  row.rms = sigma * std::sqrt(state.fit.normalised());
  row.excess_noise = state.excess_noise;
  row.unsupported = state.unsupported;
  row.rejection = state.rejection;
  if (state.rejected_by) row.rejected_by = search.models()[*state.rejected_by]->name();
  return row;
}

/// The search, as the options ask for it.
inline HierarchyOptions searchOptions(const TwoViewMotionOptions& options) {
  HierarchyOptions search = options.search;
  if (options.noise_is_known) search.choice.support.guard = 1;
  return search;
}

using TwoViewSearch = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;

/// A search to its end, or to that of `stop`.
inline TwoViewSearch searched(const TwoViewModels& models, const std::vector<Eigen::Vector4d>& matches,
                              const TwoViewMotionOptions& options) {
  TwoViewSearch search(models, searchOptions(options));
  search.add(matches);
  while (!(options.stop && options.stop()) && search.iterate(options.stop)) {
  }
  return search;
}

/// The search over the matches that move, where those that do not move are a motion of their own, as an overlay of the
/// image is: what is found without them explains less than half of them within the largest noise that is believed. An
/// epipolar geometry through both would be a mixture. `moving` are those that are left. Nothing where all matches are
/// of one motion.
inline std::optional<TwoViewSearch> besideStillMatches(const TwoViewSearch& all,
                                                       const std::vector<Eigen::Vector4d>& matches,
                                                       const TwoViewMotionOptions& options,
                                                       std::vector<Eigen::Vector4d>& moving) {
  const std::size_t none = all.nullModel();
  const auto& still_state = all.state(none);
  if (all.best() == none || !still_state.hasEstimate() || still_state.unsupported) return std::nullopt;
  std::vector<double> errors(matches.size());
  all.models()[none]->errors(still_state.estimate.parameter, matches, errors);
  std::vector<Eigen::Vector4d> still;
  moving.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    (errors[i] < still_state.threshold ? still : moving).push_back(matches[i]);
  }
  TwoViewSearch search = searched(all.models(), moving, options);
  const auto& state = search.state(search.best());
  if (search.best() == none || !state.hasEstimate() || state.unsupported) return std::nullopt;
  errors.resize(still.size());
  search.models()[search.best()]->errors(state.estimate.parameter, still, errors);
  const auto explained =
      std::count_if(errors.begin(), errors.end(), [&](double e) { return e < max_excess_noise * state.threshold; });
  if (2 * static_cast<std::size_t>(explained) >= still.size()) return std::nullopt;
  return search;
}

/// The search over the matches that no noise would bring close to the chosen model, where they are a quarter of all and
/// half of them follow a motion of their own: as many as that are found in few draws.
inline std::optional<TwoViewSearch> besideChosen(const TwoViewSearch& all, const std::vector<Eigen::Vector4d>& matches,
                                                 TwoViewMotionOptions options, std::vector<Eigen::Vector4d>& others) {
  constexpr std::size_t min_others = 20;
  const auto& state = all.state(all.best());
  if (!state.hasEstimate() || state.unsupported) return std::nullopt;
  std::vector<double> errors(matches.size());
  all.models()[all.best()]->errors(state.estimate.parameter, matches, errors);
  others.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (errors[i] >= max_excess_noise * state.threshold) others.push_back(matches[i]);
  }
  if (others.size() < std::max(min_others, matches.size() / 4)) return std::nullopt;
  options.search.min_share = std::max(options.search.min_share, 0.5);
  TwoViewSearch search = searched(all.models(), others, options);
  const auto& second = search.state(search.best());
  if (!second.hasEstimate() || second.unsupported || 2 * second.inliers.size() < others.size()) return std::nullopt;
  return search;
}

/// A part of several matches in words.
inline std::string shareInWords(std::size_t part, std::size_t all) {
  return std::to_string(part) + " of " + std::to_string(all) + " matches (" +
         std::to_string((200 * part + all) / (2 * all)) + " %)";
}

/// An estimate at the noise that the data show, where this exceeds the stated one: from the matches within the
/// threshold of that noise, with its covariance. Inliers of the stated noise would be a third of the right ones less at
/// twice the noise, of which the covariance knows nothing.
inline ModelEstimate<TwoViewMotionModel> atShownNoise(const TwoViewModel& model,
                                                      const ModelState<TwoViewMotionModel>& state,
                                                      std::span<const Eigen::Vector4d> matches,
                                                      const TwoViewMotionOptions& options) {
  ModelEstimate<TwoViewMotionModel> estimate = state.estimate;
  std::vector<double> errors(matches.size());
  const auto estimateWithin = [&](double threshold, bool is_final) {
    model.errors(estimate.parameter, matches, errors);
    std::vector<Eigen::Vector4d> within;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (errors[i] < threshold) within.push_back(matches[i]);
    }
    return is_final ? model.finalEstimate(estimate.parameter, within, options.stop)
                    : model.estimate(estimate.parameter, within, options.stop);
  };
  // Where a plane dominates the steps are many; the search does not wait for them.
  for (int more = 0; more < 5 && estimate.status == Status::not_converged; ++more) {
    if (options.stop && options.stop()) break;
    ModelEstimate<TwoViewMotionModel> next = estimateWithin(state.threshold, false);
    if (!next.usable()) break;
    estimate = std::move(next);
  }
  const double noise = options.noise_is_known ? 1 : std::max(state.excess_noise, 1.0);
  // Within this the stated threshold cuts off hardly more than it is meant to.
  constexpr double estimated_again = 1.3;
  if (estimate.usable()) {
    ModelEstimate<TwoViewMotionModel> last =
        estimateWithin(noise > estimated_again ? noise * state.threshold : state.threshold, true);
    if (last.usable()) {
      estimate = std::move(last);
    } else {
      estimate.status = last.status;
    }
  }
  RelativeCurvature shown = estimate.relative_curvature.at(std::sqrt(noise));
  // Every fifth pose whose covariance was widened by more was outside of its region (docs/two_view.md).
  shown.max_widening = 9;
  estimate.covariance *= noise * shown.widening() / estimate.relative_curvature.widening();
  estimate.information /= noise;
  estimate.relative_curvature = shown;
  if (estimate.status == Status::ok && shown.large()) estimate.status = Status::ill_defined;
  if (estimate.status != Status::ok) estimate.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  return estimate;
}

/// The parameters of the first motion that all others have, too: its values, and a covariance that covers each motion.
inline std::optional<PhysicalParameters> sharedParameters(const TwoViewMotionResult& first,
                                                          std::span<const TwoViewRival> others) {
  if (first.physical.empty()) return std::nullopt;
  const PhysicalParameters& own = first.physical[0];
  // For each motion the places of the shared ones.
  std::vector<std::vector<Eigen::Index>> places(others.size() + 1);
  PhysicalParameters shared;
  for (std::size_t i = 0; i < own.size(); ++i) {
    std::vector<Eigen::Index> at = {static_cast<Eigen::Index>(i)};
    for (const TwoViewRival& other : others) {
      if (other.physical.empty()) return std::nullopt;
      const auto& names = other.physical[0].names;
      const auto found = std::find(names.begin(), names.end(), own.names[i]);
      if (found != names.end()) at.push_back(found - names.begin());
    }
    if (at.size() != places.size()) continue;
    shared.names.push_back(own.names[i]), shared.units.push_back(own.units[i]);
    for (std::size_t k = 0; k < at.size(); ++k) places[k].push_back(at[k]);
  }
  const auto n = static_cast<Eigen::Index>(shared.size());
  if (n == 0) return std::nullopt;
  shared.values.resize(n), shared.covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) shared.values[i] = own.values[places[0][static_cast<std::size_t>(i)]];
  for (std::size_t k = 0; k < places.size(); ++k) {
    const PhysicalParameters& one = k == 0 ? own : others[k - 1].physical[0];
    const auto difference = [&](Eigen::Index i) {
      return one.values[places[k][static_cast<std::size_t>(i)]] - shared.values[i];
    };
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        const double covariance =
            one.covariance(places[k][static_cast<std::size_t>(i)], places[k][static_cast<std::size_t>(j)]);
        shared.covariance(i, j) += (covariance + difference(i) * difference(j)) / static_cast<double>(places.size());
      }
    }
  }
  return shared;
}

/// The least and the largest coordinate of all points along an axis. Those that lie ten times as far beyond the middle
/// eight tenths as these are wide are in no image: one of them would take the centre and the scale of all others away.
struct CoordinateRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;

  CoordinateRange(std::span<const Eigen::Vector4d> matches, Eigen::Index axis) {
    std::vector<double> all;
    for (const Eigen::Vector4d& m : matches) {
      if (m.allFinite()) all.push_back(m[axis]), all.push_back(m[2 + axis]);
    }
    if (all.empty()) return;
    std::sort(all.begin(), all.end());
    const double tenth = all[(all.size() - 1) / 10], last_tenth = all[all.size() - 1 - (all.size() - 1) / 10];
    const double reach = last_tenth > tenth ? 10 * (last_tenth - tenth) : std::numeric_limits<double>::infinity();
    low = *std::find_if(all.begin(), all.end(), [&](double x) { return x >= tenth - reach; });
    high = *std::find_if(all.rbegin(), all.rend(), [&](double x) { return x <= last_tenth + reach; });
  }
};

/// The cameras for which the matches speak instead of those as given, or as the priors allow; empty: none.
inline std::string refutedCameras(std::span<const TwoViewSuspectTest> tests) {
  std::string refuted = suspectsInWords(tests);
  for (const TwoViewSuspectTest& test : tests) {
    if (test.prior_sigma > 0 && test.significant) {
      refuted += (refuted.empty() ? "" : ", ") + test.inWords() + " against its prior";
    }
  }
  return refuted;
}

/// Matches as the models take them.
struct TwoViewInput {
  TwoViewImageFrame frame;
  Status status = Status::ok;
  std::string reason;                                ///< why there is nothing to estimate
  bool first_differ = false, second_differ = false;  ///< the points of the first image, and of the second
  TwoViewCoordinates first, second;
  bool same_camera = true;
  TwoViewCalibration calibration = TwoViewCalibration::uncalibrated;
  TwoViewModels models;
  std::array<double, 2> prior_sigmas = {};  ///< of focal lengths and k1
  std::vector<Eigen::Vector4d> normalised;
  std::vector<std::size_t> used;            ///< places of those that take part
  std::vector<std::size_t> first_of_equal;  ///< for each match the place of the first one that is equal to it

  TwoViewInput(std::span<const Eigen::Vector4d> matches, const TwoViewMotionOptions& options) {
    frame.matches = matches.size(), frame.sigma = options.sigma;
    frame.calibrated = options.first.has_value();
    same_camera = !options.second;
    prior_sigmas = {options.focal_length_sigma, options.k1_sigma};
    if (frame.calibrated) calibration = TwoViewCalibration::calibrated;
    // The size of the images: it says how likely wrong matches fit a model, and where the centre is.
    const Eigen::Vector4d* one = nullptr;
    for (const Eigen::Vector4d& m : matches) {
      if (!m.allFinite()) continue;
      if (one == nullptr) one = &m;
      first_differ = first_differ || m.head<2>() != one->head<2>();
      second_differ = second_differ || m.tail<2>() != one->tail<2>();
    }
    Eigen::Vector2d& size = frame.image_size;
    if (options.image_size) {
      size = *options.image_size;
    } else if (options.first && options.first->width > 0 && options.first->height > 0) {
      size = {options.first->width, options.first->height};
    } else if (one != nullptr) {
      // One match alone, or several on a line, leave no area.
      const CoordinateRange x(matches, 0), y(matches, 1);
      size = Eigen::Vector2d(x.high - x.low, y.high - y.low).cwiseMax(options.sigma);
      frame.size_from_matches = true;
      frame.image_corner = {x.low, y.low};
    }
    first = coordinatesOf(options.first, size, frame.image_corner);
    second = coordinatesOf(options.second ? options.second : options.first, size, frame.image_corner);
    const TwoViewImages images{{options.sigma / first.focalLength(), options.sigma / second.focalLength()},
                               size.cwiseQuotient(second.focal)};
    const TwoViewModelOptions lattice{calibration, options.nodes, options.verticals};
    models = options.planes_only ? homographyModels(images, lattice) : twoViewModels(images, lattice);
    take(matches, options, images.noise, one != nullptr);
  }
  bool ok() const { return status == Status::ok; }
  /// Why no answer is to be trusted, whatever it is; empty: nothing of that kind.
  std::string fault() const {
    if (!first_differ && !second_differ) return "all matches are the same one";
    if (!first_differ || !second_differ) return "all points of one image are the same one";
    return {};
  }
  /// The matches that take part.
  std::vector<Eigen::Vector4d> usedMatches() const {
    std::vector<Eigen::Vector4d> all;
    for (const std::size_t i : used) all.push_back(normalised[i]);
    return all;
  }

  /// The matches in the models' coordinates, or why not.
  void take(std::span<const Eigen::Vector4d> matches, const TwoViewMotionOptions& options, const MatchNoise& noise,
            bool any_finite) {
    if (!any_finite) return refuse(Status::too_few, "there is no finite match");
    if (!(options.sigma > 0) || !std::isfinite(options.sigma) || !frame.image_size.allFinite() ||
        !(frame.image_size.minCoeff() > 0)) {
      return refuse(Status::not_applicable, "noise and size of the images must be finite and positive");
    }
    for (const std::optional<Camera>& camera : {options.first, options.second}) {
      if (camera && !isPinhole(*camera)) {
        return refuse(Status::not_applicable,
                      "focal lengths of a camera must be finite and positive, its centre finite");
      }
    }
    if (!(options.focal_length_sigma >= 0 && options.focal_length_sigma < 1) ||
        !(options.k1_sigma >= 0 && options.k1_sigma < 1)) {
      return refuse(Status::not_applicable, "standard deviations of focal length and k1 must be in [0, 1)");
    }
    if (options.focal_length_sigma > 0 && !options.first) {
      return refuse(Status::not_applicable,
                    "a standard deviation of the focal length is one of cameras: none is given");
    }
    if (options.verticals && !(isDirection(options.verticals->first) && isDirection(options.verticals->second))) {
      return refuse(Status::not_applicable, "verticals must be finite and not zero");
    }
    if (!(options.search.outlier_share > 0 && options.search.outlier_share < 1)) {
      return refuse(Status::not_applicable, "the share of outliers beyond the threshold must be between 0 and 1");
    }
    CoordinateUnits units[2];
    for (const Eigen::Vector4d& m : matches) {
      Eigen::Vector4d& u = normalised.emplace_back();
      u << first(m.head<2>()), second(m.tail<2>());
      units[0].add(m.head<2>(), u.head<2>()), units[1].add(m.tail<2>(), u.tail<2>());
    }
    for (int k = 0; k < 2; ++k) {
      const auto& camera = k == 1 && options.second ? options.second : options.first;
      const CoordinateFault fault = camera ? units[k].fault(*camera) : CoordinateFault{};
      if (fault) return refuse(Status::not_applicable, fault.found + "; expected " + fault.expected);
    }
    used = independentMatches(normalised, noise, options.keep_contradictions);
    first_of_equal = firstOfEqualMatches(normalised);
    for (std::size_t i = 0; i < matches.size(); ++i) frame.repeated += first_of_equal[i] != i ? 1U : 0U;
    frame.contradicted = matches.size() - frame.repeated - used.size();
    if (std::none_of(used.begin(), used.end(), [&](std::size_t i) { return normalised[i].allFinite(); })) {
      const bool none = std::none_of(normalised.begin(), normalised.end(), [](const auto& u) { return u.allFinite(); });
      refuse(none ? Status::too_few : Status::ill_defined,
             none ? "the cameras see no match" : "all matches contradict each other");
    }
  }
  /// The tests of the cameras at an estimate.
  TwoViewCameraTests testCameras(const TwoViewModel& model, const ModelEstimate<TwoViewMotionModel>& estimate,
                                 std::span<const Eigen::Vector4d> agreeing) const {
    const MatchNoise noise{frame.sigma / first.focalLength(), frame.sigma / second.focalLength()};
    const Eigen::Matrix3d& matrix = estimate.parameter.matrix;
    return TwoViewSuspects(first, second, same_camera, noise, prior_sigmas)
        .test(matrix / matrix.norm(),
              covarianceInPixels(estimate, Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity()),
              model.freeParameters(), model.equations(), agreeing);
  }
  void refuse(Status why, const std::string& in_words) { status = why, reason = in_words; }
  static bool isPinhole(const Camera& camera) {
    return camera.fu > 0 && camera.fv > 0 && std::isfinite(camera.fu) && std::isfinite(camera.fv) &&
           std::isfinite(camera.cu) && std::isfinite(camera.cv);
  }
  static bool isDirection(const Eigen::Vector3d& v) { return v.allFinite() && !v.isZero(0); }

  /// Fills the result with the motion of an estimate, using the matches that agree with it. The priors of the cameras are
  /// in its covariances.
  void describe(const TwoViewModel& model, ModelEstimate<TwoViewMotionModel> estimate,
                std::span<const Eigen::Vector4d> agreeing, TwoViewMotionResult& result) const {
    std::vector<TwoViewCameraTests::Shift> shifts;
    if (prior_sigmas[0] > 0 || prior_sigmas[1] > 0) shifts = testCameras(model, estimate, agreeing).shifts;
    const Eigen::Matrix3d to_first = first.pixels().inverse(), K2 = second.pixels();
    const Eigen::Matrix3d to_second = model.equations() == 2 ? K2 : Eigen::Matrix3d(K2.inverse().transpose());
    const Eigen::Matrix3d in_pixels = to_second * estimate.parameter.matrix * to_first;
    result.matrix = in_pixels / in_pixels.norm();
    result.matrix_covariance = covarianceInPixels(estimate, to_second, to_first);
    // With longer focal lengths the same pixels have smaller coordinates.
    const Eigen::Matrix3d M = estimate.parameter.matrix / estimate.parameter.matrix.norm();
    const Eigen::Matrix3d flat = Eigen::Vector3d(1, 1, 0).asDiagonal();
    const Entries unit = entriesFrom(result.matrix);
    for (const TwoViewCameraTests::Shift& shift : shifts) {
      const double of_second = model.equations() == 2 ? shift.second_focal_length : -shift.second_focal_length;
      const Eigen::Matrix3d moved =
          matrixFrom(shift.entries) + of_second * flat * M - shift.first_focal_length * M * flat;
      Entries in_unit = entriesFrom(to_second * moved * to_first) / (to_second * M * to_first).norm();
      in_unit -= unit.dot(in_unit) * unit;
      result.matrix_covariance += in_unit * in_unit.transpose();
    }
    estimate.covariance = covarianceWithShifts(estimate, shifts);
    result.physical =
        physicalParameters(model.name(), estimate, agreeing, calibration, {first.focalLength(), second.focalLength()});
    result.relative_curvature = estimate.relative_curvature;
    if (estimate.covariance.rows() == 5) {
      result.relative_pose = Gaussian<Essentiald>{estimate.parameter.pose, estimate.covariance};
    }
  }
  /// The motion of another model, by its state in a search; its inliers are of `all`, its estimate is from `over`.
  TwoViewRival rival(const TwoViewModel& model, const ModelState<TwoViewMotionModel>& state,
                     std::span<const Eigen::Vector4d> all, std::span<const Eigen::Vector4d> over,
                     const TwoViewMotionOptions& options) const {
    std::vector<double> errors(all.size());
    model.errors(state.estimate.parameter, all, errors);
    std::vector<Eigen::Vector4d> inliers;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (errors[i] < state.threshold) inliers.push_back(all[i]);
    }
    TwoViewRival rival;
    rival.model = model.name(), rival.inliers = inliers.size(), rival.equations = model.equations();
    describe(model, atShownNoise(model, state, over, options), inliers, rival);
    return rival;
  }
};

inline std::string whyNoCovariance(const std::string& model, const ModelEstimate<TwoViewMotionModel>& estimate) {
  if (estimate.status != Status::ill_defined) return "the estimate of the chosen model did not converge";
  if (estimate.relative_curvature.large()) {
    return model + " is curved on the scale of the noise: no covariance of the matches would hold";
  }
  return "the covariance of " + model + " would rest on single matches that no other one confirms";
}

inline std::string notToldApart(const std::string& chosen, std::span<const TwoViewRival> rivals) {
  std::string text = "the matches do not tell apart " + chosen;
  for (const TwoViewRival& rival : rivals) text += (&rival == &rivals.back() ? " and " : ", ") + rival.model;
  return text;
}

}  // namespace detail

LIESTAT_FUSION_INLINE TwoViewMotionEstimate estimateTwoViewMotion(std::span<const Eigen::Vector4d> matches,
                                                                  const TwoViewMotionOptions& options) {
  const detail::TwoViewInput input(matches, options);
  TwoViewMotionEstimate result;
  static_cast<TwoViewImageFrame&>(result) = input.frame;
  result.status = input.status, result.reason = input.reason;
  result.errors.assign(matches.size(), std::numeric_limits<double>::quiet_NaN());
  result.inlier.assign(matches.size(), false);
  std::vector<Eigen::Vector4d> taking_part = result.ok() ? input.usedMatches() : std::vector<Eigen::Vector4d>{};
  detail::TwoViewSearch search = result.ok() ? detail::searched(input.models, taking_part, options)
                                             : detail::TwoViewSearch(input.models, HierarchyOptions{});
  std::vector<Eigen::Vector4d> moving;
  std::optional<detail::TwoViewSearch> beside_still =
      result.ok() ? detail::besideStillMatches(search, taking_part, options, moving) : std::nullopt;
  const bool is_beside_still = beside_still.has_value();
  if (is_beside_still) search = std::move(*beside_still), taking_part = std::move(moving);
  std::vector<Eigen::Vector4d> others;
  const std::optional<detail::TwoViewSearch> beside_chosen =
      result.ok() && !is_beside_still ? detail::besideChosen(search, taking_part, options, others) : std::nullopt;
  for (std::size_t m = 0; m < search.models().size(); ++m) {
    result.lattice.push_back(detail::rowOf(search, m, options.sigma));
  }
  result.chosen = search.best();
  if (!result.lattice.empty()) result.equations = result.chosenModel().equations;
  if (!result.ok()) return result;

  const ModelState<TwoViewMotionModel>& state = search.state(result.chosen);
  const TwoViewModel& model = *search.models()[result.chosen];
  if (!state.hasEstimate()) {
    result.status = Status::not_converged, result.reason = "stopped before there was an estimate";
    return result;
  }
  // Errors in the order of the matches; inliers are those of the threshold.
  model.errors(state.estimate.parameter, input.normalised, result.errors);
  std::vector<double> still_errors(matches.size(), std::numeric_limits<double>::infinity());
  const std::size_t none = search.nullModel();
  if (is_beside_still) search.models()[none]->errors({}, input.normalised, still_errors);
  const double still_threshold = search.state(none).threshold;
  std::size_t still = 0;
  std::vector<Eigen::Vector4d> agreeing, distinct;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const bool is_still = still_errors[i] < still_threshold;
    still += is_still;
    result.inlier[i] = !is_still && result.errors[i] < state.threshold;
    if (!result.inlier[i]) continue;
    agreeing.push_back(input.normalised[i]);
    if (input.first_of_equal[i] == i) distinct.push_back(input.normalised[i]);
  }
  result.inliers = agreeing.size(), result.threshold = state.threshold;
  const ModelEstimate<TwoViewMotionModel> estimate = detail::atShownNoise(model, state, taking_part, options);
  input.describe(model, estimate, agreeing, result);
  result.suspects = input.testCameras(model, estimate, distinct).tests;

  result.status = estimate.status;
  if (search.progress() != HierarchyState::terminated) {
    result.status = Status::not_converged, result.reason = "the search was stopped";
  } else if (!result.ok()) {
    result.reason = detail::whyNoCovariance(model.name(), estimate);
  } else if (!input.fault().empty()) {
    result.status = Status::ill_defined, result.reason = input.fault();
  } else if (state.unsupported) {
    result.status = Status::ill_defined;
    result.reason = "no model is supported: the inliers of the chosen one could be chance";
  } else if (is_beside_still) {
    result.status = Status::contested;
    result.reason = "two motions: " + detail::shareInWords(still, matches.size()) + " do not move, " +
                    detail::shareInWords(result.inliers, matches.size()) + " follow " + model.name();
    TwoViewRival& rival = result.rivals.emplace_back();
    rival.model = search.models()[none]->name(), rival.inliers = still, rival.equations = 2;
    ModelEstimate<TwoViewMotionModel> at_rest;
    input.describe(*search.models()[none], at_rest, {}, rival);
  } else if (beside_chosen) {
    const std::size_t m = beside_chosen->best();
    const TwoViewRival& rival = result.rivals.emplace_back(
        input.rival(*beside_chosen->models()[m], beside_chosen->state(m), input.normalised, others, options));
    result.status = Status::contested;
    result.reason = "two motions: " + detail::shareInWords(result.inliers, matches.size()) + " follow " + model.name() +
                    ", " + detail::shareInWords(rival.inliers, matches.size()) + " another " + rival.model;
  } else if (const std::vector<std::size_t> set = search.contested(); set.size() > 1) {
    for (auto m = set.begin() + 1; m != set.end(); ++m) {
      result.rivals.push_back(
          input.rival(*search.models()[*m], search.state(*m), input.normalised, taking_part, options));
    }
    result.status = Status::contested, result.reason = detail::notToldApart(model.name(), result.rivals);
    result.shared = detail::sharedParameters(result, result.rivals);
  } else if (const std::string suspected = detail::refutedCameras(result.suspects); !suspected.empty()) {
    result.status = Status::inconsistent, result.reason = "the matches speak for " + suspected;
  }
  return result;
}

LIESTAT_FUSION_INLINE TwoViewMotions estimateTwoViewMotions(std::span<const Eigen::Vector4d> matches,
                                                            const TwoViewMotionOptions& options, std::size_t most) {
  const detail::TwoViewInput input(matches, options);
  TwoViewMotions result;
  static_cast<TwoViewImageFrame&>(result) = input.frame;
  result.status = input.status, result.reason = input.reason;
  if (!input.ok()) {
    result.rest.resize(matches.size());
    std::iota(result.rest.begin(), result.rest.end(), std::size_t{0});
    return result;
  }
  RepeatedExtraction<Eigen::Vector4d, TwoViewMotionModel> search(
      input.models, input.usedMatches(), {.hierarchy = detail::searchOptions(options), .max_structures = most});
  while (!(options.stop && options.stop()) && search.iterate(options.stop)) {
  }
  std::vector<char> taken(matches.size(), 0);
  for (const auto& found : search.structures()) {
    const TwoViewModel& model = *input.models[found.model];
    std::vector<Eigen::Vector4d> own;
    std::vector<char> is_own(matches.size(), 0);
    for (const std::size_t i : found.inliers) {
      is_own[input.used[i]] = 1;
      own.push_back(input.normalised[input.used[i]]);
    }
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (is_own[input.first_of_equal[i]] != 0) places.push_back(i), taken[i] = 1;
    }
    std::vector<double> errors(own.size());
    model.errors(found.estimate.parameter, own, errors);
    const ModelFit fit{std::accumulate(errors.begin(), errors.end(), 0.0),
                       own.size() * static_cast<std::size_t>(model.equations()), model.freeParameters()};
    TwoViewStructure& structure = result.structures.emplace_back();
    structure.model = found.name, structure.equations = model.equations();
    ModelState<TwoViewMotionModel> state = found.state;
    state.estimate = found.estimate;
    const ModelEstimate<TwoViewMotionModel> estimate = detail::atShownNoise(model, state, own, options);
    structure.status = estimate.status, structure.inliers = std::move(places);
    structure.rms = options.sigma * std::sqrt(fit.normalised());
    input.describe(model, estimate, own, structure);
    structure.suspects = input.testCameras(model, estimate, own).tests;
    if (structure.status != Status::ok) {
      structure.reason = detail::whyNoCovariance(found.name, estimate);
      continue;
    }
    // A rival may have what is left to all motions.
    std::vector<Eigen::Vector4d> own_and_rest = own;
    for (const std::size_t i : search.rest()) own_and_rest.push_back(input.normalised[input.used[i]]);
    for (const auto& [m, its] : found.rivals) {
      structure.rivals.push_back(input.rival(*input.models[m], its, own_and_rest, own_and_rest, options));
    }
    if (!structure.rivals.empty()) {
      structure.status = Status::contested, structure.reason = detail::notToldApart(found.name, structure.rivals);
      structure.shared = detail::sharedParameters(structure, structure.rivals);
    } else if (const std::string suspected = detail::refutedCameras(structure.suspects); !suspected.empty()) {
      structure.status = Status::inconsistent, structure.reason = "the matches speak for " + suspected;
    }
  }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (taken[i] == 0) result.rest.push_back(i);
  }
  if (!search.terminated()) {
    result.status = Status::not_converged, result.reason = "the search was stopped";
  } else if (!input.fault().empty()) {
    result.status = Status::ill_defined, result.reason = input.fault();
  }
  for (std::size_t k = 0; k < result.structures.size() && result.status == Status::ok; ++k) {
    const TwoViewStructure& structure = result.structures[k];
    if (structure.status == Status::ok) continue;
    result.status = structure.status, result.reason = "motion " + std::to_string(k + 1) + ": " + structure.reason;
  }
  return result;
}

}  // namespace liestat
