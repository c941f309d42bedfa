#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <map>
#include <thread>

#include "tests/cli/wrong_invocations.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// Every way to call the program wrongly that we could think of: each is answered with its exit code and one line, soon, and
/// nothing is made or changed.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// Names that begin with "new" get the number of the invocation: two run at a time, and an output has one writer.
std::vector<std::string> Words(const std::string& text, size_t number) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) {
    if (word.compare(0, 3, "new") == 0) word.insert(3, std::to_string(number));
    words.push_back(word == "''" ? "" : word);
  }
  return words;
}

/// Every name below a folder, with the content of files; locks that somebody held and let go are no change.
std::map<std::string, std::string> Contents(const std::string& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const bool file = entry.symlink_status().type() == fs::file_type::regular;
    contents[entry.path().string()] = file ? Slurp(entry.path().string()) : "";
  }
  return contents;
}

void MakeSandbox(const TempDir& sandbox) {
  const std::string in = "cd " + sandbox.path() + " && ";
  const CliRun made = RunCli(
      {"synth", "--out", "studio", "--cameras", "3", "--size", "640x480", "--board-frames", "8", "--take-frames", "3"}, in);
  ASSERT_EQ(made.exit, 0) << made.err;
  const CliRun built = RunCli({"dataset", "build", "--session", "studio", "--calib", "studio/truth/calibration.json",
                               "--pose3d", "studio/truth/pose3d", "--out", "dataset"},
                              in);
  ASSERT_EQ(built.exit, 0) << built.err;
  fs::copy_file(sandbox / "studio/truth/calibration.json", sandbox / "rig.json");
  for (const char* extension : {"json", "toml", "mp4", "png", "csv", "npy", "onnx"}) {
    std::ofstream(sandbox / ("garbage." + std::string(extension))) << "{] this is no file of any kind, \x01\x02\xff";
  }
  std::ofstream(sandbox / "empty");
  fs::create_directory(sandbox / "nothing");
  fs::create_directory(sandbox / "folder");
  std::ofstream(sandbox / "folder/notes.txt") << "mine";
  ASSERT_EQ(mkfifo((sandbox / "pipe").c_str(), 0600), 0);
  fs::create_symlink("loop", sandbox / "loop");
}

/// What is wrong with an answer; empty: nothing.
std::string FaultOf(const Invocation& invocation, const CliRun& run, bool json) {
  std::string fault;
  if (run.exit != invocation.exit)
    fault += "exit " + std::to_string(run.exit) + " instead of " + std::to_string(invocation.exit) + "; ";
  if (std::count(run.err.begin(), run.err.end(), '\n') != 1) fault += "not one line; ";
  if (run.err.rfind("error: ", 0) != 0) fault += "does not begin with 'error: '; ";
  if (run.err.rfind("error: : ", 0) == 0) fault += "names nothing; ";
  if (run.err.find(invocation.part) == std::string::npos) fault += "lacks '" + invocation.part + "'; ";
  if (!json && !run.out.empty()) fault += "prints on stdout; ";
  if (json && (!run.Json().is_object() || run.Json()["exit"] != run.exit)) fault += "is not one object; ";
  return fault;
}

/// Two at a time: starting the program takes longest. A program that hangs ends with 124.
class Runner {
 public:
  Runner(const TempDir& sandbox, const std::vector<Invocation>& all) : sandbox_(sandbox), all_(all), faults_(all.size()) {}

  std::vector<std::string> Run() {
    std::thread other([this] { Work(); });
    Work();
    other.join();
    return faults_;
  }

 private:
  void Work() {
    for (size_t i = next_++; i < all_.size(); i = next_++) {
      std::vector<std::string> words = Words(all_[i].words, i);
      const bool json = i % 3 == 0;
      if (json) words.push_back("--json");
      const CliRun run = RunCli(words, "cd " + sandbox_.path() + " && MVSTUDIO_CACHE=off MVSTUDIO_MODELS=nothing timeout 30 ");
      const std::string fault = FaultOf(all_[i], run, json);
      if (!fault.empty()) faults_[i] = "mvstudio " + all_[i].words + ": " + fault + "\n    " + run.err;
    }
  }

  const TempDir& sandbox_;
  const std::vector<Invocation>& all_;
  std::vector<std::string> faults_;
  std::atomic<size_t> next_{0};
};

bool HasAvatar() { return RunCli({"version", "--json"}).Json()["metrics"]["avatar"] == true; }

TEST(Invocations, EveryWrongOneIsAnsweredWithOneLineAndNothingIsMade) {
  const TempDir sandbox;
  MakeSandbox(sandbox);
  if (HasFatalFailure()) return;
  std::vector<Invocation> all;
  const bool avatar = HasAvatar();
  for (const Invocation& invocation : kInvocations) {
    const std::string command = invocation.words.substr(0, invocation.words.find(' '));
    const bool needs_avatar = command == "avatar" || command == "demo" || command == "models" || command == "pose2d" ||
                              command == "mask" || command == "metrics";
    if (avatar || !needs_avatar) all.push_back(invocation);
  }
  const auto before = Contents(sandbox.path());
  for (const std::string& fault : Runner(sandbox, all).Run()) {
    if (!fault.empty()) ADD_FAILURE() << fault;
  }
  for (const auto& [path, content] : Contents(sandbox.path())) {
    const auto found = before.find(path);
    if (found == before.end()) ADD_FAILURE() << path << " was made";
    if (found != before.end() && found->second != content) ADD_FAILURE() << path << " was changed";
  }
  for (const auto& [path, content] : before) EXPECT_TRUE(fs::exists(fs::symlink_status(path))) << path << " is gone";
  std::cout << all.size() << " invocations\n";
}

/// A missing value is seen wherever the words stand, and an error of the parser is told in JSON as well.
TEST(Invocations, UsageErrorsNameTheCommandsOwnHelp) {
  const CliRun run = RunCli({"--json", "calib", "show", "--unknown"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_EQ(run.Json()["errors"][0]["hint"], "see mvstudio calib show --help");
}

}  // namespace
}  // namespace mvstudio::testing
