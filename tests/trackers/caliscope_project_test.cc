#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/trackers/tracked_project.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Folders as caliscope's docs/reconstruction.md describes them.
namespace mvstudio::dataset {
namespace {

void PutEmpty(const std::string& path) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  WriteFileAtomic(path, "");
}

TEST(CaliscopeProject, ARecordingIsOfTheCamerasThatItWasProcessedWith) {
  const TempDir folder;
  PutEmpty(folder / "camera_array.toml");
  PutEmpty(folder / "recordings/old/POSE/xy_POSE.csv");
  PutEmpty(folder / "recordings/walk/ONNX_rtmpose_t_halpe26/xy_ONNX_rtmpose_t_halpe26.csv");
  PutEmpty(folder / "recordings/walk/ONNX_rtmpose_t_halpe26/camera_array.toml");
  const TrackedProject project = ReadTrackedProject(folder.path());
  ASSERT_EQ(project.takes.size(), 2u);
  EXPECT_EQ(project.takes[0].name, "old/POSE");
  EXPECT_EQ(project.takes[0].calibration, folder / "camera_array.toml");
  EXPECT_EQ(project.takes[1].calibration, folder / "recordings/walk/ONNX_rtmpose_t_halpe26/camera_array.toml");
}

TEST(CaliscopeProject, SnapshotsAloneAreEnoughAndTakesWithoutCamerasAreNamed) {
  const TempDir folder;
  PutEmpty(folder / "recordings/old/POSE/xy_POSE.csv");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackedProject(folder.path()); }),
              HasSubstr("xy_POSE.csv: no camera_array.toml beside it or in the project"));
  PutEmpty(folder / "recordings/walk/POSE/xy_POSE.csv");
  PutEmpty(folder / "recordings/walk/POSE/camera_array.toml");
  const TrackedProject project = ReadTrackedProject(folder.path());
  ASSERT_EQ(project.takes.size(), 1u);
  EXPECT_EQ(project.takes[0].name, "walk/POSE");
  ASSERT_EQ(project.left_out.size(), 1u);
  EXPECT_THAT(project.left_out[0], HasSubstr("old/POSE"));
}

/// Projects that are not read say by name what of them can be used.
TEST(TrackedProject, FreeMoCapAndDeepLabCutAreNamed) {
  const auto refused = [](const TempDir& folder) { return MessageOf<FormatError>([&] { ReadTrackedProject(folder.path()); }); };
  const TempDir recording, calibration_alone, stereo, one, other;
  PutEmpty(recording / "walk_camera_calibration.toml");
  PutEmpty(recording / "output_data/raw_data/mediapipe2dData_numCams_numFrames_numTrackedPoints_pixelXY.npy");
  EXPECT_THAT(refused(recording), AllOf(HasSubstr("FreeMoCap"), HasSubstr("_pixelXY.npy is not read"),
                                        HasSubstr("option 'calib' " + (recording / "walk_camera_calibration.toml"))));
  PutEmpty(calibration_alone / "walk_camera_calibration.toml");
  EXPECT_THAT(refused(calibration_alone), HasSubstr("its array of 2D points is not read"));
  WriteFileAtomic(stereo / "config.yaml", "camera_names:\n- camera-1\nscorername_3d: DLC\n");
  EXPECT_THAT(refused(stereo), AllOf(HasSubstr("DeepLabCut"), HasSubstr(".pickle")));
  WriteFileAtomic(one / "config.yaml", "scorer: me\nbodyparts:\n- nose\n");
  EXPECT_THAT(refused(one), AllOf(HasSubstr("DeepLabCut"), HasSubstr("option 'pose2d'"), Not(HasSubstr("pickle"))));
  WriteFileAtomic(other / "config.yaml", "a: 1\n");
  EXPECT_THAT(refused(other), HasSubstr("holds neither config.toml"));
}

}  // namespace
}  // namespace mvstudio::dataset
