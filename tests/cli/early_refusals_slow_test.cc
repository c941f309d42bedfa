#include <map>
#include <regex>
#include <set>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// What a command cannot do in the end it refuses first: before it looks for inputs that are not there, with the words of
/// docs/cli.md for its arguments. And the example that ends each help can be typed.
namespace mvstudio::testing {
namespace {

/// Values that the parser takes; everything else is a path that leads nowhere.
const std::map<std::string, std::string> kValues = {
    {"--units", "mm"}, {"BOARD", "chessboard:9x6:25mm"}, {"--to", "csv"}, {"--serial", "1"}, {"--camera", "cam1"}};

struct Section {
  std::string command;
  std::vector<std::string> required;
  std::set<std::string> options;
  std::string example;
};

std::vector<Section> Sections() {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  std::istringstream lines(Slurp(std::string(source ? source : ".") + "/docs/cli.md"));
  const std::string heading = "### mvstudio ";
  const std::regex option("^ {6}(-h,)?((--)?[A-Za-z0-9-]+).*");
  std::vector<Section> sections;
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(heading, 0) == 0) {
      sections.push_back({line.substr(heading.size()), {}, {}, ""});
    } else if (!sections.empty() && std::regex_match(line, match, option)) {
      const std::string name = match[2];
      sections.back().options.insert(name);
      if (line.find(" REQUIRED") == std::string::npos || name == "--out") continue;
      const auto value = kValues.find(name);
      if (name[0] == '-') sections.back().required.push_back(name);
      sections.back().required.push_back(value == kValues.end() ? "nowhere" : value->second);
    } else if (!sections.empty() && line.rfind("    Example: mvstudio ", 0) == 0) {
      sections.back().example = line.substr(std::string("    Example: mvstudio ").size());
    }
  }
  return sections;
}

CliRun RunWith(const Section& section, const std::vector<std::string>& more) {
  std::vector<std::string> words = WordsOf(section.command);
  words.insert(words.end(), section.required.begin(), section.required.end());
  words.insert(words.end(), more.begin(), more.end());
  return RunCli(words);
}

bool Knows(const Section& section) { return RunCli(WordsOf(section.command + " --help")).exit == 0; }

TEST(EarlyRefusals, ADeviceThatIsNotThere) {
  size_t count = 0;
  for (const Section& section : Sections()) {
    if (section.options.count("--device") == 0 || !Knows(section)) continue;
    std::vector<std::string> more = {"--device", "cuda"};
    if (section.options.count("--out") > 0) more.insert(more.end(), {"--out", "new"});
    const CliRun run = RunWith(section, more);
    if (run.exit != 8 && count == 0) GTEST_SKIP() << "a GPU is here, or " << run.err;
    EXPECT_EQ(run.exit, 8) << section.command << ": " << run.err;
    EXPECT_TRUE(Mentions(run.err, "finds no GPU here")) << section.command << ": " << run.err;
    ++count;
  }
  EXPECT_GE(count, 4u);
}

TEST(EarlyRefusals, AnOutputThatCannotBeWritten) {
  size_t count = 0;
  for (const Section& section : Sections()) {
    if (section.options.count("--out") == 0 || !Knows(section)) continue;
    const CliRun run = RunWith(section, {"--out", "/proc/nowhere/out"});
    EXPECT_EQ(run.exit, 3) << section.command << ": " << run.err;
    EXPECT_TRUE(Mentions(run.err, "cannot create folder")) << section.command << ": " << run.err;
    ++count;
  }
  EXPECT_GE(count, 25u);
}

TEST(EarlyRefusals, ExamplesCanBeTyped) {
  size_t count = 0;
  for (const Section& section : Sections()) {
    if (!Knows(section)) continue;
    std::vector<std::string> words = WordsOf(section.example);
    EXPECT_FALSE(words.empty()) << section.command;
    words.push_back("--no-such-flag");  // what the parser says last, when all else is right
    const CliRun run = RunCli(words);
    EXPECT_TRUE(Mentions(run.err, "unknown flag '--no-such-flag'")) << section.example << ": " << run.err;
    ++count;
  }
  EXPECT_GE(count, 30u);
}

}  // namespace
}  // namespace mvstudio::testing
