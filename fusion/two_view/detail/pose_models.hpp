// Optional models whose parameter is a pose and what is known or unknown beside it: upright and shared focal length of
// fusion/two_view/models.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/epipolar_type_model.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/detail/two_view_lattice.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/shared_focal.hpp>
#include <fusion/two_view/upright.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/essential.hpp>
#include <lie/product.hpp>
#include <lie/rn.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace liestat::detail {

/// A pose up to scale that keeps the vertical.
class UprightModel : public EpipolarTypeModel {
 public:
  UprightModel(const TwoViewVerticals& verticals, TwoViewModelCard card, const TwoViewImages& images)
      : EpipolarTypeModel(std::move(card), images), verticals_(verticals), constraint_(verticals) {}
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    for (const Eigen::Matrix3d& E : solveEssentialUpright(sample, verticals_.first, verticals_.second)) {
      solutions.emplace_back().matrix = E;
    }
  }
  ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers, const StopRequest& stop,
                               bool is_final) const override {
    return estimateTwoView<Essentiald, UprightConstraint, PoseEquation>(
        poseOf(start.matrix, inliers), constraint_, inliers, images_.noise, stop, is_final,
        [](const Essentiald& found, Parameter& parameter) {
          parameter.pose = found;
          parameter.matrix = found.essentialMatrix();
        });
  }

 private:
  /// The pose with most matches in front, among those two of four that keep the vertical.
  Essentiald poseOf(const Eigen::Matrix3d& E, std::span<const Measurement> matches) const {
    const auto poses = posesOfEssential(E);
    const auto counts = poseByCheirality(E, matches).counts;
    const auto error = [&](std::size_t i) { return constraint_(toEssential(poses[i])).norm(); };
    if (poses.empty()) return Essentiald();
    // Those with the same rotation are the first and the last, and the two between.
    const bool outer = error(0) <= error(1);
    const std::size_t a = outer ? 0 : 1, b = outer ? 3 : 2;
    return toEssential(poses[counts[b] > counts[a] ? b : a]);
  }

  TwoViewVerticals verticals_;
  UprightConstraint constraint_;
};

/// A pose and log f.
using PoseAndFocal = Product<Essentiald, Eigen::Matrix<double, 1, 1>>;

inline SharedFocalMotion motionFrom(const PoseAndFocal& q) { return {q.get<0>(), std::exp(q.get<1>()[0])}; }

struct SharedFocalEquation {
  using Value = Eigen::Matrix<double, 1, 1>;
  Value operator()(const PoseAndFocal& q, const Eigen::Vector4d& m) const {
    return Value(EpipolarForm(fundamentalFromMotion(motionFrom(q)), m).value);
  }
  EquationDerivatives<1, 6, 4> linearize(const PoseAndFocal& q, const Eigen::Vector4d& m) const {
    const SharedFocalMotion motion = motionFrom(q);
    const EpipolarForm form(fundamentalFromMotion(motion), m);
    return {Value(form.value), product(form.by_entries, fundamentalJacobian(motion)), form.by_match};
  }
};

/// A pose up to scale and the focal length of both views.
class SharedFocalModel : public EpipolarTypeModel {
 public:
  using EpipolarTypeModel::EpipolarTypeModel;
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    for (const SharedFocalMotion& motion : solveSharedFocal(sample)) solutions.push_back(parameterOf(motion));
  }
  ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers, const StopRequest& stop,
                               bool is_final) const override {
    const double f = start.focal_length;
    const Eigen::Vector3d k(f, f, 1);
    const Eigen::Matrix3d E = k.asDiagonal() * start.matrix * k.asDiagonal();
    const CheiralPose chosen = poseByCheirality(E, inliers, 1e-12, {f, f});
    const PoseAndFocal q(toEssential(chosen.pose), Eigen::Matrix<double, 1, 1>(std::log(f)));
    ModelEstimate<Parameter> result = estimateTwoView<PoseAndFocal, NoConstraint, SharedFocalEquation>(
        q, {}, inliers, images_.noise, stop, is_final,
        [](const PoseAndFocal& found, Parameter& parameter) { parameter = parameterOf(motionFrom(found)); });
    if (result.status == Status::ill_defined) return result;
    if (result.status != Status::ok || !isTold(result, inliers)) {
      result = {};
      result.status = Status::not_applicable;
    }
    return result;
  }

 private:
  static Parameter parameterOf(const SharedFocalMotion& motion) {
    Parameter parameter;
    parameter.matrix = fundamentalFromMotion(motion);
    parameter.matrix *= std::sqrt(2 / parameter.matrix.squaredNorm());
    parameter.pose = motion.pose;
    parameter.focal_length = motion.focal_length;
    return parameter;
  }
  /// Largest standard deviation of log f for which the first-order covariance is still right; beyond it errors of ten
  /// standard deviations were found (docs/two_view.md).
  static constexpr double max_log_focal_sigma = 0.1;
  /// Standard deviations by which F33 must differ from zero: where it is zero the optical axes meet and f is free.
  static constexpr double min_axes_sigmas = 3;
  /// Fraction of matches on one plane from which the others, which outliers may be, do not determine f.
  static constexpr double max_planar_share = 0.9;

  /// True if the matches determine the focal length.
  bool isTold(const ModelEstimate<Parameter>& found, std::span<const Measurement> inliers) const {
    if (!(found.covariance(5, 5) <= max_log_focal_sigma * max_log_focal_sigma)) return false;
    const Eigen::Matrix<double, 1, 5> J = found.parameter.pose.essentialMatrixJacobian().row(entry(2, 2));
    const double apart = found.parameter.pose.essentialMatrix()(2, 2);
    const double variance = (J * found.covariance.topLeftCorner<5, 5>() * J.transpose())(0);
    return apart * apart > min_axes_sigmas * min_axes_sigmas * variance && !isPlanar(inliers);
  }
  /// True if a homography explains nearly all matches.
  bool isPlanar(std::span<const Measurement> inliers) const {
    constexpr double limit = 9.21;  // the 0.99 quantile of χ² with two degrees of freedom
    std::vector<Measurement> kept(inliers.begin(), inliers.end());
    std::vector<double> errors(inliers.size()), sorted;
    for (int pass = 0; pass < 4; ++pass) {
      const auto H = solveHomography(kept);
      if (H.empty()) return false;
      homographyErrors(H[0], inliers, images_.noise, errors);
      sorted = errors;
      const auto cut = sorted.begin() + static_cast<std::ptrdiff_t>(4 * sorted.size() / 5);
      std::nth_element(sorted.begin(), cut, sorted.end());
      const double bound = std::max(*cut, limit);
      kept.clear();
      for (std::size_t i = 0; i < inliers.size(); ++i) {
        if (errors[i] <= bound) kept.push_back(inliers[i]);
      }
    }
    const auto on = std::count_if(errors.begin(), errors.end(), [](double e) { return e <= limit; });
    return static_cast<double>(on) >= max_planar_share * static_cast<double>(errors.size());
  }
};

LIESTAT_FUSION_INLINE TwoViewModels poseModels(const TwoViewImages& images, const TwoViewModelOptions& options) {
  const TwoViewLattice lattice(options);
  TwoViewModels models;
  const auto card = [&](const char* name, int free_parameters, std::size_t sample_size) {
    return TwoViewModelCard{name, lattice.parents(name), free_parameters, sample_size};
  };
  if (lattice.has("upright")) {
    models.push_back(std::make_shared<UprightModel>(*options.verticals, card("upright", 3, 3), images));
  }
  if (lattice.has("shared focal length")) {
    models.push_back(std::make_shared<SharedFocalModel>(card("shared focal length", 6, 7), images));
  }
  return models;
}

}  // namespace liestat::detail
