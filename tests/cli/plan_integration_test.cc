#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>
#include <sstream>
#include <thread>

#include "tests/support/run_cli.h"

/// `mvstudio plan`, `task` and `jobs` with ninja, which builds mvstudio itself, on a small studio with truth.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class PlanCommands : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    const CliRun made = RunCli({"synth", "--out", *folder_ / "s", "--cameras", "3", "--size", "320x240", "--board",
                                "charuco:5x4:240mm:180mm", "--board-frames", "40", "--take-frames", "12"});
    ASSERT_EQ(made.exit, 0) << made.err;
    for (const char* name : {"straight", "fresh"}) fs::copy(*folder_ / "s", *folder_ / name, fs::copy_options::recursive);
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static int NumDone() {
    const nlohmann::json json = RunCli({"jobs", "status", Path("plan"), "--json"}).Json();
    return json["metrics"]["num_done"].get<int>();
  }
  /// A number of a task's line in plan.jsonl.
  static double Foretold(int task, const char* key) {
    std::istringstream lines(Slurp(Path("plan/plan.jsonl")));
    std::string line;
    for (int i = 0; i <= task; ++i) std::getline(lines, line);
    return nlohmann::json::parse(line)[key].get<double>();
  }
  static inline TempDir* folder_ = nullptr;
};

/// One test, because each step stands on the last.
TEST_F(PlanCommands, DoWhatRunDoes) {
  const CliRun plan = RunCli({"plan", Path("s"), "--out", Path("plan"), "--to", "triangulate", "--write", "ninja", "slurm"});
  ASSERT_EQ(plan.exit, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("3  triangulate take1 "));
  EXPECT_THAT(plan.out, HasSubstr(" MB on disk after 1, 2"));
  EXPECT_THAT(Slurp(Path("plan/submit.sh")), HasSubstr("--mem="));
  EXPECT_EQ(RunCli({"task", Path("plan"), "3"}).exit, 2) << "before those that it waits for";
  EXPECT_EQ(RunCli({"task", Path("plan"), "4"}).exit, 2) << "there are three";
  EXPECT_EQ(RunCli({"jobs", "status", Path("plan")}).exit, 6);
  auto does_it = std::async(std::launch::async, [] { return RunCli({"task", Path("plan"), "1", "--json"}).Json(); });
  while (!fs::exists(Path("plan/tried/1.json"))) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_EQ(RunCli({"task", Path("plan"), "1"}).exit, 75) << "another process does it";
  const CliRun waited = RunCli({"task", Path("plan"), "1", "--wait"});
  EXPECT_EQ(waited.exit, 0) << waited.err;
  EXPECT_THAT(waited.out, HasSubstr("up to date"));
  const nlohmann::json first = does_it.get();
  const double peak_mb = first["timing"]["peak_rss_mb"].get<double>(), foretold_mb = Foretold(1, "memory_mb");
  if (!kSanitized) {
    EXPECT_GT(foretold_mb, peak_mb / 2);
    EXPECT_LT(foretold_mb, peak_mb * 2);
  }
  const CliRun all = RunCli({"jobs", "submit", Path("plan")});
  EXPECT_EQ(all.exit, 0) << all.err << Slurp(Path("plan/submit.log"));
  EXPECT_EQ(NumDone(), 3);
  const CliRun straight = RunCli({"run", Path("straight"), "--to", "triangulate"});
  ASSERT_THAT(straight.exit, ::testing::AnyOf(0, 6)) << straight.err;
  for (const char* file : {"calib/calibration.json", "pose3d/take1/points.csv"})
    EXPECT_EQ(Slurp(Path(std::string("s/") + file)), Slurp(Path(std::string("straight/") + file))) << file;

  // Done is done: neither a task nor a submission touches anything.
  const auto written = fs::last_write_time(Path("plan/done/1.json"));
  EXPECT_THAT(RunCli({"task", Path("plan"), "1"}).out, HasSubstr("up to date"));
  EXPECT_EQ(RunCli({"jobs", "submit", Path("plan")}).exit, 0);
  EXPECT_EQ(fs::last_write_time(Path("plan/done/1.json")), written);

  // A lost result is made again, to the same bytes.
  fs::remove_all(Path("s/pose3d/take1"));
  EXPECT_EQ(NumDone(), 2);
  EXPECT_EQ(RunCli({"jobs", "retry", Path("plan")}).exit, 0);
  EXPECT_EQ(Slurp(Path("s/pose3d/take1/points.csv")), Slurp(Path("straight/pose3d/take1/points.csv")));

  // A lost marker of a result that is there is written again.
  fs::remove(Path("plan/done/2.json"));
  EXPECT_EQ(NumDone(), 2);
  EXPECT_EQ(RunCli({"jobs", "retry", Path("plan")}).exit, 0);
  EXPECT_EQ(NumDone(), 3);

  // A marker that somebody else put there is nobody's to remove, and none.
  fs::remove(Path("plan/done/3.json"));
  std::ofstream(Path("plan/done/3.json")) << "done";
  EXPECT_EQ(NumDone(), 2);
  EXPECT_EQ(RunCli({"jobs", "retry", Path("plan")}).exit, 2);
  EXPECT_EQ(Slurp(Path("plan/done/3.json")), "done");
  fs::remove(Path("plan/done/3.json"));

  // Other footage than the plan was written for.
  std::ofstream(Path("s/raw/board/cam_01.mp4"), std::ios::app) << "x";
  const CliRun changed = RunCli({"task", Path("plan"), "1"});
  EXPECT_EQ(changed.exit, 3);
  EXPECT_THAT(changed.err, HasSubstr("write the plan anew"));
  EXPECT_EQ(RunCli({"plan", Path("s"), "--out", Path("plan"), "--to", "triangulate"}).exit, 2) << "it is there";
  EXPECT_EQ(RunCli({"plan", Path("s"), "--out", Path("plan"), "--to", "triangulate", "--overwrite"}).exit, 0);
}

/// Masks and a dataset by cameras, joined by tasks that find what the others kept; its check by cameras, too.
TEST_F(PlanCommands, PartsGiveWhatOneRunGives) {
  for (const char* name : {"cut", "whole"}) fs::copy(Path("fresh"), Path(name), fs::copy_options::recursive);
  const CliRun whole = RunCli({"run", Path("whole"), "--to", "verify"});
  ASSERT_THAT(whole.exit, ::testing::AnyOf(0, 6)) << whole.err;
  const auto images = [](const std::string& session, const std::string& stage) {
    std::map<std::string, std::string> files;
    const std::string folder = Path(session + "/" + stage + "/take1");
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.path().extension() == ".png" || entry.path().extension() == ".jpg")
        files[entry.path().string().substr(folder.size())] = Slurp(entry.path().string());
    }
    return files;
  };
  const auto masks = [&](const std::string& session) { return images(session, "masks"); };
  const CliRun plan = RunCli({"plan", Path("cut"), "--out", Path("parts"), "--to", "verify", "--task-seconds", "0.05",
                              "--write", "ninja", "slurm", "snakemake"});
  ASSERT_EQ(plan.exit, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("mask take1 frames=cam_02"));
  EXPECT_THAT(Slurp(Path("parts/submit.sh")), HasSubstr("--job-name=mask-frames --array=0-2 "));
  const auto states = [] {
    std::map<std::string, int> counts;
    const nlohmann::json json = RunCli({"jobs", "status", Path("parts"), "--json"}).Json();
    for (const auto& task : json["metrics"]["tasks"]) ++counts[task["state"].get<std::string>()];
    return counts;
  };
  const CliRun all = RunCli({"jobs", "submit", Path("parts")});
  ASSERT_EQ(all.exit, 0) << all.err << Slurp(Path("parts/submit.log"));
  EXPECT_EQ(states(), (std::map<std::string, int>{{"done", 3 + (3 + 1 + 3 + 1) + (3 + 3 + 1) + (3 + 1)}}))
      << "samples, choice, frames, the whole; samples, frames, the whole; shares, the whole";
  EXPECT_EQ(masks("cut").size(), size_t{3 * 12 + 3});
  EXPECT_EQ(masks("cut"), masks("whole"));
  EXPECT_FALSE(fs::exists(Path("cut/masks/take1/part.json")));
  EXPECT_EQ(images("cut", "dataset").size(), size_t{2 * 3 * 12});
  EXPECT_EQ(images("cut", "dataset"), images("whole", "dataset"));
  const auto found = [](const std::string& session) {
    const auto metrics = nlohmann::json::parse(Slurp(Path(session + "/verify/take1/dataset_verify.result.json")))["metrics"];
    std::vector<int> numbers;
    for (const char* name : {"num_errors", "num_warnings", "cameras", "frames", "pictures", "masks"})
      numbers.push_back(metrics[name]);
    return numbers;
  };
  EXPECT_EQ(found("cut"), found("whole"));
  for (const char* times : {"once", "again"}) {  // in processes of their own
    const CliRun share = RunCli({"dataset", "verify", Path("cut/dataset/take1"), "--cache", Path("checks"), "--part",
                                 "share=0/2", "--keep", Path("share")});
    EXPECT_EQ(share.exit, 0) << times << ": " << share.err;
  }

  // The parts did their work: that they are gone changes nothing, and a lost result is made without them.
  fs::remove_all(Path("parts/kept")), fs::remove_all(Path("parts/parts"));
  EXPECT_EQ(states().size(), 1u);
  fs::remove_all(Path("cut/masks/take1"));
  EXPECT_EQ(RunCli({"jobs", "retry", Path("parts")}).exit, 0);
  EXPECT_EQ(masks("cut"), masks("whole"));
}

}  // namespace
}  // namespace mvstudio::testing
