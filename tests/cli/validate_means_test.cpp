// Output of `liestat validate means` on its verdict; the verdict itself: tests/experiments/means_validation_test.cpp.

#include <cli/show/means_validation.hpp>

#include <gtest/gtest.h>

#include <support/means_validations.hpp>

#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

TEST(ValidateMeans, anyNumberOfTrialsPasses) {
  for (const std::size_t trials : {1U, 3U, 10U, 40U}) {
    MeansValidation validation;
    validation.n = {5, 10};
    validation.trials = trials;
    validation.seed = 3;
    const std::vector<MeansRow> rows = validateMeans(validation);
    EXPECT_EQ(formatMeansTables(rows).find("FAILED"), std::string::npos) << formatMeansTables(rows);
  }
}

TEST(ValidateMeans, whatIsJudgedIsCounted) {
  MeansValidation validation = liestat_test::mahaOnFrames();
  validation.trials = 20;
  validation.n = {5, 10};
  std::size_t judged = 0;
  const std::vector<MeansRow> rows = validateMeans(validation);
  for (const MeansRow& row : rows) {
    // The domain of MAHA on frames begins at ten measurements; the report's formulas are not judged.
    EXPECT_EQ(row.passed.has_value(), row.method.corrected && row.experiment.n == 10);
    judged += row.passed.has_value();
  }
  EXPECT_EQ(judged, 2U);
  EXPECT_NE(formatMeansTables(rows).find("2 of 2 rows in the promised domain pass"), std::string::npos);
}

}  // namespace
}  // namespace liestat::cli
