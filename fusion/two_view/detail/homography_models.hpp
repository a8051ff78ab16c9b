// Motions that a homography tells: families, equation and models of fusion/two_view/models.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/detail/two_view_equations.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/detail/two_view_lattice.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/image_motion_solvers.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/rotation_solvers.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The parts that models of homographies have in common.
class HomographyTypeModel : public CardModel {
 public:
  using CardModel::CardModel;
  int equations() const override { return 2; }
  void errors(const Parameter& q, std::span<const Measurement> matches, std::span<double> squared) const override {
    homographyErrors(q.matrix, matches, images_.noise, squared);
  }
  /// The disc about the mapped point, of the whole image.
  double chance(double threshold) const override {
    const double variance = 0.5 * (std::pow(images_.noise.first, 2) + std::pow(images_.noise.second, 2));
    return std::min(1.0, 2 * std::numbers::pi * threshold * variance / (images_.size.x() * images_.size.y()));
  }
};

/// Nothing moves.
class NoMotionModel : public HomographyTypeModel {
 public:
  using HomographyTypeModel::HomographyTypeModel;
  void solve(std::span<const Measurement>, std::vector<Parameter>& solutions) const override {
    solutions.emplace_back();
  }
  ModelEstimate<Parameter> fit(const Parameter&, std::span<const Measurement> inliers, const StopRequest&,
                               bool) const override {
    ModelEstimate<Parameter> result;
    result.status = Status::ok;
    result.chi2 = 0, result.equation_error = 0;
    for (const Measurement& m : inliers) result.chi2 += homographyError(result.parameter.matrix, m, images_.noise);
    result.degrees_of_freedom = 2 * static_cast<int>(inliers.size());
    result.measurements = inliers.size();
    return result;
  }
};

class HomographyModel : public HomographyTypeModel {
 public:
  HomographyModel(HomographyFamily family, TwoViewSolver solver, TwoViewModelCard card, const TwoViewImages& images)
      : HomographyTypeModel(std::move(card), images), constraint_{family}, solver_(solver) {}
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    solver_(sample, solutions);
  }
  ModelEstimate<Parameter> fit(const Parameter& start, std::span<const Measurement> inliers, const StopRequest& stop,
                               bool is_final) const override {
    const Entries q = entriesFrom(start.matrix);
    return estimateTwoView<Entries, HomographyConstraint, HomographyEquation>(
        q, constraint_, inliers, images_.noise, stop, is_final,
        [](const Entries& found, Parameter& parameter) { parameter.matrix = matrixFrom(found); });
  }

 private:
  HomographyConstraint constraint_;
  TwoViewSolver solver_;
};

LIESTAT_FUSION_INLINE TwoViewModels homographyModels(const TwoViewImages& images, const TwoViewModelOptions& options) {
  using Family = HomographyFamily;
  const TwoViewLattice lattice(options);
  TwoViewModels models = {std::make_shared<NoMotionModel>(TwoViewModelCard{"none", {}, 0, 0}, images)};
  const auto add = [&](Family family, TwoViewSolver solver, const char* name, int free_parameters,
                       std::size_t sample_size) {
    if (!lattice.has(name)) return;
    models.push_back(std::make_shared<HomographyModel>(
        family, solver, TwoViewModelCard{name, lattice.parents(name), free_parameters, sample_size}, images));
  };
  add(Family::retinal_translation, addSolutions<solveRetinalTranslation>, "retinal translation", 2, 1);
  add(Family::zoom, addSolutions<solveZoom>, "zoom", 1, 1);
  add(Family::free_zoom, addSolutions<solveFreeZoom>, "free zoom", 3, 2);
  add(Family::retinal_displacement, addSolutions<solveRetinalDisplacement>, "retinal displacement", 3, 2);
  add(Family::similarity, addSolutions<solveSimilarity>, "similarity", 4, 2);
  add(Family::affine, addSolutions<solveAffine>, "affine", 6, 3);
  add(Family::rotation, addSolutions<solveRotation>, "rotation", 3, 2);
  add(Family::rotation_zoom, addSolutions<solveRotationZoom>, "rotation and zoom", 4, 2);
  add(Family::homography, addSolutions<solveHomography>, "homography", 8, 4);
  return models;
}

}  // namespace liestat::detail
