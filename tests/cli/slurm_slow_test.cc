#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "tests/support/run_cli.h"

/// `mvstudio jobs` with a real Slurm of one node, which the test starts and ends: Debian's slurm-wlm and munge.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

bool IsInstalled(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
}

/// A program that runs until the test ends it.
class Daemon {
 public:
  Daemon(const Words& words, const std::string& log) {
    pid_ = fork();
    if (pid_ != 0) return;
    if (!freopen(log.c_str(), "a", stdout) || dup2(STDOUT_FILENO, STDERR_FILENO) < 0) _exit(98);
    std::vector<char*> argv;
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    execvp(argv[0], argv.data());
    _exit(99);
  }
  ~Daemon() { End(SIGTERM); }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  void End(int signal) {
    if (pid_ > 0) kill(pid_, signal), waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
};

/// munged, slurmctld and slurmd, with everything that they write in one folder.
class Slurm {
 public:
  explicit Slurm(const std::string& folder) : folder_(folder) {
    for (const char* name : {"state", "spool"}) fs::create_directories(folder_ + "/" + name);
    WriteKey();
    WriteConfiguration();
    munged_ = Start({"munged", "--foreground", "--force", "--key-file", folder_ + "/key", "--socket", folder_ + "/munge.socket",
                     "--pid-file", folder_ + "/munge.pid", "--seed-file", folder_ + "/munge.seed", "--log-file",
                     folder_ + "/munge.log"});
    StartController();
    slurmd_ = Start({"slurmd", "-D", "-f", Configuration()});
    setenv("SLURM_CONF", Configuration().c_str(), 1);
  }
  ~Slurm() { unsetenv("SLURM_CONF"); }

  void StartController() { controller_ = Start({"slurmctld", "-D", "-f", Configuration()}); }
  void KillController() { controller_->End(SIGKILL); }

  /// What a client of Slurm prints.
  std::string Ask(const std::string& line) const {
    const std::string out = folder_ + "/answer";
    return std::system((line + " >" + ShellQuote(out) + " 2>&1").c_str()) == 0 ? Slurp(out) : "failed: " + Slurp(out);
  }

 private:
  std::string Configuration() const { return folder_ + "/slurm.conf"; }
  std::unique_ptr<Daemon> Start(const Words& words) const {
    return std::make_unique<Daemon>(words, folder_ + "/" + words.front() + ".out");
  }
  void WriteKey() const {
    std::ofstream(folder_ + "/key") << std::string(128, 'k');
    chmod((folder_ + "/key").c_str(), 0400);
  }
  void WriteConfiguration() const {
    char name[256] = "";
    gethostname(name, sizeof name - 1);
    const std::string host = std::string(name).substr(0, std::string(name).find('.'));
    std::ofstream(Configuration()) << "ClusterName=test\nSlurmctldHost=" << host << "(127.0.0.1)\nSlurmUser=root\n"
                                   << "AuthType=auth/munge\nCredType=cred/munge\nAuthInfo=socket=" << folder_
                                   << "/munge.socket\nSlurmctldPort=26817\nSlurmdPort=26818\nStateSaveLocation=" << folder_
                                   << "/state\nSlurmdSpoolDir=" << folder_ << "/spool\nSlurmctldPidFile=" << folder_
                                   << "/slurmctld.pid\nSlurmdPidFile=" << folder_
                                   << "/slurmd.pid\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n"
                                   << "SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\n"
                                   << "SlurmdParameters=config_overrides\nReturnToService=2\nNodeName=" << host
                                   << " NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000 State=UNKNOWN\nPartitionName=main Nodes="
                                   << host << " Default=YES MaxTime=INFINITE State=UP\n";
  }

  const std::string folder_;
  std::unique_ptr<Daemon> munged_, controller_, slurmd_;
};

template <class Condition>
bool Await(int seconds, const Condition& condition) {
  for (int tenth = 0; tenth < 10 * seconds; ++tenth) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return false;
}

/// A task is killed, then the controller: one `jobs retry` does what is missing, and every byte is that of `run`.
TEST(SlurmJobs, AfterKillsOneRetryDoesTheRest) {
  for (const char* program : {"munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo"})
    if (!IsInstalled(program)) GTEST_SKIP() << program << " is not there: Debian's slurm-wlm and munge";
  if (geteuid() != 0) GTEST_SKIP() << "needs the right to start slurmd";
  const TempDir folder;
  const auto path = [&](const std::string& name) { return folder / name; };
  ASSERT_EQ(RunCli({"synth", "--out", path("s"), "--cameras", "3", "--size", "320x240", "--board", "charuco:5x4:240mm:180mm",
                    "--board-frames", "40", "--take-frames", "12"})
                .exit,
            0);
  fs::copy(path("s"), path("straight"), fs::copy_options::recursive);
  ASSERT_EQ(RunCli({"plan", path("s"), "--out", path("plan"), "--to", "triangulate", "--write", "slurm"}).exit, 0);
  const auto num_done = [&] {
    return RunCli({"jobs", "status", path("plan"), "--json"}).Json()["metrics"]["num_done"].get<int>();
  };

  fs::create_directory(path("slurm"));
  Slurm slurm(path("slurm"));
  const auto is_idle = [&] { return slurm.Ask("sinfo --noheader --format=%t").rfind("idle", 0) == 0; };
  const auto is_empty = [&] { return slurm.Ask("squeue --noheader").empty(); };
  ASSERT_TRUE(Await(60, is_idle)) << slurm.Ask("sinfo") << Slurp(path("slurm/slurmctld.out"));

  const CliRun submitted = RunCli({"jobs", "submit", path("plan"), "--engine", "slurm"});
  ASSERT_EQ(submitted.exit, 0) << submitted.err << Slurp(path("plan/submit.log"));
  ASSERT_TRUE(Await(60, [&] { return fs::exists(path("plan/tried/1.json")); })) << slurm.Ask("squeue");
  slurm.Ask("scancel --user=root --state=RUNNING --signal=KILL --full");
  ASSERT_TRUE(Await(60, is_empty)) << "what waits for a killed task is cancelled: " << slurm.Ask("squeue");
  EXPECT_LT(num_done(), 3);
  slurm.KillController();
  slurm.StartController();
  ASSERT_TRUE(Await(60, is_idle)) << slurm.Ask("sinfo");

  ASSERT_EQ(RunCli({"jobs", "retry", path("plan"), "--engine", "slurm"}).exit, 0);
  ASSERT_TRUE(Await(120, is_empty)) << slurm.Ask("squeue");
  EXPECT_EQ(num_done(), 3);
  const CliRun straight = RunCli({"run", path("straight"), "--to", "triangulate"});
  ASSERT_THAT(straight.exit, ::testing::AnyOf(0, 6)) << straight.err;
  for (const char* file : {"calib/calibration.json", "pose3d/take1/points.csv"})
    EXPECT_EQ(Slurp(path(std::string("s/") + file)), Slurp(path(std::string("straight/") + file))) << file;
}

}  // namespace
}  // namespace mvstudio::testing
