#include <filesystem>

#include "core/format.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// A studio whose board has a print on both sides, calibrated as a user does it, and again.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

class TwoSidedStudio : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    studio_ = std::make_unique<TempDir>();
    const CliRun made =
        RunCli({"synth", "--out", *studio_ / "s", "--cameras", "4", "--board", "charuco:7x5:140mm:105mm:two-sided=6mm",
                "--board-frames", "24", "--take-frames", "0", "--format", "png", "--size", "480x360", "--seed", "3"});
    ASSERT_EQ(made.exit, 0) << made.err;
  }
  static void TearDownTestSuite() { studio_.reset(); }

  static CliRun Calibrate(const std::string& out, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"calibrate", "--session", *studio_ / "s", "--out", *studio_ / out, "--cache", *studio_ / "cache",
                               "--model", "brown4", "--no-motions", "--json"});
    const CliRun run = RunCli(more);
    EXPECT_TRUE(run.exit == 0 || run.exit == 4) << run.out << run.err;
    return run;
  }
  static geometry::Rig Rig(const std::string& out) { return geometry::ReadRig(*studio_ / out + "/calibration.json"); }

  static std::unique_ptr<TempDir> studio_;
};

std::unique_ptr<TempDir> TwoSidedStudio::studio_;

TEST_F(TwoSidedStudio, BothSidesAreUsedFromFootage) {
  const CliRun both = Calibrate("both");
  const CliRun one = Calibrate("one", {"--board", "charuco:7x5:140mm:105mm"});
  const geometry::Rig truth = geometry::ReadRig(*studio_ / "s/truth/calibration.json");
  const double off_m = geometry::CompareRigs(Rig("both"), truth).max_translation_m;
  std::printf("both sides: %d corners, off by %.2f mm; front alone: %d\n", both.Json()["metrics"]["num_corners"].get<int>(),
              1e3 * off_m, one.Json()["metrics"]["num_corners"].get<int>());
  EXPECT_LT(off_m, 2e-3);
  EXPECT_GT(both.Json()["metrics"]["num_corners"].get<int>(), 1.3 * one.Json()["metrics"]["num_corners"].get<int>());
}

TEST_F(TwoSidedStudio, BoardsWithMarksInCommonAreRefused) {
  const CliRun run = RunCli({"calibrate", "--session", *studio_ / "s", "--board", "charuco:7x5:140mm:105mm", "--board",
                             "charuco:5x4:140mm:105mm:4x4_50", "--out", *studio_ / "twice"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.err, HasSubstr("share markers 0 to 9 of 4x4"));
}

/// The floor was said once.
TEST_F(TwoSidedStudio, TheWorldStaysWhenTheCalibrationIsMadeAgain) {
  const CliRun first = Calibrate("again", {"--world", "board:0"});
  EXPECT_THAT(first.out, Not(HasSubstr("CAL-WORLD")));
  const geometry::Rig floor = Rig("again");
  EXPECT_EQ(GaugeText(floor.gauge), "board in frame 0");
  for (int run = 0; run < 2; ++run) {
    const CliRun again = Calibrate("again", {"--overwrite"});
    EXPECT_THAT(again.out, Not(HasSubstr("CAL-WORLD"))) << run;
    EXPECT_EQ(again.Json()["metrics"]["earlier_world"]["kept"], true);
    EXPECT_EQ(Rig("again").gauge, floor.gauge);
    EXPECT_LT((Rig("again").cameras[3].CenterInWorld() - floor.cameras[3].CenterInWorld()).norm(), 1e-9);
  }
  const CliRun asked = Calibrate("again", {"--overwrite", "--world", "camera:cam_02"});
  EXPECT_EQ(GaugeText(Rig("again").gauge), "camera cam_02");
  EXPECT_FALSE(asked.Json()["metrics"].contains("earlier_world"));
}

TEST_F(TwoSidedStudio, AWorldThatIsLostIsSaid) {
  Calibrate("lost", {"--world", "board:0"});
  // Filmed again under the same name: frame 0 may show anything.
  fs::copy(*studio_ / "s", *studio_ / "s2", fs::copy_options::recursive);
  fs::remove(*studio_ / "s2/raw/board/cam_01/00000005.png");
  const CliRun other = RunCli({"calibrate", "--session", *studio_ / "s2", "--out", *studio_ / "lost", "--cache",
                               *studio_ / "cache", "--model", "brown4", "--no-motions", "--overwrite", "--json"});
  EXPECT_THAT(other.out, HasSubstr("the world of the earlier calibration is lost"));
  EXPECT_THAT(other.out, HasSubstr("the board was filmed again"));
  EXPECT_EQ(GaugeText(Rig("lost").gauge), "camera cam_01");
  // Moved afterwards: calibrate cannot do that.
  geometry::Rig aligned = Rig("lost");
  aligned.gauge = geometry::GaugeFromText("the floor under feet; uncertainty relative to camera cam_01");
  const std::string path = *studio_ / "moved";
  Calibrate("moved");
  geometry::WriteRig(aligned, path + "/calibration.json");
  const CliRun moved = Calibrate("moved", {"--overwrite"});
  EXPECT_THAT(moved.out, HasSubstr("which was fixed by: the floor under feet"));
}

}  // namespace
}  // namespace mvstudio::testing
