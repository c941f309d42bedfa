#include <filesystem>

#include "avatar/body/files/person_file.h"
#include "calib/corners/corner_files.h"
#include "calib/detect/detection_cache.h"
#include "calib/formats/formats.h"
#include "calib/points/scene_points.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/npy.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "dataset/arrays/npz.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "dataset/session/session.h"
#include "dataset/time/sync_file.h"
#include "dataset/trackers/tracker_file.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/hostile_readers.h"

/// The readers that the command line opens files with, but for those of report/, detect/ and avatar/io/ (beside their tests).
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

using Reader = HostileReader;

calib::ReadOptions SizeOptions() {
  calib::ReadOptions options;
  options.width_px = 640, options.height_px = 480;
  return options;
}

Reader Calibration(const std::string& seed, const std::string& file, calib::CalibrationFormat format, bool json = false) {
  return {seed, seed, file, json, [format](const std::string& path) { calib::ReadCalibration(format, {path}, SizeOptions()); }};
}

Reader Corners(const std::string& seed, const std::string& format) {
  return {seed, seed, "corners.txt", false, [format](const std::string& path) {
            calib::CornerFileOptions options;
            FromString(format, &options.format);
            if (format == "vnl") options.board = calib::ParseBoard("grid:2x2:10mm");
            calib::ReadCornerFile(path, options);
          }};
}

/// With a right digest at the end, otherwise nothing behind it is read.
void ReadDetections(const std::string& path) {
  const std::string bytes = ReadFile(path), folder = fs::path(path).parent_path().string();
  fs::create_directory(folder + "/detections");
  std::ofstream(folder + "/detections/key.detections", std::ios::binary | std::ios::trunc)
      << bytes << Sha256Hex(bytes.data(), bytes.size());
  const auto footage = calib::DetectionCache(CacheIn(folder)).Load("key");
  if (!footage) throw FormatError(path, "", "is damaged");
  for (const auto& image : footage->images) {
    for (const calib::BoardDetection& board : image.layouts) {
      const Eigen::Index corners = board.detection.num_corners(), sigmas = board.detection.sigmas_px.size();
      EXPECT_TRUE(board.detection.points_px.cols() == corners && (sigmas == 0 || sigmas == corners));
    }
  }
}

std::vector<Reader> Readers() {
  using Format = calib::CalibrationFormat;
  const auto openpose = [](const std::string& path) {
    dataset::ReadOpenPoseFolder(fs::path(path).parent_path().string(), "cam", geometry::SkeletonByName("body25"));
  };
  const auto results = [](const std::string& path) {
    dataset::ReadPoseResults(path, "cam", geometry::SkeletonByName("coco17"));
  };
  return {
      {"calibration", "calibration_json/perspective.json", "a.json", true,
       [](const std::string& path) { geometry::ReadRig(path); }},
      {"wide", "calibration_json/wide.json", "a.json", true, [](const std::string& path) { geometry::ReadRig(path); }},
      Calibration("toml/pose2sim.toml", "a.toml", Format::kToml),
      Calibration("caliscope/camera_array.toml", "a.toml", Format::kCaliscope),
      Calibration("qca/qca.txt", "a.qca.txt", Format::kQca),
      Calibration("opencv_yaml/stereo.yml", "a.yml", Format::kOpenCvYaml),
      Calibration("mrcal/opencv8.cameramodel", "a.cameramodel", Format::kMrcal),
      Calibration("nerfstudio/transforms.json", "a.json", Format::kNerfstudio, true),
      Calibration("kalibr/camchain.yaml", "a.yaml", Format::kKalibr),
      Corners("corners_vnl/two.vnl", "vnl"),
      Corners("corners_caliscope/xy.csv", "caliscope"),
      Corners("corners_opencv/one.xml", "opencv"),
      Corners("corners_csv/two.csv", "csv"),
      {"openpose", "openpose_json/two.json", "cam_0_keypoints.json", true, openpose, -1, true},
      {"coco", "pose_results_json/coco.json", "a.json", true, results, -1, true},
      {"mmpose", "pose_results_json/mmpose.json", "a.json", true, results, -1, true},
      {"points2d", "pose2d_csv/points.csv", "a.csv", false, [](const std::string& path) { dataset::ReadPose2dCsv(path); }},
      {"deeplabcut", "deeplabcut_csv/two.csv", "a.csv", false,
       [](const std::string& path) { dataset::ReadTrackerFile(path, "cam"); }},
      {"sleap", "sleap_csv/two.csv", "a.csv", false, [](const std::string& path) { dataset::ReadTrackerFile(path, "cam"); }},
      {"xypoints", "caliscope_points/pose.csv", "a.csv", false,
       [](const std::string& path) { dataset::ReadCaliscopeCsv(path); }},
      {"c3d", "c3d/intel_floats.c3d", "a.c3d", false, [](const std::string& path) { dataset::ReadMarkers(path); }},
      {"trc", "trc/two.trc", "a.trc", false, [](const std::string& path) { dataset::ReadTrc(path); }},
      {"sync", "sync_json/two.json", "sync.json", true, [](const std::string& path) { dataset::ReadSync(path); }},
      {"session", "session_toml/full.toml", "mvstudio.toml", false,
       [](const std::string& path) { dataset::ReadSession(path); }},
      {"panoptic", "panoptic_calibration/two.json", "calibration_a.json", true,
       [](const std::string& path) { dataset::ReadPanopticCalibration(path); }},
      {"any", "panoptic_calibration/flat.json", "calibration_a.json", true,
       [](const std::string& path) { dataset::ReadAnyCalibration(path); }},
      {"scene", "body3d_scene/two.json", "body3DScene_00000001.json", true,
       [](const std::string& path) { dataset::ReadBody3dSceneFile(path); }, -1, true},
      {"marks", "scene_points/one.csv", "a.csv", false, [](const std::string& path) { calib::ReadScenePoints({path}); }},
      {"detections", "detection_cache/one.bin", "a.bin", false, ReadDetections},
      {"npy", "npy/doubles.npy", "a.npy", false, [](const std::string& path) { ReadNpy(path); }},
      {"npz", "npz/deflated.npz", "a.npz", false, [](const std::string& path) { dataset::ReadNpz(path); }},
      {"body", "npz/body.npz", "body.npz", false, [](const std::string& path) { body::ReadPersonFile(path); }},
      {"manifest", "manifest/three.json", "a.json", true,
       [](const std::string& path) { ManifestFromJsonText(ReadFile(path), path); }}};
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), HostileReaderName);

}  // namespace
}  // namespace mvstudio::testing
