#include "tests/support/run_cli.h"
#include "tests/support/test.h"

namespace mvstudio::testing {
namespace {

const char* const kCommands[] = {"demo",          "synth",        "calibrate",     "calib convert", "calib show",
                                 "calib compare", "calib eval",   "triangulate",   "dataset build", "dataset verify",
                                 "dataset info",  "avatar train", "avatar resume", "avatar eval",   "avatar info",
                                 "metrics",       "report",       "version"};

bool HasAvatar() { return RunCli({"version", "--json"}).Json()["metrics"]["avatar"] == true; }

TEST(Contract, VersionGivesOneObjectWithEveryKey) {
  const CliRun run = RunCli({"version", "--json"});
  EXPECT_EQ(run.exit, 0);
  const nlohmann::json json = run.Json();
  ASSERT_TRUE(json.is_object()) << run.out;
  EXPECT_EQ(json["schema"], "mvstudio.result/1");
  EXPECT_EQ(json["command"], "version");
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["exit"], 0);
  for (const char* key : {"version", "metrics", "outputs", "warnings", "errors", "timing"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_GT(json["timing"]["peak_rss_mb"].get<double>(), 1);
}

TEST(Contract, EveryCommandHasHelp) {
  const bool avatar = HasAvatar();
  for (const std::string command : kCommands) {
    if (!avatar && (command.rfind("avatar", 0) == 0 || command == "demo" || command == "metrics")) continue;
    std::vector<std::string> words = WordsOf(command);
    words.push_back("--help");
    const CliRun run = RunCli(words);
    EXPECT_EQ(run.exit, 0) << command;
    EXPECT_THAT(run.out, ::testing::HasSubstr("--help")) << command;
    EXPECT_THAT(run.out, ::testing::HasSubstr(WordsOf(command).back())) << command;
  }
}

TEST(Contract, VersionAsAFlag) {
  const CliRun run = RunCli({"--version"});
  EXPECT_EQ(run.exit, 0);
  EXPECT_THAT(run.out, ::testing::MatchesRegex("mvstudio [0-9.]+\n"));
}

TEST(Contract, HelpShowsWhatChangesADefault) {
  const std::string help = RunCli({"dataset", "build", "--help-all"}).out;
  EXPECT_THAT(help, ::testing::HasSubstr("  --no-masks   "));
  EXPECT_THAT(help, ::testing::HasSubstr("  --png "));
  EXPECT_THAT(help, ::testing::Not(::testing::HasSubstr("{false}")));
}

// Whatever writes files can be asked to replace older ones.
TEST(Contract, CommandsWithAnOutputHaveOverwrite) {
  const bool avatar = HasAvatar();
  for (const std::string command : kCommands) {
    if (!avatar && (command.rfind("avatar", 0) == 0 || command == "demo" || command == "metrics")) continue;
    std::vector<std::string> words = WordsOf(command);
    words.push_back("--help-all");
    const std::string help = RunCli(words).out;
    if (help.find(" --out ") == std::string::npos || command == "report") continue;
    EXPECT_THAT(help, ::testing::HasSubstr("--overwrite")) << command;
  }
}

TEST(Contract, GlobalFlagsMayStandAnywhere) {
  EXPECT_TRUE(RunCli({"--json", "version"}).Json().is_object());
  EXPECT_TRUE(RunCli({"version", "--json"}).Json().is_object());
}

TEST(Contract, UnknownFlagsAndCommandsAreUsageErrorsInJsonToo) {
  for (const auto& words :
       {WordsOf("version --nonsense --json"), WordsOf("nonsense --json"), WordsOf("--json"), WordsOf("calib --json")}) {
    const CliRun run = RunCli(words);
    EXPECT_EQ(run.exit, 2) << run.err;
    const nlohmann::json json = run.Json();
    ASSERT_TRUE(json.is_object()) << run.out;
    EXPECT_EQ(json["status"], "error");
    EXPECT_EQ(json["exit"], 2);
    EXPECT_FALSE(json["errors"].empty());
  }
}

TEST(Contract, ErrorsAreOneLineOnStderr) {
  const CliRun run = RunCli({"calib", "show", "/does/not/exist.json"});
  EXPECT_EQ(run.exit, 3);
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_THAT(run.err, ::testing::HasSubstr("/does/not/exist.json"));
  EXPECT_EQ(run.out, "");
}

}  // namespace
}  // namespace mvstudio::testing
