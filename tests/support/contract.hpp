// The contract's checks, compiled once for all tests (contract.cpp). A test pays for the record of its manifold's
// operations alone.
#pragma once

#include <lie/detail/contract_operations.hpp>
#include <lie/detail/contract_report.hpp>

namespace liestat_test {

/// liestat::checkContract with its default options.
liestat::ContractReport checkedContract(const liestat::ManifoldOperations& operations);

}  // namespace liestat_test
