#include "core/join.h"

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/test.h"

namespace mvstudio {
namespace {

struct Person {
  std::string name;
  std::string Greeting() const { return "hello " + name; }
};

TEST(Join, PutsTheTextBetween) {
  EXPECT_EQ(Join(std::vector<std::string>{}, ", "), "");
  EXPECT_EQ(Join(std::vector<std::string>{"a"}, ", "), "a");
  EXPECT_EQ(Join(std::vector<std::string>{"a", "b", "c"}, " or "), "a or b or c");
  EXPECT_EQ(Join(std::vector<std::string>{"", "b", ""}, ","), ",b,");
}

TEST(Join, TakesWhateverHoldsStrings) {
  constexpr std::string_view kViews[] = {"a", "b"};
  const char* const words[] = {"c", "d"};
  EXPECT_EQ(Join(kViews, "+"), "a+b");
  EXPECT_EQ(Join(words, ""), "cd");
}

TEST(Join, OfWhatIsMadeOfTheItems) {
  const std::vector<Person> people = {{"Ada"}, {"Bo"}};
  EXPECT_EQ(Join(people, ", ", &Person::name), "Ada, Bo");
  EXPECT_EQ(Join(people, "; ", &Person::Greeting), "hello Ada; hello Bo");
  const std::map<int, int> counts = {{1, 2}, {3, 4}};
  EXPECT_EQ(Join(counts, " ", [](const auto& count) { return std::to_string(count.second); }), "2 4");
}

}  // namespace
}  // namespace mvstudio
