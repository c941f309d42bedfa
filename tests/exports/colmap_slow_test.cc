#include <regex>

#include "core/disk/paths.h"
#include "tests/exports/fixture.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// The program `colmap` itself opens the export, triangulates its own features with our cameras and undistorts our images.
namespace mvstudio::exports::testing {
namespace {

namespace fs = std::filesystem;

#define MVS_NEEDS_COLMAP() \
  if (std::system("command -v colmap >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs the program colmap"

/// Runs `colmap COMMAND --flag value…`; returns its output, "" when it fails.
std::string Colmap(const std::string& command, const std::vector<std::pair<std::string, std::string>>& flags) {
  const TempDir folder;
  std::string line = "QT_QPA_PLATFORM=offscreen colmap " + command;
  for (const auto& [flag, value] : flags) line += " --" + flag + " " + ShellQuote(value);
  const int status = std::system((line + " >" + (folder / "log") + " 2>&1").c_str());
  const std::string log = Slurp(folder / "log");
  EXPECT_EQ(status, 0) << line << "\n" << log;
  return log;
}

/// The last number after `label` in colmap's output; NaN when it is not there.
double Figure(const std::string& log, const std::string& label) {
  const std::regex pattern(label + "\\s*[:=]\\s*([-+0-9.e]+)");
  double value = std::nan("");
  for (auto it = std::sregex_iterator(log.begin(), log.end(), pattern); it != std::sregex_iterator(); ++it) {
    value = std::strtod((*it)[1].str().c_str(), nullptr);
  }
  return value;
}

/// Mean reprojection error of a model's points by COLMAP's own projection: an adjustment that may not move anything.
double InitialErrorPx(const std::string& model, const std::string& out) {
  MakeFolder(out);
  const std::string log = Colmap("bundle_adjuster", {{"input_path", model},
                                                     {"output_path", out},
                                                     {"BundleAdjustment.max_num_iterations", "1"},
                                                     {"BundleAdjustment.refine_focal_length", "0"},
                                                     {"BundleAdjustment.refine_extra_params", "0"}});
  return Figure(log, "Initial cost");
}

TEST(ColmapProgram, AgreesWithEveryTrackOfADistortedRig) {
  MVS_NEEDS_COLMAP();
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  const ExportReport report = ExportDataset(dataset, "colmap", folder / "out", {});
  const std::string log = Colmap("model_analyzer", {{"path", folder / "out/sparse/0"}});
  EXPECT_EQ(Figure(log, "Registered images"), 5) << log;
  EXPECT_GT(report.points, 25);
  EXPECT_EQ(Figure(log, "Points"), report.points) << log;
  EXPECT_LT(Figure(log, "Mean reprojection error"), 1e-6) << log;
  EXPECT_LT(InitialErrorPx(folder / "out/sparse/0", folder / "adjusted"), 1e-6);
  // Its undistortion takes the FULL_OPENCV lenses.
  Colmap("image_undistorter",
         {{"image_path", folder / "out/images"}, {"input_path", folder / "out/sparse/0"}, {"output_path", folder / "flat"}});
  EXPECT_EQ(FilesMatching(folder / "flat/images/*.jpg").size(), 5u);
  EXPECT_GT(fs::file_size(folder / "flat/images/00_00.jpg"), 100u);
}

/// COLMAP's points from its own matches with the cameras of `model`; the log of its analyzer.
std::string Triangulate(const std::string& db, const std::string& images, const std::string& model, const std::string& out) {
  MakeFolder(out);
  Colmap("point_triangulator", {{"database_path", db},
                                {"image_path", images},
                                {"input_path", model},
                                {"output_path", out},
                                {"clear_points", "1"},
                                {"Mapper.ba_refine_focal_length", "0"},
                                {"Mapper.ba_refine_extra_params", "0"}});
  return Colmap("model_analyzer", {{"path", out}});
}

/// Few features, as a body of smooth colours seen from ten sides gives: matching is set to keep what it can, and the cameras
/// have to sort out what is true.
void MatchImages(const std::string& db, const std::string& folder) {
  Colmap("feature_extractor", {{"database_path", db},
                               {"image_path", folder + "/images"},
                               {"ImageReader.mask_path", folder + "/masks"},
                               {"ImageReader.single_camera_per_image", "1"},
                               {"ImageReader.camera_model", "PINHOLE"},
                               {"SiftExtraction.use_gpu", "0"},
                               {"SiftExtraction.num_threads", "2"}});
  Colmap("exhaustive_matcher", {{"database_path", db},
                                {"SiftMatching.use_gpu", "0"},
                                {"SiftMatching.num_threads", "2"},
                                {"SiftMatching.max_ratio", "0.9"},
                                {"SiftMatching.guided_matching", "1"},
                                {"SiftMatching.min_num_inliers", "8"}});
}

TEST(ColmapProgram, TriangulatesItsOwnFeaturesWithTheExportedCameras) {
  MVS_NEEDS_COLMAP();
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  dataset::PanopticDataset dataset = dataset::OpenPanopticDataset(DataRoot() + "/person_a");
  ASSERT_EQ(ExportDataset(dataset, "colmap", folder / "out", {}).images, 10);
  const std::string db = folder / "db", images = folder / "out/images";
  MatchImages(db, folder / "out");
  const std::string log = Triangulate(db, images, folder / "out/sparse/0", folder / "points");
  const double points = Figure(log, "Points"), error_px = Figure(log, "Mean reprojection error");
  RecordProperty("points", static_cast<int>(points));
  RecordProperty("mean_error_mpx", static_cast<int>(1000 * error_px));
  EXPECT_GE(points, 45) << log;
  EXPECT_LT(error_px, 1.4) << log;
  Colmap("image_undistorter", {{"image_path", images}, {"input_path", folder / "points"}, {"output_path", folder / "flat"}});
  EXPECT_EQ(FilesMatching(folder / "flat/images/*.jpg").size(), 10u);
  // The same matches with every pose at the wrong camera: what agrees by chance.
  const std::vector<geometry::RigCamera> right = dataset.rig.cameras;
  for (size_t i = 0; i < right.size(); ++i) {
    dataset.rig.cameras[i].cam_from_world = right[(i + 1) % right.size()].cam_from_world;
  }
  ExportDataset(dataset, "colmap", folder / "wrong", {});
  const std::string wrong = Triangulate(db, images, folder / "wrong/sparse/0", folder / "wrong-points");
  EXPECT_GT(points, 1.5 * Figure(wrong, "Points")) << wrong;
}

}  // namespace
}  // namespace mvstudio::exports::testing
