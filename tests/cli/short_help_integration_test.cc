#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

namespace mvstudio::testing {
namespace {

using Subjects = std::map<std::string, std::set<std::string>>;

/// The options under each heading of a help text.
Subjects SubjectsOf(const std::string& help) {
  Subjects subjects;
  std::istringstream in(help);
  std::string subject;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line[0] != ' ') subject = line.back() == ':' ? line.substr(0, line.size() - 1) : "";
    const bool is_option = line.size() > 3 && line.substr(0, 2) == "  " && line[2] != ' ';
    if (is_option && !subject.empty()) subjects[subject].insert(line.substr(2, line.find(' ', 2) - 2));
  }
  return subjects;
}

/// The whole help of each command, as docs/cli.md has it: the test cli/docs holds that page against the program.
const std::map<std::string, std::string>& AllHelp() {
  static const auto* const kHelp = [] {
    auto* help = new std::map<std::string, std::string>;
    const char* source = std::getenv("MVSTUDIO_SOURCE");
    std::ifstream page(std::string(source ? source : ".") + "/docs/cli.md");
    const std::string head = "### mvstudio", indent = "    ";
    std::string command;
    for (std::string line; std::getline(page, line);) {
      if (line.rfind(head, 0) == 0) {
        command = line.substr(head.size());
      } else if (!command.empty()) {
        (*help)[command] += (line.rfind(indent, 0) == 0 ? line.substr(indent.size()) : line) + "\n";
      }
    }
    return help;
  }();
  return *kHelp;
}

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
    EXPECT_LE(std::count(brief.out.begin(), brief.out.end(), '\n'), 35);
    const Subjects shown = SubjectsOf(brief.out), every = SubjectsOf(all.out);
    size_t num_shown = 0, num_every = 0;
    for (const auto& [subject, options] : every) num_every += options.size();
    for (const auto& [subject, options] : shown) {
      num_shown += options.size();
      ASSERT_EQ(every.count(subject), 1u) << subject;
      for (const std::string& option : options) EXPECT_EQ(every.at(subject).count(option), 1u) << subject << " " << option;
    }
    EXPECT_TRUE(Mentions(brief.out, std::to_string(num_every - num_shown) + " more with --help-all"));
  }
}

TEST(ShortHelp, EveryOptionOfALongCommandHasASubject) {
  size_t num_long = 0;
  for (const auto& [command, help] : AllHelp()) {
    const Subjects subjects = SubjectsOf(help);
    size_t count = 0;
    for (const auto& [subject, options] : subjects) count += subject == "Positionals" ? 0 : options.size();
    if (count <= 30) continue;
    ++num_long;
    EXPECT_THAT(subjects.at("Options"), ElementsAre("-h,--help")) << command;
    EXPECT_GE(subjects.size(), 4u) << command;
    for (const auto& [subject, options] : subjects) EXPECT_LE(options.size(), 20u) << command << ": " << subject;
  }
  EXPECT_GE(num_long, 5u) << "the commands and their options were not found";
}

std::string LastLine(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

TEST(ShortHelp, EndsWithAnExample) {
  for (const auto& [command, help] : AllHelp())
    EXPECT_EQ(LastLine(help).rfind("Example: mvstudio" + command, 0), 0u) << command << ": " << LastLine(help);
  EXPECT_GE(AllHelp().size(), 30u);
  EXPECT_EQ(LastLine(RunCli({"markers", "--help"}).out).rfind("Example: mvstudio markers pose3d", 0), 0u);
}

TEST(ShortHelp, IsAsWideAsTheTerminal) {
  const std::string whole = RunCli({"calibrate", "--help"}).out;
  const std::string narrow = RunCli({"calibrate", "--help"}, "COLUMNS=80 ").out;
  std::istringstream lines(narrow);
  for (std::string line; std::getline(lines, line);) {
    const bool one_word = line.size() > 30 && line.find(' ', 30) == std::string::npos;
    const auto width = std::count_if(line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) >> 6 != 2; });
    EXPECT_TRUE(width <= 80 || one_word || line.rfind("Example: ", 0) == 0) << line;
  }
  EXPECT_EQ(WordsOf(narrow), WordsOf(whole)) << "the same words";
  EXPECT_NE(narrow, whole);
}

TEST(ShortHelp, ACommandWithFewOptionsShowsThemAll) {
  EXPECT_EQ(RunCli({"sync", "--help"}).out, RunCli({"sync", "--help-all"}).out);
  EXPECT_TRUE(Mentions(RunCli({"--help"}).out, "--help-all"));
}

}  // namespace
}  // namespace mvstudio::testing
