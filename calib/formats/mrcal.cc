#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using internal::ValueView;

struct MrcalModel {
  const char* name;
  LensModel model;
};
constexpr MrcalModel kModels[] = {{"LENSMODEL_PINHOLE", LensModel::kPinhole},
                                  {"LENSMODEL_OPENCV4", LensModel::kBrown4},
                                  {"LENSMODEL_OPENCV5", LensModel::kBrown5},
                                  {"LENSMODEL_OPENCV8", LensModel::kRational8},
                                  {"LENSMODEL_OPENCV12", LensModel::kThinPrism12}};
constexpr char kSplined[] = "LENSMODEL_SPLINED_STEREOGRAPHIC_";

/// The model and, for the splined one, its grid.
geometry::Camera ReadModel(const ValueView& lensmodel) {
  const std::string& name = lensmodel.Text();
  geometry::Camera camera;
  if (name.rfind(kSplined, 0) == 0) {
    camera.model = LensModel::kSplined;
    geometry::SplineGrid& grid = camera.spline;
    char end = 0;
    const int read = std::sscanf(name.c_str() + sizeof kSplined - 1, "order=%d_Nx=%d_Ny=%d_fov_x_deg=%d%c", &grid.order,
                                 &grid.cols, &grid.rows, &grid.fov_x_deg, &end);
    const bool sane = read == 4 && grid.cols > 0 && grid.cols < 1000 && grid.rows > 0 && grid.rows < 1000;
    if (!sane) lensmodel.Fail("the configuration in '" + internal::Printable(name) + "' cannot be read");
    return camera;
  }
  for (const MrcalModel& known : kModels) {
    if (name != known.name) continue;
    camera.model = known.model;
    return camera;
  }
  lensmodel.Fail("the lens '" + internal::Printable(name) +
                 "' is not known here; convert it with mrcal-convert-lensmodel to LENSMODEL_OPENCV8 or a splined one");
}

geometry::RigCamera ReadOne(const std::string& path, double metres_per_unit, geometry::UnusedKeys* unused) {
  const internal::Value document = internal::ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document);
  const Eigen::VectorXd size = root["imagersize"].Vector(2);
  geometry::Camera lens = ReadModel(root["lensmodel"]);
  lens.name = internal::Stem(path);
  lens.params = root["intrinsics"].Vector();
  geometry::RigCamera camera;
  camera.camera = internal::Checked(std::move(lens), size[0], size[1], {path, "intrinsics"});
  const ValueView pose = root[root.Has("rt_cam_ref") ? "rt_cam_ref" : "extrinsics"];
  const Eigen::VectorXd rt = pose.Vector(6);
  if (root.Has("extrinsics") && (root["extrinsics"].Vector(6) - rt).norm() > 1e-6)
    pose.Fail("is another pose than extrinsics: one of them was changed; take it out");
  camera.cam_from_world.rotation = internal::RotationFromVector(Eigen::Vector3d(rt.head<3>()), pose.place());
  camera.cam_from_world.translation = rt.tail<3>() * metres_per_unit;
  internal::AddUnused(root,
                      {"validintrinsicsregion", "optimizationinputs", "icamintrinsics", "icamintrinsicsoptimizationinputs",
                       "extrinsics", "note", "range", "rtfromref"},
                      unused);
  return camera;
}

/// Name and parameters as mrcal has them; an empty name when it has no such lens.
std::pair<std::string, Eigen::VectorXd> ToMrcal(const geometry::Camera& camera) {
  if (camera.model == LensModel::kSplined) {
    const geometry::SplineGrid& grid = camera.spline;
    return {kSplined + ("order=" + std::to_string(grid.order)) + "_Nx=" + std::to_string(grid.cols) +
                "_Ny=" + std::to_string(grid.rows) + "_fov_x_deg=" + std::to_string(grid.fov_x_deg),
            camera.params};
  }
  const auto lens = internal::ToOpenCvLens(camera);
  if (!lens || lens->fisheye) return {};
  for (const MrcalModel& known : kModels) {
    if (geometry::NumDistortionParams(known.model) != lens->distortion.size()) continue;
    Eigen::VectorXd params(4 + lens->distortion.size());
    params << camera.params.head<4>(), lens->distortion;
    return {known.name, params};
  }
  return {};
}

std::string ModelText(const geometry::RigCamera& camera) {
  const auto [name, params] = ToMrcal(camera.camera);
  Eigen::VectorXd rt(6);
  rt << geometry::RotationLog(camera.cam_from_world.rotation), camera.cam_from_world.translation;
  return "{\n    'lensmodel':  '" + name +
         "',\n\n    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n    'intrinsics': " +
         internal::ListText(params) + ",\n\n    # extrinsics are rt_fromref\n    'extrinsics': " + internal::ListText(rt) +
         ",\n\n    'imagersize': [ " + std::to_string(camera.camera.width_px) + ", " + std::to_string(camera.camera.height_px) +
         ",]\n}\n";
}

}  // namespace

ImportedRig ReadMrcal(const std::vector<std::string>& paths, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("mrcal's reference");
  for (const std::string& path : paths) {
    geometry::UnusedKeys unused(path, options.metres_per_unit);
    internal::AddCamera(ReadOne(path, options.metres_per_unit, &unused), {path, ""}, &imported.rig);
    internal::AddUnusedNote(unused, &imported);
  }
  return imported;
}

bool internal::MrcalCanCarry(const geometry::Camera& camera) { return !ToMrcal(camera).first.empty(); }

internal::Files internal::WriteMrcal(const geometry::Rig& rig, const std::string& path) {
  const bool is_file = std::filesystem::path(path).extension() == ".cameramodel";
  if (is_file && rig.cameras.size() > 1) {
    throw UsageError(path + ": mrcal has a file for each camera; give a folder for these " +
                     std::to_string(rig.cameras.size()));
  }
  Files files;
  for (const geometry::RigCamera& camera : rig.cameras) {
    files.push_back(is_file ? path : path + "/" + FileName(camera.camera.name) + ".cameramodel");
    WriteFileAtomic(files.back(), ModelText(camera));
  }
  return files;
}

}  // namespace mvstudio::calib
