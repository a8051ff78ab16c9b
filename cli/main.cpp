#include <cli/commands/commands.hpp>
#include <cli/commands/states.hpp>

int main(int argc, char** argv) {
  using namespace liestat::cli;
  // In the order in which the help lists them.
  return runCommandLine(
      argc, argv,
      {{"",
        "",
        {addCompareCommand, addConvertCommand, addDoctorCommand, addEvaluateCommand, addFitCommand, addHandEyeCommand,
         addMeanCommand, addMergeCommand, addMotionCommand, addPreintegrateCommand, addTagPoseCommand, addTrackCommand,
         addTwoViewCommand, addViInitCommand}},
       {"simulate",
        "Files of simulated measurements with their truth",
        {addSimulateHandEyeCommand, addSimulateMotionCommand, addSimulateTwoViewCommand, addSimulateViCommand}},
       {"validate",
        validate_description,
        {addValidateEstimatorCommand, addValidateGroupsCommand, addValidateHandEyeCommand, addValidateLawsCommand,
         addValidateMeansCommand, addValidateMotionCommand, addValidatePreintegrationCommand,
         addValidatePropagationCommand, addValidateRobustCommand, addValidateSplitCommand, addValidateTwoViewCommand,
         addValidateViInitCommand}}});
}
