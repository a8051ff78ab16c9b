// Motions that an epipolar geometry tells: families, equation and models of fusion/two_view/models.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/epipolar_type_model.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/detail/two_view_lattice.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/pose.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/essential.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The equation of F's entries.
struct EpipolarEquation {
  using Value = Eigen::Matrix<double, 1, 1>;
  Value operator()(const Entries& q, const Eigen::Vector4d& m) const {
    return Value(EpipolarForm(matrixFrom(q), m).value);
  }
  EquationDerivatives<1, 9, 4> linearize(const Entries& q, const Eigen::Vector4d& m) const {
    const EpipolarForm form(matrixFrom(q), m);
    return {Value(form.value), form.by_entries, form.by_match};
  }
};

/// Plane and parallax: a match off the plane of H lies on the line through its image under H and the epipole, so two
/// matches determine e' = (x₁' × H x₁) × (x₂' × H x₂) and F = [e']× H (R. Hartley and A. Zisserman, Multiple View
/// Geometry, section 13.3).
inline void planeAndParallax(const Eigen::Matrix3d& H, std::span<const Eigen::Vector4d> off,
                             std::vector<TwoViewMotionModel>& solutions) {
  const auto line = [&](const Eigen::Vector4d& m) {
    const Eigen::Vector3d first(m[0], m[1], 1), second(m[2], m[3], 1);
    return Eigen::Vector3d(second.cross(H * first));
  };
  const Eigen::Vector3d epipole = line(off[0]).cross(line(off[1]));
  const Eigen::Matrix3d F = skew(epipole) * H;
  const double norm = F.norm();
  if (norm > 0 && std::isfinite(norm)) solutions.emplace_back().matrix = F * (std::sqrt(2.0) / norm);
}

/// F under constraints.
class EpipolarModel : public EpipolarTypeModel {
 public:
  EpipolarModel(EpipolarFamily family, TwoViewSolver solver, TwoViewModelCard card, const TwoViewImages& images)
      : EpipolarTypeModel(std::move(card), images), constraint_{family}, solver_(solver) {}
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    solver_(sample, solutions);
  }
  /// An affine map determines an affine epipolar geometry up to the direction of its lines: one freedom.
  int freedomBeyond(const TwoViewModel& specific) const override {
    if (constraint_.family == EpipolarFamily::affine && specific.equations() == 2) return 1;
    return EpipolarTypeModel::freedomBeyond(specific);
  }
  std::size_t completionSize(const TwoViewModel& plane) const override {
    return constraint_.family == EpipolarFamily::fundamental && plane.name() == "homography" ? 2 : 0;
  }
  void complete(const TwoViewModel&, const Parameter& plane, std::span<const Measurement> off,
                std::vector<Parameter>& solutions) const override {
    planeAndParallax(plane.matrix, off, solutions);
  }
  ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers, const StopRequest& stop,
                               bool is_final) const override {
    const Entries q = entriesFrom(start.matrix) * (std::sqrt(2.0) / start.matrix.norm());
    return estimateTwoView<Entries, EpipolarConstraint, EpipolarEquation>(
        q, constraint_, inliers, images_.noise, stop, is_final,
        [](const Entries& found, Parameter& parameter) { parameter.matrix = matrixFrom(found); });
  }

 private:
  EpipolarConstraint constraint_;
  TwoViewSolver solver_;
};

/// A pose up to scale.
class EssentialModel : public EpipolarTypeModel {
 public:
  using EpipolarTypeModel::EpipolarTypeModel;
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    for (const Eigen::Matrix3d& E : solveEssential(sample)) solutions.emplace_back().matrix = E;
  }
  std::size_t completionSize(const TwoViewModel& plane) const override { return plane.name() == "homography" ? 2 : 0; }
  void complete(const TwoViewModel&, const Parameter& plane, std::span<const Measurement> off,
                std::vector<Parameter>& solutions) const override {
    planeAndParallax(plane.matrix, off, solutions);
  }
  ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers, const StopRequest& stop,
                               bool is_final) const override {
    return estimateTwoView<Essentiald, NoConstraint, PoseEquation>(
        toEssential(poseByCheirality(start.matrix, inliers).pose), {}, inliers, images_.noise, stop, is_final,
        [](const Essentiald& found, Parameter& parameter) {
          parameter.pose = found;
          parameter.matrix = found.essentialMatrix();
        });
  }
};

LIESTAT_FUSION_INLINE TwoViewModels epipolarModels(const TwoViewImages& images, const TwoViewModelOptions& options) {
  using Family = EpipolarFamily;
  const TwoViewLattice lattice(options);
  TwoViewModels models;
  const auto card = [&](const char* name, int free_parameters, std::size_t sample_size) {
    return TwoViewModelCard{name, lattice.parents(name), free_parameters, sample_size};
  };
  models.push_back(std::make_shared<EpipolarModel>(Family::translation, addSolutions<solveTranslation>,
                                                   card("translation", 2, 2), images));
  if (lattice.has("affine epipolar")) {
    models.push_back(std::make_shared<EpipolarModel>(Family::affine, addSolutions<solveAffineEpipolar>,
                                                     card("affine epipolar", 4, 4), images));
  }
  if (lattice.has("essential")) models.push_back(std::make_shared<EssentialModel>(card("essential", 5, 5), images));
  models.push_back(std::make_shared<EpipolarModel>(Family::fundamental, addSolutions<solveFundamental>,
                                                   card("fundamental", 7, 7), images));
  return models;
}

}  // namespace liestat::detail
