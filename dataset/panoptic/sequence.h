#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic_files.h"

/// Lists the content of a Panoptic sequence's folder, CMU's or one in its layout. Opens folders only, no files.
namespace mvstudio::dataset {

enum class PanopticKind { kHd, kVga, kKinect };
/// By the panel: hd 0, kinect-color 50, else vga.
PanopticKind KindOfPanel(int panel);
/// By the panel of a camera's name, 00_05; hd where it is no such name.
PanopticKind KindOfCamera(const std::string& name);
/// "hd", "vga", "kinect"
std::string ToString(PanopticKind kind);

/// Images or a video of one camera.
struct PanopticFootage {
  bool is_video = false;
  std::string path;                   ///< video file, or folder of images
  std::map<int, std::string> images;  ///< number in the name -> file name; the Kinects' numbers begin at 1
  std::string other;                  ///< a second video, or a video beside the images; usually empty
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
      links_out;  ///< links that lead out of `root`: path, target; not included above
};

/// Throws IoError, and FormatError without a folder or with other than one calibration. `follow_links`: `links_out` are
/// read too.
PanopticSequence ScanPanopticSequence(const std::string& root, bool follow_links = false);

/// Selects from `names` by a text of "hd", "vga", "kinect" and names, separated by commas; keeps the order of `names`.
/// Throws UsageError for what is not there.
std::vector<std::string> SelectPanopticCameras(const std::vector<std::string>& names, const std::string& selection);

/// The studio's camera names -> Panoptic names, from the dataset.json that `dataset build` writes; empty without it.
std::map<std::string, std::string> ReadPanopticAliases(const std::string& root);

}  // namespace mvstudio::dataset
