#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/footage/mask_io.h"
#include "dataset/panoptic/own_joints.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// CMU Panoptic's world is centimetres with y pointing down; ours is metres with z up: x_ours = (x, z, -y) / 100. The
/// conversion is made only in these functions. dataset/panoptic/panoptic_files.h holds the files' own values.

/// Reads calibration_<seq>.json. Cameras keep the file's order; models: pinhole when distCoef is all zero, else brown5.
/// Throws FormatError.
geometry::Rig ReadPanopticCalibration(const std::string& path);
/// x_ours = OursFromPanoptic() x_in_panoptic / 100.
Eigen::Matrix3d OursFromPanoptic();
/// Reads a calibration file of mvstudio or Panoptic, detected by content, or the `calibration.json` of a folder. Throws
/// FormatError for other layouts, by name where they are known.
geometry::Rig ReadAnyCalibration(const std::string& path);
/// Names must be `%02d_%02d` (ContractViolation): rename first. Lenses that five Brown coefficients cannot express are
/// refused (UsageError).
void WritePanopticCalibration(const geometry::Rig& rig, const std::string& path, const std::string& source);

/// Content of a body3DScene file.
struct Body3dScene {
  double univ_time_ms = -1;          ///< universal clock; -1 when unknown
  std::string fps_type;              ///< "hd_29_97" or "vga_25"
  std::map<int, Coco19Pose> people;  ///< by id; ids below 0 (false positives) are skipped
};
Body3dScene ReadBody3dSceneFile(const std::string& path);

/// body3DScene_%08d.json: person id -> joints. Invalid joints are (0, 0, 0, -1) in the file and `valid == false` here.
std::map<int, Coco19Pose> ReadBody3dScene(const std::string& path);
/// Writes the bytes of CMU's writer, but with enough digits to parse to the same doubles (a file of CMU survives
/// unchanged).
void WriteBody3dScene(const std::map<int, Coco19Pose>& people, double univ_time_ms, const std::string& path);

/// A dataset folder in Panoptic layout with images of HD cameras, from mvstudio or elsewhere. (Everything else in a
/// sequence: dataset/panoptic/sequence.h.)
struct PanopticDataset {
  std::string root;
  std::string sequence;  ///< <seq> of calibration_<seq>.json
  geometry::Rig rig;     ///< cameras that have images in hdImgs, names 00_NN
  std::map<std::string, std::string>
      aliases;              ///< studio's name ("cam_02") -> Panoptic name ("00_01"); from dataset.json when there is one
  std::vector<int> frames;  ///< frame numbers with a body3DScene file, sorted
  std::map<int, std::map<int, Coco19Pose>> poses;  ///< frame -> person -> joints, in our world
  std::optional<OwnJoints> own = {};               ///< the joints of another skeleton than the 19, where the folder has them

  /// Panoptic name for either kind of name; empty when unknown.
  std::string Resolve(const std::string& camera) const;
  std::string ImagePath(const std::string& camera, int frame) const;  ///< hdImgs/00_NN/00_NN_%08d.jpg (or .png)
  std::string MaskPath(const std::string& camera, int frame) const;   ///< masks/00_NN/00_NN_%08d.png
  /// What the numbers of all masks of the folder mean; decided when first asked for.
  const MaskMeaning& Masks() const { return mask_folder.Of(root + "/masks"); }
  Image ReadMask(const std::string& camera, int frame) const { return dataset::ReadMask(MaskPath(camera, frame), Masks()); }

  MaskFolder mask_folder = {};
};

/// True for `%02d_%02d`; then returns the panel and node numbers.
bool ParsePanopticName(const std::string& name, int* panel, int* node);

/// The only calibration_<seq>.json of a dataset folder. Throws IoError / FormatError when there is none or several.
std::string FindPanopticCalibration(const std::string& root);

/// "; hdPose3d_stage1_coco19.tar is not unpacked: …", for the archives in a sequence's folder; empty: there is none.
std::string NotUnpacked(const std::string& root);

/// Frame number -> body3DScene file, sorted. Empty when there is none.
std::map<int, std::string> ListBody3dScenes(const std::string& root);

/// Fills `frames`, `poses` and `own` from the folder `dataset->root`. Throws IoError, FormatError.
void ReadJoints(PanopticDataset* dataset);

/// Throws IoError / FormatError when the folder does not have this layout.
PanopticDataset OpenPanopticDataset(const std::string& root);

}  // namespace mvstudio::dataset
