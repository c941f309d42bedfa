#include <sys/stat.h>

#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "dataset/session/session.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/folder_state.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// Names that look like patterns, pipes and playlists in the place of files, names of cameras that no line can hold: as a user
/// meets them.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// So that a command that waits for a pipe fails with 124.
constexpr char kSoon[] = "timeout 60 ";

std::string SeedFile(const std::string& name) {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::string(source ? source : ".") + "/tests/fuzz/seeds/" + name;
}

TEST(Paths, BracketsNameTheFolderItself) {
  const TempDir root;
  const std::string camera = Slurp(SeedFile("mrcal/opencv8.cameramodel"));
  Put(root / "cams[1]/right.cameramodel", camera);
  Put(root / "cams1/wrong.cameramodel", camera);
  const CliRun calib = RunCli({"calib", "show", root / "cams[1]", "--json"});
  ASSERT_EQ(calib.exit, 0) << calib.out << calib.err;
  EXPECT_THAT(calib.out, HasSubstr("\"right\""));
  EXPECT_THAT(calib.out, Not(HasSubstr("wrong")));

  const std::string panoptic = Slurp(SeedFile("panoptic_calibration/two.json"));
  Put(root / "take[1]/calibration_right.json", panoptic);
  Put(root / "take1/calibration_wrong.json", panoptic);
  for (const int frame : {1, 2, 3}) {
    const std::string name = Format("/hdPose3d_stage1_coco19/body3DScene_%08d.json", frame);
    Put(root / ("take1" + name), "{}");
    if (frame == 1) Put(root / ("take[1]" + name), Slurp(SeedFile("body3d_scene/two.json")));
  }
  const CliRun info = RunCli({"dataset", "info", root / "take[1]", "--json"});
  ASSERT_EQ(info.exit, 0) << info.out << info.err;
  EXPECT_EQ(info.Json()["metrics"]["sequence"], "right");
  EXPECT_EQ(info.Json()["metrics"]["frames"], 1);
  fs::remove_all(root / "take1");
  EXPECT_EQ(RunCli({"dataset", "info", root / "take[1]"}).exit, 0) << "without the neighbour";
}

TEST(Paths, CameraNamesThatNoLineCanHold) {
  const TempDir folder;
  const std::string text = Slurp(SeedFile("panoptic_calibration/two.json"));
  const std::string ours = Slurp(SeedFile("calibration_json/perspective.json"));
  const size_t at = text.find("\"name\""), ours_at = ours.find("\"name\"");
  const auto renamed = [](std::string calibration, size_t key, const std::string& name) {
    const size_t begin = calibration.find('"', calibration.find(':', key)), end = calibration.find('"', begin + 1);
    return calibration.replace(begin + 1, end - begin - 1, name);
  };
  for (const std::string& name : {std::string("a\\u001b[31mred"), std::string("a\\nb"), std::string(5000, 'x')}) {
    Put(folder / "panoptic.json", renamed(text, at, name));
    Put(folder / "ours.json", renamed(ours, ours_at, name));
    for (const char* file : {"panoptic.json", "ours.json"}) {
      const CliRun run = RunCli({"calib", "show", folder / file});
      EXPECT_EQ(run.exit, 3) << run.out << run.err;
      EXPECT_THAT(run.err, HasSubstr("cameras[0].name"));
      EXPECT_THAT(run.err, Not(HasSubstr("\x1b[31mred")));
      EXPECT_LT(run.err.size(), 1000u);
    }
  }
  Put(folder / "a\nb.cameramodel", Slurp(SeedFile("mrcal/opencv8.cameramodel")));
  const CliRun mrcal = RunCli({"calib", "show", folder / "a\nb.cameramodel"});
  EXPECT_EQ(mrcal.exit, 3) << mrcal.out << mrcal.err;
  EXPECT_THAT(mrcal.err, HasSubstr("control character"));
}

TEST(Paths, NumbersOfCamerasAreNoNames) {
  const TempDir folder;
  for (const char* number : {"99999999999", "0", "1001", "-1", "+4", "5000000000000000000000000"}) {
    const CliRun run = RunCli({"session", "init", folder / "s", "--units", "m", "--cameras", number});
    EXPECT_EQ(run.exit, 2) << number << run.out << run.err;
    EXPECT_THAT(run.err, HasSubstr("between 1 and 1000")) << number;
    EXPECT_FALSE(fs::exists(folder / "s"));
  }
  ASSERT_EQ(RunCli({"session", "init", folder / "s", "--units", "m", "--cameras", "1000"}).exit, 0);
  EXPECT_EQ(dataset::ReadSession(folder / "s").cameras.size(), 1000u);
  ASSERT_EQ(RunCli({"session", "init", folder / "t", "--units", "m", "--cameras", "1,2,3"}).exit, 0);
  EXPECT_EQ(dataset::ReadSession(folder / "t").cameras[2].name, "3") << "a list holds names";
}

// What leads a reader elsewhere, or nowhere, is said of each camera; nothing else is read.
TEST(Paths, PipesAndPlaylistsAreNoFootage) {
  const TempDir folder;
  Put(folder / "s/mvstudio.toml",
      "schema = \"mvstudio.session/1\"\nunits = \"m\"\ncameras = [\"cam_01\", \"cam_02\", \"cam_03\"]\ntakes = [\"walk\"]\n");
  fs::create_directories(folder / "private");
  fs::create_directories(folder / "s/raw/walk");
  WriteClip(folder / "private/cam_01.mp4", Regular(5));
  const auto playlist = [](const std::string& part) {
    return "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\n" + part + "\n#EXT-X-ENDLIST\n";
  };
  Put(folder / "s/raw/walk/cam_01.mp4", playlist("../../../private/cam_01.mp4"));
  Put(folder / "s/raw/walk/cam_02.mp4", playlist(folder / "private/cam_01.mp4"));
  ASSERT_EQ(mkfifo((folder / "s/raw/walk/cam_03.mp4").c_str(), 0600), 0);
  const CliRun show = RunCli({"session", "show", folder / "s", "--json"}, kSoon);
  EXPECT_EQ(show.exit, 3) << "all of it is unusable" << show.out << show.err;
  EXPECT_THAT(show.out, HasSubstr("is a named pipe"));
  for (const auto& footage : show.Json()["metrics"]["footage"]) EXPECT_EQ(footage.value("frames", 0), 0) << footage;
  for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
    const CliRun run = RunCli(
        {"mask", "--video", std::string("c=") + (folder / "s/raw/walk/") + camera + ".mp4", "--out", folder / "m"}, kSoon);
    EXPECT_EQ(run.exit, 3) << run.out << run.err;
    EXPECT_THAT(run.err, ::testing::AnyOf(HasSubstr("is of the kind 'hls'"), HasSubstr("is a named pipe")));
    EXPECT_FALSE(fs::exists(folder / "m"));
  }
}

}  // namespace
}  // namespace mvstudio::testing
