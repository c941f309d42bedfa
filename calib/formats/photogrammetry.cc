#include "calib/formats/photogrammetry.h"

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/xml.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/some_of.h"
#include "core/text/words.h"
#include "geometry/rig/foreign_layout.h"

namespace mvstudio::calib::internal {
namespace {

Eigen::VectorXd NumbersIn(const pugi::xml_node& node, size_t count, const Place& place) {
  std::istringstream in(node.child_value());
  std::vector<double> numbers;
  for (std::string word; in >> word;) numbers.push_back(ParseNumber(word, place));
  if (numbers.size() != count) throw FormatError(place.path, place.where, std::to_string(count) + " numbers were expected");
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(count));
}

Eigen::MatrixXd RowsIn(const pugi::xml_node& node, int size, const Place& place) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::VectorXd numbers = NumbersIn(node, static_cast<size_t>(size) * static_cast<size_t>(size), place);
  return Eigen::Map<const RowMajor>(numbers.data(), size, size);
}

/// World from chunk: x_in_world = scale R x_in_chunk + t.
struct ChunkTransform {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

std::optional<ChunkTransform> TransformOf(const pugi::xml_node& parent, const std::string& name, const std::string& path) {
  const pugi::xml_node transform = parent.child("transform");
  const std::string where = name + ".transform.";
  if (!transform) return std::nullopt;
  ChunkTransform out;
  if (const auto node = transform.child("rotation")) out.rotation = RowsIn(node, 3, {path, where + "rotation"});
  if (const auto node = transform.child("translation")) out.translation = NumbersIn(node, 3, {path, where + "translation"});
  if (const auto node = transform.child("scale")) out.scale = NumbersIn(node, 1, {path, where + "scale"})[0];
  if (!(out.scale > 0)) throw FormatError(path, where + "scale", "must be above 0");
  return out;
}

/// The transforms of a chunk's cameras: a component's own, else that of the chunk.
class ChunkWorlds {
 public:
  ChunkWorlds(const pugi::xml_node& chunk, const std::string& path)
      : path_(path), of_chunk_(TransformOf(chunk, "chunk", path)) {
    for (const pugi::xml_node& component : chunk.child("components").children("component"))
      of_component_[component.attribute("id").value()] = TransformOf(component, "component", path);
  }

  /// Of an aligned camera. Throws FormatError where components have no world in common.
  ChunkTransform Of(const pugi::xml_node& camera) {
    const std::string id = camera.attribute("component_id").value();
    const auto found = of_component_.find(id);
    const bool own = found != of_component_.end() && found->second;
    seen_.insert(id), borrowed_ |= !own;
    if (borrowed_ && seen_.size() > 1)
      throw FormatError(path_, "components",
                        "cameras are of several components, and one has no transform: they have no world in common; align "
                        "them together, or export one component");
    return own ? *found->second : of_chunk_.value_or(ChunkTransform());
  }

 private:
  std::string path_;
  std::optional<ChunkTransform> of_chunk_;
  std::map<std::string, std::optional<ChunkTransform>> of_component_;
  std::set<std::string> seen_;
  bool borrowed_ = false;  ///< a camera's component has no transform of its own
};

/// Labels are names of images, or any others: `rig.A` has no ending.
std::string ImageOfLabel(const std::string& label) {
  static const std::set<std::string> kEndings = {"jpg", "jpeg", "png",  "tif", "tiff", "bmp",
                                                 "dng", "exr",  "webp", "jp2", "ppm"};
  const size_t dot = label.find_last_of('.');
  return dot != std::string::npos && kEndings.count(PlainWord(label.substr(dot + 1))) > 0 ? label : label + ".jpg";
}

/// u = width / 2 + cx + x f + x b1 + y b2 counts the middle of the first pixel as 0.5.
geometry::RigCamera LensOf(const pugi::xml_node& sensor, const std::string& name, const ReadOptions& options,
                           const Place& place, std::vector<Notice>* notes) {
  pugi::xml_node calibration = sensor.child("calibration");
  for (const pugi::xml_node& other : sensor.children("calibration")) {
    if (std::string_view(other.attribute("class").value()) == "adjusted") calibration = other;
  }
  const std::string type = calibration.attribute("type") ? calibration.attribute("type").value() : "frame";
  if (!calibration || type != "frame")
    throw FormatError(place.path, place.where,
                      calibration ? "sensors of type " + Printable(type) + " are not read; export them for COLMAP"
                                  : "its sensor has no calibration: align the photos first");
  const auto number = [&](const char* key) {
    const pugi::xml_node node = calibration.child(key);
    return node ? NumbersIn(node, 1, {place.path, place.where + "." + key})[0] : 0;
  };
  if (number("k4") != 0 || number("p3") != 0 || number("p4") != 0)
    throw FormatError(place.path, place.where,
                      "k4, p3 and p4 are no terms of a lens here: optimize without them and export again");
  const pugi::xml_node resolution =
      calibration.child("resolution") ? calibration.child("resolution") : sensor.child("resolution");
  const Eigen::Vector2d size(resolution.attribute("width").as_double(), resolution.attribute("height").as_double());
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = number("f") + number("b1"), k(1, 1) = number("f"), k(0, 1) = number("b2");
  const bool whole = !calibration.child("f");  // PhotoScan's fx, fy: cx and cy from the image's corner
  if (whole) k(0, 0) = number("fx"), k(1, 1) = number("fy"), k(0, 1) = number("skew");
  k(0, 2) = number("cx") + (whole ? 0 : 0.5 * size[0]) - 0.5, k(1, 2) = number("cy") + (whole ? 0 : 0.5 * size[1]) - 0.5;
  Eigen::VectorXd distortion(5);
  distortion << number("k1"), number("k2"), number("p2"), number("p1"), number("k3");
  if (distortion[4] == 0) distortion.conservativeResize(4);
  if (distortion.isZero(0)) distortion.resize(0);
  return MakeRigCamera(name, size, k, distortion, false, options, place, notes);
}

/// Intrinsics by their number.
struct MvgLens {
  std::string type;
  const Value* data = nullptr;
};

std::map<double, MvgLens> MvgLenses(const ValueView& root) {
  std::map<double, MvgLens> lenses;
  std::map<int, std::string> names;  // a type is named where it comes first
  const ValueView list = root["intrinsics"];
  for (size_t i = 0; i < list.ListSize(); ++i) {
    const ValueView value = list[i]["value"];
    const int type = static_cast<int>(static_cast<int64_t>(value["polymorphic_id"].Number()) & 0x7fffffff);
    if (value.Has("polymorphic_name")) names[type] = value["polymorphic_name"].Text();
    lenses[list[i]["key"].Number()] = {names[type], &value["ptr_wrapper"]["data"].value()};
  }
  return lenses;
}

geometry::RigCamera MvgCamera(const MvgLens& lens, const std::string& name, const ReadOptions& options, const Place& place,
                              std::vector<Notice>* notes) {
  const ValueView data(place.path, *lens.data, place.where);
  Eigen::VectorXd distortion;
  const bool fisheye = data.Has("fisheye");
  if (fisheye) distortion = data["fisheye"].Vector(4);
  if (data.Has("disto_k1")) distortion = (Eigen::VectorXd(4) << data["disto_k1"].Vector(1), 0, 0, 0).finished();
  if (data.Has("disto_k3")) {
    const Eigen::VectorXd k = data["disto_k3"].Vector(3);
    distortion = (Eigen::VectorXd(5) << k[0], k[1], 0, 0, k[2]).finished();
  }
  if (data.Has("disto_t2")) {
    const Eigen::VectorXd k = data["disto_t2"].Vector(5);
    distortion = (Eigen::VectorXd(5) << k[0], k[1], k[3], k[4], k[2]).finished();
  }
  if (distortion.size() == 0 && lens.type != "pinhole")
    throw FormatError(place.path, place.where, "lens '" + Printable(lens.type) + "' of openMVG is not read; export for COLMAP");
  if (!fisheye && distortion.isZero(0)) distortion.resize(0);
  const Eigen::VectorXd centre = data["principal_point"].Vector(2);
  const double f = data["focal_length"].Number();
  return MakeRigCamera(name, {data["width"].Number(), data["height"].Number()}, CameraMatrix(f, f, centre[0], centre[1]),
                       distortion, fisheye, options, place, notes);
}

}  // namespace

void AddLeftOut(const std::string& path, const std::vector<std::string>& names, std::vector<Notice>* notes) {
  if (names.empty()) return;
  notes->push_back({"CAL-IGNORED", path + ": cameras that were not aligned are left out: " + SomeOf(names),
                    "align them, or disable them, in the program that wrote the file"});
}

bool IsMetashapeCameras(std::string_view text) {
  return geometry::IsMetashape(text) && text.find("<sensors") != std::string_view::npos &&
         text.find("<camera") != std::string_view::npos;
}

ImportedRig ReadMetashape(const std::string& path, const ReadOptions& options) {
  pugi::xml_document document;
  ParseXml(path, ReadFile(path), &document);
  const pugi::xml_node chunk = document.document_element().child("chunk");
  if (chunk.next_sibling("chunk")) throw FormatError(path, "chunk", "there are several; export each to a file of its own");
  std::map<std::string, pugi::xml_node> sensors;
  for (const pugi::xml_node& sensor : chunk.child("sensors").children("sensor"))
    sensors[sensor.attribute("id").value()] = sensor;
  ChunkWorlds worlds(chunk, path);
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("Metashape's chunk");
  std::vector<ImageCamera> images;
  std::vector<std::string> left_out;
  for (const pugi::xpath_node& found : chunk.select_nodes(".//camera[@label]")) {
    const pugi::xml_node node = found.node();
    const std::string label = node.attribute("label").value();
    const Place place{path, "camera " + Printable(label)};
    const auto sensor = sensors.find(node.attribute("sensor_id").value());
    if (!node.child("transform") || sensor == sensors.end()) {
      left_out.push_back(Printable(label));
      continue;
    }
    const ChunkTransform world = worlds.Of(node);
    const Eigen::MatrixXd chunk_from_cam = RowsIn(node.child("transform"), 4, place);
    const Eigen::Quaterniond rotation =
        MakeRotation((world.rotation * chunk_from_cam.topLeftCorner<3, 3>()).transpose(), place);
    const Eigen::Vector3d centre =
        (world.scale * world.rotation * chunk_from_cam.topRightCorner(4, 1).topRows<3>() + world.translation) *
        options.metres_per_unit;
    geometry::RigCamera camera = LensOf(sensor->second, label, options, place, &imported.notes);
    camera.cam_from_world = camera.cam_from_world * geometry::Rigid3{rotation, -(rotation * centre)};
    images.push_back({ImageOfLabel(label), Stem(ImageOfLabel(label)), std::move(camera), place});
  }
  if (images.empty()) throw FormatError(path, "cameras", "none of them is aligned: align the photos and export again");
  AddImageCameras(std::move(images), &imported);
  AddLeftOut(path, left_out, &imported.notes);
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

bool IsOpenMvg(std::string_view json) {
  return json.find("\"sfm_data_version\"") != std::string_view::npos &&
         json.find("\"principal_point\"") != std::string_view::npos;
}

ImportedRig ReadOpenMvg(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document), views = root["views"], poses = root["extrinsics"];
  const std::map<double, MvgLens> lenses = MvgLenses(root);
  std::map<double, size_t> pose_of;
  for (size_t i = 0; i < poses.ListSize(); ++i) pose_of[poses[i]["key"].Number()] = i;
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("openMVG's world");
  std::vector<ImageCamera> images;
  std::vector<std::string> left_out;
  for (size_t i = 0; i < views.ListSize(); ++i) {
    const ValueView view = views[i]["value"]["ptr_wrapper"]["data"];
    const auto pose_at = pose_of.find(view["id_pose"].Number());
    const auto lens = lenses.find(view["id_intrinsic"].Number());
    const std::string file = view["filename"].Text();
    if (pose_at == pose_of.end() || lens == lenses.end()) {
      left_out.push_back(Printable(file));
      continue;
    }
    const ValueView pose = poses[pose_at->second]["value"];
    const Eigen::Quaterniond rotation = MakeRotation(pose["rotation"].Matrix(3, 3), pose.place());
    const Eigen::Vector3d centre = Eigen::Vector3d(pose["center"].Vector(3)) * options.metres_per_unit;
    geometry::RigCamera camera = MvgCamera(lens->second, Stem(file), options, view.place(), &imported.notes);
    camera.cam_from_world = camera.cam_from_world * geometry::Rigid3{rotation, -(rotation * centre)};
    const std::string folder = view.Has("local_path") ? view["local_path"].Text() : "";
    images.push_back({folder.empty() ? file : folder + "/" + file, Stem(file), std::move(camera), view.place()});
  }
  if (images.empty()) throw FormatError(path, "extrinsics", "no view has a pose; give the sfm_data of a reconstruction");
  AddImageCameras(std::move(images), &imported);
  AddLeftOut(path, left_out, &imported.notes);
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

}  // namespace mvstudio::calib::internal
