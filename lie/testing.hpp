// Checkers of the manifold contract: the numbered invariants of lie/concepts.hpp as functions to run on any manifold,
// the library's or a user's own. They know no test framework: a report comes back.
//
//   const liestat::ContractReport report = liestat::checkContract<MyManifold>();
//   if (!report.ok()) std::cerr << report;
//
// Inputs are made of tangent vectors, whose angles are swept by decades from 1e-12 to the cut locus less 1e-12 (less
// 1e-5 in float), for it is at these ends that formulas fail. A coordinate counts as an angle when a whole turn along
// it comes back to the origin, as a logarithm (of a scale) when matrices grow exponentially along it, in which case it
// is swept to ±1; the others are lengths. The other inputs fill the tangent spaces evenly, always in the same way.
//
// Jacobians are compared with central differences of fourth order at the step h = eps^(1/5), where rounding, of some
// eps/h, and truncation, of some h^4, are of one size.
//
// The checks are functions of a record of M's operations, ManifoldOperations, so that they are compiled once and not
// once per manifold. A program that checks many manifolds includes lie/detail/contract_operations.hpp where it makes
// the records and this header in one unit (tests/support/contract.cpp does so).
#pragma once

#include <lie/detail/contract_group.hpp>
#include <lie/detail/contract_homogeneous.hpp>
#include <lie/detail/contract_metric.hpp>
#include <lie/detail/contract_operations.hpp>
#include <lie/detail/contract_statistics.hpp>

namespace liestat {

/// Everything that a manifold promises by the concepts which it satisfies. The single checks are functions of the same
/// arguments: checkGroup, checkPlacement, checkAction, checkExpLog, checkIsotropy, checkActionJacobians,
/// checkPlacementJacobian, checkExpLogJacobians, checkErrorVector, checkSecondDerivatives, checkPlacementIndependence,
/// checkMetric, checkInjectivityRadius, checkHessian, checkQuotient, checkStatisticsTraits. Each adds to the report, and does nothing if the
/// manifold does not have what it checks.
inline ContractReport checkContract(const ManifoldOperations& m, const ContractOptions& options = {}) {
  ContractReport report;
  for (const auto check : {checkGroup, checkPlacement, checkAction, checkExpLog, checkIsotropy, checkActionJacobians,
                           checkPlacementJacobian, checkExpLogJacobians, checkErrorVector, checkSecondDerivatives,
                           checkPlacementIndependence, checkMetric, checkInjectivityRadius, checkHessian, checkQuotient,
                           checkStatisticsTraits}) {
    check(m, report, options);
  }
  return report;
}

/// The same of a type: checkContract<MyManifold>().
template <Homogeneous M>
ContractReport checkContract(const ContractOptions& options = {}) {
  return checkContract(operationsOf<M>(), options);
}

}  // namespace liestat
