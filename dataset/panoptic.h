#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/pose3d.h"
#include "geometry/rig.h"

namespace mvstudio::dataset {

/// CMU Panoptic's world is centimetres with y pointing down; ours is metres with z up: x_ours = (x, z, -y) / 100. The change is made
/// in these functions and nowhere else.

/// calibration_<seq>.json. Cameras keep the file's order; models: pinhole when distCoef is all zero, else brown5. Throws FormatError.
geometry::Rig ReadPanopticCalibration(const std::string& path);
/// Names are kept when they are `%02d_%02d`, otherwise an error (ContractViolation): rename first. Lenses that five Brown coefficients
/// cannot express are refused (UsageError).
void WritePanopticCalibration(const geometry::Rig& rig, const std::string& path, const std::string& source);

/// body3DScene_%08d.json: person id -> joints. Invalid joints are (0, 0, 0, -1) in the file and `valid == false` here.
std::map<int, Coco19Pose> ReadBody3dScene(const std::string& path);
void WriteBody3dScene(const std::map<int, Coco19Pose>& people, double univ_time_ms, const std::string& path);

/// A dataset folder in Panoptic layout, ours or foreign.
struct PanopticDataset {
  std::string root;
  std::string sequence;                       ///< <seq> of calibration_<seq>.json
  geometry::Rig rig;                          ///< cameras that have pictures, names 00_NN
  std::map<std::string, std::string> aliases; ///< studio's own name ("cam_02") -> Panoptic name ("00_01"); from dataset.json when there
  std::vector<int> frames;                    ///< frame numbers with a body3DScene file, sorted
  std::map<int, std::map<int, Coco19Pose>> poses;  ///< frame -> person -> joints, in our world

  /// Panoptic name for either kind of name; empty when unknown.
  std::string Resolve(const std::string& camera) const;
  std::string ImagePath(const std::string& camera, int frame) const;  ///< hdImgs/00_NN/00_NN_%08d.jpg (or .png)
  std::string MaskPath(const std::string& camera, int frame) const;   ///< masks/00_NN/00_NN_%08d.png
};

/// Throws IoError / FormatError when the layout is not there.
PanopticDataset OpenPanopticDataset(const std::string& root);

}  // namespace mvstudio::dataset
