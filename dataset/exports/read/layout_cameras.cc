#include "dataset/exports/read/layout_cameras.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "calib/board/pixel_origin.h"
#include "calib/formats/format_camera.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/json_view.h"
#include "core/label.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::exports::internal {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;
using JsonView = BasicJsonView<Json>;

/// The folder's export.json, when it is one of ours; null otherwise.
Json ExportOf(const std::string& path) {
  if (!fs::is_regular_file(path)) return nullptr;
  Json json = JsonFromText<Json>(ReadFile(path), {}, path);
  const bool ours = json.is_object() && json.contains("schema") && json["schema"] == "mvstudio.export/1";
  return ours ? json : Json(nullptr);
}

struct Known {
  std::string name;
  double width_px = 0, height_px = 0;
};

std::vector<Known> CamerasOfExport(const std::string& folder) {
  const std::string path = folder + "/export.json";
  const Json json = ExportOf(path);
  std::vector<Known> known;
  if (!json.is_object()) return known;
  const JsonView cameras = JsonView(path, json)["cameras"];
  for (size_t i = 0; i < cameras.ArraySize(); ++i) {
    const JsonView camera = cameras[i], size = camera["size_px"];
    known.push_back({camera["name"].Text(), size[size_t{0}].Number(), size[size_t{1}].Number()});
  }
  return known;
}

void FillSize(const Known* known, const std::string& folder, const calib::ReadOptions& options, LayoutCamera* camera) {
  if (camera->width_px > 0) return;
  if (known) {
    camera->width_px = known->width_px, camera->height_px = known->height_px;
    return;
  }
  const std::string image = folder + "/" + camera->image;
  if (!camera->image.empty() && fs::is_regular_file(image)) {
    const dataset::ImageHeader header = dataset::ReadImageHeader(image);
    camera->width_px = static_cast<double>(header.width), camera->height_px = static_cast<double>(header.height);
    return;
  }
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(camera->place.path +
                     ": neither the file nor an image or export.json beside it gives the image size; pass option 'size' "
                     "WIDTHxHEIGHT");
  }
  camera->width_px = options.width_px, camera->height_px = options.height_px;
}

/// Without a last coefficient that is 0, so that k1, k2, p1, p2 alone are not read as a lens with k3.
Eigen::VectorXd WithoutK3(const Eigen::VectorXd& distortion) {
  return distortion.size() == 5 && distortion[4] == 0 ? Eigen::VectorXd(distortion.head(4)) : distortion;
}

}  // namespace

geometry::Rig RigOfCameras(const std::vector<LayoutCamera>& cameras, const std::string& folder,
                           const calib::ReadOptions& options) {
  const std::vector<Known> known = CamerasOfExport(folder);
  geometry::Rig rig;
  for (LayoutCamera camera : cameras) {
    const bool is_known = camera.place_in_export < known.size();
    FillSize(is_known ? &known[camera.place_in_export] : nullptr, folder, options, &camera);
    if (camera.name.empty() && is_known) camera.name = known[camera.place_in_export].name;
    if (!WhyNotALabel(camera.name).empty()) camera.name = Format("%02d", static_cast<int>(camera.place_in_export));
    geometry::RigCamera made;
    made.camera = calib::internal::MakeCamera(camera.name, camera.width_px, camera.height_px, camera.k,
                                              WithoutK3(camera.distortion), false, camera.place);
    made.cam_from_world = camera.cam_from_world;
    made.cam_from_world.translation *= options.metres_per_unit;
    calib::internal::AddCamera(std::move(made), camera.place, &rig);
  }
  return rig;
}

Eigen::MatrixXd MatrixOfRows(const std::vector<double>& numbers, Eigen::Index rows, Eigen::Index columns,
                             const calib::internal::Place& place) {
  if (static_cast<Eigen::Index>(numbers.size()) != rows * columns) {
    throw FormatError(place.path, place.where,
                      "holds " + std::to_string(numbers.size()) + " numbers, expected " + std::to_string(rows) + "x" +
                          std::to_string(columns));
  }
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(numbers.data(), rows,
                                                                                                  columns);
}

geometry::Rigid3 MakeTransform(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                               const calib::internal::Place& place) {
  if (!rotation.allFinite() || !translation.allFinite())
    throw FormatError(place.path, place.where, "the pose holds a number that is not finite");
  return {calib::internal::MakeRotation(rotation, place), translation};
}

Eigen::Matrix3d FromCornerOrigin(Eigen::Matrix3d k) {
  k(0, 2) -= calib::kCornerOriginShiftPx;
  k(1, 2) -= calib::kCornerOriginShiftPx;
  return k;
}

std::string FormatOfExport(const std::string& folder) {
  const std::string path = folder + "/export.json";
  const Json json = ExportOf(path);
  return json.is_object() ? JsonView(path, json)["format"].Text() : "";
}

std::string FileOf(const std::string& path, const std::string& in_folder) {
  return fs::is_directory(path) ? path + "/" + in_folder : path;
}

std::string FolderOf(const std::string& path, int levels) {
  if (fs::is_directory(path)) return path;
  fs::path folder = fs::absolute(path).parent_path();
  for (int i = 0; i < levels; ++i) folder = folder.parent_path();
  return folder.string();
}

}  // namespace mvstudio::exports::internal
