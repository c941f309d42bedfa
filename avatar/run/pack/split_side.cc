#include "avatar/run/pack/split_side.h"

#include <algorithm>

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::avatar {

SplitSide TrainingSide(const DatasetSplit& split) {
  return {"training cameras in training frames", split.train_cameras, split.train_frames};
}

SplitSide HoldoutSide(const DatasetSplit& split) {
  const bool cameras = !split.holdout_cameras.empty(), frames = !split.holdout_frames.empty();
  if (!cameras && !frames) return {};
  if (!frames) return {"held-out cameras in training frames", split.holdout_cameras, split.train_frames};
  if (!cameras) return {"training cameras in held-out frames", split.train_cameras, split.holdout_frames};
  return {"held-out cameras in held-out frames", split.holdout_cameras, split.holdout_frames};
}

dataset::MissingImages RequireImages(const dataset::PanopticDataset& data, const SplitSide& side, double most) {
  dataset::MissingImages missing = dataset::FindMissing(data, side.cameras, side.frames);
  const auto refuse = [&](const std::string& why) {
    throw FormatError(data.root, "", side.kind + ": " + why + "; " + dataset::MissingText(missing));
  };
  const std::vector<std::string> without = missing.CamerasWithout();
  if (missing.asked() > 0 && missing.missing() == missing.asked()) refuse("no image with a mask is left");
  if (!without.empty()) refuse("no image with a mask of camera " + Join(without, ", ") + ": leave it out");
  if (missing.missing() > most * missing.asked())
    refuse("more than half of the images are missing: choose cameras and frames that the dataset holds");
  return missing;
}

std::vector<int> FramesWithImages(const dataset::PanopticDataset& data, const SplitSide& side) {
  const dataset::MissingImages missing = dataset::FindMissing(data, side.cameras, side.frames);
  std::vector<int> frames;
  std::copy_if(side.frames.begin(), side.frames.end(), std::back_inserter(frames), [&](int frame) {
    return std::any_of(side.cameras.begin(), side.cameras.end(),
                       [&](const std::string& camera) { return !missing.Has(camera, frame); });
  });
  return frames;
}

void UseCameras(const dataset::PanopticDataset& data, const std::string& names, DatasetSplit* split) {
  if (names.empty()) return;
  split->holdout_cameras.clear();
  for (const std::string& name : SplitCommas(names)) {
    const std::string camera = data.Resolve(name);
    if (camera.empty()) throw UsageError("option 'cameras' " + name + " is not in " + data.root);
    if (std::count(split->train_cameras.begin(), split->train_cameras.end(), camera) > 0) {
      throw UsageError("option 'cameras' " + name + ": the run was trained on it");
    }
    split->holdout_cameras.push_back(camera);
  }
}

bool ShowsItsPoses(const DatasetSplit& split, const SplitSide& selection) {
  const auto shared = [](const auto& some, const auto& all) {
    return std::any_of(some.begin(), some.end(), [&](const auto& one) { return std::count(all.begin(), all.end(), one) > 0; });
  };
  return shared(selection.cameras, split.train_cameras) && !shared(selection.frames, split.train_frames);
}

}  // namespace mvstudio::avatar
