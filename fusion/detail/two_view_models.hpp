// The definition of fusion/two_view/models.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/models.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/essential.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se2.hpp>
#include <lie/so3.hpp>
#include <stats/constrained.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// The derivatives of a matrix's entries, column after column, by N coordinates.
template <int N>
using EntriesJacobian = Eigen::Matrix<double, 9, N>;
using Entries = Eigen::Matrix<double, 9, 1>;

inline Entries entriesOf(const Eigen::Matrix3d& M) { return Eigen::Map<const Entries>(M.data()); }
inline Eigen::Matrix3d matrixOf(const Entries& entries) { return Eigen::Map<const Eigen::Matrix3d>(entries.data()); }
inline double determinant(const Eigen::Matrix3d& M) { return M.col(0).dot(M.col(1).cross(M.col(2))); }

// The families of matrices. Each has its parameter Q, the constraint on it, the matrix of a parameter and its derivative
// by Q's tangent, and the parameter of a matrix.

struct RetinalTranslationFamily {
  using Q = Eigen::Vector2d;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
    H.topRightCorner<2, 1>() = q;
    return H;
  }
  static EntriesJacobian<2> jacobian(const Q&) {
    EntriesJacobian<2> J = EntriesJacobian<2>::Zero();
    J(6, 0) = J(7, 1) = 1;
    return J;
  }
  static Q from(const TwoViewMotionModel& motion) { return motion.matrix.topRightCorner<2, 1>(); }
};

struct ZoomFamily {
  using Q = Eigen::Matrix<double, 1, 1>;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
    H(0, 0) = H(1, 1) = std::exp(q[0]);
    return H;
  }
  static EntriesJacobian<1> jacobian(const Q& q) {
    EntriesJacobian<1> J = EntriesJacobian<1>::Zero();
    J(0, 0) = J(4, 0) = std::exp(q[0]);
    return J;
  }
  static Q from(const TwoViewMotionModel& motion) { return Q(std::log(motion.matrix(0, 0))); }
};

struct RetinalDisplacementFamily {
  using Q = SE2d;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) { return q.matrix(); }
  static EntriesJacobian<3> jacobian(const Q& q) {
    // q·Exp(a, θ): the shift moves by the turned a, the columns of the turn by θ times each other.
    const Eigen::Matrix3d H = q.matrix();
    EntriesJacobian<3> J = EntriesJacobian<3>::Zero();
    J.block<2, 2>(6, 0) = H.topLeftCorner<2, 2>();
    J.block<2, 1>(0, 2) = H.block<2, 1>(0, 1);
    J.block<2, 1>(3, 2) = -H.block<2, 1>(0, 0);
    return J;
  }
  static Q from(const TwoViewMotionModel& motion) {
    const Eigen::Matrix3d& H = motion.matrix;
    return SE2d(SO2d(std::atan2(H(1, 0), H(0, 0))), Eigen::Vector2d(H.topRightCorner<2, 1>()));
  }
};

struct RotationFamily {
  using Q = SO3d;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) { return q.matrix(); }
  static EntriesJacobian<3> jacobian(const Q& q) {
    // R (I + [v]×): column k moves by -R [e_k]× v.
    const Eigen::Matrix3d R = q.matrix();
    EntriesJacobian<3> J;
    for (int k = 0; k < 3; ++k) J.block<3, 3>(3 * k, 0) = -R * skew(Eigen::Vector3d(Eigen::Vector3d::Unit(k)));
    return J;
  }
  static Q from(const TwoViewMotionModel& motion) { return SO3d::fitToSO3(motion.matrix); }
};

/// ‖q‖² = Square.
template <int Square>
struct FixedNorm {
  Eigen::Matrix<double, 1, 1> operator()(const Entries& q) const {
    return Eigen::Matrix<double, 1, 1>(q.squaredNorm() - Square);
  }
  ConstraintDerivatives<1, 9> linearize(const Entries& q) const { return {(*this)(q), 2 * q.transpose()}; }
};

struct HomographyFamily {
  using Q = Entries;
  using Constraint = FixedNorm<3>;
  static Eigen::Matrix3d matrix(const Q& q) { return matrixOf(q); }
  static Q from(const TwoViewMotionModel& motion) {
    return entriesOf(motion.matrix) * (std::sqrt(3.0) / motion.matrix.norm());
  }
};

struct TranslationFamily {
  using Q = S2d;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) { return skew(q.unit_vector()); }
  static EntriesJacobian<2> jacobian(const Q& q) {
    const Eigen::Matrix3d A = ManifoldTraits<Q>::placement(q).matrix();
    EntriesJacobian<2> J;
    for (int k = 0; k < 2; ++k) J.col(k) = entriesOf(skew(Eigen::Vector3d(A.col(k))));
    return J;
  }
  static Q from(const TwoViewMotionModel& motion) {
    const Eigen::Matrix3d& F = motion.matrix;
    return S2d(Eigen::Vector3d(F(2, 1) - F(1, 2), F(0, 2) - F(2, 0), F(1, 0) - F(0, 1)));
  }
};

struct EssentialFamily {
  using Q = Essentiald;
  using Constraint = NoConstraint;
  static Eigen::Matrix3d matrix(const Q& q) { return q.essentialMatrix(); }
  static EntriesJacobian<5> jacobian(const Q& q) { return q.essentialMatrixJacobian(); }
  static Q from(const TwoViewMotionModel& motion) { return motion.pose; }
};

/// det F = 0, ‖F‖² = 2.
struct RankTwo {
  Eigen::Vector2d operator()(const Entries& q) const {
    return Eigen::Vector2d(determinant(matrixOf(q)), q.squaredNorm() - 2);
  }
  ConstraintDerivatives<2, 9> linearize(const Entries& q) const {
    const Eigen::Matrix3d F = matrixOf(q);
    ConstraintDerivatives<2, 9> result{(*this)(q), {}};
    for (int k = 0; k < 3; ++k) {
      result.by_parameter.block<1, 3>(0, 3 * k) = F.col((k + 1) % 3).cross(F.col((k + 2) % 3)).transpose();
    }
    result.by_parameter.row(1) = 2 * q.transpose();
    return result;
  }
};

struct FundamentalFamily {
  using Q = Entries;
  using Constraint = RankTwo;
  static Eigen::Matrix3d matrix(const Q& q) { return matrixOf(q); }
  static Q from(const TwoViewMotionModel& motion) {
    return entriesOf(motion.matrix) * (std::sqrt(2.0) / motion.matrix.norm());
  }
};

/// By the parameter of a family, of the derivatives by the entries.
template <class Family, int P>
auto byParameter(const Eigen::Matrix<double, P, 9>& by_entries, const typename Family::Q& q) {
  if constexpr (std::is_same_v<typename Family::Q, Entries>) {
    return by_entries;
  } else {
    return product(by_entries, Family::jacobian(q));
  }
}

/// (h₃·ũ) u' - (h₁·ũ, h₂·ũ) = 0.
template <class Family>
struct HomographyEquation {
  using Q = typename Family::Q;
  static constexpr int equations = 2;
  static Eigen::Vector2d value(const Eigen::Matrix3d& H, const Eigen::Vector4d& m) {
    const double w = H(2, 0) * m[0] + H(2, 1) * m[1] + H(2, 2);
    return {w * m[2] - (H(0, 0) * m[0] + H(0, 1) * m[1] + H(0, 2)),
            w * m[3] - (H(1, 0) * m[0] + H(1, 1) * m[1] + H(1, 2))};
  }
  Eigen::Vector2d operator()(const Q& q, const Eigen::Vector4d& m) const { return value(Family::matrix(q), m); }
  EquationDerivatives<2, ManifoldTraits<Q>::DoF, 4> linearize(const Q& q, const Eigen::Vector4d& m) const {
    const Eigen::Matrix3d H = Family::matrix(q);
    const double w = H(2, 0) * m[0] + H(2, 1) * m[1] + H(2, 2);
    Eigen::Matrix<double, 2, 9> J = Eigen::Matrix<double, 2, 9>::Zero();
    Eigen::Matrix<double, 2, 4> D = Eigen::Matrix<double, 2, 4>::Zero();
    for (int k = 0; k < 2; ++k) {
      const double u = m[2 + k];
      J(k, k) = -m[0], J(k, 3 + k) = -m[1], J(k, 6 + k) = -1;
      J(k, 2) = u * m[0], J(k, 5) = u * m[1], J(k, 8) = u;
      D(k, 0) = u * H(2, 0) - H(k, 0), D(k, 1) = u * H(2, 1) - H(k, 1), D(k, 2 + k) = w;
    }
    return {value(H, m), byParameter<Family, 2>(J, q), D};
  }
};

/// ũ'ᵀ F ũ = 0.
template <class Family>
struct EpipolarEquation {
  using Q = typename Family::Q;
  static constexpr int equations = 1;
  using Value = Eigen::Matrix<double, 1, 1>;
  static Value value(const Eigen::Matrix3d& F, const Eigen::Vector4d& m) {
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1);
    return Value(v.dot(F * u));
  }
  Value operator()(const Q& q, const Eigen::Vector4d& m) const { return value(Family::matrix(q), m); }
  EquationDerivatives<1, ManifoldTraits<Q>::DoF, 4> linearize(const Q& q, const Eigen::Vector4d& m) const {
    const Eigen::Matrix3d F = Family::matrix(q);
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1);
    Eigen::Matrix<double, 1, 9> J;
    for (int k = 0; k < 3; ++k) J.template segment<3>(3 * k) = (u[k] * v).transpose();
    Eigen::Matrix<double, 1, 4> D;
    for (int k = 0; k < 2; ++k) D[k] = v.dot(F.col(k)), D[2 + k] = F.row(k).dot(u);
    return {value(F, m), byParameter<Family, 1>(J, q), D};
  }
};

/// The projection estimate of a family's parameter.
template <class Family, class Equation>
ModelEstimate<TwoViewMotionModel> estimateTwoView(const TwoViewMotionModel& start,
                                                  std::span<const Eigen::Vector4d> inliers, const MatchNoise& noise,
                                                  const StopRequest& stop) {
  using Q = typename Family::Q;
  using Noise = DiagonalNoise<4>;
  const Noise sigma(Eigen::Vector4d(noise.first, noise.first, noise.second, noise.second));
  const MeasurementChannel<Eigen::Vector4d, Noise, Equation> matches{
      {inliers.begin(), inliers.end()}, {sigma}, {Equation{}}};
  ConstrainedOptions<Q> options;
  options.max_iterations = 50;
  ConstrainedEstimator<Q, typename Family::Constraint, MeasurementChannel<Eigen::Vector4d, Noise, Equation>> estimator(
      Family::from(start), {}, options, matches);
  ModelEstimate<TwoViewMotionModel> result;
  while (estimator.iterate()) {
    if (stop && stop()) estimator.stop();
  }
  const auto& found = estimator.result();
  result.status = found.status();
  result.parameter.matrix = Family::matrix(found.parameter);
  if constexpr (std::is_same_v<Q, Essentiald>) result.parameter.pose = found.parameter;
  result.information = found.information;
  result.covariance = found.covariance;
  result.chi2 = found.chi2;
  result.equation_error = found.equation_error;
  result.degrees_of_freedom = found.degrees_of_freedom;
  return result;
}

/// Of the four poses of an essential matrix the one that most matches lie in front of.
inline Essentiald poseInFront(const Eigen::Matrix3d& E, std::span<const Eigen::Vector4d> matches) {
  std::vector<Eigen::Vector3d> first, second;
  for (const Eigen::Vector4d& m : matches) {
    first.emplace_back(m[0], m[1], 1), second.emplace_back(m[2], m[3], 1);
  }
  const auto poses = decomposeEssential(E);
  return poses[chooseByCheirality(poses, second, first).best];
}

/// What each model of the lattice says of itself.
struct TwoViewModelCard {
  std::string name;
  std::vector<std::string> parents;
  int free_parameters = 0;
  std::size_t sample_size = 0;
};

/// The parts that models of homographies have in common.
class HomographyTypeModel : public TwoViewModel {
 public:
  HomographyTypeModel(TwoViewModelCard card, const TwoViewImages& images) : card_(std::move(card)), images_(images) {}
  std::string name() const override { return card_.name; }
  std::vector<std::string> parents() const override { return card_.parents; }
  int freeParameters() const override { return card_.free_parameters; }
  int equations() const override { return 2; }
  int measurementDimension() const override { return 4; }
  std::size_t sampleSize() const override { return card_.sample_size; }
  void errors(const Parameter& q, std::span<const Measurement> matches, std::span<double> squared) const override {
    homographyErrors(q.matrix, matches, images_.noise, squared);
  }
  /// The disc about the mapped point, of the whole image.
  double chance(double threshold) const override {
    const double variance = 0.5 * (std::pow(images_.noise.first, 2) + std::pow(images_.noise.second, 2));
    return std::min(1.0, 2 * std::numbers::pi * threshold * variance / (images_.size.x() * images_.size.y()));
  }

 protected:
  TwoViewModelCard card_;
  TwoViewImages images_;
};

/// Nothing moves.
class NoMotionModel : public HomographyTypeModel {
 public:
  using HomographyTypeModel::HomographyTypeModel;
  void solve(std::span<const Measurement>, std::vector<Parameter>& solutions) const override {
    solutions.emplace_back();
  }
  ModelEstimate<Parameter> estimate(const Parameter&, std::span<const Measurement> inliers,
                                    const StopRequest&) const override {
    ModelEstimate<Parameter> result;
    result.status = Status::ok;
    result.chi2 = 0, result.equation_error = 0;
    for (const Measurement& m : inliers) result.chi2 += homographyError(result.parameter.matrix, m, images_.noise);
    result.degrees_of_freedom = 2 * static_cast<int>(inliers.size());
    return result;
  }
};

template <class Family, auto solver>
class HomographyModel : public HomographyTypeModel {
 public:
  using HomographyTypeModel::HomographyTypeModel;
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    for (const Eigen::Matrix3d& H : solver(sample)) solutions.emplace_back().matrix = H;
  }
  ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                    const StopRequest& stop) const override {
    return estimateTwoView<Family, HomographyEquation<Family>>(start, inliers, images_.noise, stop);
  }
};

template <class Family, auto solver>
class EpipolarModel : public TwoViewModel {
 public:
  EpipolarModel(TwoViewModelCard card, const TwoViewImages& images) : card_(std::move(card)), images_(images) {}
  std::string name() const override { return card_.name; }
  std::vector<std::string> parents() const override { return card_.parents; }
  int freeParameters() const override { return card_.free_parameters; }
  int equations() const override { return 1; }
  int measurementDimension() const override { return 4; }
  std::size_t sampleSize() const override { return card_.sample_size; }
  void solve(std::span<const Measurement> sample, std::vector<Parameter>& solutions) const override {
    for (const Eigen::Matrix3d& F : solver(sample)) solutions.emplace_back().matrix = F;
  }
  void errors(const Parameter& q, std::span<const Measurement> matches, std::span<double> squared) const override {
    epipolarErrors(q.matrix, matches, images_.noise, squared);
  }
  ModelEstimate<Parameter> estimate(const Parameter& start, std::span<const Measurement> inliers,
                                    const StopRequest& stop) const override {
    if constexpr (std::is_same_v<typename Family::Q, Essentiald>) {
      Parameter posed = start;
      posed.pose = poseInFront(start.matrix, inliers);
      return estimateTwoView<Family, EpipolarEquation<Family>>(posed, inliers, images_.noise, stop);
    } else {
      return estimateTwoView<Family, EpipolarEquation<Family>>(start, inliers, images_.noise, stop);
    }
  }
  /// The band about an epipolar line, which crosses the image in a length of about 1.3 times its height.
  double chance(double threshold) const override {
    const double variance = 0.5 * (std::pow(images_.noise.first, 2) + std::pow(images_.noise.second, 2));
    const double height = std::min(images_.size.x(), images_.size.y());
    return std::min(1.0, 2 * 1.3 * std::sqrt(2 * threshold * variance) / height);
  }

 private:
  TwoViewModelCard card_;
  TwoViewImages images_;
};

}  // namespace detail

LIESTAT_FUSION_INLINE std::vector<std::shared_ptr<const TwoViewModel>> twoViewModels(const TwoViewImages& images,
                                                                                     TwoViewCalibration calibration) {
  using namespace detail;
  const bool calibrated = calibration == TwoViewCalibration::calibrated;
  std::vector<std::shared_ptr<const TwoViewModel>> models;
  const auto add = [&]<class Model>(std::type_identity<Model>, const char* name, std::vector<std::string> parents,
                                    int free_parameters, std::size_t sample_size) {
    if (!calibrated) std::erase_if(parents, [](const std::string& p) { return p == "rotation" || p == "essential"; });
    models.push_back(
        std::make_shared<Model>(TwoViewModelCard{name, std::move(parents), free_parameters, sample_size}, images));
  };
  add(std::type_identity<NoMotionModel>(), "none", {}, 0, 0);
  add(std::type_identity<HomographyModel<RetinalTranslationFamily, solveRetinalTranslation>>(), "retinal translation",
      {"none"}, 2, 1);
  add(std::type_identity<HomographyModel<ZoomFamily, solveZoom>>(), "zoom", {"none"}, 1, 1);
  add(std::type_identity<HomographyModel<RetinalDisplacementFamily, solveRetinalDisplacement>>(),
      "retinal displacement", {"retinal translation"}, 3, 2);
  if (calibrated) {
    add(std::type_identity<HomographyModel<RotationFamily, solveRotation>>(), "rotation", {"none"}, 3, 2);
  }
  add(std::type_identity<HomographyModel<HomographyFamily, solveHomography>>(), "homography",
      {"retinal displacement", "zoom", "rotation"}, 8, 4);
  add(std::type_identity<EpipolarModel<TranslationFamily, solveTranslation>>(), "translation",
      {"retinal translation", "zoom"}, 2, 2);
  if (calibrated) {
    add(std::type_identity<EpipolarModel<EssentialFamily, solveEssential>>(), "essential",
        {"translation", "rotation", "retinal displacement"}, 5, 5);
  }
  add(std::type_identity<EpipolarModel<FundamentalFamily, solveFundamental>>(), "fundamental",
      {"essential", "homography", "zoom", "translation"}, 7, 7);
  return models;
}

}  // namespace liestat
