#include <fstream>

#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/resize.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "tests/calib/synthetic.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// calib align, resize, lenses and calibrate with fewer cameras as a user runs them.
namespace mvstudio::testing {
namespace {

class MovedRigs : public ::testing::Test {
 protected:
  MovedRigs() {
    calib::testing::SceneOptions options;
    options.num_cameras = 3, options.num_frames = 6, options.noise_px = 0.05;
    scene_ = calib::testing::MakeScene(options);
    rig_ = calib::testing::TruthRig(scene_);
    rig_.gauge = geometry::RigGauge::OfCamera("cam0");
    geometry::WriteRig(rig_, folder_ / "rig.json");
    calib::CornerFile corners;
    const calib::CalibrateInput input = calib::testing::ToInput(scene_);
    corners.cameras = input.cameras, corners.boards = input.boards, corners.detections = input.detections;
    calib::WriteCornerFile(corners, folder_ / "corners.csv");
  }

  geometry::Rig Written() const { return geometry::ReadRig(folder_ / "new.json"); }
  std::string Error(const CliRun& run) const { return run.out + run.err; }

  TempDir folder_;
  calib::testing::Scene scene_;
  geometry::Rig rig_;
};

TEST_F(MovedRigs, TheBoardOnTheFloorGivesTheWorld) {
  const int64_t frame = scene_.truth.frames[2];
  const CliRun run = RunCli({"calib", "align", folder_ / "rig.json", "--floor-board", std::to_string(frame), "--corners",
                             folder_ / "corners.csv", "--out", folder_ / "new.json", "--json"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_LT(run.Json()["metrics"]["rms_px"].get<double>(), 0.15);
  EXPECT_EQ(GaugeText(Written().gauge), "board in frame " + std::to_string(frame));
  EXPECT_LT(geometry::CompareRigs(Written(), rig_).max_translation_m, 1e-9) << "the rig moved as a whole";
}

TEST_F(MovedRigs, PointsOfBothWorldsMoveAndScaleIt) {
  std::ofstream(folder_ / "pairs.csv")
      << "point,x,y,z,x_old,y_old,z_old\na,0,0,0,1,0,0\nb,2,0,0,2,0,0\nc,0,2,0,1,1,0\nd,0,0,2,1,0,1\n";
  const CliRun run = RunCli({"calib", "align", folder_ / "rig.json", "--points", folder_ / "pairs.csv", "--scale", "--out",
                             folder_ / "new.json", "--json"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_NEAR(run.Json()["metrics"]["scale"].get<double>(), 2, 1e-12);
  EXPECT_EQ(GaugeText(Written().gauge), "the marked points; uncertainty relative to camera cam0");
  const Eigen::Vector3d wanted = 2 * (rig_.cameras[1].CenterInWorld() - Eigen::Vector3d::UnitX());
  EXPECT_LT((Written().cameras[1].CenterInWorld() - wanted).norm(), 1e-9);
}

/// A take that was triangulated with a rig of half the size, and marks in images: known lengths give the size.
TEST_F(MovedRigs, KnownLengthsGiveTheSize) {
  geometry::WriteRig(geometry::InWorld(rig_, {}, 0.5), folder_ / "half.json");
  dataset::Pose3d pose;
  pose.skeleton = "coco17";
  for (int frame = 0; frame < 10; ++frame) {
    for (const auto& [joint, x] : {std::pair{"LShoulder", 0.1}, {"RShoulder", -0.1}}) {
      dataset::JointRow row;
      row.frame = frame, row.joint = joint, row.status = Status::kOk, row.x_in_world = Eigen::Vector3d(x, 0.1 * frame, 1);
      pose.rows.push_back(row);
    }
  }
  dataset::WritePose3d(pose, folder_ / "pose3d");
  const auto align = [&](std::vector<std::string> words) {
    words.insert(words.begin(),
                 {"calib", "align", folder_ / "half.json", "--out", folder_ / "new.json", "--overwrite", "--json"});
    return RunCli(words);
  };
  const CliRun run = align({"--points", folder_ / "pose3d", "--length", "LShoulder:RShoulder:400mm"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_NEAR(run.Json()["metrics"]["scale"].get<double>(), 2, 1e-9);
  EXPECT_LT(geometry::CompareRigs(Written(), rig_).max_translation_m, 1e-9);
  EXPECT_EQ(GaugeText(Written().gauge), "camera cam0, size by stated lengths");
  std::ofstream marks(folder_ / "marks.csv");
  marks << "camera,point,x_px,y_px\n";
  const Eigen::Vector3d middle = scene_.truth.world_from_board[0].translation;
  for (const geometry::RigCamera& camera : rig_.cameras) {
    for (const auto& [name, x] : {std::pair{"a", 0.0}, {"b", 0.06}}) {
      const auto seen =
          geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(middle + Eigen::Vector3d(x, 0, 0)));
      ASSERT_EQ(seen.status, Status::kOk);
      marks << camera.camera.name << "," << name << "," << seen.px.x() << "," << seen.px.y() << "\n";
    }
  }
  marks.close();
  const CliRun marked = align({"--points", folder_ / "marks.csv", "--length", "a:b:60mm"});
  ASSERT_EQ(marked.exit, 0) << Error(marked);
  EXPECT_NEAR(marked.Json()["metrics"]["scale"].get<double>(), 2, 0.02);
  EXPECT_EQ(align({"--points", folder_ / "marks.csv", "--length", "a:c:60mm"}).exit, 2);
  EXPECT_EQ(align({"--points", folder_ / "pose3d", "--length", "LShoulder:RShoulder:0mm"}).exit, 2);
  EXPECT_EQ(align({"--length", "LShoulder:RShoulder:1m"}).exit, 2);
}

TEST_F(MovedRigs, PeopleWhoStandStillGiveNoFloor) {
  dataset::Pose3d pose;
  pose.skeleton = "coco17", pose.world = "right-handed, axes of camera cam0: x right, y down, z forward";
  for (int frame = 0; frame < 60; ++frame) {
    for (const auto& [joint, z] : {std::pair{"LHip", 0.9}, {"RHip", 0.9}, {"LAnkle", 0.1}, {"RAnkle", 0.1}}) {
      dataset::JointRow row;
      row.frame = frame, row.joint = joint, row.status = Status::kOk;
      row.x_in_world = Eigen::Vector3d(joint[0] == 'L' ? 0.1 : -0.1, 0, z);
      pose.rows.push_back(row);
    }
  }
  dataset::WritePose3d(pose, folder_ / "pose3d");
  const CliRun run =
      RunCli({"calib", "align", folder_ / "rig.json", "--floor-joints", folder_ / "pose3d", "--out", folder_ / "new.json"});
  EXPECT_EQ(run.exit, 5) << Error(run);
  EXPECT_THAT(Error(run), HasSubstr("feet stand in 2 places"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "new.json"));
}

TEST_F(MovedRigs, OneWorldIsAskedFor) {
  const auto align = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"calib", "align", folder_ / "rig.json", "--out", folder_ / "new.json"});
    return RunCli(words);
  };
  EXPECT_EQ(align({}).exit, 2);
  EXPECT_THAT(Error(align({"--floor-board", "3", "--points", folder_ / "pairs.csv"})), HasSubstr("give one of --floor-board"));
  EXPECT_THAT(Error(align({"--floor-board", "3"})), HasSubstr("needs the board's corners"));
  EXPECT_THAT(Error(align({"--floor-board", "3", "--corners", folder_ / "corners.csv"})),
              HasSubstr("sees the board in frame 3"));
  EXPECT_THAT(Error(align({"--floor-joints", folder_ / "pose3d", "--scale"})), HasSubstr("--scale belongs to --points"));
}

/// Boards that one camera saw at times of its own: the others are calibrated.
TEST_F(MovedRigs, OneCameraWithoutALinkLeavesTheOthers) {
  calib::CornerFile corners;
  const calib::CalibrateInput input = calib::testing::ToInput(scene_);
  corners.cameras = input.cameras, corners.boards = input.boards, corners.detections = input.detections;
  for (calib::Detection& d : corners.detections) d.frame_idx += d.camera_idx == 2 ? 1000 : 0;
  calib::WriteCornerFile(corners, folder_ / "unlinked.csv");
  const CliRun run = RunCli({"calibrate", "--corners", folder_ / "unlinked.csv", "--model", "brown4", "--warp", "off",
                             "--stretch", "off", "--out", folder_ / "calib", "--json"});
  ASSERT_TRUE(run.exit == 6 || run.exit == 4) << Error(run);
  EXPECT_EQ(geometry::ReadRig(folder_ / "calib" + "/calibration.json").cameras.size(), 2u);
  EXPECT_EQ(run.Json()["metrics"]["left_out"][0]["name"], "cam2");
  EXPECT_EQ(run.Json()["metrics"]["cameras"].size(), 2u);
  EXPECT_THAT(run.out, HasSubstr("camera cam2 is not calibrated"));
}

/// A camera whose images are flipped left-right, with --mirrored: as if they were not.
TEST_F(MovedRigs, AMirroredCameraIsCalibratedAsIfItWereNot) {
  calib::CornerFile corners;
  const calib::CalibrateInput input = calib::testing::ToInput(scene_);
  corners.cameras = input.cameras, corners.boards = input.boards, corners.detections = input.detections;
  for (calib::Detection& d : corners.detections) {
    if (d.camera_idx == 1) d.points_px.row(0) = 639 - d.points_px.row(0).array();
  }
  calib::WriteCornerFile(corners, folder_ / "flipped.csv");
  const auto calibrate = [&](const std::string& file, const std::string& out, std::vector<std::string> more) {
    more.insert(more.begin(),
                {"calibrate", "--corners", file, "--model", "brown4", "--warp", "off", "--stretch", "off", "--out", out});
    return RunCli(more);
  };
  calibrate(folder_ / "corners.csv", folder_ / "plain", {});
  const CliRun run = calibrate(folder_ / "flipped.csv", folder_ / "mirrored", {"--mirrored", "cam1"});
  EXPECT_THAT(Error(run), HasSubstr("CAL-MIRRORED"));
  const geometry::Rig plain = geometry::ReadRig(folder_ / "plain" + "/calibration.json");
  const geometry::Rig mirrored = geometry::ReadRig(folder_ / "mirrored" + "/calibration.json");
  EXPECT_LT(geometry::CompareRigs(mirrored, plain).max_translation_m, 1e-6);
  const CliRun unknown = calibrate(folder_ / "corners.csv", folder_ / "none", {"--mirrored", "nobody"});
  EXPECT_EQ(unknown.exit, 2);
  EXPECT_THAT(Error(unknown), HasSubstr("no camera called 'nobody'"));
}

/// Lenses first, then the rig from few boards: lenses without poses do not say where the cameras are.
TEST_F(MovedRigs, LensesOfALibraryAreHeldAndTheRigIsPlaced) {
  geometry::Rig lenses = rig_;
  lenses.gauge = calib::kLensesOnly;
  for (geometry::RigCamera& camera : lenses.cameras) camera.cam_from_world = geometry::Rigid3();
  geometry::WriteRig(lenses, folder_ / "lenses.json");
  const auto calibrate = [&](std::vector<std::string> more) {
    more.insert(more.begin(),
                {"calibrate", "--corners", folder_ / "corners.csv", "--warp", "off", "--stretch", "off", "--json"});
    return RunCli(more);
  };
  const CliRun placed = calibrate({"--start", folder_ / "lenses.json", "--fix", "lenses", "--out", folder_ / "placed"});
  ASSERT_TRUE(placed.exit == 0 || placed.exit == 4) << Error(placed);
  EXPECT_LT(geometry::CompareRigs(geometry::ReadRig(folder_ / "placed" + "/calibration.json"), rig_).max_translation_m, 2e-3);

  for (const std::string camera : {"cam0", "cam1"}) {
    const CliRun run = RunCli({"calib", "lenses", "add", folder_ / "library.json", folder_ / "rig.json", "--camera", camera,
                               "--serial", "s" + camera, "--setting", "near"});
    ASSERT_EQ(run.exit, 0) << Error(run);
  }
  EXPECT_THAT(RunCli({"calib", "lenses", "list", folder_ / "library.json"}).out, HasSubstr("scam1@near"));
  EXPECT_THAT(Error(RunCli({"calib", "lenses", "check", folder_ / "library.json"})), HasSubstr("states no covariance"));
  std::filesystem::create_directory(folder_ / "session");
  std::ofstream(folder_ / "session" + "/mvstudio.toml")
      << "schema = \"mvstudio.session/1\"\nunits = \"mm\"\nboard = \"chessboard:9x6:60mm\"\n"
         "[[cameras]]\nname = \"cam0\"\nserial = \"scam0\"\n[[cameras]]\nname = \"cam1\"\nserial = \"scam1\"\n"
         "[[cameras]]\nname = \"cam2\"\n";
  const CliRun held =
      calibrate({"--session", folder_ / "session", "--lenses", folder_ / "library.json", "--out", folder_ / "held"});
  ASSERT_TRUE(held.exit == 0 || held.exit == 4) << Error(held);
  EXPECT_EQ(held.Json()["metrics"]["lenses_from_library"], (std::vector<std::string>{"cam0", "cam1"}));
  const geometry::Rig found = geometry::ReadRig(folder_ / "held" + "/calibration.json");
  EXPECT_EQ(found.cameras[0].camera.params, rig_.cameras[0].camera.params);
  EXPECT_NE(found.cameras[2].camera.params, rig_.cameras[2].camera.params);
  EXPECT_THAT(held.out, HasSubstr("CAL-WORLD"));
}

TEST_F(MovedRigs, LensesOfAnotherSizeAreRefusedByName) {
  geometry::Rig lenses = rig_;
  for (const size_t c : {0, 2}) geometry::ResizeCamera(c, geometry::MapOfArea({0, 0, 640, 480}, 1280, 960), 1280, 960, &lenses);
  geometry::WriteRig(lenses, folder_ / "large.json");
  const CliRun run = RunCli(
      {"calibrate", "--corners", folder_ / "corners.csv", "--start", folder_ / "large.json", "--out", folder_ / "calib"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(Error(run), HasSubstr("cam0 (1280x960, images 640x480), cam2"));
  EXPECT_THAT(Error(run), HasSubstr("--camera-size cam0=640x480 --camera-size cam2=640x480 --out resized.json"));
}

TEST_F(MovedRigs, ResizedThereAndBack) {
  const CliRun larger =
      RunCli({"calib", "resize", folder_ / "rig.json", "--size", "1280x960", "--out", folder_ / "large.json", "--json"});
  ASSERT_EQ(larger.exit, 0) << Error(larger);
  const geometry::Camera before = rig_.cameras[0].camera, after = geometry::ReadRig(folder_ / "large.json").cameras[0].camera;
  EXPECT_EQ(after.width_px, 1280);
  EXPECT_NEAR(after.fx(), 2 * before.fx(), 1e-9);
  EXPECT_NEAR(after.cx(), 2 * before.cx() + 0.5, 1e-9);
  const CliRun back = RunCli({"calib", "resize", folder_ / "large.json", "--size", "640x480", "--out", folder_ / "new.json"});
  ASSERT_EQ(back.exit, 0) << Error(back);
  EXPECT_LT((Written().cameras[2].camera.params - rig_.cameras[2].camera.params).norm(), 1e-9);
}

TEST_F(MovedRigs, ACropOfOneCameraLeavesTheOthers) {
  const CliRun run = RunCli({"calib", "resize", folder_ / "rig.json", "--camera-size", "cam1=320x180", "--crop",
                             "cam1=0,60,640,360", "--out", folder_ / "new.json"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_EQ(Written().cameras[0].camera.width_px, 640);
  EXPECT_EQ(Written().cameras[1].camera.height_px, 180);
  EXPECT_NEAR(Written().cameras[1].camera.cy(), 0.5 * (rig_.cameras[1].camera.cy() + 0.5 - 60) - 0.5, 1e-9);
}

TEST_F(MovedRigs, AnotherShapeIsRefused) {
  const auto resize = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"calib", "resize", folder_ / "rig.json", "--out", folder_ / "new.json"});
    return RunCli(words);
  };
  const CliRun shape = resize({"--size", "1280x720"});
  EXPECT_EQ(shape.exit, 2);
  EXPECT_THAT(Error(shape), HasSubstr("say with --crop"));
  EXPECT_THAT(Error(resize({"--size", "480x640"})), HasSubstr("turned by a quarter"));
  EXPECT_THAT(Error(resize({"--camera-size", "nobody=640x480"})), HasSubstr("no camera 'nobody'"));
  EXPECT_THAT(Error(resize({"--size", "64x48", "--crop", "700,0,640,480"})), HasSubstr("lies outside"));
  EXPECT_THAT(Error(resize({"--size", "64x48", "--crop", "7,0,640"})), HasSubstr("expected X,Y,WIDTH,HEIGHT"));
  EXPECT_EQ(resize({}).exit, 2);
}

}  // namespace
}  // namespace mvstudio::testing
