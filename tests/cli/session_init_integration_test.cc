#include <filesystem>

#include "dataset/session/session.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/folder_state.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// session init on folders as cameras and people leave them; and what it leaves when it fails.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

class SessionInit : public ::testing::Test {
 protected:
  CliRun Init(std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"session", "init", folder_ / "s", "--units", "mm", "--scan", folder_ / "card", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
  dataset::Session Read() { return dataset::ReadSession(folder_ / "s", true); }

  TempDir folder_;
};

TEST_F(SessionInit, CamerasFirst) {
  for (const char* file : {"gopro1/board.mp4", "gopro1/walk.mp4", "gopro2/board.mp4", "gopro2/walk.mp4"})
    Put(folder_ / ("card/" + std::string(file)), "x");
  const CliRun run = Init();
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["layout"], "camera-first");
  EXPECT_THAT(run.out, HasSubstr("SES-LAYOUT"));
  EXPECT_THAT(run.out, HasSubstr("--layout take-first"));
  const dataset::Session session = Read();
  ASSERT_EQ(session.takes.size(), 2u);
  EXPECT_EQ(session.takes[0].kind, dataset::TakeKind::kBoard);
  EXPECT_EQ(session.takes[1].footage.at(1).path, "raw/gopro2/walk.mp4");
  EXPECT_EQ(session.FindCamera("gopro2"), 1);
  ASSERT_EQ(Init({"--layout", "take-first", "--overwrite"}).exit, 0);
  EXPECT_EQ(Read().takes.at(0).name, "gopro1");
  EXPECT_EQ(Init({"--layout", "sideways", "--overwrite"}).exit, 2);
}

/// The card before it is a session, with a clean plate beside the videos: as `session init --scan` reads it.
TEST_F(SessionInit, DoctorReadsACardAsScanDoes) {
  for (const char* camera : {"gopro1", "gopro2"}) {
    const std::string at = folder_ / ("card/" + std::string(camera));
    fs::create_directories(at);
    WriteClip(at + "/board.mp4", Regular(4));
    WriteClip(at + "/walk.mp4", Regular(6));
    Put(at + "/plate.png", "x");
  }
  const CliRun doctor = RunCli({"doctor", folder_ / "card", "--json"});
  const auto footage = doctor.Json()["metrics"]["footage"];
  ASSERT_EQ(footage.size(), 4u) << doctor.out << doctor.err;
  for (const auto& one : footage) EXPECT_EQ(one["frames"], one["take"] == "board" ? 4 : 6) << one;
}

TEST_F(SessionInit, ChaptersAreReadAsOneVideo) {
  fs::create_directories(folder_ / "card/walk/gopro1");
  fs::create_directories(folder_ / "card/walk/gopro2");
  WriteClip(folder_ / "card/walk/gopro1/GX010007.MP4", Regular(12));
  WriteClip(folder_ / "card/walk/gopro1/GX020007.MP4", Regular(8));
  WriteClip(folder_ / "card/walk/gopro2/GX010031.MP4", Regular(20));
  ASSERT_EQ(Init().exit, 0);
  EXPECT_EQ(Read().takes.at(0).footage.at(0).path, "raw/walk/gopro1/GX??0007.MP4");
  const CliRun show = RunCli({"session", "show", folder_ / "s", "--allow-outside", "--decode", "--json"});
  ASSERT_EQ(show.exit, 0) << show.out << show.err;
  for (int c = 0; c < 2; ++c) {
    EXPECT_EQ(show.Json()["metrics"]["footage"][c]["frames"], 20);
    EXPECT_NEAR(show.Json()["metrics"]["footage"][c]["duration_s"].get<double>(), 20 / 30.0, 0.005);
  }
  ASSERT_EQ(RunCli({"session", "timeline", folder_ / "s", "--allow-outside"}).exit, 0);
  fs::rename(folder_ / "card/walk/gopro1/GX020007.MP4", folder_ / "card/walk/gopro1/GX030007.MP4");
  const CliRun gap = RunCli({"session", "timeline", folder_ / "s", "--allow-outside"});
  EXPECT_EQ(gap.exit, 3);
  EXPECT_THAT(gap.err, HasSubstr("chapter 2 of the recording is missing"));
}

TEST_F(SessionInit, ATrustedSessionIsReadWithoutTheFlag) {
  fs::create_directories(folder_ / "card/walk/left");
  WriteClip(folder_ / "card/walk/left/a.mp4", Regular(8));
  const CliRun init = Init();
  ASSERT_EQ(init.exit, 0);
  EXPECT_THAT(init.out, HasSubstr("mvstudio session trust"));
  const std::string state = "XDG_STATE_HOME=" + ShellQuote(folder_ / "state") + " ";
  EXPECT_EQ(RunCli({"session", "timeline", folder_ / "s"}, state).exit, 3);
  const CliRun trust = RunCli({"session", "trust", folder_ / "s"}, state);
  ASSERT_EQ(trust.exit, 0) << trust.err;
  EXPECT_THAT(trust.out, HasSubstr(fs::canonical(folder_ / "card").string()));
  EXPECT_EQ(RunCli({"session", "timeline", folder_ / "s"}, state).exit, 0);
  EXPECT_EQ(RunCli({"session", "show", folder_ / "s"}, state).exit, 0);
  EXPECT_EQ(RunCli({"doctor", folder_ / "s", "--json"}, state).out.find("allow-outside"), std::string::npos);
  ASSERT_EQ(RunCli({"session", "trust", folder_ / "s", "--forget"}, state).exit, 0);
  EXPECT_EQ(RunCli({"session", "timeline", folder_ / "s", "--overwrite"}, state).exit, 3);
}

TEST_F(SessionInit, AChapterThatWasNotCopiedIsTold) {
  fs::create_directories(folder_ / "card/walk/gopro1");
  WriteClip(folder_ / "card/walk/gopro1/GX020001.MP4", Regular(8));
  const CliRun run = Init();
  EXPECT_EQ(run.exit, 0);
  EXPECT_THAT(run.out, HasSubstr("SES-CHAPTER"));
  EXPECT_THAT(run.out, HasSubstr("walk/gopro1/GX010001.MP4 is missing"));
}

TEST_F(SessionInit, ATakesOwnFolderIsToldFromOneWithoutFootage) {
  for (const char* camera : {"left", "right"}) Put(folder_ / ("card/" + std::string(camera) + ".mp4"), "x");
  const CliRun run = Init();
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.err, HasSubstr("is one take's folder, with footage of left, right; give the folder above, --scan " +
                                 fs::canonical(folder_.path()).string()));
  // Doctor counts what it prints: two files that are no videos, no models, no session.
  const CliRun doctor = RunCli({"doctor", folder_ / "card"});
  const auto count = [&](const std::string& start) {
    size_t lines = 0;
    for (size_t at = doctor.err.find(start); at != std::string::npos; at = doctor.err.find(start, at + 1))
      lines += at == 0 || doctor.err[at - 1] == '\n';
    return lines;
  };
  ASSERT_GE(count("warning "), 1u) << doctor.err;
  const size_t warnings = count("warning ");
  EXPECT_THAT(doctor.out, HasSubstr("2 errors, " + std::to_string(warnings) + (warnings == 1 ? " warning\n" : " warnings\n")))
      << doctor.err;
}

TEST_F(SessionInit, LeavesNothingWhenItFails) {
  fs::create_directories(folder_ / "card/nothing");
  EXPECT_EQ(Init().exit, 3) << "no footage";
  EXPECT_FALSE(fs::exists(folder_ / "s"));
  Put(folder_ / "card/left/GX010001.MP4", "x");
  Put(folder_ / "card/left/GX010002.MP4", "x");
  Put(folder_ / "card/right/GX010001.MP4", "x");
  const CliRun uneven = Init();
  EXPECT_EQ(uneven.exit, 3);
  EXPECT_THAT(uneven.err, HasSubstr("left has 2 recordings and right 1"));
  EXPECT_FALSE(fs::exists(folder_ / "s"));
  Put(folder_ / "s/raw/mine/notes.txt", "mine");
  fs::create_directories(folder_ / "s/calib");
  fs::remove_all(folder_ / "card/right");
  const auto before = StateOf(folder_ / "s");
  EXPECT_EQ(Init().exit, 2) << "raw is there already";
  EXPECT_EQ(StateOf(folder_ / "s"), before);
}

}  // namespace
}  // namespace mvstudio::testing
