#include <cmath>
#include <filesystem>
#include <map>

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/exports/read/layout_cameras.h"

/// Dynamic 3D Gaussians' train_meta.json and test_meta.json, HuMMan's cameras.json.
namespace mvstudio::exports::internal {
namespace {

using calib::internal::Value;
using calib::internal::ValueView;

/// A camera of one time step; `step` and `i` are places in the lists.
LayoutCamera MetaCamera(const ValueView& root, size_t step, size_t i, int id) {
  const ValueView image = root["fn"][step][i], w2c = root["w2c"][step][i];
  LayoutCamera camera;
  camera.place = w2c.place();
  camera.place_in_export = static_cast<size_t>(id);
  camera.image = "ims/" + image.Text();
  const std::string folder = std::filesystem::path(image.Text()).parent_path().filename().string();
  camera.name = folder.empty() ? std::to_string(id) : folder;
  camera.width_px = root["w"].Number(), camera.height_px = root["h"].Number();
  camera.k = FromCornerOrigin(root["k"][step][i].Matrix(3, 3));
  const Eigen::MatrixXd transform = w2c.Matrix(4, 4);
  camera.cam_from_world = MakeTransform(transform.block<3, 3>(0, 0), transform.block<3, 1>(0, 3), camera.place);
  return camera;
}

bool Differ(const LayoutCamera& a, const LayoutCamera& b) {
  constexpr double kSame = 1e-6;
  return (a.k - b.k).norm() > kSame * a.k.norm() ||
         (ToMatrix(a.cam_from_world) - ToMatrix(b.cam_from_world)).norm() > kSame * ToMatrix(a.cam_from_world).norm();
}

void AddMeta(const std::string& file, double metres_per_unit, std::map<int, LayoutCamera>* cameras) {
  const Value document = calib::internal::ParseLiteral(file, ReadFile(file));
  const ValueView root(file, document), ids = root["cam_id"];
  for (const char* key : {"fn", "w2c", "k"}) {
    if (root[key].ListSize() != ids.ListSize())
      root[key].Fail("has " + std::to_string(root[key].ListSize()) + " time steps, cam_id has " +
                     std::to_string(ids.ListSize()));
    for (size_t step = 0; step < ids.ListSize(); ++step) {
      const ValueView list = root[key][step];
      if (list.ListSize() != ids[step].ListSize())
        list.Fail("has " + std::to_string(list.ListSize()) + " cameras, cam_id[" + std::to_string(step) + "] has " +
                  std::to_string(ids[step].ListSize()));
    }
  }
  for (size_t step = 0; step < ids.ListSize(); ++step) {
    for (size_t i = 0; i < ids[step].ListSize(); ++i) {
      const double id = ids[step][i].Number();
      if (!(id >= 0 && id < 1e6 && id == std::floor(id))) ids[step][i].Fail("a camera's number was expected");
      LayoutCamera camera = MetaCamera(root, step, i, static_cast<int>(id));
      const auto [known, is_new] = cameras->emplace(static_cast<int>(id), camera);
      if (!is_new && Differ(known->second, camera)) {
        throw FormatError(file, camera.place.where,
                          "camera " + camera.name + " is elsewhere or has another lens than in " + known->second.place.where +
                              "; a rig's cameras stand still");
      }
    }
  }
  geometry::UnusedKeys unused(file, metres_per_unit);  // throws for those that change the meaning
  calib::internal::AddUnused(root, {}, &unused);
}

}  // namespace

geometry::Rig ReadDynamic3dgs(const std::string& path, const calib::ReadOptions& options) {
  std::map<int, LayoutCamera> by_id;
  if (std::filesystem::is_directory(path)) {
    for (const char* name : {"train_meta.json", "test_meta.json"}) {
      if (std::filesystem::exists(path + "/" + name)) AddMeta(path + "/" + name, options.metres_per_unit, &by_id);
    }
  } else {
    AddMeta(path, options.metres_per_unit, &by_id);
  }
  if (by_id.empty()) throw FormatError(path, "cam_id", "there is no camera in any time step");
  std::vector<LayoutCamera> cameras;
  for (auto& [id, camera] : by_id) cameras.push_back(std::move(camera));
  return RigOfCameras(cameras, FolderOf(path, 0), options);
}

geometry::Rig ReadHumman(const std::string& path, const calib::ReadOptions& options) {
  const std::string file = FileOf(path, "cameras.json"), folder = FolderOf(path, 0), prefix = "kinect_color_";
  const Value document = calib::internal::ParseLiteral(file, ReadFile(file));
  const ValueView root(file, document);
  std::vector<LayoutCamera> cameras;
  for (const auto& [key, unused] : document.entries) {
    if (key.compare(0, prefix.size(), prefix) != 0) continue;  // depth cameras and phones
    const ValueView entry = root[key];
    LayoutCamera camera;
    camera.place_in_export = cameras.size(), camera.place = entry.place();
    const std::string number = key.substr(prefix.size()), images = "kinect_color/kinect_" + number;
    const std::vector<std::string> found = FilesIn(folder + "/" + images);
    if (!found.empty()) camera.image = images + "/" + std::filesystem::path(found.front()).filename().string();
    if (FormatOfExport(folder).empty()) camera.name = "kinect_" + number;
    camera.k = entry["K"].Matrix(3, 3);
    camera.cam_from_world = MakeTransform(entry["R"].Matrix(3, 3), entry["T"].Vector(3), camera.place);
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) throw FormatError(file, "", "holds no kinect_color_ camera");
  return RigOfCameras(cameras, folder, options);
}

}  // namespace mvstudio::exports::internal
