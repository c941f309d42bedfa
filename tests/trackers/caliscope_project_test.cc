#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/trackers/tracked_project.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Folders as caliscope's docs/reconstruction.md describes them.
namespace mvstudio::dataset {
namespace {

using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempDir;

void Put(const std::string& path) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  WriteFileAtomic(path, "");
}

TEST(CaliscopeProject, ARecordingIsOfTheCamerasThatItWasProcessedWith) {
  const TempDir folder;
  Put(folder / "camera_array.toml");
  Put(folder / "recordings/old/POSE/xy_POSE.csv");
  Put(folder / "recordings/walk/ONNX_rtmpose_t_halpe26/xy_ONNX_rtmpose_t_halpe26.csv");
  Put(folder / "recordings/walk/ONNX_rtmpose_t_halpe26/camera_array.toml");
  const TrackedProject project = ReadTrackedProject(folder.path());
  ASSERT_EQ(project.takes.size(), 2u);
  EXPECT_EQ(project.takes[0].name, "old/POSE");
  EXPECT_EQ(project.takes[0].calibration, folder / "camera_array.toml");
  EXPECT_EQ(project.takes[1].calibration, folder / "recordings/walk/ONNX_rtmpose_t_halpe26/camera_array.toml");
}

TEST(CaliscopeProject, SnapshotsAloneAreEnoughAndTakesWithoutCamerasAreNamed) {
  const TempDir folder;
  Put(folder / "recordings/old/POSE/xy_POSE.csv");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackedProject(folder.path()); }),
              HasSubstr("xy_POSE.csv: no camera_array.toml beside it or in the project"));
  Put(folder / "recordings/walk/POSE/xy_POSE.csv");
  Put(folder / "recordings/walk/POSE/camera_array.toml");
  const TrackedProject project = ReadTrackedProject(folder.path());
  ASSERT_EQ(project.takes.size(), 1u);
  EXPECT_EQ(project.takes[0].name, "walk/POSE");
  ASSERT_EQ(project.left_out.size(), 1u);
  EXPECT_THAT(project.left_out[0], HasSubstr("old/POSE"));
}

}  // namespace
}  // namespace mvstudio::dataset
