// A small hierarchy for tests: curves y = a + b x + c x² through points with noise in y.
#pragma once

#include <stats/hierarchy_types.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>
#include <Eigen/QR>

#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat_test {

using CurveModel = liestat::HierarchyModel<Eigen::Vector2d, Eigen::Vector3d>;

inline constexpr double curve_sigma = 0.05, curve_height = 10;

/// The coefficients of which bits are set are free.
class Curve : public CurveModel {
 public:
  Curve(std::string name, unsigned coefficients, std::vector<std::string> parents)
      : name_(std::move(name)), parents_(std::move(parents)) {
    for (int k = 0; k < 3; ++k) {
      if ((coefficients >> k) & 1u) powers_.push_back(k);
    }
  }
  std::string name() const override { return name_; }
  std::vector<std::string> parents() const override { return parents_; }
  int freeParameters() const override { return static_cast<int>(powers_.size()); }
  int equations() const override { return 1; }
  int measurementDimension() const override { return 1; }
  std::size_t sampleSize() const override { return powers_.size(); }
  double chance(double threshold) const override { return 2 * std::sqrt(threshold) * curve_sigma / (2 * curve_height); }

  void solve(std::span<const Eigen::Vector2d> sample, std::vector<Eigen::Vector3d>& solutions) const override {
    const Eigen::MatrixXd A = design(sample);
    if (!A.allFinite()) return;
    Eigen::Vector3d q = Eigen::Vector3d::Zero();
    if (!powers_.empty()) {
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
      if (qr.rank() < A.cols()) return;
      put(qr.solve(heights(sample)), q);
    }
    if (q.allFinite()) solutions.push_back(q);
  }
  void errors(const Eigen::Vector3d& q, std::span<const Eigen::Vector2d> points,
              std::span<double> squared) const override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = points[i].x(), e = points[i].y() - (q[0] + x * (q[1] + x * q[2]));
      squared[i] = e * e / (curve_sigma * curve_sigma);
    }
  }
  liestat::ModelEstimate<Eigen::Vector3d> estimate(const Eigen::Vector3d&, std::span<const Eigen::Vector2d> inliers,
                                                   const liestat::StopRequest& stop) const override {
    liestat::ModelEstimate<Eigen::Vector3d> result;
    result.parameter.setZero();
    ++estimates;
    if (stop && stop()) return result;
    if (inliers.size() < powers_.size()) {
      result.status = liestat::Status::too_few;
      return result;
    }
    if (!powers_.empty()) {
      const Eigen::MatrixXd A = design(inliers);
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
      if (qr.rank() < A.cols()) {
        result.status = liestat::Status::too_few;
        return result;
      }
      put(qr.solve(heights(inliers)), result.parameter);
      result.information = A.transpose() * A / (curve_sigma * curve_sigma);
      result.covariance = result.information.inverse();
    }
    std::vector<double> squared(inliers.size());
    errors(result.parameter, inliers, squared);
    result.chi2 = 0;
    for (const double e : squared) result.chi2 += e;
    result.degrees_of_freedom = static_cast<int>(inliers.size()) - freeParameters();
    result.status = liestat::Status::ok;
    return result;
  }

  mutable int estimates = 0;  // made so far

 private:
  Eigen::MatrixXd design(std::span<const Eigen::Vector2d> points) const {
    Eigen::MatrixXd A(points.size(), powers_.size());
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      for (Eigen::Index k = 0; k < A.cols(); ++k) {
        A(i, k) = std::pow(points[static_cast<std::size_t>(i)].x(), powers_[static_cast<std::size_t>(k)]);
      }
    }
    return A;
  }
  static Eigen::VectorXd heights(std::span<const Eigen::Vector2d> points) {
    Eigen::VectorXd y(points.size());
    for (Eigen::Index i = 0; i < y.size(); ++i) y[i] = points[static_cast<std::size_t>(i)].y();
    return y;
  }
  void put(const Eigen::VectorXd& values, Eigen::Vector3d& q) const {
    for (std::size_t k = 0; k < powers_.size(); ++k) q[powers_[k]] = values[static_cast<Eigen::Index>(k)];
  }

  std::string name_;
  std::vector<std::string> parents_;
  std::vector<int> powers_;
};

/// zero ⊂ constant, slope ⊂ line ⊂ parabola.
inline std::vector<std::shared_ptr<const CurveModel>> curveModels() {
  return {std::make_shared<Curve>("zero", 0b000, std::vector<std::string>{}),
          std::make_shared<Curve>("constant", 0b001, std::vector<std::string>{"zero"}),
          std::make_shared<Curve>("slope", 0b010, std::vector<std::string>{"zero"}),
          std::make_shared<Curve>("line", 0b011, std::vector<std::string>{"constant", "slope"}),
          std::make_shared<Curve>("parabola", 0b111, std::vector<std::string>{"line"})};
}

/// Points on a curve for x in [-3, 3], and points anywhere.
inline std::vector<Eigen::Vector2d> curvePoints(const Eigen::Vector3d& q, int inliers, int outliers,
                                                std::uint64_t seed) {
  liestat::CounterRng rng(seed, 5);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < inliers; ++i) {
    const double x = rng.uniform(-3, 3);
    points.emplace_back(x, q[0] + x * (q[1] + x * q[2]) + curve_sigma * rng.normal());
  }
  for (int i = 0; i < outliers; ++i) {
    const double x = rng.uniform(-3, 3);
    points.emplace_back(x, rng.uniform(-curve_height, curve_height));
  }
  return points;
}

}  // namespace liestat_test
