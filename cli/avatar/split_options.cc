#include "cli/avatar/split_options.h"

#include "cli/program/commands.h"
#include "cli/program/options.h"

namespace mvstudio::cli {

void AddSplitOptions(CLI::App* sub, stages::SplitArguments& a) {
  AddOption(sub, "--train-cameras", a.train_cameras,
            "cameras to train on, e.g. cam_00,cam_04; all that are not held out unless given");
  AddOption(sub, "--holdout-cameras,--test-cameras", a.holdout_cameras,
            "cameras never trained on, e.g. cam_02,cam_05 (Panoptic or studio names)");
  AddOption(sub, "--holdout-frames,--test-frames", a.holdout_frames, "frames never trained on, e.g. 80-99");
  AddOption(sub, "--frames", a.frames, "80-99 or 1,4,7-9: frames of the dataset, for training and test; all unless given");
  AddOption(sub, "--split", a.split,
            "a file of `mvstudio dataset split` in place of these three: its training, validation and test parts");
  AddOption(sub, "--validate-camera", a.validate_camera,
            "a training camera that is not trained on but scored at each checkpoint, for --patience");
}

}  // namespace mvstudio::cli
