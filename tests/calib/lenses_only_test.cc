#include "geometry/rig/lenses_only.h"

#include <fstream>

#include "calib/formats/formats.h"
#include "core/error.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Lenses whose poses no file states are lenses only, in every format; a pose in halves, or of some cameras, is damage.
namespace mvstudio::calib {
namespace {

ImportedRig Read(CalibrationFormat format, const std::string& text) {
  static const TempDir folder;
  const std::string path = folder / "file.txt";
  std::ofstream(path, std::ios::binary) << text;
  return ReadCalibration(format, {path});
}

std::string Complaint(CalibrationFormat format, const std::string& text) {
  try {
    Read(format, text);
  } catch (const FormatError& error) {
    return error.where() + ": " + error.what();
  }
  return "accepted";
}

constexpr char kLens[] =
    "size = [640, 480]\nmatrix = [[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]]\n"
    "distortions = [0.1, 0.0, 0.0, 0.0]\n";

TEST(LensesOnly, TomlWithoutPoses) {
  const std::string lens = kLens, pose = "rotation = [0.0, 0.0, 0.1]\ntranslation = [0.1, 0.0, 0.0]\n";
  const ImportedRig read = Read(CalibrationFormat::kToml, "[cam_0]\n" + lens + "[cam_1]\n" + lens);
  EXPECT_EQ(read.rig.gauge, geometry::kLensesOnly);
  ASSERT_FALSE(read.notes.empty());
  EXPECT_EQ(read.notes.back().code, "CAL-NOPOSE");
  EXPECT_THAT(Complaint(CalibrationFormat::kToml, "[cam_0]\n" + lens + pose + "[cam_1]\n" + lens),
              ::testing::HasSubstr("all or none"));
  EXPECT_THAT(Complaint(CalibrationFormat::kToml, "[cam_0]\n" + lens + "rotation = [0.0, 0.0, 0.1]\n"),
              ::testing::HasSubstr("cam_0.translation"));
}

TEST(LensesOnly, KalibrWithoutPoses) {
  const std::string lens =
      "  camera_model: pinhole\n  intrinsics: [500.0, 500.0, 319.5, 239.5]\n  distortion_model: radtan\n"
      "  distortion_coeffs: [0.1, 0.0, 0.0, 0.0]\n  resolution: [640, 480]\n";
  const std::string pose =
      "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, 0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n";
  const std::string two = "cam0:\n" + lens + "cam1:\n" + lens;
  EXPECT_EQ(Read(CalibrationFormat::kKalibr, two).rig.gauge, geometry::kLensesOnly);
  EXPECT_EQ(GaugeText(Read(CalibrationFormat::kKalibr, two + pose).rig.gauge), "camera cam0");
  EXPECT_NE(Complaint(CalibrationFormat::kKalibr, two + pose + "cam2:\n" + lens), "accepted") << "a pose of three is missing";
}

TEST(LensesOnly, AllAtTheOriginIsNoRig) {
  geometry::Rig rig;
  rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  rig.cameras.resize(2);
  EXPECT_TRUE(geometry::HasLensesOnly(rig));
  rig.cameras[1].cam_from_world.translation.x() = 0.1;
  EXPECT_FALSE(geometry::HasLensesOnly(rig));
  rig.cameras.pop_back();
  EXPECT_FALSE(geometry::HasLensesOnly(rig)) << "one camera alone is where it is";
  rig.gauge = geometry::kLensesOnly;
  EXPECT_TRUE(geometry::HasLensesOnly(rig));
}

}  // namespace
}  // namespace mvstudio::calib
