#pragma once

// Views of `liestat validate` that more than one source needs. They refer to their argument.

#include <cli/show/validation.hpp>

#include <vector>

namespace liestat::experiments {
struct Table1Row;
struct TwoSolutions;
struct TwoViewPairsResult;
struct ViInitRow;
}  // namespace liestat::experiments

namespace liestat::cli {

ValidationView viewOf(const experiments::TwoViewPairsResult& result);
ValidationView viewOf(const std::vector<experiments::ViInitRow>& rows);
ValidationView viewOf(const std::vector<experiments::Table1Row>& rows);
ValidationView viewOf(const experiments::TwoSolutions& found);

}  // namespace liestat::cli
