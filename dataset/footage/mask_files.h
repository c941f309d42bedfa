#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dataset/footage/mask_io.h"

/// Where other programs put the masks of a camera.
namespace mvstudio::dataset {

/// The masks of one camera: number of the footage's frame -> file.
struct FrameMasks {
  std::map<int64_t, std::string> files;
  MaskMeaning meaning;
  /// Further objects of a frame, where each has a file of its own.
  std::map<int64_t, std::vector<std::string>> objects = {};

  std::vector<std::string> Paths() const;
  void CountFrom(int first);  ///< number `first` becomes 0
};

/// The masks of a camera, numbered by the last number of each name: FOLDER/CAMERA/FRAME.png, the camera's name in any spelling
/// (PlainWord); FOLDER/CAMERA/masks/FRAME.png; FOLDER/CAMERA_FRAME.png; FOLDER/FRAME/CAMERA.png; and of a file for each object
/// FRAME_OBJECT.png, OBJECT/FRAME.png or FRAME/OBJECT.png. `cameras`: all of them; a file that another one's name fits better
/// is not this camera's (front_left.png is none of `front`). Their meaning is left to the caller. Throws FormatError for two
/// masks of a frame and for names without a number.
FrameMasks FindMasks(const std::string& folder, const std::string& camera, const std::vector<std::string>& cameras);
/// The same of a camera's own folder, or of a pattern; files without any numbers have their positions (NumberFrames).
FrameMasks FindMasks(const std::string& folder_or_pattern);

/// The mask of a frame, that of all its objects; empty where there is none. One of the image's shape is brought to its size.
/// Throws FormatError for another shape.
Image MaskOfFrame(const FrameMasks& masks, int64_t frame, int width, int height);

}  // namespace mvstudio::dataset
