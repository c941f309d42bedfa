#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "calib/corner_files.h"
#include "calib/formats.h"
#include "core/error.h"
#include "dataset/panoptic.h"
#include "dataset/pose2d.h"
#include "dataset/pose3d.h"
#include "dataset/pose3d_trc.h"
#include "dataset/session.h"
#include "dataset/sync_file.h"
#include "geometry/rig_io.h"
#include "tests/support/hostile_files.h"
#include "tests/support/memory_folder.h"
#include "tests/support/run_cli.h"

/// Every reader that the command line opens files with, called directly: cut at every byte, and every kind of damage. A reader
/// may accept or throw one of our errors about files; anything else, a crash included, fails. libFuzzer goes on where this ends
/// (docs/fuzzing.md) and starts from the same files.
namespace mvstudio::testing {
namespace {

[[maybe_unused]] const bool kInMemory = TempFoldersInMemory();

namespace fs = std::filesystem;

struct Reader {
  std::string name;
  std::string seed;  ///< below fuzz/seeds
  std::string file;  ///< name that the reader expects
  bool json = false;
  std::function<void(const std::string& path)> read;
};

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
            options.format = format;
            if (format == "vnl") options.board = calib::ParseBoard("grid:2x2:10mm");
            calib::ReadCornerFile(path, options);
          }};
}

std::vector<Reader> Readers() {
  using Format = calib::CalibrationFormat;
  const auto openpose = [](const std::string& path) {
    dataset::ReadOpenPoseFolder(fs::path(path).parent_path().string(), "cam", body::SkeletonByName("body25"));
  };
  const auto results = [](const std::string& path) { dataset::ReadPoseResults(path, "cam", body::SkeletonByName("coco17")); };
  return {{"calibration", "calibration_json/perspective.json", "a.json", true,
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
          {"openpose", "openpose_json/two.json", "cam_0_keypoints.json", true, openpose},
          {"coco", "pose_results_json/coco.json", "a.json", true, results},
          {"mmpose", "pose_results_json/mmpose.json", "a.json", true, results},
          {"points2d", "pose2d_csv/points.csv", "a.csv", false, [](const std::string& path) { dataset::ReadPose2dCsv(path); }},
          {"trc", "trc/two.trc", "a.trc", false, [](const std::string& path) { dataset::ReadTrc(path); }},
          {"sync", "sync_json/two.json", "sync.json", true, [](const std::string& path) { dataset::ReadSync(path); }},
          {"session", "session_toml/full.toml", "mvstudio.toml", false,
           [](const std::string& path) { dataset::ReadSession(path); }},
          {"panoptic", "panoptic_calibration/two.json", "calibration_a.json", true,
           [](const std::string& path) { dataset::ReadPanopticCalibration(path); }},
          {"any", "panoptic_calibration/flat.json", "calibration_a.json", true,
           [](const std::string& path) { dataset::ReadAnyCalibration(path); }},
          {"scene", "body3d_scene/two.json", "body3DScene_00000001.json", true,
           [](const std::string& path) { dataset::ReadBody3dSceneFile(path); }}};
}

class HostileReaders : public ::testing::TestWithParam<Reader> {
 protected:
  static std::string SeedPath() {
    const char* source = std::getenv("MVSTUDIO_SOURCE");
    return std::string(source ? source : ".") + "/fuzz/seeds/" + GetParam().seed;
  }
  static std::string Seed() { return Slurp(SeedPath()); }

  /// True when it is accepted. Errors about files and usage are fine, all else is a failure that names `what`.
  bool Accepts(const std::string& text, const std::string& what) {
    const std::string path = folder_ / GetParam().file;
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
    try {
      GetParam().read(path);
      return true;
    } catch (const FormatError&) {
    } catch (const IoError&) {
    } catch (const UsageError&) {
    } catch (const std::exception& error) {
      ADD_FAILURE() << GetParam().name << ", " << what << ": " << error.what();
    }
    return false;
  }

  TempDir folder_;
};

TEST_P(HostileReaders, AcceptsItsSeed) {
  const std::string seed = Seed();
  ASSERT_FALSE(seed.empty()) << GetParam().seed;
  EXPECT_TRUE(Accepts(seed, "the seed itself"));
}

/// The other seeds of the format, among them inputs that once broke the reader.
TEST_P(HostileReaders, EverySeedOfItsFormat) {
  for (const auto& entry : fs::directory_iterator(fs::path(SeedPath()).parent_path())) {
    Accepts(Slurp(entry.path().string()), entry.path().string());
  }
}

TEST_P(HostileReaders, CutAtEveryByte) {
  const std::string seed = Seed();
  const size_t whole = seed.find_last_not_of(" \r\n") + 1;
  for (size_t size = 0; size < whole; ++size) {
    const bool accepted = Accepts(seed.substr(0, size), "cut at byte " + std::to_string(size));
    EXPECT_FALSE(accepted && GetParam().json) << GetParam().name << " accepts what is cut at byte " << size;
  }
}

TEST_P(HostileReaders, EveryByteReplaced) {
  const std::string seed = Seed();
  for (const char byte : {'\0', '\xff', '{', '"', '9', '-', '\n'}) {
    for (size_t at = 0; at < seed.size(); at += seed.size() / 100 + 1) {
      std::string text = seed;
      text[at] = byte;
      Accepts(text, "byte " + std::to_string(at) + " replaced by " + std::to_string(byte));
    }
  }
}

TEST_P(HostileReaders, EveryKindOfDamage) {
  for (const auto& [name, text] : HostileJson(Seed())) {
    const bool accepted = Accepts(text, name);
    EXPECT_FALSE(accepted && GetParam().json) << GetParam().name << " accepts " << name;
  }
}

TEST_P(HostileReaders, ByteOrderMark) { Accepts("\xef\xbb\xbf" + Seed(), "byte-order mark"); }

std::string TestName(const ::testing::TestParamInfo<Reader>& test) {
  std::string name = test.param.name;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), TestName);

}  // namespace
}  // namespace mvstudio::testing
