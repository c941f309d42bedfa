#include <filesystem>
#include <fstream>
#include <set>

#include "core/format.h"
#include "dataset/session/session.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// calibrate on a session in which one camera dropped three frames and numbered on, as recorders do.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 48;
const std::set<int> kDropped = {9, 22, 35};

class CalibrateSession : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    studio_ = std::make_unique<TempDir>();
    const CliRun made = RunCli({"synth", "--out", *studio_ / "s", "--cameras", "4", "--board-frames", std::to_string(kFrames),
                                "--take-frames", "0", "--format", "png", "--size", "480x360", "--seed", "5"});
    ASSERT_EQ(made.exit, 0) << made.err;
    complete_ = Calibrate("complete");
    const dataset::Session session = dataset::ReadSession(*studio_ / "s");
    std::ofstream stamps(*studio_ / "s/raw/board.csv");
    stamps << "camera,frame,time_s\n";
    for (size_t c = 0; c < session.cameras.size(); ++c) Record(session.cameras[c].name, c == 1, &stamps);
  }
  static void TearDownTestSuite() { studio_.reset(); }

  /// The time stamps of one camera; where it drops frames the others move up in its numbering.
  static void Record(const std::string& camera, bool drops, std::ostream* stamps) {
    int number = 0;
    for (int step = 0; step < kFrames; ++step) {
      const auto image = [&](int n) { return *studio_ / ("s/raw/board/" + camera + Format("/%08d.png", n)); };
      if (drops && kDropped.count(step)) {
        fs::remove(image(step));
        continue;
      }
      if (number != step) fs::rename(image(step), image(number));
      *stamps << camera << "," << number << "," << Format("%.6f", 50 + step / 30.0) << "\n";
      ++number;
    }
  }

  static dataset::Session Read() { return dataset::ReadSession(*studio_ / "s"); }
  static void NameTimestamps(const std::string& path) {
    dataset::Session session = Read();
    for (dataset::SessionTake& take : session.takes) take.timestamps = path;
    dataset::WriteSession(session);
  }
  static nlohmann::json Calibrate(const std::string& name) {
    const CliRun run = RunCli({"calibrate", "--session", *studio_ / "s", "--out", *studio_ / name, "--cache",
                               *studio_ / "cache", "--model", "brown4", "--json"});
    EXPECT_TRUE(run.exit == 0 || run.exit == 4) << run.out << run.err;
    return run.Json();
  }

  static double Rejected(const nlohmann::json& result) { return result["metrics"]["rejected_fraction"].get<double>(); }

  static std::unique_ptr<TempDir> studio_;
  static nlohmann::json complete_;  ///< of the recording before frames were dropped
};

std::unique_ptr<TempDir> CalibrateSession::studio_;
nlohmann::json CalibrateSession::complete_;

TEST_F(CalibrateSession, BoardsArePairedByTimeWhereItIsKnown) {
  const auto by_number = Calibrate("number");
  EXPECT_EQ(by_number["metrics"]["pairing"]["by"], "number");
  EXPECT_GT(Rejected(by_number), Rejected(complete_) + 0.1);
  EXPECT_THAT(by_number.dump(), HasSubstr("session timeline"));

  NameTimestamps("raw/board.csv");
  const auto by_time = Calibrate("time");
  EXPECT_EQ(by_time["metrics"]["pairing"], nlohmann::json::parse(R"({"by": "time", "clock": "common", "reference": ")" +
                                                                 Read().cameras[0].name + R"(", "dropped": 3})"));
  EXPECT_NEAR(Rejected(by_time), Rejected(complete_), 0.01);
  std::printf("rejected: %.2f %% before frames were dropped, then %.2f %% by number, %.2f %% by time\n",
              100 * Rejected(complete_), 100 * Rejected(by_number), 100 * Rejected(by_time));

  // Without a session, the table is named on the command line.
  NameTimestamps("");
  std::vector<std::string> words = {"calibrate", "--board",          Read().board, "--out",  *studio_ / "table",
                                    "--cache",   *studio_ / "cache", "--model",    "brown4", "--json"};
  for (const dataset::SessionCamera& camera : Read().cameras) {
    words.push_back("--camera");
    words.push_back(camera.name + "=" + *studio_ / ("s/raw/board/" + camera.name));
  }
  const auto untimed = RunCli(words).Json();
  EXPECT_EQ(untimed["metrics"]["pairing"]["by"], "number");
  EXPECT_THAT(untimed.dump(), HasSubstr("--timestamps FILE"));
  words.insert(words.end(), {"--timestamps", *studio_ / "s/raw/board.csv", "--overwrite"});
  EXPECT_EQ(RunCli(words).Json()["metrics"]["rms_px"], by_time["metrics"]["rms_px"]);
  NameTimestamps("raw/board.csv");

  // A written timeline is used though the table of times is gone.
  ASSERT_EQ(RunCli({"session", "timeline", *studio_ / "s", "--take", "board"}).exit, 0);
  NameTimestamps("");
  const auto written = Calibrate("written");
  EXPECT_EQ(written["metrics"]["pairing"], by_time["metrics"]["pairing"]);
  EXPECT_EQ(written["metrics"]["rejected_fraction"], by_time["metrics"]["rejected_fraction"]);
  EXPECT_EQ(written["metrics"]["rms_px"], by_time["metrics"]["rms_px"]);
}

TEST_F(CalibrateSession, ACheckOfItsCalibrationLeavesATrace) {
  const auto check = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {
        "calib", "eval", *studio_ / "complete/calibration.json", "--session", *studio_ / "s", "--cache", *studio_ / "cache"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  };
  const CliRun first = check({"--out", *studio_ / "check"});
  ASSERT_EQ(first.exit, 0) << first.out << first.err;
  const auto kept = nlohmann::json::parse(Slurp(*studio_ / "check/calib_eval.result.json"));
  EXPECT_EQ(kept["metrics"]["cameras"].size(), 4u);
  EXPECT_TRUE(fs::exists(*studio_ / "check/provenance.jsonl"));
  EXPECT_EQ(check({"--out", *studio_ / "check"}).exit, 0) << "nothing changed";
  EXPECT_EQ(check({"--out", *studio_ / "check", "--seed", "2"}).exit, 2) << "last month's check stays";
  EXPECT_EQ(check({"--out", *studio_ / "check", "--overwrite"}).exit, 0);
  ASSERT_EQ(RunCli({"report", *studio_ / "check"}).exit, 0);
  EXPECT_THAT(Slurp(*studio_ / "check/report.html"), HasSubstr("calib eval"));
  const CliRun same = RunCli({"calib", "compare", *studio_ / "complete/calibration.json",
                              *studio_ / "complete/calibration.json", "--out", *studio_ / "change"});
  EXPECT_EQ(same.exit, 0) << same.err;
  EXPECT_TRUE(fs::exists(*studio_ / "change/calib_compare.result.json"));
  const CliRun none = RunCli({"calib", "eval", "--board", "chessboard:5x4:25mm", "--corners", "nowhere"});
  EXPECT_EQ(none.exit, 2);
  EXPECT_THAT(none.err, HasSubstr("--session"));
}

}  // namespace
}  // namespace mvstudio::testing
