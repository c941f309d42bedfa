#include "calib/board/board.h"
#include "calib/board/sides.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/formats.h"
#include "geometry/rig/rig_io.h"
#include "tests/fuzz/fuzz.h"

/// Calibration files of all formats. What is read must be writable in the same format, and read back the same.
namespace mvstudio::fuzz {
namespace {

using calib::CalibrationFormat;
using calib::ImportedRig;

constexpr double kRelative = 1e-9;  ///< rotations pass through other parametrisations

/// The perspective or fisheye coefficients with the zeros cut off that some formats pad; all of the parameters of other lenses.
Eigen::VectorXd Coefficients(const geometry::Camera& camera) {
  const auto lens = calib::internal::ToOpenCvLens(camera);
  Eigen::VectorXd all = lens ? lens->distortion : camera.params.tail(camera.params.size() - 4);
  while (all.size() > 0 && all[all.size() - 1] == 0) all.conservativeResize(all.size() - 1);
  return all;
}

void RequireSameLens(const geometry::Camera& a, const geometry::Camera& b) {
  Require(a.width_px == b.width_px && a.height_px == b.height_px, "the image size changed");
  for (int i = 0; i < 4; ++i) {
    const double scale = std::max(std::abs(a.params[i]), std::abs(b.params[i]));
    Require(std::abs(a.params[i] - b.params[i]) <= kRelative * scale + 1e-6, "the focal length or the centre changed");
  }
  const Eigen::VectorXd k = Coefficients(a), l = Coefficients(b);
  Require(k.size() == l.size(), "the number of lens coefficients changed");
  for (Eigen::Index i = 0; i < k.size(); ++i) Require(Near(k[i], l[i], kRelative), "a lens coefficient changed");
}

void RequireSameRig(const geometry::Rig& a, const geometry::Rig& b) {
  Require(a.cameras.size() == b.cameras.size(), "the number of cameras changed");
  for (const geometry::RigCamera& camera : a.cameras) {
    const int idx = b.Find(camera.camera.name);
    Require(idx >= 0, "the camera '" + camera.camera.name + "' is gone");
    const geometry::RigCamera& other = b.cameras[static_cast<size_t>(idx)];
    RequireSameLens(camera.camera, other.camera);
    const double angle = camera.cam_from_world.rotation.angularDistance(other.cam_from_world.rotation);
    Require(angle <= 1e-6, "a rotation changed");
    const Eigen::Vector3d t = camera.cam_from_world.translation, u = other.cam_from_world.translation;
    Require((t - u).norm() <= 1e-6 * std::max(t.norm(), u.norm()), "a translation changed");
  }
}

void RequireValid(const geometry::Rig& rig) {
  Require(!rig.cameras.empty(), "a rig without cameras was accepted");
  for (const geometry::RigCamera& camera : rig.cameras) {
    Require(geometry::WhyInvalidLens(camera.camera).empty(), "an invalid lens was accepted");
    Require(camera.cam_from_world.translation.allFinite(), "a translation that is not finite was accepted");
    Require(std::abs(camera.cam_from_world.rotation.norm() - 1) < 1e-6, "a rotation of norm other than 1 was accepted");
  }
}

/// Numbers of studios: beyond them a chain of transforms loses what the comparison asks for.
bool IsOrdinary(const geometry::Rig& rig) {
  for (const geometry::RigCamera& camera : rig.cameras) {
    const double distance = camera.cam_from_world.translation.norm(), largest = camera.camera.params.cwiseAbs().maxCoeff();
    if (!(distance < 1e6) || !(largest < 1e6) || !(distance == 0 || distance > 1e-6)) return false;
  }
  return true;
}

/// The files that a reader is given back: EasyMocap's both, of COLMAP's text the cameras, of its binary model the folder.
std::vector<std::string> FilesToRead(CalibrationFormat format, const std::string& path) {
  if (format == CalibrationFormat::kEasyMocap) return {path + "/intri.yml", path + "/extri.yml"};
  if (format == CalibrationFormat::kColmapText) return {path + "/cameras.txt"};
  return {path};
}

/// Refusing a name or a mixture of lenses is the writer's right.
void RequireRoundTrip(const geometry::Rig& rig, CalibrationFormat format, const std::string& name) {
  const bool on_disk = format == CalibrationFormat::kColmap;
  const std::string path = on_disk ? ScratchFolder(name) : MemoryPath(name);
  const bool written = Accepts([&] { calib::WriteCalibration(rig, format, path); });
  if (!written || !IsOrdinary(rig)) return;
  ImportedRig back;
  const bool read = Accepts([&] { back = calib::ReadCalibration(format, FilesToRead(format, path)); });
  Require(read, "what was written cannot be read");
  RequireSameRig(rig, back.rig);
}

void RunFormat(CalibrationFormat format, const std::vector<std::string>& paths, const std::string& written_name) {
  ImportedRig imported;
  calib::ReadOptions options;
  options.width_px = 640, options.height_px = 480;
  if (!Accepts([&] { imported = calib::ReadCalibration(format, paths, options); })) return;
  RequireValid(imported.rig);
  Require(!geometry::RigToJsonText(imported.rig).empty(), "not writable as our own calibration");
  RequireRoundTrip(imported.rig, format, written_name);
}

}  // namespace

MVS_FUZZ_TARGET(calibration_json, bytes) {
  geometry::Rig rig;
  if (!Accepts([&] { rig = geometry::RigFromJsonText(std::string(bytes), "calibration.json"); })) return;
  RequireValid(rig);
  const std::string text = geometry::RigToJsonText(rig);
  Require(geometry::RigToJsonText(geometry::RigFromJsonText(text, "again")) == text, "numbers change on the way");
}

MVS_FUZZ_TARGET(toml, bytes) { RunFormat(CalibrationFormat::kToml, {InMemory("in.toml", bytes)}, "out.toml"); }

MVS_FUZZ_TARGET(caliscope, bytes) { RunFormat(CalibrationFormat::kCaliscope, {InMemory("in.toml", bytes)}, "out.toml"); }

MVS_FUZZ_TARGET(qca, bytes) { RunFormat(CalibrationFormat::kQca, {InMemory("in.qca.txt", bytes)}, "out.qca.txt"); }

MVS_FUZZ_TARGET(opencv_yaml, bytes) { RunFormat(CalibrationFormat::kOpenCvYaml, {InMemory("camera.yml", bytes)}, "out.yml"); }

MVS_FUZZ_TARGET(mrcal, bytes) { RunFormat(CalibrationFormat::kMrcal, {InMemory("cam.cameramodel", bytes)}, "cam.cameramodel"); }

MVS_FUZZ_TARGET(nerfstudio, bytes) { RunFormat(CalibrationFormat::kNerfstudio, {InMemory("in.json", bytes)}, "out.json"); }

MVS_FUZZ_TARGET(kalibr, bytes) { RunFormat(CalibrationFormat::kKalibr, {InMemory("in.yaml", bytes)}, "out.yaml"); }

MVS_FUZZ_TARGET(easymocap, bytes) {
  const auto parts = Parts(bytes, 2);
  RunFormat(CalibrationFormat::kEasyMocap, {InMemory("in/intri.yml", parts[0]), InMemory("in/extri.yml", parts[1])}, "out");
}

MVS_FUZZ_TARGET(colmap_text, bytes) {
  const auto parts = Parts(bytes, 2);
  InMemory("in/images.txt", parts[1]);
  RunFormat(CalibrationFormat::kColmapText, {InMemory("in/cameras.txt", parts[0])}, "out");
}

MVS_FUZZ_TARGET(colmap_binary, bytes) {
  const auto parts = Parts(bytes, 2);
  const std::string folder = ScratchFolder("colmap");
  Scratch("colmap/cameras.bin", parts[0]);
  Scratch("colmap/images.bin", parts[1]);
  RunFormat(CalibrationFormat::kColmap, {folder}, "colmap-out");
}

MVS_FUZZ_TARGET(detect_format, bytes) {
  const std::string path = InMemory("in.txt", bytes);
  Accepts([&] { calib::DetectFormat(path); });
}

MVS_FUZZ_TARGET(board_text, bytes) {
  calib::Board board;
  if (!Accepts([&] { board = calib::ParseBoard(std::string(bytes)); })) return;
  Require(calib::ThicknessUnknown(board) || calib::CornersInBoard(board).allFinite(), "a corner is not finite");
  const std::string text = calib::ToString(board);
  Require(calib::ToString(calib::ParseBoard(text)) == text, "the text of the board changes: " + text);
}

}  // namespace mvstudio::fuzz
