#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "avatar/run/pack/run_config.h"
#include "avatar/run/references/references.h"
#include "avatar/settings/options.h"
#include "core/progress.h"
#include "dataset/panoptic/missing.h"
#include "stages/input_notes.h"

/// Selects the images of a dataset for training and for scoring.
namespace mvstudio::stages {

/// Which cameras and frames are trained on, and which are held out; a split file replaces the first three.
struct SplitArguments {
  std::string train_cameras, holdout_cameras, holdout_frames, split, validate_camera;
  std::string frames = {};  ///< "80-99": the others are on no side; empty: all
};

template <class Visitor>
void VisitFields(Visitor&& visit, SplitArguments& o) {
  visit("train-cameras", o.train_cameras, "cameras to train on, e.g. cam_00,cam_04; all that are not held out unless given");
  visit("holdout-cameras,test-cameras", o.holdout_cameras,
        "cameras never trained on, e.g. cam_02,cam_05 (Panoptic or studio names)");
  visit("holdout-frames,test-frames", o.holdout_frames, "frames never trained on, e.g. 80-99");
  visit("frames", o.frames, "80-99 or 1,4,7-9: frames of the dataset, for training and test; all unless given");
  visit("split", o.split,
        "a file of `mvstudio dataset split` in place of these three: its training, validation and test parts");
  visit("validate-camera", o.validate_camera,
        "a training camera that is not trained on but scored at each checkpoint, for option 'patience'");
}

/// Throws UsageError for cameras and frames that do not exist or contradict each other, FormatError for the file, and what
/// KnownFrames does.
avatar::DatasetSplit SplitOf(const dataset::PanopticDataset& data, int person, const SplitArguments& arguments);

/// Before images are used: throws FormatError where no joint lies in any camera's image (of other units, mostly). Returns what
/// says that training images, masks and joints do not belong together (DAT-IMAGE-MASK, DAT-EXCHANGED, DAT-COVER), and logs it
/// at once.
std::vector<Notice> CheckTrainingImages(const dataset::PanopticDataset& data, const avatar::DatasetSplit& split,
                                        const RunContext& run);

/// Says which frames the arguments name that the dataset does not have.
void ReportSplitFrames(const dataset::PanopticDataset& data, const SplitArguments& arguments, InputNotes* notes);

/// What the dataset does not hold of the images of a split.
struct PackNotes {
  std::vector<std::string> skipped;
  dataset::MissingImages missing;  ///< of the training images: those that the dataset does not hold
  /// Side of the split, and what is missing of it: validation and held-out images, where some are.
  std::vector<std::pair<std::string, dataset::MissingImages>> missing_scored;
  int frames_without_person = 0;  ///< of the dataset; they are in no side
};

struct RunPacks : PackNotes {
  avatar::AvatarPack train;
  std::vector<avatar::RowView> train_views, watched_views;  ///< of their rows, where the options keep them
  std::optional<avatar::AvatarPack> watched;  ///< scored at each checkpoint: validation images, else held-out ones, if any
  std::shared_ptr<const avatar::References> references;  ///< of the training images, where the network takes some
};

/// Throws FormatError when a camera or a side of the split has no image left, or less than half of the training images.
/// Sets crop and template shape in `config` from the training images. `references`: those of a run that goes on.
RunPacks BuildPacks(const dataset::PanopticDataset& data, const avatar::ModelOptions& model,
                    const avatar::TrainOptions& options, const RunContext& run, avatar::RunConfig* config,
                    std::shared_ptr<const avatar::References> references = nullptr);

}  // namespace mvstudio::stages
