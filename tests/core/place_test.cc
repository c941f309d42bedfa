#include "core/disk/place.h"

#include <unistd.h>

#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/run_in_copy.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

namespace fs = std::filesystem;

/// `here` is the current folder, `latest` in it a link to ../other/today, `file` a file, `gone` a link that leads nowhere.
class Place : public ::testing::Test {
 protected:
  Place() : before_(fs::current_path()) {
    fs::create_directories(root_ / "other/today/in");
    fs::create_directories(root_ / "here/sub");
    Put(root_ / "here/file", "mine");
    fs::current_path(root_ / "here");
    fs::create_directory_symlink("../other/today", "latest");
    fs::create_symlink("nowhere", "gone");
    fs::create_symlink("loop", "loop");
  }
  ~Place() override { fs::current_path(before_); }

  const TempDir root_;
  const fs::path before_;
};

TEST_F(Place, NamesMeanWhatTheyMeanToTheSystem) {
  const std::string root = fs::canonical(root_.path());
  const std::pair<std::string, std::string> forms[] = {
      {"a", "here/a"},
      {"./a", "here/a"},
      {"a/", "here/a"},
      {"a//b", "here/a/b"},
      {"a/./b", "here/a/b"},
      {"new/deep/a", "here/new/deep/a"},
      {"sub/../a", "here/a"},
      {"../a", "a"},
      {"../here/a", "here/a"},
      {".", "here"},
      {"..", ""},
      {"sub/.", "here/sub"},
      {"sub/..", "here"},
      {"latest", "here/latest"},
      {"latest/", "other/today"},
      {"latest/.", "other/today"},
      {"latest/..", "other"},
      {"latest/a", "other/today/a"},
      {"latest/../a", "other/a"},
      {"latest/../../here/a", "here/a"},
      {"latest/in/../../a", "other/a"},
      {"gone", "here/gone"},
      {"/proc/self/cwd/a", "here/a"},
      {"/proc/self/cwd/latest/../a", "other/a"},
      {root + "/here/latest/../a", "other/a"},
  };
  for (const auto& [given, place] : forms) EXPECT_EQ(PathOnDisk(given), place.empty() ? root : root + "/" + place) << given;
  EXPECT_EQ(PathOnDisk("/"), "/");
  EXPECT_EQ(PathOnDisk("/../.."), "/");
}

TEST_F(Place, WhatLeadsNowhereIsRefused) {
  for (const std::string path :
       {"none/../a", "/nonexistent/../a", "file/a", "file/../a", "file/", "gone/a", "gone/../a", "loop/a"})
    EXPECT_THROW(PathOnDisk(path), IoError) << path;
}

TEST_F(Place, AnOutputHasOneNameThatIsRelativeWhereItWas) {
  const auto file = [](const std::string& path) { return OutputName(path, OutputKind::kFile); };
  EXPECT_EQ(file("a.json"), "a.json");
  EXPECT_EQ(file("./sub/../a.json"), "a.json");
  EXPECT_EQ(file("../a.json"), "../a.json");
  EXPECT_EQ(file("latest/../a.json"), "../other/a.json");
  EXPECT_EQ(file(root_ / "here/a.json"), PathOnDisk("a.json"));
  EXPECT_EQ(OutputName("latest", OutputKind::kFolder), "../other/today");
  EXPECT_EQ(OutputName("new/", OutputKind::kFolder), "new");
  EXPECT_EQ(OutputName("new/", OutputKind::kAny), "new/");
  for (const char* path : {"a/", "sub/.", "latest/..", ""}) EXPECT_THROW(file(path), UsageError) << path;
  EXPECT_THROW(OutputName("points.csv", OutputKind::kFolder), UsageError);
  fs::create_directory("points.csv");
  EXPECT_EQ(OutputName("points.csv", OutputKind::kFolder), "points.csv") << "who made it wants it";
  EXPECT_EQ(OutputName("take.2026", OutputKind::kFolder), "take.2026");
}

TEST_F(Place, ReservedNamesAreNoOutputs) {
  const auto before = StateOf(root_.path());
  const std::string tag(32, 'a');
  for (const std::string& name :
       {std::string("calib_convert.result.json"), std::string("provenance.jsonl"), std::string("Provenance.JSONL"),
        std::string(".mvstudio.json"), ".mvstudio-" + tag, ".mvstudio-" + tag + ".json", ".mvstudio-old-" + tag + "-x",
        std::string(".mvstudio.a.lock")}) {
    EXPECT_TRUE(IsReservedName(name)) << name;
    for (const std::string& path : {name, "latest/" + name, "new/../" + name, "sub/../" + name}) {
      if (path.rfind("new", 0) == 0) continue;
      EXPECT_THROW(OutputName(path, OutputKind::kFile), UsageError) << path;
      EXPECT_THROW(OutputName(path + "/", OutputKind::kFolder), UsageError) << path;
      EXPECT_THROW(OutputFiles({path}, {}), UsageError) << path;
      EXPECT_THROW(OutputFolder(path, {}, {"a"}), UsageError) << path;
      EXPECT_THROW(AtomicFolder(path, true), UsageError) << path;
    }
  }
  EXPECT_THROW(OutputName(".mvstudio-" + tag + "/a.json", OutputKind::kFile), UsageError) << "it would be swept";
  for (const char* name : {"result.json", "provenance.csv", "mvstudio.json", ".mvstudiorc", "report.json"})
    EXPECT_FALSE(IsReservedName(name)) << name;
  EXPECT_EQ(StateOf(root_.path()), before);
}

TEST_F(Place, WritesGoWhereTheSystemSaysAndLeaveNothingElsewhere) {
  WriteFileAtomic("latest/../a.json", "x");
  EXPECT_EQ(ReadFile("latest/../a.json"), "x");
  EXPECT_FALSE(fs::exists("a.json"));
  const auto before = StateOf(root_.path());
  EXPECT_THROW(WriteFileAtomic("none/../c.json", "x"), IoError);
  EXPECT_THROW(MakeFolder("none/../c"), IoError);
  EXPECT_THROW(AtomicFolder("none/../c", false), IoError);
  EXPECT_THROW(OutputFiles({"none/../c.json"}, {}), IoError);
  EXPECT_THROW(OutputFolder("none/../c", {}, {"a"}), IoError);
  EXPECT_THROW(WriteFileAtomic("a.json/", "x"), UsageError);
  EXPECT_EQ(StateOf(root_.path()), before);
}

TEST_F(Place, AnInputIsFoundUnderEachOfItsNames) {
  {
    AtomicFolder made("../other/ds", false);
    WriteFileAtomic(made.work_path() + "/a", "x");
    made.Commit();
  }
  Put("../other/in.json", "x");
  fs::create_hard_link("../other/in.json", "hard.json");
  const auto before = StateOf(root_.path());
  for (const char* name :
       {"latest/../ds", "latest/../ds/", "../other/ds/.", "latest/../../other/ds", "/proc/self/cwd/latest/../ds"}) {
    EXPECT_THROW(AtomicFolder(name, true, {"../other/ds"}), UsageError) << name;
    EXPECT_THROW(AtomicFolder("../other/ds", true, {name}), UsageError) << name;
    EXPECT_THROW(OutputFolder(std::string(name) + "/in", {"../other/ds"}, {"a"}), UsageError) << name;
  }
  EXPECT_THROW(AtomicFolder("latest/..", true, {"../other/ds"}), UsageError);
  for (const char* name : {"latest/../in.json", "hard.json", "/proc/self/cwd/latest/../in.json"})
    EXPECT_THROW(OutputFiles({name}, {"../other/in.json"}), UsageError) << name;
  EXPECT_EQ(StateOf(root_.path()), before);
}

TEST_F(Place, OneWriterUnderEachOfItsNames) {
  const OutputLock held("latest/../out");
  for (const char* name : {"../other/out", "latest/../out", "/proc/self/cwd/latest/../out"}) {
    EXPECT_EQ(RunInCopy([&] {
                EXPECT_THROW(OutputLock{name}, LockedError);
                return HasFailure() ? 1 : 0;
              }),
              0)
        << name;
  }
}

TEST_F(Place, NoTwoOutputsOfOneRunHaveOneName) {
  const OutputFolder place("../other/out", {}, {"calibration.json"});
  EXPECT_THROW(OutputFiles({"latest/../out/calibration.json"}, {}), UsageError);
  EXPECT_THROW(OutputFiles({"a.json", "sub/../a.json"}, {}), UsageError);
  EXPECT_NO_THROW(OutputFiles({"latest/../out/corners.csv"}, {}));
}

TEST_F(Place, AFolderNamedLikeALockIsNobodysLeftover) {
  fs::create_directory(".mvstudio.a.json.lock");
  RemoveLeftovers(".");
  EXPECT_TRUE(fs::exists(".mvstudio.a.json.lock"));
  EXPECT_THROW(OutputFiles({"a.json"}, {}), UsageError);
  EXPECT_NO_THROW(OutputFiles({"b.json"}, {}));
  EXPECT_TRUE(fs::exists(".mvstudio.a.json.lock"));
}

/// A list in `folder` that names `name`, as it is.
void ListIn(const std::string& folder, const std::string& name, bool with_folder) {
  Manifest manifest;
  manifest.files[name].now = DigestOf(folder + "/" + name);
  if (with_folder) manifest.files[fs::path(name).parent_path().string() + "/"];
  Put(folder + "/" + kManifestName, ManifestToJsonText(manifest));
}

TEST_F(Place, AListAboveAFolderDoesNotMakeItsFilesOurs) {
  Put("out/thesis.txt", "mine");
  ListIn(".", "out/thesis.txt", false);
  EXPECT_THROW(AtomicFolder("out", true), UsageError);
  EXPECT_THROW(OutputFolder("out", {}, {"thesis.txt"}), UsageError);
  EXPECT_THROW(RequireOurs({"out/thesis.txt"}), UsageError);
  ListIn(".", "out/thesis.txt", true);
  EXPECT_NO_THROW(RequireOurs({"out"})) << "made as a part of what was written here";
  if (geteuid() != 0) return;
  ASSERT_EQ(chown(kManifestName, 4321, 4321), 0);
  EXPECT_THROW(RequireOurs({"out"}), UsageError) << "another user's list of root's file";
  ASSERT_EQ(chown("out/thesis.txt", 4321, 4321), 0);
  EXPECT_NO_THROW(RequireOurs({"out"})) << "of the user's own";
}

TEST_F(Place, WhatAListAboveKnowsGoesWhole) {
  Put("out/old.txt", "ours");
  ListIn(".", "out/old.txt", true);
  AtomicFolder folder("out", true);
  WriteFileAtomic(folder.work_path() + "/new.txt", "x");
  folder.Commit();
  EXPECT_EQ(testing::Entries("out"), std::set<std::string>({"new.txt"}));
  for (const auto& entry : fs::directory_iterator(".")) {
    const std::string name = entry.path().filename().string();
    EXPECT_TRUE(name.rfind(".mvstudio-", 0) != 0) << name << " stays";
  }
}

}  // namespace
}  // namespace mvstudio
