#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/support/run_cli.h"

namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

std::string Companion() { return CliPath() + "-avatar"; }

class CompanionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(Companion())) GTEST_SKIP() << "a build without libtorch has one program";
  }
};

TEST_F(CompanionTest, OnlyTheCompanionLoadsLibtorch) {
  EXPECT_FALSE(Mentions(Slurp(CliPath()), "libtorch_cpu.so"));
  EXPECT_TRUE(Mentions(Slurp(Companion()), "libtorch_cpu.so"));
}

TEST_F(CompanionTest, BothSayTheSame) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{{},
                                                                                     {"--help"},
                                                                                     {"version"},
                                                                                     {"nonsense"},
                                                                                     {"calibrate", "--nonsense"},
                                                                                     {"tradeoff"},
                                                                                     {"tradeoff", "--help"},
                                                                                     {"tradeoff", "pack", "--help"},
                                                                                     {"tradeoff", "avatar", "--help"},
                                                                                     {"metrics", "--help"},
                                                                                     {"calib"},
                                                                                     {"calib", "shown"},
                                                                                     {"--json", "version"},
                                                                                     {"dataset", "--help"},
                                                                                     {"report"},
                                                                                     {"avatar", "train"}}) {
    const CliRun own = RunCli(words), all = RunProgram(Companion(), words);
    SCOPED_TRACE(words.empty() ? "no words" : words.front());
    EXPECT_EQ(own.exit, all.exit);
    EXPECT_EQ(own.err, all.err);
    const bool timed = !words.empty() && words.front() == "--json";
    EXPECT_TRUE(timed || own.out == all.out) << own.out << all.out;
  }
}

TEST_F(CompanionTest, SaysWhatIsMissingWhenItStandsAlone) {
  TempDir folder;
  const std::string alone = folder.path() + "/mvstudio";
  fs::copy_file(CliPath(), alone);
  const CliRun version = RunProgram(alone, {"version"}), metrics = RunProgram(alone, {"metrics", "a", "b"});
  EXPECT_EQ(version.exit, 0) << version.err;
  EXPECT_EQ(metrics.exit, 8);
  EXPECT_TRUE(Mentions(metrics.err, alone + "-avatar")) << metrics.err;
  EXPECT_EQ(std::count(metrics.err.begin(), metrics.err.end(), '\n'), 1) << metrics.err;
  EXPECT_EQ(metrics.out, "");
  EXPECT_EQ(RunProgram(alone, {"metrics", "a", "b", "--json"}).Json()["exit"], 8);
}

}  // namespace
}  // namespace mvstudio::testing
