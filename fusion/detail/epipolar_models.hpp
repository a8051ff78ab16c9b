// Motions that an epipolar geometry tells: families, equation and models of fusion/two_view/models.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/detail/two_view_estimate.hpp>
#include <fusion/detail/two_view_lattice.hpp>
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

/// ũ'ᵀ F ũ = 0 and its derivatives by F's entries and by the match.
struct EpipolarForm {
  double value;
  Eigen::Matrix<double, 1, 9> by_entries;
  Eigen::Matrix<double, 1, 4> by_match;

  EpipolarForm(const Eigen::Matrix3d& F, const Eigen::Vector4d& m) {
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1);
    const Eigen::Vector3d Fu = F.col(0) * u[0] + F.col(1) * u[1] + F.col(2);
    value = v.dot(Fu);
    for (int k = 0; k < 3; ++k) by_entries.segment<3>(3 * k) = (u[k] * v).transpose();
    for (int k = 0; k < 2; ++k) by_match[k] = v.dot(F.col(k)), by_match[2 + k] = Fu[k];
  }
};

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
/// The same of a pose.
struct PoseEquation {
  using Value = Eigen::Matrix<double, 1, 1>;
  Value operator()(const Essentiald& q, const Eigen::Vector4d& m) const {
    return Value(EpipolarForm(q.essentialMatrix(), m).value);
  }
  EquationDerivatives<1, 5, 4> linearize(const Essentiald& q, const Eigen::Vector4d& m) const {
    const EpipolarForm form(q.essentialMatrix(), m);
    return {Value(form.value), product(form.by_entries, q.essentialMatrixJacobian()), form.by_match};
  }
};

/// The parts that models of epipolar geometries have in common.
class EpipolarTypeModel : public TwoViewModel {
 public:
  EpipolarTypeModel(TwoViewModelCard card, const TwoViewImages& images) : card_(std::move(card)), images_(images) {}
  std::string name() const override { return card_.name; }
  std::vector<std::string> parents() const override { return card_.parents; }
  int freeParameters() const override { return card_.free_parameters; }
  int equations() const override { return 1; }
  int measurementDimension() const override { return 4; }
  /// What a homography moves has the epipolar geometries [e']× H, for any epipole e'.
  int freedomBeyond(const TwoViewModel& specific) const override {
    const int more = std::max(0, freeParameters() - specific.freeParameters());
    return specific.equations() == 2 && freeParameters() > 2 ? 2 : more;
  }
  std::size_t sampleSize() const override { return card_.sample_size; }
  void errors(const Parameter& q, std::span<const Measurement> matches, std::span<double> squared) const override {
    epipolarErrors(q.matrix, matches, images_.noise, squared);
  }
  /// The band about an epipolar line, which crosses the image in a length of about 1.3 times its height.
  double chance(double threshold) const override {
    const double variance = 0.5 * (std::pow(images_.noise.first, 2) + std::pow(images_.noise.second, 2));
    const double height = std::min(images_.size.x(), images_.size.y());
    return std::min(1.0, 2 * 1.3 * std::sqrt(2 * threshold * variance) / height);
  }

 protected:
  TwoViewModelCard card_;
  TwoViewImages images_;
};

/// F under constraints.
class EpipolarModel : public EpipolarTypeModel {
 public:
  EpipolarModel(EpipolarFamily family, TwoViewSolver solver, TwoViewModelCard card, const TwoViewImages& images)
      : EpipolarTypeModel(std::move(card), images), constraint_{family}, solver_(solver) {}
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    solver_(sample, solutions);
  }
  /// Of an affine map there are affine epipolar geometries of any one direction of the lines.
  int freedomBeyond(const TwoViewModel& specific) const override {
    if (constraint_.family == EpipolarFamily::affine && specific.equations() == 2) return 1;
    return EpipolarTypeModel::freedomBeyond(specific);
  }
  ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                    const StopRequest& stop) const override {
    const Entries q = entriesFrom(start.matrix) * (std::sqrt(2.0) / start.matrix.norm());
    return estimateTwoView<Entries, EpipolarConstraint, EpipolarEquation>(
        q, constraint_, inliers, images_.noise, stop,
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
  ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                    const StopRequest& stop) const override {
    return estimateTwoView<Essentiald, NoConstraint, PoseEquation>(
        toEssential(poseByCheirality(start.matrix, inliers).pose), {}, inliers, images_.noise, stop,
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
