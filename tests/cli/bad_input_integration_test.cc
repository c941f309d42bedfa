#include <fstream>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// A tiny session with true calibration and joints; made once, copied by tests that damage it.
class BadInput : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    const CliRun run = RunCli({"synth", "--out", *folder_ / "studio", "--cameras", "3", "--size", "320x240", "--board-frames",
                               "3", "--take-frames", "6"});
    ASSERT_EQ(run.exit, 0) << run.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  void SetUp() override {
    session_ = work_ / "studio";
    fs::copy(*folder_ / "studio", session_, fs::copy_options::recursive);
  }

  std::vector<std::string> Triangulate() const {
    std::vector<std::string> words = {
        "triangulate", "--calib", session_ + "/truth/calibration.json", "--skeleton", "body25", "--out", work_ / "pose3d"};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
      words.insert(words.end(), {"--pose2d", std::string(camera) + "=" + session_ + "/pose2d/take1/" + camera});
    }
    return words;
  }
  std::vector<std::string> Build() const {
    std::vector<std::string> words = {
        "dataset", "build",          "--calib", session_ + "/truth/calibration.json", "--pose3d", session_ + "/truth/pose3d",
        "--out",   work_ / "dataset"};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
      words.insert(words.end(), {"--video", std::string(camera) + "=" + session_ + "/raw/take1/" + camera + ".mp4"});
    }
    return words;
  }
  /// The command fails with `exit`, one line on stderr holding every one of `parts`, and leaves no output and no rubbish.
  void ExpectFailure(const std::vector<std::string>& words, int exit, const std::vector<std::string>& parts,
                     const std::string& output, const std::string& prefix = "") {
    std::vector<std::string> line = words;
    line.insert(line.end(), {"--progress", "none"});  // a slow machine would report progress
    const CliRun run = RunCli(line, prefix);
    EXPECT_EQ(run.exit, exit) << run.err;
    for (const std::string& part : parts) EXPECT_THAT(run.err, HasSubstr(part));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_FALSE(fs::exists(output)) << output;
    for (const auto& entry : fs::directory_iterator(work_.path())) {
      EXPECT_THAT(entry.path().string(), ::testing::Not(HasSubstr(".mvstudio-")));
    }
  }

  TempDir work_;
  std::string session_;

 private:
  static TempDir* folder_;
};
TempDir* BadInput::folder_ = nullptr;

std::string FirstFile(const std::string& folder) {
  std::string first;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (first.empty() || entry.path().string() < first) first = entry.path().string();
  }
  return first;
}

TEST_F(BadInput, TheSessionItselfIsGood) {
  EXPECT_EQ(RunCli(Triangulate()).exit, 0);
  const CliRun build = RunCli(Build());
  EXPECT_EQ(build.exit, 0) << build.err;
}

TEST_F(BadInput, OneTruncatedPoseJsonCostsThatFrameAlone) {
  const std::string victim = FirstFile(session_ + "/pose2d/take1/cam_02");
  fs::resize_file(victim, fs::file_size(victim) / 2);
  const CliRun run = RunCli(Triangulate());
  EXPECT_EQ(run.exit, 6) << run.err;
  EXPECT_THAT(run.err, HasSubstr(victim));
  EXPECT_TRUE(fs::exists(work_ / "pose3d/points.csv"));
}

TEST_F(BadInput, TruncatedPoseJsonEverywhereInACamera) {
  std::vector<fs::path> victims;
  for (const auto& entry : fs::directory_iterator(session_ + "/pose2d/take1/cam_02")) victims.push_back(entry.path());
  for (const fs::path& victim : victims) fs::resize_file(victim, fs::file_size(victim) / 2);
  ExpectFailure(Triangulate(), 3, {FirstFile(session_ + "/pose2d/take1/cam_02"), "cam_02"}, work_ / "pose3d");
}

TEST_F(BadInput, EmptyPoseFolder) {
  const std::string victim = session_ + "/pose2d/take1/cam_03";
  fs::remove_all(victim);
  fs::create_directory(victim);
  ExpectFailure(Triangulate(), 3, {victim}, work_ / "pose3d");
}

TEST_F(BadInput, CameraInThePosesButNotInTheCalibration) {
  auto words = Triangulate();
  words.insert(words.end(), {"--pose2d", "cam_77=" + session_ + "/pose2d/take1/cam_01"});
  ExpectFailure(words, 3, {"cam_77", "cam_01"}, work_ / "pose3d");
}

TEST_F(BadInput, TruncatedCalibration) {
  const std::string victim = session_ + "/truth/calibration.json";
  fs::resize_file(victim, fs::file_size(victim) / 2);
  ExpectFailure(Triangulate(), 3, {victim}, work_ / "pose3d");
}

TEST_F(BadInput, TruncatedVideo) {
  const std::string victim = session_ + "/raw/take1/cam_02.mp4";
  fs::resize_file(victim, fs::file_size(victim) / 2);
  ExpectFailure(Build(), 3, {victim, "cam_02"}, work_ / "dataset");
}

TEST_F(BadInput, ImageSizeThatContradictsTheCalibration) {
  const std::string path = session_ + "/truth/calibration.json";
  nlohmann::json calibration = nlohmann::json::parse(Slurp(path));
  calibration["cameras"][1]["size_px"] = {640, 200};
  std::ofstream(path) << calibration;
  ExpectFailure(Build(), 3, {"cam_02", "320x240", "640x200"}, work_ / "dataset");
}

TEST_F(BadInput, BoardNeverSeen) {
  std::vector<std::string> words = {"calibrate", "--board", "charuco:7x5:140mm:105mm", "--out", work_ / "run"};
  for (const char* camera : {"cam_01", "cam_02"}) {
    words.insert(words.end(), {"--camera", std::string(camera) + "=" + session_ + "/raw/take1/" + camera + ".mp4"});
  }
  ExpectFailure(words, 3, {"cam_01", "board"}, work_ / "run/calibration.json");
}

/// Runs a command in a mount namespace of its own, in which `mount` was run before; what is left below `disk` is its stdout.
CliRun RunMounted(const std::vector<std::string>& words, const std::string& mount, const std::string& disk) {
  const TempDir folder;
  std::string line;
  for (const std::string& word : words) line += " " + ShellQuote(word);
  const std::string script =
      mount + " && " + ShellQuote(CliPath()) + line + " >/dev/null; code=$?; ls -A " + disk + "; exit $code";
  const int status =
      std::system(("unshare -m sh -c " + ShellQuote(script) + " >" + (folder / "out") + " 2>" + (folder / "err")).c_str());
  return {WEXITSTATUS(status), Slurp(folder / "out"), Slurp(folder / "err")};
}

bool MayMount() { return std::system("unshare -m true 2>/dev/null") == 0; }

TEST_F(BadInput, NoSpaceLeftOnTheDevice) {
  const std::string disk = work_ / "disk";
  fs::create_directory(disk);
  if (!MayMount()) GTEST_SKIP() << "needs the right to mount a small file system";
  auto words = Build();
  *std::find(words.begin(), words.end(), work_ / "dataset") = disk + "/dataset";
  const CliRun run = RunMounted(words, "mount -t tmpfs -o size=100k none " + disk, disk);
  EXPECT_EQ(run.exit, 7) << run.err;
  EXPECT_THAT(run.err, HasSubstr("No space left"));
  EXPECT_THAT(run.err, HasSubstr(disk + "/dataset"));
  EXPECT_THAT(run.err, ::testing::Not(HasSubstr(".mvstudio-"))) << "names the hidden file that stands for it";
  EXPECT_EQ(run.out, "");  // nothing was left on the full disk
}

TEST_F(BadInput, AReadOnlyDisk) {
  const std::string disk = work_ / "disk";
  fs::create_directory(disk);
  if (!MayMount()) GTEST_SKIP() << "needs the right to mount a small file system";
  const std::string mount = "mount -t tmpfs -o size=1m,ro none " + disk;
  auto words = Build();
  *std::find(words.begin(), words.end(), work_ / "dataset") = disk + "/dataset";
  const std::vector<std::string> convert = {"calib", "convert", session_ + "/truth/calibration.json", "--out",
                                            disk + "/copy.json"};
  for (const auto& [line, output] : {std::pair(words, disk + "/dataset"), std::pair(convert, disk + "/copy.json")}) {
    const CliRun run = RunMounted(line, mount, disk);
    EXPECT_EQ(run.exit, 3) << run.err;
    EXPECT_THAT(run.err, HasSubstr(output));
    EXPECT_THAT(run.err, HasSubstr("Read-only file system"));
    EXPECT_THAT(run.err, ::testing::Not(HasSubstr(".mvstudio-")));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
}

TEST_F(BadInput, AnOutputWithANameThatIsTooLong) {
  const std::string name = work_ / std::string(300, 'n');
  const CliRun run = RunCli({"calib", "convert", session_ + "/truth/calibration.json", "--out", name + ".json"});
  EXPECT_EQ(run.exit, 3) << run.err;
  EXPECT_THAT(run.err, HasSubstr(name));
  EXPECT_THAT(run.err, HasSubstr("File name too long"));
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
}

}  // namespace
}  // namespace mvstudio::testing
