// The record of a manifold's operations on which the contract's checks work. The checks are ordinary functions of this
// record, compiled once for all manifolds; detail/contract_operations.hpp makes the record of a manifold.
//
// Points and group elements are opaque handles. Tangent vectors and matrices are those of the manifold's scalar,
// carried in double: a float is a double, so nothing is lost on the way out, and `rounded` tells what is lost on the
// way in.
#pragma once

#include <lie/concepts.hpp>

#include <Eigen/Core>

#include <functional>
#include <memory>
#include <vector>

namespace liestat {
namespace detail {

/// A value of a type that its holder does not know. Tag keeps points and group elements apart.
template <class Tag>
class ContractHandle {
 public:
  template <class T>
  static ContractHandle of(const T& value) {
    ContractHandle handle;
    handle.value_ = std::shared_ptr<const void>(new T(value));
    return handle;
  }
  template <class T>
  const T& as() const {
    return *static_cast<const T*>(value_.get());
  }

 private:
  std::shared_ptr<const void> value_;
};

}  // namespace detail

/// The operations of a manifold M and of the group that acts on it, without their types. What M does not have is empty.
struct ManifoldOperations {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  using Point = detail::ContractHandle<struct PointTag>;
  using Element = detail::ContractHandle<struct ElementTag>;
  template <class Result, class... Arguments>
  using Function = std::function<Result(const Arguments&...)>;

  /// The group that acts on M.
  struct Group {
    int dimension = 0;
    Function<Element> identity;
    Function<Element, Element, Element> product;
    Function<Element, Element> inverse;
    Function<Element, Vector> exp;
    Function<Vector, Element> log;
    Function<Matrix, Element> Adj;
    Function<Matrix, Vector> leftJacobian, leftJacobianInverse, rightJacobian, rightJacobianInverse;
    // Optional.
    Function<Matrix, Vector> ad;
    Function<Matrix, Element> matrix;
    Function<Matrix, Vector> hat;
    Function<Vector, Matrix> vee;
  } group;

  int dimension = 0;
  double epsilon = 0;                ///< ε of the scalar
  Function<Vector, Vector> rounded;  ///< to the nearest numbers of the scalar

  // Homogeneous.
  Function<Point> origin;
  Function<Point, Element, Point> act;
  Function<Element, Point> placement;
  Function<Point, Vector> expOrigin;
  Function<Vector, Point> logOrigin;
  Function<Matrix, Vector> dexpOrigin;
  Function<Matrix, Point> dlogOrigin;
  Function<Matrix, Element, Point> isotropy;
  Function<Matrix> originProjection;
  Function<Matrix, Point> placementJacobian;
  Function<bool, Point> isPlacementSmooth;

  // Derived by lie/manifold.hpp from these. The base's Jacobian takes dlogOrigin(p) itself.
  Function<Point, Point, Vector> exp;
  Function<Vector, Point, Point> log;
  Function<Matrix, Element, Point> actionFeatureJacobian, actionTransformationJacobian;
  Function<Matrix, Point> principalChartJacobian, logBaseJacobian;
  Function<Matrix, Point, Point> frameTransport;
  Function<Vector, Point, Point> errorVector;
  Function<Matrix, Point, Point> errorByFeature, errorByBase;

  // Metric.
  Function<double, Point, Point> distance;
  Function<Vector> metricWeights;
  Function<double> injectivityRadius;
  Function<Matrix, Vector> hessianHalfSquaredDistance;

  // Quotient.
  std::vector<int> representatives;
  Function<Point, Point, int> representative;
  Function<Matrix, int> representativeJacobian;
  Function<double, Point> representativeGap;  ///< gap of nearestRepresentative

  // Optional: derivatives of dlogOrigin (see checkSecondDerivatives).
  Function<Matrix, Vector, Vector> dlogFeatureTransposed, dlogBaseTransposed;

  /// The operations that the traits offer to statistics; those that they lack are empty.
  struct Statistics {
    CompactFactor compact_factor = CompactFactor::unknown;
    int compact_begin = 0;
    Function<Vector, Point> compactCoordinates, parameters;
    /// The mean of weighted points; none if they cancel.
    Function<std::vector<Point>, std::vector<Point>, Vector> chordalMean;
    std::vector<TangentBlock> tangent_parts;
    Function<Point, Point> throughMetricTwin, throughFactors;  ///< there and back
    std::vector<int> factor_sizes;
    Function<Vector, Point, Point> factorDistances;
  } statistics;
};

}  // namespace liestat
