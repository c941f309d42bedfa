#include <sys/mount.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// `mvstudio dataset pack` on the recorded person.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::string> Content(const std::string& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().filename() != ".mvstudio.json") content[entry.path().filename().string()] = Slurp(entry.path().string());
  return content;
}

std::vector<std::string> Pack(const std::string& out, const std::vector<std::string>& more, const std::string& frames = "0-11",
                              const std::string& crop = "96") {
  std::vector<std::string> words = {"dataset", "pack", DataRoot() + "/person_a", "--out", out,     "--frames", frames,
                                    "--crop",  crop,   "--shard-samples",        "40",    "--json"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(DatasetPack, SharesMergesAndReruns) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  const CliRun whole = RunCli(Pack(folder / "whole", {"--single", folder / "one.h5"}));
  ASSERT_EQ(whole.exit, 0) << whole.err;
  const auto metrics = whole.Json()["metrics"];
  EXPECT_EQ(metrics["shards"], 3);
  EXPECT_EQ(metrics["samples"], 120);
  EXPECT_EQ(metrics["complete"], true);
  EXPECT_GT(metrics["times"]["decode_s"], 0);
  EXPECT_TRUE(fs::exists(folder / "one.h5"));
  EXPECT_EQ(RunCli(Pack(folder / "shared", {"--shard", "0/2"})).exit, 0);
  const CliRun early = RunCli({"dataset", "pack", "--out", folder / "shared", "--merge"});
  EXPECT_EQ(early.exit, 3);
  EXPECT_THAT(early.err, HasSubstr("lacks 1 of 3 shards (1)"));
  EXPECT_EQ(RunCli(Pack(folder / "shared", {"--shard", "1/2", "--threads", "1"})).exit, 0);
  EXPECT_EQ(RunCli({"dataset", "pack", "--out", folder / "shared", "--merge"}).exit, 0);
  EXPECT_EQ(Content(folder / "whole"), Content(folder / "shared"));
  const CliRun again = RunCli(Pack(folder / "shared", {}));
  EXPECT_EQ(again.Json()["metrics"]["kept"].size(), 3u);
}

TEST(DatasetPack, AnotherReaderGetsTheSame) {
  MVS_NEEDS_DATA("person_a");
  if (std::system("/usr/bin/python3 -c 'import h5py, numpy' 2>/dev/null") != 0) GTEST_SKIP() << "needs python3-h5py";
  const TempDir folder;
  ASSERT_EQ(RunCli(Pack(folder / "pack", {})).exit, 0);
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const std::string script = std::string(source ? source : ".") + "/tests/clients/pack_reader.py";
  const std::string line =
      "/usr/bin/python3 " + ShellQuote(script) + " " + ShellQuote(folder / "pack") + " >" + ShellQuote(folder / "out");
  ASSERT_EQ(std::system(line.c_str()), 0);
  const auto found = nlohmann::json::parse(Slurp(folder / "out"));
  EXPECT_EQ(found["samples"], 120);
  EXPECT_EQ(found["bad_crc"], 0);
  EXPECT_EQ(found["bad_size"], 0);
  EXPECT_GT(found["joints"], 2000);
  EXPECT_LT(found["max_joint_error_px"], 1e-9);
}

TEST(DatasetPack, ExitCodes) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  EXPECT_EQ(RunCli({"dataset", "pack", "--out", folder / "a"}).exit, 2) << "no dataset";
  EXPECT_EQ(RunCli(Pack(folder / "a", {"--shard", "2/2"})).exit, 2);
  EXPECT_EQ(RunCli(Pack(folder / "a", {"--shard", "1"})).exit, 2);
  EXPECT_EQ(RunCli(Pack(folder / "a", {"--codec", "webp"})).exit, 2);
  EXPECT_EQ(RunCli(Pack(folder / "a", {"--cameras", "00_77"})).exit, 2);
  EXPECT_EQ(RunCli(Pack(folder / "a", {"--undistort"})).exit, 2);
  EXPECT_EQ(RunCli({"dataset", "pack", folder / "none", "--out", folder / "a"}).exit, 3);
  EXPECT_EQ(RunCli({"dataset", "pack", "--out", folder / "none", "--merge"}).exit, 3);
  EXPECT_FALSE(fs::exists(folder / "a"));
}

TEST(DatasetPack, TradeoffComparesPacksWithTheFolder) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  const CliRun run =
      RunCli({"tradeoff", "pack", DataRoot() + "/person_a", "--frames", "1", "--codecs", "raw,jpeg:90", "--crops", "64,96",
              "--threads-list", "1", "--seconds", "0.05", "--out", folder / "out", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto metrics = run.Json()["metrics"];
  ASSERT_EQ(metrics["trials"].size(), 8u) << "two ways to read the folder and two packs, for each size";
  EXPECT_EQ(metrics["trials"][2]["codec"], "raw");
  EXPECT_EQ(metrics["trials"][2]["exact"], true);
  EXPECT_GT(metrics["trials"][3]["psnr_db"], 25);
  EXPECT_LT(metrics["trials"][3]["bytes_per_crop"], metrics["trials"][2]["bytes_per_crop"]);
  EXPECT_EQ(metrics["builds"].size(), 4u);
  const std::string page = Slurp(folder / "out/tradeoff-pack.html");
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("pack jpeg:90"));
  for (const auto& entry : fs::directory_iterator(folder / "out")) {
    EXPECT_EQ(entry.path().filename().string().find(".mvstudio-"), std::string::npos) << "the packs are removed";
  }
  EXPECT_EQ(RunCli({"tradeoff", "pack", DataRoot() + "/person_a", "--crops", "3", "--out", folder / "x"}).exit, 2);
  EXPECT_EQ(RunCli({"tradeoff", "pack", DataRoot() + "/person_a", "--codecs", "webp", "--out", folder / "x"}).exit, 2);
  EXPECT_EQ(RunCli({"tradeoff", "pack", folder / "none", "--out", folder / "x"}).exit, 3);
}

TEST(DatasetSplit, WritesChecksAndDescribes) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  const std::string data = DataRoot() + "/person_a", file = folder / "split.json";
  const CliRun made = RunCli({"dataset", "split", data, "--preset", "tna-16", "--guard", "5", "--out", file, "--json"});
  ASSERT_EQ(made.exit, 0) << made.err;
  EXPECT_EQ(made.Json()["metrics"]["train"]["cameras"], 5);
  EXPECT_EQ(made.Json()["metrics"]["unused_frames"], 5);
  const CliRun described = RunCli({"dataset", "split", data, "--describe", file, "--json"});
  EXPECT_EQ(described.Json()["metrics"], made.Json()["metrics"]);
  const CliRun packed = RunCli(Pack(folder / "pack", {"--split", file}, "80-95"));
  EXPECT_EQ(packed.Json()["metrics"]["samples"], 5 * 5 + 5 * 6) << "85 to 89 are the guard band";

  nlohmann::json leaking = nlohmann::json::parse(Slurp(file));
  leaking["test"]["cameras"].push_back(leaking["train"]["cameras"][0]);
  std::ofstream(file) << leaking;
  const CliRun refused = RunCli(Pack(folder / "other", {"--split", file}));
  EXPECT_EQ(refused.exit, 3);
  EXPECT_THAT(refused.err, HasSubstr("train and test share camera 00_00"));
  EXPECT_EQ(RunCli({"dataset", "split", data, "--describe", file}).exit, 3);
  EXPECT_EQ(RunCli({"dataset", "split", data, "--preset", "tna-17", "--out", file}).exit, 2);
  EXPECT_EQ(RunCli({"dataset", "split", data, "--preset", "tna-16"}).exit, 2) << "no --out";
}

TEST(DatasetPack, ASecondWriterIsToldToTryAgain) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  fs::create_directory(folder / "pack");
  const std::string lock = ShellQuote(folder / "pack/.mvstudio.shard-00001.lock");
  const CliRun second = RunCli(Pack(folder / "pack", {}), "flock " + lock + " ");
  EXPECT_EQ(second.exit, 75) << second.err;
  EXPECT_THAT(second.err, HasSubstr("made by someone else: 1"));
  EXPECT_EQ(second.Json()["metrics"]["built"].size(), 2u);
  EXPECT_EQ(RunCli(Pack(folder / "pack", {})).exit, 0) << "the lock file that was left does not matter";
}

TEST(DatasetPack, AFullDiskIsExit7) {
  MVS_NEEDS_DATA("person_a");
  const TempDir folder;
  if (mount("tmpfs", folder.path().c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "needs the right to mount a tmpfs";
  const CliRun first = RunCli(Pack(folder / "small", {"--codec", "jpeg:80"}, "0-1"));
  EXPECT_EQ(first.exit, 0) << first.err;
  const auto before = Content(folder / "small");
  const CliRun full = RunCli(Pack(folder / "pack", {"--codec", "raw"}, "0-11", "256"));
  EXPECT_EQ(full.exit, 7) << full.out;
  EXPECT_THAT(full.err, HasSubstr("No space left on device"));
  EXPECT_EQ(before, Content(folder / "small"));
  umount(folder.path().c_str());
}

}  // namespace
}  // namespace mvstudio::testing
