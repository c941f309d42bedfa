#include <fstream>

#include "geometry/rig/rig_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Files of other programs, by their published layouts, through the commands that docs/neighbours.md names.
namespace mvstudio::testing {
namespace {

/// freemocap's freemocap_anipose.py: aniposelib's cameras in the unit of `charuco_square_size`, mm, and metadata of its own.
constexpr char kFreeMoCap[] = R"([cam_0]
name = "0"
size = [ 720, 1280,]
matrix = [ [ 896.3, 0.0, 359.5,], [ 0.0, 896.3, 639.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ -0.05, 0.0, 0.0, 0.0, 0.0,]
rotation = [ 0.0, 0.0, 0.0,]
translation = [ 0.0, 0.0, 0.0,]

[cam_1]
name = "1"
size = [ 720, 1280,]
matrix = [ [ 911.2, 0.0, 359.5,], [ 0.0, 911.2, 639.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ -0.03, 0.0, 0.0, 0.0, 0.0,]
rotation = [ 0.0, 1.5707963267948966, 0.0,]
translation = [ -1500.0, 20.0, 800.0,]

[metadata]
adjusted = false
error = 0.31
charuco_square_size = 58.0
charuco_board_object = "<class 'CharucoBoardDefinition'>"
path_to_recorded_videos = "C:\\Users\\lab\\synchronized_videos"
date_time_calibrated = "2023-05-17T12:49:06"
groundplane_calibration = false
)";

TEST(Neighbours, FreeMoCapsCamerasAreInMillimetres) {
  const TempDir folder;
  std::ofstream(folder / "walk_camera_calibration.toml") << kFreeMoCap;
  const CliRun run = RunCli({"calib", "convert", folder / "walk_camera_calibration.toml", "--unit", "mm", "--to", "mvstudio",
                             "--out", folder / "rig.json", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const geometry::Rig rig = geometry::ReadRig(folder / "rig.json");
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].camera.name, "1");
  EXPECT_EQ(rig.cameras[1].camera.fx(), 911.2);
  // A quarter turn about y takes world z to x: the centre is -R^T t.
  EXPECT_LT((rig.cameras[1].CenterInWorld() - Eigen::Vector3d(0.8, -0.02, 1.5)).norm(), 1e-9);
}

}  // namespace
}  // namespace mvstudio::testing
