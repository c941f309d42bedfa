// Private: BuildDataset's work for one camera.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dataset/build/build.h"
#include "dataset/build/given_masks.h"
#include "dataset/masks/size_rule.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset::internal {

using People = std::map<int, Coco19Pose>;

struct CameraJob {
  CameraFootage footage;
  std::string name;            ///< Panoptic's
  geometry::RigCamera camera;  ///< as calibrated
  const std::map<int, People>* poses = nullptr;
  const GivenMasks* masks = nullptr;  ///< null: they are made
  double joint_rms_px = 0;            ///< median reprojection error of the joints
  std::string folder;                 ///< of the dataset under construction
  std::string kept = {};              ///< see BuildInputs
  std::function<void()> on_image;     ///< after each image
};

struct CameraResult {
  geometry::RigCamera camera;  ///< as the images need it, under Panoptic's name
  BuiltCamera built;
  SizeDecision size;
  double frame_rate_hz = 0;  ///< 0 for images; with a timeline, of its time steps
  std::vector<int> gaps;     ///< time steps with joints and no image, ascending
  std::vector<Notice> warnings;
};

/// Reads the first image of each camera. Throws FormatError that names every camera whose footage has a size that no rule of
/// SizeRules explains; `calibration` is the file's path, for the message.
void RequireSizes(const std::vector<CameraJob>& jobs, const std::string& calibration, const BuildOptions& options);

/// Keeps a part of one camera's images and masks, or the first pass over its footage: see KeepBuildPart.
std::vector<std::string> KeepCameraPart(const CameraJob& job, const BuildPart& part, const BuildOptions& options);

/// Writes images and masks of one camera.
CameraResult BuildCamera(const CameraJob& job, const BuildOptions& options);

}  // namespace mvstudio::dataset::internal
