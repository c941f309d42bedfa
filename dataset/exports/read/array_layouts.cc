#include <algorithm>
#include <filesystem>

#include "core/disk/npy.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/some_of.h"
#include "dataset/arrays/child_process.h"
#include "dataset/arrays/foreign_hdf5.h"
#include "dataset/arrays/npz.h"
#include "dataset/exports/read/layout_cameras.h"

/// DNA-Rendering's SMC files (HDF5), and joints.npz.
namespace mvstudio::exports::internal {
namespace {

using dataset::internal::ForeignHdf5;

/// Width and height in the header of a mask's PNG bytes; nothing where it is none.
void SizeOfMask(const ForeignHdf5& file, const std::string& camera, LayoutCamera* of) {
  const std::string group = "/Mask/" + std::to_string(std::stoi(camera)) + "/mask";
  if (!file.Has(group)) return;
  const std::vector<std::string> frames = file.Members(group);
  if (frames.empty()) return;
  const std::vector<double> bytes = file.Numbers(group + "/" + frames.front());
  constexpr double kPng[] = {0x89, 'P', 'N', 'G'};
  if (bytes.size() < 24 || !std::equal(std::begin(kPng), std::end(kPng), bytes.begin())) return;
  const auto number = [&](size_t at) {
    return ((bytes[at] * 256 + bytes[at + 1]) * 256 + bytes[at + 2]) * 256 + bytes[at + 3];
  };
  of->width_px = number(16), of->height_px = number(20);
}

std::vector<LayoutCamera> SmcCameras(const std::string& path) {
  const ForeignHdf5 file(path);
  if (!file.Has("/Camera_Parameter")) {
    file.Fail("Camera_Parameter", "is missing; of DNA-Rendering's files, *_annots.smc holds the cameras");
  }
  std::vector<LayoutCamera> cameras;
  for (const std::string& number : file.Members("/Camera_Parameter")) {
    if (number.empty() || number.size() > 4 || number.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string group = "/Camera_Parameter/" + number;
    LayoutCamera camera;
    camera.place_in_export = cameras.size(), camera.place = {path, group};
    camera.name = file.HasAttribute(group, "name") ? file.TextAttribute(group, "name") : number;
    camera.k = MatrixOfRows(file.Numbers(group + "/K"), 3, 3, {path, group + "/K"});
    const std::vector<double> d = file.Numbers(group + "/D");
    camera.distortion = MatrixOfRows(d, static_cast<Eigen::Index>(d.size()), 1, camera.place);
    const Eigen::MatrixXd rt = MatrixOfRows(file.Numbers(group + "/RT"), 4, 4, {path, group + "/RT"});
    camera.cam_from_world = Inverse(MakeTransform(rt.block<3, 3>(0, 0), rt.block<3, 1>(0, 3), {path, group + "/RT"}));
    if (file.Has(group + "/size_px")) {
      const Eigen::MatrixXd size = MatrixOfRows(file.Numbers(group + "/size_px"), 2, 1, {path, group + "/size_px"});
      camera.width_px = size(0), camera.height_px = size(1);
    } else {
      SizeOfMask(file, number, &camera);
    }
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) file.Fail("Camera_Parameter", "holds no camera");
  return cameras;
}

/// Of an array of `count` rows; throws FormatError for another shape.
NpyArray RowsOf(const std::map<std::string, std::string>& arrays, const char* key, int64_t count, int64_t per_camera,
                const std::string& path) {
  const auto found = arrays.find(key);
  if (found == arrays.end())
    throw FormatError(path, key, "is missing; cameras are in camera_names, K, distCoef, cam_from_world and size_px");
  NpyArray array = ParseNpy(found->second, path + ": " + key);
  if (static_cast<int64_t>(array.values.size()) != count * per_camera)
    throw FormatError(path, key, "has not " + std::to_string(per_camera) + " numbers for each camera");
  return array;
}

std::vector<double> Part(const NpyArray& array, size_t camera, size_t count) {
  const auto from = array.values.begin() + static_cast<std::ptrdiff_t>(camera * count);
  return {from, from + static_cast<std::ptrdiff_t>(count)};
}

/// Says what is in an archive that another program wrote.
[[noreturn]] void FailForeign(const std::string& file, const std::map<std::string, std::string>& arrays) {
  std::vector<std::string> names;
  for (const auto& [name, bytes] : arrays) names.push_back(name);
  const auto has = [&](const char* name) { return arrays.count(name) > 0; };
  const bool neus = has("world_mat_0") && has("scale_mat_0");
  throw FormatError(file, "camera_names",
                    "is missing; this archive holds " + SomeOf(names) +
                        (neus ? ", as NeuS's cameras_sphere.npz: its world_mat_N are K [R t] of scaled scenes; give the "
                                "calibration that it was "
                                "made from, or write"
                              : ": no cameras that are known here; write") +
                        " JSON of cameras by name, {\"cam1\": {\"K\", \"dist\", \"R\", \"T\", \"image_size\"}, …}, R and T "
                        "camera from world");
}

}  // namespace

std::string AnnotationsIn(const std::string& folder) {
  std::vector<std::string> found = FilesNamed(folder + "/annotations", "", "_annots.smc");
  if (found.empty()) found = FilesNamed(folder, "", "_annots.smc");
  if (found.size() > 1) {
    throw FormatError(folder, "",
                      std::to_string(found.size()) + " files end in _annots.smc, one each sequence; name one of them");
  }
  return found.empty() ? "" : found.front();
}

geometry::Rig ReadDna(const std::string& path, const calib::ReadOptions& options) {
  const bool is_folder = std::filesystem::is_directory(path);
  const std::string file = is_folder ? AnnotationsIn(path) : path;
  if (file.empty()) throw FormatError(path, "annotations", "holds no *_annots.smc");
  // The library can crash on damaged files.
  constexpr dataset::internal::ChildLimits kLimits{120, 6ull << 30};
  dataset::internal::RunInChild(file, kLimits, [&] {
    SmcCameras(file);
    return std::string();
  });
  return RigOfCameras(SmcCameras(file), FolderOf(path, 1), options);
}

geometry::Rig ReadNpzCameras(const std::string& path, const calib::ReadOptions& options) {
  const std::string file = FileOf(path, "joints.npz");
  const auto arrays = dataset::ReadNpzMembers(file);
  const auto names_at = arrays.find("camera_names");
  if (names_at == arrays.end()) FailForeign(file, arrays);
  const std::vector<std::string> names = ParseNpyTexts(names_at->second, file + ": camera_names");
  const auto count = static_cast<int64_t>(names.size());
  const NpyArray k = RowsOf(arrays, "K", count, 9, file), d = RowsOf(arrays, "distCoef", count, 5, file),
                 poses = RowsOf(arrays, "cam_from_world", count, 16, file), sizes = RowsOf(arrays, "size_px", count, 2, file);
  std::vector<LayoutCamera> cameras;
  for (size_t i = 0; i < names.size(); ++i) {
    LayoutCamera camera;
    camera.place_in_export = i, camera.place = {file, "camera " + std::to_string(i)}, camera.name = names[i];
    camera.k = MatrixOfRows(Part(k, i, 9), 3, 3, camera.place);
    camera.distortion = MatrixOfRows(Part(d, i, 5), 5, 1, camera.place);
    const Eigen::MatrixXd pose = MatrixOfRows(Part(poses, i, 16), 4, 4, camera.place);
    camera.cam_from_world = MakeTransform(pose.block<3, 3>(0, 0), pose.block<3, 1>(0, 3), camera.place);
    camera.width_px = sizes.values[2 * i], camera.height_px = sizes.values[2 * i + 1];
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) throw FormatError(file, "camera_names", "names no camera");
  return RigOfCameras(cameras, FolderOf(path, 0), options);
}

}  // namespace mvstudio::exports::internal
