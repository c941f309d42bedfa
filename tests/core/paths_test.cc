#include "core/disk/paths.h"

#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

namespace fs = std::filesystem;
using Paths = std::vector<std::string>;

void Touch(const std::string& path) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path) << "x";
}

TEST(FilesIn, OrdinaryFilesSorted) {
  const TempDir folder;
  for (const char* name : {"b.png", "a.png", ".hidden", "sub/c.png"}) Touch(folder / name);
  ASSERT_EQ(mkfifo((folder / "pipe.png").c_str(), 0600), 0);
  fs::create_symlink(folder / "sub/c.png", folder / "link.png");
  fs::create_symlink(folder / "nowhere", folder / "broken.png");
  EXPECT_EQ(FilesIn(folder.path()), (Paths{folder / "a.png", folder / "b.png", folder / "link.png"}));
  EXPECT_TRUE(FilesIn(folder / "none").empty());
  EXPECT_TRUE(FilesIn(folder / "a.png").empty());
}

TEST(FilesIn, SaysWhenAFolderCannotBeListed) {
  if (geteuid() == 0) GTEST_SKIP() << "root may list everything";
  const TempDir folder;
  Touch(folder / "shut/a.png");
  fs::permissions(folder / "shut", fs::perms::none);
  EXPECT_THROW(FilesIn(folder / "shut"), IoError);
  fs::permissions(folder / "shut", fs::perms::owner_all);
}

TEST(FilesNamed, ByBothEnds) {
  const TempDir folder;
  for (const char* name : {"shard-0.h5", "shard-1.h5", "shard-.h", "x-shard-2.h5", ".shard-3.h5", "shard-h5/x"})
    Touch(folder / name);
  EXPECT_EQ(FilesNamed(folder.path(), "shard-", ".h5"), (Paths{folder / "shard-0.h5", folder / "shard-1.h5"}));
  EXPECT_EQ(FilesNamed(folder.path(), ".shard-", ""), (Paths{folder / ".shard-3.h5"}));
  EXPECT_TRUE(FilesNamed(folder.path(), "shard-0.h", "h5").empty()) << "begin and end do not overlap";
}

// The folder that a path names, whatever characters it has: a neighbour whose name fits as a pattern is another one.
TEST(FilesNamed, BracketsOfAFolderAreNoPattern) {
  const TempDir root;
  for (const std::string name : {"take[1]", "take?", "take*"}) {
    Touch(root / (name + "/right.json"));
  }
  Touch(root / "take1/wrong.json");
  for (const std::string name : {"take[1]", "take?", "take*"}) {
    const Paths right = {root / (name + "/right.json")};
    EXPECT_EQ(FilesNamed(root / name, "", ".json"), right);
    EXPECT_EQ(FilesIn(root / name), right);
    EXPECT_EQ(FilesMatching(root / name), right);
    EXPECT_EQ(FilesMatching(root / (name + "/*.json")), right);
    EXPECT_EQ(FilesMatching(root / (name + "/right.json")), right);
  }
}

TEST(FilesMatching, SortsAndFindsNothingQuietly) {
  const TempDir folder;
  for (const char* name : {"cam2/b.png", "cam1/b.png", "cam1/a.png", "cam1/a.txt", "other/a.png"}) Touch(folder / name);
  EXPECT_EQ(FilesMatching(folder / "cam?/*.png"), (Paths{folder / "cam1/a.png", folder / "cam1/b.png", folder / "cam2/b.png"}));
  EXPECT_TRUE(FilesMatching(folder / "*.jpg").empty());
  EXPECT_EQ(FilesMatching(folder / "cam1"), (Paths{folder / "cam1/a.png", folder / "cam1/a.txt", folder / "cam1/b.png"}));
  EXPECT_TRUE(FilesMatching(folder.path()).empty()) << "folders are not files";
  EXPECT_TRUE(FilesMatching(folder / "*").empty());
  EXPECT_EQ(FilesMatching(folder / "cam1/a.txt"), (Paths{folder / "cam1/a.txt"}));
  EXPECT_TRUE(FilesMatching("").empty());
  EXPECT_TRUE(FilesMatching(folder / "none/*.png").empty());
  EXPECT_TRUE(FilesMatching(folder / "cam1/a.txt/*").empty());
}

TEST(FilesMatching, WhatExistsIsTakenByItsName) {
  const TempDir folder;
  for (const char* name : {"a*.png", "ab.png", "d?/x.png", "de/x.png", "[ab].png"}) Touch(folder / name);
  EXPECT_EQ(FilesMatching(folder / "a*.png"), (Paths{folder / "a*.png"}));
  EXPECT_EQ(FilesMatching(folder / "d?/*.png"), (Paths{folder / "d?/x.png"}));
  EXPECT_EQ(FilesMatching(folder / "d*/x.png"), (Paths{folder / "d?/x.png", folder / "de/x.png"}));
  EXPECT_EQ(FilesMatching(folder / "[ab].png"), (Paths{folder / "[ab].png"}));
  EXPECT_EQ(FilesMatching(folder / "[ab].*"), (Paths{folder / "[ab].png"}));
  EXPECT_EQ(FilesMatching(folder / "[a]b.png"), (Paths{folder / "ab.png"})) << "a set where no name has the brackets";
  EXPECT_FALSE(IsPattern(folder / "a*.png"));
  EXPECT_TRUE(IsPattern(folder / "z*.png"));
  EXPECT_FALSE(IsPattern(folder / "[ab].png"));
}

TEST(FilesMatching, StarsCharactersAndHiddenNames) {
  const TempDir folder;
  for (const char* name : {"aXbXc", "abc", "ac", "é", ".a", "..b"}) Touch(folder / name);
  EXPECT_EQ(FilesMatching(folder / "a*b*c"), (Paths{folder / "aXbXc", folder / "abc"}));
  EXPECT_EQ(FilesMatching(folder / "a**c"), (Paths{folder / "aXbXc", folder / "abc", folder / "ac"}));
  EXPECT_EQ(FilesMatching(folder / "?"), (Paths{folder / "é"})) << "one character of two bytes";
  EXPECT_EQ(FilesMatching(folder / ".*"), (Paths{folder / "..b", folder / ".a"}));
  std::string hard, name(200, 'a');
  for (int i = 0; i < 60; ++i) hard += "*a";
  Touch(folder / name);
  EXPECT_TRUE(FilesMatching(folder / (hard + "*b")).empty());
  EXPECT_EQ(FilesMatching(folder / (hard + "*")), (Paths{folder / name}));
}

TEST(FilesMatching, SetsAndAlternatives) {
  const TempDir folder;
  for (const char* name : {"f1.png", "f2.png", "f12.png", "fa.png", "fé.png", "left.jpg", "right.jpg"}) Touch(folder / name);
  EXPECT_EQ(FilesMatching(folder / "f[0-9].png"), (Paths{folder / "f1.png", folder / "f2.png"}));
  EXPECT_EQ(FilesMatching(folder / "f[0-9]*.png"), (Paths{folder / "f1.png", folder / "f12.png", folder / "f2.png"}));
  EXPECT_EQ(FilesMatching(folder / "f[!0-9].png"), (Paths{folder / "fa.png", folder / "fé.png"}));
  EXPECT_EQ(FilesMatching(folder / "f[2a].png"), (Paths{folder / "f2.png", folder / "fa.png"}));
  EXPECT_EQ(FilesMatching(folder / "{left,right}.jpg"), (Paths{folder / "left.jpg", folder / "right.jpg"}));
  EXPECT_EQ(FilesMatching(folder / "*.{jpg,tif}"), (Paths{folder / "left.jpg", folder / "right.jpg"}));
  EXPECT_TRUE(IsPattern(folder / "f[0-9].png"));
  EXPECT_TRUE(IsPattern(folder / "{left,right}.jpg"));
  EXPECT_FALSE(IsPattern(folder / "f[0-9.png")) << "no closing bracket";
  EXPECT_FALSE(IsPattern(folder / "{left}.jpg"));
}

TEST(WildSpans, AreWhatTheWildcardsStandFor) {
  const TempDir folder;
  const auto texts = [&](const std::string& path, const std::string& pattern) {
    std::vector<std::string> found;
    for (const auto& [begin, end] : WildSpans(folder / path, folder / pattern))
      found.push_back((folder / path).substr(begin, end - begin));
    return found;
  };
  EXPECT_EQ(texts("both/07_0.jpg", "both/*_0.jpg"), (Paths{"07"}));
  EXPECT_EQ(texts("a/12/left.png", "a/*/left.png"), (Paths{"12"}));
  EXPECT_EQ(texts("a/12/img_3.png", "?/1[0-9]/*_?.png"), (Paths{"a", "2", "img", "3"}));
  EXPECT_EQ(texts("a_b_c.png", "*_*.png"), (Paths{"a", "b_c"}));
  EXPECT_EQ(texts("left5.jpg", "{left,right}5.jpg"), (Paths{"left"}));
  EXPECT_TRUE(texts("x[1]/a.png", "x[1]/a.png").empty());
}

TEST(RequireRegularFile, RefusesWhatWouldHang) {
  const TempDir folder;
  Touch(folder / "file");
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  fs::create_symlink(folder / "pipe", folder / "link");
  fs::create_symlink(folder / "loop", folder / "loop");
  fs::create_symlink(folder / "file", folder / "good");
  EXPECT_NO_THROW(RequireRegularFile(folder / "file"));
  EXPECT_NO_THROW(RequireRegularFile(folder / "good"));
  const auto said = [&](const std::string& path) { return MessageOf<IoError>([&] { RequireRegularFile(path); }); };
  EXPECT_EQ(said(folder / "pipe"), folder / "pipe: is a named pipe, a regular file was expected");
  EXPECT_NE(said(folder / "link").find("named pipe"), std::string::npos);
  EXPECT_EQ(said("/dev/zero"), "/dev/zero: is a device, a regular file was expected");
  EXPECT_NE(said(folder.path()).find("is a folder"), std::string::npos);
  EXPECT_NE(said(folder / "none").find("no such file"), std::string::npos);
  EXPECT_NE(said(folder / "loop").find("cannot open"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio
