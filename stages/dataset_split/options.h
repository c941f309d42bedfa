#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "core/fields.h"
#include "core/join.h"
#include "dataset/views/split.h"

/// Cameras and frames of a dataset for training and test: what a caller gives.
namespace mvstudio::stages {

struct DatasetSplitOptions {
  std::string dataset;   ///< folder in Panoptic layout
  std::string out;       ///< file for the split; may be empty with `describe`
  std::string describe;  ///< check and describe this split instead of making one; may be empty
  dataset::SplitOptions split;
  std::string test_frames, validation_frames;  ///< "90-119" or "0-9,50-59"; they make those of `split`
};

/// Without the dataset.
template <class Visitor>
void VisitFields(Visitor&& visit, DatasetSplitOptions& o) {
  const std::string presets =
      Join(dataset::SplitPresets(), "; ", [](const dataset::SplitPreset& preset) { return preset.name + ": " + preset.what; });
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "file for the split (JSON)");
  visit("describe", o.describe, "check and describe this split instead of making one");
  visit("preset", o.split.preset, presets);
  VisitStyled(visit, OptionStyle::kList, "holdout-cameras,test-cameras", o.split.test_cameras,
              "names, separated by commas: those that test");
  VisitStyled(visit, OptionStyle::kList, "train-cameras", o.split.train_cameras, "names; default: all that are not for test");
  VisitStyled(visit, OptionStyle::kList, "validation-cameras", o.split.validation_cameras,
              "names; default: the training cameras");
  VisitStyled(visit, OptionStyle::kUnset, "train-count", o.split.num_train_cameras,
              "number of training cameras, spread evenly around the people; the others are for test; option 'seed' gives other "
              "choices");
  VisitStyled(visit, OptionStyle::kUnset, "every-camera", o.split.every_camera, "every k-th camera is for test");
  visit("holdout-frames,test-frames", o.test_frames, "such as 90-119 or 0-9,50-59");
  visit("validation-frames", o.validation_frames, "likewise");
  visit("test-share", o.split.test_share, "share of the frames, the last ones, when none are named");
  visit("guard", o.split.guard_frames, "frames left out on either side of test and validation frames");
}

}  // namespace mvstudio::stages
