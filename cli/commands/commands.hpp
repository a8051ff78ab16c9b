#pragma once

#include <cli/commands/command_line.hpp>

namespace liestat::cli {

// Each declares a command with its options and its work, in the source of its name.

void addMeanCommand(const CommandList& program);
void addMotionCommand(const CommandList& program);
void addPreintegrateCommand(const CommandList& program);
void addTagPoseCommand(const CommandList& program);
void addTrackCommand(const CommandList& program);
void addViInitCommand(const CommandList& program);
void addTwoViewCommand(const CommandList& program);
void addCompareCommand(const CommandList& program);
void addConvertCommand(const CommandList& program);
void addDoctorCommand(const CommandList& program);
void addEvaluateCommand(const CommandList& program);
void addFitCommand(const CommandList& program);
void addHandEyeCommand(const CommandList& program);
void addSimulateHandEyeCommand(const CommandList& simulate);
void addSimulateMotionCommand(const CommandList& simulate);
void addSimulateTwoViewCommand(const CommandList& simulate);
void addSimulateViCommand(const CommandList& simulate);
void addValidateEstimatorCommand(const CommandList& validate);
void addValidateGroupsCommand(const CommandList& validate);
void addValidateHandEyeCommand(const CommandList& validate);
void addValidateLawsCommand(const CommandList& validate);
void addValidateMeansCommand(const CommandList& validate);
void addValidateMotionCommand(const CommandList& validate);
void addValidatePreintegrationCommand(const CommandList& validate);
void addValidatePropagationCommand(const CommandList& validate);
void addValidateRobustCommand(const CommandList& validate);
void addValidateSplitCommand(const CommandList& validate);
void addValidateTwoViewCommand(const CommandList& validate);
void addValidateViInitCommand(const CommandList& validate);

/// The line of `liestat --help` on the commands that begin with `validate`.
inline constexpr const char* validate_description = "Does an estimator keep what its covariance promises?";

}  // namespace liestat::cli
