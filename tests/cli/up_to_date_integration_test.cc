#include <algorithm>
#include <filesystem>

#include "tests/support/folder_state.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// A command that is run again: nothing to do where nothing changed, --overwrite where its results would be others.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class UpToDate : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    studio_ = new TempDir;
    const CliRun run = RunCli(
        {"synth", "--out", *studio_ / "s", "--cameras", "3", "--size", "320x240", "--board-frames", "3", "--take-frames", "6"});
    ASSERT_EQ(run.exit, 0) << run.err;
  }
  static void TearDownTestSuite() { delete studio_; }
  void SetUp() override {
    fs::copy(*studio_ / "s/pose2d/take1", In("joints"), fs::copy_options::recursive);
    fs::copy(*studio_ / "s/truth/calibration.json", In("rig.json"));
  }

  std::string In(const std::string& name) const { return folder_ / name; }
  /// `root` stands before each path: "" for those below the current folder.
  static Words Triangulate(const std::string& root) {
    Words words = {"triangulate", "--calib", root + "rig.json", "--skeleton", "body25", "--out", root + "pose3d"};
    for (const std::string camera : {"cam_01", "cam_02", "cam_03"})
      words = words + Words{"--pose2d", camera + "=" + root + "joints/" + camera};
    return words;
  }
  Words Line() const { return Triangulate(folder_.path() + "/"); }
  Words Build() const {
    Words words = {"dataset",    "build", "--calib", In("rig.json"), "--pose3d", *studio_ / "s/truth/pose3d",
                   "--no-masks", "--out", In("d")};
    for (const std::string camera : {"cam_01", "cam_02", "cam_03"})
      words = words + Words{"--video", camera + "=" + (*studio_ / ("s/raw/take1/" + camera + ".mp4"))};
    return words;
  }

  /// Nothing is done, and nothing on the disk changes.
  void Kept(const Words& words, const std::string& why, const std::string& prefix = "") const {
    const auto before = StateOf(folder_.path());
    const CliRun run = RunCli(words, prefix);
    EXPECT_EQ(run.exit, 0) << why << ": " << run.err;
    EXPECT_THAT(run.out, HasSubstr("up to date: nothing changed since 20")) << why;
    EXPECT_EQ(StateOf(folder_.path()), before) << why;
  }
  void AsksFor(const std::string& text, const Words& words, const std::string& why) const {
    const auto before = StateOf(folder_.path());
    const CliRun run = RunCli(words);
    EXPECT_EQ(run.exit, 2) << why << ": " << run.out;
    EXPECT_THAT(run.err, HasSubstr(text)) << why;
    EXPECT_EQ(StateOf(folder_.path()), before) << why;
  }
  void Refused(const Words& words, const std::string& why) const { AsksFor("--overwrite", words, why); }

  const TempDir folder_;
  static inline TempDir* studio_ = nullptr;
};

TEST_F(UpToDate, TheSameLineHoweverItIsTyped) {
  const CliRun first = RunCli(Line() + Words{"--json"});
  ASSERT_EQ(first.exit, 0) << first.err;
  Kept(Line(), "the same line");
  Kept(Triangulate(""), "relative paths", "cd " + folder_.path() + " && ");
  Kept(Triangulate(folder_.path() + "/joints/.././"), "paths with dots");
  Kept(Line() + Words{"--log-level", "error", "--progress", "none"}, "less is printed");
  Words rotated = Line();
  std::rotate(rotated.begin() + 1, rotated.begin() + 3, rotated.begin() + 7);
  Kept(rotated, "another order");
  const CliRun again = RunCli(Line() + Words{"--json"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_EQ(again.Json()["metrics"], first.Json()["metrics"]);
  EXPECT_EQ(again.Json()["outputs"], first.Json()["outputs"]);
  EXPECT_TRUE(again.Json().contains("unchanged_since"));
  EXPECT_FALSE(first.Json().contains("unchanged_since"));
  EXPECT_THAT(RunCli(Line()).out, HasSubstr("Kept " + In("pose3d")));
  ASSERT_EQ(RunCli(Line() + Words{"--overwrite"}).exit, 0);
  Kept(Line(), "after it was replaced by the same");
}

TEST_F(UpToDate, ALineThatWouldGiveOtherResults) {
  ASSERT_EQ(RunCli(Line()).exit, 0);
  Refused(Line() + Words{"--seed", "2"}, "another seed");
  Refused(Line() + Words{"--min-score", "0.3"}, "another option");
  Words less = Line();
  less.resize(less.size() - 2);
  Refused(less, "a camera less");
  Refused(Line() + Words{"--redact"}, "the results name the folder");
}

TEST_F(UpToDate, AnInputThatChanged) {
  fs::create_directory_symlink(In("joints"), In("latest"));
  Words line = Line();
  for (std::string& word : line)
    if (const size_t at = word.find("/joints/"); at != std::string::npos) word.replace(at, 8, "/latest/");
  ASSERT_EQ(RunCli(line).exit, 0);
  const std::string rig = Slurp(In("rig.json")), joints = In("joints/cam_02");
  fs::last_write_time(In("rig.json"), fs::file_time_type::clock::now());
  Kept(line, "touched");
  Put(In("rig.json"), rig + " ");
  Refused(line, "a byte more");
  Put(In("rig.json"), rig);
  Kept(line, "as it was");
  const std::string one = fs::directory_iterator(joints)->path().string(), text = Slurp(one);
  fs::copy(one, joints + "/cam_02_000000000099_keypoints.json");
  Refused(line, "a file more");
  fs::remove(joints + "/cam_02_000000000099_keypoints.json");
  Kept(line, "a file more is gone");
  fs::rename(one, In("away.json"));
  Refused(line, "a file less");
  fs::create_symlink(In("away.json"), one);
  Kept(line, "a link to the same");
  Put(In("away.json"), text + "\n");
  Refused(line, "other content behind the link");
  Put(In("away.json"), text);
  fs::copy(In("joints"), In("others"), fs::copy_options::recursive);
  fs::remove(In("latest"));
  fs::create_directory_symlink(In("others"), In("latest"));
  Refused(line, "the folder's link leads elsewhere");
}

TEST_F(UpToDate, AnOutputThatIsNotWhatItWas) {
  ASSERT_EQ(RunCli(Line()).exit, 0);
  const std::string points = Slurp(In("pose3d/points.csv"));
  fs::remove(In("pose3d/points.csv"));
  Refused(Line(), "a file is gone");
  Put(In("pose3d/points.csv"), points);
  Kept(Line(), "it is back");
  Put(In("pose3d/points.csv"), points + "edited");
  AsksFor("points.csv", Line(), "edited");
  Put(In("pose3d/points.csv"), points);
  Put(In("pose3d/notes.txt"), "mine");
  Kept(Line(), "a file beside them, in a folder that may hold others");
}

TEST_F(UpToDate, AFolderThatIsWrittenAsAWhole) {
  ASSERT_EQ(RunCli(Build()).exit, 0);
  Kept(Build(), "the same");
  Put(In("d/notes.txt"), "mine");
  Refused(Build(), "a file of the user");
  fs::remove(In("d/notes.txt"));
  Kept(Build(), "without it");
  const std::string image = [&] {
    for (const auto& entry : fs::recursive_directory_iterator(In("d")))
      if (entry.path().extension() == ".jpg") return entry.path().string();
    return std::string();
  }();
  fs::rename(image, In("away.jpg"));
  Refused(Build(), "an image is gone");
  fs::rename(In("away.jpg"), image);
  fs::remove(In("d/provenance.jsonl"));
  Refused(Build(), "nothing is known of it");
}

TEST_F(UpToDate, WhatASessionHasByNow) {
  fs::copy(*studio_ / "s", In("s"), fs::copy_options::recursive);
  fs::create_directories(In("s/calib"));
  fs::copy(In("rig.json"), In("s/calib/calibration.json"));
  const Words line = {"triangulate", "--session", In("s"), "--skeleton", "body25"};
  ASSERT_EQ(RunCli(line).exit, 0);
  Kept(line, "the same");
  ASSERT_EQ(RunCli({"dataset", "build", "--session", In("s"), "--no-masks"}).exit, 0);
  Kept(line, "a later stage wrote into the session");
  Kept({"dataset", "build", "--session", In("s"), "--no-masks"}, "so did it");
  Put(In("s/sync/take1.timeline.json"), "{}");
  const CliRun timed = RunCli(line);
  EXPECT_NE(timed.exit, 0) << "there is a timeline by now: " << timed.out;
  fs::remove(In("s/sync/take1.timeline.json"));
  Kept(line, "there is none");
  std::ofstream(In("s/mvstudio.toml"), std::ios::app) << "# a note\n";
  Refused(line, "the session's file changed");
}

}  // namespace
}  // namespace mvstudio::testing
