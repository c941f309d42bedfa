#include "core/disk/output.h"

#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <functional>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/run_in_copy.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

int steps_left = 0;  // before the fault
bool kills = false;  // instead of failing
int seen = 0;

int Fault(const char*, const std::string&) {
  ++seen;
  if (--steps_left != 0) return 0;
  if (kills) raise(SIGKILL);
  return ENOSPC;
}

/// Runs `work` with its n-th step failing; true when all went well.
bool FailsAt(int n, const std::function<void()>& work) {
  steps_left = n, kills = false, seen = 0;
  const IoFault before = SetIoFault(Fault);
  bool done = true;
  try {
    work();
  } catch (const ResourceError&) {
    done = false;
  }
  SetIoFault(before);
  return done;
}

/// Runs `work` in a process of its own that is killed at its n-th step; true when it came to its end.
bool KilledAt(int n, const std::function<void()>& work) {
  const int exit = RunInCopy([&] {
    steps_left = n, kills = true;
    SetIoFault(Fault);
    work();
    return 0;
  });
  EXPECT_TRUE(exit == 0 || exit == 128 + SIGKILL) << exit;
  return exit == 0;
}

/// In a process of its own, so that it sweeps folders anew.
void InAnotherProcess(const std::function<void()>& work) { EXPECT_TRUE(KilledAt(-1, work)); }

void MakeFolderWith(const std::string& path, const std::string& name, const std::string& content, bool overwrite) {
  AtomicFolder folder(path, overwrite);
  WriteFileAtomic(folder.work_path() + "/" + name, content);
  folder.Commit();
}

TEST(AtomicFolder, AppearsOnCommitOnly) {
  const TempDir root;
  const std::string path = root / "run/out";
  {
    AtomicFolder folder(path, false);
    WriteFileAtomic(folder.work_path() + "/a", "x");
    EXPECT_FALSE(fs::exists(path));
    folder.Commit();
    EXPECT_TRUE(fs::exists(path + "/a"));
  }
  EXPECT_TRUE(fs::exists(path + "/a"));
  EXPECT_EQ(Entries(root / "run"), Names({"out"}));
}

TEST(AtomicFolder, LeavesNothingWithoutCommit) {
  const TempDir root;
  {
    AtomicFolder folder(root / "out", false);
    WriteFileAtomic(folder.work_path() + "/a", "x");
  }
  EXPECT_TRUE(Entries(root.path()).empty());
}

TEST(AtomicFolder, ReplacesOnlyWhenAskedAndKeepsTheOldOneTillThen) {
  const TempDir root;
  MakeFolderWith(root / "out", "old", "x", false);
  EXPECT_THROW(AtomicFolder(root / "out", false), UsageError);
  {
    AtomicFolder abandoned(root / "out", true);
    WriteFileAtomic(abandoned.work_path() + "/new", "y");
    EXPECT_TRUE(fs::exists(root / "out/old"));
  }
  EXPECT_TRUE(fs::exists(root / "out/old"));
  MakeFolderWith(root / "out/", "new", "y", true);
  EXPECT_EQ(Entries(root / "out"), Names({"new"}));
  EXPECT_EQ(Entries(root.path()), Names({"out"}));
}

TEST(AtomicFolder, NeverReplacesAFolderWithFilesOfOthers) {
  const TempDir root;
  Put(root / "photos/holiday.jpg", "mine");
  const auto before = StateOf(root.path());
  EXPECT_THROW(AtomicFolder(root / "photos", true), UsageError);
  EXPECT_EQ(StateOf(root.path()), before);
  MakeFolderWith(root / "out", "a", "x", false);
  Put(root / "out/notes.txt", "mine");
  Put(root / "out/deep/er/thesis.tex", "mine");
  const std::string why = testing::MessageOf<UsageError>([&] { AtomicFolder(root / "out", true); });
  EXPECT_NE(why.find("notes.txt"), std::string::npos) << why;
  EXPECT_NE(why.find("thesis.tex"), std::string::npos) << why;
  EXPECT_EQ(ReadFile(root / "out/notes.txt"), "mine");
}

TEST(AtomicFolder, NeverReplacesAFileThatWasChangedOrAnEmptyFolderOfOthers) {
  const TempDir root;
  MakeFolderWith(root / "out", "a", "x", false);
  Put(root / "out/a", "edited");
  EXPECT_THROW(AtomicFolder(root / "out", true), UsageError);
  Put(root / "out/a", "x");
  EXPECT_NO_THROW(AtomicFolder(root / "out", true));
  fs::create_directory(root / "out/for later");
  EXPECT_THROW(AtomicFolder(root / "out", true), UsageError);
}

TEST(AtomicFolder, LooksAgainBeforeItReplaces) {
  const TempDir root;
  MakeFolderWith(root / "out", "a", "x", false);
  AtomicFolder folder(root / "out", true);
  WriteFileAtomic(folder.work_path() + "/b", "y");
  Put(root / "out/notes.txt", "written while we worked");
  EXPECT_THROW(folder.Commit(), UsageError);
  EXPECT_EQ(Entries(root / "out"), Names({"a", "notes.txt"}));
}

TEST(AtomicFolder, FollowsALinkToAFolderAndKeepsIt) {
  const TempDir root;
  fs::create_directory(root / "disk");
  fs::create_directory_symlink(root / "disk", root / "out");
  MakeFolderWith(root / "out", "a", "x", false);
  EXPECT_TRUE(fs::is_symlink(root / "out"));
  EXPECT_EQ(ReadFile(root / "disk/a"), "x");
  fs::create_symlink(root / "nowhere", root / "broken");
  EXPECT_THROW(AtomicFolder(root / "broken", true), UsageError);
}

TEST(AtomicFolder, AFullDiskAtAnyStepLeavesTheOldFolder) {
  const TempDir root;
  MakeFolderWith(root / "out", "old", "x", false);
  const auto before = StateOf(root.path());
  int n = 1;
  for (; !FailsAt(n, [&] { MakeFolderWith(root / "out", "new", "y", true); }); ++n) {
    if (fs::exists(root / "out/new")) break;  // swapped; only the old folder could not be taken away
    EXPECT_EQ(StateOf(root.path()), before) << "step " << n;
  }
  EXPECT_GT(n, 10);
}

TEST(AtomicFolder, KilledAtAnyStepTheOldOrTheNewOneIsThereAndLeftoversGo) {
  int n = 1;
  for (bool done = false; !done; ++n) {
    const TempDir root;
    MakeFolderWith(root / "out", "old", "x", false);
    Put(root / "neighbour.txt", "mine");
    done = KilledAt(n, [&] { MakeFolderWith(root / "out", "new", "y", true); });
    const Names inside = Entries(root / "out");
    EXPECT_TRUE(inside == Names({"old"}) || inside == Names({"new"})) << "step " << n;
    InAnotherProcess([&] { MakeFolderWith(root / "out", "newer", "z", true); });
    EXPECT_EQ(Entries(root / "out"), Names({"newer"})) << "step " << n;
    EXPECT_EQ(Entries(root.path()), Names({"neighbour.txt", "out"})) << "step " << n;
  }
  EXPECT_GT(n, 10);
}

TEST(AtomicFolder, OneWriterAtATimeAndTheOtherIsToldWho) {
  const TempDir root;
  const AtomicFolder mine(root / "out", false);
  EXPECT_EQ(RunInCopy([&] {
              const std::string told = testing::MessageOf<LockedError>([&] { const AtomicFolder theirs(root / "out", false); });
              return told.find("process " + std::to_string(getppid())) != std::string::npos ? 0 : 2;
            }),
            0);
}

TEST(CommitTogether, AllOrNoneAtEveryFault) {
  int n = 1;
  for (bool done = false; !done; ++n) {
    const TempDir root;
    const auto write = [&](const std::string& text) {
      FilesTogether set;
      WriteFileAtomic(root / "out/points.csv", "points " + text);
      WriteFileAtomic(root / "out/covariance.csv", "covariance " + text);
      set.Commit();
    };
    write("old");
    Put(root / "neighbour.txt", "mine");
    done = KilledAt(n, [&] { write("new"); });
    const std::string points = ReadFile(root / "out/points.csv"), covariance = ReadFile(root / "out/covariance.csv");
    EXPECT_EQ(points.substr(7), covariance.substr(11)) << "step " << n;
    InAnotherProcess([&] { write("newer"); });
    EXPECT_EQ(ReadFile(root / "out/points.csv"), "points newer");
    EXPECT_EQ(Entries(root / "out"), Names({"points.csv", "covariance.csv"})) << "step " << n;
    EXPECT_EQ(Entries(root.path()), Names({"neighbour.txt", "out"})) << "step " << n;
  }
  EXPECT_GT(n, 10);
}

TEST(CommitTogether, FilesOfOthersInTheSameFolderStay) {
  const TempDir root;
  Put(root / "run/notes.txt", "mine");
  Put(root / "run/colmap/database.db", "mine");
  for (const char* text : {"one", "two"}) {
    FilesTogether set;
    WriteFileAtomic(root / "run/a.csv", text);
    WriteFileAtomic(root / "run/b.csv", text);
    EXPECT_NE(fs::exists(root / "run/a.csv") ? ReadFile(root / "run/a.csv") : "", text) << "not before Commit";
    set.Commit();
    EXPECT_EQ(ReadFile(root / "run/a.csv"), text);
  }
  EXPECT_EQ(ReadFile(root / "run/notes.txt"), "mine");
  EXPECT_EQ(ReadFile(root / "run/colmap/database.db"), "mine");
  EXPECT_EQ(Entries(root / "run"), Names({"notes.txt", "colmap", "a.csv", "b.csv"}));
}

TEST(CommitTogether, OneRefusalLeavesAllAsTheyWere) {
  const TempDir root;
  Put(root / "b.csv", "mine");
  const auto before = StateOf(root.path());
  EXPECT_THROW(
      {
        FilesTogether set;
        WriteFileAtomic(root / "a.csv", "x");
        WriteFileAtomic(root / "b.csv", "x");
        set.Commit();
      },
      UsageError);
  EXPECT_EQ(StateOf(root.path()), before);
}

TEST(RequireSafeOutput, RefusesPlacesThatHoldMoreThanAnOutput) {
  const TempDir root;
  Put(root / "take/cam.mp4", "mine");
  fs::create_directory_symlink(root / "take", root / "link");
  const std::vector<std::string> inputs = {root / "take"};
  for (const std::string& out :
       {root / "take", root / "take/out", root.path(), root / "link", root / "link/out", root / "take/../take"})
    EXPECT_THROW(RequireSafeOutput(out, inputs, true), UsageError) << out;
  EXPECT_NO_THROW(RequireSafeOutput(root / "out", inputs, true));
  EXPECT_NO_THROW(RequireSafeOutput(root / "taken", inputs, true));
  fs::create_directory_symlink("/", root / "everything");
  fs::create_directory_symlink(fs::current_path(), root / "here");
  for (const std::string& out :
       {std::string("/"), std::string("."), std::string(""), std::string("/.."), root / "everything", root / "here"})
    EXPECT_THROW(RequireSafeOutput(out, {}, false), UsageError) << out;
}

TEST(RequireSafeOutput, RefusesTheHomeFolder) {
  const TempDir home;
  const std::string before = std::getenv("HOME") ? std::getenv("HOME") : "";
  setenv("HOME", home.path().c_str(), 1);
  EXPECT_THROW(RequireSafeOutput(home.path(), {}, false), UsageError);
  EXPECT_THROW(RequireSafeOutput(home / ".", {}, false), UsageError);
  EXPECT_NO_THROW(RequireSafeOutput(home / "run", {}, true));
  setenv("HOME", before.c_str(), 1);
}

TEST(RemoveOurs, RemovesAllOrNothing) {
  const TempDir root;
  WriteFileAtomic(root / "run/samples/step_1.png", "ours");
  WriteFileAtomic(root / "run/history.csv", "ours");
  Put(root / "run/samples/mine.jpg", "mine");
  const auto before = StateOf(root.path());
  EXPECT_THROW(RemoveOurs({root / "run/history.csv", root / "run/samples"}), UsageError);
  EXPECT_EQ(StateOf(root.path()), before);
  fs::remove(root / "run/samples/mine.jpg");
  RemoveOurs({root / "run/history.csv", root / "run/samples", root / "run/never"});
  EXPECT_TRUE(Entries(root / "run").empty());
}

TEST(OutputFiles, AreNeverInputsNorWhatAnotherCommandWrote) {
  const TempDir root;
  SetWriterName("calibrate", "1");
  WriteFileAtomic(root / "calib/calibration.json", "{}");
  SetWriterName("report", "1");
  EXPECT_THROW(OutputFiles({root / "calib/calibration.json"}, {}), UsageError);
  EXPECT_NO_THROW(OutputFiles({root / "calib/report.json"}, {}));
  Put(root / "in.json", "mine");
  EXPECT_THROW(OutputFiles({root / "./in.json"}, {root / "in.json"}), UsageError);
  { const OutputFiles two({root / "new/a.html", root / "new/a.json"}, {}); }
  EXPECT_FALSE(fs::exists(root / "new")) << "nothing was written";
  SetWriterName("", "");
}

TEST(Sweep, TakesNothingThatAnotherProcessIsJustMaking) {
  const TempDir root;
  const pid_t sweeper = fork();
  if (sweeper == 0) {
    for (;;) RemoveLeftovers(root.path());
  }
  for (int i = 0; i < 10000; ++i) {
    const std::string name = internal::TemporaryBeside(root / "a.csv");
    const int fd = internal::CreateTemporary(name, root / "a.csv");
    EXPECT_TRUE(fs::exists(name)) << i;
    unlink(name.c_str());
    internal::UnregisterTemporary(name);
    close(fd);
  }
  for (int i = 0; i < 100; ++i) EXPECT_NO_THROW({ const ScratchFolder scratch(root.path()); }) << i;
  kill(sweeper, SIGKILL);
  waitpid(sweeper, nullptr, 0);
}

TEST(Sweep, LeavesWhatOnlyLooksLikeALeftover) {
  const TempDir root;
  Put(root / ".mvstudio-notes.txt", "mine");
  Put(root / ".mvstudio.thesis.lock", "mine");
  Put(root / (".mvstudio-" + std::string(32, 'a')) + "/thesis.tex", "mine");
  const auto before = StateOf(root.path());
  InAnotherProcess([&] { MakeFolderWith(root / "out", "a", "x", false); });
  fs::remove_all(root / "out");
  EXPECT_EQ(StateOf(root.path()), before);
}

TEST(LentFolder, GoesWithWhatOthersPutThere) {
  const TempDir root;
  {
    const LentFolder lent(root / "runs/peers");
    Put(lent.path() + "/deep/theirs.txt", "theirs");
    EXPECT_THROW(LentFolder(root / "runs/peers"), IoError);
    EXPECT_TRUE(fs::exists(root / "runs/peers/deep/theirs.txt")) << "what is there is nobody's to lend";
  }
  EXPECT_TRUE(Entries(root / "runs").empty());
}

TEST(AbandonTemporaries, LeavesNothingAndStopsAllCommits) {
  const TempDir root;
  EXPECT_EQ(RunInCopy([&] {
              AtomicFolder folder(root / "out", false);
              AtomicFile file(root / "a.csv");
              WriteFile(file.temporary(), "half");
              AbandonTemporaries();
              _exit(0);  // before the two are cleaned away
              return 1;
            }),
            0);
  EXPECT_TRUE(Entries(root.path()).empty());
}

}  // namespace
}  // namespace mvstudio
