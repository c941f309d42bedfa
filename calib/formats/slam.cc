#include "calib/formats/slam.h"

#include <filesystem>
#include <optional>

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "geometry/rig/file_keys.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::LensModel;

/// fx, fy, cx, cy and the lens's own terms.
struct NamedLens {
  LensModel model = LensModel::kPinhole;
  Eigen::VectorXd params;
};

Eigen::VectorXd NumbersBy(const ValueView& table, std::initializer_list<const char*> keys) {
  Eigen::VectorXd numbers(static_cast<Eigen::Index>(keys.size()));
  Eigen::Index i = 0;
  for (const char* key : keys) numbers[i++] = table[key].Number();
  return numbers;
}

NamedLens LensFrom(LensModel model, const Eigen::VectorXd& focal, const Eigen::VectorXd& terms) {
  NamedLens lens{model, Eigen::VectorXd(4 + terms.size())};
  lens.params << focal, terms;
  return lens;
}

/// Brown's lens of these terms in OpenCV's order; none of them: a pinhole.
NamedLens BrownLens(const Eigen::VectorXd& focal, const Eigen::VectorXd& terms) {
  if (terms.isZero(0)) return {LensModel::kPinhole, focal};
  if (terms.size() == 5 && terms[4] == 0) return LensFrom(LensModel::kBrown4, focal, terms.head(4));
  return LensFrom(terms.size() == 8   ? LensModel::kRational8
                  : terms.size() == 5 ? LensModel::kBrown5
                                      : LensModel::kBrown4,
                  focal, terms);
}

const Entry& NeededEntry(const Entries& entries, const std::string& path, const std::string& key, const char* shown) {
  if (const Entry* const entry = FindEntry(entries, key)) return *entry;
  throw FormatError(path, shown, "this key is missing");
}

ValueView ViewOf(const Entry& entry) { return {entry.place.path, entry.value, entry.place.where}; }

std::string WordOf(const Entries& entries, const std::string& key) {
  const Entry* const entry = FindEntry(entries, key);
  return entry ? TextOf(entry->value) : "";
}

Eigen::Vector2d StatedSize(const Entry* width, const Entry* height, const std::string& path, const ReadOptions& options) {
  if (width && height) return {ReadNumber(*width), ReadNumber(*height)};
  if (options.width_px <= 0 || options.height_px <= 0)
    throw UsageError(path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
  return {options.width_px, options.height_px};
}

/// A 3x4 or 4x4 matrix [R t; 0 1].
geometry::Rigid3 PoseIn4x4(const Entry& entry, const ReadOptions& options) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.cols() != 4 || matrix.rows() < 3 || matrix.rows() > 4)
    throw FormatError(entry.place.path, entry.place.where, "a 4x4 matrix [R t; 0 1] was expected");
  return {MakeRotation(matrix.topLeftCorner<3, 3>(), entry.place),
          matrix.topRightCorner(matrix.rows(), 1).topRows<3>() * options.metres_per_unit};
}

NamedLens MeiLens(const Entries& entries, const std::string& path, const ValueView& projection, const ValueView& distortion) {
  const Eigen::VectorXd terms = NumbersBy(distortion, {"k1", "k2", "p1", "p2"});
  if (!terms.head<2>().isZero(0))
    distortion.Fail(
        "MEI with k1 and k2 is no lens model here (its p1 and p2 are); calibrate its boards again "
        "(mvstudio calibrate chooses a wide lens itself), or as KANNALA_BRANDT");
  const ValueView mirror = ViewOf(NeededEntry(entries, path, "mirrorparameters", "mirror_parameters"));
  const bool plain = terms.isZero(0);
  Eigen::VectorXd own(plain ? 1 : 3);
  own[0] = mirror["xi"].Number();
  if (!plain) own.tail<2>() = terms.tail<2>();
  return LensFrom(plain ? LensModel::kUcm : LensModel::kUcmP, NumbersBy(projection, {"gamma1", "gamma2", "u0", "v0"}), own);
}

NamedLens VinsLens(const Entries& entries, const std::string& path) {
  const Entry& word = NeededEntry(entries, path, "modeltype", "model_type");
  const std::string model = geometry::PlainKey(TextOf(word.value));
  const ValueView projection = ViewOf(NeededEntry(entries, path, "projectionparameters", "projection_parameters"));
  if (model == "kannalabrandt")
    return LensFrom(LensModel::kKannalaBrandt4, NumbersBy(projection, {"mu", "mv", "u0", "v0"}),
                    NumbersBy(projection, {"k2", "k3", "k4", "k5"}));
  const ValueView distortion = ViewOf(NeededEntry(entries, path, "distortionparameters", "distortion_parameters"));
  if (model == "mei") return MeiLens(entries, path, projection, distortion);
  if (model == "pinhole" || model == "pinholefull")
    return BrownLens(NumbersBy(projection, {"fx", "fy", "cx", "cy"}),
                     model == "pinhole" ? NumbersBy(distortion, {"k1", "k2", "p1", "p2"})
                                        : NumbersBy(distortion, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}));
  throw FormatError(path, "model_type",
                    "'" + Printable(TextOf(word.value)) +
                        "' is no lens model here (PINHOLE, PINHOLE_FULL, KANNALA_BRANDT, MEI are); calibrate as one of these");
}

geometry::Camera VinsCamera(const Entries& entries, const std::string& name, const std::string& path,
                            const ReadOptions& options) {
  if (const Entry* const poly = FindEntry(entries, "polyparameters"))
    throw FormatError(path, poly->place.where,
                      "SCARAMUZZA's polynomial is no lens model here (PINHOLE, PINHOLE_FULL, KANNALA_BRANDT, MEI are); "
                      "calibrate as one of these");
  const NamedLens lens = VinsLens(entries, path);
  const Eigen::Vector2d size = StatedSize(FindEntry(entries, "imagewidth"), FindEntry(entries, "imageheight"), path, options);
  return MakeModelCamera(name, size[0], size[1], lens.model, lens.params, {path, "projection_parameters"});
}

/// The file that the settings name, beside them.
Entries LensesBeside(const std::string& settings, const Entry& entry, std::string* path) {
  const std::string name = TextOf(entry.value);
  if (name.empty() || name.find('/') != std::string::npos || name.find('\\') != std::string::npos)
    throw FormatError(settings, entry.place.where, "'" + Printable(name) + "' is no file beside this one");
  *path = (std::filesystem::path(settings).parent_path() / name).string();
  Entries entries;
  ReadEntries(*path, true, &entries);
  return entries;
}

/// Body from camera of VINS-Mono's settings, or nothing.
std::optional<geometry::Rigid3> VinsMonoPose(const Entries& entries, const ReadOptions& options) {
  const Entry *rotation = FindEntry(entries, "extrinsicrotation"), *translation = FindEntry(entries, "extrinsictranslation");
  if (!rotation || !translation) return std::nullopt;
  const Eigen::VectorXd t = ReadVector(*translation);
  if (t.size() != 3) throw FormatError(translation->place.path, translation->place.where, "3 numbers were expected");
  return geometry::Rigid3{ReadRotation(*rotation), t * options.metres_per_unit};
}

/// The cameras of one file, each with body from camera where the file has it.
using Placed = std::pair<geometry::Camera, std::optional<geometry::Rigid3>>;
std::vector<Placed> VinsCameras(const std::string& path, const Entries& entries, const std::string& name,
                                const ReadOptions& options) {
  if (!entries.count("cam0calib")) return {{VinsCamera(entries, name, path, options), VinsMonoPose(entries, options)}};
  std::vector<Placed> cameras;
  for (int n = 0; const Entry* const named = FindEntry(entries, "cam" + std::to_string(n) + "calib"); ++n) {
    std::string lens_path;
    const Entries lens = LensesBeside(path, *named, &lens_path);
    const Entry* const pose = FindEntry(entries, "bodytcam" + std::to_string(n));
    cameras.emplace_back(VinsCamera(lens, "cam" + std::to_string(n), lens_path, options), std::nullopt);
    if (pose) cameras.back().second = PoseIn4x4(*pose, options);
  }
  return cameras;
}

geometry::Camera OrbCamera(const Entries& entries, const std::string& prefix, const std::string& name, const std::string& path,
                           const ReadOptions& options) {
  const std::string type = geometry::PlainKey(WordOf(entries, "camera.type"));
  const auto number = [&](const char* key, bool must) {
    const Entry* const entry = FindEntry(entries, prefix + key);
    if (entry) return ReadNumber(*entry);
    if (must) throw FormatError(path, prefix + key, "this key is missing");
    return 0.0;
  };
  const Eigen::Vector4d focal(number("fx", true), number("fy", true), number("cx", true), number("cy", true));
  NamedLens lens;
  if (type == "kannalabrandt8") {
    lens = LensFrom(LensModel::kKannalaBrandt4, focal,
                    Eigen::Vector4d(number("k1", true), number("k2", true), number("k3", true), number("k4", true)));
  } else if (type == "rectified") {
    lens = {LensModel::kPinhole, focal};
  } else if (type.empty() || type == "pinhole") {
    Eigen::VectorXd terms(5);
    terms << number("k1", false), number("k2", false), number("p1", false), number("p2", false), number("k3", false);
    lens = BrownLens(focal, terms);
  } else {
    throw FormatError(
        path, "Camera.type",
        "'" + Printable(WordOf(entries, "camera.type")) + "' is no lens model here (PinHole, KannalaBrandt8, Rectified are)");
  }
  const Eigen::Vector2d size =
      StatedSize(FindEntry(entries, "camera.width"), FindEntry(entries, "camera.height"), path, options);
  return MakeModelCamera(name, size[0], size[1], lens.model, lens.params, {path, prefix + "fx"});
}

NamedLens BasaltLens(const ValueView& camera) {
  const std::string& type = camera["camera_type"].Text();
  const ValueView numbers = camera["intrinsics"];
  const Eigen::VectorXd focal = NumbersBy(numbers, {"fx", "fy", "cx", "cy"});
  if (type == "ds") return LensFrom(LensModel::kDoubleSphere, focal, NumbersBy(numbers, {"xi", "alpha"}));
  if (type == "eucm") return LensFrom(LensModel::kEucm, focal, NumbersBy(numbers, {"alpha", "beta"}));
  if (type == "kb4") return LensFrom(LensModel::kKannalaBrandt4, focal, NumbersBy(numbers, {"k1", "k2", "k3", "k4"}));
  if (type == "pinhole") return {LensModel::kPinhole, focal};
  if (type == "pinhole-radtan8") return BrownLens(focal, NumbersBy(numbers, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}));
  if (type == "ucm") {  // alpha d + (1 - alpha) z below the line; Mei's is xi d + z
    const double alpha = numbers["alpha"].Number();
    if (!(alpha >= 0 && alpha < 1)) numbers["alpha"].Fail("must be from 0 to 1");
    Eigen::VectorXd scaled = focal;
    scaled.head<2>() /= 1 - alpha;
    return LensFrom(LensModel::kUcm, scaled, Eigen::VectorXd::Constant(1, alpha / (1 - alpha)));
  }
  camera["camera_type"].Fail("'" + Printable(type) +
                             "' is no lens model here (ds, eucm, ucm, kb4, pinhole, pinhole-radtan8 are); calibrate as one");
}

}  // namespace

bool IsVins(const Entries& entries) {
  return entries.count("cam0calib") || (entries.count("modeltype") && entries.count("cameraname")) ||
         (entries.count("modeltype") && entries.count("projectionparameters"));
}

ImportedRig ReadVins(const std::vector<std::string>& paths, const std::vector<Entries>& files, const ReadOptions& options) {
  ImportedRig imported;
  size_t placed = 0;
  for (size_t f = 0; f < paths.size(); ++f) {
    const std::string name = paths.size() > 1 ? Stem(paths[f]) : "camera";
    for (const auto& [lens, body_from_cam] : VinsCameras(paths[f], files[f], name, options)) {
      geometry::RigCamera camera;
      camera.camera = lens;
      if (body_from_cam) camera.cam_from_world = Inverse(*body_from_cam), ++placed;
      AddCamera(std::move(camera), {paths[f], ""}, &imported.rig);
    }
  }
  const size_t count = imported.rig.cameras.size();
  if (placed > 0 && placed < count)
    throw FormatError(paths.front(), "body_T_cam",
                      std::to_string(placed) + " of " + std::to_string(count) + " cameras have a pose: give all or none");
  imported.rig.gauge = placed > 0 ? geometry::RigGauge::Other("the body of VINS") : geometry::RigGauge::OfCamera("camera");
  if (placed == 0 && count > 1) StateLensesOnly(&imported);
  return imported;
}

bool IsOrbSlam(const Entries& entries) { return entries.count("camera1.fx") || entries.count("camera.fx"); }

ImportedRig ReadOrbSlam(const std::string& path, const Entries& entries, const ReadOptions& options) {
  if (entries.count("left.k") || entries.count("right.k"))
    throw FormatError(path, "LEFT.K",
                      "the file describes raw images (LEFT.K, RIGHT.K) and what is left of them when rectified (Camera.fx): "
                      "write those of your images as OpenCV's camera_matrix and distortion_coefficients, a file for each");
  const bool numbered = entries.count("camera1.fx");
  const Entry* pose = FindFirst(entries, {"stereo.tc1c2", "tlr"});
  const Entry* const base = WordOf(entries, "camera.type") == "Rectified" ? FindEntry(entries, "stereo.b") : nullptr;
  const bool two = entries.count("camera2.fx") || base;
  ImportedRig imported;
  geometry::RigCamera first, second;
  first.camera = OrbCamera(entries, numbered ? "camera1." : "camera.", two ? "camera1" : "camera", path, options);
  imported.rig.gauge = geometry::RigGauge::OfCamera(first.camera.name);
  if (entries.count("camera2.fx")) {
    if (!pose) throw FormatError(path, "Stereo.T_c1_c2", "this key is missing: nothing places Camera2 against Camera1");
    second.camera = OrbCamera(entries, "camera2.", "camera2", path, options);
    second.cam_from_world = Inverse(PoseIn4x4(*pose, options));
  } else if (base) {
    second.camera = first.camera;
    second.camera.name = "camera2";
    second.cam_from_world.translation = {-ReadNumber(*base) * options.metres_per_unit, 0, 0};
  }
  AddCamera(std::move(first), {path, "Camera1"}, &imported.rig);
  if (two) AddCamera(std::move(second), {path, "Camera2"}, &imported.rig);
  return imported;
}

ImportedRig ReadBasalt(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document), all = root["value0"], poses = all["T_imu_cam"], lenses = all["intrinsics"];
  if (lenses.ListSize() != poses.ListSize() || all["resolution"].ListSize() != poses.ListSize())
    all.Fail("T_imu_cam, intrinsics and resolution are of different numbers of cameras");
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("Basalt's IMU");
  for (size_t i = 0; i < poses.ListSize(); ++i) {
    const ValueView pose = poses[i];
    const Eigen::VectorXd q = NumbersBy(pose, {"qx", "qy", "qz", "qw"});
    if (!(std::abs(q.norm() - 1) < 1e-3)) pose.Fail("the quaternion is not of unit length");
    geometry::Rigid3 imu_from_cam;
    imu_from_cam.rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
    imu_from_cam.translation = NumbersBy(pose, {"px", "py", "pz"}) * options.metres_per_unit;
    const NamedLens lens = BasaltLens(lenses[i]);
    const Eigen::VectorXd size = all["resolution"][i].Vector(2);
    geometry::RigCamera camera;
    camera.camera = MakeModelCamera("cam" + std::to_string(i), size[0], size[1], lens.model, lens.params, lenses[i].place());
    camera.cam_from_world = Inverse(imu_from_cam);
    AddCamera(std::move(camera), pose.place(), &imported.rig);
  }
  if (imported.rig.cameras.empty()) poses.Fail("there is no camera in it");
  return imported;
}

}  // namespace mvstudio::calib::internal
