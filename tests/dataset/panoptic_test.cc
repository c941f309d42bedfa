#include "dataset/panoptic/panoptic.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/build/scene_joints.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/panoptic/time.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

using nlohmann::json;

namespace fs = std::filesystem;

const char kBand2[] = "panoptic/160906_band2/calibration_160906_band2.json";
const char kBand2Poses[] = "panoptic/160906_band2/hdPose3d_stage1_coco19";

/// Panoptic's own formula in its own units: x_cam = R x + t.
TEST(Panoptic, CamerasKeepOrderNumbersAndPlace) {
  MVS_NEEDS_DATA(kBand2);
  const std::string path = DataFolder(kBand2);
  const json file = json::parse(ReadFile(path));
  const geometry::Rig rig = ReadPanopticCalibration(path);
  ASSERT_EQ(rig.cameras.size(), 520u);
  const Eigen::Vector3d x_cm(31.5, -140.25, 77.0);  // y down
  const Eigen::Vector3d x_in_world = Eigen::Vector3d(31.5, 77.0, 140.25) / 100;
  for (size_t i = 0; i < 520; ++i) {
    const json& c = file["cameras"][i];
    const geometry::RigCamera& camera = rig.cameras[i];
    EXPECT_EQ(camera.camera.name, c["name"]);
    EXPECT_EQ(camera.camera.model, geometry::LensModel::kBrown5);
    EXPECT_EQ(camera.camera.fx(), c["K"][0][0].get<double>());
    EXPECT_EQ(camera.camera.cy(), c["K"][1][2].get<double>());
    for (int k = 0; k < 5; ++k) EXPECT_EQ(camera.camera.params[4 + k], c["distCoef"][k].get<double>());
    const Eigen::Vector3d x_in_cam = camera.cam_from_world * x_in_world;
    for (int r = 0; r < 3; ++r) {
      double expected = c["t"][r][0];
      for (int k = 0; k < 3; ++k) expected += c["R"][r][k].get<double>() * x_cm[k];
      EXPECT_NEAR(100 * x_in_cam[r], expected, 2e-7) << camera.camera.name;  // R is orthonormal to 1e-10 only
    }
  }
}

/// A calibration of another program is no damaged JSON.
TEST(Panoptic, OtherCalibrationsAreSentToConvert) {
  mvstudio::testing::TempDir folder;
  mvstudio::testing::Put(folder / "calibration.toml", "[cam_0]\nname = \"left\"\n");
  mvstudio::testing::Put(folder / "calibration.json", "[cam_0]");
  const auto message = [&](const char* name) {
    return mvstudio::testing::MessageOf<FormatError>([&] { ReadAnyCalibration(folder / name); });
  };
  EXPECT_NE(message("calibration.toml").find("mvstudio calib convert"), std::string::npos);
  EXPECT_EQ(message("calibration.json").find("mvstudio calib convert"), std::string::npos);
}

TEST(Panoptic, CalibrationRoundTrip) {
  MVS_NEEDS_DATA(kBand2);
  const std::string path = DataFolder(kBand2);
  mvstudio::testing::TempDir folder;
  const geometry::Rig once = ReadPanopticCalibration(path);
  WritePanopticCalibration(once, folder / "calibration_b.json", "copy");
  const geometry::Rig twice = ReadPanopticCalibration(folder / "calibration_b.json");
  ASSERT_EQ(twice.cameras.size(), once.cameras.size());
  for (size_t i = 0; i < once.cameras.size(); ++i) {
    const geometry::RigCamera &a = once.cameras[i], &b = twice.cameras[i];
    EXPECT_EQ(a.camera.name, b.camera.name);
    EXPECT_EQ(a.camera.width_px, b.camera.width_px);
    EXPECT_EQ(a.camera.params, b.camera.params);
    EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
    EXPECT_LT((a.cam_from_world.rotation.coeffs() - b.cam_from_world.rotation.coeffs()).norm(), 1e-15);
  }
  const json original = json::parse(ReadFile(path)), copy = json::parse(ReadFile(folder / "calibration_b.json"));
  for (size_t i = 0; i < 520; ++i) {
    for (const char* key : {"name", "type", "resolution", "panel", "node", "K", "distCoef", "t"}) {
      EXPECT_EQ(original["cameras"][i][key], copy["cameras"][i][key]) << key;
    }
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(original["cameras"][i]["R"][r][c].get<double>(), copy["cameras"][i]["R"][r][c].get<double>(), 3e-10);
      }
    }
  }
}

TEST(Panoptic, BodySceneOfCmuReadsAndRoundTrips) {
  MVS_NEEDS_DATA(kBand2Poses);
  const std::string poses = DataFolder(kBand2Poses);
  mvstudio::testing::TempDir folder;
  for (const std::string& path : FilesMatching(poses)) {
    const Body3dScene scene = ReadBody3dSceneFile(path);
    EXPECT_EQ(scene.people.size(), 3u);
    EXPECT_EQ(scene.fps_type, "hd_29_97");
    WriteBody3dScene(scene.people, scene.univ_time_ms, folder / "copy.json");
    const json original = json::parse(ReadFile(path)), copy = json::parse(ReadFile(folder / "copy.json"));
    EXPECT_EQ(original, copy) << path;
  }
}

/// Numbers aside, the bytes are those of CMU's writer (its line ends depend on the system it ran on).
TEST(Panoptic, BodySceneHasTheByteFormOfCmu) {
  MVS_NEEDS_DATA(kBand2Poses);
  const std::string poses = DataFolder(kBand2Poses);
  mvstudio::testing::TempDir folder;
  const std::string path = FilesMatching(poses)[0];
  const Body3dScene scene = ReadBody3dSceneFile(path);
  WriteBody3dScene(scene.people, scene.univ_time_ms, folder / "copy.json");
  const auto form = [](const std::string& file) {
    std::string text = std::regex_replace(ReadFile(file), std::regex("\r"), "");
    return std::regex_replace(text, std::regex("-?[0-9]+(\\.[0-9]+)?(e-?[0-9]+)?([,\\]])"), "N$3");
  };
  EXPECT_EQ(form(path), form(folder / "copy.json"));
}

TEST(Panoptic, InvalidJointsAndEmptyScenes) {
  mvstudio::testing::TempDir folder;
  Coco19Pose pose;
  pose.valid[4] = true;
  pose.confidence[4] = 0.5;
  pose.x_in_world.col(4) << 0.123456789, -0.25, 1.5;
  WriteBody3dScene({{3, pose}}, -1, folder / "a.json");
  const json file = json::parse(ReadFile(folder / "a.json"));
  const auto& joints = file["bodies"][0]["joints19"];
  ASSERT_EQ(joints.size(), 76u);
  EXPECT_EQ(joints[0], 0);
  EXPECT_EQ(joints[3], -1);
  EXPECT_NEAR(joints[16].get<double>(), 12.3456789, 1e-12);
  EXPECT_NEAR(joints[17].get<double>(), -150, 1e-12);  // y is down
  EXPECT_NEAR(joints[18].get<double>(), -25, 1e-12);
  const auto people = ReadBody3dScene(folder / "a.json");
  EXPECT_FALSE(people.at(3).valid[0]);
  EXPECT_TRUE(people.at(3).valid[4]);
  WriteBody3dScene({}, 0, folder / "empty.json");
  EXPECT_TRUE(ReadBody3dScene(folder / "empty.json").empty());
}

TEST(Panoptic, TruncatedAndMutatedFilesAreFormatErrors) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  mvstudio::testing::TempDir folder;
  const std::string calibration = person + "/calibration_person_a.json";
  const std::string pose = person + "/hdPose3d_stage1_coco19/body3DScene_00000000.json";
  for (int i = 0; i < 100; ++i) {
    Truncate(calibration, folder / "c.json", i / 100.0);
    EXPECT_THROW(ReadPanopticCalibration(folder / "c.json"), FormatError) << i;
    Truncate(pose, folder / "p.json", i / 100.0);
    EXPECT_THROW(ReadBody3dScene(folder / "p.json"), FormatError) << i;
  }
  WriteFileAtomic(folder / "deep.json", std::string(100000, '['));
  EXPECT_THROW(ReadPanopticCalibration(folder / "deep.json"), FormatError);
}

TEST(Panoptic, WrongFieldsAreNamed) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  mvstudio::testing::TempDir folder;
  const json good = json::parse(ReadFile(person + "/calibration_person_a.json"));
  const auto where = [&](const std::function<void(json&)>& change) -> std::string {
    json bad = good;
    change(bad["cameras"][2]);
    WriteFileAtomic(folder / "c.json", bad.dump());
    try {
      ReadPanopticCalibration(folder / "c.json");
    } catch (const FormatError& error) {
      return error.where();
    }
    return "no error";
  };
  EXPECT_EQ(where([](json& c) { c["K"][1][2] = "x"; }), "cameras[2].K[1][2]");
  EXPECT_EQ(where([](json& c) { c["K"][0][1] = 0.5; }), "cameras[2].K");
  EXPECT_EQ(where([](json& c) { c.erase("t"); }), "cameras[2].t");
  EXPECT_EQ(where([](json& c) { c["distCoef"].erase(4); }), "cameras[2].distCoef");
  EXPECT_EQ(where([](json& c) {
              for (auto& v : c["R"][0]) v = -v.get<double>();
            }),
            "cameras[2].R");
  EXPECT_EQ(where([](json& c) { c["R"][0][0] = 3; }), "cameras[2].R");
  EXPECT_EQ(where([](json& c) { c["resolution"][0] = 0; }), "cameras[2].resolution");
  EXPECT_EQ(where([](json& c) { c["name"] = "00_01"; }), "cameras[2].name");
  EXPECT_EQ(where([](json& c) { c["name"] = "../up"; }), "cameras[2].name");
}

/// Every lens either keeps its projection through the file or is refused.
TEST(Panoptic, LensesBeyondFiveCoefficientsAreRefused) {
  mvstudio::testing::TempDir folder;
  geometry::Rig rig;
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("00_00", 640, 480, 500);
  int written = 0;
  for (const geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    rig.cameras = {camera};
    geometry::Camera& lens = rig.cameras[0].camera;
    lens.model = model;
    lens.params = Eigen::VectorXd::Constant(NumParams(model), 0.01);
    lens.params.head<4>() = camera.camera.params;
    const bool fits = !IsWide(model) && NumParams(model) <= 9;
    if (!fits) {
      EXPECT_THROW(WritePanopticCalibration(rig, folder / "c.json", ""), UsageError) << ToString(model);
      continue;
    }
    ++written;
    WritePanopticCalibration(rig, folder / "c.json", "");
    const Eigen::Vector3d x(0.3, -0.2, 1.1);
    const geometry::Rig back = ReadPanopticCalibration(folder / "c.json");
    EXPECT_LT((Project(back.cameras[0].camera, x).px - Project(lens, x).px).norm(), 1e-12) << ToString(model);
  }
  EXPECT_EQ(written, 7);
  rig.cameras[0] = camera;
  rig.cameras[0].camera.name = "left";
  EXPECT_THROW(WritePanopticCalibration(rig, folder / "c.json", ""), ContractViolation);
}

TEST(Panoptic, OpensAForeignDataset) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  const PanopticDataset dataset = OpenPanopticDataset(person);
  EXPECT_EQ(dataset.sequence, "person_a");
  EXPECT_EQ(dataset.rig.cameras.size(), 10u);
  EXPECT_EQ(dataset.frames.size(), 120u);
  EXPECT_EQ(dataset.Resolve("00_03"), "00_03");
  EXPECT_EQ(dataset.Resolve("cam_9"), "");
  EXPECT_TRUE(std::filesystem::exists(dataset.ImagePath("00_03", 119)));
  EXPECT_TRUE(std::filesystem::exists(dataset.MaskPath("00_03", 119)));
  const Coco19Pose& pose = dataset.poses.at(0).at(0);
  EXPECT_GT(pose.x_in_world(2, 1), 1.4);  // the nose is up
  EXPECT_THROW(OpenPanopticDataset(person + "/truth"), IoError);
}

/// What people give in place of a dataset is named, and where the dataset is.
TEST(Panoptic, PacksAndSessionsAreNamed) {
  const TempDir folder;
  const auto said = [&](const std::string& name) {
    return MessageOf<IoError>([&] { FindPanopticCalibration(folder / name); });
  };
  std::ofstream(folder / "one.h5", std::ios::binary) << std::string("\x89HDF\r\n\x1a\n\0rest", 13);
  std::ofstream(folder / "text") << "calibration";
  fs::create_directories(folder / "pack");
  std::ofstream(folder / "pack/shard-00000.h5") << "";
  EXPECT_THAT(said("one.h5"), HasSubstr("reads the dataset that the pack was made from"));
  EXPECT_THAT(said("pack"), HasSubstr("reads the dataset that the pack was made from"));
  EXPECT_THAT(said("text"), HasSubstr("is a file, a folder was expected"));
  fs::create_directories(folder / "day/dataset/walk");
  EXPECT_THAT(said("day"), HasSubstr("not a dataset in Panoptic layout"));
  std::ofstream(folder / "day/mvstudio.toml") << "";
  EXPECT_THAT(said("day"), HasSubstr("mvstudio dataset build option 'session' " + (folder / "day") + " makes one"));
  std::ofstream(folder / "day/dataset/walk/calibration_walk.json") << "{}";
  EXPECT_THAT(said("day"), HasSubstr("its datasets: " + (folder / "day/dataset/walk")));
}

TEST(PanopticSequence, EveryKindOfFootageIsFound) {
  mvstudio::testing::TempDir folder;
  const auto touch = [&](const std::string& name) { WriteFileAtomic(folder / name, "x"); };
  for (const char* name :
       {"calibration_160422_haggling1.json", "hdImgs/00_07/00_07_00000245.jpg", "hdImgs/00_07/00_07_00000246.png",
        "hdImgs/00_07/notes.txt", "hdImgs/extra/a.jpg", "hdVideos/hd_00_30.mp4", "hdVideos/hd_00_07.mp4",
        "vgaVideos/vga_17_11.mp4", "vgaVideos/KINECTNODE4/vga_04_07.mp4", "vgaImgs/20_24/20_24_00000000.jpg",
        "kinectImgs/50_10/50_10_00000001.jpg", "kinectVideos/kinect_50_02.mp4", "hdPose3d_stage1/body3DScene_00000245.json",
        "hdFace3d/faceRecon3D_hd00000245.json", "hdHand3d/handRecon3D_hd00000246.json",
        "vgaPose3d_stage1/body3DScene_00000000.json", "synctables_160422_haggling1.json", "hdFace3d/faceRecon3D_hd1.json"}) {
    touch(name);
  }
  const PanopticSequence sequence = ScanPanopticSequence(folder.path());
  EXPECT_EQ(sequence.name, "160422_haggling1");
  std::map<std::string, bool> is_video;
  for (const auto& [camera, footage] : sequence.footage) is_video[camera] = footage.is_video;
  EXPECT_EQ(is_video, (std::map<std::string, bool>{{"00_07", false},
                                                   {"00_30", true},
                                                   {"04_07", true},
                                                   {"17_11", true},
                                                   {"20_24", false},
                                                   {"50_02", true},
                                                   {"50_10", false}}));
  EXPECT_EQ(sequence.footage.at("00_07").images.rbegin()->first, 246);
  EXPECT_EQ(std::filesystem::path(sequence.footage.at("00_07").other).filename(), "hd_00_07.mp4");
  EXPECT_EQ(sequence.hd_scenes.files.begin()->first, 245);  // the old folder, for want of another
  EXPECT_EQ(sequence.hands.files.begin()->first, 246);
  EXPECT_EQ(sequence.vga_scenes.files.size(), 1u);
  EXPECT_FALSE(sequence.sync.empty());
  EXPECT_TRUE(sequence.kinect_sync.empty());
  EXPECT_EQ(sequence.strange.size(), 3u);  // notes.txt, extra, the face with a short number
}

TEST(PanopticSequence, Selections) {
  const std::vector<std::string> names = {"01_01", "00_02", "50_03", "00_01"};
  EXPECT_EQ(SelectPanopticCameras(names, "hd"), (std::vector<std::string>{"00_02", "00_01"}));
  EXPECT_EQ(SelectPanopticCameras(names, "kinect,00_01"), (std::vector<std::string>{"50_03", "00_01"}));
  for (const char* bad : {"00_09", "hd,depth", "", ","}) EXPECT_THROW(SelectPanopticCameras(names, bad), UsageError) << bad;
}

TEST(PanopticTime, ShiftOfTheTableIsMeasured) {
  for (const int shift : {-2, 0, 1, 3}) {
    PanopticSyncTrack track;
    for (int p = 0; p < 100; ++p) track.univ_time_ms.push_back(p == 50 ? -1 : 1000 + 33.3667 * p);
    std::map<int, double> joints;
    for (int f = 20; f < 60; ++f) joints[f] = 1000 + 33.3667 * (f + shift);
    const PanopticTableMatch match = MatchPanopticTable(joints, track);
    EXPECT_EQ(match.shift, shift);
    EXPECT_FALSE(match.contradicts());
    AddTable(track, match, &joints);
    EXPECT_NEAR(joints.at(70), 1000 + 33.3667 * (70 + shift), 1e-9);
  }
  PanopticSyncTrack other;
  for (int p = 0; p < 100; ++p) other.univ_time_ms.push_back(1010 + 33.3667 * p);
  EXPECT_TRUE(MatchPanopticTable({{5, 1000 + 33.3667 * 6}, {6, 1000 + 33.3667 * 7}}, other).contradicts());
  EXPECT_EQ(MatchPanopticTable({}, other).shift, 1);
}

TEST(PanopticTime, FramesByTheNearestTime) {
  std::map<int, double> known;
  for (int f = 245; f < 300; f += 3) known[f] = 90000 + 33.3667 * f;
  const PanopticClock clock = FitPanopticClock(known);
  EXPECT_TRUE(clock.is_line);
  EXPECT_NEAR(*clock.TimeMs(246), 90000 + 33.3667 * 246, 1e-6);
  EXPECT_EQ(clock.NearestFrame(90000 + 33.3667 * 250 + 10), 250);
  EXPECT_EQ(clock.NearestFrame(-1e6), std::nullopt);
  const PanopticClock broken = FitPanopticClock({{0, 0}, {1, 33}, {2, 5000}, {3, 5033}});
  EXPECT_FALSE(broken.is_line);
  EXPECT_EQ(broken.TimeMs(7), std::nullopt);
  EXPECT_EQ(FitPanopticClock({}).TimeMs(0), std::nullopt);
}

/// A dataset, or its folder of scenes, in place of a folder of points.
TEST(SceneJoints, AreTheSceneFilesJoints) {
  const mvstudio::testing::TempDir folder;
  std::filesystem::create_directories(folder / "d/hdPose3d_stage1_coco19");
  Coco19Pose pose = StandingPerson(0.5);
  pose.valid[4] = false, pose.confidence[7] = 0.5;
  for (const int frame : {7, 12}) {
    WriteBody3dScene({{3, pose}}, 1000 + 40.0 * frame,
                     folder / ("d/hdPose3d_stage1_coco19/body3DScene_0000000" + std::string(frame == 7 ? "7" : "9") + ".json"));
  }
  for (const char* path : {"d", "d/hdPose3d_stage1_coco19"}) {
    const Pose3d read = ReadSceneJoints(folder / path);
    EXPECT_NEAR(read.frame_rate_hz, 1000.0 * (9 - 7) / (40 * (12 - 7)), 1e-9) << "numbers of files by their time stamps";
    const auto poses = ToCoco19(read);
    ASSERT_EQ(poses.size(), 2u) << path;
    const Coco19Pose& back = poses.at(9).at(3);
    EXPECT_FALSE(back.valid[4]);
    EXPECT_NEAR(back.confidence[7], 0.5, 1e-6);
    EXPECT_LT((back.x_in_world.col(7) - pose.x_in_world.col(7)).norm(), 1e-6);
  }
  EXPECT_TRUE(SceneFilesAt(folder.path()).empty());
  EXPECT_THROW(ReadSceneJoints(folder.path()), IoError);
}

}  // namespace
}  // namespace mvstudio::dataset
