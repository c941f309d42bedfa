#include <algorithm>
#include <filesystem>

#include "calib/formats/csv_table.h"
#include "calib/formats/format_camera.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/exports/read/layout_cameras.h"

/// calibration.csv of ActorsHQ: rotation vector and centre of camera to world; focal lengths and principal point as shares of
/// the image, counted from its corner.
namespace mvstudio::exports::internal {

std::string CalibrationCsvIn(const std::string& folder) {
  namespace fs = std::filesystem;
  const auto holds = [](const std::string& file) { return fs::is_regular_file(file); };
  if (holds(folder + "/calibration.csv")) return folder + "/calibration.csv";
  std::vector<std::string> found;
  for (const std::string& name : NamesIn(folder)) {
    if (holds(folder + "/" + name + "/calibration.csv")) found.push_back(folder + "/" + name + "/calibration.csv");
  }
  return found.empty() ? "" : found.front();
}

geometry::Rig ReadActorsHq(const std::string& path, const calib::ReadOptions& options) {
  const bool is_folder = std::filesystem::is_directory(path);
  const std::string file = is_folder ? CalibrationCsvIn(path) : path;
  if (file.empty()) throw FormatError(path, "", "holds no calibration.csv, nor does a folder in it (1x, 2x, 4x)");
  const calib::CsvTable table(file);
  const int name = table.Require({"name"});
  std::vector<int> columns;
  for (const char* key : {"w", "h", "rx", "ry", "rz", "tx", "ty", "tz", "fx", "fy", "px", "py"})
    columns.push_back(table.Require({key}));
  std::vector<LayoutCamera> cameras;
  for (size_t row = 0; row < table.num_rows(); ++row) {
    const auto number = [&](size_t column) { return table.Number(row, columns[column]); };
    LayoutCamera camera;
    camera.place_in_export = row, camera.place = {file, table.Where(row)};
    camera.name = table.Text(row, name);
    camera.width_px = number(0), camera.height_px = number(1);
    const double w = camera.width_px, h = camera.height_px;
    Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
    k(0, 0) = number(8) * w, k(1, 1) = number(9) * h, k(0, 2) = number(10) * w, k(1, 2) = number(11) * h;
    camera.k = FromCornerOrigin(k);
    const geometry::Rigid3 world_from_cam{
        calib::internal::RotationFromVector(Eigen::Vector3d(number(2), number(3), number(4)), camera.place),
        {number(5), number(6), number(7)}};
    camera.cam_from_world = Inverse(world_from_cam);
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) throw FormatError(file, "", "holds no camera");
  return RigOfCameras(cameras, FolderOf(path, 1), options);
}

}  // namespace mvstudio::exports::internal
