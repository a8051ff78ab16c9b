// Members shared by the models of epipolar geometries.
#pragma once

#include <fusion/two_view/detail/two_view_equations.hpp>
#include <fusion/two_view/detail/two_view_estimate.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/models.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/essential.hpp>
#include <stats/constrained_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The equation of a pose.
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

/// The further parts of models of epipolar geometries.
class EpipolarTypeModel : public CardModel {
 public:
  using CardModel::CardModel;
  int equations() const override { return 1; }
  /// Matches of a homography H satisfy [e']× H for any epipole e': two freedoms.
  int freedomBeyond(const TwoViewModel& specific) const override {
    const int more = std::max(0, freeParameters() - specific.freeParameters());
    return specific.equations() == 2 && freeParameters() > 2 ? 2 : more;
  }
  void errors(const Parameter& q, std::span<const Measurement> matches, std::span<double> squared) const override {
    epipolarErrors(q.matrix, matches, images_.noise, squared);
  }
  /// The band about an epipolar line, which crosses the image in a length of about 1.3 times its height.
  double chance(double threshold) const override {
    const double variance = 0.5 * (std::pow(images_.noise.first, 2) + std::pow(images_.noise.second, 2));
    const double height = std::min(images_.size.x(), images_.size.y());
    return std::min(1.0, 2 * 1.3 * std::sqrt(2 * threshold * variance) / height);
  }
};

}  // namespace liestat::detail
