#pragma once

// The views of the subjects of `liestat validate`, each in the source of its name. They refer to their argument.

#include <cli/show/validation.hpp>

#include <vector>

namespace liestat::experiments {
struct EstimatorRow;
struct HandEyeRow;
struct MeansValidationResult;
struct MotionRow;
struct PreintegrationRow;
struct PropagationRow;
struct RobustValidationResult;
struct Table1Row;
struct TwoSolutions;
struct TwoViewPairsResult;
struct TwoViewRuleRow;
struct TwoViewValidationResult;
struct ViInitRow;
}  // namespace liestat::experiments

namespace liestat::cli {

ValidationView viewOf(const std::vector<experiments::EstimatorRow>& rows);
ValidationView viewOf(const std::vector<experiments::HandEyeRow>& rows);
ValidationView viewOf(const experiments::MeansValidationResult& result);
ValidationView viewOf(const std::vector<experiments::MotionRow>& rows);
ValidationView viewOf(const std::vector<experiments::PreintegrationRow>& rows);
ValidationView viewOf(const std::vector<experiments::PropagationRow>& rows);
ValidationView viewOf(const experiments::RobustValidationResult& result);
ValidationView viewOf(const experiments::TwoViewValidationResult& result);
ValidationView viewOf(const experiments::TwoViewPairsResult& result);
ValidationView viewOf(const std::vector<experiments::TwoViewRuleRow>& rows);
ValidationView viewOf(const std::vector<experiments::ViInitRow>& rows);
ValidationView viewOf(const std::vector<experiments::Table1Row>& rows);
ValidationView viewOf(const experiments::TwoSolutions& found);

}  // namespace liestat::cli
