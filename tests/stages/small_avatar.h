#pragma once

#include "stages/nets/train/run.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::stages {

/// Three of four cameras and three of four frames of a mannequin without a fitted body, by a small network of three steps.
inline AvatarTrainOptions SmallAvatar(const mvstudio::testing::TempDir& folder) {
  avatar::WriteMannequinDataset(folder / "data", 4, 4, 96);
  AvatarTrainOptions options;
  options.dataset = folder / "data", options.out = folder / "run";
  options.split.holdout_cameras = "00_03", options.split.holdout_frames = "3";
  options.fit = BodyFitMode::kOff;
  options.pack.size_px = 48;
  options.model.width = 4, options.model.downs = 2, options.model.encoder_blocks = options.model.decoder_blocks = 1;
  options.train.steps = 3, options.train.batch = 1, options.train.device = "cpu";
  options.given = {"fit", "steps"};
  return options;
}

}  // namespace mvstudio::stages
