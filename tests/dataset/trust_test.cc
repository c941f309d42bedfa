#include "dataset/session/trust.h"

#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "dataset/session/session.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Which sessions may read outside their folders without being asked again.
namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;

class Trust : public ::testing::Test {
 protected:
  Trust() {
    setenv("XDG_STATE_HOME", (root_ / "state").c_str(), 1);
    for (const char* name : {"cards/walk/a.mp4", "cards/walk/b.mp4", "others/c.mp4"}) Fill(root_ / name, "x");
    fs::create_directories(root_ / "day1");
    fs::create_directory_symlink(root_ / "cards", root_ / "day1/raw");
    Name("raw/walk/a.mp4");
  }
  ~Trust() override { unsetenv("XDG_STATE_HOME"); }

  static void Fill(const std::string& path, const std::string& text) {
    fs::create_directories(fs::path(path).parent_path());
    std::ofstream(path) << text;
  }
  void Name(const std::string& footage) {
    Fill(root_ / "day1/mvstudio.toml",
         "schema = \"mvstudio.session/1\"\nunits = \"m\"\n[[cameras]]\nname = \"a\"\n[[takes]]\nname = \"walk\"\n"
         "[takes.footage]\na = \"" +
             footage + "\"\n");
  }
  void TrustIt() { TrustSession(root_ / "day1", FoldersOutside(ReadSession(root_ / "day1", true))); }
  /// Why the session may not read a path; empty when it may.
  std::string Refused(const std::string& session, const std::string& path) {
    const std::string said =
        mvstudio::testing::MessageOf<FormatError>([&] { ResolveInSession(ReadSession(root_ / session), path); });
    return said == "no exception" ? "" : said;
  }
  static std::string Text(const std::string& path) {
    std::ifstream in(path);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  mvstudio::testing::TempDir root_;
  std::string state_ = root_ / "state/mvstudio/trusted";
};

TEST_F(Trust, IsForTheFoldersThatTheSessionReads) {
  EXPECT_NE(Refused("day1", "raw/walk/a.mp4").find("mvstudio session trust " + (root_ / "day1")), std::string::npos);
  TrustIt();
  const std::string day1 = fs::canonical(root_ / "day1"), cards = fs::canonical(root_ / "cards");
  EXPECT_EQ(Text(state_), day1 + "\t" + cards + "\n");
  struct stat info {};
  ASSERT_EQ(stat(state_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 07777, 0600u);
  const Session session = ReadSession(root_ / "day1");
  EXPECT_EQ(ResolveInSession(session, "raw/walk/a.mp4"), root_ / "day1/raw/walk/a.mp4");
  EXPECT_NO_THROW(ResolveInSession(session, "raw/walk"));
  EXPECT_NO_THROW(ResolveInSession(session, root_ / "cards/walk/b.mp4"));
  EXPECT_NO_THROW(ResolveInSession(session, "../cards/walk/b.mp4"));
  for (const std::string& path : {root_ / "others/c.mp4", std::string("../others/c.mp4"), std::string("/etc/passwd")})
    EXPECT_NE(Refused("day1", path), "") << path;
  fs::create_symlink(root_ / "others/c.mp4", root_ / "cards/walk/c.mp4");
  EXPECT_NE(Refused("day1", "raw/walk/c.mp4"), "") << "a link out of the trusted folder";
  EXPECT_NE(Refused("day1", "raw/walk"), "");
}

TEST_F(Trust, IsForReadingAlone) {
  TrustIt();
  fs::create_directory_symlink(root_ / "cards", root_ / "day1/masks");
  EXPECT_THROW(TakeFolder(ReadSession(root_ / "day1"), "masks", "walk"), FormatError);
}

TEST_F(Trust, EndsWhenTheLinkLeadsElsewhere) {
  TrustIt();
  fs::remove(root_ / "day1/raw");
  fs::create_directories(root_ / "more/walk");
  Fill(root_ / "more/walk/a.mp4", "y");
  fs::create_directory_symlink(root_ / "more", root_ / "day1/raw");
  EXPECT_NE(Refused("day1", "raw/walk/a.mp4"), "");
  TrustIt();
  EXPECT_EQ(Refused("day1", "raw/walk/a.mp4"), "");
  EXPECT_EQ(Text(state_).find("cards"), std::string::npos) << "the line is replaced";
}

TEST_F(Trust, IsNotForCopiesAndMovedSessions) {
  TrustIt();
  fs::copy(root_ / "day1", root_ / "copy", fs::copy_options::recursive | fs::copy_options::copy_symlinks);
  EXPECT_NE(Refused("copy", "raw/walk/a.mp4"), "");
  fs::create_directory_symlink(root_ / "day1", root_ / "other name");
  EXPECT_EQ(Refused("other name", "raw/walk/a.mp4"), "") << "the same folder";
  fs::rename(root_ / "day1", root_ / "moved");
  EXPECT_NE(Refused("moved", "raw/walk/a.mp4"), "");
}

TEST_F(Trust, OfOneSessionLeavesTheOthers) {
  TrustIt();
  fs::create_directories(root_ / "day2");
  Fill(root_ / "day2/mvstudio.toml", "schema = \"mvstudio.session/1\"\nunits = \"m\"\n");
  TrustSession(root_ / "day2", {root_ / "others"});
  EXPECT_EQ(Refused("day1", "raw/walk/a.mp4"), "");
  EXPECT_EQ(Refused("day2", root_ / "others/c.mp4"), "");
  TrustSession(root_ / "day1", {});
  EXPECT_NE(Refused("day1", "raw/walk/a.mp4"), "");
  EXPECT_EQ(Refused("day2", root_ / "others/c.mp4"), "");
  EXPECT_THROW(TrustSession(root_ / "day1", {"/a\tb"}), UsageError);
}

TEST_F(Trust, FoldersOfFilesNamedOutside) {
  Name("../others/c.mp4");
  EXPECT_EQ(FoldersOutside(ReadSession(root_ / "day1", true)), std::vector<std::string>{fs::canonical(root_ / "others")});
  Name(root_ / "cards/walk/*.mp4");
  EXPECT_EQ(FoldersOutside(ReadSession(root_ / "day1", true)), std::vector<std::string>{fs::canonical(root_ / "cards/walk")});
}

TEST_F(Trust, AFileThatOthersMayWriteCountsForNothing) {
  TrustIt();
  const std::string ours = Text(state_);
  ASSERT_EQ(chmod(state_.c_str(), 0666), 0);
  EXPECT_NE(Refused("day1", "raw/walk/a.mp4"), "");
  ASSERT_EQ(ReadSession(root_ / "day1").warnings.size(), 1u);
  EXPECT_NE(ReadSession(root_ / "day1").warnings[0].find("is open for others to write"), std::string::npos);
  EXPECT_THROW(TrustIt(), UsageError);
  fs::rename(state_, root_ / "elsewhere");
  ASSERT_EQ(chmod((root_ / "elsewhere").c_str(), 0600), 0);
  fs::create_symlink(root_ / "elsewhere", state_);
  EXPECT_NE(Refused("day1", "raw/walk/a.mp4"), "") << "a link";
  EXPECT_THROW(TrustIt(), UsageError);
  EXPECT_EQ(Text(root_ / "elsewhere"), ours);
}

}  // namespace
}  // namespace mvstudio::dataset
