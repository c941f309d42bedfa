#include "core/disk/kept.h"

#include <cstdlib>

#include "core/disk/files.h"
#include "core/disk/kept_key.h"
#include "core/error.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(KeptResults, WhereTheyLie) {
  const TempDir folder;
  CachePlace place;
  for (const char* word : {"off", "auto", "/a/folder"}) {
    FromString(word, &place);
    EXPECT_EQ(ToString(place), word);
  }
  EXPECT_THROW(FromString("", &place), UsageError);
  EXPECT_EQ(KeptResults(place, "boards").folder(), "/a/folder/boards");
  EXPECT_FALSE(KeptResults({CachePlace::Kind::kOff, ""}, "boards").enabled());
  const char* chosen = std::getenv("MVSTUDIO_CACHE");
  const std::string before = chosen ? chosen : "";
  unsetenv("MVSTUDIO_CACHE");
  setenv("XDG_CACHE_HOME", folder.path().c_str(), 1);
  EXPECT_EQ(KeptResults(CachePlace(), "boards").folder(), folder / "mvstudio/boards");
  setenv("MVSTUDIO_CACHE", "off", 1);
  EXPECT_FALSE(KeptResults(CachePlace(), "boards").enabled());
  if (chosen) setenv("MVSTUDIO_CACHE", before.c_str(), 1);
}

TEST(KeptResults, DamagedOnesAreMissing) {
  const TempDir folder;
  const KeptResults kept(CacheIn(folder.path()), "things");
  EXPECT_FALSE(kept.Load("key"));
  for (const std::string text : {"", "some bytes"}) {
    kept.Store("key", text);
    EXPECT_EQ(kept.Load("key"), text);
    const std::string path = folder / "things/key.things", good = ReadFile(path);
    for (size_t i = 0; i < good.size(); ++i) {
      std::string bad = good;
      bad[i] ^= 1;
      WriteFileAtomic(path, bad);
      EXPECT_FALSE(kept.Load("key")) << i;
      WriteFileAtomic(path, good.substr(0, i));
      EXPECT_FALSE(kept.Load("key")) << i;
    }
  }
  WriteFileAtomic(folder / "file", "");
  KeptResults(CacheIn(folder / "file"), "things").Store("key", "text");  // no such folder can be made: no error
}

TEST(KeptReader, CountsAreHeldAgainstTheRest) {
  KeptWriter out;
  out.Put<int32_t>(-7);
  out.Put(std::string("two"));
  const double values[] = {1.0 / 3, -0.0};
  out.PutAll(values, 2);
  const std::string bytes = out.Take();
  KeptReader in(bytes);
  EXPECT_EQ(in.Get<int32_t>(), -7);
  EXPECT_EQ(in.Text(), "two");
  EXPECT_EQ(in.All<double>(), std::vector<double>(values, values + 2));
  EXPECT_TRUE(in.AtEnd());
  EXPECT_THROW(in.Get<char>(), DamagedBytes);
  KeptWriter huge;
  huge.Put<uint64_t>(~uint64_t{0} / 2);
  const std::string lie = huge.Take() + "few";
  EXPECT_THROW(KeptReader(lie).All<double>(), DamagedBytes);
  EXPECT_THROW(KeptReader(lie).Text(), DamagedBytes);
}

TEST(KeptKey, PartsDoNotRunTogether) {
  KeptKey one, two;
  one.Add("ab"), one.Add("c");
  two.Add("a"), two.Add("bc");
  EXPECT_NE(one.Take(), two.Take());
}

}  // namespace
}  // namespace mvstudio
