#include <filesystem>

#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/pose/pose3d.h"
#include "dataset/session/session.h"
#include "dataset/session/timeline_source.h"
#include "geometry/rig/rig_io.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `dataset import panoptic`, `dataset verify` and `dataset info` as a user runs them, and a reader that is not ours.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kFirst = 4, kLast = 11;  // HD frames with joints; the videos begin at 0
constexpr double kHdMs = 1001.0 / 30, kStartMs = 5000;

std::string Number(int frame) { return Format("%08d", frame); }

geometry::RigCamera CameraAt(const std::string& name, double angle, int width, int height) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole(name, width, height, 0.9 * width);
  camera.camera.model = geometry::LensModel::kBrown5;
  camera.camera.params.conservativeResize(9);
  camera.camera.params.tail<5>() << -0.2, 0.15, 0.001, -0.0007, 0.05;
  const Eigen::Vector3d center(3 * std::sin(angle), -3 * std::cos(angle), 1.2);
  const Eigen::Vector3d forward = (Eigen::Vector3d(0, 0, 1) - center).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rows;
  rows << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.cam_from_world = {Eigen::Quaterniond(rows), -(rows * center)};
  return camera;
}

std::string Landmarks(const Eigen::Vector3d& cm, int count) {
  std::string xyz, score;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) xyz += (xyz.empty() ? "" : ",") + std::to_string(cm[k] + 0.1 * i);
    score += (i ? ",0.5" : "0.5");
  }
  return "{\"landmarks\":[" + xyz + "],\"averageScore\":[" + score + "]}";
}

/// Two HD videos, a VGA video in CMU's other folder form, Kinect images that begin at 1, joints that begin at 4, a face, one
/// hand, sync tables.
class Sequence {
 public:
  Sequence() {
    fs::create_directories(folder_ / "seq");
    geometry::Rig rig;
    rig.cameras = {CameraAt("50_01", 2.0, 64, 48), CameraAt("00_07", 0.4, 64, 48), CameraAt("01_03", 1.1, 32, 24),
                   CameraAt("00_02", -0.7, 64, 48)};
    dataset::WritePanopticCalibration(rig, Root() + "/calibration_seq.json", "synthetic");
    WriteVideo("hdVideos/hd_00_02.mp4", 64, 48, kLast + 1, 0, 29.97);
    WriteVideo("hdVideos/hd_00_07.mp4", 64, 48, kLast + 1, 2, 29.97);
    WriteVideo("vgaVideos/KINECTNODE1/vga_01_03.mp4", 32, 24, 9, 4, 25);
    for (int n = 1; n <= 10; ++n)
      dataset::WriteImage(dataset::SmoothImage(64, 48, 0.2 * n), Root() + "/kinectImgs/50_01/50_01_" + Number(n) + ".jpg");
    for (int f = kFirst; f <= kLast; ++f) WriteJoints(f);
    WriteTables();
  }
  std::string Root() const { return folder_ / "seq"; }
  std::string Out() const { return folder_ / "session"; }
  std::string Path(const std::string& name) const { return Root() + "/" + name; }
  const TempDir& folder() const { return folder_; }

  CliRun Import(std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {"dataset", "import", "panoptic", Root(), "--out", Out(), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }

 private:
  void WriteVideo(const std::string& name, int width, int height, int frames, double phase, double fps) {
    fs::create_directories(fs::path(Path(name)).parent_path());
    dataset::VideoWriter writer(Path(name), width, height, fps);
    for (int f = 0; f < frames; ++f) writer.Write(dataset::SmoothImage(width, height, phase + 0.3 * f));
    writer.Close();
  }

  void WriteJoints(int frame) {
    const double x = 0.02 * frame;
    dataset::WriteBody3dScene({{0, dataset::StandingPerson(x)}, {4, dataset::StandingPerson(x + 0.8)}},
                              kStartMs + kHdMs * frame, Path("hdPose3d_stage1_coco19/body3DScene_" + Number(frame) + ".json"));
    const Eigen::Vector3d head(100 * x, -160, -10), hand(100 * x + 48, -100, 0);
    WriteFileAtomic(Path("hdFace3d/faceRecon3D_hd" + Number(frame) + ".json"),
                    "{\"people\":[{\"id\":0,\"face70\":" + Landmarks(head, 70) + "}]}");
    WriteFileAtomic(Path("hdHand3d/handRecon3D_hd" + Number(frame) + ".json"),
                    "{\"people\":[{\"id\":0,\"left_hand\":" + Landmarks(hand, 21) + "},{\"id\":-1}]}");
  }

  void WriteTables() {
    json hd = json::array(), color = json::array();
    for (int p = 0; p < 20; ++p) hd.push_back(kStartMs + kHdMs * (p - 1));  // frame f at f + 1, as CMU's tables
    for (int n = 0; n < 12; ++n) color.push_back(kStartMs + 3 + kHdMs * n);
    WriteFileAtomic(Path("synctables_seq.json"), json({{"hd", {{"univ_time", hd}}}}).dump());
    WriteFileAtomic(Path("ksynctables_seq.json"),
                    json({{"kinect", {{"color", {{"KINECTNODE1", {{"univ_time", color}}}}}}}}).dump());
    for (int v = 0; v < 9; ++v) {
      WriteFileAtomic(Path("vgaPose3d_stage1_coco19/body3DScene_" + Number(v) + ".json"),
                      json({{"univTime", kStartMs + 7 + 40 * v}, {"fpsType", "vga_25"}, {"bodies", json::array()}}).dump());
    }
  }

  TempDir folder_;
};

/// Joints of a session's points.csv, by frame and person.
std::map<int, std::map<int, dataset::Coco19Pose>> JointsOf(const std::string& session, const std::string& take) {
  return dataset::ToCoco19(dataset::ReadPose3d(session + "/pose3d/" + take));
}

TEST(ImportPanoptic, VideosImagesAndClocksOfAllKinds) {
  const Sequence sequence;
  const CliRun run = sequence.Import({"--pictures", "decode"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const json metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["cameras_with_footage"], 4);
  EXPECT_EQ(metrics["frames"], kLast - kFirst + 1);
  EXPECT_EQ(metrics["first_frame"], kFirst);
  EXPECT_EQ(metrics["takes"], json({"seq"}));
  EXPECT_EQ(metrics["faces"], 8);
  EXPECT_EQ(metrics["pictures"], 2 * (kLast + 1) + 9 + 10);
  EXPECT_LT(metrics["worst_clock_ms"].get<double>(), 0.01);

  const auto joints = JointsOf(sequence.Out(), "seq");
  for (int f = kFirst; f <= kLast; ++f) {
    const auto scene = dataset::ReadBody3dScene(sequence.Path("hdPose3d_stage1_coco19/body3DScene_" + Number(f) + ".json"));
    for (const auto& [id, pose] : scene) EXPECT_EQ(joints.at(f).at(id).x_in_world, pose.x_in_world);
  }
  const dataset::Session session = dataset::ReadSession(sequence.Out());
  const auto take = dataset::BuildTakeTimeline(session, dataset::TakeOf(session, ""), {});
  EXPECT_EQ(take.timeline.clock, dataset::TimelineClock::kCommon);
  const dataset::CameraTimeline *vga = take.timeline.Find("01_03"), *kinect = take.timeline.Find("50_01");
  ASSERT_NE(vga, nullptr);
  EXPECT_NEAR(vga->fps_hz, 25, 1e-3);
  // HD frame 5 is at 166.83 ms, VGA frame 4 at 167 ms; Kinect image 6 is at 3 + 5 x 33.37 - 6.25 = 163.6 ms.
  const dataset::CameraTimeline* hd = take.timeline.Find("00_02");
  const size_t time_step = 5;  // counted as the joints are, by HD frames, though the calibration lists a Kinect first
  EXPECT_EQ(hd->frame_at.at(time_step), 5);
  EXPECT_EQ(vga->frame_at.at(time_step), 4);
  EXPECT_EQ(kinect->frame_at.at(time_step), 6);
  EXPECT_NEAR(kinect->residual_s.at(time_step) - hd->residual_s.at(time_step), -0.00325, 1e-4);
  // a decoded image is that frame of the video
  const Image image = dataset::ReadImage(sequence.Out() + "/raw/seq/00_07/00_07_00000006.jpg");
  EXPECT_LT(dataset::MeanAbsDifference(image, dataset::SmoothImage(64, 48, 2 + 0.3 * 6)), 4);
  EXPECT_TRUE(fs::exists(sequence.Out() + "/panoptic/hdHand3d/handRecon3D_hd00000004.json"));
  EXPECT_TRUE(fs::exists(sequence.Out() + "/panoptic/hd_times.csv"));
}

TEST(ImportPanoptic, WithoutHdFootageJointsAreCountedByVgaFrames) {
  const Sequence sequence;
  for (int v = 2; v < 6; ++v) {
    dataset::PanopticScene scene = dataset::ToPanopticScene({{0, dataset::StandingPerson(0.1 * v)}}, kStartMs + 7 + 40 * v);
    scene.fps_type = "vga_25";
    dataset::WritePanopticScene(scene, sequence.Path("vgaPose3d_stage1_coco19/body3DScene_" + Number(v) + ".json"));
  }
  const CliRun run = sequence.Import({"--cameras", "vga"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_THAT(run.out, HasSubstr("counted by HD frames"));
  EXPECT_EQ(JointsOf(sequence.Out(), "seq-hd").begin()->first, kFirst);
  const auto joints = JointsOf(sequence.Out(), "seq");
  ASSERT_EQ(joints.size(), 4u);
  EXPECT_NEAR(joints.at(3).at(0).x_in_world(0, 0), dataset::StandingPerson(0.3).x_in_world(0, 0), 1e-12);
  const CliRun build = RunCli({"dataset", "build", "--session", sequence.Out(), "--out", sequence.folder() / "d", "--no-masks",
                               "--allow-outside", "--json"});
  ASSERT_EQ(build.exit, 0) << build.out << build.err;
  EXPECT_EQ(build.Json()["metrics"]["images"], 4);
}

TEST(ImportPanoptic, LinksCopiesAndSelections) {
  const Sequence sequence;
  const CliRun linked = sequence.Import({"--cameras", "hd", "--frames", "6-9"});
  ASSERT_EQ(linked.exit, 0) << linked.out << linked.err;
  EXPECT_EQ(linked.Json()["metrics"]["frames"], 4);
  EXPECT_EQ(linked.Json()["metrics"]["cameras"], 2);
  EXPECT_TRUE(fs::is_symlink(sequence.Out() + "/raw/seq/00_02.mp4"));
  const dataset::Session session = dataset::ReadSession(sequence.Out());
  EXPECT_TRUE(session.warnings.empty());
  EXPECT_THAT(linked.out, HasSubstr("DAT-OUTSIDE"));
  EXPECT_EQ(RunCli({"session", "timeline", sequence.Out()}).exit, 3) << "a session cannot let itself out";
  EXPECT_EQ(RunCli({"session", "timeline", sequence.Out(), "--allow-outside"}).exit, 0);
  EXPECT_EQ(geometry::ReadRig(sequence.Out() + "/calib/calibration.json").cameras.size(), 2u);

  EXPECT_EQ(sequence.Import().exit, 2) << "the session is there";
  fs::remove_all(sequence.Out());
  const CliRun copied = sequence.Import({"--cameras", "kinect,00_07", "--pictures", "copy"});
  ASSERT_EQ(copied.exit, 0) << copied.out << copied.err;
  EXPECT_FALSE(fs::is_symlink(sequence.Out() + "/raw/seq/00_07.mp4"));
  EXPECT_TRUE(fs::is_regular_file(sequence.Out() + "/raw/seq/50_01/50_01_00000010.jpg"));
  fs::remove_all(sequence.Out());
  EXPECT_EQ(sequence.Import({"--cameras", "00_30"}).exit, 2);
  EXPECT_EQ(sequence.Import({"--frames", "9-6"}).exit, 2);
  EXPECT_EQ(sequence.Import({"--frames", "900-990"}).exit, 3);
  EXPECT_EQ(sequence.Import({"--pictures", "burn"}).exit, 2);
  EXPECT_FALSE(fs::exists(sequence.Out()));
}

TEST(ImportPanoptic, WithoutTablesTheClocksStandAlone) {
  const Sequence sequence;
  for (const char* name : {"synctables_seq.json", "ksynctables_seq.json", "vgaPose3d_stage1_coco19"})
    fs::remove_all(sequence.Path(name));
  const CliRun run = sequence.Import();
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["takes"].size(), 3u);
  EXPECT_THAT(run.out, HasSubstr("nothing relates the clock of take seq-vga"));
  const dataset::Session session = dataset::ReadSession(sequence.Out());
  EXPECT_FALSE(dataset::TakeOf(session, "seq").timestamps.empty());
  EXPECT_TRUE(dataset::TakeOf(session, "seq-vga").timestamps.empty());
  EXPECT_EQ(dataset::TakeOf(session, "seq-vga").fps_hz, 25);
}

TEST(ImportPanoptic, WhatIsBadIsListedAndTheRestImported) {
  const Sequence sequence;
  json calibration = json::parse(ReadFile(sequence.Path("calibration_seq.json")));
  calibration["cameras"][0]["name"] = "../../up";
  WriteFileAtomic(sequence.Path("calibration_seq.json"), calibration.dump());
  dataset::Truncate(sequence.Path("hdVideos/hd_00_07.mp4"), sequence.Path("cut"), 0.5);
  fs::rename(sequence.Path("cut"), sequence.Path("hdVideos/hd_00_07.mp4"));
  dataset::Truncate(sequence.Path("hdPose3d_stage1_coco19/body3DScene_00000007.json"), sequence.Path("cut"), 0.5);
  fs::rename(sequence.Path("cut"), sequence.Path("hdPose3d_stage1_coco19/body3DScene_00000007.json"));
  WriteFileAtomic(sequence.Path("hdFace3d/faceRecon3D_hd00000009.json"),
                  "{\"people\":[{\"id\":0,\"face70\":{\"landmarks\":[1]}}]}");
  const CliRun run = sequence.Import({"--pictures", "decode"});
  EXPECT_EQ(run.exit, 6);
  EXPECT_EQ(run.Json()["status"], "partial");
  for (const char* part : {"cut short or damaged", "hd_00_07.mp4", "cameras[0].name", "people[0].face70.landmarks", "50_01"})
    EXPECT_THAT(run.out, HasSubstr(part));
  EXPECT_EQ(run.Json()["metrics"]["frames"], 7);
  EXPECT_EQ(run.Json()["metrics"]["faces"], 7);
  EXPECT_EQ(JointsOf(sequence.Out(), "seq").count(7), 0u);
  EXPECT_FALSE(fs::exists(sequence.folder() / "up"));

  const CliRun verify = RunCli({"dataset", "verify", sequence.Root(), "--json"});
  EXPECT_EQ(verify.exit, 6);
  for (const char* code : {"DAT-CALIB", "DAT-VIDEO", "DAT-POSE", "DAT-FACE", "DAT-NAME"})
    EXPECT_THAT(verify.out, HasSubstr(code));
  WriteFileAtomic(sequence.Path("calibration_seq.json"), "{\"cameras\":[]}");
  EXPECT_EQ(RunCli({"dataset", "verify", sequence.Root()}).exit, 3);
  fs::remove_all(sequence.Out());
  EXPECT_EQ(sequence.Import().exit, 3);
  EXPECT_FALSE(fs::exists(sequence.Out()));
}

TEST(ImportPanoptic, LinksOutOfTheSequenceAreRefused) {
  const Sequence sequence;
  fs::create_directories(sequence.folder() / "elsewhere");
  fs::rename(sequence.Path("kinectImgs/50_01"), sequence.folder() / "elsewhere/50_01");
  fs::create_directory_symlink(sequence.folder() / "elsewhere/50_01", sequence.Path("kinectImgs/50_01"));
  const CliRun refused = sequence.Import();
  EXPECT_EQ(refused.exit, 3);
  EXPECT_THAT(refused.out + refused.err, HasSubstr("symbolic link out of the sequence"));
  EXPECT_FALSE(fs::exists(sequence.Out()));
  const CliRun verify = RunCli({"dataset", "verify", sequence.Root(), "--json"});
  EXPECT_EQ(verify.exit, 6);
  EXPECT_THAT(verify.out, HasSubstr("DAT-LINK"));
  EXPECT_EQ(sequence.Import({"--follow-links"}).exit, 0);
}

TEST(ImportPanoptic, PersonA) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = dataset::DataFolder("person_a");
  TempDir folder;
  const CliRun run = RunCli({"dataset", "import", "panoptic", person, "--out", folder / "s", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["warnings"].size(), 1u) << run.out;
  EXPECT_THAT(run.out, HasSubstr("--allow-outside"));
  EXPECT_EQ(run.Json()["metrics"]["cameras_with_footage"], 10);
  const auto joints = JointsOf(folder / "s", "person_a");
  ASSERT_EQ(joints.size(), 120u);
  const auto truth = dataset::OpenPanopticDataset(person);
  for (const auto& [frame, people] : truth.poses) {
    EXPECT_EQ(joints.at(frame).at(0).x_in_world, people.at(0).x_in_world);
    for (int j = 0; j < 19; ++j) EXPECT_NEAR(joints.at(frame).at(0).confidence[j], people.at(0).confidence[j], 1e-12);
  }
  const geometry::Rig rig = geometry::ReadRig(folder / "s/calib/calibration.json");
  for (size_t c = 0; c < 10; ++c) {
    EXPECT_EQ(rig.cameras[c].camera.params, truth.rig.cameras[c].camera.params);
    EXPECT_EQ(rig.cameras[c].cam_from_world.translation, truth.rig.cameras[c].cam_from_world.translation);
  }
  const dataset::Session session = dataset::ReadSession(folder / "s");
  dataset::TakeTimelineOptions options;
  options.allow_outside = true;
  const auto take = dataset::BuildTakeTimeline(session, dataset::TakeOf(session, ""), options);
  EXPECT_EQ(take.timeline.num_time_steps, 120);
  EXPECT_NEAR(take.timeline.fps_hz, 15, 1e-3);
  for (const auto& camera : take.timeline.cameras) EXPECT_EQ(camera.frame_at.at(119), 119) << camera.name;
  EXPECT_TRUE(fs::exists(folder / "s/masks/person_a/00_03/00_03_00000119.png"));
}

TEST(ImportPanoptic, RealSequencesWithoutImages) {
  MVS_NEEDS_DATA("panoptic");
  for (const std::string band : {"160906_band1", "160906_band2"}) {
    TempDir folder;
    const std::string root = dataset::DataFolder("panoptic/" + band);
    const CliRun run = RunCli({"dataset", "import", "panoptic", root, "--out", folder / "s", "--json"});
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    EXPECT_EQ(run.Json()["metrics"]["cameras"], 520);
    EXPECT_EQ(run.Json()["metrics"]["frames"], 20);
    EXPECT_EQ(run.Json()["metrics"]["most_people"], 3);
    EXPECT_LT(run.Json()["metrics"]["worst_clock_ms"].get<double>(), 0.1);
    EXPECT_EQ(dataset::ReadSession(folder / "s").cameras.size(), 520u);
    const CliRun verify = RunCli({"dataset", "verify", root, "--json"});
    EXPECT_EQ(verify.exit, 0) << verify.out;
    const CliRun info = RunCli({"dataset", "info", root, "--json"});
    EXPECT_EQ(info.exit, 0) << info.out;
    EXPECT_EQ(info.Json()["metrics"]["calibrated"], json({{"hd", 31}, {"kinect", 10}, {"vga", 479}}));
  }
}

/// What the reader that is not ours makes of a dataset.
json Client(const std::string& root, const std::string& more) {
  TempDir folder;
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const std::string script = std::string(source ? source : ".") + "/tests/clients/panoptic_reader.py";
  const std::string line = "/usr/bin/python3 " + ShellQuote(script) + " " + ShellQuote(root) + " " + more + " >" +
                           ShellQuote(folder / "out") + " 2>" + ShellQuote(folder / "err");
  EXPECT_EQ(std::system(line.c_str()), 0) << Slurp(folder / "err");
  return json::parse(Slurp(folder / "out"), nullptr, false);
}

bool HasClient() { return std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") == 0; }

/// Same bodies, same points, same pixels as ours; returns the number of pixels compared and the largest difference.
std::pair<int, double> CompareWithClient(const std::string& root, const json& client) {
  const geometry::Rig rig = dataset::ReadPanopticCalibration(dataset::FindPanopticCalibration(root));
  const auto files = dataset::ListBody3dScenes(root);
  int compared = 0;
  double worst_px = 0;
  for (const json& frame : client["frames"]) {
    const auto people = dataset::ReadBody3dScene(files.at(frame["frame"].get<int>()));
    size_t counted = 0;
    for (const auto& [id, pose] : people) counted += pose.valid[2] && pose.confidence[2] > 0.1;
    EXPECT_EQ(frame["bodies"].size(), counted);
    for (const json& body : frame["bodies"]) {
      const dataset::Coco19Pose& pose = people.at(body["id"].get<int>());
      for (const json& name : client["cameras"]) {
        const int index = rig.Find(name.get<std::string>());
        const geometry::RigCamera& camera = rig.cameras.at(static_cast<size_t>(index));
        const json& px = body["px"][name.get<std::string>()];
        for (size_t j = 0; j < 19; ++j) {
          if (!body["counts"][j].get<bool>()) continue;
          const Eigen::Vector3d x = pose.x_in_world.col(static_cast<Eigen::Index>(j));
          const auto x_mm = body["points_mm"][j].get<std::vector<double>>();
          EXPECT_LT((Eigen::Vector3d(x_mm[0], x_mm[1], x_mm[2]) - 1000 * x).norm(), 1e-9);
          const geometry::Projection projection = geometry::Project(camera.camera, camera.cam_from_world * x);
          if (projection.status != Status::kOk) continue;
          if (!InImage(camera.camera, projection.px)) continue;
          ++compared;
          for (const char* reader : {"voxel", "toolbox"}) {
            const auto uv = px[reader][j].get<std::vector<double>>();
            worst_px = std::max(worst_px, (Eigen::Vector2d(uv[0], uv[1]) - projection.px).norm());
          }
        }
      }
    }
  }
  return {compared, worst_px};
}

TEST(PanopticClient, ReadsWhatWeWrite) {
  if (!HasClient()) GTEST_SKIP() << "needs /usr/bin/python3 with numpy (python3-numpy)";
  const Sequence sequence;
  fs::create_directories(sequence.Path("hdImgs"));
  const auto [compared, worst_px] = CompareWithClient(sequence.Root(), Client(sequence.Root(), ""));
  EXPECT_GT(compared, 800);
  EXPECT_LT(worst_px, 1e-6);
  RecordProperty("worst_px", std::to_string(worst_px * 1e9) + "e-9");
}

TEST(PanopticClient, ReadsRealFilesThatWeWroteAgain) {
  MVS_NEEDS_DATA("panoptic");
  if (!HasClient()) GTEST_SKIP() << "needs /usr/bin/python3 with numpy (python3-numpy)";
  const std::string root = dataset::DataFolder("panoptic/160906_band1");
  TempDir folder;
  const std::string exact = folder / "exact", ours = folder / "ours";
  for (const auto& [frame, path] : dataset::ListBody3dScenes(root)) {
    const std::string name = "/hdPose3d_stage1_coco19/" + fs::path(path).filename().string();
    dataset::WritePanopticScene(dataset::ReadPanopticScene(path), exact + name);
    const auto scene = dataset::ReadBody3dSceneFile(path);
    dataset::WriteBody3dScene(scene.people, scene.univ_time_ms, ours + name);
  }
  const std::string calibration = dataset::FindPanopticCalibration(root);
  dataset::WritePanopticCalibrationFile(dataset::ReadPanopticCalibrationFile(calibration), exact + "/calibration_x.json");
  dataset::WritePanopticCalibration(dataset::ReadPanopticCalibration(calibration), ours + "/calibration_x.json", "ours");
  const std::string some = "--step 7 --cameras 00_03,00_06,00_12,00_13,00_23,01_01,17_11,20_24,50_04";
  const json of_cmu = Client(root, some);
  json of_exact = Client(exact, some);
  of_exact["sequence"] = of_cmu["sequence"];
  EXPECT_EQ(of_exact, of_cmu) << "the same numbers give the same pixels, bit for bit";
  for (const std::string& written : {root, ours}) {
    const auto [compared, worst_px] = CompareWithClient(written, Client(written, some));
    EXPECT_GT(compared, 500);
    EXPECT_LT(worst_px, 1e-6) << written;
  }
}

TEST(PanopticClient, ReadsPersonAWithItsImages) {
  MVS_NEEDS_DATA("person_a");
  if (!HasClient()) GTEST_SKIP() << "needs /usr/bin/python3 with numpy (python3-numpy)";
  const std::string root = dataset::DataFolder("person_a");
  const auto [compared, worst_px] = CompareWithClient(root, Client(root, "--step 12 --require-pictures"));
  EXPECT_EQ(compared, 10 * 10 * 19);
  EXPECT_LT(worst_px, 1e-6);
}

}  // namespace
}  // namespace mvstudio::testing
