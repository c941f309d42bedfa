#include <filesystem>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "stages/nets/pose2d/describe.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Keypoints of a take, without the program.
namespace mvstudio::stages {
namespace {

std::vector<std::string> PoseCodes(const std::vector<Notice>& notices) {
  std::vector<std::string> codes;
  for (const Notice& notice : notices) codes.push_back(notice.code);
  return codes;
}

std::vector<std::string> KeysOf(const nlohmann::ordered_json& json) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  return keys;
}

/// Frames 0 to 3 of camera a, of which the last shows nobody; the files are another program's.
Pose2dOptions PutExistingPoses(const TempDir& folder) {
  std::string person = "50,40,0.5";
  for (int j = 1; j < 25; ++j) person += ",0,0,0";
  const std::string seen = R"({"people": [{"pose_keypoints_2d": [)" + person + "]}]}";
  for (int frame = 0; frame < 4; ++frame) {
    Put(folder / ("poses/a/" + std::to_string(frame) + "_keypoints.json"), frame < 3 ? seen : R"({"people": []})");
    dataset::WriteImage(Image(100, 80, 3), folder / ("raw/a/" + std::to_string(frame) + ".png"));
  }
  Pose2dOptions options;
  options.take.images = {{"a", folder / "raw/a"}};
  options.backend = "openpose:" + (folder / "poses"), options.out = folder / "out";
  return options;
}

TEST(Pose2dStage, PosesThatAreThereAreCheckedAndWrittenAgain) {
  const TempDir folder;
  const Pose2dReport report = RunPose2d(PutExistingPoses(folder));
  ASSERT_THAT(report.cameras, SizeIs(1));
  EXPECT_EQ(report.cameras[0].frames, 4);
  EXPECT_EQ(report.cameras[0].frames_with_people, 3);
  EXPECT_TRUE(report.FoundPeople());
  EXPECT_FALSE(report.agreement.measured) << "one camera has nothing to be compared with";
  EXPECT_TRUE(std::filesystem::exists(folder / "out/a/000000000002_keypoints.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/skeleton.json"));
  EXPECT_THAT(report.notes.inputs, ElementsAre(folder / "raw/a", folder / "poses/a"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_THAT(KeysOf(said.metrics), ElementsAre("backend", "skeleton", "cameras"));
  EXPECT_DOUBLE_EQ(said.metrics["cameras"][0]["mean_score"], 0.5 / 25);
  EXPECT_TRUE(said.metrics["cameras"][0]["frames_per_s"].is_null());
  ASSERT_THAT(said.outputs, SizeIs(1));
  EXPECT_EQ(said.outputs[0].path, folder / "out/a");
  EXPECT_THAT(said.text, HasSubstr("people in 3 of 4 images"));
}

TEST(Pose2dStage, ACalibrationOfOtherCamerasIsRefused) {
  const TempDir folder;
  Pose2dOptions options = PutExistingPoses(folder);
  geometry::Rig rig;
  rig.cameras.resize(1);
  rig.cameras[0].camera = geometry::MakePinhole("cam_a", 100, 80, 90);
  geometry::WriteRig(rig, folder / "rig.json");
  options.calib = folder / "rig.json";
  EXPECT_THAT(MessageOf<FormatError>([&] { RunPose2d(options); }),
              HasSubstr("has cam_a, the footage or its keypoints a: none is in both"));
  options.take.images.clear();
  EXPECT_THAT(MessageOf<FormatError>([&] { RunPose2d(options); }), HasSubstr("none is in both"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(Pose2dStage, FramesThatWereNotAskedForAreLeftOut) {
  const TempDir folder;
  Pose2dOptions options = PutExistingPoses(folder);
  options.frames = "2-9";
  const Pose2dReport report = RunPose2d(options);
  EXPECT_EQ(report.cameras[0].frames, 2);
  EXPECT_EQ(report.cameras[0].frames_with_people, 1);
  EXPECT_THAT(PoseCodes(report.notes.warnings), ElementsAre("CLI-FRAMES"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/a/000000000001_keypoints.json"));
  options.frames = "50-60", options.overwrite = true;
  EXPECT_THAT(MessageOf<NothingLeftError>([&] { RunPose2d(options); }), HasSubstr("option 'frames': the footage has no"));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/a/000000000002_keypoints.json")) << "the older output stays";
  options.take.images.clear(), options.backend = "posenet";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPose2d(options); }), HasSubstr("no footage: give option 'video'"));
}

CameraPoses SeenBy(const std::string& name, int frames, int with_people) {
  CameraPoses camera;
  camera.track.camera = name, camera.frames = frames, camera.frames_with_people = with_people;
  return camera;
}

TEST(Pose2dStage, WhatCamerasDidNotGiveIsSaid) {
  Pose2dReport report;
  report.cameras = {SeenBy("a", 20, 20), SeenBy("b", 20, 1), SeenBy("c", 0, 0), SeenBy("d", 0, 0)};
  report.cameras[1].damage = {"frame 7 is missing"};
  report.cameras[3].failure = "d.mp4: cannot be read";
  report.other_sizes = {{"a", 640, 480, 1280, 960}};
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_THAT(PoseCodes(said.warnings), ElementsAre("POSE-FRAMES", "POSE-NOBODY", "POSE-CAMERA", "POSE-CAMERA", "POSE-SIZE"));
  EXPECT_THAT(said.warnings[2].text, HasSubstr("c gives nothing: its footage has no frame"));
  EXPECT_EQ(said.warnings[3].text, "d: d.mp4: cannot be read");
  EXPECT_THAT(said.warnings[4].hint, HasSubstr("option 'camera-size' a=640x480"));
  EXPECT_THAT(said.errors, IsEmpty());
}

TEST(Pose2dStage, PosesOfNobodyOrWithoutAgreementFailTheGate) {
  Pose2dReport report;
  report.trials = {{"movenet", {}}, {"posenet", {}}};
  report.cameras = {SeenBy("a", 5, 5), SeenBy("b", 5, 5)};
  report.agreement.measured = true, report.agreement.share_ok = 0.5;
  report.agreement.joints = {{"Nose", 1, {}}, {"Neck", 0, triangulate::LeftOutFigures{}}};
  const CommandResult good = Describe(report);
  EXPECT_EQ(good.exit, kExitOk);
  EXPECT_THAT(KeysOf(good.metrics), ElementsAre("trials", "backend", "skeleton", "cameras", "agreement"));
  EXPECT_FALSE(good.metrics["agreement"]["joints"][0].contains("num"));
  EXPECT_TRUE(good.metrics["agreement"]["joints"][1].contains("num"));
  report.agreement.share_ok = 0;
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
  EXPECT_THAT(PoseCodes(Describe(report).errors), ElementsAre("POSE-NO-AGREEMENT"));
  report.cameras = {SeenBy("a", 5, 0), SeenBy("b", 5, 0)};
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
  EXPECT_THAT(PoseCodes(Describe(report).errors), ElementsAre("POSE-NOBODY")) << "the cause alone";
}

}  // namespace
}  // namespace mvstudio::stages
