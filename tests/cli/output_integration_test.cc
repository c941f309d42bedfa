#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// What is printed, and what is kept beside the results.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Runs a line of shell in which $MVSTUDIO is the program; stdout of the line is `out`.
CliRun Shell(const std::string& line) {
  const TempDir folder;
  const std::string whole = "MVSTUDIO=" + ShellQuote(CliPath()) + "; { " + line + "; } >" + (folder / "out") + " 2>" +
                            (folder / "err") + " </dev/null";
  const int status = std::system(("bash -c " + ShellQuote(whole)).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Slurp(folder / "out"), Slurp(folder / "err")};
}

/// A small studio whose truth is a valid calibration and dataset input; made once.
class Output : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    const CliRun run = RunCli({"synth", "--out", *folder_ / "studio", "--cameras", "3", "--size", "320x240", "--board-frames",
                               "3", "--take-frames", "6"});
    ASSERT_EQ(run.exit, 0) << run.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string Calibration() { return *folder_ / "studio/truth/calibration.json"; }
  static std::string Studio() { return *folder_ / "studio"; }
  /// Commands that write results and provenance into work_/pose3d.
  std::vector<std::string> Triangulate(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"triangulate", "--calib", Calibration(),   "--skeleton",
                                      "body25",      "--out",   work_ / "pose3d"};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"}) {
      words.insert(words.end(), {"--pose2d", std::string(camera) + "=" + Studio() + "/pose2d/take1/" + camera});
    }
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  json Provenance() const {
    std::ifstream in(work_ / "pose3d/provenance.jsonl");
    std::string line, last;
    while (std::getline(in, line)) last = line;
    return json::parse(last, nullptr, false);
  }

  TempDir work_;

 private:
  static TempDir* folder_;
};
TempDir* Output::folder_ = nullptr;

TEST_F(Output, AFullStdoutIsAnErrorOfEveryKindOfOutput) {
  for (const std::string line : {"version", "version --json", "--help", "calib show --help", "doctor --json"}) {
    const CliRun run = Shell("$MVSTUDIO " + line + " --log-level off >/dev/full");
    EXPECT_EQ(run.exit, 7) << line;
    EXPECT_THAT(run.err, HasSubstr("error: stdout: cannot write: No space left on device")) << line;
  }
  const CliRun show = Shell("$MVSTUDIO calib show " + Calibration() + " >/dev/full");
  EXPECT_EQ(show.exit, 7);
  EXPECT_EQ(show.err, "error: stdout: cannot write: No space left on device\n");
}

TEST_F(Output, AClosedPipeOrStdoutIsOneToo) {
  const CliRun closed_pipe = Shell("( sleep 1; $MVSTUDIO version; echo $? >&2 ) | true");
  EXPECT_THAT(closed_pipe.err, HasSubstr("error: stdout: cannot write: Broken pipe\n7\n"));
  const CliRun closed = Shell("$MVSTUDIO version >&-");
  EXPECT_EQ(closed.exit, 7);
  EXPECT_EQ(closed.err, "error: stdout: cannot write: Bad file descriptor\n");
}

/// With stdout closed, the first file that is opened must not take its place and be printed into.
TEST_F(Output, NothingIsPrintedIntoAnOutputFile) {
  const CliRun run = Shell("$MVSTUDIO calib convert " + Calibration() + " --out " + (work_ / "copy.json") + " >&- 2>&-");
  EXPECT_EQ(run.exit, 7);
  EXPECT_TRUE(json::parse(Slurp(work_ / "copy.json"), nullptr, false).is_object());
}

TEST_F(Output, ResultsWithoutAReaderAreKeptAllTheSame) {
  std::string line = "$MVSTUDIO";
  for (const std::string& word : Triangulate()) line += " " + ShellQuote(word);
  EXPECT_EQ(Shell(line + " >/dev/full").exit, 7);
  EXPECT_EQ(json::parse(Slurp(work_ / "pose3d/triangulate.result.json"), nullptr, false)["exit"], 0);
}

TEST_F(Output, ControlCharactersOfForeignFilesAreNotSentToTheTerminal) {
  json calibration = json::parse(Slurp(Calibration()));
  calibration["gauge"] =
      "tail\x1b[2J\x07 \xc2\x9b"
      "31m \xe2\x80\xae";
  std::ofstream(work_ / "evil.json") << calibration;
  const CliRun run = RunCli({"calib", "show", work_ / "evil.json"});
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("tail?[2J? ?31m ?"));
  for (const char* bad : {"\x1b", "\x07", "\xc2\x9b", "\xe2\x80\xae"}) EXPECT_THAT(run.out, Not(HasSubstr(bad)));
  const CliRun error = RunCli({"calib", "show", "no\x1b[31m\nsuch\x7f\xff"});
  EXPECT_EQ(error.err.find_first_of("\x1b\x7f\xff"), std::string::npos) << error.err;
  EXPECT_EQ(std::count(error.err.begin(), error.err.end(), '\n'), 1) << error.err;
}

TEST_F(Output, AnInputThatCannotBeFingerprintedIsNamedInTheProvenanceAlone) {
  const std::string pose = work_ / "poses";
  fs::copy(Studio() + "/pose2d/take1", pose, fs::copy_options::recursive);
  fs::create_symlink("loop", pose + "/cam_01/loop");
  ASSERT_EQ(mkfifo((pose + "/cam_01/pipe").c_str(), 0600), 0);
  std::vector<std::string> words = Triangulate();
  for (std::string& word : words) {
    const size_t at = word.find(Studio() + "/pose2d/take1");
    if (at != std::string::npos) word = word.substr(0, at) + pose + word.substr(at + Studio().size() + 13);
  }
  const CliRun run = RunCli(words, "timeout 60 ");
  EXPECT_EQ(run.exit, 0) << run.err;
  bool named = false;
  const json provenance = Provenance();
  for (const json& input : provenance["inputs"]) {
    named = named || (input.contains("error") && input["error"].get<std::string>().find("loop") != std::string::npos);
  }
  EXPECT_TRUE(named) << provenance;
}

/// The detectors' corners from `--corners <(cat file)` were read, the calibration was written, and then exit 3.
TEST_F(Output, APipeAsInputIsNotReadAgain) {
  const CliRun run =
      Shell("$MVSTUDIO calib convert <(cat " + Calibration() + ") --from mvstudio --out " + (work_ / "copy.json"));
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.err, Not(HasSubstr("not supported")));
}

TEST_F(Output, AUsersOwnProvenanceFileIsLeftAloneAndNoError) {
  fs::create_directories(work_ / "pose3d");
  std::ofstream(work_ / "pose3d/provenance.jsonl") << "my own notes\n";
  const CliRun run = RunCli(Triangulate({"--json"}));
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["warnings"][0]["code"], "CLI-PROVENANCE") << run.out;
  EXPECT_EQ(Slurp(work_ / "pose3d/provenance.jsonl"), "my own notes\n");
  EXPECT_TRUE(fs::exists(work_ / "pose3d/points.csv"));
  EXPECT_TRUE(fs::exists(work_ / "pose3d/triangulate.result.json"));
}

std::string HostName() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return host;
}

TEST_F(Output, RedactedResultsNameNeitherPlacesNorPeople) {
  const std::string home = "HOME=" + work_.path() + " USER=annabel LOGNAME=annabel ";
  const CliRun run = RunCli(Triangulate({"--json", "--redact"}), home);
  ASSERT_EQ(run.exit, 0) << run.err;
  const json result = run.Json();
  EXPECT_EQ(result["command"], "triangulate");
  EXPECT_EQ(result["outputs"][0]["path"].get<std::string>().rfind("~/pose3d", 0), 0u) << result["outputs"];
  for (const std::string& text : {run.out, Slurp(work_ / "pose3d/triangulate.result.json"), Provenance().dump()}) {
    EXPECT_THAT(text, Not(HasSubstr(work_.path())));
    EXPECT_THAT(text, Not(HasSubstr(Studio())));
    EXPECT_THAT(text, HasSubstr("…/calibration.json"));
    EXPECT_THAT(text, HasSubstr("cam_01=…/cam_01"));
    EXPECT_TRUE(HostName().size() < 4 || text.find(HostName()) == std::string::npos);
  }
  const CliRun failed = RunCli({"calib", "show", work_ / "annabel's rig/none.json", "--json", "--redact"}, home);
  EXPECT_EQ(failed.exit, 3);
  EXPECT_THAT(failed.out, Not(HasSubstr("annabel")));
  EXPECT_THAT(failed.out, HasSubstr("~/user's rig/none.json"));
}

/// A chain, its report among it: no file names the place, the machine or the user.
TEST_F(Output, NoFileOfARedactedChainNamesPlacesOrPeople) {
  const std::string home = "HOME=" + work_.path() + " USER=annabel LOGNAME=annabel ", page = work_ / "client/page.html";
  fs::create_directories(work_ / "client");
  ASSERT_EQ(RunCli(Triangulate({"--redact", "--to", "trc,c3d,bvh", "--frame-rate", "25"}), home).exit, 0);
  ASSERT_EQ(
      RunCli({"calib", "convert", Calibration(), "--to", "panoptic", "--out", work_ / "conv/rig.json", "--redact"}, home).exit,
      0);
  ASSERT_EQ(RunCli({"markers", work_ / "pose3d", "--frame-rate", "25", "--to", "trc", "--out", work_ / "markers of annabel",
                    "--redact"},
                   home)
                .exit,
            0);
  std::vector<std::string> open = Triangulate();  // not redacted: the report does it
  open[6] = work_ / "a b/pose3d";
  ASSERT_EQ(RunCli(open, home).exit, 0);
  const CliRun report = RunCli({"report", work_.path(), "--redact", "--out", page}, home);
  ASSERT_EQ(report.exit, 0) << report.err;
  EXPECT_THAT(Slurp(page), HasSubstr("…/calibration.json</code>")) << "Inputs and outputs with their digests";
  EXPECT_THAT(Slurp(page), HasSubstr("</details>")) << "tags are no paths";
  EXPECT_EQ(json::parse(Slurp(work_ / "client/page.json"))["schema"], "mvstudio.report/1");
  int looked_at = 0;
  for (const auto& entry : fs::recursive_directory_iterator(work_.path())) {
    const std::string path = entry.path().string();
    if (!entry.is_regular_file() || path.find("/a b/") != std::string::npos) continue;
    const std::string text = Slurp(path);
    EXPECT_THAT(text, Not(HasSubstr(work_.path()))) << path;
    EXPECT_THAT(text, Not(HasSubstr(Studio()))) << path;
    EXPECT_THAT(text, Not(HasSubstr("annabel"))) << path;
    EXPECT_TRUE(HostName().size() < 4 || text.find(HostName()) == std::string::npos) << path;
    ++looked_at;
  }
  EXPECT_GT(looked_at, 8);
}

/// Steps of the address space over which the loader, OpenBLAS's threads, the registration and the work run out of it.
TEST_F(Output, LittleAddressSpaceEndsWithAnExitCode) {
  if (kSanitized) GTEST_SKIP() << "sanitizers reserve terabytes";
  const bool two_programs = fs::exists(CliPath() + "-avatar");
  for (const int kilobytes : {450'000, 500'000, 650'000, 800'000, 1'000'000, 1'300'000}) {
    const std::string limit = "ulimit -c 0; ulimit -v " + std::to_string(kilobytes) + "; timeout -s KILL 20 ";
    std::vector<std::pair<std::string, CliRun>> runs = {{"version", RunCli({"version"}, limit)},
                                                        {"triangulate", RunCli(Triangulate({"--overwrite"}), limit)}};
    if (two_programs) runs.emplace_back("avatar", RunCli({"avatar", "render", work_ / "none", "--out", work_ / "o"}, limit));
    if (two_programs) runs.emplace_back("companion", RunProgram(CliPath() + "-avatar", {"version", "--json"}, limit));
    for (const auto& [name, run] : runs) {
      const bool loader = name == "companion" && run.exit == 127;  // the system's loader, before any of our code
      EXPECT_TRUE(run.exit == 0 || run.exit == 7 || loader || (name == "avatar" && run.exit == 3))
          << name << " with " << kilobytes << " kB: exit " << run.exit << ": " << run.err;
    }
  }
}

TEST_F(Output, WithoutTheFlagNothingIsRedacted) {
  const CliRun run = RunCli(Triangulate({"--json"}));
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr(Calibration()));
}

}  // namespace
}  // namespace mvstudio::testing
