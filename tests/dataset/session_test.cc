#include "dataset/session/session.h"

#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "dataset/session/session_scan.h"
#include "dataset/time/motion_sync.h"
#include "dataset/verify/session_check.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;

void Put(const std::string& path, const std::string& text) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path) << text;
}

Session Read(const TempDir& folder, const std::string& toml) {
  Put(folder / "mvstudio.toml", toml);
  return ReadSession(folder.path());
}

std::string Refused(const TempDir& folder, const std::string& toml) {
  return MessageOf<FormatError>([&] { Read(folder, toml); });
}

constexpr char kHead[] = "schema = \"mvstudio.session/1\"\nunits = \"cm\"\n";

TEST(Session, EveryKey) {
  const TempDir folder;
  const Session session = Read(folder, std::string(kHead) + R"(
board = "charuco:8x6:6:4.5:4x4_1000"
calibration = "calib/c.json"
fps_hz = 29.97
[[cameras]]
name = "left"
serial = "77"
lens = "8 mm"
size_px = [1920, 1080]
[[cameras]]
name = "right"
[[takes]]
name = "walk"
fps_hz = 60
timestamps = "raw/t.csv"
sync = "sync/s.json"
[takes.footage]
right = "raw/walk/r.mp4"
left = "raw/walk/l"
[takes.plate]
left = "raw/plate/l.png"
[[takes]]
name = "board"
footage = "raw/board/{camera}.mkv"
)");
  EXPECT_EQ(session.metres_per_unit(), 0.01);
  EXPECT_EQ(session.board, "charuco:8x6:6cm:4.5cm:4x4_1000");
  ASSERT_EQ(session.cameras.size(), 2u);
  EXPECT_EQ(session.cameras[0].serial, "77");
  EXPECT_EQ(session.cameras[0].width_px, 1920);
  EXPECT_EQ(session.fps_hz, 29.97);
  const SessionTake& walk = TakeOf(session, "");
  EXPECT_EQ(walk.name, "walk");
  EXPECT_EQ(walk.fps_hz, 60);
  ASSERT_EQ(walk.footage.size(), 2u);
  EXPECT_EQ(walk.footage[0].camera, "left");
  EXPECT_EQ(walk.footage[0].plate, "raw/plate/l.png");
  EXPECT_EQ(walk.footage[1].path, "raw/walk/r.mp4");
  EXPECT_EQ(TakeOf(session, "board").kind, TakeKind::kBoard);
  EXPECT_EQ(TakeOf(session, "board").footage[1].path, "raw/board/right.mkv");
  EXPECT_THROW(TakeOf(session, "run"), UsageError);
  EXPECT_TRUE(session.warnings.empty());
}

TEST(Session, ThereAndBackWithAndWithoutComments) {
  const TempDir folder;
  Session session;
  session.folder = folder.path();
  session.units = "mm";
  session.source = "tab\tquote\" back\\slash";
  session.board = "chessboard:9x6:25mm";
  session.cameras = {{"-étage 1", "9", "", 640, 480}, {"b", "", "wide", 0, 0}};
  session.takes.push_back(
      {"take 🙂", TakeKind::kPeople, 59.94, "", "", {{"-étage 1", "raw/a b/x.mp4", ""}, {"b", "raw/*.png", "p.png"}}});
  session.takes.push_back({"empty", TakeKind::kBoard, std::nullopt, "t.csv", "", {}});
  for (const bool comments : {false, true}) {
    WriteSession(session, comments);
    const Session back = ReadSession(folder.path());
    EXPECT_EQ(SessionText(back), SessionText(session));
    EXPECT_EQ(back.source, session.source);
    EXPECT_EQ(back.takes[0].name, session.takes[0].name);
    EXPECT_TRUE(back.warnings.empty()) << back.warnings[0];
  }
}

TEST(Session, SeveralBoardsAreAnArray) {
  const TempDir folder;
  std::ofstream(folder / "mvstudio.toml")
      << kHead << "board = [\"charuco:7x5:60:45:4x4_50:two-sided=3\", \"charuco:7x5:60mm:45:4x4_50:first=17\"]\n";
  const Session session = ReadSession(folder.path());
  EXPECT_EQ(session.board, "charuco:7x5:60" + session.units + ":45" + session.units + ":4x4_50:two-sided=3" + session.units +
                               " charuco:7x5:60mm:45" + session.units + ":4x4_50:first=17");
  Session copy = session;
  copy.folder = folder / "copy";
  WriteSession(copy);
  EXPECT_EQ(ReadSession(copy.folder).board, session.board);
  EXPECT_NE(Refused(folder, std::string(kHead) + "board = [5]\n").find("board"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "board = [\"a b\"]\n").find("without blanks"), std::string::npos);
}

TEST(Session, UnitsAreNeededAndMistakesHaveAPlace) {
  const TempDir folder;
  EXPECT_NE(Refused(folder, "schema = \"mvstudio.session/1\"\n").find("units: is missing"), std::string::npos);
  EXPECT_NE(Refused(folder, "schema = \"mvstudio.session/1\"\nunits = \"inch\"\n").find("line 2, column 9"), std::string::npos);
  EXPECT_NE(Refused(folder, "units = \"m\"\n").find("schema"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "fps_hz = -1\n").find("line 3"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "cameras = [\"a\", \"a\"]\n").find("twice"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "cameras = [3]\n").find("cameras"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "board = 5\n").find("board"), std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "[[takes]]\nname = \"t\"\nkind = \"x\"\n").find("line 5"), std::string::npos);
  EXPECT_NE(
      Refused(folder, std::string(kHead) + "[[takes]]\nname = \"t\"\n[takes.footage]\nx = \"y.mp4\"\n").find("'cameras' does"),
      std::string::npos);
  EXPECT_NE(Refused(folder, std::string(kHead) + "[[cameras]]\nname = \"a\"\nsize_px = [1]\n").find("size_px"),
            std::string::npos);
  EXPECT_NE(Refused(folder, "units = \n").find("line "), std::string::npos);
  EXPECT_NE(Refused(folder, "a = " + std::string(100'000, '[')).find("line 1"), std::string::npos);
  EXPECT_THROW(ReadSession(folder / "none"), IoError);
  const Session odd = Read(folder, std::string(kHead) + "colour = 1\n[[cameras]]\nname = \"a\"\nnmae = 2\n");
  ASSERT_EQ(odd.warnings.size(), 2u);
  EXPECT_NE(odd.warnings[0].find("line 6"), std::string::npos) << odd.warnings[0];
  EXPECT_NE(odd.warnings[1].find("colour"), std::string::npos);
}

TEST(Session, EveryTruncationIsReadOrRefused) {
  const TempDir folder;
  Session session;
  session.folder = folder.path();
  session.units = "m";
  session.cameras = {{"a", "", "", 4, 4}};
  session.takes.push_back({"t", TakeKind::kPeople, 30.0, "", "", {{"a", "raw/a.mp4", ""}}});
  const std::string text = SessionText(session, true);
  for (size_t keep = 0; keep < text.size(); ++keep) {
    Put(folder / "mvstudio.toml", text.substr(0, keep));
    try {
      ReadSession(folder.path());
    } catch (const FormatError&) {
    }
  }
}

TEST(Session, NamesThatAreNone) {
  const TempDir folder;
  for (const std::string name : {"", ".", "..", "../x", "a/b", "a\\\\b", "a\\nb", "a\\u0000", "a=b", "\\u007f", "\\u0085"}) {
    EXPECT_NE(Refused(folder, std::string(kHead) + "cameras = [\"" + name + "\"]\n").find("cannot be a name"),
              std::string::npos)
        << name;
  }
  EXPECT_NE(WhyNotAName(std::string(255, 'x')), "");
  EXPECT_NE(WhyNotAName("a\xc3"), "");
  EXPECT_NE(WhyNotAName("\xed\xa0\x80"), "");
  EXPECT_EQ(WhyNotAName("-rf 🙂 été"), "");
  EXPECT_EQ(Slug("cam_01.left-2"), "cam_01.left-2");
  std::set<std::string> slugs;
  for (const std::string name : {"-rf", "_rf", "rf 🙂", "rf __", ".hidden", "été", "ete", "a b", "a_b"}) {
    const std::string slug = Slug(name);
    EXPECT_EQ(slug.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"), std::string::npos);
    EXPECT_NE(slug[0], '-');
    EXPECT_NE(slug[0], '.');
    EXPECT_TRUE(slugs.insert(slug).second) << name;
  }
  EXPECT_LE(Slug(std::string(128, 'x')).size(), 80u);
}

TEST(Session, FootageStaysInside) {
  const TempDir folder, outside;
  Put(folder / "raw/t/a.mp4", "x");
  Put(outside / "b.mp4", "x");
  Put(outside / "p1.png", "x");
  fs::create_symlink(outside / "b.mp4", folder / "raw/t/link.mp4");
  fs::create_directory_symlink(outside.path(), folder / "raw/all");
  fs::create_symlink(folder / "raw/t/a.mp4", folder / "raw/t/inner.mp4");
  Put(folder / "raw/mixed/p0.png", "x");
  fs::create_symlink(outside / "p1.png", folder / "raw/mixed/p1.png");
  Session session = Read(folder, kHead);
  const auto refused = [&](const std::string& path) {
    return MessageOf<FormatError>([&] { ResolveInSession(session, path); });
  };
  EXPECT_EQ(ResolveInSession(session, "raw/t/a.mp4"), folder / "raw/t/a.mp4");
  EXPECT_EQ(ResolveInSession(session, "raw/t/../t/a.mp4"), folder / "raw/t/a.mp4");
  EXPECT_THROW(ResolveInSession(session, "raw/x/../t/a.mp4"), IoError);  // as the system: there is no raw/x
  EXPECT_NO_THROW(ResolveInSession(session, "raw/t/inner.mp4"));
  EXPECT_THROW(ResolveInSession(session, "raw/t/none.mp4"), IoError);
  for (const std::string path : {"../b.mp4", "raw/../../b.mp4", "/etc/passwd", "raw/t/link.mp4", "raw/all/b.mp4", "raw/all",
                                 "raw/mixed", "raw/mixed/*.png", "raw/*/b.mp4", ""}) {
    EXPECT_NE(refused(path).find("option 'allow-outside'"), std::string::npos) << path << ": " << refused(path);
  }
  for (const std::string path : {"raw/t/link.mp4", "raw/all", "raw/mixed"})
    EXPECT_NO_THROW(ResolveInSession(session, path, true));
  EXPECT_NO_THROW(ResolveInSession(session, outside / "b.mp4", true));
  session.allow_outside = true;
  EXPECT_NO_THROW(ResolveInSession(session, "raw/all/b.mp4"));
  EXPECT_NO_THROW(ResolveInSession(session, "/etc/passwd"));
}

// Sessions come from other people, too: what one says of itself gives it no rights.
TEST(Session, CannotLetItselfOut) {
  const TempDir folder, outside;
  Put(outside / "b.mp4", "x");
  Put(folder / "raw/t/a.mp4", "x");
  fs::create_symlink(outside / "b.mp4", folder / "raw/t/link.mp4");
  const Session session = Read(folder, std::string(kHead) + "follow_symlinks = true\n");
  ASSERT_EQ(session.warnings.size(), 1u);
  EXPECT_NE(session.warnings[0].find("follow_symlinks is not used any more"), std::string::npos) << session.warnings[0];
  EXPECT_THROW(ResolveInSession(session, "raw/t/link.mp4"), FormatError);
  EXPECT_EQ(SessionText(session, true).find("follow_symlinks"), std::string::npos);
  EXPECT_NO_THROW(ResolveInSession(ReadSession(folder.path(), true), "raw/t/link.mp4"));
  EXPECT_TRUE(Read(folder, std::string(kHead) + "follow_symlinks = false\n").warnings.empty());
}

TEST(Session, ResultsStayInside) {
  const TempDir folder, outside;
  fs::create_directories(outside / "real");
  fs::create_directories(folder / "elsewhere");
  Session session = Read(folder, kHead);
  EXPECT_EQ(TakeFolder(session, "masks", "t", "c"), folder / "masks/t/c");
  EXPECT_EQ(TimelinePath(session, "t"), folder / "sync/t.timeline.json");
  fs::create_directory_symlink(outside / "real", folder / "masks");
  fs::create_directory_symlink(outside / "not there yet", folder / "pose3d");
  fs::create_directory_symlink(folder / "elsewhere", folder / "pose2d");
  fs::create_directories(folder / "sync");
  fs::create_symlink(outside / "victim", folder / "sync/t.timeline.json");
  for (const char* kind : {"masks", "pose3d"}) {
    const std::string said = MessageOf<FormatError>([&] { TakeFolder(session, kind, "t"); });
    EXPECT_EQ(said.rfind(folder / kind + ": is a symbolic link out of the session", 0), 0u) << said;
    EXPECT_NE(said.find("option 'allow-outside'"), std::string::npos);
  }
  EXPECT_EQ(TakeFolder(session, "pose2d", "t"), folder / "pose2d/t") << "a link inside";
  EXPECT_THROW(TimelinePath(session, "t"), FormatError);
  EXPECT_EQ(TimelinePath(session, "u"), folder / "sync/u.timeline.json");
  session.allow_outside = true;
  EXPECT_EQ(TakeFolder(session, "masks", "t"), folder / "masks/t");
  EXPECT_EQ(TimelinePath(session, "t"), folder / "sync/t.timeline.json");
}

TEST(Session, BracketsInItsNameAndInItsFootage) {
  const TempDir root, outside;
  Put(root / "day[1]/mvstudio.toml", kHead);
  Put(root / "day[1]/raw/t[a]/p_1.png", "x");
  Put(root / "day1/raw/ta/p_2.png", "x");
  const Session session = ReadSession(root / "day[1]");
  EXPECT_EQ(ListFootage(ResolveInSession(session, "raw/t[a]")).paths,
            (std::vector<std::string>{root / "day[1]/raw/t[a]/p_1.png"}));
  EXPECT_EQ(ListFootage(ResolveInSession(session, "raw/t[a]/*.png")).paths,
            (std::vector<std::string>{root / "day[1]/raw/t[a]/p_1.png"}));
  fs::create_symlink(outside / "p.png", root / "day[1]/raw/t[a]/p_3.png");
  Put(outside / "p.png", "x");
  EXPECT_THROW(ResolveInSession(session, "raw/t[a]"), FormatError);
  EXPECT_THROW(ResolveInSession(session, "raw/t[a]/*.png"), FormatError);
}

TEST(Session, PipesAreNamedNotWaitedFor) {
  const TempDir folder;
  fs::create_directories(folder / "raw/t");
  ASSERT_EQ(mkfifo((folder / "raw/t/a.mp4").c_str(), 0600), 0);
  const SessionReport report = InspectSession(Read(folder, std::string(kHead) + "cameras = [\"a\"]\ntakes = [\"t\"]\n"), {});
  ASSERT_EQ(report.num_errors(), 1);
  EXPECT_NE(report.findings[0].text.find("is a named pipe"), std::string::npos) << report.findings[0].text;
  fs::remove(folder / "mvstudio.toml");
  ASSERT_EQ(mkfifo((folder / "mvstudio.toml").c_str(), 0600), 0);
  EXPECT_THROW(ReadSession(folder.path()), IoError);
}

TEST(SessionScan, FindsTakesByTheirFolders) {
  const TempDir folder;
  for (const char* file : {"raw/walk/c1.mp4", "raw/walk/c2.mkv", "raw/walk/notes.txt", "raw/board/c1.mp4", "raw/board/c1.mov",
                           "raw/plate/c1.png", "raw/walk/c3/p_1.jpg", "raw/empty/readme", "raw/bad\nname/c1.mp4"}) {
    Put(folder / file, "x");
  }
  const ScannedSession scanned = ScanSession(folder.path());
  ASSERT_EQ(scanned.takes.size(), 2u);
  EXPECT_EQ(scanned.takes[0].kind, TakeKind::kBoard);
  const SessionTake& walk = scanned.takes[1];
  ASSERT_EQ(walk.footage.size(), 3u);
  EXPECT_EQ(walk.footage[0].plate, "raw/plate/c1.png");
  EXPECT_EQ(walk.footage[2].path, "raw/walk/c3");
  EXPECT_EQ(scanned.cameras.size(), 3u);
  EXPECT_EQ(scanned.skipped.size(), 5u);
  // The short form of the file finds the same.
  const Session session = Read(folder, std::string(kHead) + "cameras = [\"c1\", \"c2\", \"c3\"]\ntakes = [\"walk\"]\n");
  ASSERT_EQ(session.takes[0].footage.size(), 3u);
  EXPECT_EQ(session.takes[0].footage[1].path, "raw/walk/c2.mkv");
  EXPECT_NE(Refused(folder, std::string(kHead) + "cameras = [\"c1\"]\ntakes = [\"board\"]\n").find("has two"),
            std::string::npos);
}

/// What InspectSession says about a camera, all codes.
std::set<std::string> Codes(const SessionReport& report) {
  std::set<std::string> codes;
  for (const Notice& f : report.findings) codes.insert(f.code);
  return codes;
}

TEST(SessionCheck, AllFindingsNotTheFirst) {
  const TempDir folder;
  using mvstudio::testing::Regular;
  mvstudio::testing::ClipOptions rotated;
  rotated.clockwise_deg = 90;
  fs::create_directories(folder / "raw/t");
  mvstudio::testing::WriteClip(folder / "raw/t/good.mp4", Regular(20));
  fs::copy_file(folder / "raw/t/good.mp4", folder / "raw/t/copy.mp4");
  mvstudio::testing::WriteClip(folder / "raw/t/turned.mp4", Regular(20), rotated);
  mvstudio::testing::WriteClip(folder / "raw/t/slow.mp4", Regular(12, 3600));
  Truncate(folder / "raw/t/good.mp4", folder / "raw/t/cut.mp4", 0.7);
  Put(folder / "raw/t/empty.mp4", "");
  for (const int i : {1, 2, 5}) WriteImage(Image(8, 8, 3), folder / ("raw/t/pictures/" + std::to_string(i) + ".png"));
  fs::create_symlink("/etc/hostname", folder / "raw/t/link.mp4");
  std::string toml = std::string(kHead) + "x = 1\ncameras = [\"absent\"]\n";
  toml = std::string(kHead) + "x = 1\n[[cameras]]\nname = \"good\"\nsize_px = [1, 1]\n";
  for (const char* name : {"copy", "turned", "slow", "cut", "empty", "pictures", "link", "gone"}) {
    toml += std::string("[[cameras]]\nname = \"") + name + "\"\n";
  }
  toml += "[[takes]]\nname = \"t\"\n";
  fs::create_directories(folder / "pose2d/t/stranger");
  const SessionReport report = InspectSession(Read(folder, toml), {});
  EXPECT_EQ(Codes(report),
            (std::set<std::string>{"SES-KEY", "SES-OUTSIDE", "SES-DAMAGED", "SES-NO-FOOTAGE", "SES-SIZE", "SES-RATE",
                                   "SES-COUNT", "SES-GAP", "SES-ROTATED", "SES-SAME-FILE", "SES-POSE"}));
  int sound = 0;
  for (const InspectedFootage& f : report.footage) sound += f.sound;
  EXPECT_EQ(sound, 5);
  for (const InspectedFootage& f : report.footage) {
    if (f.camera != "good") continue;
    EXPECT_EQ(f.num_frames, 20);
    EXPECT_NEAR(f.duration_s, 20 / 30.0, 1e-3);
  }
}

TEST(ImageLimits, BombsAreRefusedFromTheirHeader) {
  const TempDir folder;
  WriteImage(Image(16, 16, 3, 5), folder / "a.png");
  WriteImage(Image(16, 16, 3, 5), folder / "a.jpg");
  EXPECT_EQ(ReadImageHeader(folder / "a.png").width, 16);
  EXPECT_EQ(ReadImageHeader(folder / "a.jpg").height, 16);
  std::string png = ReadFile(folder / "a.png"), jpeg = ReadFile(folder / "a.jpg");
  for (const uint32_t side : {100'000u, 30'000u, 0x7fffffffu, 0u}) {
    for (int k = 0; k < 4; ++k) png[16 + k] = png[20 + k] = static_cast<char>(side >> (24 - 8 * k));
    WriteFileAtomic(folder / "bomb.png", png);
    EXPECT_THROW(ReadImage(folder / "bomb.png"), FormatError) << side;
    EXPECT_THROW(ReadImageHeader(folder / "bomb.png"), FormatError) << side;
  }
  const size_t frame = jpeg.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  jpeg.replace(frame + 5, 4, "\xff\xff\xff\xff");
  WriteFileAtomic(folder / "bomb.jpg", jpeg);
  const std::string text = MessageOf<FormatError>([&] { ReadImage(folder / "bomb.jpg"); });
  EXPECT_NE(text.find("65535x65535"), std::string::npos) << text;
  WriteImage(Image(1, 1, 3, 7), folder / "tiny.png");
  EXPECT_EQ(ReadImage(folder / "tiny.png").pixels, (std::vector<uint8_t>{7, 7, 7}));
}

/// Activity as cameras see it: the same bursts, other gains, own noise.
MotionEnergy Activity(const std::string& name, int offset, int frames, double noise, bool periodic, uint64_t seed) {
  std::vector<double> bursts(2000, 0);
  Rng scene(7), own(seed);
  for (int n = 0; n < 60; ++n) {
    const int64_t at = scene.Index(1900);
    const double size = scene.Uniform(0.5, 3);
    for (int k = 0; k < 20; ++k) bursts[static_cast<size_t>(at + k)] += size * std::sin(M_PI * k / 20);
  }
  MotionEnergy motion{name, {}};
  for (int n = 0; n < frames; ++n) {
    const int at = 500 + n - offset;
    const double scene_motion = periodic ? 1 + std::sin(2 * M_PI * at / 25.0) : bursts[static_cast<size_t>(at)];
    motion.energy.push_back((0.2 + scene_motion) * std::exp(noise * own.Normal()));
  }
  return motion;
}

TEST(MotionSync, FindsOffsetsOrSaysWhyNot) {
  const std::vector<MotionEnergy> cameras = {Activity("a", 0, 900, 0.3, false, 1), Activity("b", 23, 900, 0.4, false, 2),
                                             Activity("c", -61, 800, 0.4, false, 3)};
  MotionSyncOptions options;
  options.reference = "a";
  const MotionSync sync = SynchronizeByMotion(cameras, options);
  for (const auto& [idx, truth] : {std::pair(1, 23.0), {2, -61.0}}) {
    const MotionSyncCamera& c = sync.cameras[static_cast<size_t>(idx)];
    EXPECT_EQ(c.status, MotionSyncStatus::kOk) << c.name;
    EXPECT_NEAR(c.offset_frames, truth, 3 * c.sigma_frames);
    EXPECT_LT(c.sigma_frames, 1.5);
  }
  const MotionSync periodic =
      SynchronizeByMotion({Activity("a", 0, 600, 0.05, true, 1), Activity("b", 8, 600, 0.05, true, 2)}, options);
  EXPECT_EQ(periodic.cameras[1].status, MotionSyncStatus::kAmbiguous);
  int false_offsets = 0;
  for (uint64_t seed = 10; seed < 30; ++seed) {  // nothing in common
    const MotionSync noise = SynchronizeByMotion({Activity("a", 0, 600, 0.3, false, seed),
                                                  [&] {
                                                    MotionEnergy other = Activity("b", 0, 600, 0.3, false, seed + 100);
                                                    std::reverse(other.energy.begin(), other.energy.end());
                                                    return other;
                                                  }()},
                                                 options);
    false_offsets += noise.cameras[1].status == MotionSyncStatus::kOk;
  }
  EXPECT_EQ(false_offsets, 0);
  MotionEnergy still{"s", std::vector<double>(600, 1.0)};
  EXPECT_EQ(SynchronizeByMotion({cameras[0], still}, options).cameras[1].status, MotionSyncStatus::kNoMotion);
  EXPECT_THROW(SynchronizeByMotion({cameras[0]}, options), UsageError);
}

}  // namespace
}  // namespace mvstudio::dataset
