// Score tests of what a motion between two images takes for known: the focal lengths and the lens distortion.
#pragma once

#include <fusion/two_view/detail/two_view_coordinates.hpp>
#include <fusion/two_view/detail/two_view_equations.hpp>
#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <fusion/two_view/two_view_types.hpp>
#include <stats/score_tests.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace liestat::detail {

/// The tests of the cameras at an estimate.
struct TwoViewCameraTests {
  std::vector<TwoViewSuspectTest> tests;
  /// The movement of the estimate's matrix, of norm one, that the priors of the cameras stand for: a standard deviation of
  /// each suspect; and by how much, relatively, the focal length of each image is then longer.
  struct Shift {
    Entries entries = Entries::Zero();
    double first_focal_length = 0, second_focal_length = 0;
  };
  std::vector<Shift> shifts;
};

/// The tests at an estimate from matches that agree with it. Each match gives one row for each equation: with
/// c(û) + D (u - û) = 0 at the point û of the model next to the measured u, the whitened c, its derivatives along the
/// free directions of the matrix, and those by the cameras, through the coordinates.
class TwoViewSuspects {
 public:
  /// `prior_sigmas`: of focal lengths and of k1, 0 where they are known.
  TwoViewSuspects(const TwoViewCoordinates& first, const TwoViewCoordinates& second, bool same_camera,
                  const MatchNoise& noise, const std::array<double, 2>& prior_sigmas)
      : images_{Image(first), Image(second)},
        same_camera_(same_camera),
        prior_sigmas_(prior_sigmas),
        noise_(noise.first, noise.first, noise.second, noise.second) {}

  /// `matrix` is H or F of norm one in the models' coordinates, as the matches are, with the covariance of its entries.
  /// None for a model without parameters, without a covariance, or with few matches.
  TwoViewCameraTests test(const Eigen::Matrix3d& matrix, const Eigen::MatrixXd& covariance, int free_parameters,
                          int equations, std::span<const Eigen::Vector4d> matches) const {
    const std::size_t most = matches.size() * static_cast<std::size_t>(equations);
    if (covariance.rows() != 9 || !covariance.allFinite() || free_parameters > max_free ||
        most < min_freedom + static_cast<std::size_t>(free_parameters)) {
      return {};
    }
    const SymmetricEigen spread(Eigen::Matrix<double, 9, 9>{covariance});
    // In standard deviations of the estimate; those that the model does not have are told by rows of their own.
    Eigen::Matrix<double, 9, max_free> directions = Eigen::Matrix<double, 9, max_free>::Zero();
    std::vector<TimedRow<1, columns>> rows;
    for (int k = 0; k < max_free; ++k) {
      if (k < free_parameters) {
        directions.col(k) = std::sqrt(std::max(0.0, spread.values[8 - k])) * spread.vectors.col(8 - k);
      } else {
        rows.emplace_back().values.setZero();
        rows.back().columns()(0, k) = 1;
      }
    }
    const Entries q = entriesFrom(matrix);
    for (const Eigen::Vector4d& u : matches) {
      if (equations == 2) {
        addRows<2>(
            HomographyEquation{}.linearize(q, u), [&](const auto& at) { return HomographyEquation{}.linearize(q, at); },
            u, directions, rows);
      } else {
        const auto linearize = [&](const Eigen::Vector4d& at) {
          const EpipolarForm form(matrix, at);
          return EquationDerivatives<1, 9, 4>{Eigen::Matrix<double, 1, 1>(form.value), form.by_entries, form.by_match};
        };
        addRows<1>(linearize(u), linearize, u, directions, rows);
      }
    }
    // As in the covariance, the noise is not less than stated.
    ScoreTestOptions<suspects> options;
    for (std::size_t k = 0; k < suspects; ++k) {
      if (!same_camera_ || k % 2 == 0) options.prior_sigmas[k] = prior_sigmas_[k / 2];
    }
    const auto found = scoreTests<1, max_free, suspects>(std::move(rows), options);
    TwoViewCameraTests result;
    for (int k = 0; k < suspects; ++k) {
      if (same_camera_ && k % 2 == 1) continue;
      TwoViewSuspectTest& test = result.tests.emplace_back();
      // An estimate whose standard deviation is the whole quantity comes of rounding alone.
      if (found.suspects[static_cast<std::size_t>(k)].sigma < 1) {
        static_cast<SuspectTest&>(test) = found.suspects[static_cast<std::size_t>(k)];
        test.shift = found.shifts.col(k).norm();
      }
      test.name = k < 2 ? "focal length" : "k1";
      if (!same_camera_) test.name += k % 2 == 0 ? " of the first camera" : " of the second camera";
      test.unit = k < 2 ? "" : "1";
      test.prior_sigma = options.prior_sigmas[static_cast<std::size_t>(k)];
      if (!(test.prior_sigma > 0)) continue;
      auto& shift = result.shifts.emplace_back();
      shift.entries = test.prior_sigma * directions * found.shifts.col(k);
      if (k == 0) shift.first_focal_length = test.prior_sigma;
      if (k == 1 || (k == 0 && same_camera_)) shift.second_focal_length = test.prior_sigma;
    }
    return result;
  }

 private:
  /// Focal length and k1 of the first image, or of both, and of the second.
  static constexpr int suspects = 4, max_free = 8, columns = max_free + suspects;
  /// Degrees of freedom below which a motion itself says little.
  static constexpr std::size_t min_freedom = 20;
  static constexpr double max_leverage = 0.5;

  /// The coordinates of an image, as given and with a camera that is a little different.
  struct Image {
    static constexpr double step = 1e-4;
    TwoViewCoordinates given;
    std::array<std::array<TwoViewCoordinates, 2>, 2> moved;  ///< of focal length and k1, forth and back

    explicit Image(const TwoViewCoordinates& of)
        : given(of),
          moved{{{of.withFocalLength(1 + step), of.withFocalLength(1 - step)},
                 {of.withDistortion(step), of.withDistortion(-step)}}} {
      // Without cameras no coordinate depends on a focal length.
      if (!of.camera) moved[0] = {of, of};
    }
    Eigen::Vector2d derivative(std::size_t suspect, const Eigen::Vector2d& u) const {
      const Eigen::Vector2d pixel = given.pixel(u);
      const Eigen::Vector2d difference = moved[suspect][0](pixel) - moved[suspect][1](pixel);
      return difference.allFinite() ? Eigen::Vector2d(difference / (2 * step)) : Eigen::Vector2d(0, 0);
    }
  };

  /// The movement of a match's coordinates per unit of each suspect. At measured points the noise would be in it, and
  /// pass for the effect of a suspect that the motion makes up for.
  Eigen::Matrix<double, 4, suspects> coordinateDerivatives(const Eigen::Vector4d& u) const {
    Eigen::Matrix<double, 4, suspects> D = Eigen::Matrix<double, 4, suspects>::Zero();
    for (int image = 0; image < 2; ++image) {
      for (int k = 0; k < 2; ++k) {
        D.block<2, 1>(2 * image, 2 * k + (same_camera_ ? 0 : image)) =
            images_[static_cast<std::size_t>(image)].derivative(static_cast<std::size_t>(k), u.segment<2>(2 * image));
      }
    }
    return D;
  }
  /// The rows of a match, at the point next to it that obeys the equations.
  template <int E, class Linearize>
  void addRows(const EquationDerivatives<E, 9, 4>& at_match, const Linearize& linearize, const Eigen::Vector4d& u,
               const Eigen::Matrix<double, 9, max_free>& directions, std::vector<TimedRow<1, columns>>& rows) const {
    const Eigen::Vector4d variances = noise_.cwiseAbs2();
    const auto factorOf = [&](const EquationDerivatives<E, 9, 4>& at) {
      const Eigen::Matrix<double, E, 4> half = at.by_measurement * noise_.asDiagonal();
      return Cholesky<double, E>(half * half.transpose());
    };
    const Eigen::Vector4d back = variances.cwiseProduct(at_match.by_measurement.transpose() *
                                                        factorOf(at_match).template solve<1>(at_match.value));
    const EquationDerivatives<E, 9, 4> at = linearize(u - back);
    const Cholesky<double, E> factor = factorOf(at);
    const Eigen::Matrix<double, E, max_free> by_parameters =
        factor.template halfSolve<max_free>(at.by_parameter * directions);
    if (by_parameters.squaredNorm() > max_leverage) return;
    const Eigen::Matrix<double, E, 1> residual = factor.template halfSolve<1>(at.value + at.by_measurement * back);
    const Eigen::Matrix<double, E, suspects> by_cameras =
        factor.template halfSolve<suspects>(at.by_measurement * coordinateDerivatives(u - back));
    for (int k = 0; k < E; ++k) {
      TimedRow<1, columns>& row = rows.emplace_back();
      row.residual()(0) = residual[k];
      row.columns() << by_parameters.row(k), by_cameras.row(k);
    }
  }

  std::array<Image, 2> images_;
  bool same_camera_;
  std::array<double, 2> prior_sigmas_;
  Eigen::Vector4d noise_;
};

}  // namespace liestat::detail
