// Curves, surfaces and maps through noisy points, with their covariance: constrained estimates (stats/constrained.hpp)
// with the equations, constraints and starts of the common models. Needs Eigen alone.
//
//   const auto ellipse = liestat::fitEllipse(points, 0.02);
//   if (ellipse.ok()) std::cout << ellipse.parameter.transpose() << "\n" << ellipse.covariance << "\n";
//
// Every coordinate of every point is noisy, with one standard deviation; distances are orthogonal ones. Points are in
// whatever unit; the fit does not depend on it, nor on the origin. Nothing throws: an end that is not `converged` says
// why there is no covariance.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/compiled.hpp>

#include <Eigen/Core>

#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

/// A model fitted to points. Covariances are first order, of coordinates that a constraint ties (a unit normal)
/// singular.
template <int N>
struct Fit {
  ConstrainedEnd end = ConstrainedEnd::too_few;
  Eigen::Matrix<double, N, 1> parameter = Eigen::Matrix<double, N, 1>::Zero();
  Eigen::Matrix<double, N, N> covariance =
      Eigen::Matrix<double, N, N>::Constant(std::numeric_limits<double>::quiet_NaN());
  double sigma = 0;  ///< standard deviation of a coordinate: the stated one, or that of the residuals
  double chi2 = std::numeric_limits<double>::quiet_NaN();  ///< Σ of squared corrections over sigma²
  int degrees_of_freedom = 0;
  double fit_p = std::numeric_limits<double>::quiet_NaN();  ///< probability of a larger χ²; NaN without a stated sigma
  int iterations = 0;
  RelativeCurvature relative_curvature = {};  ///< of the equations in which the model is fitted
  double widening = 1;                        ///< the factor of the covariance that it asks for, in `covariance`
  /// Distance of each point from the model, in the points' unit; of a match, in the four coordinates of both points.
  std::vector<double> distances = {};

  Status status() const { return statusOf(end); }
  bool ok() const { return end == ConstrainedEnd::converged; }
};

/// An ellipse that does not refute the circle at this level has no axes to first order: 35 of 100 circles had the truth
/// outside of the region (docs/constrained.md, "Fits").
inline constexpr double circle_level = 0.01;

/// Options of the fits.
struct FitOptions {
  StatedNoise noise = StatedNoise::tested;  ///< what becomes of a stated sigma that χ² refutes
  int max_iterations = 100;
};

using Points2 = std::span<const Eigen::Vector2d>;
using Points3 = std::span<const Eigen::Vector3d>;
/// Matches x, y in the first image and x, y in the second.
using PointMatches = std::span<const Eigen::Vector4d>;

// Without a sigma it is that of the residuals, √(Σ corrections²/degrees of freedom), and nothing tests it.

/// A circle: centre and radius. Three points at least; on a short arc they say little, and the end says so.
LIESTAT_ESTIMATION_API Fit<3> fitCircle(Points2 points, std::optional<double> sigma = {},
                                        const FitOptions& options = {});
/// A sphere: centre and radius.
LIESTAT_ESTIMATION_API Fit<4> fitSphere(Points3 points, std::optional<double> sigma = {},
                                        const FitOptions& options = {});
/// A line of the plane, n·m + d = 0: unit normal n and d.
LIESTAT_ESTIMATION_API Fit<3> fitLine(Points2 points, std::optional<double> sigma = {}, const FitOptions& options = {});
/// A plane, n·m + d = 0: unit normal n and d.
LIESTAT_ESTIMATION_API Fit<4> fitPlane(Points3 points, std::optional<double> sigma = {},
                                       const FitOptions& options = {});
/// A line of space: its point nearest to the origin, and its unit direction.
LIESTAT_ESTIMATION_API Fit<6> fitLine3(Points3 points, std::optional<double> sigma = {},
                                       const FitOptions& options = {});
/// A conic, a x² + b xy + c y² + d x + e y + f = 0: coefficients of unit length, a + c ≥ 0.
LIESTAT_ESTIMATION_API Fit<6> fitConic(Points2 points, std::optional<double> sigma = {},
                                       const FitOptions& options = {});
/// An ellipse: centre, semi-axes (the longer one first), angle of the longer one against x in (-π/2, π/2], rad. The end
/// is `contradictory` if the conic through the points is none, and `curved` if a circle is not refuted at
/// `circle_level`: the axes of a circle have no angle.
LIESTAT_ESTIMATION_API Fit<5> fitEllipse(Points2 points, std::optional<double> sigma = {},
                                         const FitOptions& options = {});
/// A homography H, x₂ ∝ H x₁, row by row, of unit length; its largest entry is positive. Four matches at least.
LIESTAT_ESTIMATION_API Fit<9> fitHomography(PointMatches matches, std::optional<double> sigma = {},
                                            const FitOptions& options = {});
/// A fundamental matrix F, x₂ᵀ F x₁ = 0, row by row, of unit length and rank two; its largest entry is positive. Eight
/// matches at least for the start.
LIESTAT_ESTIMATION_API Fit<9> fitFundamental(PointMatches matches, std::optional<double> sigma = {},
                                             const FitOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <stats/detail/fits.hpp>
#endif
