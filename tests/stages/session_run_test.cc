#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/session/session.h"
#include "stages/session/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// Two cameras that filmed four images each, outside the session.
class SessionStage : public ::testing::Test {
 protected:
  SessionStage() {
    for (const char* camera : {"left", "right"}) {
      for (int i = 0; i < 4; ++i)
        dataset::WriteImage(Image(16, 12, 3), folder_ / "card/walk/" + camera + "/000" + std::to_string(i) + ".png");
    }
    setenv("XDG_STATE_HOME", (folder_ / "state").c_str(), 1);
    options_.folder = folder_ / "s", options_.units = "mm", options_.scan = folder_ / "card", options_.fps_hz = 25;
  }
  ~SessionStage() override { unsetenv("XDG_STATE_HOME"); }

  TempDir folder_;
  SessionInitOptions options_;
};

TEST_F(SessionStage, FootageElsewhereIsLinkedToAndItsCamerasAreAdded) {
  options_.cameras = "left,top";
  const SessionInitReport report = RunSessionInit(options_);
  EXPECT_EQ(report.link, folder_ / "s/raw");
  EXPECT_THAT(report.unnamed, ElementsAre("right"));
  const dataset::Session written = dataset::ReadSession(options_.folder, true);
  ASSERT_EQ(written.cameras.size(), 3u);
  EXPECT_EQ(written.cameras[2].name, "right");
  ASSERT_EQ(written.takes.size(), 1u);
  EXPECT_EQ(written.takes[0].footage.size(), 2u);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics.dump(), R"({"layout":"take-first","cameras":3,"takes":1})");
  ASSERT_EQ(said.warnings.size(), 2u);
  EXPECT_EQ(said.warnings[0].code, "SES-CAMERA");
  EXPECT_EQ(said.warnings[1].code, "SES-OUTSIDE");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunSessionInit(options_); }), HasSubstr("exists already; option 'overwrite'"));
}

TEST_F(SessionStage, ANumberOfCamerasNamesThem) {
  options_.scan.clear(), options_.cameras = "3";
  const SessionInitReport report = RunSessionInit(options_);
  ASSERT_EQ(report.session.cameras.size(), 3u);
  EXPECT_EQ(report.session.cameras[2].name, "cam_03");
  EXPECT_THAT(report.link, IsEmpty());
  EXPECT_TRUE(fs::is_directory(folder_ / "s/raw"));
  EXPECT_THAT(Describe(report).text, HasSubstr("3 cameras, 0 takes\nput footage into raw/TAKE/CAMERA.mp4"));
}

/// A number beside footage says how many there should be; it makes no cameras that nobody has.
TEST_F(SessionStage, ANumberOfCamerasIsHeldAgainstTheFootage) {
  options_.cameras = "4";
  const SessionInitReport report = RunSessionInit(options_);
  ASSERT_EQ(report.session.cameras.size(), 2u);
  EXPECT_EQ(report.session.cameras[1].name, "right");
  EXPECT_THAT(Describe(report).warnings[0].text, HasSubstr("the footage is of 2 cameras, option 'cameras' says 4"));
  options_.cameras = "2", options_.overwrite = true;
  EXPECT_EQ(Describe(RunSessionInit(options_)).warnings[0].code, "SES-OUTSIDE");
}

TEST_F(SessionStage, CountedCamerasWithoutFootageYetStay) {
  fs::rename(folder_ / "card/walk/left", folder_ / "card/walk/cam_02");
  fs::remove_all(folder_ / "card/walk/right");
  options_.cameras = "3";
  EXPECT_EQ(RunSessionInit(options_).session.cameras.size(), 3u);
}

TEST_F(SessionStage, NothingIsMadeOfWhatIsRefused) {
  options_.units = "ft";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunSessionInit(options_); }), HasSubstr("option 'units' must be m, cm or mm"));
  options_.units = "mm", options_.cameras = "a,a";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunSessionInit(options_); }), HasSubstr("option 'cameras': 'a' is there twice"));
  MakeFolder(folder_ / "empty");
  options_.cameras.clear(), options_.scan = folder_ / "empty";
  EXPECT_THAT(MessageOf<FormatError>([&] { RunSessionInit(options_); }), HasSubstr("holds no footage"));
  EXPECT_FALSE(fs::exists(options_.folder));
}

/// Outside footage is read once the session is trusted, and no longer when that is taken back.
TEST_F(SessionStage, TrustOpensTheFootage) {
  RunSessionInit(options_);
  EXPECT_FALSE(Describe(RunSessionShow({options_.folder})).errors.empty());
  const SessionTrustReport trust = RunSessionTrust({options_.folder});
  EXPECT_THAT(trust.folders, ElementsAre(fs::canonical(folder_ / "card").string()));
  const SessionShowReport shown = RunSessionShow({options_.folder});
  EXPECT_EQ(shown.footage.num_errors(), 0);
  const CommandResult said = Describe(shown);
  ASSERT_EQ(said.metrics["footage"].size(), 2u);
  EXPECT_EQ(said.metrics["footage"][1]["frames"], 4);
  EXPECT_THAT(RunSessionTrust({options_.folder, true}).folders, IsEmpty());
  EXPECT_FALSE(Describe(RunSessionShow({options_.folder})).errors.empty());
}

TEST_F(SessionStage, ATimelineNamesCamerasThatDidNotFilm) {
  options_.cameras = "left,right,top";
  RunSessionInit(options_);
  SessionTimelineOptions options;
  options.folder = options_.folder, options.how.allow_outside = true;
  const SessionTimelineReport report = RunSessionTimeline(options);
  EXPECT_EQ(report.file, folder_ / "s/sync/walk.timeline.json");
  EXPECT_TRUE(fs::exists(report.file));
  EXPECT_THAT(report.unfilmed, ElementsAre("top"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_EQ(said.metrics["instants"], 4);
  EXPECT_EQ(said.warnings.back().code, "SES-NO-FOOTAGE");
}

}  // namespace
}  // namespace mvstudio::stages
