#include <cmath>
#include <fstream>

#include "core/error.h"
#include "dataset/pose/pose2d.h"
#include "dataset/time/sync_file.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/message_of.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// sync as a user runs it, and its file.
namespace mvstudio::testing {
namespace {

const std::vector<double> kOffsets{0, 12, -7.4};

Eigen::Vector3d JointAt(int joint, double frame, bool moves) {
  const Eigen::Vector3d rest(0.3 * std::cos(2.4 * joint), 0.3 * std::sin(2.4 * joint), 0.06 * joint - 0.7);
  if (!moves) return rest;
  const double t = frame / 30;
  return rest + 0.2 * Eigen::Vector3d(std::sin(2.1 * t + joint) + 0.5 * std::sin(5.3 * t), std::sin(1.3 * t - joint),
                                      0.6 * std::sin(3.7 * t + 2 * joint));
}

/// Calibration and OpenPose folders of three cameras; returns the arguments that name them.
std::vector<std::string> WriteTake(const TempDir& folder, bool moves) {
  const geometry::Rig rig = triangulate::MakeRing(3);
  geometry::WriteRig(rig, folder / "calibration.json");
  std::vector<std::string> words{"sync", "--calib", folder / "calibration.json", "--out", folder / "sync", "--json"};
  Rng rng(2);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    dataset::Pose2dTrack track;
    track.camera = rig.cameras[c].camera.name;
    for (int f = 0; f < 120; ++f) {
      dataset::Person2d person;
      for (int j = 0; j < 25; ++j) {
        const Eigen::Vector3d x = JointAt(j, f - kOffsets[c], moves);
        const auto at = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
        person.keypoints.push_back({at.px.x() + rng.Normal(), at.px.y() + rng.Normal(), 0.9});
      }
      track.frames[f] = {person};
    }
    dataset::WriteOpenPoseFolder(track, folder / track.camera);
    words.insert(words.end(), {"--pose2d", track.camera + "=" + (folder / track.camera)});
  }
  return words;
}

TEST(Sync, WritesOffsets) {
  const TempDir folder;
  std::vector<std::string> words = WriteTake(folder, true);
  words.insert(words.end(), {"--fps", "30", "--reference", "cam_0"});
  const CliRun run = RunCli(words);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["status"], "Ok");
  EXPECT_EQ(metrics["reference"], "cam_0");
  EXPECT_LT(metrics["median_residual_px"]["after"].get<double>(), metrics["median_residual_px"]["before"].get<double>());
  const dataset::SyncFile file = dataset::ReadSync(folder / "sync/sync.json");
  EXPECT_EQ(file.reference, "cam_0");
  EXPECT_EQ(file.fps, 30);
  for (size_t c = 0; c < 3; ++c) {
    const auto& camera = metrics["cameras"][c];
    EXPECT_NEAR(camera["offset_frames"].get<double>(), kOffsets[c], 0.1);
    EXPECT_NEAR(camera["offset_ms"].get<double>(), 1000 * kOffsets[c] / 30, 3.4);
    EXPECT_NEAR(*file.cameras[c].offset_frames, camera["offset_frames"].get<double>(), 1e-12);
  }
}

TEST(Sync, StillPersonIsIllPosed) {
  const TempDir folder;
  const CliRun run = RunCli(WriteTake(folder, false));
  EXPECT_EQ(run.exit, 5) << run.out;
  EXPECT_EQ(run.Json()["metrics"]["status"], "NoMotion");
  EXPECT_EQ(run.Json()["errors"][0]["code"], "SYN-UNDETERMINED");
  for (const auto& camera : dataset::ReadSync(folder / "sync/sync.json").cameras) EXPECT_FALSE(camera.offset_frames);
}

TEST(Sync, KeepsAnEarlierResult) {
  const TempDir folder, still;
  std::vector<std::string> words = WriteTake(folder, true);
  ASSERT_EQ(RunCli(words).exit, 0);
  const std::string good = Slurp(folder / "sync/sync.json"), told = Slurp(folder / "sync/sync.result.json");
  EXPECT_EQ(RunCli(words).exit, 0) << "nothing changed";
  EXPECT_EQ(Slurp(folder / "sync/sync.result.json"), told);
  std::vector<std::string> other = words;
  other.insert(other.end(), {"--seed", "2"});
  const CliRun again = RunCli(other);
  EXPECT_EQ(again.exit, 2);
  EXPECT_THAT(again.err, HasSubstr("is a result of an earlier run of `mvstudio sync`"));
  EXPECT_THAT(again.err, HasSubstr("--overwrite"));
  // Asked to replace it, a run that finds nothing still leaves it.
  std::vector<std::string> lost = WriteTake(still, false);
  *(std::find(lost.begin(), lost.end(), "--out") + 1) = folder / "sync";
  lost.push_back("--overwrite");
  const CliRun failed = RunCli(lost);
  EXPECT_EQ(failed.exit, 5) << failed.out;
  EXPECT_EQ(failed.Json()["warnings"].back()["code"], "CLI-OLDER-KEPT");
  EXPECT_EQ(Slurp(folder / "sync/sync.json"), good);
  EXPECT_EQ(Slurp(folder / "sync/sync.result.json"), told);
  words.push_back("--overwrite");
  EXPECT_EQ(RunCli(words).exit, 0);
}

TEST(Sync, WrongWords) {
  const TempDir folder;
  std::vector<std::string> words = WriteTake(folder, true);
  std::vector<std::string> one(words.begin(), words.begin() + 8);
  EXPECT_EQ(RunCli(one).exit, 2);
  words.insert(words.end(), {"--reference", "nobody"});
  const CliRun run = RunCli(words);
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.out, HasSubstr("cam_0, cam_1, cam_2"));
}

TEST(SyncFile, ThereAndBack) {
  const TempDir folder;
  dataset::SyncFile file{"a", 59.94, {{"a", "Ok", 0.0, 0}, {"b", "Ok", -3.25, 0.125}, {"c", "NoMotion", std::nullopt, 0}}};
  dataset::WriteSync(file, folder / "sync.json");
  const dataset::SyncFile back = dataset::ReadSync(folder / "sync.json");
  EXPECT_EQ(back.reference, "a");
  EXPECT_EQ(back.fps, 59.94);
  EXPECT_EQ(back.cameras[1].offset_frames, -3.25);
  EXPECT_EQ(back.cameras[1].sigma_frames, 0.125);
  EXPECT_EQ(back.cameras[2].status, "NoMotion");
  const std::vector<double> offsets = dataset::OffsetsOf(back, {"c", "b", "unknown", "a"});
  EXPECT_TRUE(std::isnan(offsets[0]) && std::isnan(offsets[2]));
  EXPECT_EQ(offsets[1], -3.25);
  EXPECT_EQ(offsets[3], 0);
}

TEST(SyncFile, NamesWhatIsWrong) {
  const TempDir folder;
  const auto message = [&folder](const std::string& text) {
    std::ofstream(folder / "sync.json") << text;
    return MessageOf<FormatError>([&folder] { dataset::ReadSync(folder / "sync.json"); });
  };
  const std::string head = R"({"schema":"mvstudio.sync/1","reference":"a","cameras":[{"name":"a","status":"Ok",)";
  EXPECT_THAT(message("{"), HasSubstr("sync.json"));
  EXPECT_THAT(message(R"({"schema":"other"})"), HasSubstr("schema"));
  EXPECT_THAT(message(head + R"("sigma_frames":0}]})"), HasSubstr("cameras[0]"));
  EXPECT_THAT(message(head + R"("offset_frames":1e9,"sigma_frames":0}]})"), HasSubstr("1e6"));
  EXPECT_THAT(message(head + R"("offset_frames":"x","sigma_frames":0}]})"), HasSubstr("offset_frames"));
  EXPECT_THAT(message(R"({"schema":"mvstudio.sync/1","reference":"b","cameras":[]})"), HasSubstr("reference"));
}

}  // namespace
}  // namespace mvstudio::testing
