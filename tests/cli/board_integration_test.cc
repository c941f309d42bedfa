#include "dataset/footage/image_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::testing {
namespace {

TEST(BoardDraw, ThenCheckSaysWhichBoardItIs) {
  const TempDir folder;
  const std::string image = folder / "board.png";
  const CliRun drawn = RunCli({"board", "draw", "charuco:7x5:25mm:18mm:5x5_50", "--out", image, "--dpi", "100", "--json"});
  ASSERT_EQ(drawn.exit, 0) << drawn.err;
  EXPECT_EQ(drawn.Json()["metrics"]["num_corners"], 24);
  const CliRun checked = RunCli({"board", "check", image, "--board", "charuco:5x7:25mm:18mm:5x5_50", "--json"});
  ASSERT_EQ(checked.exit, 0) << checked.out;
  const auto metrics = checked.Json()["metrics"];
  EXPECT_EQ(metrics["board"], "charuco:7x5:25mm:18mm:5x5_50");
  EXPECT_EQ(metrics["trials"][0]["relation"], "rows and columns exchanged");
  EXPECT_EQ(metrics["trials"][0]["num_corners"], 24);
  EXPECT_NE(RunCli({"board", "check", image, "--board", "charuco:5x7:25mm:18mm:5x5_50"})
                .out.find("--board charuco:7x5:25mm:18mm:5x5_50"),
            std::string::npos);
}

TEST(BoardDraw, RefusesWhatDoesNotFit) {
  const TempDir folder;
  const CliRun large = RunCli({"board", "draw", "chessboard:9x6:40mm", "--out", folder / "b.pdf"});
  EXPECT_EQ(large.exit, 2);
  EXPECT_NE((large.out + large.err).find("440.0 x 337.0 mm"), std::string::npos) << large.out << large.err;
  EXPECT_EQ(RunCli({"board", "draw", "chessboard:9x6:40mm", "--paper", "none", "--out", folder / "b.pdf"}).exit, 0);
  EXPECT_EQ(RunCli({"board", "draw", "chessboard:9x6:20mm", "--out", folder / "b.gif"}).exit, 2);
  EXPECT_EQ(RunCli({"board", "draw", "chess:9x6:20mm", "--out", folder / "b.pdf"}).exit, 2);
  EXPECT_EQ(RunCli({"board", "draw", "grid:9x6:20mm", "--out", folder / "b.pdf"}).exit, 2);
}

TEST(BoardCheck, ExitsWhenNothingFits) {
  const TempDir folder;
  dataset::WriteImage(Image(320, 240, 3, 170), folder / "wall.png");
  const CliRun run = RunCli({"board", "check", folder / "wall.png", "--board", "chessboard:9x6:20mm", "--json"});
  EXPECT_EQ(run.exit, 3);
  EXPECT_TRUE(run.Json()["metrics"]["board"].is_null());
  EXPECT_EQ(run.Json()["errors"][0]["code"], "BRD-NONE");
  EXPECT_EQ(RunCli({"board", "check", folder / "nowhere.png"}).exit, 3);
  EXPECT_EQ(RunCli({"board", "check", folder / "wall.png", "--board", "grid:9x6:20mm"}).exit, 2);
}

TEST(BoardCheck, ListsAllTagsOfTheSwarm) {
  MVS_NEEDS_DATA("apriltag");
  const CliRun run = RunCli({"board", "check", DataRoot() + "/apriltag/*.jpg", "--board", "tag:36h11:0:150mm", "--json"});
  EXPECT_EQ(run.exit, 0) << run.out;
  EXPECT_EQ(run.Json()["metrics"]["num_tags"], 47);
}

TEST(BoardPropose, NamesThePapersThatItTakes) {
  for (const char* paper : {"a0", "none"}) {
    const CliRun run = RunCli({"board", "propose", "--paper", paper});
    EXPECT_EQ(run.exit, 2);
    EXPECT_NE(run.err.find("is none of a4, a3, a2, a1, letter"), std::string::npos) << run.err;
  }
  const CliRun wide = RunCli({"board", "propose", "--paper", "a3", "--fov", "90", "--image-width", "320"});
  EXPECT_NE(wide.out.find("none; images of "), std::string::npos) << wide.out;
}

}  // namespace
}  // namespace mvstudio::testing
