#include "dataset/exports/read/layout_read.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "calib/formats/format_camera.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/exports/export.h"
#include "dataset/exports/read/layout_cameras.h"

namespace mvstudio::exports {
namespace fs = std::filesystem;
namespace {

using calib::CalibrationFormat;

[[noreturn]] void FailJoints(const std::string& path, const std::string& what) {
  throw FormatError(path, "",
                    what +
                        " holds joints and no cameras; the calibration is what the joints were triangulated with, or what "
                        "`mvstudio dataset export` writes as colmap, nerfstudio, npz, …");
}

/// The first kilobytes.
std::string HeadOf(const std::string& path) {
  constexpr size_t kBytes = 1 << 16;
  std::ifstream stream(path, std::ios::binary);
  std::string head(kBytes, '\0');
  stream.read(head.data(), kBytes);
  head.resize(static_cast<size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
  return head;
}

/// Of a frame's folder where the export has several time steps.
std::string FirstModel(const std::string& folder) {
  for (const std::string& name : NamesIn(folder)) {
    if (name.compare(0, 6, "frame_") == 0 && fs::is_directory(folder + "/" + name)) return folder + "/" + name;
  }
  return folder;
}

std::optional<Layout> DetectExport(const std::string& folder) {
  const std::string name = internal::FormatOfExport(folder);
  if (name.empty()) return std::nullopt;
  if (name == "trc" || name == "c3d" || name == "bvh" || name == "csv") FailJoints(folder, "this export, " + name + ",");
  if (name == "ros") {
    throw FormatError(folder, "",
                      "ROS's camera_info files hold lenses and no poses: they are no rig; name one of the .yaml files");
  }
  if (name == "mcap")
    throw FormatError(folder, "",
                      "MCAP files hold cameras as messages, which are not read: name the dataset that was exported");
  if (name == "colmap") return Layout{CalibrationFormat::kColmap, FirstModel(folder) + "/sparse/0"};
  if (name == "nerfstudio") return Layout{CalibrationFormat::kNerfstudio, FirstModel(folder) + "/transforms.json"};
  if (name == "blender") return Layout{CalibrationFormat::kMvstudio, folder + "/calibration.json"};
  const auto format = calib::CalibrationFormatFromString(name);
  return format ? std::optional(Layout{*format, folder}) : std::nullopt;
}

std::optional<Layout> DetectFolder(const std::string& folder) {
  if (const auto of_export = DetectExport(folder)) return of_export;
  const auto has = [&](const char* name) { return fs::is_regular_file(folder + "/" + name); };
  for (const char* calibration : {"calibration.json", "intri.yml", "transforms.json", "cameras.bin", "cameras.txt"}) {
    if (has(calibration)) return std::nullopt;  // of a program that keeps its calibration by itself
  }
  if (has("annots.npy")) return Layout{CalibrationFormat::kZju, folder};
  if (has("train_meta.json")) return Layout{CalibrationFormat::kDynamic3dgs, folder};
  if (has("joints.npz")) return Layout{CalibrationFormat::kNpz, folder};
  if (has("rig.ply")) return Layout{CalibrationFormat::kPly, folder};
  if (has("cameras.json") && HeadOf(folder + "/cameras.json").find("\"kinect_color_") != std::string::npos)
    return Layout{CalibrationFormat::kHumman, folder};
  if (!internal::AnnotationsIn(folder).empty()) return Layout{CalibrationFormat::kDna, folder};
  if (!internal::CalibrationCsvIn(folder).empty()) return Layout{CalibrationFormat::kActorsHq, folder};
  if (!FilesNamed(folder, "", ".glb").empty() || !FilesNamed(folder, "", ".gltf").empty())
    return Layout{CalibrationFormat::kGltf, folder};
  return std::nullopt;
}

bool IsJoints(const std::string& head) {
  return head.compare(0, 9, "HIERARCHY") == 0 || head.compare(0, 12, "PathFileType") == 0 ||
         head.compare(0, 19, "frame,person,joint,") == 0 || (head.size() >= 512 && head[0] == 2 && head[1] == 0x50);
}

std::optional<CalibrationFormat> DetectFile(const std::string& path) {
  const std::string head = HeadOf(path);
  const auto begins = [&](const std::string& text) { return head.compare(0, text.size(), text) == 0; };
  const auto has = [&](const char* text) { return head.find(text) != std::string::npos; };
  if (IsJoints(head)) FailJoints(path, "the file");
  if (begins("\x93NUMPY")) return CalibrationFormat::kZju;
  if (begins("PK\x03\x04")) return CalibrationFormat::kNpz;
  if (begins("\x89HDF\r\n\x1a\n")) return CalibrationFormat::kDna;
  if (begins("glTF")) return CalibrationFormat::kGltf;
  if (begins("ply\n") || begins("ply\r")) return CalibrationFormat::kPly;
  if (begins("name,w,h,rx,ry,rz,")) return CalibrationFormat::kActorsHq;
  const size_t start = head.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (start == std::string::npos || head[start] != '{') return std::nullopt;
  if (has("\"kinect_color_")) return CalibrationFormat::kHumman;
  if (has("\"asset\"") && has("\"cameras\"") && has("\"yfov\"")) return CalibrationFormat::kGltf;
  // Its keys come after lists of any length.
  const std::string name = fs::path(path).filename().string();
  const bool meta = has("\"w2c\"") && has("\"cam_id\"");
  return meta || name == "train_meta.json" || name == "test_meta.json" ? std::optional(CalibrationFormat::kDynamic3dgs)
                                                                       : std::nullopt;
}

geometry::Rig RigOfLayout(CalibrationFormat format, const std::string& path, const calib::ReadOptions& options) {
  switch (format) {
    case CalibrationFormat::kZju:
      return internal::ReadZju(path, options);
    case CalibrationFormat::kActorsHq:
      return internal::ReadActorsHq(path, options);
    case CalibrationFormat::kDynamic3dgs:
      return internal::ReadDynamic3dgs(path, options);
    case CalibrationFormat::kDna:
      return internal::ReadDna(path, options);
    case CalibrationFormat::kHumman:
      return internal::ReadHumman(path, options);
    case CalibrationFormat::kNpz:
      return internal::ReadNpzCameras(path, options);
    case CalibrationFormat::kGltf:
      return internal::ReadGltf(path, options);
    case CalibrationFormat::kPly:
      return internal::ReadPlyRig(path, options);
    default:
      throw ContractViolation(std::string(ToString(format)) + " is no layout of a dataset");
  }
}

/// The layouts that state a unit; the others are in metres by their documentation alone.
bool HasOwnUnit(CalibrationFormat format) { return format == CalibrationFormat::kZju || format == CalibrationFormat::kPly; }

}  // namespace

std::optional<Layout> DetectLayout(const std::string& path) {
  if (fs::is_directory(path)) return DetectFolder(path);
  if (!fs::is_regular_file(path)) return std::nullopt;
  if (fs::path(path).filename() == "export.json") {
    const std::string folder = internal::FolderOf(path, 0);
    if (const auto of_export = DetectExport(folder)) return of_export;
  }
  const auto format = DetectFile(path);
  return format ? std::optional(Layout{*format, path}) : std::nullopt;
}

calib::ImportedRig ReadLayout(CalibrationFormat format, const std::string& path, const calib::ReadOptions& options) {
  if (HasOwnUnit(format) && options.metres_per_unit != 1) {
    throw UsageError("option 'unit': " + std::string(ToString(format)) + " has a unit of its own, " +
                     (format == CalibrationFormat::kZju ? "millimetres" : "metres"));
  }
  calib::ImportedRig imported{RigOfLayout(format, path, options), {}};
  imported.rig.gauge = geometry::RigGauge::Other("the world of " + std::string(ToString(format)));
  if (!HasOwnUnit(format) && internal::FormatOfExport(internal::FolderOf(path, 0)).empty())
    imported.notes.push_back(calib::internal::UnitNote(options.metres_per_unit));
  if (format == CalibrationFormat::kHumman)
    imported.notes.push_back({"CAL-WORLDLOST", "HuMMan's first camera is the world", ""});
  return imported;
}

}  // namespace mvstudio::exports
