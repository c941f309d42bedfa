#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose3d.h"

/// Poses of people in motion, as a generic network learns from them.
namespace mvstudio::avatar {

/// One person in temporal order; every pose shows neck, hips, arms and legs. World: metres, z up.
struct MotionClip {
  std::string source;       ///< the animation file, or the dataset's folder
  int person = 0;           ///< id in the dataset; 0 in an animation file
  std::vector<int> frames;  ///< ascending
  std::vector<dataset::Coco19Pose> poses;
  std::vector<int> learned, held_out;  ///< indices of `poses`
};

/// The clip of a Biovision file, with an adult's bone lengths. Throws IoError, FormatError.
MotionClip ClipOfBvh(const std::string& path);

/// Everybody in the body3DScene files of a sequence in Panoptic's layout; images and calibration are not needed. `frames`:
/// those used, empty: all. Throws IoError, FormatError, UsageError naming a frame that the sequence has not.
std::vector<MotionClip> ClipsOfDataset(const std::string& root, const std::vector<int>& frames);

/// Holds out every fifth block of a clip: of 16 poses, or a fifth of the clip where it is shorter than 80. Fewer than five
/// poses are all learned from.
void HoldOutBlocks(MotionClip* clip);

}  // namespace mvstudio::avatar
