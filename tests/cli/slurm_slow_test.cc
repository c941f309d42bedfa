#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <thread>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

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

  /// What a client of Slurm prints; clients wait for minutes where there is no controller.
  std::string Ask(const std::string& line) const {
    const std::string out = folder_ + "/answer";
    const std::string command = "timeout 10 " + line + " >" + ShellQuote(out) + " 2>&1";
    return std::system(command.c_str()) == 0 ? Slurp(out) : "failed: " + Slurp(out);
  }
  bool IsIdle() const { return Ask("sinfo --noheader --format=%t").rfind("idle", 0) == 0; }
  bool IsEmpty() const { return Ask("squeue --noheader").empty(); }
  std::string NumRunning() const { return Ask("squeue --noheader --states=RUNNING --format=%A"); }
  std::string Log() const { return Ask("squeue") + Slurp(folder_ + "/slurmctld.out"); }

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
                                   << "SlurmdParameters=config_overrides\nReturnToService=2\nMpiDefault=none\n"
                                   << "SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0\n"
                                   << "KillWait=5\nNodeName=" << host
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

class SlurmJobs : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel", "sinfo", "scontrol"})
      if (!IsInstalled(program)) GTEST_SKIP() << program << " is not there: Debian's slurm-wlm and munge";
    if (geteuid() != 0) GTEST_SKIP() << "needs the right to start slurmd";
    if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
      GTEST_SKIP() << "needs the right to mount a small file system";
    fs::create_directory(Path("slurm"));
    slurm_ = std::make_unique<Slurm>(Path("slurm"));
    ASSERT_TRUE(Await(60, [&] { return slurm_->IsIdle(); })) << slurm_->Ask("sinfo") << slurm_->Log();
  }

  std::string Path(const std::string& name) const { return folder_ / name; }

  /// Sessions `s` and `straight` of the same bytes.
  void MakeSessions() const {
    ASSERT_EQ(RunCli({"synth", "--out", Path("s"), "--cameras", "3", "--size", "320x240", "--board", "charuco:5x4:240mm:180mm",
                      "--board-frames", "40", "--take-frames", "12"})
                  .exit,
              0);
    fs::copy(Path("s"), Path("straight"), fs::copy_options::recursive);
  }
  void Jobs(const std::string& verb) const {
    const CliRun submitted = RunCli({"jobs", verb, Path("plan"), "--engine", "slurm"});
    ASSERT_EQ(submitted.exit, 0) << submitted.err << Slurp(Path("plan/submit.log"));
  }
  std::map<std::string, int> States() const {
    std::map<std::string, int> counts;
    const nlohmann::json json = RunCli({"jobs", "status", Path("plan"), "--json"}).Json();
    for (const auto& task : json["metrics"]["tasks"]) ++counts[task["state"].get<std::string>()];
    return counts;
  }
  int NumDone() const { return States()["done"]; }
  bool AwaitEmpty(int seconds) const {
    return Await(seconds, [&] { return slurm_->IsEmpty(); });
  }
  /// What tasks said, and what Slurm did.
  std::string Logs() const {
    std::string text = slurm_->Log();
    if (!fs::exists(Path("plan/log"))) return text;
    for (const auto& entry : fs::directory_iterator(Path("plan/log")))
      text += entry.path().filename().string() + ":\n" + Slurp(entry.path().string());
    return text;
  }
  /// What Slurm knew after its last save is lost: it may start again what is done, or runs.
  void KillAndStartController() {
    slurm_->KillController();
    slurm_->StartController();
    ASSERT_TRUE(Await(60, [&] { return slurm_->Ask("sinfo --noheader").rfind("failed", 0) != 0; })) << slurm_->Log();
  }
  /// All files of a kind below SESSION/FOLDER by their names.
  std::map<std::string, std::string> BytesOf(const std::string& folder) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(Path(folder))) {
      const std::string name = entry.path().filename().string(), end = entry.path().extension().string();
      if (end == ".png" || end == ".jpg" || end == ".h5" || name == "points.csv" || name == "calibration.json")
        files[entry.path().lexically_relative(Path(folder)).string()] = Slurp(entry.path().string());
    }
    return files;
  }

  const TempDir folder_;
  std::unique_ptr<Slurm> slurm_;
};

/// A task is killed, then the controller: one `jobs retry` does what is missing, and every byte is that of `run`.
TEST_F(SlurmJobs, AfterKillsOneRetryDoesTheRest) {
  MakeSessions();
  ASSERT_EQ(RunCli({"plan", Path("s"), "--out", Path("plan"), "--to", "triangulate", "--write", "slurm"}).exit, 0);
  Jobs("submit");
  ASSERT_TRUE(Await(60, [&] { return fs::exists(Path("plan/tried/1.json")); })) << Logs();
  slurm_->Ask("scancel --user=root --state=RUNNING --signal=KILL --full");
  ASSERT_TRUE(AwaitEmpty(60)) << "what waits for a killed task is cancelled: " << Logs();
  EXPECT_LT(NumDone(), 3);
  KillAndStartController();

  Jobs("retry");
  ASSERT_TRUE(AwaitEmpty(120)) << Logs();
  EXPECT_EQ(NumDone(), 3) << Logs();
  const CliRun straight = RunCli({"run", Path("straight"), "--to", "triangulate"});
  ASSERT_THAT(straight.exit, ::testing::AnyOf(0, 6)) << straight.err;
  for (const char* folder : {"/calib", "/pose3d"}) {
    EXPECT_FALSE(BytesOf("s" + std::string(folder)).empty());
    EXPECT_EQ(BytesOf("s" + std::string(folder)), BytesOf("straight" + std::string(folder)));
  }
}

/// A plan cut by parts: a part is killed, the node drained, the controller killed, a marker forged, the disk full.
TEST_F(SlurmJobs, PartsSurviveKillsADrainAForgedMarkerAndAFullDisk) {
  MakeSessions();
  ASSERT_EQ(
      RunCli({"plan", Path("s"), "--out", Path("plan"), "--to", "verify", "--task-seconds", "0.02", "--write", "slurm"}).exit,
      0);
  constexpr int kBeforeMasks = 3 + 3 + 1 + 3, kTasks = kBeforeMasks + 1 + (3 + 3 + 1) + (3 + 1);
  constexpr int kSamples = 4;  // the first task of samples; 1 to 3 are stages
  Jobs("submit");
  const std::string tried = Path("plan/tried/" + std::to_string(kSamples) + ".json");
  ASSERT_TRUE(Await(120, [&] { return fs::exists(tried); })) << Logs();
  slurm_->Ask("scancel --user=root --state=RUNNING --signal=KILL --full");
  ASSERT_TRUE(AwaitEmpty(60)) << Logs();
  EXPECT_THAT(NumDone(), ::testing::AllOf(::testing::Ge(3), ::testing::Lt(kTasks)));

  // A forged marker, a true one of another task, counts for nothing, and is nobody's of mvstudio to remove.
  const std::string forged = Path("plan/done/" + std::to_string(kTasks) + ".json");
  fs::copy_file(Path("plan/done/1.json"), forged);
  EXPECT_LT(NumDone(), kTasks);
  EXPECT_EQ(RunCli({"jobs", "retry", Path("plan"), "--engine", "slurm"}).exit, 2);
  fs::remove(forged);

  // Drained: what runs ends, nothing begins. Then the controller forgets what it did.
  Jobs("retry");
  ASSERT_TRUE(Await(60, [&] { return !slurm_->NumRunning().empty(); })) << Logs();
  const std::string node = slurm_->Ask("sinfo --noheader --format=%n");
  const auto update = [&](const std::string& state) {
    return slurm_->Ask("scontrol update NodeName=" + node.substr(0, node.find('\n')) + " State=" + state + " Reason=test");
  };
  EXPECT_EQ(update("DRAIN"), "");
  EXPECT_TRUE(Await(120, [&] { return slurm_->NumRunning().empty(); })) << Logs();
  const int drained = NumDone();
  std::this_thread::sleep_for(std::chrono::seconds(3));
  EXPECT_EQ(NumDone(), drained) << "nothing begins on a node that is drained";
  EXPECT_LT(drained, kTasks);
  KillAndStartController();
  update("RESUME");

  // The disk that holds the masks is full: the task fails, and says so.
  fs::create_directories(Path("s/masks"));
  ASSERT_EQ(mount("tmpfs", Path("s/masks").c_str(), "tmpfs", 0, "size=40k"), 0);
  ASSERT_TRUE(AwaitEmpty(180)) << Logs();
  Jobs("retry");
  ASSERT_TRUE(AwaitEmpty(180)) << Logs();
  EXPECT_EQ(NumDone(), kBeforeMasks) << Logs();
  EXPECT_EQ(RunCli({"jobs", "status", Path("plan")}).exit, 7) << "out of resources";
  ASSERT_EQ(umount(Path("s/masks").c_str()), 0);

  Jobs("retry");
  ASSERT_TRUE(AwaitEmpty(180)) << Logs();
  EXPECT_EQ(NumDone(), kTasks) << Logs();
  const CliRun straight = RunCli({"run", Path("straight"), "--to", "verify"});
  ASSERT_THAT(straight.exit, ::testing::AnyOf(0, 6)) << straight.err;
  for (const char* folder : {"/calib", "/pose3d", "/masks", "/dataset"}) {
    EXPECT_FALSE(BytesOf("s" + std::string(folder)).empty());
    EXPECT_EQ(BytesOf("s" + std::string(folder)), BytesOf("straight" + std::string(folder)));
  }
}

/// One training of two processes: told to stop, it saves and ends with 75; started again, it has the bytes of one that nobody
/// cut.
TEST_F(SlurmJobs, ATrainingUnderSrunGoesOnToTheSameBytes) {
  if (RunCli({"version", "--json"}).Json()["metrics"]["avatar"] != true) GTEST_SKIP() << "built without avatars";
  avatar::WriteMannequinDataset(Path("data"), 4, 12, 96);
  const auto submit = [&](const std::string& run) {
    const std::string net =
        " --size 32 --width 4 --downs 2 --encoder-blocks 1 --decoder-blocks 1 --no-fit-shape --init-steps 4"
        " --save-every 2 --steps 600";
    const std::string script = Path("train.sh"), end = " --rendezvous slurm --threads 1\n";
    std::ofstream(script) << "#!/bin/sh\nif [ -e " << run << "/checkpoint.safetensors ]; then\n  srun " << CliPath()
                          << " avatar resume " << run << end << "else\n  srun " << CliPath() << " avatar train " << Path("data")
                          << " --out " << run << net << end << "fi\necho ended with $?\n";
    slurm_->Ask("sbatch --ntasks=2 --output=" + run + ".txt " + script);
  };
  const auto bytes = [&](const std::string& run) { return Slurp(run + "/checkpoint.safetensors"); };
  submit(Path("whole"));
  ASSERT_TRUE(AwaitEmpty(120)) << slurm_->Log();
  EXPECT_THAT(Slurp(Path("whole.txt")), ::testing::HasSubstr("ended with 0"));
  for (const char* signal : {"USR1", "TERM"}) {
    const std::string run = Path(signal);
    submit(run);
    ASSERT_TRUE(Await(60, [&] { return fs::exists(run + "/checkpoint.safetensors"); })) << Slurp(run + ".txt");
    slurm_->Ask("scancel --user=root --state=RUNNING --signal=" + std::string(signal));  // the processes, not the script
    ASSERT_TRUE(AwaitEmpty(60)) << slurm_->Log();
    EXPECT_THAT(Slurp(run + ".txt"), ::testing::HasSubstr("ended with 75"));
    EXPECT_NE(bytes(run), bytes(Path("whole")));
    submit(run);
    ASSERT_TRUE(AwaitEmpty(120)) << slurm_->Log();
    EXPECT_THAT(Slurp(run + ".txt"), ::testing::HasSubstr("ended with 0"));
    EXPECT_EQ(bytes(run), bytes(Path("whole")));
  }
}

}  // namespace
}  // namespace mvstudio::testing
