#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/run_cli.h"

namespace mvstudio::testing {
namespace {

TEST(ShortHelp, FitsAScreenAndSaysWhereTheRestIs) {
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{{"calibrate"},
                                                                                       {"calib", "refine"},
                                                                                       {"triangulate"},
                                                                                       {"pose2d"},
                                                                                       {"mask"},
                                                                                       {"dataset", "build"},
                                                                                       {"dataset", "pack"},
                                                                                       {"avatar", "train"}}) {
    std::vector<std::string> words = command;
    words.push_back("--help");
    const CliRun brief = RunCli(words);
    if (brief.exit == 2) continue;  // needs libtorch, and this build has none
    words.back() = "--help-all";
    const CliRun all = RunCli(words);
    SCOPED_TRACE(command.back());
    EXPECT_EQ(brief.exit, 0);
    EXPECT_EQ(all.exit, 0);
    EXPECT_TRUE(Mentions(brief.out, " more with --help-all"));
    EXPECT_TRUE(Mentions(all.out, "More options:"));
    EXPECT_LE(std::count(brief.out.begin(), brief.out.end(), '\n'), 35);
    const size_t shown = brief.out.rfind("\n\n", brief.out.find(" more with"));
    EXPECT_EQ(all.out.find(brief.out.substr(0, shown)), 0u) << "the rest comes after what is always shown";
  }
}

TEST(ShortHelp, ACommandWithFewOptionsShowsThemAll) {
  EXPECT_EQ(RunCli({"sync", "--help"}).out, RunCli({"sync", "--help-all"}).out);
  EXPECT_TRUE(Mentions(RunCli({"--help"}).out, "--help-all"));
}

}  // namespace
}  // namespace mvstudio::testing
