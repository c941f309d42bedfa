#include "core/toml_depth.h"

#include <string>

#include "core/error.h"
#include "tests/support/test.h"

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

TEST(TomlBraceInList, IsFoundOutsideStringsAndComments) {
  EXPECT_EQ(TomlBraceInList("a = [0, }]"), 1u);
  EXPECT_EQ(TomlBraceInList("a = 1\nb = { c = [0,\n }, 1] }"), 3u);
  EXPECT_EQ(TomlBraceInList("a = [}"), 1u);
  EXPECT_EQ(TomlBraceInList("[[takes]]\na = [{ b = [1, 2] }, { c = 3 }]\n[x]\n"), 0u);
  EXPECT_EQ(TomlBraceInList("a = [\"}\", '}', # }\n 1]"), 0u);
  EXPECT_EQ(TomlBraceInList("a = }"), 0u);  // damaged, and seen by the parser
  EXPECT_EQ(TomlBraceInList(""), 0u);
}

TEST(RequireParsableToml, NamesTheLine) {
  EXPECT_NO_THROW(RequireParsableToml("a = [1, 2]", "a.toml"));
  try {
    RequireParsableToml("a = 1\nb = [1, }", "a.toml");
    FAIL() << "accepted";
  } catch (const FormatError& error) {
    EXPECT_STREQ(error.what(), "a.toml: line 2: a `}` where a list goes on; is its `]` missing?");
  }
  std::string deep;
  for (int i = 0; i < 100; ++i) deep += "a.";
  EXPECT_THROW(RequireParsableToml(deep + "a = 1", "a.toml"), FormatError);
}

}  // namespace
}  // namespace mvstudio
