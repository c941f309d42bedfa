#include "core/toml_depth.h"

#include <gtest/gtest.h>

#include <string>

namespace mvstudio {
namespace {

TEST(TomlKeyParts, CountsThePartsOfKeysAlone) {
  EXPECT_EQ(TomlKeyParts(""), 0u);
  EXPECT_EQ(TomlKeyParts("a = 1"), 1u);
  EXPECT_EQ(TomlKeyParts("[cameras.0.x]\na.b = 2"), 3u);
  EXPECT_EQ(TomlKeyParts("a = { b.c.d.e = 1 }"), 4u);
  EXPECT_EQ(TomlKeyParts("numbers = [1.5, 2.5, 3.5]"), 2u);
}

TEST(TomlKeyParts, TextsAndCommentsDoNotCount) {
  EXPECT_EQ(TomlKeyParts("a = \"../../../..\" # see b.c.d.e"), 1u);
  EXPECT_EQ(TomlKeyParts("a = '...'\nb = '''\n.....\n'''"), 1u);
  EXPECT_EQ(TomlKeyParts("a = \"\\\".....\""), 1u);
  EXPECT_EQ(TomlKeyParts("a = \"\"\"\n\\\"\"\".....\n\"\"\""), 1u);
}

TEST(TomlKeyParts, QuotedPartsCannotHideTheOthers) {
  EXPECT_EQ(TomlKeyParts(R"("="."="."#".'[' = 1)"), 4u);
  EXPECT_EQ(TomlKeyParts("\"\".a.b = 1"), 3u);
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "a . ";
  EXPECT_EQ(TomlKeyParts(deep + "a = 1"), 100001u);
}

}  // namespace
}  // namespace mvstudio
