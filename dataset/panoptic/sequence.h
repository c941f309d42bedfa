#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic_files.h"

/// What lies in the folder of a Panoptic sequence, CMU's or one in its layout. Nothing is opened but the folders.
namespace mvstudio::dataset {

enum class PanopticKind { kHd, kVga, kKinect };
/// By the panel: hd 0, kinect-color 50, else vga.
PanopticKind KindOfPanel(int panel);
/// "hd", "vga", "kinect"
std::string ToString(PanopticKind kind);

/// Pictures or a video of one camera.
struct PanopticFootage {
  bool is_video = false;
  std::string path;                     ///< video file, or folder of pictures
  std::map<int, std::string> pictures;  ///< number in the name -> file name; the Kinects' numbers begin at 1
  std::string other;                    ///< a video beside the pictures, or a second video; empty mostly
};

/// A folder with files of one kind, by the frame number in their names.
struct PanopticFrames {
  std::string folder;
  std::map<int, std::string> files;  ///< frame -> path
};

struct PanopticSequence {
  std::string root, name;                          ///< <seq>
  std::string calibration;                         ///< calibration_<seq>.json
  std::map<std::string, PanopticFootage> footage;  ///< by `%02d_%02d`; hdImgs, hdVideos, vga…, kinect…
  PanopticFrames hd_scenes, vga_scenes;            ///< body3DScene; coco19 before the older skeletons
  PanopticFrames faces, hands;
  std::string sync, kinect_sync;  ///< synctables_<seq>.json, ksynctables_<seq>.json; empty: not there
  std::vector<std::pair<std::string, std::string>>
      strange;  ///< files and folders of these places that have a wrong name: path, why
  std::vector<std::pair<std::string, std::string>>
      links_out;  ///< links that lead out of `root`: path, where to; left out above
};

/// Throws IoError, FormatError when there is no folder or not one calibration. `follow_links`: `links_out` are read as well.
PanopticSequence ScanPanopticSequence(const std::string& root, bool follow_links = false);

/// Those of `names` that a text of "hd", "vga", "kinect" and names, separated by commas, selects; in the order of `names`.
/// Throws UsageError for what is not there.
std::vector<std::string> SelectPanopticCameras(const std::vector<std::string>& names, const std::string& selection);

/// Studio's own names of cameras -> Panoptic names, from the dataset.json that `dataset build` leaves; empty without it.
std::map<std::string, std::string> ReadPanopticAliases(const std::string& root);

}  // namespace mvstudio::dataset
