#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "calib/formats/xml.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {
namespace {

using internal::Place;

constexpr double kPerPixel = 64;                  ///< the file's units of focal lengths and centres
constexpr double kHugeK1 = 1.6, kTinyK1 = 0.002;  ///< signs of the other divisor, see ReadQca

/// Access to the numbers of one child of a camera.
class Numbers {
 public:
  Numbers(const pugi::xml_node& camera, const std::string& child, const Place& place)
      : element_(camera.child(child.c_str())), place_{place.path, place.where + "." + child} {
    if (!element_) throw FormatError(place_.path, place_.where, "this element is missing");
  }
  double operator()(const std::string& key) const {
    used_.insert(key);
    const pugi::xml_attribute attribute = element_.attribute(key.c_str());
    if (!attribute) throw FormatError(place_.path, place_.where, "attribute '" + key + "' is missing");
    return internal::ParseNumber(attribute.value(), {place_.path, place_.where + "." + key});
  }
  double operator()(const std::string& key, double fallback) const {
    return element_.attribute(key.c_str()) ? (*this)(key) : fallback;
  }
  const Place& place() const { return place_; }
  /// Attributes that nobody asked for.
  void AddUnused(std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused) const {
    for (const pugi::xml_attribute& attribute : element_.attributes()) {
      const std::string key = attribute.name(), plain = geometry::PlainKey(key);
      if (used_.count(key) > 0 || std::find(harmless.begin(), harmless.end(), plain) != harmless.end()) continue;
      unused->Add(place_.where + "." + internal::Printable(key), internal::Printable(key), attribute.value());
    }
  }

 private:
  pugi::xml_node element_;
  Place place_;
  mutable std::set<std::string> used_;
};

/// The camera without its place in the world, but for a turn that stands for skew.
geometry::RigCamera ReadIntrinsics(const pugi::xml_node& element, const std::string& name, const Place& place,
                                   const ReadOptions& options, geometry::UnusedKeys* unused, std::vector<Notice>* notes) {
  const Numbers window(element, "fov_video", place), intrinsic(element, "intrinsic", place);
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 1) = intrinsic("skew", 0) / kPerPixel;
  k(0, 0) = intrinsic("focalLengthU") / kPerPixel;
  k(1, 1) = intrinsic("focalLengthV") / kPerPixel;
  k(0, 2) = intrinsic("centerPointU") / kPerPixel - window("left");
  k(1, 2) = intrinsic("centerPointV") / kPerPixel - window("top");
  const double k1 = intrinsic("radialDistortion1"), k2 = intrinsic("radialDistortion2"), k3 = intrinsic("radialDistortion3", 0);
  const double p1 = intrinsic("tangentalDistortion1"), p2 = intrinsic("tangentalDistortion2");
  Eigen::VectorXd distortion = (Eigen::VectorXd(5) << k1, k2, p1, p2, k3).finished();
  if (distortion[4] == 0) distortion.conservativeResize(4);
  intrinsic.AddUnused({"focallength", "sensorminu", "sensormaxu", "sensorminv", "sensormaxv"}, unused);
  const Eigen::Vector2d size(window("right") - window("left") + 1, window("bottom") - window("top") + 1);
  return internal::MakeRigCamera(name, size, k, distortion / options.qca_distortion_divisor, false, options, intrinsic.place(),
                                 notes);
}

geometry::Rigid3 ReadTransform(const pugi::xml_node& element, const Place& place) {
  const Numbers transform(element, "transform", place);
  Eigen::Matrix3d file;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) file(i, j) = transform("r" + std::to_string(i + 1) + std::to_string(j + 1));
  }
  const Eigen::Matrix3d rotation = Eigen::Vector3d(1, -1, -1).asDiagonal() * file;
  const Eigen::Vector3d centre_mm(transform("x"), transform("y"), transform("z"));
  geometry::Rigid3 cam_from_world;
  cam_from_world.rotation = internal::MakeRotation(rotation, transform.place());
  cam_from_world.translation = -(cam_from_world.rotation * (centre_mm / 1000));
  return cam_from_world;
}

/// Qualisys' fisheye lenses have a model of their own.
void RefuseFisheye(const std::string& word, const Place& place) {
  if (geometry::PlainKey(word).find("fisheye") != std::string::npos)
    throw FormatError(place.path, place.where,
                      "says that the lenses are fisheyes, whose terms in this format are not known here; convert it with QTM");
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return escaped;
}

}  // namespace

ImportedRig ReadQca(const std::string& path, const ReadOptions& options) {
  pugi::xml_document document;
  internal::ParseXml(path, ReadFile(path), &document);
  pugi::xpath_node_set elements = document.select_nodes("//camera");
  elements.sort();
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  geometry::UnusedKeys unused(path, 0.001);
  const pugi::xml_node head = document.child("calibration");
  for (const pugi::xml_attribute& word : head.attributes()) {
    if (geometry::LensWords::IsKey(word.name()) || std::string(word.name()) == "type")
      RefuseFisheye(word.value(), {path, std::string("calibration.") + internal::Printable(word.name())});
  }
  for (size_t i = 0; i < elements.size(); ++i) {
    const Place place{path, "camera[" + std::to_string(i) + "]"};
    const pugi::xml_node element = elements[i].node();
    const std::string name = element.attribute("serial").value(), rotated = element.attribute("viewrotation").value();
    if (name.empty()) throw FormatError(path, place.where, "attribute 'serial' is missing");
    if (!rotated.empty() && internal::ParseNumber(rotated, place) != 0) {
      imported.notes.push_back(
          {"CAL-VIEWROTATION",
           "camera " + name + " is shown rotated by " + rotated + " degrees in QTM; its calibration is for the sensor as it is",
           "use its footage unrotated"});
    }
    if (std::string(element.attribute("active").value()) == "0") {
      imported.notes.push_back({"CAL-INACTIVE",
                                "camera " + name +
                                    " is marked inactive: it took no part in this calibration, what stands there "
                                    "may be of an earlier one",
                                "leave it out of the session, or calibrate it again"});
    }
    geometry::RigCamera camera = ReadIntrinsics(element, name, place, options, &unused, &imported.notes);
    camera.cam_from_world = camera.cam_from_world * ReadTransform(element, place);
    internal::AddCamera(std::move(camera), place, &imported.rig);
  }
  if (imported.rig.cameras.empty()) throw FormatError(path, "", "there is no <camera> in it");
  const auto note = internal::QcaDivisorNote(imported.rig, options.qca_distortion_divisor, false);
  if (note) imported.notes.push_back(*note);
  internal::AddUnusedNote(unused, &imported);
  return imported;
}

std::optional<Notice> internal::QcaDivisorNote(const geometry::Rig& rig, double divisor, bool writing) {
  double largest_k1 = 0;
  for (const geometry::RigCamera& placed : rig.cameras) {
    const auto lens = ToOpenCvLens(placed.camera);
    if (lens && lens->distortion.size() > 0) largest_k1 = std::max(largest_k1, std::abs(lens->distortion[0]));
  }
  if (largest_k1 == 0) return std::nullopt;
  const auto text = [](double value) { return Format("%.3g", value); };
  if (divisor != 1) {
    const bool small = !writing && largest_k1 < kTinyK1;
    return Notice{"CAL-QCADISTORTION",
                  "the lens distortion was " + std::string(writing ? "multiplied" : "divided") + " by " + text(divisor) +
                      ", as Pose2Sim reads it; board images say that Qualisys means the coefficients as they stand" +
                      (small ? ", and these look like it: divided, no lens has a k1 above " + text(largest_k1) : ""),
                  "leave option 'qca-distortion-divisor' out unless the other program needs it"};
  }
  if (writing || largest_k1 <= kHugeK1) return std::nullopt;
  return Notice{"CAL-QCADISTORTION",
                "a k1 of " + text(largest_k1) + " is no lens's; was the file written with coefficients times 64?",
                "compare with option 'qca-distortion-divisor' 64"};
}

internal::Files internal::WriteQca(const geometry::Rig& rig, const std::string& path, double distortion_divisor) {
  const auto attribute = [](const std::string& key, double value) { return " " + key + "=\"" + NumberText(value) + "\""; };
  std::string text = "<?xml version='1.0' encoding='UTF-8'?>\n<calibration>\n  <cameras>\n";
  for (const geometry::RigCamera& placed : rig.cameras) {
    const geometry::Camera& camera = placed.camera;
    Eigen::VectorXd distortion = Eigen::VectorXd::Zero(5);
    const OpenCvLens lens = OpenCvLensOf(camera);
    distortion.head(lens.distortion.size()) = distortion_divisor * lens.distortion;
    const Eigen::Matrix3d r = Eigen::Vector3d(1, -1, -1).asDiagonal() * placed.cam_from_world.rotation.toRotationMatrix();
    const Eigen::Vector3d centre_mm = 1000 * placed.CenterInWorld();
    text += "    <camera active=\"1\" viewrotation=\"0\" serial=\"" + Escaped(camera.name) +
            "\">\n      <fov_video left=\"0\" top=\"0\"";
    text +=
        " right=\"" + std::to_string(camera.width_px - 1) + "\" bottom=\"" + std::to_string(camera.height_px - 1) + "\"/>\n";
    text += "      <transform" + attribute("x", centre_mm.x()) + attribute("y", centre_mm.y()) + attribute("z", centre_mm.z());
    for (int i = 0; i < 9; ++i) text += attribute("r" + std::to_string(i / 3 + 1) + std::to_string(i % 3 + 1), r(i / 3, i % 3));
    text += "/>\n      <intrinsic" + attribute("focalLengthU", kPerPixel * camera.fx()) +
            attribute("focalLengthV", kPerPixel * camera.fy()) + attribute("centerPointU", kPerPixel * camera.cx()) +
            attribute("centerPointV", kPerPixel * camera.cy()) + " skew=\"0\"" + attribute("radialDistortion1", distortion[0]) +
            attribute("radialDistortion2", distortion[1]) + attribute("radialDistortion3", distortion[4]) +
            attribute("tangentalDistortion1", distortion[2]) + attribute("tangentalDistortion2", distortion[3]) +
            "/>\n    </camera>\n";
  }
  WriteFileAtomic(path, text + "  </cameras>\n</calibration>\n");
  return {path};
}

}  // namespace mvstudio::calib
