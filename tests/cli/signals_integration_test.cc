#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <map>
#include <thread>

#include "tests/support/running_cli.h"
#include "tests/support/test.h"

/// SIGINT, SIGTERM and SIGHUP end any command within five seconds, whatever it is doing, and leave nothing behind.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// Every file below a folder with its content.
std::map<std::string, std::string> Contents(const std::string& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) contents[entry.path().string()] = Slurp(entry.path().string());
  }
  return contents;
}

/// Names of hidden files and folders below: temporary ones and locks are hidden.
std::vector<std::string> Leftovers(const std::string& folder) {
  std::vector<std::string> left;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name[0] == '.' && name != ".mvstudio.json") left.push_back(entry.path().string());
  }
  return left;
}

class Signals : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    studio_ = new TempDir;
    const CliRun made = RunCli({"synth", "--out", *studio_ / "studio", "--cameras", "4", "--size", "640x480", "--board-frames",
                                "40", "--take-frames", "12"});
    ASSERT_EQ(made.exit, 0) << made.err;
    const CliRun built = RunCli({"dataset", "build", "--session", Studio(), "--calib", Studio() + "/truth/calibration.json",
                                 "--pose3d", Studio() + "/truth/pose3d", "--out", *studio_ / "dataset"});
    ASSERT_EQ(built.exit, 0) << built.err;
  }
  static void TearDownTestSuite() {
    delete studio_;
    studio_ = nullptr;
  }
  static std::string Studio() { return *studio_ / "studio"; }
  static std::string Dataset() { return *studio_ / "dataset"; }

  /// Sends `number` when the program has worked for `delay` and expects the end of the contract: in time, its exit code, one
  /// line or one object, no leftovers, inputs as before.
  void ExpectEnd(const std::vector<std::string>& words, int number, std::chrono::milliseconds delay, bool json = false) {
    SCOPED_TRACE(words[0] + " and signal " + std::to_string(number));
    const auto before = Contents(studio_->path());
    std::vector<std::string> line = words;
    line.insert(line.end(), {"--progress", "none"});
    if (json) line.push_back("--json");
    Running program(line, streams_);
    ASSERT_TRUE(WaitUntil([&] { return program.Listens() || program.HasEnded(); }));
    std::this_thread::sleep_for(delay);
    ASSERT_FALSE(program.HasEnded()) << "before the signal: " << program.Result().err;
    program.Send(number);
    ASSERT_TRUE(program.Await(kBound)) << "does not end";
    const CliRun run = program.Result();
    EXPECT_EQ(run.exit, 128 + number) << run.err;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_THAT(run.err, HasSubstr("error: interrupted"));
    if (json) {
      EXPECT_EQ(run.Json()["exit"], 128 + number) << run.out;
      EXPECT_EQ(run.Json()["errors"][0]["code"], "CLI-INTERRUPTED");
    } else {
      EXPECT_EQ(run.out, "");
    }
    EXPECT_THAT(Leftovers(work_.path()), ::testing::IsEmpty());
    EXPECT_TRUE(Contents(studio_->path()) == before) << "inputs were changed";
  }

  std::vector<std::string> LongSynth() const {
    return {"synth", "--out", work_ / "long", "--cameras", "8", "--size", "640x480", "--take-frames", "5000"};
  }

  TempDir work_, streams_;

 private:
  static TempDir* studio_;
};
TempDir* Signals::studio_ = nullptr;

TEST_F(Signals, EachOfThreeEndsSynthAndNothingIsLeft) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    ExpectEnd(LongSynth(), number, std::chrono::milliseconds(800), number == SIGHUP);
    EXPECT_TRUE(fs::is_empty(work_.path()));
  }
}

/// The solver of the splined lens asks nobody for the better part of a minute: the watcher ends it.
TEST_F(Signals, ALongSolveThatAsksNobodyIsEnded) {
  std::vector<std::string> words = {"calibrate", "--session", Studio(), "--model", "splined", "--out", work_ / "calib"};
  ExpectEnd(words, SIGINT, std::chrono::seconds(7));
  ExpectEnd(words, SIGTERM, std::chrono::seconds(7), true);
  EXPECT_FALSE(fs::exists(work_ / "calib/calibration.json"));
}

TEST_F(Signals, BuildingAndExportingEndToo) {
  ExpectEnd({"dataset", "build", "--session", Studio(), "--calib", Studio() + "/truth/calibration.json", "--pose3d",
             Studio() + "/truth/pose3d", "--out", work_ / "dataset"},
            SIGHUP, std::chrono::milliseconds(500));
  EXPECT_TRUE(fs::is_empty(work_.path()));
  ExpectEnd({"dataset", "export", Dataset(), "--to", "nerfstudio", "--undistort", "always", "--frames", "all", "--out",
             work_ / "export"},
            SIGTERM, std::chrono::milliseconds(50));
  EXPECT_FALSE(fs::exists(work_ / "export"));
}

TEST_F(Signals, TrainingEnds) {
  if (RunCli({"version", "--json"}).Json()["metrics"]["avatar"] != true) GTEST_SKIP() << "built without avatars";
  ExpectEnd({"avatar", "train", Dataset(), "--out", work_ / "run", "--steps", "100000", "--size", "64"}, SIGINT,
            std::chrono::seconds(3));
}

TEST_F(Signals, ASecondOneEndsAtOnce) {
  std::vector<std::string> words = {"calibrate", "--session", Studio(), "--model", "splined", "--out", work_ / "calib"};
  Running program(words, streams_);
  ASSERT_TRUE(WaitUntil([&] { return program.Listens() || program.HasEnded(); }));
  std::this_thread::sleep_for(std::chrono::seconds(6));
  ASSERT_FALSE(program.HasEnded());
  program.Send(SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  program.Send(SIGINT);
  ASSERT_TRUE(program.Await(kBound));
  EXPECT_EQ(program.Result().exit, 130);
  EXPECT_THAT(program.Result().err, HasSubstr("error: interrupted"));
  EXPECT_THAT(Leftovers(work_.path()), ::testing::IsEmpty());
}

TEST_F(Signals, AHangUpIsIgnoredWhereItWasIgnoredBefore) {
  const std::vector<std::string> words = {
      "synth",     "--out", work_ / "short",  "--cameras", "2", "--size", "160x120", "--take-frames", "30",
      "--threads", "1",     "--board-frames", "30"};
  Running program(words, streams_, [] { signal(SIGHUP, SIG_IGN); });
  ASSERT_TRUE(WaitUntil([&] { return !fs::is_empty(work_.path()) || program.HasEnded(); }));
  program.Send(SIGHUP);
  ASSERT_TRUE(program.Await(std::chrono::seconds(100)));
  EXPECT_EQ(program.Result().exit, 0) << program.Result().err;
}

TEST_F(Signals, BlockedAndIgnoredOnesOfTheCallerDoNoHarm) {
  Running program(LongSynth(), streams_, [] {
    sigset_t all;
    sigfillset(&all);
    sigprocmask(SIG_BLOCK, &all, nullptr);
    signal(SIGCHLD, SIG_IGN);
  });
  ASSERT_TRUE(WaitUntil([&] { return !fs::is_empty(work_.path()) || program.HasEnded(); }));
  program.Send(SIGTERM);
  ASSERT_TRUE(program.Await(kBound));
  EXPECT_EQ(program.Result().exit, 143);
}

/// An npm that has started another process, and writes down both numbers.
void WriteFakeNpm(const std::string& folder, const std::string& pids, bool stubborn) {
  fs::create_directory(folder);
  std::ofstream(folder + "/npm") << "#!/bin/sh\n"
                                 << (stubborn ? "trap '' TERM\n" : "") << "sleep 60 &\necho $$ $! > " << pids << ".part; mv "
                                 << pids << ".part " << pids << "\nwait\nsleep 60\n";
  fs::permissions(folder + "/npm", fs::perms::owner_all);
}

TEST_F(Signals, FetchingModelsEndsWithNpmAndWhatItStarted) {
  if (RunCli({"version", "--json"}).Json()["metrics"]["avatar"] != true) GTEST_SKIP() << "built without models";
  for (const bool stubborn : {false, true}) {
    const TempDir folder;
    WriteFakeNpm(folder / "bin", folder / "pids", stubborn);
    Running program({"models", "fetch", "--dir", folder / "models"}, streams_,
                    [&] { setenv("PATH", ((folder / "bin") + ":/usr/bin:/bin").c_str(), 1); });
    ASSERT_TRUE(WaitUntil([&] { return fs::exists(folder / "pids") || program.HasEnded(); }));
    program.Send(SIGINT);
    ASSERT_TRUE(program.Await(kBound));
    EXPECT_EQ(program.Result().exit, 130) << program.Result().err;
    EXPECT_THAT(program.Result().err, HasSubstr("error: interrupted"));
    std::ifstream in(folder / "pids");
    std::string npm, other;
    in >> npm >> other;
    EXPECT_FALSE(other.empty());
    EXPECT_FALSE(Runs(npm));
    EXPECT_FALSE(Runs(other));
    EXPECT_THAT(Leftovers(folder / "models"), ::testing::IsEmpty());
  }
}

}  // namespace
}  // namespace mvstudio::testing
