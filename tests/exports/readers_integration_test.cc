#include "tests/exports/fixture.h"
#include "tests/support/test.h"

/// Every format read back by tests/clients/export_readers.py, which knows only the public rules of the formats, and compared
/// with the dataset by projecting the joints.
namespace mvstudio::exports::testing {
namespace {

constexpr double kPinPx = 1e-6;

#define MVS_NEEDS_PYTHON() \
  if (Python().empty()) GTEST_SKIP() << "needs a python3 with numpy and h5py"

/// Exports the dataset in all of `formats` and reads it back. Returns what the client says, by format.
std::map<std::string, nlohmann::json> ExportAndRead(const TempDir& folder, const Setting& setting, ExportOptions options,
                                                    std::vector<std::string> formats = {}) {
  const std::string root = folder / "dataset";
  const dataset::PanopticDataset dataset = MakeDataset(root, setting);
  if (formats.empty()) {
    for (const FormatInfo& format : Formats()) formats.push_back(format.name);
  }
  options.hull_points = std::min(options.hull_points, 300);
  std::vector<Reading> readings;
  for (const std::string& format : formats) {
    const std::string out = folder / format;
    ExportDataset(dataset, format, out, options);
    readings.push_back({format, out, root});
  }
  std::string log;
  std::map<std::string, nlohmann::json> results;
  for (const nlohmann::json& result : ReadByClient(readings, &log)) results[result["format"]] = result;
  EXPECT_EQ(results.size(), formats.size()) << log;
  for (const auto& [format, result] : results) {
    EXPECT_TRUE(result["faults"].empty()) << format << ": " << result["faults"];
  }
  return results;
}

void ExpectPinned(const std::map<std::string, nlohmann::json>& results, bool nobody = false) {
  for (const auto& [format, result] : results) {
    SCOPED_TRACE(format + " " + result.dump());
    // Joints in floats; fixed bones.
    const bool single_precision = format == "c3d" || format == "bvh" || format == "mcap";
    if (!single_precision) {
      EXPECT_LT(result["max_px"].get<double>(), kPinPx);
      EXPECT_LT(result["max_m"].get<double>(), 1e-6);
    }
    if (!nobody && format != "bvh") {
      EXPECT_GT(result["pixels"].get<int>(), 0);
    }
    for (const char* key : {"track_px", "annots_px", "keypoints2d_px"}) {
      if (result.contains(key)) {
        EXPECT_LT(result[key].get<double>(), kPinPx);
      }
    }
  }
}

TEST(Readers, PinholeRig) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  const auto results = ExportAndRead(folder, {}, {});
  ExpectPinned(results);
  EXPECT_LT(results.at("c3d")["max_m"].get<double>(), 1e-6);
  EXPECT_GT(results.at("colmap")["points"].get<int>(), 25);
  EXPECT_LT(results.at("colmap")["at_joints"].get<int>(), 2);  // the surface, not the skeleton
  EXPECT_GT(results.at("dynamic3dgs")["points"].get<int>(), 20);
}

TEST(Readers, BrownRigWithK3) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  ExportOptions options;
  options.undistort_view = dataset::UndistortView::kAll;  // no joint that the footage shows is lost
  ExpectPinned(ExportAndRead(folder, setting, options));
}

TEST(Readers, EverythingUndistortedFrameByFrame) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  ExportOptions options;
  options.undistort = ExportUndistort::kAlways;
  options.all_frames = true;
  options.images = ExportImages::kCopy;
  ExpectPinned(ExportAndRead(folder, setting, options, {"colmap", "nerfstudio", "zju", "easymocap", "dna", "npz", "gltf"}));
}

TEST(Readers, TwoPeopleWithHoles) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.people = 2;
  setting.missing_joints = true;
  setting.masks = false;
  const auto results = ExportAndRead(folder, setting, {});
  ExpectPinned(results);
  EXPECT_GT(results.at("colmap")["points"].get<int>(), 60);  // along the bones
  EXPECT_GT(results.at("colmap")["at_joints"].get<int>(), 20);
}

TEST(Readers, ColmapWithoutHullPointsHasTheJoints) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  ExportOptions options;
  options.hull_points = 0;
  const auto results = ExportAndRead(folder, {}, options, {"colmap"});
  ExpectPinned(results);
  EXPECT_EQ(results.at("colmap")["points"], 19);
  EXPECT_EQ(results.at("colmap")["at_joints"], 19);
}

/// The loader of Gaussian splatting takes PINHOLE alone.
TEST(Readers, ColmapIsOfPinholesWhereAskedFor) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  ExportOptions options;
  EXPECT_FALSE(ExportAndRead(folder, setting, options, {"colmap"}).at("colmap")["pinhole"].get<bool>());
  options.undistort = ExportUndistort::kAlways;
  options.overwrite = true;
  EXPECT_TRUE(ExportAndRead(folder, setting, options, {"colmap"}).at("colmap")["pinhole"].get<bool>());
}

TEST(Readers, Nobody) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.people = 0;
  ExpectPinned(ExportAndRead(folder, setting, {},
                             {"colmap", "nerfstudio", "zju", "easymocap", "actorshq", "dynamic3dgs", "dna", "humman", "npz",
                              "gltf", "ply"}),
               true);
}

TEST(Readers, CameraAtTheOriginAndHalfTurns) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.odd_poses = true;
  setting.origin = {0.2, 0.1, 2.5};
  ExpectPinned(ExportAndRead(folder, setting, {}));
}

TEST(Readers, TenKilometresFromTheOrigin) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.origin = {10000, -8000, 30};
  setting.distorted = true;
  ExportOptions options;
  options.undistort_view = dataset::UndistortView::kAll;
  const auto results = ExportAndRead(folder, setting, options);
  ExpectPinned(results);
  // A float holds 10 km to half a millimetre: said, not hidden.
  EXPECT_GT(results.at("c3d")["max_m"].get<double>(), 1e-5);
  EXPECT_LT(results.at("c3d")["max_m"].get<double>(), 2e-3);
  const dataset::PanopticDataset dataset = dataset::OpenPanopticDataset(folder / "dataset");
  const ExportReport report = ExportDataset(dataset, "c3d", folder / "again", {});
  ASSERT_EQ(report.figures.at(0).first, "max_rounding_mm");
  EXPECT_NEAR(report.figures[0].second, 1000 * results.at("c3d")["max_m"].get<double>(), 0.3);
  ASSERT_FALSE(report.notes.empty());
  EXPECT_EQ(report.notes[0].code, "EXP-ROUNDED");
}

TEST(Readers, HundredAndTwentyCameras) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.cameras = 120;
  setting.width = 32, setting.height = 24;
  setting.frames = {7};
  ExpectPinned(ExportAndRead(folder, setting, {},
                             {"colmap", "nerfstudio", "zju", "easymocap", "actorshq", "dynamic3dgs", "dna", "gltf", "ply"}));
}

TEST(Readers, SplitGoesWhereTheFormatHasIt) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  Setting setting;
  setting.frames = {10, 11, 12, 13};
  MakeDataset(folder / "dataset", setting);
  dataset::Split split;
  split.dataset = "test";
  split.rule = "by hand";
  split.train = {{"00_00", "00_02", "00_03"}, {10, 11}};
  split.test = {{"00_01", "00_04"}, {12, 13}};
  dataset::WriteSplit(split, folder / "split.json");
  ExportOptions options;
  options.split = folder / "split.json";
  const auto results = ExportAndRead(folder, setting, options, {"colmap", "nerfstudio", "dynamic3dgs"});
  ExpectPinned(results);
  EXPECT_EQ(results.at("dynamic3dgs")["train"], 3);
  EXPECT_EQ(results.at("dynamic3dgs")["test"], 2);
  EXPECT_EQ(ReadFile(folder / "colmap/sparse/0/test.txt"), "00_01.jpg\n00_04.jpg\n");
  const auto transforms = nlohmann::json::parse(ReadFile(folder / "nerfstudio/transforms.json"));
  EXPECT_EQ(transforms["train_filenames"].size(), 3u);
  EXPECT_EQ(transforms["test_filenames"], (nlohmann::json{"images/00_01.jpg", "images/00_04.jpg"}));
  EXPECT_TRUE(std::filesystem::exists(folder / "dynamic3dgs/split.json"));
}

}  // namespace
}  // namespace mvstudio::exports::testing
