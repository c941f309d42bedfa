#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Names of cameras in files that list pictures, and folders that hold a calibration.
namespace mvstudio::calib {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Picture {
  std::string path;
  double x_m;
};

ImportedRig ReadColmapOf(const std::vector<Picture>& pictures) {
  const TempDir folder;
  std::string images;
  int id = 0;
  for (const Picture& picture : pictures) {
    images += std::to_string(++id) + " 1 0 0 0 " + std::to_string(-picture.x_m) + " 0 0 1 " + picture.path + "\n\n";
  }
  WriteFileAtomic(folder / "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  WriteFileAtomic(folder / "images.txt", images);
  WriteFileAtomic(folder / "points3D.txt", "");
  return ReadColmap(folder.path());
}

std::vector<std::string> NamesOf(const ImportedRig& imported) { return geometry::CameraNames(imported.rig); }

std::string CodesOf(const ImportedRig& imported) {
  std::string codes;
  for (const ImportNote& note : imported.notes) codes += note.code + " ";
  return codes;
}

TEST(PictureNames, PicturesOfOneStandingCameraAreOneCamera) {
  const auto by_folder =
      ReadColmapOf({{"cam1/000000.jpg", 0}, {"cam1/000001.jpg", 0}, {"cam2/000000.jpg", 1}, {"cam2/000001.jpg", 1}});
  EXPECT_THAT(NamesOf(by_folder), ElementsAre("cam1", "cam2"));
  EXPECT_THAT(CodesOf(by_folder), HasSubstr("CAL-MERGED"));
  EXPECT_NEAR(by_folder.rig.cameras[1].CenterInWorld().x(), 1, 1e-12);
  const auto by_name = ReadColmapOf({{"f0/a.png", 0}, {"f0/b.png", 1}, {"f1/a.png", 0}, {"f1/b.png", 1}});
  EXPECT_THAT(NamesOf(by_name), ElementsAre("a", "b"));
  const auto flat = ReadColmapOf({{"cam1_0007.png", 0}, {"cam1_0008.png", 0}, {"cam2_0007.png", 1}});
  EXPECT_THAT(NamesOf(flat), ElementsAre("cam1", "cam2"));
}

TEST(PictureNames, CamerasAreTheirFoldersWhereFileNamesRepeat) {
  const auto read = ReadColmapOf({{"images/cam0/000000.jpg", 0}, {"images/cam1/000000.jpg", 1}});
  EXPECT_THAT(NamesOf(read), ElementsAre("cam0", "cam1"));
  const auto other = ReadColmapOf({{"a/left/rgb/1.jpg", 0}, {"b/left/rgb/1.jpg", 1}});
  EXPECT_THAT(NamesOf(other), ElementsAre("a", "b"));
}

TEST(PictureNames, MovingCamerasAreSaid) {
  const auto read = ReadColmapOf({{"cam1/0.jpg", 0}, {"cam1/1.jpg", 1}, {"cam2/0.jpg", 2}, {"cam2/1.jpg", 3}});
  EXPECT_EQ(read.rig.cameras.size(), 4u);
  EXPECT_THAT(CodesOf(read), HasSubstr("CAL-MOVING"));
  const auto plain = ReadColmapOf({{"images/0.jpg", 0}, {"images/1.jpg", 1}, {"images/2.jpg", 2}});
  EXPECT_THAT(NamesOf(plain), ElementsAre("images/0", "images/1", "images/2"));
  EXPECT_EQ(CodesOf(plain), "CAL-UNIT ");
}

TEST(CalibrationIn, FindsWhatAFolderHolds) {
  const TempDir folder;
  const auto put = [&](const std::string& path) { WriteFileAtomic(folder / path, "x"); };
  put("run/calibration.json"), put("run/transforms.json");
  put("project/sparse/0/cameras.bin"), put("project/sparse/0/images.bin");
  put("flat/sparse/cameras.txt"), put("flat/sparse/images.txt");
  put("panoptic/calibration_a.json");
  put("nerf/transforms.json");
  put("none/a.txt");
  EXPECT_EQ(CalibrationIn(folder / "run"), folder / "run/calibration.json");
  EXPECT_EQ(CalibrationIn(folder / "project"), folder / "project/sparse/0");
  EXPECT_EQ(CalibrationIn(folder / "flat"), folder / "flat/sparse");
  EXPECT_EQ(CalibrationIn(folder / "panoptic"), folder / "panoptic/calibration_a.json");
  EXPECT_EQ(CalibrationIn(folder / "nerf"), folder / "nerf");
  EXPECT_EQ(CalibrationIn(folder / "nerf/transforms.json"), folder / "nerf/transforms.json");
  EXPECT_THAT(MessageOf<FormatError>([&] { DetectFormat(CalibrationIn(folder / "none")); }), HasSubstr("sparse/0"));
}

TEST(DetectFormat, UnknownFilesAreCalledThatWithTheirLayout) {
  const TempDir folder;
  const auto said = [&](const std::string& text) {
    WriteFileAtomic(folder / "file.json", text);
    return MessageOf<FormatError>([&] { DetectFormat(folder / "file.json"); });
  };
  EXPECT_THAT(said("{\"cam0.png\": {\"focal_length\": [1, 1], \"image_center\": [0, 0]}}"), HasSubstr("MVHumanNet"));
  EXPECT_THAT(said("{\"2201\": {\"distCoeff\": [], \"imgSize\": []}}"), HasSubstr("AvatarReX"));
  EXPECT_THAT(said("{\"intrinsics\": {\"calibration_matrix\": []}, \"extrinsics\": {}}"), HasSubstr("Human3.6M"));
  EXPECT_THAT(said("{\"w2c\": [], \"k\": [], \"cam_id\": []}"), HasSubstr("Dynamic 3D Gaussians"));
  EXPECT_THAT(said("{\"asset\": {}, \"nodes\": [], \"cameras\": []}"), HasSubstr("glTF"));
  EXPECT_THAT(said(std::string("PK\x03\x04zip")), HasSubstr(".npz"));
  EXPECT_THAT(said("{\"hello\": 1}"),
              ::testing::AllOf(HasSubstr("not a calibration that is known here"), HasSubstr("panoptic")));
  EXPECT_THAT(said("[1, 2]"), HasSubstr("not a calibration that is known here"));
}

}  // namespace
}  // namespace mvstudio::calib
