#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/toml_depth.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {
namespace {

using internal::Place;

[[noreturn]] void Fail(const Place& place, const std::string& what) { throw FormatError(place.path, place.where, what); }

double Number(const toml::node& node, const Place& place) {
  const std::optional<double> number = node.value<double>();
  if (!node.is_number() || !number || !std::isfinite(*number)) Fail(place, "a finite number was expected");
  return *number;
}

/// Settings and figures of Pose2Sim, caliscope and aniposelib beside the lens and the pose.
const std::set<std::string> kHarmlessInToml = {"error",    "port",      "camid",    "rotationcount",
                                               "exposure", "gridcount", "verified", "adjusted"};

std::string TextOf(const toml::node& node) {
  if (const auto truth = node.as_boolean()) return **truth ? "true" : "false";
  if (const auto text = node.as_string()) return **text;
  const std::optional<double> number = node.value<double>();
  return number ? internal::NumberText(*number) : "[…]";
}

/// One camera's table with its place.
struct CameraTable {
  const toml::table* table;
  std::string name;
  Place place;
  mutable std::set<std::string> used = {"name", "ignore"};

  Place At(const std::string& key) const { return {place.path, place.where + "." + key}; }
  const toml::array& Array(const std::string& key) const {
    used.insert(key);
    const toml::array* array = table->get_as<toml::array>(key);
    if (!array) Fail(At(key), "missing, or not a list");
    return *array;
  }
  Eigen::VectorXd Vector(const std::string& key, const toml::array& array) const {
    Eigen::VectorXd vector(static_cast<Eigen::Index>(array.size()));
    for (size_t i = 0; i < array.size(); ++i) {
      vector[static_cast<Eigen::Index>(i)] = Number(array[i], At(key + "[" + std::to_string(i) + "]"));
    }
    return vector;
  }
  Eigen::VectorXd Vector(const std::string& key, size_t size) const {
    const toml::array& array = Array(key);
    if (array.size() != size) Fail(At(key), std::to_string(array.size()) + " entries, " + std::to_string(size) + " expected");
    return Vector(key, array);
  }
  Eigen::Matrix3d Matrix(const std::string& key) const {
    const toml::array& rows = Array(key);
    Eigen::Matrix3d matrix;
    if (rows.size() != 3) Fail(At(key), "a 3x3 matrix was expected");
    for (size_t i = 0; i < 3; ++i) {
      const std::string row_key = key + "[" + std::to_string(i) + "]";
      const toml::array* row = rows[i].as_array();
      if (!row || row->size() != 3) Fail(At(row_key), "a row of 3 numbers was expected");
      matrix.row(static_cast<Eigen::Index>(i)) = Vector(row_key, *row).transpose();
    }
    return matrix;
  }
  bool HasPose() const { return table->contains("rotation") || table->contains("translation"); }
  bool Flag(const char* key) const { return table->at_path(key).value_or(false); }

  geometry::LensKind LensKindOf(const ReadOptions& options) const {
    geometry::LensWords words;
    for (const auto& [key, node] : *table) {
      const std::string name_of(key.str());
      if (!geometry::LensWords::IsKey(name_of)) continue;
      used.insert(name_of);
      words.Add(place.path, At(name_of).where, name_of, TextOf(node));
    }
    return internal::LensKindOf(words, options, place);
  }
  void AddUnused(geometry::UnusedKeys* unused) const {
    for (const auto& [key, node] : *table) {
      const std::string id(key.str());
      if (used.count(id) == 0 && kHarmlessInToml.count(geometry::PlainKey(id)) == 0)
        unused->Add(At(id).where, internal::Printable(id), TextOf(node));
    }
  }
};

toml::table Parse(const std::string& path) {
  const std::string text = ReadFile(path);
  RequireParsableToml(text, path);
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    const auto at = error.source().begin;
    throw FormatError(path, "line " + std::to_string(at.line) + ", column " + std::to_string(at.column),
                      std::string(error.description()));
  }
}

void Collect(const toml::table& parent, const std::string& path, const std::string& prefix, std::vector<CameraTable>* cameras) {
  for (const auto& [key, node] : parent) {
    const toml::table* table = node.as_table();
    if (!table || !table->contains("matrix")) continue;
    const std::string id(key.str());
    const bool numeric = id.find_first_not_of("0123456789") == std::string::npos;
    const std::string name = table->at_path("name").value_or(numeric ? "cam_" + id : id);
    cameras->push_back({table, name, {path, prefix + internal::Printable(id)}});
  }
}

std::vector<CameraTable> CamerasInFileOrder(const toml::table& root, const std::string& path) {
  std::vector<CameraTable> cameras;
  Collect(root, path, "", &cameras);
  if (const toml::table* nested = root.get_as<toml::table>("cameras")) Collect(*nested, path, "cameras.", &cameras);
  std::stable_sort(cameras.begin(), cameras.end(), [](const CameraTable& a, const CameraTable& b) {
    return a.table->source().begin.line < b.table->source().begin.line;
  });
  return cameras;
}

geometry::RigCamera ReadCamera(const CameraTable& table, const ReadOptions& options, std::vector<Notice>* notes) {
  const Eigen::VectorXd size = table.Vector("size", 2);
  const Eigen::VectorXd distortion = table.Vector("distortions", table.Array("distortions"));
  geometry::RigCamera camera =
      internal::MakeRigCamera(table.name, size, table.Matrix("matrix"), distortion,
                              table.LensKindOf(options) == geometry::LensKind::kFisheye, options, table.place, notes);
  // Lenses alone; a pose in halves is damage.
  if (!table.HasPose()) return camera;
  geometry::Rigid3 pose;
  const toml::array& rotation = table.Array("rotation");
  if (!rotation.empty() && rotation[0].is_array()) {
    pose.rotation = internal::MakeRotation(table.Matrix("rotation"), table.At("rotation"));
  } else {
    pose.rotation = internal::RotationFromVector(Eigen::Vector3d(table.Vector("rotation", 3)), table.At("rotation"));
  }
  pose.translation = table.Vector("translation", 3) * options.metres_per_unit;
  camera.cam_from_world = camera.cam_from_world * pose;
  return camera;
}

}  // namespace

ImportedRig ReadToml(const std::string& path, const ReadOptions& options) {
  const toml::table root = Parse(path);
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  geometry::UnusedKeys unused(path, options.metres_per_unit);
  const std::vector<CameraTable> cameras = CamerasInFileOrder(root, path);
  const auto first = std::find_if(cameras.begin(), cameras.end(), [](const CameraTable& t) { return !t.Flag("ignore"); });
  for (const CameraTable& table : cameras) {
    if (table.Flag("ignore")) {
      imported.notes.push_back(
          {"CAL-IGNORED", "camera " + table.name + " is left out: the file says ignore = true", "remove that line to use it"});
      continue;
    }
    geometry::RigCamera camera = ReadCamera(table, options, &imported.notes);
    if (table.HasPose() != first->HasPose())
      Fail(table.place, "it has " + std::string(table.HasPose() ? "a pose" : "no rotation and translation") + ", and camera " +
                            first->name + (table.HasPose() ? " has none" : " has") + ": give all or none");
    internal::AddCamera(std::move(camera), table.place, &imported.rig);
    table.AddUnused(&unused);
  }
  if (const toml::table* metadata = root.get_as<toml::table>("metadata")) {
    CameraTable{metadata, "", {path, "metadata"}}.AddUnused(&unused);
  }
  internal::AddUnusedNote(unused, &imported);
  if (first != cameras.end() && !first->HasPose()) internal::StateLensesOnly(&imported);
  if (imported.rig.cameras.empty()) throw FormatError(path, "", "no camera in it: no table has a key 'matrix'");
  return imported;
}

internal::Files internal::WriteToml(const geometry::Rig& rig, const std::string& path, bool nested) {
  std::string text;
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const geometry::Camera& camera = rig.cameras[i].camera;
    const geometry::Rigid3& pose = rig.cameras[i].cam_from_world;
    const OpenCvLens lens = OpenCvLensOf(camera);
    const Eigen::Matrix3d k = camera.K(), r = pose.rotation.toRotationMatrix();
    Eigen::VectorXd distortion = Eigen::VectorXd::Zero(std::max<Eigen::Index>(lens.distortion.size(), lens.fisheye ? 4 : 5));
    distortion.head(lens.distortion.size()) = lens.distortion;
    const auto rows = [](const Eigen::Matrix3d& m) {
      return "[" + ListText(m.row(0)) + ", " + ListText(m.row(1)) + ", " + ListText(m.row(2)) + "]";
    };
    text += nested ? "[cameras." + std::to_string(i) + "]\ncam_id = " + std::to_string(i) + "\nrotation_count = 0\n"
                   : "[cam_" + std::to_string(i) + "]\n";
    text += "name = " + Quoted(camera.name) + "\nsize = [" + std::to_string(camera.width_px) + ", " +
            std::to_string(camera.height_px) + "]\nmatrix = " + rows(k) + "\ndistortions = " + ListText(distortion) +
            "\nrotation = " + (nested ? rows(r) : ListText(geometry::RotationLog(pose.rotation))) +
            "\ntranslation = " + ListText(pose.translation) + "\nfisheye = " + (lens.fisheye ? "true" : "false") + "\n\n";
  }
  if (!nested) text += "[metadata]\nadjusted = false\nerror = 0.0\n";
  WriteFileAtomic(path, text);
  return {path};
}

}  // namespace mvstudio::calib
