#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/session/session.h"
#include "dataset/time/sync_file.h"
#include "dataset/time/timeline.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// session, doctor and sync on a session, as a user runs them; and dataset build in step with the timeline.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

constexpr int kTimeSteps = 90;
constexpr double kOffsetB = 4;  // b shows time step i at its tick i + 4

Eigen::Vector3d JointAt(int joint, double time_step) {
  const double t = time_step / 30;
  const Eigen::Vector3d rest(0.3 * std::cos(2.4 * joint), 0.3 * std::sin(2.4 * joint), 0.06 * joint - 0.7);
  return rest + 0.2 * Eigen::Vector3d(std::sin(2.1 * t + joint) + 0.5 * std::sin(5.3 * t), std::sin(1.3 * t - joint),
                                      0.6 * std::sin(3.7 * t + 2 * joint));
}

bool Dropped(int camera, int tick) { return camera == 1 && (tick == 20 || tick == 21 || tick == 50); }

/// Three cameras with videos whose images carry the time step they show; camera 1 starts 4 frames earlier and drops three.
class SessionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    rig_ = triangulate::MakeRing(3);
    for (auto& c : rig_.cameras) {  // small images
      c.camera.width_px /= 4, c.camera.height_px /= 4;
      c.camera.params.head<4>() /= 4;
    }
    geometry::WriteRig(rig_, Path("calib/calibration.json"));
    for (int c = 0; c < 3; ++c) Film(c);
  }

  std::string Path(const std::string& relative) const { return folder_ / ("s/" + relative); }
  virtual std::string TimeCode(int) const { return ""; }
  std::string Name(int c) const { return rig_.cameras[static_cast<size_t>(c)].camera.name; }

  void Film(int c) {
    fs::create_directories(Path("raw/walk"));
    dataset::Pose2dTrack track;
    track.camera = Name(c);
    std::ofstream stamps(Path("raw/walk.csv"), std::ios::app);
    if (c == 0) stamps << "camera,frame,time_s\n";
    stamps.precision(9);
    stamps << std::fixed;
    ClipOptions options;
    options.width = rig_.cameras[0].camera.width_px, options.height = rig_.cameras[0].camera.height_px;
    options.codec = "mjpeg", options.time_code = TimeCode(c);
    ClipWriter writer(Path("raw/walk/" + Name(c) + ".mkv"), options);
    Rng rng(static_cast<uint64_t>(c) + 1);
    for (int tick = 0, frame = 0; tick < kTimeSteps; ++tick) {
      if (Dropped(c, tick)) continue;
      const int time_step = tick - (c == 1 ? static_cast<int>(kOffsetB) : 0);
      writer.Write(std::max(time_step, 0), 3000 * tick);
      stamps << Name(c) << "," << frame << "," << 1000 + time_step / 30.0 << "\n";
      dataset::Person2d person;
      for (int j = 0; j < 25; ++j) {
        const auto& camera = rig_.cameras[static_cast<size_t>(c)];
        const auto at = geometry::Project(camera.camera, camera.cam_from_world * JointAt(j, time_step));
        person.keypoints.push_back({at.px.x() + 0.25 * rng.Normal(), at.px.y() + 0.25 * rng.Normal(), 0.9});
      }
      track.frames[frame++] = {person};
    }
    dataset::WriteOpenPoseFolder(track, Path("pose2d/walk/" + Name(c)));
  }

  CliRun Init() {
    return RunCli({"session", "init", Path(""), "--units", "m", "--scan", Path("raw"), "--overwrite", "--json"});
  }

  /// The take's time stamps are named, and its 3D joints written.
  void WriteJointsAt(const std::vector<int>& time_steps) {
    dataset::Session session = Read();
    session.takes[0].timestamps = "raw/walk.csv";
    dataset::WriteSession(session);
    dataset::Pose3d pose;
    pose.skeleton = "coco19";
    for (const int time_step : time_steps) {
      for (int j = 0; j < 19; ++j) {
        dataset::JointRow row;
        row.frame = time_step;
        row.joint = geometry::Coco19().joints[static_cast<size_t>(j)];
        row.status = Status::kOk;
        row.x_in_world = JointAt(j, time_step);
        row.num_views = 3;
        pose.rows.push_back(row);
      }
    }
    dataset::WritePose3d(pose, Path("pose3d/walk"));
  }

  dataset::Session Read() { return dataset::ReadSession(Path("")); }

  TempDir folder_;
  geometry::Rig rig_;
};

TEST_F(SessionTest, InitShowDoctor) {
  const CliRun init = Init();
  ASSERT_EQ(init.exit, 0) << init.out << init.err;
  const dataset::Session session = Read();
  EXPECT_EQ(session.cameras.size(), 3u);
  ASSERT_EQ(session.takes.size(), 1u);
  EXPECT_EQ(session.takes[0].name, "walk");
  EXPECT_EQ(RunCli({"session", "init", Path(""), "--units", "m"}).exit, 2) << "it exists already";
  EXPECT_EQ(RunCli({"session", "init", folder_ / "n"}).exit, 2) << "units are mandatory";
  EXPECT_EQ(RunCli({"session", "init", folder_ / "n", "--units", "inch"}).exit, 2);
  EXPECT_EQ(RunCli({"session", "init", folder_ / "n", "--units", "cm", "--cameras", "a,../b"}).exit, 2);
  EXPECT_EQ(RunCli({"session", "init", folder_ / "n", "--units", "cm", "--board", "charuco:8x6"}).exit, 2);
  EXPECT_FALSE(fs::exists(folder_ / "n"));
  const CliRun empty =
      RunCli({"session", "init", folder_ / "n", "--units", "cm", "--cameras", "4", "--board", "chessboard:9x6:2.5"});
  EXPECT_EQ(empty.exit, 0) << empty.err;
  EXPECT_EQ(dataset::ReadSession(folder_ / "n").cameras[3].name, "cam_04");
  EXPECT_EQ(dataset::ReadSession(folder_ / "n").board, "chessboard:9x6:2.5cm");

  const CliRun show = RunCli({"session", "show", Path(""), "--json"});
  ASSERT_EQ(show.exit, 0) << show.out << show.err;
  const auto footage = show.Json()["metrics"]["footage"];
  EXPECT_EQ(footage[0]["frames"], kTimeSteps);
  EXPECT_EQ(footage[1]["frames"], kTimeSteps - 3);
  EXPECT_EQ(footage[0]["codec"], "mjpeg");

  const CliRun doctor = RunCli({"doctor", Path(""), "--json"});
  ASSERT_EQ(doctor.exit, 0) << doctor.out << doctor.err;
  EXPECT_GE(doctor.Json()["metrics"]["cores"], 1);
  EXPECT_TRUE(doctor.Json()["metrics"]["libraries"].contains("opencv"));
  fs::copy_file(Path("raw/walk/" + Name(0) + ".mkv"), Path("raw/walk/" + Name(2) + ".mkv"),
                fs::copy_options::overwrite_existing);
  fs::resize_file(Path("raw/walk/" + Name(1) + ".mkv"), fs::file_size(Path("raw/walk/" + Name(1) + ".mkv")) / 2);
  const CliRun sick = RunCli({"doctor", Path(""), "--json", "--decode"});
  EXPECT_EQ(sick.exit, 6) << sick.out;
  EXPECT_THAT(sick.out, HasSubstr("SES-SAME-FILE"));
  EXPECT_THAT(sick.out, HasSubstr("SES-DAMAGED"));
  EXPECT_EQ(RunCli({"doctor", folder_ / "nowhere"}).exit, 3);
  EXPECT_EQ(RunCli({"doctor", Path("raw/walk"), "--json"}).exit, 6);
}

TEST_F(SessionTest, HostileSessionsAreRefused) {
  ASSERT_EQ(Init().exit, 0);
  const std::string toml = Slurp(Path("mvstudio.toml"));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bad = toml;
    bad.replace(bad.find(from), from.size(), to);
    std::ofstream(Path("mvstudio.toml")) << bad;
    return RunCli({"session", "timeline", Path(""), "--json"});
  };
  const CliRun no_units = with("units = \"m\"", "");
  EXPECT_EQ(no_units.exit, 3);
  EXPECT_THAT(no_units.err, HasSubstr("units: is missing"));
  EXPECT_EQ(with("raw/walk/" + Name(0) + ".mkv", "../../etc/passwd").exit, 3);
  EXPECT_EQ(with("raw/walk/" + Name(0) + ".mkv", "/etc/passwd").exit, 3);
  fs::create_symlink("/etc/hostname", Path("raw/link.mkv"));
  EXPECT_EQ(with("raw/walk/" + Name(0) + ".mkv", "raw/link.mkv").exit, 3);
  EXPECT_FALSE(fs::exists(Path("sync/walk.timeline.json")));
}

TEST_F(SessionTest, ItsFileGivesNoPermission) {
  ASSERT_EQ(Init().exit, 0);
  fs::create_directories(folder_ / "private");
  const std::string video = Path("raw/walk/" + Name(0) + ".mkv");
  fs::rename(video, folder_ / "private/a.mkv");
  fs::create_symlink(folder_ / "private/a.mkv", video);
  std::string toml = Slurp(Path("mvstudio.toml"));
  toml.insert(toml.find("units"), "follow_symlinks = true\n");
  std::ofstream(Path("mvstudio.toml")) << toml;
  const CliRun run = RunCli({"session", "timeline", Path(""), "--json"});
  EXPECT_EQ(run.exit, 3) << run.out << run.err;
  EXPECT_THAT(run.err, HasSubstr("--allow-outside"));
  const CliRun allowed = RunCli({"session", "timeline", Path(""), "--allow-outside", "--json"});
  EXPECT_EQ(allowed.exit, 0) << allowed.out << allowed.err;
  EXPECT_THAT(allowed.out, HasSubstr("follow_symlinks is not used any more"));
}

TEST_F(SessionTest, ResultsStayInTheSession) {
  ASSERT_EQ(Init().exit, 0);
  fs::create_directories(folder_ / "elsewhere");
  for (const char* kind : {"pose3d", "sync"}) {
    fs::remove_all(Path(kind));
    fs::create_directory_symlink("../elsewhere", Path(kind));
  }
  const std::vector<std::vector<std::string>> commands = {{"triangulate", "--session", Path("")},
                                                          {"sync", "--session", Path(""), "--fps", "30"},
                                                          {"session", "timeline", Path("")}};
  for (std::vector<std::string> words : commands) {
    const CliRun refused = RunCli(words);
    EXPECT_EQ(refused.exit, 3) << words[0] << refused.out << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("is a symbolic link out of the session"));
    EXPECT_TRUE(fs::is_empty(folder_ / "elsewhere")) << words[0];
  }
  for (std::vector<std::string> words : commands) {
    words.push_back("--allow-outside");
    const CliRun allowed = RunCli(words);
    EXPECT_EQ(allowed.exit, 0) << words[0] << allowed.out << allowed.err;
  }
  EXPECT_TRUE(fs::exists(folder_ / "elsewhere/walk/points.csv"));
  EXPECT_TRUE(fs::exists(folder_ / "elsewhere/walk/sync.json"));
  EXPECT_TRUE(fs::exists(folder_ / "elsewhere/walk.timeline.json"));
}

TEST_F(SessionTest, FootageElsewhereIsLinkedAndAskedForByTheCommand) {
  fs::create_directories(folder_ / "n");
  const CliRun init = RunCli({"session", "init", folder_ / "n", "--units", "m", "--scan", Path("raw"), "--json"});
  ASSERT_EQ(init.exit, 0) << init.out << init.err;
  EXPECT_THAT(init.out, HasSubstr("SES-OUTSIDE"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "n/raw"));
  EXPECT_EQ(RunCli({"session", "timeline", folder_ / "n"}).exit, 3);
  EXPECT_EQ(RunCli({"session", "timeline", folder_ / "n", "--allow-outside"}).exit, 0);
  fs::create_directories(folder_ / "other/t");
  EXPECT_EQ(RunCli({"session", "init", folder_ / "n", "--units", "m", "--scan", folder_ / "other", "--overwrite"}).exit, 2)
      << "the link that is there is not thrown away";
  EXPECT_EQ(fs::read_symlink(folder_ / "n/raw"), fs::absolute(Path("raw")));
}

TEST_F(SessionTest, TimelineAndSyncByEachRoad) {
  ASSERT_EQ(Init().exit, 0);
  dataset::Session session = Read();
  // From poses: frames are counted by the cameras' clocks.
  const CliRun poses = RunCli({"sync", "--session", Path(""), "--fps", "30", "--reference", Name(0), "--json"});
  ASSERT_EQ(poses.exit, 0) << poses.out << poses.err;
  const std::string sync_path = Path("sync/walk/sync.json");
  EXPECT_NEAR(*dataset::ReadSync(sync_path).cameras[1].offset_frames, kOffsetB, 0.1);
  EXPECT_THAT(poses.out, HasSubstr("SYN-DROPPED"));
  const CliRun by_offsets = RunCli({"session", "timeline", Path(""), "--reference", Name(0), "--json"});
  ASSERT_EQ(by_offsets.exit, 0) << by_offsets.out << by_offsets.err;
  const std::string timeline_path = Path("sync/walk.timeline.json");
  const dataset::Timeline offsets = dataset::ReadTimeline(timeline_path);
  EXPECT_EQ(offsets.clock, dataset::TimelineClock::kOffsets);
  // From time stamps.
  fs::remove_all(Path("sync"));
  EXPECT_EQ(RunCli({"sync", "--session", Path(""), "--from", "timestamps"}).exit, 2) << "no table named";
  session.takes[0].timestamps = "raw/walk.csv";
  dataset::WriteSession(session);
  const CliRun stamps = RunCli({"sync", "--session", Path(""), "--from", "timestamps", "--json"});
  ASSERT_EQ(stamps.exit, 0) << stamps.out << stamps.err;
  EXPECT_NEAR(*dataset::ReadSync(sync_path).cameras[1].offset_frames, kOffsetB, 1e-4);
  ASSERT_EQ(RunCli({"session", "timeline", Path("")}).exit, 0);
  const dataset::Timeline common = dataset::ReadTimeline(timeline_path);
  EXPECT_EQ(common.clock, dataset::TimelineClock::kCommon);
  for (const dataset::Timeline* timeline : {&offsets, &common}) {
    const dataset::CameraTimeline& b = timeline->cameras[1];
    int64_t frame = 0;
    for (int tick = 0; tick < kTimeSteps; ++tick) {
      const int time_step = tick - static_cast<int>(kOffsetB);
      const int64_t truth = Dropped(1, tick) ? -1 : frame;
      EXPECT_TRUE(time_step < 0 || b.frame_at[static_cast<size_t>(time_step)] == truth) << time_step;
      frame += !Dropped(1, tick);
    }
  }
  EXPECT_EQ(RunCli({"sync", "--from", "timestamps", "--out", folder_ / "x"}).exit, 2) << "needs a session";
}

/// Mean distance of triangulated joints from where they were at the time steps that the file names, mm.
double MeanErrorMm(const std::string& folder, int* time_steps) {
  const dataset::Pose3d pose = dataset::ReadPose3d(folder);
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  double sum = 0;
  int count = 0;
  std::set<int> frames;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status != Status::kOk) continue;
    sum += (row.x_in_world - JointAt(skeleton.Find(row.joint), row.frame)).norm(), ++count;
    frames.insert(row.frame);
  }
  *time_steps = static_cast<int>(frames.size());
  return 1000 * sum / std::max(count, 1);
}

TEST_F(SessionTest, TriangulateCountsTimeStepsHoweverTheyAreKnown) {
  ASSERT_EQ(Init().exit, 0);
  dataset::Session session = Read();
  const auto solve = [&](const char* how, int* time_steps) {
    fs::remove_all(Path("pose3d"));
    const CliRun run = RunCli({"triangulate", "--session", Path(""), "--json"});
    EXPECT_EQ(run.exit, 0) << run.out << run.err;
    const double error_mm = MeanErrorMm(Path("pose3d/walk"), time_steps);
    std::printf("%s: %d instants, mean error %.2f mm\n", how, *time_steps, error_mm);
    return error_mm;
  };
  int time_steps = 0;
  const double by_number_mm = solve("frame numbers alone", &time_steps);
  session.takes[0].timestamps = "raw/walk.csv";
  dataset::WriteSession(session);
  const double by_stamps_mm = solve("table of times", &time_steps);
  EXPECT_GT(time_steps, 84);
  ASSERT_EQ(RunCli({"sync", "--session", Path(""), "--from", "timestamps", "--reference", Name(0)}).exit, 0);
  session.takes[0].timestamps = "";
  dataset::WriteSession(session);
  const double by_offsets_mm = solve("offsets", &time_steps);
  EXPECT_GT(time_steps, 84);
  ASSERT_EQ(RunCli({"session", "timeline", Path("")}).exit, 0);
  const double by_timeline_mm = solve("written timeline of offsets", &time_steps);
  EXPECT_LT(by_stamps_mm, 0.3 * by_number_mm);
  EXPECT_NEAR(by_offsets_mm, by_stamps_mm, 0.1 * by_stamps_mm);
  EXPECT_EQ(by_timeline_mm, by_offsets_mm);
  EXPECT_EQ(RunCli({"triangulate", "--take", "walk"}).exit, 2);
  EXPECT_EQ(RunCli({"triangulate", "--session", Path(""), "--chunk-frames", "10"}).exit, 2);
  EXPECT_EQ(RunCli({"calibrate", "--session", Path("")}).exit, 2) << "no board in this session";
  EXPECT_EQ(RunCli({"dataset", "info", Path("")}).exit, 0);
  EXPECT_EQ(RunCli({"dataset", "verify", Path("")}).exit, 2);
}

TEST_F(SessionTest, MasksKeepTheFootagesNumbersAndFollowTheTimeline) {
  if (RunCli({"mask", "--help"}).exit != 0) GTEST_SKIP() << "this build has no `mask`: it needs libtorch";
  ASSERT_EQ(Init().exit, 0);
  WriteJointsAt({3, 15, 40});
  const CliRun run = RunCli({"mask", "--session", Path(""), "--backend", "background", "--hull-frames", "3", "--mask-outline",
                             "0", "--mask-background-frames", "9", "--sheet-tiles", "0", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const geometry::RigCamera& camera = rig_.cameras[1];
  for (const auto& [time_step, frame] : {std::pair{3, 7}, {15, 19}, {40, 42}}) {  // ticks 7, 19 and 44, two of them dropped
    const std::string name = Format("/%08d.png", frame);
    const Image mask = dataset::ReadImage(Path("masks/walk/" + Name(1) + name), true);
    int inside = 0, on_mask = 0;
    for (int j = 0; j < 15; ++j) {  // without eyes and ears
      const auto at = geometry::Project(camera.camera, camera.cam_from_world * JointAt(j, time_step));
      const int x = static_cast<int>(std::lround(at.px.x())), y = static_cast<int>(std::lround(at.px.y()));
      if (x < 1 || y < 1 || x >= mask.width - 1 || y >= mask.height - 1) continue;
      ++inside;
      on_mask += *mask.Pixel(x, y) == 255;
    }
    EXPECT_GT(inside, 10);
    EXPECT_GE(on_mask, inside - 3) << time_step << ": joints " << inside;
  }
  std::ofstream(Path("masks/walk/mask.result.json"))
      << R"({"warnings": [{"code": "MSK-HULL", "text": "doubt", "hint": null}, 3]})";
  const CliRun build = RunCli({"dataset", "build", "--session", Path(""), "--pose3d", Path("pose3d/walk"), "--json"});
  EXPECT_THAT(build.out, HasSubstr("masks/walk: doubt")) << build.err;
}

class CodedSession : public SessionTest {
  std::string TimeCode(int c) const override { return c == 1 ? "10:00:00:26" : "10:00:01:00"; }
};

TEST_F(CodedSession, TimeCodesAreTheFirstOffsets) {
  ASSERT_EQ(Init().exit, 0);
  const CliRun timeline = RunCli({"session", "timeline", Path(""), "--reference", Name(0), "--json"});
  ASSERT_EQ(timeline.exit, 0) << timeline.out << timeline.err;
  EXPECT_THAT(timeline.out, HasSubstr("time codes"));
  EXPECT_EQ(dataset::ReadTimeline(Path("sync/walk.timeline.json")).cameras[1].frame_at[3], 7);
  const auto sync = [&](const char* from) {
    const CliRun run = RunCli({"sync", "--session", Path(""), "--from", from, "--reference", Name(0), "--max-offset-frames",
                               "2", "--out", folder_ / from, "--overwrite", "--json"});
    EXPECT_EQ(run.exit, 0) << run.out << run.err;
    return dataset::ReadSync(folder_ / (std::string(from) + "/sync.json")).cameras[1];
  };
  EXPECT_NEAR(*sync("timecodes").offset_frames, kOffsetB, 0.01);  // stamps in whole ms
  EXPECT_GT(sync("timecodes").sigma_frames, 0.4);
  EXPECT_NEAR(*sync("poses").offset_frames, kOffsetB, 0.1) << "further off than was searched without the time codes";
}

TEST_F(SessionTest, BuildKeepsInStepWhereACameraDroppedFrames) {
  ASSERT_EQ(Init().exit, 0);
  WriteJointsAt({3, 15, 16, 17, 18, 40});  // 16 and 17 are the dropped ticks 20 and 21 of camera 1
  std::vector<std::string> words = {"dataset", "build",       "--session", Path(""), "--pose3d",  Path("pose3d/walk"),
                                    "--out",   folder_ / "d", "--png",     "--json", "--no-masks"};
  const CliRun build = RunCli(words);
  ASSERT_EQ(build.exit, 6) << build.out << build.err;
  EXPECT_THAT(build.out, HasSubstr("DAT-INSTANTS"));
  for (int c = 0; c < 3; ++c) {
    for (const int time_step : {3, 15, 16, 17, 18, 40}) {
      const std::string name = Format("d/hdImgs/00_0%d/00_0%d_%08d.png", c, c, time_step);
      const bool gone = c == 1 && (time_step == 16 || time_step == 17);
      ASSERT_EQ(fs::exists(folder_ / name), !gone) << name;
      EXPECT_TRUE(gone || ReadCode(dataset::ReadImage(folder_ / name)) == time_step) << name;
    }
  }
  words[6] = "--out", words[7] = folder_ / "e";
  words.push_back("--require-complete");
  const CliRun strict = RunCli(words);
  EXPECT_EQ(strict.exit, 3);
  EXPECT_THAT(strict.err, HasSubstr("16, 17"));
  EXPECT_FALSE(fs::exists(folder_ / "e"));
}

}  // namespace
}  // namespace mvstudio::testing
