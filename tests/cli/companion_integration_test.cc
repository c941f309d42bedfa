#include <algorithm>
#include <filesystem>
#include <sstream>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

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

/// Commands of a help, in its order; `group`: the words before them.
std::vector<std::vector<std::string>> CommandsIn(const std::string& help, const std::vector<std::string>& group) {
  std::istringstream lines(help.substr(std::min(help.size(), help.find("Subcommands:"))));
  std::vector<std::vector<std::string>> commands;
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    if (line.size() < 3 || line.compare(0, 2, "  ") != 0 || line[2] == ' ') continue;
    commands.push_back(group);
    commands.back().push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return commands;
}

/// The list in cli/commands.cc decides who runs what; this one is by hand.
TEST_F(CompanionTest, EachCommandRunsWhereItsLibrariesAre) {
  TempDir folder;
  const std::string alone = folder.path() + "/mvstudio";
  fs::copy_file(CliPath(), alone);
  std::vector<std::vector<std::string>> commands = CommandsIn(RunCli({"--help"}).out, {});
  const auto is_tradeoff = [](const std::vector<std::string>& words) { return words.front() == "tradeoff"; };
  commands.erase(std::remove_if(commands.begin(), commands.end(), is_tradeoff), commands.end());
  for (const auto& words : CommandsIn(RunCli({"tradeoff", "--help"}).out, {"tradeoff"})) commands.push_back(words);
  std::vector<std::string> with_torch, names;
  for (std::vector<std::string> words : commands) {
    names.push_back(words.back());
    words.emplace_back("--help");
    const CliRun own = RunCli(words), all = RunProgram(Companion(), words), single = RunProgram(alone, words);
    SCOPED_TRACE(names.back());
    EXPECT_EQ(own.exit, 0) << own.err;
    EXPECT_EQ(own.out, all.out);
    EXPECT_TRUE(single.exit == 0 || single.exit == 8) << single.err;
    if (single.exit == 8) with_torch.push_back(names.back());
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"demo",        "synth",        "session", "run",     "plan",   "task",      "jobs",
                                      "board",       "calibrate",    "calib",   "models",  "pose2d", "mask",      "sync",
                                      "triangulate", "error-budget", "markers", "dataset", "avatar", "metrics",   "report",
                                      "view",        "render",       "doctor",  "version", "all",    "calibrate", "triangulate",
                                      "pack",        "predictions",  "avatar"}));
  EXPECT_EQ(with_torch,
            (std::vector<std::string>{"demo", "run", "task", "models", "pose2d", "mask", "avatar", "metrics", "avatar"}));
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
