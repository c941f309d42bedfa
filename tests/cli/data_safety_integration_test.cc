#include <sys/stat.h>

#include <filesystem>
#include <thread>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/folder_state.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// What commands do to files that mvstudio did not write: nothing.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class DataSafety : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    inputs_ = new TempDir();
    avatar::WriteMannequinDataset(*inputs_ / "data", 4, 8, 96);
    ASSERT_EQ(RunCli({"synth", "--out", *inputs_ / "studio", "--cameras", "3", "--size", "160x120", "--board-frames", "12",
                      "--take-frames", "4"})
                  .exit,
              0);
    before_ = StateOf(inputs_->path());
  }
  static void TearDownTestSuite() {
    EXPECT_EQ(StateOf(inputs_->path()), before_) << "an input was touched";
    delete inputs_;
  }

  static std::string data() { return *inputs_ / "data"; }
  static std::string studio() { return *inputs_ / "studio"; }
  std::string out(const std::string& name = "out") const { return folder_ / name; }

  static Words Train(const std::string& out) {
    return {"avatar",    "train",
            data(),      "--out",
            out,         "--size",
            "32",        "--width",
            "4",         "--downs",
            "2",         "--encoder-blocks",
            "1",         "--decoder-blocks",
            "1",         "--init-steps",
            "2",         "--steps",
            "2",         "--no-fit-shape",
            "--threads", "1"};
  }
  static Words PerCamera(const std::string& flag, const std::string& folder, const std::string& extension) {
    Words words;
    for (const char* camera : {"cam_01", "cam_02", "cam_03"})
      words = words + Words{flag, std::string(camera) + "=" + studio() + "/" + folder + "/" + camera + extension};
    return words;
  }
  static Words Triangulate(const std::string& out) {
    return Words{"triangulate", "--calib", studio() + "/truth/calibration.json", "--skeleton", "body25", "--out", out} +
           PerCamera("--pose2d", "pose2d/take1", "");
  }
  static Words Build(const std::string& out) {
    return Words{"dataset",    "build", "--calib", studio() + "/truth/calibration.json", "--pose3d", studio() + "/truth/pose3d",
                 "--no-masks", "--out", out} +
           PerCamera("--video", "raw/take1", ".mp4");
  }

  /// The command is refused with exit 2 and one line that says `why`; nothing in the test's folder changed.
  void Refused(const Words& words, const std::string& why) {
    const auto before = StateOf(folder_.path());
    const CliRun run = RunCli(words);
    EXPECT_EQ(run.exit, 2) << run.out << run.err;
    EXPECT_THAT(run.err, HasSubstr(why));
    EXPECT_EQ(StateOf(folder_.path()), before);
  }

  const TempDir folder_;
  static TempDir* inputs_;
  static std::map<std::string, std::string> before_;
};
TempDir* DataSafety::inputs_ = nullptr;
std::map<std::string, std::string> DataSafety::before_;

TEST_F(DataSafety, TrainingNeverClearsFoldersOfTheUser) {
  Put(out("proj/pictures/mine.jpg"), "mine");
  Put(out("proj/samples/mine.jpg"), "mine");
  Put(out("proj/eval/mine.txt"), "mine");
  Put(out("proj/history.csv"), "mine");
  Refused(Train(out("proj")), "pictures/mine.jpg");
  Refused(Train(out("proj")) + Words{"--overwrite"}, "pictures/mine.jpg");
}

TEST_F(DataSafety, TrainingBesideOtherFilesLeavesThem) {
  Put(out("proj/notes/mine.txt"), "mine");
  ASSERT_EQ(RunCli(Train(out("proj"))).exit, 0);
  ASSERT_EQ(RunCli(Train(out("proj")) + Words{"--overwrite"}).exit, 0) << "its own run may be replaced";
  EXPECT_EQ(Slurp(out("proj/notes/mine.txt")), "mine");
  Put(out("proj/samples/mine.jpg"), "mine");
  Refused(Train(out("proj")) + Words{"--overwrite"}, "samples/mine.jpg");
}

TEST_F(DataSafety, CalibrationFromASceneLeavesColmapFoldersOfTheUser) {
  Put(out("run/colmap/database.db"), "mine");
  Put(out("scene/a.png"), "x");
  Refused({"calibrate", "--from-scene", out("scene"), "--out", out("run"), "--camera-distance", "a:b:1m"}, "in the way");
}

TEST_F(DataSafety, OverwriteReplacesNoFolderOfOthers) {
  Put(out("home/thesis.tex"), "mine");
  for (const Words& words : {Build(out("home")), Words{"synth", "--out", out("home")},
                             Words{"dataset", "export", data(), "--to", "colmap", "--out", out("home")},
                             Words{"demo", "--quick", "--out", out("home")},
                             Words{"mask", "--out", out("home")} + PerCamera("--video", "raw/take1", ".mp4"),
                             Words{"pose2d", "--backend", "openpose:" + studio() + "/pose2d/take1", "--out", out("home")} +
                                 PerCamera("--video", "raw/take1", ".mp4")})
    Refused(words + Words{"--overwrite"}, "thesis.tex");
}

TEST_F(DataSafety, OverwriteReplacesNoInput) {
  fs::copy(studio(), out("s"), fs::copy_options::recursive);
  fs::copy(data(), out("d"), fs::copy_options::recursive);
  Refused({"dataset", "build", "--session", out("s"), "--out", out("s"), "--overwrite"}, "");
  Refused({"dataset", "export", out("d"), "--to", "colmap", "--out", out("d"), "--overwrite"}, "input");
  Refused({"dataset", "export", out("d"), "--to", "colmap", "--out", out("d/colmap")}, "lies in the input");
  Refused({"dataset", "export", out("d"), "--to", "colmap", "--out", folder_.path(), "--overwrite"}, "contains the input");
  fs::create_directory_symlink(out("d"), out("link"));
  Refused({"dataset", "export", out("d"), "--to", "colmap", "--out", out("link"), "--overwrite"}, "input");
  Refused({"dataset", "pack", out("d"), "--out", out("d")}, "input");
}

/// `latest` is a link to other/today: `latest/..` is `other` for the system, and the folder around it for who reads the text.
TEST_F(DataSafety, OutputsAreWhereTheSystemFindsThem) {
  fs::create_directories(out("other/today"));
  fs::create_directory_symlink("other/today", out("latest"));
  fs::copy(data(), out("other/ds"), fs::copy_options::recursive);
  fs::copy(studio(), out("other/s"), fs::copy_options::recursive);
  const std::string truth = "latest/../s/truth/calibration.json";
  const std::string here = "cd " + folder_.path() + " && ";
  const auto before = StateOf(folder_.path());
  for (const Words& words :
       {Words{"dataset", "export", "other/ds", "--to", "npz", "--out", "latest/../ds"},
        Words{"dataset", "pack", "latest/../ds", "--out", "other/ds"},
        Words{"dataset", "import", "panoptic", "other/ds", "--out", "latest/../ds"},
        Words{"calib", "convert", truth, "--out", "other/s/truth/calibration.json"},
        Words{"markers", "other/s/truth/pose3d", "--to", "trc", "--frame-rate", "25", "--out", "latest/../s/truth/pose3d"},
        Words{"pose2d", "--session", "other/s", "--backend", "openpose:other/s/pose2d/take1", "--out",
              "latest/../s/pose2d/take1"}}) {
    const bool pack = words[1] == "pack";
    const CliRun run = RunCli(pack ? words : words + Words{"--overwrite"}, here);
    EXPECT_EQ(run.exit, 2) << words[0] << " " << words[1] << run.out << run.err;
    EXPECT_THAT(run.err, HasSubstr("the input"));
    EXPECT_EQ(StateOf(folder_.path()), before) << words[0] << " " << words[1];
  }
  const CliRun written = RunCli({"calib", "convert", truth, "--out", "latest/../r.json", "--json"}, here);
  ASSERT_EQ(written.exit, 0) << written.err;
  EXPECT_EQ(written.Json()["outputs"][0]["path"], "other/r.json");
  EXPECT_TRUE(fs::exists(out("other/r.json")));
  EXPECT_FALSE(fs::exists(out("r.json")));
}

/// These need no inputs: the name is looked at first.
TEST_F(DataSafety, NamesThatAreKeptAndPlacesThatAreNotThereAreNoOutputs) {
  const Words commands[] = {{"synth", "--out"},
                            {"session", "init", "--units", "m"},
                            {"board", "draw", "chessboard:9x6:20mm", "--out"},
                            {"calibrate", "--corners", "none.csv", "--save-corners"},
                            {"calib", "convert", "none.json", "--out"},
                            {"calib", "eval", "none.json", "--repair"},
                            {"calib", "lenses", "add"},
                            {"triangulate", "--calib", "none.json", "--out"},
                            {"sync", "--calib", "none.json", "--out"},
                            {"markers", "none", "--to", "trc", "--out"},
                            {"dataset", "export", "none", "--to", "csv", "--out"},
                            {"dataset", "pack", "none", "--out"},
                            {"dataset", "split", "none", "--out"},
                            {"dataset", "verify", "none", "--keep"},
                            {"report", "none", "--out"},
                            {"tradeoff", "calibrate", "--out"},
                            {"demo", "--out"}};
  const std::string kept[] = {"x.result.json", "provenance.jsonl", ".mvstudio.json", ".mvstudio-" + std::string(32, '0'),
                              ".mvstudio.x.lock"};
  size_t next = 0;
  for (const Words& words : commands) {
    Refused(words + Words{out("new/" + kept[next++ % std::size(kept)])}, "keeps the name");
    const CliRun run = RunCli(words + Words{out("none/../x")});
    EXPECT_EQ(run.exit, 3) << words[0] << run.err;
    EXPECT_THAT(run.err, HasSubstr("there is no folder"));
  }
  EXPECT_TRUE(Entries(folder_.path()).empty());
}

TEST_F(DataSafety, NoOutputIsTheRootTheHomeOrTheCurrentFolder) {
  const std::string here = "cd " + folder_.path() + " && HOME=" + folder_.path() + "/me ";
  fs::create_directories(out("me"));
  fs::create_directory_symlink("/", out("root"));
  for (const std::string& place : {std::string("/"), std::string("."), out("me"), out("root"), std::string("./")}) {
    const CliRun run = RunCli({"synth", "--out", place, "--overwrite"}, here);
    EXPECT_EQ(run.exit, 2) << place << run.err;
    const CliRun calibrate = RunCli(
        Words{"calibrate", "--board", "charuco:7x5:140mm:105mm", "--out", place} + PerCamera("--camera", "raw/board", ".mp4"),
        here);
    EXPECT_EQ(calibrate.exit, 2) << place << calibrate.err;
  }
  EXPECT_EQ(Entries(folder_.path()), std::set<std::string>({"me", "root"}));
}

TEST_F(DataSafety, ASymbolicLinkToAFolderStaysOne) {
  fs::create_directory(out("disk"));
  fs::create_directory_symlink(out("disk"), out());
  ASSERT_EQ(RunCli(Build(out())).exit, 0);
  EXPECT_TRUE(fs::is_symlink(out()));
  EXPECT_TRUE(fs::exists(out("disk/dataset.json")));
}

TEST_F(DataSafety, AReportReplacesNoCalibration) {
  ASSERT_EQ(RunCli({"calib", "convert", studio() + "/truth/calibration.json", "--out", out("run/calib/calibration.json")}).exit,
            0);
  const std::string calibration = Slurp(out("run/calib/calibration.json"));
  ASSERT_FALSE(calibration.empty());
  Refused({"report", out("run"), "--out", out("run/calib/calibration.html")}, "calibration.json");
  EXPECT_EQ(Slurp(out("run/calib/calibration.json")), calibration);
  EXPECT_EQ(RunCli({"report", out("run"), "--out", out("run/report.html")}).exit, 0);
  EXPECT_EQ(RunCli({"report", out("run"), "--out", out("run/report.html")}).exit, 0) << "a report replaces itself";
}

TEST_F(DataSafety, NoCommandReplacesACalibrationOfTheUser) {
  Put(out("run/calibration.json"), "mine");
  Refused(Words{"calibrate", "--board", "charuco:7x5:140mm:105mm", "--out", out("run")} +
              PerCamera("--camera", "raw/board", ".mp4"),
          "calibration.json");
  Put(out("cams.yml"), "mine");
  const std::string truth = studio() + "/truth/calibration.json";
  Refused({"calib", "convert", truth, "--to", "kalibr", "--out", out("cams.yml")}, "cams.yml");
  Refused({"dataset", "split", data(), "--test-cameras", "00_03", "--test-frames", "6-7", "--out", out("run/calibration.json")},
          "calibration.json");
  Put(out("pose/points.csv"), "mine");
  Refused(Triangulate(out("pose")), "points.csv");
}

TEST_F(DataSafety, ConversionsLeaveNothingWhenOneNameCannotBeUsed) {
  Put(out("cv/cam_02.yml"), "mine");
  Refused({"calib", "convert", studio() + "/truth/calibration.json", "--to", "opencv", "--out", out("cv")}, "cam_02.yml");
}

TEST_F(DataSafety, BracketsInPathsAreNoPatterns) {
  fs::copy(data(), out("take1"), fs::copy_options::recursive);
  fs::copy(data(), out("take[1]"), fs::copy_options::recursive);
  fs::remove_all(out("take[1]/hdPose3d_stage1_coco19"));
  fs::remove(out("take1") + "/" + "calibration_test.json");
  const CliRun run = RunCli(
      {"dataset", "split", out("take[1]"), "--test-cameras", "00_03", "--test-frames", "6-7", "--out", out("split.json")});
  EXPECT_EQ(run.exit, 3) << "the joints are the neighbour's";
}

TEST_F(DataSafety, TriangulateReplacesItsThreeFilesTogether) {
  ASSERT_EQ(RunCli(Triangulate(out("pose3d"))).exit % 4, 0);
  const auto before = StateOf(out("pose3d"));
  Words words = Triangulate(out("pose3d"));
  EXPECT_EQ(RunCli(words + Words{"--seed", "2"}).exit, 2) << "an earlier result is kept";
  EXPECT_EQ(StateOf(out("pose3d")), before);
  words.push_back("--overwrite");
  ASSERT_EQ(RunCli(words).exit % 4, 0);
  for (const char* name : {"points.csv", "covariance.csv", "pose3d.json"})
    EXPECT_EQ(Slurp(out("pose3d/") + name), before.at(std::string("/") + name));
  EXPECT_EQ(Entries(folder_.path()), std::set<std::string>({"pose3d"}));
}

TEST_F(DataSafety, OneWriterAnOutputFolder) {
  std::vector<CliRun> runs(4);
  std::vector<std::thread> threads;
  for (CliRun& run : runs) {
    threads.emplace_back([&] {
      run = RunCli({"synth", "--out", out(), "--overwrite", "--cameras", "2", "--size", "160x120", "--board-frames", "2",
                    "--take-frames", "6"});
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const CliRun& run : runs) EXPECT_TRUE(run.exit == 0 || run.exit == 75) << run.exit << ": " << run.err;
  EXPECT_TRUE(std::any_of(runs.begin(), runs.end(), [](const CliRun& run) { return run.exit == 0; }));
  EXPECT_EQ(Entries(folder_.path()), std::set<std::string>({"out"}));
}

TEST_F(DataSafety, ALockThatIsALinkIsNotFollowed) {
  Put(out("victim"), "mine");
  fs::create_directory(out("pack"));
  fs::create_symlink(out("victim"), out("pack/.mvstudio.shard-00000.lock"));
  fs::create_symlink(out("victim"), out(".mvstudio.ds.lock"));
  EXPECT_NE(RunCli({"dataset", "pack", data(), "--out", out("pack")}).exit, 0);
  EXPECT_EQ(RunCli(Build(out("ds"))).exit, 2);
  EXPECT_EQ(Slurp(out("victim")), "mine");
}

TEST_F(DataSafety, ADemoOrAnExportThatWasEditedIsKept) {
  const Words words = {"dataset", "export", data(), "--to", "colmap", "--out", out("colmap")};
  ASSERT_EQ(RunCli(words).exit % 6, 0);
  ASSERT_EQ(RunCli(words + Words{"--overwrite"}).exit % 6, 0) << "unchanged: replaced";
  Put(out("colmap/sparse/0/mine.txt"), "mine");
  Refused(words + Words{"--overwrite"}, "mine.txt");
}

TEST_F(DataSafety, AnExportIsACopyUnlessLinksAreAskedFor) {
  ASSERT_EQ(RunCli({"dataset", "export", data(), "--to", "colmap", "--out", out("colmap")}).exit % 6, 0);
  int images = 0;
  for (const auto& entry : fs::recursive_directory_iterator(out("colmap"))) {
    if (entry.path().extension() != ".jpg" && entry.path().extension() != ".png") continue;
    EXPECT_EQ(fs::hard_link_count(entry.path()), 1u) << "editing it would edit the dataset";
    ++images;
  }
  EXPECT_GT(images, 0);
}

TEST_F(DataSafety, PipesWithoutAWriterAndDevicesAreRefused) {
  ASSERT_EQ(mkfifo(out("pipe").c_str(), 0600), 0);
  EXPECT_EQ(RunCli({"calib", "show", out("pipe")}).exit, 3);
  EXPECT_EQ(RunCli({"calib", "show", "/dev/zero"}).exit, 3);
}

}  // namespace
}  // namespace mvstudio
