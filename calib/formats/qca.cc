#include <algorithm>
#include <cmath>
#include <map>

#include "calib/formats/formats.h"
#include "calib/formats/formats_internal.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {
namespace {

using internal::Place;
using Attributes = std::map<std::string, std::string>;

constexpr double kPerPixel = 64;                  ///< the file's units of focal lengths and centres
constexpr double kHugeK1 = 1.6, kTinyK1 = 0.002;  ///< signs of the other divisor, see ReadQca

/// A tag of an XML text: <name a="b">, </name> or <name a="b"/>.
struct Tag {
  std::string name;
  Attributes attributes;
  bool opens = false, closes = false;
};

/// Walks over the tags of an XML text. Knows no entities beyond the five of XML, no DTD and no CDATA, which QCA files do not
/// use.
class TagScanner {
 public:
  TagScanner(const std::string& path, const std::string& text) : path_(path), text_(text) {}

  bool Next(Tag* tag) {
    while (true) {
      position_ = text_.find('<', position_);
      if (position_ == std::string::npos) return false;
      if (text_.compare(position_, 4, "<!--") == 0)
        SkipPast("-->");
      else if (text_.compare(position_, 2, "<?") == 0)
        SkipPast("?>");
      else if (text_.compare(position_, 2, "<!") == 0)
        Fail("document type definitions are not read");
      else
        break;
    }
    ++position_;
    *tag = Tag();
    tag->closes = Accept('/');
    tag->opens = !tag->closes;
    tag->name = Name();
    while (SkipSpace(), !Accept('>')) {
      if (Accept('/')) {
        tag->closes = true;
        continue;
      }
      const std::string key = Name();
      Expect('=');
      if (!tag->attributes.emplace(key, Quoted()).second) Fail("attribute '" + internal::Printable(key) + "' stands twice");
    }
    return true;
  }

  std::string Where() const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(std::min(position_, text_.size())), '\n');
    return "line " + std::to_string(line);
  }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(path_, Where(), what); }

 private:
  bool Accept(char c) {
    if (position_ >= text_.size()) Fail("the file ends inside a tag; is it truncated?");
    if (text_[position_] != c) return false;
    ++position_;
    return true;
  }
  void Expect(char c) {
    SkipSpace();
    if (!Accept(c)) Fail(std::string("'") + c + "' was expected");
    SkipSpace();
  }
  void SkipSpace() { position_ = std::min(text_.find_first_not_of(" \t\r\n", position_), text_.size()); }
  void SkipPast(const char* end) {
    const size_t found = text_.find(end, position_);
    if (found == std::string::npos) Fail(std::string("'") + end + "' is missing; is the file truncated?");
    position_ = found;
  }
  std::string Name() {
    const size_t end = std::min(text_.find_first_of(" \t\r\n=/<>\"'", position_), text_.size());
    if (end == position_) Fail("a name was expected");
    const std::string name = text_.substr(position_, end - position_);
    position_ = end;
    return name;
  }
  std::string Quoted() {
    const char quote = position_ < text_.size() ? text_[position_] : '\0';
    if (quote != '"' && quote != '\'') Fail("a quoted value was expected");
    const size_t end = text_.find(quote, position_ + 1);
    if (end == std::string::npos) Fail("a quoted value does not end; is the file truncated?");
    const std::string value = text_.substr(position_ + 1, end - position_ - 1);
    position_ = end + 1;
    return Unescape(value);
  }
  std::string Unescape(const std::string& value) const {
    static const std::map<std::string, char> kEntities = {
        {"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}};
    std::string plain;
    for (size_t i = 0; i < value.size(); ++i) {
      if (value[i] != '&') {
        plain += value[i];
        continue;
      }
      const size_t end = value.find(';', i);
      const auto entity = kEntities.find(value.substr(i + 1, end == std::string::npos ? 0 : end - i - 1));
      if (entity == kEntities.end()) Fail("unknown XML entity in '" + internal::Printable(value) + "'");
      plain += entity->second;
      i = end;
    }
    return plain;
  }

  const std::string& path_;
  const std::string& text_;
  size_t position_ = 0;
};

/// The parts of a <camera> element, by the names of its children.
struct CameraElement {
  Attributes attributes;
  std::map<std::string, Attributes> children;
};

std::vector<CameraElement> ReadCameraElements(const std::string& path, const std::string& text) {
  TagScanner scanner(path, text);
  std::vector<CameraElement> cameras;
  std::vector<std::string> open;
  for (Tag tag; scanner.Next(&tag);) {
    if (tag.opens) {
      if (tag.name == "camera")
        cameras.push_back({tag.attributes, {}});
      else if (!open.empty() && open.back() == "camera")
        cameras.back().children[tag.name] = tag.attributes;
      open.push_back(tag.name);
      if (open.size() > 64) scanner.Fail("nested deeper than 64 levels");
    }
    if (tag.closes) {
      if (open.empty() || open.back() != tag.name) scanner.Fail("</" + internal::Printable(tag.name) + "> closes nothing");
      open.pop_back();
    }
  }
  if (!open.empty()) scanner.Fail("<" + internal::Printable(open.back()) + "> is not closed; is the file truncated?");
  return cameras;
}

/// Access to the numbers of one child of a camera.
class Numbers {
 public:
  Numbers(const CameraElement& camera, const std::string& child, const Place& place)
      : place_{place.path, place.where + "." + child} {
    const auto found = camera.children.find(child);
    if (found == camera.children.end()) throw FormatError(place_.path, place_.where, "this element is missing");
    attributes_ = &found->second;
  }
  double operator()(const std::string& key) const {
    const auto found = attributes_->find(key);
    if (found == attributes_->end()) throw FormatError(place_.path, place_.where, "attribute '" + key + "' is missing");
    return internal::ParseNumber(found->second, {place_.path, place_.where + "." + key});
  }
  double operator()(const std::string& key, double fallback) const { return attributes_->count(key) ? (*this)(key) : fallback; }
  const Place& place() const { return place_; }

 private:
  const Attributes* attributes_;
  Place place_;
};

/// The camera without its place in the world.
geometry::Camera ReadIntrinsics(const CameraElement& element, const std::string& name, const Place& place, double divisor) {
  const Numbers window(element, "fov_video", place), intrinsic(element, "intrinsic", place);
  if (intrinsic("skew", 0) != 0) throw FormatError(intrinsic.place().path, intrinsic.place().where, "skew is not supported");
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = intrinsic("focalLengthU") / kPerPixel;
  k(1, 1) = intrinsic("focalLengthV") / kPerPixel;
  k(0, 2) = intrinsic("centerPointU") / kPerPixel - window("left");
  k(1, 2) = intrinsic("centerPointV") / kPerPixel - window("top");
  const double k1 = intrinsic("radialDistortion1"), k2 = intrinsic("radialDistortion2"), k3 = intrinsic("radialDistortion3", 0);
  const double p1 = intrinsic("tangentalDistortion1"), p2 = intrinsic("tangentalDistortion2");
  Eigen::VectorXd distortion = (Eigen::VectorXd(5) << k1, k2, p1, p2, k3).finished();
  if (distortion[4] == 0) distortion.conservativeResize(4);
  return internal::MakeCamera(name, window("right") - window("left") + 1, window("bottom") - window("top") + 1, k,
                              distortion / divisor, false, place);
}

geometry::Rigid3 ReadTransform(const CameraElement& element, const Place& place) {
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

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return escaped;
}

std::string Attribute(const CameraElement& element, const std::string& key) {
  const auto found = element.attributes.find(key);
  return found == element.attributes.end() ? "" : found->second;
}

}  // namespace

ImportedRig ReadQca(const std::string& path, const ReadOptions& options) {
  const std::vector<CameraElement> elements = ReadCameraElements(path, ReadFile(path));
  ImportedRig imported;
  imported.rig.gauge = "as imported";
  for (size_t i = 0; i < elements.size(); ++i) {
    const Place place{path, "camera[" + std::to_string(i) + "]"};
    const std::string name = Attribute(elements[i], "serial"), turned = Attribute(elements[i], "viewrotation");
    if (name.empty()) throw FormatError(path, place.where, "attribute 'serial' is missing");
    if (!turned.empty() && internal::ParseNumber(turned, place) != 0) {
      imported.notes.push_back(
          {"CAL-VIEWROTATION",
           "camera " + name + " is shown rotated by " + turned + " degrees in QTM; its calibration is for the sensor as it is",
           "use its footage unrotated"});
    }
    geometry::RigCamera camera;
    camera.camera = ReadIntrinsics(elements[i], name, place, options.qca_distortion_divisor);
    camera.cam_from_world = ReadTransform(elements[i], place);
    internal::AddCamera(std::move(camera), place, &imported.rig);
  }
  if (imported.rig.cameras.empty()) throw FormatError(path, "", "there is no <camera> in it");
  const auto note = internal::QcaDivisorNote(imported.rig, options.qca_distortion_divisor, false);
  if (note) imported.notes.push_back(*note);
  return imported;
}

std::optional<ImportNote> internal::QcaDivisorNote(const geometry::Rig& rig, double divisor, bool writing) {
  double largest_k1 = 0;
  for (const geometry::RigCamera& placed : rig.cameras) {
    const auto lens = ToOpenCvLens(placed.camera);
    if (lens && lens->distortion.size() > 0) largest_k1 = std::max(largest_k1, std::abs(lens->distortion[0]));
  }
  if (largest_k1 == 0) return std::nullopt;
  const auto text = [](double value) { return Format("%.3g", value); };
  if (divisor != 1) {
    const bool small = !writing && largest_k1 < kTinyK1;
    return ImportNote{"CAL-QCADISTORTION",
                      "the lens distortion was " + std::string(writing ? "multiplied" : "divided") + " by " + text(divisor) +
                          ", as Pose2Sim reads it; board images say that Qualisys means the coefficients as they stand" +
                          (small ? ", and these look like it: divided, no lens has a k1 above " + text(largest_k1) : ""),
                      "leave option 'qca-distortion-divisor' out unless the other program needs it"};
  }
  if (writing || largest_k1 <= kHugeK1) return std::nullopt;
  return ImportNote{"CAL-QCADISTORTION",
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
