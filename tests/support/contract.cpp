#include <support/contract.hpp>

#include <lie/testing.hpp>

namespace liestat_test {

liestat::ContractReport checkedContract(const liestat::ManifoldOperations& operations) {
  return liestat::checkContract(operations);
}

}  // namespace liestat_test
