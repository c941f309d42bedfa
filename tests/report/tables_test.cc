#include <gtest/gtest.h>

#include "report/sections.h"
#include "tests/support/cpu_time.h"

namespace mvstudio::report {
namespace {

// A row a key would make a table of as many columns as rows.
TEST(ObjectsTable, HasAsManyColumnsAsAPageCanShow) {
  Value rows;
  for (int i = 0; i < 20000; ++i) rows.Append(Value().Set("k" + std::to_string(i), i));
  const double start = mvstudio::testing::CpuSeconds();
  const std::string html = ObjectsTable("rows", rows, {});
  EXPECT_NE(html.find("k0"), std::string::npos);
  EXPECT_LT(html.size(), 100u << 20);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20);
}

}  // namespace
}  // namespace mvstudio::report
