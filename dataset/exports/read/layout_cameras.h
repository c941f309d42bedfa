// Private: for the readers of this folder.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "geometry/rigid/rigid3.h"

/// What the readers of layouts share.
namespace mvstudio::exports::internal {

/// A camera as most layouts have it; what is empty or 0 they leave open.
struct LayoutCamera {
  std::string name;
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();  ///< (0, 0) is the centre of the top-left pixel
  Eigen::VectorXd distortion;                       ///< in OpenCV's order
  geometry::Rigid3 cam_from_world;                  ///< metres
  double width_px = 0, height_px = 0;
  std::string image;  ///< one of its images
  size_t place_in_export = 0;
  calib::internal::Place place;
};

/// The rig, with what the layout leaves open from the folder's export.json, the images or the options. Throws UsageError where
/// an image size is nowhere, FormatError.
geometry::Rig RigOfCameras(const std::vector<LayoutCamera>& cameras, const std::string& folder,
                           const calib::ReadOptions& options);

/// `rows` x `columns` numbers row by row; throws FormatError with the place when there are more or fewer.
Eigen::MatrixXd MatrixOfRows(const std::vector<double>& numbers, Eigen::Index rows, Eigen::Index columns,
                             const calib::internal::Place& place);
/// Of a 3x3 rotation and a translation; throws FormatError where it is none.
geometry::Rigid3 MakeTransform(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                               const calib::internal::Place& place);
/// Less the half pixel between an origin at the image's corner and ours.
Eigen::Matrix3d FromCornerOrigin(Eigen::Matrix3d k);

/// "format" of the folder's export.json; empty when there is none of ours.
std::string FormatOfExport(const std::string& folder);

/// The file of a layout that `path` names itself, or that lies in that folder.
std::string FileOf(const std::string& path, const std::string& in_folder);
/// Of a file `levels` folders below the layout's folder, or of the folder itself.
std::string FolderOf(const std::string& path, int levels);

// One function per layout; `path` is its folder or its file with cameras.
geometry::Rig ReadZju(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadActorsHq(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadDynamic3dgs(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadDna(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadHumman(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadNpzCameras(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadGltf(const std::string& path, const calib::ReadOptions& options);
geometry::Rig ReadPlyRig(const std::string& path, const calib::ReadOptions& options);

/// `calibration.csv` of the folder, or of one of its scales (1x before 2x before 4x); "" when there is none.
std::string CalibrationCsvIn(const std::string& folder);
/// The only `*_annots.smc` below annotations/; "" when there is none. Throws FormatError when there are several.
std::string AnnotationsIn(const std::string& folder);

}  // namespace mvstudio::exports::internal
