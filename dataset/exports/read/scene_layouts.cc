#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "calib/formats/format_camera.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "core/json_view.h"
#include "dataset/exports/read/layout_cameras.h"
#include "geometry/rig/rig_io.h"

/// Cameras of glTF (y up, they look along -z) and of our own rig.ply.
namespace mvstudio::exports::internal {
namespace {

using Json = nlohmann::ordered_json;
using JsonView = BasicJsonView<Json>;

constexpr int kMostLevels = 64;

/// The JSON chunk of a .glb, or the whole .gltf.
std::string JsonOfGltf(const std::string& path) {
  std::string bytes = ReadFile(path);
  if (bytes.compare(0, 4, "glTF") != 0) return bytes;
  uint32_t words[5] = {};
  if (bytes.size() < sizeof words) throw FormatError(path, "", "is cut short");
  std::memcpy(words, bytes.data(), sizeof words);
  constexpr uint32_t kJsonChunk = 0x4e4f534a;
  if (words[1] != 2 || words[4] != kJsonChunk) throw FormatError(path, "", "is not glTF 2.0");
  if (words[3] > bytes.size() - sizeof words) throw FormatError(path, "", "is cut short");
  return bytes.substr(sizeof words, words[3]);
}

Eigen::Matrix4d LocalTransform(const JsonView& node) {
  if (node.Has("matrix")) {
    const std::vector<double> numbers = node["matrix"].Numbers();
    if (numbers.size() != 16) node["matrix"].Fail("must be 16 numbers");
    return Eigen::Map<const Eigen::Matrix4d>(numbers.data());  // columns, as Eigen has them
  }
  const auto vector = [&](const char* key, const std::vector<double>& fallback) {
    const std::vector<double> numbers = node.Has(key) ? node[key].Numbers() : fallback;
    if (numbers.size() != fallback.size()) node[key].Fail("must be " + std::to_string(fallback.size()) + " numbers");
    return numbers;
  };
  const std::vector<double> t = vector("translation", {0, 0, 0}), q = vector("rotation", {0, 0, 0, 1}),
                            s = vector("scale", {1, 1, 1});
  const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
  if (!(turn.norm() > 1e-6)) node["rotation"].Fail("is no rotation");
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.block<3, 3>(0, 0) = turn.normalized().toRotationMatrix() * Eigen::Vector3d(s[0], s[1], s[2]).asDiagonal();
  matrix.block<3, 1>(0, 3) << t[0], t[1], t[2];
  return matrix;
}

/// With the lens that `extras` state; without them glTF's own: centred, without distortion.
geometry::Camera LensOf(const JsonView& node, const JsonView& camera, const std::string& name,
                        const calib::ReadOptions& options) {
  const calib::internal::Place place{node.path(), node.where()};
  if (node.Has("extras") && node["extras"].Has("lens_model")) {
    const JsonView extras = node["extras"];
    const auto model = geometry::LensModelFromString(extras["lens_model"].Text());
    if (!model) extras["lens_model"].Fail("is no lens model here; known are " + geometry::LensModelNames());
    const std::vector<double> params = extras["lens_params"].Numbers();
    geometry::Camera lens;
    lens.name = name, lens.model = *model;
    lens.params = Eigen::Map<const Eigen::VectorXd>(params.data(), static_cast<Eigen::Index>(params.size()));
    if (*model == geometry::LensModel::kSplined) {
      const JsonView grid = extras["lens_spline"];
      lens.spline = {grid["order"].Int(), grid["cols"].Int(), grid["rows"].Int(), grid["fov_x_deg"].Int()};
      const std::string why = geometry::WhyInvalidGrid(lens.spline);
      if (!why.empty()) grid.Fail(why);
    }
    if (lens.params.size() != geometry::NumParams(lens)) extras["lens_params"].Fail("has too few or too many numbers");
    return calib::internal::Checked(std::move(lens), extras["width_px"].Number(), extras["height_px"].Number(), place);
  }
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(node.path() + ": glTF gives no image size; pass option 'size' WIDTHxHEIGHT");
  }
  const JsonView perspective = camera["perspective"];
  const double yfov = perspective["yfov"].Number();
  if (!(yfov > 0 && yfov < 3.1)) perspective["yfov"].Fail("must be an angle between 0 and 3.1 radians");
  const double w = options.width_px, h = options.height_px, fy = h / (2 * std::tan(yfov / 2));
  const double aspect = perspective.Has("aspectRatio") ? perspective["aspectRatio"].Number() : w / h;
  if (!(aspect > 0)) perspective["aspectRatio"].Fail("must be positive");
  if (std::abs(aspect * h / w - 1) > 0.01)
    perspective["aspectRatio"].Fail(Format("is that of other images than option 'size' %gx%g: give theirs", w, h));
  const Eigen::Matrix3d k = calib::internal::CameraMatrix(fy * w / h / aspect, fy, (w - 1) / 2, (h - 1) / 2);
  return calib::internal::MakeCamera(name, w, h, k, Eigen::VectorXd(0), false, place);
}

/// Walks the scene's nodes and adds a camera for each that has one.
class GltfCameras {
 public:
  GltfCameras(const JsonView& root, const calib::ReadOptions& options)
      : root_(root), nodes_(root["nodes"]), options_(options) {}

  void Add(int index, const Eigen::Matrix4d& world_from_parent, int level) {
    if (index < 0 || level > kMostLevels) nodes_.Fail("are nested too deep or in circles");
    const JsonView node = nodes_[static_cast<size_t>(index)];
    const Eigen::Matrix4d world_from_node = world_from_parent * LocalTransform(node);
    if (node.Has("camera")) AddCamera(node, world_from_node);
    if (!node.Has("children")) return;
    const JsonView children = node["children"];
    for (size_t i = 0; i < children.ArraySize(); ++i) Add(children[i].Int(), world_from_node, level + 1);
  }
  geometry::Rig rig;

 private:
  void AddCamera(const JsonView& node, const Eigen::Matrix4d& world_from_node) {
    const JsonView camera = root_["cameras"][static_cast<size_t>(std::max(node["camera"].Int(), 0))];
    if (camera["type"].Text() != "perspective") camera["type"].Fail("is no perspective camera");
    const calib::internal::Place place{node.path(), node.where()};
    std::string name = node.Has("name") ? node["name"].Text() : camera.Has("name") ? camera["name"].Text() : "";
    if (name.empty()) name = "camera" + std::to_string(rig.cameras.size());
    Eigen::Matrix3d axes;  // y up of the file to z up
    axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    Eigen::Matrix3d world_from_cam = axes * world_from_node.block<3, 3>(0, 0).colwise().normalized();
    world_from_cam.rightCols(2) *= -1;  // y down, z forward
    const Eigen::Vector3d centre = options_.metres_per_unit * (axes * world_from_node.block<3, 1>(0, 3));
    geometry::RigCamera added;
    added.camera = LensOf(node, camera, name, options_);
    added.cam_from_world = Inverse(MakeTransform(world_from_cam, centre, place));
    calib::internal::AddCamera(std::move(added), place, &rig);
  }

  const JsonView root_, nodes_;
  const calib::ReadOptions& options_;
};

/// The only .glb or .gltf of the folder, or the file itself.
std::string GltfFile(const std::string& path) {
  if (!std::filesystem::is_directory(path)) return path;
  std::vector<std::string> found = FilesNamed(path, "", ".glb");
  for (const std::string& file : FilesNamed(path, "", ".gltf")) found.push_back(file);
  if (found.size() != 1) throw FormatError(path, "", "holds " + std::to_string(found.size()) + " glTF files; name one");
  return found.front();
}

}  // namespace

geometry::Rig ReadGltf(const std::string& path, const calib::ReadOptions& options) {
  const std::string file = GltfFile(path);
  const Json json = JsonFromText<Json>(JsonOfGltf(file), {}, file);
  const JsonView root(file, json), version = root["asset"]["version"];
  if (version.Text().compare(0, 2, "2.") != 0) version.Fail("is " + version.Text() + "; glTF 2.0 is read");
  if (!root.Has("cameras")) throw FormatError(file, "cameras", "is missing: this glTF holds no camera");
  GltfCameras cameras(root, options);
  const JsonView scenes = root["scenes"];
  const JsonView roots = scenes[static_cast<size_t>(root.Has("scene") ? std::max(root["scene"].Int(), 0) : 0)]["nodes"];
  for (size_t i = 0; i < roots.ArraySize(); ++i) cameras.Add(roots[i].Int(), Eigen::Matrix4d::Identity(), 0);
  if (cameras.rig.cameras.empty()) throw FormatError(file, "nodes", "no node of the scene has a camera");
  return cameras.rig;
}

geometry::Rig ReadPlyRig(const std::string& path, const calib::ReadOptions& options) {
  const std::string file = FileOf(path, "rig.ply"), bytes = ReadFile(file), prefix = "comment calibration ";
  const size_t end = bytes.find("end_header");
  if (bytes.compare(0, 3, "ply") != 0 || end == std::string::npos) throw FormatError(file, "", "is no PLY file");
  std::string text;
  for (size_t at = 0; at < end; at = bytes.find('\n', at) + 1) {
    if (bytes.compare(at, prefix.size(), prefix) != 0) continue;
    text += bytes.substr(at + prefix.size(), bytes.find_first_of("\r\n", at) - at - prefix.size());
  }
  if (text.empty()) {
    throw FormatError(
        file, "",
        "holds no cameras: points and lines do not tell their lenses; of mvstudio's exports rig.ply states them in "
        "its comments, unless it was saved again by another program");
  }
  geometry::Rig rig = geometry::RigFromJsonText(text, file);
  for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world.translation *= options.metres_per_unit;
  return rig;
}

}  // namespace mvstudio::exports::internal
