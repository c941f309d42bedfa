// Private: steps of COLMAP's readers and writers, for colmap*.cc.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/formats/format_text.h"
#include "calib/formats/writers.h"
#include "geometry/rigid/rigid3.h"

/// COLMAP's model files in their own conventions.
/// https://colmap.github.io/format.html, https://colmap.github.io/cameras.html
namespace mvstudio::calib::internal {

struct ColmapModel {
  int id;
  const char* name;
  int num_params;
};
/// Null for ids and names that COLMAP 4.2 does not have.
const ColmapModel* FindColmapModel(int id);
const ColmapModel* FindColmapModel(const std::string& name);

struct ColmapCamera {
  const ColmapModel* model = nullptr;
  double width_px = 0, height_px = 0;
  std::vector<double> params;  ///< principal point relative to the corner of the image
  Place place;
};

struct ColmapImage {
  uint32_t id = 0;
  Eigen::Quaterniond rotation;  ///< cam_from_world
  Eigen::Vector3d translation;
  uint32_t camera_id = 0;
  std::string name;
  Place place;
  struct Feature {
    Eigen::Vector2d px_from_corner;
    uint64_t point_id;
  };
  std::vector<Feature> features = {};  ///< written only
};

struct ColmapPoint {
  Eigen::Vector3d x_in_world;
  std::array<uint8_t, 3> rgb;
  double error_px;
  std::vector<std::pair<uint32_t, uint32_t>> track;  ///< image id, index into its features
};

/// A camera of a rig: COLMAP 3.12's rigs.txt and rigs.bin.
struct ColmapSensor {
  uint32_t camera_id = 0;
  std::optional<geometry::Rigid3> sensor_from_rig;
};

struct ColmapRig {
  uint32_t id = 0;
  std::vector<ColmapSensor> cameras;  ///< other sensors are left out
};

/// What a rig took at one moment: COLMAP 3.12's frames.txt and frames.bin.
struct ColmapFrame {
  uint32_t id = 0, rig_id = 0;
  geometry::Rigid3 rig_from_world;
  std::vector<uint64_t> images = {};  ///< ids
  Place place;
};

struct ColmapFiles {
  std::map<uint32_t, ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapRig> rigs = {};         ///< read where the file is there
  std::vector<ColmapFrame> frames = {};     ///< the same
  std::vector<std::string> conflicts = {};  ///< counts that a text file states and does not hold
  std::vector<ColmapPoint> points = {};     ///< written only; ids from 1
};

ColmapFiles ReadColmapText(const std::string& folder);
ColmapFiles ReadColmapBinary(const std::string& folder);
/// cameras, images, rigs, frames and points3D; return the files. COLMAP before 3.12 looks for no rigs and frames.
Files WriteColmapText(const ColmapFiles& model, const std::string& folder);
Files WriteColmapBinary(const ColmapFiles& model, const std::string& folder);

/// From a quaternion w, x, y, z of a file; throws FormatError when it is far from unit length.
Eigen::Quaterniond ColmapRotation(double w, double x, double y, double z, const Place& place);

}  // namespace mvstudio::calib::internal
