#include <cmath>

#include "core/error.h"
#include "dataset/exports/export.h"
#include "dataset/footage/image_io.h"
#include "tests/exports/fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Masks as files, as an alpha channel, or not at all; images for loaders that know ideal pinholes only.
namespace mvstudio::exports::testing {
namespace {

namespace fs = std::filesystem;

#define MVS_NEEDS_PYTHON() \
  if (Python().empty()) GTEST_SKIP() << "needs a python3 with numpy and h5py"

ExportOptions ForSplatting() {
  ExportOptions options;
  options.masks = ExportMasks::kAlpha;
  options.undistort = ExportUndistort::kAlways;
  options.undistort_view = dataset::UndistortView::kCentred;
  options.hull_points = 200;
  return options;
}

nlohmann::json ReadOne(const std::string& format, const std::string& folder, const std::string& root) {
  std::string log;
  const std::vector<nlohmann::json> results = ReadByClient({{format, folder, root}}, &log);
  if (results.size() != 1) return {{"faults", {log}}};
  return results[0];
}

bool HasNote(const ExportReport& report, const std::string& code) {
  return std::any_of(report.notes.begin(), report.notes.end(), [&](const Notice& note) { return note.code == code; });
}

TEST(Masks, AlphaIsTheMaskAndOutsideIsBlack) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.masks = ExportMasks::kAlpha;
  for (const std::string format : {"colmap", "nerfstudio"}) {
    const ExportReport report = ExportDataset(dataset, format, folder / format, options);
    EXPECT_EQ(report.masks, 5);
    EXPECT_EQ(report.images, 5);
    EXPECT_TRUE(ReadOne(format, folder / format, folder / "d")["faults"].empty()) << format;
  }
  const Image source = dataset::ReadImage(dataset.ImagePath("00_02", 245)),
              mask = dataset::ReadImage(dataset.MaskPath("00_02", 245), true),
              written = dataset::ReadImage(folder / "colmap/images/00_02.png");
  int inside = 0;
  for (int i = 0; i < mask.width * mask.height; ++i) {
    for (int c = 0; c < 3; ++c) ASSERT_EQ(written.pixels[3 * i + c], mask.pixels[i] ? source.pixels[3 * i + c] : 0) << i;
    inside += mask.pixels[i] > 0;
  }
  EXPECT_GT(inside, 1000);
}

TEST(Masks, ImagesWithoutAMaskAreOpaqueAndCounted) {
  MVS_NEEDS_PYTHON();
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  fs::remove(dataset.MaskPath("00_01", 245));
  ExportOptions options;
  options.masks = ExportMasks::kAlpha;
  const ExportReport report = ExportDataset(dataset, "colmap", folder / "out", options);
  EXPECT_EQ(report.missing_masks, 1);
  EXPECT_EQ(report.masks, 4);
  EXPECT_THAT(report.notes.back().text, HasSubstr("1 masks are not in the dataset; these images are opaque"));
  const nlohmann::json result = ReadOne("colmap", folder / "out", folder / "d");
  EXPECT_TRUE(result["faults"].empty()) << result;
  EXPECT_EQ(result["opaque"][1], 1.0);
  EXPECT_LT(result["opaque"][0].get<double>(), 0.5);
}

TEST(Masks, NoneLeavesThemOut) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.masks = ExportMasks::kNone;
  for (const std::string format : {"colmap", "nerfstudio", "zju", "dynamic3dgs", "dna"}) {
    const ExportReport report = ExportDataset(dataset, format, folder / format, options);
    EXPECT_EQ(report.masks, 0) << format;
    EXPECT_EQ(report.missing_masks, 0) << format;
    EXPECT_GT(report.images, 0) << format;
    for (const char* name : {"masks", "mask", "seg"}) EXPECT_FALSE(fs::exists(folder / format + "/" + name)) << format;
  }
}

TEST(Masks, AlphaIsRefusedWhereNoReaderTakesIt) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.masks = ExportMasks::kAlpha;
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "zju", folder / "out", options); }),
              HasSubstr("readers of zju take no alpha channel; colmap and nerfstudio do"));
  options.images = ExportImages::kNone;
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "colmap", folder / "out", options); }),
              HasSubstr("needs images"));
  EXPECT_FALSE(fs::exists(folder / "out"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("black", &options.masks); }),
              HasSubstr("'masks' black: must be one of folder, alpha, none"));
}

TEST(Splatting, CentredImagesProjectAsItsLoaderBelieves) {
  MVS_NEEDS_PYTHON();
  for (const bool distorted : {false, true}) {
    const TempDir folder;
    Setting setting;
    setting.distorted = distorted;
    const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
    ExportOptions options = ForSplatting();
    ExportReport report = ExportDataset(dataset, "colmap", folder / "centred", options);
    nlohmann::json result = ReadOne("colmap", folder / "centred", folder / "d");
    EXPECT_TRUE(result["faults"].empty()) << result;
    EXPECT_TRUE(result["pinhole"].get<bool>());
    EXPECT_LT(result["splatting_px"].get<double>(), 1e-9);
    EXPECT_LT(result["max_px"].get<double>(), 1e-6);
    EXPECT_GT(result["points"].get<int>(), 20);
    EXPECT_FALSE(HasNote(report, "EXP-CENTRE") || HasNote(report, "EXP-LENS"));
    options.undistort_view = dataset::UndistortView::kInside;
    report = ExportDataset(dataset, "colmap", folder / "inside", options);
    EXPECT_TRUE(HasNote(report, "EXP-CENTRE"));
    EXPECT_GT(ReadOne("colmap", folder / "inside", folder / "d")["splatting_px"].get<double>(), 0.5);
  }
}

/// A soft dot where the lens sees a point.
void DrawDot(const Eigen::Vector2d& px, double sigma_px, Image* image) {
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const double level = 255 * std::exp(-(Eigen::Vector2d(x, y) - px).squaredNorm() / (2 * sigma_px * sigma_px));
      for (int c = 0; c < 3; ++c) {
        uint8_t& value = image->Pixel(x, y)[c];
        value = std::max(value, static_cast<uint8_t>(std::lround(level)));
      }
    }
  }
}

/// Centre of brightness within `reach` of `px`.
Eigen::Vector2d CentreOfDot(const Image& image, const Eigen::Vector2d& px, int reach) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  for (int y = static_cast<int>(px[1]) - reach; y <= px[1] + reach; ++y) {
    for (int x = static_cast<int>(px[0]) - reach; x <= px[0] + reach; ++x) {
      const double level = *image.Pixel(x, y);
      sum += level * Eigen::Vector2d(x, y), weight += level;
    }
  }
  return sum / weight;
}

/// The pinhole of a camera as export.json states it, which tests/clients reads from COLMAP's files, too.
geometry::Camera ExportedLens(const nlohmann::json& camera) {
  geometry::Camera lens = geometry::MakePinhole(camera["name"], camera["size_px"][0], camera["size_px"][1], 1);
  for (int i = 0; i < 4; ++i) lens.params[i] = camera["params"][i];
  return lens;
}

TEST(Splatting, KnownPointsAreWhereTheWrittenCamerasSeeThem) {
  const TempDir folder;
  Setting setting;
  setting.distorted = true, setting.width = 480, setting.height = 360, setting.frames = {3}, setting.cameras = 4;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0.9}, {0.4, 0.1, 1.3}, {-0.35, 0.2, 0.5}, {0.1, -0.4, 1.5}};
  for (const geometry::RigCamera& camera : dataset.rig.cameras) {
    Image image(setting.width, setting.height, 3);
    for (const Eigen::Vector3d& x : points) {
      DrawDot(geometry::Project(camera.camera, camera.cam_from_world * x).px, 3, &image);
    }
    fs::remove(dataset.ImagePath(camera.camera.name, 3));
    dataset::WriteImage(image, dataset.ImagePath(camera.camera.name, 3), 100);
    dataset::WriteImage(Image(setting.width, setting.height, 1, 255), dataset.MaskPath(camera.camera.name, 3));
  }
  ExportDataset(dataset, "colmap", folder / "out", ForSplatting());
  const auto manifest = nlohmann::json::parse(ReadFile(folder / "out/export.json"));
  double worst_px = 0;
  int seen = 0;
  for (size_t i = 0; i < dataset.rig.cameras.size(); ++i) {
    const geometry::Camera lens = ExportedLens(manifest["cameras"][i]);
    const Image image = dataset::ReadImage(folder / ("out/images/" + lens.name + ".png"), true);
    for (const Eigen::Vector3d& x : points) {
      const Eigen::Vector2d px = geometry::Project(lens, dataset.rig.cameras[i].cam_from_world * x).px;
      if (px[0] < 15 || px[1] < 15 || px[0] > image.width - 16 || px[1] > image.height - 16) continue;
      worst_px = std::max(worst_px, (CentreOfDot(image, px, 14) - px).norm());
      ++seen;
    }
  }
  EXPECT_GE(seen, 12);
  EXPECT_LT(worst_px, 0.1);
}

}  // namespace
}  // namespace mvstudio::exports::testing
