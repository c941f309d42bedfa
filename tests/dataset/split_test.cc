#include "dataset/views/split.h"

#include <cmath>
#include <set>

#include "core/error.h"
#include "core/format.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::MessageOf;

constexpr double kPi = 3.14159265358979323846;

geometry::RigCamera CameraAt(const std::string& name, const Eigen::Vector3d& centre) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole(name, 640, 480, 500);
  camera.cam_from_world.translation = -centre;
  return camera;
}

/// `cameras` on a ring of 3 m around (0, 0, 1); frames 0 to 99 of a person who walks and at frame 60 jumps by a metre.
PanopticDataset RingDataset(int cameras, int frames = 100) {
  PanopticDataset data;
  data.root = "/somewhere", data.sequence = "ring";
  for (int i = 0; i < cameras; ++i) {
    const double angle = 2 * kPi * i / cameras;
    const std::string name = Format("00_%02d", i);
    data.rig.cameras.push_back(CameraAt(name, {3 * std::cos(angle), 3 * std::sin(angle), 1}));
    data.aliases["cam" + std::to_string(i)] = name;
  }
  for (int f = 0; f < frames; ++f) {
    data.frames.push_back(f);
    Coco19Pose pose = StandingPerson(0.01 * f + (f >= 60 ? 1 : 0));
    pose.x_in_world(2, 5) += 0.3 * std::sin(0.1 * f);
    data.poses[f][0] = pose;
  }
  return data;
}

Split SmallSplit() {
  Split split;
  split.dataset = "ring", split.rule = "by \"hand\"\n";
  split.train = {{"00_00", "00_02"}, {0, 1, 2, 3}};
  split.validation = {{"00_00"}, {5}};
  split.test = {{"00_01"}, {8, 9}};
  split.guard_frames = 1, split.unused_frames = {4, 6, 7}, split.blocks = {{0, 5}, {6, 9}};
  return split;
}

TEST(SplitFile, ComesBackAsItWas) {
  const mvstudio::testing::TempDir folder;
  WriteSplit(SmallSplit(), folder / "split.json");
  const Split back = ReadSplit(folder / "split.json");
  EXPECT_EQ(SplitToJsonText(back), SplitToJsonText(SmallSplit()));
  EXPECT_EQ(back.validation.frames, std::vector<int>({5}));
  EXPECT_EQ(back.rule, "by \"hand\"\n");
  ASSERT_EQ(back.blocks.size(), 2u);
  EXPECT_EQ(back.blocks[1].last, 9);
}

TEST(SplitFile, ListsWrittenByHandNeedNotBeSorted) {
  std::string text = SplitToJsonText(SmallSplit());
  text.replace(text.find("[0,1,2,3]"), 9, "[3,0,2,1]");
  text.replace(text.find("[\"00_00\",\"00_02\"]"), 17, "[\"00_02\",\"00_00\"]");
  EXPECT_EQ(SplitToJsonText(SplitFromJsonText(text, "by hand")), SplitToJsonText(SmallSplit()));
}

TEST(SplitFile, NamesEverythingThatIsShared) {
  Split split = SmallSplit();
  split.test.cameras.push_back("00_02");
  split.test.frames.insert(split.test.frames.begin(), {2, 3});
  split.validation.frames = {3, 9};
  EXPECT_THROW(WriteSplit(split, "/nowhere"), ContractViolation);
  const std::string message = MessageOf<FormatError>([&] { SplitFromJsonText(SplitToJsonText(split), "a.json"); });
  EXPECT_NE(message.find("a.json"), std::string::npos);
  EXPECT_NE(message.find("train and test share camera 00_02"), std::string::npos) << message;
  EXPECT_NE(message.find("train and test share frames 2, 3"), std::string::npos) << message;
  EXPECT_NE(message.find("validation and test share frames 3, 9"), std::string::npos) << message;
  EXPECT_NE(message.find("train and validation share frame 3"), std::string::npos) << message;
}

TEST(SplitFile, RefusesWhatIsNoSplit) {
  const std::string good = SplitToJsonText(SmallSplit());
  for (size_t cut = 0; cut + 2 < good.size(); ++cut) {
    EXPECT_THROW(SplitFromJsonText(good.substr(0, cut), "cut"), FormatError) << cut;
  }
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return MessageOf<FormatError>([&] { SplitFromJsonText(text, "x"); });
  };
  EXPECT_NE(changed("mvstudio.split/1", "mvstudio.split/9").find("not a split"), std::string::npos);
  EXPECT_NE(changed("[0,1,2,3]", "[0,1,2.5,3]").find("train.frames[2]"), std::string::npos);
  EXPECT_NE(changed("[0,1,2,3]", "[0,1,1e99,3]").find("train.frames[2]"), std::string::npos);
  EXPECT_NE(changed("[0,1,2,3]", "[0,1,1,3]").find("there twice"), std::string::npos);
  EXPECT_NE(changed("[0,1,2,3]", "[]").find("train has no"), std::string::npos);
  EXPECT_NE(changed("[\"00_01\"]", "[7]").find("test.cameras[0]"), std::string::npos);
}

TEST(SplitFile, RefusesCamerasAndFramesThatTheDatasetLacks) {
  const PanopticDataset data = RingDataset(3, 10);
  EXPECT_NO_THROW(RequireSplitOf(SmallSplit(), data, "s"));
  Split split = SmallSplit();
  split.train.cameras.push_back("00_77\nrm -rf"), split.test.frames.push_back(50);
  const std::string message = MessageOf<FormatError>([&] { RequireSplitOf(split, data, "s"); });
  EXPECT_NE(message.find("00_77"), std::string::npos);
  EXPECT_NE(message.find("50"), std::string::npos);
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST(MakeSplit, PresetsOfThePaperTakeTheirShareOfTheCameras) {
  for (const auto& [preset, of_31, of_10] : {std::tuple("tna-16", 16u, 5u), std::tuple("tna-6", 6u, 2u)}) {
    SplitOptions options;
    options.preset = preset;
    const Split large = MakeSplit(RingDataset(31), options), small = MakeSplit(RingDataset(10), options);
    EXPECT_EQ(large.train.cameras.size(), of_31);
    EXPECT_EQ(large.test.cameras.size(), 31 - of_31);
    EXPECT_EQ(small.train.cameras.size(), of_10);
    EXPECT_EQ(large.test.frames.size(), 25u);
    EXPECT_EQ(large.test.frames.front(), 75);
    EXPECT_TRUE(SplitFaults(large).empty());
    EXPECT_EQ(SplitToJsonText(large), SplitToJsonText(MakeSplit(RingDataset(31), options))) << "the same every time";
  }
}

TEST(MakeSplit, LeavesOutTheGuardBandOnBothSides) {
  SplitOptions options;
  options.test_cameras = {"cam1"};
  options.test_frames = {40, 41, 42};
  options.validation_frames = {46, 47, 70, 71};
  options.guard_frames = 4;
  const Split split = MakeSplit(RingDataset(4), options);
  EXPECT_EQ(split.test.cameras, std::vector<std::string>({"00_01"})) << "the studio's own names are understood";
  EXPECT_EQ(split.validation.frames, std::vector<int>({47, 70, 71})) << "46 is too near the test";
  for (const int frame : split.train.frames) {
    for (const SplitPart* other : {&split.test, &split.validation}) {
      for (const int taken : other->frames) EXPECT_GT(std::abs(frame - taken), 4) << frame << " " << taken;
    }
  }
  EXPECT_EQ(split.train.frames.size() + split.validation.frames.size() + split.test.frames.size() + split.unused_frames.size(),
            100u);
  EXPECT_TRUE(std::count(split.train.frames.begin(), split.train.frames.end(), 35));
  EXPECT_TRUE(std::count(split.unused_frames.begin(), split.unused_frames.end(), 36));
}

TEST(MakeSplit, EveryKthCamera) {
  SplitOptions options;
  options.every_camera = 3;
  const Split split = MakeSplit(RingDataset(8), options);
  EXPECT_EQ(split.test.cameras, std::vector<std::string>({"00_02", "00_05"}));
  EXPECT_EQ(split.train.cameras.size(), 6u);
}

TEST(MakeSplit, SaysWhatIsWrong) {
  const PanopticDataset data = RingDataset(4);
  const auto message = [&](const std::function<void(SplitOptions&)>& set) {
    SplitOptions options;
    set(options);
    return MessageOf<UsageError>([&] { MakeSplit(data, options); });
  };
  EXPECT_NE(message([](SplitOptions&) {}).find("say which cameras"), std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.preset = "tna-17"; }).find("tna-16, tna-6"), std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.preset = "tna-6", o.every_camera = 2; }).find("leave out"), std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.test_cameras = {"00_09"}; }).find("'00_09' is not in the dataset"),
            std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.test_cameras = {"00_01"}, o.test_frames = {100}; }).find("frame 100"),
            std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.test_cameras = o.train_cameras = {"00_01"}; }).find("share camera 00_01"),
            std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.num_train_cameras = 4; }).find("left for test"), std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.every_camera = 1; }).find("2 at least"), std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.every_camera = 2, o.guard_frames = 1000; }).find("train has no"),
            std::string::npos);
  EXPECT_NE(message([](SplitOptions& o) { o.every_camera = 2, o.test_share = std::nan(""); }).find("test-share"),
            std::string::npos);
}

TEST(SpreadCameras, EverySecondOfARing) {
  const PanopticDataset data = RingDataset(12);
  const std::vector<int> chosen = SpreadCameras(data.rig, {0, 0, 1}, 6);
  ASSERT_EQ(chosen.size(), 6u);
  for (size_t i = 1; i < 6; ++i) EXPECT_EQ(chosen[i] - chosen[i - 1], 2) << "60 degrees apart";
  EXPECT_EQ(SpreadCameras(data.rig, {0, 0, 1}, 6, 9).size(), 6u);
  EXPECT_EQ(SpreadCameras(data.rig, {0, 0, 1}, 20).size(), 12u);
  EXPECT_TRUE(SpreadCameras(data.rig, {0, 0, 1}, 0).empty());
}

TEST(SpreadCameras, DoesNotTakeTwoThatStandTogether) {
  geometry::Rig rig;
  const double angles[] = {0, 0.01, 0.02, kPi / 2, kPi / 2 + 0.01, kPi, -kPi / 2, -kPi / 2 + 0.02};
  for (int i = 0; i < 8; ++i)
    rig.cameras.push_back(CameraAt("00_0" + std::to_string(i), {std::cos(angles[i]), std::sin(angles[i]), 0}));
  const std::vector<int> chosen = SpreadCameras(rig, {0, 0, 0}, 4);
  std::set<int> places;
  for (const int c : chosen) places.insert(c < 3 ? 0 : c < 5 ? 1 : c < 6 ? 2 : 3);
  EXPECT_EQ(places.size(), 4u);
}

TEST(MotionBlocks, CutAtJumpsAndGaps) {
  PanopticDataset data = RingDataset(3);
  data.frames.erase(data.frames.begin() + 20), data.poses.erase(20);
  const std::vector<MotionBlock> blocks = FindMotionBlocks(data);
  ASSERT_EQ(blocks.size(), 3u);
  EXPECT_EQ(blocks[0].last, 19);
  EXPECT_EQ(blocks[1].first, 21);
  EXPECT_EQ(blocks[2].first, 60);
}

/// A calm motion after another: the joints leap by less than a fast motion moves, and by far more than before and after.
TEST(MotionBlocks, CutWhereACalmMotionLeaps) {
  PanopticDataset data = RingDataset(3);
  const int last = data.frames.back();
  const auto blocks_of = [&](const std::function<double(int)>& place) {
    for (auto& [frame, people] : data.poses) people[0] = StandingPerson(place(frame));
    return FindMotionBlocks(data).size();
  };
  EXPECT_EQ(blocks_of([&](int frame) { return 0.012 * frame + (frame > last / 2 ? 0.06 : 0); }), 2u);
  EXPECT_EQ(blocks_of([&](int frame) { return 0.012 * frame + (frame > last / 2 ? 0.01 : 0); }), 1u) << "noise does as much";
  // From rest to a run, and a place that one frame has wrong, are no cuts.
  EXPECT_EQ(blocks_of([&](int frame) { return 0.0004 * std::pow(std::max(0, frame - last / 2), 2); }), 1u);
  EXPECT_EQ(blocks_of([&](int frame) { return 0.004 * frame + (frame == last / 2 ? 0.1 : 0); }), 1u);
}

TEST(DescribeSplit, MeasuresAnglesAndHowNewThePosesAre) {
  PanopticDataset data = RingDataset(8);
  for (auto& [frame, people] : data.poses) people[0] = StandingPerson(0.02 * frame);  // the same pose, elsewhere
  SplitOptions options;
  options.every_camera = 4;
  Split split = MakeSplit(data, options);
  SplitReport report = DescribeSplit(data, split);
  ASSERT_EQ(report.test_cameras.size(), 2u);
  EXPECT_NEAR(report.max_angle_deg, 45, 12) << "seen from the person, who walks off the middle";
  EXPECT_NEAR(report.max_novelty_m, 0, 1e-9) << "moved and turned poses are not new";
  EXPECT_EQ(report.test_images, 2 * 25);
  for (const int frame : split.test.frames) {
    Coco19Pose& pose = data.poses[frame][0];
    pose.x_in_world.col(5)[2] += 0.19;
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.1 * frame, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    pose.x_in_world = turn * pose.x_in_world;
  }
  report = DescribeSplit(data, split);
  EXPECT_NEAR(report.median_novelty_m, 0.019, 0.002) << "one wrist of 19 joints raised by 0.19 m, after the best shift";
}

TEST(DescribeSplit, PosesMayBeMissing) {
  PanopticDataset data = RingDataset(4);
  for (auto& [frame, people] : data.poses) people.clear();
  SplitOptions options;
  options.every_camera = 2;
  const SplitReport report = DescribeSplit(data, MakeSplit(data, options));
  EXPECT_TRUE(std::isnan(report.median_novelty_m));
  EXPECT_GT(report.max_angle_deg, 80);
}

/// The 31 HD cameras of a recorded sequence, and its joints.
TEST(Split, PresetsOnTheRealStudio) {
  if (!mvstudio::testing::HasData("panoptic")) GTEST_SKIP() << "panoptic is not there";
  PanopticDataset data;
  data.root = DataFolder("panoptic") + "/160906_band1", data.sequence = "160906_band1";
  for (const auto& camera : ReadPanopticCalibration(FindPanopticCalibration(data.root)).cameras) {
    if (camera.camera.name.rfind("00_", 0) == 0) data.rig.cameras.push_back(camera);
  }
  ASSERT_EQ(data.rig.cameras.size(), 31u);
  for (const auto& [frame, path] : ListBody3dScenes(data.root)) {
    data.frames.push_back(frame);
    data.poses[frame] = ReadBody3dScene(path);
  }
  for (const auto& [preset, count] : {std::pair("tna-16", 16u), std::pair("tna-6", 6u)}) {
    SplitOptions options;
    options.preset = preset;
    const mvstudio::testing::TempDir folder;
    WriteSplit(MakeSplit(data, options), folder / "split.json");
    const Split split = ReadSplit(folder / "split.json");
    EXPECT_EQ(split.train.cameras.size(), count);
    EXPECT_EQ(split.test.cameras.size(), 31 - count);
    EXPECT_EQ(split.test.frames.size(), 5u) << "the last quarter of 20";
    EXPECT_GT(split.test.frames.front(), split.train.frames.back());
    std::set<std::pair<std::string, int>> train;
    for (const std::string& camera : split.train.cameras) {
      for (const int frame : split.train.frames) train.insert({camera, frame});
    }
    for (const std::string& camera : split.test.cameras) {
      for (const auto& [other, frame] : train) EXPECT_NE(camera, other);
    }
    for (const int frame : split.test.frames) {
      for (const auto& [camera, other] : train) EXPECT_NE(frame, other);
    }
    const SplitReport report = DescribeSplit(data, split);
    EXPECT_LT(report.max_angle_deg, preset == std::string("tna-16") ? 40 : 60);
    std::printf("%s: test cameras are %.1f degrees from a training camera (median), at most %.1f\n", preset,
                report.median_angle_deg, report.max_angle_deg);
  }
}

TEST(Split, TurnA) {
  if (!mvstudio::testing::HasData("turn_a")) GTEST_SKIP() << "turn_a is not there";
  const std::vector<MotionBlock> blocks = FindMotionBlocks(OpenPanopticDataset(DataFolder("turn_a")));
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(blocks[1].first, 100);
}

TEST(Split, PersonA) {
  if (!mvstudio::testing::HasData("person_a")) GTEST_SKIP() << "person_a is not there";
  const PanopticDataset data = OpenPanopticDataset(DataFolder("person_a"));
  const std::vector<MotionBlock> blocks = FindMotionBlocks(data);
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(blocks[0].last, 61);
  EXPECT_EQ(blocks[1].first, 62);
  SplitOptions options;
  options.preset = "person-a-6";
  const Split split = MakeSplit(data, options);
  EXPECT_EQ(split.test.cameras, std::vector<std::string>({"00_03", "00_08"}));
  EXPECT_EQ(split.train.cameras.size(), 6u);
  EXPECT_EQ(split.train.frames.size(), 90u);
  EXPECT_EQ(split.test.frames.front(), 90);
  const SplitReport report = DescribeSplit(data, split);
  EXPECT_GT(report.test_cameras[0].angle_deg, 20);
  EXPECT_LT(report.max_angle_deg, 90);
  EXPECT_GT(report.median_novelty_m, report.usual_step_m);
}

}  // namespace
}  // namespace mvstudio::dataset
