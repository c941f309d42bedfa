#include <array>
#include <filesystem>
#include <memory>
#include <set>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/running_cli.h"
#include "tests/support/test.h"

/// Commands that run this program again end with all that they have started.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

/// Processes that run one of the two programs on `folder`, which no other test knows; without the first.
std::set<std::string> Others(const std::string& folder, const std::string& first) {
  std::set<std::string> found;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string pid = entry.path().filename().string();
    if (pid.find_first_not_of("0123456789") != std::string::npos || pid == first) continue;
    if (Mentions(Slurp(entry.path().string() + "/cmdline"), folder) && Runs(pid)) found.insert(pid);
  }
  return found;
}

class AvatarSignals : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    data_ = new TempDir();
    avatar::WriteMannequinDataset(*data_ / "data", 4, 12, 96);
  }
  static void TearDownTestSuite() { delete data_; }
  static std::string Data() { return *data_ / "data"; }

  /// Sends a signal to the first process alone, once another one works beside it and `ready` holds.
  void ExpectAllEnd(const Words& words, int number, const std::function<bool()>& ready) {
    Running program(words, streams_);
    std::set<std::string> others;
    ASSERT_TRUE(WaitUntil([&] {
      others = Others(work_.path(), program.Pid());
      return (!others.empty() && ready()) || program.HasEnded();
    }));
    ASSERT_FALSE(program.HasEnded()) << "before the signal: " << program.Result().err;
    program.Send(number);
    ASSERT_TRUE(program.Await(kBound)) << "does not end";
    EXPECT_EQ(program.Result().exit, 128 + number) << program.Result().err;
    EXPECT_THAT(program.Result().err, HasSubstr("error: interrupted"));
    for (const std::string& pid : others) EXPECT_TRUE(WaitUntil([&] { return !Runs(pid); })) << pid;
  }

  /// A network that takes its steps quickly, saved every second one.
  static Words SmallTraining(const std::string& out, const std::string& steps) {
    Words words = {"avatar", "train", Data(), "--out", out, "--steps", steps, "--no-fit-shape"};
    words.insert(words.end(),
                 {"--size", "32", "--width", "4", "--downs", "2", "--encoder-blocks", "1", "--decoder-blocks", "1"});
    words.insert(words.end(), {"--init-steps", "4", "--save-every", "2"});
    return words;
  }

  TempDir work_, streams_;

 private:
  static TempDir* data_;
};
TempDir* AvatarSignals::data_ = nullptr;

TEST_F(AvatarSignals, EndingTheFirstRankEndsTheOthers) {
  for (const int number : {SIGINT, SIGTERM}) {
    const std::string out = work_ / std::to_string(number);
    Words words = SmallTraining(out, "100000");
    words.insert(words.end(), {"--ranks", "2", "--threads", "2"});
    ExpectAllEnd(words, number, [&] { return fs::exists(out + "/checkpoint.safetensors"); });
  }
}

TEST_F(AvatarSignals, RanksThatSrunStartedStopTogetherAndGoOnToTheSameBytes) {
  const std::vector<std::unique_ptr<TempDir>> streams = [] {
    std::vector<std::unique_ptr<TempDir>> made;
    for (int rank = 0; rank < 2; ++rank) made.push_back(std::make_unique<TempDir>());
    return made;
  }();
  const auto start = [&](int rank, const Words& words, const char* restarts) {
    Words all = words;
    all.insert(all.end(), {"--rendezvous", "slurm", "--threads", "1"});
    return std::make_unique<Running>(all, *streams[static_cast<size_t>(rank)], [rank, restarts] {
      for (const auto& [name, value] :
           {std::pair("SLURM_JOB_ID", "7"), std::pair("SLURM_STEP_ID", "0"), std::pair("SLURM_NTASKS", "2"),
            std::pair("SLURM_STEP_NUM_NODES", "1"), std::pair("SLURM_RESTART_COUNT", restarts)})
        setenv(name, value, 1);
      setenv("SLURM_PROCID", std::to_string(rank).c_str(), 1);
    });
  };
  const auto train = [&](const std::string& out) { return SmallTraining(out, "600"); };
  const auto both_end = [&](const Words& words, const char* restarts, int number, const std::string& checkpoint) {
    const std::array<std::unique_ptr<Running>, 2> ranks = {start(0, words, restarts), start(1, words, restarts)};
    if (number > 0) {
      EXPECT_TRUE(WaitUntil([&] { return fs::exists(checkpoint) || ranks[0]->HasEnded(); }));
      ranks[1]->Send(number);  // one hears it, both stop
    }
    std::array<int, 2> exits{};
    for (size_t rank = 0; rank < 2; ++rank) {
      EXPECT_TRUE(ranks[rank]->Await(std::chrono::seconds(100)));
      exits[rank] = ranks[rank]->Result().exit;
      EXPECT_THAT(exits[rank], ::testing::AnyOf(0, 75)) << ranks[rank]->Result().err;
    }
    return exits;
  };
  const std::string whole = work_ / "whole", file = "/checkpoint.safetensors";
  EXPECT_THAT(both_end(train(whole), "0", 0, ""), ::testing::Each(0));
  for (const int number : {SIGUSR1, SIGTERM}) {
    const std::string cut = work_ / std::to_string(number);
    EXPECT_THAT(both_end(train(cut), "0", number, cut + file), ::testing::Each(75));
    ASSERT_TRUE(fs::exists(cut + file));
    EXPECT_NE(Slurp(cut + file), Slurp(whole + file)) << "it was cut before its end";
    EXPECT_THAT(both_end({"avatar", "resume", cut}, "1", 0, ""), ::testing::Each(0));
    EXPECT_EQ(Slurp(cut + file), Slurp(whole + file));
  }
  for (const auto& entry : fs::directory_iterator(work_.path()))
    EXPECT_FALSE(Mentions(entry.path().string(), ".ranks-")) << entry.path();
  EXPECT_EQ(RunCli({"avatar", "resume", whole, "--rendezvous", "slurm"}, "env -u SLURM_JOB_ID ").exit, 2) << "no srun";
}

TEST_F(AvatarSignals, EndingATradeoffEndsTheTrainingThatItRuns) {
  const std::string out = work_ / "out";
  ExpectAllEnd(
      {"tradeoff",   "avatar",    Data(),
       "--out",      out,         "--widths",
       "4",          "--sizes",   "32",
       "--steps",    "100000",    "--losses",
       "l1+ssim",    "--cameras", "2",
       "--features", "gabor",     "--holdout-cameras",
       "00_03",      "--train",   "--downs 2 --encoder-blocks 1 --decoder-blocks 1 --no-fit-shape --validate-pictures 0"},
      SIGTERM, [] { return true; });
}

TEST_F(AvatarSignals, ATradeoffNamesTheTrainingThatFailsAndWhy) {
  const CliRun run =
      RunCli({"tradeoff", "avatar",  Data(),      "--out",    work_ / "out", "--widths",  "4", "--sizes",
              "32",       "--steps", "3",         "--losses", "l1",          "--cameras", "2", "--holdout-cameras",
              "00_03",    "--train", "--batch x", "--json"});
  EXPECT_EQ(run.exit, 3) << run.err;
  const std::string text = run.Json()["errors"][0]["text"].get<std::string>();
  EXPECT_THAT(text, HasSubstr("`mvstudio avatar train " + Data()));
  EXPECT_THAT(text, HasSubstr("--batch x` ended with 2: "));
}

}  // namespace
}  // namespace mvstudio::testing
