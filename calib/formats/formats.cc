#include "calib/formats/formats.h"

#include <algorithm>
#include <filesystem>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/opencv_yaml.h"
#include "calib/formats/photogrammetry.h"
#include "calib/formats/rig_tables.h"
#include "calib/formats/slam.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "core/label.h"
#include "core/text/words.h"
#include "geometry/rig/foreign_layout.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::calib {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNames[] = {
    "mvstudio", "panoptic",  "toml", "caliscope", "qca",         "opencv", "mrcal",  "colmap", "colmap-text", "nerfstudio",
    "kalibr",   "easymocap", "zju",  "actorshq",  "dynamic3dgs", "dna",    "humman", "npz",    "gltf",        "ply"};

[[noreturn]] void Unknown(const std::string& path, std::string_view text = {}) {
  const std::string layout = geometry::ForeignLayout(text);
  throw FormatError(path, "",
                    "not a calibration that is known here" + (layout.empty() ? "" : "; it looks like " + layout) +
                        "; known are " + Join(kNames, ", ") +
                        ", to be named with option 'from'; cameras of any other program can be given as JSON, by name: "
                        "{\"cam1\": {\"K\": 3x3, \"dist\": [k1, k2, p1, p2, k3], \"R\": 3x3, \"T\": [x, y, z], \"image_size\": "
                        "[width, height]}}, x_camera = R x_world + T");
}

/// How names of files end that hold a camera each (internal::ReadMatrixText), as the first one's content says; of a folder of
/// others OpenCV's ending.
std::string OneCameraFilesIn(const std::string& folder) {
  for (const char* ending : {".krtd", ".camera", "_cam.txt", "_P.txt"}) {
    const std::vector<std::string> files =
        fs::is_directory(folder) ? FilesNamed(folder, "", ending) : std::vector<std::string>();
    if (!files.empty() && internal::IsMatrixText(ReadFile(files[0]))) return ending;
  }
  return ".yml";
}

/// The format of a folder that holds the files themselves.
std::optional<CalibrationFormat> FormatOfFolder(const std::string& path) {
  const auto has = [&](const char* name) { return fs::exists(fs::path(path) / name); };
  if (has("cameras.bin") && has("images.bin")) return CalibrationFormat::kColmap;
  if (has("cameras.txt") && has("images.txt")) return CalibrationFormat::kColmapText;
  if (has("intri.yml")) return CalibrationFormat::kEasyMocap;
  if (has("transforms.json")) return CalibrationFormat::kNerfstudio;
  if (!FilesNamed(path, "", ".cameramodel").empty()) return CalibrationFormat::kMrcal;
  if (OneCameraFilesIn(path) != ".yml") return CalibrationFormat::kOpenCvYaml;
  return std::nullopt;
}

CalibrationFormat DetectFolder(const std::string& path) {
  if (const auto format = FormatOfFolder(path)) return *format;
  throw FormatError(
      path, "",
      "no calibration is found in this folder: neither calibration.json, cameras and images of COLMAP (here or in "
      "sparse/0), transforms.json, intri.yml, *.cameramodel, *.krtd, *.camera, *_cam.txt, *_P.txt, nor one calibration_*.json; "
      "name the file");
}

/// The paths with folders replaced by the files in them that end in `extension`.
std::vector<std::string> FilesOf(const std::vector<std::string>& paths, const std::string& extension) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    const std::vector<std::string> inside = FilesNamed(path, "", extension);
    if (inside.empty()) throw FormatError(path, "", "there is no *" + extension + " in this folder");
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

/// Names stand in tables, on terminals and in names of files: no format's reader lets through what could not be written again.
void CheckNames(const geometry::Rig& rig, const std::string& path) {
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const std::string& name = rig.cameras[i].camera.name;
    const std::string why = WhyNotALabel(name);
    if (why.empty()) continue;
    const std::string shown = internal::Printable(name.substr(0, 60)) + (name.size() > 60 ? "…" : "");
    throw FormatError(path, "camera " + std::to_string(i + 1), "the name '" + shown + "' " + why + "; give the camera another");
  }
}

ImportedRig ReadAs(CalibrationFormat format, const std::vector<std::string>& paths, const ReadOptions& options) {
  switch (format) {
    case CalibrationFormat::kToml:
    case CalibrationFormat::kCaliscope:
      return ReadToml(paths[0], options);
    case CalibrationFormat::kQca:
      return ReadQca(paths[0], options);
    case CalibrationFormat::kOpenCvYaml:
      return ReadOpenCvYaml(FilesOf(paths, OneCameraFilesIn(paths[0])), options);
    case CalibrationFormat::kMrcal:
      return ReadMrcal(FilesOf(paths, ".cameramodel"), options);
    case CalibrationFormat::kColmap:
    case CalibrationFormat::kColmapText:
      return ReadColmap(paths[0], options);
    case CalibrationFormat::kNerfstudio:
      return ReadNerfstudio(paths[0], options);
    case CalibrationFormat::kKalibr:
      if (ReadFile(paths[0]).find("\"value0\"") != std::string::npos) {
        if (paths.size() > 1) throw UsageError(paths[1] + ": Basalt's calibration is one file");
        return internal::ReadBasalt(paths[0], options);
      }
      return ReadFile(paths[0]).find("T_BS:") == std::string::npos ? internal::ReadKalibrChains(paths, options)
                                                                   : ReadEuroc(paths, options);
    case CalibrationFormat::kEasyMocap:
      return ReadEasyMocap(paths, options);
    default:
      break;
  }
  if (IsDatasetLayout(format))
    throw UsageError(paths[0] + ": " + std::string(ToString(format)) + " is read by exports/read/layout_read.h");
  if (format == CalibrationFormat::kPanoptic)
    throw UsageError(paths[0] + ": Panoptic's calibration is read by dataset/panoptic/panoptic.h");
  return {geometry::ReadRig(paths[0]), {}};
}

}  // namespace

std::string_view ToString(CalibrationFormat format) { return kNames[static_cast<int>(format)]; }

std::optional<CalibrationFormat> CalibrationFormatFromString(std::string_view name) {
  for (size_t i = 0; i < std::size(kNames); ++i) {
    if (PlainWord(kNames[i]) == PlainWord(name)) return static_cast<CalibrationFormat>(i);
  }
  for (const char* toml : {"qualisys", "pose2sim", "aniposelib"}) {
    if (PlainWord(name) == toml) return CalibrationFormat::kToml;
  }
  return std::nullopt;
}

std::string CalibrationFormatNames() { return Join(kNames, ", "); }

std::string_view ToString(const std::optional<CalibrationFormat>& format) { return format ? ToString(*format) : "auto"; }

void FromString(const std::string& text, const std::string& option, std::optional<CalibrationFormat>* format) {
  const std::optional<CalibrationFormat> named = CalibrationFormatFromString(text);
  if (!named && PlainWord(text) != "auto")
    throw UsageError("option '" + option + "' " + text + ": expected auto, " + CalibrationFormatNames());
  *format = named;
}

std::string CalibrationIn(const std::string& path) {
  if (!fs::is_directory(path)) return path;
  const std::string own = path + "/calibration.json";
  if (fs::is_regular_file(own)) return own;
  if (FormatOfFolder(path)) return path;
  for (const char* inside : {"sparse/0", "sparse", "colmap/sparse/0", "0"}) {
    const std::string model = (fs::path(path) / inside).string();
    if (fs::is_directory(model) && FormatOfFolder(model)) return model;
  }
  const std::vector<std::string> panoptic = FilesNamed(path, "calibration_", ".json");
  return panoptic.size() == 1 ? panoptic[0] : path;
}

CalibrationFormat DetectFormat(const std::string& path) {
  if (fs::is_directory(path)) return DetectFolder(path);
  const std::string name = fs::path(path).filename().string();
  if (name == "cameras.bin") return CalibrationFormat::kColmap;
  const std::string text = ReadFile(path);
  const auto has = [&](const char* piece) { return text.find(piece) != std::string::npos; };
  const size_t start = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (start == std::string::npos) throw FormatError(path, "", "the file is empty");
  if (has("'lensmodel'") || has("\"lensmodel\"")) return CalibrationFormat::kMrcal;
  const bool chain = has("camera_model:") && has("cam0:");  // OpenVINS heads Kalibr's files as OpenCV's, Kimera EuRoC's
  const bool euroc = has("camera_model:") && has("T_BS:") && has("intrinsics:");
  if (text.compare(start, 5, "%YAML") == 0 && !chain && !euroc) {
    return has("\nK_") || has("\nRot_") ? CalibrationFormat::kEasyMocap : CalibrationFormat::kOpenCvYaml;
  }
  if (internal::IsMetashapeCameras(text) || internal::IsOpenMvg(text)) return CalibrationFormat::kOpenCvYaml;
  if (text[start] == '{') {
    if (has("transform_matrix")) return CalibrationFormat::kNerfstudio;
    if (has("\"value0\"") && has("\"T_imu_cam\"")) return CalibrationFormat::kKalibr;
    if (has("mvstudio.calibration")) return CalibrationFormat::kMvstudio;
    if (internal::IsMatlab(text) || internal::IsMultical(text)) return CalibrationFormat::kOpenCvYaml;
    if (internal::IsHuman36m(text) || internal::IsInterHand(text)) return CalibrationFormat::kOpenCvYaml;
    if (internal::HoldsCamerasByName(text)) return CalibrationFormat::kOpenCvYaml;
    if (has("\"camera_matrix") || has("\"cameraMatrix") || has("\"mtx")) return CalibrationFormat::kOpenCvYaml;
    const bool other_cameras = internal::IsJsonOfMatrices(text) && !has("\"resolution\"") && !has("\"panel\"");
    if (geometry::LooksLikePanoptic(text) && !other_cameras) return CalibrationFormat::kPanoptic;
    if (internal::IsJsonOfMatrices(text)) return CalibrationFormat::kOpenCvYaml;
    Unknown(path, text);
  }
  if (text[start] == '[' && has("\"img_name\"") && has("\"position\"")) return CalibrationFormat::kNerfstudio;
  if (text[start] == '[' && internal::IsJsonOfMatrices(text)) return CalibrationFormat::kOpenCvYaml;
  if (text[start] == '<' && has("<opencv_storage")) return CalibrationFormat::kOpenCvYaml;
  if (text[start] == '<' && has("<calibration") && has("<camera") && !geometry::IsMetashape(text))
    return CalibrationFormat::kQca;
  if (name == "cameras.txt" || has("# Camera list with one line of data per camera")) return CalibrationFormat::kColmapText;
  if (has("camera_matrix:") || has("mtx:") || internal::IsCameraInfo(text)) return CalibrationFormat::kOpenCvYaml;
  if (euroc || (has("intrinsics:") && (has("T_BS:") || chain))) return CalibrationFormat::kKalibr;
  if (fs::path(path).extension() == ".toml" || (has("matrix") && has("distortions"))) {
    return has("[cameras") ? CalibrationFormat::kCaliscope : CalibrationFormat::kToml;
  }
  if (internal::IsMatrixText(text)) return CalibrationFormat::kOpenCvYaml;
  Unknown(path, text);
}

ImportedRig ReadCalibration(CalibrationFormat format, const std::vector<std::string>& paths, const ReadOptions& options) {
  if (paths.empty()) throw UsageError("no calibration file given");
  const bool several = format == CalibrationFormat::kOpenCvYaml || format == CalibrationFormat::kMrcal ||
                       format == CalibrationFormat::kEasyMocap || format == CalibrationFormat::kKalibr;
  if (paths.size() > 1 && !several) {
    throw UsageError(
        paths[1] +
        ": only opencv, mrcal, easymocap, Kalibr's and EuRoC's calibrations may be spread over several files; give one "
        "alone (mvstudio calib compare A B puts two side by side)");
  }
  ImportedRig imported = ReadAs(format, paths, options);
  CheckNames(imported.rig, paths[0]);
  return imported;
}

}  // namespace mvstudio::calib
