#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_camera.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/panoptic/panoptic_units.h"
#include "geometry/rig/file_keys.h"
#include "geometry/rig/foreign_layout.h"
#include "geometry/rig/plausible.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::dataset {
namespace {

using geometry::Camera;
using geometry::LensModel;
using geometry::RigCamera;
using internal::Json;
using internal::JsonText;
using internal::JsonView;
using internal::NumbersText;
using internal::NumberText;

Eigen::Matrix3d ReadMatrix3(const JsonView& json) {
  if (json.ArraySize() != 3) json.Fail("must be a 3x3 matrix");
  Eigen::Matrix3d matrix;
  for (size_t r = 0; r < 3; ++r) {
    const JsonView row = json[r];
    if (row.ArraySize() != 3) row.Fail("must hold 3 numbers");
    for (size_t c = 0; c < 3; ++c) matrix(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = row[c].Number();
  }
  return matrix;
}

/// 3x1 nested as CMU writes it, or a flat list of three.
Eigen::Vector3d ReadVector3(const JsonView& json) {
  if (json.ArraySize() != 3) json.Fail("must hold 3 numbers");
  Eigen::Vector3d vector;
  for (size_t i = 0; i < 3; ++i) {
    const JsonView entry = json[i];
    const bool nested = entry.value().is_array();
    if (nested && entry.ArraySize() != 1) entry.Fail("must hold 1 number");
    vector[static_cast<Eigen::Index>(i)] = nested ? entry[size_t{0}].Number() : entry.Number();
  }
  return vector;
}

/// Cameras' names become names of folders and files.
bool IsFolderName(const std::string& name) { return name[0] != '.' && name.find_first_of("/\\") == std::string::npos; }

void ReadSize(const JsonView& size, PanopticCamera* camera) {
  if (size.ArraySize() != 2) size.Fail("must be [width, height]");
  camera->width_px = size[size_t{0}].Int();
  camera->height_px = size[size_t{1}].Int();
  if (camera->width_px <= 0 || camera->height_px <= 0) size.Fail("must be positive");
  if (std::max(camera->width_px, camera->height_px) > 100000) size.Fail("is beyond 100000 px");
}

std::optional<int> OptionalInt(const JsonView& json, const char* key) {
  return json.Has(key) ? std::optional(json[key].Int()) : std::nullopt;
}

Camera ToCamera(const PanopticCamera& from, const std::string& path, const std::string& where) {
  const auto fail = [&](const char* key, const std::string& what) { throw FormatError(path, where + "." + key, what); };
  const Eigen::Matrix3d& k = from.K;
  if (!(k(0, 0) > 0 && k(1, 1) > 0)) fail("K", "focal lengths must be positive");
  if (k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    fail("K", "must have the form [[fx,0,cx],[0,fy,cy],[0,0,1]]");
  if (k(0, 1) != 0)
    fail("K",
         "skew K[0][1] is not supported, it must be 0; `mvstudio calib convert` (option 'allow-approximation') reads the "
         "nearest camera without it");
  Camera camera;
  camera.name = from.name;
  camera.width_px = from.width_px;
  camera.height_px = from.height_px;
  Eigen::VectorXd params(9);
  params << k(0, 0), k(1, 1), k(0, 2), k(1, 2), Eigen::Map<const Eigen::Matrix<double, 5, 1>>(from.distortion.data());
  const bool distorted = !params.tail<5>().isZero(0);
  camera.model = distorted ? LensModel::kBrown5 : LensModel::kPinhole;
  camera.params = distorted ? params : Eigen::VectorXd(params.head<4>());
  return camera;
}

/// k1, k2, p1, p2, k3.
Eigen::Matrix<double, 5, 1> BrownCoefficients(const Camera& camera) {
  const auto terms = OpenCvTerms(camera);
  if (!terms || !terms->tail<7>().isZero(0)) {
    throw UsageError("camera " + camera.name + ": its lens model " + std::string(ToString(camera.model)) +
                     " cannot be written in Panoptic's five coefficients; calibrate with option 'model' brown5");
  }
  return terms->head<5>();
}

PanopticCamera ToPanopticCamera(const RigCamera& from) {
  const Camera& c = from.camera;
  int panel = 0, node = 0;
  MVS_CHECK(ParsePanopticName(c.name, &panel, &node), "camera name '" << c.name << "' is not of the form 00_00");
  PanopticCamera camera;
  camera.name = c.name;
  camera.type = panel == 0 ? "hd" : panel == 50 ? "kinect-color" : "vga";
  camera.width_px = c.width_px;
  camera.height_px = c.height_px;
  camera.panel = panel;
  camera.node = node;
  camera.K = c.K();
  const auto dist = BrownCoefficients(c);
  std::copy(dist.begin(), dist.end(), camera.distortion.begin());
  camera.cam_from_world_rotation = from.cam_from_world.rotation.toRotationMatrix() * OursFromPanoptic();
  for (int i = 0; i < 3; ++i)
    camera.cam_from_world_translation_cm[i] = internal::Centimetres(from.cam_from_world.translation[i]);
  return camera;
}

std::string MatrixText(const Eigen::Matrix3d& m) {
  std::string text = "[\n";
  for (int r = 0; r < 3; ++r)
    text += "\t\t\t\t[" + NumbersText({m(r, 0), m(r, 1), m(r, 2)}, ",") + "]" + (r < 2 ? ",\n" : "\n");
  return text + "\t\t\t]";
}

std::string CameraText(const PanopticCamera& c) {
  const std::string in = "\t\t\t";
  std::string text = "\t\t{\n" + in + "\"name\": " + JsonText(c.name) + ",\n";
  if (c.type) text += in + "\"type\": " + JsonText(*c.type) + ",\n";
  text += in + "\"resolution\": [" + std::to_string(c.width_px) + "," + std::to_string(c.height_px) + "],\n";
  if (c.panel) text += in + "\"panel\": " + std::to_string(*c.panel) + ",\n";
  if (c.node) text += in + "\"node\": " + std::to_string(*c.node) + ",\n";
  text += in + "\"K\": " + MatrixText(c.K) + ",\n" + in + "\"distCoef\": [" +
          NumbersText({c.distortion.begin(), c.distortion.end()}, ",") + "],\n";
  text += in + "\"R\": " + MatrixText(c.cam_from_world_rotation) + ",\n" + in + "\"t\": [\n";
  for (int i = 0; i < 3; ++i)
    text += in + "\t[" + NumbersText({c.cam_from_world_translation_cm[i]}) + "]" + (i < 2 ? ",\n" : "\n");
  return text + in + "]" + internal::ExtrasText(c.extras, in) + "\n\t\t}";
}

}  // namespace

Eigen::Matrix3d OursFromPanoptic() {
  Eigen::Matrix3d axes;
  axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return axes;
}

std::string UnusedKeysOf(const PanopticCalibrationFile& file, const std::string& path) {
  geometry::UnusedKeys unused(path, 0.01);
  const auto add = [&](const PanopticExtras& extras, const std::string& before) {
    for (const auto& [key, json] : extras) {
      const bool text = json.size() > 1 && json[0] == '"';
      unused.Add(before + key, key, text ? json.substr(1, json.size() - 2) : json);
    }
  };
  add(file.extras, "");
  for (size_t i = 0; i < file.cameras.size(); ++i) add(file.cameras[i].extras, "cameras[" + std::to_string(i) + "].");
  return unused.Text();
}

std::vector<PanopticNameConflict> PanopticNameConflicts(const std::vector<PanopticCamera>& cameras) {
  const auto stated = [](const PanopticCamera& camera) {
    int panel = 0, node = 0;
    if (!ParsePanopticName(camera.name, &panel, &node)) return camera.name;
    return Format("%02d_%02d", camera.panel.value_or(panel), camera.node.value_or(node));
  };
  std::set<std::string> names;
  std::map<std::string, int> times;
  for (const PanopticCamera& camera : cameras) names.insert(camera.name), ++times[stated(camera)];
  std::vector<PanopticNameConflict> conflicts;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const std::string other = stated(cameras[i]);
    if (other == cameras[i].name) continue;
    const bool exchanged = names.count(other) > 0 && times[other] == 1;
    conflicts.push_back({i,
                         "panel and node do not agree with the name " + internal::Quoted(cameras[i].name) + ": they say " +
                             other +
                             (exchanged ? ", which is another camera of the file; make them agree, or leave panel and node out"
                                        : "; the name counts"),
                         exchanged});
  }
  return conflicts;
}

PanopticCamera internal::ReadPanopticCameraFields(const JsonView& json) {
  internal::RequireObject(json);
  PanopticCamera camera;
  camera.name = CameraName(json["name"]);
  if (!IsFolderName(camera.name)) json["name"].Fail(Quoted(camera.name) + " cannot be a folder's name");
  camera.type = OptionalText(json, "type");
  ReadSize(json["resolution"], &camera);
  camera.panel = OptionalInt(json, "panel");
  camera.node = OptionalInt(json, "node");
  camera.K = ReadMatrix3(json["K"]);
  const JsonView dist = json["distCoef"];
  if (dist.ArraySize() != 5) dist.Fail("must hold 5 numbers: k1, k2, p1, p2, k3");
  for (size_t i = 0; i < 5; ++i) camera.distortion[i] = dist[i].Number();
  camera.cam_from_world_rotation = ReadMatrix3(json["R"]);
  camera.cam_from_world_translation_cm = ReadVector3(json["t"]);
  camera.extras = ExtrasOf(json, {"name", "type", "resolution", "panel", "node", "K", "distCoef", "R", "t"});
  return camera;
}

geometry::RigCamera internal::ToRigCamera(const PanopticCamera& from, const std::string& path, const std::string& where,
                                          double* drift) {
  RigCamera camera;
  camera.camera = ToCamera(from, path, where);
  const Eigen::Matrix3d& r = from.cam_from_world_rotation;
  const std::string wrong = geometry::WhyNotARotation(r);
  if (!wrong.empty()) throw FormatError(path, where + ".R", "is " + wrong);
  camera.cam_from_world.rotation = geometry::NearestRotation(r * OursFromPanoptic().transpose(), drift);
  if (!(*drift <= 1e-3))
    throw FormatError(path, where + ".R", "is not a rotation: it is " + NumberText(*drift) + " from the nearest one");
  camera.cam_from_world.translation = from.cam_from_world_translation_cm / 100.0;
  return camera;
}

bool ParsePanopticName(const std::string& name, int* panel, int* node) {
  if (name.size() != 5 || name[2] != '_') return false;
  for (const size_t i : {0, 1, 3, 4}) {
    if (name[i] < '0' || name[i] > '9') return false;
  }
  *panel = (name[0] - '0') * 10 + name[1] - '0';
  *node = (name[3] - '0') * 10 + name[4] - '0';
  return true;
}

namespace {

PanopticCalibrationFile FromJson(const Json& json, const std::string& path) {
  const JsonView file(path, json);
  internal::RequireObject(file);
  PanopticCalibrationFile calibration;
  calibration.source = internal::OptionalText(file, "calibDataSource");
  const JsonView cameras = file["cameras"];
  calibration.cameras.reserve(cameras.ArraySize());
  for (size_t i = 0; i < cameras.ArraySize(); ++i)
    calibration.cameras.push_back(internal::ReadPanopticCameraFields(cameras[i]));
  calibration.extras = internal::ExtrasOf(file, {"calibDataSource", "cameras"});
  return calibration;
}

}  // namespace

PanopticCalibrationFile ParsePanopticCalibration(std::string_view text, const std::string& path) {
  return FromJson(internal::ParseJson(text, path), path);
}

PanopticCalibrationFile ReadPanopticCalibrationFile(const std::string& path) {
  return ParsePanopticCalibration(internal::ReadTextFile(path, internal::kMaxCalibrationBytes), path);
}

std::string ToText(const PanopticCalibrationFile& file) {
  std::string text = "{\n";
  if (file.source) text += "\t\"calibDataSource\": " + JsonText(*file.source) + ",\n";
  text += "\t\"cameras\": [\n";
  for (size_t i = 0; i < file.cameras.size(); ++i)
    text += CameraText(file.cameras[i]) + (i + 1 < file.cameras.size() ? ",\n" : "\n");
  return text + "\t]" + internal::ExtrasText(file.extras, "\t") + "\n}\n";
}

void WritePanopticCalibrationFile(const PanopticCalibrationFile& file, const std::string& path) {
  WriteFileAtomic(path, ToText(file));
}

geometry::Rig ToRig(const PanopticCalibrationFile& file, const std::string& path) {
  UnusedKeysOf(file, path);
  geometry::Rig rig;
  rig.gauge.kind = geometry::RigGauge::Kind::kPanoptic,
  rig.gauge.words = "file " + std::filesystem::path(path).filename().string();
  std::set<std::string> names;
  for (size_t i = 0; i < file.cameras.size(); ++i) {
    const std::string where = "cameras[" + std::to_string(i) + "]";
    double drift = 0;
    rig.cameras.push_back(internal::ToRigCamera(file.cameras[i], path, where, &drift));
    const std::string& name = file.cameras[i].name;
    if (!names.insert(name).second) throw FormatError(path, where + ".name", internal::Quoted(name) + " is there twice");
  }
  if (rig.cameras.empty()) throw FormatError(path, "cameras", "is empty");
  for (const PanopticNameConflict& conflict : PanopticNameConflicts(file.cameras)) {
    if (conflict.exchanged) throw FormatError(path, "cameras[" + std::to_string(conflict.camera) + "]", conflict.text);
  }
  return rig;
}

PanopticCalibrationFile ToPanopticCalibration(const geometry::Rig& rig, const std::string& source) {
  PanopticCalibrationFile file;
  file.source = source;
  for (const RigCamera& camera : rig.cameras) {
    Validate(camera.camera);
    file.cameras.push_back(ToPanopticCamera(camera));
  }
  return file;
}

geometry::Rig ReadPanopticCalibration(const std::string& path) { return ToRig(ReadPanopticCalibrationFile(path), path); }

void WritePanopticCalibration(const geometry::Rig& rig, const std::string& path, const std::string& source) {
  WritePanopticCalibrationFile(ToPanopticCalibration(rig, source), path);
}

geometry::Rig ReadAnyCalibration(const std::string& named) {
  const bool folder = std::filesystem::is_directory(named) && std::filesystem::exists(named + "/calibration.json");
  const std::string path = folder ? named + "/calibration.json" : named;
  const std::string text = internal::ReadTextFile(path, internal::kMaxJsonBytes);
  const size_t begin = text.find_first_not_of(" \t\r\n");
  const bool other = begin != std::string::npos && text[begin] != '{' && std::filesystem::path(path).extension() != ".json";
  if (other)
    throw FormatError(path, "", "is no JSON; `mvstudio calib convert` (option 'unit' for its lengths) makes ours of it");
  const Json json = internal::ParseJson(text, path);
  const bool ours = json.is_object() && json.contains("schema");
  if (ours) return geometry::RigFromJsonText(text, path);
  if (!geometry::LooksLikePanoptic(text)) {
    const std::string layout = geometry::ForeignLayout(text);
    throw FormatError(path, "",
                      "is neither mvstudio's calibration nor Panoptic's" + (layout.empty() ? "" : "; it looks like " + layout) +
                          "; `mvstudio calib convert` makes ours of what it reads");
  }
  if (static_cast<int64_t>(text.size()) > internal::kMaxCalibrationBytes)
    throw FormatError(path, "", "is larger than any calibration in Panoptic layout");
  return ToRig(FromJson(json, path), path);
}

}  // namespace mvstudio::dataset
